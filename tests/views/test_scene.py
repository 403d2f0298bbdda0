"""The scene's numbers are those of the compliance: what is drawn is what was computed, enlarged."""

import base64
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import umsgpack

import prup_pin
from prup_pin.errors import PrupPinError
from prup_pin.spatial import skew
from prup_pin.views.meshcat.commands import scene_commands
from prup_pin.views.meshcat.view import View, view
from prup_pin.views.scene.colours import MAP, map_colour, rgb_of
from prup_pin.views.scene.motions import load_ramp, path_motion, vibration
from prup_pin.views.scene.painter import pose_scene
from prup_pin.views.scene.scene import Mesh, Solid, Tube, ball_mesh, belt_mesh, box_mesh, clustered, thread_mesh
from prup_pin.views.scene.workspace import workspace_cloud

from ..statics import cranks

ROBOTS = Path(__file__).parents[1] / "robots"
WRENCH = np.array([300, 0, 40, 0, 20, 30.0])
SCALE = 7.0


@pytest.fixture(scope="module")
def compliance(robot):
    return robot.compliance(robot.pose(z=0.4, theta=0.436, phi=0.262))


@pytest.fixture(scope="module")
def scene(robot, compliance):
    return pose_scene(robot, compliance.pose, WRENCH, SCALE, compliance=compliance)


def line_of(part):
    """Centre line of a tube or a cylinder, base axes."""
    shape = part.shape
    points = shape.points if isinstance(shape, Tube) else np.outer([-0.5, 0.5], [0, 0, shape.size[2]])
    return points @ part.placement[:3, :3].T + part.placement[:3, 3]


def volume(mesh):
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    return float(np.einsum("ni,ni->", a, np.cross(b, c))) / 6


BEAMS = [f"leg{leg}/{beam}" for leg in (1, 2, 3) for beam in ("linear_rod", "moving_star_branch")]


# -- bodies and beams --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", BEAMS)
def test_bent_beam_is_the_elastic_line(robot, compliance, scene, name):
    module = next(m for m in robot.mechanism.modules if m.name == name)
    drawn = line_of(scene.part(f"robot/deformed/beams/{name}"))
    line = compliance.elastic_line(name, WRENCH)
    expected = line.points + SCALE * line.displacement
    gaps = np.linalg.norm(drawn[None] - expected[:, None], axis=-1).min(axis=1)
    np.testing.assert_allclose(gaps, 0, atol=1e-9)
    # through the displacement of both end frames, but for the way along which the beam slides
    axis = (line.points[-1] - line.points[0]) / np.linalg.norm(line.points[-1] - line.points[0])
    for end, frame in ((0, module.root.name), (-1, module.frame.name)):
        moved = line.points[end] + SCALE * compliance.deflection(WRENCH, frame=frame)[:3]
        assert np.linalg.norm(np.cross(drawn - moved, axis), axis=1).min() < 1e-9
        turned = compliance.deflection(WRENCH, frame=frame)[3:]
        np.testing.assert_allclose(line.rotation[end], turned, atol=1e-12)


@pytest.mark.parametrize("name", BEAMS)
def test_bent_beam_has_the_computed_slope_at_its_end(robot, compliance, scene, name):
    """Bodies reach beyond one end of the span, straight on along the section's rotation there."""
    line = compliance.elastic_line(name, WRENCH)
    drawn = line_of(scene.part(f"robot/deformed/beams/{name}"))
    straight = line_of(scene.part(f"robot/ghost/beams/{name}"))
    axis = (straight[-1] - straight[0]) / np.linalg.norm(straight[-1] - straight[0])
    beyond = drawn[1] - drawn[0] if name.endswith("linear_rod") else drawn[-1] - drawn[-2]
    rotation = line.rotation[0] if name.endswith("linear_rod") else line.rotation[-1]
    expected = axis + SCALE * np.cross(rotation, axis)
    assert np.linalg.norm(np.cross(beyond, expected)) < 1e-9 * np.linalg.norm(beyond)
    # inside, the slope at the other end of the rod, extrapolated from the last sections
    if name.endswith("linear_rod"):
        p, h = drawn[drawn.shape[0] - 4 :], np.linalg.norm(line.points[1] - line.points[0])
        p = p[np.concatenate(([True], np.linalg.norm(np.diff(p, axis=0), axis=1) > 1e-9))]
        slope = (3 * p[-1] - 4 * p[-2] + p[-3]) / (2 * h)
        np.testing.assert_allclose(slope, axis + SCALE * np.cross(line.rotation[-1], axis), atol=2e-4)


