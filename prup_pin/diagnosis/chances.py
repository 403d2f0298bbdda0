"""Tails of the distributions by which a diagnosis decides, to the last digit those of scipy.stats.

Importing that takes longer than importing all that a diagnosis needs of scipy.
"""

from __future__ import annotations

import numpy as np
from scipy import special

from ..spatial import Array


def chi2_isf(chance: float, degrees: float) -> float:
    """Return what a chi squared of so many degrees exceeds by this chance."""
    return float(special.chdtri(degrees, chance))


def chi2_sf(value: float, degrees: float) -> float:
    """Return the chance by which a chi squared of so many degrees exceeds a value."""
    return float(special.chdtrc(degrees, max(value, 0.0))) if degrees > 0 else float("nan")


def chi2_median(degrees: float) -> float:
    """Return the median of a chi squared of so many degrees."""
    return float(2 * special.gammaincinv(degrees / 2, 0.5))


def hotelling_sf(x: Array, covariance: Array, degrees: int) -> float:
    """Return the chance of numbers x (p,) as large as these where their means are nothing (Hotelling 1931).

    covariance (p, p): estimated with so many degrees of freedom; combinations that it does not hold say nothing.
    """
    size = np.sqrt(np.maximum(np.diag(covariance), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(covariance / np.outer(size, size))
    told = values > np.sqrt(np.finfo(float).eps) * values[-1]
    count = min(int(told.sum()), degrees)
    square = float(np.sort((vectors[:, told].T @ (x / size)) ** 2 / values[told])[-count:].sum())
    rest = degrees - count + 1
    return float(special.fdtrc(count, rest, square * rest / (degrees * count)))


def normal_isf(chance: float) -> float:
    """Return what a standard normal number exceeds by this chance."""
    return float(-special.ndtri(chance))


def normal_sf(value: float) -> float:
    """Return the chance by which a standard normal number exceeds a value."""
    return float(special.ndtr(-value))


def normal_cdf(value: float) -> float:
    """Return the chance by which a standard normal number stays below a value."""
    return float(special.ndtr(value))


def normal_pdf(value: float) -> float:
    """Return the density of a standard normal number."""
    return float(np.exp(-(value**2) / 2.0) / np.sqrt(2 * np.pi))


#: Standard deviations within which 95 % of normal numbers lie, and one below which half of their sizes do.
WITHIN_95, WITHIN_HALF = normal_isf(0.025), normal_isf(0.25)


def robust_deviation(values: Array) -> float:
    """Return the standard deviation of normal numbers about zero by the middle of their sizes, whatever a few are."""
    return float(np.median(np.abs(values))) / WITHIN_HALF


def student_sf(value: float, degrees: float) -> float:
    """Return the chance by which Student's t of so many degrees exceeds a value."""
    return float(special.stdtr(degrees, -value))


def student_ppf(chance: float, degrees: float) -> float:
    """Return what Student's t of so many degrees stays below by this chance."""
    return float(special.stdtrit(degrees, chance))


def student_95(degrees: float) -> float:
    """Return the size that Student's t of so many degrees stays within by 95 %."""
    return student_ppf(0.975, degrees)
