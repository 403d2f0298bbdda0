"""Is a log of efforts written as it says? Signs, units, orders of columns and coupled axes compete before any law does.

What a rigid robot with some friction leaves of the efforts is compared with what it would leave if columns were written
otherwise: turned round, in degrees, another joint's, counted together with a neighbour. Where that leaves far less, the
log is not what it says, and no law is to be made of it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from ...dynamics import InMotion, InverseDynamics, Motion, could_be_gravity, motion_of
from ...errors import InputError, PrupPinError
from ...mechanism import Mechanism
from ...recordings import WORDS, Convention, Drawn, Recording, read_as
from ...recordings.conventions import GEARS, POSITION_UNITS, Evidence, exchanged, may_be_read, merged
from ...spatial import Array
from ..criteria import (
    ALIKE,
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
from ..quarter_turns import quarter_turns
from ..thinning import evenly_spaced
from .gains import gains_of, in_any_unit
from .noise import noise_of
from .problem import kept_samples
from .shares import (
    common_coefficients,
    gains_apart,
    gains_of_efforts,
    left_at_any_gain,
    rms,
    sampled,
    shares_of_efforts,
    tool_load_would_do,
)
from .unlikely import EffortLikelihood, Unlikely

#: Samples of a scan of many ratios, of one by which loops are closed, and by which readings' likelihoods are compared.
_SCANNED, _CLOSED, _COMPARED = 80, 16, 200
#: What a sign costs, and another order, and by how much a reading must be likelier to be told, in nats.
_WORD, _ORDER, _SURELY = 3.0, 25.0, 25.0
#: Conventions one after the other.
_MOST = 6
#: Words for units of efforts.
_OF_UNIT = ("gain", *(word.name for word in WORDS if "tau" in word.groups and word.factor not in (None, 1.0, -1.0)))
#: Words for axes that count together.
_TOGETHER = ("plus", "minus")
#: Ratios that come nearest, which are looked at more closely.
_RATIOS = 12
#: Units of a clock by its median step: s below the first, then ms, us, ns.
_CLOCKS = ((0.3, 300.0, "ms"), (300.0, 3e5, "us"), (3e5, 3e8, "ns"))
#: Of its travel, what a joint that moves may go from row to row of a clock in seconds.
_SHORT_WAY = 0.02


def conventions_of_efforts(mechanism: Mechanism, recording: Recording) -> Evidence | None:
    """Return other ways in which a log of efforts seems to be written; None where none does far better.

    Where the clock seems to count in another unit, all else is looked for by either clock: in degrees and
    milliseconds together, neither alone makes sense. Raises InputError where the motion cannot be told at all.
    """
    clock, plain = _clock(mechanism, recording), _Search.of(mechanism, recording)
    if clock is None:
        return plain.evidence()
    try:
        other = _Search.of(mechanism, read_as(recording, [clock], Drawn()))
    except PrupPinError:
        return plain.evidence()
    if _rate(recording) is None and not other.left_at_any_gain() < plain.left_at_any_gain():
        return plain.evidence()
    told = other.evidence() or _evidence((), plain.first, other.first)
    return replace(
        told,
        conventions=(clock, *told.conventions),
        others=tuple((clock, *reading) for reading in told.others),
    )


def is_mirrored(mechanism: Mechanism, one: Recording, other: Recording) -> bool:
    """Return whether one reading of a log is the other with all that moves turned round, which the robot cannot tell.

    A bar on a horizontal axis is its own mirror image: which way it turns is a matter of where one stands.
    """
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
    return motion.select(rows).with_motion(
        *(np.column_stack([column[name][rows] for name in motion.names]) for column in columns)
    )


def _closing(mechanism: Mechanism, recording: Recording, motion: Motion) -> tuple[Convention, ...]:
    """Return how positions are read so that loops close that do not as they are written; nothing where none close.

    motion: of the recording as it is written.

    Of units, gears and orders that close them, the plainest of those by which efforts follow the rigid robot's best, in
    its unit or all in another one.
    """
    if not mechanism.loops:
        return ()
    rows, dynamics = evenly_spaced(len(motion), _CLOSED), InverseDynamics(mechanism, motion.driven)
    sample, drawn = motion.select(rows), _drawn(mechanism, motion)
    efforts = motion.band(motion.efforts, motion.piece)[rows]
    written = _written(recording, sample, efforts, np.zeros((0, efforts.shape[1])))

    def left(steps: Sequence[Convention]) -> float:
        read = read_as(written, steps, drawn)
        moved = _moved(sample, read, np.arange(len(rows)))
        tau = np.column_stack([read.efforts[name] for name in motion.driven])
        try:
            rigid = dynamics.efforts(dynamics.trajectory(moved), moved.wrench, moved.gravity)
        except InputError:
            return np.inf
        gains = gains_of_efforts(moved, tau, rigid, follows=0.0).values()
        usual = float(np.median(list(gains))) if gains else 1.0
        one, other = (rms(shares_of_efforts(moved, tau, gain * rigid)) for gain in (1.0, usual))
        return min(one, AS_GOOD * other)

    for readings in _of_positions(mechanism, list(written.positions), list(written.efforts)):
        found = [(left(steps), steps) for steps in readings if may_be_read(written, steps)]
        best = min((item[0] for item in found), default=np.inf)
        if best < FAR_LESS:
            return min((item for item in found if item[0] <= (1 + GAIN) * best), key=_plainest)[1]
    return ()


def _of_positions(
    mechanism: Mechanism, names: Sequence[str], driven: Sequence[str]
) -> tuple[list[tuple[Convention, ...]], list[tuple[Convention, ...]]]:
    """Return ways to read all positions: units, gears, and orders, with the efforts too; and units beside orders."""
    slides = {mechanism.joint(name).slides for name in names}
    units = [(Convention("q", word.name),) for word in POSITION_UNITS if word.slide in slides]
    gears = [(Convention("q", "gear", (ratio,)),) for ratio in GEARS]
    orders: list[tuple[Convention, ...]] = [(Convention("q", "order", order),) for order in _orders(names)]
    if list(names) == list(driven):
        orders += [(*order, Convention("tau", "order", order[0].argument)) for order in orders]
    return [*units, *gears, *orders], [(*unit, *order) for unit in units for order in orders]


def _plainest(found: tuple[float, tuple[Convention, ...]]) -> tuple[int, bool, bool, bool, float]:
    """Return by what one reading comes before another: few words, no gear or the roundest, what leaves least."""
    left, steps = found
    ratio = next((float(item.argument[0]) for item in steps if item.word == "gear"), 0.0)
    return len(steps), ratio > 0, *_unusual(ratio), left


def _unusual(ratio: float) -> tuple[bool, bool]:
    """Return by what one gear's ratio comes after another that does as well: the roundest is the usual one."""
    return ratio % 10 > 0, ratio % 5 > 0


