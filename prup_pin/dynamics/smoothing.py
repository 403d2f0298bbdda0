"""Zero-phase filters, piece by piece, and the frequency up to which a motion stands above its sensors' noise."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..spatial import Array

_ORDER = 4
#: Power above that of the sensor's noise at which a motion still counts.
_ABOVE_NOISE = 3.0
#: The noise is read off this band, as shares of half the rate: above it, filters of the logger and straight lines
#: between samples may have taken it away.
_NOISE_BAND = (0.25, 0.6)
_WINDOW = 4096
#: Periods of a cut-off that lie between an end of a piece and where its filter has settled.
_SETTLES = 1.5
#: What a motion does beyond an end of a piece is a polynomial through the last periods of a cut-off before it.
_CONTINUED, _DEGREE = 2.0, 4


def pieces(piece: np.ndarray) -> Iterator[slice]:
    """Yield one slice for every piece without a break; labels (N,) do not decrease."""
    starts = np.flatnonzero(np.diff(piece, prepend=-1))
    for start, end in zip(starts, [*starts[1:], len(piece)], strict=True):
        yield slice(int(start), int(end))


@dataclass(frozen=True)
class LowPass:
    """A Butterworth filter run forwards and backwards, so that it delays nothing; `cutoff` and `rate` in Hz.

    Beyond the ends of a piece values are those before them turned about the end itself: it is kept with all its noise,
    and bends by nothing there. of_motion: they go on as they went, along a polynomial of degree four through
    the last two periods of the cut-off, so that accelerations there are hardly worse than elsewhere; if the piece lasts
    as long, and these are more samples than the polynomial has coefficients: through as few it would follow the noise
    of each, and leave the motion by many times that.
    """

    cutoff: float
    rate: float
    of_motion: bool = False

    def __call__(self, values: Array, piece: np.ndarray) -> Array:
        """Return values (N, ...) without what is faster than the cut-off, each piece for itself."""
        from scipy.signal import sosfilt  # heavy; not needed to load a robot

        if self.cutoff >= 0.49 * self.rate:
            return np.array(values, float)
        sections, settled = _butterworth(self.cutoff, self.rate)
        rows = np.reshape(values, (len(values), -1)).T
        out = np.empty(rows.shape)
        longest = round(3 * self.rate / self.cutoff) + 3 * _ORDER
        for where in pieces(piece):
            here, padding = rows[:, where], min(longest, where.stop - where.start - 1)
            before, after = (self._beyond(own, padding) for own in (here, here[:, ::-1]))
            padded = np.concatenate((before[:, ::-1], here, after), axis=1)
            for _ in range(2):  # each time from a state in which the first value has lasted for ever
                padded = sosfilt(sections, padded, zi=settled * padded[:, :1])[0][:, ::-1]
            out[:, where] = padded[:, padding : padding + here.shape[1]]
        return out.T.reshape(np.shape(values))

    def _beyond(self, rows: Array, many: int) -> Array:
        """Return what values (r, n) are taken to be before the first one, `many` of them, the nearest one first."""
        window = round(_CONTINUED * self.rate / self.cutoff)
        if not self.of_motion or not rows.shape[1] >= window >= _DEGREE + 2:
            return 2 * rows[:, :1] - rows[:, 1 : many + 1]
        at = np.arange(-many, window) / window
        powers = np.polynomial.legendre.legvander(2 * at - 1, _DEGREE)
        fitted = np.linalg.lstsq(powers[many:], rows[:, :window].T, rcond=None)[0]
        return (powers[:many][::-1] @ fitted).T

    def settled(self, piece: np.ndarray) -> np.ndarray:
        """Return the samples (N,) away from ends of pieces, where filters and rates have no other side; else all.

        An end itself is kept with all its noise, and nobody knows what a late signal was before.
        """
        out = np.ones(len(piece), bool)
        if self.cutoff >= 0.49 * self.rate:
            return out
        end = int(np.ceil(_SETTLES * self.rate / self.cutoff))
        for where in pieces(piece):
            out[where.start : where.start + end] = out[max(where.stop - end, where.start) : where.stop] = False
        return out if out.any() else np.ones(len(piece), bool)


@lru_cache(maxsize=64)
def _butterworth(cutoff: float, rate: float) -> tuple[Array, Array]:
    """Return a filter's sections, (s, 6), and the state in which each has settled at one, (s, 1, 2)."""
    from scipy.signal import butter, sosfilt_zi

    sections = butter(_ORDER, cutoff, fs=rate, output="sos")
    return sections, sosfilt_zi(sections)[:, None]


