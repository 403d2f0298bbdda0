"""Workspaces that are known: a gantry's box, a five-bar's by its closed form."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import prup_pin
from prup_pin import InputError, UnknownNameError
from prup_pin.workspace.lattice import refined
from tests.laws.bench import ROBOTS

GANTRY = """<robot name="gantry"><link name="base"/><link name="bridge"/><link name="carriage"/><link name="tool"/>
  <joint name="x_slide" type="prismatic"><parent link="base"/><child link="bridge"/><origin xyz="0.1 0.2 0"
    rpy="0 0 0.5"/><axis xyz="1 0 0"/><limit lower="-0.4" upper="0.5" effort="1" velocity="1"/></joint>
  <joint name="y_slide" type="prismatic"><parent link="bridge"/><child link="carriage"/><axis xyz="0 1 0"/>
    <limit lower="-0.3" upper="0.2" effort="1" velocity="1"/></joint>
  <joint name="z_slide" type="prismatic"><parent link="carriage"/><child link="tool"/><axis xyz="0 0 1"/>
    <limit lower="0.05" upper="0.45" effort="1" velocity="1"/></joint>
  <prup_pin version="1"><tool frame="tool"/><actuated joints="x_slide y_slide z_slide"/><task_coordinates>
    <coordinate name="x" component="x"/><coordinate name="y" component="y"/><coordinate name="z" component="z"/>
  </task_coordinates></prup_pin></robot>"""
BOX = 0.9 * 0.5 * 0.4


@pytest.fixture(scope="module")
def gantry(tmp_path_factory):
    path = tmp_path_factory.mktemp("gantry") / "gantry.urdf"
    path.write_text(GANTRY)
    return prup_pin.load(path)


@pytest.mark.parametrize("resolution", [1 / 16, 1 / 32])
def test_a_gantry_reaches_its_box(gantry, resolution):
    """A box that stands askew to the coordinates."""
    found = gantry.workspace(resolution, x=(-0.6, 0.9), y=(-0.5, 0.9), z=(0.0, 0.5))
    assert abs(found.volume - BOX) < found.error
    assert found.error < 0.09 * BOX
    assert found.bounds[0] < BOX < found.bounds[1]
    assert found.unit == "m^3"
    assert not found.touched
    assert list(found.limited_by) == ["joint limits of the robot file"]
    # every point of the boundary is on a face, to 1/64 of a cell
    c, s = np.cos(0.5), np.sin(0.5)
    x, y = (found.points[:, :2] - [0.1, 0.2]).T
    along = np.stack([c * x + s * y, c * y - s * x, found.points[:, 2]])
    apart = np.abs(along[:, None] - np.array([[-0.4, 0.5], [-0.3, 0.2], [0.05, 0.45]])[:, :, None]).min(axis=(0, 1))
    assert apart.max() < max(found.resolution.values()) / 64


def test_other_limits_cut_it(gantry):
    found = gantry.workspace(1 / 32, x=(-0.6, 0.9), y=(-0.5, 0.9), z=0.2, limits={"y_*": (None, 0.0)})
    assert abs(found.volume - 0.9 * 0.3) < found.error
    assert set(found.limited_by) == {"joint limits of the robot file", "y_slide"}
    assert found.fixed == {"z": 0.2}


def test_the_ends_of_a_span_are_no_boundary(gantry):
    found = gantry.workspace(1 / 32, x=(0.0, 0.2), y=(-0.5, 0.9), z=0.2)
    assert found.touched == ("x",)
    strip = 0.2 * 0.5 / np.cos(0.5)
    assert abs(found.volume - strip) < found.error


def test_its_surface_is_closed_and_holds_the_volume(gantry):
    found = gantry.workspace(1 / 24, x=(-0.6, 0.9), y=(-0.5, 0.9), z=(0.0, 0.5))
    points, triangles = found.surface
    edges = np.concatenate([triangles[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])
    directed = {tuple(edge) for edge in edges.tolist()}
    assert all((b, a) in directed for a, b in directed), "an edge without its neighbour, or turned"
    a, b, c = (points[triangles[:, corner]] for corner in range(3))
    assert (np.cross(a, b) * c).sum() / 6 == pytest.approx(BOX, rel=0.06)
    with pytest.raises(InputError, match="three coordinates"):
        _ = gantry.workspace(1 / 16, x=(-0.6, 0.9), y=(-0.5, 0.9), z=0.2).surface


# -- the five-bar ------------------------------------------------------------------------------------------------------

MOTORS = np.array([[-0.1, 0.0], [0.1, 0.0]])
ELBOWS = np.array([[-0.24, 0.16], [0.26, 0.15]])
POINT = np.array([0.02, 0.38])


def five_bar_stands(x, y, limit=1.5):
    """By closed form: both legs reach in home's working mode, joints within limits, the rods on home's side."""

    def cross(a, b):
        return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]

    def angle(a, b):
        return np.arctan2(cross(a, b), (a * b).sum(-1))

    at = np.stack([x, y], axis=-1)
    good = np.ones(np.shape(x), bool)
    elbows = []
    for motor, elbow in zip(MOTORS, ELBOWS, strict=True):
        arm, rod = np.linalg.norm(elbow - motor), np.linalg.norm(POINT - elbow)
        side = np.sign(cross(POINT - motor, elbow - motor))
        way = at - motor
        size = np.linalg.norm(way, axis=-1)
        with np.errstate(invalid="ignore", divide="ignore"):
            cosine = (arm**2 + size**2 - rod**2) / (2 * arm * size)
            good &= np.abs(cosine) < 1
            turn = side * np.arccos(np.clip(cosine, -1, 1))
        unit = way / size[..., None]
        here = arm * np.stack(
            [
                unit[..., 0] * np.cos(turn) - unit[..., 1] * np.sin(turn),
                unit[..., 0] * np.sin(turn) + unit[..., 1] * np.cos(turn),
            ],
            axis=-1,
        )
        motored = angle(np.broadcast_to(elbow - motor, here.shape), here)
        drawn = angle(elbow - motor, POINT - elbow)
        bent = angle(here, way - here) - drawn
        bent = (bent + np.pi) % (2 * np.pi) - np.pi
        good &= (np.abs(motored) < limit) & (np.abs(bent) < limit)
        elbows.append(motor + here)
    rods = cross(elbows[0] - at, elbows[1] - at)
    return good & (np.sign(rods) == np.sign(cross(ELBOWS[0] - POINT, ELBOWS[1] - POINT)))


SPAN = {"x": (-0.5, 0.55), "y": (0.02, 0.65)}


def test_the_closed_form_is_that_of_the_robot():
    robot = prup_pin.load(ROBOTS / "five_bar/five_bar.urdf")
    generator = np.random.default_rng(2)
    at = np.stack([generator.uniform(*SPAN[name], 150) for name in "xy"], axis=-1)
    status = robot.sweep(at, quantities=["q"]).status
    assert (five_bar_stands(*at.T) == (status == "ok")).mean() > 0.99


@pytest.mark.parametrize("resolution", [1 / 32])
def test_a_five_bar_reaches_what_its_closed_form_says(resolution):
    robot = prup_pin.load(ROBOTS / "five_bar/five_bar.urdf")
    found = robot.workspace(resolution, **SPAN)
    fine = [np.linspace(*SPAN[name], 1001) for name in "xy"]
    middles = [(axis[1:] + axis[:-1]) / 2 for axis in fine]
    area = five_bar_stands(*np.meshgrid(*middles, indexing="ij")).mean() * 1.05 * 0.63
    assert abs(found.volume - area) < found.error
    assert found.error < 0.1 * area
    assert found.bounds[0] < area < found.bounds[1]
    assert found.unit == "m^2"
    # beyond its boundary, by more than it may be off, the other side begins
    step = 1.05 * resolution / 32
    there = np.stack(
        [
            five_bar_stands(found.points[:, 0] + a * step, found.points[:, 1] + b * step)
            for a in (-1, 0, 1)
            for b in (-1, 0, 1)
        ]
    )
    assert (there.any(axis=0) & ~there.all(axis=0)).mean() > 0.97


@pytest.mark.slow
def test_a_margin_keeps_away_from_singular_poses():
    robot = prup_pin.load(ROBOTS / "five_bar/five_bar.urdf")
    whole = robot.workspace(1 / 32, **SPAN)
    kept = robot.workspace(1 / 32, **SPAN, singularity=0.6)
    assert kept.volume < 0.97 * whole.volume
    assert "singularity margin" in kept.limited_by
    x, y = (axis[index] for axis, index in zip(kept.axes, np.argwhere(kept.inside)[0], strict=True))
    free = robot.mechanism.free_dofs
    pose = robot.pose(x=x, y=y)
    rows, columns = robot._kinematics.scales(free)
    values = np.linalg.svd(pose.closure_jacobian[:, free] * rows[:, None] * columns, compute_uv=False)
    assert values[-1] / values[0] >= 0.6


def test_lengths_of_rods_and_branches_limit_the_three_prup():
    robot = prup_pin.load("3prup")
    spans = {"z": 0.3, "theta": (-1.1, 1.1), "phi": (-1.1, 1.1)}
    by_rods = robot.workspace(1 / 24, **spans, limits={"leg*/linear_rod": (0.05, 0.4)})
    by_slides = robot.workspace(1 / 24, **spans, limits={"leg*_slide": (0.15, 0.5)})
    np.testing.assert_array_equal(by_rods.inside, by_slides.inside)  # a rod is as long as its slide stands, less 0.1 m
    assert "leg1/linear_rod" in by_rods.limited_by
    mirrored = by_rods.inside[::-1]
    np.testing.assert_array_equal(by_rods.inside, mirrored)  # leg 1 stands in the plane of symmetry
    assert by_rods.inside.sum() < robot.workspace(1 / 24, **spans).inside.sum()


# -- the lattice -------------------------------------------------------------------------------------------------------


def test_a_boundary_is_followed_where_coarse_cells_saw_nothing():
    """A thin finger leaves a disk between the points of the first lattice."""
    asked = []

    def ask(points, starts):
        asked.append(len(points))
        x, y = (points / 64).T
        disk = (x - 0.3) ** 2 + (y - 0.3) ** 2 < 0.15**2
        finger = (x > 0.3) & (x < 0.93) & (abs(y - 0.3) < 0.02)
        return np.where(disk | finger, 0, 1).astype(np.int16), points

    lattice = refined(ask, (64, 64), 3, lambda share: None)
    whole, _ = ask(np.argwhere(np.ones((65, 65))).astype(float), None)
    np.testing.assert_array_equal(lattice.inside, whole.reshape(65, 65) == 0)
    assert sum(asked[:-1]) < 0.5 * 65**2


def test_a_workspace_is_a_function_of_its_question(gantry):
    asked = {"x": (-0.6, 0.9), "y": (-0.5, 0.9), "z": 0.2}
    one, other = gantry.workspace(1 / 16, **asked), pickle.loads(pickle.dumps(gantry)).workspace(1 / 16, **asked)
    np.testing.assert_array_equal(one.points, other.points)
    assert pickle.loads(pickle.dumps(one)).volume == one.volume
    assert "m^2" in repr(one)


def test_an_empty_workspace_has_no_volume(gantry):
    found = gantry.workspace(1 / 16, x=(2.0, 3.0), y=(-0.5, 0.9), z=0.2)
    assert found.volume == 0
    assert found.extent == {}
    assert len(found.points) == 0


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"x": (0.5, 0.1)}, "expected the smaller end first"),
        ({"x": (0.1, 0.2, 0.3)}, "two ends of a span"),
        ({"x": (-600.0, 900.0)}, "Millimetres?"),
        ({"x": 0.1, "y": 0.2}, "nothing varies"),
        ({"resolution": 0.5}, "at most 1/8"),
        ({"resolution": {"q": 0.01}}, "which does not vary"),
        ({"resolution": 1e-9}, "too large"),
        ({"singularity": 1.5}, "a margin from 0 to 1"),
        ({"limits": {"x_slide": (0.2, 0.1)}}, "expected the smaller end first"),
        ({"limits": {"x_slide": 0.2}}, "expected two ends"),
        ({"limits": {"x_slid": (0, 1)}}, "Did you mean 'x_slide'"),
    ],
)
def test_bad_questions_are_refused_in_words(gantry, given, says):
    asked = {"x": (-0.6, 0.9), "y": (-0.5, 0.9), "z": 0.2, **given}
    with pytest.raises(InputError) as caught:
        gantry.workspace(**asked)
    assert says in str(caught.value)


def test_all_coordinates_are_named(gantry):
    with pytest.raises(InputError, match=r"missing .*: z"):
        gantry.workspace(x=(-0.6, 0.9), y=(-0.5, 0.9))
    with pytest.raises(UnknownNameError, match="no task coordinate named 'u'"):
        gantry.workspace(x=(-0.6, 0.9), y=(-0.5, 0.9), z=0, u=1)
