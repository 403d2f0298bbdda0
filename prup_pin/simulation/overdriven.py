"""Robots with more actuators than motions: no rigid pose has what their encoders say, which never quite agree.

What yields gives way by that much. The pose is that of as many actuators as there are motions; what the others say
beside it moves them in the deformed position, as any travel does.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from ..errors import PrupPinError, UnreachablePoseError
from ..kernel import independent, rank_of
from ..kinematics import ClosedPose
from ..mechanism import Mechanism
from ..numbers import quantity
from ..robot import Robot
from ..spatial import Array

#: Actuators may differ by so much [rad], and by this share of the robot's size [m]: seats that were measured by tape
#: are off by as much, and more is no matter of encoders.
_APART = 0.05


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

        None where there are no more of them than motions, or those that are chosen reach no pose. Raises
        UnreachablePoseError where they differ by far, or where nothing yields by what they differ.
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
        worst = int(np.argmax(np.abs(beyond) / apart))
        said = (
            f"'{mechanism.name}' has {len(values)} drives for {len(chosen)} motions, and {mechanism.actuated[worst]} "
            f"reads {quantity(beyond[worst], 'm' if slides[worst] else 'rad')} beside where the others put it"
        )
        if (np.abs(beyond) >= apart).any():
            raise UnreachablePoseError(
                f"{said}, too far for one pose of this robot: check the order, units and zeros of the q columns"
            )
        if not mechanism.modules:
            raise UnreachablePoseError(
                f"{said}, which nothing of its file yields: give its drives springs (joint_spring, or "
                "--joint-stiffness), or leave surplus ones out of the actuated joints"
            )
        return pose, beyond
