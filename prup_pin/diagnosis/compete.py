"""Laws compete for the residual: forward selection, with every earlier choice tried again.

A law enters where the chi squared that it removes passes a threshold for the whole library (chance, and the same
residual with the signs of its blocks flipped), where it removes more than 1 % on blocks that were not used to fit it,
and where the whole simulation confirms it. After each step every law that is in is challenged by every other one.

How far it is searched is a matter of work counted, not of a clock: the same recording gets the same answer everywhere.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np
from scipy.stats import chi2 as chi_squared

from ..spatial import Array
from .candidates import Candidate
from .criteria import (
    BENT,
    BEYOND,
    CHALLENGES,
    CLEAR_LEAD,
    CLEARLY,
    CURVATURE,
    DETOURS,
    FALSE_ALARM,
    FAR_RIVAL,
    FEW_ROUNDS,
    FEW_SIMULATED,
    FEWEST_FOR_FOLDS,
    FIRST_STEPS,
    FLIPS,
    FOLD_STEP,
    FOLDS,
    FRONT,
    FRONT_GAIN,
    FULL_ROUNDS,
    HELD_WORK,
    HOPELESS,
    INDISTINCT,
    LARGE_MISJUDGED,
    LAST_STEPS,
    LEAST_COUNTED,
    LEAST_GAIN,
    LEAST_PIECES,
    MEMORY_WORK,
    MERGE_ROUNDS,
    MERGES_TRIED,
    MODEST,
    MORE_SIMULATED,
    MOST_PAIRS,
    MOST_TERMS,
    NEAR_RIVAL,
    NEEDED,
    ONE_PLACE,
    PAIRED,
    PARALLEL,
    PARAMETER_COST,
    REFINE_MEMORY_WORK,
    REFINE_WORK,
    RIVAL_MARGIN,
    SAME_CHI2,
    SEARCH_WORK,
    SEGMENTS,
    SMALL_MISJUDGED,
    SWAP_LEAD,
    TOLD_ALONE,
    TRIED_WHOLE,
    UNLIKELY_PLACE,
    WEIGHT_ACTS,
    WORTH_SEPARATING,
    beyond_tolerance,
    clean_bound,
)
from .fit import Beside, Fit, Problem, Term, with_priors, without
from .locate import least_left, yieldings
from .whiteness import compared

__all__ = ["Budget", "Rival", "Selection", "cross_validated", "implausible", "needed", "scale_of", "select"]


@dataclass(frozen=True)
class Budget:
    """What a search may cost before it looks for no further law, in units of `criteria`: counted, never timed."""

    work: float = SEARCH_WORK


class _Search:
    """A problem that is asked for fits, and counts what they cost. What is begun is ended."""

    def __init__(self, problem: Problem, budget: Budget):
        self.problem, self.budget, self.spent = problem, budget, 0.0

    @property
    def over(self) -> bool:
        return self.spent > self.budget.work

    def quick(
        self,
        fit: Fit,
        kept: Sequence[Term],
        candidate: Candidate,
        starts: Sequence[Array] | None = None,
        limit: int = 25,
        beside: Beside | None = None,
    ) -> tuple[float, Term, Array]:
        """Return what `Problem.quick` does."""
        self.spent += max(len(fit.samples), LEAST_COUNTED) * (MEMORY_WORK if candidate.remembers else 1.0)
        return self.problem.quick(fit, kept, candidate, starts, limit, beside)

    def refine(self, terms: Sequence[Term], start: Fit, rounds: int = 6, reach: float | None = None) -> Fit:
        """Return what `Problem.refine` does."""
        remembers = any(term.candidate.remembers for term in terms)
        each = REFINE_MEMORY_WORK if remembers else REFINE_WORK
        each *= min((1 + rounds) / FULL_ROUNDS, 1.0)
        self.spent += len(start.samples) * each * (HELD_WORK if len(start.x) else 1.0)
        return self.problem.refine(terms, start, rounds, reach)

    def settled(self, terms: Sequence[Term], like: Fit) -> Fit:
        """Return what `Problem.fit_at` does."""
        self.spent += len(like.samples) * REFINE_WORK
        return self.problem.fit_at(terms, like=like)

    def released(self, fit: Fit) -> Fit:
        """Return a fit with its toleranced parameters as far off as they would go."""
        if not self.problem.is_held_back(fit):
            return fit
        free = self.refine(fit.terms, fit, reach=np.inf)
        return free if free.chi2 < fit.chi2 else fit


@dataclass(frozen=True)
class Rival:
    """An alternative that was tried: its term, chi squared and change of the pose.

    `scale`: mean squared residual where more than noise is left, by which differences of chi squared then grow.
    `whole`: all terms and toleranced parameters (p,) with it in its place, where that was simulated.
    """

    term: Term
    chi2: float
    change: Array
    scale: float = 1.0
    whole: tuple[tuple[Term, ...], Array] | None = None

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
    work: float = 0.0  # what the search cost, in units of its budget

    @classmethod
    def nothing(cls, first: Fit, library: Sequence[Candidate]) -> Selection:
        """Return what is selected where there is nothing to compare."""
        return cls(first, first, (), library, ())


def penalty(term: Term) -> float:
    """Return what a term costs: its parameters, but for known ones, and how far off they lie where such effects are."""
    return PARAMETER_COST * int((term.candidate.known == 0).sum()) + implausible(term)


def implausible(term: Term) -> float:
    """Return what a term costs beside its parameters: values far from where such effects usually are, a rare law."""
    candidate = term.candidate
    logs = candidate.logarithmic & (candidate.known == 0)  # what is known is part of chi squared
    starts = candidate.starts()
    far = min(float((((term.coordinates - start) / candidate.law.spread)[logs] ** 2).sum()) for start in starts)
    far += float((candidate.unusual(term.coordinates) ** 2).sum())
    return far + candidate.law.cost + unlikely(candidate)


def unlikely(candidate: Candidate) -> float:
    """Return a small cost that decides between places that these data cannot tell apart at all."""
    likely = candidate.law.likely
    names = {module.name for module in candidate.mechanism.modules if module.kind.kind in likely}
    return 0.0 if not likely or names.intersection(candidate.parts) else UNLIKELY_PLACE


def cross_validated(
    problem: Problem,
    fit: Fit,
    blocks: np.ndarray,
    folds: int = FOLDS,
    *,
    less: int | None = None,
    parameters: np.ndarray | None = None,
    strained: bool = False,
) -> float:
    """Return chi squared on blocks that were left out in turn, all terms refitted without them (linearly).

    less: a term, or `parameters` (p,): a mask of toleranced ones, that are taken away, the others refitted. strained:
    what toleranced parameters cost that go far to take their place counts as well.
    """
    jacobian = problem.jacobian(fit).reshape(*fit.residual.shape, -1)
    held, x, residual = fit.held.reshape(*fit.residual.shape, -1), fit.x, fit.residual
    candidates = [term.candidate for term in fit.terms]
    own = [np.where(each.known > 0, each.known, each.logarithmic / FOLD_STEP) for each in candidates]
    narrow, off = np.concatenate([np.zeros(0), *own]), np.concatenate([np.zeros(0), *(term.off for term in fit.terms)])
    if less is not None:
        sizes = np.cumsum([0, *(term.candidate.size for term in fit.terms)])
        stays = np.ones(len(narrow), bool)
        stays[sizes[less] : sizes[less + 1]] = False
        others = [term.effect for place, term in enumerate(fit.terms) if place != less]
        residual, jacobian = residual - problem.change(fit, others), jacobian[..., stays]
        narrow, off = narrow[stays], off[stays]
    if parameters is not None:
        residual = residual + held[..., parameters] @ x[parameters]
        held, x = held[..., ~parameters], x[~parameters]
    return _held_out(residual, jacobian, blocks, folds, held, x, (narrow, off), strained)


def _held_out(
    residual: Array,
    jacobian: Array,
    blocks: np.ndarray,
    folds: int,
    held: Array,
    x: Array,
    firm: tuple[Array, Array],
    strained: bool,
) -> float:
    """`firm`: one over what a coordinate may move by when blocks are left out, and by how many of these it is off."""
    narrow, off = firm
    total = 0.0
    labels = _segments(blocks)
    kinds = np.unique(labels)
    part = {label: index % folds for index, label in enumerate(kinds)}
    fold = np.array([part[label] for label in labels])
    for index in np.unique(fold):
        out = fold == index
        target = residual[out].ravel()
        if (jacobian.shape[-1] or len(x)) and (~out).any():
            inside = residual[~out].size
            columns = jacobian[~out].reshape(inside, jacobian.shape[-1])
            scale = np.linalg.norm(columns, axis=0)
            scale = np.where(scale > 0, scale, 1.0)
            within = held[~out].reshape(inside, len(x))
            matrix, right = with_priors(columns / scale, within, residual[~out].ravel(), x)
            near = np.eye(len(narrow), matrix.shape[1]) * (narrow / scale)[:, None]
            step = np.linalg.lstsq(np.vstack((matrix, near)), np.append(right, -off), rcond=1e-8)[0]
            step[: len(scale)] /= scale
            every = np.concatenate((jacobian[out], held[out]), axis=-1)
            target = target - every.reshape(-1, every.shape[-1]) @ step
            if strained:
                total += float(((x + step[len(scale) :]) ** 2).sum()) / len(np.unique(fold))
        total += float(target @ target)
    return total


def _segments(blocks: np.ndarray) -> np.ndarray:
    """Return blocks, or pieces in time where there are too few of them."""
    if len(np.unique(blocks)) >= FEWEST_FOR_FOLDS:
        return blocks
    return np.arange(len(blocks)) * SEGMENTS // max(len(blocks), 1)


def _pieces(blocks: np.ndarray) -> np.ndarray:
    """Return blocks, each in so many pieces that flipping all signs alike is no likely accident."""
    starts = np.concatenate(([True], blocks[1:] != blocks[:-1]))
    block = np.cumsum(starts) - 1
    count = int(block[-1]) + 1 if len(block) else 1
    parts = int(np.ceil(LEAST_PIECES / count))
    inside = np.arange(len(blocks)) - np.flatnonzero(starts)[block]
    return block * parts + inside * parts // np.bincount(block)[block]


def threshold(tried: int, residual: Array, blocks: np.ndarray, rivals: Sequence[Rival]) -> Callable[[int], float]:
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
        signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(len(kinds), FLIPS))
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
    budget: Budget | None = None,
) -> Selection:
    """Return the selection of laws that the recording asks for.

    Where structure is left, the search is made again without one of the laws that it took: a law that came first may
    have come for two others.
    """
    search = _Search(problem, budget or Budget())
    best = _forward(search, library, blocks, first, tell)
    tried: set[str] = set()
    while len(tried) < DETOURS and not search.over:
        if is_clean(problem, best.last) or _sits_in_one_place(problem, best.last):
            break
        banned = next((term.candidate.name for term in best.last.terms if term.candidate.name not in tried), None)
        if banned is None:
            break
        tried.add(banned)
        others = [candidate for candidate in library if candidate.name != banned]
        other = _forward(search, others, blocks, first, tell)
        if _cost(other.last) < _cost(best.last):
            best = replace(other, library=library)
    fit = best.last
    rivals = best.rivals
    if len(rivals) != len(fit.terms) or tried:
        rivals = tuple(tuple(_judged(search, fit, index, library)[0]) for index in range(len(fit.terms)))
    rivals = tuple(_likelier(each, term) for each, term in zip(rivals, fit.terms, strict=True))
    rivals = tuple(tuple(_settled(search, fit, index, each)) for index, each in enumerate(rivals))
    return replace(best, rivals=rivals, work=search.spent)


def _likelier(rivals: Sequence[Rival], term: Term) -> tuple[Rival, ...]:
    """Return the rivals of a term that are no less to be expected.

    A robot's weight of which nothing had to be fitted is not in doubt because something else could be fitted as well.
    """
    if not term.candidate.known.all() or np.abs(term.off).max() > BEYOND:
        return tuple(rivals)
    return tuple(rival for rival in rivals if rival.term.candidate.known.all())


def needed(problem: Problem, selection: Selection, blocks: np.ndarray) -> Selection:
    """Return the selection without laws that samples left out do not ask for, beside all that was calibrated."""
    search = _Search(problem, Budget())
    fit, rivals = selection.last, list(selection.rivals)
    while fit.terms:
        labels = blocks[fit.samples]
        held = cross_validated(problem, fit, labels)
        gains = [cross_validated(problem, fit, labels, less=index) - held for index in range(len(fit.terms))]
        least = int(np.argmin(gains))
        if gains[least] > LEAST_GAIN * held:
            break
        smaller = search.refine([term for index, term in enumerate(fit.terms) if index != least], fit)
        if is_clean(problem, fit) and not is_clean(problem, smaller):
            break  # what would take its place lies farther off than parts are
        fit = smaller
        rivals = rivals[:least] + rivals[least + 1 :]
    return replace(selection, last=fit, rivals=tuple(rivals))


def is_clean(problem: Problem, fit: Fit) -> bool:
    """Return True where what is left may be noise."""
    count = compared(problem, fit)
    return fit.chi2 <= clean_bound(count) ** 2 * count


def _share(step: int, part: float) -> float:
    """Return how far the search is; how many rounds there will be is not known."""
    return 0.9 * (1 - 0.5 ** (step + part))


def _sits_in_one_place(problem: Problem, fit: Fit) -> bool:
    """Return True where what is left is the deformation of one module: then no other order of laws explains it."""
    found = yieldings(problem, fit)
    return bool(found) and found[0].gain > ONE_PLACE * (fit.chi2 - compared(problem, fit))


def _cost(fit: Fit, scale: float = 1.0) -> float:
    """Return chi squared and, `scale` times, what the terms cost."""
    return fit.chi2 + scale * sum(map(penalty, fit.terms))


def scale_of(problem: Problem, fit: Fit) -> float:
    """Return the mean squared residual where more than noise is left, else 1."""
    return max(1.0, fit.chi2 / max(compared(problem, fit), 1))


def _forward(
    search: _Search,
    library: Sequence[Candidate],
    blocks: np.ndarray,
    first: Fit,
    tell: Callable[[str, float], None],
) -> Selection:
    problem, fit = search.problem, first
    screened: list[Rival] = []
    refused: set[str] = set()
    rivals: list[list[Rival]] = []
    for step in range(MOST_TERMS + 1):
        labels = blocks[fit.samples]

        def told(share: float, step: int = step) -> None:
            tell(f"laws, round {step + 1}", _share(step, 0.5 * share))

        screened = screen(search, fit, library, told)
        if step == MOST_TERMS or search.over:
            break
        left = _left_beside(problem, fit)
        least = asked = threshold(len(library), left, labels, screened)
        before = cross_validated(problem, fit, labels)
        rest: Fit | None = None
        taken = None
        for rival in sorted(screened, key=lambda rival: rival.score)[:TRIED_WHOLE]:
            size = rival.term.candidate.size
            if rival.term.candidate.name in refused or fit.chi2 - rival.chi2 < least(size):
                continue
            tell("the whole simulation", _share(step, 0.6))
            trial = search.refine([*fit.terms, rival.term], fit)
            clear = trial.chi2 <= CLEARLY * float((left**2).sum())
            trial = trial if clear else search.released(trial)
            helps = before - cross_validated(problem, trial, labels) > LEAST_GAIN * before
            if rest is None and not (clear and helps):
                # What parameters explain that are off by more than their tolerance is no merit of a law beside them.
                rest = search.released(fit)
                asked = threshold(len(library), _left_beside(problem, rest), labels, screened)
            without_it = rest or fit
            helps = helps or _relieves(without_it, trial, asked(size))
            if without_it.chi2 - trial.chi2 >= asked(size) and helps:
                # what bends has not come to its end, and a second law would make up for that
                taken = trial if trial.chi2 < rival.chi2 + CLEAR_LEAD else search.refine(trial.terms, trial)
                break
            refused.add(rival.term.candidate.name)
        if taken is None:
            break
        tell("earlier choices again", _share(step, 0.8))
        if search.over:
            fit, rivals = taken, []
            continue
        challenged, rivals = _challenged(search, taken, library)
        if rivals and (paired := _in_pairs(search, challenged, rivals)) is not challenged:
            challenged, rivals = _challenged(search, paired, library)
        fit = _apart(search, _merged(search, challenged, library), library)
        fit = _weighed(search, _pruned(search, fit, least), library)
        if fit is not challenged:
            rivals = []
    last = search.released(fit)
    return Selection(first, last, tuple(tuple(each) for each in rivals), library, tuple(screened), search.spent)


def _left_beside(problem: Problem, fit: Fit) -> Array:
    """Return what toleranced parameters leave of a fit's residual, (n, K), in the metric of noise and tolerances."""
    return problem.beyond(fit, problem.target(fit).ravel()).reshape(fit.residual.shape)


