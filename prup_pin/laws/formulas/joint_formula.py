"""A formula of one joint's effort as a law: the base of those that a diagnosis proposes and of written ones."""

from __future__ import annotations

import re
from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ...dynamics import InMotion
from ...errors import InputError
from ...mechanism import Mechanism
from ...numbers import counted, number, quantity
from ...spatial import Array
from ..efforts.effort_law import EFFORT, EffortLaw
from ..efforts.variables import VARIABLES
from ..law import Law, Place
from .known import KNOWN

if TYPE_CHECKING:
    from typing_extensions import Self

#: A place moves by this part of the way between its bounds where a size becomes e times as large: about a third of the
#: range in which it may lie.
_STEPS = 9
#: Beyond its range by less than this share of it, a variable is hardly anywhere else.
_MARGIN = 0.01
#: A place so near to zero, as a share of the range between its bounds, is zero.
_NOTHING = 1e-6


class Proposed(Law):
    """What a formula says of itself, be it an effort or a deformation."""

    remedy = "look at {place} for what this formula describes, and record once more to confirm or refute it"
    #: What it gives, in equations.
    symbol: ClassVar[str]
    #: In symbols, as 'c |v| v'.
    equation: ClassVar[str]
    #: The parameters to which it is in proportion.
    linear: ClassVar[tuple[str, ...]]
    #: The ends between which each variable was seen, by (variable, joint or module).
    recorded: ClassVar[Mapping[tuple[str, str], tuple[float, float]]]
    #: The 95 % interval of each parameter that was found.
    found: ClassVar[Mapping[str, tuple[float, float]]]

    def told_at(self, values: Mapping[str, float]) -> str:
        """Return the equation in numbers: `linear` parameters in SI units, others in units without leading zeros."""
        out = self.equation
        for q in self.quantities:
            value = values[q.name]
            if q.name in self.linear:
                told = number(value, 3)
            elif not q.positive and abs(value) < _NOTHING * (q.upper - q.lower):
                told = "0"
            else:
                told = quantity(value, q.unit, 3)
            out = re.sub(rf"\b{q.name}\b", told, out)
        return out.replace("+ -", "- ").replace("- -", "+ ")

    def with_values(self, values: Mapping[str, float], found: Mapping[str, tuple[float, float]]) -> Self:
        """Return the formula with fitted values as defaults, and their 95 % intervals."""
        quantities = tuple(replace(q, default=values[q.name]) for q in self.quantities)
        return replace(self, quantities=quantities, found=found)  # type: ignore[type-var]

    def misdeclared(self) -> Iterator[str]:
        yield from super().misdeclared()
        if not isinstance(getattr(self, "equation", None), str):
            yield f"equation is {getattr(self, 'equation', None)!r}; expected a text"
        for what, expected in (
            ("found", "{'coefficient': (1.0, 2.0)}"),
            ("recorded", "{('position', 'x'): (0.0, 1.0)}"),
        ):
            own = getattr(self, what, None)
            if not isinstance(own, Mapping) or not all(map(_are_ends, own.values())):
                yield f"{what} is {own!r}; expected two ends each, as in {expected}"
            elif what == "recorded" and not all(isinstance(key, tuple) and len(key) == 2 for key in own):
                yield f"{what} is {own!r}; expected a variable and where it is for each, as in {expected}"

    @contextmanager
    def blamed(self, name: str) -> Iterator[None]:
        """Turn what goes wrong in a function of the formula, which people edit, into an InputError that names both."""
        try:
            with np.errstate(all="ignore"):  # what is no number is told, once
                yield
        except (ArithmeticError, AttributeError, LookupError, NameError, TypeError, ValueError) as error:
            raise InputError(
                f"{self.physics}: '{name}' fails: {type(error).__name__}: {error}; correct the formula"
            ) from error


def _are_ends(ends: Any) -> bool:
    numbers = isinstance(ends, tuple) and len(ends) == 2 and all(isinstance(end, float | int) for end in ends)
    return numbers and ends[0] <= ends[1]


