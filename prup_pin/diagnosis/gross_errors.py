"""Gross errors: what was measured so far off that no machine of this kind explains it.

Numbers that no such machine explains weigh little while nothing is known (Student's t; Lange, Little and Taylor, J. Am.
Stat. Assoc. 84, 1989), and gross ones are left out, but for those that are shared by neighbours in posture: these are a
machine's own ways.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..channels import Stack
from ..numbers import counted, quantity
from ..recordings import Together
from ..spatial import Array
from .chances import chi2_isf, chi2_median
from .criteria import APART, FAR_LESS, LITTLE, MOST_LISTED, NO_MATTER, OUTLIER
from .problem import Fit, Problem
from .variance_components import UNITS, of_groups

#: Neighbours in posture that share what is a machine's own.
_NEIGHBOURS = 2


@dataclass(frozen=True)
class Outlier:
    """A position or orientation that no machine of this kind explains.

    sample, from 0; channel, as its columns are named; distance in multiples of the noise, and `by` in `unit`, m or rad.
    exchanged: the channel whose numbers stand in its place, as its own stand in that one's.
    """

    sample: int
    channel: str
    distance: float
    by: float
    unit: str
    exchanged: str = ""

    @property
    def size(self) -> str:
        """By how much, for people."""
        return quantity(self.by, self.unit)


def gross_errors(problem: Problem, distances: Array, rest: Array, variances: Array) -> list[Outlier]:
    """Return what lies too far off: distances (N, groups), squared, and what is left (N, K), by the noise.

    variances (u,): of that noise, by unit.
    """
    found = []
    stack, noise = problem.stack, problem.noise
    scatter = np.sqrt(of_groups(stack, variances))
    for index, group in enumerate(stack.groups()):
        here = distances[:, index]
        known = np.isfinite(here)
        if not known.any():
            continue
        far, size = far_off(here)
        inputs = problem.simulator.inputs
        off = np.where(known[:, None], rest[:, group.where] / (scatter[index] * np.sqrt(size)), np.nan)
        far &= ~_shared(far, off, inputs.actuators, inputs.blocks)
        unit = noise.of_unit(group.unit) * scatter[index]
        for sample in np.flatnonzero(far):
            by = float(np.sqrt(here[sample]))
            found.append(Outlier(int(sample), group.name, by / np.sqrt(size), by * unit, group.unit))
    sizes = [group.where.stop - group.where.start for group in stack.groups()]
    return _exchanged(found, rest / np.repeat(scatter, sizes), stack)


def gross_errors_left(problem: Problem, fit: Fit) -> list[Outlier]:
    """Return the gross errors that a fit leaves."""
    stack, rows = problem.stack, fit.samples
    seen = problem.compared(fit.run)
    rest = np.full(stack.exists.shape, np.nan)
    rest[rows] = np.where(seen, stack.residual(fit.run)[rows] / stack.deviation(problem.noise), np.nan)
    distances = np.stack([(rest[:, group.where] ** 2).sum(axis=1) for group in stack.groups()], axis=1)
    return gross_errors(problem, distances, rest, np.ones(len(UNITS)))


def are_few(outliers: Sequence[Outlier], stack: Stack) -> bool:
    """Return whether there are outliers, in no more samples than a few: where more are far off, laws are missing."""
    return 0 < len({item.sample for item in outliers}) <= NO_MATTER * int(stack.exists.any(axis=1).sum())


def far_off(squares: Array) -> tuple[np.ndarray, float]:
    """Return which of squared distances (N,) of three numbers each are gross, and the variance of one number.

    The variance is that of the middle half. Where more than a few lie far off by it, they scatter more widely than that
    half says: then it is that of all but the largest share that may be gross. NaN where nothing was measured.
    """
    known = np.isfinite(squares)
    size = float(np.median(squares[known])) / chi2_median(3)
    far = known & (squares > OUTLIER**2 * size)
    if far.sum() > LITTLE * known.sum() and not _stand_apart(squares[known], far[known]):
        size = float(np.quantile(squares[known], 1 - LITTLE)) / chi2_isf(LITTLE, 3)
        far = known & (squares > OUTLIER**2 * size)
    return far, size


def _stand_apart(squares: Array, far: np.ndarray) -> bool:
    """Return True where those that are far off, by squares of distances (n,), leave a gap to all others."""
    most = far.sum() <= FAR_LESS * len(far)
    return bool(most and squares[far].min() > APART**2 * squares[~far].max())


def _shared(far: np.ndarray, off: Array, actuators: Array, blocks: np.ndarray) -> np.ndarray:
    """Return which samples that are `far` off (N,) are so with their neighbours in posture, (N,): a machine's own ways.

    A gross error is nobody else's: both postures nearest to it, by what the actuators move in all, are not off the same
    way, but for those that follow each other, as a sensor slips for a while. off (N, k): by how much, in multiples of
    the noise, NaN where nothing was measured; actuators (N, a).
    """
    found = np.zeros(len(far), bool)
    known = np.isfinite(off).all(axis=1)
    stretch = np.zeros(len(far), int)
    stretch[known] = np.cumsum(np.diff(far[known], prepend=False))
    scaled = actuators / np.maximum(actuators[known].std(axis=0), 1e-12)
    for sample in np.flatnonzero(far & known):
        others = np.flatnonzero(known & (blocks != blocks[sample]) & (stretch != stretch[sample]))
        apart = ((scaled[others] - scaled[sample]) ** 2).sum(axis=1)
        near = others[np.argsort(apart, kind="stable")[:_NEIGHBOURS]]
        along = off[near] @ off[sample] / np.linalg.norm(off[sample])
        found[sample] = len(near) == _NEIGHBOURS and bool((along > OUTLIER / 2).all())
    return found


def _exchanged(found: Sequence[Outlier], rest: Array, stack: Stack) -> list[Outlier]:
    """Return outliers, those told of another channel that have its place: what is left of both cancels, (N, K)."""
    where, out = _columns(stack), list(found)
    for index, item in enumerate(found):
        for other in found:
            if other.sample == item.sample and other.unit == item.unit and other.channel != item.channel:
                both = rest[item.sample, where[item.channel]] + rest[item.sample, where[other.channel]]
                if both @ both < 2 * OUTLIER**2:
                    out[index] = replace(item, exchanged=other.channel)
    return out


def without_outliers(exists: np.ndarray, outliers: Sequence[Outlier], stack: Stack) -> np.ndarray:
    """Return what was measured (N, K) without outliers."""
    out, where = exists.copy(), _columns(stack)
    for item in outliers:
        out[item.sample, where[item.channel]] = False
    return out


def outliers_told(outliers: Sequence[Outlier], together: Together, load: str = "") -> Iterator[str]:
    """Yield sentences for people on outliers that were left out; load: unrecorded, it
    leaves them behind.
    """
    if not outliers:
        return

    def line(sample: int, more: str = "") -> str:
        return together.told(together.sources[together.which[sample]], f"line {together.rows[sample] + 2}{more}")

    def listed(lines: Sequence[str]) -> str:
        return ", ".join(lines[:MOST_LISTED]) + (", …" if len(lines) > MOST_LISTED else "")

    worst = sorted(outliers, key=lambda item: -item.distance)
    there = listed([line(item.sample, f" ({item.channel}, {item.size} off)") for item in worst])
    if load:
        yield (
            f"left out are {counted(len({item.sample for item in worst}), 'sample')} that lie where {load} at the tool "
            "move the robot, and no load was recorded: give it in columns w.fx … w.mz, with 0 where there was none: "
            f"{there}"
        )
    else:
        yield (
            f"left out {'are' if len(worst) > 1 else 'is'} {counted(len(worst), 'gross error')}, which all "
            f"other samples contradict: {there}"
        )
    pairs = dict.fromkeys((item.channel, item.exchanged) for item in outliers if item.exchanged)
    for one, other in (pair for pair in pairs if pair[0] < pair[1]):
        here = [item.sample for item in outliers if (item.channel, item.exchanged) == (one, other)]
        yield (
            f"{one} and {other} are exchanged in {listed([line(sample) for sample in here])}: each has the other's "
            "numbers there. Put them right, or leave them out"
        )


def _columns(stack: Stack) -> dict[str, slice]:
    """Return the columns of each channel by its name."""
    return {group.name: group.where for group in stack.groups()}
