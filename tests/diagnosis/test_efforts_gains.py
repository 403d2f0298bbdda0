"""Drives that report in units of their own: gains and masses are told together, one scale of all by masses alone."""

import numpy as np
import pytest

from prup_pin import diagnose, load
from prup_pin.diagnosis.chances import WITHIN_95
from prup_pin.diagnosis.diagnosis import FittedParameter
from prup_pin.diagnosis.efforts.gains import (
    gains_of,
    in_newtons,
    likeliest_logs,
    precision_of_gains,
    scatter_of_gains,
)
from prup_pin.diagnosis.efforts.shares import gains_apart
from prup_pin.diagnosis.normal_equations import column_scales
from prup_pin.dynamics import InMotion, in_frame, motion_of
from prup_pin.laws import Effect, Place
from prup_pin.laws.efforts.effort_sensor import EffortUnit
from prup_pin.recordings import Recording, Tolerances
from prup_pin.recordings.columns import AS_LOGGED
from prup_pin.simulation import Prediction, compare
from prup_pin.simulation.moving_efforts import efforts_in_motion
from prup_pin.views.text.diagnosis_words import noise_text, parameter_texts

from ..as_written import as_written
from .test_efforts import AXIS, axis, device

GAINS = np.array([0.08, 0.09, 0.11, 2.0, 2.4, 1.7])


@pytest.fixture(scope="module")
def robot():
    return load("ur5")


@pytest.fixture(scope="module")
def moving(robot):
    """A motion whose efforts are those of links that are not as drawn, with friction, rotors and noise."""
    mechanism = robot.mechanism
    rng, time = np.random.default_rng(3), np.arange(4000) * 0.005
    home = np.array([0.0, -1.1, 1.0, -0.3, 0.5, 0.0])
    rates = rng.uniform(0.8, 4.0, (3, 6))
    sizes, phases = rng.uniform(0.5, 1.0, (3, 6)) / rates, rng.uniform(0, 6, (3, 6))
    q = home + (sizes[:, None] * np.sin(rates[:, None] * time[:, None] + phases[:, None])).sum(axis=0)
    silent = Recording(time=time, positions=dict(zip(mechanism.actuated, q.T, strict=True)))
    at = InMotion.of(mechanism, motion_of(silent, mechanism, mechanism.actuated))
    drawn = np.concatenate([body.toDynamicParameters() for body in list(mechanism.model.inertias)[1:]])
    true = (drawn.reshape(-1, 10) * np.array([1.2, 0.85, 1.1, 0.9, 1.15, 0.8])[:, None]).ravel()
    efforts = at.regressor.reshape(len(at), 6, -1) @ true
    efforts = efforts + 0.8 * np.sign(at.motion.speed) + 0.5 * at.motion.acceleration
    return at.measuring(efforts + 0.1 * rng.normal(size=efforts.shape))


def test_gains_of_drives_are_told_beside_each_other_and_with_the_masses_drawn(moving):
    found = gains_of(moving.measuring(moving.motion.efforts * GAINS), {})
    apart = np.log(found.gains / GAINS)
    # the last joint weighs next to nothing
    assert apart[:5] - apart[:5].mean() == pytest.approx(np.zeros(5), abs=0.05)
    assert abs(apart[:5].mean()) < 2 * found.common
    assert 0.02 < found.common < 0.3


def test_gains_a_little_off_at_every_joint_are_told_and_taken_out(moving):
    gains = np.array([0.75, 1.3, 0.9, 1.35, 0.8, 1.2])
    reported = moving.measuring(moving.motion.efforts * gains)
    found = gains_of(reported, {})
    apart = np.log(found.gains / gains)
    assert apart[:5] - apart[:5].mean() == pytest.approx(np.zeros(5), abs=0.05)
    back = in_newtons(reported, found.gains).motion.efforts
    assert back * found.gains == pytest.approx(reported.motion.efforts, rel=1e-12)


