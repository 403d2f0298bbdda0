"""What a map has to know of a robot: the names of its joints and frames, and how far a joint may go."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from ..spatial import Array


class NamedJoint(Protocol):
    """A joint: whether it slides, and where its coordinates stand among all."""

    @property
    def name(self) -> str:
        """Its name in the robot file."""

    @property
    def slides(self) -> bool:
        """Whether it moves by metres, not radians."""

    @property
    def first_q(self) -> int:
        """Where its coordinates begin."""

    @property
    def nq(self) -> int:
        """How many there are."""


class NamedRobot(Protocol):
    """A robot's names; a `Mechanism` is one."""

    @property
    def actuated(self) -> Sequence[str]:
        """The joints that have motors, in order."""

    @property
    def joints(self) -> Sequence[NamedJoint]:
        """All joints that move."""

    @property
    def frame_names(self) -> Sequence[str]:
        """All frames."""

    @property
    def limits(self) -> tuple[Array, Array]:
        """Lower and upper limits of all coordinates, infinite where there is none."""


def driven(robot: NamedRobot) -> list[str]:
    """Return the joints that have motors and one coordinate: no floating base."""
    several = {joint.name for joint in robot.joints if joint.nq > 2}  # an endless one has cosine and sine
    return [name for name in robot.actuated if name not in several]
