"""How a log was written where it differs from the recording format: signs, units, orders, frames, ways of rotations.

A convention is a group of columns, a word and what the word takes: `wrench=reaction`, `tau.elbow=gain:0.083`,
`q=order:b,a`. Each is one invertible change of a recording, so that what is predicted can be written as the log is.
`WORDS` is all there are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import permutations, product
from typing import Any

import numpy as np

from ..errors import InputError, UnknownNameError
from ..numbers import number
from ..spatial import Array, cross, rotation_exp, rotation_log
from .columns import MARKER_GROUPS, TRIPLES
from .recording import Recording

#: Groups of columns that are written alike, in the order in which they are read: wrenches need the drawn tool's pose.
GROUPS = {
    "time": "the clock",
    "q": "positions of joints, with qd and qdd; q.<joint> of one",
    "tau": "efforts; tau.<joint> of one",
    "p": "positions of the tool and of all markers",
    "r": "orientations of the tool and of all markers",
    "g": "gravity",
    "wrench": "forces and moments",
    "force": "forces w.fx w.fy w.fz",
    "moment": "moments w.mx w.my w.mz",
}
_OF_JOINTS = {"q": ("positions", "velocities", "accelerations"), "tau": ("efforts",)}
_GRAVITY = 9.80665  # m/s^2, of a kilogram-force


@dataclass(frozen=True, eq=False)
class Drawn:
    """What a robot knows of a log: which joints slide, and the tool's placements (N, 4, 4) at a log's positions."""

    slides: frozenset[str] = frozenset()
    tool: Callable[[Recording], Array] | None = None


#: (values, what the word takes, the tool's placements as drawn (N, 4, 4), written rather than read) -> values; arrays
#: (N, 3) or (N, 6).
_Change = Callable[[Array, "Argument", Array, bool], Array]
Argument = tuple[float, ...] | tuple[str, ...]


@dataclass(frozen=True)
class Word:
    """One way to write some groups of columns.

    takes: what stands behind the word's colon: '', 'number', 'turns' (1, 2 or 3), 'point' (three numbers), 'axes',
    'joint' or 'joints'.
    factor: of written values, that makes SI of them; None where it is no mere factor. Of joints it is for those that
    `slide` (True), that turn (False), or for all (None).
    change: how (N, 3) or (N, 6) are read and written.
    """

    name: str
    groups: tuple[str, ...]
    summary: str
    takes: str = ""
    factor: float | None = None
    slide: bool | None = None
    change: _Change | None = None
    needs_tool: bool = False


# -- rotations -----------------------------------------------------------------------------------------------------


def _orientations(read: Callable[[Any, Array], Any], written: Callable[[Any], Array]) -> _Change:
    """Return the change of rows (N, 3) that tell orientations otherwise.

    read: makes turns of rows by scipy's `Rotation`, which is heavy to load; written: makes rows of turns.
    """

    def change(values: Array, _: Argument, tool: Array, back: bool) -> Array:
        from scipy.spatial.transform import Rotation

        if back:
            return _known(values, lambda rows: written(Rotation.from_rotvec(rows)))
        return _known(values, lambda rows: read(Rotation, rows).as_rotvec())

    return change


def _known(values: Array, change: Callable[[Array], Array]) -> Array:
    """Return a change of the rows (N, 3) that hold numbers."""
    rows = np.isfinite(values).all(axis=1)
    out = np.full_like(values, np.nan)
    if rows.any():
        out[rows] = change(values[rows])
    return out


def _euler(order: str, by_axis: bool, unit: float) -> _Change:
    """Return the change of angles in an order of axes (upper case: each about the turned axes)."""
    places = ["xyz".index(axis) for axis in order.lower()] if by_axis else [0, 1, 2]
    return _orientations(
        lambda turns, rows: turns.from_euler(order, unit * rows[:, places]),
        lambda turned: turned.as_euler(order, suppress_warnings=True)[:, np.argsort(places)] / unit,
    )


def _with_scalar(vectors: Array) -> Array:
    """Return unit quaternions x y z w of their vector parts (N, 3)."""
    return np.column_stack((vectors, np.sqrt(np.maximum(1 - (vectors**2).sum(axis=1), 0.0))))


_VECTOR_PART = _orientations(
    lambda turns, rows: turns.from_quat(_with_scalar(rows)), lambda turned: turned.as_quat(canonical=True)[:, :3]
)


def _rolled(places: int) -> _Change:
    """Return the change of quaternions whose numbers were taken in another order."""
    return _orientations(
        lambda turns, rows: turns.from_quat(np.roll(turns.from_rotvec(rows).as_quat(), places, axis=1)),
        lambda turned: type(turned).from_quat(np.roll(turned.as_quat(), -places, axis=1)).as_rotvec(),
    )


# -- axes, points, wrenches ----------------------------------------------------------------------------------------


def _axes(argument: Argument) -> Array:
    """Return S (3, 3) with written = S true, of texts such as 'y', '-x', 'z'."""
    turn = np.zeros((3, 3))
    for row, text in enumerate(argument):
        assert isinstance(text, str)
        turn[row, "xyz".index(text[-1])] = -1.0 if text[0] == "-" else 1.0
    return turn


def _vectors_in_axes(values: Array, argument: Argument, tool: Array, back: bool) -> Array:
    """Return vectors (N, 3), or wrenches (N, 6), in base axes; moments of mirrored axes count the other way round."""
    turn = _axes(argument)
    turn = turn.T if back else turn
    moments = float(np.linalg.det(turn)) * values[:, 3:]
    # each column is another one, or its opposite: one that was not measured leaves the others alone
    of = np.argmax(np.abs(turn), axis=0)
    signs = turn[of, np.arange(3)]
    return np.concatenate([half[:, of] * signs for half in (values[:, :3], moments) if half.shape[1]], axis=1)


def _turns_in_axes(values: Array, argument: Argument, tool: Array, back: bool) -> Array:
    turn = _axes(argument)
    return float(np.linalg.det(turn)) * (values @ (turn.T if back else turn))


def _in_base_axes(values: Array, argument: Argument, tool: Array, back: bool) -> Array:
    turn = _axes(argument) if back else _axes(argument).T
    return _known(values, lambda rows: rotation_log(turn @ rotation_exp(rows)))


def _of_tool_axes(values: Array, argument: Argument, tool: Array, back: bool) -> Array:
    turn = _axes(argument).T if back else _axes(argument)
    return _known(values, lambda rows: rotation_log(rotation_exp(rows) @ turn))


def _in_tool_axes(values: Array, _: Argument, tool: Array, back: bool) -> Array:
    turn = tool[:, :3, :3].mT if back else tool[:, :3, :3]
    return np.concatenate([(turn @ half[..., None])[..., 0] for half in (values[:, :3], values[:, 3:])], axis=1)


def _about(values: Array, lever: Array, back: bool) -> Array:
    """Return wrenches whose moments are about another point, from which a lever (3,) or (N, 3) reaches."""
    moved = cross(lever, values[:, :3])
    return np.concatenate((values[:, :3], values[:, 3:] + (-moved if back else moved)), axis=1)


def _about_point(values: Array, argument: Argument, tool: Array, back: bool) -> Array:
    return _about(values, tool[:, :3, :3] @ np.array(argument, float), back)


def _about_origin(values: Array, _: Argument, tool: Array, back: bool) -> Array:
    return _about(values, -tool[:, :3, 3], back)


# -- the table -----------------------------------------------------------------------------------------------------

_EULER = tuple(
    Word(
        f"{kind}_{name}{'_deg' * in_degrees}",
        ("r",),
        f"angles {'about x, y, z, turned ' if kind == 'angles' else ''}in the order {name} "
        f"({'turned' if name.isupper() else 'fixed'} axes), {'deg' if in_degrees else 'rad'}",
        change=_euler(name, kind == "angles", np.pi / 180 if in_degrees else 1.0),
    )
    for in_degrees in (False, True)
    for kind, name in (
        *(("euler", "".join(order)) for axes in ("xyz", "XYZ") for order in permutations(axes)),
        *(("euler", f"{a}{b}{a}") for axes in ("xyz", "XYZ") for a, b, _ in permutations(axes)),
        *(("angles", name) for name in ("XZY", "YXZ", "YZX", "ZXY")),
    )
)
#: The word of columns that are as this format has them, whatever they look like.
AS_WRITTEN = "as_written"
#: Every way to write a group of columns.
WORDS: tuple[Word, ...] = (
    Word(AS_WRITTEN, tuple(GROUPS), "as they say, and in no other way", factor=1.0),
    Word("reversed", ("q", "tau", "p", "wrench", "force", "moment", "g"), "with the opposite sign", factor=-1.0),
    Word("reaction", ("wrench",), "what the robot exerts, not what acts on it", factor=-1.0),
    Word("ms", ("time",), "in milliseconds", factor=1e-3),
    Word("us", ("time",), "in microseconds", factor=1e-6),
    Word("ns", ("time",), "in nanoseconds", factor=1e-9),
    Word("deg", ("q", "r"), "in degrees", factor=np.pi / 180, slide=False),
    Word("revolutions", ("q",), "in revolutions", factor=2 * np.pi, slide=False),
    Word("mm", ("q", "p"), "in millimetres", factor=1e-3, slide=True),
    Word("cm", ("q", "p"), "in centimetres", factor=1e-2, slide=True),
    Word("um", ("q", "p"), "in micrometres", factor=1e-6, slide=True),
    Word("inch", ("q", "p"), "in inches", factor=0.0254, slide=True),
    Word("N_mm", ("tau", "moment"), "in N mm", factor=1e-3, slide=False),
    Word("N_cm", ("tau", "moment"), "in N cm", factor=1e-2, slide=False),
    Word("kN_m", ("tau", "moment"), "in kN m", factor=1e3, slide=False),
    Word("kgf_m", ("tau", "moment"), "in kgf m", factor=_GRAVITY, slide=False),
    Word("kgf_cm", ("tau", "moment"), "in kgf cm", factor=_GRAVITY / 100, slide=False),
    Word("kN", ("tau", "force"), "in kN", factor=1e3, slide=True),
    Word("mN", ("tau", "force"), "in mN", factor=1e-3, slide=True),
    Word("kgf", ("tau", "force"), "in kgf", factor=_GRAVITY, slide=True),
    Word("daN", ("tau", "force"), "in daN", factor=10.0, slide=True),
    Word("lbf", ("tau", "force"), "in pounds-force", factor=4.4482216152605, slide=True),
    Word("lbf_in", ("tau", "moment"), "in pound-force inches", factor=0.1129848290276167, slide=False),
    Word("multiples_of_g", ("g",), "in multiples of g", factor=_GRAVITY),
    Word("gain", ("tau",), "so many times the effort: A, per cent of a rating", "number"),
    Word("gear", ("q", "tau"), "of the motor, which makes so many turns for one of the joint", "number"),
    Word("plus", ("q", "tau"), "with that of another joint added to it", "joint"),
    Word("minus", ("q", "tau"), "with that of another joint taken from it", "joint"),
    Word("order", ("q", "tau"), "columns, as they stand in the table, of these joints", "joints"),
    Word("quarter_turns", ("q",), "counted from so many quarter turns elsewhere", "turns"),
    Word("wrapped", ("q",), "with whole turns taken off, between -pi and pi"),
    Word("axes", ("p", "wrench", "g"), "along these axes of the base", "axes", change=_vectors_in_axes),
    Word("axes", ("r",), "of axes renamed so, the base's and the platform's", "axes", change=_turns_in_axes),
    Word("base_axes", ("r",), "in these axes of the base", "axes", change=_in_base_axes),
    Word("tool_axes", ("r",), "of these axes of the tool", "axes", change=_of_tool_axes),
    Word("inverse", ("r",), "the base's, seen from the tool", factor=-1.0),
    Word("quaternion", ("r",), "the vector part of a unit quaternion", change=_VECTOR_PART),
    Word("wxyz_as_xyzw", ("r",), "of a quaternion w x y z that was taken for x y z w", change=_rolled(-1)),
    Word("xyzw_as_wxyz", ("r",), "of a quaternion x y z w that was taken for w x y z", change=_rolled(1)),
    *_EULER,
    Word("tool_frame", ("wrench",), "in the tool's axes, not the base's", change=_in_tool_axes, needs_tool=True),
    Word(
        "about", ("wrench",), "moments about this point (tool's axes, from the tool point) [m]", "point",
        change=_about_point, needs_tool=True,
    ),
    Word("about_base", ("wrench",), "moments about the base's origin", change=_about_origin, needs_tool=True),
)  # fmt: skip
_BY_NAME = {(group, word.name): word for word in WORDS for group in word.groups}


@dataclass(frozen=True)
class Convention:
    """How some columns are written: `columns` a key of GROUPS, or q.<joint> or tau.<joint>; a word, what it takes."""

    columns: str
    word: str
    argument: Argument = ()

    @property
    def group(self) -> str:
        """The group that the columns belong to."""
        return self.columns.partition(".")[0]

    @property
    def joint(self) -> str:
        """The one joint whose columns these are, or ''."""
        return self.columns.partition(".")[2]

    @property
    def meaning(self) -> Word:
        """The word's entry in the table."""
        return _BY_NAME[self.group, self.word]

    @property
    def said(self) -> str:
        """The word with what it takes, as it is declared."""
        told = ",".join(item if isinstance(item, str) else number(item, 6) for item in self.argument)
        return f"{self.word}:{told}" if told else self.word

    def __str__(self) -> str:
        return f"{self.columns}={self.said}"


