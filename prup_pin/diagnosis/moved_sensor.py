"""Was the pose sensor moved while it measured? At which sample, by what two parts of a recording leave of a fit.

Two stations, one before a sample and one from it on, each free in six motions, leave least where the sensor was moved.
"""

from __future__ import annotations

import numpy as np

from ..spatial import Array
from .chances import chi2_isf
from .criteria import FALSE_ALARM, FEWEST_BLOCKS, LITTLE
from .problem import Fit, Problem


def moment_of_move(problem: Problem, fit: Fit, blocks: np.ndarray) -> float | None:
    """Return when the pose sensor was moved [s since the recording began], by what a fit leaves; None where it was not.

    Two places of the sensor must take away all but little of what is more than noise, and more than chance would.
    blocks (N,): samples held out together; each place has been seen in some of them.
    """
    samples, inputs = fit.samples, problem.simulator.inputs
    count, total = problem.count(fit), float((fit.residual**2).sum())
    labels = blocks[samples]
    starts = np.flatnonzero(np.diff(labels) != 0) + 1
    if len(starts) < 2 * FEWEST_BLOCKS or problem.stack.stations is not None or np.any(np.diff(inputs.time) < 0):
        return None
    motions = problem.whiteners(fit.influence) @ problem.stack.by_station(fit.run, samples)
    first, last = starts[FEWEST_BLOCKS - 1], starts[-FEWEST_BLOCKS]
    places = np.arange(first, last + 1)
    gains = _gains(motions, fit.residual, places)
    best = int(np.argmax(gains))
    if gains[best] < chi2_isf(FALSE_ALARM / len(places), 2 * motions.shape[-1]):
        return None
    if total - gains[best] > count + LITTLE * max(total - count, 0.0):
        return None
    return float(inputs.elapsed[samples[places[best]]])


def _gains(motions: Array, residual: Array, places: np.ndarray) -> Array:
    """Return what a station before each place and one from it on take off the squared residual, (m,)."""
    products = np.cumsum(motions.mT @ motions, axis=0)
    targets = np.cumsum((motions.mT @ residual[..., None])[..., 0], axis=0)
    gains = np.zeros(len(places))
    for product, target in (
        (products[places - 1], targets[places - 1]),
        (products[-1] - products[places - 1], targets[-1] - targets[places - 1]),
    ):
        gains += np.einsum("ni,nij,nj->n", target, np.linalg.pinv(product, rcond=1e-10, hermitian=True), target)
    return gains
