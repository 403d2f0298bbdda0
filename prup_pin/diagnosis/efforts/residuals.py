"""What is left of efforts: in multiples of their noise, and as shares of what was measured."""

from __future__ import annotations

import numpy as np

from ...spatial import Array
from .chosen import saved
from .outcome import Outcome

__all__ = ["residuals_of", "rms_of", "shares_of"]


def residuals_of(
    outcome: Outcome, added: Array, noise: Array, scale: Array
) -> tuple[dict[str, float], dict[str, float], dict[str, dict[str, float]]]:
    """Return the residual in multiples of the noise (k,) before and after, of all and by joint.

    Before: the rigid robot over `scale` (k,), the part of the drives' gains that the log is not read with. NaN where
    the noise is unknown. What is left above where it is judged counts as white noise does, at most: a motor that
    vibrates is none of the rigid robot's matter.
    """
    every, good = outcome.efforts.every, outcome.efforts.away_from_ends(outcome.motion.band.highest)
    told = outcome.motion.efforts - outcome.at.rigid / scale
    left = outcome.motion.efforts - outcome.at.rigid - added
    judged, piece = outcome.efforts.judged, outcome.motion.piece
    cutoffs = np.array(judged.cutoffs)
    white = np.zeros_like(noise) if outcome.motion.standing else np.maximum(1 - 2 * cutoffs / outcome.motion.rate, 0.0)
    squares = []
    for values in (told, left):
        inside = judged(values, piece)
        parts = [np.where(good, part[every], 0.0) for part in (inside, values - inside)]
        inner, outer = (np.square(part).sum(axis=0) / np.maximum(good.sum(axis=0), 1) / noise**2 for part in parts)
        squares.append(inner + np.minimum(outer, white))
    counts = good.sum(axis=0) * np.isfinite(noise)
    before, after = (_of_all(each, counts) for each in squares)
    by_joint = {
        name: {"before": float(np.sqrt(squares[0][k])), "after": float(np.sqrt(squares[1][k]))}
        for k, name in enumerate(outcome.at.driven)
    }
    return {"fit": before, "heldout": before}, {"fit": after, "heldout": after * _held_ratio(outcome)}, by_joint


def _of_all(squares: Array, counts: Array) -> float:
    """Return the root mean square of all joints' samples by the mean squares of each (k,), of so many samples (k,)."""
    known = counts > 0
    return float(np.sqrt(squares[known] @ counts[known] / counts[known].sum())) if known.any() else float("nan")


def _held_ratio(outcome: Outcome) -> float:
    """Return how much larger held-out blocks' residual is than the fitted one, root mean square."""
    fitted = float(saved(outcome.given, outcome.named, outcome.x_named).sum())
    return float(np.sqrt(max(outcome.held.sum() / max(fitted, np.finfo(float).tiny), 1.0)))


def shares_of(outcome: Outcome, rigid: Array, predicted: Array, held: Array) -> dict[str, dict[str, float]]:
    """Return what is left of each joint's effort below the cut-off, as a share of it, and of all together.

    rigid, predicted (n, k); held (n, k): where each block of time was not fitted.
    """
    efforts = outcome.efforts
    measured = efforts.measured[efforts.every] * outcome.scale
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
