"""One mechanism's question as a pipeline of straight lines: start, Newton's steps, and what was asked for.

The equations are those of `kinematics` and `statics`, which are handed expressions instead of numbers. What cannot be
written so (joints that turn idly, modules whose equation asks which case holds) is told by None.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernel import (
    NEGLIGIBLE,
    NEGLIGIBLE_ENERGY,
    ROUNDING_OF_LOADS,
    Expression,
    Pipeline,
    Program,
    Tape,
    eliminated,
    independent,
    largest,
    least,
)
from ..kinematics import SURE, ClosedPose, ManyPoses, PassiveBalance
from ..spatial import Array
from ..statics import Energies, Statics, StaticsLayout, problems_of, solve_statics
from .quantities import QUANTITIES, Asked, Quantity, Solved

#: Sample poses, and how far joints are moved away from closed loops where Newton's steps are sampled [m, rad].
_SAMPLES, _APART = 64, 0.03
#: Part of the ball about home from which samples are drawn, and joints' turns [rad] where there is none.
_BALL, _TURN = 0.9, 3.0
#: A pivot this much smaller than at any sample is looked at again.
_SMALL_PIVOT = 1e-3
#: How exactly what is written agrees with arrays at the samples.
_EXACT = 1e-12
#: A pivot of normal equations below this share of their largest entry, at a sample, is none.
_REGULAR = 1e-9
#: Rounding allowed beyond a joint's limit [m, rad].
_AT_LIMIT = 1e-9


class Written(NamedTuple):
    """A pipeline, and the rows of its outputs by the quantities that it computes; the last three are 1 where all
    conditions hold, failure and way.

    `passing` gives Newton's step anywhere, the square of the error's size, 1 where the pivots are good, 1 where the
    loops are assembled.
    """

    pipeline: Pipeline
    rows: dict[str, slice]
    passing: Pipeline | None

    def accepted(self, end: Array) -> NDArray[np.bool_]:
        """Return which poses' outputs hold, (n,), by the last three of them (3, n)."""
        return (end[0] == 1.0) & (end[1] == 0.0) & (end[2] <= SURE)


class _Solver:
    """Solves systems of expressions, and remembers the pivots."""

    def __init__(self, tape: Tape):
        self._tape = tape
        self.pivots: list[Expression] = []

    def __call__(self, matrix: Array, right: Array) -> Array:
        """Return the solution (n, c) of a square matrix (n, n)."""
        solution, pivots = eliminated(self._tape.expressed(matrix), self._tape.expressed(right))
        self.pivots += pivots
        return solution

    def counting(self, loads: Array, self_stress: Array) -> Array:
        """Return loads (n, h) without what is rounding, and without forces that load no module, at the samples.

        Beside the closure forces (c, h): see `Energies`.
        """
        size = np.abs(self._tape.sampled(self_stress)).max(axis=(1, 2), initial=0.0)
        share = (np.abs(self._tape.sampled(loads)) / size[:, None, None]).max(axis=0)
        counting = loads.copy()
        counting[(share <= ROUNDING_OF_LOADS) | (share.max(axis=0, initial=0.0) <= NEGLIGIBLE)] = self._tape.constant(
            0.0
        )
        return counting

    def energies(self, matrix: Array, right: Array) -> Array:
        """Return a solution (h, c) of a semidefinite system (h, h) of energies; what has none is left at zero."""
        values = self._tape.sampled(matrix)
        diagonal = np.diagonal(values, axis1=1, axis2=2)
        size = np.sqrt(np.where(diagonal > 0, diagonal, np.inf))
        left = values / size[:, :, None] / size[:, None, :]
        kept: list[int] = []
        while True:
            energy = np.diagonal(left, axis1=1, axis2=2)
            most = int(energy.min(axis=0).argmax())
            if energy[:, most].min() < NEGLIGIBLE:
                break
            kept.append(most)
            left = left - left[:, :, most, None] * left[:, None, most] / left[:, most, most, None, None]
            left[:, most], left[:, :, most] = 0.0, 0.0
        if np.abs(energy).max(initial=0.0) > 100 * NEGLIGIBLE_ENERGY:
            raise _NotWrittenError  # more at one sample than at another
        out = self._tape.expressed(np.zeros(right.shape))
        if kept:
            out[kept] = self(matrix[np.ix_(kept, kept)], right[kept])
        return out


