"""The equilibrium in the deformed position: Newton's method on the chain's equations, many samples at once.

Samples in one rigid pose share one derivative, which changes little with the load; a sample that does not converge fast
with it gets its own, and one that fails is loaded in steps. What does not converge is said so, sample by sample.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..kinematics import ClosedPose
from ..spatial import Array
from .border import inverted
from .chain import Chain
from .derivative import frame_columns, load_columns
from .residual import Evaluation, is_balanced
from .state import Conditions, RigidSamples, State, with_actuators

_ITERATIONS, _FEW = 40, 12
#: Converged when no unknown displacement moves farther than this [m, rad].
TOLERANCE = 1e-11
#: A shared derivative is kept while it shrinks the step by this factor.
_FAST = 0.25
_LONGEST = 0.2
#: A sample whose steps have doubled so often is given up, as is one that still wanders after so many iterations.
_DIVERGING = 4
_WANDERING, _FAR = 15, 1e-3
#: One that begins near an equilibrium is within half of the longest step of it by then.
_SOON = 4
_LOAD_STEPS = (2, 8, 32)
#: Smaller steps are tried where coarser ones reached this share of the load.
_WORTHWHILE = 0.3


@dataclass(frozen=True)
class Equilibria:
    """Equilibria of N samples. `converged` (N,); where False the other values are the last ones tried.

    tool (N, 4, 4); loads (N, n, 6), strains (N, n, 6) of wrench modules; drive_loads, drives (N, d).
    """

    chain: Chain
    rigid: RigidSamples
    conditions: Conditions
    state: State
    evaluation: Evaluation
    converged: np.ndarray
    steps: Array  # last step of every sample
    inverses: tuple[Array, np.ndarray] | None  # shared inverse matrices and which one belongs to each sample

    @property
    def tool(self) -> Array:
        """Placement of the tool, (N, 4, 4)."""
        return self.evaluation.tool

    def unloaded(self, samples: Array) -> State:
        """Return the states of some samples (k,) where nothing loads the robot: no wrench, no weight, no friction."""
        some = self.conditions.take(samples)
        bare = replace(some, wrench=np.zeros_like(some.wrench), gravity=None, torques=None, inertia=None)
        rows = np.arange(len(samples))
        return _newton(self.chain, self.rigid.take(samples), self.state.take(samples), bare, rows, None)[0]

    def own_inverses(self, samples: np.ndarray | None = None) -> Array:
        """Return the inverse of every sample's own derivative, (N, m, m); or of some samples' (n, m, m)."""
        if samples is None:
            return inverted(self.matrix(), self.rigid.border)
        rigid, state, some = self.rigid.take(samples), self.state.take(samples), self.conditions.take(samples)
        return inverted(self.chain.matrix(state, self.chain.evaluate(rigid, state, some), some), rigid.border)

    def matrix(self) -> Array:
        """Return d(residual)/d(unknowns) of every sample, (N, m, m)."""
        return self.chain.matrix(self.state, self.evaluation, self.conditions)

    def bordered(self) -> Array:
        """Return the same with the border of what no equation determines, (N, m + k, m + k)."""
        return self.rigid.border.around(self.matrix())

    def tangent_compliance(self) -> Array:
        """Return d(tool's displacement)/d(wrench) at the equilibrium, (N, 6, 6), geometric stiffness included.

        Where only the load holds idle joints, an inverse alone leaves rounding that passes for a soft direction: what
        it misses is solved once more.
        """
        matrix = self.matrix()
        inverse = inverted(matrix, self.rigid.border)
        loads = load_columns(self.chain.structure, self.evaluation)
        moved = inverse @ loads
        moved += inverse @ (loads - matrix @ moved)
        return -frame_columns(self.chain.structure, self.evaluation, self.chain.tool) @ moved


def find_equilibria(
    chain: Chain,
    poses: list[ClosedPose],
    rows: Array,
    conditions: Conditions,
    start: Equilibria | None = None,
    by_steps: bool = True,
    near: bool = False,
) -> Equilibria:
    """Return the equilibria of samples that stand in `poses[rows]` under `conditions`.

    `start`: equilibria of the same samples under other conditions, from which the search starts. `by_steps`: what is
    not found so is searched again from the rigid pose, with a load that grows; else it is soon given up. `near`: an
    equilibrium that does not lie near `start`, which a few steps find, is none, and no load grows.
    """
    rows = np.asarray(rows, int)
    if start is None:
        rigid = chain.rigid_samples(poses, rows, conditions)
    else:
        rigid = replace(start.rigid, border=chain.border(poses, rows, conditions)) if poses else start.rigid
    if start is not None and conditions.actuators is None and start.conditions.actuators is None:
        state = start.state
    else:
        state = with_actuators(chain.structure, chain.rigid_state(poses, rows), conditions.actuators)
        if start is not None:
            old = start.state
            state = replace(state, strain=old.strain, closure=old.closure)
    shared = start.inverses if start is not None else None
    state, evaluation, converged, steps, shared = _newton(
        chain, rigid, state, conditions, rows, shared, _ITERATIONS if by_steps and not near else _FEW, near
    )
    free = rigid.border.holds & ~converged & (steps < TOLERANCE)
    if by_steps and free.any():
        # The load may determine what the rigid pose does not: an idle link that hangs, a play that opens.
        loose = replace(rigid, border=rigid.border.without(free))
        part, _, good, size, _ = _newton(
            chain, loose.take(free), state.take(free), conditions.take(free), np.arange(free.sum()), None, _FEW
        )
        found = np.flatnonzero(free)[good]
        if len(found):
            rigid = replace(rigid, border=rigid.border.without(found))
            state = state.with_rows(found, part.take(good))
            converged[found], steps[found] = True, size[good]
            evaluation = chain.evaluate(rigid, state, conditions)
    if by_steps and not near and not converged.all():
        state, converged, steps = _by_steps(chain, poses, rows, rigid, conditions, state, converged, steps)
        evaluation = chain.evaluate(rigid, state, conditions)
    return Equilibria(chain, rigid, conditions, state, evaluation, converged, steps, shared)


def with_torques(found: Equilibria, poses: list[ClosedPose], rows: Array, torques: Array, near: bool) -> Equilibria:
    """Return the equilibria where the joints resist by other torques (N, j) and all else is as it was.

    Samples whose torques stay are at rest already. `poses`, `rows` and `near` as in `find_equilibria`.
    """
    now = replace(found.conditions, torques=torques)
    before = found.conditions.torques
    changed = np.ones(len(rows), bool) if before is None else (torques != before).any(axis=1)
    if changed.all() or found.rigid.border.size or found.inverses is None or not found.converged.all():
        return find_equilibria(found.chain, poses, rows, now, found, near=near)
    inverses, which = found.inverses
    used, own = np.unique(which[changed], return_inverse=True)
    part = replace(
        found,
        rigid=found.rigid.take(changed),
        conditions=found.conditions.take(changed),
        state=found.state.take(changed),
        inverses=(inverses[used], own),
    )
    part = find_equilibria(found.chain, poses, rows[changed], now.take(changed), part, near=near)
    state = found.state.with_rows(changed, part.state)
    converged, steps = found.converged.copy(), found.steps.copy()
    converged[changed], steps[changed] = part.converged, part.steps
    evaluation = found.chain.evaluate(found.rigid, state, now)
    return replace(found, conditions=now, state=state, evaluation=evaluation, converged=converged, steps=steps)


@np.errstate(over="ignore", invalid="ignore")
def _newton(
    chain: Chain,
    rigid: RigidSamples,
    state: State,
    conditions: Conditions,
    rows: np.ndarray,
    shared: Any,
    most: int = _ITERATIONS,
    near: bool = False,
):
    """Return state, evaluation, which samples converged, their last steps and the shared inverses.

    near: all are given up where one is not about to converge, for that is all that is asked.
    """
    n = len(rows)
    size = np.full(n, np.inf)
    if not n:
        return state, chain.evaluate(rigid, state, conditions), np.zeros(n, bool), size, shared
    groups, which = np.unique(rows, return_inverse=True)
    if shared is None or len(shared[0]) != len(groups):
        first = np.array([np.flatnonzero(which == index)[0] for index in range(len(groups))])
        part, some = state.take(first), conditions.take(first)
        inside = rigid.take(first)
        matrix = chain.matrix(part, chain.evaluate(inside, part, some), some)
        shared = inverted(matrix, inside.border), which
    inverses, which = shared
    own: dict[int, Array] = {}
    best = np.full(n, np.inf)
    grown = np.zeros(n, int)
    active = np.arange(n)
    part, inside, some = state, rigid, conditions
    for iteration in range(1, most + 1):
        at = chain.evaluate(inside, part, some)
        kept = np.isfinite(at.residual).all(axis=1) & (grown[active] < _DIVERGING)
        residual = at.residual[kept]
        slow = kept & (size[active] > _FAST * best[active]) if iteration > 2 else np.zeros(len(active), bool)
        if slow.any():
            if not slow.all():
                there, under = part.take(slow), some.take(slow)
                matrix = chain.matrix(there, chain.evaluate(inside.take(slow), there, under), under)
            else:
                matrix = chain.matrix(part, at, some)
            own.update(zip(active[slow].tolist(), inverted(matrix, inside.border.take(slow)), strict=True))
        active, part = active[kept], part.take(kept)
        if not len(active):
            break
        change = np.empty_like(residual)
        common = np.array([index not in own for index in active.tolist()])
        for group in np.unique(which[active[common]]):
            members = common & (which[active] == group)
            change[members] = -(residual[members] @ inverses[group].T)
        for place in np.flatnonzero(~common):
            change[place] = -(own[int(active[place])] @ residual[place])
        moved = np.abs(change[:, : -chain.structure.closure_count or None]).max(axis=1, initial=0.0)
        best[active] = np.minimum(best[active], size[active])
        grown[active] += moved > 2 * size[active]
        grown[active[np.isnan(moved)]] = _DIVERGING
        size[active] = moved
        if near and iteration >= _SOON and moved.max() > _LONGEST / 2:
            break
        if iteration >= _WANDERING:
            grown[active[np.minimum(best[active], moved) > _FAR]] = _DIVERGING
        too_long = moved > _LONGEST
        change[too_long] *= (_LONGEST / moved[too_long])[:, None]
        part = chain.step(part, np.nan_to_num(change, nan=0.0, posinf=0.0, neginf=0.0))
        state = state.with_rows(active, part)
        left = ~(moved < TOLERANCE)
        if not left.any():
            break
        active, part = active[left], part.take(left)
        inside, some = rigid.take(active), conditions.take(active)
    evaluation = chain.evaluate(rigid, state, conditions)
    balanced = is_balanced(chain.structure, state, evaluation, rigid.border.holds)
    return state, evaluation, (size < TOLERANCE) & balanced, size, shared


def _by_steps(chain, poses, rows, rigid, conditions, state, converged, steps):
    """Solve what failed again, raising the load in ever finer steps."""
    converged, steps = converged.copy(), steps.copy()
    hopeful = ~converged
    for count in _LOAD_STEPS:
        going = np.flatnonzero(hopeful & ~converged)
        if not len(going):
            break
        reached = np.zeros(len(rows))
        start = chain.rigid_state(poses, rows[going])
        part = with_actuators(chain.structure, start, conditions.take(going).actuators)
        for step in range(1, count + 1):
            some = conditions.take(going)
            partly = replace(some, wrench=step / count * some.wrench)
            part, _, good, size, _ = _newton(chain, rigid.take(going), part, partly, np.arange(len(going)), None, _FEW)
            going, part = going[good], part.take(good)
            reached[going] = step / count
            if not len(going):
                break
        state = state.with_rows(going, part)
        converged[going] = True
        steps[going] = size[good]
        # one that gives way at a small part of its load bears no more in smaller steps
        hopeful &= (reached >= _WORTHWHILE) | (count == _LOAD_STEPS[0])
    return state, converged, steps
