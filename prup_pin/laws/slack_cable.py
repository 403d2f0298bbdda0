"""Cables, straps and chains between the tool and something fixed: nothing while slack, a pull beyond."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import ClassVar

import numpy as np

from ..mechanism import Mechanism
from ..numbers import number, readable_unit
from ..parameters import Quantity
from .deeds import Deed, ToolCable
from .external_spring import home_of, size_of
from .law import Law, Place
from .setup import Setup

_AXES = "xyz"
#: A fit starts with an anchor so far beside the tool at home along each axis [m] and a cable that is taut there, and
#: may end so many times the robot's size away from there.
_BESIDE, _SLACK, _FAR = 0.1, 0.12, 4.0
#: Lengths of cables that a fit starts with beside that, in the robot's size.
_LENGTHS = np.array([0.5, 2.0])


class SlackCable(Law):
    """A cable pulls the tool point towards a fixed anchor by k (l - l0) where it is longer than l0, and never pushes.

    It takes up its load over three millimetres about l0 (`deeds.cable.TAKE_UP`). It passes by the wrench sensor, and
    follows the tool as this gives way under load.
    """

    physics = "slack_cable"
    summary = "a cable that pulls at the tool once it is taut"
    source = "unilateral spring; Irvine, Cable Structures, ch. 1, without sag"
    called = "tension-only, tether, strap, chain, umbilical"
    remedy = "give the cable more length or another way, and record again to see that the pull is gone"
    cost = 16.0  # as a hose's
    quantities: ClassVar[tuple[Quantity, ...]] = (
        Quantity("stiffness", "N/m", "force per way beyond its slack length", 100.0, upper=1e7),
        Quantity("slack_length", "m", "from anchor to tool where it begins to pull", _SLACK, upper=100.0),
        *(
            Quantity(axis, "m", f"of its anchor along {axis}, base axes", _BESIDE, lower=-100.0, upper=100.0)
            for axis in _AXES
        ),
    )
    neutral: ClassVar = {"stiffness": 0.0}
    strong = 1000.0

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place("environment")] if mechanism.tool is not None else []

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        home = home_of(mechanism)
        far = _FAR * size_of(home)
        at = dict(zip(_AXES, home.tolist(), strict=True))
        found = []
        for item in self.quantities:
            if item.name in at:
                middle = at[item.name]
                item = replace(item, default=middle + _BESIDE, lower=middle - far, upper=middle + far)
            elif item.name == "slack_length":
                item = replace(item, upper=2 * far)
            found.append(item)
        return tuple(found)

    def usual_at(self, place: Place, mechanism: Mechanism) -> Mapping[str, tuple[float, float]]:
        home = home_of(mechanism)
        return {axis: (at, size_of(home)) for axis, at in zip(_AXES, home.tolist(), strict=True)}

    def starts(self, place: Place, mechanism: Mechanism) -> Sequence[Mapping[str, float]]:
        """Return a cable beside home, and those from each side, near and far, that are taut in half of all positions.

        No step leads from an anchor on one side of the tool to one on the other.
        """
        home, beside = home_of(mechanism), super().starts(place, mechanism)
        sides = [np.array(side, float) for side in product((-1, 0, 1), repeat=3) if any(side)]
        for length in _LENGTHS * size_of(home):
            anchors = (home + length * side / np.linalg.norm(side) for side in sides)
            at = (dict(zip(_AXES, anchor.tolist(), strict=True)) for anchor in anchors)
            beside = [*beside, *({**beside[0], "slack_length": float(length), **anchor} for anchor in at)]
        return beside

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        yield ToolCable(values["stiffness"], values["slack_length"], tuple(values[axis] for axis in _AXES))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        unit, factor = readable_unit(max(np.abs([values[axis] for axis in _AXES])), "m")
        anchor = ", ".join(number(factor * values[axis], 3) for axis in _AXES)
        of, by = readable_unit(values["slack_length"], "m")
        return (
            f"a cable to ({anchor}) {unit} pulls at the tool with {number(values['stiffness'], 3)} N/m "
            f"beyond its length of {number(by * values['slack_length'], 3)} {of}"
        )
