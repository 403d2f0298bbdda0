"""A tracker that stands somewhere: declared it is registered, undeclared it is found, with the number."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import prup_pin
from prup_pin.channels import Linear, Stack, channels_of
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.calibration import calibrated
from prup_pin.diagnosis.corrected import corrected_model
from prup_pin.diagnosis.criteria import LITTLE
from prup_pin.diagnosis.registration import registered, worlds_apart
from prup_pin.errors import InputError
from prup_pin.recordings import ARM, Recording, Together, Tolerances
from prup_pin.simulation import Simulator, compare, inputs_of, simulate
from prup_pin.spatial import rotation_exp, rotation_log

from ..reference.posed_tree import PosedTree, placed, turned
from .test_joint_compliance import JOINTS, NOISE, TORSO, bench, named

ROBOTS = Path(__file__).parents[1] / "robots"
SOMEWHERE = placed(turned([0.4, -0.3, 2.1]), [3.0, -2.0, 0.8])
OPEN = Tolerances(frame_position=5.0, frame_rotation=3.0)


@pytest.fixture(scope="module")
def recorded():
    return bench(PosedTree(TORSO, about={"bend": 4e-4}, tracker=SOMEWHERE))


@pytest.fixture(scope="module")
def undeclared(recorded):
    return diagnose(prup_pin.load(TORSO), recorded)


@pytest.mark.slow
def test_a_declared_tracker_stands_anywhere_and_is_no_finding(recorded):
    found = diagnose(prup_pin.load(TORSO), replace(recorded, tolerances=OPEN))
    assert named(found) == [("joint_compliance", "bend")]
    assert any("3.75 m" in text or "stands anywhere" in text for text in found.remarks)
    again = compare(recorded, simulate(prup_pin.load(TORSO), recorded, found.effects))
    assert max(item.in_noise for item in again) < 1.15


@pytest.mark.slow
def test_an_undeclared_one_is_found_with_its_numbers_and_what_to_declare(undeclared):
    assert named(undeclared) == [("pose_sensor_misalignment", "pose_sensor"), ("joint_compliance", "bend")]
    values = {name: item.value for name, item in undeclared.findings[0].parameters.items()}
    assert [values["tx"], values["ty"], values["tz"]] == pytest.approx(SOMEWHERE[:3, 3], abs=0.02)
    assert [values["rx"], values["ry"], values["rz"]] == pytest.approx(rotation_log(SOMEWHERE[:3, :3]), abs=0.02)
    assert any(
        "poses of '" in text and "one rigid motion" in text and "frame_position" in text for text in undeclared.remarks
    )
    assert undeclared.before["fit"] > 1000
    assert undeclared.after["fit"] < 1.15


@pytest.mark.slow
def test_what_it_found_predicts_another_recording_in_the_trackers_frame(undeclared):
    other = bench(PosedTree(TORSO, about={"bend": 4e-4}, tracker=SOMEWHERE), 30, seed=9)
    again = compare(other, simulate(prup_pin.load(TORSO), other, undeclared.effects))
    assert max(item.in_noise for item in again) < 1.3


@pytest.mark.slow
def test_another_robot_is_no_tracker_that_stands_somewhere(recorded):
    draw = np.random.default_rng(0)
    strange = {name: draw.uniform(-2, 2, values.shape) for name, values in recorded.markers.items()}
    with pytest.raises(InputError, match="another"):
        diagnose(prup_pin.load(TORSO), replace(recorded, markers=strange))


@pytest.mark.slow
def test_markers_beside_their_frames_and_zeros_set_by_eye_are_calibrated_with_it():
    draw = np.random.default_rng(8)
    offsets = dict(zip(JOINTS, 0.01 * draw.standard_normal(len(JOINTS)), strict=True))
    targets = {name: 0.03 * draw.standard_normal(3) for name in ("left_ball", "right_ball", "chest")}
    tree = PosedTree(TORSO, offsets=offsets, targets=targets, tracker=SOMEWHERE)
    tolerances = replace(ARM, target_position=0.03, position=None, direction=None, encoder_slope=None, mass=None)
    recording = replace(bench(tree, 80, noise=NOISE), tolerances=tolerances)
    found = calibrated(prup_pin.load(TORSO), recording)
    assert found.nominal > 20
    assert found.calibrated < 1.05
    known = {item.name: item for item in found.parameters}
    for joint in ("bend", "left_elbow", "right_lift"):
        item = known[f"{joint}.encoder_offset"]
        assert abs(item.value - offsets[joint]) < 4 * item.sd
        assert item.learned > 0.5


@pytest.mark.slow
def test_a_tracker_that_wandered_stands_for_other_recordings_where_it_was_in_the_middle(recorded):
    """2 mm in all: what is taken again at any moment of it is half of that off at most."""
    wandered = np.outer(recorded.time, [4e-5, -3e-5, 1e-5])
    seen = replace(recorded, markers={name: values + wandered for name, values in recorded.markers.items()})
    robot = prup_pin.load(TORSO)
    found = diagnose(robot, seen)
    assert ("pose_sensor_drift", "pose_sensor") in named(found)
    kept = corrected_model(found, robot, [seen], "torso").effects
    assert not any(effect.law.physics == "pose_sensor_drift" for effect in kept)
    again = simulate(robot, recorded, kept)
    for name, values in recorded.markers.items():
        assert np.mean(again.markers[name] - values, axis=0) == pytest.approx(wandered.mean(axis=0), abs=1.5e-4)


MOUNTED = turned([0.7, -1.1, 0.5])


@pytest.fixture(scope="module")
def mounted_askew(recorded):
    """What the tracker sees of a hand's marker with axes of its own, which are any others than the hand's."""
    tree, draw = PosedTree(TORSO, about={"bend": 4e-4}, tracker=SOMEWHERE), np.random.default_rng(4)
    frame, seen = tree.frame("left_ball"), []
    for row in range(len(recorded)):
        bodies = tree.bodies({name: values[row] for name, values in recorded.positions.items()})
        hand = SOMEWHERE @ bodies[frame.parentJoint] @ frame.placement.homogeneous
        seen.append(rotation_log(hand[:3, :3] @ MOUNTED @ rotation_exp(1e-3 * draw.standard_normal(3))))
    noise = replace(recorded.noise, rotation=1e-3)
    return replace(recorded, marker_rotations={"left_ball": np.array(seen)}, noise=noise)


@pytest.mark.slow
def test_a_target_is_mounted_any_way_round(mounted_askew):
    found = diagnose(prup_pin.load(TORSO), mounted_askew)
    assert named(found) == [
        ("pose_sensor_misalignment", "pose_sensor"),
        ("target_misalignment", "target"),
        ("joint_compliance", "bend"),
    ]
    values = {name: item.value for name, item in found.findings[1].parameters.items()}
    assert [values["rx"], values["ry"], values["rz"]] == pytest.approx(rotation_log(MOUNTED), abs=0.005)
    assert any("one turn of the target" in text and "target_rotation" in text for text in found.remarks)
    again = compare(mounted_askew, simulate(prup_pin.load(TORSO), mounted_askew, found.effects))
    assert max(item.in_noise for item in again) < 1.15


@pytest.mark.slow
def test_a_declared_mounting_is_no_finding(mounted_askew):
    declared = replace(mounted_askew, tolerances=replace(OPEN, target_rotation=3.0))
    found = diagnose(prup_pin.load(TORSO), declared)
    assert named(found) == [("joint_compliance", "bend")]
    again = compare(declared, simulate(prup_pin.load(TORSO), declared, found.effects))
    assert max(item.in_noise for item in again) < 1.15


@pytest.fixture(scope="module")
def switched_on_anywhere():
    """A hexapod in 30 poses, of which each leg counts from 50 mm elsewhere, and what a tracker beside it sees."""
    robot, draw = prup_pin.load(ROBOTS / "six_ups" / "six_ups.urdf"), np.random.default_rng(5)
    home = robot.home.actuators
    legs = np.array(list(home.values())) + draw.uniform(-0.06, 0.06, (30, len(home)))
    poses = [robot.pose_from_actuators(dict(zip(home, row, strict=True))) for row in legs]
    seen = np.array([SOMEWHERE @ pose.base_from_tool for pose in poses])
    counted = legs + draw.choice([-0.05, 0.05], legs.shape[1])
    recording = Recording(
        time=np.arange(30.0),
        positions=dict(zip(home, counted.T, strict=True)),
        position=seen[:, :3, 3],
        rotation=np.array([rotation_log(each) for each in seen[:, :3, :3]]),
    )
    return robot, recording


def test_encoders_that_count_from_elsewhere_make_it_no_other_robot(switched_on_anywhere):
    robot, recording = switched_on_anywhere
    linear = Linear.of(Simulator(robot, inputs_of(recording, robot)))
    stack, mechanism = Stack(channels_of(recording, robot.mechanism)), robot.mechanism
    together = Together.of([recording], mechanism.actuated, mechanism.gravity)
    placed = registered(stack, linear, together, mechanism, (0.0, LITTLE))
    everywhere = np.ones(len(recording), bool)
    assert placed.found
    for channel in placed.stack.poses:
        assert worlds_apart(channel, linear, everywhere, (0.0, LITTLE), zeros=False) == (False, True)
        assert worlds_apart(channel, linear, everywhere, (0.0, LITTLE)) == (False, False)
        mixed = np.random.default_rng(1).permutation(len(recording))
        other = replace(channel, position=channel.position[mixed], rotation=channel.rotation[mixed])
        assert any(worlds_apart(other, linear, everywhere, (0.0, LITTLE)))


@pytest.mark.parametrize("seed", range(4))
def test_a_platform_that_only_shifts_has_no_target_turned_as_its_tracker_is(seed):
    """Its orientation is the same everywhere: a turn of the tracker and one of the target look alike in it."""
    robot, draw = prup_pin.load(ROBOTS / "clavel_delta" / "clavel_delta.urdf"), np.random.default_rng(seed)
    home = robot.home.actuators
    arms = np.array(list(home.values())) + draw.uniform(-0.2, 0.2, (20, len(home)))
    poses = [robot.pose_from_actuators(dict(zip(home, row, strict=True))).base_from_tool for row in arms]
    seen = np.array([SOMEWHERE @ pose for pose in poses])
    recording = Recording(
        time=np.arange(20.0),
        positions=dict(zip(home, arms.T, strict=True)),
        position=seen[:, :3, 3] + 1e-4 * draw.standard_normal((20, 3)),
        rotation=np.array(
            [rotation_log(each @ rotation_exp(1e-3 * draw.standard_normal(3))) for each in seen[:, :3, :3]]
        ),
    )
    linear, mechanism = Linear.of(Simulator(robot, inputs_of(recording, robot))), robot.mechanism
    stack, together = (
        Stack(channels_of(recording, mechanism)),
        Together.of([recording], mechanism.actuated, mechanism.gravity),
    )
    placed_there = registered(stack, linear, together, mechanism, (0.0, LITTLE))
    assert placed_there.found
    assert not placed_there.turned
    everywhere = np.ones(len(recording), bool)
    assert worlds_apart(placed_there.stack.poses[0], linear, everywhere, (0.0, LITTLE), zeros=False) == (False, False)


@pytest.mark.parametrize("beside", [np.zeros(3), np.array([0.1, -0.2, 0.3])])
def test_a_frame_moves_with_the_actuators_as_differences_say(switched_on_anywhere, beside):
    robot, recording = switched_on_anywhere
    frame = robot.mechanism.tool
    frame = replace(frame, name="beside", placement=frame.placement @ placed(turned([0.3, 0.2, -0.4]), beside))
    drives, step = list(robot.mechanism.actuated), 1e-6
    one = recording.select(np.arange(3))

    def at(way, joint):
        moved = {name: q + way * step * (name == joint) for name, q in one.positions.items()}
        return Linear.of(Simulator(robot, inputs_of(replace(one, positions=moved), robot))).rigid(frame)

    got = Linear.of(Simulator(robot, inputs_of(one, robot))).by_actuators(frame)
    for column, joint in enumerate(drives):
        (p, r), (q, s) = at(1, joint), at(-1, joint)
        turn = np.array([rotation_log(a @ b.T) for a, b in zip(r, s, strict=True)])
        np.testing.assert_allclose(got[:, :, column], np.hstack([p - q, turn]) / (2 * step), rtol=1e-6, atol=1e-6)
