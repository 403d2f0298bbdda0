"""An answer depends on the question alone: not on what was asked before, nor on the thread or process that asks."""

import copy
import hashlib
import pickle
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

import prup_pin
from prup_pin.robot import random_poses

BOX = {"z": (0.25, 0.5), "theta": (-0.5, 0.5), "phi": (-0.5, 0.5)}
ROOT = Path(prup_pin.__file__).parent.parent
ROBOTS = ROOT / "tests/robots"


def bits(pose):
    """Return every number of a pose as bytes."""
    arrays = (pose.q, pose.placements, pose.jacobian, pose.closure_jacobian, pose.closure_wrenches, *pose.balance)
    return b"".join(array.tobytes() for array in (*arrays, pose.closure_residual))


def answer(robot, case):
    """Return the bits of a pose, and of its C, K and parts."""
    pose = robot.pose(**case)
    result = robot.compliance(pose)
    return bits(pose) + result.C.tobytes() + result.K.tobytes() + b"".join(p.tobytes() for p in result.parts.values())


@pytest.fixture(scope="module")
def cases():
    return [pose.coordinates for pose in random_poses(prup_pin.load("3prup"), BOX, 50, seed=11)]


@pytest.fixture(scope="module")
def answers(cases):
    """What a robot that was asked nothing else answers, case by case."""
    return [answer(prup_pin.load("3prup"), case) for case in cases]


def test_a_refused_request_leaves_no_trace(monkeypatch):
    """Millimetres typed for metres, refused; then a grid of poses as if nothing had been asked."""
    used = prup_pin.load("3prup")
    with pytest.raises(prup_pin.UnreachablePoseError):
        used.pose(z=400, theta=0, phi=0)
    steps = range(-3, 4)
    grid = [{"z": 0.4 + 0.002 * i, "theta": 0.05 * j, "phi": 0.02 * i * j} for i in steps for j in steps]
    passes, at = [0], type(used._kinematics).evaluate

    def counted(kinematics, q):
        passes[0] += 1
        return at(kinematics, q)

    monkeypatch.setattr(type(used._kinematics), "evaluate", counted)
    fresh = prup_pin.load("3prup")
    fresh.pose(**grid[0])
    used.pose(**grid[0])
    for case in grid:
        passes[0] = 0
        asked = bits(used.pose(**case))
        assert passes[0] < 10
        assert asked == bits(fresh.pose(**case))


def test_a_used_robot_answers_like_a_fresh_one(cases, answers):
    used = prup_pin.load("3prup")
    for case in random_poses(used, BOX, 60, seed=5):
        used.compliance(case)
    for case in ({"z": 0.4, "theta": 1.5, "phi": 0.0}, {"z": -1.0, "theta": 0.0, "phi": 0.0}):
        with suppress(prup_pin.UnreachablePoseError):
            used.pose(**case)
    assert [answer(used, case) for case in cases] == answers


def test_threads_do_not_disturb_each_other(cases, answers):
    robot, interval = prup_pin.load("3prup"), sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(8) as pool:
            asked = list(pool.map(lambda case: answer(robot, case), 8 * cases))
    finally:
        sys.setswitchinterval(interval)
    assert asked == 8 * answers


ASK = """
import hashlib, pickle, sys
sys.path[:0] = [{root!r}, {tests!r}]
from tests.kinematics.test_no_history import answer
robot, cases = pickle.load(sys.stdin.buffer)
print(hashlib.sha256(b"".join(answer(robot, case) for case in cases)).hexdigest())
"""


def test_another_process_gives_the_same_bytes(cases, answers):
    robot = prup_pin.load("3prup")
    code = ASK.format(root=str(ROOT), tests=str(ROOT / "tests"))
    sent = pickle.dumps((robot, cases[:10]))
    done = subprocess.run([sys.executable, "-c", code], input=sent, capture_output=True, check=True)
    assert done.stdout.decode().strip() == hashlib.sha256(b"".join(answers[:10])).hexdigest()


def round_trips():
    return {"pickled": lambda thing: pickle.loads(pickle.dumps(thing)), "copied": copy.copy, "deep": copy.deepcopy}


