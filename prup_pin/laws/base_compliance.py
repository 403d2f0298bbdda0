"""What a robot stands on gives way under it: a frame, a pedestal, a foundation."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import ClassVar

import numpy as np

from ..mechanism import Mechanism
from ..numbers import number
from ..parameters import Quantity
from .deeds import Deed, YieldingBase
from .law import Law, Place
from .setup import Setup

_AXES = "xyz"
_SETTLED = Quantity(
    "settled", "1", "share of its weight at home under which the base was measured", 1.0, False, upper=1
)
_BY_AXIS = (
    *(Quantity(f"translation_{axis}", "m/N", f"way per force along {axis}", 1e-8, False, upper=1e-3) for axis in _AXES),
    *(
        Quantity(f"rotation_{axis}", "rad/(N m)", f"turn per moment about {axis}", 1e-6, False, upper=1e-1)
        for axis in _AXES
    ),
)


class BaseCompliance(Law):
    """The base moves by c f along the force and turns by r m about the moment that the whole robot passes into it.

    About the base's origin, alike in all directions, so that no turn of the base frame changes it. The pose sensor
    stands elsewhere, and sees the whole robot move; no part of the robot deforms.
    """

    physics = "base_compliance"
    summary = "what the robot stands on gives way"
    called = "foundation, floor, table, stand"
    remedy = "tighten the anchors and stiffen what the robot stands on, or enter that stiffness in the robot file"
    source = "Rivin, Stiffness and Damping in Mechanical Design, ch. 5"
    quantities: ClassVar[tuple[Quantity, ...]] = (
        Quantity("translation", "m/N", "way of the base per force, in its direction", 1e-8, upper=1e-3),
        Quantity("rotation", "rad/(N m)", "turn of the base per moment, about its direction", 1e-6, upper=1e-1),
        _SETTLED,
    )
    optional = ("settled",)
    neutral: ClassVar = {"translation": 0.0, "rotation": 0.0}

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place("base", self.variant)]

    def starts(self, place: Place, mechanism: Mechanism) -> Sequence[Mapping[str, float]]:
        return [
            {"translation": 1e-8, "rotation": 1e-6, "settled": 0.5},
            {"translation": 1e-7, "rotation": 1e-8, "settled": 0.5},
        ]

    def usual_at(self, place: Place, mechanism: Mechanism) -> Mapping[str, tuple[float, float]]:
        return {"settled": (0.5, 0.5)}

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        yield YieldingBase(tuple(map(tuple, np.diag(self._compliances(values)).tolist())), values.get("settled", 1.0))

    def _compliances(self, values: Mapping[str, float]) -> Sequence[float]:
        """Return the compliance along and about the axes of the base [m/N, rad/(N m)], (6,)."""
        return [values["translation"]] * 3 + [values["rotation"]] * 3

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return self.told(place, values, {}, mechanism)

    def told(
        self,
        place: Place,
        values: Mapping[str, float],
        intervals: Mapping[str, tuple[float, float]],
        mechanism: Mechanism,
    ) -> str:
        """Return the statement; of a compliance that may be nothing, the stiffness that there is at least."""
        compliances = np.array(self._compliances(values))
        highest = [interval[1] if interval[0] <= 0 else 0.0 for interval in intervals.values()]
        known = {key: bound for key, bound in zip(intervals, highest, strict=True) if bound > 0}
        bounds = np.array(self._compliances(dict.fromkeys(values, 0.0) | known))
        (along, about), (slow, turn) = np.split(compliances, 2), np.split(bounds, 2)
        return (
            f"what the robot stands on gives way, with {_told(along, slow, 'N/m')} and {_told(about, turn, 'N m/rad')}"
        )


class UnevenBaseCompliance(BaseCompliance):
    """The same with a compliance of its own along and about each axis of the base: a frame is no cube."""

    variant = "by axis"
    quantities: ClassVar[tuple[Quantity, ...]] = (*_BY_AXIS, _SETTLED)
    neutral: ClassVar = {quantity.name: 0.0 for quantity in _BY_AXIS}

    def starts(self, place: Place, mechanism: Mechanism) -> Sequence[Mapping[str, float]]:
        return [{**{quantity.name: float(quantity.default) for quantity in _BY_AXIS}, "settled": 0.5}]  # type: ignore[arg-type]

    def _compliances(self, values: Mapping[str, float]) -> Sequence[float]:
        return [values[quantity.name] for quantity in _BY_AXIS]


def _told(compliances: np.ndarray, bounds: np.ndarray, unit: str) -> str:
    """Return stiffnesses along or about the axes in words; bounds: of compliances that may be nothing, else zero."""
    stiffnesses = [
        f"more than {number(1 / bound, 3)}" if bound > 0 else number(1 / value, 3) if value > 0 else "rigid"
        for value, bound in zip(compliances.tolist(), bounds.tolist(), strict=True)
    ]
    return f"{', '.join(stiffnesses if len(set(stiffnesses)) > 1 else stiffnesses[:1])} {unit}"
