"""A robot under load does not know how its frames are drawn, which way it stands, or what its joints are called.

The five-bar and the delta are redundant: their loops say some things several times, some joints idle, and nothing
yields to the forces that only their rigid links carry.
"""

from __future__ import annotations

import copy
import pickle
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lxml import etree

import prup_pin
from prup_pin.errors import JointLimitWarning, NoStiffnessError
from prup_pin.loaded import Conditions, find_equilibria
from prup_pin.robots import packaged_folder
from prup_pin.spatial import rotation_rpy

from .redrawn import Drawing, at

pytestmark = pytest.mark.filterwarnings(f"ignore::{JointLimitWarning.__module__}.{JointLimitWarning.__name__}")

ROBOTS = Path(__file__).parents[1] / "robots"
HALF = np.pi / 2


@dataclass(frozen=True)
class Machine:
    source: Path
    actuators: tuple[float, ...]
    wrench: tuple[float, ...]
    options: dict[str, Any] = field(default_factory=dict)
    masses: tuple[str, ...] = ()
    bearings: tuple[str, ...] = ()


FIVE_BAR = Machine(
    ROBOTS / "five_bar/five_bar.urdf",
    (0.15, -0.1),
    (-30.0, -80.0, 20.0, 1.0, -2.0, 1.5),
    {"tool": "tip", "joint_stiffness": {"left_motor": 9e3, "right_motor": 1.1e4}},
    ("left_arm", "left_rod", "right_arm", "right_rod"),
)
#: With bearings that yield in every joint, what its loop says several times puts it under stress.
YIELDING_FIVE_BAR = replace(FIVE_BAR, bearings=("left_motor", "left_elbow", "right_motor", "right_elbow"))
DELTA = Machine(
    ROBOTS / "delta/robot.urdf",
    (0.1, -0.05, 0.2),
    (60.0, -40.0, 90.0, 1.0, -2.0, 1.5),
    {"tool": "centre", "joint_stiffness": {"motor1": 9e3, "motor2": 1e4, "motor3": 1.2e4}},
    ("arm1", "arm2", "arm3", "platform"),
)
THREE_PRUP = Machine(packaged_folder() / "3prup.urdf", (), (60.0, -40.0, 90.0, 6.0, 9.0, -5.0))

