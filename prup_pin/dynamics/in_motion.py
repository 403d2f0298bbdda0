"""A robot in one recorded motion, as laws of the effort channel see it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from ..errors import InputError
from ..mechanism import Mechanism
from ..spatial import Array
from .inverse import InverseDynamics, Trajectory
from .motion import Motion
from .smoothing import differences, pieces
from .travel import Path, Travel

#: Share of its size that gravity may differ by where it pulls another way than drawn.
_SAME_SIZE = 0.05

#: Below this share of its usual speed a joint without a sensor of its own counts as slow.
_SLOW_SHARE = 1e-2
#: Samples per period of the efforts' band at which derivatives are computed.
_SAMPLES = 4.0
#: Of the shift along the motion for a numerical derivative [s].
_STEP = 1e-4
#: Of the largest effort, below which one is nothing but rounding.
_ROUNDING = 1e-12
#: Bins of a joint's travel in which periods are looked for: twenty in the shortest one.
_BINS = 8192


@dataclass(frozen=True, eq=False)
class _Nearby:
    """Two motions at some samples `rows` of another one, in which one joint is a little `ahead` and `behind`."""

    rows: np.ndarray
    wrench: Array | None
    gravity: Array | None
    ahead: Trajectory
    behind: Trajectory


@dataclass(frozen=True, eq=False)
class InMotion:
    """N samples of a motion, and the rigid robot's efforts (N, k) [N or N m] of the joints `driven` in it.

    `known` (N, k): the efforts as far as they are known beside the rigid robot's, of which `bodies` (N, k) weigh or
    are accelerated; `left` (N, k): what is measured beyond all of that. None: nothing yet. `added`: by joint, what its
    body is known to have beyond the drawn inertial parameters (10,), about the joint's frame.
    """

    mechanism: Mechanism
    motion: Motion
    dynamics: InverseDynamics
    trajectory: Trajectory
    rigid: Array
    known: Array | None = None
    left: Array | None = None
    bodies: Array | None = None
    added: Mapping[int, Array] = field(default_factory=dict)

    @classmethod
    def of(cls, mechanism: Mechanism, motion: Motion) -> InMotion:
        """Return the robot in a motion. Raises InputError where its loops cannot be closed."""
        dynamics = InverseDynamics(mechanism, motion.driven)
        trajectory = dynamics.trajectory(motion)
        rigid = dynamics.efforts(trajectory, motion.wrench, motion.gravity)
        return cls(mechanism, motion.bridged(rigid), dynamics, trajectory, rigid)

    def __len__(self) -> int:
        return len(self.motion)

    @property
    def driven(self) -> tuple[str, ...]:
        """The joints whose efforts are compared."""
        return self.motion.driven

    @property
    def temperature(self) -> Array:
        """The temperature (N,) [deg C]. Raises InputError where none was recorded."""
        if self.motion.temperature is None:
            raise InputError("a law follows the temperature, and the recording has no column temperature")
        return self.motion.temperature

    def knowing(
        self, known: Array, left: Array, bodies: Array | None = None, added: Mapping[int, Array] | None = None
    ) -> InMotion:
        """Return the same motion with more known of its efforts, and of its bodies."""
        return self._as_moved(replace(self, known=known, left=left, bodies=bodies, added=dict(added or {})))

    def measuring(self, efforts: Array) -> InMotion:
        """Return the same motion with other measured efforts (N, k)."""
        return self._as_moved(replace(self, motion=replace(self.motion, efforts=efforts)))

    def _as_moved(self, other: InMotion) -> InMotion:
        """Return another view of the same motion with what was computed of it."""
        for name in ("regressor", "reached_by_tool"):
            if name in self.__dict__:
                other.__dict__[name] = self.__dict__[name]
        for name in ("_nearby", "_changes", "_travels"):
            other.__dict__[name] = getattr(self, name)
        return other

    @property
    def predicted(self) -> Array:
        """The efforts (N, k) as far as they are known."""
        return self.rigid if self.known is None else self.rigid + self.known

    @property
    def borne(self) -> Array:
        """The efforts (N, k) of all bodies, as far as they are known: those of the robot file, and other ones."""
        return self.rigid if self.bodies is None else self.rigid + self.bodies

    @property
    def unborne(self) -> Array:
        """The known efforts (N, k) that no body asks for: friction, springs and the like, each of its own joint."""
        if self.known is None:
            return np.zeros_like(self.rigid)
        return self.known if self.bodies is None else self.known - self.bodies

    @cached_property
    def regressor(self) -> Array:
        """Efforts per inertial parameter of each joint's body, (N, k, bodies, 10)."""
        return self.dynamics.regressor(self.trajectory, self.motion.gravity)

    @cached_property
    def reached_by_tool(self) -> tuple[Array, Array]:
        """The tool point's position (N, 3) [m] in base axes, and what drives feel (N, k, 3) per force on it there."""
        return self.dynamics.reached_by_tool(self.trajectory)

    def position(self, joint: str) -> Array:
        """Return a joint's position (N,) [m or rad], an endless one's without jumps."""
        if joint in self.motion.names:
            return self.motion.position[:, self.motion.names.index(joint)]
        return np.unwrap(self.mechanism.joint(joint).position(self.trajectory.q))

    def speed(self, joint: str) -> Array:
        """Return a joint's speed (N,) [m/s or rad/s]."""
        return self.trajectory.v[:, self.mechanism.joint(joint).first_v]

    def acceleration(self, joint: str) -> Array:
        """Return a joint's acceleration (N,)."""
        return self.trajectory.a[:, self.mechanism.joint(joint).first_v]

    def slow(self, joint: str) -> float:
        """Return the speed below which the sensors cannot tell a joint's direction."""
        if joint in self.motion.names:
            return float(self.motion.slow[self.motion.names.index(joint)])
        return float(_SLOW_SHARE * np.sqrt(np.mean(self.speed(joint) ** 2)) + np.finfo(float).tiny)

    def direction(self, joint: str) -> Array:
        """Return the sign of a joint's speed (N,), with a smooth passage where the sensors cannot tell it."""
        speed = self.speed(joint)
        return speed / np.hypot(speed, self.slow(joint))

    def travel(self, shares: Mapping[str, float]) -> Travel:
        """Return the travel [m or rad] of what moves by shares of joints' ways, by the joints' names."""
        key = tuple(shares.items())
        if key not in self._travels:
            names = self.motion.names
            if all(name in names for name in shares):
                travel = self.motion.path.travel([shares.get(name, 0.0) for name in names])
            else:
                position, speed = (
                    np.column_stack([values(name) for name in shares]) for values in (self.position, self.speed)
                )
                path = Path.of(position, speed, self.motion.time, self.motion.piece)
                travel = path.travel(list(shares.values()))
            self._travels[key] = travel
        return self._travels[key]

    def dragged(self, joint: str, way: float) -> Array:
        """Return the direction of a joint's dry friction (N,), which turns round on some way [m or rad]."""
        return self.travel({joint: 1.0}).direction(way)

    def rubbing(
        self,
        shares: Mapping[str, float],
        values: Mapping[str, float],
        acts: Callable[[Array], Array] = np.ones_like,
    ) -> Array:
        """Return how much of the dry friction of what moves by shares of joints' ways acts, and which way (N,).

        It turns round on a way, 'presliding', and sets in with the speed, below 'smoothing'; acts: the share of it that
        acts at a speed (M,) beside that.
        """
        smoothing = values.get("smoothing", 0.0)
        sets_in = (lambda speed: np.tanh(np.abs(speed) / smoothing)) if smoothing > 0 else np.ones_like
        return self.travel(shares).direction(values["presliding"], lambda speed: sets_in(speed) * acts(speed))

    def loose(self, joint: str, gap: float) -> Array:
        """Return 1 where a joint is on its way through a gap [m or rad] after the motion turned round, else 0, (N,)."""
        out, position = np.zeros(len(self)), self.position(joint)
        for where in pieces(self.motion.piece):
            here, half = position[where], 0.5 * gap
            steps = np.diff(here, prepend=here[0])
            towards = np.sign(steps)
            moving = np.flatnonzero(towards)
            if not len(moving):
                continue
            last = np.maximum.accumulate(np.where(towards != 0, np.arange(len(here)), moving[0]))
            turns = np.concatenate(([0], np.flatnonzero(np.diff(towards[last])) + 1, [len(here)]))
            flank = half * towards[moving[0]]  # where the motor leans, from the middle of the gap
            for first, end in pairwise(turns.tolist()):
                along = np.clip(flank + here[first:end] - here[max(first - 1, 0)], -half, half)
                out[where.start + first : where.start + end] = np.abs(along) < half
                flank = float(along[-1])
        return out

    def moves(self, joint: str) -> bool:
        """Return whether a joint moves at all, by more than the rounding of filters."""
        position = self.position(joint)
        return bool(np.ptp(position) > _ROUNDING * np.abs(position).max())

    def shows(self, joint: str) -> bool:
        """Return whether an effort along a joint reaches a drive whose effort is compared."""
        dof = self.mechanism.joint(joint).first_v
        spread = self.trajectory.spread
        return bool((self.trajectory.dofs == dof).any() if spread is None else spread[:, dof].any())

    def along(self, joint: str, effort: Array) -> Array:
        """Return what the drives give (N, k, ...) for efforts (N, ...) needed along a joint, be it driven or not."""
        dof, spread = self.mechanism.joint(joint).first_v, self.trajectory.spread
        shares = self.trajectory.dofs == dof if spread is None else spread[:, dof]
        return shares.reshape(*shares.shape, *(1,) * (effort.ndim - 1)) * effort[:, None]

    def effort_of(self, joint: str, efforts: Array) -> Array:
        """Return the column (N,) of one driven joint; zero of another."""
        return efforts[:, self.driven.index(joint)] if joint in self.driven else np.zeros(len(self))

    def rate(self, values: Array) -> Array:
        """Return the rate of change of values (N, ...)."""
        if self.motion.separate:
            return np.zeros_like(values)
        return differences(values, self.motion.piece, 1 / self.motion.rate)

    def rigid_of(self, motion: Motion) -> Array:
        """Return the rigid robot's efforts (n, k) in another motion of the same joints."""
        return self.dynamics.efforts(self.dynamics.trajectory(motion), motion.wrench, motion.gravity)

    def rigid_under(self, gravity: Array) -> Array:
        """Return the efforts (N, k) of all known bodies that a field of gravity (3,) [m/s^2] alone asks for."""
        still = replace(self.trajectory, v=0 * self.trajectory.v, a=0 * self.trajectory.a)
        return self.dynamics.efforts(still, None, gravity, self.added)

    def periods(self, joint: str, fewest: float, most: float, step: float, count: int = 3) -> list[float]:
        """Return how many periods in a joint's travel what is left has, strongest first; at most `count` of them."""
        if self.left is None or joint not in self.driven:
            return []
        numbers = step * np.arange(round(fewest / step), round(most / step))
        # sums over narrow bins of the travel, followed by zeros so that a transform's lines are `step` apart
        sums = np.bincount(self._bins(joint, _BINS), self.effort_of(joint, self.left), _BINS)
        lines = np.abs(np.fft.rfft(sums, round(_BINS / step)))
        power = lines[round(fewest / step) : round(most / step)]
        found: list[float] = []
        for index in np.argsort(-power):
            if all(abs(numbers[index] - other) > 2.0 for other in found):
                found.append(float(numbers[index]))
            if len(found) == count:
                break
        return found

    def left_by_position(self, joint: str, count: int) -> tuple[Array, Array, Array]:
        """Return positions in the bins (b,) of a joint's travel that it passes, of `count`; the mean of what is left of
        its effort there times a weight (b,), and the weights (b,), the roots of how many samples are there.

        Empty where nothing is known to be left.
        """
        if self.left is None or joint not in self.driven or not np.ptp(self.position(joint)) > 0:
            return np.zeros(0), np.zeros(0), np.zeros(0)
        bins = self._bins(joint, count)
        counts = np.bincount(bins, minlength=count)
        there = counts > 0
        positions, sums = (
            np.bincount(bins, values, count)[there]
            for values in (self.position(joint), self.effort_of(joint, self.left))
        )
        root = np.sqrt(counts[there])
        return positions / root**2, sums / root, root

    def _bins(self, joint: str, count: int) -> np.ndarray:
        """Return the bin (N,) of a joint's travel, of so many, in which it is at each sample."""
        position = self.position(joint)
        return np.rint((position - position.min()) / np.ptp(position) * (count - 1)).astype(int)

    def later(self, values: Array, delay: float) -> Array:
        """Return by how much values (N, ...) of `delay` [s] ago differ from those of now."""
        return self._ago(_splines(self.motion, values), values, delay)

    def predicted_later(self, delay: float | Array) -> Array:
        """Return by how much the predicted efforts (N, k) of `delay` [s] ago, one or (N,), differ from those of now."""
        return self._ago(self._predicted_splines, self.predicted, delay)

    @cached_property
    def _predicted_splines(self) -> list:
        return _splines(self.motion, self.predicted)

    def _ago(self, splines: list, values: Array, delay: float | Array) -> Array:
        out, ago = np.zeros_like(values), self.motion.time - delay
        if self.motion.separate or not np.any(delay):
            return out
        for where, spline in zip(pieces(self.motion.piece), splines, strict=True):
            time = self.motion.time[where]
            out[where] = spline(np.clip(ago[where], time[0], time[-1])) - values[where]
        return out

    def shifted(self, joint: str) -> Array:
        """Return d(efforts)/dt (N, k) of all known bodies by the motion of one joint alone, as of an early encoder."""

        def rates() -> tuple[Array, Array, Array]:
            column = self.motion.names.index(joint)
            speed, acceleration = self.motion.speed[:, column], self.motion.acceleration[:, column]
            return speed, acceleration, self.rate(acceleration)

        return self._kept_derivative("shifted", joint, rates)

    @cached_property
    def _nearby(self) -> dict[tuple[str, str], _Nearby]:
        """Motions beside this one in which one joint is elsewhere, by how and which."""
        return {}

    @cached_property
    def _changes(self) -> dict[tuple[str, str], tuple[dict[int, bytes], Array]]:
        """What efforts differ by in these, and beside which bodies."""
        return {}

    @cached_property
    def _travels(self) -> dict[tuple[tuple[str, float], ...], Travel]:
        return {}

    def yielded(self, joint: str) -> Array:
        """Return d(efforts)/dc (N, k) of all known bodies by the compliance c of one joint's gear, behind the encoder.

        The links lag behind the encoder by c times what bodies, as far as they are known, ask of the joint.
        """
        column, passed = self.motion.names.index(joint), self.effort_of(joint, self.borne)
        largest = float(np.abs(passed).max(initial=0.0))
        if not largest > _ROUNDING * np.abs(self.rigid).max(initial=0.0):
            return np.zeros_like(self.rigid)  # of a link that turns about its own axis of symmetry
        back = -passed / largest
        speed = self.rate(back)
        return self._derivative(column, back, speed, self.rate(speed)) * (largest / _STEP)

    def displaced(self, joint: str) -> Array:
        """Return d(efforts)/dq (N, k) of all known bodies by the position of one joint."""
        one, zero = np.ones(len(self)), np.zeros(len(self))
        return self._kept_derivative("displaced", joint, lambda: (one, zero, zero))

    def _kept_derivative(self, how: str, joint: str, rates: Callable[[], tuple[Array, Array, Array]]) -> Array:
        """Return the change of efforts (N, k) per rates (N,) of one joint; motions beside and the last are kept."""
        key, bodies = (how, joint), {index: more.tobytes() for index, more in self.added.items()}
        if key not in self._nearby:
            self._nearby[key] = self._beside(self.motion.names.index(joint), *rates())
        if key not in self._changes or self._changes[key][0] != bodies:
            self._changes[key] = bodies, self._change(self._nearby[key]) / _STEP
        return self._changes[key][1]

    def _derivative(self, column: int, position: Array, speed: Array, acceleration: Array) -> Array:
        """Return by how much efforts (N, k) of known bodies change as one joint moves by `_STEP` times rates (N,)."""
        return self._change(self._beside(column, position, speed, acceleration))

    def _beside(self, column: int, position: Array, speed: Array, acceleration: Array) -> _Nearby:
        """Return the motions half a `_STEP` times rates (N,) of one joint before and behind this one.

        At as many samples as the band of the efforts needs.
        """
        motion = self.motion
        every = 1 if motion.separate else max(1, int(motion.rate / (_SAMPLES * motion.band.highest)))
        parts = [np.unique(np.append(np.arange(w.start, w.stop, every), w.stop - 1)) for w in pieces(motion.piece)]
        rows = np.concatenate(parts)
        few, beside = motion.select(rows), []
        rates = [rate[rows] for rate in (position, speed, acceleration)]
        for sign in (0.5, -0.5):
            moved = []
            for table, rate in zip((few.position, few.speed, few.acceleration), rates, strict=True):
                other = table.copy()
                other[:, column] += sign * _STEP * rate
                moved.append(other)
            beside.append(self.dynamics.trajectory(few.with_motion(*moved)))
        return _Nearby(rows, few.wrench, few.gravity, beside[0], beside[1])

    def _change(self, nearby: _Nearby) -> Array:
        """Return by how much efforts (N, k) of known bodies change between two motions, smoothly between samples."""
        motion, rows = self.motion, nearby.rows
        ahead, behind = (
            self.dynamics.efforts(trajectory, nearby.wrench, nearby.gravity, self.added)
            for trajectory in (nearby.ahead, nearby.behind)
        )
        change = ahead - behind
        if len(rows) == len(self):
            return change
        from scipy.interpolate import CubicSpline

        out = np.empty_like(self.rigid)
        for where in pieces(motion.piece):
            here = (rows >= where.start) & (rows < where.stop)
            out[where] = CubicSpline(motion.time[rows[here]], change[here], axis=0)(motion.time[where])
        return out


