"""What a robot file can be told beyond what it says: parts moved, zeros, masses, friction. Gathered, then written.

Laws say what of them a file can hold (`laws/law.py: Law.written`); `redrawn.py` puts it into the file.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass, field, fields
from operator import add
from typing import Any

import numpy as np

from ..spatial import Array
from .mechanism import Mechanism


@dataclass(frozen=True)
class JointDynamics:
    """What a joint asks for beside its bodies: damping v + friction sign(v) + armature a + stiffness q + preload.

    [N m s/rad, N m, kg m^2, N m/rad, N m] of a joint that turns, [N s/m, N, kg, N/m, N] of one that slides.
    """

    damping: float = 0.0
    friction: float = 0.0
    armature: float = 0.0
    stiffness: float = 0.0
    preload: float = 0.0

    def __add__(self, other: JointDynamics) -> JointDynamics:
        return JointDynamics(*map(add, astuple(self), astuple(other)))

    @property
    def slack(self) -> float | None:
        """Where its spring is slack [rad or m]; None of a force that no position takes away."""
        return -self.preload / self.stiffness if self.stiffness else None if self.preload else 0.0


@dataclass
class Changes:
    """What changes in the file of a mechanism, gathered effect by effect.

    joints, loop_ends: displacements (6,) of a joint's place, and of a loop's end by its name and 0 or 1, as in
    `loaded/state.py: Conditions`. zeros: by how much a joint stands beyond the position that its encoder reports.
    values by their full names, and by how much lengths are longer. gravity: beyond the file's. bodies: inertial
    parameters (10,) added to a joint's body about its frame, by the joint's name. masses: factors on single links, and
    `weight` on all. compliances: of joints that yield, by name and way. views: what a pose sensor makes of a frame's
    pose P, outside P inside, by the frame; None: of every frame.
    """

    mechanism: Mechanism
    joints: dict[str, Array] = field(default_factory=dict)
    loop_ends: dict[tuple[str, int], Array] = field(default_factory=dict)
    zeros: dict[str, float] = field(default_factory=dict)
    values: dict[str, float] = field(default_factory=dict)
    lengths: dict[str, float] = field(default_factory=dict)
    bodies: dict[str, Array] = field(default_factory=dict)
    masses: dict[str, float] = field(default_factory=dict)
    weight: float | None = None
    gravity: Array = field(default_factory=lambda: np.zeros(3))
    compliances: dict[tuple[str, str], Array] = field(default_factory=dict)
    dynamics: dict[str, JointDynamics] = field(default_factory=dict)
    views: dict[str | None, tuple[Array, Array]] = field(default_factory=dict)

    def _sum(self, name: str, key: Any, more: Any) -> None:
        table = getattr(self, name)
        table[key] = table[key] + more if key in table else more

    def move_joint(self, joint: str, displacement: Array) -> None:
        self._sum("joints", joint, displacement)

    def move_loop_end(self, loop: str, end: int, displacement: Array) -> None:
        self._sum("loop_ends", (loop, end), displacement)

    def move_zero(self, joint: str, offset: float) -> None:
        self._sum("zeros", joint, offset)

    def lengthen(self, name: str, error: float) -> None:
        self._sum("lengths", name, error)

    def add_body(self, joint: int, inertial: Array) -> None:
        """Add inertial parameters (10,) about its frame to a joint's body, by its Pinocchio id."""
        self._sum("bodies", self.mechanism.joint(joint).name, inertial)

    def give_way(self, joint: str, way: str, compliance: Sequence[float]) -> None:
        self._sum("compliances", (joint, way), np.array(compliance))

    def resist(self, joint: str, dynamics: JointDynamics) -> None:
        self._sum("dynamics", joint, dynamics)

    def see(self, frame: str | None, outside: Array, inside: Array) -> None:
        """Let a pose sensor make outside P inside of what it made of a frame's pose P so far."""
        before = self.views.get(frame, (np.eye(4), np.eye(4)))
        self.views[frame] = outside @ before[0], before[1] @ inside

    def add(self, other: Changes) -> None:
        """Add changes of what comes later."""
        for name in ("joints", "loop_ends", "zeros", "lengths", "bodies", "compliances", "dynamics"):
            for key, more in getattr(other, name).items():
                self._sum(name, key, more)
        for frame, (outside, inside) in other.views.items():
            self.see(frame, outside, inside)
        for link, factor in other.masses.items():
            self.masses[link] = factor * self.masses.get(link, 1.0)
        if other.weight is not None:
            self.weight = other.weight + (self.weight or 0.0)
        self.values |= other.values
        self.gravity = self.gravity + other.gravity

    @property
    def empty(self) -> bool:
        """True where nothing changes."""
        gathered = (
            getattr(self, item.name) for item in fields(self) if item.name not in ("mechanism", "gravity", "weight")
        )
        return not (self.weight is not None or self.gravity.any() or any(gathered))

    @property
    def weighs(self) -> bool:
        """True where masses change."""
        return bool(self.bodies or self.masses or self.weight is not None)

    def forget_masses(self) -> None:
        """Leave the masses as they are."""
        self.bodies, self.masses, self.weight = {}, {}, None

    @property
    def fall(self) -> Array:
        """The acceleration of free fall [m/s^2], base axes."""
        return self.mechanism.gravity + self.gravity

    @property
    def geometric(self) -> bool:
        """True where parts stand elsewhere than drawn."""
        return bool(self.joints or self.loop_ends or self.zeros or self.lengths)
