"""Laws: pieces of physics that a simulation may have left out. One library, for simulation and diagnosis alike.

To add one: a final class in a file, and one line in `LAWS`. The contract is in `law.py`; the tests in
`tests/laws/test_contract.py` run over this tuple. What packages and files bring along comes after it (`plugins`).
"""

from collections.abc import Iterator, Mapping, Sequence

from ..errors import UnknownNameError
from ..mechanism import Mechanism
from ..plugins import Library, Plugin, brought, instances
from .backlash import Backlash, BacklashByAxis
from .base_compliance import BaseCompliance, BaseTilt, UnevenBaseAtPoint, UnevenBaseCompliance
from .coulomb_friction import CoulombFriction
from .creep import CreepLaw
from .eccentric_encoder import EccentricEncoder, OvalEncoder
from .encoder import EncoderDelay, EncoderOffset
from .everywhere import Everywhere
from .external_spring import ExternalSpring, UnevenSpring
from .geometric_offset import GeometricOffset
from .guide_play import GuidePlay
from .hardening import Hardening, TwoStages
from .hertzian_contact import HertzianContact
from .in_recording import in_groups, lasting
from .inputs import LEAST_WARMING, Inputs, Trajectory
from .joint_compliance import EveryJointCompliance, JointCompliance, UnevenJointCompliance
from .joint_places import JointDirection, JointPosition, LoopEndPosition, SeatPosition
from .law import Effect, Law, Place, Sharing, defects
from .lead_error import HomedLeadError, LeadError, PeriodicLeadError, PitchError
from .link_bending import LinkBending
from .model_equation_error import ModelEquationError
from .moved_from import MOVABLE
from .out_of_level import OutOfLevel
from .payload import OffCentrePayload, Payload
from .play_with_memory import HeldBacklash, LostMotion
from .pose_sensor import PoseSensorDrift, PoseSensorMisalignment, PoseSensorScale, stands_elsewhere
from .root_tilt import HubRootCompliance, RootTiltCompliance
from .self_weight import SelfWeight, SpreadSelfWeight
from .setup import Setup
from .shear import Shear, Torsion
from .slack_cable import SlackCable
from .stiffness_changed import StiffnessChanged
from .straightness_error import GuideTwist, StraightnessError
from .target import TargetMisalignment, of_markers, sits_turned
from .thermal_growth import GrowthFromSupport, LinkGrowth, ThermalGrowth
from .tool_compliance import ToolCompliance, UnevenToolAtPoint, UnevenToolCompliance
from .viscous_friction import ViscousFriction
from .wrench_sensor import (
    WrenchSensorBias,
    WrenchSensorCommonGain,
    WrenchSensorCrosstalk,
    WrenchSensorForceBias,
    WrenchSensorGain,
    WrenchSensorMisalignment,
)

_OWN: tuple[Law, ...] = (
    StiffnessChanged(),
    RootTiltCompliance(),
    HubRootCompliance(),
    JointCompliance(),
    UnevenJointCompliance(),
    EveryJointCompliance(),
    LinkBending(),
    Backlash(),
    BacklashByAxis(),
    HeldBacklash(),
    LostMotion(),
    GuidePlay(),
    HertzianContact(),
    Hardening(),
    TwoStages(),
    CoulombFriction(),
    ViscousFriction(),
    SelfWeight(),
    SpreadSelfWeight(),
    Payload(),
    OffCentrePayload(),
    ExternalSpring(),
    UnevenSpring(),
    SlackCable(),
    BaseCompliance(),
    UnevenBaseCompliance(),
    BaseTilt(),
    UnevenBaseAtPoint(),
    ToolCompliance(),
    UnevenToolCompliance(),
    UnevenToolAtPoint(),
    OutOfLevel(),
    Shear(),
    Torsion(),
    ThermalGrowth(),
    GrowthFromSupport(),
    LinkGrowth(),
    LeadError(),
    HomedLeadError(),
    PeriodicLeadError(),
    PitchError(),
    GeometricOffset(),
    JointPosition(),
    JointDirection(),
    LoopEndPosition(),
    SeatPosition(),
    StraightnessError(),
    GuideTwist(),
    EncoderOffset(),
    EncoderDelay(),
    EccentricEncoder(),
    OvalEncoder(),
    WrenchSensorMisalignment(),
    WrenchSensorGain(),
    WrenchSensorCommonGain(),
    WrenchSensorCrosstalk(),
    WrenchSensorBias(),
    WrenchSensorForceBias(),
    PoseSensorMisalignment(),
    PoseSensorDrift(),
    PoseSensorScale(),
    TargetMisalignment(),
    CreepLaw(),
    ModelEquationError(),
    *(
        Everywhere(law)
        for law in (
            StiffnessChanged(),
            RootTiltCompliance(),
            HubRootCompliance(),
            Backlash(),
            HertzianContact(),
            Hardening(),
            CoulombFriction(),
            ViscousFriction(),
            ThermalGrowth(),
            LeadError(),
            GeometricOffset(),
            EncoderOffset(),
            EncoderDelay(),
            CreepLaw(),
        )
    ),
)


_MAKE = instances(Law, "physics", defects)  # type: ignore[type-abstract]


def brought_laws() -> tuple[Plugin[Law], ...]:
    """Return the laws of either channel that are brought along. Raises PluginError."""
    from .efforts import EFFORT_LAWS

    words = dict.fromkeys(law.physics for law in (*_OWN, *EFFORT_LAWS.own))
    return brought("laws", words, _MAKE, several=True)


LAWS: Library[Law] = Library(_OWN, lambda: [found for found in brought_laws() if not found.thing.of_efforts])

__all__ = [
    "LAWS",
    "LEAST_WARMING",
    "MOVABLE",
    "Effect",
    "Everywhere",
    "Inputs",
    "Law",
    "Place",
    "Setup",
    "Sharing",
    "Trajectory",
    "brought_laws",
    "lasting",
    "law_at",
    "laws_of",
    "sits_turned",
    "stands_elsewhere",
]


def laws_of(
    mechanism: Mechanism,
    markers: Sequence[str] = (),
    groups: Mapping[str, Sequence[Sharing]] | None = None,
    alone: Sequence[Sharing] = (),
) -> Iterator[Law]:
    """Yield all laws of poses, those of `markers` beside the tool too: each once for all recordings that share it.

    groups: recordings that share a sensor, by the sensors that not all share; alone: each, where there are several.
    """
    for law in (*LAWS, *of_markers(mechanism, markers)):
        yield from in_groups(law, groups or {}, alone)


def law_at(physics: str, place: Place, mechanism: Mechanism | None = None) -> Law:
    """Return the law of that name that acts at a place. Raises UnknownNameError.

    Without the mechanism, the place's aspect tells between laws that share a name.
    """
    named = [law for law in LAWS if law.physics == physics]
    if not named:
        raise UnknownNameError("law", physics, sorted({law.physics for law in LAWS}))
    if mechanism is None:
        return next((law for law in named if law.is_named(place)), named[0])
    places: list[str] = []
    for law in named:
        there = law.places(mechanism)
        if place in there:
            return law
        places += [str(other) for other in there]
    raise UnknownNameError(f"place of {physics}", str(place), places, "" if places else _NOWHERE.format(physics))


_NOWHERE = "This robot has no place for {}."