def test_gains_that_are_alike_are_told_where_else_the_whole_robot_would_weigh_next_to_nothing(moving):
    gains = np.full(6, 0.07)
    found = gains_of(moving.measuring(moving.motion.efforts * gains), {})
    assert found.gains[:5] == pytest.approx(gains[:5], rel=2.5 * found.common)
    assert gains_of(moving.measuring(moving.motion.efforts * 1.3), {}) is None  # masses may be so far off


def test_other_masses_and_one_gain_alone_are_no_other_units(moving):
    assert gains_of(moving, {}) is None
    assert gains_of(moving.measuring(moving.motion.efforts * [1, 1, 1.4, 1, 1, 1]), {}) is None


@pytest.mark.slow
def test_friction_by_direction_asks_for_no_other_units(tmp_path):
    """A light arm whose fifth joint resists much more backwards than forwards."""
    recording, _ = device(tmp_path, 7404, "kinova", ["viscous_friction"], (20.0, 40.0))
    mechanism = load(recording.robot).mechanism
    at = InMotion.of(mechanism, motion_of(recording, mechanism))
    assert gains_of(at, dict(recording.tolerances.declared)) is None


def test_a_prediction_is_in_the_drives_own_units(robot, moving):
    motion = moving.motion
    recording = Recording(
        time=motion.time,
        positions=dict(zip(motion.names, motion.position.T, strict=True)),
        efforts=dict(zip(motion.driven, motion.efforts.T, strict=True)),
    )
    law = EffortUnit()
    effects = [
        Effect(law, Place(name, law.variant), {"gain": g - 1}) for name, g in zip(motion.driven, GAINS, strict=True)
    ]
    plain, own = (efforts_in_motion(robot, recording, which)[0] for which in ((), effects))
    for name, gain in zip(motion.driven, GAINS, strict=True):
        assert own[name] == pytest.approx(gain * plain[name], rel=1e-9)


@pytest.fixture(scope="module")
def logged(robot, moving):
    """The motion as drives log it that report in units of their own, and what is found in it."""
    motion = moving.motion
    recording = Recording(
        time=motion.time,
        positions=dict(zip(motion.names, motion.position.T, strict=True)),
        efforts=dict(zip(motion.driven, (motion.efforts * GAINS).T, strict=True)),
        tolerances=Tolerances(effort_gain=1.0),
    )
    recording = as_written(recording, "q")
    return recording, diagnose(robot, recording)


@pytest.mark.slow
def test_gains_that_are_told_leave_none_that_are_declared_to_be_anything(moving, logged):
    """Two gains of one drive were solved for, and the corrected model predicted its own log 14 times too large."""
    gains = [effect.place.name for effect in logged[1].effects if "gain" in effect.values]
    assert sorted(gains) == sorted(moving.motion.driven)


@pytest.mark.slow
def test_a_gain_is_told_in_one_form_and_no_effort_of_a_drive_in_its_own_unit_in_newtons(moving, logged):
    _, found = logged
    (told,) = (finding for finding in found.findings if finding.conventions)
    declared = {convention.joint: float(convention.argument[0]) for convention in told.conventions}
    for name, gain in declared.items():
        reported = told.parameters[f"{name}.reported"]
        assert reported.value == pytest.approx(gain, rel=5e-3)
        assert reported.unit == "per N m"
        assert "--convention" not in told.statement  # how it is declared stands in what to do
        assert f"--convention tau.{name}=gain:{gain:g}" in told.remedy
    # a declared gain is taken for exact: how well all of them are known is declared with it
    spread = float(told.remedy.partition('"effort_gain": ')[2].partition(",")[0])
    widest = max(np.log(told.parameters[f"{name}.reported"].interval[1] / told.parameters[f"{name}.reported"].value)
                 for name in declared)  # fmt: skip
    assert spread == pytest.approx(widest / WITHIN_95, rel=0.05)
    assert '"mass": 0.3, "inertia": 0.3}' in told.remedy  # within which they are known so well
    assert {*found.efforts.units, *(curve.y_unit for curve in found.efforts.curves)} == {AS_LOGGED}
    assert not any("N m" in text for text in noise_text(found))
    # the robot file is held against the log as it is read: not newton metres against amperes
    assert max(found.efforts.shares[name]["rigid"] for name in moving.motion.driven[:5]) < 2
    rigid, measured = found.efforts.rigid[:, 1], found.efforts.measured[:, 1]
    assert np.corrcoef(rigid, measured)[0, 1] > 0.9
    assert np.std(rigid) == pytest.approx(np.std(measured), rel=0.5)


