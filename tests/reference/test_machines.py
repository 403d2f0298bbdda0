"""Concealed machines, each by a balance of its own, against the package's loaded simulation of their robot files."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest

import prup_pin
from prup_pin.build import delta as packaged_delta
from prup_pin.laws import Inputs
from prup_pin.laws.deeds import (
    Along,
    ChangedValue,
    ExtraStrain,
    JointResistance,
    MovedJoint,
    MovedLoopEnd,
    PoseReport,
    ScaledMass,
    Strain,
    ToolLoad,
    Travel,
    Weight,
    WrenchReading,
)
from prup_pin.simulation import Simulator
from prup_pin.spatial import WRENCH_NAMES, rotation_exp, rotation_log
from tests.reference.concealed import arm, delta, platform
from tests.reference.concealed.scatter import ORDINARY, draw_scatter

ROBOTS = Path(__file__).parents[1] / "robots"
NOISE = np.array([2e-6] * 3 + [6e-6] * 3)
WEIGHT = {"physics": "self_weight", "location": "robot"}
LEVELS = np.array([0.0, 1.0, -0.5])


class Bench:
    """A machine beside the package's robot, under the same loads in the same poses."""

    def __init__(self, machine, poses, level, robot):
        rng = np.random.default_rng(2)
        self.machine, self.robot = machine, robot
        poses = poses(rng, 4)
        self.q = np.repeat(poses, len(LEVELS), axis=0)
        self.w = np.concatenate([np.outer(LEVELS, level * rng.normal(size=6) * [1, 1, 1, 0.2, 0.2, 0.2])
                                 for _ in poses])  # fmt: skip
        self.blocks = np.repeat(np.arange(len(poses)), len(LEVELS))

    def apart(self, ours, effects=(), scatter=None, weight=True):
        """Return the largest difference of the poses in multiples of noise."""
        machine = self.machine([*(WEIGHT,) * weight, *effects], scatter)
        seen = machine.simulate(self.q, self.w)
        inputs = Inputs(np.arange(len(self.q), dtype=float), self.q, machine.report_wrench(self.w), self.blocks)
        simulator = Simulator(self.robot, inputs)
        setup = simulator.setup()
        setup.take([*(Weight(1.0),) * weight, *ours])
        run = simulator.run_setup(setup)
        assert run.solved.all()
        assert seen.residual.max() < 1
        turned = rotation_log(run.rotation @ rotation_exp(seen.r).mT)
        return np.abs(np.hstack([run.position - seen.p, turned]) / NOISE).max()


PLATFORM = Bench(platform.Platform, platform.poses, 500.0, prup_pin.load(ROBOTS / "six_ups/six_ups.urdf"))


def sensors(scatter):
    """Yield what the sensors make of things: gains, then the wrench sensor's turn; the target, then the frame."""
    at = {place: [np.array([scatter.get(f"{place}.{r}{axis}", 0.0) for axis in "xyz"]) for r in ("", "r")]
          for place in ("wrench_sensor", "target", "pose_sensor")}  # fmt: skip
    gain = 1 + np.array([scatter.get(f"wrench_sensor.gain_{name}", 0.0) for name in WRENCH_NAMES])
    turn = np.kron(np.eye(2), rotation_exp(at["wrench_sensor"][1]))
    yield WrenchReading(lambda w: (w * gain) @ turn.T)
    shift, rotation = at["target"]
    yield PoseReport(lambda p, r: (p + r @ shift, r @ rotation_exp(rotation)))
    offset, frame = at["pose_sensor"]
    yield PoseReport(lambda p, r: (p @ rotation_exp(frame).T + offset, rotation_exp(frame) @ r))


def drives(bench, scatter):
    """Yield what drives, encoders and bodies make of their parameters."""
    mechanism = bench.robot.mechanism
    for name, amount in scatter.items():
        place, _, what = name.rpartition(".")
        if what == "stiffness":
            yield ChangedValue(place, what, (1 + amount) * mechanism.module(place).values[what])
        elif what.startswith("encoder"):
            column = bench.machine.ACTUATED.index(place)
            yield Travel(column, amount if what == "encoder_offset" else amount * bench.q[:, column])


def platform_deeds(scatter):
    yield from drives(PLATFORM, scatter)
    moved = {}
    for name, amount in scatter.items():
        place, _, what = name.rpartition(".")
        if place.endswith("_u1"):
            moved.setdefault(place, np.zeros(6))["xyz".find(what)] += amount
        elif what == "mass":
            yield ScaledMass(place, 1 + amount)
    for joint, displacement in moved.items():
        yield MovedJoint(joint, tuple(displacement))
    yield from sensors(scatter)