def convention_of(columns: str, said: str, joints: Mapping[str, Sequence[str]]) -> Convention:
    """Return the convention that is declared as `said` of some columns; joints: by q and tau, those with such a column.

    Raises UnknownNameError or InputError for what the table does not have.
    """
    group, dot, joint = columns.partition(".")
    if group not in GROUPS or (dot and group not in _OF_JOINTS):
        raise UnknownNameError("group of columns", columns, [*GROUPS, *(f"{g}.{j}" for g in joints for j in joints[g])])
    own = list(joints.get(group, ()))
    if dot and joint not in own:
        raise UnknownNameError("group of columns", columns, [group, *(f"{group}.{name}" for name in own)])
    name, colon, text = said.strip().partition(":")
    word = _BY_NAME.get((group, name))
    if word is None:
        raise UnknownNameError(f"convention of {columns}", name, [known for of, known in _BY_NAME if of == group])
    if (word.name == "order" and dot) or (word.name in ("plus", "minus", "wrapped") and not dot):
        raise InputError(f"{columns}={said}: expected {'all of ' + group if dot else group + '.<joint>, one joint'}")
    return Convention(columns, name, _argument(word, colon, text, f"{columns}={said}", own))


def _argument(word: Word, colon: str, text: str, said: str, joints: Sequence[str]) -> Argument:
    parts = [part.strip() for part in text.split(",")] if text.strip() else []
    if not word.takes:
        if colon:
            raise InputError(f"{said}: '{word.name}' takes nothing behind a colon")
        return ()
    if word.takes == "turns":
        if parts not in (["1"], ["2"], ["3"]):
            raise InputError(f"{said}: '{word.name}' takes 1, 2 or 3, by which written angles are more than drawn ones")
        return (float(parts[0]),)
    if word.takes in ("number", "point"):
        try:
            values = tuple(float(part) for part in parts)
        except ValueError:
            values = ()
        count = 1 if word.takes == "number" else 3
        if len(values) != count or not np.isfinite(values).all() or (count == 1 and not values[0] > 0):
            what = "one number above 0" if count == 1 else "three numbers x,y,z [m]"
            example = "gain:0.083" if count == 1 else "about:0,0,0.12"
            raise InputError(f"{said}: '{word.name}' takes {what}, for example {example}")
        return values
    if word.takes == "axes":
        if len(parts) != 3 or sorted(part.lstrip("+-") for part in parts) != ["x", "y", "z"]:
            raise InputError(f"{said}: '{word.name}' takes the base's axes that x, y, z stand for, for example y,-x,z")
        axes = tuple(part.lstrip("+") for part in parts)
        if word.name != "axes" and np.linalg.det(_axes(axes)) < 0:
            raise InputError(f"{said}: these axes are mirrored, and no orientation can be written in them")
        return axes
    for part in parts:
        if part not in joints:
            raise UnknownNameError("joint with a column", part, joints)
    if word.takes == "joint" and len(parts) != 1:
        raise InputError(
            f"{said}: '{word.name}' takes one joint, for example {word.name}:{next(iter(joints), 'joint')}"
        )
    if word.takes == "joints" and len(set(parts)) < max(len(parts), 2):
        raise InputError(f"{said}: expected the joints of all columns, each once, in the order of the table")
    return tuple(parts)


