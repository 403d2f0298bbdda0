"""The same mechanism drawn in another way: turned frames, turned in space, joints in another order, other names.

A planar five-bar is overconstrained: three of its loop's five constraints only forbid what the joints cannot do. Which
they are is decided by rank, and must not hang on how the file draws its frames.
"""

from pathlib import Path

import numpy as np
import pytest
from lxml import etree

import prup_pin
from prup_pin.spatial import placement, rotation_rpy

FIVE_BAR = Path(__file__).parents[1] / "robots" / "five_bar" / "five_bar.urdf"
MOTORS = [0.2, -0.1]
JOINTS = ("left_motor", "left_elbow", "right_motor", "right_elbow")
TURNS = {
    "about x": (0.7, 0.0, 0.0),
    "a right angle about x": (np.pi / 2, 0.0, 0.0),
    "half a turn about x": (np.pi, 0.0, 0.0),
    "tilted": (0.4, -0.3, 0.9),
    "tilted a little": (1e-3, 2e-3, 0.0),
}


def numbers(text):
    return np.array([float(word) for word in text.split()])


def words(values):
    return " ".join(repr(float(value)) for value in values)


def rpy(rotation):
    """Return roll, pitch and yaw of R_z(yaw) R_y(pitch) R_x(roll)."""
    pitch = np.arctan2(-rotation[2, 0], np.hypot(rotation[0, 0], rotation[1, 0]))
    return np.arctan2(rotation[2, 1], rotation[2, 2]), pitch, np.arctan2(rotation[1, 0], rotation[0, 0])


def read_origin(joint):
    origin = joint.find("origin")
    return placement(rotation_rpy(*numbers(origin.get("rpy") or "0 0 0")), numbers(origin.get("xyz")))


def write_origin(joint, at):
    origin = joint.find("origin")
    origin.set("xyz", words(at[:3, 3]))
    origin.set("rpy", words(rpy(at[:3, :3])))


def turn_frame(root, name, turn):
    """Draw the frame of a movable joint turned by a rotation; everything stays where it is in space."""
    joint = root.find(f"joint[@name='{name}']")
    by = placement(turn, np.zeros(3))
    write_origin(joint, read_origin(joint) @ by)
    joint.find("axis").set("xyz", words(turn.T @ numbers(joint.find("axis").get("xyz"))))
    child = joint.find("child").get("link")
    for other in root.findall("joint"):
        if other.find("parent").get("link") == child:
            write_origin(other, by.T @ read_origin(other))
    for module in root.iter("module"):
        if module.get("joint") == name:
            module.set("axis", joint.find("axis").get("xyz"))


def turn_ends(root, turn, free):
    """Draw both frames of the loop turned, so that its hinge turns about another of their axes."""
    for name in ("left_end", "right_end"):
        joint = root.find(f"joint[@name='{name}']")
        write_origin(joint, read_origin(joint) @ placement(turn, np.zeros(3)))
    root.find("prup_pin/loop").set("free", free)


def with_bearings(root):
    """Add bearings that yield across every joint, so that the redundant closures carry self-stress."""
    extension = root.find("prup_pin")
    for index, name in enumerate(JOINTS):
        module = etree.SubElement(extension, "module", name=f"{name}_bearing", type="bearing", joint=name, axis="0 0 1")
        for key, value in (("radial_stiffness", 3e7), ("axial_stiffness", 2e7), ("tilting_stiffness", 4e4)):
            etree.SubElement(module, "parameter", name=key, value=repr(value * (1 + 0.3 * index)))


def five_bar(folder, change, bearings):
    root = etree.fromstring(FIVE_BAR.read_bytes())
    if bearings:
        with_bearings(root)
    change(root)
    path = folder / "redrawn.urdf"
    path.write_bytes(etree.tostring(root))
    return prup_pin.load(path, joint_stiffness=dict.fromkeys(("left_motor", "right_motor"), 10000.0))


@pytest.fixture(params=[False, True], ids=["springs in the motors", "and bearings"])
def bearings(request):
    return request.param


@pytest.fixture
def drawn(tmp_path, bearings):
    (tmp_path / "as_drawn").mkdir()
    return five_bar(tmp_path / "as_drawn", lambda root: None, bearings)


