"""Closing the loops: Newton's method on closure and task coordinates together.

The Jacobian of both is exact on and off closure, so that Newton converges quadratically.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import cached_property
from math import hypot, inf, remainder, tau
from operator import le
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from ..errors import InputError, JointLimitWarning, SingularPoseError, UnreachablePoseError, named, shortened
from ..kernel import NEGLIGIBLE, Configuration, Factors, LoopedTree, Passing, inverse, rank_of
from ..mechanism import Mechanism
from ..numbers import number, quantity, some
from ..parameters import meant_otherwise
from ..spatial import MOST_POSITION, TWIST_NAMES, Array, frobenius, skew
from .closed_pose import ClosedPose, PassiveBalance, split_residual
from .feasible import last_regular, nearest_feasible
from .start import NoPlaceError, PolynomialStart
from .task import TaskFrame, TaskRows, is_finite

#: Residual at which the loops must be closed [m, rad].
TOLERANCE = 1e-12
#: Newton goes on to rounding: until the residual is below this, or the last step was so small that the next one is.
ROUNDING = 1e-14
LAST_STEP = 1e-9
#: Rounding allowed beyond a joint's limit [m, rad].
_AT_LIMIT = 1e-9
#: Digits in which coordinates are told, and by which shares of the way home what lies between them is told instead.
_DIGITS, _INWARDS = 5, (0.0, 1e-4, 1e-3, 1e-2)
#: Of the nearest pose, what is less is an optimiser's rounding [m, rad].
_ROUNDING = 1e-6
#: An arm's nearest pose that is farther off [m, rad] shows that what was asked for is out of reach.
_BEYOND = 1e-4
#: Decimals [m, rad] of home's coordinates where a pose takes some of them.
_HOME_DIGITS = 9
#: A loop that is less open where home is given is closed as it was meant [m, rad]: two digits are that coarse.
_LITTLE_OPEN = 0.01
#: A solution is taken for the same assembly branch where no joint has moved farther than this [m, rad].
NEAR = 0.7
#: ... or where a polynomial told it as well as this.
SURE = 0.1
ITERATIONS = 40
#: Steps are shortened to this [m, rad].
SHORT = 0.6
#: After a step shorter than this [m, rad], and much shorter than the one before, the matrix is kept.
_SAME = 3e-4
#: A longer step [m, rad] comes from a matrix that is as good as singular.
LONGEST = 1e3


class _NotConvergedError(Exception):
    def __init__(self, q: Array, residual: tuple[float, float]):
        self.q, self.residual = q, residual


#: From (q, placements) to the residual of what is wanted, and to its rows as a function of the Jacobian.
Goal = Callable[[Array, Array], tuple[list[float], Callable[[Array], Array]]]


class LoopKinematics:
    """Solves one mechanism's closure. An answer depends on nothing but the question."""

    def __init__(self, mechanism: Mechanism, tree: LoopedTree | None = None):
        self.mechanism = mechanism
        self.model = mechanism.model
        self._tree = tree or LoopedTree(mechanism)
        self.task = TaskFrame.of(mechanism)
        self.closure = self._tree.closure
        self._factors = Factors()
        # Which velocities move what: loops, then task coordinates.
        self._signs = np.concatenate((self.closure.sign, self.task.moves))
        self.lower, self.upper = mechanism.limits
        self._least, self._most = self.lower - _AT_LIMIT, self.upper + _AT_LIMIT
        self._limits = self._least.tolist(), self._most.tolist()

    def of(self, mechanism: Mechanism) -> LoopKinematics:
        """Return the kinematics of a mechanism that differs in its modules or brakes alone; what is known is kept."""
        other = LoopKinematics(mechanism, self._tree)
        for name in ("home", "_home", "length", "newton_scales", "start"):
            if name in self.__dict__:
                other.__dict__[name] = self.__dict__[name]
        return other

    def prepare(self, count: int) -> list[dict[str, float]]:
        """Work out what no pose decides, and return task coordinates of up to `count` places about home.

        There Newton's method goes straight from its start to joints within their limits. Raises UnreachablePoseError
        where the loops do not close.
        """
        self._freeze(self.home, self._home, {})
        found = []
        for target in self.start.about_home(count):
            start = self.start(target)
            with suppress(_NotConvergedError):
                if start is not None and not self._outside(self._near(start, self.task.goal(target), within=SURE)[0]):
                    found.append(dict(zip(self.task.names, target.tolist(), strict=True)))
        return found

    # -- evaluation ----------------------------------------------------------------------------------------------

    def evaluate(self, q: Array) -> Configuration:
        """Return placements, Jacobian and closure at a configuration."""
        return self._tree.at(q)

    def _split(self, residual: Array) -> tuple[float, float]:
        return split_residual(self.mechanism, residual)

    def _newton(self, q: Array, goal: Goal) -> tuple[Array, Configuration, float]:
        """Return the solution, its kinematics, and the sum of the steps [m, rad]. Raises _NotConvergedError."""
        tree, solve, longest, before, way = self._tree, None, inf, inf, 0.0
        coupling = self.mechanism.coupling
        if coupling:
            q = q.copy()
            coupling.place(q)
        for _ in range(ITERATIONS):
            at = tree.passing(q)
            wanted, wanted_rows = goal(q, at.placements)
            error = at.gap.tolist() + wanted
            size = hypot(*error)
            if size < ROUNDING or (size < TOLERANCE and longest < LAST_STEP):
                return q, tree.completed(at), way
            if longest < LAST_STEP and self._as_drawn(at.gap, wanted):
                return q, tree.completed(at), way
            if not size < inf:
                break
            if solve is None or longest > _SAME or longest > 0.1 * before:
                matrix = self._matrix(at, wanted_rows)
                step, solve, length = self._solved(matrix, np.array(error))
            else:
                step = solve(np.array(error))
                length = hypot(*step.tolist())
            if coupling:
                step = coupling.motions @ step
            before, longest = longest, length
            if longest > SHORT:
                longest = np.abs(step).max(initial=0.0)
                step *= min(1.0, SHORT / longest)
            way += longest
            q = tree.moved(q, -step)
        raise _NotConvergedError(
            q, self._split(self.evaluate(q).residual) if np.isfinite(q).all() else (np.inf, np.inf)
        )

    def _matrix(self, at: Passing, wanted_rows: Callable[[Array], Array]) -> Array:
        """Return the Jacobian of gaps and what is wanted (c + t, nv), where this thread's last passing was.

        Followers are moved by their leaders.
        """
        if isinstance(wanted_rows, TaskRows):
            # Copied, as Pinocchio's comes by columns: two plain matrices are multiplied in half the time.
            matrix = self._tree.wrenches(at, wanted_rows.in_line).dot(at.jacobian.copy())
            matrix *= self._signs
        else:
            closure = self.closure.jacobian(self._tree.wrenches(at), at.jacobian)
            matrix = np.concatenate((closure, wanted_rows(at.jacobian)))
        return matrix @ self.mechanism.coupling.motions if self.mechanism.coupling else matrix

    def _as_drawn(self, gap: Array, wanted: Sequence[float]) -> bool:
        """Return True where all that is left open is what the drawing of frames makes of redundant closures.

        Seven digits tell a hinge's axis to 1e-7: parallel ones then say the same thing a little differently, and no
        motion of the joints closes that.
        """
        rows, _ = self.newton_scales
        return bool(np.abs(gap * rows).max(initial=0.0) < NEGLIGIBLE and np.abs(wanted).max(initial=0.0) < TOLERANCE)

    def _solved(self, matrix: Array, right: Array) -> tuple[Array, Callable[[Array], Array], float]:
        """Return the solution, least where rows are redundant or motions free, what solves for another `right`, and
        the solution's length."""
        if matrix.shape[0] == matrix.shape[1]:
            solve = self._factors.solver(matrix)
            solution = solve(right)
            if (length := hypot(*(solution if solution.ndim == 1 else solution.ravel()).tolist())) < LONGEST:
                return solution, solve, length
        # of the closure Jacobian with rows of wanted coordinates below it
        rows, columns = self.newton_scales
        wanted = np.abs(matrix[len(rows) :] * columns).max(axis=1, initial=0.0)
        rows = np.concatenate((rows, 1 / np.where(wanted > 0, wanted, 1.0)))
        least = rank_of(matrix, rows, columns).inverse
        solution = least @ right
        return solution, least.__matmul__, hypot(*solution.ravel().tolist())

    def _nothing(self, q: Array, placements: Array) -> tuple[list[float], Callable[[Array], Array]]:
        """The goal of closing the loops and nothing else."""
        return [], lambda jacobian: np.zeros((0, self.model.nv))

    # -- home ------------------------------------------------------------------------------------------------------

    @cached_property
    def home(self) -> Array:
        """A configuration near the file's home position with closed loops. Raises UnreachablePoseError."""
        q = self.mechanism.home_configuration()
        if not len(self.closure.row_loop):
            return q
        held, given = self.mechanism.actuated_dofs, q.copy()

        def hold_actuators(q, placements):
            away = pin.difference(self.model, given, q)[held]
            return away.tolist(), lambda jacobian: np.eye(self.model.nv)[held]

        # Near the file's home first, actuators held; then from anywhere, since far off Newton may end in a branch
        # where two frames meet half a turn apart.
        generator = np.random.default_rng(0)
        starts = [(q, hold_actuators), (q, self._nothing)]
        for size in np.repeat((0.1, 0.3, 1.0, 3.0), 8):
            starts.append((pin.integrate(self.model, q, size * generator.uniform(-1, 1, self.model.nv)), self._nothing))
        metres, radians = np.inf, np.inf
        for start, goal in starts:
            try:
                closed, evaluation, _ = self._newton(start, goal)
            except _NotConvergedError as failure:
                if max(failure.residual) < max(metres, radians):
                    metres, radians = failure.residual
                continue
            if evaluation.assembled:
                return closed
            metres, radians = min((metres, radians), (0.0, np.pi), key=max)
        worst = self._worst_loop(q)
        raise UnreachablePoseError(
            f"the loops of '{self.mechanism.name}' do not close from its home position: the best that was found leaves "
            f"{number(metres, 3)} m and {number(radians, 3)} rad; loop '{worst}' is farthest open at the start. "
            f"{self._far_homes() or 'Check the frames of this loop, or give'} a start near closure with "
            f'<home joint="value"/>{self._home_line()} (or home={{...}})',
            residual=(metres, radians),
        )

    def _far_homes(self) -> str:
        """Return which positions of the home are hardly in m and rad, or outside limits; '' where none is.

        As a sentence and 'Give'.
        """
        far = []
        for name, value in self.mechanism.description.home.items():
            joint = self.mechanism.joint(name)
            if told := meant_otherwise(value, joint.unit or ""):
                far.append(f"{name} = {told}")
            elif not self._within(name, value):
                lower, upper = float(self.lower[joint.first_q]), float(self.upper[joint.first_q])
                far.append(f"{name} = {self._told_outside(value, lower, upper, joint.unit or '')}")
        return f"Home has {'; '.join(far)}. Give" if far else ""

    def _home_line(self) -> str:
        line = self.mechanism.description.lines.get("home")
        return f" in line {line}" if line else ""

    def home_pose(self) -> ClosedPose:
        """Return the closed pose at home. Raises UnreachablePoseError, SingularPoseError."""
        return self.pose_from_configuration(self.home)

    @cached_property
    def _home(self) -> Configuration:
        """The evaluation at home, where every cold start begins."""
        return self.evaluate(self.home)

    def home_not_closed(self) -> str:
        """Return how far the loops are open at the file's home, and where home was taken instead; '' of closed ones.

        Raises UnreachablePoseError where they do not close at all.
        """
        if not (open_by := self._open_at_start()):
            return ""
        given, joints = self.mechanism.home_configuration(), self.mechanism.joints
        moved = np.abs(pin.difference(self.model, given, self.home))
        single = [joint for joint in joints if joint.nq == joint.nv == 1 and moved[joint.first_v] > _ROUNDING]
        driven = [joint for joint in single if joint.name in self.mechanism.actuated]
        places = [
            f"{joint.name} {self._told(self.home[joint.first_q], joint.unit or '', 4)}, given "
            f"{number(given[joint.first_q])}"
            for joint in driven or single
        ]
        kept = "" if driven else "its drives kept, "
        return (
            f"home, as the file gives it{self._home_line()}, does not close its loops: they are {open_by}. It was "
            f"taken where they close: {kept}{'; '.join(some(places))}. Check that loop's frames and lengths, or give a "
            "home that closes"
        )

    def _open_at_start(self) -> str:
        """Return 'open by 0.3 m, loop 'tip' the farthest' of the file's home; '' where it is closed as it was meant."""
        q = self.mechanism.home_configuration()
        open_by = self._split(self.evaluate(q).residual) if self.mechanism.loops else (0.0, 0.0)
        if max(open_by) < _LITTLE_OPEN:
            return ""
        sizes = [
            f"{number(size, 3)} {unit}" for size, unit in zip(open_by, ("m", "rad"), strict=True) if size > _AT_LIMIT
        ]
        worst = self._worst_loop(q)
        given = next(loop for loop in self.mechanism.description.loops if loop.name == worst)
        stands = f' (free="{" ".join(sorted(given.free))}", line {given.line})' if given.line else ""
        return f"open by {' and '.join(sizes)}, loop '{worst}' the farthest{stands}"

    def _start_wanted(self) -> str:
        """Return why no loop closes near the file's home, as a sentence and 'or give'; 'Give' where it is closed."""
        if far := self._far_homes():
            return far
        if not (open_by := self._open_at_start()):
            return "Give"
        return (
            f"The loops close nowhere near: as home is given, they are {open_by}. Check its frames and what it leaves "
            "free, or give"
        )

    def _worst_loop(self, q: Array) -> str:
        residual = np.abs(self.evaluate(q).residual)
        return self.mechanism.loops[self.closure.row_loop[int(np.argmax(residual))]].name

    # -- scales ----------------------------------------------------------------------------------------------------

    @cached_property
    def length(self) -> float:
        """Characteristic length [m]: root mean square distance of the joints from the tool at home.

        Of a robot without a tool frame, from their own centre.
        """
        return self._size(self._home.placements)

    def _size(self, placements: Array) -> float:
        joints = placements[1:, :3, 3]
        if not len(joints):
            return 1.0
        tool = self.mechanism.tool
        centre = joints.mean(axis=0) if tool is None else (placements[tool.joint] @ tool.placement)[:3, 3]
        size = float(np.sqrt(((joints - centre) ** 2).sum(axis=1).mean()))
        return size if size > 1e-6 else 1.0

    def scales(self, dofs: Array) -> tuple[Array, Array]:
        """Return row and column factors that make the closure Jacobian of `dofs` dimensionless."""
        return self._scales(self.length, dofs)

    def _scales(self, length: float, dofs: Array) -> tuple[Array, Array]:
        slides = np.array([not any(twist[3:]) for joint in self.mechanism.joints for twist in joint.subspace.T], bool)
        return np.where(self.closure.is_translation, 1 / length, 1.0), np.where(slides[dofs], length, 1.0)

    def by_actuators(self, pose: ClosedPose) -> Array:
        """Return the translation of the tool point and turn, base axes, per travel of each actuated joint, (6, a)."""
        mechanism, free = self.mechanism, self.mechanism.free_dofs
        driven = np.array(mechanism.actuated_dofs, int)
        velocities = np.zeros((self.model.nv, len(driven)))
        velocities[driven, np.arange(len(driven))] = 1.0
        velocities[free] = -pose.balance.inverse.T @ pose.closure_jacobian[:, driven]
        moved = self.tool_motion(pose.placements, pose.jacobian, velocities)
        moved[:3] *= self.length
        return moved

    def tool_motion(self, placements: Array, jacobian: Array, velocities: Array) -> Array:
        """Return the tool's dimensionless twist (..., 6, n) about its own point under velocities (..., nv, n).

        Those of followers are their leaders' to say. Without a tool none.
        """
        tool = self.mechanism.tool
        if tool is None:
            return np.zeros((*velocities.shape[:-2], 0, velocities.shape[-1]))
        if self.mechanism.coupling:
            velocities = self.mechanism.coupling.motions @ velocities
        twist = (jacobian * self.mechanism.support[self.mechanism.dof_joint, tool.joint]) @ velocities
        twist[..., :3, :] -= skew((placements[..., tool.joint, :, :] @ tool.placement)[..., :3, 3]) @ twist[..., 3:, :]
        twist[..., :3, :] /= self.length
        return twist

    @cached_property
    def newton_scales(self) -> tuple[Array, Array]:
        """Row and column factors that make the closure Jacobian of all velocities dimensionless."""
        # Home is not known while its loops are still open.
        drawn = self._tree.at(self.mechanism.home_configuration()).placements
        return self._scales(self._size(drawn), np.arange(self.model.nv))

    @cached_property
    def free_spread(self) -> float:
        """The most that scaling the free columns of the closure Jacobian can add to its condition number."""
        spread = 1.0
        for scale in self.free_scales:
            spread *= scale.max(initial=1.0) / scale.min(initial=1.0)
        return float(spread)

    @cached_property
    def _no_freedom(self) -> tuple[Array, Array]:
        """No self-stress (c, 0) and no idle motion (f, 0)."""
        return np.zeros((self.closure.size, 0)), np.zeros((len(self.mechanism.free_dofs), 0))

    @cached_property
    def free_scales(self) -> tuple[Array, Array]:
        """Row and column factors that make the free joints' part of the closure Jacobian dimensionless."""
        return self.scales(self.mechanism.free_dofs)

    @cached_property
    def free_rank(self) -> int:
        """Rank of the free joints' part of the closure Jacobian at home."""
        rows, columns = self.free_scales
        return rank_of(self._home.closure[:, self.mechanism.free_dofs], rows, columns).rank

    # -- poses -----------------------------------------------------------------------------------------------------

    def at_coordinates(self, row: Array) -> ClosedPose:
        """Return the pose at coordinates (t,), the tasks, or without any the actuated joints.

        Raises as `reach` does, without looking for what might be reached instead.
        """
        return self.reach(row, {}, self.task.goal) if self.mechanism.tasks else self.pose_from_actuators(row)

    def pose(self, wanted: Mapping[str, float]) -> ClosedPose:
        """Return the pose with the wanted task coordinates; those not given stay at a home that the file declares."""
        given = wanted if len(wanted) >= len(self.task.names) else self.completed(wanted)
        target = self.task.target(given)
        requested = dict(zip(self.task.names, target, strict=True))
        start = self.start(target)
        if start is not None:
            try:
                q, evaluation = self._near(start, self.task.goal(target), within=SURE)
                if self._outside(q) is None:
                    return self._freeze(q, evaluation, requested)
            except _NotConvergedError:
                pass
        return self.reach(np.array(target), requested, self.task.goal)

    def completed(self, wanted: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return what is wanted with home's value of every coordinate that is not, where the file declares a home.

        Of a robot without task coordinates these are its actuated joints; where it has no loops home is always there.
        """
        names, home = self.task.names or self.mechanism.actuated, self.mechanism.description.home
        declared = home or not (self.task.names or self.mechanism.loops)
        if not wanted or not declared or set(names) <= set(wanted) or set(wanted) - set(names):
            return wanted
        if self.task.names:
            values = (np.round(self.task.values(self._home.placements), _HOME_DIGITS) + 0.0).tolist()
        else:
            values = [float(self.mechanism.joint(name).position(self.home)) for name in names]
        return {name: value for name, value in zip(names, values, strict=True) if name not in wanted} | dict(wanted)

    @cached_property
    def start(self) -> PolynomialStart:
        """Where Newton's method begins at task coordinates near home."""
        task = self.task

        def solve(start: Array, target: Array) -> tuple[Array, Array]:
            goal = task.goal(target)
            try:
                q, at = self._near(start, goal, within=SURE)
            except _NotConvergedError:
                raise NoPlaceError(f"no closed configuration at {target} near {start}") from None
            motions = self.mechanism.coupling.motions
            matrix = np.concatenate((at.closure, goal(q, at.placements)[1](at.jacobian) @ motions))
            wanted = np.eye(len(matrix))[:, len(at.closure) :]
            return q, motions @ self._solved(matrix, wanted)[0]

        here = task.values(self._home.placements)
        costly = len(self._home.closure) + len(here) != self.model.nv  # least steps take longer
        scale = np.array([self.length if task.units[name] == "m" else 1.0 for name in task.names])
        return PolynomialStart(self._tree, self.home, here, scale, solve, costly)

    def pose_from_actuators(
        self, values: Mapping[str, float] | Sequence[float] | Array, near: ClosedPose | None = None
    ) -> ClosedPose:
        """Return the pose with the given actuator positions, on the assembly branch of home (or of `near`)."""
        model, mechanism = self.model, self.mechanism
        names = mechanism.actuated
        if isinstance(values, Mapping):
            by_name = values
            for name in by_name:
                named("actuated joint", name, dict.fromkeys(names))
            if missing := [name for name in names if name not in by_name]:
                raise InputError(f"missing actuator positions: {', '.join(missing)}; give all of {', '.join(names)}")
            values = [by_name[name] for name in names]
        try:
            array = np.asarray(values, float).ravel()
        except (OverflowError, TypeError, ValueError) as error:
            raise InputError(f"actuator positions must be numbers; got {shortened(values)}") from error
        if not np.isfinite(array).all():
            raise InputError(f"actuator positions must be finite; got {values!r}")
        start = self.home if near is None else near.q
        if not mechanism.loops and len(array) == model.nq and len(array) != len(names):
            q = pin.normalize(model, array)
            self._check_followers(q)
            return self._finish(q, self.evaluate(q), {})
        if len(array) != len(names):
            raise InputError(f"expected {len(names)} actuator positions ({', '.join(names)}); got {len(array)}")
        requested = dict(zip(names, array.tolist(), strict=True))
        reference = self.home.copy()
        for name, value in requested.items():
            self._set_joint(reference, name, value)
        mechanism.coupling.place(reference)
        if not mechanism.loops:
            return self._finish(reference, self.evaluate(reference), requested)
        self._check_limits(reference, requested, only=set(names))
        return self._driven(array, requested, start)

    def _driven(self, values: Array, requested: dict, start: Array) -> ClosedPose:
        """Return the pose with all drives at `values` [m or rad], from a start; `requested` as in `reach`."""
        model, mechanism, dofs = self.model, self.mechanism, self.mechanism.actuated_dofs
        rows = np.eye(model.nv)[dofs]
        here = _joint_values(model, start, dofs)

        def goal(target):
            at = start.copy()
            for name, value in zip(mechanism.actuated, target, strict=True):
                mechanism.set_joint(at, name, value)

            def residual(q, placements):
                return pin.difference(model, at, q)[dofs].tolist(), lambda jacobian: rows

            return residual

        try:
            return self.reach(values, requested, goal, start, here)
        except UnreachablePoseError:
            # a hinge stands where it does whole turns on, and on the way there the loops may not close
            turning = np.array([mechanism.joint(name).turns for name in mechanism.actuated])
            turns = np.where(turning, tau * np.round((values - here) / tau), 0.0)
            if not turns.any():
                raise
            with suppress(UnreachablePoseError):
                q = self.reach(values - turns, {}, goal, start, here).q.copy()
                for name, value in zip(mechanism.actuated, values.tolist(), strict=True):
                    mechanism.set_joint(q, name, value)
                return self._freeze(q, self.evaluate(q), requested)
            raise

    def pose_of_joints(self, values: Mapping[str, float]) -> ClosedPose:
        """Return the pose of a tree with joints at given positions [m or rad], the others at home."""
        q, requested = self.home.copy(), {}
        for name, value in values.items():
            joint = self.mechanism.joint(name)
            if not is_finite(value):
                raise InputError(f"{name} = {shortened(value)}: expected a finite number [{joint.unit}]")
            self._set_joint(q, name, float(value))
            requested[name] = float(value)
        self.mechanism.coupling.place(q)
        for name, value in requested.items():
            if (
                name in self.mechanism.coupling.names
                and abs(self.mechanism.joint(name).position(q) - value) > _AT_LIMIT
            ):
                raise InputError(f"{name} = {number(value, 6)}: this joint follows another one; leave it out")
        return self._finish(q, self.evaluate(q), requested)

    def _set_joint(self, q: Array, name: str, value: float) -> None:
        """Set a joint's position [m or rad] in q. Raises InputError where no part of a turn is left of its digits."""
        if abs(value) > MOST_POSITION:
            unit = self.mechanism.joint(name).unit
            raise InputError(f"{name} = {number(value, 6)} {unit}: expected at most {MOST_POSITION:g} {unit}")
        self.mechanism.set_joint(q, name, value)

    def pose_from_configuration(self, q: Sequence[float] | Array) -> ClosedPose:
        """Return the pose at a full Pinocchio configuration that already closes the loops."""
        try:
            array = np.array(q, float).ravel()
        except (OverflowError, TypeError, ValueError):
            array = np.zeros(0)
        if array.shape != (self.model.nq,) or not np.isfinite(array).all():
            raise InputError(f"expected a configuration of {self.model.nq} finite numbers; got {shortened(q)}")
        self._check_followers(array)
        metres, radians = self._split(self.evaluate(array).residual)
        if max(metres, radians) > 1e-6:
            raise UnreachablePoseError(
                f"this configuration leaves the loops open by {number(metres, 3)} m and {number(radians, 3)} "
                "rad; expected closed "
                "ones. Use pose(...) or pose_from_actuators(...), which close the loops",
                residual=(metres, radians),
            )

        closed, evaluation, _ = self._newton(array, self._nothing)
        return self._finish(closed, evaluation, {})

    def _check_followers(self, q: Array) -> None:
        away = self.mechanism.coupling.away(q)
        if away > 1e-6:
            raise UnreachablePoseError(
                f"this configuration has a joint {number(away, 3)} m or rad from where its leader puts it; expected "
                f"{', '.join(self.mechanism.coupling.names)} where their leaders put them",
                residual=(away, away),
            )

    def reach(
        self, target: Array, requested: dict, goal_of, start: Array | None = None, here: Array | None = None
    ) -> ClosedPose:
        """Return the pose at `target` on the assembly branch of the start (home).

        Straight there where the joints move little, else along the line of coordinates in steps short enough not to
        change branches. `goal_of(target)` makes the rows for Newton; `requested` names the target in messages (empty:
        no suggestions).
        """
        origin = self.home if start is None else start
        try:
            q, evaluation = self._near(origin, goal_of(target))
            if self._outside(q) is None:
                return self._freeze(q, evaluation, requested)
        except _NotConvergedError:
            pass
        if here is None:
            here = self.task.values(self._home.placements)
        q, reached, failure = self._follow(origin, here, target, goal_of)
        if reached == 1.0:
            return self._finish(q, self.evaluate(q), requested)
        raise self._unreachable(requested, target, here, q, reached, failure)

    def _near(self, q: Array, goal: Goal, within: float = NEAR) -> tuple[Array, Configuration]:
        """Return Newton's solution where it is assembled and no joint moves far. Raises _NotConvergedError."""
        found, evaluation, way = self._newton(q, goal)
        far = way > within and np.abs(pin.difference(self.model, q, found)).max() > within
        if far or not evaluation.assembled:
            raise _NotConvergedError(found, self._split(evaluation.residual))
        return found, evaluation

    def _follow(self, q: Array, here: Array, target: Array, goal_of) -> tuple[Array, float, tuple[float, float]]:
        """Return (q, reached share of the line, residual of the step that failed)."""
        reached, step, residual = 0.0, 0.25, (np.inf, np.inf)
        while reached < 1.0 and step > 1e-4:
            share = min(1.0, reached + step)
            try:
                q, _ = self._near(q, goal_of(here + share * (target - here)))
                reached, step = share, step * 2
            except _NotConvergedError as failure:
                residual = failure.residual
                step /= 2
        return q, reached, residual

    def _unreachable(self, requested, target, here, q, reached, residual) -> UnreachablePoseError:
        found = self._nearest_feasible(requested, q)
        nearest = None if found is None else self._confirmed(requested, found)
        if nearest is None and reached > 0 and requested:
            along = here + reached * (target - here)
            nearest = self._confirmed(requested, dict(zip(requested, along.tolist(), strict=True)))
        away = (0.0, 0.0) if found is None or self.mechanism.loops else self._apart(requested, found)
        if max(away) > _BEYOND:
            residual = away
            reason = f"out of reach, {_told(away)} from the nearest pose that was found"
        elif max(residual) < 1e-9:
            doubt = "out of reach, or " if found is None and not self.mechanism.loops else ""
            reason = f"{doubt}a singular pose lies on the way from home, {100 * reached:.0f} % along it"
        else:
            reason = "the loops do not close there"
            if nearest is not None:
                residual = self._apart(requested, nearest)
                reason += f", {_told(residual)} from where they do"
        return UnreachablePoseError(
            f"'{self.mechanism.name}' cannot reach {self._listed(requested)}: {reason}. {self._meant(requested)}"
            + (f"Nearest feasible: {self._listed(nearest)}" if nearest else "No feasible pose was found near it"),
            requested,
            nearest,
            residual,
        )

    def _meant(self, requested: Mapping[str, float]) -> str:
        """Return which coordinates are hardly in m and rad, a sentence each; '' where all may be."""
        told = {name: meant_otherwise(value, self._unit(name)) for name, value in requested.items()}
        return "".join(f"{name} = {text}. " for name, text in told.items() if text)

    def _apart(self, requested: Mapping[str, float], nearest: Mapping[str, float]) -> tuple[float, float]:
        """Return how far two sets of coordinates are apart, over all lengths [m] and over all angles [rad]."""
        apart: dict[str, list[float]] = {"m": [], "rad": []}
        for name, value in requested.items():
            unit = self._unit(name)
            difference = value - nearest[name]
            apart[unit].append(remainder(difference, tau) if unit == "rad" and self.task.names else difference)
        return hypot(*apart["m"]), hypot(*apart["rad"])

    def _confirmed(self, requested: Mapping[str, float], nearest: Mapping[str, float]) -> dict[str, float] | None:
        """Return coordinates in the digits in which they are told, as little towards home as it takes to reach them."""
        if tasks := self._are_tasks(requested):
            home = self.task.values(self._home.placements).tolist()
        else:
            home = [float(self.mechanism.joint(name).position(self.home)) for name in requested]
        for share in _INWARDS:
            moved = [value + share * (end - value) for value, end in zip(nearest.values(), home, strict=True)]
            told = {
                name: float(number(value, _DIGITS)) if abs(value) > _ROUNDING else 0.0
                for name, value in zip(nearest, moved, strict=True)
            }
            if not tasks and any(not self._within(name, value) for name, value in told.items()):
                continue  # rounded across a limit
            with suppress(UnreachablePoseError):
                if tasks:
                    self.reach(np.array([*told.values()]), {}, self.task.goal)
                elif self.mechanism.loops:
                    self._driven(np.array([*told.values()]), {}, self.home)
                else:
                    self.pose_of_joints(told)
                return told
        return None

    def _nearest_feasible(self, requested: Mapping[str, float], q: Array) -> dict[str, float] | None:
        if not self._are_tasks(requested) or self.model.nq != self.model.nv or self.mechanism.coupling:
            return None
        limits = self.lower, self.upper
        return nearest_feasible(self.task, requested, self.evaluate, limits, self.length, (q, self.home))

    def _place(self, placements: Array) -> str:
        """Return what a configuration is called that nobody asked for by coordinates."""
        return "home" if np.allclose(placements, self._home.placements, atol=_AT_LIMIT) else "this configuration"

    def _are_tasks(self, requested: Mapping[str, float]) -> bool:
        """Return True where task coordinates were requested, False for actuator positions or nothing."""
        return bool(requested) and tuple(requested) == self.task.names

    def _listed(self, values: Mapping[str, float]) -> str:
        """Return 'z = 0.4 m, theta = 0.436 rad (25 deg)'."""
        parts = []
        for name, value in values.items():
            value = 0.0 if abs(value) < 1e-12 else value
            parts.append(f"{name} = {self._told(value, self._unit(name), _DIGITS)}")
        return ", ".join(parts)

    @staticmethod
    def _told(value: float, unit: str, digits: int = 6) -> str:
        """Return '0.436 rad (25 deg)'; beyond a turn with how many, '15.708 rad (900 deg, 2.5 turns)'."""
        if unit != "rad":
            return f"{number(value, digits)} {unit}"
        turns = f", {number(value / (2 * np.pi), 3)} turns" if abs(value) > 2 * np.pi * (1 + _ROUNDING) else ""
        return f"{number(value, digits)} rad ({number(np.degrees(value), 4)} deg{turns})"

    def _unit(self, name: str) -> str:
        """Return m or rad, of a task coordinate or a joint."""
        return self.task.units.get(name) or self.mechanism.joint(name).unit or ""

    # -- checks ----------------------------------------------------------------------------------------------------

    def outside_limits(self, q: Array) -> NDArray[np.bool_]:
        """Return which of the configurations (..., nq) leave the limits of a joint, (...)."""
        return np.asarray(((q < self._least) | (q > self._most)).any(axis=-1))

    def _within(self, name: str, value: float) -> bool:
        """Return whether a joint may stand at a position [m or rad]."""
        joint = self.mechanism.joint(name)
        index = joint.first_q  # one that turns round and round has two numbers there, and no limits
        return joint.nq > 1 or bool(self._least[index] <= value <= self._most[index])

    def _outside(self, q: Array) -> tuple[str, float, float, float] | None:
        """Return (joint, value, lower, upper) of the joint farthest outside its limits, or None."""
        values, (least, most) = q.tolist(), self._limits
        if all(map(le, least, values)) and all(map(le, values, most)):
            return None
        worst = int(np.argmax(np.maximum(self.lower - q, q - self.upper)))
        name = next(joint.name for joint in self.mechanism.joints if joint.first_q <= worst < joint.first_q + joint.nq)
        return name, float(q[worst]), float(self.lower[worst]), float(self.upper[worst])

    def _told_outside(self, value: float, lower: float, upper: float, unit: str) -> str:
        """Return a position and the limits that it is outside of, for people."""
        text = f"{self._told(value, unit)}, outside its limits {number(lower, 6)} … {number(upper, 6)} {unit}"
        if unit == "rad":
            text += f" ({number(np.degrees(lower), 4)} … {number(np.degrees(upper), 4)} deg)"
        return text

    def _check_limits(self, q: Array, requested: dict, only: set[str] | None = None) -> None:
        outside = self._outside(q)
        if outside is None or (only is not None and outside[0] not in only):
            return
        name, value, lower, upper = outside
        unit = self._unit(name)
        text = f"joint '{name}' would stand at {self._told_outside(value, lower, upper, unit)}"
        if not requested and self.mechanism.description.described and np.array_equal(q, self.home):
            raise UnreachablePoseError(
                f"'{self.mechanism.name}' cannot stand at its home: {text}. "
                f"{self._start_wanted()} a position "
                f'within them with <home {name}="value"/>{self._home_line()} (or home={{...}})'
            )
        if not self.mechanism.description.described:
            warnings.warn(f"{text}; C is defined there all the same", JointLimitWarning, stacklevel=4)
            return
        found = self._nearest_feasible(requested, q)
        nearest = None if found is None else self._confirmed(requested, found)
        if nearest is None and name in requested:
            places = {name: self.mechanism.joint(name).first_q for name in requested}
            within = {at: min(max(requested[at], self.lower[k]), self.upper[k]) for at, k in places.items()}
            nearest = self._confirmed(requested, within)
        wanted = self._listed(requested) or self._place(self.evaluate(q).placements)
        raise UnreachablePoseError(
            f"'{self.mechanism.name}' cannot reach {wanted}: {text}. {self._meant(requested)}"
            + (
                f"Nearest feasible: {self._listed(nearest)}"
                if nearest
                else "Move the request towards the middle of the workspace"
            ),
            requested,
            nearest,
        )

    def _finish(self, q: Array, evaluation: Configuration, requested: dict) -> ClosedPose:
        """Check limits and singularity, and freeze the pose."""
        self._check_limits(q, requested)
        return self._freeze(q, evaluation, requested)

    def _freeze(self, q: Array, evaluation: Configuration, requested: dict) -> ClosedPose:
        """Return the pose as a value. Raises SingularPoseError."""
        balance = self._balance(evaluation, requested)
        coordinates = requested
        if self.task.names and not self._are_tasks(requested):
            coordinates = dict(zip(self.task.names, self.task.values(evaluation.placements).tolist(), strict=True))
        return ClosedPose(
            mechanism=self.mechanism,
            q=q,
            placements=evaluation.placements,
            jacobian=evaluation.jacobian,
            closure_jacobian=evaluation.closure,
            closure_wrenches=evaluation.wrenches,
            balance=balance,
            closure_residual=evaluation.residual,
            coordinates=coordinates,
        ).freeze()

    def _balance(self, evaluation: Configuration, requested: dict) -> PassiveBalance:
        """Return how the free joints balance. Raises SingularPoseError where the tool can still move."""
        free = self.mechanism.free_dofs
        columns = evaluation.closure.take(free, 1)
        if columns.shape[0] == columns.shape[1]:
            inverted = inverse(columns.T)
            # The product of Frobenius norms bounds the condition number from above, and so do scales far apart.
            if frobenius(inverted) * frobenius(columns) * self.free_spread < 1 / NEGLIGIBLE:
                return PassiveBalance(inverted, *self._no_freedom)
        rows, scales = self.free_scales
        _, idle, self_stress, inverted = rank_of(evaluation.closure[:, free].T, scales, rows)
        if idle.shape[1] and self.mechanism.tool is not None:
            velocities = np.zeros((self.model.nv, idle.shape[1]))
            velocities[free] = idle
            moved = self.tool_motion(evaluation.placements, evaluation.jacobian, velocities)
            size_of = np.abs(moved).max(axis=0)
            if (size_of > NEGLIGIBLE).any():
                worst = int(np.argmax(size_of))
                twist = np.concatenate((moved[:3, worst] * self.length, moved[3:, worst]))
                self._refuse_singular(twist, idle[:, worst], requested, evaluation.placements)
        return PassiveBalance(inverted, self_stress, idle)

    def _refuse_singular(self, twist: Array, motion: Array, requested: dict, placements: Array) -> None:
        names = [self.mechanism.dof_names[dof] for dof in self.mechanism.free_dofs]
        strongest = [names[i] for i in np.argsort(-np.abs(motion))[:3] if abs(motion[i]) > 1e-6]
        twist = twist / np.abs(twist).max()
        direction = ", ".join(
            f"{name} {value:+.2f}" for name, value in zip(TWIST_NAMES, twist, strict=True) if abs(value) > 0.01
        )
        nearest = None
        if self._are_tasks(requested):
            here, target = self.task.values(self._home.placements), np.array(list(requested.values()))
            found = last_regular(here, target, self.at_coordinates)
            nearest = None if found is None else dict(zip(requested, found.tolist(), strict=True))
        raise SingularPoseError(
            f"{self._listed(requested) or self._place(placements)} is a singular pose: with the actuators locked the "
            f"tool can still move ({direction}), through {', '.join(strongest)}; no stiffness holds it. "
            + (
                f"Nearest regular: {self._listed(nearest)}"
                if nearest
                else "Lock or actuate one of these joints, or ask for another pose"
            ),
            requested,
            nearest,
        )


def _joint_values(model: pin.Model, q: Array, dofs) -> Array:
    return pin.difference(model, pin.neutral(model), q)[dofs]


def _told(apart: tuple[float, float]) -> str:
    """Return '310 mm and 2 mrad' of distances [m] and [rad]; what is rounding is left out."""
    return " and ".join(quantity(far, unit) for far, unit in zip(apart, ("m", "rad"), strict=True) if far > _ROUNDING)
