"""What gives way in all six motions under all that it passes on: what a robot stands on, what sits before its tool."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pinocchio as pin

from ..mechanism import Mechanism
from ..numbers import number, readable_unit
from ..parameters import Quantity
from ..spatial import Array, skew
from .deeds import Deed
from .law import Law, Place
from .setup import Setup

_AXES = "xyz"
_BOTH = "translation", "rotation"
#: A robot smaller than this is taken as one of this size [m].
_SMALLEST = 0.2


def alike(of: str, along: float, about: float) -> tuple[Quantity, ...]:
    """Return the way per force and the turn per moment of something, in whatever direction; where a fit starts."""
    return (
        Quantity("translation", "m/N", f"way of the {of} per force, in its direction", along, upper=1e-3),
        Quantity("rotation", "rad/(N m)", f"turn of the {of} per moment, about its direction", about, upper=1e-1),
    )


def by_axis(along: float, about: float) -> tuple[Quantity, ...]:
    """Return the way per force along each axis, and the turn per moment about it; where a fit starts."""
    shift, turn = "way per force along", "turn per moment about"
    return (
        *(Quantity(f"translation_{axis}", "m/N", f"{shift} {axis}", along, False, upper=1e-3) for axis in _AXES),
        *(Quantity(f"rotation_{axis}", "rad/(N m)", f"{turn} {axis}", about, False, upper=1e-1) for axis in _AXES),
    )


def of_point(of: str) -> tuple[Quantity, ...]:
    """Return where the point lies about which something turns [m]."""
    return tuple(
        Quantity(axis, "m", f"of the point about which the {of} turns, along {axis}", -0.1, False, -100.0, 100.0)
        for axis in _AXES
    )


class GivesWay(Law):
    """A frame moves by c f along the force and turns by r m about the moment that is passed into it, about its origin.

    Alike in all directions, so that no turn of the frame changes it.
    """

    #: What gives way, for people, before its stiffnesses.
    gives: ClassVar[str]
    neutral: ClassVar = dict.fromkeys(_BOTH, 0.0)

    @abstractmethod
    def moved(self, compliance: tuple[tuple[float, ...], ...], values: Mapping[str, float]) -> Deed:
        """Return what moves the frame by a compliance (6, 6) along and about its axes [m/N, rad/(N m)]."""

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        yield self.moved(tuple(map(tuple, self._compliance(values).tolist())), values)

    def _compliance(self, values: Mapping[str, float]) -> Array:
        """Return what moves the frame's origin under a wrench about it, along and about the frame's axes, (6, 6)."""
        return np.diag(self._compliances(values))

    def _compliances(self, values: Mapping[str, float]) -> Sequence[float]:
        """Return the compliance along and about the axes of the frame [m/N, rad/(N m)], (6,)."""
        return [values[name] for name in _BOTH for _ in _AXES]

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return self.told(place, values, {}, mechanism)

    def told(
        self,
        place: Place,
        values: Mapping[str, float],
        intervals: Mapping[str, tuple[float, float]],
        mechanism: Mechanism,
    ) -> str:
        """Return the statement; of a compliance that may be nothing, the stiffness that there is at least."""
        compliances = np.array(self._compliances(values))
        highest = [interval[1] if interval[0] <= 0 else 0.0 for interval in intervals.values()]
        known = {key: bound for key, bound in zip(intervals, highest, strict=True) if bound > 0}
        bounds = np.array(self._compliances(dict.fromkeys(values, 0.0) | known))
        (along, about), (slow, turn) = np.split(compliances, 2), np.split(bounds, 2)
        moves = f"{_told(along, slow, 'N/m')} and " if along.any() else ""
        return f"{self.gives}, with {moves}{_told(about, turn, 'N m/rad')}"


class GivesWayByAxis(GivesWay):
    """The same with a compliance of its own along and about each axis of the frame."""

    neutral: ClassVar = {f"{name}_{axis}": 0.0 for name in _BOTH for axis in _AXES}

    def _compliances(self, values: Mapping[str, float]) -> Sequence[float]:
        return [values.get(name, 0.0) for name in GivesWayByAxis.neutral]


class GivesWayAtPoint(GivesWayByAxis):
    """The same seen at a point beside the frame's origin, by axis: it moves by c f and turns by r m about that point.

    The origin is carried along, by turn x (origin - point).
    """

    #: The point is about so many times the robot's size from the frame's origin, and at most so many; where a fit
    #: starts beside the origin it is half as far below.
    usual: ClassVar[float]
    far: ClassVar[float]

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        size = _size(mechanism)
        near, far = -0.5 * self.usual * size, self.far * size
        return tuple(
            replace(own, default=near, lower=-far, upper=far) if own.name in _AXES else own for own in self.quantities
        )

    def starts(self, place: Place, mechanism: Mechanism) -> Sequence[Mapping[str, float]]:
        below = {**super().starts(place, mechanism)[0], "x": 0.0, "y": 0.0}
        return [below, {**below, "z": 0.0}]

    def usual_at(self, place: Place, mechanism: Mechanism) -> Mapping[str, tuple[float, float]]:
        """Return where the point is: about as far from the origin as what gives way is wide or high."""
        near = (0.0, self.usual * _size(mechanism))
        return {**super().usual_at(place, mechanism), **dict.fromkeys(_AXES, near)}

    def _compliance(self, values: Mapping[str, float]) -> Array:
        at_origin = np.eye(6)
        at_origin[:3, 3:] = skew(np.array([values[axis] for axis in _AXES]))  # turn x (origin - point)
        return np.asarray(at_origin @ np.diag(self._compliances(values)) @ at_origin.T)

    def told(
        self,
        place: Place,
        values: Mapping[str, float],
        intervals: Mapping[str, tuple[float, float]],
        mechanism: Mechanism,
    ) -> str:
        unit, factor = readable_unit(max(abs(values[axis]) for axis in _AXES), "m")
        at = ", ".join(number(factor * values[axis], 3) for axis in _AXES)
        return f"{super().told(place, values, intervals, mechanism)}, about the point ({at}) {unit} from its origin"


def _size(mechanism: Mechanism) -> float:
    """Return how far from its base a robot's joints reach at home [m]."""
    data = mechanism.model.createData()
    pin.forwardKinematics(mechanism.model, data, mechanism.home_configuration())
    return max([_SMALLEST, *(float(np.linalg.norm(joint.translation)) for joint in data.oMi)])


def _told(compliances: np.ndarray, bounds: np.ndarray, unit: str) -> str:
    """Return stiffnesses along or about the axes in words; bounds: of compliances that may be nothing, else zero."""
    stiffnesses = [
        f"more than {number(1 / bound, 3)}" if bound > 0 else number(1 / value, 3) if value > 0 else "rigid"
        for value, bound in zip(compliances.tolist(), bounds.tolist(), strict=True)
    ]
    return f"{', '.join(stiffnesses if len(set(stiffnesses)) > 1 else stiffnesses[:1])} {unit}"
