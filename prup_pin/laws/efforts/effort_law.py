"""The contract of a law of the effort channel: efforts (N, k) that a robot in motion needs beside its rigid body's."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from enum import Enum
from typing import ClassVar

import numpy as np

from ...dynamics import InMotion, Motion
from ...mechanism import Changes, JointDynamics, Mechanism
from ...numbers import number
from ...parameters import Quantity
from ...spatial import Array
from ..law import Law, Place
from ..setup import Setup

#: Aspect of the places of these laws, which tells them from those of the pose channel.
EFFORT = "effort"


class Body(Enum):
    """Whose inertial parameters a law changes."""

    LINK = "those of one link, each for itself"
    SCALED_LINK = "those of one link, in proportion"
    HELD = "those of what the tool holds"
    ALL_LINKS = "those of all links, each for itself"


class EffortLaw(Law):
    """One piece of physics that shows in the drives' efforts.

    What it adds is in proportion to the parameters `linear`; the others are looked for among `scanned`. In equilibrium
    it does nothing.
    """

    of_efforts: ClassVar[bool] = True
    variant: ClassVar[str] = EFFORT
    #: The parameters to which its efforts are in proportion.
    linear: ClassVar[tuple[str, ...]]
    #: True where none of them can be negative.
    one_sided: ClassVar[bool] = False
    #: Those of them that take power from the motion: friction.
    resists: ClassVar[tuple[str, ...]] = ()
    #: Share of the held-out squares that it must save, where that is more than of any law.
    least_gain: ClassVar[float] = 0.0
    #: False where it is told before any law competes.
    competes: ClassVar[bool] = True
    #: True where its columns follow from what is known of the efforts so far: they are made anew as laws are found.
    of_what_is_known: ClassVar[bool] = False
    #: True where its other parameters are looked for in what is left: scanned values are found anew as laws are.
    of_what_is_left: ClassVar[bool] = False
    #: True where it is a body that weighs and is accelerated: a gain of the effort is told by what bodies ask for.
    of_bodies: ClassVar[bool] = False
    #: Laws of one family are one thing at one place: the richer one takes the place of the plainer.
    family: ClassVar[str] = ""
    #: True where it needs joints that turn round or change speed: it says nothing of one at rest.
    of_motion: ClassVar[bool] = False
    #: True where it needs to know what was before, or how fast loads change: it says nothing of states in no order.
    of_history: ClassVar[bool] = False
    #: How many scanned values were looked at for each that stands in the library: chance had so many goes.
    looked_at: ClassVar[float] = 1.0
    #: True where another recording named it: chance has one go.
    named_before: ClassVar[bool] = False
    #: True where the shape of a curve alone tells it: it is not named where that shape is not all.
    by_shape: ClassVar[bool] = False
    #: True where every drive has it: it is there at all joints before single laws compete, and goes where needless.
    everywhere: ClassVar[bool] = False
    #: Scanned parameters that are settled between scanned values, by their logarithms.
    settled: ClassVar[tuple[str, ...]] = ()
    #: Whose inertial parameters it changes, where it does.
    body: ClassVar[Body | None] = None
    #: True of a curve through free knots, which stands for what no law explains.
    is_curve: ClassVar[bool] = False
    #: The variant by what was recorded, where this one is by what only stands in for it, such as time.
    stands_in_for: ClassVar[str] = ""
    #: True of a gain of the reported effort: gains of all drives together are asked for before laws compete.
    of_gain: ClassVar[bool] = False
    #: The one of `variables.VARIABLES` that drives it, against which it is drawn.
    against: ClassVar[str] = ""
    #: True where it was seen within the joint's travel alone: beyond it it says nothing while structure is left.
    within_travel: ClassVar[bool] = False
    #: True where all laws of its word at a place are one thing, told apart by their values (`is_same`).
    told_by_values: ClassVar[bool] = False
    #: True where it would pass for noise before other laws are known.
    told_from_noise: ClassVar[bool] = False
    #: The kind of tolerance that says by how much its first parameter is off anyway.
    tolerance: ClassVar[str] = ""

    def __init_subclass__(cls) -> None:
        """Without any of its `linear` parameters a law changes nothing, unless it says otherwise."""
        super().__init_subclass__()
        linear = cls.__dict__.get("linear")
        if isinstance(linear, tuple) and "neutral" not in cls.__dict__:
            cls.neutral = dict.fromkeys(linear, 0.0)

    @abstractmethod
    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        """Return the efforts (N, k, p) per unit of each of the p `linear` parameters; `values` holds the others."""

    def is_told_by(self, motion: Motion) -> bool:
        """Return whether a motion tells what the law needs: that joints move, what was before, or a temperature."""
        if "temperature" in self.needs and motion.temperature is None:
            return False
        return not (self.of_motion and motion.standing) and not (self.of_history and motion.separate)

    def scanned(self, place: Place, at: InMotion) -> Sequence[Mapping[str, float]]:
        """Return values of the other parameters among which the best are looked for."""
        return [{}]

    def closer(self, place: Place, values: Mapping[str, float], at: InMotion) -> Sequence[Mapping[str, float]]:
        """Return scanned values about fitted `values`, where better ones may lie between those that were scanned."""
        return []

    def otherwise(self, place: Place, values: Mapping[str, float], at: InMotion) -> Mapping[str, float] | None:
        """Return scanned values by which it does much the same in another way; None where it has but one."""
        return None

    def free(self, values: Mapping[str, float]) -> tuple[str, ...]:
        """Return the `settled` parameters that have a size: what is nothing stays nothing."""
        return tuple(name for name in self.settled if values.get(name))

    def scaled(self, values: Mapping[str, float], factors: Sequence[float]) -> Mapping[str, float]:
        """Return scanned values of which the free ones are so many times as large."""
        free = self.free(values)
        return {**values, **{name: values[name] * float(f) for name, f in zip(free, factors, strict=True)}}

    def near(self, values: Mapping[str, float]) -> float:
        """Return the change of the logarithms within which the best values lie about those that were scanned."""
        return 0.2

    def is_same(self, values: Mapping[str, float], other: Mapping[str, float]) -> bool:
        """Return whether it is there already where it has `other` scanned values; two may be there where it is not."""
        return True

    def scanned_of(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return those of its parameters that are not linear."""
        return {q.name: values[q.name] for q in self.quantities if q.name not in self.linear and q.name in values}

    def fitted(self, place: Place, coefficients: Array, values: Mapping[str, float]) -> Mapping[str, float]:
        """Return all parameters from the coefficients (p,) of a linear fit and the scanned values."""
        return {**values, **dict(zip(self.linear, map(float, coefficients), strict=True))}

    def coefficients(self, place: Place, values: Mapping[str, float]) -> Array:
        """Return the coefficients (p,) that belong to parameters; the inverse of `fitted`."""
        return np.array([values[name] for name in self.linear])

    def efforts(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        """Return the efforts (N, k) [N or N m] that the law adds."""
        return self.efforts_per(place, values, at) @ self.coefficients(place, values)

    def as_known(
        self, values: Mapping[str, float], intervals: Mapping[str, tuple[float, float]], mechanism: Mechanism
    ) -> Mapping[str, float]:
        """Return the values, NaN those of which intervals as wide as these tell nothing; most are told."""
        return values

    def prior(self, place: Place, mechanism: Mechanism) -> Array:
        """Return inverse variances (p,) of the coefficients about nothing; zero where anything is as likely.

        For coefficients of which data tell some combinations only: the others stay near what is drawn.
        """
        return np.zeros(len(self.linear))

    def covariance_inverse(self, place: Place, mechanism: Mechanism) -> Array | None:
        """Return the same as a matrix (p, p), where the coefficients are not off one by one."""
        return None

    def impossible(self, place: Place, change: Array, reach: Array, mechanism: Mechanism) -> bool:
        """Return whether nothing has coefficients `change` (p,) of a fit, each of which may be off by `reach` (p,)."""
        return False

    def together(self, places: Sequence[Place]) -> EffortLaw | None:
        """Return the law that it is at all those places at once, its columns side by side; most are at single ones."""
        return None

    def parts(self, place: Place, values: Mapping[str, float]) -> Sequence[tuple[Law, Place, Mapping[str, float]]]:
        """Return the laws, places and values as which a corrected model holds it."""
        return [(self, place, values)]

    def of_body(self, place: Place, mechanism: Mechanism) -> Mapping[int, Array]:
        """Return by joint what each coefficient adds to its body's inertial parameters (10, p), about its frame."""
        return {}

    def dynamics(self, place: Place, values: Mapping[str, float]) -> Mapping[str, JointDynamics]:
        """Return what of it robot files have words for, by joint."""
        return {}

    def beyond_dynamics(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        """Return in words what `dynamics` leaves out of it; '' where that is nothing."""
        return "" if self.dynamics(place, values) else self.statement(place, values, mechanism)

    def written(self, place: Place, values: Mapping[str, float], setup: Setup, changes: Changes) -> Sequence[str]:
        bodies = self.of_body(place, setup.mechanism)
        for joint, added in bodies.items():
            changes.add_body(joint, added @ self.coefficients(place, values))
        for name, dynamics in self.dynamics(place, values).items():
            changes.resist(name, dynamics)
        left = "" if bodies else self.beyond_dynamics(place, values, setup.mechanism)
        return (left,) if left else ()

    def agrees(self, coefficients: Array, values: Mapping[str, float]) -> bool:
        """Return whether coefficients (p,) of a fit belong to the scanned values of its columns; most are free."""
        return True

    def plausible(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> bool:
        """Return whether such values can be: within their bounds, unless a law knows better."""
        quantities = self.quantities_at(place, mechanism)
        return all(q.lower <= values[q.name] <= q.upper for q in quantities if q.name in values)

    def unlike(self, place: Place) -> Sequence[tuple[str, str]]:
        """Return words and places of plainer laws beside which it must show: without them it would imitate them."""
        return ()

    def acts(self, place: Place, at: InMotion) -> bool:
        """Return whether this motion can show it at all: the joint is driven, or moves."""
        return True

    def left_range(self, at: InMotion) -> Iterable[str]:
        """Return in words where a motion leaves the ranges in which the law was seen, if it was seen in some alone."""
        return ()


#: Shares of a joint's travel on which its friction may turn round; the first is where a search begins.
_WAYS = (3e-5, 1e-5, 1e-4, 3e-4, 1e-3, 1e-2, 0.1)

#: Shares of its usual speed below which it may be smooth.
_SPEEDS = (0.03, 0.1, 0.3)

PRESLIDING = Quantity(
    "presliding", "rad", "way on which friction turns round after the motion has", 1e-4, positive=False, upper=10.0
)


SMOOTHING = Quantity(
    "smoothing",
    "rad/s",
    "speed at which it has come to 76 %: without a step",
    0.0,
    positive=False,
    lower=0.0,
    upper=1e3,
)


def usual_way(at: InMotion, joint: str) -> float:
    """Return the way on which a joint's friction turns round, where a search begins."""
    return _WAYS[0] * float(np.ptp(at.position(joint)))


def moving_places(mechanism: Mechanism, variant: str) -> list[Place]:
    """Return the joints of one freedom that can rub: those that are driven, and those of loops."""
    names = [joint.name for joint in mechanism.joints if joint.nv == 1]
    if not mechanism.loops:
        names = [name for name in names if name in mechanism.actuated]
    return [Place(name, variant) for name in names]


def driven_places(mechanism: Mechanism, variant: str) -> list[Place]:
    """Return the driven joints."""
    return [Place(name, variant) for name in mechanism.actuated if mechanism.joint(name).nv == 1]


def motor_pairs(mechanism: Mechanism) -> list[tuple[str, str]]:
    """Return joints that turn with another one whose motor may turn with both: each with that other one."""
    turning = [place.name for place in driven_places(mechanism, "") if mechanism.joint(place.name).turns]
    if mechanism.loops:  # drives of a loop may share a gearbox wherever they stand
        return [(a, b) for a in turning for b in turning if a != b]
    pairs = []
    for name in turning:
        parent = int(mechanism.model.parents[mechanism.joint_id(name)])
        before = next((other for other in turning if mechanism.joint_id(other) == parent), None)
        if before is not None:
            pairs += [(name, before), (before, name)]
    return pairs


def joint_unit(unit: str, joint: str, mechanism: Mechanism) -> str:
    """Return a unit of a joint that turns, such as 'N m s/rad', as it is of this one: 'N s/m' of one that slides."""
    if not mechanism.joint(joint).slides:
        return unit
    return unit.replace("N m", "N").replace("kg m^2", "kg").replace("rad", "m").replace("(N)", "N")


def columns_along(at: InMotion, joint: str, *parts: Array) -> Array:
    """Return efforts (N,) along a joint as columns (N, k, p) of the drives' efforts."""
    return at.along(joint, np.stack(parts, axis=-1))


class OneJointLaw(EffortLaw):
    """A law of one joint, or of several of a kind. Its quantities have the units of joints that turn."""

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        if not mechanism.joint(place.name).slides:
            return self.quantities
        return in_units(self.quantities, [joint_unit(q.unit, place.name, mechanism) for q in self.quantities])

    def sized(self, name: str, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        """Return the value of a parameter with its unit there, '3.2 N m'."""
        unit = next(q.unit for q in self.quantities_at(place, mechanism) if q.name == name)
        return f"{number(values[name], 3)} {unit}"


class JointEffortLaw(OneJointLaw):
    """A law of one joint that may be driven or passive."""

    of_motion = True

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return moving_places(mechanism, self.variant)

    def acts(self, place: Place, at: InMotion) -> bool:
        return at.moves(place.name) and at.shows(place.name)


class DrivenEffortLaw(OneJointLaw):
    """A law of one driven joint."""

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return driven_places(mechanism, self.variant)

    def acts(self, place: Place, at: InMotion) -> bool:
        return place.name in at.driven


class MovingEffortLaw(DrivenEffortLaw):
    """A law of one driven joint that acts where it moves."""

    def acts(self, place: Place, at: InMotion) -> bool:
        return super().acts(place, at) and at.moves(place.name)


class TwoJointLaw(EffortLaw):
    """A law of two driven joints: its place is the one, its aspect says the other."""

    #: What its aspect begins with, before the other joint.
    beginning: ClassVar[str]

    def is_named(self, place: Place) -> bool:
        return place.aspect.startswith(self.beginning)

    def other(self, place: Place) -> str:
        """Return the other joint."""
        return place.aspect.removeprefix(self.beginning)

    def same_places(self, place: Place, mechanism: Mechanism) -> Sequence[str]:
        return [self.other(place)]

    def acts(self, place: Place, at: InMotion) -> bool:
        both = {place.name, self.other(place)}
        return both <= set(at.driven) and all(at.moves(name) for name in both)

    def along_both(self, at: InMotion, place: Place, ratio: float, parts: Sequence[Array]) -> Array:
        """Return efforts (N,) along the joint, and `ratio` times as large along the other one, as columns (N, k, p)."""
        whole = np.stack(parts, axis=-1)
        return at.along(place.name, whole) + at.along(self.other(place), ratio * whole)


class FrictionThatTurns(EffortLaw):
    """What rubs turns round on a short way after the motion has, and may have no step there: by these two, settled."""

    of_motion = True
    one_sided = True
    settled: ClassVar[tuple[str, ...]] = ("presliding", "smoothing")
    optional = ("smoothing",)

    def scanned(self, place: Place, at: InMotion) -> Sequence[Mapping[str, float]]:
        return [{"presliding": usual_way(at, place.name), "smoothing": 0.0}]

    def closer(self, place: Place, values: Mapping[str, float], at: InMotion) -> Sequence[Mapping[str, float]]:
        travel, kept = float(np.ptp(at.position(place.name))), self.scanned_of(values)
        ways = [{**kept, "presliding": share * travel} for share in _WAYS[1:]]
        usual = float(np.sqrt(np.mean(at.speed(place.name) ** 2)))
        return [*ways, *({**kept, "smoothing": share * usual} for share in _SPEEDS if "smoothing" in kept)]

    def otherwise(self, place: Place, values: Mapping[str, float], at: InMotion) -> Mapping[str, float] | None:
        way, smoothing = values.get("presliding", 0.0), values.get("smoothing")
        if smoothing is None or not way > 0:
            return None
        if not smoothing > 0:
            # a joint that speeds up by a has come to (2 a s)^1/2 on the way s; from there downwards, for a step between
            # two samples tells nothing of how smooth it is
            usual, way = float(np.sqrt(np.mean(at.acceleration(place.name) ** 2))), max(way, usual_way(at, place.name))
            smoothing = float(np.sqrt(2 * usual * way))
        return {**values, "presliding": 0.0, "smoothing": smoothing} if smoothing > 0 else None


class DryFriction(FrictionThatTurns):
    """Dry friction of one joint, and what makes more of it: its `limit` is what a robot file has a word for."""

    family = "dry friction"
    against = "speed"

    def dynamics(self, place: Place, values: Mapping[str, float]) -> Mapping[str, JointDynamics]:
        return {place.name: JointDynamics(friction=values["limit"])}


def in_units(quantities: Sequence[Quantity], units: Sequence[str]) -> tuple[Quantity, ...]:
    """Return quantities with other units, one for each."""
    return tuple(replace(quantity, unit=unit) for quantity, unit in zip(quantities, units, strict=True))
