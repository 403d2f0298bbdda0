"""Bodies and markers that cameras and trackers saw: which columns of a log are their places and orientations."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from .log import Stream
from .units import WISHED, dimension_of, without_unit, words_of

#: What stands last in the name of a column: an axis, and perhaps its unit or a number for a name that stands twice.
_AXIS = re.compile(
    r"^(?P<body>.*?)[\s._/:\-]*(?P<kind>(?<![A-Za-z])[tTpPqQrR])?(?P<axis>(?<![A-Za-z])[xyzwXYZW]|(?<=[tTpPqQrR])[xyzwXYZW])"
    r"(?:\s*[\[(]\s*[^\])]*[\])]|_(?:mm|m|cm|deg|rad))?(?P<twice> \(\d+\))?$"
)
#: Markers by number: x1 y1 z1, and how it is turned: phix1 phiy1 phiz1.
_NUMBERED = re.compile(r"(?P<kind>|phi|rot|r)[\s._]?(?P<axis>[xyz])[\s._]?(?P<number>\d+)", re.I)
_PLACE = ("p", "position", "translation", "pos", "marker", "smr", "tracker", "trans", "location")
#: Rotation vectors, in English, German, French, Spanish and Italian, as libraries call them, and a recording does.
_VECTOR = re.compile(
    r"(?:rot(?:ation)?s?|dreh)[\s._-]*ve[ck](?:t[oe]u?r)?|ve[ckt]t[a-z]*[\s._-]*(?:d[ei][\s._-]+)?rota[a-zó]*"
    r"|axis[\s._-]*angle|rodrigues|^r(?=\.[xyz]$)",
    re.I,
)
_TURNED = ("orientation", "quaternion", "quat", "rotation", "rot")
_NEITHER = ("velocity", "vel", "speed", "twist", "force", "torque", "moment", "acc", "accel", "acceleration", "gyro",
            "imu", "angular", "linear", "error", "cop", "wrench", "center", "centre")  # fmt: skip
#: Words that say what is measured, not of what.
_SAYING = (*_PLACE, *_TURNED, "pose", "point", "stamped", "transform", "tcp")


@dataclass
class Body:
    """A body or a marker: columns of its place by axis, and of its orientation with the manner in which they tell it.

    doubt: what is not sure of its orientation. askew: the angle between its axes and its frame's [rad], where known.
    """

    called: str
    stream: Stream
    place: dict[str, str] = field(default_factory=dict)
    turn: tuple[str, ...] = ()
    manner: str = ""
    unit: str | None = None
    doubt: str = ""
    askew: float | None = None


def numbered_places(stream: Stream) -> dict[str, dict[str, str]]:
    """Return the places of markers that have numbers for names, x1 y1 z1: number -> axis -> column, all three there."""
    found: dict[str, dict[str, str]] = {}
    for name in stream.columns:
        match = _NUMBERED.fullmatch(name)
        if match is not None and not match["kind"]:
            found.setdefault(match["number"], {})[match["axis"].lower()] = name
    return {number: place for number, place in found.items() if set(place) == set("xyz")}


def triples_of(stream: Stream) -> list[dict[str, str]]:
    """Return three columns at a time whose names differ in x, y and z alone: axis -> column; each column once."""
    found: dict[tuple[str, str], dict[str, str]] = {}
    for name in stream.columns:
        for place, letter in enumerate(name):
            if letter in "xyzXYZ":
                stem = f"{name[:place]}\0{name[place + 1 :]}", "x" if letter.islower() else "X"
                found.setdefault(stem, {})[letter.lower()] = name
    out: list[dict[str, str]] = []
    used: set[str] = set()
    for triple in found.values():
        if set(triple) == set("xyz") and not used & set(triple.values()):
            out.append({axis: triple[axis] for axis in "xyz"})
            used |= set(triple.values())
    return out


def bodies_of(stream: Stream, taken: set[str], frames: Sequence[str]) -> list[Body]:
    """Return the bodies of a stream in the order of their columns; those that are `taken` are something else."""
    told: dict[str, dict[str, dict[str, str]]] = {"place": {}, "letters": {}, "turn": {}, "vector": {}, "matrix": {}}
    numbered = numbered_places(stream)
    for name in stream.columns:
        part = None if name in taken else _part(stream, name, numbered, frames)
        if part is not None:
            what, called, axis = part
            told[what].setdefault(called, {})[axis] = name
    # no name says that letters are a place, but the orientation of a body of that name is told
    for called, axes in told.pop("letters").items():
        if set(axes) == set("xyz") and set(told["turn"].get(called, ())) == set("xyzw"):
            told["place"].setdefault(called, axes)
    spoken_for = {name for of in told.values() for axes in of.values() for name in axes.values()}
    for triple in triples_of(stream):  # what is left of three lengths whose names differ in x, y and z alone
        names = set(triple.values())
        lengths = all(dimension_of(stream.unit_of(name)) == "length" for name in names)
        if lengths and not names & (taken | spoken_for) and not any(map(_is_neither, names)):
            told["place"][_plain(_stem(triple))] = triple
    whole = {called: place for called, place in told["place"].items() if set(place) == set("xyz")}
    bodies = {called: Body(called, stream, {axis: place[axis] for axis in "xyz"}) for called, place in whole.items()}
    if not bodies:  # of a planar robot two may be all that was measured, where their units say what they are
        for called, place in told["place"].items():
            units = [dimension_of(stream.unit_of(name)) for name in place.values()]
            if len(place) == 2 and "w" not in place and set(units) == {"length"}:
                bodies[called] = Body(called, stream, {axis: place[axis] for axis in sorted(place)})
    for what in ("vector", "turn"):
        for called, axes in told[what].items():
            _turn(bodies.setdefault(called, Body(called, stream)), axes, what == "vector")
    for called, cells in told["matrix"].items():
        owner = bodies.get(_plain(called))
        if owner is not None and sorted(cells) == [*"012345678"]:
            owner.turn, owner.manner, owner.unit = tuple(cells[k] for k in "012345678"), "matrix_columns", None
            owner.doubt = "" if stream.labels.get("data_included") == "6D" else "column by column, or matrix_rows?"
    return [body for body in bodies.values() if body.place or body.turn]


def _part(
    stream: Stream, name: str, numbered: Mapping[str, object], frames: Sequence[str]
) -> tuple[str, str, str] | None:
    """Return what a column tells by its name (place, turn, vector, matrix), of which body, and of which axis or cell.

    letters: an axis and nothing that says of what, which is a place beside a quaternion of the same name.

    numbered: numbers of markers that have a place. None of a column that is neither.
    """
    marker = _NUMBERED.fullmatch(name)
    if marker is not None and marker["number"] in numbered:
        turned, axis = marker["kind"], marker["axis"].lower()
        return "turn" if turned else "place", marker["number"], f"r{axis}" if turned else axis
    if _is_neither(name):
        return None
    cell = re.fullmatch(r"(.*?)[.\s_/]*(?:rot|R|rotation|matrix)[\[_ ]*(\d)\]?", name, re.I)
    if cell is not None:
        return "matrix", cell[1], cell[2]
    vector = _VECTOR.search(name) is not None
    found = _AXIS.match(_VECTOR.sub("", name))
    if found is None:
        return None
    kind, axis = (found["kind"] or "").lower(), found["axis"].lower()
    dimension = dimension_of(stream.unit_of(name))
    spoken = set(words_of(found["body"]))
    body = f"{_plain(found['body'])}{found['twice'] or ''}"
    if vector:
        return "vector", body, f"r{axis}"
    if kind == "q" or (spoken & set(_TURNED) and not spoken & set(_PLACE)):
        return "turn", body, axis
    if kind == "r":
        return ("turn", body, f"r{axis}") if dimension == "angle" else None
    placed = kind == "t" or dimension == "length" or spoken & {*_PLACE, "tcp"} or frame_of(body, frames) or not body
    return ("place" if placed else "letters", body, axis) if axis != "w" and (placed or dimension is None) else None


def _is_neither(name: str) -> bool:
    """Return whether a column is no place and no orientation that was measured."""
    return bool({*words_of(name)} & {*_NEITHER, *WISHED})


def _turn(body: Body, axes: dict[str, str], is_vector: bool) -> None:
    """Give a body its orientation by columns, by axis: a quaternion, a rotation vector or Euler angles.

    is_vector: a rotation vector by its name, and no doubt about it.
    """
    if all(axis in axes for axis in "xyzw"):
        body.turn, body.manner = tuple(axes[axis] for axis in "xyzw"), "quaternion_xyzw"
    elif all(f"r{axis}" in axes for axis in "xyz"):
        body.turn, body.manner = tuple(axes[f"r{axis}"] for axis in "xyz"), "rotation_vector"
        body.doubt = "" if is_vector else "rotation vectors, or Euler angles such as euler_XYZ?"
    elif all(axis in axes for axis in "xyz"):
        order = body.stream.labels.get("rotation type", "XYZ").upper()
        body.turn, body.manner = tuple(axes[axis.lower()] for axis in order), f"euler_{order}"
        body.doubt = "Euler angles in this order, and about the body's own axes?"
    body.unit = body.stream.unit_of(body.turn[0]) or "" if body.turn else None
    if body.manner.startswith("euler"):
        body.unit = body.unit or "deg"


def _stem(triple: dict[str, str]) -> str:
    """Return what the names of three columns have in common, without their unit."""
    first, second = (without_unit(triple[axis]) for axis in "xy")
    return "".join(a for a, b in zip(first, second, strict=False) if a == b).strip(" ._-/:")


def frame_of(body: str, frames: Sequence[str]) -> str:
    """Return the frame that a body is called like: the same name, at the end of its own, or somewhere in it."""
    low = body.lower()
    same = [frame for frame in frames if frame.lower() == low]
    ending = [frame for frame in frames if re.search(rf"[:/._\s]{re.escape(frame.lower())}$", low)]
    inside = [frame for frame in frames if frame.lower() in low and len(frame) > 2]
    return max(same or ending or inside, key=len, default="")


def _plain(body: str) -> str:
    """Return the name of a body without words that say what was measured of it."""
    parts = [part for part in re.split(r"(?<=[^:])[./\s_]+|^[./\s_]+", body) if part]
    while len(parts) > 1 and parts[-1].lower() in _SAYING:
        parts.pop()
    kept = body[: body.rfind(parts[-1]) + len(parts[-1])] if parts else body
    return "" if kept.lower() in _SAYING else kept
