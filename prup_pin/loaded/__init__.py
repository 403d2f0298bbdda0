"""The robot under load: equilibrium in the deformed position."""

from .chain import Chain, chain_of, with_values
from .equilibrium import Equilibria, find_equilibria, with_torques
from .first_order import FirstOrder, elastic_deformation, module_loads
from .loaded_pose import Energy, LoadedPose, find_loaded_pose
from .other_values import deformation_of_law, present_values
from .residual import loads_on_bodies
from .rod import LoadedRod, loaded_rod
from .state import Conditions, Pull, RigidSamples, State
