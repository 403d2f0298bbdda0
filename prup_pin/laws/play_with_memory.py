"""Gaps that stay as they are until something takes them to their other side."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from ..mechanism import Mechanism
from ..numbers import quantity
from ..parameters import Quantity
from ..spatial import Array
from .backlash import Backlash, gap_of
from .deeds import Deed, Felt, RememberedStrain, Travel
from .law import Law, Place
from .modules_at import actuator_places, actuator_slides, drive_of, turns, yielding
from .setup import Setup

_BEGUN = Quantity("begun", "1", "where in the gap a run begins, -1 and 1 its ends", 0.5, False, lower=-1.0, upper=1.0)


class HeldBacklash(Law):
    """Play that friction or preload holds where it is until the load is large enough to take it to the other side.

    e = min(max(e before, g tanh((F - H) / F_0)), g tanh((F + H) / F_0)), g the half gap, H the holding load and F_0 the
    closing load: a play operator between two curves. With H = 0 it has no memory and is `Backlash`.
    """

    physics = Backlash.physics
    summary = "play that stays where it was pushed"
    remedy = Backlash.remedy
    source = "Visintin, Differential Models of Hysteresis, ch. III.2 (generalized play)"
    likely = Backlash.likely
    variant = "held"
    cost = 6.0
    quantities = (
        *Backlash.quantities[:1],
        Quantity("holding_load", "N", "load below which the gap stays as it is", 1.0, upper=1e6),
        Backlash.quantities[1],
        _BEGUN,
    )
    neutral: ClassVar = {"half_gap": 0.0}
    closes_within = "closing_load"
    strong = Backlash.strong
    optional = ("begun",)

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place(place.name, self.variant) for place in yielding(mechanism, ("",))]

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        gap, closing = Backlash().quantities_at(Place(place.name), mechanism)
        _, holding, _, begun = self.quantities
        return gap, replace(holding, unit=closing.unit, default=closing.default), closing, begun

    def seen_at(self, place: Place, mechanism: Mechanism, felt: Felt, interval: float) -> tuple[Quantity, ...]:
        gap, holding, closing, begun = self.quantities_at(place, mechanism)
        if not felt.load > 0:
            return gap, holding, closing, begun
        holds = _HOLDS * felt.load
        # what no load moves is no play, and what closes as slowly as that another spring
        holding = replace(holding, default=holds, upper=felt.load)
        least = min(closing.lower, _CLOSES**2 * holds)
        return gap, holding, replace(closing, default=_CLOSES * holds, lower=least, upper=felt.load), begun

    def starts(self, place: Place, mechanism: Mechanism) -> Sequence[Mapping[str, float]]:
        (start,) = super().starts(place, mechanism)
        loads = {name: start[name] for name in ("holding_load", "closing_load")}
        return [{**start, **{name: times * load for name, load in loads.items()}, "begun": 0.0} for times in _TIMES]

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        play = HeldGap(values["half_gap"], values["holding_load"], values["closing_load"], values["begun"])
        yield RememberedStrain(place.name, play, by_load=True)

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        if values["holding_load"] <= values["closing_load"]:  # it hardly stays
            return Backlash().statement(Place(place.name), values, mechanism)
        unit, load = ("rad", "N m") if turns(mechanism, place) else ("m", "N")
        gap, holds = quantity(values["half_gap"], unit), quantity(values["holding_load"], load)
        return f"{place.name} has a play of ±{gap} that stays where it was pushed until the load passes {holds}"


@dataclass(frozen=True)
class HeldGap:
    """Where in its gap a part stands before each sample, and how the sample's load moves it."""

    half_gap: float
    holding_load: float
    closing_load: float
    begun: float

    def __call__(self, load: Array, time: Array, runs: np.ndarray, before: tuple | None) -> tuple[Array, tuple | None]:
        low, high = (self.half_gap * end for end in self._ends(load[:, 0]))
        held, run, at = np.zeros_like(load), None, 0.0
        if before is not None:
            run, at = before
        for sample, (least, most) in enumerate(zip(low.tolist(), high.tolist(), strict=True)):
            if runs[sample] != run:
                run, at = runs[sample], self.begun * self.half_gap
            held[sample] = at
            at = min(max(at, least), most)
        return held, (run, at) if run is not None else None

    def strain(self, load: Array, held: Array) -> tuple[Array, Array]:
        """Return where the load takes the part (n, 1), and by how much more a larger one does (n, 1, 1)."""
        low, high = self._ends(load)
        least, most = self.half_gap * low, self.half_gap * high
        end = np.where(held < least, low, np.where(held > most, high, 1.0))  # 1: no load moves it
        return np.clip(held, least, most), (self.half_gap / self.closing_load * (1 - end**2))[..., None]

    def _ends(self, load: Array) -> tuple[Array, Array]:
        """Return the least and the farthest that the part can stand under loads, as shares of the half gap."""
        least, most = (np.tanh((load + way * self.holding_load) / self.closing_load) for way in (-1, 1))
        return least, most


class LostMotion(Law):
    """Play of a drive whose load side friction holds: the actuator moves through the gap before the joint follows.

    The joint stands at q + e, e = min(max(e before - (q - q before), -g), g), g the half gap and q what the encoder
    reports: behind by g after a motion of more than 2 g, whichever way it went.
    """

    physics = Backlash.physics
    summary = "lost motion: a drive that turns back moves through its play first"
    called = "reversal error, Umkehrspanne"
    remedy = "take out the play of the drive at {place}, or approach every position from the same side"
    source = "ISO 230-2 (reversal error); Krasnosel'skii and Pokrovskii, Systems with Hysteresis (play)"
    variant = "on reversal"
    quantities = (Backlash.quantities[0], _BEGUN)
    neutral: ClassVar = {"half_gap": 0.0}
    strong = Backlash.strong
    optional = ("begun",)

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place(name, self.variant) for name in actuator_places(mechanism)]

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        return gap_of(actuator_slides(place.name, mechanism)), _BEGUN

    def same_places(self, place: Place, mechanism: Mechanism) -> Sequence[str]:
        return drive_of(place.name, mechanism)

    def starts(self, place: Place, mechanism: Mechanism) -> Sequence[Mapping[str, float]]:
        return [{**start, "begun": 0.0} for start in super().starts(place, mechanism)]

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        column, inputs = actuator_places(setup.mechanism)[place.name], setup.inputs
        yield Travel(column, _followed(inputs.actuators[:, column], inputs.run_labels(), **values))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        unit = self.quantities_at(place, mechanism)[0].unit
        gap = quantity(values["half_gap"], unit)
        return f"the drive at {place.name} has a play of ±{gap}, by which the joint stays behind from either side"


def _followed(position: Array, runs: np.ndarray, half_gap: float, begun: float) -> Array:
    """Return how far a joint stands beyond its actuator's positions (N,), runs (N,)."""
    beyond = np.empty(len(position))
    steps, fresh = np.diff(position, prepend=position[:1]), np.diff(runs, prepend=runs[:1] - 1) != 0
    at = 0.0
    for sample, (step, anew) in enumerate(zip(steps.tolist(), fresh.tolist(), strict=True)):
        at = begun * half_gap if anew else min(max(at - step, -half_gap), half_gap)
        beyond[sample] = at
    return beyond


#: Where fits start: a gap that is held against this share of the largest load, and less and more, and closes within
#: this share of what holds it.
_HOLDS, _TIMES, _CLOSES = 0.02, (1.0, 0.1, 10.0), 0.1
