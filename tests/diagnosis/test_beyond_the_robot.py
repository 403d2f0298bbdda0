"""What is off or gives way beside the robot: the pose sensor's scale, the load cell, what holds the tool, the base."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.recordings import Noise, Recording, Tolerances, add_noise
from prup_pin.simulation import effect_named, simulate
from prup_pin.spatial import rotation_exp, rotation_log

NOISE = Noise(position=5e-6, rotation=2e-5)
ROBOTS = Path(__file__).parents[1] / "robots"


@cache
def arm():
    return prup_pin.load("ur10", joint_stiffness=1e5)


def bench(robot, q, seen, loads=5, size=(150.0, 25.0), noise=NOISE, **declared):
    """Return a bench test, each posture (n, a) under some loads: `seen` makes of a tool pose (4, 4) and a wrench (6,)
    what the sensor reports of it."""
    rng = np.random.default_rng(4)
    q = np.repeat(q, loads, axis=0)
    wrench = rng.normal(size=(len(q), 6)) * np.repeat(size, 3)
    places, turns = [], []
    for row, load in zip(q, wrench, strict=True):
        pose = robot.pose_from_actuators(row)
        moved = robot.compliance(pose).deflection(load)
        at = np.eye(4)
        at[:3, 3] = pose.base_from_tool[:3, 3] + moved[:3]
        at[:3, :3] = rotation_exp(moved[3:]) @ pose.base_from_tool[:3, :3]
        at = seen(at, load)
        places.append(at[:3, 3])
        turns.append(rotation_log(at[:3, :3]))
    return Recording(
        time=np.arange(len(q), dtype=float),
        positions=dict(zip(robot.mechanism.actuated, q.T, strict=True)),
        wrench=wrench,
        position=np.array(places) + rng.normal(0, noise.position, (len(q), 3)),
        rotation=np.array(turns) + rng.normal(0, noise.rotation, (len(q), 3)),
        noise=noise,
        **declared,
    )


def postures(count=12):
    return np.random.default_rng(7).uniform(-1.5, 1.5, (count, 6))


def scaled(factor):
    def seen(at, load):
        out = at.copy()
        out[:3, 3] *= factor
        return out

    return seen


def held_softly(way, turning, before=(0.0, 0.0, 0.0)):
    """Return a tool whose holder moves by way (3,) per force and turns by turning (3,) per moment about a point."""
    before = np.array(before)

    def seen(at, load):
        turn, out = at[:3, :3], at.copy()
        force, moment = turn.T @ load[:3], turn.T @ load[3:]
        lean = rotation_exp(np.multiply(turning, moment + np.cross(-before, force)))
        out[:3, 3] += turn @ (np.multiply(way, force) + lean @ -before + before)
        out[:3, :3] = turn @ lean
        return out

    return seen


def told(found):
    return [(law.physics, law.location, law.effect.place.aspect) for law in found.findings]


@pytest.mark.slow
@pytest.mark.parametrize("error", [6e-4, pytest.param(-3e-3, marks=pytest.mark.slow)])
def test_the_scale_of_a_pose_sensor_is_one_number_and_no_lengths(error):
    found = diagnose(arm(), bench(arm(), postures(), scaled(1 + error), size=(30.0, 5.0)))
    assert found.verdict == "explained"
    assert told(found) == [("pose_sensor_scale", "pose_sensor", "")]
    (law,) = found.findings
    low, high = law.parameters["error"].interval
    assert low < error < high
    assert law.parameters["error"].value == pytest.approx(error, abs=2e-5)
    assert ("too long" if error > 0 else "too short") in law.statement


@pytest.mark.slow
def test_a_scale_as_all_sensors_have_it_is_told_only_where_it_exceeds_the_noise():
    """No length and no encoder of a sound robot comes to stand for it, either."""
    small = bench(arm(), postures(14), scaled(1 + 3e-6), size=(30.0, 5.0))
    found = diagnose(arm(), small)
    assert found.verdict == "nothing_missing"
    assert [effect.law.physics for effect in found.stand_ins] == ["pose_sensor_scale"]
    assert any("as small as on any such sensor" in text for text in found.remarks)
    sharp = bench(arm(), postures(), scaled(1 + 4e-6), size=(3.0, 0.5), noise=Noise(position=1e-6, rotation=4e-6))
    found = diagnose(arm(), sharp)
    assert told(found) == [("pose_sensor_scale", "pose_sensor", "")]


@pytest.mark.slow
def test_a_scale_shows_wherever_the_sensor_stands_and_all_is_a_little_off():
    """A tracker that nobody placed, about whose own origin all is stretched; the drawing is off by its tolerances."""
    at_sensor = np.eye(4)
    at_sensor[:3, :3], at_sensor[:3, 3] = rotation_exp(np.array([0.2, -0.5, 1.0])), [2.0, -1.5, 0.4]
    loose = Tolerances(frame_position=5.0, frame_rotation=3.0, position=5e-5, encoder_offset=5e-5)
    seen = scaled(1.0015)
    recording = bench(arm(), postures(16), lambda at, load: seen(at_sensor @ at, load), loads=3, tolerances=loose)
    found = diagnose(arm(), recording)
    assert told(found) == [("pose_sensor_scale", "pose_sensor", "")]
    assert found.findings[0].parameters["error"].value == pytest.approx(1.5e-3, rel=0.1)
    nothing = bench(arm(), postures(16), lambda at, load: at_sensor @ at, loads=3, tolerances=loose)
    assert diagnose(arm(), nothing).verdict == "nothing_missing"


@pytest.mark.parametrize(
    ("way", "turning", "before", "aspect"),
    [
        pytest.param([2e-7] * 3, [1e-5] * 3, [0, 0, 0], "", id="alike", marks=pytest.mark.slow),
        pytest.param([1e-6, 0, 1e-6], [0, 0, 0], [0, 0, 0], "by axis", id="a finger"),
        pytest.param(
            *([3e-8, 3e-8, 0], [1e-5, 1e-5, 0], [0, 0, -0.15], "by axis, about a point"),
            id="a stem",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_what_holds_a_tool_gives_way_and_no_joint_is_accused(way, turning, before, aspect):
    found = diagnose(arm(), bench(arm(), postures(), held_softly(way, turning, before)))
    assert found.verdict == "explained"
    tool = arm().mechanism.tool_part
    assert told(found) == [("tool_compliance", tool, aspect)]
    (law,) = found.findings
    assert not law.alternatives
    values = law.effect.values
    if aspect:
        np.testing.assert_allclose([values[f"translation_{axis}"] for axis in "xyz"], way, atol=6e-8)
        np.testing.assert_allclose([values[f"rotation_{axis}"] for axis in "xyz"], turning, atol=1e-6)
    else:
        assert values["translation"] == pytest.approx(way[0], rel=0.1)
        assert values["rotation"] == pytest.approx(turning[0], rel=0.1)
    if "point" in aspect:
        np.testing.assert_allclose([values[axis] for axis in "xyz"], before, atol=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("gain", [1.06, 1 / 1.06])
def test_a_load_cell_that_reports_too_much_or_too_little_is_told_as_that(gain):
    """Beside the platform's weight, which it does not feel: softer or stiffer drives would make that another one."""
    platform = prup_pin.load(ROBOTS / "six_ups" / "six_ups.urdf")
    rng = np.random.default_rng(3)
    q = np.repeat(rng.uniform(-0.04, 0.04, (8, 6)), 5, axis=0)
    home = [platform.home.actuators[name] for name in platform.mechanism.actuated]
    at = dict(zip(platform.mechanism.actuated, (q + home).T, strict=True))
    acts = rng.normal(size=(len(q), 6)) * np.repeat((300.0, 60.0), 3)
    weight = effect_named("self_weight", "robot", "", {"scale": 1.0}, platform.mechanism)
    true = simulate(platform, Recording(time=np.arange(len(q) * 1.0), positions=at, wrench=acts), [weight])
    noise = Noise(position=2e-6, rotation=1e-5)
    reported = Recording(time=np.arange(len(q) * 1.0), positions=at, wrench=gain * acts, noise=noise)
    seen = reported.with_measurements(position=true.position, rotation=true.rotation)
    found = diagnose(platform, add_noise(seen, noise, 5))
    assert found.verdict == "explained"
    every = {law.physics: law for law in found.findings}
    assert set(every) == {"wrench_sensor_gain", "self_weight"}
    law = every["wrench_sensor_gain"]
    assert law.effect.place.aspect == "all channels"
    low, high = law.parameters["gain"].interval
    assert low < 1 / gain < high
    assert high - low < 0.03


@pytest.mark.slow
def test_a_tool_and_a_base_that_loads_cannot_tell_apart_are_told_together():
    """A delta does not turn its tool: what either moves by a force is the same, and no moment is put on."""
    delta = prup_pin.load(ROBOTS / "clavel_delta" / "clavel_delta.urdf")
    rng = np.random.default_rng(2)
    q = np.array([delta.home.actuators[name] for name in delta.mechanism.actuated]) + rng.uniform(-0.2, 0.2, (10, 3))
    found = diagnose(delta, bench(delta, q, held_softly([3e-6] * 3, [0] * 3), size=(60.0, 0.0)))
    assert found.verdict == "explained"
    (law,) = found.findings
    every = {f"{law.physics} at {law.location}", *law.alternatives}
    for physics in ("tool_compliance", "base_compliance"):
        assert any(each.startswith(physics) for each in every)
