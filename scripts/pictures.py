"""Makes the pictures of the README and the documentation in docs/pictures/; run by pictures.sh.

Scenes are rendered by a headless Chromium, drawings by matplotlib. Names as arguments make only those.
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from textwrap import fill

import architecture
import effort_spectra as spectra
import numpy as np
import render
from _project import ROOT

import prup_pin
from prup_pin.robot import random_poses
from prup_pin.views.meshcat.view import View, view

OUT = ROOT / "docs" / "pictures"
LARGEST = 300_000  # bytes
SIDE_LOAD = {"fx": 300}
BOX = {"z": (0.25, 0.5), "theta": (-0.5, 0.5), "phi": (-0.5, 0.5)}


def three_prup():
    robot = prup_pin.load("3prup")
    return robot, robot.pose(z=0.4, theta=np.radians(25), phi=np.radians(15))


def side_load() -> View:
    """The 3-PRUP under a side load: what bends, how far, and who is to blame."""
    robot, pose = three_prup()
    return view(robot, pose, SIDE_LOAD)


def robot_alone() -> View:
    """The 3-PRUP at home, with its own colours."""
    return view(three_prup()[0])


def ur5() -> View:
    """An arm with its own meshes and springs in its joints."""
    robot = prup_pin.load("ur5", joint_stiffness=1e4)
    at = dict(zip(robot.task_coordinates, (0.4, -1.2, 1.4, -1.7, -1.57, 0.3), strict=True))
    return view(robot, at, {"fz": -100})


def vibration() -> View:
    """The lowest vibration mode, at its turning point."""
    robot, pose = three_prup()
    return view(robot, pose, motion="mode 1")


def workspace() -> View:
    """The largest compliance over the workspace."""
    robot, _ = three_prup()
    return view(robot, workspace=random_poses(robot, BOX, 800, seed=2))


#: Picture, what it shows, and the moment of a motion [s].
SCENES = {
    "view": (side_load, None),
    "view_robot": (robot_alone, None),
    "view_ur5": (ur5, None),
    "view_vibration": (vibration, 0.5),
    "view_workspace": (workspace, None),
}


def drawings() -> None:
    """Draw what `prup-pin stiffness --pictures` writes."""
    from prup_pin.views.drawing.figures import pose_figure, shares_figure

    robot, pose = three_prup()
    compliance = robot.compliance(pose)
    load = np.array([300.0, 0, 0, 0, 0, 0])
    pose_figure(robot, pose, compliance, load).savefig(OUT / "pose.png")
    shares_figure(compliance, load).savefig(OUT / "shares.png")


def diagnosis() -> None:
    """Draw what a diagnosis finds in the recording that ships: play in one drive, its place, its local curve."""
    from prup_pin.diagnosis import diagnose
    from prup_pin.recordings import read_recording
    from prup_pin.views.drawing.diagnosis_figures import draw_response, place_figure

    robot, _ = three_prup()
    found = diagnose(robot, read_recording(ROOT / "examples" / "bench.csv"))
    figure, finding = place_figure(robot, found), found.findings[0]
    axes = figure.add_axes((0.735, 0.4, 0.245, 0.28))
    draw_response(axes, finding.recovered, finding.physics, 8.0)
    handles, labels = axes.get_legend_handles_labels()
    labels = [fill(label, 38) for label in labels]
    figure.legend(
        handles, labels, frameon=False, fontsize=9, loc="upper left", bbox_to_anchor=(0.69, 0.31), handlelength=2
    )
    figure.savefig(OUT / "diagnosis.png")


def effort_spectra() -> None:
    """Draw spectra of a joint's efforts: an arm whose gears yield and whose motors vibrate, beside its quiet twin."""
    from prup_pin.diagnosis import diagnose
    from prup_pin.recordings import read_recording
    from prup_pin.simulation.moving_efforts import efforts_in_motion
    from tests.reference.concealed.efforts import draw_motion
    from tests.reference.concealed.elastic import KINDS, ElasticArm, Ripple, draw_elastic, write

    drawn, kind, lasting = draw_elastic(2, "ur5", "everywhere", 20.0), KINDS["ur5"], 40.0
    arm, log = drawn["arm"], drawn["log"]
    motion = draw_motion(np.random.default_rng(1), kind.chain(), kind, lasting, 0)
    # the same motion once more with perfect sensors, and motors that do not vibrate
    quiet = ElasticArm(arm.links, arm.drives, Ripple(0 * arm.ripple.size))
    perfect = replace(log, position=0.0, counts=None, velocity=None, jitter=0.0)
    robot = prup_pin.load(kind.called)
    with tempfile.TemporaryDirectory() as folder:
        recordings = []
        for seen, by in ((arm, log), (quiet, perfect)):
            rng = np.random.default_rng(2)
            logged, _ = by.record(rng, seen.run(motion, lasting, 1), seen.ripple, lasting)
            write({**drawn, "fit": logged}, Path(folder), Path(folder) / "sealed", "log")
            recordings.append(read_recording(Path(folder) / "log.csv"))
    found = diagnose(robot, recordings[0]).efforts
    joint = "elbow_joint"
    measured = recordings[0].efforts[joint]
    predicted, smooth = (efforts_in_motion(robot, each, found.effects)[0][joint] for each in recordings)
    known = np.isfinite(predicted) & np.isfinite(smooth)
    efforts = {
        "measured": measured,
        "predicted": predicted,
        "of the motion": predicted - smooth,
        "left": measured - predicted,
    }
    figure = spectra.effort_spectra_figure(
        joint, log.rate, {key: values[known] for key, values in efforts.items()}, found.band[joint], 100.0
    )
    figure.savefig(OUT / "effort_spectra.png")


def explorer() -> None:
    """Draw the explorer, as it opens under a load."""
    from PIL import Image

    from prup_pin.views.meshcat.explorer import Explorer
    from tests.views.chromium import Browser  # the page talks with its server, which takes real time

    robot, pose = three_prup()
    explored = Explorer(robot, pose, SIDE_LOAD)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        browser = Browser(folder)
        try:
            size = {"width": 1200, "height": 860, "deviceScaleFactor": 1, "mobile": False}
            browser.call("Emulation.setDeviceMetricsOverride", **size)
            browser.open(explored.serve())
            Image.fromarray(browser.picture().astype("uint8")).save(OUT / "explorer.png", optimize=True)
        finally:
            browser.close()
            explored.close()


def main(wanted: list[str]) -> None:
    OUT.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        for name, (make, moment) in SCENES.items():
            if wanted and name not in wanted:
                continue
            page = make().save(Path(folder) / f"{name}.html")
            render.render(str(page) + (f"#t={moment}" if moment else ""), OUT / f"{name}.png", (1200, 750))
    if not wanted or {"pose", "shares"} & set(wanted):
        drawings()
    if not wanted or "explorer" in wanted:
        explorer()
    if not wanted or "diagnosis" in wanted:
        diagnosis()
    if not wanted or "effort_spectra" in wanted:
        effort_spectra()
    if not wanted or "architecture" in wanted:
        architecture.draw()
    for path in sorted(OUT.glob("*.png")):
        size = path.stat().st_size
        print(f"{path.relative_to(ROOT)}  {size / 1000:.0f} kB{'  TOO LARGE' if size > LARGEST else ''}")
        if size > LARGEST:
            raise SystemExit(1)


if __name__ == "__main__":
    main(sys.argv[1:])
