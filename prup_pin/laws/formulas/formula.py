"""Formulas as sums of terms, the library of terms, and a formula as the text of a law's file."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from ...dynamics import InMotion
from ...mechanism import Mechanism
from ...parameters import Quantity
from ...spatial import Array
from ..efforts.effort_law import usual_way
from ..efforts.free_curve import FreeCurve
from ..law import Effect
from .joint_formula import JointFormula
from .known import KNOWN, composed
from .shapes import SHAPES

#: Beyond it no coefficient is one.
_LARGEST = 1e12


@dataclass(frozen=True)
class Factor:
    """A variable of a joint."""

    name: str
    joint: str

    def of(self, at: InMotion, parameters: Sequence[float] = ()) -> Array:
        """Return its values (N,)."""
        return KNOWN[self.name].of(at, self.joint, *parameters)

    def text(self, joint: str) -> str:
        """Return its symbol in a formula of a joint."""
        symbol = KNOWN[self.name].symbol
        return symbol if self.joint == joint else f"{symbol}({self.joint})"

    def code(self, joint: str, arguments: Sequence[str] = ()) -> str:
        """Return the call that gives its values in the law of a joint."""
        own = "self.joint" if self.joint == joint else repr(self.joint)
        return f"{self.name}({', '.join(('at', own.replace(chr(39), chr(34)), *arguments))})"


@dataclass(frozen=True)
class Term:
    """A shape of a variable, times another variable or direction; the coefficient of each of its heights is free."""

    shape: str
    factor: Factor
    times: Factor | None = None

    @property
    def parameters(self) -> tuple[str, ...]:
        """The parameters in which it is not linear: of its variables, and of the shape."""
        own = (name for factor in self.factors for name in KNOWN[factor.name].parameters)
        return (*own, *SHAPES[self.shape].parameters)

    @property
    def factors(self) -> tuple[Factor, ...]:
        """Its variables."""
        return (self.factor,) if self.times is None else (self.times, self.factor)

    @property
    def size(self) -> int:
        """Number of all parameters."""
        return len(self.parameters) + len(SHAPES[self.shape].heights)

    def columns(self, at: InMotion, values: Sequence[float]) -> Array:
        """Return its efforts per height (N, c) at values of its parameters."""
        *variables, shape = self._shared(values)
        table = SHAPES[self.shape].of(self.factor.of(at, variables[-1]), *shape).reshape(len(at), -1)
        return table if self.times is None else table * self.times.of(at, variables[0])[:, None]

    def _shared(self, values: Sequence[Any]) -> list[Sequence[Any]]:
        """Return values of its parameters as those of each of its variables, and of the shape."""
        ends = np.cumsum([len(KNOWN[factor.name].parameters) for factor in self.factors]).tolist()
        return [values[first:end] for first, end in zip([0, *ends], [*ends, len(values)], strict=True)]

    def text(self, joint: str, names: Mapping[str, str]) -> str:
        """Return it in symbols; names: what stands for its parameters."""
        x = self.factor.text(joint)
        if KNOWN[self.factor.name].parameters:
            x = f"{x}({', '.join(names[name] for name in KNOWN[self.factor.name].parameters)})"
        shaped = SHAPES[self.shape].text.format(x=x, **names)
        return shaped if self.times is None else f"{self.times.text(joint)} {shaped}"

    def code(self, joint: str, names: Mapping[str, str]) -> str:
        """Return it as code; names: those of its parameters in the law."""
        calls = [f'values["{names[name]}"]' for name in self.parameters]
        *variables, shape = self._shared(calls)
        x = self.factor.code(joint, variables[-1])
        shaped = x if self.shape == "linear" else f"{self.shape}({', '.join((x, *shape))})"
        if self.times is None:
            return shaped
        several = "[:, None]" if len(SHAPES[self.shape].heights) > 1 else ""
        return f"{self.times.code(joint, variables[0])}{several} * {shaped}"

    def resists(self, joint: str) -> bool:
        """Return whether it is friction of its own joint: what it gives turns round with the motion."""
        return any(
            f.joint == joint and f.name in ("speed", "direction", "hysteresis", "yielding") for f in self.factors
        )


@dataclass(frozen=True, eq=False)
class Formula(JointFormula):
    """A sum of terms at a joint. Made by `of`; `quantities` hold units, bounds, and what was fitted as defaults."""

    named_before: ClassVar[bool] = False
    joint: str  # type: ignore[misc]
    terms: tuple[Term, ...]
    quantities: tuple[Quantity, ...] = ()  # type: ignore[misc]
    recorded: Mapping[tuple[str, str], tuple[float, float]] = field(default_factory=dict)  # type: ignore[misc]
    found: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # type: ignore[misc]
    physics: str = "formula"  # type: ignore[misc]
    source: str = ""  # type: ignore[misc]

    @classmethod
    def of(cls, joint: str, terms: Sequence[Term], at: InMotion) -> Formula:
        """Return the formula of some terms, with the units and ranges of a motion."""
        ranges: dict[tuple[str, str], tuple[float, float]] = {}
        for factor in (factor for term in terms for factor in term.factors):
            seen = KNOWN[factor.name].seen_as
            values = KNOWN[seen].of(at, factor.joint)
            ranges[seen, factor.joint] = float(values.min()), float(values.max())
        plain = cls(joint, tuple(terms))
        return replace(plain, quantities=tuple(plain._quantities(at.mechanism, ranges)), recorded=ranges)

    def _quantities(
        self, mechanism: Mechanism, ranges: Mapping[tuple[str, str], tuple[float, float]]
    ) -> Iterator[Quantity]:
        effort = {"N": 1} if mechanism.joint(self.joint).slides else {"N": 1, "m": 1}
        for term, names in zip(self.terms, self.named, strict=True):
            known, shape = KNOWN[term.factor.name], SHAPES[term.shape]
            units, text = known.units(term.factor.joint, mechanism), term.text(self.joint, names)
            across = {} if term.times is None else KNOWN[term.times.name].units(term.times.joint, mechanism)
            for height, power in zip(shape.heights, shape.powers(), strict=True):
                unit = composed((effort, 1), (units, -power), (across, -1))
                yield Quantity(names[height], unit, f"of {text}", 1.0, positive=False, lower=-_LARGEST, upper=_LARGEST)
            for name in term.parameters:
                factor = next((f for f in term.factors if name in KNOWN[f.name].parameters), term.factor)
                own = KNOWN[factor.name].seen_as
                low, high = ranges[own, factor.joint]
                unit = composed((KNOWN[own].units(factor.joint, mechanism), 1))
                span = max(high - low, np.finfo(float).tiny)
                if name in shape.places:
                    yield Quantity(names[name], unit, f"where it is in the {own}", 0.5 * (low + high), positive=False,
                                   lower=low - span, upper=high + span)  # fmt: skip
                else:
                    most = span if factor is term.times else 100 * max(span, abs(low), abs(high))
                    yield Quantity(names[name], unit, f"how far it reaches in the {own}", span, upper=most)

    @cached_property
    def named(self) -> tuple[dict[str, str], ...]:
        """The names of each term's heights and parameters in the law: with its number where there are several terms."""
        ends = [""] if len(self.terms) == 1 else [f"_{index + 1}" for index in range(len(self.terms))]
        return tuple(
            {name: name + end for name in (*SHAPES[term.shape].heights, *term.parameters)}
            for term, end in zip(self.terms, ends, strict=True)
        )

    @property
    def linear(self) -> tuple[str, ...]:  # type: ignore[override]
        """The coefficients."""
        both = zip(self.terms, self.named, strict=True)
        return tuple(names[height] for term, names in both for height in SHAPES[term.shape].heights)

    @property
    def settled(self) -> tuple[str, ...]:  # type: ignore[override]
        """The parameters in which it is not linear."""
        return tuple(
            names[name] for term, names in zip(self.terms, self.named, strict=True) for name in term.parameters
        )

    @property
    def neutral(self) -> Mapping[str, float]:  # type: ignore[override]
        """No coefficient."""
        return dict.fromkeys(self.linear, 0.0)

    @property
    def size(self) -> int:
        """Number of all parameters."""
        return sum(term.size for term in self.terms)

    @property
    def since_begun(self) -> bool:
        """Whether it follows what is counted from where the recording begins: another one may begin otherwise."""
        return any(KNOWN[factor.name].since_begun for term in self.terms for factor in term.factors)

    @property
    def equation(self) -> str:  # type: ignore[override]
        """In symbols."""
        parts = []
        for term, names in zip(self.terms, self.named, strict=True):
            heights = ", ".join(names[height] for height in SHAPES[term.shape].heights)
            heights = f"({heights})" if len(SHAPES[term.shape].heights) > 1 else heights
            parts.append(f"{heights} {term.text(self.joint, names)}")
        return " + ".join(parts)

    @property
    def summary(self) -> str:  # type: ignore[override]
        """One sentence."""
        names = dict.fromkeys(f"{factor.name} of {factor.joint}" for term in self.terms for factor in term.factors)
        return f"an effort at {self.joint} that follows the {' and the '.join(names)}"

    def columns(self, at: InMotion, values: Mapping[str, float]) -> Sequence[Array]:
        return [
            term.columns(at, [values[names[name]] for name in term.parameters])
            for term, names in zip(self.terms, self.named, strict=True)
        ]

    def power(self, at: InMotion, values: Mapping[str, float]) -> Array:
        """Return the power (N,) that its friction takes from the motion."""
        heights = iter(self.linear)
        out = np.zeros(len(at))
        for term, table in zip(self.terms, self.columns(at, values), strict=True):
            own = table @ [values[next(heights)] for _ in range(table.shape[1])]
            out += own if term.resists(self.joint) else 0.0
        return out * at.speed(self.joint)


