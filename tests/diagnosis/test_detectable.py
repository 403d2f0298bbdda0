"""What a recording could not have shown is told with sizes that a law can have."""

import numpy as np
import pytest
from scipy.special import chdtri

import prup_pin
from prup_pin.channels import Noise, PoseChannel, Stack
from prup_pin.diagnosis.calibrate import calibrate
from prup_pin.diagnosis.candidates import candidates
from prup_pin.diagnosis.criteria import FALSE_ALARM
from prup_pin.diagnosis.identify import not_detectable
from prup_pin.diagnosis.problem import Problem
from prup_pin.diagnosis.search import Selection
from prup_pin.diagnosis.toleranced import Toleranced
from prup_pin.laws.deviations import deviations_of
from prup_pin.simulation import Simulator, inputs_of

from ..simulation.bench import inputs


@pytest.fixture(scope="module")
def simulator():
    robot = prup_pin.load("3prup")
    return Simulator(robot, inputs_of(inputs(robot, poses=3), robot))


def hidden(simulator, noise):
    """Return problem, library, and what stays hidden behind sensors with this noise of position [m]."""
    run = simulator.run(())
    exists = np.ones((len(run.position), 6), bool)
    pose = PoseChannel(simulator.robot.mechanism.tool, run.position, run.rotation, exists)
    problem = Problem.of(simulator, Stack((pose,)), Noise(noise, 5 * noise, 0.0, 0.0, "declared"))
    library = candidates(simulator.robot.mechanism, simulator.inputs)
    found = list(not_detectable(problem, problem.first, Selection.nothing(problem.first, library)))
    return problem, {candidate.name: candidate for candidate in library}, found


def chi2_of(problem, candidate, value):
    values = candidate.values_of(candidate.starts()[0])
    values[0] = value
    change = problem.change(problem.first, [candidate.effect(candidate.coordinates_of(values))])
    return float((change**2).sum())


# What yields in proportion, by a power of its parameter, about a value of one, and up to where a joint is stuck.
TOLD = [
    (2e-5, "stiffness_changed"),
    (2e-5, "backlash"),
    (2e-4, "payload"),
    (2e-5, "hertzian_contact"),
    (2e-4, "wrench_sensor_gain"),
    (2e-5, "viscous_friction"),
]


@pytest.mark.parametrize(("noise", "physics"), TOLD)
def test_a_size_that_is_told_would_just_have_been_seen(simulator, noise, physics):
    problem, library, found = hidden(simulator, noise)
    threshold = chdtri(1, FALSE_ALARM / len(library))
    told = [item for item in found if item.physics == physics and item.smallest is not None]
    assert told
    for item in told:
        candidate = library[f"{physics} at {item.location}"]
        assert chi2_of(problem, candidate, item.smallest) == pytest.approx(threshold, rel=0.02)


def test_what_a_stuck_joint_cannot_show_is_told_with_no_size(simulator):
    """Friction does no more than hold its joint."""
    problem, library, found = hidden(simulator, 2e-4)
    threshold = chdtri(1, FALSE_ALARM / len(library))
    stuck = [item for item in found if item.physics == "coulomb_friction" and item.location.endswith("R_phi")]
    assert len(stuck) == 3
    for item in stuck:
        assert (item.smallest, item.reason) == (None, "not visible at any size")
        candidate = library[f"coulomb_friction at {item.location}"]
        assert chi2_of(problem, candidate, candidate.quantities[0].upper) < threshold


@pytest.mark.slow
def test_no_size_is_told_that_the_law_cannot_have(simulator):
    for noise in (2e-6, 2e-4, 2e-2, 1e6):
        _, library, found = hidden(simulator, noise)
        for item in found:
            candidate = library.get(f"{item.physics} at {item.location}")
            if candidate is not None and item.smallest is not None:
                quantity = candidate.quantities[0]
                assert quantity.lower <= item.smallest <= quantity.upper
    beyond = [item for item in found if item.reason == "not visible at any size"]
    assert {"stiffness_changed", "torsion", "backlash"} <= {item.physics for item in beyond}
    assert all(item.smallest is None for item in beyond)


def test_the_softer_the_more(simulator):
    _, _, found = hidden(simulator, 2e-2)
    below = {item.physics for item in found if item.below}
    assert below == {"stiffness_changed", "root_tilt_compliance", "hub_root_compliance", "hardening"}


def test_what_wide_tolerances_could_hide_is_told_with_its_size(simulator):
    """To first order a parameter takes four of its tolerances before it is seen: then 1/f - 1 = 4 t of a factor f."""
    mechanism = simulator.robot.mechanism
    name = "leg1/R_lambda.tilting_stiffness"
    off = Toleranced.of(deviations_of(mechanism), {name: 1.2})
    problem = hidden(simulator, 2e-6)[0]
    problem = calibrate(problem, off)
    library = candidates(mechanism, simulator.inputs)
    found = list(not_detectable(problem, problem.first, Selection.nothing(problem.first, library)))
    told = [item for item in found if "tolerances" in item.reason]
    stiffness = [item for item in told if item.physics == "stiffness_changed"]
    assert [item.location for item in stiffness] == ["leg1/R_lambda (tilting)"]
    threshold = chdtri(1, FALSE_ALARM / len(library))
    assert 1 / stiffness[0].smallest - 1 == pytest.approx(1.2 * np.sqrt(threshold), rel=0.03)
    exact = [item for item in hidden(simulator, 2e-6)[2] if item.physics == "stiffness_changed"]
    assert "leg1/R_lambda (tilting)" not in [item.location for item in exact]
