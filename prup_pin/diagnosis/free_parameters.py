"""All that may be off on a robot that nobody has calibrated: toleranced parameters and joints that may yield."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..laws import Effect
from ..laws.deviations import Calibration, amounts_of, deviations_of
from ..laws.yielding import ACROSS, OWN, UNEVEN, YieldingPart, effects_of_yielding, nearest_yielding, yielding_parts
from ..mechanism import Mechanism
from ..recordings import ARM, KINDS_OF_TOLERANCE, SENSORS, Group, Recording
from ..simulation import Simulator
from ..spatial import Array
from .criteria import ROUNDING, STEP
from .influence import Influence
from .toleranced import Toleranced, changes_per_tolerance
from .variance_components import SensorEquations, VarianceEstimate, posterior

#: Before the way of `mechanism.WAYS` in which a joint yields, in the name of that kind.
YIELDS = "yields "


#: Kinds of where stations stand, and what is usual of them.
STAND = ("frame_rotation", "frame_position")


STATIONS = ("station turned", "station shifted")


#: Kinds that are left out first where little was measured.
FINEST = ("encoder_slope", f"{YIELDS}{UNEVEN}", f"{YIELDS}{ACROSS}", "direction", "position", f"{YIELDS}{OWN}")


#: How far a drawing can be off, one standard deviation a kind, in its unit.
LARGEST = {kind.name: kind.largest for kind in KINDS_OF_TOLERANCE}


#: What a robot that nobody has calibrated is usually off by: one standard deviation a kind.
USUAL: Mapping[str, float] = {
    **{kind: size for kind, size in ARM.declared.items() if kind != "mass"},
    "bending": 0.05,
    "wrench_gain": 0.02,
    "wrench_rotation": 0.01,
}


@dataclass(frozen=True, eq=False)
class FreeParameters:
    """Toleranced parameters and joints that may yield, side by side.

    kinds (p,) labels; floors (p,): what was declared, in the same units as x; places (p,): what one law would move.
    stations (N,): labels of where the pose sensor stood; the last six parameters for each of them are its turn and
    shift, which are no effects, but found anew at every step.
    """

    toleranced: Toleranced
    joints: tuple[YieldingPart, ...]
    units: Array
    kinds: np.ndarray
    floors: Array
    places: np.ndarray
    stations: np.ndarray | None = None

    def effects(self, x: Array) -> list[Effect]:
        count = len(self.toleranced)
        found = [self.toleranced.effect(x[:count])] if count else []
        return [*found, *effects_of_yielding(self.joints, self.units * x[count : self.own])]

    @property
    def own(self) -> int:
        """Number of parameters that are the robot's."""
        return len(self.toleranced) + len(self.joints)

    def without(self, kind: str) -> FreeParameters:
        """Return the parameters but for one kind."""
        keep = self.kinds != kind
        own = len(self.toleranced)
        items = [item for item, stays in zip(self.toleranced.law.deviations, keep[:own], strict=True) if stays]
        joints = tuple(item for item, stays in zip(self.joints, keep[own : self.own], strict=True) if stays)
        toleranced = Toleranced(Calibration(items), self.toleranced.tolerances[keep[:own]])
        units = self.units[keep[own : self.own]]
        by_place = self.kinds[keep], self.floors[keep], self.places[keep]
        return FreeParameters(toleranced, joints, units, *by_place, self.stations)

    def clipped(self, x: Array) -> Array:
        """Return x (p,) without compliances below zero, and without parts that fail."""
        out, count = x.copy(), len(self.toleranced)
        out[:count] = np.clip(out[:count], -self.toleranced.reach, self.toleranced.reach)
        out[count : self.own] = nearest_yielding(self.joints, self.units * x[count : self.own])
        out[count : self.own] /= self.units
        out[self.own :] = 0.0
        return out

    def nearest(self, data: SensorEquations, fit: VarianceEstimate) -> Array:
        """Return the likeliest x (p,) among those that can be: what would not be stays at its bound, and all others
        move on without it."""
        free = np.ones(len(fit.mean), bool)
        mean = fit.mean
        while True:
            x = self.clipped(mean)
            x[self.own :] = mean[self.own :]
            beyond = free & (np.abs(x - mean) > ROUNDING)
            if not beyond.any():
                return self.clipped(x)
            free &= ~beyond
            held = np.where(free, 0.0, x)
            rest = replace(data, right=data.right - data.normal @ held)
            mean = held + posterior(rest, np.where(free, fit.variances, 0.0), fit.noise).mean

    def columns(self, simulator: Simulator, influence: Influence, x: Array, beside: Sequence[Effect]) -> Array:
        """Return what is measured per unit of each parameter, (n, K, p), to first order about a run at x."""
        count = len(self.toleranced)
        yielding = self.effects(x)[1 if count else 0 :]
        found = [changes_per_tolerance(simulator, influence, self.toleranced, x[:count], [*beside, *yielding])]
        here = [*self.effects(x), *beside]
        for item, unit in zip(self.joints, self.units, strict=True):
            setup = simulator.setup(here)
            setup.take([item.deed(STEP * unit)])
            found.append(influence.change(setup)[..., None] / STEP)
        if self.stations is not None:
            found.append(by_stations(influence, self.stations))
        return np.concatenate(found, axis=2)

    def with_stations(self, stations: np.ndarray) -> FreeParameters:
        """Return the same with the turn and shift of each station (N,) besides."""
        count = len(np.unique(stations))
        kinds = np.tile(np.repeat(STATIONS, 3), count)
        return replace(
            self,
            kinds=np.concatenate((self.kinds, kinds)),
            floors=np.concatenate((self.floors, np.zeros(len(kinds)))),
            places=np.concatenate((self.places, kinds)),
            stations=stations,
        )