@pytest.mark.parametrize("visual", ["", "cylinder", "box"])
@pytest.mark.parametrize(("root", "tip"), [("crank", "crank_end"), ("crank_end", "crank")])
def test_a_crank_is_drawn_bent_once(tmp_path, root, tip, visual):
    """From its joint, which stays, to its end, which goes where what it carries goes; with its own geometry too."""
    shapes = {
        "cylinder": f'<cylinder radius="0.006" length="{cranks.LENGTH}"/>',
        "box": f'<box size="0.01 0.01 {cranks.LENGTH}"/>',
    }
    at = f'<origin xyz="{cranks.LENGTH / 2} 0 0" rpy="0 {np.pi / 2} 0"/>'
    own = f"<visual>{at}<geometry>{shapes[visual]}</geometry></visual>" if visual else ""
    path = tmp_path / "crank.urdf"
    path.write_text(cranks.crank_file(root, tip, visual=own))
    robot = prup_pin.load(path)
    load, scale = np.array([0, cranks.FORCE, 0, 0, 0, 0]), 3.0
    scene = pose_scene(robot, None, load, scale)
    part = scene.part("robot/deformed/beams/rod")
    shape = part.shape.points if isinstance(part.shape, Tube) else part.shape.vertices
    points = shape @ part.placement[:3, :3].T + part.placement[:3, 3]
    still = robot.home.base_from_tool[0, 3] - 0.1
    ends = [points[np.abs(points[:, 0] - x) < 0.012].mean(axis=0)[1] for x in (0.0, still)]
    moved, _ = cranks.along([0, 1])
    np.testing.assert_allclose(ends, scale * moved, atol=1e-5 if visual == "box" else 1e-9)


def test_links_move_rigidly_with_their_frames(robot, compliance, scene):
    drawn = [part for part in scene.parts if part.path.startswith("robot/deformed/links/")]
    assert len(drawn) == 10
    for part in drawn:
        link = part.path.split("/")[3]
        ghost = scene.part(f"robot/ghost/links/{link}")
        turn = part.placement[:3, :3]
        np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
        twist = SCALE * compliance.deflection(WRENCH, frame=link)
        at = compliance.pose.placement(link)
        offset = at[:3, :3].T @ (ghost.placement[:3, 3] - at[:3, 3])
        turned = turn @ ghost.placement[:3, :3].T
        np.testing.assert_allclose(
            part.placement[:3, 3], at[:3, 3] + twist[:3] + turned @ at[:3, :3] @ offset, atol=1e-12
        )
    # the turn is the frame's, to first order in the scale
    small = pose_scene(robot, compliance.pose, WRENCH, 1e-3, compliance=compliance)
    for part in drawn:
        twist = 1e-3 * compliance.deflection(WRENCH, frame=part.path.split("/")[3])
        turned = small.part(part.path).placement[:3, :3] @ scene_turn(scene, part).T
        np.testing.assert_allclose(turned, np.eye(3) + skew(twist[3:]), atol=1e-8)


def scene_turn(scene, part):
    return scene.part(part.path.replace("deformed", "ghost")).placement[:3, :3]


def test_the_deformed_robot_stays_together(robot, compliance):
    """At a large scale too: the yoke's lower end stands where the cross is."""
    scene = pose_scene(robot, compliance.pose, [300, 0, 0, 0, 0, 0], 50, compliance=compliance)
    for leg in (1, 2, 3):
        yoke, cross = (scene.part(f"robot/deformed/links/leg{leg}_{name}").placement for name in ("yoke", "cross"))
        along = cross[:3, 3] - yoke[:3, 3]
        assert np.linalg.norm(np.cross(yoke[:3, 2], along)) < 0.12 * np.linalg.norm(along)


EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.parametrize(
    ("name", "load"),
    [("five_bar", [2000, 0, 0, 0, 0, 0]), ("delta", [200, 0, 0, 0, 0, 0]), ("three_rrr", [200.0] + 5 * [0])],
)
def test_beams_on_hinges_are_drawn_from_joint_to_joint(name, load):
    """Hinges turn with the robot's deflection: what meets at a joint still meets where the deflection is enlarged."""
    robot = prup_pin.load(EXAMPLES / f"{name}.urdf")
    found, scale = robot.compliance(robot.home), 30.0
    scene = pose_scene(robot, None, load, scale)
    for module in robot.mechanism.modules:
        if not module.kind.spans_frames:
            continue
        line = line_of(scene.part(f"robot/deformed/beams/{module.name}"))
        for end, frame in ((line[0], module.root.name), (line[-1], module.frame.name)):
            moved = robot.home.placement(frame)[:3, 3] + scale * found.deflection(load, frame=frame)[:3]
            np.testing.assert_allclose(end, moved, atol=1e-9)


def test_ghost_is_the_pose_itself(robot, compliance, scene):
    plain = pose_scene(robot, compliance.pose, compliance=compliance)
    ghosts = [part for part in scene.parts if part.path.startswith("robot/ghost/")]
    assert len(ghosts) == 16
    for part in ghosts:
        own = plain.part(part.path.replace("robot/ghost", "robot"))
        np.testing.assert_allclose(part.placement, own.placement, atol=1e-15)
        assert part.opacity < 0.5 < own.opacity


def test_the_base_stays(scene):
    assert not [part for part in scene.parts if part.path.startswith(("robot/ghost/base", "robot/deformed/base"))]
    assert [part for part in scene.parts if part.path.startswith("robot/base/")]


def test_deflection_arrow_and_tool_frame(compliance, scene):
    tool = compliance.pose.base_from_tool[:3, 3]
    moved = SCALE * compliance.deflection(WRENCH)
    head = scene.part("deflection/head")
    tip = head.placement[:3, 3] + head.shape.size[2] / 2 * head.placement[:3, 2]
    np.testing.assert_allclose(tip - tool, moved[:3], atol=1e-12)
    assert f"{1e3 * np.linalg.norm(compliance.deflection(WRENCH)[:3]):.2f} mm" in [label.text for label in scene.labels]


def test_wrench_arrows(compliance, scene):
    arrow = scene.part("wrench/force/shaft").placement[:3, 2]
    np.testing.assert_allclose(arrow, WRENCH[:3] / np.linalg.norm(WRENCH[:3]), atol=1e-12)
    axis = scene.part("wrench/moment/arc").placement[:3, 2]
    np.testing.assert_allclose(axis, WRENCH[3:] / np.linalg.norm(WRENCH[3:]), atol=1e-12)
    # the arc runs by the right hand about the moment
    points = scene.part("wrench/moment/arc").shape.points
    assert np.cross(points[0], points[1])[2] > 0
    assert {"302.7 N", "36.06 N m"} <= {label.text for label in scene.labels}


# -- ellipsoids --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "block"), [("translation", slice(0, 3)), ("rotation", slice(3, 6))])
def test_ellipsoid_axes_are_eigenvectors(compliance, scene, name, block):
    c = compliance.C[block, block]
    ball, part = scene.ellipsoids[name], scene.part(f"ellipsoids/{name}/surface")
    assert part.shape.kind == "ball"
    turn = part.placement[:3, :3]
    np.testing.assert_allclose(turn.T @ turn, np.eye(3), atol=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1)
    np.testing.assert_allclose(
        turn @ np.diag(part.shape.size) / 2 @ turn.T / ball.scale, c, rtol=1e-9, atol=1e-9 * np.abs(c).max()
    )
    for value, axis in zip(ball.values, ball.axes.T, strict=True):
        np.testing.assert_allclose(c @ axis, value * axis, atol=1e-12 * np.abs(c).max())
    assert (np.diff(ball.values) <= 0).all()
    np.testing.assert_allclose(np.sort(ball.values), np.linalg.eigvalsh(c), rtol=1e-12)


