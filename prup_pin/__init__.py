"""Stiffness of robots with closed loops, on Pinocchio: how stiff, here, in this direction, and which part is soft."""

# ruff: noqa: F403, F405 - the names are those of _public

import sys
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from ._moved import Moved

if TYPE_CHECKING:  # completion and type checkers see it
    from ._public import *
    from .diagnosis import diagnose

__version__ = "0.1.0"
sys.meta_path.append(Moved())  # the last: asked for what is nowhere else


def __getattr__(name: str) -> Any:
    # Loaded where it is asked for: what starts the command must be in charge first. The diagnosis brings optimisers
    # along, which a robot's stiffness does not need.
    if name in __all__:
        return getattr(import_module(".diagnosis" if name == "diagnose" else "._public", __name__), name)
    if not name.startswith("_") and find_spec(f"{__name__}.{name}") is not None:
        return import_module(f"{__name__}.{name}")
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


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
