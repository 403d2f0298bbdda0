"""Logs that are written otherwise than they say: read as they seem to be meant, before any physics is looked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..dynamics import is_standing
from ..errors import InputError, PrupPinError, limits_heard
from ..numbers import number
from ..recordings import Convention, Recording, joints_of, read_as
from ..recordings.conventions import Evidence, as_json, merged
from ..robot import Robot
from ..simulation import as_recorded, drawn_for, in_format
from .criteria import LEVER, MOST_LISTED, OPEN_FRAME
from .diagnosis import Diagnosis, Finding
from .efforts.conventions import conventions_of_efforts, is_mirrored
from .efforts.with_poses import has_efforts, has_poses
from .load_conventions import conventions_of_loads
from .pose_conventions import conventions_of_poses

_Look = Callable[[Robot, Recording], Evidence | None]
#: How many times as much is beyond counting.
_BEYOND_COUNTING = 1000


@dataclass(frozen=True)
class Logs:
    """Recordings in the format's own conventions, and for each of them how it is written, with what speaks for that."""

    recordings: tuple[Recording, ...]
    evidence: tuple[tuple[Evidence, ...], ...]

    @property
    def conventions(self) -> tuple[tuple[Convention, ...], ...]:
        """How each recording is written, as far as that was found and not declared."""
        return tuple(tuple(convention for item in found for convention in item.conventions) for found in self.evidence)

    def findings(self) -> tuple[Finding, ...]:
        """Return a finding for all that is written otherwise; one for recordings that are written alike."""
        out: dict[tuple[Convention, ...], Finding] = {}
        for recording, found in zip(self.recordings, self.evidence, strict=True):
            for item in found:
                name = Path(recording.path).name or "the log"
                out.setdefault(item.conventions, _finding(item, name))
        return tuple(out.values())

    @property
    def statements(self) -> tuple[str, ...]:
        """Sentences on all that is written otherwise, each with how to declare it."""
        return tuple(f"{found.statement}. {found.remedy[:1].upper()}{found.remedy[1:]}" for found in self.findings())

    def before(self, diagnosis: Diagnosis) -> Diagnosis:
        """Return a diagnosis of what was read that begins with how that was written."""
        first = self.findings()
        if not first:
            return diagnosis
        verdict = "explained" if diagnosis.verdict == "nothing_missing" else diagnosis.verdict
        return replace(diagnosis, verdict=verdict, findings=(*first, *diagnosis.findings), conventions=self.conventions)


def read_logs(robot: Robot, recordings: Recording | Sequence[Recording]) -> Logs:
    """Return recordings read as they declare, and then as they seem to be written.

    Raises InputError where two ways to read one are as good and are not the same, or a declared one does not fit.
    """
    read = [_read(robot, recording) for recording in in_format(robot, recordings)]
    return Logs(tuple(recording for recording, _ in read), tuple(evidence for _, evidence in read))


def _read(robot: Robot, recording: Recording) -> tuple[Recording, tuple[Evidence, ...]]:
    """Return one recording read as it seems to be written, and what speaks for that: poses, loads, efforts."""
    found: list[Evidence] = []

    def told(item: Evidence | None) -> None:
        nonlocal recording
        if item is not None:
            _check_only(item, recording, robot)
            found.append(item)
            recording = read_as(recording, item.conventions, drawn_for(robot))

    poses, loads = _as_loads_say(robot, recording, _asked(_of_poses, robot, recording)[1])
    told(poses)
    told(loads)
    told(_asked(_of_efforts, robot, recording)[1])
    return recording, tuple(found)


def _asked(look: _Look, robot: Robot, recording: Recording) -> tuple[bool, Evidence | None]:
    """Return whether a log can be compared at all, and how it seems to be written.

    What cannot is told where it is diagnosed; readings that are given up stand anywhere.
    """
    with suppress(PrupPinError), limits_heard():
        return True, look(robot, recording)
    return False, None


