"""Ways in which a log may be written otherwise than it says: which are tried, and how the likeliest is found.

A reading is one convention, or some that are taken together because none of them alone brings a log nearer. What a
convention does to a recording, how it is declared and how it is told stands with its word, in
`recordings/conventions.py: WORDS`; with which columns and arguments it is tried stands here, one function for each
kind, in `READINGS`. What else a channel adds is how unlikely a log is as it is read: by poses, by loads, by efforts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise, permutations, product
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from ..mechanism import Mechanism
from ..recordings import WORDS, Convention, Recording
from ..recordings.conventions import AS_WRITTEN, AXES, GEARS, POSITION_UNITS, is_right_handed, may_be_read
from .criteria import FEW_ROUNDS

Reading = tuple[Convention, ...]
#: Readings that are taken one after the other, at most.
_MOST = 2 * FEW_ROUNDS


@dataclass(frozen=True)
class Columns:
    """The columns of a log that may be read otherwise, by their groups: joints as they stand in the table.

    q, tau: joints whose positions and efforts are compared; slides: those of them that slide; q_whole, tau_whole:
    whether these are all columns that the log has. chain: joints follow one another, and none closes a loop; spins:
    some turn more than once round.
    """

    q: tuple[str, ...] = ()
    tau: tuple[str, ...] = ()
    slides: frozenset[str] = frozenset()
    q_whole: bool = True
    tau_whole: bool = True
    chain: bool = True
    spins: bool = True

    @classmethod
    def of(cls, mechanism: Mechanism, recording: Recording, q: Sequence[str], tau: Sequence[str] = ()) -> Columns:
        """Return the columns of joints q and tau that a recording has."""
        most = [np.nanmax(np.abs(recording.positions[name]), initial=0.0) for name in q]
        return cls(
            tuple(q),
            tuple(tau),
            frozenset(name for name in (*q, *tau) if mechanism.joint(name).slides),
            list(recording.positions) == list(q),
            list(recording.efforts) == list(tau),
            not mechanism.loops,
            max(most, default=0.0) > 2 * np.pi,
        )

    def units(self, name: str) -> Iterator[str]:
        """Yield the units in which a joint's position may be."""
        return (word.name for word in POSITION_UNITS if word.slide == (name in self.slides))

    def both(self, name: str = "") -> Iterator[Reading]:
        """Yield what turns round: positions, efforts, or both, of one joint or of all."""
        q = [Convention(f"q.{name}" if name else "q", "reversed")] if not name or name in self.q else []
        tau = [Convention(f"tau.{name}" if name else "tau", "reversed")] if not name or name in self.tau else []
        q, tau = q if self.q else [], tau if self.tau else []
        yield from ((item,) for item in (*tau, *q))
        if q and tau:
            yield (*q, *tau)


def _signs_of_all(columns: Columns) -> Iterator[Reading]:
    yield from columns.both()


def _units_of_all(columns: Columns) -> Iterator[Reading]:
    """Yield units of all that slides, of all that turns, and of both, since neither alone closes a loop."""
    kinds = [
        [Convention("q", word.name) for word in POSITION_UNITS if word.slide == slide]
        for slide in (True, False)
        if any((name in columns.slides) == slide for name in columns.q)
    ]
    yield from ((unit,) for units in kinds for unit in units)
    if len(kinds) > 1:
        yield from product(*kinds)


def _signs_of_each(columns: Columns) -> Iterator[Reading]:
    for name in dict.fromkeys((*columns.tau, *columns.q)) if max(len(columns.q), len(columns.tau)) > 1 else ():
        yield from columns.both(name)


def _units_of_each(columns: Columns) -> Iterator[Reading]:
    for name in columns.q if len(columns.q) > 1 else ():
        yield from ((Convention(f"q.{name}", word),) for word in columns.units(name))


def orders(names: Sequence[str]) -> Iterator[tuple[str, ...]]:
    """Yield orders of columns: the opposite one, others round, any two exchanged; of few columns every one."""
    if len(names) < 4:
        yield from list(permutations(names))[1:]
        return
    yield tuple(reversed(names))
    for places in range(1, len(names)):
        yield (*names[places:], *names[:places])
    for a, b in combinations(range(len(names)), 2):
        other = list(names)
        other[a], other[b] = other[b], other[a]
        yield tuple(other)


