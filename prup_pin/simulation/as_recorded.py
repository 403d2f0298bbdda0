"""The robot as a recording sees it: where loads act if nobody says so, and what stands still while others move."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import InputError, close_names
from ..laws import Inputs
from ..loading import Reading
from ..mechanism import Joint, Mechanism
from ..numbers import number, some
from ..recordings import Drawn, Recording, read_as
from ..recordings.conventions import declared_as_written
from ..robot import Robot
from ..spatial import Array, rotation_exp, turn_between
from .simulator import Simulator

#: Joints that a sentence lists by name.
_MOST_LISTED = 8

#: Farther than this from the drawing [m, rad] nothing is deflected.
_DEFLECTED = 0.05
#: How alike (difflib) a column's name and a joint's are, and their words one by one, where one is the other misspelt.
#: It is more than a name needs to be suggested: joints of another device share words such as "joint" with the robot's.
_MISSPELT = 0.85
_MISSPELT_WORD = 0.75


@dataclass(frozen=True)
class AsRecorded:
    """A robot adapted to recordings: the tool that it was given, joints that are held, and sentences that tell it.

    recordings: those that were given, read as their conventions say. unknown_on_the_way: whether a joint is held, for
    want of its column, that carries what was measured.
    """

    robot: Robot
    recordings: tuple[Recording, ...]
    tool: str | None = None
    held: Mapping[str, float] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    unknown_on_the_way: bool = False

    def read(self, reading: Reading) -> Reading:
        """Return how the robot's file is read so that this robot comes out, from how it was read before."""
        return replace(reading, tool=self.tool or reading.tool, held={**reading.held, **self.held})


def as_recorded(robot: Robot, recordings: Recording | Sequence[Recording]) -> AsRecorded:
    """Return a robot as recordings of it ask for, itself where they ask for nothing.

    A tree without a tool has the first marker's frame for one, or the end of its one chain where poses of a tool were
    measured. A joint of a tree whose position was not recorded is held where the robot file has it: off the way from
    the base to what was measured it makes no difference but for the weight of what it carries. A base that floats
    stands still.

    Raises InputError for a column whose joint is misspelt: it would be left out, and its joint held instead.
    """
    given = in_format(robot, recordings)
    for recording in given:
        _check_spelling(recording, robot.mechanism)
        _check_robot(recording, robot.mechanism)
    remarks: list[str] = []
    markers = list(dict.fromkeys(name for recording in given for name in recording.marker_names))
    frames = [name for name in markers if name in robot.mechanism.frame_names]
    tool = None
    if robot.mechanism.tool is None and frames and not any(_needs_tool(recording) for recording in given):
        # a joint that follows no one knows how carries no load, and behind it no tool may sit
        tool = next((name for name in frames if not _is_loose(robot.mechanism, name)), frames[0])
        robot = robot.with_tool(tool)
        remarks.append(f"no tool frame was given: taken at '{tool}', a marker (--tool FRAME says another one)")
    elif robot.mechanism.tool is None and robot.mechanism.only_end and any(map(_needs_tool, given)):
        tool = robot.mechanism.only_end
        robot = robot.with_tool(tool)
        remarks.append(
            f"no tool frame was given: taken at '{tool}', where the robot ends (--tool FRAME says another one)"
        )
    held = _held(robot.mechanism, given, frames)
    remarks += _told(robot.mechanism, held, given)
    unknown = {name for name in held if name in robot.mechanism.actuated}
    on_the_way = bool(unknown & set(_on_the_way(robot.mechanism, given, frames)))
    return AsRecorded(robot.with_held_joints(held), tuple(given), tool, held, tuple(remarks), on_the_way)


def in_format(robot: Robot, recordings: Recording | Sequence[Recording]) -> list[Recording]:
    """Return recordings in the format's own conventions, read as the conventions say that they declare.

    What they declare to be as it says they go on declaring.
    Raises InputError where one needs what the robot or the recording lacks.
    """
    given = [recordings] if isinstance(recordings, Recording) else list(recordings)
    return [
        replace(read_as(item, item.conventions, drawn_for(robot)), conventions=declared_as_written(item.conventions))
        if item.conventions
        else item
        for item in given
    ]