def declared_as_written(conventions: Sequence[Convention]) -> tuple[Convention, ...]:
    """Return those of them that say of columns that they are as they say."""
    return tuple(item for item in conventions if item.word == AS_WRITTEN)


def may_be_read(recording: Recording, reading: Sequence[Convention]) -> bool:
    """Return whether a log does not declare of any column that a reading changes that it is as it says."""
    declared = declared_as_written(recording.conventions)
    return not any(item.word == AS_WRITTEN or any(_alike(item, own) for own in declared) for item in reading)


def _alike(one: Convention, other: Convention) -> bool:
    """Return whether two conventions are of the same columns, or of some."""
    if one.group in _OF_JOINTS:
        return one.group == other.group and (not one.joint or not other.joint or one.joint == other.joint)
    return bool(_halves(one) & _halves(other))


def _halves(convention: Convention) -> set[str]:
    """Return the columns of a group, of wrenches by forces and moments; another point leaves forces as they are."""
    if convention.group != "wrench":
        return {convention.group}
    return {"moment"} if convention.word in ("about", "about_base") else {"force", "moment"}


def as_json(conventions: Sequence[Convention]) -> dict[str, str | list[str]]:
    """Return what declares conventions in the JSON beside a log, under its key `conventions`."""
    found: dict[str, list[str]] = {}
    for convention in conventions:
        found.setdefault(convention.columns, []).append(convention.said)
    return {columns: said[0] if len(said) == 1 else said for columns, said in found.items()}


