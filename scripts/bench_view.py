"""How long does it take to see a robot? Scenes and motions as self-contained pages, from a pose to the finished HTML.

    python scripts/bench_view.py [--repeat 5]

Targets: one pose in at most 1 s after import, 100 frames in at most 5 s. What is loaded when it is first used (the
viewer's script, readers of meshes) counts in 'first'.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np

import prup_pin
from prup_pin.views.meshcat.view import view

WRENCH = [300, 0, 0, 0, 0, 0]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeat", type=int, default=5, help="times after the first")
    repeat = parser.parse_args().repeat
    three = prup_pin.load("3prup")
    pose = three.pose(z=0.4, theta=0.436, phi=0.262)
    angles = np.linspace(0, 2 * np.pi, 100)
    path = [
        three.pose(z=0.38 + 0.05 * np.sin(2 * a), theta=0.35 * np.cos(a), phi=0.35 * np.sin(a)) for a in angles.tolist()
    ]
    cases = {
        "3prup, one pose under load": (lambda: view(three, pose, WRENCH), 1.0),
        "3prup, path of 100 poses under load": (lambda: view(three, path, WRENCH), 5.0),
        "3prup, load ramp of 60 frames": (lambda: view(three, pose, WRENCH, motion="load"), 5.0),
        "3prup, vibration mode of 49 frames": (lambda: view(three, pose, motion="mode 1"), 5.0),
        "3prup, workspace cloud of 100 poses": (lambda: view(three, workspace=path), 5.0),
    }
    try:
        ur5 = prup_pin.load("ur5", joint_stiffness=1e4)
        cases["ur5 with its meshes, one pose under load"] = (lambda: view(ur5, None, [0, 0, -100, 0, 0, 0]), 1.0)
    except prup_pin.MissingExtraError as error:
        print(error)
    print(f"{'':44s}{'first':>9s}{'median':>9s}{'page':>10s}   target")
    with tempfile.TemporaryDirectory() as folder:
        for name, (make, target) in cases.items():
            times = []
            for index in range(1 + repeat):
                start = time.perf_counter()
                made = make().save(Path(folder) / f"{index}.html")
                times.append(time.perf_counter() - start)
            size = made.stat().st_size / 1e6
            verdict = "met" if times[0] <= target else "missed"
            print(f"{name:44s}{times[0]:7.2f} s{np.median(times[1:]):7.2f} s{size:7.1f} MB   {target:.0f} s {verdict}")
    start = time.perf_counter()
    served = view(three, pose, WRENCH, serve=True)
    print(f"{'server up, scene in it':44s}{time.perf_counter() - start:7.2f} s")
    served.close()


if __name__ == "__main__":
    main()
