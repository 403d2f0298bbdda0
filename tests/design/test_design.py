"""Designs against searches by hand: changed robots, asked one by one."""

from __future__ import annotations

import numpy as np
import pytest

import prup_pin
from prup_pin import InfeasibleDesignError, InputError, PrupPinError, Target, UnknownNameError
from tests.laws.bench import ROBOTS

ROBOT = prup_pin.load("3prup")
ROD, BRANCH = "leg*/linear_rod.diameter", "leg*/moving_star_branch.diameter"
GRID = {"z": 0.3, "theta": np.linspace(-0.4, 0.4, 5), "phi": np.linspace(-0.4, 0.4, 5)}
POSES = [{"z": 0.3, "theta": float(t), "phi": float(p)} for t in GRID["theta"] for p in GRID["phi"]]
BOUNDS = {ROD: (0.01, 0.05), BRANCH: (0.005, 0.05)}


def changed(robot, **values):
    """The robot with all parameters of a pattern at a value; patterns are given as words of their module."""
    named = {"rod": "/linear_rod.diameter", "branch": "/moving_star_branch.diameter"}
    changes = {f"leg{leg}{named[word]}": value for word, value in values.items() for leg in (1, 2, 3)}
    return robot.with_parameters(changes)


def worst_translation(robot, poses=POSES):
    """By single questions: the largest translation per force, of all poses."""
    return max(np.linalg.eigvalsh(robot.compliance(robot.pose(**at)).C[:3, :3])[-1] for at in poses)


def bisected(function, low, high):
    """Where a falling function is zero, to 1e-7 of it."""
    while high / low - 1 > 1e-7:
        middle = np.sqrt(low * high)
        low, high = (middle, high) if function(middle) > 0 else (low, middle)
    return high


def mass(robot):
    """Of round bars, by hand."""
    total = 0.0
    for bar in ("linear_rod", "moving_star_branch"):
        diameter, density, length = (
            robot.parameters[f"leg1/{bar}.{name}"].value for name in ("diameter", "density", "body_length")
        )
        total += 3 * density * length * np.pi / 4 * diameter**2
    return total


def test_one_diameter_is_that_of_a_bisection():
    """Which diameter gives 15 um/N everywhere?"""
    found = ROBOT.design({"translation": 1.5e-5}, [BRANCH], bounds={BRANCH: (0.005, 0.05)}, **GRID)
    by_hand = bisected(lambda d: worst_translation(changed(ROBOT, branch=d)) - 1.5e-5, 0.005, 0.05)
    assert found.values[BRANCH] == pytest.approx(by_hand, rel=2e-6)
    assert found.changes == dict.fromkeys(
        (f"leg{leg}/moving_star_branch.diameter" for leg in (1, 2, 3)), found.values[BRANCH]
    )
    assert found.reached[0] == pytest.approx(1.5e-5, rel=2e-6)
    assert found.before[0] == pytest.approx(worst_translation(ROBOT), rel=1e-9)
    at = ROBOT.with_parameters(found.changes)
    assert worst_translation(at, [found.at[0]]) == pytest.approx(found.reached[0], rel=1e-9)
    assert found.mass_before == pytest.approx(mass(ROBOT), rel=1e-5)  # areas are tabulated
    assert found.mass == pytest.approx(mass(at), rel=1e-5)


@pytest.mark.slow
def test_two_diameters_are_the_lightest_of_all_that_do():
    """For each rod the thinnest branches that do: none of these pairs is lighter."""
    found = ROBOT.design({"translation": 1e-5}, [ROD, BRANCH], bounds=BOUNDS, poses=POSES)
    best = ROBOT.with_parameters(found.changes)
    assert worst_translation(best) == pytest.approx(1e-5, rel=2e-6)
    masses = []
    for factor in (0.995, 1.0, 1.005):
        rod = factor * found.values[ROD]
        branch = bisected(lambda d, rod=rod: worst_translation(changed(ROBOT, rod=rod, branch=d)) - 1e-5, 0.01, 0.05)
        masses.append(mass(changed(ROBOT, rod=rod, branch=branch)))
    assert masses[1] == pytest.approx(found.mass, rel=1e-6)
    assert min(masses[0], masses[2]) > found.mass * 1.00001
    # the parabola through the three has its bottom where the design is
    slope, bend = (masses[2] - masses[0]) / 2, masses[2] - 2 * masses[1] + masses[0]
    assert abs(slope / bend) < 0.05
    assert not found.binding


@pytest.mark.slow
def test_legs_may_differ():
    free = [f"leg{leg}/linear_rod.diameter" for leg in (1, 2, 3)]
    poses = [{"z": 0.3, "theta": 0.3, "phi": 0.1}]
    alike = ROBOT.design({"translation": 1e-5}, [ROD], bounds={ROD: BOUNDS[ROD]}, poses=poses)
    apart = ROBOT.design({"translation": 1e-5}, free, poses=poses)
    assert apart.mass < 0.9 * alike.mass
    assert worst_translation(ROBOT.with_parameters(apart.changes), poses) < 1e-5 * (1 + 2e-6)