def test_the_nominal_platform():
    assert PLATFORM.apart([], weight=False) < 1e-4
    assert PLATFORM.apart([]) < 1e-4
    assert PLATFORM.apart([Weight(-1.0)]) > 2


@pytest.mark.parametrize("seed", range(2))
def test_a_scattered_platform(seed):
    """The ball joints' centres apart: they are no joints of the robot file."""
    scatter = draw_scatter(np.random.default_rng(seed), platform.Platform.PARAMETERS, ORDINARY)
    scatter = {name: amount for name, amount in scatter.items() if "seat" not in name}
    assert PLATFORM.apart([], scatter=scatter) > 50
    assert PLATFORM.apart(platform_deeds(scatter), scatter=scatter) < 1e-4


def rubs(location, limit=90.0, way=3e-6):
    """Return an effect of the machine and the deeds that are the same."""
    effect = {"physics": "coulomb_friction", "location": location, "limit": limit, "presliding": way}
    return effect, JointResistance(location, limit, limit / way)


@pytest.mark.parametrize(("location", "way"), [("leg2_slide", 3e-6), ("leg1_u1", 3e-5), ("leg4_u2", 3e-5)])
def test_a_rubbing_joint_of_a_platform(location, way):
    """In a free joint, and in a slide beside its drive; the limit tells at one per cent."""
    effect, deed = rubs(location, way=way)
    assert PLATFORM.apart([], [effect]) > 0.5
    assert PLATFORM.apart([deed], [effect]) < 1e-3
    assert PLATFORM.apart([JointResistance(location, 1.01 * deed.limit, deed.stiffness)], [effect]) > 3e-3


@pytest.mark.parametrize("beside", ["leg2", "leg5"])
def test_a_rubbing_slide_beside_a_gap(beside):
    """Friction in the guide of a leg with play holds its rod within the play."""
    effect, deed = rubs("leg2_slide")
    gap = {"physics": "backlash", "location": f"{beside}/drive", "half_gap": 2e-5, "smooth": 20.0}
    play = ExtraStrain(f"{beside}/drive", Strain(Along(slice(0, 1), partial(_play, gap=2e-5, load=20.0))))
    assert PLATFORM.apart([play], [gap]) < 1e-3
    assert PLATFORM.apart([play], [gap, effect]) > 1
    assert PLATFORM.apart([play, deed], [gap, effect]) < 1e-3


def test_friction_without_limit_is_none():
    effect, _ = rubs("leg3_u1", 1e-12)
    seen, other = (
        platform.Platform(effects).simulate(PLATFORM.q, PLATFORM.w) for effects in ([WEIGHT, effect], [WEIGHT])
    )
    assert np.abs(np.hstack([seen.p - other.p, seen.r - other.r])).max() < 1e-13


DELTA = Bench(delta.Delta, delta.poses, 60.0, prup_pin.load(ROBOTS / "clavel_delta/clavel_delta.urdf"))
#: A rod bends a little under its own weight in the package, and is a line in the machine.
BENT = 0.05


def delta_deeds(scatter):
    """Motors, tops and masses: seats and lengths are no joints of the robot file."""
    yield from drives(DELTA, scatter)
    moved = {}
    for name, amount in scatter.items():
        place, _, what = name.rpartition(".")
        if place.endswith(("_motor", "_top")) and what[-1] in "xyz" and len(what) < 3:
            joint = place.replace("_top", "_u1")
            moved.setdefault(joint, np.zeros(6))["xyz".find(what[-1]) + 3 * (len(what) > 1)] += amount
        elif what == "mass":
            yield ScaledMass(place, 1 + amount)
    for joint, displacement in moved.items():
        axis = DELTA.robot.mechanism.joint(joint).axis
        displacement[3:] -= (displacement[3:] @ axis) * axis
        yield MovedJoint(joint, tuple(displacement))
    yield from sensors(scatter)


def test_the_nominal_delta():
    assert DELTA.apart([], weight=False) < 1e-3
    assert DELTA.apart([]) < BENT
    assert DELTA.apart([Weight(-1.0)]) > 5


@pytest.mark.parametrize("seed", range(2))
def test_a_scattered_delta(seed):
    scatter = draw_scatter(np.random.default_rng(seed), delta.Delta.PARAMETERS, ORDINARY)
    scatter = {name: amount for name, amount in scatter.items() if "seat" not in name and "length" not in name}
    assert DELTA.apart([], scatter=scatter) > 50
    assert DELTA.apart(delta_deeds(scatter), scatter=scatter) < BENT


