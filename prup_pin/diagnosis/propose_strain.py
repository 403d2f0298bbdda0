"""From a curve to a formula, of poses: a deformation of the module where something is unknown, by a load on it.

One more call of the search by which laws compete, on the final state, with a library of formulas at that module alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import cast

import numpy as np

from ..laws import LAWS, Effect
from ..laws.formulas.strain_formula import ModuleFormula, StrainFormula, strain_library
from ..numbers import number
from .candidates import Candidate
from .criteria import INDISTINCT, LITTLE, MOST_LISTED
from .evidence import cross_validated
from .intervals import parameters_of
from .problem import Fit, Problem
from .proposal import EqualFormula, Judged, Proposal
from .search import alternatives_to, with_one_law
from .unexplained import Final


def strain_proposals(problem: Problem, final: Final, labels: np.ndarray) -> Iterator[Proposal]:
    """Yield a formula for the unknown's module, if a deformation by a load on it is surely better than chance.

    labels (N,): of samples that are held out together.
    """
    if final.unknown is None or final.unknown.curve is None:
        return
    curve, fit, mechanism = final.unknown.curve, final.fit, problem.simulator.robot.mechanism
    loads = fit.influence.loads(curve.module)
    names = mechanism.module(curve.module).kind.loads
    size = float(np.abs(curve.deformation).max(initial=0.0)) or 1e-6
    laws = strain_library(curve.module, curve.component, loads, names, mechanism, size)
    library = [Candidate(law, law.places(mechanism)[0], mechanism) for law in laws]
    taken = with_one_law(problem, library, labels, fit)
    if taken is fit:
        return
    equals = [(taken, 0.0)]
    for rival in alternatives_to(problem, taken, len(taken.terms) - 1, library):
        if rival.term.candidate in library and rival.term.candidate is not taken.terms[-1].candidate:
            other = problem.refine([*fit.terms, rival.term], fit)
            if other.chi2 - taken.chi2 < INDISTINCT:
                equals.append((other, other.chi2 - taken.chi2))
    equals.sort(key=lambda item: (item[0].terms[-1].candidate.size, item[1]))
    (found, worse), *others = equals
    held = [cross_validated(problem, each, labels[each.samples]) for each in (fit, found)]
    parameters = parameters_of(problem, found, len(found.terms) - 1)
    law = _law(found).with_values(dict(_values(found)), {name: item.interval for name, item in parameters.items()})
    cross = law.of != law.component
    doubt = (
        f"{law.module} deforms along one direction by a load along another, and not the reverse: no elastic part does"
    )
    yield Proposal(
        joint=law.module,
        text=law.told_at(_values(found)),
        law=law,
        effect=replace(found.terms[-1].effect, law=law),
        parameters=parameters,
        share=1 - held[1] / held[0],
        of_curve=curve.gain / fit.chi2,
        equals=tuple(
            EqualFormula(_law(one).told_at(_values(one)), one.terms[-1].candidate.size, more - worse, _law(one))
            for one, more in others[:MOST_LISTED]
        ),
        doubts=(doubt,) * cross,
    )


def strain_judged(problem: Problem, final: Final) -> Iterator[Judged]:
    """Yield what a recording says of each proposed formula of a module that was brought along."""
    for law in LAWS:
        if isinstance(law, StrainFormula):
            yield Judged(law.physics, *_judged(problem, final, law))


def _judged(problem: Problem, final: Final, law: StrainFormula) -> tuple[str, str]:
    mechanism = problem.simulator.robot.mechanism
    place = next(iter(law.places(mechanism)), None)
    if place is None:
        return "neither", f"this robot has no module {law.module}"
    values = law.starts(place, mechanism)[0]
    own = next((item for item in final.laws if item.effect is not None and item.effect.law is law), None)
    if own is None:
        fit = final.fit
        change = problem.change(fit, [*fit.effects, Effect(law, place, values)])
        shows = problem.change(fit, fit.effects) - change
        if not float((shows**2).sum()) > INDISTINCT:
            return "neither", "in this recording it would not show beside the noise"
        return "refuted", "this recording would show it, and asks for none of it"
    if final.unknown is not None:
        return "refuted", f"beside it more is left: {final.unknown.statement}"
    for name, fitted in own.parameters.items():
        ends = (fitted.interval, law.found.get(name, (values[name], values[name])))
        apart = max(ends[0][0], ends[1][0]) - min(ends[0][1], ends[1][1])
        if apart > LITTLE * abs(values[name]):
            now, then = (f"{number(low, 3)} to {number(high, 3)}" for low, high in ends)
            return "refuted", f"its {name} is {now} {fitted.unit} here, and was {then} (95 %)"
    return "confirmed", "its values are those that it was proposed with, as far as both recordings tell"


def _law(fit: Fit) -> ModuleFormula:
    return cast(ModuleFormula, fit.terms[-1].candidate.law)


def _values(fit: Fit) -> dict[str, float]:
    return dict(fit.terms[-1].effect.values)
