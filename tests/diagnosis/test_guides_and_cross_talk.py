"""A gantry whose guide is bowed or twisted, or whose load cell talks across, by a simulator of its own in plain numpy.

What a slide carries is led along an arc that is integrated in small steps, which is exact; the law has a parabola.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from prup_pin.diagnosis import diagnose
from prup_pin.laws import Inputs
from prup_pin.recordings import Noise, Recording
from prup_pin.simulation import Simulator, effect_named

from ..statics.build import RobotFile

#: Joints: kind, place (m) and turn (rpy, rad) on the one before, axis, stiffness of its drive.
JOINTS = {
    "X": ("prismatic", (0.0, 0.0, 0.9), (0.0, 0.0, 0.0), (1, 0, 0), 2e7),
    "Y": ("prismatic", (0.1, 0.0, 0.2), (0.0, 0.0, 0.3), (0, 1, 0), 1e7),
    "Z": ("prismatic", (0.0, 0.1, -0.3), (0.0, 0.0, 0.0), (0, 0, 1), 3e7),
    "C": ("revolute", (0.0, 0.0, -0.2), (0.0, 0.4, 0.0), (0, 0, 1), 4e4),
}
TOOL = np.array([0.15, 0.0, -0.2])
LOW, HIGH = np.array([-0.5, -0.4, -0.3, -1.5]), np.array([0.5, 0.4, 0.2, 1.5])
NOISE = Noise(position=5e-6, rotation=2e-5, force=0.1, moment=0.01)
WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")


@dataclass
class Gantry:
    """The machine: curvatures of its guides (3,) about the axes of their own frames [rad/m], its load cell's matrix."""

    curvature: dict = field(default_factory=dict)
    talk: np.ndarray = field(default_factory=lambda: np.eye(6))
    stiffer: dict = field(default_factory=dict)
    moved: dict = field(default_factory=dict)

    def led(self, name: str, way: float) -> tuple[np.ndarray, Rotation]:
        """Return where a slide is that went `way` along its guide: the arc in steps, by the midpoint of each."""
        axis, curvature = np.array(JOINTS[name][3], float), np.array(self.curvature.get(name, np.zeros(3)))
        steps = np.arange(50) + 0.5
        point = sum(Rotation.from_rotvec(curvature * way * step / 50).apply(axis) for step in steps) * way / 50
        return point, Rotation.from_rotvec(curvature * way)

    def placed(self, q: np.ndarray) -> tuple[np.ndarray, Rotation, list]:
        """Return the tool's place, and each joint's axis and point."""
        point, turn, lines = np.zeros(3), Rotation.identity(), []
        for (name, (kind, xyz, rpy, axis, _)), value in zip(JOINTS.items(), q, strict=True):
            point = point + turn.apply(np.array(xyz) + self.moved.get(name, np.zeros(3)))
            turn = turn * Rotation.from_euler("xyz", rpy)
            lines.append((kind, turn.apply(axis), point))
            way, more = self.led(name, value) if kind == "prismatic" else (
                np.zeros(3), Rotation.from_rotvec(value * np.array(axis))
            )  # fmt: skip
            point, turn = point + turn.apply(way), turn * more
        return point + turn.apply(TOOL), turn, lines

    def loaded(self, q: np.ndarray, wrench: np.ndarray) -> tuple[np.ndarray, Rotation]:
        """Return the tool's place under a wrench on it, drives as springs: the joints stand where these balance it."""
        stands = q.copy()
        for _ in range(4):
            tool, _, lines = self.placed(stands)
            for index, (kind, axis, point) in enumerate(lines):
                load = axis @ wrench[:3]
                if kind == "revolute":
                    load = axis @ (wrench[3:] + np.cross(tool - point, wrench[:3]))
                name = list(JOINTS)[index]
                stands[index] = q[index] + load / (JOINTS[name][4] * self.stiffer.get(name, 1.0))
        return self.placed(stands)[:2]

    def recording(self, seed: int, poses: int = 24, loads: int = 4) -> tuple[Recording, np.ndarray, np.ndarray]:
        """Return what is recorded in poses (p,) under loads (l,), and the true positions and rotation vectors."""
        draw = np.random.default_rng(seed)
        q = np.repeat(draw.uniform(LOW, HIGH, (poses, 4)), loads, axis=0)
        wrench = draw.uniform(-1, 1, (len(q), 6)) * ([300.0] * 3 + [30.0] * 3)
        wrench[::loads] = 0.0
        places = [self.loaded(*each) for each in zip(q, wrench, strict=True)]
        point, turn = np.array([each[0] for each in places]), Rotation.concatenate([each[1] for each in places])
        reported = wrench @ self.talk.T
        scatter = draw.standard_normal((len(q), 12)) * np.repeat([5e-6, 2e-5, 0.1, 0.01], 3)
        seen = Rotation.from_rotvec(scatter[:, 3:6]) * turn
        recording = Recording(
            np.arange(len(q)) * 3.0,
            positions={name: q[:, index] for index, name in enumerate(JOINTS)},
            position=point + scatter[:, :3],
            rotation=seen.as_rotvec(),
            noise=NOISE,
            wrench=reported + scatter[:, 6:],
        )
        return recording, point, turn.as_rotvec()


