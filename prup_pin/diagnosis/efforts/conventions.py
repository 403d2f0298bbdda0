"""Is a log of efforts written as it says? Signs, units, orders, coupled axes compete before any law does.

How unlikely a log is, by bodies near the drawing and by what drives need besides, is asked of it as it is written and
as it would be if columns were written otherwise: turned round, in degrees, another joint's, counted together with a
neighbour. What makes it far likelier is told, and no law is to be made of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import chain, product

import numpy as np

from ...dynamics import InMotion, InverseDynamics, Motion, could_be_gravity, motion_of
from ...dynamics.inertial import has_masses
from ...errors import InputError, PrupPinError
from ...mechanism import Mechanism
from ...recordings import WORDS, Convention, Drawn, Recording, read_as
from ...recordings.conventions import Evidence, may_be_read, merged
from ...spatial import Array
from ..criteria import (
    AS_GOOD,
    FAR_LESS,
    FEWEST_NUMBERS,
    FEWEST_OF_KIND,
    GAIN,
    LITTLE,
    MOST,
    MOSTLY,
    NEARLY,
    ROUGHLY,
    ROUNDING,
)
from ..readings import Columns, Found, Reading, Tried, likeliest, readings
from ..thinning import evenly_spaced
from .gains import gains_of
from .noise import noise_of
from .problem import kept_samples
from .shares import gains_of_efforts, rms, sampled, shares_of_efforts, stacked, tool_load_would_do
from .unlikely import SURELY, EffortLikelihood, Unlikely

#: Samples by which readings compete, and by which loops are closed.
_COMPARED, _CLOSED = 120, 16
#: What a word costs, and what one costs besides that stands among many, in nats.
_WORD, _AMONG_MANY = 3.0, 9.0
#: Words for units of efforts.
_OF_UNIT = ("gain", *(word.name for word in WORDS if "tau" in word.groups and word.factor not in (None, 1.0, -1.0)))
#: Units of a clock by its median step: s below the first, then ms, us, ns.
_CLOCKS = ((0.3, 300.0, "ms"), (300.0, 3e5, "us"), (3e5, 3e8, "ns"))
#: Of its travel, what a joint that moves may go from row to row of a clock in seconds.
_SHORT_WAY = 0.02


def conventions_of_efforts(mechanism: Mechanism, recording: Recording) -> Evidence | None:
    """Return other ways in which a log of efforts seems to be written; None where none makes it far likelier.

    Where the clock seems to count in another unit, all else is looked for by either clock: in degrees and
    milliseconds together, neither alone makes sense. Efforts that never change tell nothing of how they are written,
    and without any masses nobody knows what they were to be.
    Raises InputError where the motion cannot be told at all.
    """
    if not has_masses(mechanism) or all(
        np.ptp(values[np.isfinite(values)]) == 0 for values in recording.efforts.values() if np.isfinite(values).any()
    ):
        return None
    clock, plain = _clock(mechanism, recording), EffortReadings.of(mechanism, recording)
    if clock is None:
        return plain.evidence()
    try:
        other = EffortReadings.of(mechanism, read_as(recording, [clock], Drawn()))
    except PrupPinError:
        return plain.evidence()
    if _rate(recording) is None and not other.least < plain.least:
        return plain.evidence()
    told = other.evidence() or _evidence((), plain._left(plain.log)[-1], other._left(other.log)[-1])
    return replace(
        told,
        conventions=(clock, *told.conventions),
        others=tuple((clock, *reading) for reading in told.others),
    )


def is_mirrored(mechanism: Mechanism, one: Recording, other: Recording) -> bool:
    """Return whether one reading of a log is the other with all that moves turned round, which efforts cannot tell.

    A bar on a horizontal axis is its own mirror image: which way it turns is a matter of where one stands.
    """
    if not one.efforts:
        return False
    try:
        at, mirror = (InMotion.of(mechanism, motion_of(item, mechanism)) for item in (one, other))
    except PrupPinError:
        return False
    both = ((at.motion.position, mirror.motion.position), (at.motion.efforts, mirror.motion.efforts),
            (at.rigid, mirror.rigid))  # fmt: skip
    return all(
        mine.shape == theirs.shape and np.allclose(mine, -theirs, rtol=1e-3, atol=ROUNDING * np.nanmax(np.abs(mine)))
        for mine, theirs in both
    )


def _evidence(
    conventions: Sequence[Convention], written: float, read: float, others: Sequence[Sequence[Convention]] = ()
) -> Evidence:
    """Return what is left of a log as it is written and as it is read by conventions, shares, and readings as good."""
    held = 1 - min(1.0, (read / written) ** 2) if written > 0 else 0.0
    return Evidence(tuple(conventions), "efforts", "", written, read, held, tuple(dict.fromkeys(map(tuple, others))))


def _clock(mechanism: Mechanism, recording: Recording) -> Convention | None:
    """Return the unit in which a clock may count that is none of seconds: joints would hardly move from row to row.

    Logged speeds may tell that it does not.
    """
    steps = np.diff(recording.time)[np.diff(recording.run) == 0]
    step = float(np.median(steps)) if len(steps) else 0.0
    unit = next((word for low, high, word in _CLOCKS if low < step <= high), None)
    known = [q[np.isfinite(q)] for name, q in recording.positions.items() if name in mechanism.actuated]
    moving = [q for q in known if len(q) > FEWEST_NUMBERS and np.ptp(q) > 0]
    if unit is None or not moving or not may_be_read(recording, [Convention("time", unit)]):
        return None
    ways = [float(np.median(np.abs(np.diff(q)))) / float(np.ptp(q)) for q in moving]
    convention, rate = Convention("time", unit), _rate(recording)
    factor = convention.meaning.factor
    assert factor is not None
    told_otherwise = rate is not None and abs(np.log(rate * factor)) > np.log(2)
    return convention if 0 < max(ways) < _SHORT_WAY and not told_otherwise else None


def _rate(recording: Recording) -> float | None:
    """Return by how much logged speeds are larger than the positions' change in the log's own time; None: none."""
    ratios = []
    for name, speed in recording.velocities.items():
        if name in recording.positions:
            change = np.gradient(recording.positions[name], recording.time)
            if np.nansum(change**2) > 0:
                ratios.append(abs(float(np.nansum(speed * change) / np.nansum(change**2))))
    return float(np.median(ratios)) if ratios and np.median(ratios) > 0 else None


def _drawn(mechanism: Mechanism, motion: Motion) -> Drawn:
    return Drawn(frozenset(name for name in motion.names if mechanism.joint(name).slides))


def _written(recording: Recording, motion: Motion, efforts: Array, more: Array) -> Recording:
    """Return samples of a motion, with efforts (n, k), as a recording; `more` (m, k): efforts beyond its last row."""
    table = {name: motion.names.index(name) for name in recording.positions if name in motion.names}
    driven = {name: motion.driven.index(name) for name in recording.efforts if name in motion.driven}
    still = np.zeros(len(more))
    return Recording(
        time=np.arange(len(motion) + len(more), dtype=float),
        positions={name: np.append(motion.position[:, k], still) for name, k in table.items()},
        velocities={name: np.append(motion.speed[:, k], still) for name, k in table.items()},
        accelerations={name: np.append(motion.acceleration[:, k], still) for name, k in table.items()},
        efforts={name: np.append(efforts[:, k], more[:, k]) for name, k in driven.items()},
        conventions=recording.conventions,
    )


def _moved(motion: Motion, recording: Recording, rows: np.ndarray) -> Motion:
    """Return samples of a motion whose joints move as a recording has it at some of its rows."""
    columns = (recording.positions, recording.velocities, recording.accelerations)
    values = [np.column_stack([column[name][rows] for name in motion.names]) for column in columns]
    moved, before = motion.select(rows).with_motion(*values), motion.speed[rows]
    # a joint that is read to be so many times as fast is told to stand below so many times the speed
    now, then = (np.linalg.norm(speeds, axis=0) for speeds in (values[1], before))
    faster = np.where(then > ROUNDING, now / np.maximum(then, ROUNDING), 1.0)
    return replace(moved, slow=np.where(faster > 0, faster, 1.0) * motion.slow)


def _closing(mechanism: Mechanism, recording: Recording, motion: Motion) -> Reading:
    """Return how positions are read so that loops close that do not as they are written; nothing where none close.

    motion: of the recording as it is written. Of units, gears and orders that close them, and of units beside orders,
    the first of those by which efforts follow the rigid robot's best, in its unit or all in another one.
    """
    if not mechanism.loops:
        return ()
    rows, dynamics = evenly_spaced(len(motion), _CLOSED), InverseDynamics(mechanism, motion.driven)
    sample, drawn = motion.select(rows), _drawn(mechanism, motion)
    efforts = motion.band(motion.efforts, motion.piece)[rows]
    written = _written(recording, sample, efforts, np.zeros((0, efforts.shape[1])))

    def left(reading: Reading) -> float:
        read = read_as(written, reading, drawn)
        moved = _moved(sample, read, np.arange(len(rows)))
        tau = np.column_stack([read.efforts[name] for name in motion.driven])
        try:
            rigid = dynamics.efforts(dynamics.trajectory(moved), moved.wrench, moved.gravity)
        except InputError:
            return np.inf
        return rms(_shares_as_drawn(moved, tau, rigid))

    columns = Columns.of(mechanism, written, list(written.positions), list(written.efforts))
    tiers = list(readings(written, replace(columns, chain=True), "joints"))
    all_alike = [reading for tier in tiers for reading in tier if all(not item.joint for item in reading)]
    all_alike = [reading for reading in all_alike if reading[0].word != "reversed"]
    beside = [(*one, *other) for one, other in product(all_alike, all_alike)
              if one[0].word not in ("order", "gear") and other[0].word == "order"]  # fmt: skip
    for ways in (all_alike, beside):
        found = {reading: left(reading) for reading in ways}
        least = min(found.values(), default=np.inf)
        if least < FAR_LESS:
            return min((reading for reading in ways if found[reading] <= (1 + GAIN) * least), key=_price)
    return ()


def _shares_as_drawn(motion: Motion, efforts: Array, rigid: Array) -> Array:
    """Return the shares of squares (k,) that the robot as drawn leaves of efforts, in its unit or all in another."""
    gains = gains_of_efforts(motion, efforts, rigid, follows=0.0).values()
    usual = float(np.median(list(gains))) if gains else 1.0
    own, other = (shares_of_efforts(motion, efforts, gain * rigid) for gain in (1.0, usual))
    return min(own, AS_GOOD**2 * other, key=_left_of_most)


def _left_of_most(shares: Array) -> float:
    """Return what is left of most joints, by shares of squares (k,): what nothing explains of one hides no other."""
    return float(np.exp(np.nanmean(np.log(np.maximum(shares, LITTLE**2))) / 2))


class EffortReadings:
    """Samples of a motion, written as a recording, so that conventions read them like any other.

    Its last rows are none of them: each is one effort alone, which is read like it, so that they say what the efforts
    that are read are made of. `compares`: whether enough is known of the robot's places and efforts to tell readings.
    """

    def __init__(self, at: InMotion, recording: Recording, closing: Reading = ()):
        self.at, self.mechanism, self.recording, self.closing = at, at.mechanism, recording, closing
        self.rows, self.motion, efforts = sampled(at, _COMPARED)
        self.drawn = _drawn(self.mechanism, at.motion)
        self._tolerances = recording.tolerances.declared
        self.log = _written(recording, self.motion, efforts, np.eye(efforts.shape[1]))
        self._likelihood = EffortLikelihood(at, self._tolerances, self._count)
        known = bool(self.mechanism.loops) or all(name in at.motion.names for name in at.driven)
        self.compares = known and self._count >= FEWEST_NUMBERS and bool(np.isfinite(efforts).all() and efforts.any())

    @classmethod
    def of(cls, mechanism: Mechanism, recording: Recording) -> EffortReadings:
        """Return a recording's readings by its own clock. Raises InputError where the motion cannot be told.

        Where loops cannot be closed they are those of the log as it is read so that they can.
        """
        motion = motion_of(recording, mechanism)
        try:
            return cls(InMotion.of(mechanism, motion), recording)
        except InputError:
            closing = _closing(mechanism, recording, motion)
            if not closing:
                raise
        recording = read_as(recording, closing, _drawn(mechanism, motion))
        return cls(InMotion.of(mechanism, motion_of(recording, mechanism)), recording, closing)

    @property
    def _count(self) -> int:
        """How many samples are told apart: at rest all that are looked at, else as many as their band tells."""
        return len(self.rows if self.at.motion.separate else kept_samples(self.at))

    @cached_property
    def _noise(self) -> Array:
        """What each effort (k,) scatters by in the band in which it is compared; 0 where nothing tells that."""
        told, cutoffs = noise_of(self.recording, self.at), self.at.motion.band.cutoffs
        sizes = [told[name].below(cutoff) for name, cutoff in zip(self.at.driven, cutoffs, strict=True)]
        return np.nan_to_num(np.array(sizes))

    def _read(self, recording: Recording) -> tuple[Motion, Array, Array]:
        """Return motion and efforts (n, k) of the samples as a recording has them, and what each of those is made of
        (k, k)."""
        efforts = np.column_stack([recording.efforts[name] for name in self.motion.driven])
        count = len(self.motion)
        return _moved(self.motion, recording, np.arange(count)), efforts[:count], efforts[count:]

    def unlikely(self, recording: Recording) -> Unlikely:
        """Return how unlikely the log is as a recording of it has it, in whatever units where any are declared."""
        motion, efforts, made_of = self._read(recording)
        if self.recording.tolerances.effort_gain is not None:
            gains = self._gains(motion, efforts)
            sizes = np.array([abs(gains.get(name, 1.0)) for name in motion.driven])
            efforts, made_of = efforts / sizes, made_of / sizes
        return self._likelihood(motion, efforts, self._noise, made_of)

    @cached_property
    def written(self) -> Unlikely:
        """How unlikely the log is as it is written, or as it is read so that loops close."""
        return self.unlikely(self.log) if self.compares else Unlikely(np.inf, np.ones(1))

    @cached_property
    def found(self) -> Found[Unlikely] | None:
        """How the log is likeliest read, gains that are told beside all masses included; None where that is not asked.

        Turned columns imitate what physics does as well: gravity that pulls otherwise, a spring at a joint.
        """
        if not self.compares:
            return None
        if not (unit := self._unit()):
            return likeliest(self.log, self._by_physics(), self._tries, _WORD)
        begin = read_as(self.log, unit, self.drawn)
        score = self.unlikely(begin)
        if len(self.motion.driven) >= FEWEST_OF_KIND and not score.surely:
            plain = likeliest(self.log, self._by_physics(), self._tries, _WORD)
            if plain.conventions[:1] == unit:  # whatever is read beside it was asked
                return plain
        else:
            plain = None
        found = likeliest(begin, score, self._tries, _WORD)
        found = found._replace(conventions=(*unit, *found.conventions))
        return min(
            (each for each in (found, plain) if each), key=lambda each: each.score.nats + _price(each.conventions)
        )

    @property
    def least(self) -> float:
        """How unlikely the log is as it is likeliest read, in nats."""
        return self.written.nats if self.found is None else self.found.score.nats

    def _tries(
        self, read: Recording, unlikely: Unlikely, taken: Reading, first: Tried[Unlikely] | None, only: Reading
    ) -> list[Tried[Unlikely]]:
        """Return readings, those surely likelier marked; rarer ones only where no commoner one explains the log."""
        tried: list[Tried[Unlikely]] = []
        begin, ahead = (read, ()) if first is None else (first.read, first.reading)
        columns = Columns.of(self.mechanism, self.log, list(self.log.positions), list(self.log.efforts))
        whole = replace(columns, q_whole=set(self.recording.positions) <= set(columns.q), spins=True,
                        tau_whole=set(self.recording.efforts) <= set(columns.tau))  # fmt: skip
        every = readings(self.log, whole, "joints", "zeros")
        for some in [[only]] if only else chain([self._by_gains(begin)], every):
            if unlikely.surely or any(item.wins and item.score.surely for item in tried):
                break
            for reading in some:
                other = read_as(begin, reading, self.drawn)
                score, both = self.unlikely(other), (*ahead, *reading)
                price = _price(ahead) + _price(reading)
                margin = SURELY * (1 + bool(ahead))
                wins = score.nats + price < unlikely.nats - margin and self._makes_sense(both, other)
                # what leaves most of a log, and of each of its efforts, reads nothing of it
                wins &= _left_of_most(score.shares) < MOST or bool((score.shares < LITTLE * unlikely.shares).any())
                tried.append(Tried(score.nats + price + _price(taken), both, other, score, wins=wins))
        return tried

    def _makes_sense(self, reading: Reading, read: Recording) -> bool:
        """Return whether positions make sense of most joints as they are drawn, where more than their signs or order is
        read otherwise: in a unit in which a robot hardly moves nothing tells much of its bodies.
        """
        if not any(item.group == "q" and item.word not in ("reversed", "order") for item in reading):
            return True
        motion, efforts, _ = self._read(read)
        try:
            return _left_of_most(_shares_as_drawn(motion, efforts, self.at.rigid_of(motion))) < FAR_LESS
        except InputError:  # loops that do not close
            return False

    def _by_physics(self) -> Unlikely:
        """Return how unlikely the log is as written, or no more than readings may be where gravity pulls otherwise, or
        where something pulls at one drive by its position alone, as springs and counterbalances do: these are rarer
        than a sign, and in a small motion follow from many others.
        """
        if self.written.surely:
            return self.written
        motion, efforts, made_of = self._read(self.log)
        missed = efforts - self.at.rigid[self.rows]
        ways = (self._pulled_otherwise, SURELY), (self._by_position, 2 * SURELY)
        nats = [
            self._likelihood(motion, efforts - own, self._noise, made_of).nats + cost
            for way, cost in ways
            for own in way(motion, efforts, missed)
        ]
        return replace(self.written, nats=min([self.written.nats, *nats]))

    def _pulled_otherwise(self, motion: Motion, efforts: Array, missed: Array) -> Iterator[Array]:
        """Yield the part of what is missed (n, k) that gravity of another direction explains, if it could be one."""
        if self.mechanism.gravity.any():
            pulled = np.stack([self.at.rigid_under(axis)[self.rows] for axis in np.eye(3)], axis=-1)
            more = np.linalg.lstsq(*stacked(motion, efforts, range(len(motion.driven)), pulled, missed), rcond=None)[0]
            if could_be_gravity(self.mechanism.gravity + more, self.mechanism):
                yield pulled @ more

    def _by_position(self, motion: Motion, efforts: Array, missed: Array) -> Iterator[Array]:
        """Yield the part of what is missed (n, k) at each drive alone that follows from its position."""
        for drive in np.flatnonzero(efforts.any(axis=0)).tolist():
            name = motion.driven[drive]
            q = motion.position[:, motion.names.index(name)]
            turned = () if self.mechanism.joint(name).slides else (np.sin(q), np.cos(q))
            columns = np.column_stack((np.ones_like(q), q, *turned))
            by_drive = np.broadcast_to(columns[:, None], (len(q), len(motion.driven), columns.shape[1]))
            table, here = stacked(motion, efforts, [drive], by_drive, missed)
            own = np.zeros_like(missed)
            own[:, drive] = columns @ np.linalg.lstsq(table, here, rcond=None)[0]
            yield own

    def _gains(self, motion: Motion, efforts: Array) -> dict[str, float]:
        """Return how many times the rigid robot's efforts (n, k) are, or minus so many times, where they follow it."""
        try:
            return gains_of_efforts(motion, efforts, self.at.rigid_of(motion))
        except InputError:  # loops that do not close
            return {}

    @cached_property
    def _in_any_unit(self) -> bool:
        """Whether no unit of efforts is declared."""
        declared = any(item.columns == "tau" and item.word in _OF_UNIT for item in self.recording.conventions)
        return not declared and may_be_read(self.log, [Convention("tau", "gain", (1.0,))])

    def _unit(self) -> Reading:
        """Return the unit of all efforts where they are nearly as many times the rigid robot's at every joint.

        Bodies so much lighter or heavier, all alike, are as likely by each joint alone: masses are known to tens of per
        cent, and what one drive or two move may be many times as heavy as drawn, with rotors and loads, but not far
        lighter.
        """
        gains = self._gains(*self._read(self.log)[:2]) if self._in_any_unit else {}
        own = [name in gains for name in self.motion.driven]
        squares = (self.at.rigid[self.rows] ** 2).sum(axis=0)
        carry = 2 * sum(own) >= len(own) or squares[own].sum() > MOSTLY * squares.sum()
        if len(gains) < min(2, len(own)) or not carry:
            return ()
        sizes = np.abs(list(gains.values()))
        usual = float(np.median(sizes))
        # a load may make some of them larger besides
        apart, alike = np.log(sizes / usual), np.log(ROUGHLY)
        if abs(np.log(usual)) < np.log(AS_GOOD) or not (np.mean(np.abs(apart) < alike) > MOST and apart.min() > -alike):
            return ()
        # what only one drive tells has no unit's name
        unit = unit_of_all(usual, self.mechanism, self.motion.driven) if len(sizes) > 1 else gain_of("tau", usual)
        if unit.word != "gain":
            return (unit,)
        if len(sizes) < FEWEST_OF_KIND:
            return () if FAR_LESS < usual < LITTLE**-2 else (unit,)
        return () if tool_load_would_do(self.at, dict.fromkeys(self.motion.driven, usual)) else (unit,)

    def _by_gains(self, recording: Recording) -> list[Reading]:
        """Return readings by how many times the rigid robot's the efforts are: signs, a unit of all, one of each."""
        gains, driven = self._gains(*self._read(recording)[:2]), self.motion.driven
        if not gains or len(driven) < FEWEST_OF_KIND:
            return []
        found = [tuple(Convention(f"tau.{name}", "reversed") for name, gain in gains.items() if gain < 0)]
        usual = float(np.median(np.abs(list(gains.values()))))
        if self._in_any_unit:
            unit = unit_of_all(usual, self.mechanism, driven)
            if unit.word != "gain" or abs(np.log(usual)) > np.log(AS_GOOD):  # masses are known no better
                found.append((unit,))
            found.append(tuple(gain_of(f"tau.{name}", abs(gains.get(name, usual))) for name in driven))
        return [reading for reading in found if reading and may_be_read(self.log, reading)]

    def evidence(self) -> Evidence | None:
        """Return what is read otherwise and told, with that by which loops close; None where nothing is.

        What drives report per N m is told beside all masses, with how well it is known, which no reading has: read
        here, it would be taken for exact, and told again as what each drive differs by; so would a unit with a name
        that is nearly that of drives which differ. Where nothing tells gains beside masses, as at rest, the unit of
        all is a reading.
        """
        found = self.found or Found((), self.log, self.written)
        units = [item for item in found.conventions if item.word in _OF_UNIT]
        rest = tuple(item for item in found.conventions if item not in units)
        named = rest if any(item.word == "gain" for item in units) else found.conventions
        untold = units if len(units) > 1 or (units and self._tells_gains(named)) else []
        taken, *others = (
            tuple(item for item in reading if item not in untold) for reading in (found.conventions, *found.others)
        )
        if not (taken or self.closing):
            return None
        # by whatever tells them best apart: the robot as drawn, of all efforts or of most, or bodies near that
        both = zip(self._left(read_as(self.log, untold, self.drawn)), self._left(found.read), strict=True)
        written, read = max(both, key=lambda left: left[0] / max(left[1], ROUNDING))
        names = list(self.log.positions), list(self.log.efforts)
        told = merged((*self.closing, *taken), *names)
        evidence = _evidence(told, written, read, [(*self.closing, *item) for item in others])
        return replace(evidence, written=None) if self.closing else evidence

    def _left(self, recording: Recording) -> tuple[float, ...]:
        """Return what is left of the efforts, shares: by the robot as drawn, of all and most, and by the likeliest."""
        if not self.compares:
            return (1.0,)
        motion, efforts, _ = self._read(recording)
        try:
            rigid = self.at.rigid_of(motion)
        except InputError:  # loops that do not close
            return 1.0, 1.0, self.unlikely(recording).left
        shares = shares_of_efforts(motion, efforts, rigid)
        return rms(shares), _left_of_most(shares), self.unlikely(recording).left

    def _tells_gains(self, conventions: Sequence[Convention]) -> bool:
        """Return whether drives report in units of their own, beside all masses, in the log as it is read."""
        read = read_as(self.recording, conventions, self.drawn)
        at = InMotion.of(self.mechanism, motion_of(read, self.mechanism)) if conventions else self.at
        return gains_of(at, self._tolerances) is not None


def _price(reading: Reading) -> float:
    """Return what a reading costs, in nats: its words; one that stands among many; a gear's ratio that is not round."""
    many = any(item.word != "gain" and (item.argument or (item.joint and item.word != "reversed")) for item in reading)
    ratio = max((float(item.argument[0]) for item in reading if item.word == "gear"), default=0.0)
    return _WORD * (len(reading) + bool(ratio % 10) + bool(ratio % 5)) + _AMONG_MANY * many


def unit_of_all(gain: float, mechanism: Mechanism, driven: Sequence[str]) -> Convention:
    """Return the unit in which all drives report by a gain of all, by its name where it nearly is one that has one."""
    slides = {mechanism.joint(name).slides for name in driven}
    factors = {
        word.name: word.factor for word in WORDS if "tau" in word.groups and word.factor and slides == {word.slide}
    }
    near = (name for name, factor in factors.items() if factor > 0 and abs(np.log(gain * factor)) < np.log(NEARLY))
    return next((Convention("tau", name) for name in near), gain_of("tau", gain))


def gain_of(columns: str, gain: float) -> Convention:
    """Return that efforts are so many times what they are in N m or N."""
    return Convention(columns, "gain", (float(f"{gain:.3g}"),))
