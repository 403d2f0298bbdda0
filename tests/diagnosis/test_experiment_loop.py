"""A recording, a verdict that leaves a class, the plan that it proposes, a second recording: the class shrinks."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.identify import Bench, separation
from prup_pin.recordings import add_noise, read_plan, read_recording
from prup_pin.simulation import effect_named, simulate

from ..reference.concealed.scattered import draw_scattered, write
from ..simulation.bench import NOISE, plan

ARM = Path(__file__).parents[1] / "robots/elastic_arm/elastic_arm.urdf"
CYCLE = (0.0, 0.5, 1.0, 0.5, 0.0, -0.5, -1.0, -0.5, 0.0)


def recorded(robot, asked, fault, seed):
    """What sensors with noise say of a faulty robot under a test plan's loads."""
    given = asked.inputs(lambda at: robot.pose(**at).actuators)
    predicted = simulate(robot, given, [fault])
    return add_noise(replace(given, position=predicted.position, rotation=predicted.rotation), NOISE, seed)


@pytest.mark.slow
def test_the_second_recording_leaves_fewer_places_and_names_the_true_one(tmp_path):
    """A weak bearing beside a branch moves the platform much as a weak branch does, but not everywhere."""
    robot = prup_pin.load("3prup")
    fault = effect_named("stiffness_changed", "leg1/R_theta_P", "radial", {"factor": 0.06}, robot.mechanism)
    first = recorded(robot, plan(poses=4, cycle=CYCLE), fault, 1)
    alone = diagnose(robot, first)
    (one,) = alone.findings
    assert "leg1/R_theta_P" in one.candidates
    assert len(one.candidates) > 3

    proposed = alone.next_experiment
    assert proposed["why"].startswith("separates stiffness changed at ")
    (tmp_path / "next.json").write_text(json.dumps(proposed["plan"]))
    second = recorded(robot, read_plan(tmp_path / "next.json"), fault, 2)
    found = diagnose(robot, [first, second]).findings
    # poses that tell places apart may be those that give way most
    (both,) = [finding for finding in found if finding.physics != "finite_deflection"]
    assert (both.physics, both.location) == ("stiffness_changed", "leg1/R_theta_P")
    assert set(both.candidates) <= {"leg1/R_theta_P", "leg1/moving_star_branch"}


def test_what_is_one_and_the_same_is_not_promised_to_be_told_apart(diagnosed):
    """A nut and a screw carry the same force along one axis: which of them has play no pose tells."""
    _, _, found = diagnosed
    assert found.findings[0].location == "leg2/ball_nut"
    assert {"leg2/ball_screw", "leg2/R_lambda"} < set(found.findings[0].candidates)
    told, _, untold = found.next_experiment["why"].partition("But no pose and load within reach tells it from ")
    assert told.startswith("separates backlash at leg2/ball_nut from backlash at leg2/R_lambda")
    assert told.count("times the noise") == told.count("ball_nut") == 1  # each is said once
    assert untold.startswith("backlash at leg2/ball_screw")
    alike, apart = (
        {pair["other"]["location"] for pair in found.next_experiment[key]} for key in ("cannot_separate", "separates")
    )
    assert "leg2/ball_screw" in alike
    assert "leg2/R_lambda" in apart
    assert not alike & apart


@pytest.mark.slow
def test_a_weight_and_a_sensor_that_reports_one_more_are_told_by_no_pose(tmp_path):
    """What first order has a little off in a rival no other recording would show; a tilted base would."""
    drawn = draw_scattered(9704, "elastic_arm", ["payload"], poses=(6, 1))
    write(drawn, tmp_path, tmp_path / "sealed", "device")
    found = diagnose(prup_pin.load(ARM), read_recording(tmp_path / "device.csv"))
    assert found.findings[0].physics == "payload"
    proposed = found.next_experiment
    rivals = {pair["other"]["physics"]: pair for pair in proposed["cannot_separate"]}
    assert rivals["wrench_sensor_bias"]["tilted_base"] > 3
    assert rivals["wrench_sensor_bias"]["times_noise"] < 1
    # what pulls back where the tool goes is another matter: another pose tells it
    assert {pair["other"]["physics"] for pair in proposed["separates"]} <= {"external_spring"}


@pytest.mark.slow
def test_what_only_larger_loads_would_tell_apart_is_said_so():
    """A bearing on a rod that bends carries nearly what the drive does; under small loads no more can be said."""
    robot = prup_pin.load("3prup")
    fault = effect_named("backlash", "leg2/ball_nut", "", {"half_gap": 3e-5, "closing_load": 1.0}, robot.mechanism)
    found = diagnose(robot, recorded(robot, plan(poses=3, cycle=CYCLE), fault, 1))
    assert found.findings[0].candidates[:2] == ("leg2/ball_nut", "leg2/ball_screw")
    proposed = found.next_experiment
    assert ". But no pose and load within reach tells it from backlash at leg2/" in proposed["why"]
    alike, left = (
        {pair["other"]["location"]: pair for pair in proposed[name]} for name in ("cannot_separate", "undecided")
    )
    assert alike["leg2/ball_screw"]["times_noise"] < 1e-3
    assert left["leg2/R_lambda"]["larger_loads"] > 2 * left["leg2/R_lambda"]["times_noise"]
    assert "Loads 3 times as large would tell it from backlash at leg2/R_" in proposed["why"]
    assert proposed["weighed"] > 168  # the first places told nothing of it


def test_an_explanation_that_holds_the_other_one_is_not_apart_from_it():
    """What a rival's parameters can follow separates nothing, but for what is known of them already."""
    rng = np.random.default_rng(3)
    free, other = rng.normal(size=(20, 6, 2)), rng.normal(size=(20, 6))
    follows = free @ np.array([0.3, -0.2])
    nothing = np.zeros((2, 2))
    assert np.abs(separation(follows, free, nothing)).max() < 1e-12
    left = separation(follows + other, free, nothing)
    flat = free.reshape(120, 2)
    assert np.abs(flat.T @ left.ravel()).max() < 1e-10 * np.linalg.norm(flat)
    assert left == pytest.approx(separation(other, free, nothing), abs=1e-12)
    # a recording that knows the parameters as well as this one would leaves half of it
    assert separation(follows, free, flat.T @ flat) == pytest.approx(0.5 * follows, rel=1e-9)


def test_poses_and_loads_that_are_varied_stay_near_and_within_reach():
    """Poses near others keep their partners: a varied load belongs to a varied pose."""
    robot = prup_pin.load("3prup")
    reach = Bench(robot, np.full(3, 0.35), np.full(3, 0.45), 20.0, 3.0, None, None, (), np.ones(6, bool))
    around = np.array([[0.36, 0.4, 0.4], [0.44, 0.4, 0.4]])
    near = np.array(list(reach.poses(6, np.random.default_rng(1), around)))
    assert np.abs(near - np.tile(around, (3, 1))).max() <= 0.1 * 0.05
    loads = reach.loads(6, np.random.default_rng(1), np.array([[20.0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 3.0]]))
    assert np.linalg.norm(loads[:, :3], axis=1).max() <= 20.0 * (1 + 1e-12)
    assert (loads[::2, 0] > 7).all()
    assert np.abs(loads[1::2, :3]).max() < loads[::2, 0].max()