def test_ellipsoids_are_labelled_with_their_semi_axes(compliance, scene):
    words = [label.text for label in scene.labels if label.path.startswith("ellipsoids")]
    translation = np.linalg.eigvalsh(compliance.C[:3, :3]) * 1e6
    rotation = np.linalg.eigvalsh(compliance.C[3:, 3:]) * 1e6
    for value in translation:
        assert any(w.endswith(" µm/N") and float(w.split()[0]) == pytest.approx(value, rel=5e-3) for w in words)
    for value in rotation:
        assert any(w.endswith(" µrad/(N m)") and float(w.split()[0]) == pytest.approx(value, rel=5e-3) for w in words)


def test_ellipsoid_at_the_tool_and_none(robot, compliance):
    at_tool = pose_scene(robot, compliance.pose, compliance=compliance, ellipsoids="tool")
    np.testing.assert_allclose(at_tool.ellipsoids["translation"].centre, compliance.pose.base_from_tool[:3, 3])
    assert not pose_scene(robot, compliance.pose, compliance=compliance, ellipsoids="none").ellipsoids
    with pytest.raises(prup_pin.InputError, match="beside"):
        pose_scene(robot, compliance.pose, compliance=compliance, ellipsoids="above")


def test_rigid_blocks_have_no_ellipsoid():
    """A delta with compliant motors only translates."""
    robot = prup_pin.load(ROBOTS / "delta/robot.urdf", joint_stiffness=1e4, tool="centre")
    scene = pose_scene(robot, None, [100, 0, 50, 0, 0, 0])
    assert set(scene.ellipsoids) == {"translation"}
    assert any("does not turn" in line for line in scene.legend.lines)


# -- colours and words -------------------------------------------------------------------------------------------------


def test_modules_are_coloured_by_their_share(compliance, scene):
    shares = compliance.shares(WRENCH)
    largest = max(shares, key=shares.get)
    for name in BEAMS:
        colour = scene.part(f"robot/deformed/beams/{name}").colour
        assert colour == map_colour(shares[name] / float(scene.legend.scale_ends[1].split()[0]) * 100)
    assert scene.legend.rows[0].name == largest
    for name in ("ball_screw", "ball_nut", "support_bearing", "timing_belt", "motor", "R_lambda", "R_phi", "R_theta_P"):
        assert [part for part in scene.parts if part.path == f"modules/leg1/{name}"]
    shown = sum(float(row.value.split()[0]) for row in scene.legend.rows)
    assert shown == pytest.approx(100, abs=0.4)


def lightness(colour):
    """CIE L* of an sRGB colour."""
    linear = np.where(rgb_of(colour) > 0.04045, ((rgb_of(colour) + 0.055) / 1.055) ** 2.4, rgb_of(colour) / 12.92)
    y = float(linear @ [0.2126, 0.7152, 0.0722])
    return 116 * np.cbrt(y) - 16


def test_the_colour_map_is_even():
    """Lightness alone orders the values, in nearly equal steps, so that colour-blind people see the same."""
    steps = np.diff([lightness(colour) for colour in MAP])
    assert (steps < 0).all()
    assert steps.max() / steps.min() > 0.5


def test_paths_are_unique_and_clean(scene):
    paths = [part.path for part in scene.parts]
    assert len(set(paths)) == len(paths)
    folders = {path.split("/")[0] for path in paths}
    assert folders == {"robot", "modules", "drives", "frames", "wrench", "deflection", "ellipsoids", "floor"}


