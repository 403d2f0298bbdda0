"""What is drawn of a finding: by the law's own word, computed once, kept with the finding."""

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest

import prup_pin
from prup_pin.diagnosis.candidates import candidates
from prup_pin.diagnosis.locate import Agreement, Recovered, local_curve, recovered
from prup_pin.diagnosis.toleranced import Toleranced
from prup_pin.diagnosis.verdict import _noise_too_large
from prup_pin.simulation import Simulator, inputs_of

from ..simulation.bench import inputs
from .test_parts import problem_of, term

COULOMB = "coulomb_friction at leg1/R_theta_P"
BACKLASH = "backlash at leg2/ball_nut"


@pytest.fixture(scope="module")
def simulator():
    """A bench test in which all that laws may need was recorded."""
    robot = prup_pin.load("3prup")
    bench = inputs(robot, poses=5, cycle=(0.0, 0.5, 1.0, 0.5, 0.0, -0.5, -1.0))
    rng = np.random.default_rng(2)
    given = inputs_of(bench, robot)
    object.__setattr__(given, "temperature", 20 + rng.uniform(0, 8, len(given)))
    object.__setattr__(given, "speeds", rng.normal(size=given.actuators.shape))
    return Simulator(robot, given)


@pytest.fixture(scope="module")
def library(simulator):
    return {item.name: item for item in candidates(simulator.robot.mechanism, simulator.inputs)}


def drawn_of(problem, fit, candidate):
    return candidate.law.drawn(candidate.place, fit.influence.solved)


def test_what_a_law_does_lies_along_what_it_is_drawn_against(simulator, library):
    """To first order its change of the pose at every sample is a multiple of the direction that it names."""
    problem = problem_of(simulator, [], scatter=0.0)
    fit = problem.fit_at((), problem.first)
    kinds = set()
    for candidate in library.values():
        drawn = drawn_of(problem, fit, candidate)
        if drawn is None or candidate.law.physics == "creep":  # creep follows the loads before, too
            continue
        change = fit.influence.change(simulator.setup([candidate.effect(candidate.starts()[0])]))
        along = (change * drawn.direction).sum(1) / np.maximum((drawn.direction**2).sum(1), 1e-300)
        rest = change - along[:, None] * drawn.direction
        assert np.linalg.norm(rest) < 1e-6 * np.linalg.norm(change) + 1e-15, candidate.name
        assert drawn.x.shape == (len(fit.samples),)
        assert all(drawn.labels)
        assert all(drawn.units)
        assert drawn.path == candidate.remembers
        kinds.add(candidate.law.physics)
    assert kinds >= {"backlash", "hertzian_contact", "stiffness_changed", "thermal_growth", "lead_error"}
    assert kinds >= {"coulomb_friction", "viscous_friction"}


@pytest.mark.parametrize(
    "name",
    ["geometric_offset at leg1/base", "encoder_offset at leg1/motor", "payload at moving_star", "self_weight at robot"],
)
def test_what_no_load_drives_is_shown_at_the_tool(simulator, library, name):
    candidate = library[name]
    truth = term(library, name, *candidate.values_of(candidate.starts()[0]))
    problem = problem_of(simulator, [truth.effect])
    fit = problem.fit_at([truth], problem.first)
    assert drawn_of(problem, fit, candidate) is None
    after = problem.stack.residual(fit.run)[fit.samples]
    shown = recovered(problem, fit, after, truth.effect, None)
    assert isinstance(shown, Agreement)
    spread = (shown.asked - shown.law) / np.repeat([shown.noise.position, shown.noise.rotation], 3)
    assert np.sqrt(np.mean(spread**2)) == pytest.approx(1.0, abs=0.15)


def test_weight_that_acts_beside_any_law_is_shown_by_what_it_does(simulator, library):
    """It is no term of the fit: all its points stood on one line, at 'the law gives 0'."""
    candidate = library["self_weight at robot"]
    truth = term(library, candidate.name, *candidate.values_of(candidate.starts()[0]))
    problem = problem_of(simulator, [truth.effect])
    fit = problem.fit_at([truth], problem.first)
    after = problem.stack.residual(fit.run)[fit.samples]
    as_law = recovered(problem, fit, after, truth.effect, None)
    nothing = Toleranced.of([], [])
    acting = problem.within(nothing, [truth.effect])
    own = acting.fit_at((), acting.first)
    shown = recovered(acting, own, acting.stack.residual(own.run)[own.samples], truth.effect, None)
    assert np.abs(shown.law).max() > 1e-5
    np.testing.assert_allclose(shown.law, as_law.law, atol=1e-3 * np.abs(as_law.law).max())


