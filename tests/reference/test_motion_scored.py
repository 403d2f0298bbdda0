"""Blind trials in motion: what an answer gets right, what a prediction leaves, and the page that says so."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
TRUE = {"physics": "payload", "location": "tool0", "places": ["tool0", "wrist_3_joint"], "size": 6.0, "parameters": {},
        "also": [{"physics": "inertial_parameters", "places": ["wrist_3_link", "wrist_3_joint"]}]}  # fmt: skip
ALIEN = {"physics": "unknown", "location": "elbow_joint", "places": ["elbow_joint"], "size": 6.0,
         "parameters": {"kind": "position_friction"},
         "also": [{"physics": "coulomb_friction", "places": ["elbow_joint"]}]}  # fmt: skip


@pytest.fixture
def scripts(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    import _efforts
    import _markers
    import _motion

    return _motion, _efforts, _markers


def finding(physics, location, *more):
    return {"physics": physics, "location": location, "candidates": [location, *more]}


def marked(motion, findings, *effects, verdict="explained"):
    answer = {"verdict": verdict, "findings": findings}
    return motion.marks(answer, {"effects": list(effects)})


def test_an_effect_is_right_by_any_name_of_its_place_and_what_is_true_besides_is_not_wrong(scripts):
    motion, *_ = scripts
    right, twin = finding("payload", "wrist_3_joint"), finding("inertial_parameters", "wrist_3_link")
    marks = marked(motion, [twin, right], TRUE)
    assert marks["wrong"] == []
    (effect,) = marks["effects"]
    assert effect["right"]
    assert not effect["first"]
    (effect,) = marked(motion, [right, twin], TRUE)["effects"]
    assert effect["first"]
    marks = marked(motion, [finding("coulomb_friction", "elbow_joint")], TRUE)
    assert marks["wrong"] == ["coulomb_friction at elbow_joint"]
    assert not marks["effects"][0]["place"]
    assert marks["effects"][0]["told"] == "coulomb_friction elsewhere"


def test_of_several_markers_the_finding_has_to_name_the_right_one(scripts):
    motion, *_ = scripts
    true = TRUE | {"physics": "target_misalignment", "location": "link5", "places": ["link5"], "also": []}
    beside = finding("target_misalignment", "target")
    for aspect, right in ((None, False), ("marker link4", False), ("marker link5", True)):
        (effect,) = marked(motion, [beside | {"aspect": aspect}], true)["effects"]
        assert effect["right"] == effect["place"] == right


def test_outside_the_library_unknown_is_right_and_a_law_that_it_is_not_is_wrong(scripts):
    motion, *_ = scripts
    unknown, part = finding("unknown", "elbow_joint"), finding("coulomb_friction", "elbow_joint")
    marks = marked(motion, [part, unknown], ALIEN, verdict="unexplained")
    assert marks["wrong"] == []
    assert marks["effects"][0]["right"]
    marks = marked(motion, [finding("cogging", "elbow_joint")], ALIEN)
    assert marks["wrong"] == ["cogging at elbow_joint"]
    assert marks["effects"][0]["place"]
    assert not marks["effects"][0]["right"]


def test_what_a_prediction_leaves_is_a_share_of_the_efforts_where_the_robot_moves(scripts):
    _, efforts, _ = scripts
    t = np.arange(0.0, 10.0, 0.004)
    q = np.where(t < 7, np.sin(t), np.sin(7.0))
    tau = 8.0 * np.cos(3 * t)
    measured = {"time": t, "q.a": q, "tau.a": tau}
    assert efforts.share_left(measured, {"tau.a": 0.7 * tau}) == pytest.approx(0.3, rel=3e-3)
    standing = np.where(t < 7.2, tau, 0.0)
    assert efforts.share_left(measured, {"tau.a": standing}) < 0.02
    assert np.isnan(efforts.share_left(measured, {"tau.a": np.full(len(t), np.nan)}))


def test_what_a_prediction_leaves_of_markers_is_counted_in_noise(scripts):
    *_, markers = scripts
    measured = {"time": np.arange(4.0), "p.a.x": np.array([1.0, 2, 3, 4]), "p.a.y": np.zeros(4)}
    predicted = {"p.a.x": measured["p.a.x"] + 3e-4, "p.a.y": np.full(4, -1e-4)}
    assert markers.left(measured, predicted, 1e-4) == pytest.approx(np.sqrt(5))
    assert np.isnan(markers.left(measured, {"p.a.x": predicted["p.a.x"]}, 1e-4))


def test_the_page_counts_what_was_right_and_lists_what_was_not(scripts):
    motion, efforts, _ = scripts
    cases = [
        (1, "one", [finding("payload", "tool0")], [TRUE]),
        (2, "one", [finding("cogging", "elbow_joint")], [TRUE]),
        (3, "clean", [], []),
        (4, "outside", [finding("cogging", "elbow_joint")], [ALIEN]),
    ]
    trials = [
        marked(motion, found, *true)
        | {"seed": seed, "robot": "ur5", "group": group, "seconds": 1.0, "before": 0.4, "after": 0.01}
        for seed, group, found, true in cases
    ]
    text = efforts.KIND.summary(json.loads(json.dumps(trials)))
    rows = dict(line.strip("| ").split(" | ")[:2] for line in text.splitlines() if line.count(" | ") > 1)
    assert rows["within tolerance: something found"].partition("(")[2].startswith("0/1;")
    assert rows["one effect of 3 x noise or more: place right"].partition("(")[2].startswith("1/2;")
    assert rows["outside the library: a wrong law named"].partition("(")[2].startswith("1/1;")
    assert rows["outside: position friction"] == "1"
    assert "ur5 2" in text
    assert "ur5 1 " not in text
    assert "ur5 3 " not in text


def test_groups_are_drawn_in_their_shares_and_seeds_decide(scripts):
    _, efforts, _ = scripts
    drawn = [efforts.how(seed, "panda")["effects"] for seed in range(400)]
    assert drawn == [efforts.how(seed, "panda")["effects"] for seed in range(400)]
    shares = [np.mean([test(names) for names in drawn]) for test in
              (lambda n: not n, lambda n: n == ["alien"], lambda n: len(n) == 2)]  # fmt: skip
    assert shares == pytest.approx([0.25, 0.15, 0.10], abs=0.06)
    assert not any("effort_delay" in efforts.how(seed, "kinova")["effects"] for seed in range(100))