class JointFormula(Proposed, EffortLaw):
    """An effort along one joint as a sum of terms: what no law of the library gives, proposed from a recording.

    A subclass says its `joint`, its `columns`, and `recorded`: between which ends each variable of a joint was when it
    was found, by (variable, joint). Beyond them it was never seen.
    """

    variant = EFFORT
    named_before = True
    symbol = "tau"
    #: Where it acts.
    joint: ClassVar[str]

    @abstractmethod
    def columns(self, at: InMotion, values: Mapping[str, float]) -> Sequence[Array]:
        """Return the effort along the joint per unit of each `linear` parameter, each (N,), or (N, c) of c of them."""

    @property
    def of_motion(self) -> bool:  # type: ignore[override]
        """Not so where it follows positions or loads alone, which a robot at rest has too."""
        return any(name not in ("position", "load") for name, _ in self.recorded)

    @property
    def against(self) -> str:  # type: ignore[override]
        """The first variable of its own joint against which efforts are drawn."""
        return next((name for name, joint in self.recorded if joint == self.joint and name in VARIABLES), "")

    def misdeclared(self) -> Iterator[str]:
        wrong = list(super().misdeclared())
        yield from wrong
        if not isinstance(getattr(self, "joint", None), str):
            yield f"joint is {getattr(self, 'joint', None)!r}; expected the name of a joint"
        names = [q.name for q in self.quantities]
        for what in ("linear", "settled"):
            own = getattr(self, what, None)
            if not isinstance(own, tuple) or (names and not set(own) <= set(names)):
                yield f"{what} is {own!r}; expected a tuple of names of its quantities, {', '.join(names)}"
            elif what == "linear" and any(self.neutral.get(name) != 0 for name in own):
                yield f"neutral is {self.neutral!r}; expected 0 for each of {', '.join(own)}"
        if not wrong and (unknown := [name for name, _ in self.recorded if name not in KNOWN]):
            yield f"recorded names {', '.join(unknown)}; variables are {', '.join(KNOWN)}"

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return [Place(self.joint, EFFORT)] if self.joint in mechanism.actuated else []

    def acts(self, place: Place, at: InMotion) -> bool:
        joints = {self.joint, *(joint for _, joint in self.recorded)}
        return place.name in at.driven and all(joint in at.motion.names and at.moves(joint) for joint in joints)

    def scanned(self, place: Place, at: InMotion) -> Sequence[Mapping[str, float]]:
        return [{q.name: float(q.default) for q in self.quantities if q.name in self.settled}]  # type: ignore[arg-type]

    def free(self, values: Mapping[str, float]) -> tuple[str, ...]:
        return self.settled

    def scaled(self, values: Mapping[str, float], factors: Sequence[float]) -> Mapping[str, float]:
        """Return other values: sizes so many times as large, places moved by logarithms of shares of their bounds."""
        out, quantities = dict(values), {q.name: q for q in self.quantities}
        for name, factor in zip(self.settled, factors, strict=True):
            q = quantities[name]
            moved = (
                values[name] * factor if q.positive else values[name] + np.log(factor) * (q.upper - q.lower) / _STEPS
            )
            out[name] = float(np.clip(moved, q.lowest, q.upper))
        return out

    def near(self, values: Mapping[str, float]) -> float:
        return 0.06

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return at.along(place.name, self.table(at, values))

    def table(self, at: InMotion, values: Mapping[str, float]) -> Array:
        """Return all its columns (N, p). Raises InputError where they are not one number a sample and coefficient."""
        with self.blamed("columns"):
            columns = [np.asarray(column, float) for column in self.columns(at, values)]
        expected = f"expected {len(at)} samples of {len(self.linear)}, one for each of {', '.join(self.linear)}"
        if any(column.ndim not in (1, 2) or len(column) != len(at) for column in columns):
            shapes = ", ".join(str(column.shape) for column in columns)
            raise InputError(f"{self.physics}: 'columns' returns arrays of the shapes {shapes}; {expected}")
        table = np.column_stack(columns) if columns else np.zeros((len(at), 0))
        if table.shape[1] != len(self.linear):
            raise InputError(f"{self.physics}: 'columns' returns {counted(table.shape[1], 'column')}; {expected}")
        if not np.isfinite(table).all():
            sample = int(np.flatnonzero(~np.isfinite(table).all(axis=1))[0])
            told = "".join(f", {name} = {values[name]:g}" for name in self.settled if name in values)
            raise InputError(
                f"{self.physics}: 'columns' is no number at sample {sample} of the motion{told}; correct the "
                "formula or its values"
            )
        return table

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        return f"{place.name} follows {self.told_at(values)}"

    def at_values(self, values: Mapping[str, float]) -> EffortLaw:
        """Return the law of the formula at given values, of which only how much of it there is, is free."""
        return _AtValues(self, values)

    def left_range(self, at: InMotion) -> Iterator[str]:
        for (name, joint), (low, high) in self.recorded.items():
            values, margin = KNOWN[name].of(at, joint), _MARGIN * (high - low)
            share = float(((values < low - margin) | (values > high + margin)).mean())
            if share > 0:
                yield (
                    f"the {name} of {joint} is outside {number(low, 3)} to {number(high, 3)}, where {self.physics} was "
                    f"seen, in {number(100 * share, 2)} % of the samples: an extrapolation"
                )


@dataclass(frozen=True, eq=False)
class _AtValues(EffortLaw):
    """A formula at the values of its file."""

    law: JointFormula
    values: Mapping[str, float]
    physics: ClassVar[str] = "as proposed"
    summary: ClassVar[str] = "a formula as it was proposed"
    linear: ClassVar[tuple[str, ...]] = ("share",)
    quantities = ()

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        return self.law.places(mechanism)

    def efforts_per(self, place: Place, values: Mapping[str, float], at: InMotion) -> Array:
        return self.law.efforts(place, self.values, at)[..., None]