def as_diagnosed(diagnosis: Diagnosis, robot: Robot, recordings: Recording | Sequence[Recording]) -> list[Recording]:
    """Return recordings as a diagnosis of them has read them."""
    given = in_format(robot, recordings)
    if not diagnosis.conventions:
        return given
    return [
        read_as(item, conventions, drawn_for(robot))
        for item, conventions in zip(given, diagnosis.conventions, strict=True)
    ]


def _of_poses(robot: Robot, recording: Recording) -> Evidence | None:
    if not has_poses([recording], robot.mechanism):
        return None
    adapted = as_recorded(robot, recording)
    if adapted.unknown_on_the_way:
        return None  # what a joint does that nobody recorded would be told of the others' units
    kinds = recording.tolerances.declared
    anywhere = max(kinds.get("frame_position", 0.0), LEVER * kinds.get("frame_rotation", 0.0)) > OPEN_FRAME
    found = conventions_of_poses(adapted.robot, adapted.recordings[0], anywhere)
    if found is None:
        return None
    table = joints_of(recording)
    return replace(found, conventions=merged(found.conventions, table["q"], table["tau"]))


def _of_loads(robot: Robot, recording: Recording) -> Evidence | None:
    if not has_poses([recording], robot.mechanism) or not recording.has_wrench:
        return None
    adapted = as_recorded(robot, recording)
    return conventions_of_loads(adapted.robot, adapted.recordings[0])


def _as_loads_say(
    robot: Robot, recording: Recording, found: Evidence | None
) -> tuple[Evidence | None, Evidence | None]:
    """Return the evidence of poses with those of its readings, all as good, by which loads are as they are written; and
    how loads seem to be written beside the first.

    Two legs of a robot that is its own mirror image are exchanged, or the tracker is mirrored: so are loads, or not.
    """
    table, drawn = joints_of(recording), drawn_for(robot)
    readings = [()] if found is None else [found.conventions, *found.others]
    readings = [merged(reading, table["q"], table["tau"]) for reading in readings]
    if not recording.has_wrench:
        return found, None
    loads = [_asked(_of_loads, robot, read_as(recording, reading, drawn)) for reading in readings]
    suited = [reading for reading, said in zip(readings, loads, strict=True) if said == (True, None)]
    if found is None or len(readings) == 1 or not suited:
        return found, loads[0][1]
    return replace(found, conventions=suited[0], others=tuple(suited[1:])), None


def _of_efforts(robot: Robot, recording: Recording) -> Evidence | None:
    mechanism = robot.mechanism
    if not has_efforts([recording], mechanism):
        return None
    positions = [name for name in mechanism.actuated if name in recording.positions]
    if has_poses([recording], mechanism) and is_standing(recording, positions):
        return None
    adapted = as_recorded(robot, recording)
    return conventions_of_efforts(adapted.robot.mechanism, adapted.recordings[0])


def _check_only(found: Evidence, recording: Recording, robot: Robot) -> None:
    """Raise where another reading of joints is as good, and makes other positions or efforts of the log.

    Of a robot that is its own mirror image both say the same, and foretell the same of any log that is written alike.
    """
    drawn = drawn_for(robot)
    first = read_as(recording, found.conventions, drawn)
    for other in found.others:
        if not any(item.group in ("q", "tau") for item in other):
            continue
        table = joints_of(recording)
        second = read_as(recording, merged(other, table["q"], table["tau"]), drawn)
        for field in ("positions", "efforts"):
            one, two = getattr(first, field), getattr(second, field)
            if any(not np.allclose(one[name], two[name], rtol=1e-3, atol=1e-6, equal_nan=True) for name in one):
                if is_mirrored(robot.mechanism, first, second):
                    break
                ways = " or ".join(_declared(item) for item in (found.conventions, other))
                raise InputError(
                    f"{recording.path or 'the log'} is not written as it says: {_how_far(found)}. Two readings are as "
                    f"good: {ways}. Declare the right one, as --convention or in its JSON file"
                )


