"""A joint whose place changes on its way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...spatial import Array
from .deed import Deed

if TYPE_CHECKING:
    from ..setup import Setup


@dataclass(frozen=True, eq=False)
class MovedOnTheWay(Deed):
    """A joint's place, and all that it carries, is displaced by `displacement` (N, 6), as `MovedJoint` has it.

    `MovedJoint.changes` adds up the first order of all displaced joints.
    """

    joint: str
    displacement: Array

    def enter(self, setup: Setup) -> None:
        index = setup.mechanism.joint(self.joint).id
        offset = setup.offsets.get(index, np.zeros(6)) + self.displacement
        setup.offsets = {**setup.offsets, index: offset}
