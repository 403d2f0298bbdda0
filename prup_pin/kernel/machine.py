"""Pipelines as machine code, by LLVM (extra: compiled): eight poses in one go.

LLVM takes the straight line as it is; numba, which stands on the same llvmlite, reads it from Python, and takes about
ten times as long. A product that one sum takes is rounded with it, once, as IEEE 754 defines it; sine, cosine and
arctan2 are polynomials: the width of a processor's registers changes no bit. arccos is the C library's.
"""

from __future__ import annotations

import ctypes
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from math import factorial
from typing import Any

import numpy as np
from numpy.polynomial import Chebyshev, Polynomial

from ..errors import imported
from ..spatial import Array
from .program import LONG, SHORT, STEPS, Pipeline, Program

__all__ = ["LANES", "Machine"]

#: Poses that are computed side by side.
LANES = 8
#: Parts of pi/2 that add up to it, the first two short, so that their multiples are exact.
_QUARTER_PARTS = (1.5707963109016418, 1.5893254712295857e-08, 6.123233995736766e-17)


def _economised(terms: Callable[[int], float], size: float, count: int) -> tuple[float, ...]:
    """Return the coefficients of a polynomial that is a power series to rounding from 0 to `size`."""
    series = Polynomial([terms(k) for k in range(40)])
    return tuple(Chebyshev.interpolate(series, count - 1, domain=[0.0, size]).convert(kind=Polynomial).coef.tolist())


#: sin r = r + r^3 P(r^2) and cos r = 1 + r^2 P(r^2) within an eighth of a turn either way.
_EIGHTH = (np.pi / 4) ** 2
_SINE = _economised(lambda k: (-1.0) ** (k + 1) / factorial(2 * k + 3), _EIGHTH, 7)
_COSINE = _economised(lambda k: (-1.0) ** (k + 1) / factorial(2 * k + 2), _EIGHTH, 7)
#: arctan u = u + u^3 P(u^2) within a sixteenth of a turn.
_TANGENT = float(np.tan(np.pi / 8))
_ARCTANGENT = _economised(lambda k: (-1.0) ** (k + 1) / (2 * k + 3), _TANGENT**2, 13)
#: Added to a double, this leaves its nearest integer in the last bits.
_INTEGER = 1.5 * 2.0**52


class Machine:
    """A pipeline in machine code. It pickles as that and is compiled anew."""

    def __init__(self, pipeline: Pipeline, widths: Sequence[int] = ()):
        """`widths`: the outputs, failure and way at their end, go to so many arrays, as many columns to each."""
        self.pipeline = pipeline
        self.widths = tuple(widths) or (len(pipeline.final.outputs) + 2,)
        llvm = imported("llvmlite.binding", "compiled")
        _initialise(llvm)
        features = llvm.get_host_cpu_features()
        target = llvm.Target.from_default_triple().create_target_machine(
            cpu=llvm.get_host_cpu_name(), features=features.flatten(), opt=2
        )
        writer = _Writer(fused=features.get("fma", True))
        module = llvm.parse_assembly(writer.text(pipeline, self.widths))
        module.verify()
        self._constants = np.array(list(writer.constants))
        self._engine = llvm.create_mcjit_compiler(module, target)
        self._engine.finalize_object()
        address = self._engine.get_function_address("run")
        self._run = ctypes.CFUNCTYPE(None, ctypes.c_int64, *3 * [ctypes.c_void_p])(address)

    def __reduce__(self):
        return Machine, (self.pipeline, self.widths)

    def run(self, inputs: Array) -> Array:
        """Return outputs, failure and way (n, m + 2) of coordinates (n, t)."""
        parts = [np.empty((len(inputs), width)) for width in self.widths]
        self.fill(inputs, parts)
        return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1)

    def fill(self, inputs: Array, into: Sequence[Array]) -> None:
        """Write outputs, failure and way of coordinates (n, t) to contiguous arrays, rows of `widths` numbers each."""
        count, whole = len(inputs), len(inputs) // LANES
        given = np.ascontiguousarray(inputs, float)
        self._call(whole, given, into)
        if whole * LANES < count:
            rest = np.repeat(given[-1:], LANES, axis=0)
            rest[: count - whole * LANES] = given[whole * LANES :]
            last = [np.empty((LANES, width)) for width in self.widths]
            self._call(1, rest, last)
            for array, rows in zip(into, last, strict=True):
                array[whole * LANES :] = rows[: count - whole * LANES].reshape(-1, *array.shape[1:])

    def _call(self, blocks: int, given: Array, into: Sequence[Array]) -> None:
        places = np.array([array.ctypes.data for array in into], np.uintp)
        self._run(blocks, given.ctypes.data, places.ctypes.data, self._constants.ctypes.data)


