"""What a recording could show, and what it could not: to be asked before a diagnosis, while the bench still stands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from ..errors import limits_heard, postures_beyond
from ..numbers import counted
from ..recordings import Recording, suspicions
from ..robot import Robot
from ..simulation import as_recorded
from .conventions import read_logs
from .criteria import ALIKE, FEWEST_NUMBERS
from .diagnosis import Detectable
from .efforts.band import band_of, in_motion
from .efforts.belongs import check_efforts
from .efforts.evidence import gradients
from .efforts.prepare import PreparedEfforts
from .efforts.with_poses import check_measured, has_efforts, has_poses, unused_by_efforts, without_dead_efforts
from .findings import too_few_poses
from .identify import not_detectable
from .prepare import prepare, silent, unused_columns
from .search import Selection


@dataclass(frozen=True)
class Excitation:
    """How a joint moves: travel [m or rad], largest speed, share of the samples at rest, its drive's largest effort."""

    joint: str
    unit: str
    travel: float
    speed: float
    rest: float
    effort: float | None


@dataclass(frozen=True)
class Prospects:
    """What a recording could show. `joints` of a motion; `alike`: laws that it cannot tell apart; sentences.

    `conventions`: sentences on how the log seems to be written, where that is not as it says.
    """

    joints: tuple[Excitation, ...]
    not_detectable: tuple[Detectable, ...]
    alike: tuple[tuple[str, str], ...]
    unused_columns: tuple[str, ...]
    remarks: tuple[str, ...]
    conventions: tuple[str, ...] = ()
    premises: tuple[str, ...] = ()  # what comes before all else


def prospects(robot: Robot, recording: Recording) -> Prospects:
    """Return what a recording of a robot could show. Raises as `diagnose` does where it cannot be read that way."""
    with threadpool_limits(1, user_api="blas"), limits_heard() as heard:
        check_measured(robot, [recording])
        kept, dead, columns = without_dead_efforts([recording], robot.mechanism)
        logs = read_logs(robot, kept)
        (recording,) = logs.recordings
        drawn, adapted = robot, as_recorded(robot, recording)
        robot = adapted.robot
        unused, told = unused_columns(recording, robot.mechanism)
        remarks, premises = [*adapted.remarks, *suspicions(recording)], [*dead]
        efforts, poses = has_efforts([recording], robot.mechanism), has_poses([recording], robot.mechanism)
        joints: tuple[Excitation, ...] = ()
        hidden: list[Detectable] = []
        alike: list[tuple[str, str]] = []
        if poses:
            given = prepare(drawn, recording, silent)
            remarks += given.remarks
            problem = given.within_tolerances(given.problem)
            if problem.count(problem.first) < FEWEST_NUMBERS:
                few = too_few_poses(problem.count(problem.first))
                premises.append(f"{few.statement}; {few.advice}")
            else:
                hidden += not_detectable(problem, problem.first, Selection.nothing(problem.first, given.library))
        if efforts:
            joints, alike, more = _of_efforts(robot, recording)
            beside = unused_by_efforts(recording, robot.mechanism, all(joint.rest == 1 for joint in joints))
            unused = tuple(name for name in beside if not (poses and name == "temperature"))
            told = [f"not used: {', '.join(unused)}"] if unused else []
            remarks += more
        if not (efforts or poses):
            remarks.append("neither a pose, nor a marker, nor an effort was measured: nothing can be compared")
        remarks += [*told, *postures_beyond(heard)]
        first = [text for text in remarks if text not in recording.remarks]  # what was not measured comes last
    unused = (*columns, *unused)
    return Prospects(
        joints,
        tuple(hidden),
        tuple(alike),
        unused,
        tuple(dict.fromkeys((*first, *recording.remarks))),
        logs.statements,
        tuple(premises),
    )


def _of_efforts(robot: Robot, recording: Recording) -> tuple[tuple[Excitation, ...], list[tuple[str, str]], list[str]]:
    mechanism = robot.mechanism
    band, below = band_of(mechanism, recording)
    at = in_motion(mechanism, recording, band)
    doubts = [doubt.text for doubt in check_efforts(at)]
    motion = at.motion
    efforts = PreparedEfforts(at, {}, below)
    remarks = [*doubts, *motion.remarks]
    joints = []
    for column, name in enumerate(motion.names):
        own = recording.efforts.get(name) if name in at.driven else None
        joints.append(
            Excitation(
                name,
                "m" if mechanism.joint(name).slides else "rad",
                float(np.ptp(motion.position[:, column])),
                float(np.abs(motion.speed[:, column]).max()),
                1.0 if motion.standing else float(motion.still[:, column].mean()),
                None if own is None else float(np.nanmax(np.abs(own))),
            )
        )
    quiet = [item.joint for item in joints if not item.travel > 0]
    if quiet:
        remarks.append(f"{', '.join(quiet)} never moved: nothing of their friction, inertia or weight shows")
    rank, count = efforts.inertial_rank()
    if count:
        of_all = f"of the {count} inertial parameters of the moving links"
        remarks.append(f"this motion tells {counted(rank, 'combination')} {of_all}")
    start = efforts.start()
    _, rest, _ = gradients(start)
    size = np.sqrt(np.maximum(np.diag(rest), 0.0))
    single = [item for item in start.problem.candidates if item.size == 1 and size[item.where.start] > 0]
    alike = []
    for index, first in enumerate(single):
        for second in single[index + 1 :]:
            a, b = first.where.start, second.where.start
            if first.name != second.name and rest[a, b] ** 2 > ALIKE * (size[a] * size[b]) ** 2:
                alike.append((" at ".join(first.name), " at ".join(second.name)))
    return tuple(joints), list(dict.fromkeys(alike)), remarks
