"""One body or two take the place of all links where held-out blocks are foretold as well, and only there."""

import numpy as np
import pytest

from prup_pin.diagnosis.efforts.few_bodies import nearest_body, with_few_bodies
from prup_pin.diagnosis.efforts.prepare import PreparedEfforts
from prup_pin.diagnosis.efforts.problem import fit
from prup_pin.laws.efforts import Body


def scaled(at, *factors):
    """Return the model of all links' masses, and everything else that most drives have, where links weigh so much."""
    drawn = np.stack([body.toDynamicParameters() for body in list(at.mechanism.model.inertias)[1:]])
    efforts = at.regressor.reshape(len(at), 6, -1) @ (drawn * np.array(factors)[:, None]).ravel()
    noise = 0.1 * np.random.default_rng(5).normal(size=efforts.shape)
    return PreparedEfforts(at.measuring(efforts + 0.8 * np.sign(at.motion.speed) + noise), {}).start_with_nuisances()


def bodies(model):
    """The bodies of a model by name, with what each first number is."""
    x, _ = fit(model)
    return {term.place.name: float(x[model.slice_of(term)][0]) for term in model.terms if term.law.of_bodies}


def test_two_links_that_are_heavier_are_told_apart_from_a_third_one_that_takes_nearly_as_much_away(at):
    """The forearm alone took 97 % of the squares away, and was the one that was to be weighed."""
    model = scaled(at, 1, 1.15, 1, 1.5, 1, 1)
    (term,) = (term for term in model.terms if term.law.body is Body.ALL_LINKS)
    near = nearest_body(model, term)
    assert near.share > 0.9
    assert not near.do
    assert near.times > 1.5
    found = bodies(with_few_bodies(model))
    assert found == pytest.approx({"upper_arm_link": 0.15, "wrist_1_link": 0.5}, rel=0.1)


def test_one_link_that_is_heavier_is_told_alone(at):
    found = bodies(with_few_bodies(scaled(at, 1, 1, 1.3, 1, 1, 1)))
    assert found == pytest.approx({"forearm_link": 0.3}, rel=0.05)


def test_links_that_are_all_others_stay_all(at):
    model = scaled(at, 1.2, 0.85, 1.2, 0.7, 1.4, 0.8)
    assert with_few_bodies(model) is model


def test_no_body_does_a_share_of_what_all_links_do_not(at):
    """Where the links weigh what they are drawn with, free ones may foretell worse: nothing overflows."""
    model = scaled(at, *np.ones(6))
    (links,) = (term for term in model.problem.candidates if term.law.body is Body.ALL_LINKS)
    with np.errstate(all="raise"):
        nearest = nearest_body(model.with_term(links), links)
    assert 0 <= nearest.share < 1
    assert nearest.times < 1.01