def _initialise(llvm: Any) -> None:
    # Before llvmlite 0.45 the library had to be initialised by hand; since then asking for it is an error.
    with suppress(RuntimeError):
        llvm.initialize()
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()


class _Writer:
    """LLVM's assembly of one pipeline."""

    def __init__(self, fused: bool) -> None:
        """`fused`: the processor rounds a product and a sum at once."""
        self._lines: list[str] = []
        self._count = 0
        self._type = f"<{LANES} x double>"
        self._bits = f"<{LANES} x i64>"
        self._mask = f"<{LANES} x i1>"
        self._fused = fused
        self._turned: dict[str, tuple[str, str]] = {}
        self._conditions: dict[str, str] = {}
        #: What the machine reads from a table, one number for all lanes: written out it would fill the cache.
        self.constants: dict[float, int] = {}

    def text(self, pipeline: Pipeline, widths: Sequence[int]) -> str:
        """Return the module: run(blocks, inputs, arrays of outputs) over blocks of LANES poses, row after row."""
        inputs = pipeline.start.inputs
        bases = [self._new(f"getelementptr ptr, ptr %outputs, i64 {index}") for index in range(len(widths))]
        bases = [self._new(f"load ptr, ptr {base}, align 8") for base in bases]
        entry, self._lines = self._lines, []
        x = [self._gathered("%from", inputs, column) for column in range(inputs)]
        y = self._emitted(pipeline.start, x)
        way = failed = self._splat(0.0)
        if pipeline.step is not None:
            y, failed, way = self._stepped(pipeline.step, y, x)
        outputs = [*self._emitted(pipeline.final, [*y, *x]), failed, way]
        assert len(outputs) == sum(widths)
        assert len(y) == len(pipeline.start.outputs)
        for base, width in zip(bases, widths, strict=True):
            at = self._new(f"mul i64 %block, {LANES * width}")
            self._scattered(self._new(f"getelementptr double, ptr {base}, i64 {at}"), outputs[:width])
            outputs = outputs[width:]
        body, start = "\n".join(self._lines), "\n".join(entry)
        two, three = (", ".join(count * [self._type]) for count in (2, 3))
        functions = "\n".join(
            f"declare {self._type} @llvm.{name}.v{LANES}f64({arguments})"
            for name, arguments in {
                "sqrt": self._type, "rint": self._type, "fabs": self._type, "copysign": two, "fma": three,
            }.items()
        )  # fmt: skip
        return f"""
{functions}
declare i1 @llvm.vector.reduce.or.v{LANES}i1({self._mask})
declare double @acos(double)
define void @run(i64 %blocks, ptr %inputs, ptr %outputs, ptr %constants) {{
entry:
{start}
  %some = icmp sgt i64 %blocks, 0
  br i1 %some, label %loop, label %end
loop:
  %block = phi i64 [ 0, %entry ], [ %next, %done ]
  %from_at = mul i64 %block, {LANES * inputs}
  %from = getelementptr double, ptr %inputs, i64 %from_at
{body}
  br label %done
done:
  %next = add i64 %block, 1
  %more = icmp slt i64 %next, %blocks
  br i1 %more, label %loop, label %end
end:
  ret void
}}
"""

    def _emitted(self, program: Program, given: list[str]) -> list[str]:
        """Write a program's operations on named inputs, and return the names of its outputs."""
        operations, names = program.operations, [""] * len(program.operations)
        uses = Counter(at for operation in operations for at in (operation.a, operation.b))
        uses.update(program.outputs)
        joined = self._joined(program, uses)
        products = set(joined.values())

        def at(index: int) -> str:
            """A constant is loaded where it is used: there are more of them than registers."""
            return names[index] or self._splat(operations[index].value)

        for index, (name, a, b, value) in enumerate(operations):
            if name == "input":
                names[index] = given[int(value)]
            elif index in joined:
                product, other = operations[joined[index]], at(b if joined[index] == a else a)
                one, two = at(product.a), at(product.b)
                if name == "sub":  # a b - c, or c - a b
                    one, other = (one, self._neg(other)) if joined[index] == a else (self._neg(one), other)
                names[index] = self._multiplied(one, two, other)
            elif name != "constant" and index not in products:
                arguments = (at(a),) if b < 0 else (at(a), at(b))
                names[index] = getattr(self, f"_{name}")(*arguments)
        return [at(index) for index in program.outputs]

    def _joined(self, program: Program, uses: Counter[int]) -> dict[int, int]:
        """Return which sums take which product that nothing else needs."""
        joined: dict[int, int] = {}
        for index, (name, a, b, _) in enumerate(program.operations if self._fused else ()):
            if name in ("add", "sub"):
                products = [at for at in (b, a) if program.operations[at].name == "mul" and uses[at] == 1]
                if products:
                    joined[index] = products[0]
        return joined

    def _stepped(self, step: Program, start: list[str], x: list[str]) -> tuple[list[str], str, str]:
        """Write the loop of Newton's steps, as `Pipeline.run` has it; return solution, failure and way."""
        kind, size = self._type, len(start)
        zero, one = self._splat(0.0), self._splat(1.0)
        self._lines += ["  br label %begin", "begin:", "  br label %newton", "newton:"]
        y = [f"%y{index}" for index in range(size)]
        for name, value in zip(y, start, strict=True):
            self._lines.append(f"  {name} = phi {kind} [ {value}, %begin ], [ {name}n, %newton ]")
        self._lines += [
            f"  %way = phi {kind} [ {zero}, %begin ], [ %way_n, %newton ]",
            f"  %failed = phi {kind} [ {one}, %begin ], [ %failed_n, %newton ]",
            f"  %busy = phi {self._mask} [ <{', '.join(['i1 1'] * LANES)}>, %begin ], [ %busy_n, %newton ]",
            "  %turn = phi i64 [ 1, %begin ], [ %turn_n, %newton ]",
        ]
        steps = self._emitted(step, [*y, *x])
        steps, last = steps[:size], steps[size:]
        squared = self._mul(steps[0], steps[0])
        for part in steps[1:]:
            squared = self._multiplied(part, part, squared)
        near = self._new(f"fcmp ole {kind} {squared}, {self._splat(LONG)}")
        moving = self._new(f"and {self._mask} %busy, {near}")
        for name, part in zip(y, steps, strict=True):
            moved = self._sub(name, part)
            self._lines.append(f"  {name}n = select {self._mask} {moving}, {kind} {moved}, {kind} {name}")
        longer = self._add("%way", self._sqrt(squared))
        short = self._new(f"fcmp ole {kind} {squared}, {self._splat(SHORT)}")
        for condition in last:
            holds = self._new(f"fcmp oeq {kind} {condition}, {self._splat(1.0)}")
            short = self._new(f"and {self._mask} {short}, {holds}")
        ended = self._new(f"and {self._mask} {moving}, {short}")
        on = self._new(f"xor {self._mask} {short}, <{', '.join(['i1 1'] * LANES)}>")
        self._lines += [
            f"  %way_n = select {self._mask} {moving}, {kind} {longer}, {kind} %way",
            f"  %failed_n = select {self._mask} {ended}, {kind} {zero}, {kind} %failed",
            f"  %busy_n = and {self._mask} {moving}, {on}",
            "  %turn_n = add i64 %turn, 1",
        ]
        some = self._new(f"call i1 @llvm.vector.reduce.or.v{LANES}i1({self._mask} %busy_n)")
        left = self._new(f"icmp sle i64 %turn_n, {STEPS}")
        again = self._new(f"and i1 {some}, {left}")
        self._lines += [f"  br i1 {again}, label %newton, label %settled", "settled:"]
        return [f"{name}n" for name in y], "%failed_n", "%way_n"

    def _gathered(self, base: str, width: int, column: int) -> str:
        """Load one column of LANES rows."""
        out = "zeroinitializer"
        for lane in range(LANES):
            place = self._new(f"getelementptr double, ptr {base}, i64 {lane * width + column}")
            value = self._new(f"load double, ptr {place}, align 8")
            out = self._new(f"insertelement {self._type} {out}, double {value}, i64 {lane}")
        return out

    def _scattered(self, base: str, columns: list[str]) -> None:
        """Store columns of LANES rows: four columns of eight rows turn into eight rows of four."""
        width, even = len(columns), 4 * (len(columns) // 4)
        for column in range(0, even, 4):
            a, b, c, d = columns[column : column + 4]
            for odd in (0, 1):
                pairs = [lane + odd + side for lane in range(0, LANES, 2) for side in (0, LANES)]
                left, right = self._shuffled(a, b, pairs), self._shuffled(c, d, pairs)
                for lane in range(odd, LANES, 2):
                    at = lane - odd
                    row = self._shuffled(left, right, [at, at + 1, at + LANES, at + LANES + 1])
                    place = self._new(f"getelementptr double, ptr {base}, i64 {lane * width + column}")
                    self._lines.append(f"  store <4 x double> {row}, ptr {place}, align 8")
        for column in range(even, width):
            for lane in range(LANES):
                part = self._new(f"extractelement {self._type} {columns[column]}, i64 {lane}")
                place = self._new(f"getelementptr double, ptr {base}, i64 {lane * width + column}")
                self._lines.append(f"  store double {part}, ptr {place}, align 8")

    def _shuffled(self, a: str, b: str, lanes: list[int]) -> str:
        chosen = ", ".join(f"i32 {lane}" for lane in lanes)
        return self._new(f"shufflevector {self._type} {a}, {self._type} {b}, <{len(lanes)} x i32> <{chosen}>")

    def _new(self, what: str) -> str:
        self._count += 1
        self._lines.append(f"  %v{self._count} = {what}")
        return f"%v{self._count}"

    def _splat(self, value: float) -> str:
        if value == 0.0:
            return "zeroinitializer"
        at = self.constants.setdefault(float(value), len(self.constants))
        place = self._new(f"getelementptr double, ptr %constants, i64 {at}")
        one = self._new(f"load double, ptr {place}, align 8")
        first = self._new(f"insertelement {self._type} poison, double {one}, i64 0")
        return self._new(f"shufflevector {self._type} {first}, {self._type} poison, <{LANES} x i32> zeroinitializer")

    # -- operations ------------------------------------------------------------------------------------------------

    def _two(self, name: str, a: str, b: str) -> str:
        return self._new(f"{name} {self._type} {a}, {b}")

    def _add(self, a: str, b: str) -> str:
        return self._two("fadd", a, b)

    def _sub(self, a: str, b: str) -> str:
        return self._two("fsub", a, b)

    def _mul(self, a: str, b: str) -> str:
        return self._two("fmul", a, b)

    def _div(self, a: str, b: str) -> str:
        return self._two("fdiv", a, b)

    def _neg(self, a: str) -> str:
        return self._new(f"fneg {self._type} {a}")

    def _call(self, name: str, a: str) -> str:
        return self._new(f"call {self._type} @llvm.{name}.v{LANES}f64({self._type} {a})")

    def _sqrt(self, a: str) -> str:
        return self._call("sqrt", a)

    def _rint(self, a: str) -> str:
        return self._call("rint", a)

    def _abs(self, a: str) -> str:
        return self._call("fabs", a)

    def _chosen(self, which: str, a: str, b: str) -> str:
        than = self._new(f"fcmp {which} {self._type} {a}, {b}")
        return self._new(f"select <{LANES} x i1> {than}, {self._type} {a}, {self._type} {b}")

    def _max(self, a: str, b: str) -> str:
        return self._chosen("ugt", a, b)

    def _min(self, a: str, b: str) -> str:
        if a in self._conditions and b in self._conditions:
            return self._condition(f"and {self._mask} {self._conditions[a]}, {self._conditions[b]}")
        return self._chosen("ult", a, b)

    def _le(self, a: str, b: str) -> str:
        return self._condition(f"fcmp ole {self._type} {a}, {b}")

    def _condition(self, what: str) -> str:
        """Return 1 or 0 for a bit each; where bits alone are asked for, LLVM leaves the numbers out."""
        bits = self._new(what)
        number = self._new(f"uitofp {self._mask} {bits} to {self._type}")
        self._conditions[number] = bits
        return number

    def _hypot(self, a: str, b: str) -> str:
        return self._sqrt(self._add(self._mul(a, a), self._mul(b, b)))

    def _multiplied(self, a: str, b: str, c: str) -> str:
        """Return a b + c."""
        if not self._fused:
            return self._add(self._mul(a, b), c)
        kind = self._type
        return self._new(f"call {kind} @llvm.fma.v{LANES}f64({kind} {a}, {kind} {b}, {kind} {c})")

    def _polynomial(self, coefficients: Sequence[float], x: str) -> str:
        """Return the sum of c_k x^k."""
        *lower, total = (self._splat(coefficient) for coefficient in coefficients)
        for coefficient in reversed(lower):
            total = self._multiplied(total, x, coefficient)
        return total

    def _sin(self, a: str) -> str:
        return self._turn(a)[0]

    def _cos(self, a: str) -> str:
        return self._turn(a)[1]

    def _turn(self, a: str) -> tuple[str, str]:
        """Return sine and cosine: of what is left of an angle after quarter turns, swapped and signed by these."""
        if a in self._turned:
            return self._turned[a]
        shifted = self._multiplied(a, self._splat(2 / np.pi), self._splat(_INTEGER))
        quarters = self._sub(shifted, self._splat(_INTEGER))
        rest = a
        for part in _QUARTER_PARTS:
            rest = self._multiplied(quarters, self._splat(-part), rest)
        square = self._mul(rest, rest)
        sine = self._multiplied(self._mul(rest, square), self._polynomial(_SINE, square), rest)
        cosine = self._multiplied(square, self._polynomial(_COSINE, square), self._splat(1.0))
        count = self._new(f"bitcast {self._type} {shifted} to {self._bits}")
        odd = self._new(f"trunc {self._bits} {count} to {self._mask}")
        after = self._new(f"add {self._bits} {count}, {self._whole(1)}")
        found = []
        for value, other, turns in ((sine, cosine, count), (cosine, sine, after)):
            chosen = self._new(f"select {self._mask} {odd}, {self._type} {other}, {self._type} {value}")
            second = self._new(f"and {self._bits} {turns}, {self._whole(2)}")
            sign = self._new(f"shl {self._bits} {second}, {self._whole(62)}")
            plain = self._new(f"bitcast {self._type} {chosen} to {self._bits}")
            signed = self._new(f"xor {self._bits} {plain}, {sign}")
            found.append(self._new(f"bitcast {self._bits} {signed} to {self._type}"))
        self._turned[a] = found[0], found[1]
        return self._turned[a]

    def _whole(self, value: int) -> str:
        return "<" + ", ".join([f"i64 {value}"] * LANES) + ">"

    def _tan(self, a: str) -> str:
        return self._div(self._sin(a), self._cos(a))

    def _each(self, name: str, *arguments: str) -> str:
        """Return a function of the mathematical library, lane by lane."""
        out = "zeroinitializer"
        for lane in range(LANES):
            values = [self._new(f"extractelement {self._type} {argument}, i64 {lane}") for argument in arguments]
            value = self._new(f"call double @{name}({', '.join(f'double {value}' for value in values)})")
            out = self._new(f"insertelement {self._type} {out}, double {value}, i64 {lane}")
        return out

    def _arctan2(self, a: str, b: str) -> str:
        """Return the angle of (b, a): of the smaller by the larger, then from the axis that is nearer."""
        kind, zero = self._type, self._splat(0.0)
        up, along = self._abs(a), self._abs(b)
        steep = self._new(f"fcmp ogt {kind} {up}, {along}")
        least, most = self._picked(steep, along, up), self._picked(steep, up, along)
        half = self._new(f"fcmp ogt {kind} {least}, {self._mul(most, self._splat(_TANGENT))}")
        # arctan t = pi/4 + arctan((t - 1)/(t + 1))
        over = self._picked(half, self._sub(least, most), least)
        under = self._picked(half, self._add(least, most), most)
        none = self._new(f"fcmp oeq {kind} {most}, {zero}")
        share = self._div(over, self._picked(none, self._splat(1.0), under))
        square = self._mul(share, share)
        angle = self._multiplied(self._mul(share, square), self._polynomial(_ARCTANGENT, square), share)
        angle = self._add(angle, self._picked(half, self._splat(np.pi / 4), zero))
        angle = self._picked(steep, self._sub(self._splat(np.pi / 2), angle), angle)
        behind = self._new(f"fcmp olt {kind} {b}, {zero}")
        angle = self._picked(behind, self._sub(self._splat(np.pi), angle), angle)
        return self._new(f"call {kind} @llvm.copysign.v{LANES}f64({kind} {angle}, {kind} {a})")

    def _picked(self, where: str, a: str, b: str) -> str:
        return self._new(f"select {self._mask} {where}, {self._type} {a}, {self._type} {b}")

    def _arccos(self, a: str) -> str:
        return self._each("acos", a)
