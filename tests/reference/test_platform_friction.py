"""Dry friction of the concealed platform, judged by what any friction must obey: energy, and one leg by hand."""

from __future__ import annotations

import numpy as np
import pytest

from tests.reference.concealed import platform
from tests.reference.concealed.platform import BASE, LENGTHS, MOUNTS, SEATS, Platform
from tests.reference.concealed.rotations import matrix, vector

WEIGHT = {"physics": "self_weight", "location": "robot"}
Q = np.array([0.02, -0.01, 0.03, 0.0, 0.01, -0.02])
LEG = 2  # leg3


def run(path, effects, **options):
    """Return what is seen under a path of wrenches (N, 6) in one pose."""
    seen = Platform(effects, **options).simulate(np.tile(Q, (len(path), 1)), path)
    assert seen.residual.max() < 0.2
    return seen


def friction(joint, limit, way):
    return {"physics": "coulomb_friction", "location": f"leg{LEG + 1}_{joint}", "limit": limit, "presliding": way}


def leg_of(seen):
    """Return the leg as it stands, (N, 3)."""
    return seen.p + matrix(seen.r) @ SEATS[LEG] - BASE[LEG]


def way_of(joint, seen):
    """Return how far a joint of the leg moved, (N,)."""
    leg = leg_of(seen)
    if joint == "slide":
        return np.linalg.norm(leg, axis=1) - LENGTHS[LEG] - Q[LEG]
    across, second, along = (leg @ MOUNTS[LEG]).T
    return np.arctan2(-second, along) if joint == "u1" else np.arcsin(across / np.linalg.norm(leg, axis=1))


def work_on(path, seen):
    """Return the work of wrenches on the tool along their path [J]."""
    mean = (path[1:] + path[:-1]) / 2
    rot = matrix(seen.r)
    spin = vector(rot[1:] @ rot[:-1].swapaxes(1, 2))
    return float((mean[:, :3] * np.diff(seen.p, axis=0)).sum() + (mean[:, 3:] * spin).sum())


GAP = {"physics": "backlash", "location": "leg3/drive", "half_gap": 2e-5, "smooth": 20.0}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("joint", "limit", "way", "gap"),
    [
        ("slide", 60.0, 2e-6, [GAP]),
        *(
            pytest.param(joint, 40.0, 2e-5, gap, marks=pytest.mark.slow)
            for joint in ("u1", "u2")
            for gap in ([], [GAP])
        ),
        pytest.param("slide", 60.0, 2e-6, [], marks=pytest.mark.slow),
    ],
)
def test_a_cycle_of_the_load_does_the_work_that_friction_takes(joint, limit, way, gap):
    """In a settled cycle nothing else takes any: twice the limit times the way beyond presliding."""
    size = np.array([300.0, 500.0, -200.0, 60.0, -40.0, 50.0])
    turn = np.linspace(0, 2 * np.pi, 301)
    cycle = 2 * size * np.sin(turn)[:, None]
    path = np.vstack([cycle, cycle])
    seen = run(path, [WEIGHT, friction(joint, limit, way), *gap], steps=1)
    second = slice(len(cycle) - 1, None)
    settled = type(seen)(seen.p[second], seen.r[second], seen.residual[second])
    moved = np.ptp(way_of(joint, settled))
    assert moved > 3 * way  # it slides
    assert work_on(path[second], settled) == pytest.approx(2 * limit * (moved - 2 * way), rel=2e-3)


def test_one_leg_by_hand():
    """A load along one leg through its ball joint is that leg's alone: a spring beside one that slides."""
    stiffness, limit, way = 2.4e7, 100.0, 3e-6
    at = platform.Platform.rigid(Q[None])[0]
    seat = matrix(at[3:]) @ SEATS[LEG]
    leg = at[:3] + seat - BASE[LEG]
    along = leg / np.linalg.norm(leg)
    unit = np.r_[along, np.cross(seat, along)]
    held = limit / way
    loads = np.array([0.0, 50.0, 600.0, 500.0, 0.0, -600.0, 0.0])
    #  sticks, slides, turns back and sticks, slides the other way, at both ends of the cycle
    expected = [0.0, 50.0 / (stiffness + held), (600.0 - limit) / stiffness]
    expected += [expected[2] - 100.0 / (stiffness + held), limit / stiffness, -(600.0 - limit) / stiffness]
    expected += [-limit / stiffness]
    seen = run(loads[:, None] * unit, [friction("slide", limit, way)])
    assert way_of("slide", seen) == pytest.approx(expected, rel=1e-3, abs=2e-9)


@pytest.mark.parametrize("joint", ["slide", "u1"])
def test_how_finely_a_load_grows_makes_no_difference(joint):
    path = np.outer([0, 1, -1, 0.5, 0], [400.0, -300.0, 600.0, 50.0, 80.0, -40.0])
    coarse, fine = (run(path, [WEIGHT, friction(joint, 50.0, 3e-6)], steps=steps) for steps in (1, 16))
    assert np.abs(coarse.p - fine.p).max() < 1e-9


def test_a_move_lets_go_of_what_friction_held():
    """A pose starts as if nothing had been before it."""
    path = np.outer([1.0, -1.0, 0.0], [400.0, -300.0, 600.0, 50.0, 80.0, -40.0])
    q = np.repeat([Q, Q + 0.01], len(path), axis=0)
    rubbing = Platform([WEIGHT, friction("u2", 40.0, 2e-5)])
    both = rubbing.simulate(q, np.vstack([path, path]))
    alone = rubbing.simulate(q[3:], path)
    assert np.abs(both.p[3:] - alone.p).max() < 1e-12
