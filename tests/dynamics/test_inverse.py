"""Inverse dynamics by energy, power and linearity; of trees and of loops."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from prup_pin import load
from prup_pin.dynamics import INERTIAL, Band, InMotion, in_frame
from prup_pin.testing.efforts import motion_along

from ..loaded.coupled import belted_arm

ROBOTS = Path(__file__).parents[1] / "robots"


@pytest.fixture(scope="module")
def ur5():
    return load("ur5")


def random_motion(robot, seed=3, n=40):
    rng = np.random.default_rng(seed)
    names = robot.mechanism.actuated
    return motion_along(names, *(rng.normal(size=(n, len(names))) for _ in range(3)))


def test_efforts_are_linear_in_the_inertial_parameters(ur5):
    at = InMotion.of(ur5.mechanism, random_motion(ur5))
    drawn = np.array([inertia.toDynamicParameters() for inertia in list(ur5.mechanism.model.inertias)[1:]])
    assert np.einsum("nkbp,bp->nk", at.regressor, drawn) == pytest.approx(at.rigid, abs=1e-10)


def test_a_wrench_on_the_tool_does_its_work_through_the_actuators(ur5):
    """Efforts times speeds are the power that goes into motion, weight and the wrench."""
    motion = random_motion(ur5)
    wrench = np.random.default_rng(5).normal(size=(len(motion), 6))
    at = InMotion.of(ur5.mechanism, motion)
    loaded = InMotion.of(ur5.mechanism, replace(motion, wrench=wrench))
    model = ur5.mechanism.model
    data, tool = model.createData(), model.getFrameId("tool0")
    for row in range(len(motion)):
        pin.forwardKinematics(model, data, at.trajectory.q[row], at.trajectory.v[row])
        twist = pin.getFrameVelocity(model, data, tool, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED).vector
        power = (loaded.rigid[row] - at.rigid[row]) @ motion.speed[row]
        assert power == pytest.approx(-twist @ wrench[row], abs=1e-9)


def test_inertial_parameters_in_another_frame_are_those_of_the_same_body():
    body = pin.Inertia.Random()
    frame = pin.SE3.Random()
    there = frame.actInv(body).toDynamicParameters()
    assert in_frame(frame.homogeneous) @ there == pytest.approx(body.toDynamicParameters(), abs=1e-12)
    assert len(INERTIAL) == 10


def test_a_closed_loop_needs_the_efforts_that_do_its_work():
    """Of a five-bar: the power of its two drives is the rate of change of its energy, by finite differences."""
    robot = load(ROBOTS / "weighty_five_bar" / "weighty_five_bar.urdf")
    mechanism = robot.mechanism
    home = np.array([robot.home.actuators[name] for name in mechanism.actuated])
    time = np.arange(0.0, 2.0, 0.002)
    sway = np.column_stack([0.2 * np.sin(3 * time), 0.15 * np.sin(4 * time + 1)])
    speed = np.column_stack([0.6 * np.cos(3 * time), 0.6 * np.cos(4 * time + 1)])
    rate = np.column_stack([-1.8 * np.sin(3 * time), -2.4 * np.sin(4 * time + 1)])
    motion = motion_along(mechanism.actuated, home + sway, speed, rate)
    at = InMotion.of(mechanism, motion)
    model, data = mechanism.model, mechanism.model.createData()
    model = pin.Model(model)
    model.gravity.linear = mechanism.gravity
    energy = []
    for q, v in zip(at.trajectory.q, at.trajectory.v, strict=True):
        energy.append(pin.computeKineticEnergy(model, data, q, v) + pin.computePotentialEnergy(model, data, q))
    power = (at.rigid * speed).sum(axis=1)
    assert power[2:-2] == pytest.approx(np.gradient(energy, 0.002)[2:-2], abs=2e-4 * np.abs(power).max())
    # the other joints really move as the loop makes them
    assert np.gradient(at.trajectory.q, 0.002, axis=0)[2:-2] == pytest.approx(at.trajectory.v[2:-2], abs=2e-4)
    assert np.gradient(at.trajectory.v, 0.002, axis=0)[2:-2] == pytest.approx(at.trajectory.a[2:-2], abs=2e-3)


@pytest.mark.parametrize("way", [0.0, 1e-4, 0.02])
def test_friction_turns_round_where_the_motion_does_and_not_at_the_next_sample(way):
    """Dahl's model at each sample, against the same motion followed 200 times as finely."""
    robot, finer, step = load("ur5"), 200, 0.05
    time = np.arange(240) * step

    def moved(time):
        return np.sin(0.9 * time) + 0.5 * np.sin(2.3 * time + 1.0)

    q = np.zeros((len(time), 6))
    q[:, 0] = moved(time)
    speed = np.zeros_like(q)
    speed[:, 0] = (0.9 * np.cos(0.9 * time) + 1.15 * np.cos(2.3 * time + 1.0)) * step / 0.02  # on that motion's clock
    at = InMotion.of(robot.mechanism, motion_along(robot.mechanism.actuated, q, speed, 0 * q))
    fine = moved((np.arange(len(time) * finer) - finer) * step / finer)
    state, followed = np.sign(fine[1] - fine[0]), []
    for change in np.diff(fine, prepend=fine[0]):
        towards = np.sign(change)
        state = towards + (state - towards) * (np.exp(-abs(change) / way) if way else change == 0)
        followed.append(state)
    there = np.array(followed)[finer::finer][2:-2]
    dragged = at.dragged("shoulder_pan_joint", way)[2 : 2 + len(there)]
    assert np.ptp(there) == pytest.approx(2.0)
    assert dragged == pytest.approx(there, abs=0.08)
    assert np.sqrt(np.mean((dragged - there) ** 2)) < 0.012
    assert np.mean(dragged - there) == pytest.approx(0.0, abs=1e-3)