def _relieves(fit: Fit, trial: Fit, least: float) -> bool:
    """Return True where a law takes a strain from parameters that took its place: held-out samples cannot tell them.

    One culprit, its own tolerance lifted, is weighed against many that hide it. Where none of them was driven beyond
    tolerance, by how far off parameters are beside the law: what is off by more than declared is so by chance as well.
    """
    saved = float(fit.x @ fit.x - trial.x @ trial.x)
    beyond = np.abs(fit.x).max(initial=0.0) > beyond_tolerance(len(fit.x))
    return saved >= (least if beyond else least * strain_of(trial))


def strain_of(fit: Fit) -> float:
    """Return the mean square by which toleranced parameters are off, in tolerances, as far as data tell; at least 1."""
    told = np.linalg.eigvalsh(fit.held.T @ fit.held)
    count = float((told / (1 + told)).sum())
    return max(float(fit.x @ fit.x) / max(count, 1.0), 1.0)


def screen(
    search: _Search, fit: Fit, library: Sequence[Candidate], tell: Callable[[float], None] = lambda share: None
) -> list[Rival]:
    """Return all candidates fitted on top of a fit's terms and together with them, to first order, best first.

    All get a few steps of their fit, those in front the rest of it; those that cannot come near the best are left out.
    """
    problem = search.problem
    rivals = []
    kept = fit.terms
    present = {term.candidate.name for term in kept}
    beside = problem.beside(fit, range(len(kept)))
    least = _Least(problem, fit, kept, problem.target(fit), beside)
    best = fit.chi2
    single = sorted((candidate for candidate in library if not candidate.everywhere), key=least)
    for index, candidate in enumerate([*single, *(candidate for candidate in library if candidate.everywhere)]):
        tell(index / len(library))
        near = max(HOPELESS * (fit.chi2 - best), MODEST)
        if candidate.everywhere:  # many, and dear: one that removes less than it costs is not tried either
            near = min(HOPELESS * (fit.chi2 - best), fit.chi2 - best - PARAMETER_COST - candidate.law.cost)
        if candidate.name in present or least(candidate) > best + near:
            continue
        chi2, term, change = search.quick(fit, kept, candidate, limit=FIRST_STEPS, beside=beside)
        least.heard(candidate, chi2)
        rivals.append(Rival(term, chi2, change))
        best = min(best, chi2)
    rivals.sort(key=lambda rival: rival.score)
    front = [
        _finished(search, fit, kept, rival, beside) for rival in rivals[:FRONT] if rival.chi2 < fit.chi2 - FRONT_GAIN
    ]
    return sorted([*front, *rivals[len(front) :]], key=lambda rival: rival.score)


