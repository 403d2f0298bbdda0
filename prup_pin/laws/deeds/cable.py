"""Cables that pull the tool and never push it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...spatial import Array
from .deed import Deed

if TYPE_CHECKING:
    from ..setup import Setup

#: About its slack length a cable takes up its load over so much way [m], so that its stiffness has no jump for a fit.
TAKE_UP = 3e-3


@dataclass(frozen=True)
class ToolCable(Deed):
    """A cable of `stiffness` [N/m] pulls the tool point to `anchor` (3,) [m], base axes, beyond `slack_length` [m].

    It passes by the sensor, and follows the tool as this moves under load. To first order it is
    one of the springs of `ToolSpring`, which adds up what all pulls do.
    """

    stiffness: float
    slack_length: float
    anchor: tuple[float, ...]

    def enter(self, setup: Setup) -> None:
        setup.springs = (*setup.springs, self)

    def force_at(self, point: Array) -> Array:
        towards, length = self._towards(point)
        return np.asarray(self.stiffness * self._stretch(length)[0] * towards)

    def stiffness_at(self, point: Array) -> Array:
        towards, length = self._towards(point)
        along = towards[..., :, None] * towards[..., None, :]
        stretch, taut = self._stretch(length)
        across = stretch / np.where(length > 0, length, 1.0)
        return np.asarray(self.stiffness * (across[..., None] * (np.eye(3) - along) + taut[..., None] * along))

    def _stretch(self, length: Array) -> tuple[Array, Array]:
        """Return how far a cable of some length is stretched, and the slope of that: 0 while slack, 1 once taut."""
        share = np.clip((length - self.slack_length) / TAKE_UP + 0.5, 0.0, 1.0)
        beyond = np.maximum(length - self.slack_length - TAKE_UP / 2, 0.0)
        return TAKE_UP * share**2 / 2 + beyond, share

    def _towards(self, point: Array) -> tuple[Array, Array]:
        """Return the direction from the tool point to the anchor, (N, 3), and how far that is, (N, 1)."""
        way = np.array(self.anchor) - point
        length = np.linalg.norm(way, axis=-1, keepdims=True)
        return way / np.where(length > 0, length, 1.0), length
