"""What else could run the straight lines of a sweep: numba, JAX and numpy beside LLVM, on the same poses; one core.

    python scripts/bench_compilers.py [numba] [jax] [ROBOT ...]

Of each, the processor's time to its first answer, compiling included, and a pose from then on (least of some
rounds, in turns) and how far its C is from LLVM's. Needs numba and JAX beside the package's extras. numba reads a
program's text, a pose at a time; JAX reads the same text on columns of poses, and XLA compiles it for the processor.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from time import process_time
from typing import Any

import numpy as np
from bench_sweep import BOX, CASES, in_turns

from prup_pin.kernel import Columns, Pipeline, Program

POSES = 8192
SIGNS = {"add": "+", "sub": "-", "mul": "*", "div": "/", "le": "<="}
CALLS = {"max": "maximum", "min": "minimum", "neg": "negative"}


def text(program: Program) -> list[str]:
    """Return a program as assignments to v0, v1, ..., from a sequence `given`."""
    lines = []
    for index, (name, a, b, value) in enumerate(program.operations):
        if name == "input":
            what = f"given[{int(value)}]"
        elif name == "constant":
            what = repr(value)
        elif name in SIGNS:
            what = f"{'1.0 * ' if name == 'le' else ''}(v{a} {SIGNS[name]} v{b})"
        else:
            what = f"np.{CALLS.get(name, name)}(v{a}{'' if b < 0 else f', v{b}'})"
        lines.append(f"v{index} = {what}")
    return lines


class Numba:
    def __init__(self, program: Program):
        import numba

        outputs = [f"outputs[{row}, n] = v{at}" for row, at in enumerate(program.outputs)]
        body = "\n  ".join(["given = inputs[:, n]", *text(program), *outputs])
        names: dict[str, Any] = {"np": np}
        exec(f"def run(inputs, outputs):\n for n in range(inputs.shape[1]):\n  {body}", names)
        self._run = numba.njit(error_model="numpy", fastmath={"contract"})(names["run"])

    def on(self, inputs: np.ndarray, outputs: np.ndarray) -> Callable[[], object]:
        return partial(self._run, inputs, outputs)


class Jax:
    def __init__(self, program: Program):
        import jax

        jax.config.update("jax_platforms", "cpu")
        jax.config.update("jax_enable_x64", True)
        outputs = ", ".join(f"np.broadcast_to(v{at}, given.shape[1:])" for at in program.outputs)
        names: dict[str, Any] = {"np": jax.numpy}
        exec("def run(given):\n " + "\n ".join([*text(program), f"return np.stack(({outputs},))"]), names)
        self._run = jax.jit(names["run"])

    def on(self, inputs: np.ndarray, outputs: np.ndarray) -> Callable[[], object]:
        return lambda: np.copyto(outputs, np.asarray(self._run(inputs)))


def run_by(way: Any, pipeline: Pipeline) -> Callable[[np.ndarray], np.ndarray]:
    """Return what runs a pipeline by programs of another kind."""
    columns = Columns(pipeline)
    columns._start, columns._final = way(pipeline.start), way(pipeline.final)
    columns._step = pipeline.step and way(pipeline.step)
    return columns.run


WAYS = {"numba": Numba, "jax": Jax}


def main() -> None:
    asked = [name for name in sys.argv[1:] if name in WAYS] or list(WAYS)
    robots = [name for name in CASES if name.split()[0] in sys.argv[1:]] or list(CASES)
    print(f"{'':26s}{'first answer [s]':>18s}{'a pose [us]':>14s}{'x LLVM':>10s}{'C differs by':>14s}")
    for name in robots:
        robot, ends = CASES[name]
        rows = np.random.default_rng(0).uniform(*np.array(ends).T, (POSES, len(ends)))
        names = ["C", "extremes"] if name.startswith("five") else ["C", "K", "extremes"]
        written = robot.sweep(poses=rows[:8], quantities=names, **BOX, compiled=True)._engine.written
        ways = {
            "LLVM": lambda pipeline: Columns(pipeline, compiled=True).run,
            "numpy": lambda pipeline: Columns(pipeline).run,
            **{way: partial(run_by, WAYS[way]) for way in asked},
        }
        firsts, jobs, answers = [], [], []
        for made in ways.values():
            began = process_time()
            job = made(written.pipeline)
            answers.append(job(rows))
            firsts.append(process_time() - began)
            jobs.append((partial(job, rows), POSES))
        sure, times = written.accepted(answers[0][:, -3:]), in_turns(*jobs)
        for way, first, took, answer in zip(ways, firsts, times, answers, strict=True):
            apart = np.abs(answer - answers[0])[sure, :36].max(axis=1) / np.abs(answers[0])[sure, :36].max(axis=1)
            print(
                f"{name:16s}{way:10s}{first:18.1f}{1e6 * took:14.2f}{took / times[0]:10.1f}{apart.max():14.0e}",
                flush=True,
            )


if __name__ == "__main__":
    main()
