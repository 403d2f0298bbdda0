"""Nonlinear parameters of laws: a grid about scanned values, an optimum between them, and profile intervals.

A law's efforts are linear in some of its parameters; the others are scanned, each value with columns of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...dynamics import InMotion
from ...mechanism import Mechanism
from ...spatial import Array
from ..criteria import EFFORT_INDISTINCT, GAIN, LEAD, ROUNDS, SURE, WIDEST_STEP
from ..normal_equations import NormalEquations
from .evidence import CrossValidation, held_out, relative_gain
from .prepare import PreparedEfforts
from .problem import EffortCandidate, EffortModel, SparseColumns, fit

#: Logarithm of a parameter over its best value beyond which data do not bound it.
_NEVER = 7.0
#: Share of the change within which the best values lie by which a derivative is taken.
_SMALL = 0.25


def refined(
    efforts: PreparedEfforts,
    model: EffortModel,
    which: Sequence[int],
    at_last: bool = False,
) -> EffortModel:
    """Return the model with better nonlinear parameters by held-out blocks, then optimised.

    which: indices of the terms, one after the other. at_last: a parameter that is zero may become larger; while laws
    are missing it would stand for them.
    """
    for place in which:
        term, problem = model.terms[place], model.problem
        law = term.law
        values = law.fitted(term.place, fit(model)[0][model.slice_of(term)], term.values)
        # what follows from what is known is looked at again with what is known now
        again = [term.values] if law.of_what_is_known else []
        count = len(law.free(term.values))
        others = list(law.closer(term.place, values, efforts.at)) or again
        others = [
            _bounded(term, other, efforts.at.mechanism) for other in others if at_last or len(law.free(other)) <= count
        ]
        if not others:
            continue
        at = _motion_of(efforts, model, place)
        wider, tried = efforts.extended(problem, (efforts.columns_at(law, term.place, other, at) for other in others))
        squares = CrossValidation(model.without(term).in_problem(wider)).with_each([term, *tried])
        best = int(np.argmin(squares.sum(axis=1)))
        # what is zero so far must surely be something
        more = best > 0 and len(law.free(tried[best - 1].values)) > count
        if best == 0 or relative_gain(squares[0], squares[best])[1] <= (SURE if more else 0.0):
            continue
        taken = tried[best - 1]
        wider = replace(wider.only(problem.candidates), prior=wider.prior[: taken.where.stop])
        model = model.replaced(place, taken).in_problem(wider)
    return optimised(efforts, model, which)


def optimised(efforts: PreparedEfforts, model: EffortModel, which: Sequence[int] | None = None) -> EffortModel:
    """Return the model with the nonlinear parameters of some terms, or of all, where the squares are least together.

    By Gauss and Newton's steps, all coefficients free: one after the other they would creep along a valley. A friction
    that turns round on a way a little too long looks like a delay, where it is large. What follows from what is known
    does so with the coefficients of the whole fit.
    """
    which = range(len(model.terms)) if which is None else which
    cost = _cost(model)
    # the last: no step, with what is known now
    shares = (1.0, 0.5, 0.25, 0.0) if any(model.terms[i].law.of_what_is_known for i in which) else (1.0, 0.5, 0.25)
    for _ in range(ROUNDS):
        steps = _steps_together(efforts, model, which)
        for share in shares:
            tried = _moved(efforts, model, {index: share * step for index, step in steps.items()})
            if (now := _cost(tried)) < cost - LEAD:
                break
        else:
            return model
        model, cost = tried, now
    return model


def optimised_in_either_form(efforts: PreparedEfforts, model: EffortModel) -> EffortModel:
    """Return the model with all nonlinear parameters where the squares are least together.

    Laws that do much the same in two ways, as friction turns round on a way or sets in with the speed, do so in the
    other one at all places where that surely leaves less of blocks held out, and by more than a law has to: a friction
    that lags and a signal that is late would make up for each other, and no law alone leads from one way to the other.
    """
    found = optimised(efforts, model)
    other = found
    for index, term in enumerate(found.terms):
        values = term.law.otherwise(term.place, term.values, efforts.at)
        if values is not None:
            other = _replaced(efforts, other, index, values, efforts.at)
    if other is found:
        return found
    other = optimised(efforts, other)
    share, sure = relative_gain(held_out(found), held_out(other))
    return other if share > GAIN and sure > SURE else found


def _cost(model: EffortModel) -> float:
    """Return the squares left, less a constant, and those of the coefficients by their prior."""
    x, matrix = fit(model)
    moment = model.problem.columns.moment[:, model.where].sum(axis=0)
    return float(x @ matrix @ x - 2 * moment @ x)


def _steps_together(efforts: PreparedEfforts, model: EffortModel, which: Sequence[int]) -> dict[int, Array]:
    """Return Gauss and Newton's steps of the logarithms of the free parameters of some terms, all coefficients free."""
    problem, columns, x = model.problem, model.problem.columns, fit(model)[0]
    size, counts = len(problem.prior), [len(model.terms[index].law.free(model.terms[index].values)) for index in which]

    def changes() -> Iterator[SparseColumns]:
        for index, count in zip(which, counts, strict=True):
            if count:
                term = model.terms[index]
                law, place, own = term.law, term.place, x[model.slice_of(term)]
                small = _SMALL * law.near(term.values)
                at = _motion_of(efforts, model, index)
                now = law.efforts_per(place, term.values, at) @ own
                moved = [law.scaled(term.values, np.exp(small * axis).tolist()) for axis in np.eye(count)]
                after = [law.efforts_per(place, values, at) @ own for values in moved]
                yield efforts.whitened(np.stack([each - now for each in after], axis=-1) / small)

    columns.add(changes(), after=size)
    where = np.array([*model.where, *range(size, columns.size)], int)
    matrix, moment = columns.total[np.ix_(where, where)], columns.moment[:, where].sum(axis=0)
    linear = len(model.where)
    matrix[:linear, :linear] += problem.precision(model.where)
    matrix[linear:, linear:] += np.eye(len(where) - linear)  # what data do not tell stays where it is
    step = np.clip(NormalEquations.of(matrix).solve(moment)[linear:], -WIDEST_STEP, WIDEST_STEP)
    return dict(zip(which, np.split(step, np.cumsum(counts)[:-1]), strict=True)) if counts else {}


