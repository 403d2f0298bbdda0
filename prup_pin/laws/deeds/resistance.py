"""Joints that resist their motion: dry friction and dampers, in free joints and beside the drives of driven ones.

The equilibrium is solved for all samples at once with given torques; the joints' histories are then followed in time
with the equilibria's own derivatives, and both are repeated until they agree.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...loaded import Chain, Conditions, Equilibria
from ...mechanism import Changes, JointDynamics
from ...numbers import number
from ...spatial import Array
from .deed import AGREED, BLOCK, Deed, Felt, History, Solved

if TYPE_CHECKING:
    from ..setup import Setup

_SWEEPS = 60
#: A round shrinks the change of a torque by this factor; where it does not, its derivative is not that of its pose.
_SHRINKS = 0.5
#: A sample whose torques would move by less than this share of what agrees is left as it is.
_STAYS = 0.1
#: Rounds in which joints that slide are guessed before sweeps look for them, and those in which all may change.
_GUESSES, _TOGETHER = 30, 6


@dataclass(frozen=True)
class JointResistance(Deed):
    """What resists a joint along itself: an elastoplastic spring (Prandtl-Ishlinskii) and a damper.

    `limit` [N m or N], `stiffness` before sliding [N m/rad or N/m], `damping` [N m s/rad or N s/m]. A move of
    the actuators leaves it relaxed where the joint stands without any load, weight included.
    """

    memory = BLOCK

    joint: str
    limit: float = 0.0
    stiffness: float = 0.0
    damping: float = 0.0

    @property
    def resisted_joint(self) -> str | None:
        return self.joint

    @classmethod
    def joints(cls, at: Solved) -> tuple[int, ...]:
        """Return the joints that resist in a solved simulation, by their places among the moving joints."""
        solved = at.histories.get(cls)
        return tuple(dict.fromkeys(solved.places)) if isinstance(solved, _Resisting) else ()

    def felt(self, at: Solved) -> Felt:
        """Return what would hold the joint where it stands unloaded, and how stiff the rest of the robot holds it."""
        chain, found, blocks = at.first.chain, at.first.found, at.moment.blocks
        dof = chain.mechanism.joint(self.joint).first_v
        softness = np.abs(at.first.joints_by_resistance((list(chain.moving).index(dof),))[:, 0, 0])
        if not softness.min(initial=np.inf) > 0:
            return Felt()
        relaxed = at.first.once("relaxed", lambda: _relaxed(found, blocks))[:, dof]
        way = found.state.travel[:, dof] - np.repeat(relaxed, np.diff(np.append(_starts(blocks), len(blocks))))
        return Felt(float(np.abs(way / softness).max()), float(1 / np.median(softness)))

    def enter(self, setup: Setup) -> None:
        setup.resistances = (*setup.resistances, self)

    def redraw(self, changes: Changes) -> str | None:
        joint = changes.mechanism.joint(self.joint)
        changes.resist(self.joint, JointDynamics(self.damping, self.limit))
        if not self.limit:
            return ""
        unit = f"{joint.effort_unit}/{joint.unit}"
        return f"until {self.joint} slides it gives way as a spring of {number(self.stiffness, 3)} {unit}"

    @classmethod
    def history(cls, setup: Setup, samples: np.ndarray, chain: Chain, before: Slid | None) -> _Resisting | None:
        return _Resisting(setup, samples, chain, before) if setup.resistances else None

    @classmethod
    def changes(cls, setup: Setup, at: Solved) -> Iterator[Array]:
        alike = setup.resistances == at.setup.resistances
        if alike and not at.displaced:
            return
        before = np.zeros((len(at.samples), len(at.first.chain.moving)))
        solved = at.histories.get(cls)
        if isinstance(solved, _Resisting):
            before = solved.on_joints(solved.torques)
        after = _torques_at(setup, at, before)
        if alike:  # rounding aside
            before = at.first.once("resisted", lambda: _torques_at(setup, replace(at, displaced={}), before))
        yield (at.first.by_torque @ (after - before)[..., None])[..., 0]


class Slid(NamedTuple):
    """What joints remember after a sample of a block: where each slid to, where it stood, its torque (r,), the time."""

    block: int
    slid: Array
    last: Array
    time: float
    torque: Array


class _Resisting(History):
    """The torques (n, r) that agree with the joints' histories."""

    def __init__(self, setup: Setup, samples: np.ndarray, chain: Chain, before: Slid | None):
        self.resistances = setup.resistances
        mechanism = chain.mechanism
        self.dofs = [mechanism.joint(item.joint).first_v for item in self.resistances]
        moving = {int(dof): place for place, dof in enumerate(chain.moving)}
        self.places = [moving[dof] for dof in self.dofs]
        self.count = len(moving)
        self.moment = setup.moment(samples)
        self.torques = np.zeros((len(samples), len(self.places)))
        self._change = np.zeros(self.torques.shape)  # in the last round
        self._begin = np.zeros(self.torques.shape)
        self._between = np.full_like(self.torques, -np.inf), np.full_like(self.torques, np.inf)
        self._misled = np.zeros(len(samples), bool)  # for which the derivative of their pose is none
        self._before = before
        self._after = before
        self._relaxed: Array | None = None

    def on_joints(self, torques: Array) -> Array:
        """Return torques (n, r) of the resistances as those of all free and driven joints, (n, j)."""
        out = np.zeros((len(torques), self.count))
        for column, place in enumerate(self.places):
            out[:, place] += torques[:, column]
        return out

    def begin(self, found: Equilibria) -> None:
        if found.conditions.torques is not None and len(set(self.places)) == len(self.places):
            self.torques = found.conditions.torques[:, self.places]

    def act(self, now: Conditions) -> Conditions:
        return replace(now, torques=self.on_joints(self.torques))

    def follow(self, found: Equilibria) -> float:
        if self._relaxed is None:
            self._relaxed = _relaxed(found, self.moment.blocks)[:, self.dofs]
        new, begin, self._after = resisted(
            self.resistances,
            found.state.travel[:, self.dofs],
            self.torques,
            self._influence(found),
            self.moment.blocks,
            self.moment.time,
            self._relaxed,
            self._before,
        )
        scale = max(np.abs(new).max(initial=0.0), 1e-3)  # N m; smaller torques move nothing
        change = new - self.torques
        slow = (np.abs(change) > np.maximum(_SHRINKS * np.abs(self._change), AGREED * scale)) & (self._change != 0)
        self._misled |= slow.any(axis=1)
        self._step_to(new, change, begin, scale)
        return float(np.abs(change).max(initial=0.0)) / scale

    def _step_to(self, new: Array, change: Array, begin: Array, scale: float) -> None:
        """Move the torques towards new ones, and not beyond where a sample has been seen to lie.

        A joint gives way the more, the more it is pulled: of one with the same history the torque lies beyond where it
        was to grow, and before where it was to fall. Newton's steps alone leap over a gap for ever.
        """
        others = np.abs(change).max(axis=1, keepdims=True) > AGREED * scale if change.shape[1] > 1 else False
        lost = (np.abs(begin - self._begin) > AGREED * scale) | others
        low, high = np.where(lost, -np.inf, self._between[0]), np.where(lost, np.inf, self._between[1])
        low = np.where(change > 0, np.maximum(low, self.torques), low)
        high = np.where(change < 0, np.minimum(high, self.torques), high)
        beyond = ((new <= low) | (new >= high)) & np.isfinite(high - low)
        back = ~beyond & (change * self._change < 0) & (np.abs(change) > _SHRINKS * np.abs(self._change))
        step = np.where(back, change / 2, change)
        step[beyond] = (low[beyond] + high[beyond]) / 2 - self.torques[beyond]
        self._change = step.copy()
        step[(np.abs(step) <= _STAYS * AGREED * scale).all(axis=1)] = 0.0
        self.torques = self.torques + step
        self._begin, self._between = begin, (low, high)

    def _influence(self, found: Equilibria) -> Array:
        """Return d(displacement)/d(torque) of the joints, (n, r, r): those of its pose, or a sample's own.

        Where a gap is open a joint moves otherwise than in the other samples of its pose.
        """
        inverses, which = found.inverses  # type: ignore[misc]
        influence = np.asarray(inverses[:, self.places][:, :, self.places][which])
        if self._misled.any():
            influence[self._misled] = found.own_inverses(self._misled)[:, self.places][:, :, self.places]
        return -influence * found.chain.by_torque(found.evaluation)[:, None, self.places]

    @property
    def after(self) -> Slid | None:
        return self._after


