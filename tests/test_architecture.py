"""Imports point one way, and importing the package stays light."""

import ast
import inspect
import subprocess
import sys
from pathlib import Path

import prup_pin
from prup_pin.views.meshcat.view import view

ROOT = Path(prup_pin.__file__).parent
#: Lower layers know nothing of higher ones.
LAYERS = [
    "errors",
    "spatial",
    "parameters",
    "modules",
    "mechanism",
    "kernel",
    "kinematics",
    "statics",
    "recordings",
    "loaded",
    "laws",
    "robots",
    "robot",
    "loading",
    "simulation",
    "channels",
    "diagnosis",
    "views",
    "cli",
]
LEAVES = {"views", "cli", "__main__"}
#: Wings of `views`: each knows those before it; the two that draw do not know each other.
WINGS = ["text", "scene", "drawing", "meshcat", "report"]
APART = {"drawing", "meshcat"}
#: The one door from a robot to its picture: `Robot.view` loads the view when it is asked for one, and not before.
DOOR = ("robot", "views")


def layer(path):
    return path.relative_to(ROOT).parts[0].removesuffix(".py")


def imported(path):
    """Yield the dotted name of each module of the package that a file imports, as a tuple without the package."""
    package = ("prup_pin", *path.relative_to(ROOT).parent.parts)
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else ()
            full = (*base, *(node.module or "").split("."))
            names = [full] if node.module else [(*base, alias.name) for alias in node.names]
        elif isinstance(node, ast.Import):
            names = [tuple(alias.name.split(".")) for alias in node.names]
        else:
            continue
        for name in names:
            if name[0] == "prup_pin" and len(name) > 1 and name[1] and not name[1].startswith("_"):
                yield name[1:]


def test_imports_point_one_way():
    files = [path for path in ROOT.rglob("*.py") if path.name != "__init__.py" or path.parent != ROOT]
    assert len(files) > 30
    for path in files:
        own = layer(path)
        if own == "__main__":
            continue
        for other in {name[0] for name in imported(path)}:
            if own in LEAVES and hasattr(prup_pin, other):
                continue  # a leaf uses the public names as any user does
            if (own, other) == DOOR:
                continue
            assert other in LAYERS, f"{path.name} imports {other}, which has no place among the layers"
            assert LAYERS.index(other) <= LAYERS.index(own), f"{path} imports {other}, a higher layer"
            if other in LEAVES:
                assert own in LEAVES, f"{path} imports {other}, a leaf"


def test_a_robot_is_loaded_without_its_picture():
    code = "import sys, prup_pin; print([name for name in sys.modules if name.startswith('prup_pin.views')])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_robot_has_the_arguments_of_its_view():
    def arguments(function):
        return [str(parameter) for parameter in inspect.signature(function).parameters.values()][1:]

    assert arguments(prup_pin.Robot.view) == arguments(view)


def test_wings_of_the_views_are_no_circle():
    files = [path for wing in WINGS for path in (ROOT / "views" / wing).rglob("*.py")]
    assert {path.parent.name for path in (ROOT / "views").glob("*/*.py")} == set(WINGS)
    for path in files:
        own = path.relative_to(ROOT).parts[1]
        for other in {name[1] for name in imported(path) if name[0] == "views" and len(name) > 1}:
            assert WINGS.index(other) <= WINGS.index(own), f"{path} imports {other}, a later wing"
            assert other == own or {own, other} != APART, f"{path} imports {other}, which it should not know"


def test_import_is_light():
    """Command line, plots and optimisers load only when used."""
    heavy = "typer rich matplotlib scipy meshcat yourdfpy jinja2"
    code = f"import sys, prup_pin; print([name for name in '{heavy}'.split() if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_public_names_exist():
    for name in prup_pin.__all__:
        assert getattr(prup_pin, name).__doc__