def test_of_one_drive_a_prediction_says_of_its_own_log_what_the_diagnosis_does():
    slide, recording = load(AXIS), axis(damping=200.0, limit=20.0)
    found = diagnose(slide, recording)
    efforts, _ = efforts_in_motion(slide, recording, found.effects, found.efforts.band)
    nowhere = np.empty((len(recording), 0))
    predicted = Prediction(recording.time, nowhere, nowhere, efforts)
    (said,) = compare(recording, predicted, mechanism=slide.mechanism, band=found.efforts.band)
    assert said.channel == "effort carriage"
    assert said.share == pytest.approx(found.efforts.shares["carriage"]["fit"], rel=0.1)


@pytest.mark.slow
def test_a_prediction_says_of_its_own_log_what_the_diagnosis_does(robot, logged):
    recording, found = logged
    nowhere = np.empty((len(recording), 0))
    efforts, _ = efforts_in_motion(robot, recording, found.effects, found.efforts.band)
    predicted = Prediction(recording.time, nowhere, nowhere, efforts)
    said = {
        item.channel: item.share
        for item in compare(recording, predicted, mechanism=robot.mechanism, band=found.efforts.band)
    }
    row_by_row = {item.channel: item.share for item in compare(recording, predicted)}
    for name in found.efforts.joints:
        assert said[f"effort {name}"] == pytest.approx(found.efforts.shares[name]["fit"], rel=0.1)
    weak = f"effort {found.efforts.joints[-1]}"
    assert row_by_row[weak] > 2 * said[weak]  # noise above the band counted as if it were left


@pytest.mark.slow
def test_what_is_fitted_stands_beside_what_the_robot_file_has(logged):
    _, found = logged
    (masses,) = (finding for finding in found.findings if finding.physics == "inertial_parameters")
    assert all(" instead of " in value for _, value, _ in parameter_texts(masses.parameters))
    assert " instead of " not in parameter_texts({"x": FittedParameter(1.0, "m", (0.9, 1.1), 1.0)})[0][1]


@pytest.mark.slow
def test_masses_are_known_no_better_than_all_gains_together(logged):
    """All masses twice as large and all gains half as large are the same efforts."""
    _, found = logged
    (masses,) = (finding for finding in found.findings if finding.physics == "inertial_parameters")
    (told,) = (finding for finding in found.findings if finding.conventions)
    reported = told.parameters["elbow_joint.reported"]
    common = np.log(reported.interval[1] / reported.value)
    assert common > 0.2
    for one in masses.parameters.values():
        assert one.interval[1] - one.value > 0.9 * common * abs(one.value)
    assert "in proportion to all masses" in masses.statement


def as_drawn(moving, gains):
    """Return a log of the robot as it is drawn with a little friction, by drives that report in units of their own."""
    motion = moving.motion
    noise = 0.1 * np.random.default_rng(5).normal(size=moving.rigid.shape)
    efforts = moving.rigid + 0.8 * np.sign(motion.speed) + noise
    return Recording(
        time=motion.time,
        positions=dict(zip(motion.names, motion.position.T, strict=True)),
        efforts=dict(zip(motion.driven, (efforts * gains).T, strict=True)),
    )


