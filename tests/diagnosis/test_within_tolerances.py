"""Devices on which everything is a little off, and one thing is left out, or nothing."""

import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner

import prup_pin
from prup_pin.cli import app
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.calibrate import calibrated_from
from prup_pin.diagnosis.criteria import beyond_tolerance
from prup_pin.diagnosis.noise import noise_of_the_rest
from prup_pin.diagnosis.prepare import prepare
from prup_pin.diagnosis.problem import Problem
from prup_pin.diagnosis.search import Search
from prup_pin.diagnosis.toleranced import Toleranced
from prup_pin.errors import InputError
from prup_pin.laws.deviations import amounts_of, deviations_of
from prup_pin.recordings import Noise, Tolerances, add_noise, read_recording, write_recording
from prup_pin.simulation import effect_named, simulate

from ..reference.concealed.scattered import draw_scattered, write
from ..simulation.bench import inputs

DECLARED = {
    "stiffness": 0.1, "bending": 0.03, "mass": 0.1, "encoder_offset": 5e-5, "encoder_slope": 1e-4,
    "frame_position": 3e-4, "frame_rotation": 1e-3, "target_position": 3e-4, "target_rotation": 1e-3,
    "wrench_gain": 0.01, "wrench_rotation": 5e-3,
}  # fmt: skip
CYCLE = (0.0, 0.5, 1.0, 0.0, -0.5, -1.0)
ARM = Path(__file__).parents[1] / "robots/elastic_arm/elastic_arm.urdf"


def bench(robot, seed, *faults, poses=10):
    """A recording of a robot whose weight acts, whose parameters scatter, and which has some faults."""
    deviations = deviations_of(robot.mechanism)
    toleranced = Toleranced.of(deviations, amounts_of(deviations, robot.mechanism, DECLARED))
    off = toleranced.effect(np.random.default_rng(seed).normal(size=len(toleranced)))
    weight = effect_named("self_weight", "robot", "", {"scale": 1.0}, robot.mechanism)
    plan = inputs(robot, poses=poses, cycle=CYCLE, seed=seed)
    seen = simulate(robot, plan, [off, weight, *faults])
    measured = plan.with_measurements(position=seen.position, rotation=seen.rotation)
    recording = add_noise(measured, Noise(position=2e-6, rotation=1e-5, force=0.03, moment=0.002), seed)
    object.__setattr__(recording, "tolerances", Tolerances(**DECLARED))
    return recording


def run(*arguments):
    done = CliRunner().invoke(app, [str(word) for word in arguments])
    assert done.exit_code == 0, done.output
    return done.output


@pytest.mark.slow
def test_a_faultless_robot_has_nothing_but_its_weight(robot):
    found = diagnose(robot, bench(robot, 21, poses=6))
    assert found.verdict == "explained"
    assert {finding.physics for finding in found.findings} <= {"self_weight", "finite_deflection"}
    assert found.within["nominal"] > 50
    assert found.within["calibrated"] == pytest.approx(1.0, abs=0.15)
    known = found.calibration[0]
    assert known.learned > 0.9
    assert known.sd == pytest.approx((1 - known.learned) * known.tolerance, rel=0.2)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sensor", "shift", "elsewhere"),
    [
        ("target", "xyz", (-4.1e-3, 7e-4, -5.9e-3, 0.018, 0.009, 0.014)),
        ("pose_sensor", ("tx", "ty", "tz"), (-4e-3, -1e-3, -8e-3, -0.03, 0.05, 0.0)),
    ],
)
def test_weight_acts_beside_a_fault_many_times_as_large(robot, sensor, shift, elsewhere):
    """A target or a tracker that is 20 to 50 tolerances elsewhere leaves a hundred times more than weight does."""
    values = dict(zip((*shift, "rx", "ry", "rz"), elsewhere, strict=True))
    fault = effect_named(f"{sensor}_misalignment", sensor, "", values, robot.mechanism)
    given = prepare(robot, bench(robot, 1, fault, poses=4), lambda stage, share: None)
    problem = given.within_tolerances(given.problem, beyond_tolerance(len(given.toleranced)))
    assert problem.first.chi2 > 1e4 * problem.first.residual.size
    assert [effect.law.physics for effect in problem.tolerances.effects] == ["self_weight"]


def test_noise_is_told_by_what_a_fit_leaves_where_its_parameters_are(robot):
    """Not where the search began: a fit whose parameters have gone far from there leaves noise all the same."""
    given = prepare(robot, bench(robot, 1, poses=6), lambda stage, share: None)
    problem = replace(given.problem, noise=replace(given.problem.noise, position=4e-7, rotation=2e-6))
    weight = effect_named("self_weight", "robot", "", {"scale": 1.0}, robot.mechanism)
    drawn = problem.within(given.toleranced, [weight])
    fit = calibrated_from(drawn, drawn.off().x).first
    assert np.abs(fit.x).max() > 1
    assert drawn.first.chi2 > 100 * fit.chi2
    found = noise_of_the_rest(drawn, fit, given.inputs.blocks[fit.samples])
    assert found is not None
    assert found.noise.position == pytest.approx(2e-6, rel=0.3)