def _torques_at(setup: Setup, at: Solved, before: Array) -> Array:
    """Return the torques (n, j) of all joints where those of a setup resist, in a simulation solved with `before`.

    Each is displaced by what else changes: a joint that sticks resists that as well.
    """
    if not setup.resistances:
        return np.zeros_like(before)
    first, new = at.first, _Resisting(setup, at.samples, at.first.chain, None)
    travel = first.found.state.travel[:, new.dofs]
    for column, place in enumerate(new.places):
        travel[:, column] += at.displaced.get(place, 0.0)
    torques, *_ = resisted(
        setup.resistances,
        travel,
        before[:, new.places],
        first.joints_by_resistance(tuple(new.places)),
        at.moment.blocks,
        at.moment.time,
        first.once("relaxed", lambda: _relaxed(first.found, at.moment.blocks))[:, new.dofs],
    )
    return new.on_joints(torques)


def _starts(blocks: np.ndarray) -> np.ndarray:
    """Return the first sample of each block, (b,)."""
    return np.flatnonzero(np.concatenate(([True], blocks[1:] != blocks[:-1])))


def _relaxed(found: Equilibria, blocks: np.ndarray) -> Array:
    """Return where all joints stand without load at the beginning of each block, (b, nv), since the rigid pose."""
    return found.unloaded(_starts(blocks)).travel


