"""Which room of the package imports which, read from its source: nothing is run.

A room is a folder of the package or a module beside them. What a room takes from the package itself (`from .. import
load`) counts as taken from the room where that name is made.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import prup_pin

ROOT = Path(prup_pin.__file__).parent
#: Lower layers know nothing of higher ones.
LAYERS = [
    "errors",
    "files",
    "plugins",
    "numbers",
    "spatial",
    "parameters",
    "modules",
    "mechanism",
    "kernel",
    "kinematics",
    "statics",
    "recordings",
    "imports",
    "dynamics",
    "loaded",
    "laws",
    "sensitivity",
    "sweep",
    "design",
    "workspace",
    "robots",
    "robot",
    "review",
    "build",
    "loading",
    "simulation",
    "export",
    "compensation",
    "channels",
    "diagnosis",
    "testing",
    "life",
    "views",
    "cli",
]
#: Doors from an object to how it is shown: `Robot.view`, and what a notebook asks of a robot, a compliance, a
#: diagnosis; and from a robot to what is built on it, `Robot.compensate`. These rooms are loaded when one of them is
#: called, and not before.
DOORS = {("robot", "views"), ("statics", "views"), ("diagnosis", "views"), ("robot", "compensation")}


def room_of(path: Path) -> str:
    """Return the room in which a file of the package stands."""
    return path.relative_to(ROOT).parts[0].removesuffix(".py")


def files() -> list[Path]:
    """Return the files of all rooms; what starts the command line is none, nor what gathers the public names."""
    return [path for path in sorted(ROOT.rglob("*.py")) if path.parent != ROOT or not path.name.startswith("_")]


@cache
def imported(path: Path) -> tuple[tuple[str, ...], ...]:
    """Return the dotted name of each module of the package that a file imports, as a tuple without the package."""
    return tuple(_imported(path))


def _statements(tree: ast.AST) -> Iterator[ast.AST]:
    """Yield all statements, those within others too; expressions, in which nothing is imported, are most of a tree."""
    waiting = [tree]
    while waiting:
        node = waiting.pop()
        yield node
        for block in ("body", "orelse", "finalbody", "handlers", "cases"):
            waiting += getattr(node, block, ())


def _imported(path: Path) -> Iterator[tuple[str, ...]]:
    package = ("prup_pin", *path.relative_to(ROOT).parent.parts)
    for node in _statements(ast.parse(path.read_text(encoding="utf-8"))):
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


def public_names() -> dict[str, str]:
    """Return the rooms in which the package's public names are made."""
    tree = ast.parse((ROOT / "_public.py").read_text(encoding="utf-8"))
    found = [node for node in tree.body if isinstance(node, ast.ImportFrom) and node.module]
    return {alias.asname or alias.name: str(node.module).split(".")[0] for node in found for alias in node.names}


def room_imports() -> dict[str, set[str]]:
    """Return what each room imports of the others."""
    made_in = public_names()
    rooms: dict[str, set[str]] = {room_of(path): set() for path in files()}
    for path in files():
        own = room_of(path)
        names = {name[0] for name in imported(path)}
        rooms[own] |= {name if name in rooms else made_in[name] for name in names} - {own}
    return rooms


def needed(rooms: dict[str, set[str]]) -> set[tuple[str, str]]:
    """Return the fewest pairs (room, imported room) from which all others follow; imports must be no circle."""
    below: dict[str, set[str]] = {}

    def all_below(room: str) -> set[str]:
        if room not in below:
            below[room] = rooms[room].union(*(all_below(other) for other in rooms[room]))
        return below[room]

    return {
        (room, other)
        for room, others in rooms.items()
        for other in others
        if not any(other in all_below(third) for third in others - {other})
    }
