"""`compensate`: commands of the actuators at which the loaded tool is where it was wanted.

The loaded simulation says where the tool goes under the present commands; what it misses is given back through the
travel of the actuators per error, at first that of the undeformed robot, then corrected by what the last correction did
(Broyden's method, row by row). Friction, creep and play act in every pass from the first row to the last, with the
present commands, so that what they remember is that of the path as it is driven.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError
from ..laws import Effect, Inputs, Place, Setup
from ..laws.deeds import Deed, PoseReport
from ..laws.of_another import OfAnother
from ..mechanism import Mechanism
from ..numbers import number
from ..recordings import Recording, ToolPath, write_recording
from ..recordings import read_path as read_any_path
from ..robot import Robot
from ..simulation import Prediction, simulate
from ..spatial import Array, motion_between, rotation_exp
from .wanted import Wanted, coordinate_units, wanted_of

#: What is missed by less is not corrected any more [m, rad]: commands are written with nine digits.
_CLOSE = 1e-9
#: Corrections of the commands; a handful is enough where one is possible.
_PASSES = 15
#: More than this share of the uncompensated error left, and more than this [m], is not called compensated.
_SHARE, _NOTHING = 0.01, 1e-7
_WORD = "not cancelled"

#: A path, or its coordinates by name; physics that acts.
PathLike = ToolPath | Mapping[str, ArrayLike]
Effects = Sequence[Effect]
#: Called with what is being done, and the share of the rows it has been done for.
Tell = Callable[[str, float], None]


@dataclass(frozen=True, eq=False, repr=False)
class Compensation:
    """Commands along a path, and what they leave. N rows, SI units, base axes; NaN in rows without a command.

    commands: the path with the actuators' commands as positions. names, units: the k components of the error, task
    coordinates or those of the tool's pose. before, after (N, k): by how much the loaded tool misses what was wanted,
    with the commands of the undeformed robot as drawn and with the compensated ones. pose_before, pose_after (N, 6):
    the whole way of the tool from there, translation and rotation vector; it may hold what no actuator can move.
    plain (N, a): the commands of the undeformed robot as drawn.
    status: 'ok', or why a row has no command: a status of `simulate`, 'not cancelled'; reasons: by status what is wrong
    with the first such row.
    """

    path: ToolPath
    commands: Recording
    names: tuple[str, ...]
    units: tuple[str, ...]
    before: Array
    after: Array
    pose_before: Array
    pose_after: Array
    plain: Array
    status: tuple[str, ...]
    reasons: Mapping[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    passes: int = 0

    def __len__(self) -> int:
        return len(self.status)

    @property
    def failures(self) -> dict[str, np.ndarray]:
        """The rows, counted from 0, of each status but 'ok'."""
        words = np.array(self.status, dtype=str)
        return {word: np.flatnonzero(words == word) for word in dict.fromkeys(self.status) if word != "ok"}

    @property
    def corrections(self) -> dict[str, Array]:
        """By how much each actuator is commanded otherwise than without compensation, (N,) [m or rad]."""
        columns = self.commands.positions.items()
        return {name: values - self.plain[:, column] for column, (name, values) in enumerate(columns)}

    def __repr__(self) -> str:
        failed = ", ".join(f"{len(rows)} {word}" for word, rows in self.failures.items())
        return f"<Compensation of {len(self)} rows in {self.passes} passes{': ' + failed if failed else ''}>"


def read_path(robot: Robot, path: str | Path) -> ToolPath:
    """Return the path of a CSV file for a robot: columns of its task coordinates, or q.<joint>; docs/compensation.md.

    Raises RecordingFileError with all problems, each with its line and column.
    """
    return read_any_path(path, coordinate_units(robot))


def write_commands(found: Compensation, path: str | Path) -> None:
    """Write commands as a recording, as CSV and the JSON beside it, with a column `status`; `simulate` reads it.

    A row without a command has empty cells there. Raises InputError where the files cannot be written.
    """
    write_recording(found.commands, path, status=found.status)


def compensate(
    robot: Robot,
    path: PathLike,
    wrench: ArrayLike | None = None,
    *,
    effects: Effects = (),
    time: ArrayLike | None = None,
    workers: int = 1,
    tell: Tell | None = None,
) -> Compensation:
    """Return the commands that put the loaded tool where a path wants it.

    path: that of a file, `read_path(robot, "path.csv")`; or coordinates by name, (N,) each or one number that holds all
    along, with a `wrench` (N, 6) or (6,) on the tool, base axes [N, N m], and a `time` (N,) [s] for what depends on it.
    effects: physics added to what the robot file says, those of a corrected or calibrated model for example. The tool's
    true pose is put right: what such a model says of a pose sensor is left out. workers: processes to compute in; the
    numbers do not depend on it. tell: called with what is being done and its share.

    Raises InputError, UnknownNameError, ParameterError where path or effects do not fit the robot.
    """
    if not isinstance(path, ToolPath):
        path = ToolPath.of(path, wrench, time)
    elif wrench is not None or time is not None:
        raise InputError("a ToolPath has its own wrench and time; give coordinates by name when there are others")
    if not len(path):
        raise InputError("a path without rows has nothing to compensate; expected one row or more")
    effects = tuple(effect.checked(robot.mechanism) for effect in effects)
    acting, remarks = _without_reports(effects, robot.mechanism)
    wanted = wanted_of(robot, path)
    actuators = len(robot.mechanism.actuated)
    if not robot.mechanism.tasks and actuators < len(wanted.names):
        remarks.append(
            f"{actuators} actuators do not move the tool in six ways: what they can move of it is put right."
        )
    commands, inverses = wanted.commands.copy(), wanted.inverses.copy()
    lost = np.array([row in wanted.reasons for row in range(len(path))])
    before = after = np.zeros((0, len(wanted.names)))
    step = np.zeros_like(commands)
    gone: dict[int, tuple[str, str]] = {row: ("unreachable", text) for row, text in wanted.reasons.items()}
    passes = 0
    while True:
        passes += 1
        run = _simulated(robot, _driven(path, robot, commands), acting, workers, tell, passes)
        tool = _placements(run)
        missed = wanted.missed(tool)
        if passes == 1:
            before, tool_before = missed, tool
        failed = np.flatnonzero(~np.isfinite(missed).all(axis=1) & ~lost)
        for row in failed.tolist():
            gone[row] = run.status[row], run.reasons.get(run.status[row], "")
        if passes > 1:
            _corrected(inverses, step, missed - after, ~lost)
        after = missed
        lost[failed] = True
        open_rows = ~lost & (np.abs(np.nan_to_num(missed)).max(axis=1, initial=0.0) > _CLOSE)
        if not (open_rows.any() or (len(failed) and passes > 1)) or passes > _PASSES:
            break
        step = np.zeros_like(commands)
        step[open_rows] = -(inverses[open_rows] @ missed[open_rows][..., None])[..., 0]
        commands = commands + step
        commands[lost] = np.nan
    sizes = [np.linalg.norm(wanted.weights * error, axis=1) for error in (before, after)]
    for row in np.flatnonzero(~lost & (sizes[1] > np.maximum(_SHARE * sizes[0], _NOTHING))).tolist():
        gone[row] = _WORD, _not_cancelled(wanted, before[row], after[row])
    status = tuple(gone[row][0] if row in gone else "ok" for row in range(len(path)))
    reasons: dict[str, str] = {}
    for row in sorted(gone):
        reasons.setdefault(*gone[row])
    commands[[row for row, (word, _) in gone.items() if word != _WORD]] = np.nan
    return Compensation(
        path,
        _driven(path, robot, commands),
        wanted.names,
        wanted.units,
        before,
        after,
        motion_between(wanted.placements, tool_before),
        motion_between(wanted.placements, tool),
        wanted.commands,
        status,
        reasons,
        (*remarks, *run.remarks),
        passes,
    )


def _driven(path: ToolPath, robot: Robot, commands: Array) -> Recording:
    """Return the path as a recording with these commands; nothing is measured."""
    given = path.recording
    names = robot.mechanism.actuated
    return Recording(
        given.time,
        positions={name: commands[:, column] for column, name in enumerate(names)},
        velocities=given.velocities,
        wrench=given.wrench,
        wrench_columns=given.wrench_columns,
        gravity=given.gravity,
        temperature=given.temperature,
        run=given.run,
        run_names=given.run_names,
        robot=given.robot,
    )


def _simulated(
    robot: Robot, driven: Recording, effects: Sequence[Effect], workers: int, tell: Tell | None, passes: int
) -> Prediction:
    stage = "as commanded" if passes == 1 else f"compensated, pass {passes - 1}"

    def progress(done: int, total: int) -> None:
        if tell is not None:
            tell(stage, done / total)

    return simulate(robot, driven, effects, workers=workers, progress=progress)


def _placements(run: Prediction) -> Array:
    """Return the placements of the loaded tool, (N, 4, 4); NaN where there is none."""
    out = np.broadcast_to(np.eye(4), (len(run), 4, 4)).copy()
    out[:, :3, :3], out[:, :3, 3] = rotation_exp(run.rotation), run.position
    return out


def _corrected(inverses: Array, step: Array, change: Array, rows: np.ndarray) -> None:
    """Let the travel per error (N, a, k) give, in rows, the last step (N, a) for the change of the error that it made.

    Broyden's first method: everything across stays as it was.
    """
    given = (inverses @ np.nan_to_num(change)[..., None])[..., 0]
    back = (step[:, None, :] @ inverses)[:, 0, :]
    scale = (step * given).sum(axis=1)
    good = rows & (np.abs(scale) > 1e-3 * (step * step).sum(axis=1)) & np.isfinite(change).all(axis=1)
    inverses[good] += ((step - given)[good] / scale[good][:, None])[:, :, None] * back[good][:, None, :]


def _not_cancelled(wanted: Wanted, before: Array, after: Array) -> str:
    listed = ", ".join(
        f"{name} {number(value, 3)} {unit} of {number(start, 3)}"
        for name, unit, start, value in zip(wanted.names, wanted.units, before, after, strict=True)
    )
    return (
        f"{wanted.commands.shape[1]} actuators cannot put the tool where it was wanted; the best that was found leaves "
        f"{listed}. Expected coordinates that they can move, at a pose that is not singular"
    )


# -- what is only reported ---------------------------------------------------------------------------------------------


class _Unreported(OfAnother):
    """A law as it acts on the robot: what its pose sensor makes of that is left out."""

    partial: ClassVar[bool] = True

    def inner(self, place: Place, mechanism: Mechanism) -> Place:
        return place

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return self.law.places(mechanism)

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        return (deed for deed in self.law.deeds(place, values, setup) if not isinstance(deed, PoseReport))


def _without_reports(effects: Sequence[Effect], mechanism: Mechanism) -> tuple[tuple[Effect, ...], list[str]]:
    """Return effects as they act on the tool's true pose, and remarks on what is left out."""
    setup = Setup.nominal(mechanism, Inputs.empty(len(mechanism.actuated)))
    acting, named = [], []
    for effect in effects:
        if any(isinstance(deed, PoseReport) for deed in effect.deeds(setup)):
            named.append(f"{effect.law.physics} at {effect.place}")
            effect = replace(effect, law=_Unreported(effect.law))
        acting.append(effect)
    what = (
        f"What the pose sensor makes of the tool's pose is left out ({', '.join(named)}): its true pose is put right."
    )
    return tuple(acting), [what] if named else []