class _Least:
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


def _finished(search: _Search, fit: Fit, kept: Sequence[Term], rival: Rival, beside: Beside | None) -> Rival:
    candidate, around = rival.term.candidate, rival.term.candidate.around(rival.term.coordinates)
    chi2, new, change = search.quick(fit, kept, candidate, around, LAST_STEPS, beside)
    return Rival(new, chi2, change) if chi2 < rival.chi2 else rival


@dataclass(frozen=True)
class _Outlook:
    """A fit about which candidates are taken to first order beside kept terms, and what is kept does there.

    begun (n, K): what the term whose place is looked at does, beyond what the others may do.
    """

    fit: Fit
    kept: Sequence[Term]
    beside: Beside | None
    begun: Array
    least: _Least

    @classmethod
    def of(cls, problem: Problem, fit: Fit, index: int) -> _Outlook:
        """Return the outlook from a fit on the place of one of its terms."""
        others = [place for place in range(len(fit.terms)) if place != index]
        kept, beside = [fit.terms[place] for place in others], problem.beside(fit, others)
        removed = problem.change(fit, [term.effect for term in kept])
        begun = without(removed.ravel(), beside).reshape(removed.shape)
        return cls(fit, kept, beside, begun, _Least(problem, fit, kept, problem.target(fit) - removed, beside))

    @classmethod
    def without(cls, problem: Problem, fit: Fit, index: int) -> _Outlook:
        """Return the outlook from the simulation without that term."""
        kept = [term for place, term in enumerate(fit.terms) if place != index]
        bare = problem.fit_at(kept, like=fit)
        beside = problem.beside(bare, range(len(kept)))
        return cls(bare, kept, beside, 0.0 * bare.residual, _Least(problem, bare, kept, problem.target(bare), beside))

    def rival(self, search: _Search, candidate: Candidate, worst: float, finished: float, scale: float) -> Rival | None:
        """Return a candidate as a rival, fitted to the end below `finished`; None where it leaves more than `worst`."""
        if self.least(candidate) > worst:
            return None
        chi2, term, change = search.quick(self.fit, self.kept, candidate, limit=FIRST_STEPS, beside=self.beside)
        self.least.heard(candidate, chi2)
        if chi2 > worst:
            return None
        rival = Rival(term, chi2, change)
        if chi2 < finished:
            rival = _finished(search, self.fit, self.kept, rival, self.beside)
        return Rival(rival.term, rival.chi2, rival.change - self.begun, scale)


