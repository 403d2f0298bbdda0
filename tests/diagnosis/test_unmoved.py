"""A joint whose column of positions is held still while it moved is no explained one; and a prediction has each row."""

from dataclasses import replace

import numpy as np
import pytest

import prup_pin
from prup_pin import simulate
from prup_pin.diagnosis import diagnose
from prup_pin.dynamics import motion_of
from prup_pin.recordings import Noise, Recording
from prup_pin.simulation import compare
from prup_pin.views.text.diagnosis_words import verdict_text

ARM = """<robot name="lift"><link name="base"/>
<link name="carriage"><inertial><mass value="20"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="lift" type="prismatic"><parent link="base"/><child link="carriage"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="999" velocity="9"/></joint>
<link name="arm"><inertial><origin xyz="0.3 0 0"/><mass value="5"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hinge" type="revolute"><parent link="carriage"/><child link="arm"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" effort="99" velocity="9"/></joint>
<prup_pin version="1"><tool frame="arm"/><actuated joints="lift hinge"/></prup_pin></robot>"""
RATE = 200.0


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    path = tmp_path_factory.mktemp("robot") / "lift.urdf"
    path.write_text(ARM, encoding="utf-8")
    return prup_pin.load(path)


def log_of(accelerated, friction=4.0, length=10.0):
    """Return the recording of a lift that is accelerated by so much [m/s^2], and of a hinge that rubs."""
    t = np.arange(0, length, 1 / RATE)
    lift, hinge = accelerated / 2.5**2 * np.sin(2.5 * t), 0.8 * np.sin(1.7 * t)
    speed, turned = 0.8 * 1.7 * np.cos(1.7 * t), -0.8 * 1.7**2 * np.sin(1.7 * t)
    random = np.random.default_rng(3)
    force = 25 * (9.81 - accelerated * np.sin(2.5 * t)) + random.normal(0, 1.5, len(t))
    torque = (0.1 + 5 * 0.3**2) * turned + friction * np.sign(speed) + random.normal(0, 0.05, len(t))
    positions = {"lift": lift, "hinge": hinge + random.normal(0, 1e-6, len(t))}
    return Recording(t, positions=positions, efforts={"lift": force, "hinge": torque})


def held_still(log, at=0.0):
    return replace(log, positions={**log.positions, "lift": np.full(len(log), at)})


@pytest.mark.parametrize(
    ("noise", "at", "still"),
    [
        pytest.param(Noise(), 0.0, True, marks=pytest.mark.slow),
        (Noise(effort=1.5), 0.1, True),  # which filters leave as it is but for rounding
        pytest.param(Noise(), 0.0, False, marks=pytest.mark.slow),  # daily of every motion that is diagnosed
        pytest.param(Noise(effort=1.5), 0.0, False, marks=pytest.mark.slow),
    ],
)
def test_a_joint_that_moved_but_whose_column_was_held_still_is_unknown(robot, still, at, noise):
    log = replace(log_of(1.2), noise=noise)
    found = diagnose(robot, held_still(log, at) if still else log)
    unknown = [finding for finding in found.findings if finding.physics == "unknown"]
    assert [finding.location for finding in unknown] == ["lift"] * still
    assert found.verdict == ("unexplained" if still else "explained")
    if still:
        assert "the position of lift never changes, while its effort does: by" in unknown[0].statement
        assert "check the column q.lift" in unknown[0].remedy


def test_a_joint_that_stands_and_holds_its_load_is_none(robot):
    log = log_of(0.0)
    assert np.ptp(log.positions["lift"]) == 0
    assert diagnose(robot, log).verdict == "explained"


@pytest.mark.slow
def test_friction_at_rest_may_hold_all_that_the_load_changes_by(tmp_path):
    """Both joints turn about level axes, the first is braked: its drive gives the same however the second moves."""
    path = tmp_path / "arm.urdf"
    path.write_text(
        ARM.replace("prismatic", "revolute").replace('<axis xyz="0 0 1"/>', '<axis xyz="0 1 0"/>'), encoding="utf-8"
    )
    log = log_of(0.0, length=6.0)
    turned = log.positions["hinge"]
    random = np.random.default_rng(4)
    weight = -5 * 9.81 * 0.3 * np.cos(turned)
    efforts = {"lift": random.normal(weight.mean(), 0.05, len(log)), "hinge": log.efforts["hinge"] + weight}
    found = diagnose(prup_pin.load(path), log.with_measurements(efforts=efforts))
    assert not [finding for finding in found.findings if "never changes" in finding.statement]


@pytest.mark.slow
def test_what_is_left_of_efforts_is_told_as_a_share_where_no_noise_was_declared(robot):
    told = verdict_text(diagnose(robot, held_still(log_of(0.15))))
    assert told.startswith("Explained: with coulomb friction at hinge the residual of the efforts falls from ")
    assert "times the scatter of a single sample, and does not depend on the motion to an extent that matters" in told
    assert "times the noise" not in told


def test_a_motion_is_predicted_at_every_row(robot):
    """Faster than it has to be followed: rows between samples were drawn by straight lines through what jumps."""
    log = log_of(0.6, length=10.01)
    predicted = simulate(robot, log, band={"lift": 5.0, "hinge": 5.0})
    assert set(predicted.status) == {"ok"}
    assert "the motion is followed up to 5 Hz" in predicted.remarks[-2]
    noise = {"lift": 1.5}
    told = {item.channel: item for item in compare(log, predicted, noise)}
    assert told["effort lift"].in_noise == pytest.approx(1.0, abs=0.1)
    assert told["effort hinge"].in_noise is None


def test_a_log_of_more_rows_than_are_looked_at_keeps_its_rows_and_is_predicted_at_each(robot):
    n = 130_000
    t = np.arange(n) / 1000.0
    log = Recording(
        t, positions={"lift": 0.1 * np.sin(0.7 * t), "hinge": np.sin(0.3 * t)}, efforts={"lift": t, "hinge": t}
    )
    motion = motion_of(log, robot.mechanism)
    assert np.abs(log.positions["lift"][motion.rows] - motion.position[:, motion.names.index("lift")]).max() < 1e-4
    predicted = simulate(robot, log)
    assert set(predicted.status) == {"ok"}
    wanted = 25 * (9.81 - 0.1 * 0.7**2 * np.sin(0.7 * t))
    assert np.abs(predicted.efforts["lift"] - wanted)[100:-100].max() < 0.1