def test_up_is_against_gravity(robot, scene):
    turn = scene.display_from_base[:3, :3]
    down = turn @ robot.mechanism.gravity
    np.testing.assert_allclose(down / np.linalg.norm(down), [0, 0, -1], atol=1e-12)
    assert np.linalg.det(turn) > 0


def test_scale(robot, compliance):
    free = pose_scene(robot, compliance.pose, WRENCH, compliance=compliance)
    assert float(f"{free.scale:.0e}") == free.scale
    assert pose_scene(robot, compliance.pose, WRENCH, 50, compliance=compliance).scale == 50
    for wrong in (-1, np.nan, np.inf):
        with pytest.raises(prup_pin.InputError, match="scale"):
            pose_scene(robot, compliance.pose, WRENCH, wrong)


def test_wrong_input(robot, compliance):
    with pytest.raises(prup_pin.InputError, match="another pose"):
        pose_scene(robot, robot.home, WRENCH, compliance=compliance)
    with pytest.raises(prup_pin.InputError, match="compliant"):
        pose_scene(prup_pin.load("ur5"), None, WRENCH)
    with pytest.raises(prup_pin.InputError, match="motion"):
        view(robot, motion="dance")
    with pytest.raises(prup_pin.InputError, match="modes 1 to"):
        view(robot, motion="mode 7")


def test_arrays_are_frozen(scene):
    with pytest.raises(ValueError, match="read-only"):
        scene.part("robot/deformed/beams/leg1/linear_rod").shape.points[0] = 0


# -- other robots ------------------------------------------------------------------------------------------------------


def test_a_robot_without_geometry_has_a_skeleton():
    robot = prup_pin.load(ROBOTS / "five_bar/five_bar.urdf", joint_stiffness=1e3)
    scene = pose_scene(robot, None, [10, 5, 0, 0, 0, 0])
    bones = [part for part in scene.parts if part.path.startswith("robot/deformed/skeleton/")]
    assert len(bones) >= 4
    tool = (
        robot.home.base_from_tool[:3, 3]
        + scene.scale * robot.compliance(robot.home).deflection([10, 5, 0, 0, 0, 0])[:3]
    )
    ends = np.concatenate([part.shape.points for part in bones if isinstance(part.shape, Tube)])
    assert np.linalg.norm(ends - tool, axis=1).min() < 1e-9


@pytest.mark.parametrize("stiffness", [None, 1e6])
def test_a_robot_without_a_tool_is_drawn_without_one(stiffness):
    robot = prup_pin.load(ROBOTS.parents[1] / "urdf/ball_screw_axis.urdf", joint_stiffness=stiffness)
    assert robot.mechanism.tool is None
    scene = pose_scene(robot)
    assert {label.text for label in scene.labels} >= {"base"}
    assert "tool" not in {label.text for label in scene.labels}
    assert not scene.ellipsoids
    with pytest.raises(PrupPinError, match=r"no tool frame|no module .* is compliant"):
        pose_scene(robot, None, [1, 0, 0, 0, 0, 0])


def test_a_robot_of_mujoco_has_a_skeleton():
    robot = prup_pin.load(ROBOTS / "five_bar/five_bar.xml", joint_stiffness=1e3, tool="left_rod")
    assert [part for part in pose_scene(robot).parts if part.path.startswith("robot/skeleton/")]


def test_ur5_has_its_meshes():
    pytest.importorskip("trimesh")
    robot = prup_pin.load("ur5", joint_stiffness=1e4)
    scene = pose_scene(robot, None, [0, 0, -50, 0, 0, 0])
    meshes = [part for part in scene.parts if part.path.startswith("robot/deformed/links/")]
    assert len(meshes) > 6
    assert all(isinstance(part.shape, Mesh) and part.shape.smooth for part in meshes)
    assert not [part for part in scene.parts if "skeleton" in part.path]
    assert {"translation", "rotation"} == set(scene.ellipsoids)
    assert [part for part in scene.parts if part.path == "modules/elbow_joint"]