@pytest.fixture
def robot(tmp_path):
    file, parent = RobotFile(), "base"
    for name, (kind, xyz, rpy, axis, stiffness) in JOINTS.items():
        parent, before = file.link(f"{name}_part"), parent
        file.driven(name, kind, before, parent, xyz, rpy, axis)
        file.module(f"{name}_drive", "joint_spring", name, {"stiffness": stiffness})
    file.frame("tool", parent, TOOL)
    return file.load(tmp_path)


@pytest.mark.parametrize(
    ("name", "aspect", "values", "curvature"),
    [
        ("X", "", {"bow_y": 3e-3, "bow_z": -2e-3}, (0.0, 3e-3, -2e-3)),
        ("Y", "", {"bow_x": 4e-3, "bow_z": 1e-3}, (4e-3, 0.0, 1e-3)),
        ("Z", "", {"bow_x": -2e-3, "bow_y": 5e-3}, (-2e-3, 5e-3, 0.0)),
        ("Y", "twist", {"twist": 4e-3}, (0.0, 4e-3, 0.0)),
    ],
)
def test_a_guide_is_the_arc_that_is_integrated(robot, name, aspect, values, curvature):
    draw = np.random.default_rng(4)
    q = draw.uniform(LOW, HIGH, (12, 4))
    wrench = draw.uniform(-1, 1, (12, 6)) * ([300.0] * 3 + [30.0] * 3)
    turns = ("roll",) if aspect else [key.replace("bow_", "r") for key in values]

    def ours(factor):
        sizes = {**{key: factor * value for key, value in values.items()}, **dict.fromkeys(turns, 0.0)}
        effect = effect_named("straightness_error", name, aspect, sizes, robot.mechanism)
        return Simulator(robot, Inputs(np.arange(12.0), q, wrench, np.arange(12))).run([effect])

    machine = Gantry(curvature={name: curvature})
    places = [machine.loaded(*each) for each in zip(q, wrench, strict=True)]
    point, turn = np.array([each[0] for each in places]), Rotation.concatenate([each[1] for each in places])

    def apart(run):
        off = (Rotation.from_matrix(run.rotation) * turn.inv()).as_rotvec()
        return max(np.abs(run.position - point).max() / 5e-6, np.abs(off).max() / 2e-5)

    # what an arc is shorter than a parabola, along the guide, is of third order: some tenths of a micrometre
    assert apart(ours(1.0)) < 0.2
    assert apart(ours(0.5)) > 3.0


def held(found, **truth):
    """Assert that the first finding's parameters have these values, within intervals half as wide again."""
    for name, value in truth.items():
        fitted = found.findings[0].parameters[name]
        low, high = fitted.interval
        assert abs(fitted.value - value) < 0.75 * (high - low), (name, fitted.value, low, high)
        assert high - low < 0.5 * max(abs(value), 1e-3)


def named(found):
    return {(item.physics, str(item.effect.place)) for item in found.findings}


def test_a_bowed_guide_is_named_and_measured(robot):
    found = diagnose(robot, Gantry(curvature={"Y": (4e-3, 0.0, 1e-3)}).recording(1)[0])
    assert found.verdict == "explained"
    assert named(found) == {("straightness_error", "Y")}
    assert found.after["heldout"] < 1.1
    held(found, bow_x=4e-3, bow_z=1e-3, rx=0.0, rz=0.0)


@pytest.mark.slow
def test_a_twisted_guide_is_named_and_measured(robot):
    found = diagnose(robot, Gantry(curvature={"X": (3e-3, 0.0, 0.0)}).recording(2)[0])
    assert found.verdict == "explained"
    assert named(found) == {("straightness_error", "X (twist)")}
    assert found.after["heldout"] < 1.1
    held(found, twist=3e-3, roll=0.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("channel", "of", "share", "seed"),
    [("fx", "fz", 0.1, 3), pytest.param("fy", "fx", -0.1, 4, marks=pytest.mark.slow)],
)
def test_a_load_cell_that_talks_across_is_named(robot, channel, of, share, seed):
    talk = np.eye(6)
    talk[WRENCH.index(channel), WRENCH.index(of)] = share
    found = diagnose(robot, Gantry(talk=talk).recording(seed)[0])
    assert found.verdict == "explained"
    assert named(found) == {("wrench_sensor_crosstalk", f"wrench_sensor ({channel} by {of})")}
    assert found.after["heldout"] < 1.1
    held(found, share=share)


@pytest.mark.slow
def test_a_sound_gantry_is_accused_of_nothing(robot):
    found = diagnose(robot, Gantry().recording(5)[0])
    assert found.verdict == "nothing_missing"
    assert named(found) == set()


@pytest.mark.slow
def test_another_fault_is_not_taken_for_a_guide(robot):
    """A joint that sits beside its place, and a drive that is softer than drawn."""
    found = diagnose(robot, Gantry(moved={"C": np.array([3e-4, 0.0, 0.0])}, stiffer={"C": 0.8}).recording(6)[0])
    assert not {item.physics for item in found.findings} & {"straightness_error", "wrench_sensor_crosstalk"}
    assert found.after["heldout"] < 1.1
