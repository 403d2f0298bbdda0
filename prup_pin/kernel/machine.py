"""Pipelines as machine code, by LLVM (extra: compiled): eight poses in one go.

LLVM takes the straight line as it is; numba, which stands on the same llvmlite, reads it from Python, and takes about
ten times as long. Sums and products are rounded one by one as IEEE 754 says, and sine and cosine are polynomials, so
that the width of a processor's registers changes no bit; arctan2 and arccos are the C library's.
"""

from __future__ import annotations

import ctypes
from contextlib import suppress
from typing import Any

import numpy as np

from ..errors import imported
from ..spatial import Array
from .program import LONG, SHORT, STEPS, Pipeline, Program

__all__ = ["LANES", "Machine"]

#: Poses that are computed side by side.
LANES = 8
#: Parts of pi that add up to it, the first two short, so that their multiples are exact.
_PI_PARTS = (3.1415926218032837, 3.1786509424591713e-08, 1.2246467991473532e-16)
#: sin r = r (1 - r^2/3! + ...): with these terms exact to rounding within a quarter turn either way.
_SINE_TERMS = 11


class Machine:
    """A pipeline in machine code. It pickles as that and is compiled anew."""

    def __init__(self, pipeline: Pipeline):
        self.pipeline = pipeline
        llvm = imported("llvmlite.binding", "compiled")
        _initialise(llvm)
        target = llvm.Target.from_default_triple().create_target_machine(
            cpu=llvm.get_host_cpu_name(), features=llvm.get_host_cpu_features().flatten(), opt=2
        )
        module = llvm.parse_assembly(_Writer().text(pipeline))
        module.verify()
        self._engine = llvm.create_mcjit_compiler(module, target)
        self._engine.finalize_object()
        address = self._engine.get_function_address("run")
        self._run = ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p)(address)

    def __reduce__(self):
        return Machine, (self.pipeline,)

    def run(self, inputs: Array) -> Array:
        """Return outputs, failure and way (n, m + 2) of coordinates (n, t)."""
        count, width = len(inputs), len(self.pipeline.final.outputs) + 2
        whole = count // LANES
        out = np.empty((count, width))
        given = np.ascontiguousarray(inputs, float)
        self._run(whole, given.ctypes.data, out.ctypes.data)
        if whole * LANES < count:
            rest = np.repeat(given[-1:], LANES, axis=0)
            rest[: count - whole * LANES] = given[whole * LANES :]
            last = np.empty((LANES, width))
            self._run(1, rest.ctypes.data, last.ctypes.data)
            out[whole * LANES :] = last[: count - whole * LANES]
        return out


def _initialise(llvm: Any) -> None:
    # Before llvmlite 0.45 the library had to be initialised by hand; since then asking for it is an error.
    with suppress(RuntimeError):
        llvm.initialize()
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()


