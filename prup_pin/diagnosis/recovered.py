"""What a recording says of each finding's place, sample by sample: the deformation that it asks for, and the law's.

By duality a deformation of a module appears at the tool through the module's wrench Jacobian, so every measured pose
gives an estimate of it; means over neighbouring loads draw a curve through them that knows no law.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..channels import Columns, Noise
from ..laws import Effect
from ..laws.drawn import Drawn, against_component
from ..spatial import Array
from .criteria import MOST_BINS, NO_LOAD, NOT_REACHING, SAMPLES_A_BIN
from .fit import Fit, Problem
from .local_curve import LocalCurve

__all__ = ["Agreement", "Recovered", "Residuals", "recovered", "residuals"]


@dataclass(frozen=True, eq=False, repr=False)
class Recovered:
    """A finding as the recording shows it.

    x (n,): what drives it; y (n,): the deformation (torque, travel) that each sample asks for, with its standard
    deviation (n,); law (n,): what the named law gives, or None. `knots`, `curve`, `band` (k,): means over neighbours,
    a curve that knows no law, and their standard deviation. SI; `x_unit`, `y_unit`.
    """

    x: Array
    y: Array
    deviation: Array
    law: Array | None
    knots: Array
    curve: Array
    band: Array
    x_label: str
    y_label: str
    x_unit: str
    y_unit: str
    path: bool  # what happened before matters: the law is not one line
    blocks: np.ndarray  # (n,) labels of samples between two moves of the actuators


@dataclass(frozen=True, eq=False, repr=False)
class Agreement:
    """A finding that no single load drives: what the recording asks of each column (n, K), and the law's.

    [m, rad]; zero where nothing was measured. columns: in groups of one unit; noise: of position and rotation.
    """

    asked: Array
    law: Array
    columns: tuple[Columns, ...]
    noise: Noise


@dataclass(frozen=True, eq=False, repr=False)
class Residuals:
    """Residuals in multiples of the noise, (n, K), whitened; zero columns where nothing was measured."""

    before: Array
    after: Array
    exists: np.ndarray
    columns: tuple[Columns, ...]


def residuals(problem: Problem, fit: Fit, before: Array, after: Array) -> Residuals:
    """Return measured less simulated poses, (n, K) [m, rad] each, in multiples of the noise."""
    white, exists = _whitening(problem, fit)
    first, last = ((white @ values[..., None])[..., 0] for values in (before, after))
    return Residuals(first, last, exists, problem.stack.groups())


def recovered(
    problem: Problem, fit: Fit, after: Array, effect: Effect | None, curve: LocalCurve | None
) -> Recovered | Agreement | None:
    """Return what the recording shows of a finding: of an effect that the fit holds, or of an unknown one's curve.

    after (n, K): measured less simulated poses of the fit [m, rad]. None where neither is known.
    """
    influence = fit.influence
    white, exists = _whitening(problem, fit)
    asked, law, drawn = after, None, None
    if effect is not None:
        others = [term.effect for term in fit.terms if term.effect != effect]
        law = -influence.change(problem.simulator.setup(others))
        asked = asked + law
        drawn = effect.law.drawn(effect.place, influence.solved)
    elif curve is not None:
        drawn = against_component(influence.solved, curve.module, curve.component)
    if drawn is not None:
        given = None if law is None else (white @ law[..., None])[..., 0]
        blocks = problem.simulator.inputs.blocks[fit.samples]
        made = _estimate(
            drawn, problem.stack.seen(drawn.direction), white, (white @ asked[..., None])[..., 0], given, blocks
        )
        if made is not None:
            return made
    if law is None:
        return None
    columns = problem.stack.groups()
    return Agreement(np.where(exists, asked, 0.0), np.where(exists, law, 0.0), columns, problem.noise)


def _whitening(problem: Problem, fit: Fit) -> tuple[Array, np.ndarray]:
    """Return W (n, K, K) at the equilibria of the fit, and what was both measured and simulated, (n, K)."""
    exists = problem.stack.exists[fit.samples] & fit.run.solved[fit.samples, None]
    return problem.whiteners_at(fit.influence), exists


def _estimate(
    drawn: Drawn, direction: Array, white: Array, wanted: Array, given: Array | None, blocks: np.ndarray
) -> Recovered | None:
    """Return what each sample asks for along a direction, and means; None where they say nothing."""
    direction = (white @ direction[..., None])[..., 0]
    weight = (direction**2).sum(axis=1)
    good = (weight > NOT_REACHING * weight.max(initial=0.0)) & (weight > 0)
    if good.sum() < 3:
        return None
    x, along, weight = drawn.x[good], direction[good], weight[good]
    y = (along * wanted[good]).sum(axis=1) / weight
    law = None if given is None else (along * given[good]).sum(axis=1) / weight
    bins = _bins(x)
    if bins.max() < 1:
        return None
    total = np.bincount(bins, weight)
    knots, curve = (np.bincount(bins, weight * values) / total for values in (x, y))
    left = float((weight * (y - curve[bins]) ** 2).sum())
    if not float((weight * y**2).sum()) > left:
        return None  # a curve of means removes nothing
    band = np.sqrt(max(1.0, left / max(len(x) - len(knots), 1)) / total)
    labels, units = drawn.labels, drawn.units
    return Recovered(
        x, y, 1 / np.sqrt(weight), law, knots, curve, band, *labels, *units, drawn.path, blocks[good]
    )  # fmt: skip


def _bins(x: Array) -> np.ndarray:
    """Return (n,) numbers 0, 1, … of neighbouring samples: one for no load, quantiles on both sides of it."""
    reach = float(np.ptp(x))
    if not reach > 1e-9 * float(np.abs(x).max()):
        return np.zeros(len(x), int)
    sides = np.where(np.abs(x) < NO_LOAD * reach, 0, np.sign(x)).astype(int)
    bins, first = np.zeros(len(x), int), 0
    for side in (-1, 0, 1):
        rows = np.flatnonzero(sides == side)
        if not len(rows):
            continue
        count = 1 if side == 0 else int(np.clip(len(rows) // SAMPLES_A_BIN, 1, MOST_BINS))
        edges = np.quantile(x[rows], np.linspace(0, 1, count + 1)[1:-1])
        bins[rows] = first + np.searchsorted(np.unique(edges), x[rows], side="right")
        first = int(bins[rows].max()) + 1
    return np.unique(bins, return_inverse=True)[1].ravel()
