"""The laws that may compete for a recording: every law at every place where these data could show it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ..laws import LEAST_WARMING, Effect, Inputs, Law, Place, Sharing, laws_of
from ..laws.deeds import Deed, Felt, YieldingJoint
from ..mechanism import Mechanism
from ..parameters import Quantity
from ..spatial import Array
from .criteria import BEYOND, TAIL, USUAL_MULTIPLE, WIDEST_LOGARITHM
from .influence import Influence

#: Decades from a usual load to one that others do not come near.
_FAR_LOAD = 1.5
#: So many times the load at which a gap was found to close is tried, where it is fitted with other laws.
_WIDER = (100.0, 30.0, 10.0, 3.0)
#: Where nothing is known of what a place felt.
_NOT_FELT = Felt()


@dataclass(frozen=True)
class Candidate:
    """A law at a place, as something to fit. Positive parameters are fitted by their logarithms.

    felt: what these data say of the place where it acts; begins: where a fit to them starts, beside the law's starts.
    """

    law: Law
    place: Place
    mechanism: Mechanism
    sample_interval: float = 0.0
    felt: Felt = _NOT_FELT
    begins: Sequence[Mapping[str, float]] = field(default=(), compare=False, repr=False)

    @cached_property
    def quantities(self) -> tuple[Quantity, ...]:
        """The law's parameters."""
        return self.law.seen_at(self.place, self.mechanism, self.felt, self.sample_interval)

    @cached_property
    def logarithmic(self) -> np.ndarray:
        return np.array([quantity.positive and quantity.lower >= 0 for quantity in self.quantities])

    @cached_property
    def known(self) -> Array:
        """One over the standard deviation of coordinates that are known to lie about zero, (p,); 0 of the others."""
        return self.logarithmic / self.law.spread if self.law.known else np.zeros(self.size)

    @cached_property
    def deeds(self) -> tuple[Deed, ...]:
        """What the law does: kinds and places, no numbers."""
        return self.law.outline(self.place, self.mechanism)

    @cached_property
    def only_module(self) -> str | None:
        """The module through whose deformation alone it acts; None where it acts otherwise too."""
        modules = {deed.only_module for deed in self.deeds}
        return modules.pop() if len(modules) == 1 else None

    @property
    def only_part(self) -> str | int | None:
        """The one module that deforms by it, the one actuator that stands elsewhere, or 'base' or 'tool' if that moves.

        None of what does otherwise.
        """
        whole = {deed.moves_whole for deed in self.deeds}
        if len(whole) == 1 and (moved := whole.pop()):
            return moved
        actuators = {deed.only_actuator for deed in self.deeds}
        return self.only_module or (actuators.pop() if len(actuators) == 1 else None)

    @property
    def everywhere(self) -> bool:
        """True for a law that acts at all like places with one value."""
        return self.law.shared

    @cached_property
    def of_rigid_joint(self) -> bool:
        """True where a joint yields by it that the robot file has rigid."""
        return any(isinstance(deed, YieldingJoint) and not deed.is_of_link for deed in self.deeds)

    @property
    def parts(self) -> tuple[str, ...]:
        """The parts of the robot where it sits."""
        like = self.law.same_places(self.place, self.mechanism) if self.everywhere else (self.place.name,)
        return tuple(like)

    @cached_property
    def remembers(self) -> bool:
        """True where what happened before matters."""
        return any(deed.memory for deed in self.deeds)

    @cached_property
    def is_proportional(self) -> bool:
        """True where what it does is in proportion to a size that the first parameter tells, to first order.

        Not of one that takes the place of what acted before, which does nothing at the value of that, nor of one with
        several sizes.
        """
        size, *others = self.quantities
        acts_anew = self.law.instead_of is None and not self.known.any()
        several = any(other.unit == size.unit for other in others)
        alike = all(deed.is_proportional for deed in self.deeds)
        return bool(self.logarithmic[0]) and acts_anew and not several and alike

    @property
    def size(self) -> int:
        """Number of parameters."""
        return len(self.quantities)

    @property
    def name(self) -> str:
        return f"{self.law.physics} at {self.place}"

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Bounds of the fitted coordinates, (p,) each."""
        low = np.array([max(q.lower, 1e-9 * self._scale(q)) if log else q.lower for q, log in self._pairs()])
        high = np.array([q.upper for q in self.quantities])
        return self.coordinates_of(low), self.coordinates_of(high)

    def _pairs(self):
        return zip(self.quantities, self.logarithmic, strict=True)

    @staticmethod
    def _scale(quantity: Quantity) -> float:
        return float(quantity.default) if isinstance(quantity.default, int | float) else 1.0

    def coordinates_of(self, values: Array) -> Array:
        """Return fitted coordinates of parameter values, (p,)."""
        safe = np.where(self.logarithmic, np.maximum(values, 1e-300), 1.0)
        return np.where(self.logarithmic, np.log(safe), values)

    def values_of(self, coordinates: Array) -> Array:
        """Return parameter values of fitted coordinates, (p,)."""
        return np.where(self.logarithmic, np.exp(np.where(self.logarithmic, coordinates, 0.0)), coordinates)

    def effect(self, coordinates: Array) -> Effect:
        """Return the law with the values that coordinates stand for."""
        values = self.values_of(coordinates)
        values = np.clip(values, [q.lowest for q in self.quantities], [q.upper for q in self.quantities])
        named = {q.name: float(value) for q, value in zip(self.quantities, values, strict=True)}
        return Effect(self.law, self.place, named)

    def term(self, coordinates: Array) -> Term:
        """Return the candidate with fitted coordinates (p,)."""
        return Term(self, coordinates)

    def starts(self) -> list[Array]:
        """Return the coordinates from which a fit starts, moved to what the place felt."""
        return [self._coordinates(start) + self._moved_start for start in self.law.starts(self.place, self.mechanism)]

    def scan(self) -> list[Array]:
        """Return the starts, also those that the recording asks for, and the first at much larger and smaller sizes.

        The latter where what it does is no measure.
        Of a law whose effect stops growing at a load, too, where no load comes near: a gap that is never closed is a
        spring, and no step leads there from a closed one.
        """
        found = self.starts()
        found += [self._coordinates(start) + self._moved_start for start in self.begins]
        if self.logarithmic[0]:
            low, high = self.bounds
            moved = np.zeros(self.size)
            moved[0] = np.log(10.0)
            sizes = (0,) if self.is_proportional else (-1, 0, 1, 2)
            trials = [] if self.is_proportional else [found[0] + size * moved for size in (-2, 2)]
            far = np.array([0.0, *(q.unit in ("N", "N m") for q in self.quantities[1:])]) * self.logarithmic
            if far.any() and not self.remembers:
                trials += [found[0] + size * moved + _FAR_LOAD * np.log(10.0) * far for size in sizes]
            found += [trial for trial in trials if low[0] < trial[0] < high[0] and (trial < high)[far > 0].all()]
        return found

    @cached_property
    def _moved_start(self) -> Array:
        """By how much what the place felt moves the defaults, as coordinates (p,)."""
        drawn = self.law.quantities_at(self.place, self.mechanism)
        times = [self._scale(own) / self._scale(other) for own, other in zip(self.quantities, drawn, strict=True)]
        return np.where(self.logarithmic, np.log(np.where(self.logarithmic, times, 1.0)), 0.0)

    def _coordinates(self, values: Mapping[str, float]) -> Array:
        return self.coordinates_of(np.array([values[quantity.name] for quantity in self.quantities]))

    def prior_residuals(self, coordinates: Array) -> Array:
        """Return the residuals of what is usual of coordinates that are no logarithms, (p,).

        Standard deviations beside it. What is off by far, as a sensor that nobody zeroed, is so by any amount: the
        squares grow like logarithms then, which is Student's distribution instead of Gauss's.
        """
        beside = self._deviations(coordinates)
        return np.copysign(np.sqrt(TAIL * np.log1p(beside**2 / TAIL)), beside)

    def prior_slopes(self, coordinates: Array) -> Array:
        """Return d(unusual)/d(coordinates), (p,)."""
        beside, residual = self._deviations(coordinates), self.prior_residuals(coordinates)
        far = np.abs(beside) > 1e-6
        slope = np.where(far, beside / (1 + beside**2 / TAIL) / np.where(far, residual, 1.0), 1.0)
        return slope * np.where(self.logarithmic, 0.0, 1 / self._prior[1])

    def _deviations(self, coordinates: Array) -> Array:
        mean, deviation = self._prior
        return np.where(self.logarithmic, 0.0, (coordinates - mean) / deviation)

    @cached_property
    def _prior(self) -> tuple[Array, Array]:
        """Mean and standard deviation of what is usual of coordinates that are no logarithms, (p,) each."""
        own = self.law.usual_at(self.place, self.mechanism)
        rest = USUAL_MULTIPLE * self.scales()
        found = [own.get(q.name, (0.0, wide)) for q, wide in zip(self.quantities, rest.tolist(), strict=True)]
        return np.array([mean for mean, _ in found]), np.array([deviation for _, deviation in found])

    @cached_property
    def usual_spread(self) -> Array:
        """The standard deviation of what is usual of each coordinate, (p,): of a logarithm hardly anything is known."""
        return np.where(self.logarithmic, WIDEST_LOGARITHM, self._prior[1])

    def scales(self) -> Array:
        """Return a typical change of every coordinate, (p,)."""
        return np.array([1.0 if log else q.typical for q, log in self._pairs()])


@dataclass(frozen=True)
class Term:
    """A candidate with fitted coordinates (p,)."""

    candidate: Candidate
    coordinates: Array

    @property
    def effect(self) -> Effect:
        return self.candidate.effect(self.coordinates)

    @property
    def is_expected(self) -> bool:
        """True where it acts on every robot, as weight does, and is as large as that is known to be."""
        return bool(self.candidate.known.all()) and bool(np.abs(self.off).max() <= BEYOND)

    def lessened(self, share: float) -> Term:
        """Return the same law where it does a share of what it does here, to first order."""
        candidate, law = self.candidate, self.candidate.law
        nothing = law.neutral_at(candidate.place, candidate.mechanism)
        values = candidate.values_of(self.coordinates)
        none = np.array([nothing[quantity.name] for quantity in candidate.quantities])
        less, own = values.copy(), ~candidate.logarithmic & np.isfinite(none)
        less[own] = none[own] + share * (values[own] - none[own])
        if candidate.logarithmic[:1].any():
            less[0] = law.magnified(float(values[0]), share)
        return Term(candidate, np.clip(candidate.coordinates_of(less), *candidate.bounds))

    def wider(self) -> Iterator[Term]:
        """Yield the same law where it closes at larger loads, the largest first; nothing of one that does not close."""
        law, bounds = self.candidate.law, self.candidate.bounds
        if law.closes_within:
            closes = np.array([quantity.name == law.closes_within for quantity in self.candidate.quantities])
            for times in _WIDER:
                yield Term(self.candidate, np.clip(self.coordinates + np.log(times) * closes, *bounds))

    @property
    def off(self) -> Array:
        """In how many standard deviations each coordinate is off what is known of it, (p,)."""
        return self.candidate.known * self.coordinates


def candidates(
    mechanism: Mechanism,
    inputs: Inputs,
    markers: Sequence[str] = (),
    groups: Mapping[str, Sequence[Sharing]] | None = None,
    alone: Sequence[Sharing] = (),
) -> list[Candidate]:
    """Return every law at every place that these inputs could show.

    markers: frames that were measured beside the tool; groups: recordings that share a sensor, by the sensors that not
    all share; alone: each recording, where there are several.
    """
    warm = inputs.temperature is not None and np.ptp(np.nan_to_num(inputs.warming)) > LEAST_WARMING
    step = float(np.median(np.diff(inputs.time))) if len(inputs) > 1 else 0.0
    pulled = np.any(mechanism.gravity if inputs.gravity is None else np.nan_to_num(inputs.gravity))
    has = {
        "temperature": warm,
        "speed": inputs.moves,
        "gravity": pulled,
        "weight": inputs.gravity is None,
        "wrench": not inputs.weight_alone,
    }
    return [
        Candidate(law, place, mechanism, step, begins=law.starts_in(inputs, place, mechanism))
        for law in laws_of(mechanism, markers, groups, alone)
        if all(has[need] for need in law.needs)
        for place in law.places(mechanism)
        if law.shows_in(inputs, place, mechanism)
    ]


def under_load(library: Sequence[Candidate], nominal: Influence) -> list[Candidate]:
    """Return candidates that know what these data say of the place where they act."""
    at = nominal.solved
    return [replace(item, felt=_most(deed.felt(at) for deed in item.deeds)) for item in library]


def _most(each: Iterable[Felt]) -> Felt:
    """Return the largest load and stiffness of several places."""
    return Felt(*(max(values) for values in zip(_NOT_FELT, *each, strict=True)))
