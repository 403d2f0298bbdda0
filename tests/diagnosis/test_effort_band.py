"""Efforts are compared where the motion is the rigid robot's; bodies can exist; what drives share is one finding."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh

from prup_pin import load
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.efforts.band import Spectra, _cutoffs, coherent_band
from prup_pin.diagnosis.prospects import prospects
from prup_pin.dynamics import InMotion, motion_of
from prup_pin.dynamics.inertial import BODIES_OFF, SOME_BODY, near_body, pseudo_inertia, some_body
from prup_pin.laws import Effect, Place
from prup_pin.laws.efforts.coulomb_friction import SlidingFriction
from prup_pin.laws.efforts.inertial_parameters import InertialParameters
from prup_pin.laws.efforts.viscous_friction import Damping
from prup_pin.recordings import Recording, read_recording
from prup_pin.simulation import simulate

from ..reference.concealed.elastic import draw_elastic, write

#: Of the carriage and of the rotor that the file leaves out [kg].
CARRIAGE, ROTOR = 95.0, 30.0


def log(rate=1000.0, noise=0.0, counts=0.0, jitter=0.0, vibration=0.0, seconds=12.0):
    """Return a recording of the axis with a rotor; vibration [m/s^2]: of its motor at 30 Hz, which its effort lacks."""
    rng = np.random.default_rng(5)
    time = np.arange(round(seconds * rate)) / rate
    true = time + jitter * rng.uniform(-0.5, 0.5, len(time))
    q, acceleration = np.zeros_like(true), np.zeros_like(true)
    for size, speed, phase in ((0.1, 2.2, 0.0), (0.05, 5.8, 1.0), (0.02, 11.0, 2.0)):
        q += size * np.sin(speed * true + phase)
        acceleration -= size * speed**2 * np.sin(speed * true + phase)
    shaken = 2 * np.pi * 30.0
    q = q - vibration / shaken**2 * np.sin(shaken * true) + noise * rng.normal(size=len(q))
    if counts:
        q = np.round(q / counts) * counts
    tau = (CARRIAGE + ROTOR) * acceleration + rng.normal(size=len(q))
    return Recording(time=time, positions={"carriage": q}, efforts={"carriage": tau})


@pytest.mark.slow
def test_what_is_told_before_a_diagnosis_is_the_band_that_it_will_use(carriage):
    """Of a motor that vibrates: the frequency, and the words."""
    shaken = log(vibration=3.0)
    (before,) = (text for text in prospects(carriage, shaken).remarks if "efforts are compared" in text)
    after = diagnose(carriage, shaken)
    assert before in after.remarks
    assert f"{after.efforts.band['carriage']:.3g} Hz, where the rigid robot's efforts are" in before


@pytest.mark.parametrize(
    "how",
    [
        {"noise": 1e-6},
        {"noise": 1e-5},
        {"noise": 1e-6, "jitter": 5e-4},
        {"counts": 0.4 / 2**12},
        {"noise": 1e-6, "vibration": 5.0},
    ],
    ids=["quiet", "noise", "jitter", "12 bits", "vibrating motor"],
)
def test_inertia_is_right_to_one_per_cent_whatever_the_encoder_does(carriage, how):
    found = diagnose(carriage, log(**how))
    rotor = next(finding for finding in found.findings if finding.physics == "rotor_inertia").parameters["inertia"]
    assert rotor.value == pytest.approx(ROTOR, abs=0.01 * (CARRIAGE + ROTOR))


def test_a_motor_that_vibrates_ends_what_is_compared(carriage):
    bands = []
    for vibration in (0.0, 5.0):
        at = InMotion.of(carriage.mechanism, motion_of(log(noise=1e-7, vibration=vibration), carriage.mechanism))
        bands.append(coherent_band(at)[0]["carriage"])
    assert bands[0] > 40.0
    assert 4.0 < bands[1] < 30.0


def test_what_a_coherent_prediction_leaves_more_of_again_ends_what_is_compared():
    """Efforts of a motion below 3 Hz, of motors that vibrate about 25 Hz, and of white noise."""
    frequency = np.arange(0.25, 60.0, 0.25)
    motion = 10.0 / (1 + frequency**8)
    shaken, noise = 0.2 * np.exp(-(((frequency - 25) / 6) ** 2)), np.full(frequency.shape, 1e-5)

    def cutoffs(gain, measured_noise, predicted_noise, shaken=shaken):
        """The prediction knows the motion; of the vibration it has so much."""
        measured = motion + shaken + measured_noise
        predicted, both = motion + gain**2 * shaken + predicted_noise, motion + gain * shaken
        cut, vibrates = _cutoffs(Spectra(frequency, *(each[None] for each in (measured, predicted, both))), 4.0, 50.0)
        return cut[0], vibrates

    cut, vibrates = cutoffs(0.6, noise, noise)
    assert vibrates
    assert cut < 12.0
    cut, vibrates = cutoffs(1.0, noise, noise)  # a rigid robot that is shaken on purpose
    assert not vibrates
    assert cut > 40.0
    assert not cutoffs(1.0, noise, 1e-9 * frequency**6, 0.0 * shaken)[1]  # noise of encoders is not coherent
    assert not cutoffs(0.0, noise, noise)[1]  # a hum of the drive, which no motion foretells


def test_a_late_or_filtered_effort_is_still_compared(carriage):
    recording = log(noise=1e-7)
    late = 8  # ms
    moved = replace(recording, efforts={"carriage": np.roll(recording.efforts["carriage"], late)})
    at = InMotion.of(carriage.mechanism, motion_of(moved, carriage.mechanism))
    assert coherent_band(at)[0]["carriage"] > 20.0


def test_how_far_a_body_is_from_the_drawn_one_is_told_by_ratios_of_its_moments():
    """Half the sum of squared generalised eigenvalues, which no frame and no unit changes."""
    robot = load("ur5")
    joint = robot.mechanism.joint_id("elbow_joint")
    heavier = robot.mechanism.model.inertias[joint].toDynamicParameters()
    drawn, matrix = pseudo_inertia(heavier), near_body(joint, robot.mechanism)
    about = drawn + SOME_BODY * some_body(robot.mechanism, 0.3)
    for change in (heavier, np.eye(10)[0], np.eye(10)[4] + np.eye(10)[6]):
        ratios = eigh(pseudo_inertia(change), about, eigvals_only=True)
        assert change @ matrix @ change == pytest.approx((ratios**2).sum() / (2 * BODIES_OFF**2), rel=1e-9)
    assert np.linalg.eigvalsh(matrix).min() > 0


def motion(robot, seconds=20.0, rate=200.0):
    """Return a recording of a ur5 that moves all joints."""
    time = np.arange(round(seconds * rate)) / rate
    names = [joint.name for joint in robot.mechanism.joints]
    positions = {
        name: -0.3 * k + 0.5 * np.sin((1.1 + 0.37 * k) * time + k) + 0.2 * np.sin((2.9 + 0.23 * k) * time)
        for k, name in enumerate(names)
    }
    return Recording(time=time, positions=positions, efforts=dict.fromkeys(names, np.zeros(len(time))))


@pytest.mark.slow
def test_what_most_drives_have_is_one_finding_with_a_table():
    robot, rng = load("ur5"), np.random.default_rng(1)
    recording = motion(robot)
    names = list(recording.positions)
    friction = {name: 1.0 + 0.5 * k for k, name in enumerate(names)}
    effects = []
    for name, size in friction.items():
        effects.append(Effect(SlidingFriction(), Place(name, "effort"), {"limit": size, "presliding": 1e-5}))
        effects.append(Effect(Damping(), Place(name, "effort"), {"damping": 2 * size}))
    true = simulate(robot, recording, effects).efforts
    noisy = {name: np.nan_to_num(values) + 0.05 * rng.normal(size=len(values)) for name, values in true.items()}
    found = diagnose(robot, recording.with_measurements(efforts=noisy))
    assert {(finding.physics, finding.location) for finding in found.findings} == {
        ("coulomb_friction", "robot"),
        ("viscous_friction", "robot"),
    }
    for finding in found.findings:
        key, times = ("limit", 1.0) if finding.physics == "coulomb_friction" else ("damping", 2.0)
        for name, size in friction.items():
            assert finding.parameters[f"{name}.{key}"].value == pytest.approx(times * size, rel=0.02)
            assert name in finding.candidates


@pytest.mark.slow
def test_a_load_that_a_body_explains_as_well_is_no_mass_that_no_body_has(tmp_path):
    """Gears yield beside a load of half a kilogram, so that a free fit lies beyond all bodies by its own error."""
    write(draw_elastic(180008, "ur10"), tmp_path, tmp_path, "device")
    recording = read_recording(tmp_path / "device.csv")
    found = diagnose(load("ur10"), recording)
    (finding,) = (item for item in found.findings if item.physics not in ("effort_delay", "effort_filter"))
    assert finding.physics in ("payload", "inertial_parameters")
    assert {"tool0", "wrist_3_link"} & {finding.location, *finding.candidates}
    assert found.verdict == "explained"


def changed_bodies(robot, effects):
    """Return the inertial parameters (10,) of what each joint carries with some effects, which must change them."""
    whole = {
        joint.id: robot.mechanism.model.inertias[joint.id].toDynamicParameters() for joint in robot.mechanism.joints
    }
    changed = False
    for effect in effects:
        for joint, columns in getattr(effect.law, "of_body", lambda *_: {})(effect.place, robot.mechanism).items():
            whole[joint] = whole[joint] + columns @ effect.law.coefficients(effect.place, effect.values)
            changed = True
    assert changed
    return whole.values()


@pytest.mark.slow
def test_bodies_of_a_corrected_model_can_exist():
    """Efforts with a sign of acceleration that no body has are not followed by one."""
    robot, rng = load("ur5"), np.random.default_rng(2)
    recording = motion(robot)
    law, link = InertialParameters(), "wrist_1_link"
    change = dict.fromkeys((q.name for q in law.quantities), 0.0) | {"mx": 0.4, "mz": -0.3, "Iyy": -0.02}
    true = simulate(robot, recording, (Effect(law, Place(link, law.variant), change),)).efforts
    noisy = {name: np.nan_to_num(values) + 0.02 * rng.normal(size=len(values)) for name, values in true.items()}
    found = diagnose(robot, recording.with_measurements(efforts=noisy))
    for parameters in changed_bodies(robot, found.effects):
        assert np.linalg.eigvalsh(pseudo_inertia(parameters)).min() > 0


@pytest.mark.slow
def test_a_payload_of_which_a_body_that_can_be_tells_all_but_a_hundredth_is_a_body(tmp_path):
    """Motors tremble by what their encoders do not tell: the free fit is of no body, one that can be is as good."""
    write(draw_elastic(310019, "kinova"), tmp_path, tmp_path, "device")
    found = diagnose(load("kinova"), read_recording(tmp_path / "device.csv"))
    assert {finding.physics for finding in found.told} <= {"payload", "inertial_parameters"}
    body = found.told[0]
    assert "j2s6s200_end_effector" in body.candidates
    low, high = body.parameters["mass"].interval
    assert low < json.loads((tmp_path / "device.truth.json").read_text())["effects"][0]["parameters"]["mass"] < high
