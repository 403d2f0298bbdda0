"""A sensor's law in one of several recordings: what is off there need not be off in the others."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

from ..mechanism import Mechanism
from .deeds import Deed
from .deviations import Calibration, calibration_of
from .law import Effect, Law, Place, Sharing
from .of_another import OfAnother
from .setup import Setup


class InRecording(OfAnother):
    """A law of a sensor at the samples of those recordings alone that share it.

    The place's aspect names the recording where it is alone: 'in friday.csv'.
    """

    group: Sharing

    def __init__(self, law: Law, group: Sharing):
        super().__init__(law, quantities=law.quantities)
        self.group = group
        self._words = f" in {group.label}" if group.label else ""

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place(name, f"{aspect}{self._words}".strip()) for name, aspect in self.law.places(mechanism)]

    def inner(self, place: Place, mechanism: Mechanism) -> Place:
        return Place(place.name, f" {place.aspect}".removesuffix(self._words).strip())

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        rows = setup.inputs.from_sources(self.group.sources)
        for deed in self.law.deeds(self.inner(place, setup.mechanism), values, setup):
            yield deed.within(rows)

    def same_places(self, place: Place, mechanism: Mechanism) -> Sequence[str]:
        return self.law.same_places(self.inner(place, mechanism), mechanism)

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"{self.law.statement(self.inner(place, mechanism), values, mechanism)}{self._words}"


def in_groups(law: Law, groups: Mapping[str, Sequence[Sharing]], alone: Sequence[Sharing] = ()) -> Iterator[Law]:
    """Yield a law once for each group of recordings that shares its sensor, or the law itself where all share it.

    groups: by the sensors that not all recordings share; alone: each recording, where there are several. A pose sensor
    that all share wanders in each for itself, and may have been pushed before any but the first.
    """
    if alone and law.sensor == "pose_sensor" and "pose_sensor" not in groups:
        if law.lasts:
            yield law
        yield from (InRecording(law, group) for group in alone[1 if law.lasts else 0 :])
        return
    if law.sensor in groups:
        yield from (InRecording(law, group) for group in groups[law.sensor])
    else:
        yield law


def lasting(effects: Iterable[Effect], mechanism: Mechanism) -> tuple[Effect, ...]:
    """Return effects without what is off in single recordings, or goes on in one: that tells nothing of another."""
    found = []
    for effect in effects:
        law = effect.law
        if isinstance(law, Calibration):
            kept = {item.name for item in law.deviations if item.group is None or not item.group.label}
            values = {name: value for name, value in effect.values.items() if name in kept}
            found.append(Effect(calibration_of(mechanism), effect.place, values))
        elif not law.lasts:
            continue
        elif not isinstance(law, InRecording):
            found.append(effect)
        elif not law.group.label:
            found.append(Effect(law.law, effect.place, effect.values))
    return tuple(found)
