"""Exported files against the corrected model: by this package, by Pinocchio, by yourdfpy and by MuJoCo."""

from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import prup_pin
from prup_pin.dynamics import InMotion, motion_of
from prup_pin.errors import InputError
from prup_pin.export import export_model, exported
from prup_pin.laws import Effect, Place
from prup_pin.laws.deviations import calibration_of
from prup_pin.laws.link_bending import LinkBending
from prup_pin.loading import Reading
from prup_pin.mechanism import JointDynamics
from prup_pin.parameters import SMALLEST_VALUE
from prup_pin.recordings import Recording
from prup_pin.simulation import CorrectedModel, Known, effect_named, read_model, simulate, write_model

EXAMPLES = Path(__file__).parents[2] / "examples"
ARM = """<robot name="arm">
  <!-- a joint aslant, an endless one, a flange that is a link of its own -->
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0.02 0.01 0.2" rpy="0.1 0.2 0"/><mass value="4"/>
    <inertia ixx="0.08" ixy="0.001" ixz="0" iyy="0.07" iyz="0.002" izz="0.02"/></inertial></link>
  <link name="fore"><inertial><origin xyz="0 0.03 0.15" rpy="0 0 0.3"/><mass value="2.5"/>
    <inertia ixx="0.03" ixy="0" ixz="0.001" iyy="0.03" iyz="0" izz="0.008"/></inertial></link>
  <link name="wrist"><inertial><origin xyz="0 0 0.05"/><mass value="0.8"/>
    <inertia ixx="0.002" ixy="0" ixz="0" iyy="0.002" iyz="0" izz="0.001"/></inertial></link>
  <link name="flange"><inertial><origin xyz="0 0 0.01"/><mass value="0.2"/>
    <inertia ixx="0.0002" ixy="0" ixz="0" iyy="0.0002" iyz="0" izz="0.0002"/></inertial></link>
  <joint name="j1" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.3" rpy="0.2 0 0"/>
    <axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="200" velocity="3"/></joint>
  <joint name="j2" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0 0.02 0.4" rpy="0 0.1 0.3"/>
    <axis xyz="0 0.6 0.8"/><limit lower="-3" upper="3" effort="200" velocity="3"/>
    <dynamics damping="0.5" friction="0.1"/></joint>
  <joint name="j3" type="continuous"><parent link="fore"/><child link="wrist"/><origin xyz="0 0 0.3"/>
    <axis xyz="1 0 0"/><limit effort="200" velocity="3"/></joint>
  <joint name="mount" type="fixed"><parent link="wrist"/><child link="flange"/><origin xyz="0 0 0.1" rpy="0 0 0.5"/>
  </joint>
  <prup_pin version="1"><tool frame="flange"/></prup_pin>
</robot>
"""
MUJOCO_ARM = """<mujoco model="arm"><compiler angle="radian"/><worldbody>
  <body name="upper" pos="0 0 0.3" euler="0.1 0 0">
    <inertial pos="0 0.01 0.2" mass="3" diaginertia="0.05 0.05 0.01"/>
    <joint name="shoulder" axis="0 1 0" pos="0 0.02 0.01" ref="0.1" range="-2 2"/>
    <body name="fore" pos="0 0 0.4" quat="0.9 0.1 0 0.2">
      <inertial pos="0.01 0 0.15" mass="2" diaginertia="0.03 0.03 0.01"/>
      <joint name="elbow" axis="0 0.6 0.8" pos="0.01 0 0"/>
      <site name="tool" pos="0 0 0.3"/>
    </body>
  </body></worldbody>
  <prup_pin version="1"><tool frame="tool"/></prup_pin>
</mujoco>"""
#: Kinds of deviations that a robot file holds, with how far each is off here.
GEOMETRIC = {"position": 2e-4, "direction": 2e-4, "length": 2e-4, "encoder_offset": 3e-4}
RELATIVE = ("stiffness", "bending", "mass", "value")


