"""Pictures are drawn, differ where they should, and say what they show."""

import subprocess
import sys

import numpy as np
import pytest
from matplotlib.colors import to_hex

import prup_pin
from prup_pin.views.drawing.figures import pose_figure, shares_figure
from prup_pin.views.scene.camera import camera_of
from prup_pin.views.scene.colours import LOAD, rgb_of, share_colours
from prup_pin.views.scene.elastic import Deflections
from prup_pin.views.scene.painter import Painter, pose_scene
from prup_pin.views.scene.skeleton import skeleton

WRENCH = np.array([300, 0, 0, 0, 0, 100.0])
SOFTEST = "leg3/linear_rod"


@pytest.fixture(scope="module")
def compliance(robot):
    return robot.compliance(robot.pose(z=0.4, theta=0.436, phi=0.262))


def pixels(figure):
    figure.canvas.draw()
    return np.asarray(figure.canvas.buffer_rgba())[..., :3].astype(int)


def drawing_of(image):
    """The part with the mechanism, without title and legend."""
    height, width, _ = image.shape
    return image[int(0.16 * height) : int(0.95 * height), int(0.12 * width) : int(0.69 * width)]


def softest_pixels(image, compliance):
    """How many pixels have the colour of the part with the largest share."""
    shares = compliance.shares(WRENCH)
    assert max(shares, key=shares.get) == SOFTEST
    colour = np.round(rgb_of(share_colours(shares)[0][SOFTEST]) * 255)
    return (np.abs(drawing_of(image) - colour).max(axis=-1) < 12).sum()


def texts(figure):
    found = [
        text
        for axes in figure.axes
        for text in (*axes.texts, axes.title, *(axes.get_yticklabels() if axes.axison else ()))
    ]
    found += figure.texts
    return [text for text in found if text.get_text() and text.get_visible()]


def test_deflected_mechanism_is_drawn(robot, compliance):
    without = pixels(pose_figure(robot, compliance.pose, compliance))
    deflected = pixels(pose_figure(robot, compliance.pose, compliance, WRENCH, scale=10))
    more = pixels(pose_figure(robot, compliance.pose, compliance, WRENCH, scale=20))
    assert without.shape == deflected.shape
    assert len(np.unique(without.reshape(-1, 3), axis=0)) > 50
    assert softest_pixels(without, compliance) == 0
    assert softest_pixels(deflected, compliance) > 50
    assert (drawing_of(deflected) != drawing_of(more)).any(axis=-1).sum() > 1000


def test_a_page_has_one_scale_and_one_meaning_of_colours(robot, compliance):
    """The drawing beside the scene: as many times larger, the same colour for the same part."""
    scene = pose_scene(robot, compliance.pose, WRENCH, compliance=compliance)
    figure = pose_figure(robot, compliance.pose, compliance, WRENCH)
    said = " ".join(text.get_text() for text in texts(figure))
    assert f"drawn {scene.scale:g} times larger" in said
    colours = [to_hex(sign.get_facecolor()) for sign in figure.legends[0].get_patches()]
    bars = [to_hex(bar.get_facecolor()) for bar in shares_figure(compliance, WRENCH).axes[0].patches]
    for name in (SOFTEST, "leg3/moving_star_branch"):
        colour = scene.part(f"robot/deformed/beams/{name}").colour
        assert colour in colours
        assert colour in bars
    assert scene.part("wrench/force/shaft").colour == LOAD
    assert scene.legend.scale_ends[1] in [tick.get_text() for axes in figure.axes for tick in axes.get_xticklabels()]


def test_every_picture_of_a_robot_is_taken_from_the_same_side(robot, compliance):
    """Whatever the pose and the load; and small changes of the robot do not turn it round."""
    viewers = [camera_of(robot, robot.home).viewer, Painter(robot, compliance.pose).viewer]
    viewers.append(pose_scene(robot, robot.pose(z=0.25, theta=-0.4, phi=0.3), {"fy": 200}).viewer)
    changed = robot.with_parameters({"leg1/base.radius": 0.1813, "leg2/R_lambda.offset": 0.1002})
    viewers.append(camera_of(changed, changed.home).viewer)
    np.testing.assert_allclose(viewers, np.tile(viewers[0], (4, 1)), atol=1e-12)


def test_title_states_pose_load_and_scale(robot, compliance):
    said = " ".join(
        text.get_text() for text in texts(pose_figure(robot, compliance.pose, compliance, WRENCH, scale=25))
    )
    for word in ("3prup", "z 400 mm", "fx 300 N", "mz 100 N m", "25 times larger", "300 N", "leg1", "leg2", "leg3"):
        assert word in said
    for value in np.linalg.eigvalsh(compliance.C[:3, :3]) * 1e6:
        assert f"{value:.3g} µm/N" in said