class _Inverse:
    """Stands in the place of the inverse (c, f) of what free joints ask of closure forces, (f, c): solves instead.

    Of redundant closures the `chosen` forces are zero.
    """

    ndim = 0

    def __init__(self, asked: Array, settled: Array, solve: _Solver):
        self._asked, self._settled, self._solve = asked, settled, solve

    def __matmul__(self, right: Array) -> Array:
        forces = np.zeros((self._asked.shape[1], right.shape[1]), object)
        forces[self._settled] = self._solve(self._asked[:, self._settled], right)
        return forces


class _WrittenSolved(Solved):
    """Statics as expressions."""

    def __init__(self, pose: ClosedPose, layout: StaticsLayout, scaling: Array, asked: Asked, solve: _Solver):
        super().__init__(pose, layout, scaling, asked)
        self._solve = solve

    @cached_property
    def statics(self) -> Statics:
        return solve_statics(self.layout, self.poses, None, Energies(self._solve.counting, self._solve.energies))

    @cached_property
    def K(self) -> Array:  # noqa: N802
        k = eliminated(self.C * self.scaling, np.eye(6).astype(object))[0] * self.scaling
        return (k + k.T) * 0.5

    def conditions(self, elastic: bool, stiff: bool) -> list[Any]:
        """Return conditions that are 1 where C, or K too, is what has been written."""
        found: list[Any] = []
        if elastic:
            for problems in problems_of(self.layout, self.statics.geometries):
                found += [1.0 - flag for flag in problems.ravel() if isinstance(flag, Expression)]
        if stiff:  # a bound of the condition, as both are definite
            traces = np.diagonal(self.C * self.scaling).sum() * np.diagonal(self.K / self.scaling).sum()
            found.append(traces <= 0.1 / NEGLIGIBLE_ENERGY)
        return found


def written(many: ManyPoses, layout: StaticsLayout, scaling: Array, asked: Asked) -> Written | None:
    """Return the pipeline of a question, or None where it cannot be written as straight lines."""
    try:
        return _Writer(many, layout, scaling, asked).written()
    except (TypeError, ValueError, ZeroDivisionError, AttributeError, _NotWrittenError):
        return None


class _NotWrittenError(Exception):
    pass