def _orders(columns: Columns) -> Iterator[Reading]:
    for group, names, whole in (("tau", columns.tau, columns.tau_whole), ("q", columns.q, columns.q_whole)):
        if whole:
            yield from ((Convention(group, "order", order),) for order in orders(names))
    if columns.q == columns.tau and columns.q_whole and columns.tau_whole:
        yield from ((Convention("q", "order", order), Convention("tau", "order", order)) for order in orders(columns.q))


def _sums(columns: Columns) -> Iterator[Reading]:
    """Yield axes that count together with a neighbour; efforts of such ones do the same work."""
    for pair in pairwise(columns.q) if columns.chain else ():
        for (own, other), (way, dual) in product((pair[::-1], pair), (("plus", "minus"), ("minus", "plus"))):
            if (own in columns.slides) == (other in columns.slides):
                coupled = Convention(f"q.{own}", way, (other,))
                yield (coupled,)
                if {own, other} <= {*columns.tau}:
                    yield coupled, Convention(f"tau.{other}", dual, (own,))


def _gears(columns: Columns) -> Iterator[Reading]:
    """Yield that positions are the motors', before gears of one ratio, and efforts too."""
    for ratio in GEARS if columns.chain and columns.spins and columns.q else ():
        for groups in (("q",), ("q", "tau")) if columns.tau else (("q",),):
            yield tuple(Convention(group, "gear", (ratio,)) for group in groups)


def _zeros(columns: Columns) -> Iterator[Reading]:
    """Yield where joints count from, and which way, one joint and two neighbours at a time.

    A table of Denavit and Hartenberg has other zeros than a robot file, and a controller others again; no single joint
    that is read otherwise makes sense of a log in which two of them are. Of loops all count alike.
    """

    def ways(name: str) -> Iterator[Reading]:
        yield ()
        turned = list(columns.both(name))[-1:]
        for way in ((), *turned):
            yield from (
                (*way, Convention(f"q.{name}" if name else "q", "quarter_turns", (n,))) for n in (1.0, 2.0, 3.0)
            )
        yield from turned

    turning = [name for name in columns.q if name not in columns.slides]
    if not columns.chain or len(turning) < 2:
        yield from (way for way in ways("") if way and turning)
        return
    for pair in pairwise(turning):
        yield from ((*one, *other) for one, other in product(*map(ways, pair)) if one or other)


def _plain(*groups: str) -> Iterator[Reading]:
    """Yield all words of groups of columns that take nothing, but that they are as they say."""
    words = [word for word in WORDS if not word.takes and word.name != AS_WRITTEN]
    for group in groups:
        yield from ((Convention(group, word.name),) for word in words if group in word.groups)


def _along(*words: tuple[str, str]) -> Iterator[Reading]:
    """Yield words that take axes, of groups of columns: those that may be mirrored, and those that may not."""
    for axes in AXES:
        for group, word in words:
            if word == "axes" or is_right_handed(axes):
                yield (Convention(group, word, axes),)


def _of_positions(columns: Columns) -> Iterator[Reading]:
    yield from (reading for reading in _plain("p") if reading[0].word != "reversed")  # a mirror, which axes are too
    yield from _along(("p", "axes"))


def _of_orientations(columns: Columns) -> Iterator[Reading]:
    yield from _plain("r")
    yield from _along(("r", "axes"), ("r", "base_axes"), ("r", "tool_axes"))


def _of_wrench(columns: Columns) -> Iterator[Reading]:
    reaction, *others = (reading for reading in _plain("wrench") if reading[0].word != "reversed")
    yield from (reaction, *others, *_plain("force", "moment"))
    yield from ((*reaction, *other) for other in others)  # neither alone comes nearer


def _of_wrench_axes(columns: Columns) -> Iterator[Reading]:
    yield from (reading for reading in _along(("wrench", "axes")) if reading[0].argument != ("-x", "-y", "-z"))


class Kind(NamedTuple):
    """Readings of one kind: what they are of, how many kinds are commoner, and a function that yields them."""

    of: str
    rarer_than: int
    yielded: Callable[[Columns], Iterator[Reading]]


