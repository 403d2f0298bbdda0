"""Laws compete for the residual: forward selection, with every earlier choice tried again.

A law enters where the chi squared that it removes passes a threshold for the whole library (chance, and the same
residual with the signs of its blocks flipped), where it removes more than 1 % on blocks that were not used to fit it,
and where the whole simulation confirms it. After each step every law that is in is challenged by every other one.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2 as chi_squared

from ..spatial import Array
from .candidates import Candidate
from .fit import Fit, Problem, Term, without
from .locate import least_left, yieldings

__all__ = ["Rival", "Selection", "cross_validated", "scale_of", "select"]

#: Chance that anything of the whole library is accepted on a clean recording.
FALSE_ALARM = 0.01
#: Share of the held-out squared residual that a law must remove.
LEAST_GAIN = 0.01
MOST_TERMS = 4
#: Processor time after which no further law is looked for [s].
MOST_SECONDS = 30.0
#: A residual of this many times the noise may be noise; else the search is made again, so many times.
_CLEAN = 1.10
_DETOURS = 2
#: Share of what is left that one module's deformation must take away to be all of it.
_ONE_PLACE = 0.9
_FIRST_STEPS = 4
_FRONT = 24
#: First-order changes may misjudge a rival's chi squared by this share of the effect's.
_CURVATURE = 1.5e-3
#: A candidate is left out where it cannot come nearer to the best one than this share of what that removes ...
_HOPELESS = 0.2
#: ... and that is more than this.
_MODEST = 300.0
_FLIPS = 200
_LEAST_PIECES = 40
#: Offsets and the like are rarely this many times larger than where a fit starts.
_USUAL = 30.0
#: Alternatives whose chi squared is larger by less than this cannot be told apart.
INDISTINCT = 13.0


@dataclass(frozen=True)
class Rival:
    """An alternative that was tried: its term, chi squared and change of the pose.

    `scale`: mean squared residual where more than noise is left, by which differences of chi squared then grow.
    """

    term: Term
    chi2: float
    change: Array
    scale: float = 1.0

    @property
    def score(self) -> float:
        """Chi squared plus what its parameters and their implausibility cost."""
        return self.chi2 + self.scale * penalty(self.term)


@dataclass(frozen=True)
class Selection:
    """The outcome: fits from the nominal simulation to the last one, rivals of every term, thresholds."""

    first: Fit
    last: Fit
    rivals: tuple[tuple[Rival, ...], ...]
    library: Sequence[Candidate]
    screened: tuple[Rival, ...]  # what the last round tried on top, best first


def penalty(term: Term) -> float:
    """Return what a term costs: its parameters, and how far they lie from where such effects usually are."""
    candidate = term.candidate
    logs = candidate.logarithmic
    starts = candidate.starts()
    far = min(float((((term.coordinates - start) / candidate.law.spread)[logs] ** 2).sum()) for start in starts)
    far += float(((term.coordinates / (_USUAL * candidate.scales()))[~logs] ** 2).sum())
    return 8.0 * candidate.size + far + candidate.law.cost + unlikely(candidate)


def unlikely(candidate: Candidate) -> float:
    """Return a small cost that decides between places that these data cannot tell apart at all."""
    likely = getattr(candidate.law, "likely", ())
    module = next((m for m in candidate.mechanism.modules if m.name == candidate.place.name), None)
    return 0.0 if not likely or (module is not None and module.kind.kind in likely) else 1.0


def cross_validated(problem: Problem, fit: Fit, blocks: np.ndarray, folds: int = 7) -> float:
    """Return chi squared on blocks that were left out in turn, all terms refitted without them (linearly)."""
    jacobian = problem.jacobian(fit).reshape(*fit.residual.shape, -1)
    return _held_out(fit.residual, jacobian, blocks, folds)


def _held_out(residual: Array, jacobian: Array, blocks: np.ndarray, folds: int) -> float:
    total = 0.0
    labels = _segments(blocks)
    kinds = np.unique(labels)
    part = {label: index % folds for index, label in enumerate(kinds)}
    fold = np.array([part[label] for label in labels])
    for index in np.unique(fold):
        out = fold == index
        target = residual[out].ravel()
        if jacobian.shape[-1] and (~out).any():
            columns = jacobian[~out].reshape(-1, jacobian.shape[-1])
            scale = np.linalg.norm(columns, axis=0)
            scale = np.where(scale > 0, scale, 1.0)
            step = np.linalg.lstsq(columns / scale, residual[~out].ravel(), rcond=1e-8)[0] / scale
            target = target - jacobian[out].reshape(-1, jacobian.shape[-1]) @ step
        total += float(target @ target)
    return total


def _segments(blocks: np.ndarray) -> np.ndarray:
    """Return blocks, or pieces in time where there are too few of them."""
    if len(np.unique(blocks)) >= 5:
        return blocks
    return np.arange(len(blocks)) * 10 // max(len(blocks), 1)


def _pieces(blocks: np.ndarray) -> np.ndarray:
    """Return blocks, each in so many pieces that flipping all signs alike is no likely accident."""
    starts = np.concatenate(([True], blocks[1:] != blocks[:-1]))
    block = np.cumsum(starts) - 1
    count = int(block[-1]) + 1 if len(block) else 1
    parts = int(np.ceil(_LEAST_PIECES / count))
    inside = np.arange(len(blocks)) - np.flatnonzero(starts)[block]
    return block * parts + inside * parts // np.bincount(block)[block]


def threshold(problem_size: int, tried: int, residual: Array, blocks: np.ndarray, rivals: Sequence[Rival]):
    """Return the least gain by number of parameters: a function of it."""
    directions = [rival.change.ravel() for rival in rivals]
    directions = [vector / np.linalg.norm(vector) for vector in directions if np.linalg.norm(vector) > 1e-9]
    flipped = 0.0
    if directions:
        kinds, which = np.unique(_pieces(blocks), return_inverse=True)
        per_block = np.array(
            [
                np.bincount(which, (vector.reshape(residual.shape) * residual).sum(1), len(kinds))
                for vector in directions
            ]
        )
        signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(len(kinds), _FLIPS))
        flipped = float(np.quantile(((per_block @ signs) ** 2).max(axis=0), 1 - FALSE_ALARM))
    one = float(chi_squared.isf(FALSE_ALARM / tried, 1))

    def least(parameters: int) -> float:
        chance = float(chi_squared.isf(FALSE_ALARM / tried, parameters))
        return max(chance, flipped + chance - one)

    return least


def select(
    problem: Problem,
    library: Sequence[Candidate],
    blocks: np.ndarray,
    first: Fit,
    tell: Callable[[str, float], None] = lambda stage, share: None,
    seconds: float = MOST_SECONDS,
) -> Selection:
    """Return the selection of laws that the recording asks for.

    Where structure is left, the search is made again without one of the laws that it took: a law that came first may
    have come for two others.
    """
    ends = time.process_time() + seconds
    best = _forward(problem, library, blocks, first, ends, tell)
    tried: set[str] = set()
    while len(tried) < _DETOURS and time.process_time() < ends:
        if is_clean(best.last) or _sits_in_one_place(problem, best.last):
            break
        banned = next((term.candidate.name for term in best.last.terms if term.candidate.name not in tried), None)
        if banned is None:
            break
        tried.add(banned)
        others = [candidate for candidate in library if candidate.name != banned]
        other = _forward(problem, others, blocks, first, ends, tell)
        if _cost(other.last) < _cost(best.last):
            best = replace(other, library=library)
    fit = best.last
    rivals = best.rivals
    if len(rivals) != len(fit.terms) or tried:
        rivals = tuple(tuple(challengers(problem, fit, index, library)) for index in range(len(fit.terms)))
    return replace(best, rivals=rivals)


def is_clean(fit: Fit) -> bool:
    """Return True where what is left may be noise."""
    return fit.chi2 <= max(_CLEAN, 1 + 4 * float(np.sqrt(0.5 / max(fit.residual.size, 1)))) ** 2 * fit.residual.size


def _share(step: int, part: float) -> float:
    """Return how far the search is; how many rounds there will be is not known."""
    return 0.9 * (1 - 0.5 ** (step + part))


def _sits_in_one_place(problem: Problem, fit: Fit) -> bool:
    """Return True where what is left is the deformation of one module: then no other order of laws explains it."""
    found = yieldings(problem, fit)
    return bool(found) and found[0].gain > _ONE_PLACE * (fit.chi2 - fit.residual.size)


def _cost(fit: Fit) -> float:
    return fit.chi2 + sum(penalty(term) for term in fit.terms)


def scale_of(fit: Fit) -> float:
    """Return the mean squared residual where more than noise is left, else 1."""
    return max(1.0, fit.chi2 / max(fit.residual.size, 1))


def _forward(
    problem: Problem,
    library: Sequence[Candidate],
    blocks: np.ndarray,
    first: Fit,
    ends: float,
    tell: Callable[[str, float], None],
) -> Selection:
    fit = first
    screened: list[Rival] = []
    refused: set[str] = set()
    rivals: list[list[Rival]] = []
    for step in range(MOST_TERMS + 1):
        labels = blocks[fit.samples]
        screened = screen(
            problem, fit, library, lambda share, step=step: tell(f"laws, round {step + 1}", _share(step, 0.5 * share))
        )
        if step == MOST_TERMS or time.process_time() > ends:
            break
        least = threshold(fit.residual.size, len(library), fit.residual, labels, screened)
        before = cross_validated(problem, fit, labels)
        taken = None
        for rival in sorted(screened, key=lambda rival: rival.score)[:6]:
            size = rival.term.candidate.size
            if rival.term.candidate.name in refused or fit.chi2 - rival.chi2 < least(size):
                continue
            tell("the whole simulation", _share(step, 0.6))
            trial = problem.refine([*fit.terms, rival.term], fit)
            after = cross_validated(problem, trial, labels)
            if fit.chi2 - trial.chi2 >= least(size) and before - after > LEAST_GAIN * before:
                taken = trial
                break
            refused.add(rival.term.candidate.name)
        if taken is None:
            break
        tell("earlier choices again", _share(step, 0.8))
        if time.process_time() > ends:
            fit, rivals = taken, []
            continue
        challenged, rivals = _challenged(problem, taken, library)
        fit = _pruned(problem, _merged(problem, challenged, library), labels, least)
        if fit is not challenged:
            rivals = []
    return Selection(first, fit, tuple(tuple(each) for each in rivals), library, tuple(screened))


def screen(problem: Problem, fit: Fit, library, tell=lambda share: None) -> list[Rival]:
    """Return all candidates fitted on top of a fit's terms and together with them, to first order, best first.

    All get a few steps of their fit, those in front the rest of it; those that cannot come near the best are left out.
    """
    rivals = []
    kept = fit.terms
    present = {term.candidate.name for term in kept}
    beside = problem.beside(fit, range(len(kept)))
    modules = {problem.module_of(candidate): candidate for candidate in library}
    least = {module: _least_chi2(problem, fit, one, fit.residual, beside) for module, one in modules.items()}
    best = fit.chi2
    for index, candidate in enumerate(sorted(library, key=lambda candidate: least[problem.module_of(candidate)])):
        tell(index / len(library))
        bound = least[problem.module_of(candidate)]
        if candidate.name in present or bound > best + max(_HOPELESS * (fit.chi2 - best), _MODEST):
            continue
        chi2, term, change = problem.quick(fit, kept, candidate, limit=_FIRST_STEPS, beside=beside)
        rivals.append(Rival(term, chi2, change))
        best = min(best, chi2)
    rivals.sort(key=lambda rival: rival.score)
    front = [_finished(problem, fit, kept, rival, beside) for rival in rivals[:_FRONT] if rival.chi2 < fit.chi2 - 4.0]
    return sorted([*front, *rivals[len(front) :]], key=lambda rival: rival.score)


def _least_chi2(problem: Problem, fit: Fit, candidate: Candidate, residual: Array, beside: Array | None) -> float:
    """Return a chi squared that a candidate cannot go below, to first order; zero where it is not known."""
    module = problem.module_of(candidate)
    if module is None or module not in fit.influence.rows:
        return 0.0
    return least_left(problem, fit, module, residual, beside)


def _finished(problem: Problem, fit: Fit, kept, rival: Rival, beside: Array | None) -> Rival:
    term = rival.term
    chi2, new, change = problem.quick(fit, kept, term.candidate, term.candidate.around(term.coordinates), 20, beside)
    return Rival(new, chi2, change) if chi2 < rival.chi2 else rival


def challengers(problem: Problem, fit: Fit, index: int, library) -> list[Rival]:
    """Return what could stand in the place of term `index`, the term itself included, best first."""
    others = [place for place in range(len(fit.terms)) if place != index]
    kept = [fit.terms[place] for place in others]
    own = fit.terms[index]
    beside = problem.beside(fit, others)
    removed = problem.change(fit, [term.effect for term in kept])
    changed = without(removed.ravel(), beside).reshape(removed.shape)
    scale = scale_of(fit)
    rivals = [Rival(own, fit.chi2, -changed, scale)]
    weight = float((changed**2).sum())
    worst = fit.chi2 + max(0.5 * weight, 4 * INDISTINCT)
    present = {term.candidate.name for term in fit.terms}
    least: dict[str | None, float] = {}
    for candidate in library:
        if candidate.name in present:
            continue
        module = problem.module_of(candidate)
        if module not in least:
            least[module] = _least_chi2(problem, fit, candidate, fit.residual - removed, beside)
        if least[module] > worst:
            continue
        chi2, term, change = problem.quick(fit, kept, candidate, limit=_FIRST_STEPS, beside=beside)
        if chi2 > worst:
            continue
        rival = Rival(term, chi2, change)
        if chi2 < fit.chi2 + max(0.1 * weight, 4 * INDISTINCT):
            rival = _finished(problem, fit, kept, rival, beside)
        rivals.append(Rival(rival.term, rival.chi2, rival.change - changed, scale))
    return sorted(rivals, key=lambda rival: rival.score)


def _challenged(problem: Problem, fit: Fit, library) -> tuple[Fit, list[list[Rival]]]:
    """Return the fit with every term replaced by whatever explains the data better in its place, and all rivals.

    First-order changes of a large effect are a little off; a rival that comes close is simulated before it is judged.
    """
    rivals: list[list[Rival]] = []
    for _ in range(2):
        swapped = False
        rivals = []
        for index in range(len(fit.terms)):
            found = challengers(problem, fit, index, library)
            scale = scale_of(fit)
            own = fit.chi2 + scale * penalty(fit.terms[index])
            weight = float((found[0].change ** 2).sum()) if found else 0.0
            reach = _CURVATURE * weight
            judged: list[Rival] = []
            simulated, most = 0, 3 if reach < 100 else 6
            for rival in found:
                close = rival.score < own + reach and (rival.score < own - 1.0 or reach > 2.0)
                twin = any(_alike(rival, other) for other in judged)
                if rival.term is fit.terms[index] or not close or twin or simulated == most:
                    judged.append(rival)
                    continue
                simulated += 1
                terms = list(fit.terms)
                terms[index] = rival.term
                trial = problem.refine(terms, fit, rounds=4)
                judged.append(Rival(trial.terms[index], trial.chi2, rival.change, scale))
                if judged[-1].score < own - 0.5:
                    fit, swapped = trial, True
                    break
            if swapped:
                break
            rivals.append(sorted(judged, key=lambda rival: rival.score))
        if not swapped:
            break
    return fit, rivals if not swapped else []


def _merged(problem: Problem, fit: Fit, library) -> Fit:
    """Return the fit with one law in the place of two that act on the same part, where it does as well."""
    for one in range(len(fit.terms)):
        for other in range(one + 1, len(fit.terms)):
            place = fit.terms[one].candidate.place.name
            if fit.terms[other].candidate.place.name != place:
                continue
            places = [index for index in range(len(fit.terms)) if index not in (one, other)]
            kept, beside = [fit.terms[index] for index in places], problem.beside(fit, places)
            both = fit.chi2 + penalty(fit.terms[one]) + penalty(fit.terms[other])
            rivals = []
            for candidate in library:
                if candidate.place.name == place:
                    chi2, term, change = problem.quick(fit, kept, candidate, beside=beside)
                    rivals.append(Rival(term, chi2, change))
            for rival in sorted(rivals, key=lambda rival: rival.score)[:3]:
                trial = problem.refine([*kept, rival.term], fit, rounds=5)
                if trial.chi2 + penalty(trial.terms[-1]) < both:
                    return trial
    return fit


def _alike(one: Rival, other: Rival) -> bool:
    """Return True where two rivals change the pose in the same way, so that one need not be tried after the other."""
    a, b = one.change.ravel(), other.change.ravel()
    return float(a @ b) > (1 - 1e-6) * float(np.sqrt((a @ a) * (b @ b))) and abs(one.chi2 - other.chi2) < 1.0


def _pruned(problem: Problem, fit: Fit, blocks: np.ndarray, least) -> Fit:
    """Return the fit without terms that the others have made needless."""
    while len(fit.terms) > 1:
        for index, term in enumerate(fit.terms):
            others = [place for place in range(len(fit.terms)) if place != index]
            kept = [fit.terms[place] for place in others]
            changed = problem.change(fit, [other.effect for other in kept]).ravel()
            if float((without(changed, problem.beside(fit, others)) ** 2).sum()) > 4 * least(term.candidate.size):
                continue
            smaller = problem.refine(kept, fit, rounds=4)
            if smaller.chi2 - fit.chi2 < least(term.candidate.size):
                fit = smaller
                break
        else:
            return fit
    return fit
