"""Compliant modules, one kind a class; `KINDS` lists them all.

To add one: a final class in a file of its own, and one line here. The contract is in `module.py`; the tests in
`tests/modules/test_contract.py` run over this tuple. What packages and files bring along comes after it (`plugins`).
"""

from ..plugins import Library, brought, instances
from .as_published import BeamAsPublished
from .ball_nut import BallNut
from .ball_screw import BallScrew
from .beam import Beam
from .bearing import Bearing
from .bearing_pair import BearingPair
from .compliance_matrix import ComplianceMatrix
from .cross_spring_hinge import CrossSpringHinge
from .hertzian_bearing import HertzianBearing
from .joint_spring import JointSpring
from .module import CompliantModule, DriveModule, ModuleGeometry, WrenchModule, defects
from .motor import Motor
from .preloaded_ball_nut import PreloadedBallNut
from .section_beam import SectionBeam
from .support_bearing import SupportBearing
from .tapered_beam import TaperedBeam
from .timing_belt import TimingBelt

_OWN: tuple[CompliantModule, ...] = (
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
    CrossSpringHinge(),
    BeamAsPublished(),
)

_MAKE = instances(CompliantModule, "kind", defects)  # type: ignore[type-abstract]
_WORDS = tuple(kind.kind for kind in _OWN)

KINDS: Library[CompliantModule] = Library(_OWN, lambda: brought("modules", _WORDS, _MAKE))

__all__ = ["KINDS", "CompliantModule", "DriveModule", "ModuleGeometry", "WrenchModule"]
