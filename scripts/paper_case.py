"""The source paper's sign error, found from a recording alone.

    python scripts/paper_case.py [--out docs/pictures] [--seed 5] [--force 40]

A correct 3-PRUP (the independent simulator of tests/reference/concealed, sensor noise included) is recorded; the robot
file's variant `as_published`, which carries the printed sign of Eq. (90), is compared with it. Prints the verdict and
draws paper_case.png: the residual before and after, and what the printed equation leaves out at a rod's tip.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np
from _project import ROOT

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.recordings import read_recording
from prup_pin.views.drawing.plotting import plain_axes, sheet
from prup_pin.views.scene.colours import AFTER, BEFORE, FAINT, INK
from tests.reference.concealed.draw import draw, write


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "pictures")
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--force", type=float, default=40.0, help="typical force of the bench test [N]")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        write(draw(options.seed, [], level=options.force), Path(folder), Path(folder), "correct")
        recording = read_recording(Path(folder) / "correct.csv")
    printed = prup_pin.load("3prup_as_published")
    found = diagnose(printed, recording, tell=lambda stage, share: None)
    print(f"verdict: {found.verdict}")
    print(f"residual: {found.before['fit']:.2f} x noise before, {found.after['heldout']:.2f} x noise after (held out)")
    for finding in found.findings:
        print(f"- {finding.physics} at {finding.location}: {finding.statement}")
        print(f"  places: {', '.join(finding.candidates)}")
        for name, value in finding.parameters.items():
            print(f"  {name} = {value.value:.4f} ({value.interval[0]:.4f} to {value.interval[1]:.4f})")
    options.out.mkdir(parents=True, exist_ok=True)
    path = options.out / "paper_case.png"
    picture(printed, found, path)
    print(f"written: {path}")


def picture(printed, found, path: Path) -> None:
    """Draw residuals before and after, and a rod's bending by the printed and by the correct equation."""
    figure = sheet(11, 4.6)
    left, right = figure.add_axes((0.075, 0.13, 0.4, 0.66)), figure.add_axes((0.575, 0.13, 0.4, 0.66))
    for residual, colour, label in (
        (found.residual_before, BEFORE, "printed sign"),
        (found.residual_after, AFTER, "sign corrected"),
    ):
        left.plot(1e6 * np.linalg.norm(residual[:, :3], axis=1), ".", color=colour, ms=3.2, label=label)
    noise = 1e6 * found.noise.position * np.sqrt(3)
    left.axhline(noise, color=FAINT, lw=1.0, ls=(0, (4, 3)))
    left.text(1.0, noise, " noise", color=FAINT, fontsize=9, va="center", transform=left.get_yaxis_transform())
    left.set_yscale("log")
    plain_axes(left, 9, labels=("sample", "measured less simulated position [µm]"))
    equilibria = found.final.equilibria
    loads = equilibria.evaluation.loads[:, equilibria.chain.structure.layout.index["leg1/linear_rod"]]
    correct = prup_pin.load("3prup")
    pose = correct.home
    force = np.linspace(loads[:, 1].min(), loads[:, 1].max(), 50)
    offset = 0.1  # the tip's moment is d f_y, Eq. (89)
    for name, robot, colour in (("printed sign", printed, BEFORE), ("correct sign", correct, AFTER)):
        compliance = robot.compliance(robot.pose(**dict(pose.coordinates)))
        matrix = compliance.module_compliances["leg1/linear_rod"]
        moved = [(matrix @ np.array([0, f, 0, -offset * f, 0, 0]))[1] for f in force]
        right.plot(force, 1e6 * np.array(moved), color=colour, lw=2.2, label=name)
    plain_axes(right, 9, labels=("$f_y$ at the tip of rod 1 [N]", "deflection of the tip along y [µm]"))
    for axes, title in ((left, "A correct robot against the model"), (right, "A rod's bending, Eq. (90)")):
        axes.set_title(title, fontsize=11, loc="left", color=INK, pad=10)
        axes.legend(frameon=False, fontsize=9.5, markerscale=2.5, handlelength=1.2)
    figure.text(0.075, 0.93, "The sign that the paper misprints", fontsize=14, weight="bold", va="center")
    figure.savefig(path)


if __name__ == "__main__":
    main()
