"""95 % intervals of fitted values: by covariance, and by the profile where a slope is not to be trusted."""

from types import SimpleNamespace

import numpy as np
import pytest

import prup_pin
from prup_pin.diagnosis.candidates import Candidate
from prup_pin.diagnosis.findings import finding_of
from prup_pin.diagnosis.intervals import parameters_of
from prup_pin.diagnosis.toleranced import Toleranced
from prup_pin.laws import CoulombFriction, Inputs, Place, StiffnessChanged
from prup_pin.laws.deviations import amounts_of, deviations_of
from prup_pin.simulation import Simulator
from prup_pin.views.text.diagnosis_words import parameter_texts

from ..laws import bench
from ..statics.build import rubbing_block
from .test_parts import problem_of

LIMIT, STICK, SPRING = 6.0, 4e5, 2e5  # N, N/m, N/m


@pytest.fixture
def block(tmp_path):
    """A block that rubs on the base, and a spring beside it that holds it."""
    return rubbing_block(tmp_path, SPRING)


def fitted(robot, largest):
    """What is told of dry friction after pulls up to a force [N]."""
    forces = largest * np.sin(np.linspace(0, 4 * np.pi, 120))
    wrench = np.outer(forces, np.eye(6)[0])
    inputs = Inputs(np.arange(120.0), np.zeros((120, 1)), wrench, np.zeros(120, int))
    simulator = Simulator(robot, inputs)
    candidate = Candidate(CoulombFriction(), Place("rubbing"), robot.mechanism, 1.0)
    term = candidate.term(np.log([LIMIT, STICK]))
    problem = problem_of(simulator, [term.effect], scatter=0.1)
    fit = problem.refine([candidate.term(np.log([1.1 * LIMIT, 0.9 * STICK]))], problem.first)
    told = parameters_of(problem, fit, 0)
    intervals = {name: item.interval for name, item in told.items()}
    return told, term.candidate.law.told(Place("rubbing"), fit.terms[0].effect.values, intervals, robot.mechanism)


def test_friction_that_slid_has_a_size(block):
    told, statement = fitted(block, 30.0)
    low, high = told["limit"].interval
    assert low < LIMIT < high < 1.1 * low
    assert "slides at" in statement


def test_friction_that_was_never_overcome_has_a_bound(block):
    """It holds two thirds of 8.4 N, 5.6 N: a joint that slides at less would have been seen, at more never."""
    told, statement = fitted(block, 8.4)
    low, high = told["limit"].interval
    assert low == pytest.approx(8.4 * STICK / (STICK + SPRING), rel=0.05)
    assert low < LIMIT
    assert (
        high == CoulombFriction().quantities_at(Place("rubbing"), block.mechanism)[0].upper
    )  # the largest that it has
    assert f"did not slide below {low:.3g} N" in statement
    assert ("limit", f"above {low:.3g} N") in [row[:2] for row in parameter_texts(told)]
    low, high = told["presliding_stiffness"].interval
    assert low < STICK < high < 1.2 * low


def test_a_stiffness_beside_its_tolerance_is_a_share_of_what_it_was_calibrated_to():
    """Beside a tolerance it is not of the robot file's, and the value that it is a share of is told."""
    robot = prup_pin.load("3prup")
    simulator = Simulator(robot, bench.inputs("3prup"))
    candidate = Candidate(StiffnessChanged(), Place("leg2/linear_rod"), robot.mechanism, 1.0)
    problem = problem_of(simulator, [candidate.term(np.log([0.7])).effect], scatter=0.01)
    found = {}
    for declared in ({}, {"stiffness": 0.1, "bending": 0.03}):
        deviations = deviations_of(robot.mechanism)
        within = problem.within(Toleranced.of(deviations, amounts_of(deviations, robot.mechanism, declared)))
        fit = within.fit_at([candidate.term(np.log([0.7]))], within.off(np.full(len(declared) and 39, 0.5)))
        fit = within.relinearised(fit)
        told = finding_of(within, fit, 0, SimpleNamespace(rivals=[[]]), robot, 1.0).statement
        found[bool(declared)] = told.partition(" is ")[2]
    assert found[False] == "70 % of the robot file's"
    assert found[True] == "70 % of its calibrated value, 204 GPa"
