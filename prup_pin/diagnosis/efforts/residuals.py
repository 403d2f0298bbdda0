"""What is left of efforts: in multiples of their noise, and as shares of what was measured."""

from __future__ import annotations

import numpy as np

from ...dynamics.smoothing import pieces
from ...spatial import Array
from .chosen import fit, saved
from .outcome import Outcome

__all__ = ["noise_of", "residuals_of", "rms_of", "shares_of"]

#: Kept samples at an end of a piece by which nothing is judged: somewhat more than a period of the cut-off.
_END = 3


def noise_of(outcome: Outcome, added: Array) -> tuple[Array, bool]:
    """Return the noise of each effort (k,) and whether it was declared; else what no curve takes away."""
    declared = outcome.recording.noise.effort
    if declared:
        return np.full(len(outcome.at.driven), declared) / outcome.scale, True
    x, _ = fit(outcome.given, outcome.chosen)
    rest = (outcome.motion.efforts - outcome.at.rigid - outcome.efforts.added(outcome.chosen, x))[outcome.efforts.every]
    sizes = [rms_of(rest[outcome.efforts.good[:, k], k]) for k in range(rest.shape[1])]
    return np.maximum(np.nan_to_num(sizes), np.finfo(float).tiny), False


def residuals_of(
    outcome: Outcome, added: Array, noise: Array
) -> tuple[dict[str, float], dict[str, float], dict[str, dict[str, float]]]:
    """Return the residual in multiples of the noise before and after, of all and by joint."""
    every, good = outcome.efforts.every, _settled(outcome)
    raw = (outcome.motion.efforts - outcome.at.rigid)[every]
    told = (outcome.motion.efforts - outcome.at.rigid / outcome.scale)[every]
    first, last = told / noise, (raw - added[every]) / noise
    ratio = _held_ratio(outcome)
    before = rms_of(first[good])
    after = rms_of(last[good])
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


def shares_of(outcome: Outcome, predicted: Array) -> dict[str, dict[str, float]]:
    """Return what is left of each joint's effort below the cut-off, as a share of it, and of all together."""
    efforts = outcome.efforts
    measured, rigid = efforts.measured[efforts.every] * outcome.scale, efforts.rigid[efforts.every]
    held = measured - efforts.held_out_residual(outcome.given, outcome.named) * outcome.scale
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
