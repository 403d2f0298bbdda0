"""All candidates at first order: which of them would take most of what is left."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..spatial import Array
from .candidates import Candidate
from .criteria import (
    BENT,
    HOPELESS,
    MODEST,
    PARAMETER_COST,
)
from .fit import Beside, Fit, Problem, Term, without
from .locate import least_left
from .selection import Rival

__all__ = [
    "Least",
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
    least = Least(problem, fit, kept, problem.target(fit), beside)
    best = fit.chi2
    single = sorted((candidate for candidate in library if not candidate.everywhere), key=least)
    for index, candidate in enumerate([*single, *(candidate for candidate in library if candidate.everywhere)]):
        tell(index / len(library))
        near = max(HOPELESS * (fit.chi2 - best), MODEST)
        if candidate.everywhere:  # many, and dear: one that removes less than it costs is not tried either
            near = min(HOPELESS * (fit.chi2 - best), fit.chi2 - best - PARAMETER_COST - candidate.law.cost)
        if candidate.name in present or least(candidate) > best + near:
            continue
        chi2, term, change = problem.quick(fit, kept, candidate, beside=beside)
        least.heard(candidate, chi2)
        rivals.append(Rival(term, chi2, change))
        best = min(best, chi2)
    return sorted(rivals, key=lambda rival: rival.score)


class Least:
    """A chi squared that candidates on top of kept terms can hardly go below, to first order; zero where none is known.

    By the module through whose deformation alone a candidate acts. Of a law at all like places by its direction where
    the fit starts, which costs one first-order change instead of a fit; of one that remembers, whose changes are dear,
    by what it did at single places.
    """

    def __init__(self, problem: Problem, fit: Fit, kept: Sequence[Term], residual: Array, beside: Beside | None):
        self.problem, self.fit, self.beside = problem, fit, beside
        if beside is not None and beside.back is not None:
            residual = residual + beside.back.reshape(residual.shape)
        self.residual, self.left = residual, without(residual.ravel(), beside)
        self.effects = [term.effect for term in kept]
        self.known: dict[str | None, float] = {None: 0.0}
        self.gains: dict[tuple[str, str], float] = {}

    def heard(self, candidate: Candidate, chi2: float) -> None:
        """Hear what a candidate at a single place left."""
        key = candidate.law.physics, candidate.place.name
        self.gains[key] = max(float(self.left @ self.left) - chi2, self.gains.get(key, 0.0))

    def __call__(self, candidate: Candidate) -> float:
        key = candidate.name if candidate.everywhere else self.problem.module_of(candidate)
        if key not in self.known:
            self.known[key] = self._everywhere(candidate) if candidate.everywhere else self._beside(str(key))
        return self.known[key]

    def _beside(self, module: str) -> float:
        """Return what no deformation of a module takes away."""
        if module not in self.fit.influence.rows:
            return 0.0
        return least_left(self.problem, self.fit, module, self.residual, self.beside)

    def _everywhere(self, candidate: Candidate) -> float:
        total = float(self.left @ self.left)
        if candidate.remembers:
            return total - sum(self.gains.get((candidate.law.physics, part), 0.0) for part in candidate.parts)
        return total - BENT * self._along(candidate)

    def _along(self, candidate: Candidate) -> float:
        """Return what a law takes away in the direction in which its fit starts."""
        before = self.problem.change(self.fit, self.effects)

        def direction(coordinates: Array) -> Array:
            changed = self.problem.change(self.fit, [*self.effects, candidate.effect(coordinates)]) - before
            found = without(np.nan_to_num(changed.ravel()), self.beside)
            return found / max(float(np.linalg.norm(found)), 1e-300)

        if candidate.logarithmic.any():
            return max(max(float(direction(start) @ self.left), 0.0) ** 2 for start in candidate.starts())
        columns = np.stack([direction(step) for step in np.diag(candidate.scales())], axis=1)
        return float(self.left @ columns @ np.linalg.lstsq(columns, self.left, rcond=1e-9)[0])
