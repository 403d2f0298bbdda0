"""What acts on the robot: the wrench behind the sensor's report, what passes by the sensor, and weight."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ...mechanism import Changes
from ...spatial import Array
from .deed import Deed, Solved

if TYPE_CHECKING:
    from ..setup import Setup

#: Share of the weight by which its effect is differentiated.
_LIGHT = 1e-3


@dataclass(frozen=True, eq=False)
class WrenchReading(Deed):
    """The wrench sensor reports something else than what acts: `true` gives the true wrench (N, 6) of a reported one.

    Several act in their order.
    """

    displaces_joints = True

    true: Callable[[Array], Array]

    def within(self, rows: np.ndarray) -> WrenchReading:
        return WrenchReading(partial(_true_at, true=self.true, rows=rows))

    def enter(self, setup: Setup) -> None:
        setup.sensed = self.true(setup.sensed)

    @classmethod
    def changes(cls, setup: Setup, at: Solved) -> Iterator[Array]:
        yield from _by_wrench(setup.sensed, at.setup.sensed, at)


def _true_at(reported: Array, true: Callable[[Array], Array], rows: np.ndarray) -> Array:
    """Return the true wrenches (N, 6) of reported ones, which are true where the reading is not meant."""
    return np.where(rows[:, None], true(reported), reported)


@dataclass(frozen=True, eq=False)
class ToolLoad(Deed):
    """A wrench (N, 6) acts on the tool that passes by the sensor; base axes, dead."""

    displaces_joints = True

    wrench: Array

    def enter(self, setup: Setup) -> None:
        setup.unsensed = setup.unsensed + self.wrench

    @classmethod
    def changes(cls, setup: Setup, at: Solved) -> Iterator[Array]:
        yield from _by_wrench(setup.unsensed, at.setup.unsensed, at)


@dataclass(frozen=True, eq=False)
class HeldMass(Deed):
    """The tool holds a mass [kg] that is centred `arm` (N, 3) [m] from its point, base axes, and passes by the sensor.

    It falls as the tool lets it, whichever way gravity pulls. body: the tool's joint by its id and what the mass adds
    to the joint's inertial parameters (10,); None where the tool is fixed.
    """

    displaces_joints = True

    mass: float
    arm: Array
    body: tuple[int, Array] | None = None

    def wrench(self, setup: Setup) -> Array:
        """Return what it loads the tool with, (N, 6)."""
        force = np.broadcast_to(self.mass * setup.falls(self.arm), self.arm.shape)
        return np.concatenate((force, np.cross(self.arm, force)), axis=1)

    def enter(self, setup: Setup) -> None:
        setup.held = (*setup.held, self)

    def redraw(self, changes: Changes) -> str | None:
        if self.body is None:
            return None
        changes.add_body(*self.body)
        return ""

    @classmethod
    def changes(cls, setup: Setup, at: Solved) -> Iterator[Array]:
        if setup.held is not at.setup.held or (setup.held and setup.fall is not at.setup.fall):
            yield from _by_wrench(setup.held_weight, at.setup.held_weight, at)


@dataclass(frozen=True)
class ToolSpring(Deed):
    """A spring pulls the tool point to where it is `slack` (3,) [m], with `stiffness` (3, 3) [N/m], base axes.

    It passes by the sensor, and follows the tool as this moves under load.
    """

    stiffness: tuple[tuple[float, ...], ...]
    slack: tuple[float, ...]

    def enter(self, setup: Setup) -> None:
        setup.springs = (*setup.springs, self)

    def force_at(self, point: Array) -> Array:
        return np.asarray((np.array(self.slack) - point) @ np.array(self.stiffness).T)

    def stiffness_at(self, point: Array) -> Array:
        return np.array(self.stiffness)

    @classmethod
    def changes(cls, setup: Setup, at: Solved) -> Iterator[Array]:
        if setup.springs == at.setup.springs:
            return
        point = at.first.found.tool[:, :3, 3]
        force = np.zeros_like(point)
        for sign, springs in ((1.0, setup.springs), (-1.0, at.setup.springs)):
            for spring in springs:
                force += sign * spring.force_at(point)
        yield (at.first.by_wrench[:, :, :3] @ force[..., None])[..., 0]


def _by_wrench(new: Array, old: Array, at: Solved) -> Iterator[Array]:
    if new is not old and np.any(more := new[at.samples] - old[at.samples]):
        yield (at.first.by_wrench @ more[..., None])[..., 0]


@dataclass(frozen=True)
class Weight(Deed):
    """The links weigh `share` of what the robot file says; `spread`: beams along their length."""

    displaces_joints = True

    share: float
    spread: bool = False

    def enter(self, setup: Setup) -> None:
        setup.weight += self.share
        setup.spread_weight = setup.spread_weight or self.spread

    def redraw(self, changes: Changes) -> str | None:
        changes.weight = self.share + (changes.weight or 0.0)
        return ""

    @classmethod
    def changes(cls, setup: Setup, at: Solved) -> Iterator[Array]:
        new, old = (setup.weight, setup.spread_weight), (at.setup.weight, at.setup.spread_weight)
        if new == old:
            return
        (share, spread), (before, was_spread) = new, old
        if share == 0 or before == 0 or spread == was_spread:
            kind = spread if share else was_spread
            yield (share - before) * at.first.once(("weight", kind), partial(_by_weight, at, kind))
            return
        now = at.first.found.conditions
        gravity, inertia = share * at.setup.gravity(at.samples), at.setup.inertia(at.samples)
        inertia = None if inertia is None else share * inertia
        yield at.first.by_conditions(replace(now, gravity=gravity, inertia=inertia, spread_weight=spread))


@dataclass(frozen=True)
class TurnedGravity(Deed):
    """Gravity pulls by `change` (3,) [m/s^2] otherwise than the robot file says, base axes; columns g know better."""

    displaces_joints = True

    change: tuple[float, float, float]

    def enter(self, setup: Setup) -> None:
        setup.fall = setup.fall + np.array(self.change)

    def redraw(self, changes: Changes) -> str | None:
        changes.gravity = changes.gravity + np.array(self.change)
        return ""

    @classmethod
    def changes(cls, setup: Setup, at: Solved) -> Iterator[Array]:
        if not setup.weight or setup.fall is at.setup.fall:
            return
        more = setup.gravity(at.samples) - at.setup.gravity(at.samples)
        if more.any():
            spread = setup.spread_weight
            along = at.first.once(("gravity", spread), partial(_by_gravity, at, spread))
            yield setup.weight * (along @ more[..., None])[..., 0]


@dataclass(frozen=True)
class ScaledMass(Deed):
    """A link weighs `factor` times what the robot file says, where weight acts."""

    displaces_joints = True

    link: str
    factor: float

    def enter(self, setup: Setup) -> None:
        setup.mechanism.link(self.link)
        factor = self.factor * setup.mass_factors.get(self.link, 1.0)
        setup.mass_factors = {**setup.mass_factors, self.link: factor}

    def redraw(self, changes: Changes) -> str | None:
        changes.masses[self.link] = self.factor * changes.masses.get(self.link, 1.0)
        return ""

    @classmethod
    def changes(cls, setup: Setup, at: Solved) -> Iterator[Array]:
        new, old = setup.mass_factors, at.setup.mass_factors
        for link in {**new, **old} if at.setup.weight and new is not old else ():
            if step := new.get(link, 1.0) - old.get(link, 1.0):
                yield step * at.first.once(("mass", link), partial(_by_mass, at, link))


def _by_mass(at: Solved, name: str) -> Array:
    """Return what is watched by the whole weight of a link, (n, R): along its beams where weight is spread."""
    links, now = at.first.chain.structure.links, at.first.found.conditions
    place = [each.name for each in links].index(name)
    gravity = at.setup.weight * at.setup.gravity(at.samples)
    link, inertia = at.setup.mechanism.link(name), now.inertia
    if inertia is not None:
        gravity = np.concatenate((np.broadcast_to(gravity, (len(at.samples), 3)), np.zeros((len(at.samples), 3))), 1)
        gravity = gravity + inertia[:, place] / link.mass
    watched = link.mass * at.first.by_mass(link, gravity)
    if at.setup.spread_weight:
        factors = np.ones(len(links)) if now.mass_factors is None else now.mass_factors
        more = replace(now, mass_factors=factors + _LIGHT * np.eye(len(links))[place])
        for module in at.first.chain.structure.modules:
            if module.body == name:
                watched = watched + at.first.by_weight_of(module.name, more) / _LIGHT
    return watched


def _by_weight(at: Solved, spread: bool) -> Array:
    """Return what is watched per whole weight, (n, R), at the weight that acts."""
    now, light = at.first.found.conditions, _LIGHT * at.setup.gravity(at.samples)
    more = light if now.gravity is None else now.gravity + light
    inertia = at.setup.inertia(at.samples)
    if inertia is not None:
        inertia = _LIGHT * inertia if now.inertia is None else now.inertia + _LIGHT * inertia
    return at.first.by_conditions(replace(now, gravity=more, inertia=inertia, spread_weight=spread)) / _LIGHT


def _by_gravity(at: Solved, spread: bool) -> Array:
    """Return what is watched per gravity along each axis of the base, (n, R, 3), on links of their whole mass."""
    now = at.first.found.conditions
    before = np.zeros(3) if now.gravity is None else now.gravity
    changes = (replace(now, gravity=before + step, spread_weight=spread) for step in _LIGHT * np.eye(3))
    return np.stack([at.first.by_conditions(each) for each in changes], axis=-1) / _LIGHT