@pytest.mark.parametrize(
    ("wrench", "narrow"),
    [
        (None, True),
        pytest.param(WRENCH, False, marks=pytest.mark.slow),
        pytest.param([0, 0, 500, 0, 0, 0], True, marks=pytest.mark.slow),
        pytest.param([0, 0, 0, 20, 0, 0], False, marks=pytest.mark.slow),
    ],
)
def test_labels_do_not_overlap(robot, wrench, narrow):
    for pose in (robot.home, robot.pose(z=0.4, theta=0.436, phi=0.262), robot.pose(z=0.3, theta=-0.3, phi=0.2)):
        figure = pose_figure(robot, pose, robot.compliance(pose), wrench, narrow=narrow)
        figure.canvas.draw()
        renderer = figure.canvas.get_renderer()
        assert figure.get_size_inches()[0] == (5.2 if narrow else 11)
        boxes = [(text.get_text(), text.get_window_extent(renderer)) for text in texts(figure)]
        for index, (one, box) in enumerate(boxes):
            assert box.x0 >= 0
            assert box.x1 <= figure.bbox.width
            for other, second in boxes[index + 1 :]:
                assert not box.overlaps(second), f"'{one}' covers '{other}'"


def test_gravity_points_down(robot):
    """The 3-PRUP's z axis points down: its base is drawn above its tool."""
    figure = pose_figure(robot, robot.home, robot.compliance(robot.home))
    place = {text.get_text(): text.get_window_extent().y0 for text in texts(figure)}
    assert min(place[leg] for leg in ("leg1", "leg2", "leg3")) > place["z"]


@pytest.mark.parametrize(
    "name",
    [
        "double_pendulum",
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("ur5", "panda", "double_pendulum_continuous")),
    ],
)
def test_other_robots(name):
    robot = prup_pin.load(name, joint_stiffness=1e4)
    compliance = robot.compliance(robot.home)
    image = pixels(pose_figure(robot, robot.home, compliance, [5, 10, 20, 0, 0, 0]))
    assert len(np.unique(drawing_of(image).reshape(-1, 3), axis=0)) > 20


def test_pose_alone_can_be_drawn(robot):
    assert pixels(pose_figure(robot, robot.home)).min() < 100


def test_pictures_need_what_they_show(robot, compliance):
    with pytest.raises(prup_pin.InputError, match="another pose"):
        pose_figure(robot, robot.home, compliance)
    with pytest.raises(prup_pin.InputError, match="deflects nothing"):
        shares_figure(compliance, np.zeros(6))


def test_shares_are_bars_in_order(compliance):
    figure = shares_figure(compliance, WRENCH)
    bars = [bar.get_width() for bar in figure.axes[0].patches]
    shares = sorted(compliance.shares(WRENCH).values(), reverse=True)
    np.testing.assert_allclose(bars[:5], 100 * np.array(shares[:5]))
    assert sum(bars) == pytest.approx(100)
    said = " ".join(text.get_text() for text in texts(figure))
    for word in ("leg3/linear_rod", "others", "mm", "35.1 %"):
        assert word in said


@pytest.mark.slow
def test_pictures_for_a_phone_say_the_same(robot, compliance):
    """All words, in letters that can be read where 5.2 inches are 390 pixels wide, none cut off."""
    for draw in (
        lambda narrow: pose_figure(robot, compliance.pose, compliance, WRENCH, narrow=narrow),
        lambda narrow: shares_figure(compliance, WRENCH, narrow=narrow),
    ):
        wide, narrow = draw(False), draw(True)
        words = [" ".join(text.get_text() for text in texts(figure)).split() for figure in (wide, narrow)]
        assert set(words[0]) == set(words[1])
        narrow.canvas.draw()
        for text in texts(narrow):
            assert text.get_fontsize() * 390 / (72 * 5.2) >= 8.5, text.get_text()
            box = text.get_window_extent(narrow.canvas.get_renderer())
            assert box.x0 >= 0, text.get_text()
            assert box.x1 <= narrow.bbox.width, text.get_text()


def test_shares_without_wrench_and_without_legs():
    robot = prup_pin.load("ur5", joint_stiffness=1e4)
    figure = shares_figure(robot.compliance(robot.home))
    assert "softest translation" in " ".join(text.get_text() for text in texts(figure))


