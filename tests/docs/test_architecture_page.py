"""The page on the architecture, and its picture, are of the code as it is."""

import ast
import importlib
import re
import sys

import pytest

from prup_pin.diagnosis import criteria

from ..imports import DOORS, LAYERS, room_imports
from .carried_out import ROOT

PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
_PLACE = re.compile(r"`((?:prup_pin|tests|scripts|docs)/[\w./]*)(?:: ([\w.]+))?`")
PLACES = sorted(set(_PLACE.findall(PAGE)))


def has(path, name):
    """Whether a file defines a name: a function, a class, a variable, or `Class.method`."""
    nodes = ast.parse(path.read_text(encoding="utf-8")).body
    for part in name.split("."):
        found = [node for node in nodes if part in defined(node)]
        if not found:
            return False
        nodes = getattr(found[0], "body", [])
    return True


def defined(node):
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        return {node.name}
    targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
    return {target.id for target in targets if isinstance(target, ast.Name)}


@pytest.mark.parametrize(("path", "name"), PLACES, ids=lambda value: value)
def test_what_the_page_names_is_there(path, name):
    assert (ROOT / path).exists()
    assert not name or has(ROOT / path, name)


def test_the_page_names_files_and_functions():
    assert sum(bool(name) for _, name in PLACES) > 40
    assert has(ROOT / "prup_pin/kernel/closure.py", "Closure.gaps")
    assert not has(ROOT / "prup_pin/kernel/closure.py", "Closure.gap")


def test_the_rooms_stand_in_the_order_of_their_layers():
    table = PAGE.partition("| room | holds |")[2].partition("\n\n")[0]
    assert re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE) == LAYERS


@pytest.fixture
def architecture(monkeypatch):
    """The script that draws the picture."""
    pytest.importorskip("matplotlib")
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    yield importlib.import_module("architecture")
    for name in ("architecture", "_project"):
        sys.modules.pop(name, None)


def test_the_picture_is_of_the_present_imports(architecture):
    assert architecture.check() == ""


def test_a_new_import_is_noticed(architecture, monkeypatch):
    rooms = room_imports()
    assert "modules" not in rooms["robots"]
    new = {**rooms, "robots": rooms["robots"] | {"modules"}}
    monkeypatch.setattr(architecture, "room_imports", lambda: new)
    told = architecture.check()
    assert "draw it again" in told
    assert "- robots: no arrow\n" in told
    assert told.endswith("+ robots: modules")


def test_what_the_picture_cannot_show_is_an_error(architecture):
    rooms = room_imports()
    with pytest.raises(ValueError, match="attic: no place in the picture"):
        architecture.picture({**rooms, "attic": set()})
    with pytest.raises(ValueError, match="not drawn below it"):
        architecture.picture({**rooms, "kernel": rooms["kernel"] | {"recordings"}})


def test_all_imports_follow_from_the_arrows(architecture):
    rooms = room_imports()
    drawn = architecture.arrows(rooms)

    def reached(room):
        return {other for start, end in drawn if start == room for other in {end, *reached(end)}}

    for room, others in rooms.items():
        apart = set(architecture.GROUND_ROOMS) | {other for start, other in DOORS if start == room}
        assert others - apart <= reached(room), room
    for room, other in drawn:
        rest = {end for start, end in drawn if start == room} - {other}
        assert not any(other in reached(end) for end in rest), f"{room} to {other} follows from others"


def test_numbers_that_decide_are_those_of_the_code():
    """`NAME` = 13, `NAME` = 1 %, `NAME` = 1/3, `NAME` = 1.5 times: as the page prints them."""
    told = re.findall(r"`([A-Z_]+)` = ([\d.]+)(?:/(\d+))?( %)?", PAGE)
    assert len({name for name, *_ in told}) > 15
    for name, value, over, percent in told:
        number = float(value) / float(over or 1) / (100 if percent else 1)
        assert number == pytest.approx(getattr(criteria, name), rel=2e-3), name
