"""Values beside what is usual: rare, but where they are they may be so by far."""

import numpy as np
import pytest

from prup_pin.diagnosis.candidates import candidates
from prup_pin.diagnosis.evidence import implausible
from prup_pin.diagnosis.search import select
from prup_pin.simulation import effect_named

from ..laws import bench
from .test_parts import problem_of

BIAS = {"fx": -160.0, "fy": 160.0, "fz": 310.0}
FORCES = "wrench_sensor_bias at wrench_sensor (forces)"
HOSE = "external_spring at environment"
LAWS = (FORCES, "wrench_sensor_bias at wrench_sensor", HOSE, "payload at moving_star")


@pytest.fixture(scope="module")
def library():
    simulator = bench.simulator("3prup")
    found = {item.name: item for item in candidates(simulator.robot.mechanism, simulator.inputs)}
    return simulator, [found[name] for name in LAWS]


def test_what_is_unusual_costs_a_square_near_by_and_a_logarithm_far_off(library):
    _, (forces, *_) = library
    sizes = forces.scales()
    near, far = (float((forces.prior_residuals(factor * 30 * sizes) ** 2).sum()) for factor in (0.1, 30.0))
    assert near == pytest.approx(3 * 0.01, rel=1e-2)
    assert far == pytest.approx(3 * 4 * np.log1p(900 / 4), rel=1e-12)
    for factor in (-20.0, -1.0, 0.0, 1e-8, 0.5, 3.0, 50.0):
        at, step = factor * 30 * sizes, 1e-4 * sizes
        slope = np.diag((forces.prior_residuals(at + step) - forces.prior_residuals(at - step)) / (2 * step))
        np.testing.assert_allclose(np.diag(forces.prior_slopes(at)), slope, rtol=1e-6)


def test_a_sensor_that_nobody_zeroed_is_no_hose(library):
    """Forces off by hundreds of newtons: a hose that is slack far away would pull as evenly."""
    simulator, laws = library
    effect = effect_named("wrench_sensor_bias", "wrench_sensor", "forces", BIAS, simulator.robot.mechanism)
    problem = problem_of(simulator, [effect])
    found = select(problem, laws, simulator.inputs.blocks, problem.first).last
    assert [term.candidate.name for term in found.terms] == [FORCES]
    np.testing.assert_allclose(found.terms[0].coordinates, list(BIAS.values()), rtol=1e-2)
    assert implausible(found.terms[0]) < 60


def test_a_hose_hangs_from_something_near_the_robot(library):
    """As far from the tool at home as that is from the base: slack several times farther, it pulls as a bias does."""
    simulator, laws = library
    (hose,) = (item for item in laws if item.name == HOSE)
    home = simulator.robot.home.base_from_tool[:3, 3]
    here = hose.coordinates_of(np.array([100.0, *home]))
    np.testing.assert_allclose(hose.prior_residuals(here), 0.0, atol=1e-9)
    size = np.linalg.norm(home)
    away = hose.prior_residuals(np.append(here[:3], here[3] + 3 * size))
    np.testing.assert_allclose(away, [0.0, 0.0, 0.0, np.sqrt(4 * np.log1p(9 / 4))], rtol=1e-9)
    assert hose.bounds[1][3] == pytest.approx(home[2] + 4 * size)
