"""A gap: a joint that moves by it before it carries."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from ..mechanism import Mechanism
from ..parameters import Quantity
from ..spatial import Array
from .law import ASPECTS, Law, Place, Setup, Strain, along
from .modules_at import turns, yielding


class Backlash(Law):
    """Play that is taken up by the load: e = half_gap tanh(F / F_0) along the load, on top of the elastic part.

    A loaded joint rests on one side of its gap; F_0 is the load that takes it there, small against the others. The play
    has no memory: friction or weight that hold it on one side are laws of their own.
    """

    physics = "backlash"
    summary = "play"
    likely = ("ball_nut", "preloaded_ball_nut")
    quantities = (
        Quantity("half_gap", "m", "play to each side of the middle", 2e-5, upper=5e-3),
        Quantity(
            "closing_load", "N", "load at which three quarters of the gap are closed", 1.0, lower=0.02, upper=10.0
        ),
    )

    neutral: ClassVar = {"half_gap": 0.0}

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return yielding(mechanism, ("", "radial", "axial"))

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        if not turns(mechanism, place):
            return self.quantities
        return (
            Quantity("half_gap", "rad", "play to each side of the middle", 1e-3, upper=0.2),
            Quantity(
                "closing_load",
                "N m",
                "torque at which three quarters of the gap are closed",
                0.01,
                lower=1e-5,
                upper=1.0,
            ),
        )

    def act(self, place: Place, values: Mapping[str, float], setup: Setup) -> None:
        gap, load = values["half_gap"], values["closing_load"]

        def play(force: Array) -> tuple[Array, Array]:
            closed = np.tanh(force / load)
            return gap * closed, gap / load * (1 - closed**2)

        direction = ASPECTS[place.aspect] if place.aspect else slice(0, 1)
        setup.add_strain(place.name, Strain(along(direction, play, 6)))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        unit = "µrad" if turns(mechanism, place) else "µm"
        return f"{place} has a play of ±{1e6 * values['half_gap']:.3g} {unit}, which its load takes up"
