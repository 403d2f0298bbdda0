"""Which columns may be those of joints that no name led to: those that are left, in a unit that such joints have."""

from __future__ import annotations

from collections.abc import Set

from .columns import OF_THE_TOOL
from .draft import Guessing, Line
from .log import Log
from .map import JOINT_DIMENSIONS, NamedRobot, driven
from .units import WISHED, dimension_of, without_unit, words_of


def add_by_unit(log: Log, taken: set[str], mechanism: NamedRobot, found: Guessing) -> None:
    """Add, with a doubt, the columns of driven joints that have none yet.

    Where as many columns are left in a unit of length as joints that slide are without a position, they are these
    joints'; where the numbers differ the joints are told as open. A joint without any position stands at home.
    """
    slides = {joint.name: joint.slides for joint in mechanism.joints}
    placed = {line.target for line in found.lines}
    joints = [joint for joint in driven(mechanism) if f"q.{joint}" not in placed]
    for sliding in (False, True):
        alike = [joint for joint in joints if slides[joint] is sliding]
        places = _in(log, taken, JOINT_DIMENSIONS["q"][sliding])
        if alike and places and len(places) != len(alike):
            found.open |= dict.fromkeys(alike, tuple(places))
        if not places or len(places) != len(alike):
            continue
        doubt = "by its unit" + ", in the order of the robot's joints" * (len(alike) > 1) + ": is it this joint's?"
        for kind, dimensions in JOINT_DIMENSIONS.items():
            open_ = [joint for joint in alike if f"{kind}.{joint}" not in placed]
            columns = _in(log, taken, dimensions[sliding])
            if len(columns) == len(open_):
                pairs = zip(open_, columns.items(), strict=True)
                found.lines += [Line(f"{kind}.{joint}", name, unit, doubt=doubt) for joint, (name, unit) in pairs]
    placed = {line.target for line in found.lines}
    found.open |= {joint: () for joint in joints if f"q.{joint}" not in placed and joint not in found.open}


def _in(log: Log, taken: set[str], dimension: str) -> dict[str, str]:
    """Return the columns that nothing has taken yet, and that are in a unit of some dimension, with that unit.

    Left out are the tool's, and what is called as an axis beside others: x and y of a camera, A, B and C.
    """
    found = {}
    for stream in log.streams:
        called = {without_unit(name).lower() for name in stream.columns}
        for name in stream.columns:
            unit = stream.unit_of(name)
            if name in taken or {*words_of(name)} & {*WISHED, *OF_THE_TOOL} or _has_siblings(name, called):
                continue
            if unit is not None and dimension_of(unit) == dimension:
                found[name] = unit
    return found


def _has_siblings(name: str, called: Set[str]) -> bool:
    """Return whether another column is called like this one, but for x, y, z or a, b, c at its end.

    called: names of all of them, in small letters and without units.
    """
    plain = without_unit(name).lower()
    axes = next((axes for axes in ("xyz", "abc") if plain and plain[-1] in axes), "")
    alike = {plain[:-1] + axis for axis in axes} - {plain}
    return not alike.isdisjoint(called)
