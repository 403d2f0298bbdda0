"""Gravity that differs from sample to sample: a base that is tilted, and robots that nothing loads but their weight."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.influence import Influence
from prup_pin.diagnosis.toleranced import toleranced_of
from prup_pin.errors import InputError, RecordingFileError
from prup_pin.recordings import Noise, Recording, Tolerances, add_noise, read_recording, suspicions, write_recording
from prup_pin.robots import packaged_folder
from prup_pin.simulation import Simulator, effect_named, inputs_of
from prup_pin.spatial import rotation_exp, rotation_log, rotation_rpy

ARM = Path(__file__).parents[1] / "robots/elastic_arm/elastic_arm.urdf"
NOISE = Noise(position=2e-6, rotation=1e-5)
G = 9.80665
#: Three ways to stand: upright, tilted, on the wall.
DOWN = G * np.array([[0.0, 0.0, -1.0], [0.6, 0.0, -0.8], [0.0, -1.0, 0.0]])


def text_of(vector):
    return " ".join(repr(float(value)) for value in vector)


def under(path, gravity, folder):
    """The robot of a file with another gravity."""
    text = re.sub(r'<gravity xyz="[^"]*"/>', f'<gravity xyz="{text_of(gravity)}"/>', path.read_text(encoding="utf-8"))
    made = folder / f"{path.stem}.urdf"
    made.write_text(text, encoding="utf-8")
    return prup_pin.load(made)


@pytest.fixture(scope="module")
def arm():
    return prup_pin.load(ARM)


def standing(robot, angles, gravity=None, **more):
    """Samples at rest under nothing but gravity: (N, joints), (N, 3)."""
    angles = np.atleast_2d(angles)
    positions = {name: angles[:, column] for column, name in enumerate(robot.mechanism.actuated)}
    return Recording(np.arange(float(len(angles))), positions=positions, gravity=gravity, noise=NOISE, **more)


def weight(robot, aspect=""):
    return effect_named("self_weight", "robot", aspect, {"scale": 1.0}, robot.mechanism)


def measured(robot, inputs, effects, seed=3):
    seen = prup_pin.simulate(robot, inputs, effects)
    return add_noise(inputs.with_measurements(position=seen.position, rotation=seen.rotation), NOISE, seed)


def findings(found):
    return {(item.physics, item.location) for item in found.findings if item.physics != "finite_deflection"}


# -- mechanics ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "aspect"), [("arm", ""), ("3prup", ""), ("3prup", "spread")])
def test_each_sample_is_that_of_a_robot_under_its_gravity(name, aspect, tmp_path):
    path = ARM if name == "arm" else packaged_folder() / "3prup.urdf"
    robot = prup_pin.load(path)
    angles = np.tile([0.3, 0.5, -0.8, 0.2, 0.4, -0.1] if name == "arm" else [0.40, 0.42, 0.36], (3, 1))
    together = prup_pin.simulate(robot, standing(robot, angles, DOWN), [weight(robot, aspect)])
    for row, gravity in enumerate(DOWN):
        other = under(path, gravity, tmp_path)
        alone = prup_pin.simulate(other, standing(other, angles[row]), [weight(other, aspect)])
        np.testing.assert_allclose(together.position[row], alone.position[0], rtol=0, atol=1e-13)
        np.testing.assert_allclose(together.rotation[row], alone.rotation[0], rtol=0, atol=1e-13)


def test_equilibrium_takes_a_gravity(arm, tmp_path):
    angles = [0.3, 0.5, -0.8, 0.2, 0.4, -0.1]
    wrench = [50, -20, 80, 3, 2, -5]
    tilted = arm.equilibrium(arm.pose_from_actuators(angles), wrench, gravity=DOWN[1])
    other = under(ARM, DOWN[1], tmp_path)
    expected = other.equilibrium(other.pose_from_actuators(angles), wrench, gravity=True)
    np.testing.assert_array_equal(tilted.base_from_tool, expected.base_from_tool)
    assert tilted.energy().stored == pytest.approx(tilted.energy().work, rel=1e-6)
    with pytest.raises(InputError, match="expected True, False or three numbers"):
        arm.equilibrium(arm.pose_from_actuators(angles), wrench, gravity=[0, 1])


@pytest.mark.slow
def test_a_robot_turned_with_gravity_answers_the_same(arm, tmp_path):
    """Base and gravity are turned together: the same finding, its value, and poses turned along."""
    angles_of_mount = (0.7, -0.4, 1.1)
    turn = rotation_rpy(*angles_of_mount)
    mount = (
        '<link name="ground"/><link name="base"/><joint name="mount" type="fixed"><parent link="ground"/>'
        f'<child link="base"/><origin rpy="{text_of(angles_of_mount)}"/></joint>'
    )
    made = tmp_path / "turned.urdf"
    made.write_text(ARM.read_text(encoding="utf-8").replace('<link name="base"/>', mount, 1), encoding="utf-8")
    turned = prup_pin.load(made)
    angles = np.random.default_rng(1).uniform(-1.2, 1.2, (24, 6))
    down = DOWN[np.arange(24) % 3]
    answers = []
    for robot, gravity in ((arm, down), (turned, down @ turn.T)):
        soft = effect_named("stiffness_changed", "joint3/drive", "", {"factor": 0.7}, robot.mechanism)
        inputs = standing(robot, angles, gravity)
        seen = prup_pin.simulate(robot, inputs, [weight(robot), soft])
        recording = inputs.with_measurements(position=seen.position, rotation=seen.rotation)
        answers.append((seen, diagnose(robot, recording)))
    (first, plain), (second, other) = answers
    np.testing.assert_allclose(first.position @ turn.T, second.position, atol=1e-12)
    expected = turn @ rotation_exp(first.rotation)
    assert np.abs(rotation_log(expected.mT @ rotation_exp(second.rotation))).max() < 1e-12
    assert findings(plain) == findings(other) == {("self_weight", "robot"), ("stiffness_changed", "joint3/drive")}
    for one, two in zip(plain.findings, other.findings, strict=True):
        for key, fitted in one.parameters.items():
            assert two.parameters[key].value == pytest.approx(fitted.value, rel=1e-6)


@pytest.mark.parametrize("aspect", ["", "spread"])
@pytest.mark.parametrize("heavy", [False, True])
def test_first_order_of_weight_is_the_simulations_slope(aspect, heavy):
    """Weight itself, the mass of a link, a mass on the tool: under three gravities at once."""
    robot = prup_pin.load("3prup")
    inputs = standing(robot, np.tile([0.40, 0.42, 0.36], (3, 1)), DOWN)
    inputs = replace(inputs, tolerances=Tolerances(mass=0.1))
    simulator = Simulator(robot, inputs_of(inputs, robot))
    begin = [weight(robot, aspect)] if heavy else []
    run = simulator.run(begin)
    influence = Influence(simulator, run)
    masses = toleranced_of(inputs, robot.mechanism)
    more = effect_named("self_weight", "robot", aspect, {"scale": 1e-3}, robot.mechanism)
    payload = effect_named("payload", "moving_star", "", {"mass": 1e-3}, robot.mechanism)
    steps = [[more], [payload]] + [[masses.effect(1e-2 * unit)] for unit in np.eye(len(masses))] * heavy
    for step in steps:
        change = influence.change(simulator.setup([*begin, *step]))
        after = simulator.run([*begin, *step], run)
        turned = rotation_log(after.rotation @ run.rotation.mT)
        expected = np.concatenate((after.position - run.position, turned), axis=1)
        assert np.abs(expected).max() > 1e-12
        assert np.abs(change - expected).max() < 2e-3 * np.abs(expected).max() + 1e-12


# -- diagnosis ---------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_one_pose_on_a_tilting_base_shows_a_soft_drive(arm):
    """Nothing but weight, and the actuators stand still: only gravity goes about."""
    directions = np.random.default_rng(4).normal(size=(40, 3))
    gravity = G * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    soft = effect_named("stiffness_changed", "joint2/drive", "", {"factor": 0.6}, arm.mechanism)
    inputs = standing(arm, np.tile([0.3, 0.5, -0.8, 0.2, 0.4, -0.1], (40, 1)), gravity)
    found = diagnose(arm, measured(arm, inputs, [weight(arm), soft]))
    assert findings(found) == {("self_weight", "robot"), ("stiffness_changed", "joint2/drive")}
    value = next(item for item in found.findings if item.physics == "stiffness_changed").parameters["factor"]
    assert value.interval[0] < 0.6 < value.interval[1]
    # a contact that hardly stiffens can do as much, for it is a spring then
    assert "cannot_separate" not in found.next_experiment
    sound = diagnose(arm, measured(arm, inputs, [weight(arm)]))
    assert sound.next_experiment["plan"]["gravity"] == pytest.approx(gravity[-1])


def test_weight_is_a_load(arm):
    inputs = standing(arm, np.random.default_rng(1).uniform(-1, 1, (12, 6)))
    remarks = "\n".join(diagnose(arm, measured(arm, inputs, [weight(arm)])).remarks)
    assert "no load was applied but the robot's own weight" in remarks
    assert "nothing can be said" not in remarks
    floating = standing(arm, np.random.default_rng(1).uniform(-1, 1, (12, 6)), np.zeros((12, 3)))
    remarks = "\n".join(diagnose(arm, measured(arm, floating, [])).remarks)
    assert "no load was applied: nothing can be said about stiffness, play or friction" in remarks


@pytest.mark.slow
def test_weight_is_calibrated_within_tolerances(arm):
    """Stiffness and mass of each link, from weight alone, on a base that is tilted three ways."""
    angles = np.random.default_rng(2).uniform(-1.2, 1.2, (45, 6))
    inputs = standing(arm, angles, DOWN[np.arange(45) % 3], tolerances=Tolerances(stiffness=0.1, mass=0.1))
    toleranced = toleranced_of(inputs, arm.mechanism)
    x = np.random.default_rng(6).normal(size=len(toleranced))
    found = diagnose(arm, measured(arm, inputs, [toleranced.effect(x), weight(arm)]))
    assert findings(found) == {("self_weight", "robot")}
    assert found.within["calibrated"] == pytest.approx(1.0, abs=0.1)
    known = {item.name: item for item in found.calibration}
    for item, off in zip(toleranced.law.deviations, x, strict=True):
        assert abs(known[item.name].x - off) < 4 * known[item.name].share


@pytest.mark.slow
def test_gravity_of_the_recording_stands_for_that_of_a_file_without(tmp_path):
    robot = under(ARM, (0, 0, 0), tmp_path)
    angles = np.random.default_rng(2).uniform(-1.2, 1.2, (20, 6))
    recording = measured(robot, standing(robot, angles, DOWN[np.arange(20) % 3]), [weight(robot)])
    found = diagnose(robot, recording)
    assert findings(found) == {("self_weight", "robot")}
    assert found.verdict == "explained"


@pytest.mark.slow
def test_laws_that_cancel_a_weight_which_does_not_act_are_dropped(arm):
    draw = np.random.default_rng(4)
    wrench = np.zeros((100, 6))
    wrench[1::4, 2], wrench[2::4, 0] = -60, 40
    wrench[3::4] = draw.uniform(-1, 1, (25, 6)) * [40, 40, 40, 4, 4, 4]
    loaded = replace(standing(arm, np.repeat(draw.uniform(-1.2, 1.2, (25, 6)), 4, axis=0)), wrench=wrench)
    zero = effect_named("encoder_offset", "joint2", "", {"offset": 0.004}, arm.mechanism)
    found = diagnose(arm, measured(arm, loaded, [zero]))
    assert findings(found) == {("encoder_offset", "joint2")}
    assert found.findings[0].parameters["offset"].value == pytest.approx(0.004, rel=3e-3)


def test_an_accelerometers_sign_is_told(arm):
    inputs = standing(arm, np.random.default_rng(2).uniform(-1, 1, (8, 6)), -DOWN[np.zeros(8, int)])
    assert any("opposite of free fall" in text for text in diagnose(arm, measured(arm, inputs, [weight(arm)])).remarks)


def test_a_sample_without_gravity_has_no_answer(arm):
    gravity = DOWN.copy()
    gravity[1, 2] = np.nan
    seen = prup_pin.simulate(arm, standing(arm, np.zeros((3, 6)), gravity), [weight(arm)])
    assert seen.status == ("ok", "no input", "ok")
    assert "gravity is empty" in seen.reasons["no input"]


def test_simulate_says_what_acts(arm, tmp_path):
    recording = standing(arm, np.zeros((3, 6)))
    assert any("Nothing loads the robot" in text for text in prup_pin.simulate(arm, recording).remarks)
    tilted = replace(recording, gravity=DOWN)
    assert any("no effect without weight" in text for text in prup_pin.simulate(arm, tilted).remarks)
    light = under(ARM, (0, 0, 0), tmp_path)
    told = prup_pin.simulate(light, recording, [weight(light)]).remarks
    assert any("sets no gravity, and the recording has no column g" in text for text in told)


# -- files -------------------------------------------------------------------------------------------------------------


def test_gravity_is_written_and_read_again(arm, tmp_path):
    recording = standing(arm, np.zeros((3, 6)), DOWN)
    write_recording(recording, tmp_path / "bench.csv")
    again = read_recording(tmp_path / "bench.csv")
    np.testing.assert_allclose(again.gravity, DOWN, rtol=1e-8)
    np.testing.assert_array_equal(again.select([2]).gravity, again.gravity[[2]])
    assert any("nothing but weight and motion load" in text for text in again.remarks)


def table(folder, *rows, head="time,q.a,g.x,g.y,g.z"):
    path = folder / "bench.csv"
    path.write_text("\n".join((head, *rows)) + "\n", encoding="utf-8")
    return path


def test_bad_gravity_is_refused_with_its_place(tmp_path):
    with pytest.raises(RecordingFileError, match=r"bench.csv:3: column 'g.x': gravity of 9807 m/s\^2: is it in mm"):
        read_recording(table(tmp_path, "0,0,0,0,-9.8", "1,0,0,0,-9806.65"))
    with pytest.raises(RecordingFileError, match=r"column 'g.y': is missing beside g.x, g.z"):
        read_recording(table(tmp_path, "0,0,0,-9.8", head="time,q.a,g.x,g.z"))
    with pytest.raises(InputError, match="is it in mm"):
        Recording(np.zeros(1), gravity=[[0, 0, -9806.65]])
    some = read_recording(table(tmp_path, "0,0,0,0,-9.8", "1,0,,,"))
    assert any("g.x g.y g.z are empty in 1 rows" in text for text in some.remarks)
    shares = read_recording(table(tmp_path, "0,0,0,0,-1", "1,0,0.6,0,-0.8"))
    assert any("multiples of g" in text for text in suspicions(shares))
