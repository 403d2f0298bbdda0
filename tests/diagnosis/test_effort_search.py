"""A search for laws of efforts: what is left beside many fits, combinations of masses, several links at once."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from scipy.signal import butter, sosfiltfilt
from scipy.special import gammaincc

from prup_pin import load
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.conventions import read_logs
from prup_pin.diagnosis.criteria import FALSE_ALARM
from prup_pin.diagnosis.efforts import nonlinear, search
from prup_pin.diagnosis.efforts.evidence import CrossValidation, relative_gain, savings, scores
from prup_pin.diagnosis.efforts.final_state import FinalState
from prup_pin.diagnosis.efforts.inertial import BaseParameters
from prup_pin.diagnosis.efforts.noise import noise_of_efforts
from prup_pin.diagnosis.efforts.prepare import PreparedEfforts
from prup_pin.diagnosis.efforts.problem import EffortCandidate, EffortModel
from prup_pin.diagnosis.efforts.search import with_relieving_laws
from prup_pin.dynamics import InMotion, motion_of
from prup_pin.laws import Place
from prup_pin.laws.efforts.joint_coupling import SpringAcross
from prup_pin.laws.efforts.viscous_friction import Damping
from prup_pin.recordings import Recording
from prup_pin.simulation import simulate
from tests.as_written import as_written
from tests.diagnosis.test_efforts import AXIS, axis, device


@pytest.fixture(scope="module")
def efforts():
    robot = load(AXIS)
    recording = axis(damping=200.0, limit=20.0)
    at = InMotion.of(robot.mechanism, motion_of(recording, robot.mechanism))
    return PreparedEfforts(at, {"mass": 0.05})


@pytest.fixture(scope="module")
def start(efforts):
    return efforts.start()


def named(model, physics):
    return next(candidate for candidate in model.problem.candidates if candidate.law.physics == physics)


def test_one_term_more_is_what_a_fit_with_it_leaves(start):
    model = start.with_term(named(start, "viscous_friction"))
    more = [named(model, word) for word in ("coulomb_friction", "effort_offset", "stribeck_friction")]
    for term, left in zip(more, CrossValidation(model).with_each(more), strict=True):
        assert left == pytest.approx(CrossValidation(model.with_term(term)).squares, rel=1e-5)


def test_a_problem_that_is_extended_anew_forgets_what_extended_it_before(efforts, start):
    """A law's other values that were tried and given up leave nothing behind."""
    problem, term = start.problem, next(one for one in start.problem.candidates if one.law.free(one.values))
    more, less = (term.law.scaled(term.values, [times] * len(term.law.free(term.values))) for times in (2.0, 0.5))

    def left(*tried):
        for values in tried:
            columns = efforts.columns_at(term.law, term.place, values, efforts.at)
            wider, (other,) = efforts.extended(problem, [columns])
        assert other.where.stop == len(wider.prior)
        return CrossValidation(start.in_problem(wider)).with_each([other])[0], savings(start.in_problem(wider))[-1].gain

    again, alone = left(more, more, less), left(less)
    assert again[0] == pytest.approx(alone[0], rel=1e-12)
    assert again[1] == pytest.approx(alone[1], rel=1e-12)


def test_one_term_less_is_what_a_fit_without_it_leaves(start):
    model = start
    for word in ("viscous_friction", "coulomb_friction", "effort_offset"):
        model = model.with_term(named(model, word))
    for term, left in zip(model.terms, CrossValidation(model).without_each(model.terms), strict=True):
        assert left == pytest.approx(CrossValidation(model.without(term)).squares, rel=1e-6)


