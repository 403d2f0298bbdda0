"""What a diagnosis found before, as one law whose values may be others by now, and the change of one of its effects.

`AsFound` acts from the start of a later simulation: its values are known within what the earlier recording told of
them. `ChangedEffect` is one of its effects with values that nothing holds: it enters in the place of that effect.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import ClassVar

from ..mechanism import Mechanism
from ..parameters import Quantity
from .deeds import Deed, Solved
from .deviations import Calibration, Deviation
from .drawn import Drawn
from .law import Effect, Law, Place
from .of_another import OfAnother
from .setup import Setup


def value_name(effect: Effect, parameter: str) -> str:
    """Return the name that a value of an effect has among those of all effects."""
    if isinstance(effect.law, Calibration):
        return parameter
    return f"{effect.law.physics} at {effect.place}: {parameter}"


class AsFound(Law):
    """All effects that a diagnosis found, in their order, at values of which some may be others by now.

    deviations: those that may be, in amounts beside the robot file, or beside what was found where that has none.
    """

    physics = "as_found"
    summary = "all that was found before"
    quantities = ()
    neutral: ClassVar = {}
    partial = True
    is_all_that_acts = True

    def __init__(self, effects: Sequence[Effect], deviations: Sequence[Deviation]):
        self.effects, self.deviations = tuple(effects), tuple(deviations)

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place("robot")]

    def at(self, values: Mapping[str, float]) -> tuple[Effect, ...]:
        """Return the effects, with other values where `values` names them (`value_name`)."""
        return tuple(
            replace(
                effect, values={name: values.get(value_name(effect, name), was) for name, was in effect.values.items()}
            )
            for effect in self.effects
        )

    def with_changed(self, values: Mapping[str, float], changed: Iterable[Effect]) -> dict[str, float]:
        """Return values with those of effects that have changed."""
        return dict(values) | {value_name(item, name): value for item in changed for name, value in item.values.items()}

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        now = setup.copy()
        for effect in self.at(values):
            deeds = effect.deeds(now)
            now.take(deeds)
            yield from deeds

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return "; ".join(effect.statement(mechanism) for effect in self.at(values)) or "nothing was found before"


#: What is known to be there grows sooner than another of its kind comes beside it: twenty to one, in chi squared.
_LIKELIER = 6.0


class ChangedEffect(OfAnother):
    """An effect that was found before and has other values by now. In a simulation it stands in that one's place."""

    instead_of: Effect

    def __init__(self, before: Effect):
        super().__init__(before.law, quantities=before.law.quantities, cost=before.law.cost - _LIKELIER)
        self.instead_of = before

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [self.instead_of.place]

    def is_named(self, place: Place) -> bool:
        return place == self.instead_of.place

    def inner(self, place: Place, mechanism: Mechanism) -> Place:
        return place

    def starts(self, place: Place, mechanism: Mechanism) -> Sequence[Mapping[str, float]]:
        return [self._before(self.quantities_at(place, mechanism))]

    def _before(self, quantities: Sequence[Quantity]) -> dict[str, float]:
        return {item.name: self.instead_of.values.get(item.name, float(item.default)) for item in quantities}  # type: ignore[arg-type]

    def neutral_at(self, place: Place, mechanism: Mechanism) -> Mapping[str, float]:
        return self.starts(place, mechanism)[0]

    def same_places(self, place: Place, mechanism: Mechanism) -> Sequence[str]:
        return self.law.same_places(place, mechanism)

    def apart(self, place: Place, mechanism: Mechanism) -> Mapping[str, Place]:
        return {}

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        return self.law.deeds(place, values, setup)

    def drawn(self, place: Place, at: Solved) -> Drawn | None:
        return self.law.drawn(place, at)

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return self.law.statement(place, values, mechanism)

    def told(
        self,
        place: Place,
        values: Mapping[str, float],
        intervals: Mapping[str, tuple[float, float]],
        mechanism: Mechanism,
    ) -> str:
        return self.law.told(place, values, intervals, mechanism)


#: What a law says of the robot file, and what it means of a robot that acts as it was found before.
_WORDS = {
    "the robot file's": "what it was",
    "where the drawing has it": "where it was",
    "tolerances away from the robot file": "standard deviations away from what it was known to be",
    "where it just stands there, declare it (tolerances frame_position and frame_rotation)": "it has been moved",
}


def said_of_change(statement: str) -> str:
    """Return a law's statement of what comes on top of what was found before."""
    for words, others in _WORDS.items():
        statement = statement.replace(words, others)
    return statement


def said_of_calibrated(statement: str, values: Sequence[str] | None) -> str:
    """Return a law's statement of what comes on top of these values within tolerances; None: of the robot file's."""
    if values is None:
        return statement
    return statement.replace("the robot file's", ", ".join(("its calibrated value", *values)))
