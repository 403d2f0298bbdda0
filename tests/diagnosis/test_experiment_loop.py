"""A recording, a verdict that leaves a class, the plan that it proposes, a second recording: the class shrinks."""

import json
from dataclasses import replace

import pytest

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.recordings import add_noise, read_plan
from prup_pin.simulation import effect_named, simulate

from ..simulation.bench import NOISE, plan

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
    told, _, untold = found.next_experiment["why"].partition("But no pose and load within reach tells apart: ")
    assert "backlash at leg2/ball_nut against backlash at leg2/R_lambda" in told
    assert "backlash at leg2/ball_nut against backlash at leg2/ball_screw" in untold
    alike, apart = (
        {pair["other"]["location"] for pair in found.next_experiment[key]} for key in ("cannot_separate", "separates")
    )
    assert "leg2/ball_screw" in alike
    assert "leg2/R_lambda" in apart
    assert not alike & apart


@pytest.mark.slow
def test_where_nothing_can_be_told_apart_no_plan_is_made():
    robot = prup_pin.load("3prup")
    fault = effect_named("backlash", "leg2/ball_nut", "", {"half_gap": 3e-5, "closing_load": 1.0}, robot.mechanism)
    found = diagnose(robot, recorded(robot, plan(poses=3, cycle=CYCLE), fault, 1))
    assert found.findings[0].candidates[:2] == ("leg2/ball_nut", "leg2/ball_screw")
    assert found.next_experiment["why"].startswith(
        "no pose and load within reach tells apart: backlash at leg2/ball_nut against backlash at leg2/"
    )
    assert found.next_experiment["plan"] == {}
    assert found.next_experiment["separates"] == []
