"""The noise of recorded efforts, by the column alone: without any model of the robot.

The residual of a fit is no noise: it holds all that the fit lacks, and divided by itself it is always one. But a
column of efforts shows its own noise whatever robot it moves. Bodies, springs and gears have inertia, so that their
efforts follow from what they were an instant before: what a long autoregression of the recorded column cannot foretell
came from elsewhere. The middle of it is taken, since friction turns round at once, but seldom. Where all joints stand,
nothing changes but noise, about what settles slowly. And a column of counts is off by a step over the root of twelve.
Each sees a part: innovations what is white, rest what is slower too, where there is any. The largest counts. Postures
one after the other foretell nothing; there it is rows that repeat the one before in all but their efforts.

Noise that lasts from sample to sample is more than its innovations, by the root of half the samples that it lasts: a
residual of a few multiples is no proof of anything missing. Logs at thousands of samples a second hold more noise than
what is compared below a few tens of hertz: there 1 is no promise either. So multiples never speak alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...dynamics import InMotion, at_limit, is_standing
from ...recordings import Recording
from ...recordings.recording import STANDSTILL
from ...spatial import Array
from ..chances import robust_deviation
from ..criteria import LITTLE, MOST

#: Samples from which the next one is foretold, and samples for each of them at least.
_ORDER, _FOR_EACH = 40, 10
#: Samples that are foretold, at most: they tell the size to a per cent.
_MOST = 20_000
#: What is so many times the usual innovation is a jump, as friction is that turns round: samples that it is among are
#: left out, and the others foretold again, as long as they are most of all: what comes more often is the noise.
_JUMP, _ROUNDS = 4.0, 4
#: Steps of the clock, in usual ones, over which nothing is foretold.
_GAP = 8.0
#: A joint stands where its speed over this time [s] is below this share of its usual one; and rests that last.
_REST, _SLOW = 0.25, 2e-3
#: Harmonics of a sawtooth that hold all but a thousandth of it.
_HARMONICS = 700


@dataclass(frozen=True)
class EffortNoise:
    """The noise of one sample of a recorded effort [N or N m], NaN where it is unknown, and the rate [Hz].

    how: it is known by 'innovations', 'rest', 'repeats', 'quantisation', 'declared'; '' where it is unknown. rounding:
    the part of it that follows the effort, and is as slow as that.
    """

    size: float
    how: str
    rate: float
    rounding: float = 0.0

    def below(self, frequency: float) -> float:
        """Return the noise below a frequency [Hz]: at rest it may be slow, and rounding is; the others are white."""
        share = 1.0 if self.how == "rest" else min(2 * frequency / self.rate, 1.0)
        slow = min(self.rounding, self.size) ** 2
        return float(np.sqrt(share * (self.size**2 - slow) + slow))


def true_sizes(noise: Mapping[str, EffortNoise], joints: Sequence[str], scale: Array) -> Array:
    """Return the noise of a sample of each joint's true effort (k,), by what is reported per true one, `scale` (k,).

    NaN of a joint of which nothing tells it.
    """
    return np.array([noise[name].size for name in joints]) / scale


def true_roundings(noise: Mapping[str, EffortNoise], joints: Sequence[str], scale: Array) -> Array:
    """Return the part of the same (k,) that follows the effort as a curve does: rounding to steps."""
    return np.array([min(noise[name].rounding, noise[name].size) for name in joints]) / scale


def noise_of(recording: Recording, at: InMotion) -> Mapping[str, EffortNoise]:
    """Return the noise of a recorded sample of each effort: declared, or by the recording alone."""
    found = noise_of_efforts(recording, at.driven)
    if declared := recording.noise.effort:
        return {name: EffortNoise(declared, "declared", at.motion.rate, own.rounding) for name, own in found.items()}
    return found


def noise_of_efforts(recording: Recording, joints: Sequence[str]) -> dict[str, EffortNoise]:
    """Return the noise of the recorded efforts of joints, by joint."""
    names = list(recording.positions)
    separate = recording.in_no_order(names) or is_standing(recording, names)
    still = _repeated(recording) if separate else _all_stand(recording)
    return {joint: _noise(recording, recording.efforts[joint], still, separate) for joint in joints}


def _noise(recording: Recording, effort: Array, still: np.ndarray, separate: bool) -> EffortNoise:
    effort = np.where(at_limit(effort), np.nan, effort)  # a drive at its limit scatters by nothing
    rows = _sampled(effort)
    parts = list(_parts(recording.time, recording.run, rows))
    steps = np.concatenate([np.diff(recording.time[part]) for part in parts]) if parts else np.ones(1)
    step = _step(effort[rows])
    sizes = {"quantisation": step / np.sqrt(12)}
    if separate:
        again = np.flatnonzero(still[1:]) + 1
        sizes["repeats"] = float(np.nanstd(effort[again] - effort[again - 1]) / np.sqrt(2)) if len(again) > 1 else 0.0
    else:
        sizes["innovations"] = _innovations([effort[part] for part in parts])
        sizes["rest"] = _at_rest(recording.time, effort, parts, still)
    how = max(sizes, key=lambda name: sizes[name])
    if not sizes[how] > 0:
        return EffortNoise(float("nan"), "", 1.0)
    rate = 1 / max(float(np.median(steps)), np.finfo(float).tiny)
    return EffortNoise(sizes[how], how, rate, rounding_that_follows(step, sizes[how]))


def rounding_that_follows(step: float, size: float) -> float:
    """Return the root mean square of what rounding to steps does to a slow value, beside noise of some size in all.

    The mean error of a value x is a sawtooth, of which noise s before rounding leaves the harmonics step / (pi k)
    exp(-2 (pi k s / step)^2) sin(2 pi k x / step): all of it, step / sqrt(12), where there is none, and next to nothing
    from half a step on (Widrow and Kollar, Quantization Noise, 2008, on Gaussian dither).
    """
    if not step > 0:
        return 0.0
    before = max(size**2 - step**2 / 12, 0.0)
    k = np.arange(1, _HARMONICS)
    return float(np.sqrt(((step / (np.pi * k) * np.exp(-2 * (np.pi * k / step) ** 2 * before)) ** 2).sum() / 2))


def encoder_step(recording: Recording, joint: str) -> float:
    """Return the least way [m, rad] that the recorded positions of a joint show: the step of one that rounds.

    By what their past does not foretell, as if all of that were rounding.
    """
    position = recording.positions[joint]
    rows = _sampled(position)
    return float(np.sqrt(12)) * _innovations([position[part] for part in _parts(recording.time, recording.run, rows)])


def _repeated(recording: Recording) -> np.ndarray:
    """Return the rows (N,) that hold the posture and the load of the row before."""
    table = np.column_stack([*recording.positions.values()])
    load = np.nan_to_num(recording.wrench)
    out = np.zeros(len(recording), bool)
    out[1:] = (np.abs(np.diff(table, axis=0)) < STANDSTILL).all(axis=1) & (np.diff(load, axis=0) == 0).all(axis=1)
    return out


def _sampled(values: Array) -> np.ndarray:
    """Return the rows (m,) at which a column was measured: not those that hold what was measured before."""
    known = np.flatnonzero(np.isfinite(values))
    changes = known[np.concatenate(([True], np.diff(values[known]) != 0))] if len(known) else known
    # it is sampled more slowly than rows come where all but a few of its values stand for two rows and more
    held = len(changes) > 2 and np.quantile(np.diff(changes), LITTLE) >= 2
    return changes if held else known


def _parts(time: Array, run: np.ndarray, rows: np.ndarray) -> Iterator[np.ndarray]:
    """Yield rows of each piece without a break."""
    if len(rows) < 2:
        return
    steps = np.diff(time[rows])
    breaks = (steps > _GAP * np.median(steps)) | (np.diff(run[rows]) != 0)
    yield from (part for part in np.split(rows, np.flatnonzero(breaks) + 1) if len(part) > 1)


def _innovations(parts: Sequence[Array]) -> float:
    """Return the size of innovations of an autoregression, of columns without a break."""
    count = sum(len(part) for part in parts)
    order = min(_ORDER, count // _FOR_EACH)
    parts = [part for part in parts if len(part) > order]
    if order < 1 or not parts:
        return 0.0
    middle = float(np.concatenate(parts).mean())
    parts = [part - middle for part in parts]
    quiet = [np.ones(len(part) - order, bool) for part in parts]
    size = float("inf")
    for _ in range(_ROUNDS):
        table = np.concatenate([_windows(part, own, order, count) for part, own in zip(parts, quiet, strict=True)])
        if len(table) < max(_FOR_EACH * order, MOST * min(count, _MOST)):
            break
        foretold = np.linalg.lstsq(table[:, :-1], table[:, -1], rcond=None)[0]
        filter_ = np.concatenate(([1.0], -foretold[::-1]))
        left = [np.convolve(part, filter_, "valid") for part in parts]
        now = _scatter(np.concatenate([each[own] for each, own in zip(left, quiet, strict=True)]), order)
        if not now < size:
            break
        size = now
        quiet = [_without_jumps(np.abs(each) > _JUMP * size, order) for each in left]
    return size if np.isfinite(size) else 0.0


def _windows(part: Array, counts: np.ndarray, order: int, count: int) -> Array:
    """Return samples (m, order + 1) with those before them, where they count; of all, no more than tell the size."""
    here = np.flatnonzero(counts)[:: max(1, count // _MOST)]
    return np.lib.stride_tricks.sliding_window_view(part, order + 1)[here]


def _without_jumps(jumps: np.ndarray, order: int) -> np.ndarray:
    """Return the samples (n,) with no jump among themselves and so many before them."""
    seen = np.concatenate((np.zeros(order + 1, int), np.cumsum(jumps)))
    return seen[order + 1 :] == seen[: len(jumps)]


def _at_rest(time: Array, effort: Array, parts: Sequence[np.ndarray], still: np.ndarray) -> float:
    """Return the scatter about straight lines where all joints stand."""
    left, lines = [], 0
    for part in parts:
        here = still[part]
        edges = np.flatnonzero(np.diff(np.concatenate(([0], here.astype(np.int8), [0]))))
        for start, end in edges.reshape(-1, 2):
            rows = part[start:end]
            inside = rows[(time[rows] > time[rows[0]] + _REST) & (time[rows] < time[rows[-1]] - _REST)]
            if len(inside) < 2 * _FOR_EACH or time[inside[-1]] - time[inside[0]] < 2 * _REST:
                continue
            lag = time[inside] - time[inside].mean()
            own = effort[inside] - effort[inside].mean()
            left.append(own - lag * (lag @ own) / (lag @ lag))
            lines += 2
    return _scatter(np.concatenate(left), lines) if left else 0.0


def _all_stand(recording: Recording) -> np.ndarray:
    """Return the rows (N,) in which every joint stands."""
    still = np.ones(len(recording), bool)
    table = np.column_stack([*recording.positions.values()])
    speed = np.zeros(table.shape)
    time = recording.time
    for rows in np.split(np.arange(len(time)), np.flatnonzero(np.diff(recording.run) != 0) + 1):
        own = time[rows]
        first = rows[np.searchsorted(own, own - _REST / 2)]
        last = rows[np.minimum(np.searchsorted(own, own + _REST / 2), len(own) - 1)]
        speed[rows] = np.abs(table[last] - table[first]) / np.maximum(time[last] - time[first], _REST / 2)[:, None]
    usual = np.sqrt(np.nanmean(speed**2, axis=0, where=np.isfinite(speed)))
    still &= ~(speed > _SLOW * usual).any(axis=1)
    return still


def _step(values: Array) -> float:
    """Return the step between the values of a column of counts; 0 where there is none that it keeps to."""
    levels = np.unique(values)
    if len(levels) < 2 or len(levels) > len(values) / 2:
        return 0.0
    return float(np.median(np.diff(levels)))


def _scatter(left: Array, fitted: int) -> float:
    """Return the standard deviation of residuals after so many coefficients were fitted, by their median."""
    free = np.sqrt(len(left) / max(len(left) - fitted, 1))
    return robust_deviation(left) * free
