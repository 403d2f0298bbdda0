"""Imports point one way, and importing the package stays light."""

import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest

import prup_pin
from prup_pin.compensation import compensate
from prup_pin.views.meshcat.view import view

from .imports import DOORS, LAYERS, ROOT, files, imported, public_names, room_imports, room_of

LEAVES = {"views", "cli"}
#: Wings of `views`: each knows those before it; the two that draw do not know each other.
WINGS = ["text", "scene", "drawing", "meshcat", "report"]
APART = {"drawing", "meshcat"}


def test_imports_point_one_way():
    for room, others in room_imports().items():
        assert room in LAYERS, f"{room} has no place among the layers"
        for other in others:
            if (room, other) in DOORS:
                continue
            assert LAYERS.index(other) < LAYERS.index(room), f"{room} imports {other}, a higher layer"
            if other in LEAVES:
                assert room in LEAVES, f"{room} imports {other}, a leaf"


def test_only_leaves_use_the_public_names():
    """The package's own file imports the rooms: a room that asked it for a name would close a circle."""
    for path in files():
        if room_of(path) not in LEAVES:
            assert not {name[0] for name in imported(path)} & set(public_names()), path


def test_imports_are_read_from_the_source():
    assert len(files()) > 100
    assert "laws" in room_imports()["diagnosis"]  # from ..laws import ...
    assert "loading" in room_imports()["cli"]  # from .. import load
    assert ("laws", "deeds") in imported(ROOT / "channels" / "pose.py")


@pytest.fixture(scope="module")
def loaded():
    """The modules that Python has loaded after importing the package, and after importing its diagnosis too."""
    code = "import sys, prup_pin; prup_pin.load; print(*sys.modules); import prup_pin.diagnosis; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return [set(line.split()) for line in done.stdout.splitlines()]


def test_a_robot_is_loaded_without_what_is_behind_its_doors(loaded):
    loaded = {name.split(".")[1] for name in loaded[0] if name.startswith("prup_pin.")}
    assert "robot" in loaded
    assert not loaded & {room for _, room in DOORS}


def test_stiffness_does_not_wait_for_what_other_commands_need():
    code = "import sys, prup_pin.cli.application as line; sys.argv[1:] = ['stiffness', '3prup', '--json', '-']\n"
    code += "try: line.main()\nexcept SystemExit as end: print(*sys.modules, file=sys.stderr); sys.exit(end.code)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = {name.split(".")[1] for name in done.stderr.split() if name.startswith("prup_pin.")}
    assert "statics" in loaded
    assert not loaded & {"diagnosis", "imports", "laws", "recordings", "dynamics", "loaded", "sweep", "design"}
    assert "scipy" not in done.stderr.split()


def test_a_robot_has_the_arguments_of_its_view():
    def arguments(function):
        return [str(parameter) for parameter in inspect.signature(function).parameters.values()][1:]

    assert arguments(prup_pin.Robot.view) == arguments(view)


def test_a_robot_has_the_arguments_of_its_compensation():
    def arguments(function):
        return [str(parameter) for parameter in inspect.signature(function).parameters.values()][1:]

    assert arguments(prup_pin.Robot.compensate) == [text for text in arguments(compensate) if "tell" not in text]


def test_wings_of_the_views_are_no_circle():
    assert {path.parent.name for path in (ROOT / "views").glob("*/*.py")} == set(WINGS)
    for path in (ROOT / "views").rglob("*/*.py"):
        own = path.relative_to(ROOT).parts[1]
        for other in {name[1] for name in imported(path) if name[0] == "views" and len(name) > 1}:
            assert WINGS.index(other) <= WINGS.index(own), f"{path} imports {other}, a later wing"
            assert other == own or {own, other} != APART, f"{path} imports {other}, which it should not know"


def test_import_is_light(loaded):
    """Command line, plots and optimisers load only when used; of scipy a diagnosis needs no statistics."""
    package, diagnosis = loaded
    assert not package & {"typer", "rich", "matplotlib", "scipy", "meshcat", "yourdfpy", "jinja2"}
    assert "scipy.optimize" in diagnosis
    assert not diagnosis & {"scipy.stats", "scipy.signal", "matplotlib", "typer", "rich"}


def test_public_names_exist():
    for name in prup_pin.__all__:
        assert getattr(prup_pin, name).__doc__


def test_nothing_names_a_place_outside_the_project():
    """Whoever clones it has no such folder: what lies elsewhere is named by environment variables."""
    outside = re.compile(r"(?<![\w./])/(?:work|root|home|Users)/|\.\./" + "shared|[\"']" + "shared[\"'/]")
    assert all(outside.search(text) for text in ("open('/root/a.csv')", "see ../" + "shared/a", "/ 'sha" + "red' /"))
    whole = ROOT.parent
    folders = [
        path for path in whole.iterdir() if path.name in {"prup_pin", "tests", "docs", "scripts", "examples", ".ci"}
    ]
    written = [
        path for folder in folders for path in folder.rglob("*") if path.suffix in {".py", ".md", ".sh", ".ipynb", ""}
    ]
    texts = {path: path.read_text(encoding="utf-8") for path in (*written, *whole.glob("*.md")) if path.is_file()}
    assert len(texts) > 500
    assert [path for path, text in texts.items() if outside.search(text) and path != Path(__file__)] == []
