"""Laws that are followed over a life: the coordinates in which each may change, and what a test says of them.

Each test is linearised about the first one's corrected model, in the numbers x of its posterior, which all share, and
in every coordinate.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..diagnosis.criteria import LITTLE, ROUNDING
from ..diagnosis.linearised import Linearised
from ..diagnosis.nuisance import Nuisance
from ..laws import Effect
from ..laws.as_found import ChangedEffect
from ..mechanism import Mechanism
from ..parameters import Quantity
from ..recordings import Recording
from ..robot import Robot
from ..simulation import CorrectedModel, effect_named
from ..spatial import Array
from .change_points import Likelihood
from .kept import Answer, Kept, Named


@dataclass(frozen=True)
class Followed:
    """A law whose values are followed over a life, and the coordinates in which it may change.

    reference: with the values that were found; before: as the first model has it, where it has. Of a law that acts to
    one side, or always, the one coordinate says how many times it does what `reference` does (`as_a_whole`); else there
    is one for each parameter, in its unit. quantities, neutral: of the law's parameters at its place.
    """

    named: Named
    reference: Effect
    before: Effect | None
    quantities: Mapping[str, Quantity]
    neutral: Mapping[str, float]

    @classmethod
    def of(cls, named: Named, before: Effect | None, mechanism: Mechanism) -> Followed | None:
        """Return a law to follow; None where its values say nothing of how much it does."""
        if before is None:
            found = effect_named(named.physics, named.location, named.aspect, named.values, mechanism)
        else:
            found = before
        law, place = found.law, found.place
        quantities = {item.name: item for item in law.quantities_at(place, mechanism)}
        reference = Effect(law, place, {name: float(found.values[name]) for name in quantities if name in found.values})
        item = cls(named, reference, before, quantities, law.neutral_at(place, mechanism))
        first = reference.values[item.main]
        does = abs(law.magnified(first, 2.0) - first) > ROUNDING * abs(first)
        return item if does or not item.as_a_whole else None

    @property
    def as_a_whole(self) -> bool:
        return any((item.positive and item.lower >= 0) or self.neutral[item.name] for item in self.quantities.values())

    @property
    def main(self) -> str:
        """The parameter that says how much the law does."""
        return next(iter(self.reference.values))

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters that are told, one for each coordinate."""
        return (self.main,) if self.as_a_whole else tuple(self.reference.values)

    @property
    def counts_from_nothing(self) -> bool:
        """Whether its value in the first test is open too; else the first model has it, or the like of it."""
        return self.as_a_whole and self.before is None

    def first(self, name: str) -> float:
        """Return the coordinate of a parameter in the first model."""
        if self.before is None:
            return 0.0
        return 1.0 if self.as_a_whole else self.before.values[name]

    def coordinate(self, value: float) -> float:
        """Return the coordinate of a parameter's value."""
        return self.reference.law.multiple(value, self.reference.values[self.main]) if self.as_a_whole else value

    def value(self, coordinate: float) -> float:
        """Return a parameter's value at a coordinate; of a law as a whole within its bounds, beside doing nothing."""
        if not self.as_a_whole:
            return coordinate
        quantity, neutral = self.quantities[self.main], float(self.neutral[self.main])
        if coordinate == 0:
            return neutral
        value = self.reference.law.magnified(self.reference.values[self.main], coordinate)
        return float(np.clip(value, min(quantity.lowest, neutral), max(quantity.upper, neutral)))

    def secants(self, answer: Answer) -> Iterator[tuple[Effect, float]]:
        """Yield for each coordinate an effect that is off in it alone, and by how much.

        As a whole as far as this test found it, or as the first that named it did; a single parameter likewise.
        """
        named = next((each for each in answer.named if each.key == self.named.key), self.named)
        place, was = self.reference.place, self.reference.values
        law = self.reference.law if self.before is None else ChangedEffect(self.before)
        if not self.as_a_whole:
            begun = {name: self.first(name) for name in was}
            for name, value in begun.items():
                size = abs(named.values.get(name, 0.0) - value) or self._usual(name)
                yield Effect(law, place, {**begun, name: value + size}), size
            return
        values = {name: float(named.values.get(name, value)) for name, value in was.items()}
        apart = self.coordinate(values[self.main]) - self.first(self.main)
        if not abs(apart) > ROUNDING:
            apart = LITTLE
            at = self.reference.law.magnified(was[self.main], self.first(self.main) + apart)
            values = {**was, self.main: at}
        yield Effect(law, place, values), apart

    def _usual(self, name: str) -> float:
        """Return a usual size of a parameter."""
        default = self.quantities[name].default
        largest = max(map(abs, self.named.values.values()), default=0.0)
        return float(default) if isinstance(default, int | float) and default else largest or 1.0

    def first_by_x(self, name: str, model: CorrectedModel) -> Array:
        """Return by how much the coordinate in the first model is off per number x of its posterior, (p,)."""
        assert model.posterior is not None
        for row, known in zip(model.posterior.root, model.posterior.values, strict=True):
            effect = model.effects[known.effect]
            if self.before is not None and _key(effect) == self.named.key and known.name == name:
                if not self.as_a_whole:
                    return row
                step = LITTLE**3
                off = self.coordinate(known.value * (1 + step)) - 1
                return row * (off / (step if known.logarithmic else step * known.value))
        return np.zeros(len(model.posterior.values))


