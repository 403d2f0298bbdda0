"""One body or two take the place of all links where held-out blocks are foretold as well, and only there."""

from dataclasses import replace

import numpy as np
import pytest

from prup_pin import load
from prup_pin.diagnosis.efforts.band import band_of, in_motion
from prup_pin.diagnosis.efforts.few_bodies import nearest_body, with_few_bodies, with_law_for_bodies
from prup_pin.diagnosis.efforts.prepare import PreparedEfforts
from prup_pin.diagnosis.efforts.problem import fit
from prup_pin.diagnosis.efforts.search import without_needless_kinds
from prup_pin.dynamics import InMotion, motion_of
from prup_pin.laws import Place
from prup_pin.laws.efforts import Body
from prup_pin.laws.efforts.counterbalance import Counterbalance, CounterbalanceStrut
from prup_pin.recordings import Recording

SHOULDER = "shoulder_lift_joint"


def weighing(at, *factors):
    """Return prepared efforts of a UR5 of which links weigh so many times what they are drawn with."""
    drawn = np.stack([body.toDynamicParameters() for body in list(at.mechanism.model.inertias)[1:]])
    efforts = at.regressor.reshape(len(at), 6, -1) @ (drawn * np.array(factors)[:, None]).ravel()
    noise = 0.1 * np.random.default_rng(5).normal(size=efforts.shape)
    return PreparedEfforts(at.measuring(efforts + 0.8 * np.sign(at.motion.speed) + noise), {})


def scaled(at, *factors):
    """Return the model of all links' masses, and everything else that most drives have, where links weigh so much."""
    return weighing(at, *factors).start_with_nuisances()


def bodies(model):
    """The bodies of a model by name, with what each first number is."""
    x, _ = fit(model)
    return {term.place.name: float(x[model.slice_of(term)][0]) for term in model.terms if term.law.of_bodies}


@pytest.mark.slow
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


@pytest.mark.slow
def test_no_body_does_a_share_of_what_all_links_do_not(at):
    """Where the links weigh what they are drawn with, free ones may foretell worse: nothing overflows."""
    model = scaled(at, *np.ones(6))
    (links,) = (term for term in model.problem.candidates if term.law.body is Body.ALL_LINKS)
    with np.errstate(all="raise"):
        nearest = nearest_body(model.with_term(links), links)
    assert 0 <= nearest.share < 1
    assert nearest.times < 1.01


def balanced(at, effort):
    """Return prepared efforts of a UR5 as drawn with dry friction and a further effort (N,) at its shoulder."""
    efforts = at.rigid.copy()
    efforts[:, at.driven.index(SHOULDER)] += effort
    noise = 0.1 * np.random.default_rng(5).normal(size=efforts.shape)
    return PreparedEfforts(at.measuring(efforts + 0.8 * np.sign(at.motion.speed) + noise), {})


def at_shoulder(model):
    """The laws of a model at the shoulder that no drive has anyway, with their scanned values and coefficients."""
    x, _ = fit(model)
    there = [term for term in model.terms if term.place.name == SHOULDER and not model.is_nuisance(term)]
    return [(term.law, term.values, x[model.slice_of(term)]) for term in there]


@pytest.mark.slow
def test_a_counterbalance_takes_the_place_of_masses_of_all_links(at):
    """Friction that is held at nothing without it hid that it leaves less than all links: 12 times as much."""
    q = at.position(SHOULDER)
    efforts = balanced(at, 150 * np.cos(q) + 60 * np.sin(q))
    model = with_law_for_bodies(efforts, efforts.start_with_nuisances(), lambda share: None)
    assert not any(term.law.of_bodies for term in model.terms)
    ((law, _, x),) = at_shoulder(model)
    assert type(law) is Counterbalance
    assert x == pytest.approx([150, 60], rel=0.01)


@pytest.mark.slow
def test_a_cylinder_between_two_links_is_told_with_its_dead_centre(at):
    q = at.position(SHOULDER)
    length = np.sqrt(1.0 - 0.8 * np.cos(q + 2.0))
    efforts = balanced(at, np.sin(q + 2.0) * (500.0 - 260.0 / length))
    model = with_law_for_bodies(efforts, efforts.start_with_nuisances(), lambda share: None)
    assert not any(term.law.of_bodies for term in model.terms)
    ((law, values, x),) = at_shoulder(model)
    assert isinstance(law, CounterbalanceStrut)
    assert values["dead_centre"] == pytest.approx(-2.0, abs=0.02)
    assert values["slenderness"] == pytest.approx(0.8, abs=0.05)
    assert x == pytest.approx([-260, 500], rel=0.1)