def test_a_noise_declared_far_too_large_is_asked_about(simulator):
    """0.02 m for 20 µm left a thousandth of it, and nobody said a word."""
    problem = problem_of(simulator, [])
    fit = problem.fit_at((), problem.first)
    assert not [*_noise_too_large(problem, fit)]
    wrong = replace(problem, noise=replace(problem.noise, position=1e3 * problem.noise.position, source="declared"))
    (told,) = _noise_too_large(wrong, wrong.fit_at((), wrong.first))
    assert told.startswith("position_noise is declared as ")
    assert "times that is left of what was measured: is its unit right?" in told
    estimated = replace(wrong, noise=replace(wrong.noise, source="estimated"))
    assert not [*_noise_too_large(estimated, estimated.fit_at((), estimated.first))]


def test_two_findings_are_told_apart(simulator, library):
    """Each is shown without the other: the gap's curve has its two ends, the joint's torque its limit."""
    truth = [term(library, BACKLASH, 3e-5, 1.0), term(library, COULOMB, 1.0, 8000.0)]
    problem = problem_of(simulator, [item.effect for item in truth])
    fit = problem.fit_at(truth, problem.first)
    after = problem.stack.residual(fit.run)[fit.samples]
    gap, friction = (recovered(problem, fit, after, item.effect, None) for item in truth)
    assert isinstance(gap, Recovered)
    assert isinstance(friction, Recovered)
    far = np.abs(gap.x) > 5
    assert far.sum() > 10
    spread = (gap.y - np.sign(gap.x) * 3e-5)[far] / gap.deviation[far]
    assert np.sqrt(np.mean(spread**2)) < 1.4
    assert (gap.x_unit, gap.y_unit, gap.path) == ("N", "m", False)
    assert (friction.x_unit, friction.y_unit, friction.path) == ("rad", "N m", True)
    assert np.abs(friction.law).max() == pytest.approx(1.0, rel=0.05)


def test_what_is_unknown_is_shown_against_its_load(simulator, library):
    truth = term(library, BACKLASH, 3e-5, 1.0)
    problem = problem_of(simulator, [truth.effect])
    fit = problem.fit_at((), problem.first)
    after = problem.stack.residual(fit.run)[fit.samples]
    shown = recovered(problem, fit, after, None, local_curve(problem, fit, "leg2/ball_nut", 0))
    assert shown.law is None
    assert shown.curve.max() == pytest.approx(3e-5, rel=0.1)
    assert recovered(problem, fit, after, None, None) is None


def test_what_is_unknown_is_shown_with_what_laws_take_that_nobody_names(simulator, library):
    """The curve is beyond the findings alone; beyond a law that imitates it nothing would be left of it."""
    truth = term(library, BACKLASH, 3e-5, 1.0)
    problem = problem_of(simulator, [truth.effect])
    curve = local_curve(problem, problem.fit_at((), problem.first), "leg2/ball_nut", 0)
    fit = problem.fit_at([truth], problem.first)
    after = problem.stack.residual(fit.run)[fit.samples]
    whole, rest = (recovered(problem, fit, after, None, curve, ins) for ins in ([truth.effect], []))
    assert whole.curve.max() == pytest.approx(3e-5, rel=0.1)
    assert rest is None or np.abs(rest.curve).max() < 1e-5


def test_a_diagnosis_can_be_kept(diagnosed):
    """Pickled and copied with all that is drawn of it; what was simulated is not needed again."""
    _, _, diagnosis = diagnosed
    for again in (pickle.loads(pickle.dumps(diagnosis)), copy.deepcopy(diagnosis)):
        assert again.verdict == diagnosis.verdict
        shown, before = again.findings[0].recovered, diagnosis.findings[0].recovered
        np.testing.assert_array_equal(shown.y, before.y)
        np.testing.assert_array_equal(again.residuals.after, diagnosis.residuals.after)
        assert again.findings[0].effect.values == diagnosis.findings[0].effect.values
