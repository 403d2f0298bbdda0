"""Imports point one way, and importing the package stays light."""

import ast
import subprocess
import sys
from pathlib import Path

import prup_pin

ROOT = Path(prup_pin.__file__).parent
#: Lower layers know nothing of higher ones.
LAYERS = [
    "errors",
    "spatial",
    "parameters",
    "modules",
    "mechanism",
    "kinematics",
    "statics",
    "recordings",
    "loaded",
    "laws",
    "robots",
    "robot",
    "loading",
    "simulation",
    "diagnosis",
    "views",
    "cli",
]
LEAVES = {"views", "cli", "__main__"}


def layer(path):
    return path.relative_to(ROOT).parts[0].removesuffix(".py")


def imported_layers(path):
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
                yield name[1]


def test_imports_point_one_way():
    files = [path for path in ROOT.rglob("*.py") if path.name != "__init__.py" or path.parent != ROOT]
    assert len(files) > 30
    for path in files:
        own = layer(path)
        if own == "__main__":
            continue
        for other in imported_layers(path):
            if own in LEAVES and hasattr(prup_pin, other):
                continue  # a leaf uses the public names as any user does
            assert other in LAYERS, f"{path.name} imports {other}, which has no place among the layers"
            assert LAYERS.index(other) <= LAYERS.index(own), f"{path} imports {other}, a higher layer"
            if other in LEAVES:
                assert own in LEAVES, f"{path} imports {other}, a leaf"


def test_import_is_light():
    """Command line, plots and optimisers load only when used."""
    heavy = "typer rich matplotlib scipy meshcat yourdfpy jinja2"
    code = f"import sys, prup_pin; print([name for name in '{heavy}'.split() if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_public_names_exist():
    for name in prup_pin.__all__:
        assert getattr(prup_pin, name).__doc__
