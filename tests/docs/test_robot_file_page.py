"""The page on robot files: the arm that it shows whole can be loaded, and is as stiff as gears and tubes in a row."""

import numpy as np
import pytest

import prup_pin

from .carried_out import ROOT

TEXT = (ROOT / "docs" / "robot_file.md").read_text(encoding="utf-8")


def test_the_whole_arm_is_one(tmp_path):
    (arm,) = [part.split("```")[0] for part in TEXT.split("```xml\n") if part.startswith('<robot name="two_links">')]
    path = tmp_path / "two_links.urdf"
    path.write_text(arm, encoding="utf-8")
    robot = prup_pin.load(path)
    found = robot.compliance(robot.pose(shoulder=0, elbow=0))
    gears = 0.9**2 / 5e4 + 0.4**2 / 2e4
    first, second = (70e9 * np.pi / 64 * (outer**4 - inner**4) for outer, inner in ((0.08, 0.07), (0.06, 0.052)))
    tubes = (0.5**3 / 3 + 0.5**2 * 0.4 + 0.5 * 0.4**2) / first + 0.4**3 / 3 / second
    assert found.C[2, 2] == pytest.approx(gears + tubes, rel=1e-9)
