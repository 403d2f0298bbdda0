"""Hoses, cables and cords that pull at the tool while a robot moves: a force, even or with where the tool is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from ...dynamics import InMotion
from ...mechanism import Mechanism
from ...numbers import number
from ...parameters import Quantity
from ...spatial import Array
from ..external_spring import ExternalSpring, home_of
from ..law import Place
from .effort_law import EFFORT, EffortLaw

#: Places of a symmetric stiffness (3, 3) in the order of its six numbers.
_PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
_FORCES = tuple(
    Quantity(f"f{axis}", "N", f"of the force along the base's {axis}", 10.0, positive=False, lower=-1e6, upper=1e6)
    for axis in "xyz"
)


class EvenPull(EffortLaw):
    """tau = -J^T f: a force f in base axes on the tool point, the same everywhere, as of a cord with a weight at it."""

    physics = "external_force"
    summary = "a force that pulls at the tool, the same everywhere"
    called = "dress pack"
    remedy = "look for what pulls at the tool, a hose, a cable or a cord, and lead it another way"
    family = "pull at the tool"
    linear: ClassVar[tuple[str, ...]] = ("fx", "fy", "fz")
    quantities: ClassVar[tuple[Quantity, ...]] = _FORCES

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        tool = mechanism.tool
        return [] if tool is None or tool.joint == 0 else [Place(str(mechanism.tool_part), self.variant)]

    def unlike(self, place: Place) -> Sequence[tuple[str, str]]:
        return [("payload", place.name)]  # what pulls downwards is held in the tool before it is anything else

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return -at.reached_by_tool[1]

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"{_force(values)} pulls at the tool, the same everywhere"


class ElasticPull(EvenPull):
    """tau = -J^T (f - K (p - p_home)): a force with where the tool point p is, to first order about its home.

    Of a hose of any kind K is symmetric (3, 3), in base axes: a spring's, and what it is preloaded by.
    """

    physics = ExternalSpring.physics
    summary = ExternalSpring.summary
    remedy = ExternalSpring.remedy
    variant = f"{EFFORT} of a hose"
    linear = (*EvenPull.linear, *(f"k{'xyz'[i]}{'xyz'[j]}" for i, j in _PAIRS))
    quantities = (
        *_FORCES,
        *(
            Quantity(name, "N/m", f"force along {name[1]} per way along {name[2]}", 100.0, False, -1e7, 1e7)
            for name in linear[3:]
        ),
    )

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        position, per_force = at.reached_by_tool
        way = position - home_of(at.mechanism)
        columns = [-per_force[..., k] for k in range(3)]
        for i, j in _PAIRS:
            own = way[:, None, j] * per_force[..., i]
            columns.append(own if i == j else own + way[:, None, i] * per_force[..., j])
        return np.stack(columns, axis=-1)

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        stiffness = np.zeros((3, 3))
        for name, (i, j) in zip(self.linear[3:], _PAIRS, strict=True):
            stiffness[i, j] = stiffness[j, i] = values[name]
        largest = float(np.abs(np.linalg.eigvalsh(stiffness)).max())
        return (
            f"a hose or a cable pulls at the tool with {_force(values)} at home, which changes by up to "
            f"{number(largest, 3)} N/m as the tool moves"
        )


def _force(values: Mapping[str, float]) -> str:
    force = np.array([values[name] for name in EvenPull.linear])
    along = ", ".join(number(value, 3) for value in force.tolist())
    return f"{number(float(np.linalg.norm(force)), 3)} N ({along} along the base's x, y, z)"