def challengers(search: _Search, fit: Fit, index: int, library: Sequence[Candidate]) -> list[Rival]:
    """Return what could stand in the place of term `index`, the term itself included, best first."""
    problem, own, scale = search.problem, fit.terms[index], scale_of(search.problem, fit)
    here = _Outlook.of(problem, fit, index)
    rivals = [Rival(own, fit.chi2, -here.begun, scale)]
    weight = float((here.begun**2).sum())
    misjudged = _misjudged(problem, fit, index)
    margin = max(RIVAL_MARGIN * INDISTINCT, misjudged)
    worst = fit.chi2 + max(FAR_RIVAL * weight, margin)
    finished = fit.chi2 + max(NEAR_RIVAL * weight, margin)
    outlooks = [here]
    if _loads_alone(problem, own):
        # Without it nothing yields: what its rivals do is not what they do to the loaded robot.
        outlooks = [_Outlook.without(problem, fit, index)]
    elif misjudged > LARGE_MISJUDGED:
        # A large turn is bent; one law's first order sees it from where another one's does not.
        outlooks.append(_Outlook.without(problem, fit, index))
    present = {term.candidate.name for term in fit.terms}
    for candidate in library:
        if candidate.name not in present:
            seen = (outlook.rival(search, candidate, worst, finished, scale) for outlook in outlooks)
            rivals += sorted((rival for rival in seen if rival is not None), key=lambda rival: rival.chi2)[:1]
    return sorted(rivals, key=lambda rival: rival.score)