def resisted(
    resistances: Sequence[JointResistance],
    displacement: Array,
    torque: Array,
    influence: Array,
    blocks: np.ndarray,
    time: Array,
    relaxed: Array,
    memory: Slid | None = None,
) -> tuple[Array, Array, Slid | None]:
    """Return the resisting torques (N, r) that agree with the joints' history, what of the history each sample feels
    (N, r), as the torque to which it adds nothing, and what is remembered after all.

    displacement (N, r) of the joints at the present `torque` (N, r); influence (N, r, r) is d(displacement)/d(torque);
    `memory`: what is remembered before the first sample. A joint starts each block relaxed, at `relaxed` (blocks, r).
    Blocks know nothing of each other: they are followed side by side.
    """
    out, begin = np.zeros(torque.shape), np.zeros(torque.shape)
    if not len(time):
        return out, begin, memory
    limit = np.array([item.limit for item in resistances])
    stiffness = np.array([item.stiffness for item in resistances])
    damping = np.array([item.damping for item in resistances])
    reach = limit / np.where(stiffness > 0, stiffness, 1.0)
    free = displacement - (influence @ torque[..., None])[..., 0]  # where the joints would be without resistance
    starts = _starts(blocks)
    lengths = np.diff(np.append(starts, len(time)))
    before = np.full(len(starts), np.nan)
    slid, last, now = relaxed.copy(), free[starts], np.zeros((len(starts), len(resistances)))
    if memory is not None and memory.block == blocks[0]:
        slid[0], last[0], now[0], before[0] = memory.slid, memory.last, memory.torque, memory.time
    elapsed = np.diff(time, prepend=np.nan)
    elapsed[starts] = time[starts] - before
    rate = np.where(np.isnan(elapsed), 0.0, 1.0 / np.maximum(elapsed, 1e-9))
    given = [free, influence, damping * rate[:, None]]
    alone = len(resistances) == 1
    if alone:
        given[1] = influence[:, 0]
        given += [1 - given[1] * (given[2] + stiffness), 1 - given[1] * given[2]]
    alike = bool((lengths == lengths[0]).all())
    if alike:  # views by step, one row a block
        *given, found, slack = (v.reshape(len(starts), -1, *v.shape[1:]).swapaxes(0, 1) for v in (*given, out, begin))
    springs = stiffness > 0
    here: slice | np.ndarray = slice(None)
    for step in range(int(lengths.max())):
        if alike:
            at = [values[step] for values in given]
        else:
            here = np.flatnonzero(lengths > step)
            rows = starts[here] + step
            at = [values[rows] for values in given]
        standing = stiffness * slid[here] + at[2] * last[here]
        if alone:
            value, x = _balanced_alone(slid[here], last[here], stiffness[0], limit[0], *at)
        else:
            value, x = _balanced(now[here], slid[here], last[here], stiffness, limit, *at)
        held = np.minimum(np.maximum(slid[here], x - reach), x + reach)
        slid[here] = held if springs.all() else np.where(springs, held, slid[here])
        last[here], now[here] = x, value
        if alike:
            found[step], slack[step] = value, standing
        else:
            out[rows], begin[rows] = value, standing
    return out, begin, Slid(int(blocks[-1]), slid[-1], last[-1], float(time[-1]), now[-1])


