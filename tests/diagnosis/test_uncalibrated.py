"""Robots with loops of which everything is off, told nothing: what is off by how much, and what they do elsewhere."""

from __future__ import annotations

import importlib
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.account import Account
from prup_pin.diagnosis.search import Selection
from prup_pin.diagnosis.variance_components import SensorEquations, estimated, unusual
from prup_pin.laws import Effect
from prup_pin.laws.payload import Payload
from prup_pin.recordings import Noise, read_recording
from prup_pin.simulation import simulate

from ..reference.concealed.rotations import matrix
from ..reference.concealed.uncalibrated import KINDS, Oracle, apart, draw_uncalibrated, write

whole = importlib.import_module("prup_pin.diagnosis.diagnose")
ROBOTS = Path(__file__).parents[1] / "robots"
#: Where the tracker stands is no error of the robot.
FRAME = {"frame_position", "frame_rotation"}


def read(drawn, folder):
    """Return the robot and its two recordings."""
    name = KINDS[drawn["robot"]].file
    robot = prup_pin.load(name if name == drawn["robot"] else ROBOTS / name)
    write(drawn, folder / "out", folder / "sealed", "device")
    return robot, *(read_recording(folder / "out" / f"device{part}.csv") for part in ("", ".heldout"))


def asked(robot, recording):
    with threadpool_limits(1, user_api="blas"):
        return importlib.import_module("prup_pin.diagnosis.prepare").prepare(
            robot, recording, lambda stage, share: None
        )


def left(drawn, robot, heldout, effects) -> float:
    """Return what is left of the held-out poses, in multiples of the noise."""
    told = simulate(robot, heldout, effects)
    record = {"p": told.position, "R": matrix(told.rotation)}
    return float(np.sqrt(np.mean(np.square(apart(drawn["heldout"], record, drawn["noise"], drawn["turns"])))))


@pytest.mark.slow
def test_a_hexapod_that_nobody_has_calibrated(tmp_path):
    drawn = draw_uncalibrated(2, "six_ups")
    robot, recording, heldout = read(drawn, tmp_path)
    given = asked(robot, recording)
    actual, kinds = drawn["actual"], given.spread.kinds
    assert set(kinds) - FRAME <= set(actual)
    for kind in ("encoder_offset", "position"):
        assert kinds[kind] == pytest.approx(actual[kind], rel=0.6)
    assert given.problem.noise.source == "residual"
    assert given.problem.noise.position == pytest.approx(drawn["noise"]["position"], rel=0.25)
    problem = given.within_tolerances(given.problem)
    effects = [*problem.tolerances.at(problem.first.x), *given.placed.every]
    assert left(drawn, robot, heldout, effects) < 1.3 < 1000 < left(drawn, robot, heldout, [])


@pytest.mark.slow
def test_what_is_off_all_over_shows_under_loads(tmp_path):
    drawn = draw_uncalibrated(10, "six_ups")
    assert drawn["loaded"]
    robot, recording, _ = read(drawn, tmp_path)
    assert asked(robot, recording).spread is None  # laws are looked for first
    with threadpool_limits(1, user_api="blas"):
        drawn_problem = importlib.import_module("prup_pin.diagnosis.prepare").drawn_problem
        posed = drawn_problem(robot, recording, lambda stage, share: None)
        given = posed.prepared(posed.spread.all_over())
    actual, kinds = drawn["actual"], given.spread.kinds
    assert set(kinds) - FRAME <= set(actual)
    for kind in ("encoder_offset", "position"):
        assert kinds[kind] == pytest.approx(actual[kind], rel=0.6)
    noise = given.problem.noise
    assert noise.position == pytest.approx(drawn["noise"]["position"], rel=0.25)
    assert noise.rotation == pytest.approx(drawn["noise"]["rotation"], rel=0.25)


@pytest.mark.slow
def test_a_loaded_robot_that_nobody_has_calibrated(tmp_path):
    drawn = draw_uncalibrated(10, "six_ups")
    loaded, recording, heldout = read(drawn, tmp_path)
    found = diagnose(loaded, recording)
    assert found.verdict == "explained"
    assert left(drawn, loaded, heldout, found.effects) < 1.1 * Oracle(drawn).left_over()


