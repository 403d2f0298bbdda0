"""`examples`: robots, recordings and notebooks to begin with."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError, PrupPinError
from ..recordings.writer import write_whole
from ..views.text import terminal
from ..views.text.terminal import make_table, print_table

__all__ = ["examples"]


def examples(
    copy: Annotated[Path | None, typer.Option("--copy", metavar="DIR", help="Put them into this folder.")] = None,
) -> None:
    """Examples to begin with: robot files with comments, recordings to diagnose, notebooks."""
    folder = examples_folder()
    files = sorted(path for path in folder.iterdir() if path.is_file())
    if copy is None:
        out = terminal.console()
        table = make_table(("file", "left"), ("what it is", "left"))
        for path in files:
            table.add_row(path.name, _about(path))
        print_table(out, table)
        out.print("\nTo try them: prup-pin examples --copy DIR")
        return
    target = copy.expanduser()
    if target.exists() and not target.is_dir():
        raise InputError(f"--copy: '{copy}' is not a folder")
    other = [path.name for path in files if _differs(path, target / path.name)]
    if other:
        raise InputError(
            f"--copy: '{copy}' has other files of these names: {', '.join(other)}. Nothing was copied; give another "
            "folder"
        )
    try:
        target.mkdir(parents=True, exist_ok=True)
        write_whole({target / path.name: (path.read_bytes().decode("utf-8"),) for path in files})
    except InputError as error:
        raise InputError(f"--copy: {error}; nothing was copied") from error
    except OSError as error:
        raise InputError(f"--copy: cannot write to '{copy}': {error.strerror}") from error
    typer.echo(f"{len(files)} files in {target}; EXAMPLES.md tells what they are")


def examples_folder() -> Path:
    """Return the folder of the examples: installed with the package, or that of a source checkout."""
    package = Path(__file__).resolve().parents[1]
    for folder in (package / "examples", package.parent / "examples"):
        if (folder / "bench.csv").is_file():
            return folder
    raise PrupPinError(f"the examples are missing beside {package}; reinstall prup_pin")


def _differs(path: Path, there: Path) -> bool:
    """Return True where another file would be replaced."""
    return there.exists() and (not there.is_file() or there.read_bytes() != path.read_bytes())


def _about(path: Path) -> str:
    """Return what a file is, in a few words: its first comment, or what stands in the table of EXAMPLES.md."""
    if path.suffix == ".urdf":
        comment = re.search(r"<!--\s*(.*?)-->", path.read_text(encoding="utf-8"), re.DOTALL)
        words = " ".join(comment[1].split()) if comment else "a robot file"
        return re.split(r"[:.](?=\s|$)", words)[0]
    if path.suffix == ".ipynb":
        first = "".join(json.loads(path.read_text(encoding="utf-8"))["cells"][0]["source"])
        return f"a notebook: {first.partition(chr(10))[0].lstrip('# ')}"
    if path.suffix == ".json" and not path.with_suffix(".csv").exists():
        return "a test plan"
    return {
        ".csv": "a recording",
        ".json": "about the recording of that name: robot, noise",
        ".md": "what all of these are, and their stories",
    }.get(path.suffix, "")
