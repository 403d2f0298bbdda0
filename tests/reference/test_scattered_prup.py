"""A device whose parameters scatter against our simulation with the same ones moved: both mean the same by each."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

import prup_pin
from prup_pin.laws import Inputs
from prup_pin.laws.deeds import (
    Along,
    ChangedValue,
    ExtraStrain,
    MovedJoint,
    PoseReport,
    ScaledMass,
    Strain,
    Travel,
    Weight,
    WrenchReading,
)
from prup_pin.simulation import Simulator
from prup_pin.spatial import WRENCH_NAMES, rotation_exp, rotation_log
from tests.reference.concealed.device import PARAMETERS, Device
from tests.reference.concealed.draw import measure, programme
from tests.reference.concealed.scatter import ORDINARY, Yardstick, draw_scatter

NOISE = np.array([2e-6] * 3 + [1e-5] * 3)
ROBOT = prup_pin.load("3prup")
RUN = programme(np.random.default_rng(5), 3, 100.0, directions=2)
BLOCKS = np.repeat(np.arange(3), len(RUN.q) // 3)
WEIGHT = {"physics": "self_weight", "location": "robot", "branches": "hub"}


def deeds(scatter):
    """Yield what moves the parameters of the package as the device's are, in an order that the sensors need."""
    moved = {}
    turn, gain = np.zeros(3), np.ones(6)
    for name, amount in scatter.items():
        place, _, what = name.rpartition(".")
        axis = "xyz".find(what[-1])
        if "/" in place:
            yield ChangedValue(place, what, (1 + amount) * ROBOT.mechanism.module(place).values[what])
        elif what == "mass":
            yield ScaledMass(place, 1 + amount)
        elif what.startswith("encoder"):
            column = int(place[3]) - 1
            yield Travel(column, amount if what == "encoder_offset" else amount * RUN.q[:, column])
        elif place.endswith("slide"):
            moved.setdefault(place, np.zeros(6))[axis + 3 * (what[0] == "r")] += amount
        elif what.startswith("gain"):
            gain[WRENCH_NAMES.index(what[5:])] += amount
        elif place == "wrench_sensor":
            turn[axis] += amount
    for joint, displacement in moved.items():
        yield MovedJoint(joint, tuple(displacement))
    yield WrenchReading(partial(np.multiply, gain))
    yield WrenchReading(lambda w: np.hstack([w[:, :3], w[:, 3:]]) @ np.kron(np.eye(2), rotation_exp(turn)).T)
    for place in ("target", "pose_sensor"):  # a target on the tool, and then the frame that it is reported in
        shift = np.array([scatter.get(f"{place}.{axis}", 0.0) for axis in "xyz"])
        rotation = rotation_exp(np.array([scatter.get(f"{place}.r{axis}", 0.0) for axis in "xyz"]))
        if place == "target":
            yield PoseReport(lambda p, r, shift=shift, rotation=rotation: (p + r @ shift, r @ rotation))
        else:
            yield PoseReport(lambda p, r, shift=shift, rotation=rotation: (p @ rotation.T + shift, rotation @ r))


def apart(scatter, ours, *effects, weight=True, branches="hub"):
    """Return the largest difference of the poses in multiples of noise: `effects` on the device, `ours` on our side."""
    device = Device([*(WEIGHT | {"branches": branches},) * weight, *effects], scatter=scatter)
    seen = device.simulate(RUN.q, RUN.w)
    simulator = Simulator(ROBOT, Inputs(RUN.time, RUN.q, device.report_wrench(RUN.w), BLOCKS, RUN.temperature))
    setup = simulator.setup()
    setup.take([*(Weight(1.0, branches == "distributed"),) * weight, *ours])
    run = simulator.run_setup(setup)
    assert run.solved.all()
    assert seen.residual.max() < 0.2
    turned = rotation_log(run.rotation @ rotation_exp(seen.r).mT)
    return np.abs(np.hstack([run.position - seen.p, turned]) / NOISE).max()


@pytest.mark.parametrize("seed", range(3))
def test_a_scattered_device_is_the_package_with_its_parameters_moved(seed):
    scatter = draw_scatter(np.random.default_rng(seed), PARAMETERS, ORDINARY)
    scatter |= {f"star_{leg}.mass": scatter["hub.mass"] for leg in (1, 2, 3)}
    assert apart(scatter, []) > 50
    assert apart(scatter, deeds(scatter)) < 0.2


