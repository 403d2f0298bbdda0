"""What speaks for a set of laws: what it costs, what samples say that were left out, what chance would gain.

A law costs its parameters and how far they lie from what is usual; it must gain more than the best of the whole library
would by chance, and on blocks that it was not fitted to. Tolerances compete with laws: one part that is far off is a
finding, many that are all a little too far off are a tolerance that was declared too narrow, and no finding at all.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..numbers import number
from ..spatial import Array
from .candidates import Candidate
from .chances import chi2_isf
from .criteria import (
    BEYOND,
    BLOCKS,
    FALSE_ALARM,
    FEWEST_BLOCKS,
    FLIPS,
    FOLDS,
    LEAD,
    PARAMETER_COST,
    beyond_tolerance,
    clean_bound,
)
from .normal_equations import likeliest_widths
from .nuisance import Nuisance, with_priors
from .problem import Fit, Problem, Term
from .toleranced import Toleranced

# -- what a law costs --------------------------------------------------------------------------------------------------


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


def penalty(term: Term) -> float:
    """Return what a term costs: its parameters, but for known ones, and how far off they lie where such effects are."""
    return PARAMETER_COST * int((term.candidate.known == 0).sum()) + implausible(term)


def implausible(term: Term) -> float:
    """Return what a term costs beside its parameters: values far from where such effects usually are, a rare law."""
    candidate = term.candidate
    logs = candidate.logarithmic & (candidate.known == 0)  # what is known is part of chi squared
    starts = candidate.starts()
    far = min(float((((term.coordinates - start) / candidate.law.spread)[logs] ** 2).sum()) for start in starts)
    far += float((candidate.prior_residuals(term.coordinates) ** 2).sum())
    return far + candidate.law.cost + _unlikely(candidate)


def _unlikely(candidate: Candidate) -> float:
    """Return a small cost that decides between places that these data cannot tell apart at all."""
    likely = candidate.law.likely
    names = {module.name for module in candidate.mechanism.modules if module.kind.kind in likely}
    return 0.0 if not likely or names.intersection(candidate.parts) else LEAD


def is_clean(problem: Problem, fit: Fit) -> bool:
    """Return True where what is left may be noise."""
    count = problem.count(fit)
    return fit.chi2 <= clean_bound(count) ** 2 * count


def cost_of(fit: Fit, scale: float = 1.0) -> float:
    """Return chi squared and, `scale` times, what the terms cost."""
    return fit.chi2 + scale * sum(map(penalty, fit.terms))


def scale_of(problem: Problem, fit: Fit) -> float:
    """Return the mean squared residual where more than noise is left, else 1."""
    return max(1.0, fit.chi2 / max(problem.count(fit), 1))


# -- chance, and samples that were left out ----------------------------------------------------------------------------


def fold_labels(blocks: np.ndarray) -> np.ndarray:
    """Return labels (N,) of samples that are held out together: blocks, each cut in time where there are too few."""
    if len(np.unique(blocks)) >= FEWEST_BLOCKS:
        return blocks
    place = np.arange(len(blocks)) - np.searchsorted(blocks, blocks)
    return blocks * FOLDS + place * FOLDS // np.bincount(blocks)[blocks]


def cross_validated(
    problem: Problem,
    fit: Fit,
    blocks: np.ndarray,
    *,
    less: int | None = None,
    parameters: np.ndarray | None = None,
    strained: bool = False,
    bounded: bool = False,
) -> float:
    """Return chi squared on blocks that were left out in turn, all terms refitted without them (linearly).

    less: a term, or `parameters` (p,): a mask of toleranced ones, that are taken away, the others refitted. strained:
    what toleranced parameters cost that go far to take their place counts as well. bounded: terms keep within their
    bounds, as those of the corrected model do; beyond them laws that only imitate may foretell what they cannot be.
    """
    jacobian = problem.jacobian(fit).reshape(*fit.residual.shape, -1)
    held, x, residual = fit.per_tolerance.reshape(*fit.residual.shape, -1), fit.x, fit.residual
    candidates = [term.candidate for term in fit.terms]
    # a logarithm that only few samples tell (the load that closes a gap) is trusted for a step of one
    own = [np.where(each.known > 0, each.known, each.logarithmic) for each in candidates]
    narrow, off = np.concatenate([np.zeros(0), *own]), np.concatenate([np.zeros(0), *(term.off for term in fit.terms)])
    ways = [_ways(term, bounded) for term in fit.terms]
    low, high = (np.concatenate([np.zeros(0), *each]) for each in (zip(*ways, strict=True) if ways else ((), ())))
    if less is not None:
        stays = np.ones(len(narrow), bool)
        stays[fit.coordinates_of(less)] = False
        others = [term.effect for term in fit.others(less)[1]]
        residual, jacobian = residual - problem.change(fit, others), jacobian[..., stays]
        narrow, off, low, high = narrow[stays], off[stays], low[stays], high[stays]
    if parameters is not None:
        residual = residual + held[..., parameters] @ x[parameters]
        held, x = held[..., ~parameters], x[~parameters]
    return _out_of_fold(residual, jacobian, blocks, held, x, _Firm(narrow, off, low, high), strained)


def _ways(term: Term, bounded: bool) -> tuple[Array, Array]:
    """Return by how much coordinates of a term (p,) may fall and rise within their bounds; logarithms by anything."""
    free, (low, high) = term.candidate.logarithmic | (not bounded), term.candidate.bounds
    here = term.coordinates
    return np.where(free, -np.inf, np.minimum(low - here, 0.0)), np.where(free, np.inf, np.maximum(high - here, 0.0))


class _Firm(NamedTuple):
    """How firmly coordinates stand, (p,) each, where blocks are left out.

    One over what each may move by, and by how many of these it is off; the least and the most that it may move by.
    """

    narrow: Array
    off: Array
    low: Array
    high: Array


def _out_of_fold(
    residual: Array,
    jacobian: Array,
    blocks: np.ndarray,
    held: Array,
    x: Array,
    firm: _Firm,
    strained: bool,
) -> float:
    total = 0.0
    fold = np.unique(blocks, return_inverse=True)[1].ravel() % FOLDS
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
            near = np.eye(len(scale), matrix.shape[1]) * (firm.narrow / scale)[:, None]
            matrix, right = np.vstack((matrix, near)), np.append(right, -firm.off)
            step = _least_within(matrix, right, firm.low * scale, firm.high * scale)
            step[: len(scale)] /= scale
            every = np.concatenate((jacobian[out], held[out]), axis=-1)
            target = target - every.reshape(-1, every.shape[-1]) @ step
            if strained:
                total += float(((x + step[len(scale) :]) ** 2).sum()) / len(np.unique(fold))
        total += float(target @ target)
    return total


def _least_within(matrix: Array, right: Array, low: Array, high: Array) -> Array:
    """Return the least squares of matrix (m, n) x = right (m,), with low <= x[:p] <= high, (p,) each.

    What would go beyond goes to its bound, and the others do what is best then.
    """
    found, open_ = np.zeros(matrix.shape[1]), np.ones(matrix.shape[1], bool)
    while True:
        left = right - matrix[:, ~open_] @ found[~open_]
        found[open_] = np.linalg.lstsq(matrix[:, open_], left, rcond=1e-8)[0]
        within = found.copy()
        within[: len(low)] = np.clip(found[: len(low)], low, high)
        beyond = open_ & (found != within)
        if not beyond.any():
            return found
        found[beyond] = within[beyond]
        open_ &= ~beyond


def _pieces(blocks: np.ndarray) -> np.ndarray:
    """Return blocks, each in so many pieces that flipping all signs alike is no likely accident."""
    starts = np.concatenate(([True], blocks[1:] != blocks[:-1]))
    block = np.cumsum(starts) - 1
    count = int(block[-1]) + 1 if len(block) else 1
    parts = int(np.ceil(BLOCKS / count))
    inside = np.arange(len(blocks)) - np.flatnonzero(starts)[block]
    return block * parts + inside * parts // np.bincount(block)[block]


def sign_flipped(by_block: Array) -> Array:
    """Return products with a residual by block (B, p) summed with the signs of whole blocks flipped, (FLIPS, p).

    What is only correlated noise looks as it did then, and what a law explains is gone.
    """
    signs = np.random.default_rng(len(by_block)).choice([-1.0, 1.0], (FLIPS, len(by_block)))
    return signs @ by_block


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
        flipped = float(np.quantile((sign_flipped(per_block.T) ** 2).max(axis=1), 1 - FALSE_ALARM))
    one = chi2_isf(FALSE_ALARM / tried, 1)

    def least(parameters: int) -> float:
        chance = chi2_isf(FALSE_ALARM / tried, parameters)
        return max(chance, flipped + chance - one)

    return least


# -- tolerances that were declared too narrow --------------------------------------------------------------------------


def rescaled_tolerances(problem: Problem, fit: Fit) -> dict[str, float]:
    """Return by how many times as far off as declared parts are, by kinds of which that is sure.

    At least once. Of kinds that many places have: all of a sensor's are one law's, and how far it is off is a finding.
    """
    if problem.tolerances is None or not len(fit.x) or problem.tolerances.toleranced.root is not None:
        return {}
    held, residual = _without_laws(problem, fit)
    own = problem.tolerances.toleranced.law.deviations
    kinds = [item.kind for item in own]
    many = [kind for kind in dict.fromkeys(kinds) if len({item.place for item in own if item.kind == kind}) > 1]
    return factors_of_kinds(held.T @ held, held.T @ (residual + held @ fit.x), kinds, many)


def factors_of_kinds(normal: Array, right: Array, kinds: Sequence[str], free: Sequence[str]) -> dict[str, float]:
    """Return the likeliest factors of the `free` kinds' tolerances where they are sure.

    normal, right: J^T J (p, p) and J^T r (p,); kinds (p,) of the parameters.
    """
    labels = np.array(kinds)
    variances, cost = _maximum_likelihood(normal, right, labels, free)
    while free:
        others = []
        for kind in free:
            fewer = [name for name in free if name != kind]
            found, left = _maximum_likelihood(normal, right, labels, fewer)
            # one part that is far off, wherever it is, needs no other tolerance for its whole kind
            own = labels == kind
            alone = left - _outlier_gains(normal, right, found)[own].max(initial=0.0) + 2 * np.log(max(own.sum(), 1))
            others.append((min(left - PARAMETER_COST, alone), found, left, fewer))
        least = min(others, key=lambda each: each[0])
        if least[0] > cost:
            break
        _, variances, cost, free = least
    return {kind: float(np.sqrt(variances[labels == kind][0])) for kind in free}


def with_rescaled(toleranced: Toleranced, factors: Mapping[str, float]) -> Toleranced:
    """Return parameters whose tolerances are as many times as wide."""
    sizes = np.array([factors.get(item.kind, 1.0) for item in toleranced.law.deviations])
    return replace(toleranced, tolerances=sizes * toleranced.tolerances)


def minus_2_log_posterior(fit: Fit, library: int, factors: Mapping[str, float] | None = None) -> float:
    """Return -2 log of the probability of what was measured, with what findings and other tolerances cost.

    One thing may be wrong with any robot; of each further one nobody knew where to look among `library` laws at places.
    """
    size = float(np.linalg.slogdet(np.eye(len(fit.x)) + fit.per_tolerance.T @ fit.per_tolerance)[1])
    laws = sum(penalty(term) for term in fit.terms)
    named = len(fit.terms) + count_beyond_tolerance(fit)
    elsewhere = 2 * float(np.log(max(library, 1))) * max(named - 1, 0)
    return float(fit.chi2) + size + laws + elsewhere + PARAMETER_COST * len(factors or ())


def count_beyond_tolerance(fit: Fit) -> int:
    """Return how many parameters lie beyond their tolerances."""
    return int((np.abs(fit.x) > beyond_tolerance(len(fit.x))).sum())


def rescaling_remark(factors: Mapping[str, float], taken: bool) -> str:
    """Return a sentence on tolerances that were declared too narrow."""
    each = ", ".join(f"{kind} {number(factor, 2)} times" for kind, factor in factors.items())
    what = (
        "These tolerances were taken instead, for what is within them is no finding"
        if taken
        else "The declared ones were kept; those too narrow make findings of what is nobody's fault"
    )
    return f"parts are off by more than their tolerances say: {each} as far as declared. {what}"


def _without_laws(problem: Problem, fit: Fit) -> tuple[Array, Array]:
    """Return the change per tolerance (m, p) and the residual (m,) without what the fit's laws may do."""
    laws = Nuisance.free(problem.jacobian(fit))
    return laws.without(fit.per_tolerance), laws.without(fit.residual.ravel())


def _maximum_likelihood(normal: Array, right: Array, labels: np.ndarray, free: Sequence[str]) -> tuple[Array, float]:
    """Return the likeliest variances (p,) where only some kinds are not as declared, and -2 log L."""
    own = {kind: np.flatnonzero(labels == kind) for kind in free}
    kinds = {kind: (here, np.eye(len(here))) for kind, here in own.items()}
    widths = likeliest_widths(normal, right, np.eye(len(labels)), kinds, (1.0, BEYOND))
    root = np.array([widths.get(kind, 1.0) for kind in labels])
    matrix = np.eye(len(root)) + root[:, None] * normal * root
    mean = root * np.linalg.solve(matrix, root * right)
    return root**2, float(np.linalg.slogdet(matrix)[1] - right @ mean)


def _outlier_gains(normal: Array, right: Array, variances: Array) -> Array:
    """Return by how much -2 log L falls where one parameter alone, each in turn, may be off by any amount, (p,)."""
    inside = normal @ np.linalg.inv(np.diag(1 / variances) + normal)
    size = np.maximum(np.diagonal(normal - inside @ normal), 1e-300)
    far = np.maximum((right - inside @ right) ** 2 / size, 1.0)
    return np.asarray(far - 1 - np.log(far))
