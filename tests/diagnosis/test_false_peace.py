"""A residual above the noise is never called peace, whatever the robot cannot do about it."""

import csv
import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.criteria import clean_bound
from prup_pin.diagnosis.diagnosis import Finding, FittedParameter
from prup_pin.diagnosis.findings import finite_deflection, with_neutral_values
from prup_pin.diagnosis.unexplained import _cancelling
from prup_pin.recordings import Noise, Recording, add_noise, read_recording
from prup_pin.simulation import effect_named
from prup_pin.spatial import rotation_exp, rotation_log
from prup_pin.views.report.as_json import diagnosis_as_json
from prup_pin.views.report.diagnosis_files import write_diagnosis
from prup_pin.views.text.diagnosis_words import finding_lines, verdict_text

from ..as_written import as_written

NOISE = Noise(position=2e-5, rotation=1e-4)
SPRING = {"shoulder_pan_joint": 1e4}


def bench_of(robot, poses=8, loads=(0.0, 1.0, 0.5, -1.0, -0.5), seed=0):
    """A bench test of an arm of six joints that is as simulated: poses, loads of up to some 40 N, noise."""
    rng = np.random.default_rng(seed)
    middle = np.array([0.0, -1.2, 1.2, 0.0, 1.0, 0.0])
    positions = np.repeat(middle + rng.uniform(-1, 1, (poses, 6)), len(loads), axis=0)
    directions = np.repeat(rng.normal(size=(poses, 6)), len(loads), axis=0) * np.repeat([20.0, 2.0], 3)
    recording = Recording(
        time=np.arange(len(positions), dtype=float),
        positions=dict(zip(robot.mechanism.actuated, positions.T, strict=True)),
        wrench=np.tile(loads, poses)[:, None] * directions,
        noise=NOISE,
    )
    predicted = prup_pin.simulate(robot, replace(recording, position=np.zeros((len(positions), 3))))
    measured = recording.with_measurements(position=predicted.position, rotation=predicted.rotation)
    return add_noise(measured, NOISE, seed)


def lifted(recording, amount=2e-3):
    """The recording of a tool that rises and falls with the elbow, which nothing in a robot file does."""
    position = np.array(recording.position)
    position[:, 2] += amount * np.sin(7 * recording.positions["elbow_joint"])
    return recording.with_measurements(position=position)


@pytest.fixture(scope="module")
def sprung():
    """An arm that yields about a vertical axis alone: it cannot lift its tool."""
    return prup_pin.load("ur5", joint_stiffness=SPRING)


@pytest.fixture(scope="module")
def rigid():
    return prup_pin.load("ur5")


@pytest.fixture(scope="module")
def raised(sprung):
    """(recording, diagnosis) of that arm when its tool rises and falls."""
    recording = lifted(bench_of(sprung))
    return recording, diagnose(sprung, recording)


def the_unknown(diagnosis):
    assert diagnosis.verdict == "unexplained"
    (finding,) = (finding for finding in diagnosis.findings if finding.physics == "unknown")
    return finding


@pytest.mark.slow
def test_what_no_module_can_do_is_unknown_at_the_robot(raised):
    _, diagnosis = raised
    assert diagnosis.after["fit"] > 20
    finding = the_unknown(diagnosis)
    assert (finding.location, finding.candidates, finding.curve) == ("robot", ("robot",), None)
    for words in (
        "28.8 times the noise",
        "kinds of physics at",
        "whatever deformation of 1 module",
        "is largest in the position",
    ):
        assert words in finding.statement
    assert finding.heldout_gain == 0


@pytest.mark.slow
def test_where_it_turns_without_a_reason_the_rotation_is_named(rigid):
    recording = as_written(bench_of(rigid, loads=(0.0, 0.0, 0.0)))
    tilt = 0.01 * np.sin(7 * recording.positions["elbow_joint"])
    turned = rotation_exp(tilt[:, None] * [1.0, 0.0, 0.0]) @ rotation_exp(np.array(recording.rotation))
    finding = the_unknown(diagnose(rigid, recording.with_measurements(rotation=rotation_log(turned))))
    assert "is largest in the rotation" in finding.statement


@pytest.mark.parametrize(
    "loads",
    [
        pytest.param((0.0, 1.0, 0.5, -1.0, -0.5), marks=pytest.mark.slow),
        (0.0, 0.0, 0.0),
        pytest.param((0.0,), marks=pytest.mark.slow),
    ],
)
def test_a_rigid_arm_needs_no_compliance_to_be_wrong(rigid, loads):
    """With loads, without any, and with each pose measured once, so that nothing repeats."""
    poses = 60 if len(loads) == 1 else 8
    right = bench_of(rigid, poses, loads)
    assert diagnose(rigid, right).verdict == "nothing_missing"
    wrong = diagnose(rigid, lifted(right))
    assert wrong.noise.source == "declared"
    assert the_unknown(wrong).location == "robot"
    assert "no module that could yield" in the_unknown(wrong).statement


