"""One law at all like places of a robot, with one value: three screws that warm up alike."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from types import MappingProxyType

from ..mechanism import Mechanism
from .deeds import Deed
from .law import Law, Place
from .of_another import OfAnother
from .setup import Setup

#: The place of what is everywhere alike.
ROBOT = "robot"
#: What tells legs apart in names: 'leg1/ball_nut', 'motor2', 'left_elbow'.
_LEG = re.compile(r"\d+|(?<![a-z])(?:left|right)(?![a-z])")
#: What it must explain more than a law at one place, in units of chi squared: most faults sit in one part.
_COST = 6.0


class Everywhere(OfAnother):
    """The same law at all places whose names differ only in the leg, with one value for all of them.

    Of a cause that places share whatever their names, at all there are. The place is the robot; its aspect says which
    parts: 'ball_nut', 'R_lambda radial', 'leg*_slide', 'each drive'.
    """

    shared = True

    def __init__(self, law: Law):
        super().__init__(law, summary=f"{law.summary}, at all like places", cost=law.cost + _COST)

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place(ROBOT, aspect) for aspect in self.like(mechanism)]

    def is_named(self, place: Place) -> bool:
        return place.name == ROBOT

    def like(self, mechanism: Mechanism) -> Mapping[str, Sequence[Place]]:
        """Return the like places of the law, two of them or more, by what they are called together."""
        return _like(self.law, mechanism)

    def at(self, place: Place, mechanism: Mechanism) -> Sequence[Place]:
        """Return the like places that a place of this law stands for."""
        return self.like(mechanism)[place.aspect]

    def inner(self, place: Place, mechanism: Mechanism) -> Place:
        return self.at(place, mechanism)[0]

    def same_places(self, place: Place, mechanism: Mechanism) -> Sequence[str]:
        return [each.name for each in self.at(place, mechanism)]

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        for each in self.at(place, setup.mechanism):
            yield from self.law.deeds(each, values, setup)

    def advice(self, place: Place, values: Mapping[str, float]) -> str:
        return self.law.advice(Place(f"each {place.aspect.removeprefix('each ')}"), values)

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        places = self.at(place, mechanism)
        names = [each.name for each in places]
        alike = f"each of {', '.join(names[:-1])} and {names[-1]}"
        return self.law.statement(places[0], values, mechanism).replace(names[0], alike) + ", all alike"


@lru_cache(maxsize=128)  # asked for at every step of a fit
def _like(law: Law, mechanism: Mechanism) -> Mapping[str, Sequence[Place]]:
    found: dict[tuple, list[Place]] = {}
    for place in law.places(mechanism):
        key = _without_leg(place.name), place.aspect, law.quantities_at(place, mechanism)
        found.setdefault(key, []).append(place)
    groups = {key: places for key, places in found.items() if len(places) > 1 and "*" in key[0]}
    shorts = {name: name.partition("*/")[2] or name for name, _, _ in groups}
    named = {}
    for (name, aspect, _), places in groups.items():
        short = shorts[name]
        own = short if list(shorts.values()).count(short) == 1 else name
        named[f"{own} {aspect}".rstrip()] = tuple(places)
    every = tuple(law.places(mechanism))
    if law.all_places and len(every) > 1 and every not in named.values():
        named[law.all_places] = every
    return MappingProxyType(named)


def _without_leg(name: str) -> str:
    """Return a name with a star for its leg."""
    return _LEG.sub("*", name, count=1)
