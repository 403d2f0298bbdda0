"""A first map is right where names or numbers prove it, and says where it is not sure."""

from __future__ import annotations

import numpy as np
import pytest
import yaml

import prup_pin
from prup_pin.imports import convert, guess, read_log, read_map
from prup_pin.imports.convert import at_rest
from prup_pin.imports.units import spelled, unit_in_name, words_of

from . import logs
from .logs import assert_motion, converted, log_of

Q, QD, TAU = logs.motion()


def imported(tmp_path, log, mechanism):
    """Return the guess and the recording that it makes."""
    first = guess(log, mechanism, "robot")
    return first, converted(tmp_path, first.text, log, mechanism).recording


CASES = {
    "RTDE": ({"timestamp": 812.0 + logs.T}, "actual_q_{}", "target_q_{}", "actual_qd_{}", "actual_moment_{}", 1, 1, 0),
    "PLC in degrees and rpm": (
        {"Zeit [ms]": 1e3 * logs.T}, "J{}_pos[deg]", "J{}_setpoint_pos[deg]", "J{}_vel", "J{}_torque",
        180 / np.pi, 30 / np.pi, 1),
    "degrees that nothing tells": (
        {"t": logs.T}, "q{}", "qd_des{}", "dq{}", "tau{}", 180 / np.pi, 180 / np.pi, 1),
    "milliseconds that the numbers tell": (
        {"time": 1e3 * logs.T}, "pos[{}]", "cmd_pos[{}]", "vel[{}]", "trq[{}]", 1, 1, 0),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_logs_of_controllers(tmp_path, ur5, case):
    time, q, wished, qd, tau, angle, speed, first = CASES[case]
    log = log_of(
        time
        | logs.numbered(wished, angle * Q + 1e-3, first)
        | logs.numbered(q, angle * Q, first)
        | logs.numbered(qd, speed * QD, first)
        | logs.numbered(tau, TAU, first)
    )
    made, recording = imported(tmp_path, log, ur5)
    assert made.doubts == ()
    assert_motion(recording, "q", "qd", "tau")
    assert np.abs(recording.time - logs.T).max() < 1e-9


def test_joints_by_their_names_in_any_order(tmp_path, ur5):
    names = list(reversed(logs.JOINTS))
    columns = {"__time": 1.7e9 + logs.T}
    columns |= {f"/joint_states/{joint}/position": Q[:, logs.JOINTS.index(joint)] for joint in names}
    columns |= {f"/joint_states/{joint}/temperature": 30 + QD[:, 0] for joint in names}
    columns |= {f"/joint_states/{joint}/effort": TAU[:, logs.JOINTS.index(joint)] for joint in names}
    made, recording = imported(tmp_path, log_of(columns), ur5)
    assert made.doubts == ()
    assert_motion(recording, "q", "tau")
    assert list(recording.positions) == list(logs.JOINTS)


def test_joints_by_words_of_their_names_in_any_order(tmp_path, ur5):
    """By the alphabet, as many programs write them, without the word that all end with."""
    names = {name.removesuffix("_joint"): k for k, name in enumerate(logs.JOINTS)}
    q, tau = (
        {f"{what}_{name}": of[:, names[name]] for name in sorted(names)} for what, of in (("pos", Q), ("torque", TAU))
    )
    made, recording = imported(tmp_path, log_of({"time": logs.T} | q | tau), ur5)
    assert made.doubts == ()
    assert_motion(recording, "q", "tau")


def test_an_arm_with_a_hand_and_a_controller_that_logs_much_besides(tmp_path):
    panda = prup_pin.load("panda").mechanism
    q = np.column_stack([Q, Q[:, 0]]) * 0.5 + np.array([0, 0, 0, -1.5, 0, 1.5, 0])
    qd, tau = (np.column_stack([values, values[:, 0]]) * 0.5 for values in (QD, TAU))
    others = ("q_d_{}", "tau_ext_hat_filtered_{}", "joint_temperatures_{}", "tcp_speed_{}", "tau_J_d_{}")
    columns = {"time": logs.T}
    for form in others:
        columns |= logs.numbered(form, np.full_like(q, 7.0) + q**2, 0)
    columns |= logs.numbered("q_{}", q, 0) | logs.numbered("dq_{}", qd, 0) | logs.numbered("tau_J_{}", tau, 0)
    made, recording = imported(tmp_path, log_of(columns), panda)
    assert made.doubts == ()
    assert list(recording.positions) == [f"panda_joint{k}" for k in range(1, 8)]
    for k, joint in enumerate(recording.positions):
        assert np.array_equal(recording.positions[joint], q[:, k])
        assert np.array_equal(recording.velocities[joint], qd[:, k])
        assert np.array_equal(recording.efforts[joint], tau[:, k])


@pytest.mark.parametrize("storage", ["sqlite3", "mcap"])
def test_a_bag_of_joint_states_and_a_wrench(tmp_path, ur5, storage):
    log = read_log(logs.ros2_bag(tmp_path / "bag", logs.T, Q, QD, TAU, storage))
    made, recording = imported(tmp_path, log, ur5)
    assert_motion(recording, "q", "qd", "tau")
    assert all(doubt.startswith("w.") for doubt in made.doubts)
    assert "resample: {clock: /joint_states}" in made.text
    force = recording.wrench[:, 2]
    inside = np.isfinite(force)
    k = (recording.time[inside] - 0.003) / 0.004
    assert np.abs(force[inside] - (3.0 + k)).max() < 1e-4


def test_what_is_not_sure_says_so(ur5):
    def doubts(columns, mechanism=ur5):
        return "\n".join(guess(log_of({"t": logs.T} | columns), mechanism).doubts)

    q = logs.numbered("q{}", Q)
    assert doubts(q) == ""
    assert "up to 0.016: rad or deg" in doubts(logs.numbered("q{}", 0.01 * Q))
    assert "tau.elbow_joint: in A: write how much SI one A is" in doubts(q | logs.numbered("current_{}", TAU))
    assert "qd.elbow_joint: falls where the position rises" in doubts(
        q | logs.numbered("vel_{}", QD * [1, 1, -1, 1, 1, 1])
    )
    mixed = doubts(q | logs.numbered("vel_{}", QD[:, [0, 1, 5, 3, 4, 2]]))
    assert "qd.elbow_joint: is not the rate of the position" in mixed
    assert "qd.wrist_2_joint" not in mixed
    assert "the velocities are not the rate of the positions" in doubts(q | logs.numbered("vel_{}", 3.3 * QD))
    assert "up to 0.05: rad or deg" in doubts(
        logs.numbered("q{}", 0.05 * Q / np.abs(Q).max()) | logs.numbered("qd{}", 0.05 * QD / np.abs(Q).max())
    )
    assert "3 columns for 6 actuated joints" in doubts(logs.numbered("q{}", Q[:, :3]))
    assert "up to 45.84, so not rad" in doubts(logs.numbered("q{}", np.degrees(Q[:, :6]) * 0.5))
    assert "no column was found that is the position of a joint" in doubts({"voltage": logs.T**0})
    assert "the joint's name is made up" in doubts(q, None)
    loads = doubts(q | {"Fx": logs.T, "Fy": logs.T, "Fz": logs.T})
    assert loads.count("what acts on the tool point, in base axes?") == 1
    assert loads.startswith("w.fx: ")
    assert "named after a motor" in doubts(logs.numbered("motor_pos_{}", Q))
    assert "no column is a time: write how many rows a second" in "\n".join(guess(log_of(q), ur5).doubts)


def test_speeds_tell_how_many_rows_a_second_there_are_or_that_rows_are_in_no_order(tmp_path, ur5):
    rows, rate = logs.numbered("q{}", Q) | logs.numbered("qd{}", QD), 1 / np.diff(logs.T)[0]
    first, there = imported(tmp_path, log_of(rows), ur5)
    assert not first.doubts
    assert np.diff(there.time) == pytest.approx(1 / rate, rel=1e-3)
    order = np.random.default_rng(1).permutation(len(Q))
    first = guess(log_of({name: values[order] for name, values in rows.items()}), ur5)
    assert not first.doubts
    assert "the rows are in no order" in first.text
    # what is seen in the same rows needs no other clock
    seen = guess(log_of(rows | {f"p.{axis}": Q[:, k] for k, axis in enumerate("xyz")}), ur5)
    assert "rate of the positions" in seen.text
    assert "The camera may stand anywhere" not in seen.text
    turned = logs.numbered("q{}", Q) | logs.numbered("qd{}", -QD)
    assert any("no column is a time" in text for text in guess(log_of(turned), ur5).doubts)


def test_turns_of_an_endless_joint_are_seen(ur5):
    wrapped = Q.copy()
    wrapped[:, 5] = (3 * logs.T + np.pi) % (2 * np.pi) - np.pi
    lines = yaml.safe_load(guess(log_of({"t": logs.T} | logs.numbered("q{}", wrapped)), ur5).text)["columns"]
    assert [line.get("unwrap", False) for line in lines.values()] == [False] * 5 + [True]


def test_speeds_of_motors_before_their_gears_are_scaled_and_asked_about(tmp_path, ur5):
    """They come 30 ms late, through a filter."""
    late = 50 * logs.motion(logs.T - 0.03)[1]
    log = log_of({"t": logs.T} | logs.numbered("q{} [rad]", Q) | logs.numbered("vel_{} [deg/s]", np.degrees(late)))
    made, recording = imported(tmp_path, log, ur5)
    assert len(made.doubts) == 6
    assert all(doubt.endswith("times the rate of the position in deg/s: of the motor, before its gear?") for doubt in
               made.doubts)  # fmt: skip
    assert_motion(recording, "q")
    for k, name in enumerate(logs.JOINTS):
        assert np.abs(recording.velocities[name] - late[:, k] / 50).max() < 0.03 * np.abs(QD[:, k]).max()


@pytest.mark.parametrize("velocities", [True, False])
def test_degrees_that_are_counted_from_0_to_360_are_within_the_robots_limits(tmp_path, velocities):
    """As they stand they are in no robot's limits, least of all in rad."""
    panda = prup_pin.load("panda").mechanism
    q = 0.8 * np.sin(np.outer(logs.T, np.ones(7)) + np.arange(7)) + [0, 0, 0, -1.5, 0, 1.5, 0]
    columns = {"t": logs.T} | logs.numbered("position_{}", np.degrees(q) % 360)
    if velocities:
        columns |= logs.numbered("velocity_{}", np.degrees(np.gradient(q, logs.T, axis=0)))
    made, recording = imported(tmp_path, log_of(columns), panda)
    assert np.abs(np.column_stack(list(recording.positions.values())) - q).max() < 1e-9
    assert len(made.doubts) == (0 if velocities else 7)  # in deg, for sure or not
    lost = guess(log_of({"t": logs.T} | logs.numbered("position_{}", 1e4 * q)), panda)
    assert "in no unit is that within the robot's limits" in lost.doubts[0]


def test_names_that_yaml_would_misread_come_back(tmp_path, ur5):
    odd = {f"pos: {{{k}}}, #[deg]": np.degrees(Q[:, k]) for k in range(6)}
    made, recording = imported(tmp_path, log_of({"time, [s]": logs.T} | odd), ur5)
    assert made.doubts == ()
    assert np.abs(recording.positions["elbow_joint"] - Q[:, 2]).max() < 1e-9


@pytest.mark.parametrize(
    ("name", "words", "unit"),
    [
        ("TorqueJ3 [Nm]", ["torque", "j", "3"], "N m"),
        ("actual_q_0", ["actual", "q", "0"], None),
        ("q[2]", ["q", "2"], None),
        ("jointVelocity5_deg_s", ["joint", "velocity", "5", "deg", "s"], "deg/s"),
        ("Pos A1 (°)", ["pos", "a", "1"], "deg"),
        ("第１軸角度［度］", ["1"], "deg"),
        ("第1軸トルク[N・m]", ["1"], "N m"),
        ("fx_N", ["fx", "n"], "N"),
        ("tau_m", ["tau", "m"], None),
        ("x [mm] (2)", ["x", "mm", "2"], "mm"),
        ("½ Ø¹ q1 (deg)", ["q", "1"], "deg"),
    ],
)
def test_names_are_read_word_by_word(name, words, unit):
    assert words_of(name) == words
    assert unit_in_name(name) in (unit, {"deg": "°"}.get(unit))


@pytest.mark.parametrize(
    ("text", "unit"),
    [("Nm", "N m"), ("[DEG]", "deg"), ("mm", "mm"), ("1/min", "rpm"), ("m", "m"), ("M", None), ("Nmm", "N mm"),
     ("% ", "%"), ("% Nennmoment", "%"), ("[% of rated]", "%"), ("percent rated", "%"), ("percentile", None),
     ("furlong", None), ("rad/s", "rad/s"), ("°C", "degC")],
)  # fmt: skip
def test_units_are_known_as_people_spell_them(text, unit):
    assert spelled(text) == unit


@pytest.mark.parametrize(
    "heading",
    ["Achse {} Drehmoment [% Nennmoment]", "Achse {} [% Nennmoment]", "torque_{} (% of rated)", "tau{}_pct",
     "torque {} [percent]", "torque_{}_percent_of_rated"],
)  # fmt: skip
def test_a_share_of_the_rated_torque_is_asked_for_its_scale(ur5, heading):
    """It was read as N m without a word."""
    share = np.array([300.0, 300, 150, 28, 28, 28])
    log = log_of({"t": logs.T} | logs.numbered("q{} [rad]", Q) | logs.numbered(heading, 100 * TAU / share))
    text = guess(log, ur5, "robot").text
    for k, joint in enumerate(logs.JOINTS, 1):
        line = next(line for line in text.splitlines() if f"tau.{joint}" in line)
        assert heading.format(k) in line
        assert 'unit: "%"' in line or "unit: '%'" in line
        assert "# CHECK: in %: write how much SI one % is, as `scale`" in line
    assert "effort_gain" in text


def _joint(name, kind, parent, child):
    limit = '<limit lower="-5" upper="5" effort="1" velocity="1"/>'
    ends = f'<parent link="{parent}"/><child link="{child}"/><axis xyz="0 0 1"/>'
    return f'<link name="{child}"/><joint name="{name}" type="{kind}">{ends}{limit}</joint>'


@pytest.fixture(scope="module")
def lift_and_arm(tmp_path_factory):
    """An arm of two joints on a lift."""
    joints = (("lift", "prismatic"), ("shoulder", "revolute"), ("elbow", "revolute"))
    chain = "".join(_joint(name, kind, f"l{k}", f"l{k + 1}") for k, (name, kind) in enumerate(joints))
    path = tmp_path_factory.mktemp("lift") / "lift.urdf"
    path.write_text(f'<robot name="lift"><link name="l0"/>{chain}</robot>')
    return prup_pin.load(path).mechanism


def arm_columns():
    turning = {f"Winkel A{k} [deg]": np.degrees(Q[:, k]) for k in (1, 2)}
    return {"Zeit [s]": logs.T} | turning | {f"Moment A{k} [Nm]": TAU[:, k] for k in (1, 2)}


def test_a_slide_without_a_name_in_the_log_is_found_by_its_unit_and_doubted(lift_and_arm):
    lift = {"Hub [mm]": 300 + Q[:, 0], "Kraft Hub [N]": TAU[:, 0], "Hub soll [mm]": 300 + Q[:, 0]}
    made = guess(log_of(arm_columns() | lift), lift_and_arm)
    lines = yaml.safe_load(made.text)["columns"]
    assert lines["q.lift"] == {"from": "Hub [mm]", "unit": "mm"}
    assert lines["tau.lift"] == {"from": "Kraft Hub [N]", "unit": "N"}
    assert [doubt.partition(":")[0] for doubt in made.doubts] == ["q.lift", "tau.lift"]


def test_a_driven_joint_without_a_position_is_told(lift_and_arm):
    two = {"Hub [mm]": 300 + Q[:, 0], "Abstand [mm]": Q[:, 1], "Kraft Hub [N]": TAU[:, 0]}
    made = guess(log_of(arm_columns() | two), lift_and_arm)
    assert "tau.lift" not in yaml.safe_load(made.text)["columns"]
    assert len(made.doubts) == 2
    assert "q.lift: no column is its position" in made.doubts[0]
    assert "in N, and nothing is made of it: Kraft Hub [N]" in made.doubts[1]
    assert "Is it Hub [mm] or Abstand [mm]?" in made.doubts[0]
    rate = guess(log_of(arm_columns() | {"speed lift": Q[:, 0]}), lift_and_arm)
    assert any("q.lift: no column is its position" in doubt for doubt in rate.doubts)
    none = guess(log_of(arm_columns()), lift_and_arm)
    assert "# q.lift: {from: NAME, unit: m}  # CHECK: no column is its position" in none.text
    assert len(none.doubts) == 1


def test_many_joints_without_a_column_are_listed_not_told_one_by_one(ur5):
    made = guess(log_of({"time [s]": logs.T, "elbow_joint position [rad]": Q[:, 0]}), ur5)
    (doubt,) = (doubt for doubt in made.doubts if "without a column" in doubt)
    assert doubt.startswith("q.JOINT: 5 joints are without a column, and taken to stand at home: shoulder_pan_joint, ")
    hand = prup_pin.load("panda").mechanism
    arm = {f"panda_joint{k} [rad]": Q[:, k % 6] for k in range(1, 8)}
    text = guess(log_of({"time [s]": logs.T} | arm), hand).text
    assert "# q.panda_finger_joint1: {from: NAME, unit: m}  # no column is its position" in text  # it carries no tool


def test_a_recording_with_other_separators_is_one(tmp_path):
    """As a spreadsheet in German saves it: nothing of it is guessed, and nothing left out."""
    robot = prup_pin.load("3prup")
    rng = np.random.default_rng(3)
    names = [*(f"q.{name}" for name in robot.mechanism.actuated), "w.fx", "w.mz", "p.x", "p.y", "p.z", "r.x", "r.y",
             "r.z", "temperature"]  # fmt: skip
    table = np.column_stack([np.arange(30.0), rng.uniform(0.3, 0.5, (30, len(names)))])
    lines = [";".join(["time", *names]), *(";".join(f"{x:.9g}" for x in row).replace(".", ",") for row in table)]
    path = tmp_path / "bench.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    log = read_log(path)
    found = guess(log, robot.mechanism, "3prup")
    assert found.doubts == ()
    (tmp_path / "map.yaml").write_text(found.text, encoding="utf-8")
    recording = convert(log, read_map(tmp_path / "map.yaml", log, robot.mechanism), robot.mechanism).recording
    np.testing.assert_allclose(recording.time, table[:, 0])
    np.testing.assert_allclose(recording.position, table[:, names.index("p.x") + 1 :][:, :3])
    np.testing.assert_allclose(recording.rotation, table[:, names.index("r.x") + 1 :][:, :3])
    np.testing.assert_allclose(recording.positions["leg2_slide"], table[:, 2])
    np.testing.assert_allclose(recording.temperature, table[:, -1])


PLANAR = """<robot name="planar">
  <link name="base"/>{links}<link name="tip"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 -1 0"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/>
    <origin xyz="0.6 0 0"/><axis xyz="0 -1 0"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="flange" type="fixed"><parent link="fore"/><child link="tip"/><origin xyz="0.5 0 0"/></joint>
  <prup_pin version="1"><tool frame="tip"/><actuated joints="shoulder elbow"/></prup_pin>
</robot>"""


@pytest.fixture(scope="module")
def planar(tmp_path_factory):
    """A planar arm of two hinges, and a table of where its tip went, in German and in mm and degrees, by 5 s."""
    folder = tmp_path_factory.mktemp("planar")
    links = "".join(f'<link name="{name}"/>' for name in ("upper", "fore"))
    (folder / "arm.urdf").write_text(PLANAR.format(links=links))
    rng = np.random.default_rng(4)
    a, b = (np.repeat(rng.uniform(-1.2, 1.2, 25), 3) for _ in range(2))  # three loads in each posture
    bent = a + b - 2e-3 * rng.standard_normal(len(a))
    x, z = 600 * np.cos(a) + 500 * np.cos(bent), 600 * np.sin(a) + 500 * np.sin(bent)
    noise = 0.01 * rng.standard_normal((len(a), 3))
    table = np.column_stack(
        [5.0 * np.arange(len(a)), *np.degrees([a, b]), x, 0 * x, z, 0 * x, -np.degrees(bent), 0 * x]
    )
    table[:, 3:6] += noise
    head = "Zeit [s];shoulder [°];elbow [°];X [mm];Y [mm];Z [mm];RX [°];RY [°];RZ [°]"
    rows = "\n".join(";".join(f"{value:.5f}".replace(".", ",") for value in row) for row in table)
    (folder / "messung.csv").write_text(f"{head}\n{rows}\n", encoding="utf-8")
    robot = prup_pin.load(folder / "arm.urdf")
    log = read_log(folder / "messung.csv")
    text = guess(log, robot.mechanism, "robot").text
    (folder / "map.yaml").write_text(text, encoding="utf-8")
    done = convert(log, read_map(folder / "map.yaml", log, robot.mechanism), robot.mechanism)
    return text, done, (a, b, bent)


def test_two_markers_of_which_two_coordinates_were_seen_are_told_and_taken_for_no_body(tmp_path):
    (tmp_path / "arm.urdf").write_text(PLANAR.format(links='<link name="upper"/><link name="fore"/>'))
    arm = prup_pin.load(tmp_path / "arm.urdf").mechanism
    joints = {"t [s]": logs.T, "shoulder [rad]": Q[:, 0], "elbow [rad]": Q[:, 1]}
    seen = {f"marker{k} {axis} [mm]": 100 * k + Q[:, k + 1] for k in (1, 2) for axis in "xy"}
    made = guess(log_of(joints | seen), arm)
    assert "p.FRAME.x: {from: 'marker2 x [mm]', unit: mm}" in made.text
    assert "seen were marker1, marker2" in made.doubts[-1]


def test_rotation_vectors_have_the_unit_of_their_headings(planar):
    text, done, (*_, bent) = planar
    assert "as: rotation_vector, unit: °" in text
    np.testing.assert_allclose(done.recording.rotation[:, 1], -bent, atol=1e-5)


def test_rows_that_are_seconds_apart_are_not_taken_for_motion_between_them(planar):
    text, done, (a, _, _) = planar
    assert "at_rest" not in text
    assert len(done.recording) == len(a)


def test_at_rest_keeps_rows_far_apart_that_stand_to_one_side():
    time, steps = 5.0 * np.arange(6), np.array([0.0, 0.0, 1.0, 1.0, 2.0, 3.0])
    assert at_rest(time, [steps]).tolist() == [True, True, True, True, False, False]
    assert not at_rest(0.1 * np.arange(6), [steps])[1:].any()


SCARA = """<robot name="scara">
  <link name="base"/><link name="arm"/><link name="fore"/><link name="quill"/><link name="wrist"/><link name="tool0"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="arm"/><origin xyz="0 0 0.4"/>
    <axis xyz="0 0 1"/><limit lower="-2.4" upper="2.4" effort="1" velocity="1"/></joint>
  <joint name="elbow" type="revolute"><parent link="arm"/><child link="fore"/><origin xyz="0.3 0 0"/>
    <axis xyz="0 0 1"/><limit lower="-2.6" upper="2.6" effort="1" velocity="1"/></joint>
  <joint name="lift" type="prismatic"><parent link="fore"/><child link="quill"/><origin xyz="0.25 0 0"/>
    <axis xyz="0 0 1"/><limit lower="-0.2" upper="0.05" effort="1" velocity="1"/></joint>
  <joint name="spin" type="revolute"><parent link="quill"/><child link="wrist"/><origin xyz="0 0 -0.15"/>
    <axis xyz="0 0 1"/><limit lower="-6" upper="6" effort="1" velocity="1"/></joint>
  <joint name="mount" type="fixed"><parent link="wrist"/><child link="tool0"/><origin xyz="{x} 0 -0.08"/></joint>
  <prup_pin version="1"><tool frame="tool0"/><actuated joints="shoulder elbow lift spin"/></prup_pin>
</robot>"""
AXES = ("shoulder", "elbow", "lift", "spin")


@pytest.fixture(scope="module", params=[0.03, 0.0], ids=["beside the last axis", "on the last axis"])
def scara(request, tmp_path_factory):
    """A SCARA, its joints [rad, m], what it measured by name [mm, deg, N, N m], its tool seen to 20 micrometres."""
    path = tmp_path_factory.mktemp("scara") / "scara.urdf"
    path.write_text(SCARA.format(x=request.param))
    robot = prup_pin.load(path)
    rng, t = np.random.default_rng(3), np.arange(0, 8, 0.04)
    q = np.column_stack(
        [1.1 * np.sin(0.7 * t), -0.6 + 0.9 * np.cos(0.9 * t), -0.08 + 0.07 * np.sin(1.3 * t), 1.2 * np.sin(0.5 * t)]
    )
    tool = [robot.pose_from_actuators(dict(zip(AXES, row, strict=True))).base_from_tool[:3, 3] for row in q]
    efforts = np.column_stack([np.sin(t), np.cos(t), 9 + np.sin(2 * t), 0.1 * np.cos(t)])
    force = np.column_stack([np.sin(0.4 * t), np.cos(0.3 * t), -15 + np.sin(0.6 * t)])
    place = 1e3 * np.array(tool) + 0.02 * rng.standard_normal((len(t), 3))
    return robot.mechanism, t, q, {"q": q * [180 / np.pi, 180 / np.pi, 1e3, 180 / np.pi], "tau": efforts,
                                   "p": place, "w": force}  # fmt: skip


HEADINGS = {
    "Japanese": ("時刻[s]", ("第1軸角度[deg]", "第2軸角度[deg]", "昇降軸位置[mm]", "第4軸角度[deg]"),
                 ("第1軸トルク[Nm]", "第2軸トルク[Nm]", "昇降軸推力[N]", "第4軸トルク[Nm]"), "手先{}[mm]", "力{}[N]"),
    "wide characters": ("時間（秒）", ("第１軸角度［度］", "第２軸角度［度］", "第３軸位置［㎜］", "第４軸角度［度］"),
                        ("第１軸トルク［Ｎ・ｍ］", "第２軸トルク［Ｎ・ｍ］", "第３軸推力［Ｎ］",
                         "第４軸トルク［Ｎ・ｍ］"),
                        "手先{}座標［㎜］", "荷重{}［Ｎ］"),
    "German": ("Zeit [s]", ("Winkel A1 [°]", "Winkel A2 [°]", "Hub [mm]", "Winkel A4 [°]"),
               ("Moment A1 [Nm]", "Moment A2 [Nm]", "Hubkraft [N]", "Moment A4 [Nm]"), "Werkzeug {} [mm]",
               "Kraft {} [N]"),
    "ASCII": ("t", ("j1_deg", "j2_deg", "lift_mm", "j4_deg"), ("trq1_Nm", "trq2_Nm", "lift_force_N", "trq4_Nm"),
              "TCP_{}_mm", "F{}_N"),
    "numbers alone": ("t", ("j1_deg", "j2_deg", "j3_mm", "j4_deg"), ("e1 [Nm]", "e2 [Nm]", "e3 [N]", "e4 [Nm]"),
                      "{} [mm]", "load {} [N]"),
}  # fmt: skip


def scara_columns(scara, headings, **other):
    _, t, _, table = scara
    time, joints, efforts, place, force = HEADINGS[headings]
    columns = {time: t} | dict(zip(joints, table["q"].T, strict=True)) | dict(zip(efforts, table["tau"].T, strict=True))
    for form, kind in ((place, "p"), (force, "w")):
        columns |= {form.format(axis): (table | other)[kind][:, k] for k, axis in enumerate("XYZ")}
    return columns


@pytest.mark.parametrize("headings", HEADINGS)
def test_units_and_the_robot_say_what_columns_are_whatever_they_are_called(tmp_path, scara, headings):
    mechanism, _, q, table = scara
    made, recording = imported(tmp_path, log_of(scara_columns(scara, headings)), mechanism)
    assert "# Not used" not in made.text
    assert np.abs(np.column_stack([recording.positions[joint] for joint in AXES]) - q).max() < 1e-9
    assert np.abs(np.column_stack([recording.efforts[joint] for joint in AXES]) - table["tau"]).max() < 1e-9
    assert np.abs(recording.position - 1e-3 * table["p"]).max() < 1e-9  # the tool's, no marker's on a link
    assert not recording.markers
    assert np.abs(recording.wrench[:, :3] - table["w"]).max() < 1e-9
    assert {doubt.partition(".")[0] for doubt in made.doubts} <= {"q", "tau", "w", "p"}


def test_columns_of_other_joints_are_no_rivals_of_one(scara):
    """Joints that log and robot file spell with other capitals: each has its column, and nothing is asked."""
    mechanism, t, _, table = scara
    columns = {"Timestamp [s]": t}
    for k, joint in enumerate(mechanism.actuated):
        columns[f"{joint.capitalize()} Pos [{'mm' if joint == 'lift' else 'deg'}]"] = table["q"][:, k]
    assert not [doubt for doubt in guess(log_of(columns), mechanism).doubts if "those like it" in doubt]


def test_what_nothing_is_made_of_and_what_is_told_twice_is_asked(scara):
    mechanism, t, _, table = scara
    columns = {name: values for name, values in scara_columns(scara, "Japanese").items() if "昇降" not in name}
    doubts = guess(log_of(columns | {"張力1[N]": t, "張力2[N]": t}), mechanism).doubts
    assert any(doubt.startswith("q.lift: no column is its position") for doubt in doubts)
    assert any("in N, and nothing is made of it: 張力1[N], 張力2[N]" in doubt for doubt in doubts)
    twice = {f"第{k}軸指令角度[deg]": table["q"][:, k - 1] + 0.1 for k in (1, 2, 4)}
    doubts = guess(log_of(twice | scara_columns(scara, "Japanese")), mechanism).doubts
    assert any("or 第1軸角度[deg] and those like it: which were measured?" in doubt for doubt in doubts)
    amperes = {"t": t} | {f"A{k} [deg]": table["q"][:, 0] for k in (1, 2, 4)} | {f"I{k} [A]": t for k in range(1, 5)}
    text = guess(log_of(amperes), mechanism).text
    assert "tau.lift: {from: 'I3 [A]', unit: A}  # CHECK: in A: write how much SI one A is" in text


def test_a_unit_that_is_none_of_its_joint_is_asked_about(scara):
    mechanism, t, _, table = scara
    columns = {"t": t} | {f"A{k}[deg]": table["q"][:, 0] for k in (1, 2, 4)} | {f"F{k}[N]": t for k in (1, 2, 3)}
    made = guess(log_of(columns | {"A3[mm]": table["q"][:, 2]}), mechanism)
    assert not any(line.startswith("tau.") for line in yaml.safe_load(made.text)["columns"])
    assert any("in N, and nothing is made of it: F1[N], F2[N], F3[N]" in doubt for doubt in made.doubts)


def test_three_columns_x_y_z_beside_joints_are_asked_about_as_the_tool(scara):
    mechanism, t, q, table = scara
    columns = {"time": t} | dict(zip(AXES, q.T, strict=True)) | dict(zip("xyz", 1e-3 * table["p"].T, strict=True))
    made = guess(log_of(columns), mechanism)
    (doubt,) = made.doubts
    assert doubt.startswith("p.x: is it the tool point, measured from outside, in base axes? Else p.<frame>; where")
    assert "# tolerances: {frame_position: 10, frame_rotation: 3}" in made.text.splitlines()
    assert "p.x: {from: x, unit: m}" in made.text


def test_letters_beside_a_quaternion_of_the_same_name_are_where_that_body_is(scara):
    mechanism, _, q, table = scara
    half = q[:, [0, 1, 3]].sum(axis=1) / 2
    turn = {"camera_qz": np.sin(half), "camera_qw": np.cos(half), "camera_qx": 0 * half, "camera_qy": 0 * half}
    place = dict(zip(("camera_x", "camera_y", "camera_z"), 1e-3 * table["p"].T, strict=True))
    made = guess(log_of(dict(zip(AXES, q.T, strict=True)) | place | turn), mechanism)
    assert [yaml.safe_load(made.text)["columns"][f"p.{axis}"]["from"] for axis in "xyz"] == list(place)
    assert "r: {from: [camera_qx, camera_qy, camera_qz, camera_qw]" in made.text
    without = guess(log_of(dict(zip(AXES, q.T, strict=True)) | dict.fromkeys(("a_x", "a_y", "a_z"), half)), mechanism)
    assert "p." not in str(yaml.safe_load(without.text)["columns"])  # three letters alone may be anything


def test_an_effort_of_some_joints_alone_goes_where_positions_of_the_same_names_go():
    robot = prup_pin.load("3prup")
    values = np.linspace(0, 0.3, 50)
    joints = {
        f"{name}_{what}": k + values
        for what in ("position", "velocity")
        for k, name in enumerate(("left", "right", "rear"))
    }
    read = yaml.safe_load(guess(log_of({"t [s]": values, **joints, "rear_effort": values}), robot.mechanism).text)
    assert read["columns"]["tau.leg3_slide"]["from"] == "rear_effort"
    assert read["columns"]["q.leg3_slide"]["from"] == "rear_position"
    text = guess(log_of({"t [s]": values, **joints, "other_effort": values}), robot.mechanism).text
    assert "tau." not in text.partition("# Not used")[0]


@pytest.mark.parametrize(
    "called",
    [
        "Drehvektor {} [rad]",
        "rotvec_{}",
        "rotation vector {}",
        "vecteur rotation {}",
        "Vettore di rotazione {}",
        "r.{}",
    ],
)
def test_a_rotation_vector_by_its_name_is_one_and_a_place_is_asked_about_once(called):
    values = np.linspace(0, 0.3, 50)
    places = {f"p.{axis}" if called == "r.{}" else f"Position {axis} [mm]": values for axis in "xyz"}
    turns = {called.format(axis): values for axis in "xyz"}
    joints = {f"q.leg{leg}_slide": values for leg in (1, 2, 3)}
    first = guess(log_of({"t [s]": values, **joints, **places, **turns}), prup_pin.load("3prup").mechanism)
    read = yaml.safe_load(first.text)
    assert read["rotations"]["r"]["from"] == list(turns)
    assert read["rotations"]["r"]["as"] == "rotation_vector"
    assert [read["columns"][f"p.{axis}"]["from"] for axis in "xyz"] == list(places)
    assert len(first.doubts) == (called != "r.{}"), first.doubts


def test_degrees_are_told_in_other_languages(ur5):
    columns = {"tiempo_ms": 1e3 * logs.T} | {f"posicion_{k}_grados": np.degrees(Q[:, k]) for k in range(6)}
    read = yaml.safe_load(guess(log_of(columns), ur5).text)
    assert read["columns"]["q.elbow_joint"] == {"from": "posicion_2_grados", "unit": "deg"}
    assert spelled("Degrés") == spelled("gradi") == "deg"


def test_a_place_has_one_unit():
    values = np.linspace(0, 1, 50)
    places = {"TCP x": 3 * values, "TCP y": 400 * values, "TCP z": values}
    read = yaml.safe_load(guess(log_of({"t [s]": values, "q1": values, **places}), None).text)
    assert {read["columns"][f"p.{axis}"]["unit"] for axis in "xyz"} == {"mm"}


@pytest.mark.parametrize("third", [None, "Z [mm]"])
def test_two_coordinates_are_a_place_where_they_are_lengths(third):
    """A planar robot is measured in its plane; what is no length is left alone."""
    rows = np.linspace(0.0, 1.0, 20)
    columns = {"t": rows, "X [mm]": 100 * rows, "Y [mm]": 500 + rows, "Flow X [l/min]": rows, "Flow Y [l/min]": rows}
    if third is not None:
        columns[third] = 0 * rows
    lines = yaml.safe_load(guess(log_of(columns)).text)["columns"]
    places = {target: line["from"] for target, line in lines.items() if target.startswith("p")}
    axes = "xy" if third is None else "xyz"
    assert places == {f"p.{axis}": f"{axis.upper()} [mm]" for axis in axes}


def test_a_column_that_is_called_a_load_is_not_dropped_in_silence(lift_and_arm):
    """'Kraft' without a unit was 'not used', and 'nothing doubtful': the arm's deflections became its stiffness."""
    load = {"Kraft": TAU[:, 0], "Kraft soll": TAU[:, 0], "Nr": Q[:, 0]}
    still = {name: values for name, values in arm_columns().items() if "Moment" not in name}
    made = guess(log_of(still | load), lift_and_arm)
    assert [doubt for doubt in made.doubts if "Kraft" in doubt] == [
        "Kraft: a load on the tool, along z of the base, in N? Then this line is one of the columns; else none"
    ]
    assert "# w.fz: {from: Kraft, unit: N}  # CHECK" in made.text
    assert not any("Kraft" in doubt for doubt in guess(log_of(still | load | {"w.fx": TAU[:, 1]}), lift_and_arm).doubts)


@pytest.mark.parametrize("order", [(1, 2, 3), (3, 2, 1)], ids=["from the base on", "from the tool on"])
def test_columns_called_by_numbers_go_to_the_joints_of_these_numbers(tmp_path, order):
    names = ["ground", *(f"link_{joint}" for joint in order)]
    joints = "".join(
        f'<joint name="joint_{joint}" type="revolute"><parent link="{names[k]}"/><child link="{names[k + 1]}"/>'
        '<origin xyz="0 0 0.3"/><axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="9" velocity="3"/></joint>'
        for k, joint in enumerate(order)
    )
    links = "".join(f'<link name="{name}"/>' for name in names)
    (tmp_path / "arm.urdf").write_text(f'<robot name="arm">{links}{joints}</robot>')
    arm = prup_pin.load(tmp_path / "arm.urdf").mechanism
    columns = yaml.safe_load(guess(log_of({"t": logs.T} | logs.numbered("J{}", Q[:, :3], 1)), arm).text)["columns"]
    assert {target: column["from"] for target, column in columns.items() if target != "time"} == {
        "q.joint_1": "J1",
        "q.joint_2": "J2",
        "q.joint_3": "J3",
    }


def test_a_map_of_nothing_but_positions_asks_what_else_was_measured(ur5):
    q = logs.numbered("q{}", Q) | logs.numbered("qd{}", QD)
    (doubt,) = guess(log_of({"t": logs.T} | q | {"dutycycle": TAU[:, 0]}), ur5).doubts
    assert "nothing but the joints' motion is used" in doubt
    assert "dutycycle" in doubt
    for nothing_to_ask in ({}, logs.numbered("tau{}", TAU) | {"dutycycle": TAU[:, 0]}):
        assert guess(log_of({"t": logs.T} | q | nothing_to_ask), ur5).doubts == ()