@pytest.mark.slow
def test_no_mass_is_accused_of_what_a_gain_is_off_by(robot, moving):
    """Efforts in amperes of a robot whose masses are as drawn: gains alone that were solved for are 1 % off."""
    found = diagnose(robot, as_drawn(moving, GAINS))
    assert {finding.physics for finding in found.findings} == {"log_convention", "coulomb_friction"}
    (told,) = (finding for finding in found.findings if finding.conventions)
    for name, gain in zip(moving.motion.driven[:5], GAINS, strict=False):
        assert told.parameters[f"{name}.reported"].value == pytest.approx(gain, rel=5e-3)


def test_factors_of_gains_are_those_of_a_linear_fit_where_that_is_sure_and_never_below_nothing():
    sure, prior = np.diag([1e6, 1e6, 400.0, 1.0]), np.eye(4)
    change = np.array([0.5, -0.5, -1.5, 0.0])
    log, covariance = likeliest_logs(sure, sure @ change, prior, np.array([0.0, 0.0, 0.0, -2.0]))
    assert np.exp(log[:2]) == pytest.approx(1 + change[:2], rel=1e-5)
    assert np.sqrt(np.diag(covariance))[:2] == pytest.approx(1e-3 / (1 + change[:2]), rel=1e-4)
    # what would be minus half its size is hardly anything, and what efforts hardly tell is near what is usual
    assert 0 < np.exp(log[2]) < 0.05
    assert -2 < log[3] < -1


@pytest.mark.parametrize(("spread", "known_to"), [(0.0, 0.02), (0.3, 0.4)])
def test_what_a_drive_that_hardly_moves_reports_in_is_told_by_how_the_others_scatter(spread, known_to):
    """Its own efforts say half, and hardly; the others say 1.3 times, all alike or each by itself."""
    logs = np.log(1.3) + spread * np.array([1.0, -1.2, 0.8, -0.6, 0.0])
    sure, middle = np.diag([1e6] * 5 + [0.5]), np.zeros(6)
    moment = sure @ np.append(np.expm1(logs), -0.5)
    scatter = scatter_of_gains(sure, moment, 1.0, middle)
    found, covariance = likeliest_logs(sure, moment, precision_of_gains(scatter, 1.0, 6), middle)
    assert scatter == pytest.approx(np.std(logs), rel=0.35, abs=0.002)
    assert found[:5] == pytest.approx(logs, abs=0.003)
    assert abs(found[5] - np.log(1.3)) < known_to
    assert np.sqrt(covariance[5, 5]) == pytest.approx(scatter, rel=0.3, abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(("gain", "said"), [(0.09, "tau=gain:"), (1 / 9.80665, "tau=kgf_m")])
def test_drives_that_are_alike_report_in_one_unit(robot, moving, gain, said):
    found = diagnose(robot, as_drawn(moving, np.full(6, gain)))
    (told,) = (str(item) for finding in found.findings for item in finding.conventions)
    assert told.startswith(said)


@pytest.mark.slow
def test_drives_that_differ_report_in_no_unit_with_a_name(robot, moving):
    """The middle of these is nearly a kilogram-force, in which each was told to be off."""
    gains = np.array([0.083, 0.08, 0.11, 0.14, 0.12, 0.15])
    found = diagnose(robot, as_drawn(moving, gains))
    told = {item.joint: item.argument[0] for finding in found.findings for item in finding.conventions}
    assert [told[name] for name in moving.motion.driven[:5]] == pytest.approx(gains[:5], rel=0.02)


def test_the_scale_of_all_gains_is_what_the_masses_as_drawn_make_likeliest(moving):
    gains = gains_of(moving.measuring(moving.motion.efforts * GAINS), {})
    first = gains.by_masses(gains.gains).gains
    assert np.log(first / gains.gains) == pytest.approx(np.zeros(6), abs=0.25 * gains.common)
    for factor in (0.5, 3.0):
        assert gains.by_masses(factor * gains.gains).gains == pytest.approx(first, rel=1e-5)


def test_a_gain_that_counts_the_other_way_round_is_as_far_from_one_as_its_size():
    assert gains_apart({"a": -0.1, "b": 0.2, "c": -0.15})
    assert not gains_apart({"a": -1.0, "b": 1.02, "c": 0.2})


def rubbing(moving, gains, **tolerances):
    """Return a log of the robot as it is drawn that holds 1.9 kg, with dry friction of 0.8 N m at every joint."""
    tool, motion = moving.mechanism.need_tool(), moving.motion
    centre, second = np.array([0.02, -0.03, 0.09]), np.diag([0.004, 0.005, 0.003])
    about = second + 1.9 * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    held = [1.9, *(1.9 * centre), *(about[i, j] for i, j in ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)))]
    loaded = moving.regressor[:, :, tool.joint - 1] @ in_frame(tool.placement) @ np.array(held)
    own = as_drawn(moving.measuring(moving.motion.efforts), np.ones(6))
    efforts = {
        name: gain * (own.efforts[name] + more) for name, gain, more in zip(motion.driven, gains, loaded.T, strict=True)
    }
    return Recording(time=motion.time, positions=own.positions, efforts=efforts, tolerances=Tolerances(**tolerances))