def _loads_alone(problem: Problem, term: Term) -> bool:
    """Return True for weight where no wrench acts, and for a joint that is else rigid: what yields does so by it."""
    if term.candidate.law.physics == "joint_compliance":
        return True
    return "gravity" in term.candidate.law.needs and not np.any(np.nan_to_num(problem.simulator.inputs.wrench))


def _misjudged(problem: Problem, fit: Fit, index: int) -> float:
    """Return by how much first order may misjudge chi squared in the place of a term.

    It grows with all that the term moves, be it that parameters within tolerance could move most of it as well.
    """
    kept = [term.effect for place, term in enumerate(fit.terms) if place != index]
    return CURVATURE * float((problem.change(fit, kept) ** 2).sum())


def _judged(
    search: _Search, fit: Fit, index: int, library: Sequence[Candidate], leads: bool = False
) -> tuple[list[Rival], Fit | None]:
    """Return what could stand in the place of a term, best first, and with `leads` the first fit that is better by it.

    First-order changes of a large effect are a little off; a rival that comes close is simulated before it is judged.
    """
    found = challengers(search, fit, index, library)
    scale = scale_of(search.problem, fit)
    own = fit.chi2 + scale * penalty(fit.terms[index])
    reach = _misjudged(search.problem, fit, index)
    judged: list[Rival] = []
    simulated, most = 0, FEW_SIMULATED if reach < LARGE_MISJUDGED else MORE_SIMULATED
    for rival in found:
        close = rival.score < own + reach and (rival.score < own - CLEAR_LEAD or reach > SMALL_MISJUDGED)
        twin = any(_alike(rival, other) for other in judged)
        if rival.term is fit.terms[index] or not close or twin or simulated == most or search.over:
            judged.append(rival)
            continue
        simulated += 1
        terms = list(fit.terms)
        terms[index] = rival.term
        trial = search.refine(terms, fit, rounds=2)
        if trial.chi2 < max(rival.chi2, fit.chi2) + RIVAL_MARGIN * scale * INDISTINCT:
            trial = search.refine(trial.terms, trial, rounds=FEW_ROUNDS)
        judged.append(_simulated(rival, index, trial))
        if leads and judged[-1].score < own - SWAP_LEAD:
            return judged, trial
    return sorted(judged, key=lambda rival: rival.score), None


