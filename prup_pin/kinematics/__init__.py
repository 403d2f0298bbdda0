"""Loops are closed here: task coordinates or actuator positions become a `ClosedPose`."""

from .closed_pose import ClosedPose, PassiveBalance
from .loop_kinematics import LONGEST, SURE, TOLERANCE, LoopKinematics
from .many_poses import AWAY, CLOSED, DOUBTFUL, LIMITS, ManyPoses, Reached, alone
from .mobility import Mobility, mobility
from .task import TaskFrame
