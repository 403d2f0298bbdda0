"""A bar on one motor: which way its effort counts, in which unit, and that its own mass may be off like any robot's."""

from dataclasses import replace

import numpy as np
import pytest

from prup_pin import diagnose, load
from prup_pin.diagnosis.conventions import read_logs
from prup_pin.diagnosis.efforts.band import band_of, in_motion
from prup_pin.diagnosis.efforts.conventions import conventions_of_efforts
from prup_pin.diagnosis.efforts.gains import gains_of
from prup_pin.dynamics import InMotion, motion_of
from prup_pin.recordings import Recording, Tolerances
from prup_pin.simulation.moving_efforts import efforts_in_motion

UNKNOWN_UNIT = Tolerances(effort_gain=1.0)


@pytest.fixture(scope="module")
def bar(tmp_path_factory):
    inertia = '<inertia ixx="0.01" iyy="0.01" izz="0.001" ixy="0" ixz="0" iyz="0"/>'
    path = tmp_path_factory.mktemp("bar") / "bar.urdf"
    path.write_text(
        '<robot name="bar"><link name="base"/><link name="bar"><inertial><origin xyz="0 0 -0.5"/><mass value="0.5"/>'
        f'{inertia}</inertial></link><joint name="hinge" type="continuous"><parent link="base"/><child link="bar"/>'
        '<axis xyz="0 1 0"/></joint></robot>'
    )
    return load(path)


def swung(bar, heavier=1.0, friction=0.1, damping=0.03, shaken=0.0, seed=0, lasting=2.6):
    """A bar that is swung up, so many times as heavy as drawn; its drive's effort in N m with a little noise.

    shaken: by how much something shakes it that no law knows, as a controller does.
    """
    rng, time = np.random.default_rng(seed), np.arange(0, lasting, 0.02)
    grows = time / lasting * (1 + 0.3 * seed)
    silent = Recording(time=time, positions={"hinge": 2.2 * grows * np.sin(5.0 * time + seed)})
    motion = motion_of(silent, bar.mechanism, ["hinge"])
    speed = motion.speed
    tau = heavier * InMotion.of(bar.mechanism, motion).rigid + friction * np.tanh(speed / 0.05)
    tau += damping * speed + shaken * np.sin(11 * motion.time[:, None] + 0.3) + 0.05 * rng.normal(size=speed.shape)
    return replace(silent.select(motion.rows), efforts={"hinge": tau[:, 0]})


def in_motion_of(bar, recording):
    band, _ = band_of(bar.mechanism, recording)
    return in_motion(bar.mechanism, recording, band, [])


def coarse(recording, step):
    """The same log by an encoder of such a step [rad]."""
    return replace(recording, positions={"hinge": np.round(recording.positions["hinge"] / step) * step})


def scaled(recording, gain):
    return replace(recording, efforts={"hinge": gain * recording.efforts["hinge"]}, tolerances=UNKNOWN_UNIT)


@pytest.mark.parametrize("gain", [pytest.param(-5.0, marks=pytest.mark.slow), 5.0])
def test_which_way_a_drive_counts_is_told_in_whatever_unit(bar, gain):
    """Where most of the effort is something else the drawing alone tells too little, and friction tells the rest."""
    recording = swung(bar, friction=0.2, damping=0.15, shaken=2.5)
    found = conventions_of_efforts(bar.mechanism, scaled(recording, gain))
    told = [str(item) for item in found.conventions] if found else []
    assert told == (["tau=reversed"] if gain < 0 else [])


def test_a_bar_that_is_its_own_mirror_image_is_read_either_way(bar):
    """Its effort or its position turned round is the same bar from behind: both were refused as two readings."""
    logs = read_logs(bar, scaled(swung(bar), -5.0))
    (finding,) = logs.findings()
    assert [str(item) for item in finding.conventions] == ["tau=reversed"]
    assert finding.alternatives == ("q=reversed",)


def test_the_unit_of_a_lone_drive_is_told_by_a_short_motion(bar):
    """Its body is all that a counterbalance and a rotor would be: freed of these nothing told the unit."""
    recording = scaled(swung(bar, lasting=1.6), 5.0)
    gains = gains_of(in_motion_of(bar, recording), {"effort_gain": 1.0, "mass": 0.1, "inertia": 0.1})
    assert gains.gains == pytest.approx([5.0], rel=0.25)


def test_a_lone_link_may_be_heavier_than_drawn(bar):
    """Its mass was no nuisance parameter, and ten numbers of which three are told could all be chance."""
    found = diagnose(bar, swung(bar, heavier=1.45, shaken=0.3))
    assert "inertial_parameters" in [item.physics for item in found.findings]
    other = swung(bar, heavier=1.45, seed=3)
    drawn, foretold = (
        efforts_in_motion(bar, other, effects, found.efforts.band)[0]["hinge"] for effects in ([], found.effects)
    )
    measured = other.efforts["hinge"]
    assert np.std(foretold - measured) < 0.3 * np.std(drawn - measured)


def test_rows_in_which_a_coarse_encoder_saw_no_step_are_predicted_as_they_were_measured(bar):
    """An effort that went on tells them from rows that were logged again: left out, all after them came too early."""
    recording = coarse(swung(bar, seed=1), 0.01)
    measured, predicted = (motion_of(recording, bar.mechanism, driven) for driven in (None, ["hinge"]))
    assert len(predicted) == len(recording)
    assert np.array_equal(predicted.time, measured.time)


def test_efforts_are_compared_below_where_nothing_but_steps_of_the_encoder_is_predicted(bar):
    fine, rough = (band_of(bar.mechanism, coarse(swung(bar), step))[0]["hinge"] for step in (1e-5, 0.003))
    assert rough < 0.8 * fine


@pytest.mark.slow
def test_masses_of_which_a_short_log_is_not_sure_are_predicted_and_not_told(bar):
    found = diagnose(bar, coarse(swung(bar, heavier=1.14, friction=0.08, damping=0.004, lasting=1.6), 0.006))
    assert "inertial_parameters" not in {finding.physics for finding in found.findings}
    assert "inertial_parameters" in {effect.law.physics for effect in found.effects}


def test_a_weight_is_told_that_is_small_beside_what_looks_like_an_offset(bar):
    """A swing about one side: gravity's part across it hardly changes, and is the largest of a link's columns."""
    found = diagnose(bar, swung(bar, heavier=0.59, friction=0.07, damping=0.08, shaken=0.4, seed=6, lasting=1.6))
    assert {finding.physics for finding in found.findings} == {"inertial_parameters", "viscous_friction"}
