"""The robot's weight is no free number: what weighs more than its masses may be off hangs on it."""

from pathlib import Path

import numpy as np
import pytest

import prup_pin
from prup_pin.diagnosis import search as searching
from prup_pin.diagnosis.calibrate import within_tolerances
from prup_pin.diagnosis.candidates import candidates
from prup_pin.diagnosis.evidence import penalty
from prup_pin.diagnosis.search import select
from prup_pin.diagnosis.toleranced import Toleranced
from prup_pin.laws.deviations import amounts_of, deviations_of
from prup_pin.recordings import LoadProgramme, RandomPoses, TestPlan
from prup_pin.simulation import Simulator, effect_named, inputs_of

from .test_parts import problem_of

ROBOT = Path(__file__).parents[1] / "robots" / "three_rps" / "three_rps.urdf"
BOX = {"z": (0.72, 0.88), "rx": (-0.25, 0.25), "ry": (-0.25, 0.25)}
WEIGHT, PAYLOAD = "self_weight at robot", "payload at tool"
LAWS = (WEIGHT, PAYLOAD, "stiffness_changed at leg1/drive", "encoder_offset at leg1_slide")


@pytest.fixture(scope="module")
def bench():
    robot = prup_pin.load(ROBOT)
    plan = TestPlan(
        poses=(RandomPoses(6, BOX),),
        loads=(LoadProgramme((0.0, 1.0, -1.0), random_directions=1, force=300, moment=30),),
        seed=3,
    )
    simulator = Simulator(robot, inputs_of(plan.inputs(lambda at: robot.pose(**at).actuators), robot))
    library = [found for found in candidates(robot.mechanism, simulator.inputs) if found.name in LAWS]
    return simulator, {found.name: found for found in library}


def measured(simulator, scale=1.0, mass=0.0):
    named = [("self_weight", "robot", "", {"scale": scale}), ("payload", "tool", "", {"mass": mass})]
    mechanism = simulator.robot.mechanism
    return problem_of(simulator, [effect_named(*each, mechanism) for each in named if any(each[-1].values())])


def selected(bench, **what):
    simulator, library = bench
    problem = measured(simulator, **what)
    return select(problem, list(library.values()), simulator.inputs.blocks, problem.first)


def values(fit):
    return {term.candidate.name: next(iter(term.effect.values.values())) for term in fit.terms}


def test_a_payload_is_named_beside_the_weight_and_not_as_more_of_it(bench):
    found = values(selected(bench, mass=4.0).last)
    assert found == {WEIGHT: pytest.approx(1.0, abs=0.03), PAYLOAD: pytest.approx(4.0, rel=0.15)}


def test_masses_that_are_a_little_off_are_no_payload(bench):
    assert values(selected(bench, scale=1.05).last) == {WEIGHT: pytest.approx(1.04, abs=0.015)}


def test_a_payload_of_any_mass_gives_way_to_the_weight_that_acts(bench):
    simulator, library = bench
    problem = measured(simulator)
    wrong = problem.refine([library[PAYLOAD].term(library[PAYLOAD].starts()[0])], problem.first)
    search = searching.Search(problem)
    assert values(searching.rearranged(search, wrong, list(library.values()))).keys() == {WEIGHT}
    soft = "stiffness_changed at leg1/drive"
    bent = problem.refine([library[soft].term(np.zeros(1))], problem.first)
    assert values(searching.rearranged(search, bent, list(library.values()))).keys() == {soft, WEIGHT}


def test_weight_costs_no_parameter_and_has_no_rival_but_weight(bench):
    found = selected(bench)
    assert [penalty(term) for term in found.last.terms] == [0.0]
    assert all(rival.term.candidate.name == WEIGHT for rival in found.rivals[0])


def test_what_is_known_of_the_weight_is_part_of_chi_squared(bench):
    simulator, library = bench
    problem = measured(simulator, scale=1.1)
    fit = problem.refine([library[WEIGHT].term(np.zeros(1))], problem.first)
    scale, known = values(fit)[WEIGHT], 1 / library[WEIGHT].law.spread
    assert fit.chi2 == pytest.approx((fit.residual**2).sum() + (known * np.log(scale)) ** 2)
    slope = -(problem.jacobian(fit)[:, 0] @ fit.residual.ravel()) + known**2 * np.log(scale)
    assert abs(slope) < 0.02 * known**2 * np.log(scale)
    # beside a term that is known, what that may do is put back and held: nothing is left to be gained at the fit
    nuisance = problem.nuisance(fit, (0,))
    left = nuisance.without(fit.residual.ravel() + nuisance.offset)
    assert left @ left == pytest.approx(fit.chi2, rel=1e-3)


def test_weight_that_acts_already_is_not_added_once_more(bench):
    """What weighs as much again as the robot is a payload, where masses are known to a hundredth."""
    simulator, library = bench
    mechanism = simulator.robot.mechanism
    deviations = deviations_of(mechanism)
    toleranced = Toleranced.of(deviations, amounts_of(deviations, mechanism, {"mass": 0.01}))
    problem = within_tolerances(measured(simulator, scale=2.0), toleranced, list(library.values()), 4.0)
    assert [effect.law.physics for effect in problem.acting] == ["self_weight"]
    found = select(problem, list(library.values()), simulator.inputs.blocks, problem.first)
    assert WEIGHT not in values(found.last)


def test_the_weight_that_acts_has_nothing_to_prove(bench):
    simulator, library = bench
    problem = measured(simulator, mass=4.0)
    terms = [library[name].term(library[name].starts()[0]) for name in (PAYLOAD, WEIGHT)]
    fit = problem.refine(terms, problem.first)
    kept = searching.dropped(searching.Search(problem), fit, lambda fit: lambda size: np.inf)
    assert values(kept).keys() == {WEIGHT}
