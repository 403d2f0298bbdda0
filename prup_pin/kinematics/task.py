"""Task coordinates: named components of the tool's pose, as values and as rows of a Jacobian."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ..errors import InputError, UnknownNameError
from ..mechanism import Frame
from ..spatial import Array


class TaskFrame:
    """The tool's task coordinates.

    Angles are those of R = R_x R_y R_z (rotation order "xyz", Eq. 50) or R = R_z R_y R_x ("zyx"), named rx, ry, rz
    after their axes. Both are singular at ry = +-90 deg.
    """

    def __init__(self, tool: Frame | None, tasks: Sequence, rotation: str, support: Array, dof_joint):
        self.tool, self.rotation = tool, rotation
        self.names = tuple(task.name for task in tasks)
        self.components = tuple("x y z rx ry rz".split().index(task.component) for task in tasks)
        self.units = {task.name: "m" if task.component in "xyz" else "rad" for task in tasks}
        self._angles = np.array([component >= 3 for component in self.components], bool)
        self._moves = support[dof_joint, tool.joint] if tool else None
        self._indices = np.array(self.components, int)

    def target(self, wanted: Mapping[str, float]) -> Array:
        """Return the wanted values in order. Raises on unknown, missing or non-finite ones."""
        if not self.names:
            raise InputError("this robot file defines no task coordinates; use pose_from_actuators([...])")
        for name in wanted:
            if name not in self.names:
                raise UnknownNameError("task coordinate", name, self.names)
        missing = [name for name in self.names if name not in wanted]
        if missing:
            raise InputError(f"missing task coordinate{'s' if len(missing) > 1 else ''}: {', '.join(missing)}; give all of {', '.join(self.names)}")
        values = []
        for name in self.names:
            try:
                value = float(wanted[name])
            except (TypeError, ValueError):
                value = np.nan
            if not np.isfinite(value):
                raise InputError(f"{name} = {wanted[name]!r}: expected a finite number [{self.units[name]}]")
            values.append(value)
        return np.array(values)

    def pose_vector(self, placements: Array) -> Array:
        """Return (x, y, z, rx, ry, rz) of the tool."""
        placed = placements[self.tool.joint] @ self.tool.placement
        rotation = placed[:3, :3] if self.rotation == "xyz" else placed[:3, :3].T
        sign = 1.0 if self.rotation == "xyz" else -1.0
        ry = np.arctan2(rotation[0, 2], np.hypot(rotation[0, 0], rotation[0, 1]))
        rx = np.arctan2(-rotation[1, 2], rotation[2, 2])
        rz = np.arctan2(-rotation[0, 1], rotation[0, 0])
        return np.array([*placed[:3, 3], sign * rx, sign * ry, sign * rz])

    def values(self, placements: Array) -> Array:
        """Return the task coordinates of a configuration."""
        return self.pose_vector(placements)[self._indices] if self.names else np.zeros(0)

    def goal(self, target: Array) -> Callable:
        """Return the residual and its rows, as Newton wants them."""

        def residual(q, placements, jacobian):
            pose = self.pose_vector(placements)
            error = pose[self._indices] - target
            error = np.where(self._angles, (error + np.pi) % (2 * np.pi) - np.pi, error)
            return error, self._rates(pose) @ (jacobian * self._moves)

        return residual

    def _rates(self, pose: Array) -> Array:
        """Return d(task)/d(base twist), (t, 6)."""
        x, y, z, rx, ry, rz = pose
        rates = np.zeros((6, 6))
        rates[0, 0] = rates[1, 1] = rates[2, 2] = 1.0
        # velocity of the tool point: v_O + omega x p
        rates[0, 4], rates[0, 5], rates[1, 3], rates[1, 5], rates[2, 3], rates[2, 4] = z, -y, -z, x, y, -x
        first, last = (rx, 0) if self.rotation == "xyz" else (rz, 2)
        c, s, t = np.cos(first), np.sin(first), np.tan(ry)
        if last == 0:
            # omega = e_x rx' + R_x e_y ry' + R_x R_y e_z rz'
            rates[3, 3:] = 1.0, s * t, -c * t
            rates[4, 3:] = 0.0, c, s
            rates[5, 3:] = 0.0, -s / np.cos(ry), c / np.cos(ry)
        else:
            # omega = e_z rz' + R_z e_y ry' + R_z R_y e_x rx'
            rates[5, 3:] = c * t, s * t, 1.0
            rates[4, 3:] = -s, c, 0.0
            rates[3, 3:] = c / np.cos(ry), s / np.cos(ry), 0.0
        return rates[self._indices]