@pytest.mark.slow
@pytest.mark.parametrize(("tolerance", "apart"), [(0.02, 0.02), (0.1, 0.08)])
def test_a_load_is_no_scale_of_all_gains(robot, moving, tolerance, apart):
    """With masses known to 2 % all gains were 68 % too large, and what was held 45 % too light."""
    found = diagnose(robot, rubbing(moving, GAINS, effort_gain=1.0, mass=tolerance, inertia=tolerance))
    assert found.verdict == "explained"
    (told,) = (finding for finding in found.findings if finding.conventions)
    for name, gain in zip(moving.motion.driven, GAINS, strict=True):
        reported = told.parameters[f"{name}.reported"]
        assert reported.value == pytest.approx(gain, rel=apart)
        assert reported.interval[0] < gain < reported.interval[1]
    (held,) = (finding for finding in found.findings if finding.physics == "payload")
    assert held.parameters["mass"].value == pytest.approx(1.9, rel=apart)
    (friction,) = (finding for finding in found.findings if finding.physics == "coulomb_friction")
    for name in moving.motion.driven[:5]:
        low, high = friction.parameters[f"{name}.limit"].interval
        assert low < 0.8 < high


@pytest.mark.slow
def test_a_load_on_drives_in_amperes_leaves_one_statement_of_their_gains_in_the_logs_own_unit(robot, moving):
    """One gain of all was read, and six of what that left were told: none was what the drives report."""
    gains = np.array([0.085, 0.085, 0.11, 0.35, 0.36, 0.33])
    found = diagnose(robot, rubbing(moving, gains))
    assert not any(found.conventions)
    (told,) = (finding for finding in found.findings if finding.conventions)
    for name, gain in zip(moving.motion.driven[:5], gains, strict=False):
        assert told.parameters[f"{name}.reported"].value == pytest.approx(gain, rel=0.1)
    reported = rubbing(moving, gains).efforts["shoulder_pan_joint"]
    assert np.std(found.efforts.measured[:, 0]) == pytest.approx(np.std(reported), rel=0.05)


@pytest.mark.slow
def test_friction_is_known_no_better_than_a_gain_within_its_tolerance(robot, moving):
    """A drive that reports 12 % too much was told to rub by 0.896 N m, to three digits."""
    gains = np.array([1.12, 1.0, 0.92, 1.0, 1.0, 1.0])
    found = diagnose(robot, rubbing(moving, gains, effort_gain=0.1, mass=0.1, inertia=0.1))
    (friction,) = (finding for finding in found.findings if finding.physics == "coulomb_friction")
    for name in ("shoulder_pan_joint", "elbow_joint", "wrist_1_joint"):
        low, high = friction.parameters[f"{name}.limit"].interval
        assert low < 0.8 < high


