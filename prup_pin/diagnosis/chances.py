"""Tails of the distributions by which a diagnosis decides, to the last digit those of scipy.stats.

Importing that takes longer than importing all that a diagnosis needs of scipy.
"""

from __future__ import annotations

import numpy as np
from scipy import special

__all__ = [
    "chi2_isf",
    "chi2_median",
    "chi2_sf",
    "normal_cdf",
    "normal_isf",
    "normal_pdf",
    "normal_sf",
    "student_isf",
    "student_ppf",
]


def chi2_isf(chance: float, degrees: float) -> float:
    """Return what a chi squared of so many degrees exceeds by this chance."""
    return float(special.chdtri(degrees, chance))


def chi2_sf(value: float, degrees: float) -> float:
    """Return the chance by which a chi squared of so many degrees exceeds a value."""
    return float(special.chdtrc(degrees, max(value, 0.0))) if degrees > 0 else float("nan")


def chi2_median(degrees: float) -> float:
    """Return the median of a chi squared of so many degrees."""
    return float(2 * special.gammaincinv(degrees / 2, 0.5))


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


def student_isf(chance: float, degrees: float) -> float:
    """Return what Student's t of so many degrees exceeds by this chance."""
    return -float(special.stdtrit(degrees, chance))


def student_ppf(chance: float, degrees: float) -> float:
    """Return what Student's t of so many degrees stays below by this chance."""
    return float(special.stdtrit(degrees, chance))
