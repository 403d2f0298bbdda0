"""Guides that are not straight: bowed to the sides, or twisted along their way."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from typing import ClassVar

import numpy as np

from ..mechanism import Joint, Mechanism
from ..numbers import quantity
from ..parameters import Quantity
from ..spatial import Array, rotation_exp
from .deeds import Deed, MovedOnTheWay
from .follows import Followed
from .joint_places import about, across
from .law import Law, Place
from .setup import Setup

#: Lines nearer than this are one [m, rad].
_ALIKE = 1e-9


def _small(name: str, unit: str, description: str, start: float, bound: float) -> Quantity:
    return Quantity(name, unit, description, start, lower=-bound, upper=bound)


class OfGuide(Law):
    """What a slide carries follows a guide that is not straight, whatever loads it.

    At u = q - middle it is turned by turn + rate u about one or more axes, and displaced to the sides as a guide runs
    that is turned so: by the integral of the turns across the slide. The middle is that of the joint's limits; where
    it has none, home. To first order these are the errors of straightness, pitch, yaw and roll of ISO 230-1.
    """

    physics = "straightness_error"
    source = "ISO 230-1, 3.4 and 3.5; Slocum, Precision Machine Design (1992), ch. 2"
    quantities = ()
    neutral: ClassVar = {}
    cost = 3.0

    @abstractmethod
    def axes(self, joint: Joint) -> Mapping[str, tuple[str, Array]]:
        """Return the axes (3,) about which it turns, by the name of the turn: the name of the rate, and the axis."""

    @abstractmethod
    def rate(self, name: str, turn: str) -> Quantity:
        """Return a rate by its name, about the axis of a turn."""

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        """Return driven slides, and those that follow them.

        Beside loops a guide is a slide on the base: what slides in a leg is held by the hinges at its ends.
        """
        followed, found = Followed(mechanism), []
        for name in (*mechanism.actuated, *mechanism.coupling.names):
            joint = mechanism.joint(name)
            carried = int(mechanism.model.parents[joint.id]) > 0
            if not joint.slides or name in mechanism.locked or (mechanism.loops and carried):
                continue
            if followed.joint(joint, self._moves(joint, mechanism)):
                found.append(Place(name, self.variant))
        return found

    def _moves(self, joint: Joint, mechanism: Mechanism) -> Array:
        """Return the turns, and the ways aside that go with them, as displacements (k, 6) of the joint's place."""
        drawn = mechanism.model.jointPlacements[joint.id].rotation
        turns = np.array([axis for _, axis in self.axes(joint).values()])
        aside = np.cross(turns, joint.axis) @ drawn.T
        still = np.zeros_like(turns)
        return np.concatenate((np.hstack((still, turns)), np.hstack((aside, still))))

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        axes = self.axes(mechanism.joint(place.name))
        rates = (self.rate(rate, turn) for turn, (rate, _) in axes.items())
        turns = (_small(turn, "rad", "turn in the middle of the way", 1e-3, 0.1) for turn in axes)
        return (*rates, *turns)

    def neutral_at(self, place: Place, mechanism: Mechanism) -> Mapping[str, float]:
        return {item.name: 0.0 for item in self.quantities_at(place, mechanism)}

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        joint = setup.mechanism.joint(place.name)
        at = setup.position(place.name)
        beyond = (at - middle_of(joint, setup.mechanism))[:, None]
        turn, aside = np.zeros((2, len(at), 3))
        for name, (rate, axis) in self.axes(joint).items():
            turn += (values[name] + values[rate] * beyond) * axis
            aside += (values[name] * beyond + values[rate] * beyond**2 / 2) * np.cross(axis, joint.axis)
        # its place is moved before the joint slides, and a turned place turns its way: that is taken back
        way = at[:, None] * joint.axis
        aside = aside + way - (rotation_exp(turn) @ way[..., None])[..., 0]
        drawn = setup.mechanism.model.jointPlacements[joint.id].rotation
        yield MovedOnTheWay(place.name, np.concatenate((aside @ drawn.T, turn), axis=1))


