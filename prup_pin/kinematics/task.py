"""Task coordinates: named components of the tool's pose, as values and as rows of a Jacobian."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from math import atan2, cos, hypot, isfinite, pi, remainder, sin, tan, tau
from operator import sub
from typing import NoReturn

import numpy as np

from ..errors import InputError, UnknownNameError, shortened
from ..mechanism import Frame, Mechanism
from ..mechanism.description import COMPONENTS
from ..spatial import Array


class TaskFrame:
    """The tool's task coordinates.

    Angles are those of R = R_x R_y R_z (rotation order "xyz", Eq. 50) or R = R_z R_y R_x ("zyx"), named rx, ry, rz
    after their axes. Both are singular at ry = +-90 deg.
    """

    def __init__(self, tool: Frame | None, tasks: Sequence, rotation: str, support: Array, dof_joint):
        self.rotation = rotation
        self._joint = tool.joint if tool else 0
        self._placement = tool.placement if tool else np.eye(4)
        self._offset = not np.array_equal(self._placement, np.eye(4))
        self.names = tuple(task.name for task in tasks)
        self.components = tuple(COMPONENTS.index(task.component) for task in tasks)
        self.units = {task.name: "m" if task.component in "xyz" else "rad" for task in tasks}
        #: 1 for each velocity that moves the tool, else 0, alike for all coordinates, (t, nv).
        self.moves = np.repeat(support[dof_joint, self._joint][None], len(self.names), axis=0)

    @classmethod
    def of(cls, mechanism: Mechanism) -> TaskFrame:
        """Return the task coordinates of a mechanism, none where its file defines none."""
        rotation = mechanism.description.rotation
        return cls(mechanism.tool, mechanism.tasks, rotation, mechanism.support, mechanism.dof_joint)

    def target(self, wanted: Mapping[str, float]) -> list[float]:
        """Return the wanted values in order. Raises on unknown, missing or non-finite ones."""
        try:
            values = [float(wanted[name]) for name in self.names]
        except (KeyError, OverflowError, TypeError, ValueError):
            values = []
        if not values or len(values) != len(wanted) or not all(map(isfinite, values)):
            self._refuse(wanted)
        return values

    def _refuse(self, wanted: Mapping[str, float]) -> NoReturn:
        """Say what is wrong with what was wanted."""
        if not self.names:
            raise InputError("this robot file defines no task coordinates; use pose_from_actuators([...])")
        for name in wanted:
            if name not in self.names:
                raise UnknownNameError("task coordinate", name, self.names)
        missing = [name for name in self.names if name not in wanted]
        if missing:
            raise InputError(
                f"missing task coordinate{'s' if len(missing) > 1 else ''}: {', '.join(missing)}; "
                f"give all of {', '.join(self.names)}; only those of a home that the robot file declares may "
                "be left out"
            )
        name = next(name for name in self.names if not is_finite(wanted[name]))
        raise InputError(f"{name} = {shortened(wanted[name])}: expected a finite number [{self.units[name]}]")

    def pose_vector(self, placements: Array) -> tuple[float, ...]:
        """Return (x, y, z, rx, ry, rz) of the tool; of placements (nj, 4, 4), their upper three rows will do."""
        placed = placements[self._joint]
        return self._pose_of((placed.dot(self._placement) if self._offset else placed).tolist(), atan2, hypot)

    def _pose_of(self, placed, atan2: Callable, hypot: Callable) -> tuple:
        """Return (x, y, z, rx, ry, rz) of the rows of a placement, numbers or arrays."""
        (r00, r01, r02, x), (r10, _, r12, y), (r20, r21, r22, z), *_ = placed
        if self.rotation == "xyz":
            return x, y, z, atan2(-r12, r22), atan2(r02, hypot(r00, r01)), atan2(-r01, r00)
        return x, y, z, atan2(r21, r22), atan2(-r20, hypot(r00, r10)), atan2(r10, r00)

    def values(self, placements: Array) -> Array:
        """Return the task coordinates of a configuration."""
        if not self.names:
            return np.zeros(0)
        pose = self.pose_vector(placements)
        return np.array([pose[component] for component in self.components])

    def values_of(self, base_from_tool: Array) -> Array:
        """Return the task coordinates (t,) of a placement of the tool, (4, 4)."""
        vector = self._pose_of(base_from_tool.tolist(), atan2, hypot)
        return np.array([vector[component] for component in self.components])

    def by_motion(self, base_from_tool: Array) -> Array:
        """Return d(task)/d(translation of the tool point and turn, base axes), (t, 6)."""
        angles = self._pose_of(base_from_tool.tolist(), atan2, hypot)[3:]
        return self.rates((0.0, 0.0, 0.0, *angles))

    def goal(self, target: Iterable[float]) -> Callable:
        """Return a function of (q, placements) that gives the residual, t numbers, and its rows as a function of the
        Jacobian."""
        wanted = [*map(float, target)]

        def residual(q, placements):
            pose = self.pose_vector(placements)
            error = [*map(sub, map(pose.__getitem__, self.components), wanted)]
            if max(map(abs, error), default=0.0) > pi:
                error = [
                    value if component < 3 else remainder(value, tau)
                    for component, value in zip(self.components, error, strict=True)
                ]
            return error, TaskRows(self, pose)

        return residual

    def of_many(self, placements: Array) -> tuple[Array, Array]:
        """Return the task coordinates (..., t) of placements (..., nj, 4, 4), and their rates d(task)/d(base twist)
        (..., t, 6)."""
        placed = placements[..., self._joint, :, :] @ self._placement
        entries = [[placed[..., row, column] for column in range(4)] for row in range(3)]
        pose = self._pose_of(entries, np.arctan2, np.hypot)
        rows = [np.stack(np.broadcast_arrays(*row), axis=-1) for row in self._rate_rows(pose, np.sin, np.cos, np.tan)]
        values = np.stack([pose[component] for component in self.components], axis=-1)
        return values, np.stack([rows[component] for component in self.components], axis=-2)

    def less(self, values: Array, target: Array) -> Array:
        """Return values less target (..., t), angles within half a turn."""
        error = values - target
        turning = np.array([component >= 3 for component in self.components])
        return error - np.where(turning, tau, 0.0) * np.rint(error * (1 / tau))

    def rates(self, pose: tuple[float, ...]) -> Array:
        """Return d(task)/d(base twist), (t, 6)."""
        return np.array(self.rates_in_line(pose)).reshape(-1, 6)

    def rates_in_line(self, pose: tuple[float, ...]) -> list[float]:
        """Return `rates`, row after row."""
        rows = self._rate_rows(pose, sin, cos, tan)
        rates: list[float] = []
        for component in self.components:
            rates += rows[component]
        return rates

    def _rate_rows(self, pose: tuple, sin: Callable, cos: Callable, tan: Callable) -> list:
        """Return the rates of all six components, of numbers or arrays."""
        x, y, z, rx, ry, rz = pose
        t, secant = tan(ry), 1 / cos(ry)
        # velocity of the tool point: v_O + omega x p
        rows: list = [[1.0, 0.0, 0.0, 0.0, z, -y], [0.0, 1.0, 0.0, -z, 0.0, x], [0.0, 0.0, 1.0, y, -x, 0.0]]
        if self.rotation == "xyz":
            # omega = e_x rx' + R_x e_y ry' + R_x R_y e_z rz'
            c, s = cos(rx), sin(rx)
            rows += [0.0, 0.0, 0.0, 1.0, s * t, -c * t], [0.0, 0.0, 0.0, 0.0, c, s]
            rows += ([0.0, 0.0, 0.0, 0.0, -s * secant, c * secant],)
        else:
            # omega = e_z rz' + R_z e_y ry' + R_z R_y e_x rx'
            c, s = cos(rz), sin(rz)
            rows += [0.0, 0.0, 0.0, c * secant, s * secant, 0.0], [0.0, 0.0, 0.0, -s, c, 0.0]
            rows += ([0.0, 0.0, 0.0, c * t, s * t, 1.0],)
        return rows


class TaskRows:
    """How the task coordinates at a pose (x, y, z, rx, ry, rz) change."""

    __slots__ = ("_frame", "_pose")

    def __init__(self, frame: TaskFrame, pose: tuple[float, ...]):
        self._frame, self._pose = frame, pose

    def __call__(self, jacobian: Array) -> Array:
        """Return d(task)/d(velocities), (t, nv), of the joints' base twists (6, nv)."""
        return self._frame.rates(self._pose).dot(jacobian) * self._frame.moves

    @property
    def in_line(self) -> list[float]:
        """d(task)/d(base twist of the tool), (t, 6), row after row."""
        return self._frame.rates_in_line(self._pose)


def is_finite(value: object) -> bool:
    """Return True for what is a finite number."""
    try:
        return isfinite(float(value))  # type: ignore[arg-type]
    except (OverflowError, TypeError, ValueError):
        return False
