"""How much the sensors scatter, where a recording does not declare it: what repeats of a load show."""

from __future__ import annotations

import numpy as np

from ..channels import Linear, Noise, PoseChannel, Stack
from ..laws import Inputs
from ..recordings import Recording
from ..spatial import Array, turn_between
from .chances import normal_cdf, normal_pdf
from .criteria import (
    CLIP,
    FEWEST_NUMBERS,
    MOST_REPEATS,
    SAME_LOAD,
    USUAL_POSITION_NOISE,
    USUAL_ROTATION_NOISE,
)

__all__ = ["estimate_noise", "scatter_of_repeats"]


#: What is left of the variance of normal numbers without the outliers.
_CLIPPED = 1 - 2 * CLIP * normal_pdf(CLIP) / (2 * normal_cdf(CLIP) - 1)


def estimate_noise(recording: Recording, stack: Stack, linear: Linear, inputs: Inputs, here: np.ndarray) -> Noise:
    """Return the declared noise, and that which repeats show where the recording declares none.

    here (N,): which samples of the stack are the recording's. What was not measured needs no declaration. Where nothing
    is declared and nothing repeats it is that of a good sensor, and its source "assumed".
    """
    declared = recording.noise
    position, rotation = declared.position, declared.rotation
    given = {"m": position, "rad": rotation}
    measured = {unit for _, unit, where in stack.groups() if stack.exists[here][:, where].any()}
    estimated = any(given[unit] is None for unit in measured) if measured else None in given.values()
    source = "estimated" if estimated else "declared"
    if position is None or rotation is None:
        seen = scatter_of_repeats(stack, linear, inputs, here)
        repeated = {"m": seen[0], "rad": seen[1]}
        if measured and all(given[unit] is None and repeated[unit] is None for unit in measured):
            source = "assumed"
        position = position if position is not None else seen[0] or USUAL_POSITION_NOISE
        rotation = rotation if rotation is not None else seen[1] or USUAL_ROTATION_NOISE
    assert position is not None
    assert rotation is not None
    force = declared.force if declared.force is not None else 0.0
    moment = declared.moment if declared.moment is not None else 0.0
    return Noise(position, rotation, force, moment, source)


def scatter_of_repeats(
    stack: Stack, linear: Linear, inputs: Inputs, here: np.ndarray
) -> tuple[float | None, float | None]:
    """Return the noise of position [m] and rotation [rad] by samples of one block under the same wrench.

    here (N,): the samples that are looked at. Their difference, less what the small difference of their wrenches
    explains, is noise times sqrt(2). None where too few repeat. Tool and markers are seen by one sensor.
    """
    first, second = _repeats(inputs, here)
    wrench = inputs.wrench
    moved: list[Array] = []
    turned: list[Array] = []
    for measured in stack.channels:
        both = measured.exists[first] & measured.exists[second]
        if not isinstance(measured, PoseChannel) or not both.any():
            continue
        apart = turn_between(measured.rotation[second], measured.rotation[first])
        change = np.concatenate((measured.position[first] - measured.position[second], apart), axis=1)
        compliance = np.nan_to_num(linear.compliance(measured.frame))
        change -= (compliance[first] @ (wrench[first] - wrench[second])[..., None])[..., 0]
        moved.append(change[:, :3][both[:, :3]])
        turned.append(change[:, 3:][both[:, 3:]])
    return _spread(np.concatenate([np.zeros(0), *moved])), _spread(np.concatenate([np.zeros(0), *turned]))


def _spread(values: Array) -> float | None:
    """Return the standard deviation of either of two numbers with these differences, outliers left out."""
    if len(values) < FEWEST_NUMBERS:
        return None
    robust = 1.4826 * float(np.median(np.abs(values)))
    for _ in range(5):  # a mean of squares without outliers says more than the median
        inside = np.abs(values) <= CLIP * robust
        robust = float(np.sqrt((values[inside] ** 2).mean() / _CLIPPED)) if inside.any() else robust
    return robust / np.sqrt(2) if robust > 0 else None


def _repeats(inputs: Inputs, here: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return pairs of samples of one block under wrenches that are one load, but for SAME_LOAD of the largest.

    And under one gravity: a base that is tilted is no repeat.
    """
    wrench, blocks = inputs.wrench[here], inputs.blocks
    size = np.abs(wrench[:, :3]).max(initial=0.0), np.abs(wrench[:, 3:]).max(initial=0.0)
    scale = np.array(3 * [max(size[0], 1e-9)] + 3 * [max(size[1], 1e-9)])
    first, second = [], []
    loads = inputs.wrench / scale
    if inputs.gravity is not None:
        heaviest = max(float(np.nan_to_num(np.abs(inputs.gravity)).max(initial=0.0)), 1e-9)
        loads = np.concatenate((loads, inputs.gravity / heaviest), axis=1)
    for block in np.unique(blocks[here]):
        members = np.flatnonzero((blocks == block) & here)[:MOST_REPEATS]
        scaled = loads[members]
        used: set[int] = set()
        for i in range(len(members)):
            if i in used:
                continue
            others = (j for j in range(i + 1, len(members)) if j not in used)
            near = [j for j in others if np.abs(scaled[i] - scaled[j]).max() < SAME_LOAD]
            if near:
                first.append(members[i])
                second.append(members[near[0]])
                used.update((i, near[0]))
    return np.array(first, int), np.array(second, int)
