"""Loops are closed here: task coordinates or actuator positions become a `ClosedPose`."""

from .closed_pose import ClosedPose, PassiveBalance
from .loop_kinematics import LoopKinematics
from .mobility import Mobility, mobility

__all__ = ["ClosedPose", "LoopKinematics", "Mobility", "PassiveBalance", "mobility"]
