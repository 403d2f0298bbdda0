"""Robots with more actuators than motions: no rigid pose has what their encoders say, which never quite agree.

What yields gives way by that much. The pose is that of as many actuators as there are motions; what the others say
beside it moves them in the deformed position, as any travel does.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from ..errors import PrupPinError
from ..kernel import independent, rank_of
from ..kinematics import ClosedPose
from ..mechanism import Mechanism
from ..robot import Robot
from ..spatial import Array

#: Actuators may differ by so much [rad], and by this share of the robot's size [m]: more is no matter of encoders.
_APART = 0.01


class Overdriven:
    """A robot where its actuators' positions close no loops: poses by as many of them as there are motions."""

    def __init__(self, robot: Robot):
        self._robot = robot

    @cached_property
    def _fewer(self) -> tuple[Robot, np.ndarray] | None:
        """The robot by these actuators, and which they are; None where they are all."""
        mechanism = self._robot.mechanism
        kinematics = self._robot._kinematics
        scales = kinematics.scales(np.arange(mechanism.model.nv))
        motions = rank_of(kinematics.evaluate(kinematics.home).closure, *scales).right[mechanism.actuated_dofs]
        chosen = np.sort(independent(motions)[0])
        if len(chosen) == len(motions):
            return None
        names = tuple(mechanism.actuated[place] for place in chosen)
        return Robot(Mechanism(replace(mechanism.description, actuated=names), mechanism.locked)), chosen

    def pose(self, values: Array) -> tuple[ClosedPose, Array] | None:
        """Return the pose at the actuators' positions (a,), and what they are beyond it, (a,) [m, rad].

        None where there are no more of them than motions, or where they differ by far.
        """
        mechanism = self._robot.mechanism
        try:
            if self._fewer is None:
                return None
            fewer, chosen = self._fewer
            pose = self._robot.pose_from_configuration(fewer.pose_from_actuators(values[chosen]).q.tolist())
        except PrupPinError:
            return None
        beyond = values - np.array([pose.actuators[name] for name in mechanism.actuated])
        slides = np.array([mechanism.joint(name).unit == "m" for name in mechanism.actuated])
        apart = _APART * np.where(slides, self._robot.characteristic_length, 1.0)
        return (pose, beyond) if (np.abs(beyond) < apart).all() else None
