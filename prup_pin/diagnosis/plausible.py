"""Can a recording be compared with a robot at all? What it lacks, and units or machines that cannot be right."""

from __future__ import annotations

import numpy as np

from ..channels import Linear, PoseChannel, Stack
from ..errors import InputError
from ..laws import Inputs
from ..mechanism import Mechanism
from ..numbers import number
from ..recordings import Recording, Tolerances
from ..recordings.columns import AXES, MARKER_GROUPS
from ..spatial import Array, turn_between
from .criteria import (
    ALLOWED_TOLERANCES,
    FAR,
    LEAST_REACH,
    NO_FORCE,
    TURNED,
    UPSIDE_DOWN,
)

__all__ = ["beside_allowed", "check_belongs", "unused_columns", "what_is_missing"]


def what_is_missing(inputs: Inputs, stack: Stack, mechanism: Mechanism) -> list[str]:
    """Return sentences on what a recording lacks."""
    remarks = []
    measured = {unit for _, unit, where in stack.groups() if stack.exists[:, where].any()}
    if not measured:
        remarks.append("no pose was measured (columns p.x … r.z): this recording cannot be compared with a simulation")
    elif "rad" not in measured:
        remarks.append("no rotation was measured: moments and tilts are judged by the position alone")
    elif "m" not in measured:
        remarks.append("no position was measured: forces are judged by the rotation alone")
    force = np.nan_to_num(np.abs(inputs.wrench)).max(initial=0.0)
    heavy = mechanism.model.njoints > 1 and sum(float(body.mass) for body in mechanism.model.inertias) > 0
    gravity = mechanism.gravity if inputs.gravity is None else np.nan_to_num(inputs.gravity)
    if force < NO_FORCE and not (heavy and np.abs(gravity).max(initial=0.0) > NO_FORCE):
        remarks.append("no load was applied: nothing can be said about stiffness, play or friction")
    elif force < NO_FORCE:
        remarks.append("no load was applied but the robot's own weight: what it does not load does not show")
    if inputs.motion is not None and mechanism.loops:
        remarks.append(
            "the robot moves, and its loops are loaded by weight and wrench alone: what its bodies' inertia bends is "
            "not told from what is wrong with it"
        )
    if inputs.gravity is not None and _points_up(inputs.gravity, mechanism.gravity):
        remarks.append(
            "g.x g.y g.z point against the robot file's gravity: an accelerometer at rest reports the opposite of free "
            "fall, which is what is expected"
        )
    if len(np.unique(inputs.blocks)) < 2:
        remarks.append("one pose only: effects of geometry and stiffness look alike")
    return remarks


def _points_up(measured: Array, drawn: Array) -> bool:
    """Return True where gravity is, in the median, the opposite of the robot file's."""
    sizes = np.linalg.norm(measured, axis=1) * np.linalg.norm(drawn)
    known = sizes > 0
    return bool(known.any() and np.median((measured @ drawn)[known] / sizes[known]) < UPSIDE_DOWN)


#: Kinds of columns that are not compared, and what they are.
_NOT_COMPARED = {
    "efforts": "efforts are predicted, but not compared",
    "markers": "the robot file has no frame of that name",
    "accelerations": "accelerations are not used",
    "velocities": "speeds are used where every actuator has them, and no others",
    "positions": "only the positions of actuators are inputs",
    "pose": "an orientation is one where all of r.x r.y r.z are measured",
    "ignored": "",  # the reader has told
}


def unused_columns(recording: Recording, mechanism: Mechanism) -> tuple[tuple[str, ...], list[str]]:
    """Return the columns that hold numbers and have no part in the diagnosis, and sentences that tell them."""
    found: dict[str, list[str]] = {kind: [] for kind in _NOT_COMPARED}

    def take(kind: str, name: str, values: Array) -> None:
        if np.isfinite(values).any():
            found[kind].append(name)

    for joint, values in recording.efforts.items():
        take("efforts", f"tau.{joint}", values)
    turns: dict[str, Array] = {} if recording.rotation is None else {"r": recording.rotation}
    for prefix, group in MARKER_GROUPS.items():
        for marker, values in getattr(recording, group).items():
            if marker not in mechanism.frame_names:
                for column, axis in enumerate(AXES):
                    take("markers", f"{prefix}.{marker}.{axis}", values[:, column])
            elif prefix == "r":
                turns[f"r.{marker}"] = values
    for joint, values in recording.accelerations.items():
        take("accelerations", f"qdd.{joint}", values)
    all_speeds = set(mechanism.actuated) <= set(recording.velocities)
    for joint, values in recording.velocities.items():
        if not (all_speeds and joint in mechanism.actuated):
            take("velocities", f"qd.{joint}", values)
    for joint, values in recording.positions.items():
        if joint not in mechanism.actuated:
            take("positions", f"q.{joint}", values)
    for prefix, values in turns.items():
        if not np.isfinite(values).all(axis=1).any():
            for column, axis in enumerate(AXES):
                take("pose", f"{prefix}.{axis}", values[:, column])
    found["ignored"] += recording.ignored
    told = [f"not used: {', '.join(found[kind])} ({why})" for kind, why in _NOT_COMPARED.items() if why and found[kind]]
    return tuple(name for names in found.values() for name in names), told