class _Writer:
    def __init__(self, many: ManyPoses, layout: StaticsLayout, scaling: Array, asked: Asked):
        self.many, self.layout, self.scaling, self.asked = many, layout, scaling, asked
        self.mechanism = many.mechanism
        self.kinematics = many.kinematics
        self.looped = bool(self.mechanism.loops) or bool(self.mechanism.tasks)
        if any(QUANTITIES[name].by_one for name in asked.quantities):
            raise _NotWrittenError
        if self.looped and self.mechanism.model.nq != self.mechanism.model.nv:
            raise _NotWrittenError
        generator = np.random.default_rng(0)
        if self.looped:
            polynomial = self.kinematics.start.widest if self.mechanism.tasks else None
            if polynomial is None:
                raise _NotWrittenError
            self.polynomial = polynomial
            t = len(many.names)
            # A coordinate that enters linearly reaches far: samples stay where the robot is.
            scale = np.array([self.kinematics.length if many.task.units[name] == "m" else 1.0 for name in many.names])
            reach = 1 / np.maximum(polynomial.factor, 0.9 / scale)
            x = generator.uniform(-1, 1, (_SAMPLES, t))
            x *= _BALL / np.maximum(1.0, np.linalg.norm(x, axis=1, keepdims=True))
            self.coordinates = self.kinematics.start.coordinates + x * reach
            motions, _ = polynomial.of_many(self.coordinates - self.kinematics.start.coordinates)
            self.q, converged, _ = many.settle(many.tree.moved(self.kinematics.home, motions), self.coordinates)
            if not converged.all():
                raise _NotWrittenError
        else:
            joints = [self.mechanism.joint(name) for name in many.names]
            size = np.where([joint.slides for joint in joints], self.kinematics.length, _TURN)
            self.coordinates = generator.uniform(-size, size, (_SAMPLES, len(joints)))
            self.q = many.reach(self.coordinates).q
        self.apart = self.q + generator.uniform(-_APART, _APART, self.q.shape)

    def written(self) -> Written:
        final, rows = self._final()
        pipeline = Pipeline(self._start(), self._step() if self.looped else None, final)
        if not self.looped:
            return Written(pipeline, rows, None)
        size = self.q.shape[1] + self.coordinates.shape[1]
        # Where closures are redundant, whether one is closed or only drawn so takes more than a straight line.
        passing = None if self.redundant else Pipeline(Program.without(size), None, self._step(passing=True))
        return Written(pipeline, rows, passing)

    def _start(self) -> Program:
        tape = Tape(_SAMPLES)
        x = tape.inputs(self.coordinates)
        home = self.kinematics.home
        if self.looped:
            motion, _ = self.polynomial.written(x - self.kinematics.start.coordinates)
            return Program(tape, list(home + motion))
        q: list[Any] = list(home)
        for column, name in enumerate(self.many.names):
            joint = self.mechanism.joint(name)
            if joint.nq == 1:
                q[joint.first_q] = x[column]
            else:
                q[joint.first_q], q[joint.first_q + 1] = np.cos(x[column]), np.sin(x[column])
        return Program(tape, q)

    def _step(self, passing: bool = False) -> Program:
        many, tape = self.many, Tape(_SAMPLES)
        given = tape.inputs(np.hstack((self.apart, self.coordinates)))
        q, target = given[: self.q.shape[1]], given[self.q.shape[1] :]
        placements = many.tree.placements(q)
        jacobian = many.tree.jacobian(placements)
        gaps = many.closure.gaps(placements)
        values, rates = many.task.of_many(placements)
        error = np.concatenate((gaps.gap, many.task.less(values, target)))
        closure = many.closure.jacobian(gaps.wrenches, jacobian)
        matrix = np.concatenate((closure, (rates @ jacobian) * many.task.moves))
        if self.redundant:
            return self._least_step(tape, q, matrix, error)
        solution, pivots = eliminated(matrix, error[:, None])
        steps = solution[:, 0]
        if not passing:
            return Program(tape, [*(q - steps), (steps * steps).sum()])
        good = least(_conditions(pivots) or [tape.constant(1.0)])
        assembled = least(many.closure.assembled_conditions(gaps.turn) or [tape.constant(1.0)])
        return Program(tape, [*steps, (error * error).sum(), good, assembled])

    @property
    def redundant(self) -> bool:
        """Whether loops and coordinates ask more than motions can do. Raises _NotWrittenError where they ask less."""
        more = self.many.closure.size + len(self.many.names) - self.mechanism.model.nv
        if more < 0:
            raise _NotWrittenError
        return more > 0

    def _least_step(self, tape: Tape, q: Array, matrix: Array, error: Array) -> Program:
        """Return Newton's step where closures are redundant: least squares, what is open weighed as by arrays."""
        rows, columns = self.kinematics.newton_scales
        gaps = error[: len(rows)]
        wanted = tape.expressed(matrix[len(rows) :] * columns)
        most = np.array([largest([abs(entry) for entry in row]) for row in wanted], object)
        weights = np.concatenate((tape.expressed(rows), 1.0 / most))
        weighed = weights[:, None] * matrix * columns
        normal = weighed.T @ weighed
        solution, pivots = eliminated(tape.expressed(normal), tape.expressed(weighed.T @ (weights * error)[:, None]))
        size = np.abs(tape.sampled(normal)).max()
        if any(np.abs(pivot.values).min() < _REGULAR * size for pivot in pivots):
            raise _NotWrittenError  # some motions are idle
        still = [abs(gap) <= NEGLIGIBLE / row for gap, row in zip(gaps, rows, strict=True) if gap.known is None]
        steps = columns * solution[:, 0]
        return Program(tape, [*(q - steps), (steps * steps).sum(), *still])

    def _balance(self, closure: Array, solve: _Solver) -> PassiveBalance:
        """Return how free joints balance. Raises _NotWrittenError where some of them are idle."""
        asked = closure[:, self.mechanism.free_dofs].T
        count, forces = asked.shape
        home = self.kinematics.evaluate(self.kinematics.home)
        held, settled = independent(home.closure[:, self.mechanism.free_dofs].T)
        if len(held) != count:
            raise _NotWrittenError
        chosen = np.setdiff1d(np.arange(forces), settled)
        self_stress = np.zeros((forces, len(chosen)), object)
        self_stress[chosen, range(len(chosen))] = 1.0
        if len(chosen) and count:
            self_stress[settled] = -solve(asked[:, settled], asked[:, chosen])
        return PassiveBalance(
            _Inverse(asked, settled, solve),  # type: ignore[arg-type]
            self_stress,
            np.zeros((count, 0)),
        )

    def _final(self) -> tuple[Program, dict[str, slice]]:
        many, tape = self.many, Tape(_SAMPLES)
        given = tape.inputs(np.hstack((self.q, self.coordinates)))
        q, x = given[: self.q.shape[1]], given[self.q.shape[1] :]
        conditions = self._limits(q)
        if self.looped:
            _, distance = self.polynomial.written(x - self.kinematics.start.coordinates)
            conditions.append(distance <= 1.0)
        placements = many.tree.placements(q)
        jacobian = many.tree.jacobian(placements)
        gaps = many.closure.gaps(placements)
        if self.looped:
            conditions += many.closure.assembled_conditions(gaps.turn)
        closure = many.closure.jacobian(gaps.wrenches, jacobian)
        solve = _Solver(tape)
        balance = self._balance(closure, solve)
        pose = ClosedPose(
            mechanism=self.mechanism, q=q, placements=placements, jacobian=jacobian, closure_jacobian=closure,
            closure_wrenches=gaps.wrenches, balance=balance, closure_residual=gaps.gap, coordinates={},
        )  # fmt: skip
        asked = [QUANTITIES[name] for name in self.asked.quantities]
        solved = _WrittenSolved(pose, self.layout, self.scaling, self.asked, solve)
        outputs: list[Any] = []
        # K in the place of what follows from it
        computed = [QUANTITIES[name] for name in dict.fromkeys(item.after or item.name for item in asked)]
        rows: dict[str, slice] = {}
        by_arrays = Solved(many.poses(self.q)[0], self.layout, self.scaling, self.asked)
        for item in computed:
            entries = np.asarray(item.value(solved), object).ravel()
            self._check(tape, item, entries, by_arrays)
            rows[item.name] = slice(len(outputs), len(outputs) + len(entries))
            outputs += list(entries)
        elastic, stiff = any(item.elastic for item in asked), any(item.stiff for item in asked)
        conditions += solved.conditions(elastic, stiff)
        conditions += _conditions(solve.pivots)
        good = least(conditions or [tape.constant(1.0)])
        return Program(tape, [*outputs, good]), rows

    def _check(self, tape: Tape, item: Quantity, entries: Array, by_arrays: Solved) -> None:
        """Raise _NotWrittenError where arrays say otherwise at the samples."""
        ours = tape.sampled(entries)
        theirs = item.value(by_arrays).reshape(ours.shape)
        exact = np.full(len(ours), _EXACT)
        if item.stiff:  # an inverse is as exact as C's condition lets it be
            exact = np.maximum(10 * exact, 1e-14 * np.linalg.cond(by_arrays.C * self.scaling))
        good = np.abs(ours - theirs).max(axis=1) <= exact * np.abs(theirs).max(axis=1)
        if not good.all():
            raise _NotWrittenError

    def _limits(self, q: Array) -> list[Expression]:
        """Return conditions that are 1 where the joints stand within their limits."""
        if not self.looped and not self.mechanism.description.described:
            return []
        lower, upper = self.kinematics.lower, self.kinematics.upper
        conditions = [q[at] >= lower[at] - _AT_LIMIT for at in np.flatnonzero(np.isfinite(lower))]
        return conditions + [q[at] <= upper[at] + _AT_LIMIT for at in np.flatnonzero(np.isfinite(upper))]


def _conditions(pivots: list[Expression]) -> list[Expression]:
    """Return conditions that are 1 where pivots have their sign, and are not much smaller than at any sample."""
    found = []
    for pivot in pivots:
        if pivot.known is None:
            values, least_size = pivot.values, _SMALL_PIVOT * float(np.abs(pivot.values).min())
            if (values > 0.0).all():
                found.append(pivot >= least_size)
            else:
                found.append(pivot <= -least_size if (values < 0.0).all() else abs(pivot) >= least_size)
    return found