def assert_same(robot, drawn, turn=None, names=None):
    """Both robots at one pose: mobility, C, rigid directions."""
    names, turn = names or {}, np.eye(3) if turn is None else turn
    pose, reference = robot.pose_from_actuators(MOTORS), drawn.pose_from_actuators(MOTORS)
    counted, expected = robot.mobility(pose), drawn.mobility(reference)
    assert (counted.rank, counted.mobility, counted.redundant) == (2, 2, 3)
    assert (expected.rank, expected.mobility, expected.redundant) == (2, 2, 3)
    assert counted.redundant_loops == expected.redundant_loops == ("point",)
    assert counted.idle_joints == expected.idle_joints == ()
    assert pose.balance.self_stress.shape == reference.balance.self_stress.shape == (5, 3)
    both = np.kron(np.eye(2), turn)
    result, other = robot.compliance(pose), drawn.compliance(reference)
    c = both.T @ result.C @ both
    scale = np.sqrt(np.outer(*2 * [np.maximum(np.diag(other.C), 1e-6 * np.diag(other.C).max())]))
    np.testing.assert_allclose(c / scale, other.C / scale, atol=1e-9)
    for name, part in other.parts.items():
        again = both.T @ result.parts[names.get(name, name)] @ both
        np.testing.assert_allclose(again / scale, part / scale, atol=1e-9)
    rigid, expected_rigid = (np.linalg.qr(r.rigid_directions.T)[0] for r in (result, other))
    rigid = both.T @ rigid
    assert rigid.shape == expected_rigid.shape
    np.testing.assert_allclose(rigid @ rigid.T, expected_rigid @ expected_rigid.T, atol=1e-9)
    if not rigid.shape[1]:
        k = both.T @ result.K @ both
        np.testing.assert_allclose(k * scale, other.K * scale, atol=1e-9 * np.abs(other.K * scale).max())


@pytest.mark.parametrize("name", JOINTS)
@pytest.mark.parametrize("turn", TURNS)
def test_a_joint_frame_drawn_turned_changes_nothing(tmp_path, drawn, bearings, turn, name):
    rotation = rotation_rpy(*TURNS[turn])
    assert_same(five_bar(tmp_path, lambda root: turn_frame(root, name, rotation), bearings), drawn)


@pytest.mark.parametrize(
    ("angles", "free"), [((0, np.pi / 2, 0), "rx"), ((-np.pi / 2, 0, 0), "ry"), ((0, 0, 0.8), "rz")]
)
def test_the_ends_of_the_loop_drawn_turned_change_nothing(tmp_path, drawn, bearings, angles, free):
    turn = rotation_rpy(*angles)
    assert np.abs(turn[:, "xyz".index(free[1])]) == pytest.approx([0, 0, 1])

    def change(root):
        turn_ends(root, turn, free)

    assert_same(five_bar(tmp_path, change, bearings), drawn)


@pytest.mark.parametrize("angles", [(0.4, -0.7, 1.1), (np.pi / 2, 0, 0), (1e-3, 0, 0)], ids=str)
def test_the_whole_robot_turned_in_space_changes_nothing(tmp_path, drawn, bearings, angles):
    turn = rotation_rpy(*angles)

    def change(root):
        mount = etree.SubElement(root, "joint", name="mount", type="fixed")
        etree.SubElement(mount, "parent", link="world")
        etree.SubElement(mount, "child", link="base")
        etree.SubElement(mount, "origin", xyz="0.3 -2 5", rpy=words(rpy(turn)))
        etree.SubElement(root, "link", name="world")

    assert_same(five_bar(tmp_path, change, bearings), drawn, turn)


def test_other_names_and_another_order_of_joints_change_nothing(tmp_path, drawn, bearings):
    names = dict(zip(JOINTS, ("z_motor", "y_elbow", "a_motor", "b_elbow"), strict=True))

    def change(root):
        joints = root.findall("joint")
        for joint in joints:
            root.remove(joint)
        root[:0] = joints[::-1]
        for element in root.iter("joint", "module", "actuated"):
            for key in ("name", "joint", "joints"):
                if element.get(key):
                    element.set(key, " ".join(names.get(word, word) for word in element.get(key).split()))

    root = etree.fromstring(FIVE_BAR.read_bytes())
    if bearings:
        with_bearings(root)
    change(root)
    (tmp_path / "renamed.urdf").write_bytes(etree.tostring(root))
    springs = {names[name]: 1e4 for name in ("left_motor", "right_motor")}
    robot = prup_pin.load(tmp_path / "renamed.urdf", joint_stiffness=springs)
    assert tuple(joint.name for joint in robot.mechanism.joints) != JOINTS
    assert_same(robot, drawn, names=names)
