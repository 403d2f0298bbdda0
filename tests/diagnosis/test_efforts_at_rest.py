"""Poses and drives' efforts of a robot at rest: one diagnosis of both."""

from dataclasses import replace

import numpy as np
import pytest

from prup_pin import load
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.efforts.verdict import _by_link
from prup_pin.dynamics import INERTIAL, InMotion, motion_of
from prup_pin.laws import Effect, Place
from prup_pin.laws.efforts import EFFORT_LAWS
from prup_pin.laws.efforts.payload import HeldBody
from prup_pin.laws.self_weight import SelfWeight
from prup_pin.recordings import Noise, Recording
from prup_pin.simulation import simulate
from prup_pin.spatial import rotation_exp
from prup_pin.views.text.diagnosis_words import alternative_text

SHIFT = np.array([1e-3, -5e-4, 7e-4])


@pytest.fixture(scope="module")
def ur5():
    return load("ur5")


@pytest.fixture(scope="module")
def bench(ur5):
    """Thirty postures with three loads each: poses and efforts as simulated, with the sensors' noise."""
    rng, count = np.random.default_rng(7), 90
    q = np.repeat(np.array([0, -1.1, 1.0, -0.3, 0.5, 0]) + rng.uniform(-0.8, 0.8, (count // 3, 6)), 3, axis=0)
    wrench = np.zeros((count, 6))
    wrench[1::3, 2], wrench[2::3, 0] = -30.0, 25.0
    recording = Recording(
        time=np.arange(float(count)),
        positions=dict(zip(ur5.mechanism.actuated, q.T, strict=True)),
        efforts=dict.fromkeys(ur5.mechanism.actuated, np.zeros(count)),
        wrench=wrench,
        position=np.zeros((count, 3)),
        rotation=np.zeros((count, 3)),
        noise=Noise(position=2e-5, rotation=1e-4, effort=0.1),
    )
    weight = [Effect(SelfWeight(), place, {"scale": 1.0}) for place in SelfWeight().places(ur5.mechanism)]
    known = simulate(ur5, recording, weight)
    return replace(
        recording,
        position=known.position + 2e-5 * rng.normal(size=(count, 3)),
        rotation=known.rotation + 1e-4 * rng.normal(size=(count, 3)),
        efforts={name: values + 0.1 * rng.normal(size=count) for name, values in known.efforts.items()},
    )


def at_rest(ur5, bench):
    return InMotion.of(ur5.mechanism, motion_of(bench, ur5.mechanism))


def with_efforts(bench, change):
    columns = dict(bench.efforts)
    return replace(bench, efforts={name: values + change[:, k] for k, (name, values) in enumerate(columns.items())})


def test_a_robot_as_drawn_misses_nothing_in_either_channel(ur5, bench):
    found = diagnose(ur5, bench)
    assert found.verdict == "nothing_missing"
    assert found.by_channel["effort elbow_joint"]["after"] == pytest.approx(1.0, abs=0.2)
    assert not [name for name in found.unused_columns if name.startswith("tau.")]


@pytest.mark.slow
def test_a_body_that_no_pose_shows_is_found_by_what_drives_hold(ur5, bench):
    law, (place,) = HeldBody(), HeldBody().places(ur5.mechanism)
    values = {q.name: 0.0 for q in law.quantities} | {"mass": 1.5, "z": 0.05}
    held = with_efforts(bench, law.efforts(place, values, at_rest(ur5, bench)))
    found = diagnose(ur5, held)
    (finding,) = found.findings
    assert (finding.physics, finding.location, found.verdict) == ("payload", "tool0", "explained")
    low, high = finding.parameters["mass"].interval
    assert low < 1.5 < high
    assert finding.parameters["mass"].value == pytest.approx(1.5, rel=0.01)
    # moments of inertia are about a point that is told, and links that are fixed to one another are one body
    assert "Ixx to Izz are about the origin and axes of tool0, not about the centre of mass" in finding.statement
    assert {"wrist_3_link", "ee_link"} <= {*finding.candidates}
    assert alternative_text(finding) == [
        "tool0 is one rigid body with wrist_3_link: only the mass, centre and inertia of the whole show"
    ]


def test_parameters_of_a_link_of_which_nothing_shows_are_one_thing():
    silent = [f"link_1.{name}" for name in INERTIAL if name != "Izz"] + ["link_2.mz"]
    assert _by_link(silent) == "link_1 but its Izz; link_2: mz"
    assert _by_link([f"link_1.{name}" for name in INERTIAL]) == "link_1"


def test_a_prediction_at_rest_holds_what_the_laws_of_efforts_add(ur5, bench):
    gain, spring, slide = (next(law for law in EFFORT_LAWS if law.physics == word and law.variant == aspect)
                           for word, aspect in (("effort_gain", "effort"), ("counterbalance", "effort of a spring"),
                                                ("coulomb_friction", "effort")))  # fmt: skip
    effects = [
        Effect(spring, Place("elbow_joint", spring.variant), {"stiffness": 3.0, "preload": 1.0}),
        Effect(gain, Place("shoulder_lift_joint", gain.variant), {"gain": 0.25}),
        Effect(slide, Place("elbow_joint", slide.variant), {"limit": 5.0, "presliding": 1e-4}),
    ]
    expected = at_rest(ur5, bench).rigid
    lift, elbow = (list(bench.efforts).index(name) for name in ("shoulder_lift_joint", "elbow_joint"))
    expected[:, lift] *= 1.25
    # friction takes any value at rest
    expected[:, elbow] += 3.0 * bench.positions["elbow_joint"] + 1.0
    alone = replace(bench, position=None, rotation=None)
    predicted = np.column_stack(list(simulate(ur5, alone, effects).efforts.values()))
    assert predicted == pytest.approx(expected, abs=1e-9)
    weight = [Effect(SelfWeight(), place, {"scale": 1.0}) for place in SelfWeight().places(ur5.mechanism)]
    posed = np.column_stack(list(simulate(ur5, bench, [*weight, *effects]).efforts.values()))
    assert posed == pytest.approx(expected, abs=0.02)


def test_efforts_without_the_robot_s_weight_are_taken_so(ur5, bench):
    at = at_rest(ur5, bench)
    tared = with_efforts(bench, -at.rigid_under(ur5.mechanism.gravity))
    found = diagnose(ur5, tared)
    assert found.verdict == "nothing_missing"
    assert any("do not hold the robot's weight" in text for text in found.remarks)


@pytest.mark.slow
def test_a_target_seen_without_rotations_is_not_said_to_be_turned(ur5, bench):
    turns = np.array([rotation_exp(vector) for vector in bench.rotation])
    found = diagnose(ur5, replace(bench, efforts={}, rotation=None, position=bench.position + turns @ SHIFT))
    (finding,) = found.findings
    assert finding.statement == "the measured target is 1.32 mm away from the tool frame"
    assert finding.effect.values["rx"] == finding.parameters["rx"].value == 0.0
    assert [finding.parameters[axis].value for axis in "xyz"] == pytest.approx(SHIFT, abs=1e-5)


@pytest.mark.slow
def test_postures_measured_once_tell_a_gain_from_a_zero_point_though_no_noise_is_known(ur5):
    """Each of eighty postures is on its own, as a stretch of a motion is: a few of these could not tell chance."""
    rng, count = np.random.default_rng(3), 80
    q = np.array([0, -1.2, 1.0, -0.3, 0.5, 0]) + rng.uniform(-0.8, 0.8, (count, 6))
    names = ur5.mechanism.actuated
    positions, none = dict(zip(names, q.T, strict=True)), dict.fromkeys(names, np.zeros(count))
    recording = Recording(time=10.0 * np.arange(count), positions=positions, efforts=none)
    held = dict(zip(names, at_rest(ur5, recording).rigid.T, strict=True))
    gains = {"elbow_joint": 1.15}
    efforts = {name: gains.get(name, 1.0) * held[name] + 0.05 * rng.normal(size=count) for name in names}
    diagnosis = diagnose(ur5, recording.with_measurements(efforts=efforts))
    assert np.isnan(diagnosis.efforts.noise).all()
    (finding,) = (finding for finding in diagnosis.findings if finding.physics != "unknown")
    assert (finding.physics, finding.location) == ("effort_gain", "elbow_joint")
    assert finding.parameters["gain"].value == pytest.approx(0.15, abs=0.01)
