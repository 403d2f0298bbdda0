"""Where the pose sensor stands: the rigid motion between its frame and the robot's base, in closed form.

Calibration steps from what is nearly right; a tracker may stand anywhere: `spatial.rigid_motion` tells where. Where a
marker sits beside its frame is looked for with it, where its tolerance leaves that open, nothing else fits, or far less
is left. Points far off weigh little.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..channels import Channel, Linear, PoseChannel, Stack, Stations
from ..laws import Effect, Sharing, stands_elsewhere
from ..mechanism import Mechanism
from ..numbers import number
from ..recordings import ARM, Recording, Together
from ..spatial import Array, skew, turn_between
from .criteria import (
    FAR_LESS,
    FEWEST_REGISTERED,
    LEAST_REACH,
    LEVER,
    MOST,
    OPEN_FRAME,
    OPEN_TARGET,
    TURNED,
)
from .rigid_fit import RigidFit, rigid_fit

__all__ = ["Registered", "own_frames", "registered", "worlds_apart"]

#: What to declare where a pose sensor was set up anew.
OWN_FRAMES = 'where that is so, declare "own_sensors": ["pose_sensor"]'
OWN_STATIONS = 'where that is so, declare "own_sensors": {"by_run": ["pose_sensor"]}'


@dataclass(frozen=True, eq=False)
class Registered:
    """What was measured, seen from the robot's base; for each sensor that stands elsewhere an effect and a sentence.

    `found` are those that nothing declared: findings. The others are what tolerances left open.
    """

    stack: Stack
    effects: tuple[Effect, ...] = ()
    found: tuple[Effect, ...] = ()
    deviations: tuple[Array, ...] = ()  # (6,) of each one found
    remarks: tuple[str, ...] = ()
    beside: float = 0.0  # how far a marker sits beside its frame at most, where that had to be found too [m]

    @property
    def every(self) -> tuple[Effect, ...]:
        """All effects, whether declared or found."""
        return (*self.effects, *self.found)

    def open(self, recording: Recording) -> Recording:
        """Return a recording whose tolerances leave open where a sensor stands that was found elsewhere.

        What was left out has bent the closed form a little, and must not stay in it.
        """
        if not self.found:
            return recording
        frame = {"frame_position": ARM.frame_position, "frame_rotation": ARM.frame_rotation}
        return replace(recording, tolerances=replace(recording.tolerances, **frame))


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
    groups: Sequence[Sharing | None] = stations or together.groups.get("pose_sensor") or (None,)
    for group in groups:
        here = np.ones(len(together.which), bool) if group is None else np.isin(together.setups, group.sources)
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
        near = not _some_apart(_seen_from_base(stack, motion, here), linear, [here], reach, zeros=True)
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


def _some_apart(
    stack: Stack, linear: Linear, parts: Sequence[np.ndarray], allowed: tuple[float, float], zeros: bool = False
) -> bool:
    return any(any(worlds_apart(each, linear, here, allowed, zeros)) for each in stack.poses for here in parts)


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