class Explained:
    """What laws add to the rigid robot's efforts in a motion, one after the other: the next ones act on what is known.

    efforts, bodies (N, k) [N or N m]: of all, and of bodies among them. added: by joint, what its body has beyond
    the drawn inertial parameters (10,).
    """

    def __init__(self, at: InMotion):
        self.at, self.added = at, dict[int, Array]()
        self.efforts, self.bodies = np.zeros_like(at.rigid), np.zeros_like(at.rigid)

    def add(self, efforts: Array, of_bodies: bool = False, inertial: Mapping[int, Array] | None = None) -> None:
        """Add the efforts (N, k) of one more law, and what it adds to bodies (10,), by joint."""
        self.efforts = self.efforts + efforts
        if of_bodies:
            self.bodies = self.bodies + efforts
        for joint, more in (inertial or {}).items():
            self.added[joint] = self.added.get(joint, np.zeros(10)) + more

    @property
    def known(self) -> InMotion:
        """The motion with all of this known."""
        left = self.at.motion.efforts - self.at.rigid - self.efforts
        return self.at.knowing(self.efforts, left, self.bodies, self.added)


def could_be_gravity(field: Array, mechanism: Mechanism) -> bool:
    """Return whether a field (3,) [m/s^2] could be gravity, whichever way it pulls: as strong as the robot file's."""
    size = float(np.linalg.norm(mechanism.gravity))
    return bool(abs(np.linalg.norm(field) - size) < _SAME_SIZE * size)


def _splines(motion: Motion, values: Array) -> list:
    from scipy.interpolate import CubicSpline  # heavy; not needed to load a robot

    if motion.separate:
        return []
    return [CubicSpline(motion.time[where], values[where], axis=0) for where in pieces(motion.piece)]
