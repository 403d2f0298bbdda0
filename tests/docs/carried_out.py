"""A page of the documentation, carried out in a copy of the tree: files written, lines put in, scripts run.

A comment before a block says what it is: `<!-- file: PATH -->`, `<!-- line: PATH, after: TEXT -->` (in PATH, after the
line that begins with TEXT, or after the last line of its paragraph's table), `<!-- run -->`.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
#: What a copy of the tree needs.
PARTS = ("prup_pin", "urdf", "examples", "tests", "docs", "pyproject.toml")
BLOCK = re.compile(r"^<!-- (?P<what>.*?) -->\n```\w*\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL)


def carry_out(page: str, folder: Path) -> list[str]:
    """Do what a page says in `folder`, in a copy of the tree or of what other pages left, and return what its scripts
    printed."""
    for part in PARTS if not (folder / PARTS[0]).exists() else ():
        source = ROOT / part
        if source.is_dir():
            # what is compiled there already is compiled here: Python compares with the source's date, which is kept
            shutil.copytree(source, folder / part, ignore=shutil.ignore_patterns("*.png"))
        else:
            shutil.copy(source, folder / part)
    printed = []
    for block in BLOCK.finditer((ROOT / page).read_text(encoding="utf-8")):
        what, text = block["what"], block["text"]
        if what == "run":
            printed.append(python(folder, "-c", text))
        elif what.startswith("file: "):
            path = folder / what.removeprefix("file: ")
            assert not path.exists(), f"{path} is there already"
            path.write_text(text, encoding="utf-8")
        elif what.startswith("line: "):
            name, _, after = what.removeprefix("line: ").partition(", after: ")
            _insert(folder / name, after, text)
        else:
            raise AssertionError(f"{page}: what is '{what}'?")
    assert printed, f"{page} runs nothing"
    return printed


def _insert(path: Path, after: str, text: str) -> None:
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    places = [index for index, line in enumerate(lines) if line.startswith(after)]
    assert len(places) == 1, f"{path}: {len(places)} lines begin with {after!r}"
    lines.insert(places[0] + 1, text)
    path.write_text("".join(lines), encoding="utf-8")


def python(folder: Path, *arguments: str) -> str:
    """Run Python in a copied tree, its own package first; return what it printed."""
    environment = {**os.environ, "PYTHONPATH": str(folder), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, *arguments], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    return done.stdout
