"""Stiffness of robots with closed loops, on Pinocchio: how stiff, here, in this direction, and which part is soft."""

# ruff: noqa: F403, F405 - the names are those of _public

# Next to nothing is loaded here, not even typing: what starts the command must be in charge of interrupts first.
import sys

TYPE_CHECKING = False
if TYPE_CHECKING:  # completion and type checkers see it
    from importlib.machinery import ModuleSpec
    from typing import Any

    from ._public import *
    from .diagnosis import diagnose

__version__ = "0.2.0"


class _Moved:
    """Finds a moved module by its old name, once nothing else has found it."""

    @staticmethod
    def find_spec(fullname: str, path: object = None, target: object = None) -> "ModuleSpec | None":
        if not fullname.startswith(f"{__name__}."):
            return None
        from ._moved import Moved

        return Moved().find_spec(fullname)


sys.meta_path.append(_Moved)


def __getattr__(name: str) -> "Any":
    # The diagnosis brings optimisers along, which a robot's stiffness does not need.
    from importlib import import_module
    from importlib.util import find_spec

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
