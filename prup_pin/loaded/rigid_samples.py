"""The rigid poses behind samples: what the equations know of them besides the state that starts there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..kinematics import TOLERANCE, ClosedPose
from ..modules import ModuleGeometry
from ..spatial import Array
from ..statics import StaticsLayout
from .border import Border


@dataclass(frozen=True, eq=False)
class RigidSamples:
    """What N samples' rigid poses tell each group of modules, (N, n) each, and what they leave undetermined.

    gaps (N, c): what they leave open of the closures, since frames that are drawn to seven digits say redundant things
    a little differently. Nothing is under stress there.
    """

    geometries: tuple[ModuleGeometry, ...]
    border: Border
    gaps: Array

    def take(self, rows) -> RigidSamples:
        geometries = (at._replace(length=at.length[rows], position=at.position[rows]) for at in self.geometries)
        return RigidSamples(tuple(geometries), self.border.take(rows), self.gaps[rows])


def gaps_of(poses: list[ClosedPose], rows: Array) -> Array:
    """Return what is open of the closures in the poses of samples `rows` (N,), (N, c); rounding is not."""
    gaps = np.array([pose.closure_residual for pose in poses])
    return np.where(np.abs(gaps) > TOLERANCE, gaps, 0.0)[rows]


def geometries_of(layout: StaticsLayout, poses: list[ClosedPose], rows: Array) -> tuple[ModuleGeometry, ...]:
    """Return the geometries of samples `rows` (N,) that stand in `poses`."""
    each = [layout.geometries(pose, layout.frames(pose)) for pose in poses]
    gathered = []
    for index, group in enumerate(layout.groups):
        wide = (len(group.modules),)
        lengths = np.array([np.broadcast_to(geometries[index].length, wide) for geometries in each])
        positions = np.array([np.broadcast_to(geometries[index].position, wide) for geometries in each])
        inboard = np.array([module.inboard_is_root for module in group.modules])
        anchored = np.array([module.anchored_at_tip for module in group.modules])
        gathered.append(ModuleGeometry(lengths[rows], positions[rows], inboard, anchored))
    return tuple(gathered)