@dataclass(frozen=True)
class Remainder:
    """The smooth curve by a variable of its joint that was fitted beside a formula, for what its shape leaves.

    turns: as the direction of the motion does; ends: of the variable, beyond which it stays what it is there; heights:
    at even distances between them, as shares of the largest, which is `height`.
    """

    variable: str
    turns: bool
    ends: tuple[float, float]
    heights: tuple[float, ...]
    height: Quantity

    @classmethod
    def among(cls, effects: Iterable[Effect], joint: str, unit: str) -> Remainder | None:
        """Return that of a joint, whose efforts have a unit; None where no such curve is among the effects."""
        for effect in effects:
            law = effect.law
            if isinstance(law, FreeCurve) and law.fine and effect.place.name == joint:
                return cls.of(law, effect.values, unit)
        return None

    @classmethod
    def of(cls, law: FreeCurve, values: Mapping[str, float], unit: str) -> Remainder:
        """Return it of a curve that was fitted, whose efforts have a unit."""
        heights = np.array([values[name] for name in law.linear])
        largest = float(np.abs(heights).max()) or 1.0
        height = Quantity("remainder", unit, "of what the shape leaves, the largest", largest, positive=False,
                          lower=-_LARGEST, upper=_LARGEST)  # fmt: skip
        ends = values["at 0"], values[f"at {law.count - 1}"]
        return cls(law.variable, law.friction, ends, tuple((heights / largest).tolist()), height)

    @property
    def text(self) -> str:
        """In symbols."""
        turning = f"{KNOWN['direction'].symbol} " * self.turns
        return f"{self.height.name} {turning}curve({KNOWN[self.variable].symbol})"

    @property
    def code(self) -> str:
        """As code in the law of its joint, which has its heights."""
        low, high = (f"{end:.6g}" for end in self.ends)
        turning = "direction(at, self.joint, usual_way(at, self.joint)) * " * self.turns
        return f"{turning}smooth_curve({self.variable}(at, self.joint), {low}, {high}, self.heights)"