def test_what_nobody_can_check_is_not_taken_for_noise(rigid):
    """Five poses, measured once each, half a millimetre off at random, by a sensor that declares 20 µm."""
    recording = bench_of(rigid, 5, (0.0,))
    off = np.array(recording.position) + 5e-4 * np.random.default_rng(3).normal(size=(5, 3))
    diagnosis = diagnose(rigid, recording.with_measurements(position=off))
    assert diagnosis.noise.position == NOISE.position
    assert diagnosis.after["fit"] > clean_bound(30)
    assert the_unknown(diagnosis).location == "robot"


@pytest.mark.slow
def test_sixty_poses_tell_coarse_noise_from_structure(rigid):
    """Measured once each: what follows no pose is noise, and larger than was declared."""
    recording = bench_of(rigid, 60, (0.0,))
    rng = np.random.default_rng(3)
    off = np.array(recording.position) + 5e-4 * rng.normal(size=(60, 3))
    turned = np.array(recording.rotation) + 2e-3 * rng.normal(size=(60, 3))
    diagnosis = diagnose(rigid, recording.with_measurements(position=off, rotation=turned))
    assert (diagnosis.verdict, diagnosis.noise.source) == ("nothing_missing", "estimated")
    assert diagnosis.noise.position == pytest.approx(5e-4, rel=0.15)


# -- nothing to compare ------------------------------------------------------------------------------------------------


def without_pose(recording):
    ones = np.ones(len(recording))
    joints = list(recording.positions)
    return replace(
        recording,
        position=None,
        rotation=None,
        efforts=dict.fromkeys(joints, ones),
        accelerations={joints[0]: ones},
        velocities={joints[0]: ones},
        markers={"elbow": np.zeros((len(recording), 3))},
    )


def test_efforts_alone_are_no_peace(clean_bench):
    """Efforts that are all one newton, whatever the load: they are compared, and nothing explains them."""
    diagnosis = diagnose(prup_pin.load("3prup"), without_pose(read_recording(clean_bench.path)))
    finding = the_unknown(diagnosis)
    assert "explained by no law of the library: an effort that follows the joint's load" in finding.statement
    markers = [f"p.elbow.{axis}" for axis in "xyz"]
    assert set(diagnosis.unused_columns) == {*markers, "qdd.leg1_slide", "qd.leg1_slide"}
    assert any(text.startswith("not used: ") for text in diagnosis.remarks)
    assert diagnosis.efforts.shares["all"]["heldout"] > 0.5


def test_a_pose_where_no_load_is_known_compares_nothing(clean_bench):
    """The tracker was off while the force sensor was on, and the other way round."""
    recording = read_recording(clean_bench.path)
    position, rotation, wrench = (np.array(x) for x in (recording.position, recording.rotation, recording.wrench))
    position[::2] = rotation[::2] = np.nan
    wrench[1::2] = np.nan
    diagnosis = diagnose(
        prup_pin.load("3prup"), replace(recording, position=position, rotation=rotation, wrench=wrench)
    )
    assert "no sample with a measured pose could be simulated" in the_unknown(diagnosis).statement


@pytest.mark.slow
def test_it_can_be_written_and_read(rigid, sprung, raised, tmp_path):
    efforts = without_pose(bench_of(rigid))
    cases = {"efforts": (rigid, efforts, diagnose(rigid, efforts)), "lifted": (sprung, *raised)}
    for name, (robot, recording, diagnosis) in cases.items():
        write_diagnosis(diagnosis, robot, recording, tmp_path / name, robot_name="ur5")
        document = json.loads((tmp_path / name / "diagnosis.json").read_text())
        assert document["verdict"] == "unexplained"
        assert document["findings"][-1]["physics"] == "unknown"
        assert document["unused_columns"] == list(diagnosis.unused_columns)
        said = diagnosis.findings[-1].statement.partition(":")[0][1:]  # a sentence begins with a capital there
        assert said in (tmp_path / name / "report.html").read_text()
        assert "in robot" not in verdict_text(diagnosis)


