"""Where does the time of a calibration and of a diagnosis go? 400 samples of the 3-PRUP, everything a little off.

    python scripts/bench_diagnosis.py [--seed 3] [--effect stiffness_changed] [--exact]

A concealed device is drawn (tests/reference/concealed) with tolerances of some hundred parameters and one effect, and
calibrated and diagnosed as a user would. Seconds of the processor, one core; the counts depend on the recording alone.
`--exact`: the robot file is taken at its word instead. The peer is what calibration costs by finite differences of the
same simulation: one simulation a parameter and step, timed here too.
"""

from __future__ import annotations

import os

for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_variable] = "1"

import argparse
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from _project import ROOT

import prup_pin
from prup_pin.diagnosis import diagnose, search
from prup_pin.diagnosis.calibration import calibrated
from prup_pin.diagnosis.problem import Problem
from prup_pin.recordings import read_recording
from prup_pin.simulation import Simulator
from tests.reference.concealed.scattered import draw_scattered, write

CALIBRATE_TARGET, DIAGNOSE_TARGET = 20.0, 20.0  # s

#: What is timed: a text, and where the function is found. One stands inside another where the text is indented.
PARTS: tuple[tuple[str, Any, str], ...] = (
    ("laws one by one, to first order", search, "screen"),
    ("rivals of every law that is in", search, "alternatives_to"),
    ("fits through the whole simulation", Problem, "refine"),
    ("  the change by every tolerance anew", Problem, "relinearised"),
    ("simulations, wherever asked for", Simulator, "run_setup"),
)


class Clock:
    """How often functions were called and what they took, seconds of the processor."""

    def __init__(self) -> None:
        self.spent: dict[str, list[float]] = {}

    def wrapped(self, text: str, function: Callable) -> Callable:
        def timed(*arguments, **named):
            begun = time.process_time()
            try:
                return function(*arguments, **named)
            finally:
                self.spent.setdefault(text, []).append(time.process_time() - begun)

        return timed

    def table(self, whole: float) -> None:
        for text, _, _ in PARTS:
            times = self.spent.get(text, [])
            print(f"  {text:46s}{len(times):6d} x{sum(times):9.2f} s{100 * sum(times) / whole:7.0f} %")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=3, help="which device")
    parser.add_argument("--effect", default="stiffness_changed", help="what is wrong with it; 'none': nothing")
    parser.add_argument("--exact", action="store_true", help="declare no tolerances")
    arguments = parser.parse_args()

    effects = [] if arguments.effect == "none" else [arguments.effect]
    with tempfile.TemporaryDirectory() as folder:
        out, sealed = Path(folder) / "out", Path(folder) / "sealed"
        device = draw_scattered(seed=arguments.seed, robot="3prup", effects=effects, misjudged=False, sensors=1.0)
        write(device, out, sealed, "device", str(ROOT / "urdf" / "3prup.urdf"))
        recording = read_recording(out / "device.csv")
    robot = prup_pin.load("3prup")
    if arguments.exact:
        recording = replace(recording, tolerances=type(recording.tolerances)())
    else:
        begun = time.process_time()
        found = calibrated(robot, recording)
        spent = time.process_time() - begun
        print(
            f"calibrate: {spent:.1f} s (target {CALIBRATE_TARGET:.0f} s), {len(recording)} samples, "
            f"{len(found.parameters)} parameters, {found.nominal:.4g} -> {found.calibrated:.4g} times the noise"
        )
    clock, kept = Clock(), [(owner, name, getattr(owner, name)) for _, owner, name in PARTS]
    for (text, owner, name), (_, _, function) in zip(PARTS, kept, strict=True):
        setattr(owner, name, clock.wrapped(text, function))
    begun = time.process_time()
    diagnosis = diagnose(robot, recording)
    whole = time.process_time() - begun
    for owner, name, function in kept:
        setattr(owner, name, function)
    named = ", ".join(f"{finding.physics} at {finding.location}" for finding in diagnosis.findings) or "nothing"
    print(
        f"diagnose: {whole:.1f} s (target {DIAGNOSE_TARGET:.0f} s): {named}; truth: {', '.join(effects) or 'nothing'}"
    )
    clock.table(whole)
    simulations = clock.spent["simulations, wherever asked for"]
    each = sum(simulations) / len(simulations)
    count = len(diagnosis.calibration)
    if count:
        print(
            f"by finite differences one step of calibration would take {count} simulations of {each:.2f} s: "
            f"{count * each:.0f} s; here {clock.spent[PARTS[3][0]][0]:.1f} s"
        )


if __name__ == "__main__":
    main()