@dataclass(frozen=True)
class Band:
    """Up to where the efforts of each driven joint are compared: `cutoffs` (k,) and `rate` in Hz."""

    cutoffs: tuple[float, ...]
    rate: float

    @property
    def highest(self) -> float:
        """The highest cut-off [Hz] of all joints."""
        return max(self.cutoffs)

    def of_joint(self, joint: int) -> LowPass:
        """Return the filter of one joint's efforts."""
        return LowPass(self.cutoffs[joint], self.rate)

    def settled(self, piece: np.ndarray) -> np.ndarray:
        """Return the samples (N, k) away from ends of pieces, by each joint's own filter."""
        return np.column_stack([self.of_joint(joint).settled(piece) for joint in range(len(self.cutoffs))])

    def __call__(self, values: Array, piece: np.ndarray) -> Array:
        """Return efforts (N, k, ...) filtered, measured and predicted ones alike, each piece for itself."""
        there, out = np.any(values, axis=0), np.zeros(np.shape(values))  # what is nothing throughout stays so
        for cutoff in sorted(set(self.cutoffs)):
            own = there & np.reshape(np.equal(self.cutoffs, cutoff), (-1, *(1,) * (there.ndim - 1)))
            if own.any():
                out[:, own] = LowPass(cutoff, self.rate)(values[:, own], piece)
        return out


def differences(values: Array, piece: np.ndarray, step: float) -> Array:
    """Return the rates of change of values (N, ...), each piece for itself: by parabolas at its ends, and else by
    polynomials of degree four, of which few rows a second take away less than straight lines from one to the next.
    """
    out = np.empty(np.shape(values))
    for where in pieces(piece):
        own = np.asarray(values[where], float)
        # twice by straight lines, and the acceleration at an end would be half of what it is
        rates = np.gradient(own, step, axis=0, edge_order=2 if len(own) > 2 else 1)
        if len(own) > 4:
            rates[2:-2] = (8 * (own[3:-1] - own[1:-3]) - (own[4:] - own[:-4])) / (12 * step)
        out[where] = rates
    return out


def spectrum(values: Array, piece: np.ndarray, rate: float) -> tuple[Array, Array]:
    """Return frequencies (f,) [Hz] and power densities (f,) of the longest piece; empty where it tells nothing."""
    from scipy import signal

    longest = max(pieces(piece), key=lambda where: where.stop - where.start, default=slice(0, 0))
    part = np.asarray(values[longest], float)
    if len(part) < 64 or not np.ptp(part) > 0:
        return np.zeros(0), np.zeros(0)
    return signal.welch(part, rate, nperseg=min(_WINDOW, len(part)), detrend="linear")


def floor_of(frequency: Array, power: Array, rate: float) -> float:
    """Return the power density of the noise that a spectrum ends in."""
    low, high = (share * rate / 2 for share in _NOISE_BAND)
    return float(np.median(power[(frequency > low) & (frequency < high)]))


def bandwidth(values: Array, piece: np.ndarray, rate: float) -> float:
    """Return the frequency [Hz] up to which a signal (N,) stands above the white noise of its sensor."""
    frequency, power = spectrum(values, piece, rate)
    if not len(frequency):
        return 0.0
    floor = floor_of(frequency, power, rate)
    if not floor > 0:
        return float(rate / 2)
    stands = by_bands(frequency, power) > _ABOVE_NOISE * floor
    if not stands.any():
        return 0.0
    # The first frequency that mostly noise follows: lines of a resonance far above the motion are not the motion.
    for index in range(int(np.argmax(stands)), len(stands)):
        octave = stands[index : max(2 * index, index + 2)]
        if not stands[index] and octave.mean() < 0.5:
            return float(frequency[index])
    return float(frequency[-1])


def by_bands(frequency: Array, power: Array) -> Array:
    """Return spectra (f, ...) averaged over a third of an octave about each frequency: one line counts little."""
    total = np.concatenate((np.zeros((1, *power.shape[1:])), np.cumsum(power, axis=0)))
    low = np.searchsorted(frequency, frequency / 2 ** (1 / 6))
    high = np.maximum(np.searchsorted(frequency, frequency * 2 ** (1 / 6), side="right"), low + 1)
    return (total[high] - total[low]) / (high - low).reshape(-1, *[1] * (power.ndim - 1))