def test_what_one_law_explains_under_loads_is_not_off_all_over(tmp_path):
    robot, recording, _ = read(draw_uncalibrated(10, "six_ups"), tmp_path)
    told = simulate(robot, recording, [Effect(Payload(), Payload().places(robot.mechanism)[0], {"mass": 50.0})])
    draw = np.random.default_rng(0)
    position = told.position + 1e-6 * draw.standard_normal(told.position.shape)
    noise = Noise(position=1e-6, rotation=5e-5)
    recording = replace(recording, position=position, rotation=None, noise=noise)
    found = diagnose(robot, recording)
    assert {item.physics for item in found.findings} <= {"payload", "self_weight"}
    assert found.verdict == "explained"


def test_what_two_preparations_leave_is_weighed_by_one_noise(tmp_path):
    robot, recording, _ = read(draw_uncalibrated(10, "six_ups"), tmp_path)
    given = asked(robot, recording)
    noise = replace(given.problem.noise, position=2e-4, rotation=1e-4)
    found = []
    for own in (given.problem.noise, replace(given.problem.noise, position=3e-5, rotation=3e-2), noise):
        problem = replace(given.problem, noise=own)
        nothing = Selection.nothing(problem.first, given.library)
        found.append(Account(given, problem, nothing).by_noise(noise))
    chi2 = problem.first.chi2
    assert found == [(pytest.approx(chi2, rel=1e-9), False)] * 3
    loud = replace(noise, position=1.0, rotation=1.0)
    assert Account(given, problem, nothing).by_noise(loud)[1]


@pytest.mark.parametrize(
    ("again", "few", "more"),
    [
        ((30.0, True), (90.0, False), True),  # noise, where few laws leave more: by a noise that nothing else tells
        ((30.0, True), (29.0, False), False),  # blocks held out say otherwise
        ((300.0, True), (900.0, False), False),  # it follows the poses that it was fitted to, and no others
        ((30.0, True), (40.0, True), False),  # few laws do as well
        ((300.0, False), (900.0, False), False),  # neither explains it: a law may be missing
        ((80.0, False), (900.0, False), True),
    ],
)
def test_what_is_off_all_over_takes_the_place_of_few_laws(again, few, more):
    def searched(told):
        return SimpleNamespace(noise=None, size=30, is_clean=told[1], by_noise=lambda noise: told)

    assert whole._explains_more(searched(again), searched(few)) is more


NEAR = {"far": True, "one_more": True, "of_few": {}}
FAR = {"far": True, "one_more": False, "of_few": {}}


@pytest.mark.parametrize(
    ("few_laws", "larger_noise", "one_law", "searches"),
    [
        ((30.0, True), False, NEAR, ["few laws"]),  # two single faults are not everything at once
        ((30.0, True), True, NEAR, ["few laws", "all over"]),  # what they leave was taken for noise
        ((900.0, False), False, NEAR, ["few laws", "all over"]),
        ((900.0, False), False, FAR, ["all over"]),  # no law comes near what is off all over
        ((900.0, False), False, {**FAR, "of_few": {"position": 1e-3}}, ["few laws", "all over"]),  # several may
        ((900.0, False), False, {**FAR, "far": False}, ["few laws", "all over"]),  # noise is much of what is left
    ],
)
def test_few_laws_that_leave_the_declared_noise_are_the_answer(few_laws, larger_noise, one_law, searches, monkeypatch):
    def account(called, told, noise, **more):
        problem = SimpleNamespace(noise=noise)
        return SimpleNamespace(
            called=called, problem=problem, noise=noise, size=30, is_clean=told[1], by_noise=lambda _: told, **more
        )

    asked_for = []

    def search(begun, tell, most=60):
        asked_for.append(begun.called)
        few = begun.called == "few laws"
        told, noise = (few_laws, 2.0 if larger_noise else 1.0) if few else ((1.0, True), 1.0)
        return account(begun.called, told, noise, selection=SimpleNamespace(fits=1))

    other = SimpleNamespace(spread=SimpleNamespace(of_few=one_law["of_few"]))
    monkeypatch.setattr(whole, "_all_over", lambda *_: account("all over", (30.0, False), 1.0, prepared=other))
    first = account(
        "few laws", (900.0, False), 1.0, is_far_from_clean=one_law["far"], lacks_few_laws=one_law["one_more"]
    )
    monkeypatch.setattr(whole, "with_first_law", lambda *_: first)
    monkeypatch.setattr(whole, "searched", search)
    chosen = whole._under_loads(SimpleNamespace(prepared=lambda: None), lambda *_: None)
    assert asked_for == searches
    assert chosen.called == searches[-1]


