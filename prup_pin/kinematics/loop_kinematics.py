"""Closing the loops: Newton's method on closure and task coordinates together.

The residual of a loop is measured in its first frame: the distance of the origins along the constrained axes, and
entries of R_1^T R_2 that vanish when only free rotations differ. Both are linear in the entries of R_1^T R_2 and in
R_1^T (p_2 - p_1), so the Jacobian below is exact on and off closure and Newton converges quadratically.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property

import numpy as np
import pinocchio as pin

from ..errors import InputError, JointLimitWarning, SingularPoseError, UnreachablePoseError
from ..mechanism import Mechanism
from ..spatial import Array, skew
from .closed_pose import ClosedPose, PassiveBalance
from .task import TaskFrame

#: Residual at which the loops count as closed [m, rad]. Newton ends near 1e-16.
TOLERANCE = 1e-12
#: A free motion counts as singular beyond this condition of the scaled closure Jacobian.
SINGULAR = 1e7
_ITERATIONS = 40
_GENERATORS = np.stack([skew(axis) for axis in np.eye(3)])


class _NotConverged(Exception):
    def __init__(self, q: Array, residual: tuple[float, float]):
        self.q, self.residual = q, residual


class LoopKinematics:
    """Solves one mechanism's closure. Holds Pinocchio's working memory: use one instance per thread."""

    def __init__(self, mechanism: Mechanism):
        self.mechanism = mechanism
        model = self.model = mechanism.model
        self.data = model.createData()
        self._oMi = list(self.data.oMi)  # references into data, refreshed by every forward pass
        self.task = TaskFrame(mechanism.tool, mechanism.tasks, mechanism.description.rotation, mechanism.support, mechanism.dof_joint)
        loops = mechanism.loops
        self._ends = np.array([[loop.first.joint, loop.second.joint] for loop in loops], int).reshape(-1, 2)
        self._first = np.array([loop.first.placement for loop in loops]).reshape(-1, 4, 4)
        self._second = np.array([loop.second.placement for loop in loops]).reshape(-1, 4, 4)
        support, dof_joint = mechanism.support, mechanism.dof_joint
        row_loop, translations, rotations = [], [], []
        for index, loop in enumerate(loops):
            row_loop += [index] * loop.size
            translations += [np.eye(3)[axis] for axis in loop.translation_axes] + [np.zeros(3)] * len(loop.rotation_rows)
            rotations += [np.zeros(9)] * len(loop.translation_axes) + list(loop.rotation_rows)
        self.row_loop = np.array(row_loop, int)
        self._translation_rows = np.array(translations).reshape(-1, 3)
        self._rotation_rows = np.array(rotations).reshape(-1, 9)
        # support[i, j]: j in subtree of i; a dof moves a body when the body lies in the dof's subtree
        sign = np.array([support[dof_joint, b] - support[dof_joint, a] for a, b in self._ends]).reshape(-1, model.nv)
        self._row_sign = sign[self.row_loop]
        self._is_translation = np.abs(self._translation_rows).sum(1) > 0
        self._lower, self._upper = _limits(model)

    # -- evaluation ----------------------------------------------------------------------------------------------

    def _evaluate(self, q: Array):
        """Return placements, base Jacobian, closure residual (c,), closure wrenches (c, 6) and closure Jacobian."""
        pin.computeJointJacobians(self.model, self.data, q)
        placements = np.array([placement.homogeneous for placement in self._oMi])
        jacobian = self.data.J.copy()
        if not len(self.row_loop):
            return placements, jacobian, np.zeros(0), np.zeros((0, 6)), np.zeros((0, self.model.nv))
        first = placements[self._ends[:, 0]] @ self._first
        second = placements[self._ends[:, 1]] @ self._second
        rotation, point = first[:, :3, :3], second[:, :3, 3]
        gap = ((point - first[:, :3, 3])[:, None, :] @ rotation)[:, 0]
        error = rotation.transpose(0, 2, 1) @ second[:, :3, :3]
        rows = self.row_loop
        residual = (self._translation_rows * gap[rows]).sum(1) + (self._rotation_rows * error.reshape(-1, 9)[rows]).sum(1)
        # Wrench of a unit closure force, about the base origin: a force along an axis of the first frame at the
        # second frame's origin, or a moment whose components are the residual's derivatives.
        turned = (_GENERATORS @ error[:, None]).reshape(-1, 3, 9)[rows]
        moment = (turned @ self._rotation_rows[:, :, None])[..., 0]
        directions = np.stack((self._translation_rows, moment), axis=1) @ rotation.transpose(0, 2, 1)[rows]
        wrenches = np.empty((len(rows), 6))
        force, at = directions[:, 0], point[rows]
        wrenches[:, :3] = force
        wrenches[:, 3:] = directions[:, 1]
        wrenches[:, 3] += at[:, 1] * force[:, 2] - at[:, 2] * force[:, 1]
        wrenches[:, 4] += at[:, 2] * force[:, 0] - at[:, 0] * force[:, 2]
        wrenches[:, 5] += at[:, 0] * force[:, 1] - at[:, 1] * force[:, 0]
        return placements, jacobian, residual, wrenches, (wrenches @ jacobian) * self._row_sign

    def _split(self, residual: Array) -> tuple[float, float]:
        """Return the largest residual in metres and in radians."""
        metres = np.abs(residual[self._is_translation])
        radians = np.abs(residual[~self._is_translation])
        return float(metres.max(initial=0.0)), float(radians.max(initial=0.0))

    def _newton(self, q: Array, goal: Callable) -> tuple[Array, tuple, Array]:
        """Return (q, evaluation, goal residual) at the solution. Raises _NotConverged.

        `goal(q, placements, jacobian)` returns residual and rows of the wanted coordinates.
        """
        best, size = np.inf, np.inf
        for _ in range(_ITERATIONS):
            evaluation = self._evaluate(q)
            placements, jacobian, residual, _, closure_rows = evaluation
            wanted, wanted_rows = goal(q, placements, jacobian)
            error = np.concatenate((residual, wanted))
            size = np.abs(error).max(initial=0.0)
            if not np.isfinite(size):
                break
            if size < TOLERANCE:
                return q, evaluation, wanted
            best = min(best, size)
            step = _solve(np.concatenate((closure_rows, wanted_rows)), -error)
            longest = np.abs(step).max(initial=0.0)
            if longest > 0.6:
                step *= 0.6 / longest
            q = pin.integrate(self.model, q, step)
        raise _NotConverged(q, self._split(self._evaluate(q)[2]) if np.isfinite(q).all() else (np.inf, np.inf))

    # -- home ------------------------------------------------------------------------------------------------------

    @cached_property
    def home(self) -> Array:
        """A configuration near the file's home position with closed loops. Raises UnreachablePoseError."""
        q = np.clip(pin.neutral(self.model), self._lower, self._upper)
        for name, value in self.mechanism.description.home.items():
            _set_joint(self.model, q, self.mechanism.joint_id(name), value)
        if not len(self.row_loop):
            return q

        def nothing(q, placements, jacobian):
            return np.zeros(0), np.zeros((0, self.model.nv))

        held = self.mechanism.actuated_dofs

        def hold_actuators(q, placements, jacobian, at=q.copy()):
            return pin.difference(self.model, at, q)[held], np.eye(self.model.nv)[held]

        start = q
        for goal in (hold_actuators, nothing):
            try:
                q, evaluation, _ = self._newton(start, goal)
            except _NotConverged as failure:
                metres, radians = failure.residual
                continue
            if self._assembled(evaluation[0]):
                return q
            metres, radians = self._split(evaluation[2])
        worst = self._worst_loop(start)
        raise UnreachablePoseError(
            f"the loops of '{self.mechanism.name}' do not close from its home position: the best that was found leaves "
            f"{metres:.3g} m and {radians:.3g} rad; loop '{worst}' is farthest open at the start. "
            "Check the frames of this loop, or give a start near closure with <home joint=\"value\"/> (or home={...})",
            residual=(metres, radians),
        )

    def _worst_loop(self, q: Array) -> str:
        residual = np.abs(self._evaluate(q)[2])
        return self.mechanism.loops[self.row_loop[int(np.argmax(residual))]].name

    def _assembled(self, placements: Array) -> bool:
        """Return False where a rotation row vanishes at the wrong root: frames turned by half a turn."""
        for loop, (a, b) in zip(self.mechanism.loops, self._ends, strict=True):
            error = (placements[a] @ loop.first.placement)[:3, :3].T @ (placements[b] @ loop.second.placement)[:3, :3]
            turning = [axis for axis, name in enumerate(("rx", "ry", "rz")) if name in loop.free]
            if not turning and np.trace(error) < 2.9:
                return False
            if len(turning) == 1 and error[turning[0], turning[0]] < 0.9:
                return False
        return True

    # -- scales ----------------------------------------------------------------------------------------------------

    @cached_property
    def length(self) -> float:
        """Characteristic length [m]: root mean square distance of the joints from the tool at home."""
        placements = self._evaluate(self.home)[0]
        tool = self.mechanism.tool
        at = (placements[tool.joint] @ tool.placement)[:3, 3]
        distances = np.linalg.norm(placements[1:, :3, 3] - at, axis=1)
        size = float(np.sqrt(np.mean(distances**2))) if len(distances) else 0.0
        return size if size > 1e-6 else 1.0

    def scales(self, dofs: Array) -> tuple[Array, Array]:
        """Return row and column factors that make the closure Jacobian of `dofs` dimensionless."""
        jacobian = self._evaluate(self.home)[1]
        slides = np.abs(jacobian[3:, dofs]).max(axis=0, initial=0.0) < 1e-9
        return np.where(self._is_translation, 1 / self.length, 1.0), np.where(slides, self.length, 1.0)

    @cached_property
    def _free_scales(self) -> tuple[Array, Array]:
        return self.scales(self.mechanism.free_dofs)

    # -- poses -----------------------------------------------------------------------------------------------------

    def pose(self, wanted: Mapping[str, float]) -> ClosedPose:
        """Return the pose with the wanted task coordinates."""
        target = self.task.target(wanted)
        requested = dict(zip(self.task.names, target.tolist(), strict=True))
        return self.reach(target, requested, self.task.goal)

    def pose_from_actuators(self, values: Sequence[float], near: ClosedPose | None = None) -> ClosedPose:
        """Return the pose with the given actuator positions, on the assembly branch of home (or of `near`)."""
        model, mechanism = self.model, self.mechanism
        names, dofs = mechanism.actuated, mechanism.actuated_dofs
        try:
            array = np.asarray(values, float).ravel()
        except (TypeError, ValueError) as error:
            raise InputError(f"actuator positions must be numbers; got {values!r}") from error
        if not np.isfinite(array).all():
            raise InputError(f"actuator positions must be finite; got {values!r}")
        start = self.home if near is None else near.q
        if not mechanism.loops and len(array) == model.nq and len(array) != len(names):
            return self._finish(pin.normalize(model, array), {})
        if len(array) != len(names):
            raise InputError(f"expected {len(names)} actuator positions ({', '.join(names)}); got {len(array)}")
        requested = dict(zip(names, array.tolist(), strict=True))
        reference = self.home.copy()
        for name, value in requested.items():
            _set_joint(model, reference, mechanism.joint_id(name), value)
        if not mechanism.loops:
            return self._finish(reference, requested)
        self._check_limits(reference, requested, only=set(names))
        rows = np.eye(model.nv)[dofs]
        here = _joint_values(model, start, dofs)

        def goal(target):
            at = start.copy()
            for name, value in zip(names, target, strict=True):
                _set_joint(model, at, mechanism.joint_id(name), value)

            def residual(q, placements, jacobian):
                return pin.difference(model, at, q)[dofs], rows

            return residual

        return self.reach(array, requested, goal, start, here)

    def pose_from_configuration(self, q: Sequence[float]) -> ClosedPose:
        """Return the pose at a full Pinocchio configuration that already closes the loops."""
        array = np.asarray(q, float).ravel()
        if array.shape != (self.model.nq,) or not np.isfinite(array).all():
            raise InputError(f"expected a configuration of {self.model.nq} finite numbers; got {q!r}")
        metres, radians = self._split(self._evaluate(array)[2])
        if max(metres, radians) > 1e-6:
            raise UnreachablePoseError(
                f"this configuration leaves the loops open by {metres:.3g} m and {radians:.3g} rad; expected a closed one. "
                "Use pose(...) or pose_from_actuators(...), which close the loops",
                residual=(metres, radians),
            )

        def stay(at, placements, jacobian):
            return np.zeros(0), np.zeros((0, self.model.nv))

        return self._finish(self._newton(array, stay)[0], {})

    def reach(self, target: Array, requested: dict, goal_of, start: Array | None = None, here: Array | None = None) -> ClosedPose:
        """Return the pose at `target`: Newton straight there, or along the line from home in shrinking steps.

        `goal_of(target)` makes the rows for Newton; `requested` names the target in messages (empty: no suggestions).
        """
        origin = self.home if start is None else start
        try:
            q, evaluation, _ = self._newton(origin, goal_of(target))
            if self._assembled(evaluation[0]) and self._outside(q) is None:
                return self._finish(q, requested, evaluation)
        except _NotConverged:
            pass
        if here is None:
            here = self.task.values(self._evaluate(origin)[0])
        q, reached, failure = self._follow(origin, here, target, goal_of)
        if reached == 1.0:
            return self._finish(q, requested)
        raise self._unreachable(requested, target, here, q, reached, failure)

    def _follow(self, q: Array, here: Array, target: Array, goal_of) -> tuple[Array, float, tuple[float, float]]:
        """Return (q, reached share of the line, residual of the step that failed)."""
        reached, step, residual = 0.0, 0.25, (np.inf, np.inf)
        while reached < 1.0 and step > 1e-4:
            share = min(1.0, reached + step)
            try:
                candidate, evaluation, _ = self._newton(q, goal_of(here + share * (target - here)))
                jump = np.abs(pin.difference(self.model, q, candidate)).max(initial=0.0)
                if not self._assembled(evaluation[0]) or jump > 0.5:
                    raise _NotConverged(candidate, self._split(evaluation[2]))
                q, reached, step = candidate, share, step * 2
            except _NotConverged as failure:
                residual = failure.residual
                step /= 2
        return q, reached, residual

    def _unreachable(self, requested, target, here, q, reached, residual) -> UnreachablePoseError:
        from .feasible import nearest_feasible

        by_task = set(requested) == set(self.task.names) and self.task.names
        nearest = nearest_feasible(self, requested, q) if by_task else None
        if nearest is None and reached > 0:
            along = here + reached * (target - here)
            nearest = dict(zip(requested, along.tolist(), strict=True))
        units = self.task.units if by_task else {}
        return UnreachablePoseError(
            f"'{self.mechanism.name}' cannot reach {_listed(requested, units)}: the loops do not close there "
            f"(left open by {residual[0]:.3g} m, {residual[1]:.3g} rad). "
            + (f"Nearest feasible: {_listed(nearest, units)}" if nearest else "No feasible pose was found near it"),
            requested,
            nearest,
            residual,
        )

    # -- checks ----------------------------------------------------------------------------------------------------

    def _outside(self, q: Array) -> tuple[str, float, float, float] | None:
        """Return (joint, value, lower, upper) of the joint farthest outside its limits, or None."""
        excess = np.maximum(self._lower - q, q - self._upper)
        worst = int(np.argmax(excess)) if len(excess) else 0
        if not len(excess) or excess[worst] <= 1e-9:
            return None
        for index in range(1, self.model.njoints):
            joint = self.model.joints[index]
            if joint.idx_q <= worst < joint.idx_q + joint.nq:
                return self.model.names[index], float(q[worst]), float(self._lower[worst]), float(self._upper[worst])
        return None

    def _check_limits(self, q: Array, requested: dict, only: set[str] | None = None) -> None:
        outside = self._outside(q)
        if outside is None or (only is not None and outside[0] not in only):
            return
        name, value, lower, upper = outside
        text = f"joint '{name}' would stand at {value:.6g}, outside its limits {lower:.6g} … {upper:.6g}"
        if not self.mechanism.description.described:
            warnings.warn(f"{text} (of a controller: C is defined there all the same)", JointLimitWarning, stacklevel=4)
            return
        from .feasible import nearest_feasible

        by_task = bool(requested) and set(requested) == set(self.task.names)
        nearest = nearest_feasible(self, requested, q) if by_task else None
        if nearest is None and name in requested:
            nearest = {**requested, name: min(max(value, lower), upper)}
        units = self.task.units
        raise UnreachablePoseError(
            f"'{self.mechanism.name}' cannot reach {_listed(requested, units)}: {text}. "
            + (f"Nearest feasible: {_listed(nearest, units)}" if nearest else "Move the request towards the middle of the workspace"),
            requested,
            nearest,
        )

    def _finish(self, q: Array, requested: dict, evaluation=None) -> ClosedPose:
        """Check limits and singularity, and freeze the pose."""
        self._check_limits(q, requested)
        placements, jacobian, residual, wrenches, closure = evaluation or self._evaluate(q)
        balance = self._balance(closure, jacobian, placements, requested)
        for array in (q, placements, jacobian, wrenches, closure):
            array.flags.writeable = False
        coordinates = dict(zip(self.task.names, self.task.values(placements).tolist(), strict=True))
        return ClosedPose(
            self.mechanism, q, placements, jacobian, closure, wrenches, balance, self._split(residual), coordinates
        )

    def _balance(self, closure: Array, jacobian: Array, placements: Array, requested: dict) -> PassiveBalance:
        """Return how the free joints balance. Raises SingularPoseError where the tool can still move."""
        free = self.mechanism.free_dofs
        rows, columns = self._free_scales
        scaled = closure[:, free] * columns * rows[:, None]
        count, size = scaled.shape
        if count == size:
            try:
                inverse = np.linalg.inv(scaled.T)
            except np.linalg.LinAlgError:
                inverse = None
            if inverse is not None and np.abs(inverse).max(initial=0.0) * np.abs(scaled).max(initial=0.0) < SINGULAR:
                return PassiveBalance(inverse * rows[:, None] * columns, np.zeros((count, 0)), np.zeros((size, 0)))
        u, singular_values, vt = np.linalg.svd(scaled.T)
        limit = singular_values.max(initial=0.0) / SINGULAR
        rank = int((singular_values > limit).sum())
        inverse = (vt[:rank].T / singular_values[:rank]) @ u[:, :rank].T
        self_stress = vt[rank:].T * rows[:, None]
        idle = u[:, rank:] * columns[:, None]
        if idle.shape[1]:
            tool = self.mechanism.tool
            at = (placements[tool.joint] @ tool.placement)[:3, 3]
            moved = jacobian[:, free] * self.mechanism.support[self.mechanism.dof_joint[free], tool.joint]
            twist = moved @ idle
            twist[:3] -= skew(at) @ twist[3:]
            size_of = np.abs(np.concatenate((twist[:3] / self.length, twist[3:]))).max(axis=0)
            if (size_of > 1e-6).any():
                self._refuse_singular(twist[:, int(np.argmax(size_of))], idle[:, int(np.argmax(size_of))], requested)
        return PassiveBalance(inverse * rows[:, None] * columns, self_stress, idle)

    def _refuse_singular(self, twist: Array, motion: Array, requested: dict) -> None:
        names = [self.mechanism.dof_names[dof] for dof in self.mechanism.free_dofs]
        strongest = [names[i] for i in np.argsort(-np.abs(motion))[:3] if abs(motion[i]) > 1e-6]
        twist = twist / np.abs(twist).max()
        direction = ", ".join(f"{name} {value:+.2f}" for name, value in zip(("dx", "dy", "dz", "rx", "ry", "rz"), twist, strict=True) if abs(value) > 0.01)
        units = self.task.units
        nearest = None
        if requested and set(requested) == set(self.task.names):
            from .feasible import last_regular

            nearest = last_regular(self, requested)
        raise SingularPoseError(
            f"singular pose{' ' + _listed(requested, units) if requested else ''}: with the actuators locked the tool can "
            f"still move ({direction}), through {', '.join(strongest)}; no stiffness holds it. "
            + (f"Nearest regular: {_listed(nearest, units)}" if nearest else "Lock or actuate one of these joints, or leave this pose"),
            requested,
            nearest,
        )


