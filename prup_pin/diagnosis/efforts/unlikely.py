"""How unlikely are efforts, as a log is read? By bodies near the drawing, and by what drives need besides.

tau = Y b + friction + rotor + offset, with inertial parameters b that all joints share and whose prior is the robot
file's; friction and rotors take energy from the motion and give none, be they of a joint or of a motor that drives two.
What is left at a joint is noise of a size of its own. Readings of a log compete by this one score, in nats: drawings of
real robots are off by tens of per cent, and a rigid robot as drawn tells nothing of most of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve, cholesky, solve_triangular
from scipy.optimize import nnls

from ...dynamics import InMotion, Motion
from ...errors import InputError
from ...laws.efforts.effort_law import motor_pairs
from ...spatial import Array
from ..criteria import AS_GOOD, FEW_ROUNDS, LITTLE, NO_MATTER, ROUNDING
from .gains import drawn_bodies

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


@dataclass(frozen=True, eq=False)
class _Columns:
    """Efforts (n, k, p) per coefficient in a motion: of bodies, in spreads of the prior, and of what drives need."""

    drawn: Array  # (n, k): of the bodies as drawn
    bodies: Array
    offsets: Array
    taking: Array  # what cannot be negative


class _Fitted(NamedTuple):
    """How unlikely each effort is (k,) and bodies are beside it, in nats: by what they are off, and by how many others
    they might have been; left (k,): shares of squares."""

    nats: Array
    bodies: float
    left: Array


class EffortLikelihood:
    """The model of a robot by which motions and efforts are judged; `count`: as many samples tell their band."""

    def __init__(self, at: InMotion, tolerances: dict[str, float], count: int):
        self.at, self.count = at, min(float(count), _COUNTED)
        drawn, spread = drawn_bodies(at, tolerances)
        self._there, self._drawn = np.flatnonzero(spread > 0), drawn
        self._spread = spread[self._there]
        self._pairs = sorted({tuple(sorted(pair)) for pair in motor_pairs(at.mechanism) if {*pair} <= {*at.driven}})
        self._last: tuple[bytes, _Columns] = b"", _Columns(*(np.zeros(0),) * 4)

    def __call__(self, motion: Motion, efforts: Array, noise: Array, made_of: Array) -> Unlikely:
        """Return how unlikely efforts (n, k) are in a motion; without end where loops do not close.

        noise (j,): of a sample of each effort that was written; made_of (j, k): which of them add up to those that are
        read.
        """
        try:
            columns = self._columns(motion)
        except InputError:
            return Unlikely(np.inf, np.full(efforts.shape[1], np.inf))
        size = np.sqrt((efforts**2).sum(axis=0))
        seen = size > 0
        scale = np.where(seen, 1 / np.where(seen, size, 1.0), 0.0)

        def alike(part: Array) -> Array:
            """Return columns as long as one, in shares of the efforts: nothing is known of their coefficients."""
            own = part * scale[:, None]
            return np.asarray(own / np.maximum(np.linalg.norm(own, axis=(0, 1)), np.finfo(float).tiny))

        floor = NO_MATTER**2 + (noise**2 @ made_of**2) * scale**2 * len(efforts)
        # an offset is known to be small beside what a drive gives, all else may be anything
        bodies, offsets, taking = (
            columns.bodies * scale[:, None],
            LITTLE * alike(columns.offsets),
            alike(columns.taking),
        )
        as_drawn, own = (efforts - columns.drawn) * scale, efforts * scale
        still, drawn = (self._fitted(bodies[..., :0], offsets, taking, each, floor) for each in (own, as_drawn))
        near = self._fitted(bodies, offsets, taking, as_drawn, floor)
        # noise of positions may make more of a light joint's body than all that it gives
        costs = [float(np.minimum(fit.nats, still.nats)[seen].sum()) + fit.bodies for fit in (drawn, near)]
        fit, more = (drawn, near)[int(np.argmin(costs))], min(costs)
        left = np.where(fit.nats < still.nats, fit.left, still.left)
        more += self._beyond(motion) * self.count  # each as much as all of its samples
        # in the units and sums in which they were written: a larger effort that is added to a noisy one leaves no less
        made = made_of[(made_of[:, seen] != 0).any(axis=1)]
        written = np.log(size[seen]).sum() - 0.5 * np.linalg.slogdet(made @ made.T)[1]
        nats = self.count * float(0.5 * np.log(floor[seen]).sum() + written) + more
        return Unlikely(nats, np.minimum(np.where(seen, left, np.nan), 100.0), more < SURELY)

    def _fitted(self, bodies: Array, offsets: Array, taking: Array, target: Array, floor: Array) -> _Fitted:
        """Return what bodies (n, k, p) about the drawing, offsets (n, k, k) and what takes energy (n, k, m) leave.

        target (n, k): what they are to make up for; floor (k,): squares below which what is left speaks for nothing.
        """
        columns = np.concatenate((bodies, offsets, taking), axis=2)
        count, bounded = bodies.shape[2], taking.shape[2]
        prior = np.repeat([1.0, ROUNDING], [columns.shape[2] - bounded, bounded])
        left, x, matrix = self._least(columns, target, prior, bounded)
        nats = 0.5 * self.count * np.log(np.maximum(left / floor, 1.0)) + 0.5 * x[count : count + len(left)] ** 2
        freedom = float(np.linalg.slogdet(matrix[:count, :count])[1]) if count else 0.0
        return _Fitted(nats, 0.5 * float((x[:count] ** 2).sum()) + 0.5 * freedom, left)

    def _least(self, columns: Array, target: Array, prior: Array, bounded: int) -> tuple[Array, Array, Array]:
        """Return the squares (k,) that are left of targets (n, k) by the likeliest coefficients of columns (n, k, p),
        these (p,), and what they are known by, an inverse covariance (p, p).

        The last ones are not negative; prior (p,): inverse variances.
        """
        by_joint = np.ascontiguousarray(columns.transpose(1, 0, 2))  # (k, n, p)
        gram, moment = by_joint.mT @ by_joint, (by_joint.mT @ target.T[..., None])[..., 0]
        power = (target**2).sum(axis=0)
        weight = np.full(len(power), self.count / LITTLE)
        free = len(prior) - bounded
        for _ in range(FEW_ROUNDS):
            told = np.diag(prior) + np.tensordot(weight, gram, 1)
            unit = 1 / np.sqrt(np.diag(told))
            matrix = told * unit[:, None] * unit + ROUNDING * len(unit) * np.eye(len(unit))
            right = (weight @ moment) * unit
            inner = cho_factor(matrix[:free, :free])
            across = cho_solve(inner, matrix[:free, free:])
            root = cholesky(matrix[free:, free:] - matrix[free:, :free] @ across, lower=True)
            taken = nnls(root.T, solve_triangular(root, right[free:] - across.T @ right[:free], lower=True))[0]
            x = unit * np.append(cho_solve(inner, right[:free] - matrix[:free, free:] @ taken), taken)
            left = np.maximum(power - 2 * moment @ x + (gram @ x) @ x, 0.0)
            weight = self.count / np.maximum(left, LITTLE**2)
        return left, x, told

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

    def _columns(self, motion: Motion) -> _Columns:
        key = b"".join(
            np.ascontiguousarray(part).tobytes() for part in (motion.position, motion.speed, motion.acceleration)
        )
        if self._last[0] != key:
            self._last = key, self._made(motion)
        return self._last[1]

    def _made(self, motion: Motion) -> _Columns:
        at, names = self.at, self.at.driven
        trajectory = at.dynamics.trajectory(motion)
        every = at.dynamics.regressor(trajectory, motion.gravity).reshape(len(motion), len(names), -1)
        n, k = every.shape[:2]
        first = [at.mechanism.joint(name).first_v for name in names]
        speed, acceleration = trajectory.v[:, first], trajectory.a[:, first]
        own = dict(zip(motion.names, motion.slow, strict=True))
        slow = np.array([own[name] if name in own else at.slow(name) for name in names])
        taking = []

        def beside(ways: Array, least: float) -> None:
            """Add dry and viscous friction and a rotor that go with joints by the rates `ways` (k,)."""
            v, a = speed @ ways, acceleration @ ways
            for part in (v / np.hypot(v, least), v, a):
                taking.append(part[:, None] * ways)

        for joint in range(k):
            beside(np.eye(k)[joint], slow[joint])
        for pair in self._pairs:
            one, other = (names.index(name) for name in pair)
            for sign in (1.0, -1.0):
                ways = np.eye(k)[one] + sign * np.eye(k)[other]
                beside(ways, max(slow[one], slow[other]))
        offsets = np.broadcast_to(np.eye(k), (n, k, k))
        bodies = every[..., self._there] * self._spread
        return _Columns(every @ self._drawn, bodies, offsets, np.stack(taking, axis=-1))
