"""Loops are closed here: task coordinates or actuator positions become a `ClosedPose`."""

from .closed_pose import ClosedPose, PassiveBalance
from .loop_kinematics import TOLERANCE, LoopKinematics
from .mobility import Mobility, mobility

__all__ = ["TOLERANCE", "ClosedPose", "LoopKinematics", "Mobility", "PassiveBalance", "mobility"]