@pytest.fixture(
    params=["3prup", "ur5", "five_bar/five_bar.urdf", "five_bar/five_bar.xml", "delta/robot.urdf", "locked"], ids=str
)
def robot(request):
    name = request.param
    if name in ("3prup", "locked"):
        robot = prup_pin.load("3prup")
        return robot.with_locked_joints(["leg1_R_phi"]) if name == "locked" else robot
    path = name if name == "ur5" else ROBOTS / name
    tool = {"five_bar/five_bar.xml": "left_point", "delta/robot.urdf": "centre"}.get(name)
    return prup_pin.load(path, tool=tool, joint_stiffness=1e4)


@pytest.mark.parametrize("way", ["pickled", "copied", "deep"])
def test_copies_give_the_same_bits_and_go_on_working(robot, way):
    again = round_trips()[way]
    pose = robot.home
    result, other = robot.compliance(pose), again(robot)
    assert bits(other.home) == bits(pose)
    for thing, asked in ((pose, bits), (result, lambda r: r.C.tobytes()), (robot.mechanism, lambda m: repr(m.modules))):
        assert asked(again(thing)) == asked(thing)
    np.testing.assert_array_equal(again(result).deflection([1, 2, 3, 0, 0, 0]), result.deflection([1, 2, 3, 0, 0, 0]))
    moved = again(pose)
    for asks, at in ((robot, moved), (other, pose), (other, moved)):
        assert asks.compliance(at).C.tobytes() == result.C.tobytes()
    with pytest.raises(ValueError, match="read-only"):
        moved.q[0] = 0.0


def test_a_pose_of_other_parameters_is_refused_even_unpickled():
    robot = prup_pin.load("3prup")
    stiffer = robot.with_parameters({"leg1/linear_rod.diameter": 0.03})
    pose = pickle.loads(pickle.dumps(stiffer.home))
    assert stiffer.compliance(pose).C.tobytes() == stiffer.compliance(stiffer.home).C.tobytes()
    for other in (robot, stiffer.with_locked_joints(["leg1_R_phi"])):
        with pytest.raises(prup_pin.InputError, match="belongs to another robot"):
            other.compliance(pose)


def test_what_a_changed_robot_takes_over_changes_no_bit(cases):
    """Home and the start of Newton are those of the robot file where no length has changed."""
    for change in (
        lambda robot: robot.with_parameters({"leg1/linear_rod.diameter": 0.03}),
        lambda robot: robot.with_locked_joints(["leg1_R_phi"]),
        lambda robot: robot.with_variant("as_published"),
        lambda robot: robot.with_parameters({"leg1/base.radius": 1.01 * robot.parameters["leg1/base.radius"].value}),
    ):
        changed = change(prup_pin.load("3prup"))
        fresh = prup_pin.robot.Robot(pickle.loads(pickle.dumps(changed.mechanism)))
        for case in cases[:5]:
            assert answer(changed, case) == answer(fresh, case)


def test_a_robot_travels_together_with_its_poses():
    robot, pose = pickle.loads(pickle.dumps((prup_pin.load("3prup"), prup_pin.load("3prup").home)))
    assert robot.compliance(pose).C.tobytes() == prup_pin.load("3prup").compliance(pose).C.tobytes()


@pytest.mark.parametrize(
    "ask",
    [
        lambda robot: robot.pose(z=2.0, theta=0, phi=0),
        lambda robot: robot.pose(z=0.4, teta=0, phi=0),
        lambda robot: prup_pin.load("no_such_robot.urdf"),
        lambda robot: prup_pin.load("ur5", joint_stiffness=1e4).pose_from_actuators([0]),
    ],
)
def test_refusals_travel_between_processes_with_all_they_say(ask):
    with pytest.raises(prup_pin.PrupPinError) as caught:
        ask(prup_pin.load("3prup"))
    again = pickle.loads(pickle.dumps(caught.value))
    assert (type(again), str(again), vars(again)) == (type(caught.value), str(caught.value), vars(caught.value))