def _moved(efforts: PreparedEfforts, model: EffortModel, steps: Mapping[int, Array]) -> EffortModel:
    """Return the model with the logarithms of free parameters a step on, by term, and what follows from what is known
    there.
    """
    for index, step in steps.items():
        if len(step):
            model = _replaced(
                efforts, model, index, scaled_within(model.terms[index], step, efforts.at.mechanism), efforts.at
            )
    for index in steps:
        term = model.terms[index]
        if term.law.of_what_is_known:
            before, x = model.with_terms(model.terms[:index]), fit(model)[0]
            values = term.law.fitted(term.place, x[model.slice_of(term)], term.values)
            at = efforts.knowing(before, x[: len(before.where)])
            closer = term.law.closer(term.place, values, at)
            model = _replaced(efforts, model, index, closer[0] if len(closer) == 1 else term.values, at)
    return model


def _replaced(
    efforts: PreparedEfforts, model: EffortModel, index: int, values: Mapping[str, float], at: InMotion
) -> EffortModel:
    """Return the model with new columns of one term, by other values in a motion of which more may be known."""
    return with_form(efforts, model, index, model.terms[index], values, at)


def with_form(
    efforts: PreparedEfforts,
    model: EffortModel,
    index: int,
    form: EffortCandidate,
    values: Mapping[str, float],
    at: InMotion,
) -> EffortModel:
    """Return the model with the law of a candidate, by some values in a motion, in the place of one term."""
    problem = model.problem
    wider, (other,) = efforts.extended(problem, [efforts.columns_at(form.law, form.place, values, at)])
    return model.in_problem(wider.only(problem.candidates)).replaced(index, other)


def profile_intervals(
    efforts: PreparedEfforts, model: EffortModel, term: EffortCandidate, rise: float
) -> tuple[dict[str, tuple[float, float]], Array]:
    """Return the interval of each nonlinear parameter in which the squares rise by less, all coefficients free; and by
    how much the term's coefficients (p,) are others at the ends of these, whose squares add.

    Where data do not bound it, its own bounds do.
    """
    cost = _Profile.of(efforts, model, model.terms.index(term))
    law, out, free = term.law, {}, term.law.free(term.values)
    mechanism = model.problem.mechanism
    quantities = {q.name: q for q in law.quantities_at(term.place, mechanism)}
    least, here = cost.solved(term.values)
    apart = np.zeros(len(here))
    for name, axis in zip(free, np.eye(len(free)), strict=True):
        bounds, most = [quantities[name].lower, quantities[name].upper], np.zeros(len(here))
        for side, way in enumerate((-axis, axis)):
            size = _edge(cost, way, least + rise, law.near(term.values))
            if size is not None:
                end = scaled_within(term, size * way, mechanism)
                bounds[side], most = end[name], np.maximum(most, np.abs(cost.solved(end)[1] - here))
        out[name], apart = (bounds[0], bounds[1]), np.hypot(apart, most)
    others = law.closer(term.place, term.values, efforts.at)
    for name in set(law.settled) - set(free):
        # what is zero may be as much as the first size of it that the data refuse
        sizes = sorted(values[name] for values in others if values.get(name))
        refused = (size for size in sizes if cost.at_values({**term.values, name: size}) > least + rise)
        out[name] = (quantities[name].lower, next(refused, quantities[name].upper))
    return out, apart


