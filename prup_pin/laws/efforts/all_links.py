"""All links at once: the robot file's masses are those of a drawing, or of another make."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...dynamics import INERTIAL, InMotion
from ...mechanism import Mechanism
from ...spatial import Array
from ..law import Place
from .effort_law import EFFORT, EffortLaw
from .inertial_parameters import InertialParameters

__all__ = ["AllLinks"]


@dataclass(frozen=True)
class AllLinks(EffortLaw):
    """The inertial parameters of `links`, side by side: what a corrected model holds link by link."""

    links: tuple[Place, ...]
    physics: ClassVar[str] = "inertial_parameters"
    summary: ClassVar[str] = "the masses of all links, their centres and their inertia"
    remedy: ClassVar[str] = (
        "take the masses of the corrected model for feedforward; ask the maker for those of the robot file"
    )
    variant: ClassVar[str] = f"{EFFORT} of all links"
    of_bodies: ClassVar[bool] = True
    everywhere: ClassVar[bool] = True
    quantities = ()
    neutral: ClassVar = {}

    @property
    def linear(self) -> tuple[str, ...]:  # type: ignore[override]
        """Names of the parameters, link by link."""
        return tuple(f"{link.name}.{name}" for link in self.links for name in INERTIAL)

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place("robot", self.variant)]

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return np.concatenate([InertialParameters().efforts_per(link, {}, at) for link in self.links], axis=-1)

    def of_body(self, place: Place, mechanism: Mechanism) -> Mapping[int, Array]:
        out = {}
        for index, link in enumerate(self.links):
            for joint, own in InertialParameters().of_body(link, mechanism).items():
                out[joint] = np.zeros((10, len(self.linear)))
                out[joint][:, 10 * index : 10 * index + 10] = own
        return out

    def plausible(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> bool:
        return True  # most combinations of them are told by nothing: each alone may be anything