def test_a_branch_that_is_heavier_moves_the_centre_of_the_star():
    scatter = {"star_2.mass": -0.5, "star_3.mass": 0.3}
    even = {f"star_{leg}.mass": -0.2 / 3 for leg in (1, 2, 3)}
    assert apart(scatter, deeds(even), branches="distributed") > 1
    assert apart(scatter, deeds(scatter), branches="distributed") < 0.1


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[] if index % 3 == 0 else [pytest.mark.slow])
        for index, name in enumerate(PARAMETERS)
        if name.startswith(("leg1", "wrench", "target", "pose"))
    ],
)
def test_one_parameter_that_is_off(name):
    scatter = {name: 5 * ORDINARY[PARAMETERS[name]]}
    assert apart(scatter, deeds(scatter)) < 0.25


def test_parameters_that_are_not_off_change_no_bit():
    plain, scattered = (Device([WEIGHT], scatter=item) for item in (None, dict.fromkeys(PARAMETERS, 0.0)))
    seen = [device.simulate(RUN.q, RUN.w) for device in (plain, scattered)]
    assert (seen[0].p == seen[1].p).all()
    assert (seen[0].r == seen[1].r).all()
    assert (plain.report_wrench(RUN.w) == scattered.report_wrench(RUN.w)).all()


def test_a_tilted_rod():
    effect = {"physics": "geometric_offset", "location": "leg3/linear_rod", "tilt": (2.5e-3, -1.5e-3)}
    assert apart({}, [], effect) > 20
    assert apart({}, [MovedJoint("leg3_slide", (0.0, 0.0, 0.0, 2.5e-3, -1.5e-3, 0.0))], effect) < 0.25


@pytest.mark.parametrize("module", ["R_theta_P", "R_lambda"])
def test_a_gap_of_each_direction_for_itself(module):
    """The directions are those of the robot file's bearing; a round gap of the same size is something else."""
    place = f"leg2/{module}"
    effect = {"physics": "backlash", "location": place, "direction": "radial", "half_gap": 4e-5, "by_axis": True}
    play = partial(_play, gap=4e-5, load=0.5)
    by_axis = [ExtraStrain(place, Strain(Along(slice(axis, axis + 1), play))) for axis in (0, 1)]
    round_gap = [ExtraStrain(place, Strain(Along(slice(0, 2), play)))]
    assert apart({}, by_axis, effect, weight=False) < 0.1
    assert apart({}, round_gap, effect, weight=False) > 2


def _play(force, gap, load):
    closed = np.tanh(force / load)
    return gap * closed, gap / load * (1 - closed**2)


@pytest.mark.slow
def test_what_a_tolerance_can_imitate_does_not_count():
    """A bearing that is soft within reason is small beside tolerances, and nothing else is made larger by them."""
    run = programme(np.random.default_rng(6), 2, 100.0, directions=1)
    parameters = {name: kind for name, kind in PARAMETERS.items() if kind in ("stiffness", "bending")}
    noise = {"position": 2e-6, "rotation": 1e-5}
    yardstick = Yardstick(Device, measure, run, parameters, ORDINARY, noise, [WEIGHT])
    bare = Yardstick(Device, measure, run, {}, ORDINARY, noise, [WEIGHT])
    soft = {"physics": "stiffness_changed", "location": "leg1/R_lambda", "parameter": "tilting", "factor": 0.8}
    gap = {"physics": "backlash", "location": "leg1/ball_nut", "half_gap": 4e-5}
    assert bare.strength([soft])[:6].max() > 1.5
    assert yardstick.strength([soft])[:6].max() < 0.3
    assert (
        0.5 < yardstick.strength([soft])[6] < 1.5
    )  # two tolerances, and a little more in stiffness than in compliance
    assert yardstick.strength([gap])[:6].max() > 0.3 * bare.strength([gap])[:6].max() > 1.0
    assert (yardstick.strength([gap])[:6] < 1.05 * bare.strength([gap])[:6].max()).all()


def test_a_hose_pulls_where_the_robot_stands():
    """At each sample it is a dead force of its own, which the package can be given."""
    effect = {"physics": "external_spring", "location": "environment", "stiffness": 300.0, "rest": [0.05, -0.02, 0.35]}
    seen = Device([effect]).simulate(RUN.q, RUN.w)
    force = -300.0 * (seen.p - effect["rest"])
    assert np.abs(force).max() > 10
    dead = Device([]).simulate(RUN.q, RUN.w + np.hstack([force, 0 * force]))
    np.testing.assert_allclose(dead.p, seen.p, atol=1e-9)
    np.testing.assert_allclose(dead.r, seen.r, atol=1e-8)