def _settled(search: _Search, fit: Fit, index: int, rivals: Sequence[Rival]) -> list[Rival]:
    """Return rivals of a term, those that data may leave beside it as the whole simulation has them.

    What first order misjudges would be taken for a difference that another recording shows.
    """
    if not rivals or _misjudged(search.problem, fit, index) < SMALL_MISJUDGED:
        return list(rivals)
    own, found = fit.terms[index], []
    change = next((rival for rival in rivals if rival.term is own), rivals[0])
    simulated = 0
    for rival in sorted(rivals, key=lambda rival: rival.chi2):
        near = rival.chi2 - fit.chi2 <= WORTH_SEPARATING * rival.scale * INDISTINCT
        law = rival.term.candidate.law.physics
        twin = law == own.candidate.law.physics and _alike(rival, change)
        dear = rival.term.candidate.remembers or search.over or simulated == MOST_PAIRS
        if near and rival.whole is None and rival.term is not own and not twin and not dear:
            simulated += 1
            terms = (*fit.terms[:index], rival.term, *fit.terms[index + 1 :])
            rival = _simulated(rival, index, search.refine(terms, fit, rounds=FEW_ROUNDS))
        found.append(rival)
    return sorted(found, key=lambda rival: rival.score)


def _simulated(rival: Rival, index: int, trial: Fit) -> Rival:
    """Return a rival as a fit has it in the place of term `index`."""
    return replace(rival, term=trial.terms[index], chi2=trial.chi2, whole=(trial.terms, trial.x))