SKEW, OTHER = at((0.4, -1.1, 2.3)), at((-2.0, 0.3, 0.7))
BASE = rotation_rpy(0.7, -0.5, 1.9)
CASES: dict[str, tuple[Machine, Drawing]] = {
    **{
        f"five-bar, {joint} turned about {axis} by {angle:.2f}": (
            FIVE_BAR,
            Drawing({link: at(np.eye(3)["xyz".index(axis)] * angle)}),
        )
        for joint, link, axes, angles in (
            ("left elbow", "left_rod", "x", (0.3, HALF, np.pi)),
            ("left elbow", "left_rod", "yz", (0.3,)),
            ("right elbow", "right_rod", "x", (1.0,)),
            ("left motor", "left_arm", "y", (1.0,)),
        )
        for axis in axes
        for angle in angles
    },
    **{
        f"five-bar, {name}": (FIVE_BAR, drawing)
        for name, drawing in {
            "first frame of the loop turned about its hinge": Drawing({"left_point": at((0, 0, 0.8))}),
            "second frame of the loop turned about its hinge": Drawing({"right_point": at((0, 0, -2.0))}),
            "hinge pointing down": Drawing({"left_point": at((np.pi, 0, 0)), "right_point": at((np.pi, 0, 1.0))}),
            "hinge drawn higher": Drawing(
                {"left_point": at((0, 0, 0.2), (0, 0, 0.3)), "right_point": at((0, 0, 0.5), (0, 0, 0.3))}
            ),
            "all joints": Drawing({"left_arm": OTHER, "left_rod": SKEW, "right_arm": SKEW, "right_rod": at((1, 2, 3))}),
            "standing turned": Drawing(ground=BASE),
            "standing turned, all joints": Drawing({"left_rod": SKEW, "right_rod": OTHER}, BASE),
            "lying on its side": Drawing(ground=rotation_rpy(HALF, 0, 0)),
            "renamed": Drawing(names={"left_motor": "z_motor", "left_elbow": "z_elbow", "right_elbow": "a_elbow"}),
        }.items()
    },
    **{
        f"delta, {name}": (DELTA, drawing)
        for name, drawing in {
            "a loop's first frame": Drawing({"platform2a": SKEW}),
            "a loop's second frame": Drawing({"rod3b_end": OTHER}),
            "all loops": Drawing({"platform1b": SKEW, "rod1b_end": OTHER, "rod2a_end": SKEW, "platform3a": OTHER}),
            "elbows": Drawing({"rod1a": at((0.3, 0, 0)), "rod2a": SKEW, "rod3b": OTHER}),
            "a wrist turned half": Drawing({"platform": at((np.pi, 0, 0))}),
            "arms": Drawing({"arm1": SKEW, "arm2": at((HALF, 0, 0)), "arm3": OTHER}),
            "standing turned": Drawing(ground=BASE),
            "renamed": Drawing(names={"elbow1b": "z_first", "elbow3a": "a_last", "motor2": "zz_motor"}),
        }.items()
    },
    **{
        f"3prup, {name}": (THREE_PRUP, drawing)
        for name, drawing in {
            "a loop": Drawing({"leg2_star_end": SKEW, "star_2": SKEW}),
            "both loops": Drawing(
                {"leg2_star_end": OTHER, "star_2": OTHER, "leg3_star_end": at((1, 2, 3)), "star_3": at((1, 2, 3))}
            ),
            "standing turned": Drawing(ground=BASE),
        }.items()
    },
}
#: Drawings with angles and lengths of many digits.
CROOKED = {
    "five-bar": (FIVE_BAR, CASES["five-bar, standing turned, all joints"][1]),
    "five-bar with bearings": (YIELDING_FIVE_BAR, CASES["five-bar, all joints"][1]),
    "delta": (DELTA, CASES["delta, all loops"][1]),
    "delta, standing turned": (DELTA, CASES["delta, standing turned"][1]),
    "3prup": (THREE_PRUP, CASES["3prup, standing turned"][1]),
}
CASE = pytest.mark.parametrize(("machine", "drawing"), CASES.values(), ids=CASES)
#: One drawing in three for what is asked of each of them by the other question too.
SOME = pytest.mark.parametrize(("machine", "drawing"), [*CASES.values()][::3], ids=[*CASES][::3])