def test_an_encoder_that_is_late_or_off_shows_by_its_slope(ur5):
    """Against efforts of the motion that is really late, or off."""
    time = np.arange(400) * 0.01
    rate = np.array([1.0, 1.3, 0.7, 1.9, 1.1, 2.3])
    q, qd, qdd = (
        np.sin(rate * time[:, None] + order * np.pi / 2) * rate**order * 0.5 for order in range(3)
    )  # fmt: skip
    names = ur5.mechanism.actuated
    motion = replace(motion_along(names, q, qd, qdd), time=time, rate=100.0, band=Band((10.0,) * len(names), 100.0))
    at = InMotion.of(ur5.mechanism, motion)
    step = 1e-5
    for name, column in (("elbow_joint", 2), ("wrist_1_joint", 3)):
        off = q.copy()
        off[:, column] += step
        there = InMotion.of(ur5.mechanism, motion.with_motion(off, qd, qdd)).rigid
        assert at.displaced(name) == pytest.approx((there - at.rigid) / step, abs=2e-3 * np.abs(at.rigid).max())
        moved = [table.copy() for table in (q, qd, qdd)]
        ahead = [np.sin(rate * (time[:, None] + step) + order * np.pi / 2) * rate**order * 0.5 for order in range(3)]
        for table, later in zip(moved, ahead, strict=True):
            table[:, column] = later[:, column]
        there = InMotion.of(ur5.mechanism, motion.with_motion(*moved)).rigid
        inner = slice(5, -5)  # the rate of an acceleration is one-sided at the ends
        expected = (there - at.rigid) / step
        assert at.shifted(name)[inner] == pytest.approx(expected[inner], abs=2e-3 * np.abs(expected).max())


def test_drives_give_what_their_followers_need(tmp_path):
    """The power of an arm's one drive is the rate of change of its energy, in which all joints have their own part."""
    machine = belted_arm()
    robot = machine.file.load(tmp_path)
    at = InMotion.of(robot.mechanism, random_motion(robot))
    model, motion = robot.mechanism.model, at.motion
    data, ratios, step = model.createData(), np.array([1.0, -1.5, -0.75]), 1e-6

    def energy(position, speed):
        q = np.array([position, 0.3 - 1.5 * position, 0.5 * (0.3 - 1.5 * position)])
        return pin.computeKineticEnergy(model, data, q, ratios * speed) + pin.computePotentialEnergy(model, data, q)

    for row in range(len(motion)):
        x, v, a = (values[row, 0] for values in (motion.position, motion.speed, motion.acceleration))
        ends = [energy(x + s * v + s * s / 2 * a, v + s * a) for s in (step, -step)]
        assert at.rigid[row, 0] * v == pytest.approx((ends[0] - ends[1]) / (2 * step), rel=1e-6, abs=1e-6)
    drawn = np.array([inertia.toDynamicParameters() for inertia in list(model.inertias)[1:]])
    assert np.einsum("nkbp,bp->nk", at.regressor, drawn) == pytest.approx(at.rigid, abs=1e-10)