def followed(model: CorrectedModel, answers: Sequence[Answer], mechanism: Mechanism) -> list[Followed]:
    """Return the laws to follow: those of the first model, and those that a later test names, as the first one did."""
    named: dict[tuple[str, str, str], Named] = {}
    for answer in answers[1:]:
        for item in answer.named:
            named.setdefault(item.key, item)
    before = {_key(effect): effect for effect in _may_change(model)}
    found = [
        Followed.of(named.get(key) or Named(*key, dict(effect.values)), effect, mechanism)
        for key, effect in before.items()
    ]
    found += [Followed.of(item, None, mechanism) for key, item in named.items() if key not in before]
    return [item for item in found if item is not None]


def _may_change(model: CorrectedModel) -> list[Effect]:
    """Return the effects of a model whose values its test knew, and that may be others by now."""
    known = set() if model.posterior is None else {(item.effect, item.name) for item in model.posterior.values}
    return [
        effect
        for place, effect in enumerate(model.effects)
        if not (effect.law.partial or effect.law.weighs or effect.law.sensor)
        and effect.values
        and all((place, name) in known for name in effect.values)
    ]


def _key(effect: Effect) -> tuple[str, str, str]:
    return effect.law.physics, effect.place.name, effect.place.aspect


def evidence_of(
    robot: Robot, recording: Recording, model: CorrectedModel, laws: Sequence[Followed], answer: Answer, first: bool
) -> Kept:
    """Return what a test says, linearised about the first model: `library`, how many laws at places competed, and the
    likelihood of p numbers of the first model's posterior and q coordinates of followed laws, (p + q,).

    first: it is the test that the model is of. It is in the prior of x already, and adds only how x and the coordinates
    hang together in it.
    """
    assert model.posterior is not None
    test, p = Linearised.of(robot, [recording], model), len(model.posterior.values)
    by_x = test.by_value @ model.posterior.root[list(test.rows)]
    columns = [test.change(effect) / size for item in laws for effect, size in item.secants(answer)]
    off = sum((test.change(effect) for effect in test.seen_moved), np.zeros_like(test.residual))
    jacobian = np.column_stack([by_x, *(each.ravel() for each in columns)])
    noise = max(1.0, answer.left)
    nuisance = Nuisance.within(test.anew[:, :0], test.anew / noise)
    said = Likelihood.of(jacobian / noise, (test.residual + off).ravel() / noise, nuisance)
    if first:
        said.precision[:p, :p], said.score[:p] = np.eye(p), 0.0
    return Kept({"library": len(test.prepared.library)}, said._asdict())