def test_friction_that_was_held_at_nothing_is_free_beside_what_hid_it_and_held_again_without():
    """One way only, an offset hides friction: alone that would be negative."""
    time = np.arange(3000) * 0.004
    v = 0.02 + 0.01 * np.cos(2.9 * time)
    q = np.cumsum(v) * 0.004 - 0.12
    tau = -95 * 0.029 * np.sin(2.9 * time) + 400 * v - 30 + np.random.default_rng(1).normal(size=len(time))
    recording, mechanism = (
        Recording(time=time, positions={"carriage": q}, efforts={"carriage": tau}),
        load(AXIS).mechanism,
    )
    start = PreparedEfforts(InMotion.of(mechanism, motion_of(recording, mechanism)), {}).start()
    friction, offset = named(start, "viscous_friction"), named(start, "effort_offset")
    both = start.with_term(friction, offset)
    alone = CrossValidation(start.with_term(friction))
    assert all(friction.where.start in alone.where[fold.held] for fold in alone.folds)
    assert alone.with_each([offset])[0] == pytest.approx(CrossValidation(both).squares, rel=1e-5)
    assert CrossValidation(both).without_each([offset])[0] == pytest.approx(alone.squares, rel=1e-6)


def test_the_threshold_is_the_quantile_of_the_best_candidate_of_each_flip(start):
    of = savings(start.with_term(named(start, "viscous_friction")))
    ranked, limit = scores(of)
    logs = np.log([gammaincc(one.freedom / 2, one.saved / 2) for one in of])
    assert limit == np.quantile(logs[:, :-1].min(axis=0), FALSE_ALARM)
    assert [one.log_chance for one in ranked if one.candidate.law.looked_at == 1] == pytest.approx(
        [log for log, one in zip(logs[:, -1], of, strict=True) if one.candidate.law.looked_at == 1]
    )


def test_friction_of_another_size_backwards_may_follow_one_that_is_alike_both_ways():
    """Beside the latter it is only told by how the two ways differ, one up and one down: no sign that it cannot be."""
    robot, recording = load(AXIS), axis(3000, damping=200.0)
    backwards = np.minimum(np.gradient(recording.positions["carriage"], recording.time), 0.0)
    tau = recording.efforts["carriage"] + 160.0 * backwards
    recording = recording.with_measurements(efforts={"carriage": tau})
    efforts = PreparedEfforts(InMotion.of(robot.mechanism, motion_of(recording, robot.mechanism)), {})
    start = efforts.start()
    ranked, _ = scores(savings(start.with_term(named(start, "viscous_friction"))))
    (directed,) = (score for score in ranked if score.candidate.place.aspect == "effort by direction")
    assert directed.possible
    assert directed.gain > 0.5 * max(score.gain for score in ranked)


def test_what_is_left_by_joint_is_all_that_is_left(start):
    validation = CrossValidation(start.with_term(named(start, "viscous_friction")))
    assert validation.by_joint.sum() == pytest.approx(validation.squares.sum(), rel=1e-9)


def test_columns_that_are_picked_keep_their_products(start):
    problem = start.problem
    columns = problem.columns
    other = [0, 3, 2]
    folded, moment = columns.folded[:, other][:, :, other].copy(), columns.moment[:, other].copy()
    left = columns.residual(other, np.array([1.0, -2.0, 0.5]))
    columns.pick(other)
    assert np.array_equal(columns.folded, folded)
    assert np.array_equal(columns.moment, moment)
    assert columns.residual(range(3), np.array([1.0, -2.0, 0.5])) == pytest.approx(left, abs=1e-12)


def test_combinations_say_all_that_a_motion_tells():
    rng = np.random.default_rng(2)
    base = rng.normal(size=(50, 3))
    regressor = np.column_stack([base[:, 0], np.zeros(50), base[:, 1], 2 * base[:, 0] - 0.5 * base[:, 2], base[:, 2]])
    told = BaseParameters.of(regressor, ["a.mass", "a.mx", "b.mass", "b.mx", "b.my"])
    x = rng.normal(size=5)
    assert len(told.names) == 3
    assert regressor[:, told.leads] @ (told.matrix @ x) == pytest.approx(regressor @ x, abs=1e-9)
    assert told.silent == ("a.mx",)
    assert "b.mx + 0.5 a.mass" in told.names


