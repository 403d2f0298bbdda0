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
    """Draw residuals before and after, and a rod's turn about x by the printed and by the correct equation."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.8), constrained_layout=True)
    for residual, colour, label in (
        (found.residual_before, "#c0504d", "as printed"),
        (found.residual_after, "#2f6db3", "term corrected"),
    ):
        left.plot(1e6 * np.linalg.norm(residual[:, :3], axis=1), color=colour, linewidth=1, label=label)
    left.set(xlabel="sample", ylabel="measured less simulated position, um", title="A correct robot against the model")
    left.set_yscale("log")
    left.legend(frameon=False)
    loads = found.final.equilibria.evaluation.loads[:, found.final.equilibria.chain.names.index("leg1/linear_rod")]
    correct = prup_pin.load("3prup")
    pose = correct.home
    matrices = {}
    for name, robot in (("printed", printed), ("correct", correct)):
        compliance = robot.compliance(robot.pose(**dict(pose.coordinates)))
        matrices[name] = compliance.module_compliances["leg1/linear_rod"]
    force = np.linspace(loads[:, 1].min(), loads[:, 1].max(), 50)
    offset = 0.1  # the tip's moment is d f_y, Eq. (89)
    for name, colour in (("printed", "#c0504d"), ("correct", "#2f6db3")):
        turn = [matrices[name] @ np.array([0, f, 0, -offset * f, 0, 0]) for f in force]
        right.plot(force, 1e6 * np.array(turn)[:, 1], color=colour, label=f"{name} sign")
    right.set(xlabel="f_y at the tip of rod 1, N", ylabel="tip deflection along y, um")
    right.set_title("Bending about x, Eq. (90)")
    right.legend(frameon=False)
    figure.savefig(path, dpi=130)


if __name__ == "__main__":
    main()