def test_files_are_readable(robot, compliance, tmp_path):
    from matplotlib.image import imread

    for name, figure in (
        ("pose", pose_figure(robot, compliance.pose, compliance)),
        ("shares", shares_figure(compliance)),
    ):
        figure.savefig(tmp_path / f"{name}.png")
        assert imread(tmp_path / f"{name}.png").shape[2] == 4
        figure.savefig(tmp_path / f"{name}.svg")
        assert "<svg" in (tmp_path / f"{name}.svg").read_text(encoding="utf-8")


def test_pyplot_stays_untouched():
    code = "import prup_pin.views.drawing.figures, sys; assert 'matplotlib.pyplot' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)


# -- the skeleton ----------------------------------------------------------------------------------------------------


def test_skeleton_of_the_3prup(robot, compliance):
    parts = skeleton(compliance.pose)
    kinds = [segment.kind for segment in parts.segments]
    assert kinds.count("beam") == 6
    assert kinds.count("link") == 3  # the yokes
    np.testing.assert_allclose(parts.anchors[:, 2], 0, atol=1e-12)
    assert set(parts.legs) == {"leg1", "leg2", "leg3"}


def test_motions_are_those_of_the_compliance(robot, compliance):
    """A small scale moves every drawn end as `deflection` says; the loops of the deflected mechanism stay closed."""
    pose = compliance.pose
    moved = Deflections(compliance, WRENCH)

    def there(body, point):
        return point + moved.shift(body, point, 1.0)

    tool = pose.mechanism.tool
    at = pose.base_from_tool[:3, 3]
    np.testing.assert_allclose(
        moved.shift(tool.joint, at, 1.0), compliance.deflection(WRENCH)[:3], rtol=1e-9, atol=1e-15
    )
    for loop in pose.mechanism.loops:
        first, second = (end.at(pose.placements)[:3, 3] for end in (loop.first, loop.second))
        np.testing.assert_allclose(there(loop.first.joint, first), there(loop.second.joint, second), atol=1e-9)
    for segment in beams(pose):
        line = curve(moved, pose, segment)
        np.testing.assert_allclose(line[0], there(segment.bodies[0], segment.start), atol=1e-15)
        np.testing.assert_allclose(line[-1], there(segment.bodies[1], segment.end), atol=1e-15)


def beams(pose):
    return [segment for segment in skeleton(pose).segments if segment.kind == "beam"]


def curve(moved, pose, segment):
    """The deflected line of a beam as it is drawn, true to size, (25, 3)."""
    line = moved.bent(pose.mechanism.module(segment.name), pose, 1.0, stretched=True)
    points = np.outer(np.linspace(0, line.length, 25), [0, 0, 1])
    return (points + line.displacement(points)) @ line.frame[:3, :3].T + line.frame[:3, 3]


def off_cubic(moved, pose, segment):
    """How far [m] a drawn beam lies off the cubic between its ends and their slopes, across the beam.

    That cubic is the exact line of a slender beam of constant section.
    """
    drawn = curve(moved, pose, segment)
    s, line = np.linspace(0, 1, len(drawn))[:, None], segment.end - segment.start
    (first, turn), (last, turn_there) = (
        (moved.shift(body, end, 1.0), moved.shift(body, end + line, 1.0) - moved.shift(body, end, 1.0))
        for body, end in zip(segment.bodies, (segment.start, segment.end), strict=True)
    )
    bent = (1 - 3 * s**2 + 2 * s**3) * first + (3 * s**2 - 2 * s**3) * last
    off = drawn - segment.start - bent - (s - 2 * s**2 + s**3) * turn - (s**3 - s**2) * turn_there
    axis = line / np.linalg.norm(line)
    return np.linalg.norm(off - np.outer(off @ axis, axis), axis=1).max()


def test_slender_beams_are_drawn_as_cubics(robot, compliance):
    moved = Deflections(compliance, WRENCH)
    for beam in beams(compliance.pose):
        line = curve(moved, compliance.pose, beam)
        bend = np.abs(line - np.linspace(line[0], line[-1], len(line))).max()
        assert bend > 1e-6
        assert off_cubic(moved, compliance.pose, beam) < 1e-9 * bend + 1e-15


def test_beams_that_shear_are_drawn_so():
    soft = {"shear_modulus": 1e9, "shear_coefficient": 0.5}
    changes = {f"leg{leg}/linear_rod.{name}": value for leg in (1, 2, 3) for name, value in soft.items()}
    robot = prup_pin.load("3prup").with_parameters(changes)
    compliance = robot.compliance(robot.home)
    moved = Deflections(compliance, WRENCH)
    rods = [beam for beam in beams(compliance.pose) if beam.name.endswith("linear_rod")]
    assert max(off_cubic(moved, compliance.pose, rod) for rod in rods) > 1e-7