# -- reading and writing -------------------------------------------------------------------------------------------


def read_as(recording: Recording, conventions: Sequence[Convention], drawn: Drawn) -> Recording:
    """Return a recording in the format's own convention of one that is written in others, read one after the other.

    Positions of joints come before what depends on the drawn tool. Raises InputError where a tool is needed and there
    is none.
    """
    for convention in _sorted(conventions):
        recording = _changed(recording, convention, drawn, back=False)
    return recording


def written_as(recording: Recording, conventions: Sequence[Convention], drawn: Drawn) -> Recording:
    """Return a recording as a log in these conventions writes it: the inverse of `read_as`."""
    for convention in reversed(_sorted(conventions)):
        recording = _changed(recording, convention, drawn, back=True)
    return recording


def _sorted(conventions: Sequence[Convention]) -> list[Convention]:
    order = list(GROUPS)
    last = {"force": "wrench", "moment": "wrench"}
    return sorted(conventions, key=lambda item: order.index(last.get(item.group, item.group)))


def _changed(recording: Recording, convention: Convention, drawn: Drawn, back: bool) -> Recording:
    group, word = convention.group, convention.meaning
    if group in _OF_JOINTS:
        changes: dict[str, Any] = {
            field: _of_joints(getattr(recording, field), field, convention, recording, drawn, back)
            for field in _OF_JOINTS[group]
        }
        return replace(recording, **changes)
    factor = None if word.factor is None else 1 / word.factor if back else word.factor
    if group == "time":
        assert factor is not None
        return replace(recording, time=recording.time * factor)
    tool = np.zeros((0, 4, 4))
    if word.needs_tool:
        if drawn.tool is None:
            raise InputError(f"{convention}: a wrench can be read so only where the robot has a tool: --tool FRAME")
        tool = drawn.tool(recording)

    def change(values: Array) -> Array:
        if factor is not None:
            return values * factor
        assert word.change is not None
        return word.change(values, convention.argument, tool, back)

    if group in TRIPLES:
        value = getattr(recording, TRIPLES[group])
        changed: dict[str, Any] = {} if value is None else {TRIPLES[group]: change(value)}
        if marked := MARKER_GROUPS.get(group):
            changed[marked] = {name: change(values) for name, values in getattr(recording, marked).items()}
        return replace(recording, **changed)
    part = {"force": slice(0, 3), "moment": slice(3, 6)}.get(group, slice(0, 6))
    wrench = recording.wrench.copy()
    wrench[:, part] = change(wrench[:, part])
    return replace(recording, wrench=wrench)


