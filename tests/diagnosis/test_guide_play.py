"""A lifting column with an arm on it: play in a guide of its telescope is found, and no clean one is accused of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.recordings import Noise, Recording

from ..reference.posed_tree import PosedTree

LIFT = Path(__file__).parents[1] / "robots/lift/lift.urdf"
JOINTS = ("rise", "turn", "lift", "bend", "roll")
NOISE = 2e-4


def found_of(seed: int, **device):
    tree = PosedTree(LIFT, **device)
    q = tree.postures(JOINTS, 60, seed, reach=0.95)
    seen = tree.seen(q, ("target",), NOISE, seed)
    recording = Recording(np.arange(60.0), positions=q, markers=seen, noise=Noise(position=NOISE))
    return diagnose(prup_pin.load(LIFT, tool="target"), recording)


@pytest.mark.parametrize(("stage", "seed"), [("rise", 4), pytest.param("rise_top", 7, marks=pytest.mark.slow)])
def test_the_stage_with_play_is_named(stage, seed):
    """A clearance of 1 mm in a guide that holds 1.1 m where it is drawn in, and 0.3 m where it is out."""
    found = found_of(seed, guides={stage: (1e-3, 1.1, 30.0)})
    assert found.verdict == "explained"
    assert found.after["heldout"] < 1.1
    play = found.findings[0]
    assert (play.physics, play.location) == ("guide_play", stage)
    truth = {"angle": 1e-3 / 0.7, "growth": 0.4 / 0.7, "closing_moment": 30.0}
    for name, value in truth.items():
        fitted = play.parameters[name]
        wide = fitted.interval[1] - fitted.interval[0]
        assert abs(fitted.value - value) < 0.75 * wide
        assert wide < 0.4 * value


@pytest.mark.slow
def test_play_is_found_beside_joints_that_yield():
    soft = {"lift": 2e-5, "bend": 3e-5}
    found = found_of(5, guides={"rise": (1e-3, 1.1, 8.0)}, about=soft, across={"rise": 1e-5})
    named = {(item.physics, item.location) for item in found.findings}
    assert ("guide_play", "rise") in named
    assert {item.physics for item in found.findings} == {"guide_play", "joint_compliance", "self_weight"}
    assert found.after["heldout"] < 1.1


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "scattered"), [pytest.param(2, False, marks=pytest.mark.slow), (3, True)])
def test_a_column_that_yields_is_not_said_to_have_play(seed, scattered):
    draw = np.random.default_rng(seed)
    off = {name: 1e-3 * draw.standard_normal(3) for name in JOINTS} if scattered else {}
    found = found_of(seed, about={"lift": 2e-5, "bend": 3e-5}, across={"rise": 2e-5}, tilted=off)
    assert "guide_play" not in {item.physics for item in found.findings}
    assert found.after["heldout"] < 1.2


@pytest.mark.slow
def test_what_a_few_places_could_explain_as_well_is_off_all_over_where_no_law_names_them():
    draw = np.random.default_rng([7, 7])
    joints = ("rise", "rise_top", *JOINTS[1:])
    found = found_of(
        7,
        offsets={name: 2e-3 * draw.standard_normal() for name in JOINTS[1:]},
        moved={name: 5e-4 * draw.standard_normal(3) for name in joints},
        tilted={name: 1e-3 * draw.standard_normal(3) for name in joints},
        targets={"target": 1e-3 * draw.standard_normal(3)},
    )
    assert found.verdict == "explained"
    assert ("geometric_offset", "robot") in {(item.physics, item.location) for item in found.findings}
    assert found.after["heldout"] < 1.2