class _Search:
    """Samples of a motion, written as a recording, so that conventions read them like any other.

    Its last rows are none of them: each is one effort's noise, which is read like it; what several add up to in a
    column adds in squares. `first`: what is left of the log as it is written, noise and all, a share.
    """

    def __init__(self, at: InMotion, recording: Recording, closing: tuple[Convention, ...] = ()):
        self.at, self.mechanism, self.recording, self.closing = at, at.mechanism, recording, closing
        self.rows, self.motion, self.efforts = sampled(at)
        self.rigid = at.rigid[self.rows]
        self.first = rms(shares_of_efforts(self.motion, self.efforts, self.rigid))
        self.drawn = _drawn(self.mechanism, at.motion)
        self.whole = all(name in at.motion.names for name in recording.positions)
        self.all_driven = all(name in at.driven for name in recording.efforts)
        self.written = _written(recording, self.motion, self.efforts, np.diag(self._noise()))

    @classmethod
    def of(cls, mechanism: Mechanism, recording: Recording) -> _Search:
        """Return the search of a recording by its own clock. Raises InputError where the motion cannot be told.

        Where loops cannot be closed it is that of the log as it is read so that they can.
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
    def compares(self) -> bool:
        """Whether the place of each joint whose effort was recorded is known."""
        seen = bool(self.mechanism.loops) or all(name in self.at.motion.names for name in self.at.driven)
        return bool(self.at.driven) and seen

    def left_at_any_gain(self) -> float:
        """Return what is left of the log as it is read where each drive may report in a unit of its own, a share."""
        if not self.compares:
            return self.first
        moved, read, _ = self.read(read_as(self.written, self.found.conventions if self.found else (), self.drawn))
        try:
            return left_at_any_gain(moved, read, self.at.rigid_of(moved))
        except InputError:  # loops that do not close
            return 1.0

    def evidence(self) -> Evidence | None:
        """Return what is read otherwise and told, with that by which loops close; None where nothing is."""
        found = self._told()
        if not self.closing:
            return found
        found = found or _evidence((), 1.0, self.first)
        names = list(self.written.positions), list(self.written.efforts)
        return replace(
            found,
            conventions=merged((*self.closing, *found.conventions), *names),
            written=None,
            others=tuple((*self.closing, *other) for other in found.others),
        )

    def _told(self) -> Evidence | None:
        """Return what is read otherwise and told: but for a gain that all drives have; None where that is all.

        What drives report per N m is told beside all masses, with how well it is known, which no reading has: read
        here, it would be taken for exact, and told again as what each drive differs by; so would a unit with a name
        that is nearly that of drives which differ. Where nothing tells gains beside masses, as at rest, it is a
        reading.
        """
        found = self.found
        unit = next((item for item in found.conventions if item.word in _OF_UNIT), None) if found else None
        if found is None or unit is None:
            return found
        rest, *others = (
            tuple(item for item in reading if item != unit) for reading in (found.conventions, *found.others)
        )
        if not self._tells_gains(rest if unit.word == "gain" else found.conventions):
            return found
        return (
            _evidence(rest, self.left(read_as(self.written, [unit], self.drawn)), found.read, others) if rest else None
        )

    def _tells_gains(self, conventions: Sequence[Convention]) -> bool:
        """Return whether drives report in units of their own, beside all masses, in the log as it is read."""
        read = read_as(self.recording, conventions, self.drawn)
        at = InMotion.of(self.mechanism, motion_of(read, self.mechanism)) if conventions else self.at
        return gains_of(at, {key: float(value) for key, value in read.tolerances.declared.items()}) is not None

    def _noise(self) -> Array:
        """Return what each effort (k,) scatters by in the band in which it is compared; 0 where nothing tells that."""
        told, cutoffs = noise_of(self.recording, self.at), self.at.motion.band.cutoffs
        sizes = [told[name].below(cutoff) for name, cutoff in zip(self.at.driven, cutoffs, strict=True)]
        return np.nan_to_num(np.array(sizes))

    @cached_property
    def found(self) -> Evidence | None:
        """What would be read otherwise, and how much less that leaves; None where nothing is.

        By the robot as it is drawn, or, where that tells too little of a real one, by bodies that are free about it.
        """
        found = self._by_drawing()
        if not self._is_compared:
            return found
        steps = () if found is None else found.conventions
        written = self._in_units_of_their_own if in_any_unit(self.recording.tolerances.declared) else self.written
        begin = read_as(written, steps, self.drawn)
        plain = self._unlikely(begin)
        if plain.explains:
            return found
        taken, unlikely, others = self._likelier(written, begin)
        if not taken or (steps and not unlikely.nats < plain.nats - _SURELY):
            return found
        return _evidence(taken, self._unlikely(written).left, unlikely.left, others)

    @cached_property
    def _count(self) -> int:
        """How many samples are told apart: at rest all that are looked at, else as many as their band tells."""
        return len(self.rows if self.at.motion.standing else kept_samples(self.at))

    @cached_property
    def _is_compared(self) -> bool:
        known = self.compares and self._count >= FEWEST_NUMBERS and np.isfinite(self.efforts).all()
        return bool(known and self.efforts.any())

    @cached_property
    def _in_units_of_their_own(self) -> Recording:
        """The log as it is written, each effort in the unit in which it is as large as the rigid robot's."""
        sizes = gains_of_efforts(self.motion, self.efforts, self.rigid, follows=0.0)
        own = {name: tau / abs(sizes.get(name, 1.0)) for name, tau in self.written.efforts.items()}
        return replace(self.written, efforts=own)

    def _by_drawing(self) -> Evidence | None:
        if not self._is_compared:
            return None
        first = self.left(self.written)
        signed = gains_of_efforts(self.motion, self.efforts, self.rigid)
        unit = self._unit(signed)
        begin, tried = self.written, [self._found((), self.written)]
        if unit is not None:
            tried.append(self._found((unit,), read_as(self.written, [unit], self.drawn)))
        elif first > FAR_LESS and (in_any_unit(self.recording.tolerances.declared) or gains_apart(signed)):
            # each drive in a unit of its own is no sign turned round: what is read otherwise is looked for beside that
            begin = self._in_units_of_their_own
            beside = self._found((), begin)
            if not beside.conventions and beside.read < FAR_LESS and tried[0].read > FAR_LESS * beside.read:
                return None  # these units are all that is other
            tried.append(beside)
        found = [item for item in tried if item.conventions]
        if not found and (turned := self._single_signs(signed)) is not None:
            return turned
        if all(item.read > LITTLE for item in found) and (counted := self._counted_elsewhere(first, begin)) is not None:
            found.append(counted)
        if not found:
            return self._before_gears(first)
        return min(found, key=lambda item: item.read * (1 + 0.05 * len(item.conventions)))

    def _likelier(
        self, written: Recording, beside: Recording
    ) -> tuple[tuple[Convention, ...], Unlikely, Sequence[tuple[Convention, ...]]]:
        """Return signs and orders by which a log is surely likelier, how unlikely it then is, and others as good.

        Likelier, too, whatever else may be: that the drawing tells nothing of it, or that gravity pulls another way;
        beside: the log as it is read by the robot as drawn.
        """
        begun = self._unlikely(written)
        taken: tuple[Convention, ...] = ()
        others: list[tuple[Convention, ...]] = []
        now, unlikely = written, begun
        while len(taken) < _MOST:
            steps = [step for step in self._readings(now) if may_be_read(self.written, step)]
            steps = [step for step in steps if _is_likely(step) or self._is_unit_of_all(now, step)]
            tried = [(self._unlikely(read_as(now, step, self.drawn)), step) for step in steps]
            if not tried:
                break
            best, step = min(tried, key=lambda item: item[0].nats + _price(item[1]))
            if not best.nats + _price(step) < unlikely.nats - _SURELY:
                break
            least = best.nats + _price(step)
            alike = [other for read, other in tried if read.nats + _price(other) < least + _WORD and other != step]
            others = [(*other, *step) for other in others] + [(*taken, *other) for other in dict.fromkeys(alike)]
            taken, now, unlikely = (*taken, *step), read_as(now, step, self.drawn), best
        sure = taken and self._likeliest(now) + _price(taken) < self._likeliest(beside)
        return (taken, unlikely, others) if sure else ((), begun, ())

    def _is_unit_of_all(self, now: Recording, reading: Sequence[Convention]) -> bool:
        """Return whether a reading is one unit of all positions that makes sense of most joints as they are drawn."""
        return (
            [item.columns for item in reading] == ["q"]
            and reading[0].word in [word.name for word in POSITION_UNITS]
            and self._by_likelihood(read_as(now, reading, self.drawn)) < FAR_LESS
        )

    def _likeliest(self, recording: Recording) -> float:
        """Return how unlikely a log is, in nats, by the drawing or by whatever else makes it likelier."""
        read = self.read(recording, self._few)
        found = [self._likelihood(*read).nats, self._likelihood(*read, drawn=False).nats]
        if self.mechanism.gravity.any():
            found.append(self._likelihood(*read, pulled=self._pulled[self._few]).nats)
        return min(found)

    @cached_property
    def _likelihood(self) -> EffortLikelihood:
        declared = {key: float(value) for key, value in self.recording.tolerances.declared.items()}
        return EffortLikelihood(self.at, declared, min(self._count, len(self.rows)))

    @cached_property
    def _pulled(self) -> Array:
        """What gravity along each axis of the base adds to the efforts of the samples, (n, k, 3)."""
        return np.stack([self.at.rigid_under(axis)[self.rows] for axis in np.eye(3)], axis=-1)

    @cached_property
    def _few(self) -> np.ndarray:
        return evenly_spaced(len(self.rows), _COMPARED)

    def _unlikely(self, recording: Recording) -> Unlikely:
        return self._likelihood(*self.read(recording, self._few))

    def _single_signs(self, signed: Mapping[str, float]) -> Evidence | None:
        """Return drives whose efforts are minus the rigid robot's and its friction's, each by itself.

        Where most drives do little, what noise makes of them would hide one that says it surely. signed: gains of those
        that follow the rigid robot.
        """
        motion, efforts, noise = self.read(self.written)
        both = [shares_of_efforts(motion, sign * efforts, self.rigid, noise) for sign in (1, -1)]
        which = [
            name
            for name, written, read in zip(motion.driven, *both, strict=True)
            if may_be_read(self.written, [Convention(f"tau.{name}", "reversed")])
            and not signed.get(name, 0.0) > 0
            and read < FAR_LESS**2 < MOST * written
        ]
        if not which or set(which) >= set(signed) or np.isfinite(self._under_any_gravity(self.written)).any():
            return None  # or gravity pulls another way
        own = [motion.driven.index(name) for name in which]
        written, read = (float(np.sqrt(np.mean(shares[own]))) for shares in both)
        turned = tuple(Convention(f"tau.{name}", "reversed") for name in which)
        others = tuple(
            (*turned[:place], Convention(f"q.{name}", "reversed"), *turned[place + 1 :])
            for place, name in enumerate(which)
            if self._turned_position_does_as_well(name, both[1][motion.driven.index(name)])
        )
        return _evidence(turned, written, read, others)

    def _turned_position_does_as_well(self, name: str, left: float) -> bool:
        """Return whether a joint's position turned round leaves as little of its effort as that turned round does.

        Of dry friction alone nobody can tell which of both is.
        """
        if name not in self.written.positions or self.mechanism.loops:
            return False
        convention = Convention(f"q.{name}", "reversed")
        motion, efforts, noise = self.read(read_as(self.written, [convention], self.drawn))
        shares = shares_of_efforts(motion, efforts, self.at.rigid_of(motion), noise)
        return bool(shares[motion.driven.index(name)] < AS_GOOD**2 * left)

    def _found(self, start: tuple[Convention, ...], begin: Recording) -> Evidence:
        """Return what is read otherwise beside a unit; begin: as that is read."""
        shares = self.shares(begin)
        now = least = rms(shares)
        taken: tuple[Convention, ...] = ()
        others: tuple[tuple[Convention, ...], ...] = ()
        if _unexplained(shares):
            taken, least, others = self._forward(begin, shares)
            if taken and not self._makes_sense(begin, taken):
                # what came last may have come for what no reading explains; and signs of efforts say nothing of one
                # another: those that are sure by themselves are told
                first = (taken[:end] for end in range(len(taken) - 1, 0, -1))
                signs = (item for item in taken if item.word == "reversed" and item.columns.startswith("tau."))
                told = next((some for some in first if self._makes_sense(begin, some)), None)
                taken = told or tuple(item for item in signs if self._makes_sense(begin, (item,)))
                others = ()
                least = self.left(read_as(begin, taken, self.drawn)) if taken else now
        written = self.left(self.written) if start else now
        conventions = merged((*start, *taken), list(self.written.positions), list(self.written.efforts))
        return _evidence(conventions, written, least, [(*start, *other) for other in others])

    def _counted_elsewhere(self, first: float, begin: Recording) -> Evidence | None:
        """Return from where joints count, and which way, where that makes sense of the log, and more than begin does.

        first: what is left of the log as it is written.

        A joint that goes the other way round is driven the other way round.
        """

        def with_efforts(reading: Sequence[Convention]) -> tuple[Convention, ...]:
            names = {item.joint for item in reading if item.word == "reversed"}
            driven = [Convention(f"tau.{name}", "reversed") for name in self.written.efforts if {name, ""} & names]
            return (*reading, *driven)

        def cost(reading: Sequence[Convention]) -> float:
            return self._by_likelihood(read_as(self.written, with_efforts(reading), self.drawn), few)

        if not first > FAR_LESS:
            return None
        few = evenly_spaced(len(self.rows), _SCANNED)
        found = with_efforts(quarter_turns(self.mechanism, list(self.written.positions), cost))
        if not found or not may_be_read(self.written, found) or not self._makes_sense(self.written, found):
            return None
        read = read_as(self.written, found, self.drawn)
        if not self._by_likelihood(read) < self._by_likelihood(begin):
            return None
        left = self.left(read)
        return _evidence(found, first, left) if left < 1 else None  # of all efforts: it makes no sense of the log

    def _by_likelihood(self, recording: Recording, rows: np.ndarray | None = None) -> float:
        """Return the geometric mean over the joints of what is left of each, as its noise may be any.

        So one that nothing explains hides no other. rows: by those samples alone.
        """
        shares = self.shares(recording, rows)
        return float(np.exp(np.nanmean(np.log(np.maximum(shares, LITTLE**2))) / 2))

    def _makes_sense(self, written: Recording, taken: Sequence[Convention]) -> bool:
        """Return whether a log leaves so much less as it is read, and less than where gravity may pull any way.

        Of all joints, or of those of which it changes what is left: the others cannot hide it. But axes that count
        together may be one motor that drives both: there bodies must speak for it, and most of all joints.
        """
        before, hung = self.shares(written), self._under_any_gravity(written)
        after = self.shares(read_as(written, taken, self.drawn))
        together = [item for item in taken if item.word in _TOGETHER]
        if together and rms(after) > MOSTLY * self._left_by_motors(written, taken):
            return False
        told = _explained_by_either(before, after)
        if rms(after[told]) < min(_limit(rms(before[told])), rms(hung[told])):
            return True
        if together:
            return False
        changed = told & _changed(before, after)
        if not changed.any():
            return False
        left = rms(before[changed])
        several = changed.sum() > 1 or left > 1
        return bool(several and rms(after[changed]) < min(FAR_LESS * min(left, 1.0), rms(hung[changed])))

    def _left_by_motors(self, written: Recording, taken: Sequence[Convention]) -> float:
        """Return what is left where only friction counts axes together, and bodies are as written: a share, RMS.

        So it is where one motor drives two joints.
        """
        axes = [item for item in taken if item.word in _TOGETHER]
        plain = read_as(written, [item for item in taken if item not in axes], self.drawn)
        rigid = self.at.rigid_of(self.read(plain)[0])
        still = np.zeros(len(plain) - len(rigid))
        own = {name: np.append(rigid[:, self.motion.driven.index(name)], still) for name in plain.efforts}
        motion, efforts, noise = self.read(read_as(plain, axes, self.drawn))
        _, bodies, _ = self.read(read_as(replace(plain, efforts=own), axes, self.drawn))
        return rms(shares_of_efforts(motion, efforts, bodies, noise))

    def left(self, recording: Recording, rows: np.ndarray | None = None) -> float:
        """Return what rigid efforts and friction leave of the efforts but noise: a share, RMS of the joints."""
        return rms(self.shares(recording, rows))

    def shares(self, recording: Recording, rows: np.ndarray | None = None) -> Array:
        """Return the same of the squares of each joint's effort (k,), beside a body that the tool may hold.

        rows: those samples alone.
        """
        motion, efforts, noise = self.read(recording, rows)
        try:
            rigid = self.at.rigid_of(motion)
        except InputError:  # loops that do not close
            return np.full(efforts.shape[1], np.inf)
        plain = shares_of_efforts(motion, efforts, rigid, noise)
        # of the log as it is written as well as of each reading, or one would be told for what the other may hold too
        if not _unexplained(plain) or (held := self._tool_load(motion, efforts, rigid)) is None:
            return plain
        return min(plain, shares_of_efforts(motion, efforts, rigid + held, noise), key=rms)

    def _tool_load(self, motion: Motion, efforts: Array, rigid: Array) -> Array | None:
        """Return the efforts (n, k) of the body at the tool that fits best; None where it could be none.

        A point of mass suffices to tell how columns are meant: no more than the robot weighs, no farther off than its
        longest link reaches.
        """
        tool, model = self.mechanism.tool, self.mechanism.model
        if tool is None or tool.joint == 0 or self.mechanism.loops:
            return None
        dynamics = self.at.dynamics
        held = dynamics.regressor(dynamics.trajectory(motion), motion.gravity)[:, :, tool.joint - 1, :4]
        mass, *moments = x = common_coefficients(motion, efforts, rigid, held)
        links = [float(np.linalg.norm(placement.translation)) for placement in model.jointPlacements]
        reach = max(links) + float(np.linalg.norm(tool.placement[:3, 3]))
        possible = 0 < mass < sum(float(body.mass) for body in model.inertias)
        return held @ x if possible and float(np.linalg.norm(moments)) <= mass * reach else None

    def _left_by_friction(self, recording: Recording) -> Array:
        """Return the shares of squares (k,) that are left where no joint needs more for its rigid body than it helps.

        Nor more than a constant does: what positions scatter by is less of a motion that is read in a smaller unit, in
        which the robot hardly moves, and neither speaks for the unit.
        """
        motion, efforts, noise = self.read(recording)
        rigid = self.at.rigid_of(motion)
        still = np.broadcast_to(efforts.mean(axis=0), efforts.shape)
        shares = (shares_of_efforts(motion, efforts, own, noise) for own in (rigid, np.zeros_like(rigid), still))
        return np.minimum.reduce(list(shares))

    def read(self, recording: Recording, rows: np.ndarray | None = None) -> tuple[Motion, Array, Array]:
        """Return motion, efforts (n, k) and their noise (k,) of samples, or of some rows, as a recording has them."""
        rows = np.arange(len(self.motion)) if rows is None else rows
        efforts = np.column_stack([recording.efforts[name] for name in self.motion.driven])
        noise = np.linalg.norm(efforts[len(self.motion) :], axis=0) * np.sqrt(len(rows) / len(self.motion))
        return _moved(self.motion, recording, rows), efforts[rows], noise

    def _forward(
        self, begin: Recording, first: Array
    ) -> tuple[tuple[Convention, ...], float, tuple[tuple[Convention, ...], ...]]:
        """Return what is read otherwise, one step after the other, what that leaves, and what would do as well.

        As far as each reading leaves less than friction alone would before it: it is to make sense of the rigid robot.
        first: shares of the squares of each joint (k,) that are left as it is written.
        """
        taken: tuple[Convention, ...] = ()
        others: tuple[tuple[Convention, ...], ...] = ()
        found = taken, rms(first), others
        now, least, without = begin, first, self._left_by_friction(begin)
        while len(taken) < _MOST:
            tried = []
            for step in self._readings(now):
                if not may_be_read(self.written, step):
                    continue
                if rms(first) <= FAR_LESS and any(item.word != "reversed" for item in step):
                    continue  # where most of a log fits, a joint or two count the other way round
                read = read_as(now, step, self.drawn)
                tried.append((self.shares(read), step, read))
            tried = [item for item in tried if rms(item[0]) < np.inf]
            if not tried:
                break
            # what takes more words must leave less for each of them
            cost = [rms(shares) * (1 + GAIN * len(step)) for shares, step, _ in tried]
            best = int(np.argmin(cost))
            shares, step, read = tried[best]
            least, without = (self._of_same_efforts(own, step) for own in (least, without))
            if not _makes_more(least, shares):
                break
            others = tuple(
                (*taken, *item[1])
                for place, item in enumerate(tried)
                if cost[place] < 1.01 * cost[best] and item[1] != step
            )
            taken, now, least = (*taken, *step), read, shares
            if _makes_more(without, shares, _changed(without, shares)):
                found = taken, rms(shares), others
            without = min(without, self._left_by_friction(now), key=rms)
        return found

    def _of_same_efforts(self, shares: Array, step: Sequence[Convention]) -> Array:
        """Return shares (k,) of efforts as they were before a step, in the order of the joints that they are after it.

        Drives that are exchanged are each compared with themselves.
        """
        out = shares.copy()
        for item in step:
            if item.group == "tau" and item.word == "order":
                table = zip(self.written.efforts, map(str, item.argument), strict=True)
                places = [(self.motion.driven.index(of), self.motion.driven.index(to)) for of, to in table]
                before = out.copy()
                for of, to in places:
                    out[to] = before[of]
        return out

    def _readings(self, recording: Recording) -> Iterator[tuple[Convention, ...]]:
        """Yield what columns may be instead, the commonest first."""
        motion, efforts, noise = self.read(recording)
        rigid = self.at.rigid_of(motion)
        driven, names = list(recording.efforts), list(recording.positions)
        written, read = (shares_of_efforts(motion, sign * efforts, rigid, noise) for sign in (1, -1))
        turned = read < MOST * written
        which = [name for name, other in zip(motion.driven, turned, strict=True) if other]
        if len(driven) > 1:
            yield (Convention("tau", "reversed"),)
        if which and len(which) < len(driven):
            # each joint's for itself: signs of efforts say nothing of one another
            yield tuple(Convention(f"tau.{name}", "reversed") for name in which)
        # beside a load each alone as well, which leaves little of what it bears whichever way that counts
        yield from ((Convention(f"tau.{name}", "reversed"),) for name in driven)
        if len(driven) > 1 and self.all_driven:
            yield from ((Convention("tau", "order", order),) for order in _orders(driven))
        slides = {name: self.mechanism.joint(name).slides for name in names}
        if len(names) > 1:
            yield (Convention("q", "reversed"),)
            yield (Convention("q", "reversed"), Convention("tau", "reversed"))
        for word in POSITION_UNITS:
            if any(slides[name] == word.slide for name in names):
                yield (Convention("q", word.name),)
        for name in names:
            yield (Convention(f"q.{name}", "reversed"),)
            if name in driven:
                yield Convention(f"q.{name}", "reversed"), Convention(f"tau.{name}", "reversed")
            yield from ((Convention(f"q.{name}", word.name),) for word in POSITION_UNITS if word.slide == slides[name])
        if len(names) > 1 and self.whole:
            yield from ((Convention("q", "order", order),) for order in _orders(names))
            if names == driven:
                yield from ((Convention("q", "order", order), Convention("tau", "order", order))
                            for order in _orders(names))  # fmt: skip
        for before, after in pairwise(names):
            for own, other in ((after, before), (before, after)):
                for way, dual in (("plus", "minus"), ("minus", "plus")):
                    with_other = Convention(f"q.{own}", way, (other,))
                    yield (with_other,)
                    if own in driven and other in driven:
                        yield with_other, Convention(f"tau.{other}", dual, (own,))

    def _unit(self, signed: dict[str, float]) -> Convention | None:
        """Return the unit of all efforts where they are nearly as many times the rigid robot's at every joint."""
        sizes = np.abs(list(signed.values()))
        if in_any_unit(self.recording.tolerances.declared):
            return None  # which is declared to be anything
        if not may_be_read(self.written, [Convention("tau", "gain", (1.0,))]):
            return None  # which is declared to be what it says
        if any(item.columns == "tau" and item.word in _OF_UNIT for item in self.recording.conventions):
            return None  # which is declared
        if len(sizes) < min(2, len(self.motion.driven)) or not self._carry_most(signed):
            return None
        usual = float(np.median(sizes))
        # a load may make some of them larger besides
        apart, alike = np.log(sizes / usual), np.log(ROUGHLY)
        most = float(np.mean(np.abs(apart) < alike)) > MOST and apart.min() > -alike
        if abs(np.log(usual)) < np.log(AS_GOOD) or not most:
            return None
        # masses are known to tens of per cent: what only one drive tells has no unit's name
        unit = unit_of_all(usual, self.mechanism, self.motion.driven) if len(sizes) > 1 else gain_of("tau", usual)
        if unit.word == "gain":
            # what one drive or two move may be many times as heavy as drawn, with rotors and loads, but not far lighter
            few = len(sizes) < FEWEST_OF_KIND
            would_do = FAR_LESS < usual < LITTLE**-2 if few else self._load_would_do(usual)
            return None if would_do else unit
        return unit

    def _carry_most(self, joints: Collection[str]) -> bool:
        """Return whether some joints are half of all drives, or carry nearly all that the rigid robot takes."""
        own = [name in joints for name in self.motion.driven]
        squares = np.sum(self.rigid**2, axis=0)
        return 2 * sum(own) >= len(own) or float(squares[own].sum()) > MOSTLY * float(squares.sum())

    def _load_would_do(self, gain: float) -> bool:
        return tool_load_would_do(self.at, dict.fromkeys(self.motion.driven, gain))

    def _before_gears(self, first: float) -> Evidence | None:
        """Return that positions are the motors', before gears of one ratio; and efforts too, where these are so."""
        if self.mechanism.loops or not first > FAR_LESS or self.at.motion.standing:
            return None
        if not may_be_read(self.written, [Convention("q", "reversed")]):
            return None
        few = evenly_spaced(len(self.rows), _SCANNED)
        tried = []
        for ratio in GEARS:
            read = read_as(self.written, [Convention("q", "gear", (ratio,))], self.drawn)
            moved, efforts, _ = self.read(read, few)
            tried.append((left_at_any_gain(moved, efforts, self.at.rigid_of(moved)), ratio))
        found = []
        for _, ratio in sorted(tried)[:_RATIOS]:
            steps = [Convention("q", "gear", (ratio,))]
            read = read_as(self.written, steps, self.drawn)
            moved, efforts, _ = self.read(read)
            gains = list(gains_of_efforts(moved, efforts, self.at.rigid_of(moved)).values())
            if gains and abs(np.log(np.median(np.abs(gains)) * ratio)) < np.log(AS_GOOD) / 2:
                steps.append(Convention("tau", "gear", (ratio,)))
                read = read_as(read, steps[1:], self.drawn)
            found.append((self.left(read), ratio, tuple(steps)))
        best = min(item[0] for item in found)
        near = [item for item in found if item[0] <= 1.03 * best]
        least, _, taken = min(near, key=lambda item: (_unusual(item[1]), item[0]))
        if not least < min(_limit(first), MOSTLY * rms(self._left_by_friction(self.written))):
            return None
        return _evidence(taken, first, least)

    def _under_any_gravity(self, recording: Recording) -> Array:
        """Return what is left of each joint (k,) where gravity may pull any way, which turned columns imitate."""
        motion, efforts, noise = self.read(recording)
        never = np.full(efforts.shape[1], np.inf)
        if not self.mechanism.gravity.any():
            return never
        more = common_coefficients(motion, efforts, self.rigid, self._pulled)
        if not could_be_gravity(self.mechanism.gravity + more, self.mechanism):
            return never
        return shares_of_efforts(motion, efforts, self.rigid + self._pulled @ more, noise)


