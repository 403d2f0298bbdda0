"""What a rigid robot with some friction leaves of recorded efforts, a share of each joint's.

By it ways to read a log compete (`conventions.py`), and a log that is another robot's is told (`belongs.py`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from scipy.optimize import nnls

from ...dynamics import InMotion, Motion
from ...spatial import Array
from ..criteria import AS_GOOD, FEWEST_OF_KIND, MOSTLY, NEARLY
from ..thinning import evenly_spaced

#: Samples that are looked at.
_SAMPLES = 600


def sampled(at: InMotion, most: int = _SAMPLES) -> tuple[np.ndarray, Motion, Array]:
    """Return the places (n,) of some samples of a motion, the motion there, and its efforts (n, k) in their band."""
    rows = evenly_spaced(len(at), most)
    return rows, at.motion.select(rows), at.motion.band(at.motion.efforts, at.motion.piece)[rows]


def shares_of_efforts(motion: Motion, efforts: Array, rigid: Array, noise: Array | float = 0.0) -> Array:
    """Return the share of the squares of each effort (k,) that rigid ones and friction leave; NaN of one without any.

    noise (k,): of a sample of each, which is not counted: a wrist whose efforts are hardly more tells nothing.
    """
    shares = np.full(len(motion.driven), np.nan)
    alone = np.broadcast_to(noise, shares.shape) ** 2 * len(efforts)
    for column, name in enumerate(motion.driven):
        size = float(efforts[:, column] @ efforts[:, column])
        if size > 0:
            left = _norm_beyond_friction(motion, name, efforts[:, column] - rigid[:, column]) ** 2 - alone[column]
            shares[column] = min(max(left, 0.0) / size, 100.0)
    return shares


def rms(shares: Array) -> float:
    """Return the root of the mean of shares of squares (k,) that are known."""
    known = shares[~np.isnan(shares)]
    return float(np.sqrt(known.mean())) if len(known) else 0.0


def gains_of_efforts(motion: Motion, efforts: Array, rigid: Array, follows: float = MOSTLY) -> dict[str, float]:
    """Return by how much efforts are larger than the rigid robot's, of joints where they follow them or minus them.

    follows: the correlation without friction, of either sign, from which they do.
    """
    return {
        name: product / predicted
        for name, measured, predicted, product in _products_without_friction(motion, efforts, rigid)
        if measured * predicted > 0 and abs(product) > follows * np.sqrt(measured * predicted)
    }


def gains_apart(gains: dict[str, float]) -> bool:
    """Return whether no joint's effort is in the unit of the rigid robot's; gains: of each, whichever way it counts."""
    apart = np.abs(np.log(np.abs(list(gains.values()))))
    return not (len(gains) < FEWEST_OF_KIND or np.median(apart) < np.log(AS_GOOD) or apart.min() < np.log(NEARLY))


def in_another_unit(gain: float) -> bool:
    """Return whether a drive reports in another unit than the rigid robot's; gain: reported per true effort."""
    return bool(abs(np.log(abs(gain))) >= np.log(NEARLY))


def _products_without_friction(
    motion: Motion, efforts: Array, rigid: Array
) -> Iterator[tuple[str, float, float, float]]:
    """Yield of each joint the squares of its effort and of the rigid robot's, and their product, freed of friction."""
    for column, name in enumerate(motion.driven):
        own = _without_friction(motion, name, np.column_stack((efforts[:, column], rigid[:, column])))
        yield name, float(own[:, 0] @ own[:, 0]), float(own[:, 1] @ own[:, 1]), float(own[:, 0] @ own[:, 1])


def stacked(motion: Motion, efforts: Array, which: Sequence[int], columns: Array, missed: Array) -> tuple[Array, Array]:
    """Return columns (n, k, c) and what is missed (n, k) of some joints below each other, freed of friction, as shares
    of the joint's efforts.
    """
    sizes = np.linalg.norm(efforts, axis=0)
    parts = [
        _without_friction(motion, motion.driven[k], np.column_stack((columns[:, k], missed[:, k]))) / sizes[k]
        for k in which
        if sizes[k] > 0
    ]
    whole = np.concatenate(parts)
    return whole[:, :-1], whole[:, -1]


def tool_load_would_do(at: InMotion, gains: Mapping[str, float]) -> bool:
    """Return whether a body that the tool holds leaves no more of the efforts of joints than gains of those."""
    tool = at.mechanism.tool
    if tool is None or tool.joint == 0:
        return False
    rows, motion, efforts = sampled(at)
    rigid, held = at.rigid[rows], at.regressor[rows][:, :, tool.joint - 1]
    which = [at.driven.index(name) for name in gains]
    bodies, missed = stacked(motion, efforts, which, held, efforts - rigid)
    _, read = stacked(motion, efforts, which, held, efforts - rigid * [gains.get(name, 1.0) for name in at.driven])
    left = missed - bodies @ np.linalg.lstsq(bodies, missed, rcond=1e-9)[0]
    return float(left @ left) < float(read @ read)


def _norm_beyond_friction(motion: Motion, joint: str, values: Array) -> float:
    """Return how large values (n,) are that friction leaves at a joint, which takes energy and gives none."""
    if joint not in motion.names:
        return float(np.linalg.norm(values))
    return float(nnls(_friction(motion, joint), values)[1])


def _without_friction(motion: Motion, joint: str, values: Array) -> Array:
    """Return values (n, ...) freed of all that goes with friction at a joint, be it of either sign."""
    if joint not in motion.names:
        return values
    table = _friction(motion, joint)
    return values - table @ np.linalg.lstsq(table, values, rcond=1e-10)[0]


def _friction(motion: Motion, joint: str) -> Array:
    """Return dry and viscous friction of one unit at a joint (n, 2)."""
    column = motion.names.index(joint)
    speed = motion.speed[:, column]
    return np.column_stack((speed / np.hypot(speed, motion.slow[column]), speed))