def _solve(matrix: Array, right: Array) -> Array:
    """Return the solution, or the least one where rows are redundant or motions free."""
    if matrix.shape[0] == matrix.shape[1]:
        try:
            step = np.linalg.solve(matrix, right)
            if np.abs(step).max(initial=0.0) < 1e3:
                return step
        except np.linalg.LinAlgError:
            pass
    return np.linalg.lstsq(matrix, right, rcond=1e-9)[0]


def _set_joint(model: pin.Model, q: Array, index: int, value: float) -> None:
    """Set a joint with one degree of freedom; an endless one is stored as cosine and sine."""
    joint = model.joints[index]
    if joint.nv != 1:
        raise InputError(f"joint '{model.names[index]}' has {joint.nv} degrees of freedom; expected a joint with one")
    q[joint.idx_q : joint.idx_q + joint.nq] = (value,) if joint.nq == 1 else (np.cos(value), np.sin(value))


def _joint_values(model: pin.Model, q: Array, dofs) -> Array:
    return pin.difference(model, pin.neutral(model), q)[dofs]


def _limits(model: pin.Model) -> tuple[Array, Array]:
    """Return limits on q; none where a joint has no plain coordinate."""
    lower, upper = np.full(model.nq, -np.inf), np.full(model.nq, np.inf)
    for index in range(1, model.njoints):
        joint = model.joints[index]
        if joint.nq == joint.nv == 1:
            low, high = model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q]
            if low < high:
                lower[joint.idx_q], upper[joint.idx_q] = low, high
    return lower, upper


def _listed(values: Mapping[str, float], units: Mapping[str, str]) -> str:
    """Return 'z = 0.4 m, theta = 0.436 rad (25 deg)'."""
    parts = []
    for name, value in values.items():
        unit = units.get(name, "")
        degrees = f" ({np.degrees(value):.4g} deg)" if unit == "rad" else ""
        parts.append(f"{name} = {value:.5g}{' ' + unit if unit else ''}{degrees}")
    return ", ".join(parts)