def write_robot(folder, visual):
    path = folder / "arm.urdf"
    path.write_text(
        f"""<robot name="arm"><link name="base"/>
        <link name="arm"><inertial><origin xyz="0.5 0 0"/><mass value="2"/>
          <inertia ixx="0.01" iyy="0.02" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial>{visual}</link>
        <link name="hand"/>
        <joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
          <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
        <joint name="end" type="fixed"><parent link="arm"/><child link="hand"/><origin xyz="0.8 0 0"/></joint>
        </robot>""",
        encoding="utf-8",
    )
    return prup_pin.load(path, tool="hand", joint_stiffness=500.0)


def test_primitives(tmp_path):
    robot = write_robot(
        tmp_path,
        '<visual><origin xyz="0.4 0 0"/><geometry><box size="0.8 0.1 0.1"/></geometry>'
        '<material name="m"><color rgba="1 0 0 0.5"/></material></visual>',
    )
    part = pose_scene(robot).part("robot/links/arm")
    assert part.shape == Solid("box", (0.8, 0.1, 0.1))
    assert (part.colour, part.opacity) == ("#ff0000", 0.5)
    np.testing.assert_allclose(part.placement[:3, 3], [0.4, 0, 0])


def test_meshes_and_missing_meshes(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    trimesh.creation.box((0.8, 0.1, 0.1)).export(tmp_path / "box.stl")
    visual = '<visual><geometry><mesh filename="{}" scale="2 1 1"/></geometry></visual>'
    robot = write_robot(tmp_path, visual.format("box.stl"))
    part = pose_scene(robot).part("robot/links/arm")
    np.testing.assert_allclose(np.ptp(part.shape.vertices, axis=0), [1.6, 0.1, 0.1])
    assert volume(part.shape) == pytest.approx(0.016)
    # a missing mesh is said and replaced by the skeleton
    scene = pose_scene(write_robot(tmp_path, visual.format("gone.stl")))
    assert any("gone.stl" in note and "missing" in note for note in scene.legend.notes)
    assert [part for part in scene.parts if part.path.startswith("robot/skeleton/")]
    (tmp_path / "bad.stl").write_bytes(b"no mesh at all")
    assert any("bad.stl" in note for note in pose_scene(write_robot(tmp_path, visual.format("bad.stl"))).legend.notes)


# -- motions -----------------------------------------------------------------------------------------------------------


def test_load_ramp_goes_from_nothing_to_the_load(robot, compliance):
    motion = load_ramp(robot, compliance.pose, WRENCH, SCALE, frames=21)
    tool = compliance.pose.base_from_tool[:3, 3]
    moved = [frame.part("frames/tool/x/shaft").placement for frame in motion.frames]
    still = (
        pose_scene(robot, compliance.pose, WRENCH, SCALE, compliance=compliance).part("frames/tool/x/shaft").placement
    )
    np.testing.assert_allclose(moved[10], still, atol=1e-12)
    np.testing.assert_allclose(moved[0], moved[-1], atol=1e-12)
    head = motion.frames[0].part("robot/deformed/links/hub")
    np.testing.assert_allclose(head.placement, motion.frames[0].part("robot/ghost/links/hub").placement, atol=1e-12)
    assert np.linalg.norm(tool) > 0


def test_path_visits_the_poses(robot):
    poses = [robot.pose(z=0.35 + 0.01 * i, theta=0.05 * i, phi=0) for i in range(5)]
    motion = path_motion(robot, poses)
    assert len(motion.frames) == 5
    for pose, frame in zip(poses, motion.frames, strict=True):
        np.testing.assert_allclose(frame.part("robot/links/hub").placement, pose.placement("hub"), atol=1e-12)
    told = View(motion).message()
    assert told["words"]["rate"] == motion.rate
    commands = {name: umsgpack.unpackb(base64.b64decode(text)) for name, (_, text) in told["commands"].items()}
    for pose, frame in zip(poses, told["words"]["frames"], strict=True):
        here = [commands[name] for name in frame["drawn"] if commands[name]["path"] == "/robot/links/hub"]
        assert [command["type"] for command in here] == ["set_object", "set_transform"]
        np.testing.assert_allclose(np.reshape(here[1]["matrix"], (4, 4)).T, pose.placement("hub"), atol=1e-12)


def test_vibration_is_one_period(robot, compliance):
    motion = vibration(robot, compliance.pose, 1, frames=8)
    rest, one, _, three = (motion.frames[i].part("robot/deformed/links/hub").placement[:3, 3] for i in (0, 2, 4, 6))
    np.testing.assert_allclose(one - rest, rest - three, atol=1e-12)
    assert "Hz" in " ".join(motion.frames[0].legend.lines)
    assert not [part for part in motion.frames[2].parts if part.path.startswith("wrench")]


def test_cloud_is_coloured_by_the_index(robot):
    poses = [robot.pose(z=z, theta=0.1, phi=0.0) for z in (0.3, 0.5)]
    scene = workspace_cloud(robot, poses)
    cloud = scene.part("workspace/cloud").shape
    centres = cloud.vertices.reshape(2, -1, 3).mean(axis=1)
    np.testing.assert_allclose(centres, [pose.base_from_tool[:3, 3] for pose in poses], atol=1e-9)
    values = [np.linalg.eigvalsh(robot.compliance(pose).C[:3, :3])[-1] * 1e6 for pose in poses]
    colours = cloud.colours.reshape(2, -1, 3)[:, 0]
    np.testing.assert_allclose(colours[int(np.argmax(values))], rgb_of(MAP[-1]))
    np.testing.assert_allclose(colours[int(np.argmin(values))], rgb_of(MAP[0]))
    assert scene.legend.scale_ends[1].endswith("µm/N")

    def turning_about_z(compliance):
        return compliance.C[5, 5]

    assert workspace_cloud(robot, poses, turning_about_z).legend.scale_title == "turning_about_z"
    with pytest.raises(prup_pin.InputError, match="not finite"):
        workspace_cloud(robot, poses, lambda compliance: np.nan)


# -- shapes and commands -----------------------------------------------------------------------------------------------


def test_surfaces_are_closed_and_face_outwards():
    angle = np.linspace(0, 1.5, 60)
    bent = Tube(np.column_stack((np.cos(angle), np.sin(angle), 0.1 * angle)), 0.05, sides=48).mesh
    length = float(np.linalg.norm([1.5, 0.15]))
    assert volume(bent) == pytest.approx(np.pi * 0.05**2 * length, rel=0.01)
    assert volume(ball_mesh(3)) == pytest.approx(4 / 3 * np.pi, rel=0.02)
    assert volume(belt_mesh(1.0, 0.2, 0.2, 0.1, 0.01)) == pytest.approx(0.1 * 0.01 * (2 + 0.41 * np.pi), rel=0.02)
    assert np.abs(np.linalg.norm(thread_mesh(1.0, 5.0).vertices[:, :2], axis=1) - 0.91).max() <= 0.09 + 1e-12
    for along in range(3):
        box = box_mesh((0.1, 0.2, 0.3), along, 9)
        assert volume(box) == pytest.approx(0.006)
        np.testing.assert_allclose(np.ptp(box.vertices, axis=0), [0.1, 0.2, 0.3])
        assert len(np.unique(np.round(box.vertices[:, along], 9))) == 9


def test_commands_are_meshcats(scene):
    commands = scene_commands(scene, scene.display_from_base)
    objects = [command for command in commands if command["type"] == "set_object"]
    assert len(objects) == len(scene.parts)
    assert {command["type"] for command in commands} == {"set_object", "set_transform"}
    assert "/robot/ghost/beams/leg1/linear_rod" in {command["path"] for command in objects}


def test_strange_names_stay_one_folder(tmp_path):
    from prup_pin.views.meshcat.commands import tree_path

    assert tree_path("robot/a.b<object>[0]:c//d") == "/robot/a_b_object__0__c/d"


def test_view_in_a_notebook_and_file(robot, tmp_path):
    shown = view(robot)
    assert isinstance(shown, View)
    assert shown._repr_html_().startswith("<iframe srcdoc=")
    text = shown.save(tmp_path / "deep" / "view.html").read_text(encoding="utf-8")
    assert text.count("<script>") == 2
    assert "connect-src 'none'" in text
    assert shown.url is None
    with pytest.raises(prup_pin.InputError, match="cannot write"):
        shown.save(tmp_path / "deep" / "view.html" / "below.html")


def test_server_is_for_this_machine_only(robot):
    import urllib.error
    import urllib.request

    shown = view(robot, serve=True)
    try:
        with urllib.request.urlopen(shown.url, timeout=600) as answer:
            assert b"meshcat-pane" in answer.read()
        foreign = urllib.request.Request(shown.url, headers={"Host": "evil.example"})
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(foreign, timeout=600)
        assert refused.value.code == 403
        refused.value.close()
        port = int(shown.url.rstrip("/").rpartition(":")[2])
        with pytest.raises(prup_pin.InputError, match="port"):
            view(robot).serve(port)
    finally:
        shown.close()
    assert shown.url is None


def test_scenes_need_no_renderer():
    code = (
        "import sys, prup_pin.views.scene.painter, prup_pin.views.scene.motions, prup_pin.views.meshcat.view\n"
        "heavy = 'meshcat matplotlib trimesh tornado umsgpack IPython'.split()\n"
        "print([name for name in heavy if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


# -- heavy meshes ------------------------------------------------------------------------------------------------------


def test_a_coarser_mesh_keeps_its_shape():
    ball = ball_mesh(5)
    coarse = clustered(Mesh(0.3 * ball.vertices, ball.faces), 0.04)
    assert len(coarse.faces) < 0.1 * len(ball.faces)
    assert volume(coarse) == pytest.approx(4 / 3 * np.pi * 0.027, rel=0.03)
    radii = np.linalg.norm(coarse.vertices, axis=1)
    assert np.abs(radii - 0.3).max() < 0.01
    a, b, c = np.moveaxis(coarse.vertices[coarse.faces], 1, 0)
    outwards = np.einsum("ni,ni->n", np.cross(b - a, c - a), (a + b + c) / 3)
    assert (outwards > 0).mean() > 0.99
    tiny = clustered(Mesh(1e-3 * ball.vertices + 0.5, ball.faces), 1.0)
    assert len(tiny.faces) == 0


@pytest.mark.parametrize("name", [pytest.param("panda", marks=pytest.mark.slow), "ur5"])
def test_a_page_with_heavy_meshes_stays_below_5_mb(name, monkeypatch):
    """Drawn with and without load; and the robot is as large as its files say."""
    robot = prup_pin.load(name, joint_stiffness=1e4, tool="panda_hand" if name == "panda" else None)
    shown = view(robot, None, {"fz": -50})
    assert 2e6 < len(shown.static_html()) < 5e6
    monkeypatch.setattr("prup_pin.views.scene.visuals.PAGE_BYTES", np.inf)
    whole = pose_scene(robot, None, {"fz": -50})
    ends, faces = [], []
    for scene in (shown.scene, whole):
        parts = [part for part in scene.parts if part.path.startswith("robot/ghost/links")]
        points = [part.shape.vertices @ part.placement[:3, :3].T + part.placement[:3, 3] for part in parts]
        ends.append(np.concatenate([np.concatenate(points).min(axis=0), np.concatenate(points).max(axis=0)]))
        faces.append(sum(len(part.shape.faces) for part in parts))
    np.testing.assert_allclose(*ends, atol=0.004)
    assert 10_000 < faces[0] < 0.6 * faces[1]


def test_labels_of_a_page_are_placed_anew_where_only_the_view_shifts():
    """A panel that grew shifted the picture, not the camera: labels stood 55 px below their frames."""
    page = (Path(prup_pin.__file__).parent / "views" / "meshcat" / "page.html").read_text(encoding="utf-8")
    key = page.partition("function watch(clock)")[2].partition("if (now === eye)")[0]
    assert "camera.projectionMatrix.elements" in key