def _declared(conventions: Sequence[Convention]) -> str:
    return " ".join(f"--convention {item}" for item in conventions)


def _how_far(found: Evidence) -> str:
    what = {"positions": "measured and drawn positions are", "orientations": "measured and drawn orientations are"}
    read = _size(found.read, found.unit)
    if found.written is None and found.what == "efforts":
        share = f"{number(100 * found.read, 3)} %"
        return f"the loops cannot be closed as it is written; read so, the robot file leaves {share} of the efforts"
    if found.written is None:
        return f"the robot cannot stand as it is written; {what[found.what]} {read} apart as it is read"
    if found.what in what:
        written = _size(found.written, found.unit)
        return f"{what[found.what]} {written} apart as it is written, and {read} as it is read"
    # a ratio alone: shares of what friction and noise leave would stand beside those of a diagnosis, which are others
    if found.written > _BEYOND_COUNTING * found.read:
        return f"read so, the robot file leaves hardly more than noise of {found.what}; as it is written, much"
    times = number(found.written / found.read, 3)
    return f"as it is written, the robot file leaves {times} times as much of {found.what} as when it is read so"


def _size(value: float, unit: str) -> str:
    if not np.isfinite(value):
        return "all"
    if unit == "m" and value < 1:
        return f"{number(1e3 * value, 3)} mm"
    return f"{number(value, 3)} {unit}"


def _finding(found: Evidence, name: str) -> Finding:
    columns: dict[str, list[str]] = {}
    for item in found.conventions:
        columns.setdefault(_meaning(item), []).append(item.columns)
    words = "; ".join(f"{', '.join(those)} {meaning}" for meaning, those in columns.items())
    beside = ", ".join(f'"{key}": {_quoted(value)}' for key, value in as_json(found.conventions).items())
    said = ", ".join(map(str, found.conventions))
    others = [text for other in found.others[:MOST_LISTED] if (text := ", ".join(map(str, other))) != said]
    equal = f". As good on this log: {' or '.join(others)}" if others else ""
    places, far = tuple(dict.fromkeys(_place(item) for item in found.conventions)), _how_far(found)
    return Finding(
        physics="log_convention",
        location=places[0] if len(places) == 1 else "robot",
        candidates=places if len(places) == 1 else ("robot", *(place for place in places if place != "robot")),
        parameters={},
        heldout_gain=float(np.clip(found.held, 0.0, 1.0)),
        statement=(
            f"{'' if name == 'the log' else 'the log '}{name} does not seem to be written as it says: {words}. "
            f"{far[:1].upper()}{far[1:]}{equal}"
        ),
        advice=(
            f'where that is right, declare it, "conventions": {{{beside}}} in its JSON file or '
            f"{_declared(found.conventions)}; or write it otherwise"
        ),
        alternatives=tuple(others),
        conventions=found.conventions,
        evidence=_evidence(found),
    )


def _evidence(found: Evidence) -> dict[str, str | float]:
    told: dict[str, str | float] = {"of": found.what, "unit": found.unit or "1"}
    if found.written is not None:
        told["as_written"] = found.written
    return told | {"as_read": found.read}


def _quoted(value: str | list[str]) -> str:
    return f'"{value}"' if isinstance(value, str) else "[" + ", ".join(f'"{item}"' for item in value) + "]"


def _meaning(convention: Convention) -> str:
    told = convention.said.partition(":")[2]
    return f"{convention.meaning.summary}{f' ({told})' if told else ''}"


def _place(convention: Convention) -> str:
    if convention.joint:
        return convention.joint
    return {"p": "pose_sensor", "r": "pose_sensor", "wrench": "wrench_sensor", "force": "wrench_sensor",
            "moment": "wrench_sensor"}.get(convention.group, "robot")  # fmt: skip
