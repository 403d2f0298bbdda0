"""Compliant modules, one kind a class; `KINDS` lists them all.

To add one: a final class in a file of its own, and one line here. The contract is in `module.py`; the tests in
`tests/modules/test_contract.py` run over this tuple.
"""

from .as_published import BeamAsPublished
from .ball_nut import BallNut, PreloadedBallNut
from .ball_screw import BallScrew
from .beam import Beam
from .bearing import Bearing, BearingPair, HertzianBearing
from .compliance_matrix import ComplianceMatrix
from .drive import JointSpring, Motor, SupportBearing, TimingBelt
from .module import CompliantModule, DriveModule, ModuleGeometry, WrenchModule
from .section_beam import SectionBeam
from .tapered_beam import TaperedBeam

KINDS: tuple[CompliantModule, ...] = (
    Beam(),
    TaperedBeam(),
    SectionBeam(),
    Bearing(),
    BearingPair(),
    HertzianBearing(),
    BallNut(),
    PreloadedBallNut(),
    BallScrew(),
    SupportBearing(),
    TimingBelt(),
    Motor(),
    JointSpring(),
    ComplianceMatrix(),
    BeamAsPublished(),
)

__all__ = ["KINDS", "CompliantModule", "DriveModule", "ModuleGeometry", "WrenchModule"]
