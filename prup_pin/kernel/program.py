"""Equations as a straight line of scalar operations, for millions of poses.

The equations of this package are written for arrays with any leading axes. Given an array of `Expression`s they write
down what they do instead of doing it: each sum, product, root of one pose in turn, zeros and ones left out. What comes
out is a `Program` that knows one mechanism only; numpy runs it on columns of poses, or `machine` compiles it.

Every expression carries its values at some sample poses. They tell which pivots are good and which sums are zero, as
identities of the mechanism make them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..spatial import Array

#: Smaller than this share of what it is made of, at every sample: zero. Rounding leaves some 1e-15.
_ZERO = 1e-13
#: A constant smaller than this is what rounding leaves of the zeros in rotations.
_ROUNDING = 1e-15
#: Share of the largest candidate that a pivot must have at every sample.
_PIVOT = 0.05

_UNARY = {
    "neg": np.negative,
    "sqrt": np.sqrt,
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "arccos": np.arccos,
    "rint": np.rint,
    "abs": np.abs,
}
_BINARY: dict[str, Callable[..., Any]] = {
    "add": np.add,
    "sub": np.subtract,
    "mul": np.multiply,
    "div": np.divide,
    "arctan2": np.arctan2,
    "hypot": np.hypot,
    "max": np.maximum,
    "min": np.minimum,
    "le": np.less_equal,
}
FUNCTIONS: dict[str, Callable[..., Any]] = {**_UNARY, **_BINARY}
#: Operations that compute nothing.
GIVEN = ("input", "constant")
#: Functions that decide case by case.
_PIECEWISE = ("rint", "abs", "max", "min", "le")


class Operation(NamedTuple):
    """One step: 'input' number `value`, 'constant' of that value, or a function of earlier steps a and b."""

    name: str
    a: int = -1
    b: int = -1
    value: float = 0.0


class Tape:
    """Operations as they are written down, with the values of each at the sample poses, (S,)."""

    def __init__(self, samples: int):
        self.operations: list[Operation] = []
        self.values: list[Array] = []
        self._samples = samples
        self._known: dict[tuple, int] = {}
        self._piecewise: list[bool] = []

    def inputs(self, samples: Array) -> Array:
        """Return expressions of new inputs, an object array (n,), of their values at the samples (S, n)."""
        first = sum(operation.name == "input" for operation in self.operations)
        out = np.empty(samples.shape[1], object)
        for column in range(samples.shape[1]):
            out[column] = self._new(Operation("input", value=first + column), samples[:, column].copy())
        return out

    def constant(self, value: float) -> Expression:
        """Return a constant exactly as it is."""
        operation = Operation("constant", value=float(value))
        if operation in self._known:
            return Expression(self, self._known[operation])
        return self._new(operation, np.full(self._samples, float(value)))

    def expressed(self, values: Array) -> Array:
        """Return an object array whose numbers have become constants."""
        out = np.empty(values.shape, object)
        for index, value in np.ndenumerate(values):
            out[index] = value if isinstance(value, Expression) else self.constant(value)
        return out

    def sampled(self, values: Array) -> Array:
        """Return numbers and expressions (...) at the samples, (S, ...)."""
        out = np.empty((*values.shape, self._samples))
        for index, value in np.ndenumerate(values):
            out[index] = value.values if isinstance(value, Expression) else float(value)
        return np.moveaxis(out, -1, 0)

    def apply(self, name: str, a: Expression, b: Expression | None = None) -> Expression:
        """Return a function of expressions, or what is known to be zero."""
        if b is None:
            value = FUNCTIONS[name](a.values)
        else:
            if name in ("add", "mul", "max", "min") and a.index > b.index:
                a, b = b, a
            value = FUNCTIONS[name](a.values, b.values)
        operation = Operation(name, a.index, -1 if b is None else b.index)
        if operation in self._known:
            return Expression(self, self._known[operation])
        # What is decided case by case may be zero at all samples and another elsewhere.
        cases = name in _PIECEWISE or self._piecewise[a.index] or (b is not None and self._piecewise[b.index])
        if name in ("add", "sub") and not cases:
            assert b is not None
            if (np.abs(value) <= _ZERO * (np.abs(a.values) + np.abs(b.values))).all():
                return self.constant(0.0)
        return self._new(operation, value.astype(float) if cases else value, cases)

    def _new(self, operation: Operation, value: Array, cases: bool = False) -> Expression:
        self.operations.append(operation)
        self.values.append(value)
        self._piecewise.append(cases)
        index = len(self.operations) - 1
        self._known[operation] = index
        return Expression(self, index)


class Expression:
    """A scalar that is yet to be computed. Sums, products, roots and the like of it write operations down.

    Comparisons give 1 where they hold, else 0; "or" is the larger of two.
    """

    __array_priority__ = 100.0
    __slots__ = ("index", "tape")

    def __init__(self, tape: Tape, index: int):
        self.tape, self.index = tape, index

    @property
    def values(self) -> Array:
        """At the sample poses, (S,)."""
        return self.tape.values[self.index]

    @property
    def known(self) -> float | None:
        """The value of a constant, else None."""
        operation = self.tape.operations[self.index]
        return operation.value if operation.name == "constant" else None

    def _other(self, other: Any) -> Expression | None:
        if isinstance(other, Expression):
            return other
        if isinstance(other, float | int | np.floating | np.integer | np.bool_):
            value = float(other)
            return self.tape.constant(0.0 if abs(value) < _ROUNDING else value)
        return None

    def _operand(self) -> Operation:
        return self.tape.operations[self.index]

    def __add__(self, other):
        b = self._other(other)
        if b is None:
            return NotImplemented
        if b.known == 0:
            return self
        if self.known == 0:
            return b
        if self.known is not None and b.known is not None:
            return self.tape.constant(self.known + b.known)
        if b._operand().name == "neg":
            return self - Expression(self.tape, b._operand().a)
        if self._operand().name == "neg":
            return b - Expression(self.tape, self._operand().a)
        return self.tape.apply("add", self, b)

    __radd__ = __add__

    def __sub__(self, other):
        b = self._other(other)
        if b is None:
            return NotImplemented
        if b.known == 0:
            return self
        if b.index == self.index:
            return self.tape.constant(0.0)
        if self.known == 0:
            return -b
        if self.known is not None and b.known is not None:
            return self.tape.constant(self.known - b.known)
        if b._operand().name == "neg":
            return self + Expression(self.tape, b._operand().a)
        return self.tape.apply("sub", self, b)

    def __rsub__(self, other):
        b = self._other(other)
        return NotImplemented if b is None else b - self

    def __mul__(self, other):
        b = self._other(other)
        if b is None:
            return NotImplemented
        for one, two in ((self, b), (b, self)):
            if one.known == 0:
                return self.tape.constant(0.0)
            if one.known == 1:
                return two
            if one.known == -1:
                return -two
        if self.known is not None and b.known is not None:
            return self.tape.constant(self.known * b.known)
        if self._operand().name == "neg":
            return -(Expression(self.tape, self._operand().a) * b)
        if b._operand().name == "neg":
            return -(self * Expression(self.tape, b._operand().a))
        return self.tape.apply("mul", self, b)

    __rmul__ = __mul__

    def __truediv__(self, other):
        b = self._other(other)
        if b is None:
            return NotImplemented
        if self.known == 0:
            return self
        if b.known is not None:
            return self * (1.0 / b.known) if self.known is None else self.tape.constant(self.known / b.known)
        return self.tape.apply("div", self, b)

    def __rtruediv__(self, other):
        b = self._other(other)
        return NotImplemented if b is None else b / self

    def __neg__(self):
        if self.known is not None:
            return self.tape.constant(-self.known)
        if self._operand().name == "neg":
            return Expression(self.tape, self._operand().a)
        return self.tape.apply("neg", self)

    def __pow__(self, power):
        if power != int(power) or power < 1:
            return NotImplemented
        result = self
        for _ in range(int(power) - 1):
            result = result * self
        return result

    def _function(self, name: str) -> Expression:
        if self.known is not None:
            return self.tape.constant(float(FUNCTIONS[name](self.known)))
        return self.tape.apply(name, self)

    def __abs__(self):
        return self._function("abs")

    def __le__(self, other):
        b = self._other(other)
        return NotImplemented if b is None else self.tape.apply("le", self, b)

    def __ge__(self, other):
        b = self._other(other)
        return NotImplemented if b is None else self.tape.apply("le", b, self)

    def __or__(self, other):
        b = self._other(other)
        return NotImplemented if b is None else self.tape.apply("max", self, b)

    __ror__ = __or__

    def arctan2(self, other):
        return self.tape.apply("arctan2", self, self._other(other))

    def hypot(self, other):
        return self.tape.apply("hypot", self, self._other(other))


def _method(name: str) -> Callable[[Expression], Expression]:
    return lambda expression: expression._function(name)


#: numpy's functions of arrays of expressions call methods of their names.
for _name in ("sqrt", "sin", "cos", "tan", "arccos", "rint"):
    setattr(Expression, _name, _method(_name))


def largest(values: Sequence[Any]) -> Any:
    """Return the largest of some expressions, or elementwise of some arrays."""
    return _reduced("max", values)


def least(values: Sequence[Any]) -> Any:
    """Return the least of some expressions, or elementwise of some arrays."""
    return _reduced("min", values)


def _reduced(name: str, values: Sequence[Any]) -> Any:
    result, *others = values
    for value in others:
        if isinstance(result, Expression):
            result = result.tape.apply(name, result, value)
        else:
            result = _BINARY[name](result, value)
    return result


def eliminated(matrix: Array, right: Array) -> tuple[Array, list[Expression]]:
    """Return the solution (n, c) of a square system (n, n) of expressions, and its pivots.

    Gauss's elimination, the order of pivots settled by the samples: few operations first, as long as the pivot is not
    small against its rivals at any of them. Raises ZeroDivisionError where no pivot is left.
    """
    a, b = matrix.copy(), right.copy()
    size = len(a)
    rows, columns = list(range(size)), list(range(size))
    order: list[tuple[int, int]] = []
    pivots: list[Expression] = []
    inverses: dict[int, Any] = {}
    zero = np.array([[_vanishes(value) for value in row] for row in a], bool).reshape(a.shape)
    values = next(value for value in a.flat if isinstance(value, Expression)).tape.sampled(a)
    while rows:
        row, column = _pivot(values, zero, rows, columns)
        order.append((row, column))
        pivots.append(a[row, column])
        rows.remove(row)
        columns.remove(column)
        inverse = 1.0 / a[row, column]
        inverses[row] = inverse
        for other in rows:
            if zero[other, column]:
                continue
            factor = a[other, column] * inverse
            for k in columns:
                if not zero[row, k]:
                    a[other, k] = a[other, k] - factor * a[row, k]
                    zero[other, k] = _vanishes(a[other, k])
                    values[:, other, k] = 0.0 if zero[other, k] else a[other, k].values
            for k in range(b.shape[1]):
                if not _vanishes(b[row, k]):
                    b[other, k] = b[other, k] - factor * b[row, k]
            zero[other, column] = True
    solution = np.empty((size, b.shape[1]), object)
    for row, column in reversed(order):
        for k in range(b.shape[1]):
            value = b[row, k]
            for other in (c for _, c in order[order.index((row, column)) + 1 :]):
                if not zero[row, other]:
                    value = value - a[row, other] * solution[other, k]
            solution[column, k] = value * inverses[row]
    return solution, pivots


def _pivot(values: Array, zero: NDArray[np.bool_], rows: list[int], columns: list[int]) -> tuple[int, int]:
    """Return the pivot of the least fill among those that are large enough."""
    part = np.ix_(rows, columns)
    signed = values[:, rows][:, :, columns]
    sizes = np.abs(signed)
    rival = np.maximum(sizes.max(axis=2, keepdims=True), 1e-300)
    # What has either sign is zero somewhere between the samples.
    one_sign = (signed > 0.0).all(axis=0) | (signed < 0.0).all(axis=0)
    good = (sizes >= _PIVOT * rival).all(axis=0) & one_sign & ~zero[part]
    if not good.any():
        share = np.where(zero[part], 0.0, (sizes / rival).min(axis=0))
        if not share.any():
            raise ZeroDivisionError("singular at the samples")
        good = share == share.max()
    filled = ~zero[part]
    cost = (filled.sum(axis=1)[:, None] - 1) * (filled.sum(axis=0)[None] - 1)
    place = np.argmin(np.where(good, cost, np.inf))
    row, column = np.unravel_index(place, cost.shape)
    return rows[int(row)], columns[int(column)]


def _vanishes(value: Any) -> bool:
    known = value.known if isinstance(value, Expression) else value
    return known is not None and known == 0


class Program:
    """What a tape computes from its inputs, without what no output needs. Immutable; it pickles."""

    def __init__(self, tape: Tape, outputs: Sequence[Any]):
        """`outputs` are expressions, or numbers."""
        given = [value if isinstance(value, Expression) else tape.constant(float(value)) for value in outputs]
        needed = np.zeros(len(tape.operations), bool)
        waiting = [value.index for value in given]
        while waiting:
            index = waiting.pop()
            if not needed[index]:
                needed[index] = True
                operation = tape.operations[index]
                waiting += [at for at in (operation.a, operation.b) if at >= 0]
        self.inputs = sum(operation.name == "input" for operation in tape.operations)
        place: dict[int, int] = {-1: -1}
        self.operations: list[Operation] = []
        for index in np.flatnonzero(needed).tolist():
            operation = tape.operations[index]
            place[index] = len(self.operations)
            self.operations.append(operation._replace(a=place[operation.a], b=place[operation.b]))
        self.outputs = [place[value.index] for value in given]

    @classmethod
    def without(cls, inputs: int) -> Program:
        """Return a program that takes so many inputs and does nothing."""
        program = cls(Tape(1), [])
        program.inputs = inputs
        return program

    def __len__(self) -> int:
        return sum(operation.name not in GIVEN for operation in self.operations)


class Pipeline(NamedTuple):
    """From coordinates x (t,) to outputs: y = start(x); Newton's steps y = step(y, x); outputs of final(y, x).

    Without `step` the start is the solution. A step gives where it leads to, the square of its length, and conditions
    that are 1 where it may be the last. The outputs are followed by 0 where the steps have ended, else 1, and by the
    sum of their lengths. Each pose stops by itself: when a step is so short that the next one is rounding, or when it
    is so long that Newton's method would be lost.
    """

    start: Program
    step: Program | None
    final: Program


#: Newton's method: most steps; squares of the length [m, rad] below which a step is the last, above which it is lost.
STEPS, SHORT, LONG = 8, 1e-16, 0.01