def _is_likely(reading: Sequence[Convention]) -> bool:
    """Return whether a reading is one of signs and orders: of units and sums a robot that is off tells too little."""
    return all(item.word in ("reversed", "order") for item in reading)


def _price(reading: Sequence[Convention]) -> float:
    """Return what a reading costs, in nats."""
    return sum(_ORDER if item.word == "order" else _WORD for item in reading)


def _limit(written: float) -> float:
    """Return the share that a reading must come below where a log leaves so much as it is written.

    What is worse than no effort at all is turned round somewhere, whatever else is off. Where it is a joint or two of
    many, laws could take as much away.
    """
    if written < FAR_LESS:
        return FAR_LESS * written
    return max(MOST * min(written, 1.0), min(FAR_LESS * written, MOSTLY))


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


def _orders(names: Sequence[str]) -> Iterator[tuple[str, ...]]:
    """Yield orders of columns: the opposite one, and any two exchanged."""
    if len(names) > 2:
        yield tuple(reversed(names))
    yield from exchanged(names)


def _explained_by_either(one: Array, other: Array) -> np.ndarray:
    """Return the joints (k,) of which either of two readings makes sense: what neither explains speaks for none."""
    told = np.fmin(one, other) < MOSTLY**2
    return told if told.any() else np.ones(len(one), bool)


def _changed(one: Array, other: Array) -> np.ndarray:
    """Return the joints (k,) of which two readings leave different shares of the squares."""
    return (np.minimum(one, other) < ALIKE * np.maximum(one, other)) & np.isfinite(one)


def _makes_more(before: Array, after: Array, among: np.ndarray | bool = True) -> bool:
    """Return whether a reading makes more sense of joints than one before it; shares of squares (k,) that are left."""
    told = _explained_by_either(before, after) & among
    return rms(after[told]) < MOSTLY * rms(before[told])


def _unexplained(shares: Array) -> bool:
    """Return whether of any joint more is left than a reading must come below, by shares of squares (k,)."""
    return bool(np.nanmax(shares, initial=0.0) > FAR_LESS**2)