SPRINGS = {"left_motor": 1e4, "right_motor": 2e4}


def test_springs_of_a_five_bar_cost_what_is_said():
    """A planar robot whose motors yield: C = J diag(1/k) J^T by hand, the cheapest pair by a fine scan."""
    robot = prup_pin.load(ROBOTS / "five_bar/five_bar.urdf", joint_stiffness=SPRINGS, tool="left_point")
    free = [
        name for name in robot.parameters if name.endswith("motor.stiffness") or ("motor" in name and "stiff" in name)
    ]
    assert len(free) == 2, free
    costs = dict(zip(free, (1e-4, 3e-4), strict=True))
    home = robot.home
    step = 1e-6
    columns = []
    start = list(home.actuators.values())
    for index in range(2):
        ends = []
        for sign in (-1, 1):
            moved = [value + sign * step * (place == index) for place, value in enumerate(start)]
            ends.append(robot.pose_from_actuators(moved).base_from_tool[:3, 3])
        columns.append((ends[1] - ends[0]) / (2 * step))
    jacobian = np.array(columns).T

    def worst(stiffness):
        return np.linalg.eigvalsh(jacobian @ np.diag(1 / np.array(stiffness)) @ jacobian.T)[-1]

    most = worst([1.5e4, 1.5e4])
    found = robot.design({"translation": most}, free, costs=costs)
    assert worst([found.values[name] for name in free]) == pytest.approx(most, rel=1e-5)
    cheapest = np.inf
    for first in np.geomspace(3e3, 4e4, 4000):
        if worst([first, 1e12]) < most:
            second = bisected(lambda k, first=first: worst([first, k]) - most, 1e3, 1e12)
            cheapest = min(cheapest, costs[free[0]] * first + costs[free[1]] * second)
    assert found.cost == pytest.approx(cheapest, rel=1e-5)
    assert found.mass == found.mass_before


@pytest.mark.slow
def test_a_length_may_be_free():
    """The base's radius: redrawn robots at the same coordinates, by bisection."""
    poses = [{"z": 0.35, "theta": 0.15, "phi": -0.1}]
    name = "leg*/base.radius"
    found = ROBOT.design({"rotation": 2.4e-4}, [name], bounds={name: (0.12, 0.3)}, costs={name: 10.0}, poses=poses)

    def worst(radius):
        robot = ROBOT.with_parameters({f"leg{leg}/base.radius": radius for leg in (1, 2, 3)})
        return np.linalg.eigvalsh(robot.compliance(robot.pose(**poses[0])).C[3:, 3:])[-1]

    assert worst(found.values[name]) <= 2.4e-4 * (1 + 2e-6)
    for other in (0.999, 1.001):
        robot = ROBOT.with_parameters({f"leg{leg}/base.radius": other * found.values[name] for leg in (1, 2, 3)})
        cheaper = mass(robot) + 10 * other * found.values[name] < found.cost
        assert not (cheaper and worst(other * found.values[name]) <= 2.4e-4)


KINDS = [
    Target("translation", 1e-5),
    Target("rotation", 1e-4),
    Target("translation", 1e-5, along=(1, 2, -1)),
    Target("rotation", 1e-4, along=(0, 0, 3)),
    Target("translation", 1e-3, wrench={"fx": 100, "mz": 20}),
    Target("rotation", 1e-2, force=300, moment=100),
]


@pytest.mark.parametrize("target", KINDS, ids=str)
def test_a_target_is_the_worst_of_all_directions_and_loads(target):
    pose = ROBOT.pose(z=0.4, theta=0.2, phi=-0.1)
    c = ROBOT.compliance(pose).C
    (worst,) = target.worst(c[None])
    rows = slice(0, 3) if target.what == "translation" else slice(3, 6)
    generator = np.random.default_rng(1)
    if target.wrench is not None:
        tried = [np.linalg.norm((c @ [100, 0, 0, 0, 0, 20])[rows])]
    elif target.force is not None:
        box = np.array([300.0] * 3 + [100.0] * 3)
        tried = np.linalg.norm((generator.uniform(-1, 1, (5000, 6)) * box @ c)[:, rows], axis=1)
        corners = np.sign(generator.uniform(-1, 1, (500, 6))) * box
        tried = [*tried, *np.linalg.norm((corners @ c)[:, rows], axis=1)]
    else:
        axes = generator.normal(size=(5000, 3)) if target.along is None else np.array([target.along], float)
        axes /= np.linalg.norm(axes, axis=1, keepdims=True)
        tried = np.einsum("ni,ij,nj->n", axes, c[rows, rows], axes)
    assert max(tried) == pytest.approx(worst, rel=2e-3)
    assert max(tried) <= worst * (1 + 1e-12)
    # the cuts are that number near here, and their slopes are right
    change = generator.normal(size=(6, 6))
    change = 1e-9 * (change + change.T)
    sizes, slopes = zip(*(cut.of(c) for cut in target.cuts(c)), strict=True)
    assert max(sizes) == pytest.approx(worst, rel=1e-9)
    for cut, size, slope in zip(target.cuts(c), sizes, slopes, strict=True):
        ahead, behind = cut.of(c + change)[0], cut.of(c - change)[0]
        assert (ahead - behind) / 2 == pytest.approx((slope * change).sum(), rel=1e-5, abs=1e-9 * size)


