"""First-order changes of the pose against the simulation itself, for every law on three robots."""

import re
import tempfile
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import prup_pin
from prup_pin.diagnosis.first_order_fit import FirstOrderFit
from prup_pin.diagnosis.influence import Influence
from prup_pin.laws import LAWS, Effect, Everywhere, Inputs
from prup_pin.laws.deeds import ScaledMass
from prup_pin.simulation import Simulator, effect_named
from prup_pin.spatial import rotation_log

from ..loaded.coupled import lifting_column
from ..simulation.bench import inputs

#: Share of what a law starts with that is small enough to be linear, and of the change that may differ from it.
SMALL, WITHIN = 1e-3, 5e-3


def three_prup():
    robot = prup_pin.load("3prup")
    bench = inputs(robot, poses=2, cycle=(0.0, 0.3, 0.6, 0.2, -0.4))
    actuators = np.column_stack([bench.positions[name] for name in robot.mechanism.actuated])
    return robot, actuators, np.array(bench.wrench)


def arm():
    # The elbow is stiff: its position acts on what comes after it without a drive between.
    soft = ["shoulder_pan_joint", "shoulder_lift_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint"]
    robot = prup_pin.load("ur5", joint_stiffness=dict.fromkeys(soft, 2e4), tool="tool0")
    bent = np.array([0.3, -1.2, 1.4, -0.6, 0.8, 0.2])
    wrench = np.array([0.0, 0.3, 0.6, 0.2, -0.4])[:, None] * np.array([20.0, -30.0, 40.0, 3.0, 2.0, -1.0])
    return robot, np.repeat([bent, bent + 0.2], 5, axis=0), np.vstack((wrench, wrench))


def platform():
    robot = prup_pin.load(Path(__file__).parents[1] / "robots/six_ups/six_ups.urdf")
    home = np.array(list(robot.home.actuators.values()))
    poses = [home, home + 0.02 * np.array([1.0, -1.0, 1.0, -1.0, 0.5, 0.2])]
    wrench = np.array([0.0, 0.3, 0.6, 0.2, -0.4])[:, None] * np.array([6e3, -4e3, 1e4, 600.0, 400.0, -800.0])
    return robot, np.repeat(poses, 5, axis=0), np.vstack((wrench, wrench))


def column():
    """A rigid lifting column whose stages follow its lift: joints yield, and move those that follow them."""
    machine = lifting_column()
    path = Path(tempfile.mkdtemp()) / "column.urdf"
    path.write_text(re.sub("<module.*?</module>", "", machine.file.text("tool")))
    wrench = np.array([0.0, 0.3, 0.6, 0.2, -0.4])[:, None] * np.array([200.0, -300.0, 400.0, 3.0, 2.0, -1.0])
    actuators = np.repeat([list(machine.commands.values()), [0.9, -0.3]], 5, axis=0)
    return prup_pin.load(path), actuators, np.vstack((wrench, wrench))


@pytest.fixture(
    scope="module", params=[three_prup, arm, platform, column], ids=["3prup", "ur5", "six_ups", "lifting column"]
)
def solved(request):
    robot, actuators, wrench = request.param()
    n = len(wrench)
    speeds = 0.01 * np.cos(np.arange(n)[:, None] + np.arange(actuators.shape[1]))
    temperature = 20.0 + np.linspace(0, 8, n)
    blocks = np.repeat(np.arange(2), n // 2)
    simulator = Simulator(robot, Inputs(np.arange(float(n)), actuators, wrench, blocks, temperature, speeds))
    return simulator, simulator.run()


def weak(law, place, mechanism):
    """The law at a thousandth of its start, from where it is nothing."""
    values = dict(law.starts(place, mechanism)[0])
    nothing = law.neutral_at(place, mechanism)
    if law.physics == "hertzian_contact":  # nothing where both are alike and far beyond every load
        return Effect(law, place, {"preload": 1e6, "reference_load": 1e6 * (1 + SMALL)})
    # where several joints stick before they slide, they are linear only once all slide
    small = 0.1 * SMALL if isinstance(law, Everywhere) and law.physics == "coulomb_friction" else SMALL
    for name in law.neutral or nothing:
        if np.isfinite(nothing[name]) and abs(nothing[name]) < 1e6:
            values[name] = nothing[name] + small * (values[name] - nothing[name])
        else:
            values[name] = values[name] / SMALL  # a stiffness without bounds is nothing
    return Effect(law, place, values)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: f"{law.physics} {law.variant}".strip())