#: Two links that hang, of which the first alone is driven.
PENDUBOT = """<robot name="pendubot"><link name="base"/>
  <link name="upper"><inertial><origin xyz="0.1 0 0"/><mass value="1.1"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
  <link name="lower"><inertial><origin xyz="0.1 0 0"/><mass value="0.3"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.002"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><origin rpy="1.5707963 0 0"/>
    <axis xyz="0 0 1"/><limit lower="-7" upper="7" effort="9" velocity="9"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0.25 0 0"/>
    <axis xyz="0 0 1"/><limit lower="-7" upper="7" effort="9" velocity="9"/></joint></robot>"""


@pytest.mark.parametrize("gain", [10.0, -10.0])
def test_a_single_drive_in_a_unit_of_its_own_is_told_by_masses_whichever_way_it_counts(tmp_path, gain):
    (tmp_path / "pendubot.urdf").write_text(PENDUBOT)
    robot = load(tmp_path / "pendubot.urdf")
    rng, time = np.random.default_rng(7), 0.01 * np.arange(800)
    moved = np.sin(np.outer(time, [2.1, 3.4])) + 0.6 * np.sin(np.outer(time, [4.7, 1.3]))
    positions = dict(zip(("shoulder", "elbow"), (np.array([-1.6, 0.0]) + moved).T, strict=True))
    silent = Recording(time=time, positions=positions)
    at = InMotion.of(robot.mechanism, motion_of(silent, robot.mechanism, ["shoulder"]))
    reported = gain * at.rigid[:, 0] + 0.2 * rng.normal(size=len(time))
    tolerances = Tolerances(effort_gain=1.0, mass=0.1, inertia=0.1)
    found = diagnose(
        robot, Recording(time=time, positions=positions, efforts={"shoulder": reported}, tolerances=tolerances)
    )
    told = {finding.physics: finding for finding in found.findings}
    assert set(told) == {"effort_gain", "log_convention"} if gain < 0 else {"effort_gain"}
    (per_newton,) = told["effort_gain"].parameters.values()
    assert per_newton.value == pytest.approx(10, rel=0.1)


@pytest.mark.slow
def test_gains_are_those_beside_the_bodies_that_stay(robot, moving):
    """Beside free gains no body foretold as well as all of them, and given gains were those beside all of them."""
    rows = slice(None, None, 2)
    rubs = moving.rigid + 5.0 * np.sign(moving.motion.speed) + 3.0 * moving.motion.speed
    noise = 0.1 * np.random.default_rng(5).normal(size=rubs.shape)
    recording = Recording(
        time=moving.motion.time[rows],
        positions=dict(zip(moving.motion.names, moving.motion.position[rows].T, strict=True)),
        efforts=dict(zip(moving.motion.driven, ((rubs + noise) * GAINS)[rows].T, strict=True)),
        tolerances=Tolerances(effort_gain=1.0),
    )
    found = diagnose(robot, as_written(recording, "q")).efforts
    assert not [item for item in found.findings if item.physics == "inertial_parameters"]
    for name in found.joints:
        assert found.shares[name]["fit"] < 1.1 * found.shares[name]["heldout"]


def test_a_drive_that_tells_nothing_of_its_gain_leaves_the_others_as_they_are():
    """A wrist without masses: its middle ran away, and with it what all gains were computed by."""
    prior = precision_of_gains(0.5, 1.0, 2)
    told, moment, middle = np.diag([1e4, 0.0]), np.array([2e3, 0.0]), np.array([0.1, 400.0])
    log, covariance = likeliest_logs(told, moment, prior, middle)
    assert np.isfinite(log).all()
    assert np.isfinite(covariance).all()


def test_columns_of_nothing_stay_finite_beside_others():
    scales = column_scales(np.array([4.0, 0.0, 1e-40]))
    assert scales[0] == 0.5
    assert np.isfinite(scales**4).all()
    assert (column_scales(np.zeros(2)) ** 4 < np.inf).all()