# -- columns without a use ---------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_columns_without_a_use_are_named(clean_bench, diagnosed_clean, tmp_path):
    """Those that the format does not know too; the verdict does not depend on them."""
    with clean_bench.path.open(encoding="utf-8") as stream:
        head, *rows = csv.reader(stream)
    extra = ["a.z", "r.elbow.x", "humidity", "p.elbow.x", "qd.leg1_slide"]
    path = tmp_path / "more.csv"
    lines = [",".join([*head, *extra]), *(",".join([*row, *"12356"]) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    path.with_suffix(".json").write_text(clean_bench.path.with_suffix(".json").read_text(encoding="utf-8"))
    robot, _, plain = diagnosed_clean
    more = diagnose(robot, read_recording(path))
    assert set(more.unused_columns) == set(extra)
    assert plain.unused_columns == ()
    told = " ".join(more.remarks)
    assert all(name in told for name in extra)
    one, other = (diagnosis_as_json(found, robot) for found in (more, plain))
    assert {key for key in one if one[key] != other[key]} == {"remarks", "unused_columns"}


def test_speeds_of_all_actuators_are_used(rigid):
    recording = bench_of(rigid, 4, (0.0,))
    speeds = {name: np.full(len(recording), 1e-3) for name in recording.positions}
    diagnosis = diagnose(rigid, replace(recording, velocities=speeds))
    assert diagnosis.unused_columns == ()


# -- no verdict contradicts its numbers --------------------------------------------------------------------------------


@pytest.mark.slow
def test_no_finding_makes_it_worse():
    """An arm that yields in every joint: some joint takes part of it, and no law beside that may add to the rest."""
    robot = prup_pin.load("ur5", joint_stiffness=1e4)
    diagnosis = diagnose(robot, lifted(bench_of(robot, 4)))
    finding = the_unknown(diagnosis)
    assert finding.location in robot.mechanism.actuated
    assert finding.curve is not None
    assert diagnosis.findings == (finding,)
    # what is before is linear: the deformed position accounts for a little
    assert diagnosis.after["fit"] < 1.001 * diagnosis.before["fit"]


def test_peace_has_no_residual_before_either(diagnosed, diagnosed_strange):
    for _, _, diagnosis in (diagnosed, diagnosed_strange):
        count = 6 * len(diagnosis.samples)
        assert diagnosis.before["fit"] > clean_bound(count)
        assert diagnosis.verdict != "nothing_missing"
        assert diagnosis.findings
        assert (diagnosis.verdict == "unexplained") == any(item.physics == "unknown" for item in diagnosis.findings)


@pytest.mark.parametrize("rows", [slice(20, 21), pytest.param(slice(0, 5), marks=pytest.mark.slow)])
def test_of_few_samples_without_declared_noise_nothing_can_be_said(bench, rows):
    few = replace(read_recording(bench.path).select(rows), noise=Noise())
    found = diagnose(prup_pin.load("3prup"), few)
    assert found.verdict == "unexplained"
    assert verdict_text(found).startswith("Nothing can be said: the noise is not declared")
    (finding,) = found.findings  # which the verdict has told: what to do is left
    assert finding_lines(found, finding) == [f"to do: {finding.remedy}"]
    assert finding.remedy.startswith("declare position_noise")
    assert np.isnan(found.after["heldout"])


def test_the_deformed_position_is_told_where_it_gains_more_than_chance():
    """Beside what else is left, a third of its own effect is enough where that is thirty of chi squared."""
    effect, against = np.full((25, 4), 1.0), np.full((25, 4), -0.35)
    drawn = SimpleNamespace(residual=np.zeros((25, 4)))
    last = SimpleNamespace(residual=against, chi2=float((against**2).sum()))
    found = finite_deflection(drawn, last, effect)
    assert found is not None
    assert found.heldout_gain == pytest.approx(30 / 42.25)
    assert finite_deflection(drawn, last, 0.5 * effect) is None  # it gains less than nothing there


def test_what_data_do_not_tell_is_set_to_nothing_only_where_its_law_allows_that():
    """A preload that is nowhere in sight was told as 1e15 N, which no prediction takes."""
    robot = prup_pin.load("3prup")
    values = {"reference_load": 500.0, "preload": 80.0}
    effect = effect_named("hertzian_contact", "leg1/ball_nut", "", values, robot.mechanism)
    bounds = {q.name: (q.lower, q.upper) for q in effect.law.quantities_at(effect.place, robot.mechanism)}
    parameters = {name: FittedParameter(value, "N", bounds[name]) for name, value in effect.values.items()}
    parameters["reference_load"] = replace(parameters["reference_load"], interval=(400.0, 600.0))
    finding = Finding("hertzian_contact", "leg1/ball_nut", ("leg1/ball_nut",), parameters, 0.5, "", effect)
    with_neutral_values(finding, robot).effect.checked(robot.mechanism)


@pytest.mark.parametrize(
    ("moved", "cancel"),
    [
        ([[9.0, 0.0], [-8.5, 0.3]], (0, 1)),  # a scale and a zero that leave a twentieth
        ([[9.0, 0.0], [-7.0, 0.3]], ()),
        ([[9.0, 0.0], [0.0, 1.0], [-4.5, 4.4], [-4.4, -4.5]], (0, 2, 3)),  # three, beside one that is there
        ([[9.0, 0.0]], ()),
        ([], ()),
    ],
)
def test_laws_that_do_a_small_part_together_of_what_each_does_cancel(moved, cancel):
    terms = [SimpleNamespace(effect=np.array(each)) for each in moved]
    problem = SimpleNamespace(change=lambda fit, kept: np.sum(kept, axis=0) - np.sum(moved, axis=0))
    assert _cancelling(problem, SimpleNamespace(terms=terms)) == cancel