#: Every kind of reading that is tried. To add one: its function, and its line here.
READINGS = (
    Kind("joints", 0, _signs_of_all),
    Kind("joints", 0, _units_of_all),
    Kind("joints", 1, _signs_of_each),
    Kind("joints", 1, _units_of_each),
    Kind("joints", 1, _orders),
    Kind("joints", 1, _sums),
    Kind("joints", 2, _gears),
    Kind("zeros", 2, _zeros),
    Kind("positions", 0, _of_positions),
    Kind("orientations", 0, _of_orientations),
    Kind("wrench", 0, _of_wrench),
    Kind("wrench", 1, _of_wrench_axes),
)


def readings(recording: Recording, columns: Columns, *of: str, second: bool = False) -> Iterator[list[Reading]]:
    """Yield lists of readings of what is asked, the commonest first, but what a log declares to be as it says.

    second: beside another reading: of the rarest, those that are not of two joints.
    """
    seen: set[Reading] = set()
    for rarer_than in range(3):
        kinds = (kind for kind in READINGS if kind.of in of and kind.rarer_than == rarer_than)
        found = dict.fromkeys(reading for kind in kinds for reading in kind.yielded(columns) if reading not in seen)
        seen |= found.keys()
        some = [reading for reading in found if may_be_read(recording, reading)]
        if second and rarer_than == 2:
            some = [reading for reading in some if len({item.joint for item in reading}) == 1]
        if some:
            yield some


S = TypeVar("S")


class Tried(NamedTuple, Generic[S]):
    """A reading, the log as it is read so, how well that fits, and the same as a cost; beside: what is read with it.

    wins: whether it is better than none, by the margin of each of its steps.
    """

    cost: float
    reading: Reading
    read: Recording
    score: S
    beside: Reading = ()
    wins: bool = True


class Found(NamedTuple, Generic[S]):
    """Conventions, the log as it is read by them, how well that fits, and other conventions that are as good."""

    conventions: Reading
    read: Recording
    score: S
    others: tuple[Reading, ...] = ()


def likeliest(
    written: Recording,
    score: S,
    tries: Callable[[Recording, S, Reading, Tried[S] | None, Reading], Sequence[Tried[S]]],
    as_good: float,
    firsts: int = 0,
) -> Found[S]:
    """Return the readings by which a log fits best, one after the other, as far as any is better than none.

    Where no single one is, two are, of which the first is one of so many that come nearest. as_good: what two of them
    cost that are as good, of which the first is taken. tries: tries readings of a log that fits by a score, beside
    those taken; beside a first one those that are to be better with it than none; or one that is given and no other.
    """
    taken: Reading = ()
    others: list[tuple[Tried[S], S, Reading]] = []
    read = written
    for _ in range(_MOST):
        tried = tries(read, score, taken, None, ())
        if not taken and not any(item.wins for item in tried):
            nearest: dict[object, Tried[S]] = {}  # one of a kind: a ratio next to another one is as near
            for item in sorted(tried, key=lambda item: round(item.cost, 2)):
                nearest.setdefault(tuple((each.columns, each.word) for each in item.reading), item)
            tried = [item for first in list(nearest.values())[:firsts] for item in tries(read, score, taken, first, ())]
        if not (tried := [item for item in tried if item.wins]):
            break
        next_one = min(tried, key=lambda item: round(item.cost, 2)).reading
        rivals = [(item, score, taken) for item in tried]
        # what was as good as an earlier reading is asked beside this one, too: it may be worse now, or better
        rivals += [
            (item, before, had)
            for first, before, had in others
            for item in tries(first.read, before, had, first, next_one)
        ]
        best, _, had = min((each for each in rivals if each[0].wins), key=lambda each: round(each[0].cost, 2))
        others = [
            each
            for each in rivals
            if each[0].cost < best.cost + as_good and each[0] is not best and not _same(each[0].read, best.read)
        ]
        taken, read, score = (*had, *best.reading), best.read, best.score
    alike = ((*item.beside, *had, *item.reading) for item, _, had in others)
    return Found(taken, read, score, tuple(dict.fromkeys(alike)))


def _same(one: Recording, other: Recording) -> bool:
    """Return whether two readings are one: that of an axis along which nothing was measured, say."""
    both = zip(_values(one), _values(other), strict=True)
    return all(np.array_equal(values, others, equal_nan=True) for values, others in both)


def _values(recording: Recording) -> list[np.ndarray]:
    given = (recording.position, recording.rotation, *recording.markers.values(), *recording.marker_rotations.values())
    joints = (*recording.positions.values(), *recording.efforts.values())
    return [recording.wrench, *joints, *(values for values in given if values is not None)]
