"""Where the pose sensor stands: the rigid motion between its frame and the robot's base, in closed form.

Calibration steps from what is nearly right; a tracker may stand anywhere: `spatial.rigid_motion` tells where. Where a
marker sits beside its frame is looked for with it, where its tolerance leaves that open, nothing else fits, or far less
is left. Points far off weigh little. A target is mounted any way round: how it is turned on its body is told first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from ..channels import Channel, Linear, PoseChannel, Stack, Stations
from ..laws import Effect, Sharing, sits_turned, stands_elsewhere
from ..mechanism import Mechanism
from ..numbers import number
from ..recordings import ARM, Recording, Together
from ..spatial import Array, rotation_log, skew, turn_between
from .criteria import (
    FAR_LESS,
    FEWEST_REGISTERED,
    ITERATIONS,
    LEAST_REACH,
    LEVER,
    MOST,
    OPEN_FRAME,
    OPEN_TARGET,
    TURNED,
)
from .rigid_fit import RigidFit, rigid_fit

#: What to declare where a pose sensor was set up anew.
OWN_FRAMES = 'where that is so, declare "own_sensors": ["pose_sensor"]'
OWN_STATIONS = 'where that is so, declare "own_sensors": {"by_run": ["pose_sensor"]}'


@dataclass(frozen=True, eq=False)
class Registered:
    """What was measured, seen from the robot's base; for each sensor that stands elsewhere an effect and a sentence.

    `found` and `turned` (targets) are those that nothing declared: findings. The others are what tolerances left open.
    """

    stack: Stack
    effects: tuple[Effect, ...] = ()
    found: tuple[Effect, ...] = ()
    deviations: tuple[Array, ...] = ()  # (6,) of each one found
    turned: tuple[Effect, ...] = ()
    turned_deviations: tuple[Array, ...] = ()  # (3,) of each one
    remarks: tuple[str, ...] = ()
    beside: float = 0.0  # how far a marker sits beside its frame at most, where that had to be found too [m]

    @property
    def every(self) -> tuple[Effect, ...]:
        """All effects, whether declared or found."""
        return (*self.effects, *self.undeclared)

    @property
    def undeclared(self) -> tuple[Effect, ...]:
        """The effects that nothing declared."""
        return (*self.found, *self.turned)

    def open(self, recording: Recording) -> Recording:
        """Return a recording whose tolerances leave open where a sensor stands that was found elsewhere.

        What was left out has bent the closed form a little, and must not stay in it.
        """
        kinds = {"frame_position": ARM.frame_position, "frame_rotation": ARM.frame_rotation} if self.found else {}
        if self.turned and recording.tolerances.target_rotation is None:
            kinds["target_rotation"] = ARM.target_rotation
        return replace(recording, tolerances=replace(recording.tolerances, **kinds)) if kinds else recording


def registered(
    stack: Stack, linear: Linear, together: Together, mechanism: Mechanism, allowed: tuple[float, float]
) -> Registered:
    """Return what was measured with every pose sensor's frame put where the robot's base is.

    allowed: how far markers may be off anyway, as `prepare.allowed_of_markers` says.

    One whose frame has a wide tolerance stands wherever it fits. One without is moved only where it is worlds apart and
    a single rigid motion explains that: then it is a finding. Of stations of their own for each run neither is told.
    """
    stations = together.stations
    out = Registered(replace(stack, stations=Stations(together.recording.run)) if stations else stack)
    out = _targets_upright(out, linear, together, mechanism)
    groups: Sequence[Sharing | None] = stations or together.groups.get("pose_sensor") or (None,)
    for group in groups:
        here = _of_group(group, together)
        kinds = together.recording.tolerances.declared if group is None else group.tolerances
        is_open = max(kinds.get("frame_position", 0.0), LEVER * kinds.get("frame_rotation", 0.0)) > OPEN_FRAME
        is_open |= bool(stations)
        if not is_open and not _some_apart(out.stack, linear, [here], allowed):
            continue
        motion = _likely_motion(
            out.stack, linear, here, together.recording.tolerances.target_position, is_open, allowed
        )
        if motion is None:
            continue
        stack = _seen_from_base(out.stack, motion, here)
        if stations:
            out = replace(out, stack=stack, beside=max(out.beside, motion.beside))
            continue
        effect = stands_elsewhere(motion.turn, motion.shift, group, mechanism)
        label = f"{group.label}: " if group is not None and group.label else ""
        where = effect.statement(mechanism)
        fits = f"so that measured and simulated positions are {_length(motion.after)} apart instead of " + _length(
            motion.before
        )
        if is_open:
            text = f"{label}{where}, {fits}: within the tolerances frame_position and frame_rotation it stands anywhere"
            out = replace(out, stack=stack, effects=(*out.effects, effect), remarks=(*out.remarks, text))
        else:
            text = (
                f"{label}all poses of {_seen(out.stack)} are off by one rigid motion: {where}, {fits}. Where the "
                'sensor just stands there, declare it: "tolerances": {"frame_position": 5, "frame_rotation": 3}'
            )
            out = replace(out, stack=stack, found=(*out.found, effect), remarks=(*out.remarks, text))
            out = replace(out, deviations=(*out.deviations, motion.deviation), beside=max(out.beside, motion.beside))
    return out


def _targets_upright(out: Registered, linear: Linear, together: Together, mechanism: Mechanism) -> Registered:
    """Return what was measured with every target whose axes are others than its frame's turned into these.

    Farther than `TURNED`, and one turn for all samples: smaller ones are calibrated. Where encoders that count from
    elsewhere explain far more, they are.
    """
    sensors: Sequence[Sharing | None] = together.stations or together.groups.get("pose_sensor") or (None,)
    from_base, shift, apart = np.tile(np.eye(3), (len(together.which), 1, 1)), np.zeros((len(together.which), 3)), 0.0
    for group in sensors:
        here = _of_group(group, together)
        motion = _motion(out.stack.poses, linear, here, True)
        if motion is not None:
            from_base[here], shift[here], apart = motion.turn, motion.shift, max(apart, motion.after)
    for group in together.groups.get("target") or (None,):
        here, label = _of_group(group, together), group.label if group is not None else ""
        declared = (together.recording.tolerances.declared if group is None else group.tolerances).get(
            "target_rotation"
        )
        for channel in out.stack.poses:
            rows = here & linear.samples & channel.exists[:, 3:].all(axis=1)
            if rows.sum() < FEWEST_REGISTERED:
                continue
            drawn = linear.pose_of(channel.frame)[1]
            seen = channel.rotation[rows]
            as_seen, from_here = _Mounted.of(drawn[rows], seen), _Mounted.of(drawn[rows], from_base[rows].mT @ seen)
            best = min(as_seen, from_here, key=lambda way: way.left)
            if not (best.size > TURNED and best.left < min(TURNED, MOST * best.before)):
                continue
            if from_here.before < TURNED:  # where the sensor stands says all: a platform that only shifts
                continue
            far, askew = _left_by_zeros(channel, linear, rows, from_base, shift)
            if askew < MOST * best.left or (far < MOST * apart and MOST * askew < best.left):
                continue
            effect = sits_turned(best.turn, channel.frame.name, group, mechanism)
            upright = np.where(here[:, None, None], channel.rotation @ best.turn.T, channel.rotation)
            channels = [replace(channel, rotation=upright) if each is channel else each for each in out.stack.channels]
            out = replace(out, stack=replace(out.stack, channels=tuple(channels)))
            text = (
                f"{label + ': ' if label else ''}all orientations of '{channel.frame.name}' are off by one turn of the "
                f"target: {effect.statement(mechanism)}, so that measured and simulated orientations are "
                f"{number(best.left, 3)} rad apart instead of {number(best.before, 3)} rad"
            )
            if (declared or 0.0) > TURNED:
                text += ": within the tolerance target_rotation it is mounted any way round"
                out = replace(out, effects=(*out.effects, effect), remarks=(*out.remarks, text))
                continue
            text += '. Where it is just mounted so, declare it: "tolerances": {"target_rotation": 3}'
            out = replace(out, turned=(*out.turned, effect), remarks=(*out.remarks, text))
            out = replace(out, turned_deviations=(*out.turned_deviations, best.deviation))
    return out


@dataclass(frozen=True, eq=False)
class _Mounted:
    """How a target is turned on its body (3, 3), and how far orientations are apart before and after, in the median.

    deviation (3,): standard deviations of its rotation vector [rad].
    """

    turn: Array
    deviation: Array
    before: float
    left: float

    @property
    def size(self) -> float:
        return float(np.linalg.norm(rotation_log(self.turn)))

    @classmethod
    def of(cls, drawn: Array, seen: Array) -> _Mounted:
        """drawn, seen (n, 3, 3): orientations of the frame, and of the target in the same axes."""
        between, kept = drawn.mT @ seen, np.ones(len(drawn), bool)
        for _ in range(ITERATIONS):  # without gross errors
            turn = Rotation.from_matrix(between[kept]).mean().as_matrix()
            angles = np.linalg.norm(rotation_log(between @ turn.T), axis=1)
            again = angles <= 3 * np.median(angles)
            if np.array_equal(again, kept):
                break
            kept = again
        left = float(np.median(angles))
        before = float(np.median(np.linalg.norm(rotation_log(between), axis=1)))
        return cls(turn, np.full(3, left / np.sqrt(kept.sum())), before, left)


def _left_by_zeros(
    measured: PoseChannel, linear: Linear, rows: np.ndarray, turn: Array, shift: Array
) -> tuple[float, float]:
    """Return how far positions [m] and orientations [rad] are apart beside other zeros of the encoders: RMS and median.

    turn (N, 3, 3), shift (N, 3): about where the sensor stands.
    """
    position, rotation = (value[rows] for value in linear.pose_of(measured.frame))
    by, still = linear.by_actuators(measured.frame)[rows], np.zeros((int(rows.sum()), 3, 3))
    seen = turn_between(rotation, turn[rows].mT @ measured.rotation[rows])
    at = np.einsum("nji,nj->ni", turn[rows], measured.position[rows] - shift[rows]) - position
    told = measured.exists[rows, :3].all(axis=1)
    reach = max(float(np.median(np.linalg.norm(position, axis=1))), LEAST_REACH)
    whole = np.broadcast_to(np.eye(3), still.shape)
    moves = np.concatenate((by[:, :3], -skew(position), whole), axis=2)[told] / reach
    turns = np.concatenate((by[:, 3:], whole, still), axis=2)
    table = np.concatenate([part.reshape(-1, by.shape[2] + 6) for part in (moves, turns)])
    left = np.concatenate((at[told].ravel() / reach, seen.ravel()))
    left = (left - table @ np.linalg.lstsq(table, left, rcond=None)[0]).reshape(-1, 3)
    sizes = np.linalg.norm(left, axis=1)
    placed = int(told.sum())
    return float(reach * np.sqrt(np.mean(sizes[:placed] ** 2))) if placed else 0.0, float(np.median(sizes[placed:]))


def _of_group(group: Sharing | None, together: Together) -> np.ndarray:
    """Return the samples (N,) of the recordings that share a sensor; all without a group."""
    return np.ones(len(together.which), bool) if group is None else np.isin(together.setups, group.sources)


def _likely_motion(
    stack: Stack, linear: Linear, here: np.ndarray, aside: float | None, is_open: bool, allowed: tuple[float, float]
) -> RigidFit | None:
    """Return the motion that brings samples `here` (N,) near; of an open frame the best one anyway; or None.

    aside: how far a target sits from where it is drawn [m], None where nothing is declared. Markers sit beside their
    frames where that is wide, where else nothing is near, and where it leaves far less.
    """
    kept: RigidFit | None = None
    fits = False
    for beside in dict.fromkeys(((aside or 0.0) > OPEN_TARGET, True)):
        motion = _motion(stack.poses, linear, here, beside)
        if motion is None or (not is_open and not motion.after < MOST * motion.before):
            continue
        reach = allowed[0] + motion.beside, allowed[1]
        # orientations that no one can read are told as such, where positions fit
        seen = _seen_from_base(stack, motion, here)
        near = not any(worlds_apart(each, linear, here, reach)[0] for each in seen.poses)
        if kept is not None and fits:
            near &= motion.after < FAR_LESS * kept.after
        if near or (is_open and kept is None):
            kept, fits = motion, near
    return kept


def _seen(stack: Stack) -> str:
    """Return which places were measured: the tool, and frames with markers."""
    return ", ".join(f"'{channel.frame.name}'" for channel in stack.poses if channel.exists.any())


def own_frames(
    stack: Stack,
    placed: Registered,
    linear: Linear,
    together: Together,
    mechanism: Mechanism,
    allowed: tuple[float, float],
) -> tuple[Together, Registered] | None:
    """Return recordings that each have a pose sensor of their own, or each run, where one frame does not fit all.

    stack: what was measured; placed: what one frame for all has made of it. None where that fits, or where frames of
    their own do not either.
    """
    if "pose_sensor" in together.groups or not _parts_apart(placed, linear, together, allowed):
        return None
    ways = [(together.with_own("pose_sensor"), f"recording; {OWN_FRAMES}")] if together.several else []
    if len(np.unique(together.recording.run)) > 1:
        ways.append((together.with_runs_of("pose_sensor"), f"run; {OWN_STATIONS}"))
    for own, told in ways:
        again = registered(stack, linear, own, mechanism, allowed)
        if not _parts_apart(again, linear, own, allowed):
            return own, replace(again, remarks=(*again.remarks, f"the pose sensor stood elsewhere in each {told}"))
    return None


def _parts_apart(placed: Registered, linear: Linear, together: Together, allowed: tuple[float, float]) -> bool:
    """Return whether any recording or run is worlds apart from the robot."""
    reach, run = (allowed[0] + placed.beside, allowed[1]), together.recording.run
    parts = [run == each for each in np.unique(run)] + [here for _, here in together.each()]
    return _some_apart(placed.stack, linear, parts, reach)


def _some_apart(stack: Stack, linear: Linear, parts: Sequence[np.ndarray], allowed: tuple[float, float]) -> bool:
    return any(any(worlds_apart(each, linear, here, allowed, zeros=False)) for each in stack.poses for here in parts)


def _length(metres: float) -> str:
    return f"{number(metres, 3)} m" if metres >= 1 else f"{number(1e3 * metres, 3)} mm"


def worlds_apart(
    measured: PoseChannel, linear: Linear, here: np.ndarray, allowed: tuple[float, float], zeros: bool = True
) -> tuple[bool, bool]:
    """Return whether a frame is measured elsewhere, and turned elsewhere, than deflections or calibration would put it.

    zeros: the encoders may have been switched on anywhere, and the sensor's frame lies a little beside then.
    """
    placed = here & linear.samples & measured.exists[:, :3].any(axis=1)
    turned = here & linear.samples & measured.exists[:, 3:].all(axis=1)
    told = measured.exists[placed, :3]
    found = (True, True)
    for position, rotation in (linear.pose_of(measured.frame), linear.rigid(measured.frame)):
        reach = max(float(np.median(np.linalg.norm(position[placed], axis=1))), LEAST_REACH) if placed.any() else 1.0
        shift = np.where(told, measured.position[placed] - position[placed], 0.0)
        turn = turn_between(rotation[turned], measured.rotation[turned])
        limits = allowed[0] + allowed[1] * reach, TURNED
        found = min(found, _beyond(shift, turn, limits), key=sum)
        if any(found) and zeros and placed.sum() >= FEWEST_REGISTERED:
            by = linear.by_actuators(measured.frame)
            shifted, still = -skew(position[placed]), np.zeros((int(turned.sum()), 3, 3))
            rows = (
                np.concatenate((by[placed, :3], shifted, np.broadcast_to(np.eye(3), shifted.shape)), axis=2) / reach,
                np.concatenate((by[turned, 3:], np.broadcast_to(np.eye(3), still.shape), still), axis=2),
            )
            table = np.concatenate([part.reshape(-1, by.shape[2] + 6) for part in rows])
            table[: told.size] *= told.reshape(-1, 1)
            left = np.concatenate((shift.ravel() / reach, turn.ravel()))
            left = (left - table @ np.linalg.lstsq(table, left, rcond=None)[0]).reshape(-1, 3)
            found = min(found, _beyond(left[: len(shift)] * reach, left[len(shift) :], limits), key=sum)
    return found


def _beyond(shift: Array, turn: Array, limits: tuple[float, float]) -> tuple[bool, bool]:
    """Return whether shifts (n, 3) [m] and turns (m, 3) [rad] are beyond their limits, in the median."""
    sizes = (np.linalg.norm(values, axis=1) for values in (shift, turn))
    far, askew = (bool(len(each) and np.median(each) > most) for each, most in zip(sizes, limits, strict=True))
    return far, askew


def _motion(channels: Sequence[PoseChannel], linear: Linear, here: np.ndarray, beside: bool) -> RigidFit | None:
    """Return the rigid motion that fits best, None where too little was measured to tell.

    `beside`: markers may sit anywhere on their bodies.
    """
    parts = []
    for channel in channels:
        rows = here & linear.samples & channel.exists[:, :3].all(axis=1)
        position, rotation = linear.pose_of(channel.frame)
        if rows.any():
            parts.append((position[rows], rotation[rows], channel.position[rows]))
    return rigid_fit(parts, beside)


def _seen_from_base(stack: Stack, motion: RigidFit, here: np.ndarray) -> Stack:
    """Return the stack with poses as a sensor reports them that stands at the base, where `here` (N,) it does not."""

    def seen(channel: Channel) -> Channel:
        if not isinstance(channel, PoseChannel):
            return channel
        # what was measured along one axis alone is along none of the base's
        placed = (here & np.all(channel.exists[:, :3], axis=1))[:, None]
        turned = (here & np.all(channel.exists[:, 3:], axis=1))[:, None, None]
        exists = channel.exists.copy()
        exists[here, :3] = placed[here]
        return replace(
            channel,
            position=np.where(placed, (channel.position - motion.shift) @ motion.turn, channel.position),
            rotation=np.where(turned, motion.turn.T @ channel.rotation, channel.rotation),
            exists=exists,
        )

    return replace(stack, channels=tuple(seen(channel) for channel in stack.channels))