def scaled_within(term: EffortCandidate, step: Array, mechanism: Mechanism) -> dict[str, float]:
    """Return values of a term of which the free ones are exp(step) times as large, as far as they can be."""
    return _bounded(term, term.law.scaled(term.values, np.exp(step).tolist()), mechanism)


def _bounded(term: EffortCandidate, values: Mapping[str, float], mechanism: Mechanism) -> dict[str, float]:
    """Return nonlinear values of a term's law with the settled ones within their bounds."""
    bounds = {q.name: (q.lower, q.upper) for q in term.law.quantities_at(term.place, mechanism)}
    return {
        name: float(np.clip(value, *bounds[name])) if name in term.law.settled else value
        for name, value in values.items()
    }


def _edge(cost: Callable[[Array], float], way: Array, most: float, first: float) -> float | None:
    """Return the size > 0 of a step along `way` (p,) that costs `most`; None where none before `_NEVER` does."""
    from scipy.optimize import brentq  # heavy; not needed to load a robot

    inner, outer = 0.0, first
    while cost(outer * way) < most:
        inner, outer = outer, 2 * outer
        if outer > _NEVER:
            return None
    return float(brentq(lambda size: cost(size * way) - most, inner, outer, xtol=0.02 * outer))


def _motion_of(efforts: PreparedEfforts, model: EffortModel, place: int) -> InMotion:
    """Return the motion that a law sees: with the efforts of the terms before it, where it depends on them."""
    if not model.terms[place].law.of_what_is_known:
        return efforts.at
    before = model.with_terms(model.terms[:place])
    return efforts.knowing(before, fit(before)[0])


@dataclass(frozen=True, eq=False)
class _Profile:
    """The squares left, less a constant, by nonlinear parameters of a term, all coefficients fitted.

    columns: those of the other terms, by joint; residual (n, k) and normal equations of the fit without the term.
    """

    efforts: PreparedEfforts
    term: EffortCandidate
    at: InMotion
    columns: list[Array]
    residual: Array
    normal: NormalEquations

    @classmethod
    def of(cls, efforts: PreparedEfforts, model: EffortModel, place: int) -> _Profile:
        """Return the profile of a term of a model."""
        term, columns = model.terms[place], model.problem.columns
        others = model.without(term)
        x, matrix = fit(others)
        at, residual = _motion_of(efforts, model, place), columns.residual(others.where, x)
        free = np.flatnonzero(~others.one_sided | (x > 0))  # what is held at nothing stays there
        normal = NormalEquations.of(matrix[free[:, None], free])
        return cls(efforts, term, at, columns.dense([others.where[index] for index in free]), residual, normal)

    def solved(self, values: Mapping[str, float]) -> tuple[float, Array]:
        """Return the squares at values of the nonlinear parameters, and the term's coefficients (p,) there."""
        law, place = self.term.law, self.term.place
        own = self.efforts.whitened(law.efforts_per(place, values, self.at))
        matrix, gradient = np.diag(self.efforts.prior_of(law, place)), np.zeros(own.size)
        cross = np.zeros((len(self.normal.scale), own.size))
        for joint, (which, columns) in enumerate(own.joints):
            matrix[np.ix_(which, which)] += columns.T @ columns
            cross[:, which] += self.columns[joint].T @ columns
            gradient[which] += columns.T @ self.residual[:, joint]
        rest = matrix - cross.T @ self.normal.solve(cross)
        x = NormalEquations.of(rest, np.diag(matrix), EFFORT_INDISTINCT).solve(gradient)
        return -float(gradient @ x), x

    def at_values(self, values: Mapping[str, float]) -> float:
        """Return the squares at values of the nonlinear parameters."""
        return self.solved(values)[0]

    def __call__(self, step: Array) -> float:
        """Return the squares at logarithms of the free parameters over what they are."""
        return self.at_values(scaled_within(self.term, step, self.at.mechanism))