def _balanced(torque, slid, last, stiffness, limit, free, influence, viscous) -> tuple[Array, Array]:
    """Return torques (b, r) and displacements (b, r) of joints that agree with each other.

    torque = viscous (x - last) + clip(stiffness (x - slid), +-limit), x = free + influence torque.
    Which joints slide is guessed; the rest is linear, and says who does: a few rounds, or else sweeps.
    """
    count = len(stiffness)
    slides, left = np.zeros(free.shape), np.arange(len(free))
    found, moved = np.empty_like(free), np.empty_like(free)
    for round_ in range(_GUESSES):
        sticks = slides == 0
        slope = viscous[left] + np.where(sticks, stiffness, 0.0)
        begin = np.where(sticks, -stiffness * slid[left], slides * limit) - viscous[left] * last[left]
        x = _solved(np.eye(count) - influence[left] * slope[:, None], free[left], influence[left], begin)
        stretched = stiffness * (x - slid[left])
        wrong = np.sign(stretched) * (np.abs(stretched) > limit) - slides
        if round_ >= _TOGETHER:  # one by one, the first of them: that comes to an end
            wrong = np.clip(wrong, -1.0, 1.0) * (np.cumsum(wrong != 0, axis=1) == 1)
        right = ~wrong.any(axis=1)
        found[left[right]], moved[left[right]] = (begin + slope * x)[right], x[right]
        slides, left = (slides + wrong)[~right], left[~right]
        if not len(left):
            return found, moved
    found[left], moved[left] = _swept(
        free[left], influence[left], torque[left], slid[left], last[left], stiffness, limit, viscous[left]
    )
    return found, moved


def _solved(matrix: Array, free: Array, influence: Array, begin: Array) -> Array:
    """Return displacements (b, r), matrix x = free + influence begin; NaN where they are not determined."""
    right = free[..., None] + influence @ begin[..., None]
    try:
        return np.asarray(np.linalg.solve(matrix, right)[..., 0])
    except np.linalg.LinAlgError:
        return np.full(free.shape, np.nan)


def _swept(free, influence, torque, slid, last, stiffness, limit, viscous) -> tuple[Array, Array]:
    """Return the same by Gauss-Seidel sweeps."""
    count = len(stiffness)
    torque = torque.copy()
    for _ in range(_SWEEPS):
        old = torque.copy()
        for j in range(count):
            own = influence[:, j, j]
            apart = free[:, j] + (influence[:, j] * torque).sum(1) - own * torque[:, j]  # without its own resistance
            damped = viscous[:, j] * (apart - last[:, j])
            value = (damped + stiffness[j] * (apart - slid[:, j])) / (1 - own * (viscous[:, j] + stiffness[j]))
            stretched = stiffness[j] * (apart + own * value - slid[:, j])
            sliding = (np.abs(stretched) > limit[j]) & (stiffness[j] > 0)
            limited = (damped + np.sign(stretched) * limit[j]) / (1 - own * viscous[:, j])
            torque[:, j] = np.where(sliding, limited, value)
        if np.abs(torque - old).max(initial=0.0) <= 1e-12 * (np.abs(torque).max(initial=0.0) + 1e-12):
            break
    return torque, free + (influence @ torque[..., None])[..., 0]


def _balanced_alone(slid, last, stiffness, limit, free, own, viscous, sticking, sliding) -> tuple[Array, Array]:
    """Return the same of a single joint, whose torque nothing else moves; all (b, 1).

    `sticking` and `sliding`: one less what its own torque does to itself through spring and damper, damper alone.
    """
    damped = viscous * (free - last)
    torque = (damped + stiffness * (free - slid)) / sticking
    if stiffness > 0:
        stretched = stiffness * (free + own * torque - slid)
        slides = np.abs(stretched) > limit
        if slides.any():
            torque = np.where(slides, (damped + np.copysign(limit, stretched)) / sliding, torque)
    return torque, free + own * torque
