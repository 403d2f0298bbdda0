"""How unlikely are efforts, as a log is read? By bodies near the drawing, and by what drives need besides.

tau = Y b + friction + rotor + offset, with inertial parameters b that all joints share and whose prior is the robot
file's; friction and rotors take energy from the motion and give none, be they of a joint or of a motor that drives two.
What is left at a joint is noise of a size of its own. Readings of a log compete by this one score, in nats: drawings of
real robots are off by tens of per cent, and a rigid robot as drawn tells nothing of most of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve, cholesky, solve_triangular
from scipy.optimize import nnls

from ...dynamics import InMotion, Motion
from ...errors import InputError
from ...laws.efforts.effort_law import motor_pairs
from ...spatial import Array
from ..criteria import AS_GOOD, FEW_ROUNDS, LITTLE, MUCH, ROUNDING, UNSEEN
from .gains import drawn_bodies

#: Samples of each joint that count, of all that are looked at: what a model of a real robot leaves is no white noise.
_COUNTED = 60.0


@dataclass(frozen=True, eq=False)
class Unlikely:
    """Minus the logarithm of the likelihood of efforts, less a constant; shares (k,) of each joint's squares left.

    strain: squares of what bodies and offsets are off by, in spreads; beyond: how many joints go where they cannot.
    """

    nats: float
    shares: Array
    strain: float = np.inf
    beyond: int = 0

    @property
    def explains(self) -> bool:
        """Whether hardly anything is left of any joint by bodies that are hardly off."""
        little = np.nanmax(self.shares, initial=0.0) <= LITTLE**2
        return bool(little and self.strain <= MUCH * len(self.shares) and not self.beyond)

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


class EffortLikelihood:
    """The model of a robot by which motions and efforts are judged; `count`: as many samples tell their band."""

    def __init__(self, at: InMotion, tolerances: dict[str, float], count: int):
        self.at, self.count = at, min(float(count), _COUNTED)
        drawn, spread = drawn_bodies(at, tolerances)
        self._there, self._drawn = np.flatnonzero(spread > 0), drawn
        self._spread = spread[self._there]
        self._pairs = sorted({tuple(sorted(pair)) for pair in motor_pairs(at.mechanism) if {*pair} <= {*at.driven}})
        self._last: tuple[bytes, _Columns] = b"", _Columns(*(np.zeros(0),) * 4)

    def __call__(
        self,
        motion: Motion,
        efforts: Array,
        noise: Array,
        *,
        drawn: bool = True,
        pulled: Array | None = None,
    ) -> Unlikely:
        """Return how unlikely efforts (n, k) with a noise (k,) of a sample are in a motion; without end where loops
        do not close.

        drawn: else bodies weigh nothing, which says that the drawing tells nothing of the log; pulled (n, k, c): what
        else may act, by any coefficients.
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

        known = columns.bodies[..., : columns.bodies.shape[2] if drawn else 0] * scale[:, None]
        # an offset is known to be small beside what a drive gives, all else may be anything
        more = [LITTLE * alike(columns.offsets), *([] if pulled is None else [alike(pulled)])]
        taking = alike(columns.taking)
        whole = np.concatenate((known, *more, taking), axis=2)
        prior = np.where(np.arange(whole.shape[2]) < known.shape[2] + more[0].shape[2], 1.0, ROUNDING)
        target = (efforts - (columns.drawn if drawn else 0.0)) * scale
        left, strain = self._least(whole, target, prior, taking.shape[2])
        if known.shape[2]:  # noise of positions may make more of a light joint's body than all that it gives
            still = whole[..., known.shape[2] :], efforts * scale, prior[known.shape[2] :]
            left = np.minimum(left, self._least(*still, taking.shape[2])[0])
        floor = UNSEEN**2 + (np.broadcast_to(noise, size.shape) * scale) ** 2 * len(efforts)
        shares = np.where(seen, left, np.nan)
        nats = 0.5 * self.count * float(np.log(np.maximum(left, floor)[seen]).sum()) + 0.5 * strain
        beyond = self._beyond(motion)
        # each as much as all of its samples
        return Unlikely(nats + beyond * self.count, np.minimum(shares, 100.0), strain, beyond)

    def _least(self, columns: Array, target: Array, prior: Array, bounded: int) -> tuple[Array, float]:
        """Return the squares (k,) that are left of targets (n, k) by the likeliest coefficients of columns (n, k, p),
        the last ones of which are not negative, and the squares of those with a prior (p,) of inverse variances.
        """
        by_joint = np.ascontiguousarray(columns.transpose(1, 0, 2))  # (k, n, p)
        gram, moment = by_joint.mT @ by_joint, (by_joint.mT @ target.T[..., None])[..., 0]
        power = (target**2).sum(axis=0)
        weight = np.full(len(power), self.count / LITTLE)
        free = len(prior) - bounded
        for _ in range(FEW_ROUNDS):
            matrix, right = np.diag(prior) + np.tensordot(weight, gram, 1), weight @ moment
            unit = 1 / np.sqrt(np.diag(matrix))
            matrix = matrix * unit[:, None] * unit + ROUNDING * len(unit) * np.eye(len(unit))
            right = right * unit
            inner = cho_factor(matrix[:free, :free])
            across = cho_solve(inner, matrix[:free, free:])
            root = cholesky(matrix[free:, free:] - matrix[free:, :free] @ across, lower=True)
            taken = nnls(root.T, solve_triangular(root, right[free:] - across.T @ right[:free], lower=True))[0]
            x = unit * np.append(cho_solve(inner, right[:free] - matrix[:free, free:] @ taken), taken)
            left = np.maximum(power - 2 * moment @ x + (gram @ x) @ x, 0.0)
            weight = self.count / np.maximum(left, LITTLE**2)
        return left, float(prior @ x**2)

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
