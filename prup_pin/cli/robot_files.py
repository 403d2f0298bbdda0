"""The commands about robots and their files: `check`, `info`, `robots`, `kinds`, `laws`, `examples`."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from .. import __version__
from ..errors import InputError, SingularPoseError, UnknownNameError, UnreachablePoseError, limits_heard
from ..files import write_whole
from ..modules import KINDS
from ..robots import examples_folder, packaged_names
from ..views.report.as_json import dump, info_as_json
from ..views.text import terminal
from ..views.text.robot_files import (
    laws_named,
    print_check,
    print_info,
    print_kinds,
    print_laws,
    print_prospects,
    print_robots,
)
from . import progress
from .files import list_written, write
from .options import AsJson, ConventionOption, Reading, RobotName, RobotOption, TolerancesOption
from .recorded import note_foreign_joints, of_the_robot, recording_typed, robot_beside, tolerances_named


def info(
    robot: RobotName = "3prup", tolerances: TolerancesOption = None, as_json: AsJson = None, *, reading: Reading
) -> None:
    """Joints, loops, mobility, modules and parameters of a robot, with their tolerances."""
    with limits_heard():
        wanted = None if tolerances is None else tolerances_named(tolerances)
        loaded = reading.load(robot)
        document = dump(info_as_json(loaded, wanted, __version__)) if as_json is not None else ""
        if as_json == "-":
            typer.echo(document)
            return
        if as_json is not None:
            write(Path(as_json), document + "\n", "--json")
        print_info(terminal.console(), loaded, wanted)
    if as_json is not None:
        list_written([Path(as_json)])


def robots() -> None:
    """Robots that can be loaded by name."""
    print_robots(terminal.console())


def kinds(
    kind: Annotated[str | None, typer.Argument(metavar="[KIND]", help="One kind only.", show_default=False)] = None,
) -> None:
    """Kinds of compliant modules and their parameters."""
    chosen = [known for known in KINDS if kind in (None, known.kind)]
    if not chosen:
        raise UnknownNameError("kind of module", str(kind), [known.kind for known in KINDS])
    print_kinds(terminal.console(), chosen)


def laws(
    physics: Annotated[
        str | None,
        typer.Argument(
            metavar="[PHYSICS]", help="One law only, by its name or a word such as play.", show_default=False
        ),
    ] = None,
    robot: Annotated[str, typer.Option(metavar="ROBOT", help="The robot whose places are listed.")] = "3prup",
    *,
    reading: Reading,
) -> None:
    """Physics that a simulation can be given: places, parameters, sources."""
    if physics is not None and (Path(physics).suffix or physics in packaged_names()):
        raise InputError(f"'{physics}' is no law; the robot whose places are listed is given as --robot {physics}")
    loaded = reading.load(robot)
    print_laws(terminal.console(), laws_named(physics, loaded.mechanism), loaded)


# -- check -------------------------------------------------------------------------------------------------------------


def check(
    file: Annotated[
        str, typer.Argument(metavar="FILE", help="A robot file, a name of `prup-pin robots`, or a recording (.csv).")
    ],
    robot: RobotOption = None,
    convention: ConventionOption = None,
    *,
    reading: Reading,
) -> None:
    """All that is wrong or open in a robot file, or what a recording could show and what it could not.

    Ends with exit code 2 where a robot's loops do not close at home.
    """
    suffix = Path(file).suffix.lower()
    if suffix == ".json":
        raise InputError(f"'{file}' is no robot file; expected a URDF or MJCF file, or a name of `prup-pin robots`")
    if suffix in (".csv", ".tsv", ".txt", ".log", ".dat", ".xlsx", ".xls", ".ods"):
        _check_recording(Path(file), reading, robot, convention)
    elif robot is not None:
        raise InputError("--robot names the robot of a recording; expected a recording (.csv) before it")
    elif convention:
        raise InputError("--convention says how a recording is written; expected a recording (.csv) before it")
    else:
        _check_robot(file, reading)


def _check_robot(file: str, reading: Reading) -> None:
    with limits_heard():
        loaded = reading.load(file)
        print_check(terminal.console(), loaded)
        try:
            _ = loaded.home
        except SingularPoseError:
            pass  # other poses may be regular
        except UnreachablePoseError:
            raise typer.Exit(2) from None


def _check_recording(file: Path, reading: Reading, robot: str | None, conventions: Sequence[str] | None) -> None:
    from ..diagnosis.prospects import prospects

    recording = recording_typed(file, robot, conventions)
    loaded = reading.load(robot or robot_beside(recording.robot, file))
    note_foreign_joints([recording], loaded)
    if robot is not None:
        recording = of_the_robot(recording, robot, loaded)
    with progress.stages() as tell:
        tell("what the recording could show", 0.1)
        found = prospects(loaded, recording)
    print_prospects(terminal.console(), loaded, recording, found)


# -- examples ----------------------------------------------------------------------------------------------------------


def examples(
    copy: Annotated[Path | None, typer.Option("--copy", metavar="DIR", help="Put them into this folder.")] = None,
) -> None:
    """Examples to begin with: robot files with comments, recordings to diagnose, notebooks."""
    folder = examples_folder()
    files = sorted(path for path in folder.iterdir() if path.is_file())
    if copy is None:
        out = terminal.console()
        terminal.show_table(out, ("file", "what it is"), [(path.name, _about(path)) for path in files])
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