def drawn_for(robot: Robot) -> Drawn:
    """Return what the robot knows of its logs: joints that slide, and where its tool is drawn; NaN where nowhere.

    Where the log tells how the tool moves beside that, as under load, it is moved so.
    """

    def tool(recording: Recording) -> Array:
        adapted = as_recorded(robot, replace(recording, conventions=()))
        actuators = adapted.recordings[0].actuator_positions(adapted.robot.mechanism.actuated)
        nothing = np.zeros((len(recording), 6))
        inputs = Inputs(recording.time, actuators, nothing, np.arange(len(recording)))
        geometry = Simulator(adapted.robot, inputs).geometry({})
        out = np.full((len(recording), 4, 4), np.nan)
        if geometry.poses:
            each = np.array([pose.base_from_tool for pose in geometry.poses])
            out[geometry.reachable] = each[geometry.rows[geometry.reachable]]
        return _deflected(out, recording)

    slides = frozenset(joint.name for joint in robot.mechanism.joints if joint.slides)
    return Drawn(slides, None if robot.mechanism.tool is None else tool)


def _deflected(drawn: Array, recording: Recording) -> Array:
    """Return placements (N, 4, 4) moved as a log's poses are beside them, but for what they all have in common."""
    out = drawn.copy()
    if recording.position is not None:
        out[:, :3, 3] += _beside(recording.position - drawn[:, :3, 3])
    if recording.rotation is not None:
        turned = turn_between(drawn[:, :3, :3], rotation_exp(recording.rotation))
        out[:, :3, :3] = rotation_exp(_beside(turned)) @ drawn[:, :3, :3]
    return out


def _beside(apart: Array) -> Array:
    """Return differences (N, 3) [m, rad] less their middle; zero where they are no deflections, or unknown."""
    known = np.isfinite(apart).all(axis=1)
    if not known.any():
        return np.zeros_like(apart)
    apart = apart - np.median(apart[known], axis=0)
    known &= np.linalg.norm(np.nan_to_num(apart), axis=1) < _DEFLECTED
    return np.where(known[:, None], apart, 0.0)


def _check_spelling(recording: Recording, mechanism: Mechanism) -> None:
    """Raise InputError where columns name no joints of the robot, but nearly ones that lack these columns."""
    if misspelt := misspelt_joints(recording, mechanism):
        raise InputError("\n".join(text for _, text in misspelt))


def misspelt_joints(recording: Recording, mechanism: Mechanism) -> list[tuple[str, str]]:
    """Return names of columns that nearly are those of joints which lack these columns, and what to do, in words."""
    misspelt = []
    joints = [joint.name for joint in mechanism.joints]
    known = {*joints, *mechanism.description.held, *mechanism.frame_names}
    for prefix, columns in (
        ("q", recording.positions),
        ("qd", recording.velocities),
        ("qdd", recording.accelerations),
        ("tau", recording.efforts),
    ):
        lacking = {name.lower(): name for name in joints if name not in columns}
        foreign = [name for name in columns if name not in known]
        driven = [name.lower() for name in mechanism.actuated if name not in columns]
        for name in foreign:
            close = difflib.get_close_matches(name.lower(), list(lacking), cutoff=_MISSPELT)
            close = [match for match in close if _misspelt(name.lower(), match)]
            # one column too many and one too few, alike but for a number or for letters
            if len(foreign) == len(driven) == 1 and (
                re.sub(r"\d", "", name.lower()) == re.sub(r"\d", "", driven[0])
                or (re.findall(r"\d", name) == re.findall(r"\d", driven[0]) and close_names(name, driven))
            ):
                close = driven
            if close:
                text = f"no joint '{name}' (column {prefix}.{name}); did you mean {lacking[close[0]]}? Name the column "
                misspelt.append((name, f"{text}{prefix}.{lacking[close[0]]}, or leave it out"))
    return misspelt


def foreign_joints(recording: Recording, mechanism: Mechanism) -> list[str]:
    """Return names of joints that a recording has positions or efforts of, and the robot has not."""
    known = {*(joint.name for joint in mechanism.joints), *mechanism.description.held}
    return [name for name in dict.fromkeys((*recording.positions, *recording.efforts)) if name not in known]


def _check_robot(recording: Recording, mechanism: Mechanism) -> None:
    """Raise InputError where a recording has joints, and none of them is the robot's."""
    columns = [*(f"q.{name}" for name in recording.positions), *(f"tau.{name}" for name in recording.efforts)]
    if columns and len(foreign_joints(recording, mechanism)) == len({*recording.positions, *recording.efforts}):
        own = ", ".join(some([f"q.{name}" for name in mechanism.actuated], _MOST_LISTED))
        there = ", ".join(some(columns, _MOST_LISTED))
        raise InputError(
            f"{recording.path or 'the recording'} is of another robot: it has {there}; "
            f"expected joints of '{mechanism.name}', {own}. Name its robot (--robot), or its columns by this one's "
            "joints; prup-pin import makes them of other names"
        )


