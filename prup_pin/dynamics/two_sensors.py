"""A rate of change that was logged beside what changes: two measurements of one motion, each with noise and delay.

What was logged may come late, filtered or in counts; positions may be coarse, and their stamps may jitter. The delay
and the filter are those by which both agree best. Of what is left each sensor has its own part, and at each frequency
that mean of both is the likeliest rate which has the least power: what both have in common is the motion, and is in any
mean. A logged rate that has little in common with what moved is none of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..spatial import Array
from .smoothing import LowPass, bandwidth, by_bands, differences, pieces

#: Delay and filter are told by what is slower than the fastest of both that stands above its noise, and than this [Hz].
_SLOWEST = 10.0
#: Both agree at first order in a delay: rounds until it is found, and the longest that is looked for [s].
_ROUNDS, _LATEST = 6, 0.05
#: What takes away less than this share of the squares of their difference is nothing.
_GAIN = 0.02
#: What was logged is of something else, or dead, where less than this share of it is in what moved.
_OWN = 0.5
#: Samples of a window in which the powers of both are compared, and the fewest in which they are.
_WINDOW, _FEWEST = 1024, 64


@dataclass(frozen=True, eq=False)
class Rate:
    """The likelier rate (N,) of what changes; delay [s]: by how much later what was logged of it came."""

    values: Array
    delay: float = 0.0


def likelier_rate(
    values: Array, logged: Array, piece: np.ndarray, rate: float, every: tuple[int, int] = (1, 1)
) -> Rate:
    """Return the likelier rate of values (N,) whose rate was logged too (N,), at `rate` samples a second.

    every: of how many samples each was measured at one, the others drawn through these.
    """
    if not np.ptp(values) > 0 or not np.ptp(logged) > 0:
        return Rate(logged)
    # straight lines from row to row hear less of what is faster than the motion, and of both sensors alike
    moved = np.concatenate([np.gradient(values[where], 1 / rate) for where in pieces(piece)])
    band = min(max(_SLOWEST, min(bandwidth(values, piece, rate), bandwidth(logged, piece, rate))), 0.2 * rate)
    told, delay = _in_step(moved, logged, piece, rate, band)
    low = LowPass(band, rate)
    ours, theirs = low(moved, piece), low(told, piece)
    if float(ours @ theirs) < _OWN * float(theirs @ theirs):
        return Rate(differences(values, piece, 1 / rate))
    apart = moved - _as_differences_see(told, piece)
    frequency, share = _shares(apart, told, piece, rate)
    if not len(frequency):
        return Rate(told, delay)
    # what is drawn through samples says nothing of what is faster than they
    fastest_moved, fastest_told = (rate / (2 * own) for own in every)
    share = np.where(frequency > fastest_told, 1.0, share)
    share = np.where(frequency > fastest_moved, 0.0, share)
    return Rate(told + _filtered(apart, piece, rate, frequency, share), delay)


def _in_step(moved: Array, logged: Array, piece: np.ndarray, rate: float, band: float) -> tuple[Array, float]:
    """Return what was logged (N,) without its delay and its filter, and the delay [s] against what moved.

    In a band [Hz]: what a filter does there is a delay, and less of what bends: told = logged + c times its second
    derivative.
    """
    low = LowPass(band, rate)
    inside, ours = low.settled(piece), low(moved, piece)

    def apart(told: Array) -> Array:
        return np.asarray((ours - _as_differences_see(told, piece))[inside])

    def left(told: Array) -> float:
        return float(np.sum(apart(told) ** 2))

    def by(told: Array, change: Array) -> float:
        size = float(change[inside] @ change[inside])
        return float(apart(told) @ change[inside]) / size if size > 0 else 0.0

    delay, told = 0.0, low(logged, piece)
    before = left(told)
    for _ in range(_ROUNDS):
        delay += by(told, differences(told, piece, 1 / rate))
        if abs(delay) > _LATEST:
            break
        told = low(_earlier(logged, piece, delay * rate), piece)
    if abs(delay) > _LATEST or left(told) > (1 - _GAIN) * before:
        delay, told = 0.0, low(logged, piece)
    out = _earlier(logged, piece, delay * rate)
    bent = differences(differences(told, piece, 1 / rate), piece, 1 / rate)
    less = min(by(told, bent), 0.0)  # a filter takes away from what is fast
    return (out + less * bent, delay) if left(told + less * bent) < (1 - _GAIN) * left(told) else (out, delay)


def _earlier(values: Array, piece: np.ndarray, by: float) -> Array:
    """Return values (N,) as they were `by` samples earlier, by cubic splines; an end lasts."""
    from scipy.interpolate import CubicSpline  # heavy; not needed to load a robot

    if by == 0:
        return np.array(values)
    out = np.empty(len(values))
    for where in pieces(piece):
        at = np.arange(where.stop - where.start, dtype=float)
        out[where] = CubicSpline(at, values[where])(np.clip(at + by, 0, at[-1])) if len(at) > 3 else values[where]
    return out


def _as_differences_see(rates: Array, piece: np.ndarray) -> Array:
    """Return rates (N,) as central differences see them: their mean over two steps, by Simpson's rule."""
    out = np.array(rates)
    for where in pieces(piece):
        own = rates[where]
        out[where][1:-1] = (own[:-2] + 4 * own[1:-1] + own[2:]) / 6
        out[where][[0, -1]] = (own[[0, -1]] + own[[1, -2]]) / 2
    return out


def _shares(apart: Array, told: Array, piece: np.ndarray, rate: float) -> tuple[Array, Array]:
    """Return frequencies (f,) [Hz] and the share (f,) by which told + share apart has the least power."""
    from scipy import signal  # heavy; not needed to load a robot

    longest = max(pieces(piece), key=lambda where: where.stop - where.start, default=slice(0, 0))
    apart, told = apart[longest], told[longest]
    if len(told) < _FEWEST:
        return np.zeros(0), np.zeros(0)
    window = {"nperseg": min(_WINDOW, len(told)), "detrend": "linear"}
    frequency, power = signal.welch(apart, rate, **window)
    common = -signal.csd(told, apart, rate, **window)[1].real
    power, common = by_bands(frequency, power), by_bands(frequency, common)
    return frequency, np.clip(common / np.maximum(power, np.finfo(float).tiny), 0.0, 1.0)


def _filtered(values: Array, piece: np.ndarray, rate: float, frequency: Array, share: Array) -> Array:
    """Return a share (f,) of values (N,) at each frequency (f,), nothing delayed; a piece is mirrored at its ends."""
    out = np.empty(len(values))
    for where in pieces(piece):
        own = values[where]
        mirrored = np.pad(own, len(own) - 1, "reflect") if len(own) > 1 else own
        spectral = np.fft.rfft(mirrored)
        spectral *= np.interp(np.fft.rfftfreq(len(mirrored), 1 / rate), frequency, share)
        out[where] = np.fft.irfft(spectral, len(mirrored))[len(own) - 1 : 2 * len(own) - 1]
    return out
