"""Programs as machine code, by LLVM (extra: compiled): eight poses in one go.

LLVM takes the straight line as it is; numba, which stands on the same llvmlite, reads it from Python, and takes many
times as long. LLVM decides which product is rounded together with the sum that takes it, the same in every process of
one machine; what it has no instruction for is the C library's.
"""

from __future__ import annotations

import ctypes
import struct
from collections.abc import Callable
from contextlib import suppress
from functools import partial

from ..errors import imported
from ..spatial import Array
from .program import Program

#: Poses that are computed side by side.
LANES = 8
_TYPE, _MASK = f"<{LANES} x double>", f"<{LANES} x i1>"

#: Instructions, and functions of LLVM and of the C library, by the operation.
_INSTRUCTIONS = {
    "add": "fadd contract",
    "sub": "fsub contract",
    "mul": "fmul contract",
    "div": "fdiv",
    "neg": "fneg",
}
_INTRINSICS = {"sqrt": "sqrt", "rint": "rint", "abs": "fabs", "sin": "sin", "cos": "cos"}
_LIBRARY = {"tan": "tan", "arccos": "acos", "arctan2": "atan2", "hypot": "hypot"}
_CHOICES = {"max": "ugt", "min": "ult"}


class MachineCode:
    """A program in machine code."""

    def __init__(self, program: Program):
        llvm = imported("llvmlite.binding", "compiled")
        # Before llvmlite 0.45 the library had to be initialised by hand; since then asking for it is an error.
        with suppress(RuntimeError):
            llvm.initialize()
        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        target = llvm.Target.from_default_triple().create_target_machine(
            cpu=llvm.get_host_cpu_name(), features=llvm.get_host_cpu_features().flatten(), opt=2
        )
        module = llvm.parse_assembly(_assembly(program))
        module.verify()
        self._engine = llvm.create_mcjit_compiler(module, target)
        self._engine.finalize_object()
        address = self._engine.get_function_address("run")
        self._run = ctypes.CFUNCTYPE(None, ctypes.c_int64, *2 * [ctypes.c_void_p])(address)

    def on(self, inputs: Array, outputs: Array) -> Callable[[], None]:
        """Return what computes contiguous rows of outputs (m, n) of those of inputs (k, n), n a multiple of LANES."""
        return partial(self._run, inputs.shape[1], inputs.ctypes.data, outputs.ctypes.data)


class _Lines:
    """LLVM's assembly as it is written down."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def new(self, what: str) -> str:
        self.lines.append(f"  %v{len(self.lines)} = {what}")
        return f"%v{len(self.lines) - 1}"

    def place(self, rows: str, row: int) -> str:
        """Return where the poses at hand stand in a row."""
        before = self.new(f"mul i64 %poses, {row}")
        return self.new(f"getelementptr double, ptr {rows}, i64 {self.new(f'add i64 {before}, %pose')}")

    def each(self, name: str, given: list[str]) -> str:
        """Return a function of the C library, lane by lane."""
        out = "poison"
        for lane in range(LANES):
            numbers = [self.new(f"extractelement {_TYPE} {value}, i64 {lane}") for value in given]
            number = self.new(f"call double @{name}({', '.join(f'double {each}' for each in numbers)})")
            out = self.new(f"insertelement {_TYPE} {out}, double {number}, i64 {lane}")
        return out

    def operation(self, name: str, given: list[str]) -> str:
        both = f"{_TYPE} {', '.join(given)}"
        if name in _INSTRUCTIONS:
            return self.new(f"{_INSTRUCTIONS[name]} {both}")
        if name in _INTRINSICS:
            return self.new(f"call {_TYPE} @llvm.{_INTRINSICS[name]}.v{LANES}f64({both})")
        if name in _LIBRARY:
            return self.each(_LIBRARY[name], given)
        if name == "le":
            return self.new(f"uitofp {_MASK} {self.new(f'fcmp ole {both}')} to {_TYPE}")
        which = self.new(f"fcmp {_CHOICES[name]} {both}")
        return self.new(f"select {_MASK} {which}, {_TYPE} {given[0]}, {_TYPE} {given[1]}")


def _assembly(program: Program) -> str:
    """Return the module: run(poses, rows of inputs, rows of outputs)."""
    out = _Lines()
    names: list[str] = []
    for name, a, b, value in program.operations:
        if name == "constant":
            bits = struct.unpack("<Q", struct.pack("<d", value))[0]
            names.append(f"<{', '.join(LANES * [f'double 0x{bits:016X}'])}>")
        elif name == "input":
            names.append(out.new(f"load {_TYPE}, ptr {out.place('%inputs', int(value))}, align 8"))
        else:
            names.append(out.operation(name, [names[at] for at in (a, b) if at >= 0]))
    for row, at in enumerate(program.outputs):
        out.lines.append(f"  store {_TYPE} {names[at]}, ptr {out.place('%outputs', row)}, align 8")
    declared = [f"declare {_TYPE} @llvm.{name}.v{LANES}f64({_TYPE})" for name in _INTRINSICS.values()]
    for name, function in _LIBRARY.items():
        numbers = "double, double" if name in ("arctan2", "hypot") else "double"
        declared.append(f"declare double @{function}({numbers})")
    head, body = "\n".join(declared), "\n".join(out.lines)
    return f"""{head}
define void @run(i64 %poses, ptr noalias %inputs, ptr noalias %outputs) {{
entry:
  br label %loop
loop:
  %pose = phi i64 [ 0, %entry ], [ %next, %loop ]
{body}
  %next = add i64 %pose, {LANES}
  %more = icmp slt i64 %next, %poses
  br i1 %more, label %loop, label %end
end:
  ret void
}}
"""
