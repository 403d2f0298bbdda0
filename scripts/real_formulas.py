"""Formulas on a real robot: what is proposed for what its efforts leave unknown, and does another run confirm it?

    python scripts/real_formulas.py ROBOT.urdf FIT.csv HELDOUT.csv [--everywhere] [--out DIR] [--picture PNG]

Prints what `diagnose --propose` proposes from FIT, joint by joint what its model leaves of HELDOUT's effort, with the
formula, with a curve of no law in its place, and with neither, and whether a diagnosis of HELDOUT confirms it. The
picture is of what both recordings ask for at the first one's joint.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.signal import butter, sosfiltfilt

from prup_pin import Robot, load
from prup_pin.diagnosis import Diagnosis, diagnose
from prup_pin.diagnosis.proposal import Proposal, proposed_files
from prup_pin.laws import Effect
from prup_pin.plugins import along
from prup_pin.recordings import Recording, read_recording
from prup_pin.simulation import simulate
from prup_pin.views.drawing.plotting import encoded, page_figure, plain_axes, zero_lines
from prup_pin.views.scene.colours import AFTER

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


def left_of(
    robot: Robot, recording: Recording, effects: Sequence[Effect], band: Mapping[str, float]
) -> dict[str, float]:
    """Return the share of each joint's effort that a model leaves, in per cent; band: by which it was found."""
    predicted = simulate(robot, recording, effects, band=band).efforts
    left = {name: low(recording, measured - predicted[name]) for name, measured in recording.efforts.items()}
    whole = {name: low(recording, measured) for name, measured in recording.efforts.items()}
    return {name: 100 * float(np.linalg.norm(left[name]) / np.linalg.norm(whole[name])) for name in left}


def told(shares: Mapping[str, float]) -> str:
    """Return shares by joint in words."""
    return ", ".join(f"{name} {share:.2f} %" for name, share in shares.items())


def picture(robot: Robot, found: Diagnosis, item: Proposal, logs: dict[str, Recording]) -> Figure:
    """Return what recordings ask for at a formula's joint beyond the model without it, and what the formula says.

    Means of 25 bins of the joint's position, and of the time; friction counts along its direction.
    """
    joint, sliding = item.joint, robot.mechanism.joint(item.joint).slides
    turns = any(term.resists(joint) for term in item.law.terms)
    figure = page_figure(4.2, False, f"{joint}: tau = {item.text}")
    sides = figure.subplots(1, 2, sharey=True)
    for (name, log), colour in zip(logs.items(), (AFTER, "#E07B00"), strict=True):
        plain, whole = (
            simulate(robot, log, effects, band=found.efforts.band).efforts[joint]
            for effects in (found.effects, item.effects)
        )
        q = log.positions[joint]
        speed = sosfiltfilt(
            butter(2, 20.0, fs=1 / np.median(np.diff(log.time)), output="sos"), np.gradient(q, log.time)
        )
        good = np.isfinite(plain) & np.isfinite(whole) & (np.abs(speed) > 0.05 * np.abs(speed).max())
        way = np.sign(speed) if turns else np.ones(len(q))
        for axes, x in zip(sides, (q, log.time), strict=True):
            where = np.digitize(x[good], np.linspace(x[good].min(), x[good].max(), 26)[1:-1])
            seen = np.unique(where)
            means = [
                np.array([values[good][where == each].mean() for each in seen])
                for values in (x, way * (log.efforts[joint] - plain), way * (whole - plain))
            ]
            axes.plot(means[0], means[1], "o", ms=4.5, color=colour, label=f"{name}: asked for")
            axes.plot(means[0], means[2], "-", lw=1.8, color=colour, label=f"{name}: the formula")
    what, unit = "friction" if turns else "effort", robot.mechanism.joint(joint).effort_unit
    for axes, name in zip(sides, (f"position [{'m' if sliding else 'rad'}]", "time [s]"), strict=True):
        zero_lines(axes)
        plain_axes(axes, 8.5, labels=(name, f"{what} beyond the model without it [{unit}]" * (axes is sides[0])))
    sides[1].legend(fontsize=8.5, frameon=False)
    return figure


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("robot", type=Path)
    parser.add_argument("fit", type=Path)
    parser.add_argument("heldout", type=Path)
    parser.add_argument("--everywhere", action="store_true", help="ask at every joint, unknown there or not")
    parser.add_argument("--out", type=Path, default=Path("out/real_formulas"), help="a folder for files of laws")
    parser.add_argument("--picture", type=Path)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    robot, fit, held = load(options.robot), read_recording(options.fit), read_recording(options.heldout)
    found = diagnose(robot, fit, propose=list(fit.efforts) if options.everywhere else True)
    print(found.verdict, *(f"{item.physics} at {item.location}" for item in found.findings), sep="\n  ")
    plain = [effect for effect in found.effects if effect.law.physics != "unknown"]
    for by, effects in (("laws", plain), ("laws and curves", found.effects)):
        print(f"left by {by}: {told(left_of(robot, held, effects, found.efforts.band))}")
    for item, (word, text) in zip(found.proposals, proposed_files(found.proposals, [options.fit]), strict=True):
        print(f"{item.joint}: tau = {item.text}")
        print(f"  left with it: {told(left_of(robot, held, item.effects, found.efforts.band))}")
        print(f"  {100 * item.share:.1f} % of the squares, the curve {100 * item.of_curve:.1f} %; {item.instead}")
        print(*(f"  or {other.text}" for other in item.equals), *item.doubts, sep="\n")
        path = options.out / f"{word}.py"
        path.write_text(text)
        with along(path):
            print("  ", *diagnose(robot, held).judged, flush=True)
    if options.picture and found.proposals:
        logs = {options.fit.stem: fit, options.heldout.stem: held}
        options.picture.write_bytes(encoded(picture(robot, found, found.proposals[0], logs), "png", dpi=110))


if __name__ == "__main__":
    main()
