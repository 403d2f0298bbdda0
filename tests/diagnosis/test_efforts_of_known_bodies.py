"""What shows by the weight of bodies shows by that of what the tool holds, too."""

import numpy as np
import pinocchio as pin
import pytest

import prup_pin
from prup_pin.dynamics import InMotion, motion_of
from prup_pin.laws import Effect, Place
from prup_pin.laws.efforts import EFFORT_LAWS
from prup_pin.recordings import Recording
from prup_pin.simulation import simulate

NOISE = np.array([0.2, 0.2, 0.15, 0.05, 0.05, 0.05])
#: What the tool holds [kg], where its centre is in the axes of the last joint [m], and what an encoder is off by [rad].
MASS, CENTRE, OFFSET = 4.0, np.array([0.05, 0.02, 0.06]), 0.03


@pytest.fixture(scope="module")
def ur5():
    return prup_pin.load("ur5")


def loaded(robot, seed=80, seconds=20.0, rate=100.0):
    """Sines of a robot that holds a body, with an elbow that stands beside where it is read; by Pinocchio alone."""
    rng, model = np.random.default_rng(seed), robot.model.copy()
    names, time = [str(name) for name in model.names[1:]], np.arange(0.0, seconds, 1 / rate)
    rates, phases = 2 * np.pi * rng.uniform(0.05, 0.5, (6, 5)), rng.uniform(0, 2 * np.pi, (6, 5))
    sizes, angle = rng.uniform(-0.7, 0.7, (6, 5)), rates[:, :, None] * time + phases[:, :, None]
    q = np.array([0.0, -1.0, 1.2, 0.4, 0.8, 0.0]) + np.einsum("ik,ikt->ti", sizes, np.sin(angle))
    v = np.einsum("ik,ikt->ti", sizes * rates, np.cos(angle))
    a = -np.einsum("ik,ikt->ti", sizes * rates**2, np.sin(angle))
    model.inertias[6] += pin.Inertia(MASS, CENTRE, 0.01 * MASS * np.eye(3))
    data, beside = model.createData(), OFFSET * np.eye(6)[2]
    tau = np.array([pin.rnea(model, data, *each) for each in zip(q + beside, v, a, strict=True)])
    tau += NOISE * rng.normal(size=tau.shape)
    columns = ({name: table[:, k] for k, name in enumerate(names)} for table in (q, v, a, tau))
    groups = dict(zip(("positions", "velocities", "accelerations", "efforts"), columns, strict=True))
    return Recording(time=time, **groups)


@pytest.mark.slow
def test_an_encoder_is_off_by_what_the_weight_of_a_held_body_says(ur5):
    recording = loaded(ur5)
    found = prup_pin.diagnose(ur5, recording)
    assert found.verdict == "explained"
    physics = {finding.physics for finding in found.told}
    assert physics == {"payload", "encoder_offset"}
    (off,) = [finding for finding in found.told if finding.physics == "encoder_offset"]
    assert off.location == "elbow_joint"
    low, high = off.parameters["offset"].interval
    assert low < OFFSET < high < 1.1 * OFFSET
    (held,) = [finding for finding in found.told if finding.physics == "payload"]
    assert held.parameters["mass"].value == pytest.approx(MASS, rel=0.03)

    other = loaded(ur5, seed=81)
    foretold = simulate(ur5, other, found.effects).efforts
    for name, noise in zip(other.efforts, NOISE, strict=True):
        left = np.abs(other.efforts[name] - foretold[name])
        assert np.median(left) < 1.1 * 0.6745 * noise


@pytest.mark.parametrize("physics", ["encoder_offset", "encoder_delay"])
def test_what_a_displaced_joint_changes_is_that_of_all_known_bodies(ur5, physics):
    """As a robot file says it that has the held body in it."""
    added = pin.Inertia(MASS, CENTRE, 0.01 * MASS * np.eye(3)).toDynamicParameters()
    at = InMotion.of(ur5.mechanism, motion_of(loaded(ur5), ur5.mechanism))
    (law,) = [law for law in EFFORT_LAWS if law.physics == physics and law.acts(Place("elbow_joint"), at)][:1]
    place, values = Place("elbow_joint", law.variant), {"offset": 1e-3, "delay": 1e-3, "age": 1e-3}
    bodies = at.regressor[:, :, 5] @ added
    known = at.knowing(bodies, np.zeros_like(bodies), bodies, {6: added})
    model = ur5.model.copy()
    model.inertias[6] += pin.Inertia(MASS, CENTRE, 0.01 * MASS * np.eye(3))

    def efforts(sign):
        motion, step, column = at.motion, 1e-4, at.motion.names.index("elbow_joint")
        q, v, a = (table.copy() for table in (motion.position, motion.speed, motion.acceleration))
        if physics == "encoder_offset":
            q[:, column] += sign * step
        else:
            jerk = at.rate(motion.acceleration[:, column])
            for table, rate in ((q, v), (v, a)):
                table[:, column] += sign * step * rate[:, column]
            a[:, column] += sign * step * jerk
        data = model.createData()
        return np.array([pin.rnea(model, data, *each) for each in zip(q, v, a, strict=True)])

    per = (efforts(0.5) - efforts(-0.5)) / 1e-4
    own = law.efforts(place, {name: values[name] for name in law.linear}, known) / 1e-3
    assert own == pytest.approx(per, abs=2e-3 * np.abs(per).max())
    drawn = law.efforts(place, {name: values[name] for name in law.linear}, at) / 1e-3
    assert np.abs(drawn - per).max() > 0.1 * np.abs(per).max()


def test_a_simulation_takes_the_bodies_that_come_before_it(ur5):
    words = ("payload", "encoder_offset")
    laws = {law.physics: law for law in EFFORT_LAWS if law.physics in words and law.variant == "effort"}
    body = {"mass": MASS, **dict(zip("xyz", CENTRE, strict=True)), **dict.fromkeys(("Ixx", "Iyy", "Izz"), 0.1)}
    body.update(dict.fromkeys(("Ixy", "Ixz", "Iyz"), 0.0))
    (tool,) = laws["payload"].places(ur5.mechanism)
    held = Effect(laws["payload"], tool, body)
    off = Effect(laws["encoder_offset"], Place("elbow_joint", laws["encoder_offset"].variant), {"offset": 1e-3})
    recording = loaded(ur5)
    whole, alone, drawn = (simulate(ur5, recording, effects).efforts for effects in ((held, off), (held,), (off,)))
    rigid = simulate(ur5, recording).efforts
    name = "wrist_1_joint"
    assert np.std(whole[name] - alone[name]) > 1.5 * np.std(drawn[name] - rigid[name])
