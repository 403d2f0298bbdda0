"""Channels: any frame's pose, with or without orientation, of robots with or without compliance."""

import numpy as np
import pytest

import prup_pin
from prup_pin.channels import Linear, Noise, PoseChannel, Stack, channels_of
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.influence import Influence
from prup_pin.recordings import LoadProgramme, RandomPoses, Recording, TestPlan, add_noise
from prup_pin.recordings import Noise as SensorNoise
from prup_pin.simulation import Simulator, effect_named, inputs_of
from prup_pin.spatial import rotation_log

MARKERS = ("leg1_bush", "leg2_bush", "star_3")
BOX = {"z": (0.35, 0.45), "theta": (-0.2, 0.2), "phi": (-0.2, 0.2)}


def planned(robot, poses=6, cycle=(0.0, 0.5, 1.0, 0.5, 0.0, -0.5, -1.0)):
    loads = LoadProgramme(cycle, random_directions=1, force=80.0, moment=8.0)
    plan = TestPlan(poses=(RandomPoses(poses, BOX),), loads=(loads,), robot="3prup", seed=3)
    return plan.inputs(lambda at: robot.pose(**at).actuators)


def with_markers(recording):
    empty = np.zeros((len(recording), 3))
    return recording.with_measurements(markers=dict.fromkeys(MARKERS, empty))


def seen(run, stack):
    """What a stack's frames do in a run: (n, 6 frames)."""
    return [run.pose_of(frame) for frame in stack.frames]


LAWS = [
    ("backlash", "leg2/ball_nut", "", {"half_gap": 3e-8, "closing_load": 1.0}),
    ("stiffness_changed", "leg1/linear_rod", "", {"factor": 0.9995}),
    ("self_weight", "robot", "", {"scale": 1e-3}),
    ("encoder_offset", "leg3/motor", "", {"offset": 1e-7}),
    ("geometric_offset", "leg1/base", "", None),
    ("pose_sensor_misalignment", "pose_sensor", "", dict.fromkeys(("rx", "ry", "rz", "tx", "ty", "tz"), 1e-6)),
]


@pytest.mark.parametrize(("physics", "place", "aspect", "values"), LAWS, ids=lambda value: str(value))
def test_first_order_of_markers_is_the_simulations_slope(robot, physics, place, aspect, values):
    recording = with_markers(planned(robot, 2))
    stack = Stack(channels_of(recording, robot.mechanism))
    assert [channel.name for channel in stack.channels] == ["pose", *(f"marker {name}" for name in MARKERS)]
    simulator = Simulator(robot, inputs_of(recording, robot))
    if values is None:
        lengths = [name for name in robot.parameters if name.startswith(place)]
        values = {name.rpartition(".")[2]: 1e-7 for name in lengths}
    effect = effect_named(physics, place, aspect, values, robot.mechanism)
    run = simulator.run()
    found = Influence(simulator, run, stack).change(simulator.setup([effect]))
    after = simulator.run([effect], run)
    for index, (before, moved) in enumerate(zip(seen(run, stack), seen(after, stack), strict=True)):
        expected = np.concatenate((moved[0] - before[0], rotation_log(moved[1] @ before[1].mT)), axis=1)
        part = found[:, 6 * index : 6 * index + 6]
        for columns in (slice(0, 3), slice(3, 6)):
            assert np.abs(part - expected)[:, columns].max() < 5e-3 * np.abs(expected[:, columns]).max() + 1e-10


@pytest.mark.slow
def test_markers_alone_tell_where_the_play_is(robot):
    """No pose of the tool, no orientation: three points on the star's branches."""
    recording = with_markers(planned(robot, 4, (0.0, 1.0, 0.5, 0.0, -1.0)))
    play = effect_named("backlash", "leg2/ball_nut", "", {"half_gap": 4e-5, "closing_load": 1.0}, robot.mechanism)
    bench = prup_pin.simulate(robot, recording, [play])
    measured = recording.with_measurements(markers=bench.markers)
    found = diagnose(robot, add_noise(measured, SensorNoise(position=2e-6, rotation=1e-5), seed=5))
    (finding,) = [item for item in found.findings if item.physics != "finite_deflection"]
    assert (finding.physics, finding.location) == ("backlash", "leg2/ball_nut")
    assert finding.parameters["half_gap"].value == pytest.approx(4e-5, rel=0.05)
    assert set(found.by_channel) == {f"marker {name} position" for name in MARKERS}
    assert found.after["fit"] == pytest.approx(1.0, abs=0.1)
    assert found.unused_columns == ()


def test_a_rigid_arm_has_a_channel():
    """Nothing yields: the pose is that of the joints, and an encoder's offset moves it by the Jacobian."""
    arm = prup_pin.load("ur5", tool="tool0")
    at = np.array([0.3, -1.2, 1.4, -0.6, 0.8, 0.2]) + 0.1 * np.arange(3)[:, None]
    positions = {name: at[:, column] for column, name in enumerate(arm.mechanism.actuated)}
    recording = Recording(np.arange(3.0), positions=positions, position=np.zeros((3, 3)), rotation=np.zeros((3, 3)))
    simulator = Simulator(arm, inputs_of(recording, arm))
    stack = Stack(channels_of(recording, arm.mechanism))
    run = simulator.run()
    poses = [arm.pose_from_actuators(row) for row in at]
    tool = np.array([pose.base_from_tool for pose in poses])
    np.testing.assert_allclose(stack.residual(run)[:, :3], -tool[:, :3, 3], atol=1e-15)
    np.testing.assert_allclose(stack.residual(run), stack.residual_of_start(Linear.of(simulator)), atol=1e-14)
    late = effect_named("encoder_offset", "elbow_joint", "", {"offset": 1e-6}, arm.mechanism)
    moved = Influence(simulator, run, stack).change(simulator.setup([late]))
    jacobian = np.array([pose.jacobian[:, 2] for pose in poses])
    expected = jacobian[:, :3] + np.cross(jacobian[:, 3:], tool[:, :3, 3])
    np.testing.assert_allclose(moved[:, :3], 1e-6 * expected, atol=1e-11)


def test_whitening_of_several_channels_makes_the_wrench_sensors_noise_independent(robot):
    """Tool and markers share the wrench sensor's noise: all columns together become white."""
    recording = with_markers(planned(robot, 1, (1.0,)))
    stack = Stack(channels_of(recording, robot.mechanism))
    simulator = Simulator(robot, inputs_of(recording, robot))
    first = Influence(simulator, simulator.run(), stack).first
    noise = Noise(2e-6, 1e-5, 0.3, 0.02, "declared")
    (white,) = stack.whiteners(noise, stack.seen(first.by_wrench), np.ones((1, stack.size), bool))
    rng = np.random.default_rng(1)
    n = 20_000
    columns = rng.normal(size=(n, stack.size)) * stack.deviation(noise)
    columns += (rng.normal(size=(n, 6)) * noise.wrench) @ stack.seen(first.by_wrench)[0].T
    whitened = columns @ white.T
    np.testing.assert_allclose(whitened.T @ whitened / n, np.eye(stack.size), atol=0.06)


def test_what_was_not_measured_has_no_residual(robot):
    channel = PoseChannel.nothing(robot.mechanism.tool, 4)
    assert not channel.exists.any()
    assert (channel.less(np.ones((4, 3)), np.broadcast_to(np.eye(3), (4, 3, 3))) == 0).all()