def test_first_order_is_the_simulations_slope(solved, law):
    simulator, run = solved
    mechanism = simulator.robot.mechanism
    places = list(law.places(mechanism))
    if not places:
        pytest.skip(f"no place for {law.physics} on {mechanism.name}")
    influence = Influence(simulator, run)
    for place in places if len(places) <= 6 else (places[0], places[len(places) // 2], places[-1]):
        effect = weak(law, place, mechanism)
        found = influence.change(simulator.setup([effect]))
        after = simulator.run([effect])
        assert after.solved.all()
        turned = rotation_log(after.rotation @ run.rotation.mT)
        expected = np.concatenate((after.position - run.position, turned), axis=1)
        # Equilibria are found to 1e-11, histories a little less; below that there is no slope to compare.
        for columns in (slice(0, 3), slice(3, 6)):
            size = np.abs(expected[:, columns]).max()
            assert np.abs(found - expected)[:, columns].max() < WITHIN * size + 1e-10, place


#: A joint that rubs, the torque or force at which it slides, and what changes beside it.
BESIDE = [
    (machine, rubs, limit, law, values)
    for machine, rubs, limit, laws in (
        (
            platform,
            "leg1_u2",
            {"limit": 1000.0, "presliding_stiffness": 2e7},
            {
                "backlash at leg3/drive": {"half_gap": 2e-7, "closing_load": 300.0},
                "stiffness_changed at leg1/drive": {"factor": 0.999},
                "payload at platform": {"mass": 0.05},
                "wrench_sensor_bias at wrench_sensor (forces)": {"fx": 0.3, "fy": -0.2, "fz": 0.5},
                "encoder_offset at leg1_slide": {"offset": 1e-8},
            },
        ),
        (
            platform,
            "leg4_slide",
            {"limit": 700.0, "presliding_stiffness": 2e7},
            {
                "payload at platform": {"mass": 0.05},
                "backlash at leg4/drive": {"half_gap": 2e-7, "closing_load": 300.0},
            },
        ),
        (
            three_prup,
            "leg1/R_theta_P",
            {"limit": 0.3, "presliding_stiffness": 2e3},
            {
                "thermal_growth at leg2/linear_rod": {"expansion": 1e-8},
                "backlash at leg1/R_phi (radial)": {"half_gap": 2e-8, "closing_load": 50.0},
                "stiffness_changed at leg1/linear_rod": {"factor": 0.9995},
            },
        ),
    )
    for law, values in laws.items()
]


@pytest.mark.parametrize(
    ("machine", "rubs", "friction", "name", "sizes"), BESIDE, ids=[f"{each[3]}, {each[1]} rubs" for each in BESIDE]
)
def test_a_joint_that_sticks_resists_what_any_other_law_does(machine, rubs, friction, name, sizes):
    """Its torque follows the joint, and where it slid to what was before: of both first order knows."""
    robot, actuators, wrench = machine()
    n = len(wrench)
    blocks, warm = np.repeat(np.arange(2), n // 2), 20.0 + np.linspace(0, 8, n)
    simulator = Simulator(robot, Inputs(np.arange(float(n)), actuators, wrench, blocks, warm))
    laws = {f"{law.physics} at {place}": (law, place) for law in LAWS for place in law.places(robot.mechanism)}
    rubbing = Effect(*laws[f"coulomb_friction at {rubs}"], friction)
    run, (law, place) = simulator.run([rubbing]), laws[name]
    effects = [rubbing, Effect(law, place, {**law.neutral_at(place, robot.mechanism), **sizes})]
    found = Influence(simulator, run).change(simulator.setup(effects))
    after = simulator.run(effects)
    turned = rotation_log(after.rotation @ run.rotation.mT)
    expected = np.concatenate((after.position - run.position, turned), axis=1)
    for columns in (slice(0, 3), slice(3, 6)):
        size = np.abs(expected[:, columns]).max()
        assert np.abs(found - expected)[:, columns].max() < WITHIN * size


class Curve(FirstOrderFit):
    """A fit of what only a function of its coordinates says."""

    def __init__(self, candidate, left):
        self.candidate, self.bounds, self.left = candidate, candidate.bounds, left


@pytest.mark.parametrize("logarithmic", [False, True])
def test_a_law_in_proportion_to_its_value_is_fitted_by_one_step(logarithmic):
    draw = np.random.default_rng(3)
    columns, truth, noise = draw.standard_normal((40, 2)), np.array([0.4, 2.5]), 1e-2 * draw.standard_normal(40)
    values = np.exp if logarithmic else (lambda x: x)
    candidate = SimpleNamespace(
        logarithmic=np.full(2, logarithmic), bounds=(np.full(2, -10.0), np.full(2, 10.0)), scales=lambda: np.ones(2)
    )
    fit = Curve(candidate, lambda x: columns @ (truth - values(x)) + noise)
    found, ended = fit._stepped(np.array([0.0, 0.3]))
    assert ended
    assert values(found) == pytest.approx(np.linalg.lstsq(columns, columns @ truth + noise)[0], rel=1e-3)


def test_a_law_that_bends_is_not_fitted_by_one_step():
    line = np.linspace(-1, 1, 20)
    candidate = SimpleNamespace(
        logarithmic=np.zeros(1, bool), bounds=(np.array([-10.0]), np.array([10.0])), scales=lambda: np.ones(1)
    )
    _, ended = Curve(candidate, lambda x: line * (2.0 - x - x**3))._stepped(np.array([0.5]))
    assert not ended


def test_a_law_whose_slopes_lead_to_more_than_is_promising_is_fitted_no_further():
    line, asked = np.linspace(-1, 1, 20), []
    candidate = SimpleNamespace(
        is_proportional=False,
        logarithmic=np.zeros(1, bool),
        bounds=(np.array([-10.0]), np.array([10.0])),
        scales=lambda: np.ones(1),
    )

    def left(x):
        asked.append(x)
        return np.concatenate((line * (2.0 - x - x**3), [3.0]))  # the last is out of its reach

    curve = Curve(candidate, left)
    assert curve._fitted(np.array([0.5]), np.inf) == pytest.approx(1.0, abs=1e-2)
    whole = len(asked)
    asked.clear()
    assert np.isfinite(curve._fitted(np.array([0.5]), 8.0))
    assert len(asked) < 0.6 * whole


def test_a_heavier_link_pulls_along_its_beams_where_weight_is_spread():
    robot, actuators, wrench = three_prup()
    n = len(wrench)
    simulator = Simulator(robot, Inputs(np.arange(float(n)), actuators, wrench, np.zeros(n, int)))
    mechanism = robot.mechanism
    run = simulator.run([effect_named("self_weight", "robot", "spread", {"scale": 1.0}, mechanism)])
    first, now = Influence(simulator, run).first, run.equilibria.conditions
    setup = run.setup.copy()
    for index, link in enumerate(mechanism.links):
        setup.mass_factors = {link.name: 1.01}
        found = ScaledMass.first_order(setup, Influence(simulator, run).solved)
        heavier = np.ones(len(mechanism.links)) + 1e-4 * np.eye(len(mechanism.links))[index]
        expected = 100 * first.by_conditions(replace(now, mass_factors=heavier))
        assert np.abs(found - expected).max() < 1e-3 * np.abs(expected).max() + 1e-12, link.name
