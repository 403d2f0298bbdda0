"""Rows of a motion that were shuffled, as some public sets are: each says how fast the joints go and speed up."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import prup_pin
from prup_pin.dynamics import InMotion, motion_of
from prup_pin.errors import InputError
from prup_pin.recordings import Noise, Recording
from prup_pin.simulation import simulate

SIZES = np.array([0.5, 0.6, 0.4, 0.1, 0.1, 0.1])
FRICTION = np.array([6.0, 8.0, 5.0, 1.5, 1.2, 1.0])


@pytest.fixture(scope="module")
def ur5():
    return prup_pin.load("ur5")


def logged(robot, rows=1500, shuffled=True, faulty=True, seed=80):
    """A motion of sines with a forearm that is heavier by 30 %, and dry friction at all joints; by Pinocchio alone."""
    rng, model = np.random.default_rng(seed), robot.model.copy()
    names, time = [str(name) for name in model.names[1:]], 0.02 * np.arange(rows)
    waves = len(names), 5
    rates, phases = 2 * np.pi * rng.uniform(0.05, 0.6, waves), rng.uniform(0, 2 * np.pi, waves)
    sizes, angle = rng.uniform(-0.6, 0.6, waves), rates[:, :, None] * time + phases[:, :, None]
    q = np.einsum("ik,ikt->ti", sizes, np.sin(angle))
    v = np.einsum("ik,ikt->ti", sizes * rates, np.cos(angle))
    a = -np.einsum("ik,ikt->ti", sizes * rates**2, np.sin(angle))
    if faulty:
        body = model.inertias[3]
        model.inertias[3] = pin.Inertia(1.3 * body.mass, body.lever, 1.3 * body.inertia)
    data = model.createData()
    tau = np.array([pin.rnea(model, data, *each) for each in zip(q, v, a, strict=True)])
    tau += FRICTION[: len(names)] * np.sign(v) if faulty else 0.0
    tau += SIZES[: len(names)] * rng.normal(size=tau.shape)
    order = rng.permutation(rows) if shuffled else np.arange(rows)
    columns = ({name: table[order, k] for k, name in enumerate(names)} for table in (q, v, a, tau))
    groups = dict(zip(("positions", "velocities", "accelerations", "efforts"), columns, strict=True))
    return Recording(time=time, **groups)


@pytest.fixture(scope="module")
def shuffled(short_arm):
    return logged(short_arm, rows=400)


@pytest.fixture(scope="module")
def told(short_arm, shuffled, once):
    return once("shuffled", lambda _: prup_pin.diagnose(short_arm, shuffled))


def test_what_was_left_out_is_told_as_of_a_course_of_time(shuffled, told):
    assert told.verdict == "explained"
    limits = {effect.place.name: effect.values["limit"] for effect in told.effects if "limit" in effect.values}
    assert set(limits) == set(shuffled.efforts)
    assert [limits[name] for name in shuffled.efforts] == pytest.approx(FRICTION[:3], rel=0.03)
    (mass,) = [item for item in told.findings if item.physics == "inertial_parameters"]
    assert "forearm_link" in mass.statement
    assert any("in no order of time" in text for text in told.remarks)


@pytest.mark.slow
def test_nothing_is_missing_where_nothing_is(ur5):
    told = prup_pin.diagnose(ur5, replace(logged(ur5, faulty=False), noise=Noise(effort=float(SIZES.max()))))
    assert told.verdict == "nothing_missing"
    assert not told.findings


def test_each_row_has_its_own_motion(short_arm, shuffled):
    motion = motion_of(shuffled, short_arm.mechanism)
    rows, names = motion.rows, motion.names
    for table, group in ((motion.speed, "velocities"), (motion.acceleration, "accelerations")):
        assert table == pytest.approx(np.column_stack([getattr(shuffled, group)[name] for name in names])[rows])
    at = InMotion.of(short_arm.mechanism, motion)
    for name in names:
        assert (at.dragged(name, 0.0) == np.sign(at.speed(name))).all()
        assert (at.dragged(name, 1e-3) == np.sign(at.speed(name))).all()


def test_a_prediction_takes_rows_for_themselves_too(short_arm, told):
    other = logged(short_arm, seed=81)
    found = simulate(short_arm, other, told.effects)
    for k, (name, efforts) in enumerate(other.efforts.items()):
        left = efforts - found.efforts[name]
        assert np.std(left) == pytest.approx(SIZES[k], rel=0.1), name


def test_a_course_of_time_and_postures_are_what_they_were(ur5):
    names = list(logged(ur5).positions)
    assert logged(ur5).in_no_order(names)
    assert not logged(ur5, shuffled=False).in_no_order(names)
    rng = np.random.default_rng(1)  # postures at rest, in which a controller still reports some speed
    postures = {name: rng.uniform(-1, 1, 200) for name in names}
    speeds = {name: 1e-3 * rng.normal(size=200) for name in names}
    assert not Recording(time=np.arange(200.0), positions=postures, velocities=speeds).in_no_order(names)
    assert not Recording(time=np.arange(200.0), positions=postures).in_no_order(names)


def test_without_accelerations_it_is_told_what_is_missing(short_arm, shuffled):
    with pytest.raises(InputError, match=r"in no order of time.*qdd\.shoulder_pan_joint"):
        motion_of(replace(shuffled, accelerations={}), short_arm.mechanism)