def test_every_tolerance_of_a_motion_is_a_parameter():
    robot = load(AXIS)
    at = InMotion.of(robot.mechanism, motion_of(axis(damping=200.0, limit=20.0), robot.mechanism))
    declared = {"mass": 0.05, "inertia": 0.1, "effort_gain": 0.02, "effort_bias": 1.0}
    deviations = PreparedEfforts(at, declared).deviations
    kinds = [base.law.tolerance or "mass" for base in deviations]
    assert sorted(kinds) == sorted(set(declared) - {"inertia"})  # a slide turns nothing
    for kind, base in zip(kinds, deviations, strict=True):
        assert base.tolerance == pytest.approx(declared[kind] * (base.nominal if base.inertial is not None else 1))
    (mass,) = (base for base in deviations if base.inertial is not None)
    rigid = at.rigid - PreparedEfforts(at, {"mass": 1e-6}).deviations[0].efforts * 1e6  # the axis without its one mass
    assert np.abs(rigid).max() < 1e-9 * np.abs(at.rigid).max()
    assert mass.efforts == pytest.approx(0.05 * at.rigid)


def test_no_parameter_is_taken_beyond_what_it_can_be():
    """A spring at one joint alone is one across two joints at an endless ratio."""
    robot = load("ur5")
    place = Place("wrist_2_joint", f"{SpringAcross.beginning}wrist_1_joint")
    for ratio, step, end in ((-9.0, -1.0, -10.0), (9.0, 1.0, 10.0), (2.0, 0.5, 2.0 * np.exp(0.5))):
        term = EffortCandidate(SpringAcross(), place, {"ratio": ratio}, slice(0, 2))
        assert nonlinear.scaled_within(term, np.array([step]), robot.mechanism)["ratio"] == pytest.approx(end)


@pytest.mark.slow
def test_a_zero_point_is_not_all_links(tmp_path):
    """A light arm: beside a coupled wrist an offset at its third joint drives the masses of several links."""
    recording, _ = device(tmp_path, 7708, "kinova", ["transmission_coupling", "effort_offset"])
    found = diagnose(load(recording.robot), recording)
    named = {(finding.physics, finding.location) for finding in found.findings}
    assert named == {("transmission_coupling", "j2s6s200_joint_6"), ("effort_offset", "j2s6s200_joint_3")}


def test_what_had_come_to_make_up_for_a_law_that_relieves_tolerances_goes_with_it():
    robot, recording = load(AXIS), axis(2000, damping=200.0)
    heavier = np.gradient(np.gradient(recording.positions["carriage"], recording.time), recording.time)
    tau = recording.efforts["carriage"] + 40.0 * np.convolve(heavier, np.ones(25) / 25, "same")
    recording = recording.with_measurements(efforts={"carriage": tau})
    efforts = PreparedEfforts(InMotion.of(robot.mechanism, motion_of(recording, robot.mechanism)), {"mass": 0.01})
    model, friction = efforts.start(), "viscous_friction"
    model = model.with_term(named(model, friction)).with_term(named(model, "counterbalance"))
    found = with_relieving_laws(efforts, model)
    assert {term.law.physics for term in found.terms} - {friction} == {"rotor_inertia"}
    assert friction in {term.law.physics for term in found.terms}


def test_a_law_that_comes_back_as_often_as_it_is_needless_ends_the_search(monkeypatch):
    """Whatever was refused before."""
    coming = EffortCandidate(Damping(), Place("a", "effort"), {}, slice(0, 1))
    monkeypatch.setattr(search, "_forward", lambda efforts, model, *rest: model.with_term(coming))
    monkeypatch.setattr(search, "pruned", lambda model, doubtful: model.with_terms(()))
    assert search.searched(None, EffortModel(None, ()), print).terms == ()


