"""Was the pose sensor, or the target, moved while it measured? When, by what two parts of a recording leave of a fit.

Two places, one before a sample and one from it on, each free in six motions, leave least where it was moved.
"""

from __future__ import annotations

import numpy as np

from ..laws import Effect, Law
from ..spatial import Array
from .chances import chi2_isf
from .criteria import FALSE_ALARM, FEWEST_BLOCKS, LITTLE
from .problem import Fit, Problem


def moment_of_move(problem: Problem, fit: Fit, blocks: np.ndarray, law: Law) -> float | None:
    """Return when something was moved [s since the recording began], by what a fit leaves; None where it was not.

    law: what it does where it was moved before all. Two places of the sensor, or of the target, must take away all but
    little of what is more than noise, and more than chance would.
    blocks (N,): samples held out together; each place has been seen in some of them.
    """
    samples, inputs = fit.samples, problem.simulator.inputs
    count, total = problem.count(fit), float((fit.residual**2).sum())
    labels = blocks[samples]
    starts = np.flatnonzero(np.diff(labels) != 0) + 1
    if len(starts) < 2 * FEWEST_BLOCKS or problem.stack.stations is not None or np.any(np.diff(inputs.time) < 0):
        return None
    motions = _motions(problem, fit, law)
    first, last = starts[FEWEST_BLOCKS - 1], starts[-FEWEST_BLOCKS]
    places = np.arange(first, last + 1)
    gains = _gains(motions, fit.residual, places)
    best = int(np.argmax(gains))
    if gains[best] < chi2_isf(FALSE_ALARM / len(places), 2 * motions.shape[-1]):
        return None
    if total - gains[best] > count + LITTLE * max(total - count, 0.0):
        return None
    return float(inputs.elapsed[samples[places[best]]])


def _motions(problem: Problem, fit: Fit, law: Law) -> Array:
    """Return the whitened change of the columns (n, K, p) per unit of each parameter of a law."""
    (place, *_), nothing = law.places(problem.simulator.robot.mechanism), dict(law.neutral)
    found = []
    for quantity in law.quantities:
        effect = Effect(law, place, {**nothing, quantity.name: quantity.typical})
        found.append(problem.change(fit, [*fit.effects, effect]) / quantity.typical)
    return np.stack(found, axis=-1)


def _gains(motions: Array, residual: Array, places: np.ndarray) -> Array:
    """Return what motions before each place and others from it on take off the squared residual, (m,)."""
    products = np.cumsum(motions.mT @ motions, axis=0)
    targets = np.cumsum((motions.mT @ residual[..., None])[..., 0], axis=0)
    gains = np.zeros(len(places))
    for product, target in (
        (products[places - 1], targets[places - 1]),
        (products[-1] - products[places - 1], targets[-1] - targets[places - 1]),
    ):
        gains += np.einsum("ni,nij,nj->n", target, np.linalg.pinv(product, rcond=1e-10, hermitian=True), target)
    return gains
