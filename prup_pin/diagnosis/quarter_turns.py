"""Where joints count from, and which way: drawings, controllers and textbooks disagree by quarter turns.

A table of Denavit and Hartenberg has other zeros than a robot file, and a controller others again. No single joint that
is read otherwise makes sense of a log in which two of them are, so neighbours are read otherwise together, one pair
after the other, until none is any better.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise, product

from ..mechanism import Mechanism
from ..recordings import Convention
from .criteria import FEW_ROUNDS, MOSTLY

_Reading = tuple[Convention, ...]


def quarter_turns(mechanism: Mechanism, names: Sequence[str], cost: Callable[[_Reading], float]) -> _Reading:
    """Return how positions of joints `names` may be written, in quarter turns and either way, so that it costs least.

    cost: of what a log leaves as it is read by conventions; each must leave MOSTLY of what was left without. Of
    loops, whose joints do not go one by one, all together are tried.
    """
    turning = [name for name in names if mechanism.joint(name).turns]
    if mechanism.loops or len(turning) < 2:
        return min(((), *_ways("q", bool(turning))), key=lambda reading: _weighed(cost, reading))
    chosen: dict[str, _Reading] = dict.fromkeys(turning, ())
    least = _weighed(cost, ())
    for _ in range(FEW_ROUNDS):
        before = dict(chosen)
        for pair in pairwise(turning):
            for ways in product(*(((), *_ways(f"q.{name}", True)) for name in pair)):
                tried = chosen | dict(zip(pair, ways, strict=True))
                this = _weighed(cost, _flat(tried))
                if this < least:
                    chosen, least = tried, this
        if chosen == before:
            break
    return _flat(chosen)


def _weighed(cost: Callable[[_Reading], float], reading: _Reading) -> float:
    return cost(reading) / MOSTLY ** len(reading)


def _flat(chosen: dict[str, _Reading]) -> _Reading:
    return tuple(convention for reading in chosen.values() for convention in reading)


def _ways(columns: str, turns: bool) -> Iterator[_Reading]:
    """Yield how positions of a joint, or of all, may be written: the other way round, and from elsewhere."""
    for way in ((), (Convention(columns, "reversed"),)):
        yield from ((*way, Convention(columns, "quarter_turns", (n,))) for n in (1.0, 2.0, 3.0) if turns)
        if way:
            yield way
