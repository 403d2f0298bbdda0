"""A load that is taken up or put down while it is recorded is told with its moment, its mass and its joints."""

from types import SimpleNamespace

import numpy as np
import pytest

from prup_pin.diagnosis.efforts.prepare import PreparedEfforts
from prup_pin.diagnosis.efforts.unexplained import load_change
from prup_pin.laws.efforts import Body

MOMENT = 7.0


def left_by(at, mass, drift=0.0):
    """Return what `load_change` reads of a final state that explains nothing; mass (N,): held, 8 cm before the tool."""
    tool = at.mechanism.need_tool()
    still = at.measuring(np.zeros_like(at.rigid))
    problem = PreparedEfforts(still, {}).start().problem
    held = next(term for term in problem.candidates if term.law.body is Body.HELD)
    columns = held.law.efforts_per(held.place, held.values, at)
    assert held.place.name == tool.name
    added = columns @ np.array([1.0, 0, 0, 0.08, 0.0064, 0, 0.0064, 0, 0, 0]) * np.asarray(mass)[:, None]
    noise = 0.1 * np.random.default_rng(5).normal(size=added.shape)
    time = at.motion.time[:, None]
    efforts = PreparedEfforts(at.measuring(at.rigid + added + noise + drift * time), {})
    return SimpleNamespace(
        problem=problem,
        motion=at.motion,
        at=at,
        efforts=efforts,
        explained=np.zeros_like(efforts.target),
        noise_sizes=np.full(6, 0.1),
    )


@pytest.mark.parametrize("mass", [2.0, -0.8])
def test_a_load_that_is_taken_up_or_put_down_is_told_with_its_moment(at, mass):
    found = load_change(left_by(at, np.where(at.motion.time < MOMENT, 0.0, mass)))
    assert found.time == pytest.approx(MOMENT, abs=0.1)
    assert found.mass == pytest.approx(mass, rel=0.05)
    assert {"shoulder_lift_joint", "elbow_joint"} <= set(found.joints)
    assert found.share > 0.95


def test_a_load_that_stays_and_a_drift_are_no_change_of_load(at):
    assert load_change(left_by(at, np.full(len(at), 2.0))) is None
    assert load_change(left_by(at, np.zeros(len(at)), drift=0.5)) is None