def test_a_saving_in_every_block_is_sure_though_one_of_them_holds_most():
    rng = np.random.default_rng(8)
    before = rng.chisquare(30, 40)
    before[7] = 1e5
    share, sure = relative_gain(before, 0.4 * before)
    assert share == pytest.approx(0.6)
    assert sure > 100
    share, sure = relative_gain(before, before * np.where(np.arange(40) == 7, 0.4, rng.uniform(0.8, 1.25, 40)))
    assert share > 0.5
    assert sure < 2


def test_a_law_is_needless_that_may_be_nothing_by_its_own_uncertainty():
    robot, recording = load(AXIS), axis(3000, damping=200.0)
    efforts = PreparedEfforts(InMotion.of(robot.mechanism, motion_of(recording, robot.mechanism)), {})
    model = efforts.start()
    for word in ("viscous_friction", "effort_offset"):
        model = model.with_term(named(model, word))
    noise = noise_of_efforts(recording, efforts.at.driven)
    final = FinalState(robot, recording, efforts, noise, model, (), ())
    friction, offset = model.terms
    assert final.p_value(friction) < 1e-6
    assert final.p_value(offset) > 0.05
    final.laws = list(model.terms)
    assert final.needless is offset


@pytest.mark.slow
def test_one_law_stands_for_several_that_do_not_earn_what_they_have_more(tmp_path):
    """Efforts of all drives that are late alike are one lag of the log, and none of each drive."""
    recording, _ = device(tmp_path, 7708, "ur5", [])
    late = round(0.02 / float(np.median(np.diff(recording.time))))
    joints = recording.efforts
    recording = recording.select(slice(late, None)).with_measurements(
        efforts={name: values[:-late] for name, values in joints.items()}
    )
    robot = load(recording.robot)
    at = InMotion.of(robot.mechanism, motion_of(recording, robot.mechanism))
    efforts = PreparedEfforts(at, {})
    model = efforts.start()
    for candidate in model.problem.candidates:
        single = candidate.law.physics == "effort_delay" and candidate.place.name in at.driven[:3]
        if single and candidate.values["age"] == 16e-3:
            model = model.with_term(candidate)
    assert len(model.terms) == 3
    found = search._simpler(efforts, model)
    assert [term.name for term in found.terms] == [("effort_delay", "robot")]


YAW = """<robot name="yaw"><link name="base"/><joint name="yaw" type="revolute"><parent link="base"/><child link="arm"/>
<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="50" velocity="10"/></joint><link name="arm"><inertial>
<origin xyz="0.15 0 0"/><mass value="2"/><inertia ixx="1e-3" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial>
</link></robot>"""


def test_friction_far_beyond_its_prior_stays_where_much_else_is_left(tmp_path):
    """Efforts of another unit, beside a wandering one: its prior held friction back where weights are plain alone."""
    (tmp_path / "yaw.urdf").write_text(YAW)
    rng, t = np.random.default_rng(0), np.arange(0, 3, 0.005)
    slow, fast = 2 * np.pi / 2.6, 2 * np.pi / 1.13
    q = 0.5 * np.sin(slow * t + 0.5) + 0.2 * np.sin(fast * t)
    speed = 0.5 * slow * np.cos(slow * t + 0.5) + 0.2 * fast * np.cos(fast * t)
    wandering = 0.105 * np.cumsum(rng.normal(size=len(t)))
    tau = 20 * np.tanh(speed / 0.7) + wandering + 0.02 * rng.normal(size=len(t))
    recording = Recording(time=t, positions={"yaw": q + 1e-5 * rng.normal(size=len(t))}, efforts={"yaw": tau})
    found = diagnose(load(tmp_path / "yaw.urdf"), recording)
    friction = found.findings[0]
    assert friction.physics == "coulomb_friction"
    assert friction.parameters["limit"].value == pytest.approx(19.29, rel=5e-3)  # truly 20, beside what wanders


