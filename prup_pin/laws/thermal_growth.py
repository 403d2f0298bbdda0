"""Bodies that grow as they warm up."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import ClassVar

import numpy as np

from ..mechanism import REFERENCE_TEMPERATURE, Joint, Mechanism
from ..numbers import number, quantity
from ..parameters import Quantity
from ..spatial import Array
from .deeds import Deed, ExtraStrain, MovedOnTheWay, Solved, Strain, Travel
from .drawn import Drawn
from .follows import Followed
from .law import Law, Place
from .modules_at import beams, lengths_of, screws, travels
from .setup import Setup

#: A joint nearer than this to the one before it, or beside a slide's line, is there [m].
_HERE = 1e-9


class ThermalGrowth(Law):
    """What a slide's actuator holds grows between its fixed support and the nut, by alpha l (T - 20 deg C).

    l is the slide's position q, and the way along its axis from the joint before it where there is one: of a screw on
    the base l = q, of a platform's leg the whole leg. A beam grows along its length. The actuator's encoder turns with
    the motor, so it does not see a screw grow.
    """

    physics = "thermal_growth"
    summary = "growth with temperature"
    called = "heat, expansion"
    remedy = "warm the machine up before it works, or correct {place} by its temperature"
    needs = ("temperature",)
    quantities = (Quantity("expansion", "1/K", "coefficient of expansion", 1e-5, lower=0.0, upper=5e-4),)
    neutral: ClassVar = {"expansion": 0.0}

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        rods = [Place(module.name) for module in beams(mechanism) if module.inboard_is_root]
        return [*(Place(name) for name in _held(mechanism)), *rods]

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        growth = values["expansion"] * setup.inputs.warming
        found = _held(setup.mechanism)
        if place.name in found:
            column, before = found[place.name]
            yield Travel(column, growth * (before + setup.inputs.actuators[:, column]))
            return
        lengths = lengths_of(setup, setup.mechanism.module(place.name))
        yield ExtraStrain(place.name, Strain(_grow, (growth * lengths,)))

    def drawn(self, place: Place, at: Solved) -> Drawn:
        found = _held(at.setup.mechanism)
        if place.name in found:
            column, before = found[place.name]
            length, direction = before + at.setup.inputs.actuators[:, column], at.first.by_travel(column)
        else:
            direction = at.first.by_strain(place.name)[:, :, 2]
            length = lengths_of(at.setup, at.setup.mechanism.module(place.name))
        warm = REFERENCE_TEMPERATURE + at.setup.inputs.warming[at.samples]
        labels, units = ("temperature", "growth per length"), ("°C", "m/m")
        return Drawn(warm, direction * length[at.samples, None], labels, units)

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"{place} grows as it warms up, by {quantity(values['expansion'], '1/K')}"


class GrowthFromSupport(Law):
    """What a slide's actuator holds grows from a support that stands anywhere: alpha (length + q) (T - 20 deg C).

    Robot files put a slide's zero where they like, mostly in the middle of its way, and say nothing of the bearing that
    holds its screw: `length` is the way from there to the zero, negative where it stands at the other end. What knows
    its ball screw knows its bearing too.
    """

    physics = "thermal_growth"
    summary = "growth from a support that the robot file does not tell"
    remedy = "warm the machine up before it works, or correct {place} by its temperature"
    variant = "from its support"
    needs = ("temperature",)
    quantities = (
        *ThermalGrowth.quantities,
        Quantity("length", "m", "way from the support to the slide's zero", 0.5, lower=-5.0, upper=5.0),
    )
    neutral: ClassVar = {"expansion": 0.0}

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        told = screws(mechanism)
        return [Place(name, self.variant) for name in _held(mechanism) if name not in told]

    def starts(self, place: Place, mechanism: Mechanism) -> Sequence[Mapping[str, float]]:
        return [{"expansion": 1e-5, "length": length} for length in (0.5, -0.5)]

    def usual_at(self, place: Place, mechanism: Mechanism) -> Mapping[str, tuple[float, float]]:
        return {"length": (0.0, _extent(place, mechanism))}

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        column, _ = _held(setup.mechanism)[place.name]
        length = values["length"] + setup.inputs.actuators[:, column]
        yield Travel(column, values["expansion"] * setup.inputs.warming * length)

    def drawn(self, place: Place, at: Solved) -> Drawn:
        column, _ = _held(at.setup.mechanism)[place.name]
        warm = REFERENCE_TEMPERATURE + at.setup.inputs.warming[at.samples]
        return Drawn(warm, at.first.by_travel(column), ("temperature", "growth"), ("°C", "m"))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        if abs(values["length"]) > _extent(place, mechanism):  # nothing of the robot grows from there
            shift = number(1e6 * values["expansion"] * values["length"], 3)
            return f"{place.name} is displaced as it warms up, by about {shift} µm/K, much alike wherever it stands"
        growth, length = quantity(values["expansion"], "1/K"), quantity(values["length"], "m")
        return f"{place.name} grows as it warms up, by {growth}, from a support {length} before its zero"


class LinkGrowth(Law):
    """A rigid link grows: the joints that it carries move away from its own by alpha (T - 20 deg C) times their places.

    All along the link alike, about the frame of the joint that carries it. Where the tool or the end of a loop sits on
    a link its place stays as drawn.
    """

    physics = "thermal_growth"
    summary = "a link that grows with temperature"
    called = "heat, expansion, warm arm"
    remedy = "let the robot warm up before it works, or correct the length of {place} by its temperature"
    variant = "link"
    needs = ("temperature",)
    quantities = ThermalGrowth.quantities
    neutral: ClassVar = {"expansion": 0.0}

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place(name, self.variant) for name in _links(mechanism)]

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        growth = values["expansion"] * setup.inputs.warming
        for joint in _carried(place.name, setup.mechanism):
            moved = growth[:, None] * _at(joint, setup.mechanism)
            yield MovedOnTheWay(joint.name, np.concatenate((moved, np.zeros_like(moved)), axis=1))

    def drawn(self, place: Place, at: Solved) -> Drawn:
        mechanism = at.setup.mechanism
        carried = _carried(place.name, mechanism)
        moved = sum(at.first.by_joint(each.id)[..., :3] @ _at(each, mechanism) for each in carried)
        warm = REFERENCE_TEMPERATURE + at.setup.inputs.warming[at.samples]
        return Drawn(warm, np.asarray(moved), ("temperature", "growth per length"), ("°C", "m/m"))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        far = max(float(np.linalg.norm(_at(joint, mechanism))) for joint in _carried(place.name, mechanism))
        growth, each = quantity(values["expansion"], "1/K"), quantity(values["expansion"] * far, "m")
        return f"the link {place.name} grows as it warms up, by {growth}: {each} a kelvin at the joint it carries"


def _links(mechanism: Mechanism) -> list[str]:
    """Return the rigid links that carry other joints at some distance from their own.

    Not the base, nor where a beam or a length of the robot file tells the link's own, nor where loops hold it so that
    it could not grow.
    """
    followed = Followed(mechanism)
    drawn = {name for length in mechanism.description.lengths for name, _ in length.moves}
    bent = {module.joint for module in beams(mechanism)}
    held = {frame.joint for loop in mechanism.loops for frame in (loop.first, loop.second)}
    found = []
    for own in mechanism.joints:
        name = mechanism.bodies[own.id]
        carried = _carried(name, mechanism)
        rigid = not {own.id, *(joint.id for joint in carried)} & bent and own.id not in held
        told = drawn & {joint.name for joint in carried}
        moves = [np.concatenate((_at(joint, mechanism), np.zeros(3)))[None] for joint in carried]
        if carried and rigid and not told and all(map(followed.joint, carried, moves)):
            found.append(name)
    return found


def _carried(link: str, mechanism: Mechanism) -> list[Joint]:
    """Return the joints that a link carries at some distance from its own.

    Not a driven slide in whose line it lies, which holds that length itself, and grows by its own law.
    """
    model, found = mechanism.model, []
    for joint in mechanism.joints:
        way = _at(joint, mechanism)
        if joint.slides and joint.name in mechanism.actuated:
            along = model.jointPlacements[joint.id].rotation @ joint.axis
            way = way - (way @ along) * along
        if mechanism.bodies.get(int(model.parents[joint.id])) == link and np.linalg.norm(way) > _HERE:
            found.append(joint)
    return found


def _at(joint: Joint, mechanism: Mechanism) -> Array:
    """Return a joint's place on the link that carries it (3,) [m], in the axes of that link's joint."""
    return np.array(mechanism.model.jointPlacements[joint.id].translation)


def _held(mechanism: Mechanism) -> dict[str, tuple[int, float]]:
    """Return what actuated slides hold, by what makes their travel: their column, and the length beyond q [m]."""
    found: dict[str, tuple[int, float]] = {}
    for name, column in travels(mechanism).items():
        joint = mechanism.joint(mechanism.actuated[column])
        if joint.slides:
            placed = mechanism.model.jointPlacements[joint.id]
            carried = int(mechanism.model.parents[joint.id]) > 0
            found[name] = column, float(placed.translation @ placed.rotation @ joint.axis) if carried else 0.0
    return found


def _extent(place: Place, mechanism: Mechanism) -> float:
    """Return how far off a support may stand [m]: as far as the robot's joints at home, or as the slide goes."""
    column, _ = _held(mechanism)[place.name]
    at = mechanism.joint(mechanism.actuated[column]).first_q
    model = mechanism.model
    ends = abs(float(model.lowerPositionLimit[at])), abs(float(model.upperPositionLimit[at]))
    joints = mechanism.placements(mechanism.home_configuration())[:, :3, 3]
    return min(GrowthFromSupport.quantities[1].upper, max(*ends, float(np.linalg.norm(joints, axis=1).max())))


def _grow(load: Array, extent: Array) -> tuple[Array, Array]:
    """Return the strain of beams that are longer by `extent` (N,), whatever their load."""
    strain = np.zeros_like(load)
    strain[:, 2] = extent
    return strain, np.zeros((*load.shape, load.shape[1]))
