"""A body in the tool's hand that nobody told the simulation about, or one that was never mounted."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import combinations
from typing import ClassVar

import numpy as np

from ...dynamics import INERTIAL, InMotion, in_frame
from ...dynamics.inertial import usual_lever
from ...mechanism import Mechanism
from ...numbers import number, quantity
from ...parameters import Quantity
from ...spatial import Array
from ..law import Place
from .effort_law import EFFORT, Body, EffortLaw
from .inertial_parameters import about, parts_of, usual_inertia

_CENTRE = ("x", "y", "z")

#: The drawn mass, and a little for what is uncertain.
_ALL = 1.05
#: Samples by which a moment is looked for, and stretches between which one is at first.
_SAMPLES, _STRETCHES = 4000, 40
#: It is not put down again [s].
_NEVER = 1e9
#: Share of the longest combination of a body's columns below which one is rounding.
_ROUNDING = 1e-9


class HeldBody(EffortLaw):
    """A rigid body fixed to the tool: mass, centre, inertia about the tool's frame. Less than nothing may be true."""

    physics = "payload"
    summary = "a body that the tool holds"
    remedy = "enter this mass and its centre in the robot file and the controller's tool data, or take off what is held"
    of_bodies = True
    linear = INERTIAL
    body: ClassVar[Body | None] = Body.HELD
    quantities = (
        Quantity("mass", "kg", "of the body", 1.0, positive=False, lower=-1e4, upper=1e4),
        *(
            Quantity(
                axis, "m", f"centre of its mass along the tool's {axis}", 0.0, positive=False, lower=-1e3, upper=1e3
            )
            for axis in _CENTRE
        ),
        *(
            Quantity(name, "kg m^2", "about the tool's frame", 0.0, positive=False, lower=-1e6, upper=1e6)
            for name in INERTIAL[4:]
        ),
    )
    neutral: ClassVar = {"mass": 0.0, **dict.fromkeys(INERTIAL[4:], 0.0)}

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        tool = mechanism.tool
        return [] if tool is None or tool.joint == 0 else [Place(str(mechanism.tool_part), self.variant)]

    def prior(self, place: Place, mechanism: Mechanism) -> Array:
        return usual_inertia(mechanism)

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        tool = at.mechanism.need_tool()
        return at.regressor[:, :, tool.joint - 1] @ in_frame(tool.placement)

    def of_body(self, place: Place, mechanism: Mechanism) -> Mapping[int, Array]:
        tool = mechanism.need_tool()
        return {tool.joint: in_frame(tool.placement)}

    def fitted(self, place: Place, coefficients: Array, values: Mapping[str, float]) -> Mapping[str, float]:
        mass = float(coefficients[0])
        centre = coefficients[1:4] / mass if mass else np.zeros(3)
        names = ("mass", *_CENTRE, *INERTIAL[4:])
        return dict(zip(names, map(float, (mass, *centre, *coefficients[4:])), strict=True))

    def coefficients(self, place: Place, values: Mapping[str, float]) -> Array:
        mass = values["mass"]
        return np.array([mass, *(mass * values[axis] for axis in _CENTRE), *(values[name] for name in INERTIAL[4:])])

    def plausible(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> bool:
        # What was never mounted cannot weigh more than what is drawn there.
        drawn = float(mechanism.model.inertias[mechanism.need_tool().joint].mass)
        return super().plausible(place, values, mechanism) and values["mass"] > -_ALL * max(drawn, 0.0)

    def same_places(self, place: Place, mechanism: Mechanism) -> Sequence[str]:
        return parts_of(mechanism.need_tool().joint, mechanism)

    def told(
        self,
        place: Place,
        values: Mapping[str, float],
        intervals: Mapping[str, tuple[float, float]],
        mechanism: Mechanism,
    ) -> str:
        known = self.as_known(values, intervals, mechanism)
        return f"{self.statement(place, known, mechanism)}; {about('the origin and axes of ' + place.name)}"

    def as_known(
        self, values: Mapping[str, float], intervals: Mapping[str, tuple[float, float]], mechanism: Mechanism
    ) -> Mapping[str, float]:
        # a centre that may as well lie a link's length away
        lever = usual_lever(mechanism)
        told = {axis: intervals.get(axis, (0.0, 0.0)) for axis in _CENTRE}
        far = [axis for axis, (low, high) in told.items() if not high - low < 2 * lever]
        return {**values, **dict.fromkeys(far, np.nan)}

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        mass = values["mass"]
        if mass < 0:
            lacks = f"the robot file has {number(-mass, 3)} kg at {place.name} that the robot does not carry"
            return f"{lacks}, or its efforts are reported too small"
        untold = [axis for axis in _CENTRE if np.isnan(values[axis])]
        carries, nothing = f"{place.name} carries {number(mass, 3)} kg", "this motion tells nothing"
        if len(untold) == len(_CENTRE):
            return f"{carries}; of its centre {nothing}"
        centre = ", ".join("?" if axis in untold else number(1e3 * values[axis], 3) for axis in _CENTRE)
        told = f"{carries}, centred at ({centre}) mm in its axes"
        return f"{told}, where of {' and '.join(untold)} {nothing}" if untold else told


class HeldMeanwhile(HeldBody):
    """The same from a moment on, or until another one: what was taken up, or put down, while the recording ran."""

    summary = "a body that the tool takes up or puts down meanwhile"
    called = "pick and place, tool change"
    remedy = "record what is held before and after each for itself, or tell the load by runs"
    variant = f"{EFFORT} from a moment on"
    of_history = True
    of_what_is_left = True
    told_by_values = True
    body = None
    quantities = (
        *HeldBody.quantities,
        Quantity("moment", "s", "from which it is held, since the recording began", 0.0, False, 0.0, _NEVER),
        Quantity("until", "s", "to which it is held", _NEVER, False, 0.0, _NEVER),
    )

    def scanned(self, place: Place, at: InMotion) -> Sequence[Mapping[str, float]]:
        """Return the moment from which on another body takes most of what is left away, and the stretch in which one
        does; none where nothing is known of what is left.
        """
        if at.left is None:
            return []
        rows = np.arange(0, len(at), max(1, len(at) // _SAMPLES))
        left = np.nan_to_num(at.left[rows])
        table = np.concatenate((super().efforts_per(place, {}, at)[rows], left[..., None]), axis=2)
        table = table / np.maximum(np.sqrt(np.mean(left**2, axis=0)), np.finfo(float).tiny)[:, None]
        table = table / np.maximum(np.sqrt(np.sum(table**2, axis=(0, 1))), np.finfo(float).tiny)
        until = np.concatenate((np.zeros((1, 11, 11)), np.cumsum(np.einsum("nki,nkj->nij", table, table), axis=0)))

        def saved(first: int, last: int) -> float:
            """What a body of its own from one row to another, and another one before and after, take away."""
            inside = until[last] - until[first]
            return sum(
                float(gram[:-1, -1] @ np.linalg.lstsq(gram[:-1, :-1], gram[:-1, -1], rcond=_ROUNDING)[0])
                for gram in (inside, until[-1] - inside)
            )

        end, coarse = len(rows), np.unique(np.linspace(0, len(rows), _STRETCHES + 1, dtype=int))
        alone = max(((first, end) for first in coarse[1:-1]), key=lambda ends: saved(*ends), default=None)
        stretch = max(combinations(coarse[:-1], 2), key=lambda ends: saved(*ends), default=None)
        found = [self._settled(ends, saved, end) for ends in (alone, stretch) if ends is not None]
        elapsed = np.append(at.motion.elapsed[rows], _NEVER)
        return [{"moment": float(elapsed[first]), "until": float(elapsed[last])} for first, last in found]

    def _settled(self, ends: tuple[int, int], saved: Callable[[int, int], float], last: int) -> tuple[int, int]:
        """Return the rows between which most is saved, near some; the last row of all stays."""
        step = max(1, last // _STRETCHES)
        while step > 0:
            first, end = ends
            near = [(first + by, end) for by in (-step, step)]
            near += [(first, end + by) for by in (-step, step) if end < last]
            near = [each for each in near if 0 < each[0] < each[1] <= last]
            best = max([ends, *near], key=lambda each: saved(*each))
            step, ends = step // 2 if best == ends else step, best
        return ends

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        elapsed = at.motion.elapsed
        held = (elapsed >= values["moment"]) & (elapsed < values["until"])
        return np.where(held[:, None, None], super().efforts_per(place, values, at), 0.0)

    def of_body(self, place: Place, mechanism: Mechanism) -> Mapping[int, Array]:
        return {}

    def fitted(self, place: Place, coefficients: Array, values: Mapping[str, float]) -> Mapping[str, float]:
        return {**values, **super().fitted(place, coefficients, values)}

    def is_same(self, values: Mapping[str, float], other: Mapping[str, float]) -> bool:
        return values == other

    def unlike(self, place: Place) -> Sequence[tuple[str, str]]:
        return [("payload", place.name)]

    def plausible(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> bool:
        return EffortLaw.plausible(self, place, values, mechanism)

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        from_, until, mass = quantity(values["moment"], "s"), values["until"], values["mass"]
        when = f"from {from_} on" if until >= _NEVER else f"from {from_} to {quantity(until, 's')}"
        if mass < 0:
            return f"{when} {place.name} carries {number(-mass, 3)} kg less than otherwise"
        return f"{when} {super().statement(place, values, mechanism)} more than otherwise"
