"""Laws that remember: joints that stick and slip, dampers, parts that creep.

The equilibrium is solved for all samples at once with given resistances; the histories are then followed in time with
the equilibria's own derivatives, and both are repeated until they agree. What is remembered after the last sample can
be handed on, so that a long history may be followed in parts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ..laws import Creep, Resistance
from ..spatial import Array

__all__ = ["Crept", "Memory", "Resisted", "creep_strains", "resisted"]

_SWEEPS = 60


class Resisted(NamedTuple):
    """What joints remember after a sample of a block: where each slid to, where it stood, its torque (r,), the time."""

    block: int
    slid: Array
    last: Array
    time: float
    torque: Array


class Crept(NamedTuple):
    """What a module remembers after a sample: the time, its elastic deformation and what it has crept, (k,)."""

    time: float
    elastic: Array
    extent: Array


@dataclass(frozen=True)
class Memory:
    """What all laws that remember hold after a sample; `crept` by their order and module."""

    resisted: Resisted | None = None
    crept: Mapping[str, Crept] = field(default_factory=dict)


def resisted(
    resistances: Sequence[Resistance],
    displacement: Array,
    torque: Array,
    influence: Array,
    blocks: np.ndarray,
    time: Array,
    memory: Resisted | None = None,
) -> tuple[Array, Resisted | None]:
    """Return the resisting torques (N, r) that agree with the joints' history, and what is remembered after it.

    displacement (N, r) of the joints at the present `torque` (N, r); influence (N, r, r) is d(displacement)/d(torque);
    `memory`: what is remembered before the first sample. A joint starts each block of samples relaxed, where it stands
    under the load of the first one. Blocks know nothing of each other: they are followed side by side.
    """
    out = np.zeros_like(torque)
    if not len(time):
        return out, memory
    limit = np.array([item.limit for item in resistances])
    stiffness = np.array([item.stiffness for item in resistances])
    damping = np.array([item.damping for item in resistances])
    reach = limit / np.where(stiffness > 0, stiffness, 1.0)
    free = displacement - (influence @ torque[..., None])[..., 0]  # where the joints would be without resistance
    starts = np.flatnonzero(np.concatenate(([True], blocks[1:] != blocks[:-1])))
    lengths = np.diff(np.append(starts, len(time)))
    shape = (len(starts), len(resistances))
    slid, last, now, before = free[starts], free[starts], np.zeros(shape), np.full(len(starts), np.nan)
    if memory is not None and memory.block == blocks[0]:
        slid[0], last[0], now[0], before[0] = memory.slid, memory.last, memory.torque, memory.time
    for sample in range(int(lengths.max())):
        here = np.flatnonzero(lengths > sample)
        rows = starts[here] + sample
        elapsed = time[rows] - before[here]
        rate = np.where(np.isnan(elapsed), 0.0, 1.0 / np.maximum(elapsed, 1e-9))
        value, x = _balanced(
            free[rows], influence[rows], now[here], slid[here], last[here], stiffness, limit, damping * rate[:, None]
        )
        held = np.clip(slid[here], x - reach, x + reach)
        slid[here] = np.where(stiffness > 0, held, slid[here])
        last[here], now[here], before[here] = x, value, time[rows]
        out[rows] = value
    return out, Resisted(int(blocks[-1]), slid[-1], last[-1], float(before[-1]), now[-1])


def _balanced(free, influence, torque, slid, last, stiffness, limit, viscous) -> tuple[Array, Array]:
    """Return torques (b, r) and displacements (b, r) of joints that agree with each other, by Gauss-Seidel sweeps.

    torque = viscous (x - last) + clip(stiffness (x - slid), +-limit), x = free + influence torque.
    """
    count = len(stiffness)
    if count == 1:
        return _balanced_alone(free, influence[:, 0], slid, last, stiffness[0], limit[0], viscous)
    torque = torque.copy()
    for _ in range(_SWEEPS):
        old = torque.copy()
        for j in range(count):
            own = influence[:, j, j]
            apart = free[:, j] + (influence[:, j] * torque).sum(1) - own * torque[:, j]  # without its own resistance
            damped = viscous[:, j] * (apart - last[:, j])
            value = (damped + stiffness[j] * (apart - slid[:, j])) / (1 - own * (viscous[:, j] + stiffness[j]))
            stretched = stiffness[j] * (apart + own * value - slid[:, j])
            sliding = (np.abs(stretched) > limit[j]) & (stiffness[j] > 0)
            limited = (damped + np.sign(stretched) * limit[j]) / (1 - own * viscous[:, j])
            torque[:, j] = np.where(sliding, limited, value)
        if np.abs(torque - old).max(initial=0.0) <= 1e-12 * (np.abs(torque).max(initial=0.0) + 1e-12):
            break
    return torque, free + (influence @ torque[..., None])[..., 0]


def _balanced_alone(free, own, slid, last, stiffness, limit, viscous) -> tuple[Array, Array]:
    """Return the same of a single joint, whose torque nothing else moves; all (b, 1)."""
    damped = viscous * (free - last)
    torque = (damped + stiffness * (free - slid)) / (1 - own * (viscous + stiffness))
    if stiffness > 0:
        stretched = stiffness * (free + own * torque - slid)
        sliding = np.abs(stretched) > limit
        if sliding.any():
            limited = (damped + np.copysign(limit, stretched)) / (1 - own * viscous)
            torque = np.where(sliding, limited, torque)
    return torque, free + own * torque


def creep_strains(creep: Creep, elastic: Array, time: Array, run: np.ndarray, memory: Crept | None = None) -> Array:
    """Return what a module has crept (N, k), given its elastic deformation (N, k), held since the sample before.

    tau de/dt + e = share * elastic, at rest at the start of each run; with `memory`, the first run goes on from there.
    """
    if memory is not None:
        longer = np.vstack((memory.elastic[None], elastic))
        return _crept(creep, longer, np.append(memory.time, time), np.append(run[:1], run), memory.extent)[1:]
    return _crept(creep, elastic, time, run, 0.0)


def _crept(creep: Creep, elastic: Array, time: Array, run: np.ndarray, first: Array | float) -> Array:
    out = np.zeros_like(elastic)
    out[:1] = first
    target = np.zeros_like(elastic)
    target[:, creep.components] = creep.share * elastic[:, creep.components]
    decays = np.exp(-np.maximum(np.diff(time), 0.0) / creep.time_constant)  # a new run may start earlier
    even = len(decays) > 0 and float(np.ptp(decays)) < 1e-9 * (1 - float(decays[0])) and not np.any(run != run[0])
    if even:
        from scipy.signal import lfilter  # its import takes longer than that of all the rest

        decay = float(decays.mean())
        out[1:] = lfilter([1 - decay], [1, -decay], target[1:], axis=0, zi=decay * out[:1])[0]
        return out
    for sample in range(1, len(time)):
        if run[sample] != run[sample - 1]:
            continue
        decay = decays[sample - 1]
        out[sample] = decay * out[sample - 1] + (1 - decay) * target[sample]
    return out
