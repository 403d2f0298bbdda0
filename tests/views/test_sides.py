"""From which side robots are seen, and pages of a telephone's width."""

import numpy as np
import pytest
from PIL import Image

from prup_pin import load
from prup_pin.views.scene.camera import camera_of, front_of

from .chromium import render

#: A mechanism of two links in a plane, whose joints turn about AXIS and whose weight pulls along PULL.
TWO_LINKS = """<robot name="two"><link name="base"/>
<joint name="a" type="revolute"><parent link="base"/><child link="one"/><axis xyz="AXIS"/>
<limit lower="-3" upper="3" effort="1" velocity="1"/></joint><link name="one"/>
<joint name="b" type="revolute"><parent link="one"/><child link="two"/><origin xyz="0.3 0.2 0.25"/><axis xyz="AXIS"/>
<limit lower="-3" upper="3" effort="1" velocity="1"/></joint><link name="two"/>
<joint name="c" type="fixed"><parent link="two"/><child link="tool"/><origin xyz="0.25 0.1 0.3"/></joint>
<link name="tool"/>
<prup_pin version="1"><gravity xyz="PULL"/><tool frame="tool"/><actuated joints="a b"/><home a="0" b="0.4"/></prup_pin>
</robot>"""


def two_links(folder, axis, pull):
    (folder / "two.urdf").write_text(TWO_LINKS.replace("AXIS", axis).replace("PULL", pull))
    return load(str(folder / "two.urdf"))


@pytest.mark.parametrize(
    ("axis", "pull", "right", "up"),
    [
        ("0 0 1", "0 -9.81 0", 0, 1),
        ("0 0 -1", "0 -9.81 0", 0, 1),
        ("0 1 0", "0 0 -9.81", 0, 2),
        ("1 0 0", "0 0 -9.81", 1, 2),
    ],
)
def test_a_planar_robot_is_seen_from_where_its_axes_are_as_in_books(tmp_path, axis, pull, right, up):
    """One in x and y with its weight along -y was seen from behind, x to the left."""
    robot = two_links(tmp_path, axis, pull)
    camera = camera_of(robot, robot.home)
    page = np.eye(3) @ camera.plane.T
    assert page[right][0] > 0.5
    assert page[up][1] > 0.5


def test_robots_in_space_and_level_ones_are_seen_as_suits_them(tmp_path):
    assert front_of(load("3prup").home) is None
    level = two_links(tmp_path, "0 0 1", "0 0 -9.81")
    assert camera_of(level, level.home).viewer[2] > 0


def test_a_page_of_a_telephone_s_width_is_laid_out_in_it(tmp_path):
    """Chromium's windows are no narrower than 500 pixels: frames within were laid out for these, and cut."""
    inner = "<style>body{background:#00ff00} @media (min-width: 380px) {body{background:#ff0000}}</style>"
    (tmp_path / "page.html").write_text(
        f"<body style='margin: 20px'><iframe srcdoc='{inner}' style='width: 100%; height: 300px; border: 0'></iframe>"
    )
    render.render(str(tmp_path / "page.html"), tmp_path / "page.png", (390, 400), 1.0)
    with Image.open(tmp_path / "page.png") as picture:
        assert picture.size == (390, 400)
        assert picture.convert("RGB").getpixel((350, 150)) == (0, 255, 0)