def _of_joints(
    columns: Mapping[str, Array], field: str, convention: Convention, recording: Recording, drawn: Drawn, back: bool
) -> dict[str, Array]:
    """Return the columns of joints read, or with `back` written, by a convention."""
    word, argument, out = convention.meaning, convention.argument, dict(columns)
    if word.takes == "joints":
        joints = [str(name) for name in argument]
        table = list(joints_of(recording)[convention.group])
        if sorted(joints) != sorted(table):
            raise InputError(f"{convention}: expected each of {', '.join(table)} once, as the log has columns")
        here, there = (joints, table) if back else (table, joints)
        moved = {to: columns[of] for of, to in zip(here, there, strict=True) if of in columns}
        return {name: moved[name] for name in columns if name in moved} | {
            name: values for name, values in columns.items() if name not in here
        }
    names = [convention.joint] if convention.joint else list(columns)
    for name in names:
        if name not in columns:
            continue
        slides = name in drawn.slides
        if word.factor is not None:
            if word.slide is None or word.slide == slides:
                out[name] = columns[name] * (1 / word.factor if back else word.factor)
        elif word.takes == "turns":
            if field == "positions" and not slides:
                out[name] = columns[name] + float(argument[0]) * (1 if back else -1) * np.pi / 2
        elif word.takes == "number":
            size = float(argument[0])
            larger = word.name == "gain" or convention.group == "q"
            out[name] = columns[name] * (size if larger == back else 1 / size)
        elif word.takes == "joint":
            sign = (1.0 if word.name == "plus" else -1.0) * (1.0 if back else -1.0)
            if argument[0] in columns:
                out[name] = columns[name] + sign * columns[str(argument[0])]
        elif field == "positions":  # wrapped
            whole = columns[name] + np.pi
            out[name] = whole % (2 * np.pi) - np.pi if back else _unwrapped(columns[name], recording.run)
    return out