def _misspelt(name: str, joint: str) -> bool:
    """Return False for names that are alike and still of two joints: joint_6 and joint_7, left_hip and right_hip."""
    if re.findall(r"\d", name) != re.findall(r"\d", joint):
        return False
    words, others = name.split("_"), joint.split("_")
    if len(words) != len(others):
        return "".join(words) == "".join(others)
    pairs = zip(words, others, strict=True)
    return all(difflib.SequenceMatcher(None, *pair).ratio() >= _MISSPELT_WORD for pair in pairs)


def _is_loose(mechanism: Mechanism, frame: str) -> bool:
    """Return True for a frame behind a joint that follows another one no one knows how."""
    at = mechanism.frame(frame).joint
    return any(mechanism.support[mechanism.joint_id(item.joint), at] for item in mechanism.loose)


def _needs_tool(recording: Recording) -> bool:
    return recording.has_wrench or recording.position is not None or recording.rotation is not None


def _held(mechanism: Mechanism, recordings: Sequence[Recording], markers: Sequence[str]) -> dict[str, float]:
    """Return the joints of a tree that stand still while its recorded joints move, and where."""
    recorded = {name for recording in recordings for name in recording.positions}
    known = [joint for joint in mechanism.joints if joint.name in recorded]
    if mechanism.loops or not known or not all(set(recording.positions) & recorded for recording in recordings):
        return {}
    everywhere = {name for name in recorded if all(name in recording.positions for recording in recordings)}
    moving = set(_on_the_way(mechanism, recordings, markers))
    home = mechanism.home_configuration()
    found = {}
    for joint in mechanism.joints:
        if joint.nv > 1:
            if joint.name not in moving or _is_base(joint, mechanism):
                found[joint.name] = 0.0
            continue
        unknown = joint.name in mechanism.actuated and joint.name not in everywhere
        if unknown and (joint.name not in moving or joint.name in mechanism.description.home):
            found[joint.name] = float(joint.position(home))
    return found


def _on_the_way(mechanism: Mechanism, recordings: Sequence[Recording], markers: Sequence[str]) -> Iterator[str]:
    """Yield the joints whose positions what was measured depends on."""
    ends = [mechanism.frame(name).joint for name in markers]
    if mechanism.tool is not None and (not markers or any(_needs_tool(recording) for recording in recordings)):
        ends.append(mechanism.tool.joint)
    efforts = {name for recording in recordings for name in recording.efforts}
    ends += [joint.id for joint in mechanism.joints if joint.name in efforts]
    for joint in mechanism.joints:
        if any(mechanism.support[joint.id, end] for end in ends):
            yield joint.name


def _is_base(joint: Joint, mechanism: Mechanism) -> bool:
    return int(mechanism.model.parents[joint.id]) == 0


def unnamed_positions(recording: Recording, mechanism: Mechanism) -> tuple[list[str], list[str]]:
    """Return columns of positions that are of no joint, and driven joints without one, where these are as many.

    They may be the same by another name; else nothing.
    """
    known = {*(joint.name for joint in mechanism.joints), *mechanism.description.held, *mechanism.locked}
    foreign = [f"q.{name}" for name in recording.positions if name not in known]
    lacking = [f"q.{name}" for name in mechanism.actuated if name not in recording.positions]
    return (foreign, lacking) if len(foreign) == len(lacking) else ([], [])


def _told(mechanism: Mechanism, held: Mapping[str, float], recordings: Sequence[Recording]) -> Iterator[str]:
    floating = [name for name in held if mechanism.joint(name).nv > 1 and _is_base(mechanism.joint(name), mechanism)]
    if floating:
        yield (
            f"the base of the robot file floats (joint '{floating[0]}'): it is taken to stand still, in the axes in "
            "which poses were measured. Where these are others, declare the tolerances frame_position, frame_rotation"
        )
    still = [name for name in held if name not in floating]
    if still:
        listed = ", ".join(still[:_MOST_LISTED]) + (", …" if len(still) > _MOST_LISTED else "")
        away = [f"{name} = {number(held[name], 4)}" for name in still if not np.isclose(held[name], 0.0)]
        where = f" ({', '.join(away[:_MOST_LISTED])}; the others at 0)" if away else ", at 0"
        joints, them = ("joints", "them") if len(still) > 1 else ("joint", "it")
        pairs = [unnamed_positions(recording, mechanism) for recording in recordings]
        foreign, lacking = next((pair for pair in pairs if pair[0]), ([], []))
        renamed = (
            f" There {'are' if foreign[1:] else 'is'} {', '.join(foreign)} of no joint: rename it, where it is "
            f"{', '.join(lacking)}."
        )
        yield (
            f"{len(still)} {joints} without a column q: {listed}.{renamed if foreign else ''} Held where the robot "
            f"file has {them}{where}; --home J=VALUE says where else"
        )
