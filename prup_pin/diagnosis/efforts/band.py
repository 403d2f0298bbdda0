"""Up to which frequency a joint's efforts can be compared with a rigid robot's.

What encoders see is the rigid robot's motion plus an error of its own: noise, counts and jitter at all frequencies, and
motors that vibrate against gears that yield above some. Inverse dynamics differentiate it twice, so that the predicted
effort holds more and more of it, and efforts may have passed a filter that nobody logged. Let p be what bodies and
rotors need for the motion, m the measured effort less friction, and S_m, S_p and S_mp their spectral densities and that
of both together (Bendat and Piersol 2010, ch. 6). At the phase that suits it best, for signals may come late, p leaves

    S_m + S_p - 2 |S_mp|

of S_m: where that is more than there was to begin with, or has risen again though it is no noise, the motion says
nothing of this effort, and it is compared below that frequency alone. Bodies, rotor, friction and offset are the best
fit up to where it counts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...dynamics import InMotion, LowPass, motion_of
from ...dynamics.inertial import near_body
from ...dynamics.smoothing import by_bands, pieces
from ...errors import InputError
from ...laws.efforts.effort_law import usual_way
from ...mechanism import Mechanism
from ...recordings import Recording
from ...spatial import Array
from ..criteria import FEW_ROUNDS, MOST, MUCH, NO_MATTER, ROUNDING, TREMOR

#: Up to how many times the motion's own frequency, below which all of its way but a tremor lies, efforts are compared.
_OWN_TIMES = 4.0
#: Coherence from which it is no noise that makes the prediction worse, but a motor that vibrates; and the share of that
#: frequency up to which efforts are then compared: a gear that yields deviates from a rigid one by 1 / (1 - r^2) at the
#: share r of its resonance, a third at half of it.
_COHERENT, _FOOT = 0.25, 0.5
#: ... as where what a coherent prediction leaves has risen so many times above what it left before.
_RISEN = 10.0
#: Periods of the motion's own frequency in a stretch whose spectrum is taken, and fewest stretches.
_PERIODS, _STRETCHES = 4.0, 6


@dataclass(frozen=True, eq=False)
class Spectra:
    """Power densities (k, f) of the measured and the predicted efforts, and of both together, at `frequency` (f,) [Hz].

    Averaged over a third of an octave about each frequency.
    """

    frequency: Array
    measured: Array
    predicted: Array
    both: Array  # the size of the complex cross-spectrum

    @property
    def coherence(self) -> Array:
        """Share (k, f) of the measured power that follows the predicted one at any gain and phase."""
        return self.both**2 / np.maximum(self.measured * self.predicted, np.finfo(float).tiny)

    @property
    def explained(self) -> Array:
        """Share (k, f) of the measured power that the prediction takes away at its best phase; negative: it adds."""
        return (2 * self.both - self.predicted) / np.maximum(self.measured, np.finfo(float).tiny)


def in_motion(
    mechanism: Mechanism,
    recording: Recording,
    band: Mapping[str, float] | None = None,
    without: Sequence[tuple[int, int]] = (),
) -> InMotion:
    """Return the robot in a recorded motion, in a band [Hz] by driven joint, without stretches of rows.

    Raises InputError where the motion cannot be told, or no effort of a driven joint was recorded.
    """
    motion = motion_of(recording, mechanism, without=without, band=band)
    if not motion.driven:
        raise InputError("no column tau.<joint> of an actuated joint of this robot holds a number")
    return InMotion.of(mechanism, motion)


def band_of(mechanism: Mechanism, recording: Recording) -> tuple[dict[str, float] | None, float | None]:
    """Return the `coherent_band` of a recording; (None, None) of postures. Raises as `in_motion`."""
    seen = in_motion(mechanism, recording)
    return (None, None) if seen.motion.separate else coherent_band(seen)


def coherent_band(at: InMotion) -> tuple[dict[str, float], float | None]:
    """Return by driven joint the frequency [Hz] up to which its efforts are compared; and that below which the residual
    is judged where motors vibrate, for above it the motion has nothing but vibration. None where they do not.
    """
    motion = at.motion
    highest = motion.band.highest
    lowest = min(_OWN_TIMES * _own_frequency(at), highest)
    columns = [_background(at, joint) for joint in range(len(at.driven))]
    cutoffs, shaken = np.full(len(at.driven), lowest), False
    for _ in range(FEW_ROUNDS):
        parts = [_fitted(at, joint, own, cutoffs[joint]) for joint, own in enumerate(columns)]
        inertial, others = (np.column_stack(part) for part in zip(*parts, strict=True))
        seen = spectra_of(at, motion.efforts - others, inertial, lowest / _OWN_TIMES)
        before, (cutoffs, shaken) = cutoffs, _cutoffs(seen, lowest, highest)
        if (cutoffs == before).all():
            break
    return dict(zip(at.driven, cutoffs.tolist(), strict=True)), lowest if shaken else None


def spectra_of(at: InMotion, measured: Array, predicted: Array, own: float) -> Spectra:
    """Return the spectra of measured efforts and of predicted ones (N, k); own: the motion's frequency [Hz]."""
    from scipy.signal import csd, welch  # heavy; not needed to load a robot

    motion = at.motion
    longest = max(pieces(motion.piece), key=lambda where: where.stop - where.start)
    length = longest.stop - longest.start
    stretch = int(min(max(_PERIODS * motion.rate / max(own, 1e-9), 64), max(length // _STRETCHES, 16)))
    settings = {"fs": motion.rate, "nperseg": stretch, "detrend": "constant", "axis": 0}
    measured, predicted = measured[longest], predicted[longest]
    frequency, power = welch(measured, **settings)
    parts = [power, welch(predicted, **settings)[1], csd(measured, predicted, **settings)[1]]
    m, p, both = (by_bands(frequency, part).T for part in parts)
    return Spectra(frequency, m, p, np.abs(both))


def _cutoffs(spectra: Spectra, lowest: float, highest: float) -> tuple[Array, bool]:
    """Return (k,) frequencies [Hz] up to the lowest one at which a prediction adds more than there was, and whether
    motors vibrate.

    Where a vibration ends what is compared, no joint is compared far above the motion, nor far above the joint that
    ends first, for the mass matrix passes it on: but for as far as the prediction leaves next to nothing.
    """
    vibrating = spectra.coherence > _COHERENT
    worse = (spectra.explained < -MOST) & (spectra.frequency < highest)
    # steps of an encoder, which rise with frequency, end even what is near the motion; gaps between its lines do not
    on = np.logical_and.accumulate((worse | (spectra.frequency >= highest))[:, ::-1], axis=1)[:, ::-1]
    worse &= spectra.frequency > np.where(on & ~vibrating, lowest / _OWN_TIMES, lowest)
    first = np.argmax(worse, axis=1)
    coherent = vibrating[np.arange(len(first)), first]
    cut = np.where(worse.any(axis=1), spectra.frequency[first] * np.where(coherent, _FOOT, 1.0), highest)
    shaken = coherent & worse.any(axis=1)
    rising = _rising(spectra, lowest) & (spectra.frequency < cut[:, None])
    cut = np.where(rising.any(axis=1), spectra.frequency[np.argmax(rising, axis=1)], cut)
    shaken |= rising.any(axis=1)
    if shaken.any():
        # bodies that swing on gears look heavier by 1 / (1 - r^2), at a tenth of a resonance by a hundredth, at half of
        # it by a third, and vibration is all that is there between
        most = MUCH * lowest
        poor = (spectra.explained < 1 - NO_MATTER) & (spectra.frequency > lowest)
        good = np.where(poor.any(axis=1), spectra.frequency[np.argmax(poor, axis=1)], highest)
        cut = np.minimum(cut, np.maximum(np.sqrt(most * np.clip(cut[shaken].min(), lowest, most)), good))
    return np.where(shaken, np.maximum(cut, lowest), cut), bool(shaken.any())


def _rising(spectra: Spectra, lowest: float) -> np.ndarray:
    """Return where (k, f), above a frequency, what the prediction leaves has risen again though it is no noise.

    What noise adds to a prediction is not coherent with the effort, and noise of efforts does not rise.
    """
    above = spectra.frequency > lowest
    left = np.where(above, np.clip(1 - spectra.explained, 0.0, None) * spectra.measured, np.inf)
    least = np.minimum.accumulate(left, axis=1)
    return above & (left > _RISEN * least) & (spectra.coherence > _COHERENT)


def _own_frequency(at: InMotion) -> float:
    """Return the frequency [Hz] below which a hundredth of the way is all that is missed, over all joints.

    Of the way and not of the speed: a motor that trembles by microradians at thirty times the frequency of its motion
    has a good share of the speed. Of each joint by its own: those that move little vibrate as others do.
    """
    from scipy.signal import welch

    motion = at.motion
    longest = max(pieces(motion.piece), key=lambda where: where.stop - where.start)
    speed = motion.speed[longest]
    frequency, power = welch(speed, motion.rate, nperseg=max(len(speed) // 2, 16), detrend="constant", axis=0)
    way = power[1:, power.any(axis=0)] / frequency[1:, None] ** 2
    share = np.cumsum(way / way.sum(axis=0), axis=0).mean(axis=1)
    return float(frequency[1:][np.argmax(share > 1 - TREMOR**2)]) if way.size else float(motion.band.highest)


def _background(at: InMotion, joint: int) -> tuple[Array, Array, Array]:
    """Return columns of efforts of every drive: of bodies over their spread (N, p), of a rotor, and others (N, q)."""
    name, bodies = at.driven[joint], []
    for index in range(at.regressor.shape[2]):
        own = at.regressor[:, joint, index]
        if own.any():
            spread = np.linalg.inv(np.linalg.cholesky(near_body(index + 1, at.mechanism))).T
            bodies.append(own @ spread)
    rotor, rest = [], [np.ones(len(at))]
    if name in at.motion.names and at.moves(name):
        rotor.append(at.acceleration(name))
        rest += [at.dragged(name, usual_way(at, name)), at.speed(name)]
    nothing = np.zeros((len(at), 0))
    return (np.concatenate([nothing, *bodies], axis=1), np.column_stack([nothing, *rotor]), np.column_stack(rest))


def _fitted(at: InMotion, joint: int, columns: tuple[Array, Array, Array], cutoff: float) -> tuple[Array, Array]:
    """Return the effort of bodies and rotor (N,), and of friction and offset (N,), by a fit below a frequency."""
    bodies, rotor, rest = columns
    low_pass, piece = LowPass(cutoff, at.motion.rate), at.motion.piece
    settled, every = low_pass.settled(piece), np.concatenate(columns, axis=1)
    asked = low_pass(at.motion.efforts[:, joint] - at.rigid[:, joint], piece)[settled]
    low = low_pass(every, piece)[settled]
    sizes = np.sqrt((low**2).sum(axis=0))
    # bodies by their spread, beside what no law takes away: a tenth of what they miss, a hundredth of its square; of
    # samples that the cut-off makes alike one counts
    alike = at.motion.rate / (2 * cutoff)
    weights = np.where(np.arange(every.shape[1]) < bodies.shape[1], alike * TREMOR * np.mean(asked**2), 0.0)
    matrix = low.T @ low + np.diag(weights + ROUNDING * np.maximum(sizes**2, np.finfo(float).tiny))
    scale = 1 / np.sqrt(np.diag(matrix))
    x = scale * np.linalg.solve(matrix * scale[:, None] * scale, scale * (low.T @ asked))
    count = bodies.shape[1] + rotor.shape[1]
    return at.rigid[:, joint] + every[:, :count] @ x[:count], rest @ x[count:]
