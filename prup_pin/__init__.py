"""Stiffness of robots with closed loops, on Pinocchio: how stiff, here, in this direction, and which part is soft."""

from .errors import (
    InputError,
    JointLimitWarning,
    MissingExtraError,
    NoStiffnessError,
    ParameterError,
    Problem,
    PrupPinError,
    RobotFileError,
    SingularPoseError,
    UnknownNameError,
    UnreachablePoseError,
)
from .kinematics import ClosedPose, Mobility
from .loading import load
from .parameters import Parameter
from .robot import Robot
from .statics import Compliance

__version__ = "0.1.0"

__all__ = [
    "ClosedPose",
    "Compliance",
    "InputError",
    "JointLimitWarning",
    "MissingExtraError",
    "Mobility",
    "NoStiffnessError",
    "Parameter",
    "ParameterError",
    "Problem",
    "PrupPinError",
    "Robot",
    "RobotFileError",
    "SingularPoseError",
    "UnknownNameError",
    "UnreachablePoseError",
    "load",
]