def beside_allowed(declared: Tolerances, mechanism: Mechanism) -> tuple[float, float]:
    """Return how far tolerances let a marker be off: a length [m], and a share of its distance from the base."""
    joints = float(np.sqrt(len(mechanism.actuated)))
    length = (declared.target_position or 0.0) + joints * (declared.position or 0.0)
    turn = joints * ((declared.encoder_offset or 0.0) + (declared.direction or 0.0))
    return ALLOWED_TOLERANCES * length, FAR + ALLOWED_TOLERANCES * turn


def check_belongs(
    stack: Stack,
    linear: Linear,
    inputs: Inputs,
    here: np.ndarray,
    rows: np.ndarray,
    allowed: tuple[float, float] = (0.0, FAR),
) -> None:
    """Raise InputError where recording and robot are worlds apart, with the likely reason.

    here (N,): the samples of the recording that is asked; rows (N,): where each stands in its table, from 0; `allowed`:
    what `beside_allowed` says.
    """
    for name, values in (("q", inputs.actuators[here]), ("w", inputs.wrench[here])):
        if len(values) and np.isnan(values).all(axis=0).any():
            raise InputError(
                f"a column {name}.… is empty in every row: without all positions of the actuators [m, rad] and all "
                "components of the load [N, N m] nothing can be simulated. Write 0 for a load that was not applied"
            )
    if not linear.samples[here].any():
        lost = next(((rows[row], text) for row, text in sorted(linear.geometry.reasons.items()) if here[row]), None)
        why = "" if lost is None else f": row {lost[0] + 2}: {lost[1]}"
        raise InputError(
            "the robot reaches none of the recording's poses, or none of its samples is complete"
            f"{why}. Check --robot, the q columns' names and units [m, rad]; no other way to write them would do"
        )
    for measured in stack.channels:
        if isinstance(measured, PoseChannel):
            _check_channel(measured, linear, here, rows, allowed)


def _check_channel(
    measured: PoseChannel, linear: Linear, here: np.ndarray, rows: np.ndarray, allowed: tuple[float, float]
) -> None:
    """Raise InputError where a frame is measured worlds apart from where it is simulated."""
    placed = here & linear.samples & measured.exists[:, :3].all(axis=1)
    turned = here & linear.samples & measured.exists[:, 3:].all(axis=1)
    of, column = "", ""
    if measured.name != "pose":
        of, column = f" of {measured.name}", f".{measured.frame.name}"
    if placed.any():
        rigid, loaded = linear.rigid(measured.frame)[0], linear.pose_of(measured.frame)[0]
        near = measured.position[placed], rigid[placed], loaded[placed]
        _check_positions(*near, rows[placed], of or " of the tool", column, allowed)
    if turned.any():
        _check_rotations(measured.rotation[turned], linear.rigid(measured.frame)[1][turned], of, column)


def _check_rotations(measured: Array, rigid: Array, of: str, column: str) -> None:
    apart = float(np.median(np.linalg.norm(turn_between(rigid, measured), axis=1)))
    if apart > TURNED:
        raise InputError(
            f"measured and simulated orientations{of} are {number(apart, 3)} rad apart: expected r{column}.x "
            f"r{column}.y "
            f"r{column}.z as a rotation vector in rad, in the base frame of the robot file, and no other way to write "
            "them would do: is it another robot?"
        )


def _check_positions(
    measured: Array,
    rigid: Array,
    loaded: Array,
    rows: np.ndarray,
    of: str,
    column: str,
    allowed: tuple[float, float],
) -> None:
    apart = np.linalg.norm(measured - rigid, axis=1)
    distance = float(np.median(apart))
    size = float(np.median(np.linalg.norm(rigid, axis=1)))
    reach = max(size, LEAST_REACH)
    near = allowed[0] + allowed[1] * reach
    if distance < near or float(np.median(np.linalg.norm(measured - loaded, axis=1))) < near:
        return
    usual = int(np.argmin(np.abs(apart - distance)))
    seen, drawn = (" ".join(number(float(v), 3) for v in values[usual]) for values in (measured, rigid))
    columns = " ".join(f"p{column}.{axis}" for axis in AXES)
    raise InputError(
        f"measured and simulated positions{of} are {number(distance, 3)} m apart, in the median: in line "
        f"{rows[usual] + 2} it was measured at {seen}, and the robot file puts it at {drawn} m with that row's joint "
        f"positions: this is another robot, another frame, or other units. Check --robot, {columns} (expected in "
        "metres, in the base frame of the robot file), and signs, zeros and order of the q columns"
    )