def test_a_fit_begins_where_the_robot_can_be(robot, monkeypatch):
    """First order may ask for a body that no robot bears: less of it is tried, and no load is raised in steps."""
    given = prepare(robot, bench(robot, 1, poses=4), lambda stage, share: None)
    payload = next(item for item in given.library if item.law.physics == "payload" and item.size == 1)
    tried = []

    def borne(self, terms, like, x=None, near=False):
        assert near
        tried.append(terms[0].effect.values["mass"])
        return SimpleNamespace(chi2=1.0 if tried[-1] < 50 else np.inf, terms=tuple(terms))

    first = given.problem.first
    monkeypatch.setattr(Problem, "fit_at", borne)
    asked = payload.term(payload.coordinates_of(np.array([300.0])))
    (begun,) = given.problem._begun([asked], first)
    assert tried == pytest.approx([300.0, 100.0, 100 / 3])
    assert begun.terms[0].effect.values["mass"] == tried[-1]


def test_each_set_of_rivals_is_fitted_once(robot):
    given = prepare(robot, bench(robot, 1, poses=4), lambda stage, share: None)
    problem = given.problem
    offsets = (item for item in given.library if item.law.physics == "encoder_offset" and item.size == 1)
    one, other = next(offsets), next(offsets)
    search = Search(problem)
    terms = [item.term(np.array([1e-4])) for item in (one, other)]
    first = search.rival(terms, problem.first)
    again = search.rival(terms[::-1], problem.first)
    assert search.fits == 1
    assert again.terms == first.terms[::-1]
    assert again.chi2 == first.chi2 == pytest.approx(problem.fit_at(first.terms, problem.first, first.x).chi2)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("physics", "place", "aspect", "values"),
    [
        ("backlash", "leg1/ball_nut", "", {"half_gap": 4e-5, "closing_load": 1.0}),
        ("geometric_offset", "leg3/linear_rod", "direction", {"rx": 2.5e-3, "ry": -1.5e-3}),
    ],
)
def test_a_fault_beyond_the_tolerances_is_named(robot, physics, place, aspect, values):
    fault = effect_named(physics, place, aspect, values, robot.mechanism)
    found = diagnose(robot, bench(robot, 5, fault))
    named = [item for item in found.findings if item.physics not in ("self_weight", "finite_deflection")]
    assert named[0].physics == physics
    assert place in named[0].candidates
    assert found.after["fit"] < 1.25


@pytest.mark.slow
def test_a_stiffness_many_tolerances_off_is_named_though_its_parameter_could_follow(tmp_path):
    """Let go, the parameter leaves little of the residual: what the law must gain is asked beside that, not before."""
    drawn = draw_scattered(5, "elastic_arm", effects=["stiffness_changed"], misjudged=False, sensors=1.0, poses=(6, 2))
    write(drawn, tmp_path, tmp_path / "sealed", "device")
    true = json.loads((tmp_path / "sealed" / "device.truth.json").read_text())["effects"][0]
    found = diagnose(prup_pin.load(ARM), read_recording(tmp_path / "device.csv"))
    first = found.findings[0]
    assert (
        (first.physics, first.location)
        == ("stiffness_changed", true["location"])
        == ("stiffness_changed", "joint2/drive")
    )
    low, high = first.parameters["factor"].interval
    assert low < true["parameters"]["factor"] < high
    assert found.verdict == "explained"


def test_calibrate_from_the_shell_and_predict_with_what_it_learned(robot, tmp_path):
    path, other, model = tmp_path / "bench.csv", tmp_path / "other.csv", tmp_path / "model.json"
    write_recording(bench(robot, 21), path)
    write_recording(bench(robot, 21).select(slice(0, 12)), other)
    said = run("calibrate", path, "--robot", "3prup", "--out", model)
    assert "which is noise" in said
    assert "target.rz" in said
    count = int(re.search(r"Never seen by these data \((\d+) parameters\)", said)[1])
    told = said[said.index("Never seen by these data") :].partition("Remarks")[0]
    lines, told = told.count("\n  - "), " ".join(told.split())
    named = sum(int(more) for more in re.findall(r"and (\d+) more", told)) + told.count(",") - told.count(", and")
    assert count > 40
    assert named + lines == count  # each kind once, with three names at most
    assert lines < 15
    effects = json.loads(model.read_text(encoding="utf-8"))["effects"]
    assert [item["physics"] for item in effects] == ["calibration", "self_weight"]
    predicted = tmp_path / "predicted.csv"
    run("predict", model, other, "--out", predicted)
    table = np.genfromtxt(predicted, delimiter=",", names=True, deletechars="", dtype=None, encoding="utf-8")
    apart = read_recording(other).position - np.column_stack([table[f"p.{axis}"] for axis in "xyz"])
    assert np.sqrt((apart**2).mean()) < 4e-6


def test_without_a_tolerance_there_is_nothing_to_calibrate(robot, tmp_path):
    from prup_pin.diagnosis.calibration import calibrated

    recording = bench(robot, 21)
    object.__setattr__(recording, "tolerances", Tolerances())
    with pytest.raises(InputError, match=r"nothing may be off.*--tolerances typical"):
        calibrated(robot, recording)
