"""A gap: a joint that moves by it before it carries."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import ClassVar

import numpy as np

from ..mechanism import Mechanism
from ..numbers import quantity
from ..parameters import Quantity
from ..spatial import Array
from .deeds import Along, Deed, ExtraStrain, Felt, Strain
from .law import ASPECTS, Law, Place
from .modules_at import turns, yielding
from .setup import Setup

_GAP = Quantity("half_gap", "m", "play to each side of the middle", 2e-5, upper=5e-3)


def gap_of(slides: bool) -> Quantity:
    """Return the half gap of a slide's play, or of a hinge's."""
    return _GAP if slides else replace(_GAP, unit="rad", default=1e-3, upper=0.2)


class Backlash(Law):
    """Play that is taken up by the load: e = half_gap tanh(F / F_0) along the load, on top of the elastic part.

    Across a bearing the gap is round: play in any direction. A loaded joint rests on one side of its gap; F_0 is the
    load that takes it there, within reach of the others. The play has no memory: friction or weight that hold it on one
    side are laws of their own.
    """

    physics = "backlash"
    summary = "play"
    called = "play, clearance, slack, lost motion, a loose fit"
    remedy = "take out the play at {place}: check its preload first, then bearings and guides for wear"
    likely = ("ball_nut", "preloaded_ball_nut")
    quantities = (
        _GAP,
        Quantity("closing_load", "N", "load at which three quarters of the gap are closed", 1.0, lower=0.02, upper=1e6),
    )

    neutral: ClassVar = {"half_gap": 0.0}
    closes_within = "closing_load"
    strong = 2e-4

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return yielding(mechanism, ("", "radial", "axial"))

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        if not turns(mechanism, place):
            return self.quantities
        return (
            gap_of(slides=False),
            Quantity(
                "closing_load",
                "N m",
                "torque at which three quarters of the gap are closed",
                0.01,
                lower=1e-5,
                upper=1e5,
            ),
        )

    def seen_at(self, place: Place, mechanism: Mechanism, felt: Felt, interval: float) -> tuple[Quantity, ...]:
        return _told_by(self.quantities_at(place, mechanism), felt.load)

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        direction = ASPECTS[place.aspect] if place.aspect else slice(0, 1)
        play = partial(_play, gap=values["half_gap"], load=values["closing_load"])
        yield ExtraStrain(place.name, Strain(Along(direction, play)))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        gap = quantity(values["half_gap"], "rad" if turns(mechanism, place) else "m")
        return f"{place} has a play of ±{gap}, which its load takes up"


class BacklashByAxis(Law):
    """Play across a bearing that has two gaps, one along each axis across: two bushes, or a guide with four faces.

    Each gap is taken up by the load along its own axis, in the axes in which the robot file gives the module.
    """

    physics = "backlash"
    summary = "play along each axis for itself"
    remedy = "take out the play at {place}: check its preload first, then bushes and guides for wear"
    variant = "radial by axis"
    quantities = (
        Quantity("half_gap_x", "m", "play along x to each side of the middle", 2e-5, upper=5e-3),
        Quantity("half_gap_y", "m", "play along y to each side of the middle", 2e-5, upper=5e-3),
        *Backlash.quantities[1:],
    )
    neutral: ClassVar = {"half_gap_x": 0.0, "half_gap_y": 0.0}
    closes_within = "closing_load"
    strong = 2e-4

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place(place.name, self.variant) for place in yielding(mechanism, ("radial",))]

    def starts(self, place: Place, mechanism: Mechanism) -> Sequence[Mapping[str, float]]:
        load = float(self.quantities[2].default)  # type: ignore[arg-type]
        return [{"half_gap_x": gap, "half_gap_y": gap, "closing_load": load} for gap in (2e-5, 2e-4)]

    def seen_at(self, place: Place, mechanism: Mechanism, felt: Felt, interval: float) -> tuple[Quantity, ...]:
        return _told_by(self.quantities, felt.load)

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        for component, gap in enumerate((values["half_gap_x"], values["half_gap_y"])):
            play = partial(_play, gap=gap, load=values["closing_load"])
            yield ExtraStrain(place.name, Strain(Along(slice(component, component + 1), play)))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        x, y = (quantity(values[name], "m") for name in ("half_gap_x", "half_gap_y"))
        return f"{place.name} has a play of ±{x} along its x and of ±{y} along its y, each for itself"


#: Multiple of the largest load up to which data tell an open gap from a spring: its tanh bends by 8 % there.
_TOLD = 2.0
#: Where no load comes near, a gap is a spring: the least ends of a fit, as multiples of where it starts, by unit.
_LEAST_ENDS = {"N": 10.0, "N m": 100.0}


def _told_by(quantities: tuple[Quantity, ...], load: float) -> tuple[Quantity, ...]:
    """Return a gap's parameters, the load that closes it no larger than loads up to `load` can tell."""
    *gaps, closing = quantities
    least = _LEAST_ENDS[closing.unit] * float(closing.default)  # type: ignore[arg-type]
    return (*gaps, replace(closing, upper=min(max(least, _TOLD * load), closing.upper)))


def _play(force: Array, gap: float, load: float) -> tuple[Array, Array]:
    """Return how far a gap is taken up by a force >= 0 (N,), and the slope."""
    closed = np.tanh(force / load)
    return gap * closed, gap / load * (1 - closed**2)
