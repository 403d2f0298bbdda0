"""What is left of efforts: in multiples of their noise, and as shares of what was measured."""

from __future__ import annotations

import numpy as np

from ...dynamics.smoothing import pieces
from ...spatial import Array
from .chosen import saved
from .noise import EffortNoise, noise_of_efforts
from .outcome import Outcome

__all__ = ["noise_of", "residuals_of", "rms_of", "shares_of"]

#: Kept samples at an end of a piece by which nothing is judged: somewhat more than a period of the cut-off.
_END = 3


def noise_of(outcome: Outcome) -> dict[str, EffortNoise]:
    """Return the noise of a sample of each effort, as recorded: declared, or what the recording alone tells of it."""
    declared = outcome.recording.noise.effort
    if declared:
        return dict.fromkeys(outcome.at.driven, EffortNoise(declared, "declared", outcome.motion.rate))
    return noise_of_efforts(outcome.recording, outcome.at.driven)


def residuals_of(
    outcome: Outcome, added: Array, noise: Array
) -> tuple[dict[str, float], dict[str, float], dict[str, dict[str, float]]]:
    """Return the residual in multiples of the noise (k,) before and after, of all and by joint.

    NaN where the noise is unknown.
    """
    every, good = outcome.efforts.every, _settled(outcome)
    known = good & np.isfinite(noise)
    raw = (outcome.motion.efforts - outcome.at.rigid)[every]
    told = (outcome.motion.efforts - outcome.at.rigid / outcome.scale)[every]
    first, last = told / noise, (raw - added[every]) / noise
    ratio = _held_ratio(outcome)
    before = rms_of(first[known])
    after = rms_of(last[known])
    by_joint = {
        name: {"before": rms_of(first[good[:, k], k]), "after": rms_of(last[good[:, k], k])}
        for k, name in enumerate(outcome.at.driven)
    }
    return {"fit": before, "heldout": before}, {"fit": after, "heldout": after * ratio}, by_joint


def _settled(outcome: Outcome) -> np.ndarray:
    """Return the samples that count (n, k) but for those at ends of pieces, where filters and rates have no other
    side, and nobody knows what a signal that comes late was before."""
    good = outcome.efforts.good
    if outcome.motion.standing:
        return good
    inside = good.copy()
    for where in pieces(outcome.efforts.piece):
        inside[where.start : where.start + _END] = inside[max(where.stop - _END, where.start) : where.stop] = False
    return np.where(inside.any(axis=0), inside, good)


def _held_ratio(outcome: Outcome) -> float:
    """Return how much larger held-out blocks' residual is than the fitted one, root mean square."""
    fitted = float(saved(outcome.given, outcome.named, outcome.x_named).sum())
    return float(np.sqrt(max(outcome.held.sum() / max(fitted, np.finfo(float).tiny), 1.0)))


def shares_of(outcome: Outcome, predicted: Array, held: Array) -> dict[str, dict[str, float]]:
    """Return what is left of each joint's effort below the cut-off, as a share of it, and of all together.

    predicted (n, k); held (n, k): where each block of time was not fitted.
    """
    efforts = outcome.efforts
    measured, rigid = efforts.measured[efforts.every] * outcome.scale, efforts.rigid[efforts.every]
    out: dict[str, dict[str, float]] = {}
    columns = {name: [k] for k, name in enumerate(outcome.at.driven)}
    for name, where in {**columns, "all": list(range(measured.shape[1]))}.items():
        good = efforts.good[:, where]
        size = max(rms_of(measured[:, where][good]), np.finfo(float).tiny)
        out[name] = {
            key: rms_of((measured - values)[:, where][good]) / size
            for key, values in (("rigid", rigid), ("fit", predicted), ("heldout", held))
        }
    return out


def rms_of(values: Array) -> float:
    """Return the root mean square of values; NaN where there is none."""
    return float(np.sqrt(np.mean(values**2))) if np.size(values) else float("nan")
