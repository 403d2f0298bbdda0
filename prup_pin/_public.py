"""What the package offers by its own name; it takes a second or two to load."""

# ruff: noqa: F401

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
