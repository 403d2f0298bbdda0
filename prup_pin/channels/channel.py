"""The contract of a channel: something that was measured at every sample, beside what a simulation says of it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np

from ..laws import Setup
from ..laws.deeds import Solved
from ..mechanism import Frame
from ..simulation import Run
from ..spatial import Array
from .linear import Linear
from .noise import Noise


class Columns(NamedTuple):
    """Columns of a channel that share a unit and a noise: `name` for people, `unit`, and where they stand."""

    name: str
    unit: str
    where: slice


class Channel(ABC):
    """N samples of k columns. Final subclasses are made by `stack.channels_of`."""

    #: For people: 'pose', 'marker elbow'.
    name: str
    #: Its columns in groups of one unit.
    columns: tuple[Columns, ...]
    #: Which numbers were measured, (N, k).
    exists: np.ndarray
    #: Frames whose motion its first-order changes need.
    frames: tuple[Frame, ...]

    @property
    def size(self) -> int:
        """Number of columns, k."""
        return int(self.exists.shape[1])

    @abstractmethod
    def deviation(self, noise: Noise) -> Array:
        """Return the standard deviation of each column, (k,)."""

    @abstractmethod
    def residual(self, run: Run) -> Array:
        """Return measured less simulated, (N, k); zero where nothing was measured or simulated."""

    @abstractmethod
    def residual_of_start(self, linear: Linear) -> Array:
        """Return the same against the simulation that a user starts from."""

    @abstractmethod
    def seen(self, watched: Array) -> Array:
        """Return what the columns see of small motions of `frames` (n, 6 frames, …): (n, k, …), first order."""

    @abstractmethod
    def change(self, setup: Setup, at: Solved, moved: Array) -> Array:
        """Return the change of what is reported (n, k) from a solved setup to another one.

        moved (n, 6 frames) is how far the frames go, translation and small turn in base axes [m, rad].
        """