def _challenged(search: _Search, fit: Fit, library: Sequence[Candidate]) -> tuple[Fit, list[list[Rival]]]:
    """Return the fit with every term replaced by whatever explains the data better in its place, and all rivals."""
    rivals: list[list[Rival]] = []
    for _ in range(CHALLENGES):
        rivals, better = [], None
        for index in range(len(fit.terms)):
            if search.over:
                return fit, []
            judged, better = _judged(search, fit, index, library, leads=True)
            if better is not None:
                fit = better
                break
            rivals.append(judged)
        if better is None:
            return fit, rivals
    return fit, []


def _in_pairs(search: _Search, fit: Fit, rivals: Sequence[Sequence[Rival]]) -> Fit:
    """Return the fit with one law at another place that looks alike, and with it another weight, or a law less.

    Weight acts through what yields. Of places in series, which look alike under the tool's load, one was taken beside a
    wrong weight, or with a small law to make up for the difference; beside the right place neither is wanted.
    """
    problem, scale = search.problem, scale_of(search.problem, fit)
    best, found = fit, _cost(fit, scale) - SWAP_LEAD

    def better(terms: Sequence[Term], chi2: float, start: Fit) -> None:
        nonlocal best, found
        if chi2 + scale * sum(map(penalty, terms)) > found:
            return
        trial = search.refine(terms, start, rounds=FEW_ROUNDS)
        if _cost(trial, scale) < found:
            best, found = trial, _cost(trial, scale)

    for place, other in permutations(range(len(fit.terms)), 2):
        physics, far = fit.terms[place].candidate.law.physics, fit.chi2 + RIVAL_MARGIN * scale * INDISTINCT
        weighs = "gravity" in fit.terms[other].candidate.law.needs
        alike = [rival for rival in rivals[place] if rival.term.candidate.law.physics == physics and rival.chi2 < far]
        for twin in _others(alike, fit.terms[place])[:PAIRED]:
            if search.over:
                return best
            terms = [twin.term if index == place else term for index, term in enumerate(fit.terms)]
            start = search.settled(terms, fit)
            kept = [index for index in range(len(terms)) if index != other]
            rest, beside = [terms[index] for index in kept], problem.beside(start, kept)
            changed = problem.target(start) - problem.change(start, [term.effect for term in rest])
            left = _Least(problem, start, rest, changed, beside).left
            better(rest, float(left @ left), start)
            for rival in _others(rivals[other], fit.terms[other])[:PAIRED] if weighs else ():
                candidate = rival.term.candidate
                if "gravity" in candidate.law.needs and candidate.name not in {term.candidate.name for term in rest}:
                    chi2, term, _ = search.quick(start, rest, candidate, limit=LAST_STEPS, beside=beside)
                    better([*rest, term], chi2, start)
    return best


def _others(rivals: Sequence[Rival], term: Term) -> list[Rival]:
    """Return rivals other than a term itself, without those that remember: these are dear."""
    name = term.candidate.name
    return [rival for rival in rivals if rival.term.candidate.name != name and not rival.term.candidate.remembers]


def _merged(search: _Search, fit: Fit, library: Sequence[Candidate]) -> Fit:
    """Return the fit with one law in the place of two that act on the same part, where it does as well."""
    for one in range(len(fit.terms)):
        for other in range(one + 1, len(fit.terms)):
            parts = fit.terms[one].candidate.parts
            if fit.terms[other].candidate.parts != parts:
                continue
            places = [index for index in range(len(fit.terms)) if index not in (one, other)]
            kept, beside = [fit.terms[index] for index in places], search.problem.beside(fit, places)
            both = fit.chi2 + penalty(fit.terms[one]) + penalty(fit.terms[other])
            rivals = []
            for candidate in library:
                if candidate.parts == parts:
                    chi2, term, change = search.quick(fit, kept, candidate, beside=beside)
                    rivals.append(Rival(term, chi2, change))
            for rival in sorted(rivals, key=lambda rival: rival.score)[:MERGES_TRIED]:
                trial = search.refine([*kept, rival.term], fit, rounds=MERGE_ROUNDS)
                if trial.chi2 + penalty(trial.terms[-1]) < both:
                    return trial
    return fit


