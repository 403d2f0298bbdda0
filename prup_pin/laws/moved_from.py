"""A sensor, or what it sees, that was moved while it measured: from a moment of the recording on it is off."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial

from ..mechanism import Mechanism
from ..numbers import number
from .deeds import Deed
from .law import Effect, Law, Place
from .pose_sensor import PoseSensorMisalignment
from .setup import Setup
from .target import TargetMisalignment


class MovedFrom(Law):
    """A sensor's law from a `moment` on [s since the recording began], which data have told.

    A tripod that somebody pushed, a target that somebody hit. what, by: what is moved, and what
    moved it, in words.
    """

    lasts = False

    def __init__(self, law: Law, what: str, by: str, remedy: str, moment: float):
        self.law, self.moment, self.by = law, moment, by
        vars(self).update(
            physics=law.physics, sensor=law.sensor, quantities=law.quantities, neutral=law.neutral,
            summary=f"{what} that was moved meanwhile", remedy=remedy,
        )  # fmt: skip

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place(name, f"from {number(self.moment, 6)} s on") for name, _ in self.law.places(mechanism)]

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        later = setup.inputs.elapsed >= self.moment
        for deed in self.law.deeds(Place(place.name), values, setup):
            yield deed.within(later)

    def same_places(self, place: Place, mechanism: Mechanism) -> Sequence[str]:
        return self.law.same_places(Place(place.name), mechanism)

    def meanwhile(self, values: Mapping[str, float], mechanism: Mechanism, elapsed: float) -> Effect | None:
        if elapsed < self.moment:
            return None
        return Effect(self.law, self.law.places(mechanism)[0], values)

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        said = self.law.statement(Place(place.name), values, mechanism)
        return f"{said} from {number(self.moment, 6)} s on: {self.by}"


_DECLARE = "by runs (a column run, own_sensors by_run)"
#: What may be moved while it is measured: functions that take the moment [s] and return the law. To add one: a line.
MOVABLE: tuple[Callable[[float], Law], ...] = (
    partial(
        MovedFrom, PoseSensorMisalignment(), "a pose sensor", "somebody or something moved it, or the target",
        f"look after what moved the tracker, and declare how it stood {_DECLARE}",
    ),
    partial(
        MovedFrom, TargetMisalignment(), "a target", "somebody or something moved it on the tool",
        f"look after what moved the target on the tool, and declare how it sat {_DECLARE}",
    ),
)  # fmt: skip
