"""What samples that were left out say, and how much chance would gain."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..spatial import Array
from .chances import chi2_isf
from .criteria import (
    FALSE_ALARM,
    FEWEST_FOR_FOLDS,
    FLIPS,
    FOLDS,
    LEAST_PIECES,
)
from .fit import Fit, Problem, with_priors
from .selection import Rival

__all__ = [
    "cross_validated",
    "threshold",
]


def cross_validated(
    problem: Problem,
    fit: Fit,
    blocks: np.ndarray,
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
    # a logarithm that only few samples tell (the load that closes a gap) is trusted for a step of one
    own = [np.where(each.known > 0, each.known, each.logarithmic) for each in candidates]
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
    return _held_out(residual, jacobian, blocks, held, x, (narrow, off), strained)


def _held_out(
    residual: Array,
    jacobian: Array,
    blocks: np.ndarray,
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
    part = {label: index % FOLDS for index, label in enumerate(kinds)}
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
    return np.arange(len(blocks)) * FOLDS // max(len(blocks), 1)


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
    one = chi2_isf(FALSE_ALARM / tried, 1)

    def least(parameters: int) -> float:
        chance = chi2_isf(FALSE_ALARM / tried, parameters)
        return max(chance, flipped + chance - one)

    return least
