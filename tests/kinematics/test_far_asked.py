"""What is asked in millimetres where metres are meant is asked about, by the package as by the command line."""

import math

import pytest

from prup_pin import load
from prup_pin.errors import UnreachablePoseError


def test_millimetres_that_would_be_metres_are_asked_about():
    with pytest.raises(
        UnreachablePoseError, match=r"z = 400 m: is it in mm\? Expected m, which would be 0\.4\. "
    ) as caught:
        load("3prup").pose(z=400, theta=0, phi=0)
    assert "Nearest feasible" in str(caught.value)
    with pytest.raises(UnreachablePoseError) as caught:
        load("3prup").pose(z=4, theta=0, phi=0)
    assert "is it in" not in str(caught.value)


ARM = """<robot name="arm">
  <link name="base"/><link name="arm"/>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
    <limit lower="{lower!r}" upper="{upper!r}" effort="9" velocity="1"/>
  </joint>
  <link name="tool"/>
  <joint name="flange" type="fixed"><parent link="arm"/><child link="tool"/><origin xyz="0.5 0 0"/></joint>
  <prup_pin version="1"><tool frame="tool"/></prup_pin>
</robot>"""


@pytest.mark.parametrize("asked", [-2.7, 0.6, 8.0])
def test_a_limit_that_rounds_outwards_has_a_pose_inside_it(tmp_path, asked):
    """Five digits of 30 and of 150 degrees are beyond them."""
    file, limits = tmp_path / "arm.urdf", (-math.radians(150), math.radians(30))
    file.write_text(ARM.format(lower=limits[0], upper=limits[1]))
    robot = load(file)
    with pytest.raises(UnreachablePoseError, match="Nearest feasible") as caught:
        robot.pose_from_actuators([asked])
    told = caught.value.nearest["shoulder"]
    assert limits[0] <= told <= limits[1]
    assert told == pytest.approx(min(max(asked, limits[0]), limits[1]), rel=2e-4)
    robot.pose_from_actuators([told])
