"""All candidates at first order: which of them would take most of what is left."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ..spatial import Array
from .candidates import Candidate
from .criteria import HOPELESS
from .fit import Beside, Fit, Problem, without
from .locate import least_left
from .selection import Rival

__all__ = [
    "Bound",
    "screen",
]


def screen(
    problem: Problem, fit: Fit, library: Sequence[Candidate], tell: Callable[[float], None] = lambda share: None
) -> list[Rival]:
    """Return all candidates fitted on top of a fit's terms and together with them, to first order, best first.

    Those that cannot come near the best are left out.
    """
    rivals = []
    kept = fit.terms
    present = {term.candidate.name for term in kept}
    beside = problem.beside(fit, range(len(kept)))
    bound = Bound(problem, fit, problem.target(fit), beside)
    best = fit.chi2
    for index, candidate in enumerate(sorted(library, key=bound)):
        tell(index / len(library))
        if candidate.name in present or bound(candidate) > best + HOPELESS * (fit.chi2 - best):
            continue
        chi2, term, change = problem.quick(fit, kept, candidate, beside=beside)
        rivals.append(Rival(term, chi2, change))
        best = min(best, chi2)
    return sorted(rivals, key=lambda rival: rival.score)


class Bound:
    """A chi squared that candidates on top of kept terms cannot go below, to first order; zero where none is known.

    By the module through whose deformation alone a candidate acts.
    """

    def __init__(self, problem: Problem, fit: Fit, residual: Array, beside: Beside | None):
        self.problem, self.fit, self.beside = problem, fit, beside
        if beside is not None and beside.back is not None:
            residual = residual + beside.back.reshape(residual.shape)
        self.residual, self.left = residual, without(residual.ravel(), beside)
        self.known: dict[str, float] = {}

    def __call__(self, candidate: Candidate) -> float:
        module = candidate.only_module
        if module is None or module not in self.fit.influence.rows:
            return 0.0
        if module not in self.known:
            self.known[module] = least_left(self.problem, self.fit, module, self.residual, self.beside)
        return self.known[module]
