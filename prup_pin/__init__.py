"""Stiffness of robots with closed loops, on Pinocchio: how stiff, here, in this direction, and which part is soft."""

from typing import TYPE_CHECKING

from . import build
from .design import Design, Target
from .errors import (
    InfeasibleDesignError,
    InputError,
    JointLimitWarning,
    MissingExtraError,
    NoStiffnessError,
    NotConvergedError,
    ParameterError,
    Problem,
    PrupPinError,
    RobotFileError,
    SimulationStoppedError,
    SingularPoseError,
    UnknownNameError,
    UnreachablePoseError,
)
from .kinematics import ClosedPose, Mobility
from .loaded import LoadedPose
from .loading import load
from .parameters import Parameter
from .robot import Robot
from .sensitivity import Sensitivity
from .simulation import Prediction, simulate
from .statics import Compliance
from .workspace import Workspace

if TYPE_CHECKING:  # completion and type checkers see it
    from .diagnosis import diagnose

__version__ = "0.1.0"


def __getattr__(name: str):
    # The diagnosis brings optimisers along, which a robot's stiffness does not need.
    if name == "diagnose":
        from .diagnosis import diagnose

        return diagnose
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")


__all__ = [
    "ClosedPose",
    "Compliance",
    "Design",
    "InfeasibleDesignError",
    "InputError",
    "JointLimitWarning",
    "LoadedPose",
    "MissingExtraError",
    "Mobility",
    "NoStiffnessError",
    "NotConvergedError",
    "Parameter",
    "ParameterError",
    "Prediction",
    "Problem",
    "PrupPinError",
    "Robot",
    "RobotFileError",
    "Sensitivity",
    "SimulationStoppedError",
    "SingularPoseError",
    "Target",
    "UnknownNameError",
    "UnreachablePoseError",
    "Workspace",
    "build",
    "diagnose",
    "load",
    "simulate",
]
