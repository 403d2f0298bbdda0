"""A robot in motion: what its clocks, encoders and drives recorded, and the efforts that a rigid robot would need.

Two steps, and nothing else of a recording of efforts is known here: `motion_of` makes positions, speeds and
accelerations on an even clock, and `InverseDynamics` says what the actuators must then give, loops included.
"""

from .clock import EvenClock, even_clock
from .in_motion import Explained, InMotion, could_be_gravity
from .inertial import INERTIAL, in_frame, point_mass
from .inertial_loads import BodyMotion, body_motion
from .inverse import InverseDynamics, Trajectory
from .motion import Motion, is_standing, motion_of
from .saturation import at_limit
from .smoothing import Band, LowPass, bandwidth
from .travel import Path
