"""Deeds: what laws do to a simulation. Each kind is one file that says all there is to know of it.

A deed of a new kind: a final class in a file of its own, and one line in `DEEDS`. The contract is in `deed.py`.
"""

from .cable import ToolCable
from .deed import AGREED, BLOCK, RUN, Deed, Felt, History, Moment, Solved
from .extra_tilt import ExtraTilt
from .load import HeldMass, ScaledMass, ToolLoad, ToolSpring, TurnedGravity, Weight, WrenchReading
from .on_the_way import MovedOnTheWay
from .remembered import RememberedStrain
from .report import Moved, PoseReport, Wandering
from .resistance import JointResistance
from .strain import Along, ExtraStrain, Strain, Strains
from .travel import ChangedLength, MovedJoint, MovedLoopEnd, Travel
from .value import ChangedValue
from .yielding import YieldingJoint, yield_of, yielding_values
from .yielding_base import YieldingBase, base_motion, carried_along
from .yielding_tool import YieldingTool, moved_tool, tool_motion

#: Every kind, in the order in which their first-order effects are added up.
DEEDS: tuple[type[Deed], ...] = (
    WrenchReading,
    ToolLoad,
    HeldMass,
    ToolSpring,
    ToolCable,
    Travel,
    ExtraStrain,
    ChangedValue,
    JointResistance,
    RememberedStrain,
    Weight,
    TurnedGravity,
    ScaledMass,
    ChangedLength,
    MovedJoint,
    MovedOnTheWay,
    MovedLoopEnd,
    YieldingJoint,
    ExtraTilt,
    YieldingTool,
    YieldingBase,
    PoseReport,
)