def test_where_neither_explains_it_what_is_off_all_over_is_asked_beside_the_few_laws(monkeypatch):
    def account(called, left, is_clean):
        return SimpleNamespace(
            called=called,
            problem=SimpleNamespace(noise=1.0),
            noise=1.0,
            size=30,
            is_clean=is_clean,
            is_far_from_clean=False,
            by_noise=lambda _: (left, is_clean),
            prepared=SimpleNamespace(outliers=()),
            selection=SimpleNamespace(fits=1),
        )

    left = {"few laws": (900.0, False), "all over": (800.0, False), "both": (30.0, True)}
    monkeypatch.setattr(whole, "_all_over", lambda *_: account("all over", 800.0, False))
    monkeypatch.setattr(whole, "_beside", lambda drawn, few, tell: account("both", 30.0, True))
    monkeypatch.setattr(whole, "with_first_law", lambda *_: account("few laws", 900.0, False))
    monkeypatch.setattr(whole, "searched", lambda begun, tell, most=60: account(begun.called, *left[begun.called]))
    assert whole._under_loads(SimpleNamespace(prepared=lambda: None), lambda *_: None).called == "both"


@pytest.mark.slow
@pytest.mark.parametrize(("robot", "seed"), [("delta", 4), ("3prup", 4)])
def test_a_robot_is_predicted_as_well_as_its_data_allow(robot, seed, tmp_path):
    drawn = draw_uncalibrated(seed, robot)
    assert not drawn["loaded"]
    loaded, recording, heldout = read(drawn, tmp_path)
    found = diagnose(loaded, recording)
    assert found.verdict == "explained"
    assert left(drawn, loaded, heldout, found.effects) < 1.1 * Oracle(drawn).left_over()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "seed", "word", "place"),
    [
        ("3prup", 524018, "lead_error", "leg3/ball_screw"),  # under loads, its noise declared
        ("3prup", 561000, "lead_error", "leg1/ball_screw"),  # under its weight
        ("3prup", 562001, "payload", "moving_star"),  # its noise not declared
        ("delta", 560001, "backlash", "leg1/motor"),  # and under loads
        (
            "delta",
            597002,
            "stiffness_changed",
            "leg2/motor",
        ),  # which hides what else is off
        ("delta", 906400, "stiffness_changed", "leg1/motor"),  # which play stands for, beside what else is off
        ("six_ups", 563000, "stiffness_changed", "leg2/drive"),  # for which play stands at first
    ],
)
def test_a_law_beside_what_is_off_all_over_is_no_noise(robot, seed, word, place, tmp_path):
    drawn = draw_uncalibrated(seed, robot, [word])
    loaded, recording, heldout = read(drawn, tmp_path)
    found = diagnose(loaded, recording)
    assert (word, place) in {(item.physics, item.location) for item in found.findings}
    assert not any(item.physics == "unknown" for item in found.findings)
    assert left(drawn, loaded, heldout, found.effects) < 1.25 * Oracle(drawn).left_over()


# -- the equations -----------------------------------------------------------------------------------------------------


def test_of_two_kinds_that_do_the_same_the_usual_one_is_off():
    draw = np.random.default_rng(5)
    matrix_ = draw.standard_normal((60, 6))
    both = np.concatenate((matrix_, 0.03 * matrix_), axis=1)  # the second must be off by thirty times what is usual
    right = matrix_ @ draw.standard_normal(6) + 0.1 * draw.standard_normal(60)
    sums = (both.T @ both, both.T @ right, right @ right, len(right))
    data = SensorEquations(*(np.array([each]) for each in sums))
    labels, floors = np.repeat(["usual", "unusual"], 6).astype(object), np.full(12, 1e-12)
    costs = {}
    for kind in ("usual", "unusual"):
        alone = np.where(labels == kind, labels, "")
        costs[kind] = estimated(data, np.ones(12), np.ones(1), alone, floors, 0.0, unusual).cost
    plain = [estimated(data, np.ones(12), np.ones(1), np.where(labels == kind, labels, ""), floors, 0.0).cost
             for kind in ("usual", "unusual")]  # fmt: skip
    assert plain[0] == pytest.approx(plain[1], abs=0.1)
    assert costs["unusual"] - costs["usual"] > 10
    slope = (unusual(np.exp(2.01))[0] - unusual(np.exp(1.99))[0]) / 0.02
    assert unusual(np.exp(2.0))[1] == pytest.approx(slope, rel=1e-6)
    assert unusual(0.5) == (0.0, 0.0)
