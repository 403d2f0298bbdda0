"""Residuals of efforts: in multiples of their noise, as shares of what was measured, and against what drives them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from ...laws.efforts.effort_law import joint_unit
from ...laws.efforts.variables import VARIABLES, variable_of
from ...spatial import Array
from .diagnosis import EffortCurve
from .final_state import FinalState
from .problem import EffortCandidate, block_squares

#: Means that a curve is drawn through.
_BINS = 24


class EffortResiduals(NamedTuple):
    """Efforts (n, k) in the recording's unit at the kept samples: measured, as drawn and read so, predicted, and
    predicted where each block was not fitted; and the residual.

    before, after: root mean square in multiples of the noise, {'fit', 'heldout'}; by_joint: {'before', 'after'} of
    each; shares: of the measured effort of each joint and of 'all', {'rigid', 'fit', 'heldout'}.
    """

    measured: Array
    rigid: Array
    predicted: Array
    held_out: Array
    before: Mapping[str, float]
    after: Mapping[str, float]
    by_joint: Mapping[str, Mapping[str, float]]
    shares: Mapping[str, Mapping[str, float]]


def residuals_of(final: FinalState) -> EffortResiduals:
    """Return the efforts and residuals of a final state."""
    efforts, driven = final.efforts, final.at.driven
    measured, rigid = efforts.measured[efforts.kept] * final.scale, efforts.rigid[efforts.kept]
    predicted, rigid = (rigid + final.explained) * final.scale, rigid * final.read_scale
    held_out = measured - efforts.held_out_residual(final.model) * final.scale
    squares, counts = _squares_over_noise(final)
    before, after = (_root_mean(each, counts) for each in squares)
    by_joint = {
        name: {"before": float(np.sqrt(squares[0][k])), "after": float(np.sqrt(squares[1][k]))}
        for k, name in enumerate(driven)
    }
    fitted = float(block_squares(final.model, final.x).sum())
    ratio = float(np.sqrt(max(final.held_out.sum() / max(fitted, np.finfo(float).tiny), 1.0)))
    shares: dict[str, dict[str, float]] = {}
    columns = {name: [k] for k, name in enumerate(driven)}
    for name, where in {**columns, "all": list(range(len(driven)))}.items():
        good = efforts.good[:, where]
        size = max(rms_of(measured[:, where][good]), np.finfo(float).tiny)
        shares[name] = {
            key: rms_of((measured - values)[:, where][good]) / size
            for key, values in (("rigid", rigid), ("fit", predicted), ("heldout", held_out))
        }
    ends = {"fit": before, "heldout": before}, {"fit": after, "heldout": after * ratio}
    return EffortResiduals(measured, rigid, predicted, held_out, *ends, by_joint, shares)


def _squares_over_noise(final: FinalState) -> tuple[list[Array], Array]:
    """Return the mean squares (k,) of the residual over the noise, as drawn and fitted; and the samples of each (k,).

    NaN where the noise is unknown. Above the band where it is judged, the residual counts as white noise does, at most:
    a motor that vibrates is none of the rigid robot's matter.
    """
    motion, judged, noise = final.motion, final.efforts.judged, final.noise_sizes
    good = final.efforts.settled(judged)
    cutoffs = np.array(judged.cutoffs)
    white = np.zeros_like(noise) if motion.separate else np.maximum(1 - 2 * cutoffs / motion.rate, 0.0)
    squares = []
    unread = final.scale / final.read_scale  # drives' gains that stay in the log as it is read
    for values in (motion.efforts - final.at.rigid / unread, motion.efforts - final.at.rigid - final.added):
        inside = judged(values, motion.piece)
        parts = [np.where(good, part[final.efforts.kept], 0.0) for part in (inside, values - inside)]
        inner, outer = (np.square(part).sum(axis=0) / np.maximum(good.sum(axis=0), 1) / noise**2 for part in parts)
        squares.append(inner + np.minimum(outer, white))
    return squares, good.sum(axis=0) * np.isfinite(noise)


def _root_mean(squares: Array, counts: Array) -> float:
    """Return the root mean square of all joints' samples by mean squares (k,) of so many samples (k,)."""
    known = counts > 0
    return float(np.sqrt(squares[known] @ counts[known] / counts[known].sum())) if known.any() else float("nan")


def rms_of(values: Array) -> float:
    """Return the root mean square of values; NaN where there is none."""
    return float(np.sqrt(np.mean(values**2))) if np.size(values) else float("nan")


def curves_of(final: FinalState) -> Iterator[EffortCurve]:
    """Yield, for each finding that one variable drives, its effort and the residual against that variable."""
    efforts = final.efforts
    left = (efforts.measured[efforts.kept] - efforts.rigid[efforts.kept] - final.explained) * final.scale
    for term in (*final.laws, *final.curves):
        joint, curve, variable = term.place.name, term.law.is_curve, term.law.against
        if not variable or joint not in final.at.driven:
            continue
        column = final.at.driven.index(joint)
        good = efforts.good[:, column]
        own = np.zeros(len(left))
        if not term.is_of_time:
            own = _effort_of(final, term)[:, column] * final.scale[column]
        x = variable_of(final.at, joint, variable)[efforts.kept]
        drawn = _means(x[good], (left[:, column] + own)[good], None if curve or not own.any() else own[good])
        unit = joint_unit(VARIABLES[variable], joint, final.mechanism)
        physics = "" if curve else term.law.physics
        yield EffortCurve(joint, variable, *drawn, unit, final.units[column], physics)


def _effort_of(final: FinalState, term: EffortCandidate) -> Array:
    """Return the effort (n, k) of one term of the final model alone."""
    x, own = np.zeros_like(final.x), final.model.slice_of(term)
    x[own] = final.x[own]
    return final.efforts.at_kept(final.efforts.modelled(final.model, x)[0])


def _means(x: Array, y: Array, law: Array | None) -> tuple[Array, Array, Array, Array | None]:
    """Return means of neighbours by x, as many in each: of x, of y, its standard error, and of the law."""
    order = np.argsort(x, kind="stable")
    parts = [part for part in np.array_split(order, _BINS) if len(part) > 1]
    error = np.array([y[part].std(ddof=1) / np.sqrt(len(part)) for part in parts])
    means = [None if each is None else np.array([each[part].mean() for part in parts]) for each in (x, y, law)]
    return means[0], means[1], error, means[2]  # type: ignore[return-value]