def joints_of(recording: Recording) -> dict[str, tuple[str, ...]]:
    """Return the joints that have a column q, and those that have a column tau, in the order of the table."""
    return {group: tuple(getattr(recording, fields[0])) for group, fields in _OF_JOINTS.items()}


def _unwrapped(values: Array, run: np.ndarray) -> Array:
    """Return positions (N,) without jumps of whole turns within a run; what is not measured stays so."""
    out = values.copy()
    for label in np.unique(run):
        rows = np.flatnonzero((run == label) & np.isfinite(values))
        out[rows] = np.unwrap(values[rows])
    return out


# -- which conventions are tried, and what speaks for them -------------------------------------------------------------

#: Axes that x, y, z of a log may stand for, but for themselves.
AXES = [
    tuple(f"{'-' if sign < 0 else ''}{axis}" for axis, sign in zip(order, signs, strict=True))
    for order in permutations("xyz")
    for signs in product((1, -1), repeat=3)
][1:]
#: Ratios of gears that are tried [turns of the motor for one of the joint].
GEARS = tuple(map(float, (*range(2, 201), 224, 240, 250, 256, 300, 320, 360, 400, 500)))
#: Words for units of joints' positions.
POSITION_UNITS = tuple(
    word
    for word in WORDS
    if "q" in word.groups and word.factor is not None and word.name not in ("reversed", AS_WRITTEN)
)


@dataclass(frozen=True)
class Evidence:
    """Conventions, and what speaks for them: what the drawing leaves of `what` [unit] as written, and as read.

    written: None where the robot cannot be where the log has it.
    unit '' is a share. held: the share of the squares, of what was held out where that can be, that reading so takes
    away. others: conventions that would do as well.
    """

    conventions: tuple[Convention, ...]
    what: str
    unit: str
    written: float | None
    read: float
    held: float
    others: tuple[tuple[Convention, ...], ...] = ()


def is_right_handed(axes: Sequence[str]) -> bool:
    """Return whether axes such as 'y', '-x', 'z' are right-handed."""
    return bool(np.linalg.det(_axes(tuple(axes))) > 0)


def merged(conventions: Sequence[Convention], q: Sequence[str], tau: Sequence[str]) -> tuple[Convention, ...]:
    """Return the same conventions, with several of the same columns made one where they are orders, or say which way
    and from where a joint counts; the joints with columns q, tau."""
    tables = {"q": q, "tau": tau}
    out: dict[object, list[Convention]] = {}
    for convention in conventions:
        kind = "order" if convention.word == "order" else "way" if convention.word in _WAYS else convention
        out.setdefault((convention.columns, kind), []).append(convention)
    found: list[Convention] = []
    for each in out.values():
        columns, table = each[0].columns, tables.get(each[0].group, ())
        if len(each) == 1:
            found += each
        elif each[0].word == "order":
            order = tuple(map(str, each[0].argument))
            for item in each[1:]:  # the columns are read by the first, then by this one
                step = dict(zip(table, map(str, item.argument), strict=True))
                order = tuple(step[name] for name in order)
            found.append(Convention(columns, "order", order))
        else:
            found += _one_way(each)
    return tuple(item for item in found if item.word != "order" or item.argument != tuple(tables[item.columns]))


#: Words for which way a joint counts, and from where.
_WAYS = ("reversed", "quarter_turns")


def _one_way(several: Sequence[Convention]) -> list[Convention]:
    """Return which way one joint counts, and from where, of such conventions one after the other."""
    sign, turns = 1, 0.0
    for item in several:
        if item.word == "reversed":
            sign, turns = -sign, -turns
        else:
            turns += float(item.argument[0])
    columns = several[0].columns
    out = [Convention(columns, "reversed")] if sign < 0 else []
    return [*out, Convention(columns, "quarter_turns", (turns % 4,))] if turns % 4 else out
