"""How unlikely are efforts, as a log is read? By bodies near the drawing, and by what drives need besides.

tau = Y b + friction + rotor + offset, with inertial parameters b that all joints share and whose prior is the robot
file's; friction and rotors take energy from the motion and give none, be they of a joint or of a motor that drives two.
What is left at a joint is noise of a size of its own. Readings of a log compete by this one score, in nats: drawings of
real robots are off by tens of per cent, and a rigid robot as drawn tells nothing of most of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from ...dynamics import InMotion, Motion
from ...errors import InputError
from ...laws.efforts.effort_law import motor_pairs
from ...spatial import Array
from ..criteria import AS_GOOD, FEW_ROUNDS, LITTLE, NO_MATTER, ROUNDING
from .joint_equations import BodyPrior, JointEquations, gram_of

#: By how much, in nats, a log must be likelier as it is read otherwise.
SURELY = 25.0
#: Samples of each joint that count, of all that are looked at: what a model of a real robot leaves is no white noise.
_COUNTED = 60.0


@dataclass(frozen=True, eq=False)
class Unlikely:
    """Minus the logarithm of the likelihood of efforts, less a constant; shares (k,) of each joint's squares left.

    surely: whether no other way to read them could be surely likelier.
    """

    nats: float
    shares: Array
    surely: bool = False

    @property
    def left(self) -> float:
        """What is left of the efforts, a share: the root mean square over the joints."""
        known = self.shares[~np.isnan(self.shares)]
        return float(np.sqrt(known.mean())) if len(known) else 0.0


class _Fitted(NamedTuple):
    """How unlikely each effort is (k,), and bodies are beside it, in nats: by what they are off, and by how many others
    they might have been; x (p,): coefficients of all columns."""

    nats: Array
    bodies: float
    x: Array


class EffortLikelihood:
    """The model of a robot by which motions and efforts are judged; `count`: as many samples tell their band.

    Its columns: of bodies, in standard deviations of their prior, of offsets of the drives, and of what takes energy.
    """

    def __init__(self, at: InMotion, tolerances: Mapping[str, float], count: int):
        self.at, self.count = at, min(float(count), _COUNTED)
        self._prior = BodyPrior.of(at.mechanism, tolerances)
        self._ways, self._sharing = self._motors()
        self._last: tuple[bytes, Array, Array] = b"", np.zeros(0), np.zeros(0)

    def __call__(self, motion: Motion, efforts: Array, noise: Array, made_of: Array) -> Unlikely:
        """Return how unlikely efforts (n, k) are in a motion; without end where loops do not close.

        noise (j,): of a sample of each effort that was written; made_of (j, k): which of them add up to those that are
        read.
        """
        try:
            columns, gram = self._columns(motion)
        except InputError:
            return Unlikely(np.inf, np.full(efforts.shape[1], np.inf))
        bodies, count = len(self._prior.drawn), len(efforts)
        offsets = slice(bodies, bodies + efforts.shape[1])
        size = np.sqrt((efforts**2).sum(axis=0))
        seen = size > 0
        scale = np.divide(1.0, size, where=seen, out=0 * size)
        floor = NO_MATTER**2 + (noise**2 @ made_of**2) * scale**2 * count
        # in shares of the efforts, where what drives need may be anything: columns as long as one; but an offset is
        # known to be small beside what a drive gives
        lengths = np.sqrt(scale**2 @ np.einsum("kpp->kp", gram))
        units = np.divide(1.0, lengths, where=lengths > 0, out=0 * lengths)
        units[:bodies], units[offsets] = 1.0, LITTLE * units[offsets]
        own, nothing = JointEquations.of(columns, efforts, gram).scaled(scale, units), np.zeros_like(units)
        drawing = np.append(self._prior.drawn, nothing[bodies:])
        as_drawn = own.less(drawing)
        still = self._fitted(own.without(bodies), 0, floor, nothing)
        drawn = self._fitted(as_drawn.without(bodies), 0, floor, drawing)
        near = self._fitted(as_drawn, bodies, floor, drawing)
        # noise of positions may make more of a light joint's body than all that it gives
        fit = min((drawn, near), key=lambda one: np.minimum(one.nats, still.nats)[seen].sum() + one.bodies)
        moved = fit.nats < still.nats
        left = (efforts - np.where(moved, *(columns @ (units * one.x) for one in (fit, still)))) * seen
        # what is left is noise of efforts as they are written: what two have in common stays there in any sum of them
        to_written = np.linalg.inv(made_of)
        squares, written = (((each @ to_written) ** 2).sum(axis=0) for each in (efforts, left))
        known = squares > 0
        least = NO_MATTER**2 * squares[known] + noise[known] ** 2 * count
        more = 0.5 * self.count * float(np.log(np.maximum(written[known] / least, 1.0)).sum()) + fit.bodies
        more += 0.5 * float((np.where(moved, fit.x[offsets], still.x[offsets])[seen] ** 2).sum())
        more += self._beyond(motion) * self.count  # each as much as all of its samples
        shares = np.where(seen, np.minimum((left**2).sum(axis=0) * scale**2, 100.0), np.nan)
        return Unlikely(more + 0.5 * self.count * float(np.log(least).sum()), shares, more < SURELY)

    def _fitted(self, equations: JointEquations, bodies: int, floor: Array, beside: Array) -> _Fitted:
        """Return the likeliest coefficients of bodies, of an offset at each joint, and of what takes energy.

        The first ones are free, with a variance of one; of the others, which are not negative, nothing is known. floor
        (k,): squares below which what is left speaks for nothing; beside (p,): coefficients that are there.
        """
        count, free = equations.moment.shape[1], bodies + len(floor)
        prior = np.repeat([1.0, ROUNDING], [free, count - free])
        weights = np.full(len(floor), self.count / LITTLE)
        for _ in range(FEW_ROUNDS):
            precision = equations.weighted(weights)
            precision.flat[:: count + 1] += prior
            unit = 1 / np.sqrt(np.diag(precision))
            matrix = precision * unit[:, None] * unit
            matrix.flat[:: count + 1] += ROUNDING * count
            right, cross = (weights @ equations.moment) * unit, matrix[free:, :free]
            solved = np.linalg.solve(matrix[:free, :free], np.column_stack((cross.T, right[:free])))
            across, alone = solved[:, :-1], solved[:, -1]
            root = np.linalg.cholesky(matrix[free:, free:] - cross @ across)
            taken = nnls(root.T, np.linalg.solve(root, right[free:] - cross @ alone))[0]
            x = unit * np.append(alone - across @ taken, taken)
            left = np.maximum(equations.left(x), 0.0)
            weights = self.count / np.maximum(left, LITTLE**2)
        nats = 0.5 * self.count * np.log(np.maximum(left / floor, 1.0)) + 0.5 * x[bodies:free] ** 2
        by_bodies = x[:bodies] @ x[:bodies] + np.linalg.slogdet(precision[:bodies, :bodies])[1]
        return _Fitted(nats, 0.5 * float(by_bodies), beside + np.append(np.zeros(len(beside) - count), x))

    def _beyond(self, motion: Motion) -> int:
        """Return how many joints travel farther or faster than they can, by far."""
        model, (lower, upper), count = self.at.mechanism.model, self.at.mechanism.limits, 0
        for column, name in enumerate(motion.names):
            joint = self.at.mechanism.joint(name)
            if joint.nq == 1:
                way, fastest = upper[joint.first_q] - lower[joint.first_q], model.velocityLimit[joint.first_v]
                farther = np.ptp(motion.position[:, column]) > AS_GOOD * way
                faster = np.abs(motion.speed[:, column]).max() > AS_GOOD * fastest > 0
                count += bool(farther or faster)
        return count

    def _motors(self) -> tuple[Array, np.ndarray]:
        """Return how motors turn with joints (k, m), each with one, or with the sum or difference of two; and with
        which ones each of them turns (m, k).
        """
        driven = list(self.at.driven)
        pairs = {tuple(sorted(pair)) for pair in motor_pairs(self.at.mechanism) if {*pair} <= {*driven}}
        each = np.eye(len(driven))
        both = [(each[driven.index(one)], each[driven.index(other)]) for one, other in sorted(pairs)]
        ways = np.array([*each, *(way for one, other in both for way in (one + other, one - other))]).T
        return ways, ways.T != 0

    def _columns(self, motion: Motion) -> tuple[Array, Array]:
        """Return the columns (n, k, p) of a motion and their products (k, p, p), the same ones for the same motion."""
        key = b"".join(part.tobytes() for part in (motion.position, motion.speed, motion.acceleration))
        if self._last[0] != key:
            columns = self._made(motion)
            self._last = key, columns, gram_of(columns)
        return self._last[1:]

    def _made(self, motion: Motion) -> Array:
        at, names = self.at, self.at.driven
        trajectory = at.dynamics.trajectory(motion)
        bodies = self._prior.columns(at.dynamics.regressor(trajectory, motion.gravity))
        first = [at.mechanism.joint(name).first_v for name in names]
        own = dict(zip(motion.names, motion.slow, strict=True))
        slow = np.array([own[name] if name in own else at.slow(name) for name in names])
        # dry and viscous friction and a rotor of each motor
        speed, acceleration = trajectory.v[:, first] @ self._ways, trajectory.a[:, first] @ self._ways
        dry = speed / np.hypot(speed, np.where(self._sharing, slow, 0.0).max(axis=1))
        parts = np.stack((dry, speed, acceleration), axis=-1)  # (n, m, 3)
        taking = self._ways[:, :, None] * parts[:, None]
        offsets = np.broadcast_to(np.eye(len(names)), (len(motion), len(names), len(names)))
        return np.concatenate((bodies, offsets, taking.reshape(*offsets.shape[:2], -1)), axis=2)
