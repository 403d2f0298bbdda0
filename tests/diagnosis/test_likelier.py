"""Which of several laws is the likelier: bodies by what bodies there are, columns however they are combined."""

import numpy as np
import pytest

from prup_pin import load
from prup_pin.diagnosis.efforts.bayes_factors import held_body, other_link
from prup_pin.diagnosis.efforts.evidence import savings, scores
from prup_pin.diagnosis.efforts.prepare import PreparedEfforts
from prup_pin.diagnosis.efforts.problem import block_squares, fit
from prup_pin.diagnosis.efforts.search import strain
from prup_pin.diagnosis.normal_equations import identifiable
from prup_pin.dynamics import InMotion, in_frame, motion_of
from prup_pin.dynamics.inertial import of_pseudo_inertia, pseudo_inertia

from .test_efforts import AXIS, axis


def ball(mass, centre, radius):
    """Return the inertial parameters (10,) of a ball."""
    pseudo = np.outer([*centre, 1.0], [*centre, 1.0])
    pseudo[:3, :3] += 0.2 * radius**2 * np.eye(3)
    return of_pseudo_inertia(mass * pseudo)


@pytest.fixture(scope="module")
def wrist():
    """Return a robot, the joint of its tool, and the drawn parameters of what that carries."""
    mechanism = load("ur5").mechanism
    joint = mechanism.need_tool().joint
    return mechanism, joint, mechanism.model.inertias[joint].toDynamicParameters()


def told(change, off):
    """Return what data say of a change (10,) whose numbers are known to within `off` (10,)."""
    information = np.diag(1 / np.asarray(off) ** 2)
    return information, information @ change


OFF = [0.02, *3 * [0.002], *6 * [0.001]]


def log_bayes_factors(wrist, about_the_tool):
    """Return the logarithm of how much likelier a held body is than another link, by a change about the tool."""
    mechanism, joint, _ = wrist
    moved = in_frame(mechanism.need_tool().placement)
    information, _ = told(np.zeros(10), OFF)
    held = held_body(mechanism, information, information @ about_the_tool)
    back = np.linalg.inv(moved)
    whole, _ = other_link(mechanism, joint, 6, back.T @ information @ back, back.T @ information @ about_the_tool)
    return held - whole


def about_the_tool(wrist, change):
    return np.linalg.solve(in_frame(wrist[0].need_tool().placement), change)


@pytest.mark.parametrize(
    ("mass", "centre"), [(0.4, (0.03, 0.0, 0.05)), (1.5, (0.0, -0.04, 0.1)), (3.0, (0.0, 0.0, 0.0))]
)
def test_a_body_of_its_own_near_the_tool_is_held_by_it(wrist, mass, centre):
    assert log_bayes_factors(wrist, ball(mass, centre, 0.04)) > 3


@pytest.mark.parametrize("share", [-0.6, 0.8, 2.0])
def test_a_link_off_in_proportion_is_another_link(wrist, share):
    assert log_bayes_factors(wrist, about_the_tool(wrist, share * wrist[2])) < -3


def test_a_link_whose_centre_is_elsewhere_is_another_link(wrist):
    """No mass is added: what moved is drawn already."""
    moved = np.eye(4)
    moved[:3, 3] = 0.12, -0.08, 0.08
    change = of_pseudo_inertia(moved @ pseudo_inertia(wrist[2]) @ moved.T) - wrist[2]
    assert log_bayes_factors(wrist, about_the_tool(wrist, change)) < -3


def test_a_score_counts_the_tolerances_that_a_law_takes_back():
    """A carriage whose mass is known to a hair, with friction that would like it to be another."""
    robot = load(AXIS)
    at = InMotion.of(robot.mechanism, motion_of(axis(1500, damping=200.0, limit=20.0), robot.mechanism))
    efforts = PreparedEfforts(at, {"mass": 0.0005})
    start = efforts.start()
    ranked, _ = scores(savings(start))

    def lost(model):
        x, _ = fit(model)
        return float(block_squares(model, x).sum() + (strain(model) ** 2).sum())

    assert (strain(start) > 1).any()
    plain = [score for score in ranked if not score.candidate.law.one_sided]
    assert len(plain) > 5
    for score in sorted(plain, key=lambda item: -item.gain)[:3]:
        assert score.gain == pytest.approx(lost(start) - lost(start.with_term(score.candidate)), rel=1e-6)


def test_what_columns_tell_does_not_hang_on_how_they_are_combined():
    """A line about a place far off, and about its middle."""
    rng = np.random.default_rng(5)
    q, beside = 2.8 + 0.05 * rng.normal(size=60), rng.normal(size=(60, 3))
    beside[:, 0] = 1 + 0.1 * rng.normal(size=60)
    kept = []
    for columns in (np.column_stack([q, np.ones(60)]), np.column_stack([q - 2.8, np.ones(60)])):
        free = columns - beside @ np.linalg.lstsq(beside, columns, rcond=None)[0]
        basis = identifiable(free.T @ free, columns.T @ columns, 1e-4, 60.0)
        assert basis.shape == (2, 2)
        assert basis.T @ (free.T @ free) @ basis == pytest.approx(np.eye(2), abs=1e-8)
        kept.append(free @ basis @ (free @ basis).T)
    assert kept[0] == pytest.approx(kept[1], abs=1e-8)