def test_a_longer_rod_of_the_delta():
    longer = {"leg2b_rod.length": 1e-4}
    way = DELTA.robot.mechanism.frame("leg2b_bottom").placement[:3, 3]
    moved = MovedLoopEnd("leg2b", 1, (*(1e-4 * way / np.linalg.norm(way)), 0.0, 0.0, 0.0))
    assert DELTA.apart([], scatter=longer) > 5
    assert DELTA.apart([moved], scatter=longer) < BENT


def test_the_delta_is_that_of_the_builder():
    built, read = packaged_delta(**delta.DRAWING), DELTA.robot
    pose = dict.fromkeys(delta.Delta.ACTUATED, 0.1)
    one, other = (robot.compliance(robot.pose_from_actuators(pose)).C for robot in (built, read))
    assert np.abs(one - other).max() < 1e-9 * np.abs(one).max()


ARM = Bench(arm.Arm, arm.poses, 150.0, prup_pin.load(ROBOTS / "elastic_arm/elastic_arm.urdf"))


def arm_deeds(scatter):
    yield from drives(ARM, scatter)
    moved = {}
    for name, amount in scatter.items():
        place, _, what = name.rpartition(".")
        if what in ("x", "y", "z", "rx", "ry", "rz") and place.startswith("joint"):
            moved.setdefault(place, np.zeros(6))["xyz".find(what[-1]) + 3 * (len(what) > 1)] += amount
        elif what == "mass":
            yield ScaledMass(place, 1 + amount)
    for joint, displacement in moved.items():
        yield MovedJoint(joint, tuple(displacement))
    yield from sensors(scatter)


def test_the_nominal_arm():
    assert ARM.apart([], weight=False) < 1e-4
    assert ARM.apart([]) < 1e-4
    assert ARM.apart([Weight(-1.0)]) > 50


@pytest.mark.parametrize("seed", range(2))
def test_a_scattered_arm(seed):
    scatter = draw_scatter(np.random.default_rng(seed), arm.Arm.PARAMETERS, ORDINARY)
    assert ARM.apart([], scatter=scatter) > 50
    assert ARM.apart(arm_deeds(scatter), scatter=scatter) < 1e-4


def _play(force, gap, load):
    closed = np.tanh(force / load)
    return gap * closed, gap / load * (1 - closed**2)


@pytest.mark.parametrize(
    ("bench", "effect", "ours"),
    [
        (PLATFORM, {"physics": "backlash", "location": "leg1/drive", "half_gap": 2e-5, "smooth": 2.0},
         [ExtraStrain("leg1/drive", Strain(Along(slice(0, 1), partial(_play, gap=2e-5, load=2.0))))]),
        (ARM, {"physics": "backlash", "location": "joint3/drive", "half_gap": 5e-5, "smooth": 0.5},
         [ExtraStrain("joint3/drive", Strain(Along(slice(0, 1), partial(_play, gap=5e-5, load=0.5))))]),
        (PLATFORM, {"physics": "payload", "location": "platform", "mass": 60.0},
         [ToolLoad(np.array([0, 0, -60.0 * 9.80665, 0, 0, 0]))]),
        (ARM, {"physics": "payload", "location": "tool", "mass": 3.0},
         [ToolLoad(np.array([0, 0, -3.0 * 9.80665, 0, 0, 0]))]),
        (PLATFORM, {"physics": "lead_error", "location": "leg2/drive", "ratio": 5e-4},
         [Travel(1, 5e-4 * PLATFORM.q[:, 1])]),
        (PLATFORM, {"physics": "geometric_offset", "location": "leg5", "place": "leg5_u1",
                    "translation": [-7e-5, 4e-5, 5e-5]}, [MovedJoint("leg5_u1", (-7e-5, 4e-5, 5e-5, 0, 0, 0))]),
        (ARM, {"physics": "geometric_offset", "location": "joint4", "place": "joint4", "rotation": [0.0, 2e-3, 1e-3]},
         [MovedJoint("joint4", (0, 0, 0, 0.0, 2e-3, 1e-3))]),
    ],
    ids=lambda value: value["physics"] if isinstance(value, dict) else "",
)  # fmt: skip
def test_an_effect_on_a_machine(bench, effect, ours):
    assert bench.apart([], [effect]) > 2
    assert bench.apart(ours, [effect]) < 0.01


@pytest.mark.parametrize("module", [platform, arm])
def test_the_robot_file_is_the_nominal_machine(module):
    name = "six_ups" if module is platform else "elastic_arm"
    assert (ROBOTS / name / f"{name}.urdf").read_text() == module.robot_file()