def by_stations(influence: Influence, stations: np.ndarray) -> Array:
    """Return what is measured per turn and shift of every station, in units of what is usual, (n, K, 6 stations)."""
    samples = influence.run.samples
    moved = influence.stack.by_station(influence.run, samples) * np.repeat([USUAL[k] for k in STAND], 3)
    labels = np.unique(stations)
    out = np.zeros((*moved.shape[:2], len(labels), 6))
    for place, label in enumerate(labels):
        rows = stations[samples] == label
        out[rows, :, place] = moved[rows]
    return out.reshape(*moved.shape[:2], -1)


def free_parameters(
    recording: Recording, mechanism: Mechanism, groups: Mapping[str, Sequence[Group]], loaded: bool, moves: bool
) -> FreeParameters:
    """Return all that may be off on a robot, in units of what is usual there.

    loaded: by weight or else; moves: it is known how it moved.
    """
    tool = mechanism.need_tool().name
    markers = [name for name in recording.marker_names if name in mechanism.frame_names and name != tool]
    kinds = {kind: shared for sensor, shared in groups.items() for kind in SENSORS[sensor]}
    deviations = deviations_of(mechanism, markers, kinds, moves)
    loose = [replace(item, group=None) for item in deviations]
    measured = [kind for kind in USUAL if recording.has_wrench or not kind.startswith("wrench")]
    toleranced = Toleranced.of(deviations, amounts_of(loose, mechanism, {kind: USUAL[kind] for kind in measured}))
    declared = amounts_of(deviations, mechanism, recording.tolerances.declared)
    joints = yielding_parts(mechanism) if loaded else ()
    units = [item.unit for item in joints]
    own = toleranced.law.deviations
    labels = [*(item.kind for item in own), *(f"{YIELDS}{item.way}" for item in joints)]
    names = [item.together or f"{item.physics} {item.kind} {item.place}" for item in own]
    names += [item.name for item in joints]
    floors = [declared.get(item.name, 0.0) / size for item, size in zip(own, toleranced.tolerances, strict=True)]
    floors += [0.0] * len(joints)
    return FreeParameters(toleranced, joints, np.array(units), np.array(labels), np.array(floors), np.array(names))
