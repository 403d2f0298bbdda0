"""A joint that tilts where the robot file has it rigid, by more than a compliance."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ...mechanism import yielding_module
from ...spatial import Array
from .deed import Deed, Solved
from .strain import ExtraStrain, Strain, extent_of
from .yielding import YieldingJoint, yield_of

if TYPE_CHECKING:
    from ..setup import Setup

#: Components, of a module's six, of the tilts across a joint.
_ACROSS = slice(3, 5)


@dataclass(frozen=True, eq=False)
class ExtraTilt(Deed):
    """A joint tilts across its axis by `strain` of what it carries, beside what it yields there.

    Load and strain (N, 6) are those of a module, of which components 3 and 4 are about the two axes across, of
    `Joint.motions` as they stand on the body before the joint.
    """

    joint: str
    strain: Strain

    def enter(self, setup: Setup) -> None:
        YieldingJoint(self.joint, "across", (0.0, 0.0, 0.0)).enter(setup)
        ExtraStrain(yielding_module(self.joint, "across"), self.strain).enter(setup)

    @classmethod
    def changes(cls, setup: Setup, at: Solved) -> Iterator[Array]:
        """Yield what tilts joints that were rigid; of those that were not it is a strain of their module."""
        for joint, way in setup.yielding:
            name = yielding_module(joint, way)
            if name in at.first.rows or name not in setup.strains:
                continue
            moment, by = at.first.once(("tilts", joint), partial(yield_of, at, joint, way))
            load = np.zeros((len(moment), 6))
            load[:, _ACROSS] = moment
            yield (by @ extent_of(setup, name, load, at.samples)[:, _ACROSS, None])[..., 0]