def drawn(machine: Machine, drawing: Drawing, folder: Path):
    """Return the robot, with masses on its links, and the pose."""
    root = etree.parse(str(machine.source)).getroot()
    for link in root.iterfind("link"):
        if link.get("name") in machine.masses:
            inertial = etree.SubElement(link, "inertial")
            etree.SubElement(inertial, "origin", xyz="-0.04 0.07 0.02")
            etree.SubElement(inertial, "mass", value="1.7")
            moments = {key: "0.01" if key[1] == key[2] else "0" for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")}
            etree.SubElement(inertial, "inertia", **moments)
    extension = root.find("prup_pin")
    if extension is None:
        extension = etree.SubElement(root, "prup_pin", version="1")
    if extension.find("gravity") is None:
        etree.SubElement(extension, "gravity", xyz="1.5 -9.0 -3.0")
    for index, name in enumerate(machine.bearings):
        module = etree.SubElement(extension, "module", name=f"{name}_bearing", type="bearing", joint=name, axis="0 0 1")
        for key, value in (("radial_stiffness", 3e7), ("axial_stiffness", 2e7), ("tilting_stiffness", 4e4)):
            etree.SubElement(module, "parameter", name=key, value=repr(value * (1 + 0.3 * index)))
    (folder / "source").mkdir(exist_ok=True)
    source = folder / "source" / machine.source.name
    source.write_bytes(etree.tostring(root))
    beside = machine.source.with_suffix(".yaml")
    if beside.exists():
        source.with_suffix(".yaml").write_text(beside.read_text())
    options = dict(machine.options)
    if "joint_stiffness" in options:
        options["joint_stiffness"] = {
            drawing.names.get(name, name): value for name, value in options["joint_stiffness"].items()
        }
    robot = prup_pin.load(drawing.write(source, folder), **options)
    actuators = machine.actuators or list(robot.home.actuators.values())
    return robot, robot.pose_from_actuators(actuators)


def turned(matrix: np.ndarray, ground: np.ndarray) -> np.ndarray:
    """Return a wrench, displacement or compliance seen from a turned ground, in the axes of the robot's own base."""
    both = np.kron(np.eye(2), ground)
    return both.T @ matrix @ both if matrix.ndim == 2 else both.T @ matrix


def answers(machine: Machine, drawing: Drawing, folder: Path) -> dict[str, np.ndarray]:
    folder.mkdir(exist_ok=True)
    robot, pose = drawn(machine, drawing, folder)
    there = drawing.ground
    wrench = turned(np.array(machine.wrench), there.T)
    loaded = robot.equilibrium(pose, wrench, gravity=True)
    names = {new: old for old, new in drawing.names.items()}
    energy = loaded.energy(2)
    found = {
        "rigid C": turned(robot.compliance(pose).C, there),
        "C": turned(loaded.C, there),
        "displacement": turned(loaded.displacement, there),
        "stored": np.array(energy.stored),
        "work": np.array(energy.work),
    }
    for name, load in loaded.loads.items():
        found[f"load of {names.get(name, name)}"] = np.array(load)
    return found


def agree(value: np.ndarray, expected: np.ndarray, tolerance: float) -> bool:
    return bool(np.abs(value - expected).max() <= tolerance * np.abs(expected).max())


@pytest.fixture(scope="module")
def as_drawn(tmp_path_factory):
    """The answers of the files as they are, computed once."""
    known: dict[Path, dict] = {}

    def get(machine: Machine) -> dict:
        if machine.source not in known:
            known[machine.source] = answers(machine, Drawing(), tmp_path_factory.mktemp("drawn"))
        return known[machine.source]

    return get


@CASE
def test_answers_do_not_depend_on_the_drawing(tmp_path, as_drawn, machine, drawing):
    """Under a load and its own weight: without the latter at rest, which is asked here too, and under small loads."""
    expected = as_drawn(machine)
    found = answers(machine, drawing, tmp_path / "robot")
    assert set(found) == set(expected)
    for name, value in found.items():
        assert agree(value, expected[name], 1e-8), name


@SOME
def test_a_small_load_moves_the_tool_as_castigliano_says(tmp_path, machine, drawing):
    robot, pose = drawn(machine, drawing, tmp_path)
    C = robot.compliance(pose).C
    for wrench in 0.1 * np.eye(6):
        linear = C @ wrench
        displacement = robot.equilibrium(pose, wrench).displacement
        # The rigid pose itself closes its loops to 1e-12.
        assert np.abs(displacement - linear).max() <= 2e-5 * np.abs(linear).max() + 1e-12
    assert agree(robot.equilibrium(pose, np.zeros(6)).C, C, 1e-9)


@pytest.mark.parametrize(
    ("name", "wrench"),
    [
        ("five-bar, all joints", (30, -80, 20, 1, -2, 1.5)),
        ("five-bar, standing turned, all joints", (30, -80, 20, 1, -2, 1.5)),
        pytest.param("delta, arms", (30, -80, 20, 1, -2, 1.5), marks=pytest.mark.slow),
        pytest.param("delta, arms", (0, 0, 100, 0, 0, 0), marks=pytest.mark.slow),
        ("delta, standing turned", (30, -80, 20, 1, -2, 1.5)),
        pytest.param("3prup, standing turned", (100, -50, 200, 10, 20, -15), marks=pytest.mark.slow),
    ],
)
def test_where_it_gives_way_does_not_depend_on_the_drawing(tmp_path, name, wrench):
    machine, drawing = CASES[name]
    margins = []
    for index, each in enumerate((Drawing(), drawing)):
        (tmp_path / str(index)).mkdir()
        robot, pose = drawn(machine, each, tmp_path / str(index))
        load = turned(np.array(wrench, float), each.ground.T)
        margins.append(robot.equilibrium(pose, load).buckling_margin())
    assert np.isfinite(margins[0])
    assert margins[1] == pytest.approx(margins[0], rel=1e-7)


@pytest.mark.parametrize("angle", [0.3, 1.0, HALF])
def test_a_hinge_askew_jams_the_five_bar_alike_in_both_models(tmp_path, angle):
    """Its loop then holds what the elbows would have to turn: stiffer, and no less in balance."""
    straight, _ = drawn(FIVE_BAR, Drawing(), tmp_path)
    hinge = Drawing({"left_point": at((angle, 0, 0)), "right_point": at((angle, 0, 0))})
    robot, askew = drawn(replace(FIVE_BAR, actuators=()), hinge, tmp_path)
    C = robot.compliance(askew).C
    assert not agree(C, straight.compliance(straight.home).C, 0.1)
    wrench = np.array([0.1, -0.2, 0, 0, 0, 0.01])
    assert agree(robot.equilibrium(askew, wrench).displacement, C @ wrench, 1e-5)


def rigid_directions(result) -> np.ndarray:
    """Return an orthonormal basis (6, n) of what no module yields to."""
    try:
        assert np.isfinite(result.K).all()
    except NoStiffnessError as error:
        return np.linalg.qr(error.directions.T)[0]
    return np.zeros((6, 0))


@pytest.mark.parametrize("digits", [7, 10])
@pytest.mark.parametrize(("machine", "drawing"), CROOKED.values(), ids=CROOKED)
def test_seven_digits_of_a_drawing_are_enough(tmp_path, machine, drawing, digits):
    """Parallel axes are then parallel to 1e-7: redundant loops still close, and nothing is stiff that was free."""
    results = []
    for each in (drawing, replace(drawing, digits=digits)):
        folder = tmp_path / str(each.digits)
        folder.mkdir()
        robot, pose = drawn(machine, each, folder)
        at_rest = robot.compliance(pose)
        loaded = robot.equilibrium(pose, turned(np.array(machine.wrench), drawing.ground.T))
        counted = robot.mobility(pose)
        results.append((at_rest, loaded, (counted.rank, counted.idle_joints, counted.redundant_loops)))
    (at_rest, loaded, counted), (rounded, rounded_loaded, recounted) = results
    assert recounted == counted
    assert agree(rounded.C, at_rest.C, 1e-6)
    assert agree(rounded_loaded.C, loaded.C, 1e-6)
    assert agree(rounded_loaded.displacement, loaded.displacement, 1e-6)
    for found, exact in ((rounded, at_rest), (rounded_loaded, loaded)):
        basis, expected = rigid_directions(found), rigid_directions(exact)
        assert basis.shape == expected.shape
        assert basis @ basis.T == pytest.approx(expected @ expected.T, abs=2e-6)
    # ... and under load no more and no less is rigid than at rest
    assert rigid_directions(loaded).shape == rigid_directions(at_rest).shape


def test_many_samples_of_a_redundant_robot_at_once(tmp_path):
    robot, pose = drawn(FIVE_BAR, Drawing({"left_rod": SKEW}), tmp_path)
    wrenches = np.random.default_rng(1).normal(size=(9, 6)) * np.repeat([50.0, 5.0], 3)
    poses = [pose, robot.home]
    found = find_equilibria(robot._chain, poses, np.arange(9) % 2, Conditions(wrenches))
    assert found.converged.all()
    for index in range(9):
        alone = robot.equilibrium(poses[index % 2], wrenches[index])
        assert found.tool[index] == pytest.approx(alone.base_from_tool, abs=1e-11)


@pytest.mark.parametrize("machine", [FIVE_BAR, THREE_PRUP], ids=["five-bar", "3prup"])
def test_what_was_found_can_be_copied_and_sent(tmp_path, machine):
    robot, pose = drawn(machine, Drawing(), tmp_path)
    loaded = robot.equilibrium(pose, machine.wrench)
    for other in (copy.deepcopy(loaded), pickle.loads(pickle.dumps(loaded))):
        assert np.array_equal(other.displacement, loaded.displacement)
        assert np.array_equal(other.C, loaded.C)
        assert other.energy(1) == loaded.energy(1)
