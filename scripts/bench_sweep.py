"""How long a pose takes: single calls, sweeps by arrays, lines and machine code, frame programs; one core, one run.

    python scripts/bench_sweep.py [--long]

Every number beside another was measured in turns with it, in the processor's time, so that what else the machine does
falls on both. `--long` streams ten million poses as well.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import resource
import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, process_time

import numpy as np
from _project import ROOT

import prup_pin
from prup_pin import build
from tests.reference import frame_fe

ROBOTS = ROOT / "tests" / "robots"
CASES = {
    "3prup": (prup_pin.load("3prup"), [(0.28, 0.45), (-0.4, 0.4), (-0.4, 0.4)]),
    "six_ups": (
        prup_pin.load(str(ROBOTS / "six_ups" / "six_ups.urdf")),
        [(-0.1, 0.1), (-0.1, 0.1), (0.65, 0.8), (-0.2, 0.2), (-0.2, 0.2), (-0.2, 0.2)],
    ),
    "ur5": (prup_pin.load("ur5", joint_stiffness=1e4), [(-3.0, 3.0)] * 6),
    "five_bar (C)": (
        prup_pin.load(str(ROBOTS / "five_bar" / "five_bar.urdf"), joint_stiffness=1e4),
        [(-0.1, 0.14), (0.3, 0.45)],
    ),
    "three_rrr": (
        build.three_rrr(
            base_radius=0.3,
            platform_radius=0.08,
            arm=0.2,
            rod=0.2,
            motor_stiffness=2e4,
            arm_diameter=0.03,
            rod_diameter=0.02,
        ),
        [(-0.05, 0.05), (-0.05, 0.05), (-0.2, 0.2)],
    ),
}
BOX = {"force": 300.0, "moment": 100.0}
ROUNDS = 15
MANY = 131_072


def in_turns(*jobs: tuple[Callable[[], object], int]) -> list[float]:
    """Return the least processor time of each (job, poses) a pose [s], run in turns."""
    best = [np.inf] * len(jobs)
    for _ in range(ROUNDS):
        for index, (job, poses) in enumerate(jobs):
            began = process_time()
            job()
            best[index] = min(best[index], (process_time() - began) / poses)
    return best


def singly(robot, rows):
    for row in rows:
        if robot.mechanism.tasks:
            pose = robot.pose(**dict(zip(robot.task_coordinates, row.tolist(), strict=True)))
        else:
            pose = robot.pose_from_actuators(row)
        compliance = robot.compliance(pose)
        if robot.mechanism.model.nq > 4:
            _ = compliance.K


def print_speeds() -> None:
    print("C, K and all extremes over the box of wrenches, from coordinates, closing loops included [us a pose]")
    heads = ("single", "arrays", "lines", "compiled", "engine")
    print(f"{'':16s}" + "".join(f"{head:>10s}" for head in heads) + f"{'to write and compile [s]':>28s}")
    for name, (robot, ends) in CASES.items():
        rows = np.random.default_rng(0).uniform(*np.array(ends).T, (MANY, len(ends)))
        names = ["C", "extremes"] if name.startswith("five") else ["C", "K", "extremes"]
        began = perf_counter()
        first = robot.sweep(poses=rows[:8], quantities=names, **BOX, compiled=True)
        ready = perf_counter() - began
        machine = first._engine._machine

        def sweep(count, robot=robot, rows=rows, names=names, **how):
            return robot.sweep(poses=rows[:count], quantities=names, **BOX, **how)

        assert machine is not None
        times = in_turns(
            (lambda robot=robot, rows=rows: singly(robot, rows[:100]), 100),
            (lambda sweep=sweep: sweep(1024), 1024),
            (lambda sweep=sweep: sweep(MANY // 4), MANY // 4),
            (lambda sweep=sweep: sweep(None, compiled=True), MANY),
            (lambda machine=machine, rows=rows[:4096]: machine.run(rows), 4096),
        )
        print(f"{name:16s}" + "".join(f"{1e6 * value:10.2f}" for value in times) + f"{ready:28.1f}")
    print("arrays: few poses; lines: many, the straight lines run by numpy; compiled: all of robot.sweep at 131,072")
    print("poses, its arrays and checks; engine: the machine code alone\n")


def print_peers() -> None:
    robot, ends = CASES["3prup"]
    rows = np.random.default_rng(0).uniform(*np.array(ends).T, (MANY, len(ends)))
    few = [dict(zip(("z", "theta", "phi"), row.tolist(), strict=True)) for row in rows[:20]]
    how = {"quantities": ["C"], "compiled": True}
    print("the 3-PRUP's C beside frame programs on the same job, in turns")
    for name, peer in (
        ("OpenSeesPy, frame model", frame_fe.three_prup_compliance_opensees),
        ("PyNite, dense constraints", frame_fe.three_prup_compliance),
    ):
        try:
            theirs = peer(**few[0])
        except (ImportError, RuntimeError) as error:
            print(f"{name:32s} not installed ({type(error).__name__})")
            continue
        ours = robot.sweep(poses=rows[:1], **how)["C"][0]
        slow, quick = in_turns(
            (lambda peer=peer: [peer(**case) for case in few], len(few)),
            (lambda: robot.sweep(poses=rows, **how), len(rows)),
        )
        print(
            f"{name:32s}{slow * 1e6:10.0f} us   {slow / quick:8.0f} x ours ({quick * 1e6:.2f} us); "
            f"C differs by {np.abs(ours - theirs).max() / np.abs(theirs).max():.1e}"
        )
    print()


def print_streaming(most: int) -> None:
    robot, ends = CASES["3prup"]
    how = {"quantities": ["extremes"], **BOX, "compiled": True}
    robot.sweep(poses=np.mean(ends, axis=1)[None], **how)  # written and compiled once, before the clock starts
    print("streamed to Parquet: extremes, compiled, one process")
    print(f"{'poses':>12s}{'time [s]':>12s}{'us a pose':>12s}{'file [MB]':>12s}{'most memory [MB]':>18s}")
    count = 10_000
    while count <= most:
        side = round(count ** (1 / 3)) + 1
        axes = {
            name: np.linspace(*end, side)
            for name, end in zip(robot.task_coordinates, ends, strict=True)
        }  # fmt: skip
        with TemporaryDirectory() as folder:
            out = Path(folder) / "sweep.parquet"
            began = perf_counter()
            robot.sweep(**axes, **how, out=out)
            took, size = perf_counter() - began, out.stat().st_size / 1e6
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(f"{side**3:12d}{took:12.2f}{took / side**3 * 1e6:12.2f}{size:12.1f}{memory:18.0f}")
        count *= 10


if __name__ == "__main__":
    print_speeds()
    print_peers()
    print_streaming(10_000_000 if "--long" in sys.argv else 1_000_000)
