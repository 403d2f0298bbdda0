"""Is what is left noise, only more of it than was declared?"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.stats import chi2 as chi_squared
from scipy.stats import norm

from ..spatial import Array
from .criteria import STRUCTURE_CHANCE, chance_bound
from .fit import Fit, Problem
from .local_curve import strongest_curve
from .residual import Noise

__all__ = ["compared", "is_white", "noise_of_the_rest"]


def compared(problem: Problem, fit: Fit) -> int:
    """Return how many numbers of a fit's residual were both measured and simulated."""
    return int((problem.measured.exists[fit.samples] & fit.run.solved[fit.samples, None]).sum())


def is_white(problem: Problem, fit: Fit, blocks: np.ndarray) -> bool:
    """Return True where a whitened residual follows neither time, nor pose, nor any module's load.

    blocks (n,): labels of the fit's samples between two moves of the actuators.
    """
    channels = [column for column in fit.residual.T if np.any(column)]
    if not channels:
        return True
    together = blocks[1:] == blocks[:-1]
    tests = []
    for column in channels:
        if (
            together.any()
        ):  # neighbours in time: r_t r_t+1 has the variance of r^4 where they know nothing of each other
            products = (column[1:] * column[:-1])[together]
            size = float(np.sqrt((products**2).sum()))
            tests.append(2 * float(norm.sf(abs(products.sum()) / max(size, 1e-300))))
        names, which, counts = np.unique(blocks, return_inverse=True, return_counts=True)
        means = np.bincount(which, column) / np.sqrt(counts)
        if len(names) > 1:
            tests.append(float(chi_squared.sf((means**2).sum(), len(names))))
    curves = strongest_curve(problem, fit)
    tests += [float(chi_squared.sf(curve.gain, curve.degrees)) for curve in curves]
    return min(tests) * len(tests) > STRUCTURE_CHANCE


def noise_of_the_rest(problem: Problem, fit: Fit, blocks: np.ndarray) -> Noise | None:
    """Return the noise that a fit's residual has where it is noise alone but not of the size assumed, else None.

    blocks (n,): labels of the fit's samples.
    """
    exists = problem.measured.exists[fit.samples] & fit.run.solved[fit.samples, None]
    raw = problem.measured.residual(fit.run.position, fit.run.rotation)[fit.samples]
    count = int(exists.sum())
    if not count or fit.chi2 / count < chance_bound(count) ** 2:
        return None
    other = replace(
        problem.noise,
        position=_size(raw[:, :3], exists[:, :3], problem.noise.position),
        rotation=_size(raw[:, 3:], exists[:, 3:], problem.noise.rotation),
        source="estimated",
    )
    again = Problem(problem.simulator, problem.measured, other)
    return other if is_white(again, again.fit_at(fit.terms, fit.run), blocks) else None


def _size(raw: Array, exists: np.ndarray, fallback: float) -> float:
    return float(np.sqrt((raw[exists] ** 2).mean())) if exists.any() else fallback
