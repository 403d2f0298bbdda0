"""Play in the guide of a slide: a drawer that is pulled out tilts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import ClassVar

import numpy as np

from ..mechanism import Mechanism
from ..modules import WrenchModule
from ..numbers import quantity
from ..parameters import Quantity
from ..spatial import Array
from .deeds import Along, Deed, ExtraTilt, Solved, Strain, yield_of
from .drawn import Drawn
from .law import ASPECTS, Law, Place
from .setup import Setup


class GuidePlay(Law):
    """What a slide carries tilts in its guide, to the side to which the moment across turns it.

    A part with the clearance s in a guide that holds it over the length b tilts by s / b, and b shrinks as the slide
    comes out: tilt = angle / (1 - growth z) tanh(M / M_0) along the moment M, with z = (q - middle) / half of its way
    between the robot file's limits, and growth half the way over b in the middle: negative where the guide lets go
    towards the lower limit. M_0 is the moment that takes it to its side. The play has no memory.
    """

    physics = "guide_play"
    summary = "play in the guide of a slide"
    called = "play, clearance, telescope, drawer, tilting of a carriage, a loose fit"
    remedy = "take out the play in the guide of {place}: adjust its gibs or rollers, or let it overlap more"
    source = "Slocum, Precision Machine Design (1992), on guides and Saint-Venant's principle"
    quantities = (
        Quantity("angle", "rad", "tilt to each side in the middle of the way", 1e-3, upper=0.2),
        Quantity("growth", "1", "half the way over the length of the guide in its middle", 0.3, False,
                 lower=-0.95, upper=0.95),
        Quantity("closing_moment", "N m", "moment that tilts it by three quarters of that", 1.0, lower=1e-3, upper=1e4),
    )  # fmt: skip
    neutral: ClassVar = {"angle": 0.0}
    closes_within = "closing_moment"
    strong = 1e-2

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        if mechanism.loops or any(isinstance(module.kind, WrenchModule) for module in mechanism.modules):
            return ()
        joints = (mechanism.joint(name) for name in (*mechanism.actuated, *mechanism.coupling.names))
        return [Place(joint.name) for joint in joints if joint.slides and joint.name not in mechanism.locked]

    def starts(self, place: Place, mechanism: Mechanism) -> Sequence[Mapping[str, float]]:
        return [
            {"angle": 1e-3, "growth": growth, "closing_moment": moment}
            for moment in (1.0, 30.0)
            for growth in (0.3, -0.3)
        ]

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        angle = values["angle"] / (1 - values["growth"] * _way(place.name, setup))
        tilt = partial(_tilt, closing=values["closing_moment"])
        yield ExtraTilt(place.name, Strain(Along(ASPECTS["tilting"], tilt), (angle,)))

    def drawn(self, place: Place, at: Solved) -> Drawn:
        moment, by = yield_of(at, place.name, "across")
        size = np.linalg.norm(moment, axis=1)
        unit = moment / np.maximum(size, 1e-12)[:, None]
        labels = "moment across the slide", "tilt in the guide"
        return Drawn(size, (by @ unit[..., None])[..., 0], labels, ("N m", "rad"))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        growth = values["growth"]
        middle, out, in_ = (quantity(values["angle"] / (1 - abs(growth) * way), "rad") for way in (0.0, 1.0, -1.0))
        return (
            f"{place.name} has play in its guide: what it carries tilts to the side to which its load turns it, by "
            f"±{middle} in the middle of its way, by ±{out} where it is {'extended' if growth > 0 else 'drawn in'} and "
            f"by ±{in_} at the other end"
        )


def _way(name: str, setup: Setup) -> Array:
    """Return where a slide stands between its limits, (N,), -1 to 1; in metres from its zero where it has none."""
    mechanism = setup.mechanism
    joint = mechanism.joint(name)
    at = setup.position(name)
    low, high = (float(limit[joint.first_q]) for limit in mechanism.limits)
    if not low < high < np.inf or low == -np.inf:
        low, high = -1.0, 1.0
    return np.clip((2 * at - low - high) / (high - low), -1.0, 1.0)


def _tilt(moment: Array, angle: Array, closing: float) -> tuple[Array, Array]:
    """Return the tilt within `angle` (N,) by a moment >= 0 (N,), and the slope."""
    closed = np.tanh(moment / closing)
    return angle * closed, angle / closing * (1 - closed**2)
