"""Formulas on a real robot: what is proposed for what its efforts leave unknown, and does another run confirm it?

    python scripts/real_formulas.py ROBOT.urdf FIT.csv HELDOUT.csv [--everywhere] [--out DIR]

Prints what `diagnose --propose` proposes from FIT, joint by joint what its model leaves of HELDOUT's effort, with the
formula, with a curve of no law in its place, and with neither, and whether a diagnosis of HELDOUT confirms it.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.signal import butter, sosfiltfilt

from prup_pin import Robot, load
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.proposal import proposed_files
from prup_pin.laws import Effect
from prup_pin.plugins import along
from prup_pin.recordings import Recording, read_recording
from prup_pin.simulation import simulate

#: Below it [Hz] the rigid robot's efforts are in those that were measured.
CUT = 5.0


def low(recording: Recording, values: np.ndarray) -> np.ndarray:
    """Return efforts (N,) below CUT on an even clock, run by run."""
    parts = []
    for run in range(len(recording.run_names)):
        here = np.isfinite(values) & (recording.run == run)
        time = recording.time[here]
        step = float(np.median(np.diff(time)))
        even = np.interp(np.arange(time[0], time[-1], step), time, values[here])
        parts.append(sosfiltfilt(butter(4, CUT, fs=1 / step, output="sos"), even))
    return np.concatenate(parts)


def left_of(robot: Robot, recording: Recording, joint: str, effects: Sequence[Effect]) -> float:
    """Return the share of a joint's effort that a model leaves, in per cent."""
    measured = recording.efforts[joint]
    left = measured - simulate(robot, recording, effects).efforts[joint]
    return 100 * float(np.linalg.norm(low(recording, left)) / np.linalg.norm(low(recording, measured)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("robot", type=Path)
    parser.add_argument("fit", type=Path)
    parser.add_argument("heldout", type=Path)
    parser.add_argument("--everywhere", action="store_true", help="ask at every joint, unknown there or not")
    parser.add_argument("--out", type=Path, default=Path("out/real_formulas"), help="a folder for files of laws")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    robot, fit, held = load(options.robot), read_recording(options.fit), read_recording(options.heldout)
    found = diagnose(robot, fit, propose=list(fit.efforts) if options.everywhere else True)
    print(found.verdict, *(f"{item.physics} at {item.location}" for item in found.findings), sep="\n  ")
    plain = [effect for effect in found.effects if effect.law.physics != "unknown"]
    for joint in fit.efforts:
        shares = [left_of(robot, held, joint, effects) for effects in (plain, found.effects)]
        print(f"{joint}: left {shares[0]:.2f} % by laws, {shares[1]:.2f} % with curves")
    for item, (word, text) in zip(found.proposals, proposed_files(found.proposals, [options.fit]), strict=True):
        print(f"{item.joint}: tau = {item.text}; left {left_of(robot, held, item.joint, item.effects):.2f} %")
        print(*(f"  or {other.text}" for other in item.equals), *item.doubts, item.instead, sep="\n")
        path = options.out / f"{word}.py"
        path.write_text(text)
        with along(path):
            print(*diagnose(robot, held).judged, sep="\n")


if __name__ == "__main__":
    main()
