"""Where fits of gaps and of dry friction begin: at what the place felt, and with a gap that is still open."""

from dataclasses import replace

import numpy as np
import pytest

from prup_pin.channels import Noise, PoseChannel, Stack
from prup_pin.diagnosis.candidates import Candidate, under_load
from prup_pin.diagnosis.influence import Influence
from prup_pin.diagnosis.problem import Problem
from prup_pin.laws import Inputs, Place, law_at
from prup_pin.simulation import Simulator

from ..statics.build import rubbing_block

K = 2e5  # N/m
FORCES = np.arange(-100.0, 100.0, 7.3)  # N


@pytest.fixture
def block(tmp_path):
    """A block that slides on the base, and a spring beside it that holds it."""
    return rubbing_block(tmp_path, K)


def pulled(robot, forces):
    count = len(forces)
    wrench = np.outer(forces, np.eye(6)[0])
    return Simulator(robot, Inputs(np.arange(float(count)), np.zeros((count, 1)), wrench, np.zeros(count, int)))


def candidate(robot, physics, place, aspect=""):
    at = Place(place, aspect)
    return Candidate(law_at(physics, at, robot.mechanism), at, robot.mechanism, 1.0)


def measured(simulator, effects, noise):
    """Return the problem of what these effects make of the tool's place, beside noise."""
    run = simulator.run(effects)
    assert run.solved.all()
    scatter = np.random.default_rng(1).normal(size=run.position.shape) * noise.position
    exists = np.zeros((len(scatter), 6), bool)
    exists[:, 0] = True
    pose = PoseChannel(simulator.robot.mechanism.tool, run.position + scatter, run.rotation, exists)
    return Problem.of(simulator, Stack((pose,)), noise)


@pytest.mark.parametrize("place", ["rubbing", "slide"])
def test_friction_begins_at_what_its_joint_felt(block, place):
    """All of the load would hold the block where it stands, and the spring is what else holds it."""
    simulator = pulled(block, np.array([0.0, 12.0, 31.0, -20.0]))
    nominal = Influence(simulator, simulator.run(()))
    (found,) = under_load([candidate(block, "coulomb_friction", place)], nominal)
    assert found.felt == pytest.approx((31.0, K), rel=1e-6)
    limit, sticking = found.values_of(found.starts()[0])
    assert (limit, sticking) == pytest.approx((3.1, K), rel=1e-6)
    assert found.quantities[1].upper == pytest.approx(100 * K, rel=1e-6)


def test_a_gap_opens_where_another_law_joins_it(block):
    """One that has closed within too small a load holds all samples on the side on which they were seen."""
    simulator = pulled(block, FORCES)
    gap = candidate(block, "backlash", "spring")
    bias = candidate(block, "wrench_sensor_bias", "wrench_sensor", "forces")
    truth = [gap.term(gap.coordinates_of(np.array([2e-4, 0.3])))]
    truth.append(bias.term(np.array([9.0, 0.0, 0.0])))
    problem = measured(simulator, [term.effect for term in truth], Noise(1e-6, 1e-5, 0.0, 0.0, "declared"))
    closed = problem.fit_at([replace(truth[0], coordinates=gap.coordinates_of(np.array([2e-4, 0.02])))], problem.first)
    fit = problem.refine([*closed.terms, bias.term(np.array([1.0, 0.0, 0.0]))], closed)
    assert fit.chi2 < 2 * len(FORCES)
    half_gap, _ = gap.values_of(fit.terms[0].coordinates)
    assert half_gap == pytest.approx(2e-4, rel=5e-3)
    assert fit.terms[1].coordinates[0] == pytest.approx(9.0, rel=5e-3)


def test_what_does_not_close_is_not_opened(block):
    stiff = candidate(block, "stiffness_changed", "spring")
    assert not list(stiff.term(stiff.starts()[0]).wider())
    gap = candidate(block, "backlash", "spring")
    wider = [gap.values_of(term.coordinates) for term in gap.term(gap.coordinates_of(np.array([1e-4, 0.05]))).wider()]
    np.testing.assert_allclose(wider, [[1e-4, 5.0], [1e-4, 1.5], [1e-4, 0.5], [1e-4, 0.15]], rtol=1e-9)