def test_targets_over_loads_are_met():
    target = Target("translation", 6e-3, force=300, moment=100)
    found = ROBOT.design([target], [ROD, BRANCH], bounds=BOUNDS, poses=POSES)
    sweep = ROBOT.with_parameters(found.changes).sweep(POSES, quantities=["extremes"], force=300, moment=100)
    assert sweep["extremes"][:, 0].max() == pytest.approx(6e-3, rel=2e-6)


def test_bounds_hold_and_are_named():
    found = ROBOT.design(
        {"translation": 1e-5}, [ROD, BRANCH], bounds={ROD: (0.03, 0.05), BRANCH: (0.005, 0.05)}, **GRID
    )
    assert found.binding == {ROD: "low"}
    assert found.values[ROD] == pytest.approx(0.03)
    assert "(its least)" in str(found)
    assert "was" in repr(found)


def test_a_target_that_no_design_meets_says_how_near_one_comes():
    with pytest.raises(InfeasibleDesignError) as caught:
        ROBOT.design({"translation": 1e-6}, [ROD], bounds={ROD: (0.01, 0.05)}, **GRID)
    error = caught.value
    assert error.values[ROD] == pytest.approx(0.05)
    assert error.reached[0] == pytest.approx(worst_translation(changed(ROBOT, rod=0.05)), rel=1e-6)
    for text in ("at best, at z = 0.3, theta =", "moving_star_branch (", "At their largest: leg*/linear_rod.diameter"):
        assert text in str(error)


@pytest.mark.slow
def test_an_answer_is_a_function_of_its_question():
    one, other = (ROBOT.design({"translation": 1e-5}, [BRANCH], **GRID) for _ in range(2))
    assert one.values == other.values


@pytest.mark.parametrize(
    ("error", "given", "says"),
    [
        (UnknownNameError, {"free": ["leg1/linear_rod.diametre"]}, "Did you mean 'leg1/linear_rod.diameter'"),
        (InputError, {"free": []}, "nothing is free"),
        (InputError, {"bounds": {BRANCH: (0.02, 0.01)}}, "the smaller first [m]"),
        (InputError, {"bounds": {BRANCH: 0.02}}, "expected two numbers"),
        (UnknownNameError, {"bounds": {"leg1": (1, 2)}}, "no free parameter with bounds named 'leg1'"),
        (InputError, {"targets": {}}, "needs a target"),
        (InputError, {"targets": {"translation": 0}}, "expected a number above 0 [m/N]"),
        (UnknownNameError, {"targets": {"stiffness": 1}}, "no kind of target named 'stiffness'"),
        (InputError, {"targets": [2e-6]}, "expected a Target"),
        (InputError, {"free": ["leg*/ball_nut.stiffness"]}, "changes no mass that the robot file knows"),
        (InputError, {"free": ["leg1/linear_rod.*"]}, "expected one unit"),
        (
            InputError,
            {"free": [BRANCH, "leg1/moving_star_branch.diameter"]},
            "both set leg1/moving_star_branch.diameter",
        ),
        (InputError, {"poses": [{"z": 0.9, "theta": 0.0, "phi": 0.0}]}, "1 of 1 poses cannot be judged, the first at"),
        (InputError, {"poses": [{"z": 400, "theta": 0.0, "phi": 0.0}]}, "Millimetres?"),
    ],
)
def test_bad_questions_are_refused_in_words(error, given, says):
    asked = {"targets": {"translation": 1e-5}, "free": [BRANCH], **given}
    with pytest.raises(error) as caught:
        ROBOT.design(**asked)
    assert says in str(caught.value)


def test_targets_say_one_thing():
    with pytest.raises(InputError, match="give one of these"):
        Target("translation", 1e-6, along=(1, 0, 0), wrench=[1, 0, 0, 0, 0, 0])
    with pytest.raises(InputError, match="expected both"):
        Target("translation", 1e-6, force=300)
    with pytest.raises(InputError, match="expected a direction"):
        Target("translation", 1e-6, along=(0, 0, 0))


def test_a_rigid_robot_has_nothing_to_design():
    with pytest.raises(PrupPinError, match="no compliant module"):
        prup_pin.load(ROBOTS / "delta/robot.urdf", tool="platform").design({"translation": 1e-6}, ["x"])