@pytest.fixture
def arm(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(ARM)
    return path


def calibrated(mechanism, seed=1, kinds=()):
    """Return every parameter that a robot file holds, off at random, and parameters of other kinds likewise."""
    rng, values = np.random.default_rng(seed), {}
    for item in calibration_of(mechanism).deviations:
        if item.kind in GEOMETRIC:
            values[item.name] = item.nominal + GEOMETRIC[item.kind] * rng.normal()
        elif item.kind in RELATIVE:
            values[item.name] = item.nominal * float(np.exp(0.1 * rng.normal()))
        elif item.kind in kinds and "marker" not in item.name:
            values[item.name] = item.nominal + 2e-4 * rng.normal()
    return Effect(calibration_of(mechanism), Place("robot"), values)


def bench(robot, count=5, spread=0.03, force=50.0, markers=()):
    """Return a bench test of a robot about its home, under forces and moments of any direction."""
    rng, mechanism = np.random.default_rng(3), robot.mechanism
    home = robot.home.q
    q = {
        name: float(mechanism.joint(name).position(home)) + spread * rng.uniform(-1, 1, count)
        for name in mechanism.actuated
    }
    wrench = force * rng.normal(size=(count, 6)) * [1, 1, 1, 0.1, 0.1, 0.1]
    nothing = np.zeros((count, 3))
    marked = dict.fromkeys(markers, nothing)
    return Recording(
        time=np.arange(count) * 1.0, positions=q, wrench=wrench, position=nothing, rotation=nothing,
        markers=marked, marker_rotations=marked,
    )  # fmt: skip


def weight(mechanism):
    return effect_named("self_weight", "robot", "", {"scale": 1.0}, mechanism)


# -- poses and compliance ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ending", [".urdf", ".xml"])
@pytest.mark.parametrize("name", ["3prup", "six_ups", "elastic_arm"])
def test_a_file_yields_under_loads_as_the_corrected_model_does(name, ending, tmp_path):
    """Offsets, lengths, zeros, stiffnesses and masses at once: the file's robot deflects as the model's, to 1e-9."""
    file = "3prup" if name == "3prup" else str(EXAMPLES / f"{name}.urdf")
    robot = prup_pin.load(file)
    mechanism = robot.mechanism
    effects = (
        calibrated(mechanism),
        effect_named("self_weight", "robot", "", {"scale": 1.05}, mechanism),
        effect_named("payload", mechanism.tool_part, "", {"mass": 0.7}, mechanism),
    )
    made = export_model(CorrectedModel(file, effects), tmp_path / f"corrected{ending}")
    assert made.left_out == ()
    found = prup_pin.load(tmp_path / f"corrected{ending}")
    # what seats of platforms do to the tool's report is a frame of its own
    seen = f"{mechanism.tool.name}_measured"
    seen = seen if seen in found.mechanism.frame_names else None
    recording = bench(robot)
    wanted = simulate(robot, recording, effects)
    drawn = simulate(robot, recording, [weight(mechanism)])
    got = simulate(found, recording, [weight(found.mechanism)], markers=[seen] if seen else [])
    position = got.markers[seen] if seen else got.position
    rotation = got.marker_rotations[seen] if seen else got.rotation
    assert set(wanted.status) == set(got.status) == {"ok"}
    assert np.abs(wanted.position - drawn.position).max() > 1e-4  # the effects are no trifle
    assert np.abs(position - wanted.position).max() < 1e-9
    assert np.abs(rotation - wanted.rotation).max() < 1e-9


@pytest.mark.parametrize("ending", [".urdf", ".xml"])
def test_a_joint_that_yields_is_a_module_of_the_file(arm, ending, tmp_path):
    robot = prup_pin.load(arm)
    mechanism = robot.mechanism
    effects = [calibrated(mechanism)]
    for joint, compliance in (("j1", 1e-4), ("j2", 2e-4)):
        effects.append(effect_named("joint_compliance", joint, "about", {"compliance": compliance}, mechanism))
    effects.append(effect_named("joint_compliance", "j1", "across", {"compliance": 5e-5}, mechanism))
    uneven = {"compliance": 4e-5, "share": 0.3, "direction": 0.7}
    effects.append(effect_named("joint_compliance", "j2", "across by direction", uneven, mechanism))
    made = export_model(CorrectedModel(str(arm), tuple(effects)), tmp_path / f"corrected{ending}")
    assert made.left_out == ()
    recording = bench(robot, spread=0.5, force=20.0)
    wanted = simulate(robot, recording, effects)
    got = simulate(prup_pin.load(tmp_path / f"corrected{ending}"), recording)
    assert np.abs(wanted.position - simulate(robot, recording).position).max() > 1e-4
    assert np.abs(got.position - wanted.position).max() < 1e-9
    assert np.abs(got.rotation - wanted.rotation).max() < 1e-9


@pytest.mark.parametrize("ending", [".urdf", ".xml"])
def test_a_link_that_bends_is_a_module_of_the_file(arm, ending, tmp_path):
    robot = prup_pin.load(arm)
    mechanism = robot.mechanism
    effects = [calibrated(mechanism)]
    for place in LinkBending().places(mechanism):
        effects.append(effect_named("link_bending", place.name, place.aspect, {"flexibility": 1e-4}, mechanism))
    effects.append(effect_named("joint_compliance", "j2", "across", {"compliance": 5e-5}, mechanism))
    assert len(effects) > 3
    made = export_model(CorrectedModel(str(arm), tuple(effects)), tmp_path / f"corrected{ending}")
    assert made.left_out == ()
    recording = bench(robot, spread=0.5, force=20.0)
    wanted = simulate(robot, recording, effects)
    got = simulate(prup_pin.load(tmp_path / f"corrected{ending}"), recording)
    assert np.abs(wanted.position - simulate(robot, recording, effects[:1]).position).max() > 1e-5
    assert np.abs(got.position - wanted.position).max() < 1e-9
    assert np.abs(got.rotation - wanted.rotation).max() < 1e-9


def test_what_a_pose_sensor_sees_is_a_frame_and_its_own_frame_another(arm, tmp_path):
    robot = prup_pin.load(arm)
    kinds = ("target_position", "target_rotation", "frame_position", "frame_rotation")
    effect = calibrated(robot.mechanism, kinds=kinds)
    made = export_model(CorrectedModel(str(arm), (effect,)), tmp_path / "corrected.urdf")
    assert any("flange_measured" in text for text in made.remarks)
    recording = bench(robot, spread=0.5)
    wanted = simulate(robot, recording, [effect])
    model = pin.buildModelFromUrdf(str(tmp_path / "corrected.urdf"))
    data = model.createData()
    for k in range(len(recording)):
        q1, q2, q3 = (recording.positions[name][k] for name in ("j1", "j2", "j3"))
        pin.framesForwardKinematics(model, data, np.array([q1, q2, np.cos(q3), np.sin(q3)]))
        sensor, target = (data.oMf[model.getFrameId(name)] for name in ("pose_sensor", "flange_measured"))
        seen = sensor.inverse() * target
        assert np.abs(seen.translation - wanted.position[k]).max() < 1e-9
        assert np.abs(pin.log3(seen.rotation) - wanted.rotation[k]).max() < 1e-9


# -- other readers -----------------------------------------------------------------------------------------------------


def placements(mechanism, q):
    data = mechanism.model.createData()
    pin.forwardKinematics(mechanism.model, data, q)
    return {
        name: data.oMi[mechanism.frame(name).joint].homogeneous @ mechanism.frame(name).placement
        for name in mechanism.frame_names
    }


@pytest.mark.parametrize("name", ["3prup", "six_ups", "delta", "arm"])
def test_every_reader_puts_links_where_this_package_does(name, arm, tmp_path):
    yourdfpy = pytest.importorskip("yourdfpy")
    file = {"3prup": "3prup", "arm": str(arm)}.get(name, str(EXAMPLES / f"{name}.urdf"))
    robot = prup_pin.load(file)
    model = CorrectedModel(file, (calibrated(robot.mechanism),))
    for ending in (".urdf", ".xml"):
        export_model(model, tmp_path / f"corrected{ending}")
    found = prup_pin.load(tmp_path / "corrected.urdf")
    q, mechanism = found.home.q, found.mechanism
    wanted = placements(mechanism, q)
    drawn = placements(robot.mechanism, robot.home.q)
    assert max(np.abs(wanted[link] - drawn[link]).max() for link in drawn) > 1e-4
    at = {joint.name: float(joint.position(q)) for joint in mechanism.joints}

    plain = pin.buildModelFromUrdf(str(tmp_path / "corrected.urdf"))
    data = plain.createData()
    pin.framesForwardKinematics(plain, data, q)
    by_pinocchio = {frame.name: data.oMf[k].homogeneous for k, frame in enumerate(plain.frames)}

    urdf = yourdfpy.URDF.load(str(tmp_path / "corrected.urdf"), load_meshes=False, build_scene_graph=True)
    urdf.update_cfg({joint: at[joint] for joint in urdf.actuated_joint_names})
    root = urdf.base_link

    compiled = mujoco.MjModel.from_xml_path(str(tmp_path / "corrected.xml"))
    state = mujoco.MjData(compiled)
    mujoco.mj_resetDataKeyframe(compiled, state, 0)
    for joint, value in at.items():
        assert abs(state.qpos[compiled.joint(joint).qposadr[0]] - value) < 1e-9  # the key stands at home
    mujoco.mj_forward(compiled, state)
    loops = np.abs(state.efc_pos[: state.ne]) if state.ne else np.zeros(1)
    assert loops.max() < 1e-9

    links = {link.get("name") for link in _links(tmp_path / "corrected.urdf")}
    for link in links:
        assert np.abs(by_pinocchio[link] - wanted[link]).max() < 1e-9, link
        assert np.abs(urdf.get_transform(link, root) - wanted[link]).max() < 1e-9, link
        is_body = mujoco.mj_name2id(compiled, mujoco.mjtObj.mjOBJ_BODY, link) > 0
        body = state.body(link) if is_body else state.site(link)
        assert np.abs(body.xpos - wanted[link][:3, 3]).max() < 1e-9, link
        assert np.abs(body.xmat.reshape(3, 3) - wanted[link][:3, :3]).max() < 1e-9, link


def _links(path):
    from lxml import etree

    return etree.parse(str(path)).getroot().findall("link")


def test_a_loop_that_leaves_a_hinge_free_is_a_light_body_and_a_weld(tmp_path):
    """MuJoCo has no hinge between two bodies: a loop closes by a body that turns, and weighs nothing."""
    robot = prup_pin.load(EXAMPLES / "five_bar.urdf")
    robot.save(tmp_path / "five_bar.xml")
    compiled = mujoco.MjModel.from_xml_path(str(tmp_path / "five_bar.xml"))
    state = mujoco.MjData(compiled)
    mujoco.mj_resetDataKeyframe(compiled, state, 0)
    mujoco.mj_forward(compiled, state)
    assert state.ne == 6
    assert np.abs(state.efc_pos[: state.ne]).max() < 1e-9
    masses = sum(inertia.mass for inertia in list(robot.model.inertias)[1:])
    assert abs(sum(compiled.body_mass) - masses) < 1e-9
    again = prup_pin.load(tmp_path / "five_bar.xml")
    C = robot.compliance(robot.home).C
    assert np.abs(again.compliance(again.home).C - C).max() < 1e-9 * np.abs(C).max()


# -- efforts -----------------------------------------------------------------------------------------------------------


def arm_effects(mechanism, bodies):
    """Return friction, rotors, a spring, and bodies or a tilted base: the model has no weight of what it adds."""

    def effect(physics, place, aspect="effort", **values):
        return effect_named(physics, place, aspect, values, mechanism)

    resisting = (
        effect("viscous_friction", "j1", damping=3.0),
        effect("coulomb_friction", "j2", limit=1.7, presliding=0.0, smoothing=0.0),
        effect("rotor_inertia", "j1", inertia=0.15),
        effect("rotor_inertia", "j3", inertia=0.05),
        effect("counterbalance", "j2", "effort of a spring", stiffness=12.0, preload=3.0),
    )
    if not bodies:
        return (*resisting, effect("geometric_offset", "base", gx=0.3, gy=-0.2, gz=0.01))
    return (
        *resisting,
        effect(
            "payload", "flange", mass=1.2, x=0.01, y=-0.02, z=0.06,
            Ixx=0.006, Ixy=0.0, Iyy=0.0061, Ixz=0.0, Iyz=0.0001, Izz=0.001,
        ),
        effect("inertial_parameters", "fore", mass=0.3, mx=0.01, my=0.0, mz=0.03,
               Ixx=0.004, Ixy=0.0, Iyy=0.004, Ixz=0.0, Iyz=0.0, Izz=0.001),
    )  # fmt: skip


def motion(mechanism, seconds=4.0):
    """Return a motion of the arm, as this package takes one from a recording."""
    time = np.arange(0.0, seconds, 0.004)
    names = mechanism.actuated
    q = {name: 0.5 * np.sin((1 + 0.4 * k) * time + k) + 0.2 * np.sin((2.7 + k) * time) for k, name in enumerate(names)}
    recording = Recording(time=time, positions=q, efforts=dict.fromkeys(names, np.zeros(len(time))))
    return InMotion.of(mechanism, motion_of(recording, mechanism, list(names)))


def efforts_of(effects, at):
    """Return what the corrected model's drives give (N, k), as `predict` has it."""
    total = at.rigid.copy()
    for effect in effects:
        total += effect.law.efforts(effect.place, effect.values, at)
    return total


@pytest.mark.parametrize("bodies", [True, False])
def test_mujoco_needs_the_efforts_of_the_corrected_model(bodies, arm, tmp_path):
    mechanism = prup_pin.load(arm).mechanism
    effects = arm_effects(mechanism, bodies)
    made = export_model(CorrectedModel(str(arm), effects), tmp_path / "corrected.xml")
    assert made.left_out == ()
    at = motion(mechanism)
    wanted = efforts_of(effects, at)
    compiled = mujoco.MjModel.from_xml_path(str(tmp_path / "corrected.xml"))
    state = mujoco.MjData(compiled)
    count = 0
    for k in np.flatnonzero(np.abs(at.motion.speed[:, 1]) > 0.2)[::20]:
        state.qpos[:], state.qvel[:], state.qacc[:] = (
            values[k] for values in (at.motion.position, at.motion.speed, at.motion.acceleration)
        )
        mujoco.mj_inverse(compiled, state)
        assert np.abs(state.qfrc_inverse - wanted[k]).max() < 1e-9 * np.abs(wanted).max()
        count += 1
    assert count > 20


@pytest.mark.parametrize("bodies", [True, False])
def test_pinocchio_needs_them_less_what_a_urdf_has_no_word_for(bodies, arm, tmp_path):
    mechanism = prup_pin.load(arm).mechanism
    effects = arm_effects(mechanism, bodies)
    made = export_model(CorrectedModel(str(arm), effects), tmp_path / "corrected.urdf")
    left = {item.physics: item.what for item in made.left_out}
    assert set(left) == {"rotor_inertia", "counterbalance"}
    assert len(made.left_out) == 3
    at = motion(mechanism)
    wanted = efforts_of([effect for effect in effects if effect.law.physics not in left], at)
    model = pin.buildModelFromUrdf(str(tmp_path / "corrected.urdf"))
    model.gravity.linear = made.mechanism.gravity  # told among the remarks: a URDF has no word for it
    assert any("gravity" in text for text in made.remarks) != bodies
    assert model.damping.tolist() == [3.0, 0.0, 0.0]
    data = model.createData()
    for k in np.flatnonzero(np.abs(at.motion.speed[:, 1]) > 0.2)[::20]:
        q, v, a = (values[k] for values in (at.motion.position, at.motion.speed, at.motion.acceleration))
        tau = pin.rnea(model, data, np.array([q[0], q[1], np.cos(q[2]), np.sin(q[2])]), v, a)
        tau = tau + model.damping * v + model.upperDryFrictionLimit * np.sign(v)
        assert np.abs(tau - wanted[k]).max() < 1e-9 * np.abs(wanted).max()


def test_an_encoder_that_is_off_for_efforts_stands_there_in_the_file(arm, tmp_path):
    """The law is of first order in the offset, the file exact: they differ by its square."""
    mechanism = prup_pin.load(arm).mechanism
    effect = effect_named("encoder_offset", "j2", "effort", {"offset": 1e-3}, mechanism)
    export_model(CorrectedModel(str(arm), (effect,)), tmp_path / "corrected.urdf")
    at = motion(mechanism)
    wanted = efforts_of([effect], at)
    model = pin.buildModelFromUrdf(str(tmp_path / "corrected.urdf"))
    data = model.createData()
    off, error = 0.0, 0.0
    for k in range(0, len(at.motion), 50):
        q, v, a = (values[k] for values in (at.motion.position, at.motion.speed, at.motion.acceleration))
        tau = pin.rnea(model, data, np.array([q[0], q[1], np.cos(q[2]), np.sin(q[2])]), v, a)
        off, error = max(off, np.abs(at.rigid[k] - wanted[k]).max()), max(error, np.abs(tau - wanted[k]).max())
    assert error < 1e-2 * off


# -- what is left out --------------------------------------------------------------------------------------------------


def test_what_a_file_cannot_say_is_listed_with_what_it_explained(arm, tmp_path):
    mechanism = prup_pin.load(arm).mechanism
    effects = (
        effect_named("viscous_friction", "j1", "effort", {"damping": 3.0}, mechanism),
        effect_named("effort_gain", "j1", "effort", {"gain": 0.1}, mechanism),
        effect_named("coulomb_friction", "j2", "effort by load",
                     {"limit": 1.0, "share_of_load": 0.1, "presliding": 1e-4}, mechanism),
    )  # fmt: skip
    known = (Known({"damping": (2.9, 3.1)}, 0.4), Known(share=0.02), Known(share=0.1))
    model = CorrectedModel(str(arm), effects, notes="diagnosis of monday.csv", known=known)
    write_model(model, tmp_path / "model.json")
    again = read_model(tmp_path / "model.json")
    assert again.known == known
    made = export_model(again, tmp_path / "corrected.urdf")
    assert [(item.physics, item.share) for item in made.left_out] == [
        ("effort_gain", 0.02),
        ("coulomb_friction", None),  # of which the rest is in the file
    ]
    assert "10 % of what the drive passes on" in made.left_out[1].what
    assert [item.physics for item in made.said] == ["viscous_friction", "coulomb_friction"]
    text = (tmp_path / "corrected.urdf").read_text()
    assert "diagnosis of monday.csv" in text
    assert "damping = 3 N m s/rad (95 %: 2.9 to 3.1)" in text
    assert "<!-- a joint aslant, an endless one" in text  # the file's own comments stay
    assert made.dynamics["j2"].friction == 1.0


@pytest.mark.parametrize("ending", [".urdf", ".xml"])
def test_what_a_fit_left_at_zero_is_told_and_written_as_nothing(arm, ending, tmp_path):
    """A model holds it as the least size that a law takes."""
    mechanism = prup_pin.load(arm).mechanism
    effects = (
        effect_named("viscous_friction", "j1", "effort", {"damping": SMALLEST_VALUE}, mechanism),
        effect_named("rotor_inertia", "j1", "effort", {"inertia": SMALLEST_VALUE}, mechanism),
        effect_named("coulomb_friction", "j2", "effort", {"limit": 2.0, "presliding": 1e-4}, mechanism),
        effect_named("viscous_friction", "j2", "effort", {"damping": 3e-50}, mechanism),
    )
    made = export_model(CorrectedModel(str(arm), effects), tmp_path / f"corrected{ending}")
    values = {(item.physics, item.place): item.values for item in made.said}
    assert values["viscous_friction", "j1 (effort)"] == ("damping = 0 N m s/rad (none was found)",)
    assert values["rotor_inertia", "j1 (effort)"] == ("inertia = 0 kg m^2 (none was found)",)
    assert values["viscous_friction", "j2 (effort)"] == ("damping = 3e-50 N m s/rad",)
    assert made.dynamics["j1"] == JointDynamics()
    assert made.dynamics["j2"] == JointDynamics(damping=3e-50, friction=2.0)
    assert not any("rotor" in item.what for item in made.left_out)
    assert "1e-50" not in (tmp_path / f"corrected{ending}").read_text()


def test_what_resists_a_joint_comes_wholly_from_the_model_or_wholly_from_the_robot_file(arm):
    mechanism = prup_pin.load(arm).mechanism
    effect = effect_named("viscous_friction", "j1", "effort", {"damping": 3.0}, mechanism)
    made = exported(CorrectedModel(str(arm), (effect,)), Path("corrected.xml"))
    assert made.dynamics["j2"].damping == 0.5
    assert any("<dynamics> of j2" in text for text in made.remarks)
    effect = effect_named("coulomb_friction", "j2", "effort", {"limit": 2.0, "presliding": 1e-4}, mechanism)
    made = exported(CorrectedModel(str(arm), (effect,)), Path("corrected.xml"))
    assert (made.dynamics["j2"].damping, made.dynamics["j2"].friction) == (0.0, 2.0)
    assert "turns round on a way of 100 µrad" in made.left_out[0].what


def test_of_what_poses_and_efforts_both_tell_the_better_is_kept(arm):
    mechanism = prup_pin.load(arm).mechanism
    effects = (
        effect_named("encoder_offset", "j2", "", {"offset": 2e-3}, mechanism),
        effect_named("self_weight", "robot", "", {"scale": 1.2}, mechanism),
        effect_named("encoder_offset", "j2", "effort", {"offset": 1e-3}, mechanism),
        effect_named("inertial_parameters", "fore", "effort in proportion", {"share": 0.1}, mechanism),
    )
    made = exported(CorrectedModel(str(arm), effects), Path("corrected.urdf"))
    assert [item.physics for item in made.left_out] == ["self_weight", "encoder_offset"]
    masses = [inertia.mass for inertia in list(made.mechanism.model.inertias)[1:]]
    assert np.allclose(masses, [4.0, 2.75, 1.0], rtol=1e-12)
    both = exported(CorrectedModel(str(arm), effects[:1]), Path("corrected.urdf")).mechanism.model.jointPlacements[2]
    assert np.abs((both.inverse() * made.mechanism.model.jointPlacements[2]).homogeneous - np.eye(4)).max() < 1e-12


# -- what is refused ---------------------------------------------------------------------------------------------------


def test_a_name_that_is_no_format_is_refused(arm, tmp_path):
    for name, told in (("robot.step", "'.step' is no ending"), ("robot", "has no ending")):
        with pytest.raises(InputError, match=told):
            export_model(CorrectedModel(str(arm)), tmp_path / name)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["arm.urdf"]


def test_the_robot_file_itself_is_not_replaced(arm):
    with pytest.raises(InputError, match="is the robot file from which the model was made"):
        export_model(CorrectedModel(str(arm)), arm)
    assert arm.read_text() == ARM


def test_a_body_that_cannot_be_is_refused(arm, tmp_path):
    mechanism = prup_pin.load(arm).mechanism
    values = {**dict.fromkeys(("mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz"), 0.0), "mass": -5.0}
    effect = effect_named("inertial_parameters", "fore", "effort", values, mechanism)
    with pytest.raises(InputError, match=r"the body of joint 'j2' would weigh -2\.5 kg"):
        export_model(CorrectedModel(str(arm), (effect,)), tmp_path / "corrected.urdf")
    assert not (tmp_path / "corrected.urdf").exists()


def test_a_body_that_mujoco_refuses_is_refused_with_its_name(arm, tmp_path):
    flat = ARM.replace('ixx="0.03" ixy="0" ixz="0.001" iyy="0.03" iyz="0" izz="0.008"',
                       'ixx="0.03" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.09"')  # fmt: skip
    arm.write_text(flat)
    assert exported(CorrectedModel(str(arm)), tmp_path / "c.urdf").content
    with pytest.raises(InputError, match="body 'fore': its principal moments of inertia"):
        export_model(CorrectedModel(str(arm)), tmp_path / "c.xml")


def test_loops_that_close_only_as_parts_give_way_are_refused(tmp_path):
    file = str(EXAMPLES / "five_bar.urdf")
    model = CorrectedModel(file, (calibrated(prup_pin.load(file).mechanism),))
    with pytest.raises(InputError, match="close only as its parts give way"):
        export_model(model, tmp_path / "corrected.urdf")


@pytest.mark.parametrize("ending", [".urdf", ".xml"])
@pytest.mark.parametrize("name", ["3prup", "six_ups", "mujoco_arm"])
def test_a_robot_that_was_read_from_mjcf_is_written_in_both_formats(name, ending, tmp_path):
    """Bodies whose joints stand beside their origins, and loops: the file's robot deflects as the model's."""
    file = tmp_path / "robot.xml"
    if name == "mujoco_arm":
        file.write_text(MUJOCO_ARM)
    else:
        prup_pin.load("3prup" if name == "3prup" else EXAMPLES / f"{name}.urdf").save(file)
    reading = Reading(joint_stiffness=1e4) if name == "mujoco_arm" else Reading()
    robot = reading.load(str(file))
    mechanism = robot.mechanism
    effects = [calibrated(mechanism), effect_named("self_weight", "robot", "", {"scale": 1.05}, mechanism)]
    if name == "mujoco_arm":
        effects.append(effect_named("inertial_parameters", "fore", "effort in proportion", {"share": 0.2}, mechanism))
        effects.pop(1)
    made = export_model(CorrectedModel(str(file), tuple(effects), reading=reading), tmp_path / f"corrected{ending}")
    found = prup_pin.load(tmp_path / f"corrected{ending}")
    assert made.mechanism.actuated == mechanism.actuated
    seen = f"{mechanism.tool.name}_measured"
    seen = seen if seen in found.mechanism.frame_names else None
    recording = bench(robot, spread=0.3 if name == "mujoco_arm" else 0.03)
    weighs = name != "mujoco_arm"
    wanted = simulate(robot, recording, effects if weighs else effects[:1])
    got = simulate(found, recording, [weight(found.mechanism)] if weighs else [], markers=[seen] if seen else [])
    position = got.markers[seen] if seen else got.position
    assert np.abs(wanted.position - simulate(robot, recording).position).max() > 1e-4
    assert np.abs(position - wanted.position).max() < 1e-9
    if name == "mujoco_arm":
        masses = sorted(inertia.mass for inertia in list(made.mechanism.model.inertias)[1:])
        assert np.allclose(masses, [2.4, 3.0], rtol=1e-9)


# -- what MuJoCo's words are read as -----------------------------------------------------------------------------------


def test_a_joint_that_follows_does_so_in_both_formats(arm, tmp_path):
    follows = '<axis xyz="1 0 0"/><mimic joint="j2" multiplier="-2" offset="0.1"/>'
    arm.write_text(ARM.replace('<axis xyz="1 0 0"/>', follows))
    mechanism = prup_pin.load(arm).mechanism
    effect = effect_named("encoder_offset", "j2", "", {"offset": 2e-3}, mechanism)
    for ending in (".urdf", ".xml"):
        made = export_model(CorrectedModel(str(arm), (effect,)), tmp_path / f"corrected{ending}")
        (follower,) = made.mechanism.coupling.followers
        assert (follower.joint.name, follower.leader.name, follower.ratio) == ("j3", "j2", -2.0)
        assert abs(follower.offset - (0.1 - 2 * 2e-3)) < 1e-12
    compiled = mujoco.MjModel.from_xml_path(str(tmp_path / "corrected.xml"))
    assert np.allclose(compiled.eq_data[0][:2], [0.1 - 2 * 2e-3, -2.0], rtol=1e-12)


def test_a_loop_that_ends_a_quarter_micrometre_beside_its_body_does_so_in_mujoco(tmp_path):
    """MuJoCo takes a site so near as its body's own frame, unless it is turned."""
    robot = prup_pin.load(EXAMPLES / "six_ups.urdf")
    kinds = {item.name: item for item in calibration_of(robot.mechanism).deviations if item.kind in GEOMETRIC}
    values = {name: item.nominal + 2.5e-7 for name, item in kinds.items() if item.kind in ("position", "length")}
    effect = Effect(calibration_of(robot.mechanism), Place("robot"), values)
    export_model(CorrectedModel(str(EXAMPLES / "six_ups.urdf"), (effect,)), tmp_path / "corrected.xml")
    compiled = mujoco.MjModel.from_xml_path(str(tmp_path / "corrected.xml"))
    state = mujoco.MjData(compiled)
    mujoco.mj_resetDataKeyframe(compiled, state, 0)
    mujoco.mj_forward(compiled, state)
    assert np.abs(state.efc_pos[: state.ne]).max() < 1e-9
