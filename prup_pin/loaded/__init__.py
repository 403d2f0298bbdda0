"""The robot under load: equilibrium in the deformed position."""

from .chain import Chain, Conditions
from .equilibrium import Equilibria, find_equilibria
from .first_order import FirstOrder, elastic_deformation
from .loaded_pose import Energy, LoadedPose, find_loaded_pose
from .revalued import with_values
from .rod import LoadedRod, loaded_rod

__all__ = [
    "Chain",
    "Conditions",
    "Energy",
    "Equilibria",
    "FirstOrder",
    "LoadedPose",
    "LoadedRod",
    "elastic_deformation",
    "find_equilibria",
    "find_loaded_pose",
    "loaded_rod",
    "with_values",
]
