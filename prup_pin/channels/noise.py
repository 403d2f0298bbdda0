"""How much the sensors scatter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..spatial import Array

__all__ = ["Noise"]


@dataclass(frozen=True)
class Noise:
    """Standard deviations: position [m], rotation [rad], force [N], moment [N m]; where they come from."""

    position: float
    rotation: float
    force: float
    moment: float
    source: str

    def of_unit(self, unit: str) -> float:
        """Return that of a pose sensor's columns in 'm' or in 'rad'."""
        return self.position if unit == "m" else self.rotation

    @property
    def wrench(self) -> Array:
        """Of the wrench sensor's components, (6,) [N, N m]."""
        return np.array(3 * [self.force] + 3 * [self.moment])