def test_a_spring_that_hardens_is_no_cylinder(at):
    """A spring that is slack where two links are in line has much the shape of a cubic one, which is unknown."""
    law, q = CounterbalanceStrut(), at.position(SHOULDER)
    noise, place = 0.1 * np.random.default_rng(7).normal(size=len(at)), Place(SHOULDER, CounterbalanceStrut.variant)
    length = np.sqrt(1.0 - 0.8 * np.cos(q + 2.0))

    def found(effort):
        return law.scanned(place, at.knowing(np.zeros_like(at.rigid), at.along(SHOULDER, effort + noise)))

    assert found(np.sin(q + 2.0) * (500.0 - 260.0 / length))
    assert not found(5.0 * (q + 1.0) ** 3)


@pytest.mark.slow
def test_links_that_are_heavier_are_no_counterbalance(at):
    efforts = weighing(at, 1, 1.15, 1, 1.5, 1, 1)
    model = efforts.start_with_nuisances()
    assert with_law_for_bodies(efforts, model, lambda share: None) is model


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    def link(name, mass, centre, inertia):
        moments = f'ixx="{inertia}" iyy="{inertia}" izz="{inertia / 15}" ixy="0" ixz="0" iyz="0"'
        body = f'<origin xyz="0 0 {centre}"/><mass value="{mass}"/><inertia {moments}/>'
        return f'<link name="{name}"><inertial>{body}</inertial></link>'

    def hinge(name, parent, child, height):
        place = f'<parent link="{parent}"/><child link="{child}"/><origin xyz="0 0 {height}"/><axis xyz="0 -1 0"/>'
        return f'<joint name="{name}" type="continuous">{place}</joint>'

    path = tmp_path_factory.mktemp("arm") / "arm.urdf"
    links = link("upper_arm", 1.4, -0.085, 0.02), link("forearm", 0.3, -0.053, 0.001)
    joints = hinge("shoulder", "base", "upper_arm", 0), hinge("elbow", "upper_arm", "forearm", -0.33)
    path.write_text(f'<robot name="arm"><link name="base"/>{"".join((*links, *joints))}</robot>')
    return load(path)


@pytest.mark.parametrize("seed", [5, 15, 20])
def test_rotors_that_are_needless_beside_bodies_stand_in_the_place_of_bodies_that_are_not_needed(arm, seed):
    """Of three periods of a swing, with harmonics in its efforts that no law knows, bodies imitated the rotors, which
    went; in other postures they foretold more than the effort itself.
    """
    rng, time = np.random.default_rng(seed), np.arange(0, 3, 0.01)
    swing = 2 * np.pi * time
    q = {"shoulder": 1.42 + 0.14 * np.sin(swing), "elbow": 0.72 + 0.32 * np.sin(swing + 0.4)}
    motion = motion_of(Recording(time=time, positions=q), arm.mechanism, list(q))
    tau = InMotion.of(arm.mechanism, motion).rigid + [0.9, 0.6] * np.tanh(motion.speed / 0.05)
    tau += [1.5, 0.4] * motion.speed + [0.2, 0.05] * motion.acceleration
    for harmonic in (1, 2, 3):
        size = rng.normal(size=2) * [0.3, 0.15]
        tau += size * np.sin(2 * np.pi * harmonic * motion.time[:, None] + rng.uniform(0, 6, 2))
    tau += 0.05 * rng.normal(size=tau.shape)
    coarse = Recording(time=time, positions={name: np.round(at / 0.005) * 0.005 for name, at in q.items()})
    recording = replace(coarse.select(motion.rows), efforts=dict(zip(q, tau.T, strict=True)))
    at = in_motion(arm.mechanism, recording, band_of(arm.mechanism, recording)[0], [])
    efforts = PreparedEfforts(at, {})
    _, start = efforts.with_learned_variances(efforts.start_with_nuisances())
    kinds = {term.law.physics for term in without_needless_kinds(start).terms}
    assert kinds == {"viscous_friction", "coulomb_friction", "rotor_inertia"}
