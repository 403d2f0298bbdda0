"""What one test says for itself: its verdict, what is left, and which laws it names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ..diagnosis.diagnosis import Diagnosis
from .kept import Kept

__all__ = ["Answer", "Named"]


@dataclass(frozen=True)
class Named:
    """A law that a test names: its physics, place and values, and what it cannot be told from."""

    physics: str
    location: str
    aspect: str
    values: Mapping[str, float]
    others: tuple[str, ...] = ()

    @property
    def key(self) -> tuple[str, str, str]:
        return self.physics, self.location, self.aspect

    def __str__(self) -> str:
        return f"{self.physics} at {self.location}"


@dataclass(frozen=True)
class Answer:
    """What a test says for itself: its verdict, what is left in multiples of the noise, and what it names."""

    verdict: str
    left: float
    named: tuple[Named, ...] = ()
    unknown: tuple[str, ...] = ()  # where something is that no law explains

    @classmethod
    def of(cls, diagnosis: Diagnosis) -> Answer:
        """Return what a diagnosis, of the robot file or against an earlier model, names that lasts."""
        named = []
        for item in diagnosis.findings:
            effect = item.effect
            if effect is None or not item.is_fault or not effect.law.lasts or effect.law.partial or not effect.values:
                continue
            places = (f"{item.physics} at {place}" for place in item.candidates if place != item.location)
            others = (*places, *item.alternatives)
            named.append(Named(item.physics, effect.place.name, effect.place.aspect, dict(effect.values), others))
        unknown = tuple(item.location for item in diagnosis.findings if item.physics == "unknown")
        after = float(diagnosis.after["fit"])
        return cls(diagnosis.verdict, after if np.isfinite(after) else 1.0, tuple(named), unknown)

    @classmethod
    def read(cls, document: Mapping[str, Any]) -> Answer:
        """Return that of `dataclasses.asdict`, read from JSON."""
        named = tuple(Named(**{**item, "others": tuple(item["others"])}) for item in document["named"])
        return cls(document["verdict"], document["left"], named, tuple(document["unknown"]))

    @property
    def kept(self) -> Kept:
        return Kept(asdict(self), {})

    @property
    def told(self) -> list[str]:
        """What it names, and where something is unknown, as 'backlash at joint2/gear'."""
        return [*map(str, self.named), *(f"unknown at {location}" for location in self.unknown)]
