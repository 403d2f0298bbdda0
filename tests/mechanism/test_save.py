"""`robot.save` writes a file that `load` reads as the same robot."""

from pathlib import Path

import numpy as np
import pytest

import prup_pin
from prup_pin.errors import InputError

ROBOTS = Path(__file__).parents[1] / "robots"
FIVE_BAR = {"tool": "left_point", "actuated": ["left_motor", "right_motor"]}


def same(one, other):
    """The same poses and the same compliance at home, module by module."""
    a, b = one.mechanism, other.mechanism
    assert (a.name, a.actuated, a.tool.name) == (b.name, b.actuated, b.tool.name)
    assert [(loop.name, loop.free) for loop in a.loops] == [(loop.name, loop.free) for loop in b.loops]
    np.testing.assert_allclose(other.home.q, one.home.q, atol=1e-14)
    want, found = one.compliance(one.home), other.compliance(other.home)
    np.testing.assert_allclose(found.C, want.C, rtol=0, atol=1e-12 * np.abs(want.C).max())
    assert list(found.parts) == list(want.parts)
    assert {name: str(p.value) for name, p in a.parameters.items()} == {
        name: str(p.value) for name, p in b.parameters.items()
    }


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("3prup", {}),
        ("3prup_as_published", {}),
        ("ur5", {"joint_stiffness": 1e4}),
        (ROBOTS / "six_ups/six_ups.urdf", {}),
        (ROBOTS / "five_bar/five_bar.urdf", {"joint_stiffness": 1e4}),
        (ROBOTS / "five_bar/five_bar_loop_joint.urdf", {"joint_stiffness": 1e4, **FIVE_BAR}),
        (ROBOTS / "five_bar/five_bar_closing.urdf", {"joint_stiffness": 1e4, **FIVE_BAR, "tool": "closing_point_1"}),
        (ROBOTS / "delta/robot.urdf", {"joint_stiffness": {f"motor{i}": 1e4 * i for i in (1, 2, 3)}, "tool": "centre"}),
    ],
    ids=str,
)  # fmt: skip
def test_the_saved_robot_is_the_same_robot(name, options, tmp_path):
    robot = prup_pin.load(name, **options)
    path = robot.save(tmp_path / "saved.urdf")
    same(robot, prup_pin.load(path))
    same(robot, prup_pin.load(prup_pin.load(path).save(tmp_path / "again.urdf")))
    assert (tmp_path / "again.urdf").read_bytes() == path.read_bytes()


def test_changed_values_and_lengths_are_in_the_file(tmp_path):
    robot = prup_pin.load("3prup").with_parameters(
        {"leg1/linear_rod.diameter": 0.022, "leg1/R_lambda.offset": 0.11, "leg2/R_lambda.radial_stiffness": 5e7}
    )
    saved = prup_pin.load(robot.save(tmp_path / "changed.urdf"))
    same(robot, saved)
    assert saved.parameters["leg1/R_lambda.offset"].value == 0.11
    assert saved.parameters["leg1/linear_rod.diameter"].source == "changed by the user"
    # Nothing else has changed, comments included.
    before = set(robot.mechanism.description.content.decode().splitlines())
    added = [line for line in (tmp_path / "changed.urdf").read_text().splitlines() if line not in before]
    assert "Rezaei & Akbarzadeh" in (tmp_path / "changed.urdf").read_text()
    assert len(added) < 12


def test_what_cannot_be_saved_is_refused_and_nothing_is_written(tmp_path):
    locked = prup_pin.load("3prup").with_locked_joints("leg1_branch")
    with pytest.raises(InputError, match=r"locked or held joints \(leg1_branch\) have no place"):
        locked.save(tmp_path / "locked.urdf")
    mjcf = prup_pin.load(ROBOTS / "five_bar/five_bar.xml", tool="left_point", actuated=["left_motor", "right_motor"])
    with pytest.raises(InputError, match="read from MJCF"):
        mjcf.save(tmp_path / "mjcf.urdf")
    with pytest.raises(InputError):
        prup_pin.load("3prup").save(tmp_path / "nowhere" / "robot.urdf")
    assert list(tmp_path.iterdir()) == []
