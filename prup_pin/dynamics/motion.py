"""From a recording to a motion: positions, speeds, accelerations and efforts on an even clock, all filtered alike."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..errors import InputError
from ..mechanism import Mechanism
from ..numbers import counted, number
from ..recordings import Recording
from ..recordings.table import Thinning
from ..spatial import Array
from .clock import EvenClock, even_clock
from .glitches import without_glitches
from .rates import one_rate
from .saturation import at_limit, limits_told
from .smoothing import Band, LowPass, bandwidth, differences, floor_of, pieces, spectrum
from .travel import Path, Sampling
from .two_sensors import likelier_rate

#: The slowest cut-off [Hz]: what a drive's friction does at a reversal is faster than the motion itself.
_SLOWEST = 10.0
#: Samples per period of the cut-off that are kept, for friction turns round faster than the motion; fewer where
#: there are more samples than this.
_KEPT, _LONG = 10.0, 40_000
#: A sample between rows is at a limit where this share of it is from one that is.
_TOUCHED = 1e-3
#: ... and periods of the cut-off within which the filter brings what it is to others.
_REACHED = 1.0
#: A turn, and what noise and interpolation add to it [rad].
_TURN = 2.2 * np.pi
#: Positions and speeds are smoothed with a wider band than efforts: products of them are to be right within that.
_WIDER = 2.0
#: A joint stands still below this many times the noise of its speed, and below this share of its usual speed.
_STILL, _STILL_SHARE = 4.0, 2e-3
#: A joint that stands for more than this share of the time is compared there too: else nothing would be left of it.
_ALWAYS = 0.8
#: A joint that is slow for no longer than this [s] turns round and does not rest.
_TURNING = 0.2
#: Fewest samples between two stretches that are left out, for any of them to count.
_SHORTEST = 16
#: Rows, and samples that follow from them, beyond which pieces of time are chosen instead of all, evenly.
_MOST_ROWS, _MOST_SAMPLES, _PIECES = 100_000, 10_000, 10
#: Where spectra are to tell the band: samples, in few pieces, since slow motions need long ones.
_OF_SPECTRA, _LONG_PIECES = 48_000, 4
#: Steps of a clock [s] beyond which its rows are postures, and the share of rows below which joints hardly ever move.
_SLOW_CLOCK, _MOVING = 0.3, 0.3
#: Rates that come later than what changes by less than this [s] are not told to.
_NO_DELAY = 1e-4
#: A state's way before and after it, as a share of the way of a second: it tells which way the joints go.
_AROUND = 1e-6
_OTHER_UNITS = (
    (57.29578, "they seem to be in degrees per second"),
    (1 / 57.29578, "the positions seem to be in degrees"),
    (9.549297, "they seem to be in revolutions per minute"),
    (1e3, "they seem to be in mm/s"),
    (1e-3, "the positions seem to be in mm"),
    (-1.0, "the sign of one of them is turned round"),
)
#: Recorded speeds that differ from the positions' by more than this share are not those of the positions.
_STRANGE = 0.3


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion of the joints `names` at N samples on an even clock.

    time (N,) [s]; piece (N,) labels of pieces without a break; position, speed, acceleration (N, j) [m or rad and s];
    still (N, j): where a joint stands; efforts (N, k) of the joints `driven` [N or N m], not filtered, and where they
    are at a limit of the drive, or within reach of the filter of that, `saturated` (N, k); wrench (N, 6), gravity
    (N, 3) and temperature (N,) [deg C] where they were recorded; rows (N,): the row of the recording nearest to each
    sample.
    `band` is what measured and predicted efforts are both to be filtered with; path: where the joints were between
    samples, as far as their sensors tell it; remarks: sentences for a person.
    """

    names: tuple[str, ...]
    driven: tuple[str, ...]
    time: Array
    piece: np.ndarray
    rate: float
    position: Array
    speed: Array
    acceleration: Array
    still: np.ndarray
    slow: Array  # (j,) the speed below which a joint stands still
    efforts: Array
    saturated: np.ndarray
    wrench: Array | None
    gravity: Array | None
    temperature: Array | None
    rows: np.ndarray
    band: Band
    path: Path
    remarks: tuple[str, ...] = ()
    separate: bool = False  # each row is a state by itself: nothing is known of the way from one to the next

    def __len__(self) -> int:
        return len(self.time)

    @property
    def elapsed(self) -> Array:
        """Time since the recording began (N,) [s], over runs whose clocks start again too."""
        return np.cumsum(np.maximum(np.diff(self.time, prepend=self.time[:1]), 0.0))

    @property
    def standing(self) -> bool:
        """Whether the rows are postures in which the joints stand."""
        return self.separate and not self.speed.any() and not self.acceleration.any()

    def select(self, rows: np.ndarray) -> Motion:
        """Return some of the samples, by their places (n,)."""
        changes = {name: getattr(self, name)[rows] for name in _BY_SAMPLE}
        for name in ("wrench", "gravity", "temperature"):
            value = getattr(self, name)
            changes[name] = None if value is None else value[rows]
        return replace(self, **changes, path=self.path.select(rows))

    def with_motion(self, position: Array, speed: Array, acceleration: Array) -> Motion:
        """Return the same samples with another motion."""
        path = Path.of(position, speed, self.time, self.piece)
        return replace(self, position=position, speed=speed, acceleration=acceleration, path=path)

    @property
    def compared(self) -> np.ndarray:
        """Which samples of efforts count (N, k): a joint at rest rubs by what it likes, up to its limit.

        And a drive at its limit gives what it has, whatever is asked of it.
        """
        counts = np.isfinite(self.efforts) & ~self.saturated
        for column, name in enumerate(self.driven):
            if name in self.names and (still := self.still[:, self.names.index(name)]).mean() < _ALWAYS:
                counts[:, column] &= ~still
        return counts

    def bridged(self, rigid: Array) -> Motion:
        """Return the same with what efforts at a limit may have been, by the rigid robot's (N, k).

        They are compared with nothing; but a filter brings them to the samples beside them.
        """
        if not self.saturated.any():
            return self
        efforts, index = self.efforts.copy(), np.arange(len(self))
        for column, here in enumerate(self.saturated.T):
            if here.any() and not here.all():
                beyond = (efforts - rigid)[~here, column]
                efforts[here, column] = rigid[here, column] + np.interp(index[here], index[~here], beyond)
        return replace(self, efforts=efforts)


