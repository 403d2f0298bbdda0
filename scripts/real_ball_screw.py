"""A real ball-screw axis: what a frictionless 95 kg carriage leaves of its force, and what a diagnosis finds.

    python scripts/real_ball_screw.py EMPS.csv [--second OTHER.csv] [--pictures DIR]

EMPS.csv: `time`, `q.carriage` [m], `tau.carriage` [N] of the Electro-Mechanical Positioning System of A. Janot,
M. Gautier and M. Brunot, "Data set and reference models of EMPS", Workshop on Nonlinear System Identification
Benchmarks, 2019.
Prints the share of the force that classical models leave, term by term by least squares, beside what `diagnose` finds.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from prup_pin import load
from prup_pin.diagnosis import diagnose
from prup_pin.dynamics import InMotion, motion_of
from prup_pin.recordings import read_recording
from prup_pin.simulation import simulate

AXIS = Path(__file__).parents[1] / "urdf" / "ball_screw_axis.urdf"


def classical(at: InMotion) -> list[tuple[str, float, str]]:
    """Return what least squares of growing models leave: name, share of the force, values."""
    speed, rate = at.speed("carriage"), at.acceleration("carriage")
    direction = at.direction("carriage")
    forwards, backwards = np.maximum(speed, 0), np.minimum(speed, 0)
    models = (
        ("mass", [rate]),
        ("+ viscous", [rate, speed]),
        ("+ Coulomb", [rate, speed, direction]),
        ("viscous by direction", [rate, forwards, backwards, direction]),
    )
    motion = at.motion
    force = motion.band(motion.efforts, motion.piece)[:, 0]
    good = ~motion.still[:, 0]
    rows = []
    for name, columns in models:
        table = motion.band(np.column_stack(columns), motion.piece)
        x, *_ = np.linalg.lstsq(table[good], force[good], rcond=None)
        left = force - table @ x
        share = float(np.linalg.norm(left[good]) / np.linalg.norm(force[good]))
        rows.append((name, share, ", ".join(f"{value:.4g}" for value in x)))
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("recording", type=Path)
    parser.add_argument("--second", type=Path, help="another run of the same axis, to be predicted")
    parser.add_argument("--pictures", type=Path, help="a folder for ball_screw_axis.png")
    options = parser.parse_args()
    robot, recording = load(AXIS), read_recording(options.recording)
    at = InMotion.of(robot.mechanism, motion_of(recording, robot.mechanism))
    print("least squares, told the terms          unexplained   values")
    for name, share, values in classical(at):
        print(f"  {name:36s} {100 * share:8.2f} %   {values}")
    found = diagnose(robot, recording)
    shares = found.efforts.shares["carriage"]
    print("diagnosis, told nothing")
    print(f"  {'as drawn: 95 kg, no friction':36s} {100 * shares['rigid']:8.2f} %")
    print(f"  {'with its findings, held-out blocks':36s} {100 * shares['heldout']:8.2f} %   {found.verdict}")
    for finding in found.findings:
        print(f"    {finding.physics} at {finding.location}: {finding.statement}")
    if options.second:
        other = read_recording(options.second)
        predicted = simulate(robot, other, found.effects).efforts["carriage"]
        left = other.efforts["carriage"] - predicted
        known = np.isfinite(left)
        share = np.linalg.norm(left[known]) / np.linalg.norm(other.efforts["carriage"][known])
        print(f"  {'second run, predicted, not filtered':36s} {100 * share:8.2f} %")
    if options.pictures:
        from prup_pin.views.drawing.diagnosis_figures import effort_figure

        options.pictures.mkdir(parents=True, exist_ok=True)
        effort_figure(found.efforts).savefig(options.pictures / "ball_screw_axis.png", dpi=100)


if __name__ == "__main__":
    main()
