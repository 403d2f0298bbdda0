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


def _view(self, *args, **options):
    """Return a view of the robot in meshcat's viewer; see `prup_pin.views.meshcat_view.view`."""
    from .views.meshcat_view import view

    return view(self, *args, **options)


# Views are leaves: the robot does not know them, so its method is added here.
Robot.view = _view  # type: ignore[attr-defined]

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