class _Writer:
    """LLVM's assembly of one pipeline."""

    def __init__(self) -> None:
        self._lines: list[str] = []
        self._count = 0
        self._type = f"<{LANES} x double>"
        self._mask = f"<{LANES} x i1>"

    def text(self, pipeline: Pipeline) -> str:
        """Return the module: run(blocks, inputs, outputs) over blocks of LANES poses, row after row."""
        size, width = len(pipeline.start.outputs), len(pipeline.final.outputs) + 2
        inputs = pipeline.start.inputs
        x = [self._gathered("%from", inputs, column) for column in range(inputs)]
        y = self._emitted(pipeline.start, x)
        way = failed = self._splat(0.0)
        if pipeline.step is not None:
            y, failed, way = self._stepped(pipeline.step, y, x)
        outputs = [*self._emitted(pipeline.final, [*y, *x]), failed, way]
        assert len(outputs) == width
        assert len(y) == size
        for column, value in enumerate(outputs):
            self._scattered("%to", width, column, value)
        body = "\n".join(self._lines)
        functions = "\n".join(
            f"declare {self._type} @llvm.{name}.v{LANES}f64({self._type})" for name in ("sqrt", "rint", "fabs")
        )
        return f"""
{functions}
declare i1 @llvm.vector.reduce.or.v{LANES}i1({self._mask})
declare double @atan2(double, double)
declare double @acos(double)
define void @run(i64 %blocks, ptr %inputs, ptr %outputs) {{
entry:
  %some = icmp sgt i64 %blocks, 0
  br i1 %some, label %loop, label %end
loop:
  %block = phi i64 [ 0, %entry ], [ %next, %done ]
  %from_at = mul i64 %block, {LANES * inputs}
  %from = getelementptr double, ptr %inputs, i64 %from_at
  %to_at = mul i64 %block, {LANES * width}
  %to = getelementptr double, ptr %outputs, i64 %to_at
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
        names: list[str] = []
        for operation in program.operations:
            if operation.name == "constant":
                names.append(self._splat(operation.value))
            elif operation.name == "input":
                names.append(given[int(operation.value)])
            elif operation.b < 0:
                names.append(getattr(self, f"_{operation.name}")(names[operation.a]))
            else:
                names.append(getattr(self, f"_{operation.name}")(names[operation.a], names[operation.b]))
        return [names[at] for at in program.outputs]

    def _stepped(self, step: Program, start: list[str], x: list[str]) -> tuple[list[str], str, str]:
        """Write the loop of Newton's steps, as `Pipeline.run` has it; return solution, failure and way."""
        kind, size = self._type, len(start)
        self._lines += ["  br label %begin", "begin:", "  br label %newton", "newton:"]
        y = [f"%y{index}" for index in range(size)]
        for name, value in zip(y, start, strict=True):
            self._lines.append(f"  {name} = phi {kind} [ {value}, %begin ], [ {name}n, %newton ]")
        zero, one = self._splat(0.0), self._splat(1.0)
        self._lines += [
            f"  %way = phi {kind} [ {zero}, %begin ], [ %way_n, %newton ]",
            f"  %failed = phi {kind} [ {one}, %begin ], [ %failed_n, %newton ]",
            f"  %busy = phi {self._mask} [ <{', '.join(['i1 1'] * LANES)}>, %begin ], [ %busy_n, %newton ]",
            "  %turn = phi i64 [ 1, %begin ], [ %turn_n, %newton ]",
        ]
        steps = self._emitted(step, [*y, *x])
        squared = self._mul(steps[0], steps[0])
        for part in steps[1:]:
            squared = self._add(squared, self._mul(part, part))
        near = self._new(f"fcmp ole {kind} {squared}, {self._splat(LONG)}")
        moving = self._new(f"and {self._mask} %busy, {near}")
        for name, part in zip(y, steps, strict=True):
            moved = self._sub(name, part)
            self._lines.append(f"  {name}n = select {self._mask} {moving}, {kind} {moved}, {kind} {name}")
        longer = self._add("%way", self._sqrt(squared))
        short = self._new(f"fcmp ole {kind} {squared}, {self._splat(SHORT)}")
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

    def _scattered(self, base: str, width: int, column: int, value: str) -> None:
        """Store one column of LANES rows."""
        for lane in range(LANES):
            part = self._new(f"extractelement {self._type} {value}, i64 {lane}")
            place = self._new(f"getelementptr double, ptr {base}, i64 {lane * width + column}")
            self._lines.append(f"  store double {part}, ptr {place}, align 8")

    def _new(self, what: str) -> str:
        self._count += 1
        self._lines.append(f"  %v{self._count} = {what}")
        return f"%v{self._count}"

    def _splat(self, value: float) -> str:
        bits = np.array(value).view(np.uint64)
        return "<" + ", ".join([f"double 0x{int(bits):016X}"] * LANES) + ">"

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
        return self._chosen("ult", a, b)

    def _le(self, a: str, b: str) -> str:
        than = self._new(f"fcmp ole {self._type} {a}, {b}")
        return self._new(f"uitofp {self._mask} {than} to {self._type}")

    def _hypot(self, a: str, b: str) -> str:
        return self._sqrt(self._add(self._mul(a, a), self._mul(b, b)))

    def _sin(self, a: str) -> str:
        turns = self._rint(self._mul(a, self._splat(1 / np.pi)))
        return self._sine_from(a, turns, turns)

    def _cos(self, a: str) -> str:
        # cos x = sin(x + pi/2): multiples of pi and a half are taken off, and one half turn is counted on.
        turns = self._rint(self._sub(self._mul(a, self._splat(1 / np.pi)), self._splat(0.5)))
        return self._sine_from(a, self._add(turns, self._splat(0.5)), self._add(turns, self._splat(1.0)))

    def _sine_from(self, a: str, taken: str, turns: str) -> str:
        """Return (-1)^turns sin(a - taken pi)."""
        rest = a
        for part in _PI_PARTS:
            rest = self._sub(rest, self._mul(taken, self._splat(part)))
        square = self._mul(rest, rest)
        coefficients = [1.0]
        for term in range(1, _SINE_TERMS):
            coefficients.append(-coefficients[-1] / ((2 * term) * (2 * term + 1)))
        total = self._splat(coefficients[-1])
        for coefficient in coefficients[-2:0:-1]:
            total = self._add(self._mul(total, square), self._splat(coefficient))
        sine = self._add(rest, self._mul(rest, self._mul(square, total)))
        half = self._mul(turns, self._splat(0.5))
        odd = self._abs(self._sub(half, self._rint(half)))  # 0 of even, 1/2 of odd numbers
        return self._mul(sine, self._sub(self._splat(1.0), self._mul(odd, self._splat(4.0))))

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
        return self._each("atan2", a, b)

    def _arccos(self, a: str) -> str:
        return self._each("acos", a)