_BY_SAMPLE = ("time", "piece", "position", "speed", "acceleration", "still", "efforts", "saturated", "rows")


def is_standing(recording: Recording, names: Sequence[str]) -> bool:
    """Return whether a recording is of postures in which the joints `names` stand, not of motions between them."""
    if len(recording) < 2 or not names:
        return True
    return not recording.in_no_order(names) and _stands(one_rate(recording).recording, names)


def _stands(recording: Recording, names: Sequence[str]) -> bool:
    steps = np.diff(recording.time)[np.diff(recording.run) == 0]
    if not len(steps) or float(np.median(steps)) > _SLOW_CLOCK:
        return True
    logged = [recording.velocities[name] for name in names if name in recording.velocities]
    if len(logged) == len(names) and not np.nanmax(np.abs(np.column_stack(logged))) > 0:
        return True
    moved = np.diff(np.column_stack([recording.positions[name] for name in names]), axis=0)
    return bool((np.abs(np.nan_to_num(moved)) > 0).any(axis=1).mean() < _MOVING)


def motion_of(
    recording: Recording,
    mechanism: Mechanism,
    driven: Sequence[str] | None = None,
    without: Sequence[tuple[int, int]] = (),
    band: Mapping[str, float] | None = None,
) -> Motion:
    """Return the motion that a recording tells of a mechanism's joints.

    driven: the joints whose efforts are asked for, at every row; None: those that were recorded, at as many samples as
    tell something. without: stretches of rows, the first and the last of each, that are left out: the joints are
    followed through them. band: frequency [Hz] by joint up to which its efforts are compared; None: up to where the
    motion stands above its noise.

    Raises InputError where no joint has a position, or nothing lasts long enough to tell a speed.
    """
    joints = [joint.name for joint in mechanism.joints if joint.nv == 1 and joint.name in recording.positions]
    names = tuple(name for name in joints if np.isfinite(recording.positions[name]).any())
    drives = tuple(
        name for name in mechanism.actuated if name in recording.efforts and np.isfinite(recording.efforts[name]).any()
    )
    if not names:
        raise InputError("no column q.<joint> of this robot's joints holds a number: its motion is unknown")
    if driven is not None:
        # what was recorded of them tells a row that was logged again from one in which a coarse encoder saw no step
        known = {name: recording.efforts.get(name, np.zeros(len(recording))) for name in driven}
        recording = recording.with_measurements(efforts={name: np.nan_to_num(tau) for name, tau in known.items()})
        drives = tuple(driven)
    if recording.in_no_order(names):
        return _states(recording, names, drives, driven is None)
    rates = one_rate(recording)
    if len(recording) < 2 or _stands(rates.recording, names):
        return _postures(recording, names, drives)
    clean, told_off = without_glitches(recording)
    rates = one_rate(clean) if told_off else rates
    limited = {name: at_limit(clean.efforts[name]) for name in drives}
    remarks = [*told_off, *(limits_told(clean, limited) if driven is None else ()), *rates.remarks]
    recording, there = rates.recording, None
    if driven is None:
        recording, there = _bounded(recording, remarks)
        limited = {name: here if there is None else here[there] for name, here in limited.items()}
    speeds = _logged(recording.velocities, names)
    accelerations = _logged(recording.accelerations, names)
    groups = (
        [recording.positions[name] for name in names],
        [recording.efforts[name] for name in drives],
        [recording.velocities[name] for name in speeds],
        [recording.accelerations[name] for name in accelerations],
        [limited[name].astype(float) for name in drives],
    )
    table = np.column_stack([column for group in groups for column in group])
    clock = even_clock(recording.time, table, recording.run)
    if not clock.exact:
        clock = _smoother(clock, clock.counted(), table[:, : len(names)])
    remarks += clock.remarks
    if not len(clock):
        raise InputError(
            f"nothing in this recording, {counted(len(recording), 'row')} in {number(np.ptp(recording.time), 3)} s, "
            "lasts long enough to tell a speed: expected some seconds of rows at an even rate with all of "
            f"{', '.join(f'q.{name}' for name in names)} and the efforts"
        )
    rate = 1 / clock.step
    parts_of = np.split(clock.sampled(table), np.cumsum([len(group) for group in groups[:-1]]), axis=1)
    position, efforts, logged_speeds, logged_accelerations, limits = parts_of
    position, saturated = _unwrapped(position, names, mechanism), np.abs(limits) > _TOUCHED
    logged_speed = dict(zip(speeds, logged_speeds.T, strict=True))
    logged_acceleration = dict(zip(accelerations, logged_accelerations.T, strict=True))
    _strange_speeds(names, position, logged_speed, clock)

    rows = clock.rows[np.clip(np.searchsorted(clock.row_time, clock.time), 0, len(clock.rows) - 1)]
    if clock.exact:
        rows = clock.rows
    rows = rows if there is None else there[rows]
    counts, parts = _parted(rows, clock.piece, without)

    def band_of(key: str, values: Array) -> float:
        thin = rates.every.get(key, 1)
        return bandwidth(values[::thin], parts[::thin], rate / thin)

    of_position = [band_of(f"q.{name}", position[:, column]) for column, name in enumerate(names)]
    of_speed = {name: band_of(f"qd.{name}", logged_speed[name]) for name in speeds}
    speed_delays, logged_speed = _likelier(
        names, dict(zip(names, position.T, strict=True)), logged_speed, ("q", "qd"), clock, rates.every
    )
    remarks += _lateness("speeds", "positions", speed_delays)
    _, logged_acceleration = _likelier(names, logged_speed, logged_acceleration, ("qd", "qdd"), clock, rates.every)
    moving = [of_speed.get(name, band) for name, band in zip(names, of_position, strict=True)]
    moving = [band for band in moving if band > 0]
    compared = [f"q.{name}" for name in names] + [f"tau.{name}" for name in drives]
    slowest = rate / max(rates.every.get(name, 1) for name in compared)
    stands_out, told = max((_SLOWEST, *moving)), band or {}
    cutoffs = [min(told.get(name, stands_out), 0.4 * slowest) for name in drives]
    cutoff = max(cutoffs, default=_SLOWEST)
    # a motion whose band is known is followed by that where nothing is compared with it
    wider = _WIDER if driven is None or band is None else 1.0
    smooth, speed, acceleration, path, path_speed = (np.empty_like(position) for _ in range(5))
    noise = np.empty(len(names))
    for column, name in enumerate(names):
        wide = LowPass(min(wider * told.get(name, cutoff), 0.45 * rate), rate, of_motion=True)
        smooth[:, column] = wide(position[:, column], clock.piece)
        fine = LowPass(min(of_position[column], 0.45 * rate), rate, of_motion=True)
        if name in logged_speed:
            speed[:, column] = wide(logged_speed[name], clock.piece)
            noise[column] = np.std(logged_speed[name] - speed[:, column])
        else:
            raw = differences(position[:, column], clock.piece, clock.step)
            speed[:, column] = differences(smooth[:, column], clock.piece, clock.step)
            noise[column] = np.std(raw - speed[:, column])
        path[:, column], path_speed[:, column] = smooth[:, column], speed[:, column]
        if fine.cutoff > wide.cutoff:
            path[:, column] = fine(position[:, column], clock.piece)
            for where in pieces(clock.piece):  # by straight lines: counts of an encoder have no turns between them
                path_speed[where, column] = np.gradient(path[where, column], clock.step)
        if name in logged_acceleration:
            acceleration[:, column] = wide(logged_acceleration[name], clock.piece)
        else:
            acceleration[:, column] = differences(speed[:, column], clock.piece, clock.step)
        noise[column] *= np.sqrt(wide.cutoff / (rate / 2))  # what the filter leaves of it
    slow = np.maximum(_STILL * noise, _STILL_SHARE * np.sqrt(np.mean(speed**2, axis=0)))
    slow = np.maximum(slow, np.finfo(float).tiny)
    still = _standing(np.abs(speed) < slow, clock.piece, rate, cutoff)
    verb = "efforts are compared" if driven is None else "the motion is followed"
    remarks.append(_compared(verb, drives, cutoffs, bool(band)))
    if not speeds:
        remarks.append("speeds and accelerations are those of the positions")
    every = max(1, int(rate / (_KEPT * cutoff)), min(len(clock) // _LONG, int(rate / (4 * cutoff))))
    every = every if driven is None else 1  # each row is asked for
    keep = np.concatenate([np.arange(where.start, where.stop, every) for where in pieces(parts)])
    reached = 2 * int(_REACHED * rate / cutoff) + 1
    before_taking = LowPass(0.4 * rate / every, rate) if every > 1 else None
    if before_taking is not None:
        efforts = before_taking(efforts, parts)
        rate /= every
    keep = keep[counts[keep]]
    most = (
        Thinning(len(keep), _OF_SPECTRA, _LONG_PIECES) if band is None else Thinning(len(keep), _MOST_SAMPLES, _PIECES)
    )
    keep, piece = (keep, parts[keep]) if driven is not None else _fewer(keep, parts, most, remarks)
    wrench = recording.wrench if recording.has_wrench else None
    motion = Motion(
        names=names,
        driven=drives,
        time=clock.time[keep],
        piece=piece,
        rate=rate,
        position=smooth[keep],
        speed=speed[keep],
        acceleration=acceleration[keep],
        still=still[keep],
        slow=slow,
        efforts=efforts[keep],
        saturated=np.column_stack([np.convolve(here, np.ones(reached), "same")[keep] > 0 for here in saturated.T]),
        wrench=None if wrench is None else np.nan_to_num(clock.sampled(np.asarray(wrench)))[keep],
        gravity=None if recording.gravity is None else clock.sampled(np.asarray(recording.gravity))[keep],
        temperature=_temperature_at(rows[keep], recording),
        rows=rows[keep],
        band=Band(tuple(cutoffs), rate),
        path=_path_at_rows(path, path_speed, clock, parts, Sampling(keep, parts, before_taking)),
        remarks=tuple(remarks),
    )
    return motion if driven is None or clock.exact else _at_each_row(motion, clock)


def _likelier(
    names: Sequence[str],
    values: Mapping[str, Array],
    rates: Mapping[str, Array],
    prefixes: tuple[str, str],
    clock: EvenClock,
    every: Mapping[str, int],
) -> tuple[dict[str, float], dict[str, Array]]:
    """Return by how much later [s] each logged rate came than what changes, and the likelier rate of both, by joint."""
    delays, out = {}, dict(rates)
    for name in names:
        if name in values and name in rates:
            thin = (every.get(f"{prefixes[0]}.{name}", 1), every.get(f"{prefixes[1]}.{name}", 1))
            likelier = likelier_rate(values[name], rates[name], clock.piece, 1 / clock.step, thin)
            delays[name], out[name] = likelier.delay, likelier.values
    return delays, out


def _lateness(what: str, of_what: str, delays: Mapping[str, float]) -> list[str]:
    """Return what is said of rates that were logged at another moment than what changes."""
    late = {name: delay for name, delay in delays.items() if abs(delay) > _NO_DELAY}
    if not late:
        return []
    each = ", ".join(f"{name} {number(1e3 * delay, 2)}" for name, delay in late.items())
    return [f"logged {what} come later than the {of_what} by so many ms, and were taken earlier by that: {each}"]


def _compared(verb: str, drives: Sequence[str], cutoffs: Sequence[float], rigid: bool) -> str:
    """Return up to where efforts are compared, in words; rigid: that was told by the efforts, not the positions."""
    why = (
        "where the rigid robot's efforts are in those that were measured"
        if rigid
        else "where the motion stands above the noise of its positions"
    )
    if len(set(cutoffs)) < 2:
        return f"{verb} up to {number(max(cutoffs, default=0.0), 3)} Hz, {why}"
    each = ", ".join(f"{name} {number(cutoff, 3)}" for name, cutoff in zip(drives, cutoffs, strict=True))
    return f"{verb} up to so many Hz, {why}: {each}"


def _postures(recording: Recording, names: tuple[str, ...], driven: tuple[str, ...]) -> Motion:
    """Return postures at rest, one after the other."""
    position = _joined(names, recording.positions)
    still = np.zeros_like(position)
    return _separate(
        recording,
        names,
        driven,
        (position, still, still),
        "the joints stand in every row: efforts are those of weight and load, and nothing shows that needs motion",
        "a position or an effort",
    )


def _states(recording: Recording, names: tuple[str, ...], driven: tuple[str, ...], fewer: bool) -> Motion:
    """Return states of motion in no order; fewer: no more of them than tell something."""
    lacking = [f"qdd.{name}" for name in names if name not in _logged(recording.accelerations, names)]
    if lacking:
        raise InputError(
            "the rows are in no order of time, so that each has to say how the joints speed up: missing are "
            f"{', '.join(lacking)}. Give the rows as they were logged, or these columns"
        )
    rows, told = np.arange(len(recording)), ""
    if fewer and len(rows) > _MOST_SAMPLES:
        rows = np.arange(_MOST_SAMPLES) * len(rows) // _MOST_SAMPLES
        told = f"; {len(recording)} rows are more than are needed, and {_MOST_SAMPLES} of them were used, evenly spread"
    some = recording.select(rows)
    motion = _separate(
        some,
        names,
        driven,
        tuple(_joined(names, group) for group in (some.positions, some.velocities, some.accelerations)),
        "the rows are in no order of time: each is taken for itself, with the speeds and accelerations that it holds, "
        f"and nothing shows that needs to know what was before, such as a delay, a filter or backlash{told}",
        "a position, a speed, an acceleration or an effort",
    )
    return replace(motion, rows=rows[motion.rows])


def _temperature_at(rows: np.ndarray, recording: Recording) -> Array | None:
    """Return the temperature (N,) [deg C] at rows (N,), between those that have one; None where none has."""
    if recording.temperature is None:
        return None
    there = np.flatnonzero(np.isfinite(recording.temperature))
    return np.interp(rows, there, np.asarray(recording.temperature)[there]) if len(there) else None


def _joined(names: Sequence[str], group: Mapping[str, Array]) -> Array:
    return np.column_stack([group[name] for name in names])


def _separate(
    recording: Recording,
    names: tuple[str, ...],
    driven: tuple[str, ...],
    moved: Sequence[Array],
    remark: str,
    needed: str,
) -> Motion:
    """Return rows of which each is a sample by itself; moved: positions, speeds and accelerations (N, j)."""
    table = np.column_stack([*moved, *(recording.efforts[name] for name in driven)])
    rows = np.flatnonzero(np.isfinite(table).all(axis=1))
    position, speed, acceleration, efforts = np.split(table[rows], len(names) * np.arange(1, 4), axis=1)
    usual, samples = np.sqrt(np.mean(speed**2, axis=0)), np.arange(len(rows))
    slow = np.maximum(_STILL_SHARE * usual, np.finfo(float).tiny)
    lost = f"{len(recording) - len(rows)} of {len(recording)} rows lack {needed}"
    around = np.stack([position + sign * _AROUND * speed for sign in (-1.0, 0.0, 1.0)], axis=1)
    return Motion(
        names=names,
        driven=driven,
        time=np.asarray(recording.time)[rows],
        piece=recording.select(rows).blocks(),
        rate=1.0,
        position=position,
        speed=speed,
        acceleration=acceleration,
        still=(np.abs(speed) < slow) & (usual > 0),
        slow=slow,
        efforts=efforts,
        saturated=np.zeros((len(rows), len(driven)), bool),
        wrench=np.nan_to_num(np.asarray(recording.wrench))[rows] if recording.has_wrench else None,
        gravity=None if recording.gravity is None else np.asarray(recording.gravity)[rows],
        temperature=_temperature_at(rows, recording),
        rows=rows,
        band=Band((1.0,) * len(driven), 1.0),
        path=Path(
            around.reshape(-1, len(names)),
            np.repeat(speed, 3, axis=0),
            (samples[:, None] + _AROUND * np.arange(-1, 2)).ravel(),
            np.repeat(samples, 3),
            Sampling(3 * samples + 1, np.repeat(samples, 3)),
        ),
        remarks=(remark, *[lost] * (len(rows) < len(recording))),
        separate=True,
    )


def _path_at_rows(position: Array, speed: Array, clock: EvenClock, parts: np.ndarray, sampling: Sampling) -> Path:
    """Return the path by the times of the rows; position, speed (E, j): on the even clock, whose places are of pieces
    `parts` (E,).
    """
    if clock.exact:
        return Path(position, speed, clock.time, parts, sampling)
    at_rows, nearest = _at_rows(np.hstack((position, speed)), clock)
    position, speed = np.hsplit(at_rows, 2)
    return Path(position, speed, clock.row_time, parts[nearest], replace(sampling, between=clock.between))


def _at_rows(values: Array, clock: EvenClock) -> tuple[Array, np.ndarray]:
    """Return what changes smoothly on an even clock (E, k) at the times of its rows (M, k), and the sample nearest to
    each (M,).
    """
    from scipy.interpolate import CubicSpline  # heavy; not needed to load a robot

    out, nearest = np.empty((len(clock.rows), values.shape[1])), np.empty(len(clock.rows), int)
    for piece in np.unique(clock.piece):
        here, given = np.flatnonzero(clock.piece == piece), clock.row_piece == piece
        time, wanted = clock.time[here], clock.row_time[given]
        out[given] = CubicSpline(time, values[here])(wanted)
        nearest[given] = here[np.clip(np.rint((wanted - time[0]) / clock.step).astype(int), 0, len(here) - 1)]
    return out, nearest


def _at_each_row(motion: Motion, clock: EvenClock) -> Motion:
    """Return a motion of which all places of an even clock are samples at the times of its rows."""
    at_rows, nearest = _at_rows(np.hstack((motion.position, motion.speed, motion.acceleration)), clock)
    position, speed, acceleration = np.hsplit(at_rows, 3)
    path = replace(motion.path, sampling=Sampling.each(motion.path.piece))
    return replace(
        motion.select(nearest),
        time=clock.row_time,
        rows=clock.rows,
        position=position,
        speed=speed,
        acceleration=acceleration,
        path=path,
    )


def _smoother(stamped: EvenClock, counted: EvenClock, position: Array) -> EvenClock:
    """Return the clock on which positions have less noise: stamps jitter because samples do, or for themselves."""
    noise = []
    for clock in (stamped, counted):
        own, rate = clock.sampled(position), 1 / clock.step
        spectra = [spectrum(column, clock.piece, rate) for column in own.T]
        noise.append([floor_of(*seen, rate) if len(seen[0]) else 0.0 for seen in spectra])
    apart = [np.log(b / a) for a, b in zip(*noise, strict=True) if a > 0 and b > 0]
    return counted if apart and float(np.median(apart)) < 0 else stamped


def _parted(rows: np.ndarray, piece: np.ndarray, without: Sequence[tuple[int, int]]) -> tuple[np.ndarray, np.ndarray]:
    """Return which samples stand in none of some stretches of rows, and labels (N,) of pieces that end there too.

    rows (N,): of the samples, which are of pieces `piece` (N,). Too little between two stretches goes with them.
    """
    if not without:
        return np.ones(len(rows), bool), piece
    counts = np.ones(len(rows), bool)
    for first, last in without:
        counts &= (rows < first) | (rows > last)
    parts = np.concatenate(([0], np.cumsum((np.diff(counts) > 0) | (np.diff(piece) != 0))))
    return counts & (np.bincount(parts) >= _SHORTEST)[parts], parts


def _logged(group, names: tuple[str, ...]) -> list[str]:
    """Return the joints of which a column holds numbers in most rows."""
    return [name for name in names if name in group and np.isfinite(group[name]).mean() > 0.5]


def _bounded(recording: Recording, remarks: list[str]) -> tuple[Recording, np.ndarray | None]:
    """Return at most _MOST_ROWS rows, in long pieces that are spread evenly over the recording, and which these are."""
    thinning = Thinning(len(recording), _MOST_ROWS, _PIECES)
    rows = thinning.keeps(np.arange(len(recording)))
    if rows is None:
        return recording, None
    remarks.append(
        f"{len(recording)} rows are more than are needed: {thinning.pieces} pieces of {thinning.length} rows, evenly "
        "spread, were used, the others were not looked at"
    )
    there = np.flatnonzero(rows)
    return recording.select(there), there


def _fewer(
    keep: np.ndarray, piece: np.ndarray, thinning: Thinning, remarks: list[str]
) -> tuple[np.ndarray, np.ndarray]:
    """Return no more samples than are needed, and the pieces without a break that they are of by all labels."""
    here = thinning.keeps(np.arange(len(keep)))
    if here is None:
        return keep, piece[keep]
    remarks.append(
        f"{len(keep)} samples are more than are needed: {thinning.pieces} pieces of {thinning.length}, evenly spread, "
        "were used"
    )
    place = np.flatnonzero(here)
    keep = keep[here]
    broken = (np.diff(place) > 1) | (np.diff(piece[keep]) != 0)
    labels = np.concatenate(([0], np.cumsum(broken)))
    long = (np.bincount(labels) >= _SHORTEST)[labels]
    return keep[long], labels[long]


def _unwrapped(position: Array, names: tuple[str, ...], mechanism: Mechanism) -> Array:
    """Return positions without the jumps by a turn that an encoder of an endless joint reports.

    One that reports more than a turn takes none off: a motor's, before a gear and in degrees, goes fast.
    """
    out = position.copy()
    for column, name in enumerate(names):
        if mechanism.joint(name).turns and np.ptp(position[:, column]) < _TURN:
            out[:, column] = np.unwrap(position[:, column])
    return out


def _strange_speeds(names: tuple[str, ...], position: Array, logged: dict[str, Array], clock: EvenClock) -> None:
    """Raise InputError where recorded speeds are not those of the positions, with the factor that gave them away."""
    for column, name in enumerate(names):
        if name not in logged:
            continue
        own = LowPass(min(5.0, 0.2 / clock.step), 1 / clock.step)
        moved = own(differences(position[:, column], clock.piece, clock.step), clock.piece)
        told = own(logged[name], clock.piece)
        size = float(moved @ moved)
        if not float(told @ told) > 0:
            continue
        if not size > 0:
            raise InputError(f"column q.{name} never changes, but qd.{name} tells of a motion: is it a dead channel?")
        ratio = float(moved @ told) / size
        alike = abs(float(moved @ told)) / np.sqrt(size * float(told @ told))
        if alike > 0.9 and abs(ratio - 1) > _STRANGE:
            seems = next((text for factor, text in _OTHER_UNITS if abs(ratio / factor - 1) < 0.1), "")
            raise InputError(
                f"column qd.{name}: the recorded speeds are {number(ratio)} times those of q.{name}"
                f"{seems and ': '}{seems}; expected rad and rad/s, or m and m/s"
            )


def _standing(slow: np.ndarray, piece: np.ndarray, rate: float, cutoff: float) -> np.ndarray:
    """Return where a joint really stands (N, j): slow for longer than it takes to turn round, and a little around."""
    least = max(3, round(rate / cutoff), round(_TURNING * rate))
    around = max(1, round(0.5 * rate / cutoff))
    out = np.zeros_like(slow)
    for where in pieces(piece):
        for column in range(slow.shape[1]):
            part = slow[where, column]
            edges = np.flatnonzero(np.diff(np.concatenate(([0], part.astype(np.int8), [0]))))
            for start, end in edges.reshape(-1, 2):
                if end - start >= least:
                    begin = where.start + max(start - around, 0)
                    out[begin : min(where.start + end + around, where.stop), column] = True
    return out
