"""The simulation that a user starts from: the rigid pose and C w about it, or what was found before."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..mechanism import Frame
from ..simulation import Run, Simulator
from ..simulation.simulator import Geometry
from ..spatial import Array, rotation_exp, skew
from ..statics import Compliance


@dataclass(frozen=True, eq=False)
class Linear:
    """Poses of frames without what the loaded simulation knows, N samples.

    `samples` (N,) tells which ones have an answer, the others hold NaN. `run`: where effects act from the start, the
    whole simulation with them, whose poses then are those under load and before.
    """

    geometry: Geometry
    wrench: Array
    samples: np.ndarray
    run: Run | None = None

    @classmethod
    def of(cls, simulator: Simulator, run: Run | None = None) -> Linear:
        geometry = simulator.geometry({})
        samples = simulator.complete & geometry.reachable
        return cls(geometry, simulator.inputs.wrench, samples if run is None else samples & run.solved, run)

    @cached_property
    def _compliances(self) -> list[Compliance]:
        robot = self.geometry.robot
        return [robot.compliance(pose) for pose in self.geometry.poses] if robot.mechanism.modules else []

    def compliance(self, frame: Frame) -> Array:
        """Return the motion of a frame per wrench on the tool, (N, 6, 6); zero where nothing yields."""
        if frame.name not in self._by_frame:
            self._by_frame[frame.name] = self._compliance_of(frame)
        return self._by_frame[frame.name]

    @cached_property
    def _by_frame(self) -> dict[str, Array]:
        return {}

    def _compliance_of(self, frame: Frame) -> Array:
        out = np.full((len(self.samples), 6, 6), np.nan)
        if self.samples.any():
            if not self._compliances:
                each = np.zeros((len(self.geometry.poses), 6, 6))
            elif frame == self.geometry.robot.mechanism.tool:
                each = np.array([compliance.C for compliance in self._compliances])
            else:
                each = np.array(
                    [
                        np.column_stack([compliance.deflection(unit, frame=frame.name) for unit in np.eye(6)])
                        for compliance in self._compliances
                    ]
                )
            out[self.samples] = each[self.geometry.rows[self.samples]]
        return out

    def rigid(self, frame: Frame) -> tuple[Array, Array]:
        """Return position (N, 3) and rotation (N, 3, 3) of a frame before anything deforms."""
        if self.run is not None:
            return self.run.pose_of(frame)
        n = len(self.samples)
        position, rotation = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan)
        if self.samples.any():
            each = np.array([pose.placements[frame.joint] @ frame.placement for pose in self.geometry.poses])
            placed = each[self.geometry.rows[self.samples]]
            position[self.samples], rotation[self.samples] = placed[:, :3, 3], placed[:, :3, :3]
        return position, rotation

    def by_actuators(self, frame: Frame) -> Array:
        """Return the translation and turn of a frame per travel of each actuated joint, (N, 6, a), base axes.

        Zero of a frame that the tool does not carry.
        """
        mechanism, kinematics = self.geometry.robot.mechanism, self.geometry.robot._kinematics
        out = np.zeros((len(self.samples), 6, len(mechanism.actuated)))
        if not self.samples.any() or mechanism.tool is None or frame.joint != mechanism.tool.joint:
            return out
        each = np.array([kinematics.by_actuators(pose) for pose in self.geometry.poses])[self.geometry.rows]
        turned = self.rigid(frame)[1][self.samples] @ frame.placement[:3, :3].T
        beside = turned @ (frame.placement[:3, 3] - mechanism.tool.placement[:3, 3])
        out[self.samples] = each[self.samples]
        out[self.samples, :3] -= skew(beside) @ out[self.samples, 3:]
        return out

    def pose_of(self, frame: Frame) -> tuple[Array, Array]:
        """Return position (N, 3) and rotation (N, 3, 3) of a frame under load, weights neglected."""
        position, rotation = self.rigid(frame)
        if self.run is not None:
            return position, rotation
        moved = (self.compliance(frame) @ self.wrench[..., None])[..., 0]
        turned = np.where(self.samples[:, None], moved[:, 3:], 0.0)
        return position + moved[:, :3], rotation_exp(turned) @ rotation