class StraightnessError(OfGuide):
    """The guide is bowed: of constant curvature towards each of two sides, and turned in the middle of its way."""

    summary = "a guide that is bowed"
    called = "straightness, bow, bent column, sagging rail, warped bed, guideway, pitch, yaw, angular error, ISO 230-1"
    remedy = (
        "check the guide of {place} with a straightedge or an autocollimator, then align its bed, or give the "
        "controller this error as a table"
    )

    def axes(self, joint: Joint) -> Mapping[str, tuple[str, Array]]:
        return {name: (f"bow_{name.removeprefix('r')}", axis) for name, axis in across(joint.axis).items()}

    def rate(self, name: str, turn: str) -> Quantity:
        return _small(name, "rad/m", f"turn {about(turn)} per way: the guide's curvature", 1e-3, 1.0)

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        joint = mechanism.joint(place.name)
        rates, turns = [], []
        for name, (rate, _) in self.axes(joint).items():
            rates.append(f"{quantity(values[rate], 'rad', signed=True)} {about(name)}")
            turns.append(f"{quantity(values[name], 'rad', signed=True)} {about(name)}")
        rates_of = np.array([values[rate] for rate, _ in self.axes(joint).values()])
        sagitta = quantity(float(np.linalg.norm(rates_of)) / 8, "m")
        middle = quantity(middle_of(joint, mechanism), "m")
        return (
            f"the guide of {place.name} is bowed, by {sagitta} over a metre: what it carries turns by "
            f"{' and '.join(rates)} per metre of its way, and is turned by {' and '.join(turns)} at {middle}"
        )


class GuideTwist(OfGuide):
    """The guide is twisted: what it carries rolls about the slide in proportion to its way."""

    summary = "a guide that is twisted"
    called = "roll, twist, torsion of a bed, winding of a guideway, ISO 230-1"
    remedy = "check the guide of {place} with a level, then align its bed, or give the controller this error as a table"
    variant = "twist"

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        """Return those of them that carry no free hinge about their own line, which would take the roll up."""
        return [place for place in super().places(mechanism) if not _spins(mechanism.joint(place.name), mechanism)]

    def axes(self, joint: Joint) -> Mapping[str, tuple[str, Array]]:
        return {"roll": ("twist", joint.axis)}

    def rate(self, name: str, turn: str) -> Quantity:
        return _small(name, "rad/m", "turn about the slide per way", 1e-3, 1.0)

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        twist, roll = (quantity(values[name], "rad", signed=True) for name in ("twist", "roll"))
        middle = quantity(middle_of(mechanism.joint(place.name), mechanism), "m")
        return (
            f"the guide of {place.name} is twisted: what it carries rolls by {twist} per metre of its way, "
            f"and by {roll} at {middle}"
        )


def _spins(slide: Joint, mechanism: Mechanism) -> bool:
    """Return True where what a slide carries hangs on a free hinge about the line along which it slides."""
    model, driven = mechanism.model, (*mechanism.actuated, *mechanism.coupling.names)
    carried = [joint for joint in mechanism.joints if int(model.parents[joint.id]) == slide.id]
    if len(carried) != 1 or carried[0].slides or carried[0].nv != 1 or carried[0].name in driven:
        return False
    placed = model.jointPlacements[carried[0].id]
    beside = np.cross(placed.translation, slide.axis), np.cross(placed.rotation @ carried[0].axis, slide.axis)
    return bool(np.abs(beside).max() < _ALIKE)


def middle_of(joint: Joint, mechanism: Mechanism) -> float:
    """Return the middle of a slide's way between its limits [m]; where it has none, where it is at home."""
    low, high = (float(limit[joint.first_q]) for limit in mechanism.limits)
    if low < high and np.isfinite([low, high]).all():
        return (low + high) / 2
    return float(joint.position(mechanism.home_configuration()))