def library(at: InMotion, joint: str) -> Iterator[Term]:
    """Yield the terms that a motion can show at a joint, plainer ones first: an effort, friction or damping by shapes.

    Of the joint itself all shapes that suit a variable; of every other joint that moves those without parameters.
    What the laws of the library give (offset, dry and viscous friction, springs, whole turns) is none of it.
    """
    own = {name: Factor(name, joint) for name in KNOWN}
    ways: tuple[Factor | None, ...] = (None, own["direction"], own["speed"])
    centred = ("linear", "magnitude", "square", "signed_square", "cube", "outside", "saturation", "decay")
    placed = tuple(name for name, shape in SHAPES.items() if name not in centred and name != "wave")
    for times in ways:
        shapes = placed if times is None else ("linear", *placed, "wave")
        yield from (Term(shape, own["position"], times) for shape in shapes)
        yield from (
            Term(shape, own["load"], times) for shape in (centred if times is None else ("magnitude", "square"))
        )
        yield from (Term(shape, own[name], times) for name in ("time", "travelled") for shape in ("linear", "decay"))
    yield from (Term(shape, own["speed"]) for shape in centred if shape not in ("linear", "decay"))
    yield Term("decay", own["speed"], own["direction"])
    yield from (Term("linear", own[name]) for name in ("hysteresis", "yielding"))
    for other in at.motion.names:
        if other == joint or not at.moves(other):
            continue
        for name in ("position", "speed"):
            for times in (*ways, own["position"]):
                plain = ("linear", "magnitude", "square", "signed_square", "cube")
                yield from (Term(shape, Factor(name, other), times) for shape in plain)
        yield from (Term("linear", Factor(name, other)) for name in ("hysteresis", "yielding"))


def tried(term: Term, at: InMotion, joint: str) -> Iterator[tuple[float, ...]]:
    """Yield values of a term's parameters among which the best are looked for."""
    if KNOWN[term.factor.name].parameters:
        travel = float(np.ptp(at.position(term.factor.joint)))
        yield from ((share * travel,) for share in (0.01, 0.03, 0.1, 0.3, 1.0))
        return
    turns = (usual_way(at, joint),) if term.times and KNOWN[term.times.name].parameters else ()
    values = term.factor.of(at)
    yield from ((*turns, *own) for own in SHAPES[term.shape].tried(float(values.min()), float(values.max())))