def _weighed(search: _Search, fit: Fit, library: Sequence[Candidate]) -> Fit:
    """Return the fit with the robot's own weight beside what hangs on it, or instead, where that is likelier.

    Weight has nothing to be fitted, and where something else weighs it is no news: it need not pass what a law must
    that nobody expects. Alone, a payload of any mass takes the place of both.
    """
    heavy = [term.candidate for term in fit.terms if "gravity" in term.candidate.law.needs]
    if not heavy or any(candidate.known.any() for candidate in heavy):
        return fit
    best, found = fit, _cost(fit) - WEIGHT_ACTS * scale_of(search.problem, fit)
    others = [term for term in fit.terms if term.candidate not in heavy]
    for candidate in library:
        if "gravity" in candidate.law.needs and candidate.known.any() and not search.over:
            own = candidate.term(candidate.starts()[0])
            trials = [search.refine([*kept, own], fit) for kept in (fit.terms, others)]
            trial = min(trials, key=_cost)
            if _cost(trial) < found:
                best, found = trial, _cost(trial)
    return best


def _apart(search: _Search, fit: Fit, library: Sequence[Candidate]) -> Fit:
    """Return the fit with laws at a few places in the place of one at all of them, where they do as well for less."""
    problem, scale = search.problem, scale_of(search.problem, fit)
    single = {(candidate.law.physics, candidate.place): candidate for candidate in library if candidate.size == 1}
    for index, term in enumerate(fit.terms):
        law, names = term.candidate.law, [quantity.name for quantity in term.candidate.quantities]
        places = law.apart(term.candidate.place, term.candidate.mechanism)
        if not all(name in places and (law.physics, places[name]) in single for name in names):
            continue
        sure = _surety(problem, fit, index)
        kept = [other for place, other in enumerate(fit.terms) if place != index]
        told = [place for place in np.argsort(-sure) if sure[place] > TOLD_ALONE]
        if not told or len(told) + len(kept) > MOST_TERMS:
            continue
        for place in told:
            candidate, name = single[law.physics, places[names[place]]], names[place]
            kept.append(candidate.term(candidate.coordinates_of(np.array([term.effect.values[name]]))))
        trial = search.refine(kept, fit, rounds=MERGE_ROUNDS)
        if _cost(trial, scale) < _cost(fit, scale):
            return trial
    return fit


def _surety(problem: Problem, fit: Fit, index: int) -> Array:
    """Return by how many standard deviations the coordinates of a term differ from zero, (p,)."""
    jacobian = problem.beyond(fit, problem.jacobian(fit))
    size = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-300)
    covariance = np.linalg.pinv((jacobian / size).T @ (jacobian / size), rcond=1e-12, hermitian=True)
    begin = sum(term.candidate.size for term in fit.terms[:index])
    own = slice(begin, begin + fit.terms[index].candidate.size)
    return fit.terms[index].coordinates * size[own] / np.sqrt(np.maximum(np.diag(covariance)[own], 1e-300))


def _alike(one: Rival, other: Rival) -> bool:
    """Return True where two rivals change the pose in the same way, so that one need not be tried after the other."""
    a, b = one.change.ravel(), other.change.ravel()
    return float(a @ b) > (1 - PARALLEL) * float(np.sqrt((a @ a) * (b @ b))) and abs(one.chi2 - other.chi2) < SAME_CHI2


def _pruned(search: _Search, fit: Fit, least: Callable[[int], float]) -> Fit:
    """Return the fit without terms that the others have made needless."""
    problem = search.problem
    while len(fit.terms) > 1:
        for index, term in enumerate(fit.terms):
            others = [place for place in range(len(fit.terms)) if place != index]
            kept = [fit.terms[place] for place in others]
            changed = problem.change(fit, [other.effect for other in kept]).ravel()
            if float((without(changed, problem.beside(fit, others)) ** 2).sum()) > NEEDED * least(term.candidate.size):
                continue
            smaller = search.refine(kept, fit, rounds=FEW_ROUNDS)
            if smaller.chi2 - fit.chi2 < least(term.candidate.size):
                fit = smaller
                break
        else:
            return fit
    return fit
