"""What a recording tells the laws."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..spatial import Array

__all__ = ["Inputs"]

#: Temperature [deg C] at which lengths are nominal.
REFERENCE_TEMPERATURE = 20.0


@dataclass(frozen=True)
class Inputs:
    """What a recording says about every sample, as far as laws need it.

    time (N,) [s]; actuators (N, a) and their speeds (N, a) or None; wrench (N, 6); temperature (N,) [deg C] or None;
    blocks (N,) labels of samples between two moves of the actuators; runs (N,) labels of samples recorded one after
    another, one run where they are None; gravity (N, 3), acceleration of free fall in the base frame [m/s^2], or None
    where it is the robot file's; sources (N,), which of several recordings a sample is from, or None for one.
    began (N,), when the recording of each sample began [s], or None: with the first one here.
    weight_alone: no wrench was recorded, so that nothing but the robot's weight acts.
    """

    time: Array
    actuators: Array
    wrench: Array
    blocks: np.ndarray
    temperature: Array | None = None
    speeds: Array | None = None
    runs: np.ndarray | None = None
    gravity: Array | None = None
    sources: np.ndarray | None = None
    weight_alone: bool = False
    began: Array | None = None

    @classmethod
    def empty(cls, actuators: int) -> Inputs:
        """Return a recording without samples that has every column."""
        none, positions = np.zeros(0), np.zeros((0, actuators))
        return cls(none, positions, np.zeros((0, 6)), np.zeros(0, int), temperature=none, speeds=positions)

    def __len__(self) -> int:
        return len(self.time)

    def run_labels(self) -> np.ndarray:
        """Return the runs (N,)."""
        return np.zeros(len(self), int) if self.runs is None else self.runs

    def from_sources(self, places: Sequence[int]) -> np.ndarray:
        """Return which samples are from the recordings with these places, (N,); none where there is one alone."""
        return np.zeros(len(self), bool) if self.sources is None else np.isin(self.sources, list(places))

    @property
    def elapsed(self) -> Array:
        """Time since the beginning of a sample's recording [s], (N,)."""
        return self.time - (self.time[:1] if self.began is None else self.began)

    @property
    def warming(self) -> Array:
        """Temperature above the reference [K], (N,); zero where it was not measured."""
        if self.temperature is None:
            return np.zeros(len(self))
        return np.nan_to_num(self.temperature - REFERENCE_TEMPERATURE)
