"""Closing the loops for many poses at once: the Newton of `loop_kinematics` with a leading axis.

Start, steps, what counts as converged, and the way around a failure are those of a single pose, pose by pose: no pose
knows of the others, so that an answer does not depend on its company.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import SingularPoseError, UnreachablePoseError
from ..kernel import NEGLIGIBLE, Tree, equal_ranks, pseudo_inverse, rank_of
from ..spatial import Array
from .closed_pose import ClosedPose, PassiveBalance
from .loop_kinematics import (
    ITERATIONS,
    LAST_STEP,
    LONGEST,
    NEAR,
    ROUNDING,
    SHORT,
    SURE,
    TOLERANCE,
    LoopKinematics,
)

Mask = NDArray[np.bool_]
States = NDArray[np.int8]
#: Places of some poses among others.
Lanes = NDArray[np.int_]

#: What became of a pose: closed; not reached; beyond a joint's limits; of another rank than home, perhaps singular.
CLOSED, AWAY, LIMITS, DOUBTFUL = range(4)
#: Shortest step along the line from home, in shares of it.
_LEAST_SHARE = 1e-4


#: From configurations (n, nq) and targets (n, t) to the size of the error (n,), Newton's step (n, nv), where both can
#: be relied on, (n,), and where the loops are assembled, see `Closure.assembled`, (n,).
Stepper = Callable[[Array, Array], tuple[Array, Array, Mask, Mask]]


class Reached(NamedTuple):
    """Configurations q (n, nq) at the wanted coordinates, and what became of each, (n,)."""

    q: Array
    state: States


class ManyPoses:
    """Solves one mechanism's closure for arrays of coordinates: the tasks, or without any the actuated joints."""

    def __init__(self, kinematics: LoopKinematics):
        self.kinematics = kinematics
        self.mechanism = kinematics.mechanism
        self.tree = Tree(self.mechanism)
        self.task, self.closure = kinematics.task, kinematics.closure
        mechanism = self.mechanism
        self._by_task = bool(mechanism.tasks)
        self.names = self.task.names if self._by_task else mechanism.actuated
        #: Newton's step as machine code, where somebody has had it compiled: see `settle`.
        self.stepper: Stepper | None = None
        joints = [mechanism.joint(name) for name in mechanism.actuated]
        self._driven = np.array([joint.first_v for joint in joints], int)
        self._rows = np.eye(mechanism.model.nv)[self._driven]

    # -- coordinates -----------------------------------------------------------------------------------------------

    def _wanted(self, q: Array, placements: Array, jacobian: Array, target: Array) -> tuple[Array, Array]:
        """Return how far configurations are from their targets (n, t), and the rows of that (n, t, nv)."""
        if self._by_task:
            values, rates = self.task.of_many(placements)
            return self.task.less(values, target), (rates @ jacobian) * self.task.moves
        return self._positions(q) - target, np.broadcast_to(self._rows, (len(q), *self._rows.shape))

    def _positions(self, q: Array) -> Array:
        joints = [self.mechanism.joint(name) for name in self.mechanism.actuated]
        return np.stack([joint.position(q) for joint in joints], axis=-1)

    def _home(self) -> Array:
        """Return home's coordinates, (t,)."""
        home = self.kinematics.home
        if self._by_task:
            return self.task.of_many(self.tree.placements(home))[0]
        return self._positions(home)

    # -- Newton ----------------------------------------------------------------------------------------------------

    def settle(self, q: Array, target: Array) -> tuple[Array, Mask, Array]:
        """Return what Newton's method makes of configurations (n, nq) for targets (n, t).

        Where they end (n, nq), which have converged (n,), and the sums of their steps (n,) [m, rad].
        """
        count = len(q)
        q = q.copy()
        converged, way = np.zeros(count, bool), np.zeros(count)
        last = np.full(count, np.inf)
        busy = np.arange(count)
        for _ in range(ITERATIONS):
            if not len(busy):
                break
            at = q[busy]
            size, drawn, step = self._passing(at, target[busy])
            done = (size < ROUNDING) | ((last[busy] < LAST_STEP) & ((size < TOLERANCE) | drawn))
            converged[busy[done]] = True
            on = ~done & np.isfinite(size)
            if not on.any():
                break
            step = step[on]
            length = np.sqrt((step * step).sum(axis=-1))
            most = np.abs(step).max(axis=-1, initial=0.0)
            long = length > SHORT
            step *= np.where(long, np.minimum(1.0, SHORT / np.where(long, most, 1.0)), 1.0)[:, None]
            busy = busy[on]
            last[busy] = np.where(long, most, length)
            way[busy] += last[busy]
            q[busy] = self.tree.moved(at[on], -step)
        return q, converged, way

    def _passing(self, q: Array, target: Array) -> tuple[Array, Mask, Array]:
        """Return how far configurations (n, nq) are from closed loops and targets, (n,) [m, rad]; where only redundant
        closures are open, as they are drawn, (n,); and Newton's steps (n, nv)."""
        if self.stepper is None:
            return self._passing_by_arrays(q, target)
        size, step, sure, _ = self.stepper(q, target)
        drawn = np.zeros(len(q), bool)
        if not sure.all():
            size[~sure], drawn[~sure], step[~sure] = self._passing_by_arrays(q[~sure], target[~sure])
        return size, drawn, step

    def _passing_by_arrays(self, q: Array, target: Array) -> tuple[Array, Mask, Array]:
        placements = self.tree.placements(q)
        jacobian = self.tree.jacobian(placements)
        gaps = self.closure.gaps(placements)
        wanted, wanted_rows = self._wanted(q, placements, jacobian, target)
        error = np.concatenate((gaps.gap, wanted), axis=-1)
        size = np.sqrt((error * error).sum(axis=-1))
        rows_scale, _ = self.kinematics.newton_scales
        drawn = (np.abs(gaps.gap * rows_scale).max(axis=-1, initial=0.0) < NEGLIGIBLE) & (
            np.abs(wanted).max(axis=-1, initial=0.0) < TOLERANCE
        )
        step = np.zeros((len(q), wanted_rows.shape[-1]))
        on = np.isfinite(size)
        matrix = np.concatenate((self.closure.jacobian(gaps.wrenches[on], jacobian[on]), wanted_rows[on]), axis=-2)
        step[on] = self._solved(matrix, error[on])
        return size, drawn, step

    def _solved(self, matrix: Array, right: Array) -> Array:
        """Return the solutions (n, nv), least where rows are redundant or motions free."""
        if matrix.shape[-2] == matrix.shape[-1]:
            try:
                solution = np.asarray(np.linalg.solve(matrix, right[..., None])[..., 0], float)
            except np.linalg.LinAlgError:
                solution = np.full_like(right, np.inf)
            with np.errstate(invalid="ignore", over="ignore"):
                poor = np.logical_not(np.sqrt((solution * solution).sum(axis=-1)) < LONGEST)
            if poor.any():
                solution[poor] = self._least(matrix[poor], right[poor])
            return solution
        return self._least(matrix, right)

    def _least(self, matrix: Array, right: Array) -> Array:
        rows, columns = self.kinematics.newton_scales
        wanted = np.abs(matrix[:, len(rows) :] * columns).max(axis=-1, initial=0.0)
        scale = np.concatenate(
            (np.broadcast_to(rows, (len(matrix), len(rows))), 1 / np.where(wanted > 0, wanted, 1.0)), axis=-1
        )
        inverse = pseudo_inverse(scale[..., None] * matrix * columns)
        return columns * (inverse @ (scale * right)[..., None])[..., 0]

    # -- reaching --------------------------------------------------------------------------------------------------

    def reach(self, target: Array) -> Reached:
        """Return the configurations at targets (n, t), each on the assembly branch of home."""
        if not self.mechanism.loops and not self._by_task:
            return self._placed(target)
        count = len(target)
        home = self.kinematics.home
        q = np.repeat(home[None], count, axis=0)
        state = np.full(count, AWAY, np.int8)
        left: Lanes = np.arange(count)
        if self._by_task:
            motions, told = self.kinematics.start.of_many(target)
            left = self._accepted(self.tree.moved(home, motions[told]), target, np.flatnonzero(told), SURE, q, state)
            left = np.concatenate((np.flatnonzero(~told), left))
        if len(left):
            starts = np.repeat(home[None], len(left), axis=0)
            left = self._accepted(starts, target, left, NEAR, q, state)
        if len(left):
            self._follow(target, left, q, state)
        return Reached(q, state)

    def nearby(self, start: Array, target: Array) -> Reached:
        """Return the configurations at targets (n, t) that lie near `start` (n, nq): AWAY where there is none."""
        found, good = self._near(start, target, NEAR)
        state = np.full(len(target), AWAY, np.int8)
        state[good] = np.where(self.kinematics.outside_limits(found[good]), LIMITS, CLOSED)
        return Reached(found, state)

    def _placed(self, target: Array) -> Reached:
        """Return the configurations of a tree whose joints are given."""
        q = np.repeat(self.kinematics.home[None], len(target), axis=0)
        for column, name in enumerate(self.mechanism.actuated):
            self.mechanism.joint(name).place(q, target[:, column])
        state = np.full(len(q), CLOSED, np.int8)
        if self.mechanism.description.described:
            state[self.kinematics.outside_limits(q)] = LIMITS
        return Reached(q, state)

    def _near(self, start: Array, target: Array, within: float) -> tuple[Array, Mask]:
        """Return where Newton's method ends, and where that is assembled and no joint has moved far."""
        found, converged, way = self.settle(start, target)
        moved = np.abs(self._moved(start, found)).max(axis=-1)
        good = converged & ((way <= within) | (moved <= within))
        good[good] = self._assembled(found[good])
        return found, good

    def _moved(self, start: Array, found: Array) -> Array:
        joints = self.mechanism.joints
        before = np.stack([joint.position(start) for joint in joints], axis=-1)
        after = np.stack([joint.position(found) for joint in joints], axis=-1)
        endless = np.array([joint.nq == 2 for joint in joints])
        away = after - before
        return np.where(endless, np.remainder(away + np.pi, 2 * np.pi) - np.pi, away)

    def _assembled(self, q: Array) -> Mask:
        if not len(q):
            return np.zeros(0, bool)
        if self.stepper is not None:
            return self.stepper(q, np.zeros((len(q), len(self.names))))[3]
        return self.closure.assembled_each(self.closure.gaps(self.tree.placements(q)).turn)

    def _accepted(self, start: Array, target: Array, lanes: Lanes, within: float, q: Array, state: States) -> Lanes:
        """Settle some poses, keep those that are good and within limits, and return the others."""
        found, good = self._near(start, target[lanes], within)
        good &= ~self.kinematics.outside_limits(found)
        q[lanes[good]], state[lanes[good]] = found[good], CLOSED
        return lanes[~good]

    def _follow(self, target: Array, lanes: Lanes, q: Array, state: States) -> None:
        """Go along the line of coordinates from home in steps short enough not to change branches."""
        home, here = self.kinematics.home, self._home()
        at = np.repeat(home[None], len(lanes), axis=0)
        reached, step = np.zeros(len(lanes)), np.full(len(lanes), 0.25)
        going = np.arange(len(lanes))
        while len(going):
            share = np.minimum(1.0, reached[going] + step[going])
            aim = here + share[:, None] * (target[lanes[going]] - here)
            found, good = self._near(at[going], aim, NEAR)
            at[going[good]], reached[going[good]] = found[good], share[good]
            step[going] *= np.where(good, 2.0, 0.5)
            going = going[(reached[going] < 1.0) & (step[going] > _LEAST_SHARE)]
        arrived = reached == 1.0
        q[lanes[arrived]] = at[arrived]
        inside = ~self.kinematics.outside_limits(at)
        state[lanes[arrived & inside]] = CLOSED
        state[lanes[arrived & ~inside]] = LIMITS

    # -- poses -----------------------------------------------------------------------------------------------------

    def poses(self, q: Array) -> tuple[ClosedPose, Mask]:
        """Return closed configurations (n, nq) as one pose with a leading axis, and which may be singular, (n,)."""
        placements = self.tree.placements(q)
        jacobian = self.tree.jacobian(placements)
        gaps = self.closure.gaps(placements)
        closure = self.closure.jacobian(gaps.wrenches, jacobian)
        balance, doubtful = self._balance(placements, jacobian, closure)
        pose = ClosedPose(
            mechanism=self.mechanism, q=q, placements=placements, jacobian=jacobian, closure_jacobian=closure,
            closure_wrenches=gaps.wrenches, balance=balance, closure_residual=gaps.gap, coordinates={},
        )  # fmt: skip
        return pose, doubtful

    def _balance(self, placements: Array, jacobian: Array, closure: Array) -> tuple[PassiveBalance, Mask]:
        """Return how the free joints balance, and where that may be otherwise than at home."""
        count = len(closure)
        free = self.mechanism.free_dofs
        columns = closure[..., free]
        rows, scales = self.kinematics.free_scales
        doubtful = np.zeros(count, bool)
        if not columns.size:
            only = rank_of(columns[0].T, scales, rows) if count else rank_of(np.zeros((len(free), len(rows))))
            parts = (only.inverse, only.right, only.left)
            return PassiveBalance(*(np.broadcast_to(part, (count, *part.shape)) for part in parts)), doubtful
        rank = self.kinematics.free_rank
        if columns.shape[-1] == columns.shape[-2] == rank:
            inverse, regular = self._inverted(columns.mT)
            if not regular.all():
                ranks, same = equal_ranks(columns[~regular].mT, scales, rows, rank)
                inverse[~regular], doubtful[~regular] = ranks.inverse, ~same
            none = np.zeros((count, len(free), 0))
            return PassiveBalance(inverse, none, none), doubtful
        ranks, same = equal_ranks(columns.mT, scales, rows, rank)
        doubtful = ~same
        if ranks.left.shape[-1] and self.mechanism.tool is not None:
            velocities = np.zeros((count, self.mechanism.model.nv, ranks.left.shape[-1]))
            velocities[:, free] = ranks.left
            moved = self.kinematics.tool_motion(placements, jacobian, velocities)
            doubtful |= np.abs(moved).max(axis=(-1, -2), initial=0.0) > NEGLIGIBLE
        return PassiveBalance(ranks.inverse, ranks.right, ranks.left), doubtful

    def _inverted(self, matrix: Array) -> tuple[Array, Mask]:
        """Return inverses, and which of them a bound of the condition number makes sure of."""
        try:
            inverse = np.asarray(np.linalg.inv(matrix), float)
        except np.linalg.LinAlgError:
            return np.zeros_like(matrix), np.zeros(len(matrix), bool)
        squares = (inverse * inverse).sum(axis=(-1, -2)) * (matrix * matrix).sum(axis=(-1, -2))
        return inverse, np.sqrt(squares) * self.kinematics.free_spread < 1 / NEGLIGIBLE


def alone(kinematics: LoopKinematics, row: Array) -> tuple[int, ClosedPose | None]:
    """Return what became of one place (t,), and its pose where it is closed, with the care of a single question."""
    try:
        return CLOSED, kinematics.at_coordinates(row)
    except SingularPoseError:
        return DOUBTFUL, None
    except UnreachablePoseError as error:
        return (LIMITS if "outside its limits" in str(error) else AWAY), None
