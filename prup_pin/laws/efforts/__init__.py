"""Laws of the effort channel: what drives must give beyond a rigid robot's inverse dynamics.

They share their words with the laws of the pose channel where it is the same physics. To add one: a final class of
`effort_law.EffortLaw` in a file, and one line in `EFFORT_LAWS`; `tests/laws/test_effort_laws.py` runs over the tuple.
"""

from ...plugins import Library
from .backlash import LostLoad
from .clock import AnotherClock
from .cogging import Cogging, CoggingOfFewPeriods
from .coulomb_friction import LoadedFriction, SlidingFriction
from .counterbalance import Counterbalance, CounterbalanceHardening, CounterbalanceSpring, CounterbalanceStrut
from .effort_filter import EffortFilter, EffortsFilter
from .effort_law import EFFORT, Body, EffortLaw
from .effort_sensor import CrossTalk, EffortDelay, EffortGain, EffortOffset, EffortsDelay, EffortUnit
from .encoder import DelayedEncoder, DelayedEncoders, OffsetEncoder
from .external_pull import ElasticPull, EvenPull
from .free_curve import CURVES, FINE_CURVES, ROUGH_CURVES, curve_by_position
from .gain_by_temperature import GainByTemperature
from .inertial_parameters import InertialParameters, ScaledInertia
from .joint_compliance import YieldingGear
from .joint_coupling import FeltMotion, FeltPosition, SpringAcross
from .mounting import Mounting
from .payload import HeldBody, HeldMeanwhile
from .rotor_inertia import RotorInertia
from .stribeck_friction import StribeckFriction
from .transmission_coupling import TransmissionCoupling
from .viscous_friction import Damping, DirectedViscousFriction
from .warming_up import (
    ColdDamping,
    ColdFriction,
    DriftingByTemperature,
    DriftingZero,
    ThinnedDamping,
    ThinnedFriction,
)

_OWN: tuple[EffortLaw, ...] = (
    Damping(),
    DirectedViscousFriction(),
    SlidingFriction(),
    LoadedFriction(),
    ColdFriction(),
    ColdDamping(),
    ThinnedFriction(),
    ThinnedDamping(),
    StribeckFriction(),
    RotorInertia(),
    YieldingGear(),
    TransmissionCoupling(),
    FeltMotion(),
    FeltPosition(),
    SpringAcross(),
    HeldBody(),
    HeldMeanwhile(),
    EvenPull(),
    ElasticPull(),
    ScaledInertia(),
    InertialParameters(),
    Counterbalance(),
    CounterbalanceSpring(),
    CounterbalanceHardening(),
    CounterbalanceStrut(),
    Mounting(),
    EffortOffset(),
    DriftingZero(),
    DriftingByTemperature(),
    EffortGain(),
    EffortUnit(),
    CrossTalk(),
    GainByTemperature(),
    EffortDelay(),
    EffortsDelay(),
    AnotherClock(),
    OffsetEncoder(),
    DelayedEncoder(),
    DelayedEncoders(),
    EffortFilter(),
    EffortsFilter(),
    Cogging(),
    CoggingOfFewPeriods(),
    LostLoad(),
)


def _brought():
    from .. import brought_laws

    return [found for found in brought_laws() if found.thing.of_efforts]


EFFORT_LAWS: Library[EffortLaw] = Library(_OWN, _brought)

__all__ = ["CURVES", "EFFORT", "EFFORT_LAWS", "FINE_CURVES", "ROUGH_CURVES", "Body", "EffortLaw", "curve_by_position"]