def one_way(seed):
    """A slow motion of an arm whose masses are 15 % off and whose gears ripple by more than they rub, and the next one,
    which turns back, without ripple.
    """
    drawn = load("ur5").mechanism.model
    arm, rng, t = drawn.copy(), np.random.default_rng(seed), np.arange(0, 6, 0.008)
    for body in range(1, 7):
        drawn_as = drawn.inertias[body]
        mass = drawn_as.mass * (1 + 0.15 * rng.normal())
        arm.inertias[body] = pin.Inertia(mass, drawn_as.lever, drawn_as.inertia)
    middle, swing = rng.uniform(-1.2, 1.2, 6), rng.uniform(0.3, 0.9, 6) * rng.choice([-1, 1], 6)
    rate, phase = 0.8 * rng.uniform(0.7, 1.1, 6), rng.uniform(-1.3, -1.1, 6)
    friction = rng.uniform(0.5, 1.5, 6) * np.array([6, 6, 6, 2, 2, 2])
    angle = np.outer(t, rate) + phase
    q, v, a = middle + swing * np.sin(angle), swing * rate * np.cos(angle), -swing * rate**2 * np.sin(angle)
    data = arm.createData()
    tau = np.array([pin.rnea(arm, data, *state) for state in zip(q, v, a, strict=True)]) + friction * np.tanh(v / 0.02)
    ripple = sosfiltfilt(butter(2, (1, 3), "band", fs=125, output="sos"), rng.normal(size=(2000, 6)), axis=0)[300:1050]
    rippled = tau + 2.5 * friction * ripple / ripple.std(axis=0) + 0.02 * rng.normal(size=tau.shape)
    q = q + 1e-5 * rng.normal(size=q.shape)
    names = list(drawn.names[1:])
    return [
        Recording(
            time=t[rows],
            positions=dict(zip(names, q[rows].T, strict=True)),
            efforts=dict(zip(names, efforts[rows].T, strict=True)),
        )
        for rows, efforts in ((slice(0, 375), rippled), (slice(375, None), tau))
    ]


@pytest.mark.slow
def test_friction_of_which_no_joint_is_sure_alone_foretells_the_next_motion():
    """Nothing is surely there of any drive by itself: the drawing alone leaves 27 % of the next motion."""
    robot, (slow, following) = load("ur5"), one_way(1)
    found = diagnose(robot, as_written(slow, "q tau"))
    predicted = simulate(robot, following, found.effects)
    left, whole = 0.0, 0.0
    for name, efforts in following.efforts.items():
        turns = np.abs(np.gradient(following.positions[name], following.time)) > 0.05
        turns &= np.isfinite(predicted.efforts[name])
        left += float(((efforts - predicted.efforts[name])[turns] ** 2).sum())
        whole += float((efforts[turns] ** 2).sum())
    assert np.sqrt(left / whole) < 0.15


def scaled(log, times):
    """Return a log in another unit, with some noise."""
    rng = np.random.default_rng(5)
    efforts = {name: times * (tau + 0.02 * rng.normal(size=len(tau))) for name, tau in log.efforts.items()}
    return replace(log, efforts=efforts)


@pytest.mark.slow
def test_two_joints_that_carry_the_arm_tell_the_unit_of_all_its_efforts():
    """Of a slow motion no other joint tells any: turned signs and other zeros were found that leave a fifth."""
    first = read_logs(load("ur5"), scaled(one_way(3)[1], 1 / 7)).findings()[0]
    assert "tau so many times the effort: A, per cent of a rating (0.128)" in first.statement


@pytest.mark.slow
@pytest.mark.parametrize("times", [1, 3])
def test_a_robot_much_heavier_than_its_drawing_may_be_a_log_in_another_unit(times):
    """Masses of all links that are three times as large are said to be what a unit looks like, where none is asked."""
    log = as_written(scaled(one_way(2)[1], times), "q tau")
    told = [text for text in diagnose(load("ur5"), log).remarks if "as heavy as" in text]
    assert len(told) == (times == 3)
    assert all("2.8 times" in text and '"effort_gain": 1' in text for text in told)
