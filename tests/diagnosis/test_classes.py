"""What markers cannot tell apart is told as a class, the simplest first; a tracker's faults are none of the robot."""

from __future__ import annotations

import numpy as np
import pytest

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.findings import _is_richer
from prup_pin.diagnosis.spread import Outlier, Spread
from prup_pin.laws import Place, law_at
from prup_pin.laws.in_recording import lasting
from prup_pin.recordings import Noise, Recording

from ..as_written import as_written
from ..reference.posed_tree import PosedTree, placed, turned

WRIST = """<robot name="wrist">
  <link name="base"/>
  <link name="fore"><inertial><origin xyz="0.1 0 0.02"/><mass value="1.5"/>{inertia}</inertial></link>
  <link name="hand"><inertial><origin xyz="0.06 0 0"/><mass value="0.4"/>{inertia}</inertial></link>
  <link name="ball"/><joint name="stem" type="fixed"><parent link="hand"/><child link="ball"/>
    <origin xyz="0.15 0 0.02"/></joint>
  <joint name="roll" type="revolute"><parent link="base"/><child link="fore"/><origin rpy="1.2 0 0"/>
    <axis xyz="0 0 1"/>{limit}</joint>
  <joint name="bend" type="revolute"><parent link="fore"/><child link="hand"/><origin xyz="0.25 0 0" rpy="0 0.3 0"/>
    <axis xyz="0 1 0"/>{limit}</joint>
</robot>"""
NOISE = 5e-5


@pytest.fixture(scope="module")
def wrist(tmp_path_factory):
    path = tmp_path_factory.mktemp("wrist") / "wrist.urdf"
    inertia = '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>'
    path.write_text(
        WRIST.format(inertia=inertia, limit='<limit lower="-2" upper="2" effort="1" velocity="1"/>'), encoding="utf-8"
    )
    return path


@pytest.mark.slow
def test_a_gap_that_no_load_closes_is_not_told_beside_the_spring_that_it_is(wrist):
    """A gap that some load closed would have shown; another law of another part is told."""
    tree = PosedTree(wrist, about={"bend": 0.02, "roll": 1e-4})
    q = tree.postures(("roll", "bend"), 16, 1)
    seen = tree.seen(q, ("ball",), NOISE, 1)
    recording = Recording(np.arange(16.0), positions=q, markers=seen, noise=Noise(position=NOISE))
    robot = prup_pin.load(wrist, tool="ball", joint_stiffness={"roll": 1e4, "bend": 1e4})
    found = next(item for item in diagnose(robot, recording).findings if item.physics != "self_weight")
    assert (found.physics, found.location) == ("stiffness_changed", "bend")
    assert found.parameters["factor"].value == pytest.approx(1 / (0.02 * 1e4), rel=0.05)
    assert found.alternatives == ("payload at ball (off centre)",)


def seen(path, seed: int, speed=(0.0, 0.0, 0.0), step=(0.0, 0.0, 0.0), **of_tree) -> Recording:
    """Return what a tracker sees of two markers that wanders by `speed` [m/s] and stands `step` [m] beside itself."""
    tree, time = PosedTree(path, **of_tree), 500.0 + 10.0 * np.arange(16.0)
    q = tree.postures(("roll", "bend"), 16, seed)
    found = tree.seen(q, ("ball", "fore"), NOISE, seed)
    moved = np.outer(time - time[0], speed) + np.array(step)
    found = {name: values + moved for name, values in found.items()}
    return as_written(Recording(time, positions=q, markers=found, noise=Noise(position=NOISE), path=f"day{seed}.csv"))


def told(path, *recordings: Recording):
    """Return the findings by physics and place."""
    found = diagnose(prup_pin.load(path, tool="ball"), recordings)
    assert found.verdict == "explained"
    return {(item.physics, str(item.effect.place)): item for item in found.findings if item.physics != "self_weight"}


@pytest.mark.slow
def test_a_tracker_that_wanders_is_named_and_says_nothing_of_another_day(wrist):
    speed = np.array([2e-6, 0.0, -1e-6])
    found = told(wrist, seen(wrist, 1, speed))
    finding = found.pop(("pose_sensor_drift", "pose_sensor (drift)"))
    assert not found
    fitted = np.array([finding.parameters[name].value for name in ("vx", "vy", "vz")])
    assert np.abs(fitted - speed).max() < 0.15 * speed.max()
    assert lasting([finding.effect], prup_pin.load(wrist).mechanism) == ()


@pytest.mark.slow
def test_that_a_tracker_was_pushed_between_two_days_is_none_of_the_robots_faults(wrist):
    soft = {"about": {"bend": 0.02}}
    found = told(wrist, seen(wrist, 1, **soft), seen(wrist, 2, step=(1e-3, 0.0, 0.0), **soft))
    assert set(found) == {
        ("joint_compliance", "bend (about)"),
        ("pose_sensor_misalignment", "pose_sensor (in day2.csv)"),
    }


def test_a_tracker_that_was_set_up_anew_each_day_is_found_wherever_it_stood(wrist):
    there = [placed(turned((0.3, 1.1, -0.7)), (1.5, -2.0, 0.4)), placed(turned((-2.0, 0.4, 0.3)), (-3.0, 0.5, 2.0))]
    found = told(wrist, *(seen(wrist, day, tracker=frame) for day, frame in enumerate(there, 1)))
    for day, frame in enumerate(there, 1):
        where = found.pop(("pose_sensor_misalignment", f"pose_sensor (in day{day}.csv)")).effect.values
        assert [where[name] for name in ("tx", "ty", "tz")] == pytest.approx(frame[:3, 3], abs=2e-3)
    assert not found


@pytest.mark.slow
def test_of_two_days_the_one_is_named_on_which_a_tracker_wandered(wrist):
    found = told(wrist, seen(wrist, 1), seen(wrist, 2, speed=(3e-6, 0.0, 0.0)))
    assert set(found) == {("pose_sensor_drift", "pose_sensor (drift in day2.csv)")}


def test_a_law_with_more_numbers_is_none_to_tell_beside_the_same_one_with_fewer():
    assert _is_richer("joint_compliance at a (across by direction)", "joint_compliance at a (across)")
    assert not _is_richer("joint_compliance at a (across)", "joint_compliance at a (across by direction)")
    assert not _is_richer("joint_compliance at ab (across by direction)", "joint_compliance at a (across)")


def test_what_came_again_while_nothing_moved_is_no_slip_of_the_sensor():
    blocks = np.repeat(np.arange(4), 3)

    def spread(*samples: int) -> Spread:
        found = tuple(Outlier(sample, "marker hand position", 20.0, 1e-3, "m") for sample in samples)
        return Spread({}, (), frozenset(), 1.0, found, np.ones((12, 3), bool))

    assert spread(3, 4, 5).repeated(blocks)
    assert spread(3, 4, 9).repeated(blocks)
    assert not spread(0, 3, 6, 7).repeated(blocks)
    assert not spread().repeated(blocks)


def test_each_value_of_a_law_at_all_joints_has_a_law_that_has_it_alone():
    robot = prup_pin.load("ur5")
    mechanism = robot.mechanism
    law = law_at("joint_compliance", Place("robot", "each joint"), mechanism)
    apart = law.apart(Place("robot", "each joint"), mechanism)
    assert list(apart) == [item.name for item in law.quantities_at(Place("robot", "each joint"), mechanism)]
    assert all(law_at("joint_compliance", place, mechanism).apart(place, mechanism) == {} for place in apart.values())
