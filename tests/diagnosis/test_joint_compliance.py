"""Arms under their own weight, seen by markers: which joint yields, found without being told what to look for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.recordings import Noise, Recording, Tolerances

from ..as_written import as_written
from ..reference.posed_tree import PosedTree

TORSO = Path(__file__).parents[1] / "robots/torso/torso.urdf"
ARM = ("swing", "lift", "elbow", "wrist")
JOINTS = ("turn", "bend", *(f"{side}_{name}" for side in ("left", "right") for name in ARM))
MARKERS = ("left_ball", "right_ball", "chest")
NOISE = 2e-4


def bench(tree: PosedTree, count: int = 40, seed: int = 2, noise: float = NOISE) -> Recording:
    q = tree.postures(JOINTS, count, seed)
    seen = tree.seen(q, MARKERS, noise, seed)
    return as_written(Recording(np.arange(float(count)), positions=q, markers=seen, noise=Noise(position=noise)))


def named(found):
    return [(finding.physics, finding.location) for finding in found.findings if finding.physics != "self_weight"]


@pytest.mark.parametrize(
    ("joint", "aspect"),
    [("turn", "across"), *(pytest.param(name, "about", marks=pytest.mark.slow) for name in ("bend", "left_swing"))],
)
def test_the_joint_that_yields_is_named(joint, aspect):
    tree = PosedTree(TORSO, **{aspect: {joint: 4e-4}})
    found = diagnose(prup_pin.load(TORSO), bench(tree))
    assert found.verdict == "explained"
    assert named(found) == [("joint_compliance", joint)]
    finding = next(item for item in found.findings if item.physics == "joint_compliance")
    assert finding.effect.place.aspect == aspect
    fitted = finding.parameters["compliance"]
    wide = fitted.interval[1] - fitted.interval[0]
    assert abs(fitted.value - 4e-4) < 0.75 * wide
    assert wide < 0.2 * 4e-4
    assert any(item.physics == "self_weight" for item in found.findings)


@pytest.mark.slow
def test_a_rigid_torso_lacks_nothing_and_says_what_it_could_not_show():
    found = diagnose(prup_pin.load(TORSO), bench(PosedTree(TORSO)))
    assert found.verdict == "nothing_missing"
    assert not found.findings
    hidden = {item.location: item.smallest for item in found.not_detectable if item.physics == "joint_compliance"}
    # the elbow carries half a kilogram on a short lever
    assert hidden["left_elbow (about)"] > 2e-5
    assert hidden["turn (about)"] is None  # no weight turns a vertical axis


@pytest.mark.slow
def test_what_is_too_small_is_not_named_but_told():
    tree = PosedTree(TORSO, about={"left_elbow": 1e-5})
    found = diagnose(prup_pin.load(TORSO), bench(tree))
    assert not named(found)
    hidden = {item.location: item.smallest for item in found.not_detectable if item.physics == "joint_compliance"}
    assert hidden["left_elbow (about)"] > 1e-5


@pytest.mark.slow
def test_springs_that_the_user_gives_are_judged_beside_joints_that_are_rigid():
    tree = PosedTree(TORSO, about={"bend": 4e-4, "left_swing": 5e-4})
    robot = prup_pin.load(TORSO, joint_stiffness={"bend": 2500.0})
    assert named(diagnose(robot, bench(tree))) == [("joint_compliance", "left_swing")]


@pytest.mark.slow
def test_zeros_within_their_tolerance_are_none_of_the_findings():
    draw = np.random.default_rng(5)
    offsets = dict(zip(JOINTS, 2e-3 * draw.standard_normal(len(JOINTS)), strict=True))
    tree = PosedTree(TORSO, about={"bend": 4e-4}, offsets=offsets)
    recording = replace(bench(tree, 80), tolerances=Tolerances(encoder_offset=2e-3))
    found = diagnose(prup_pin.load(TORSO), recording)
    assert named(found) == [("joint_compliance", "bend")]
    assert found.after["fit"] < 1.1


@pytest.mark.slow
def test_a_robot_that_was_weighed_out_does_not_weigh():
    tree = PosedTree(TORSO, about={"bend": 4e-4}, weighs=False)
    q = tree.postures(JOINTS, 60, 3)
    draw = np.random.default_rng(4)
    wrench = draw.uniform(-40, 40, (60, 6)) * np.array([1, 1, 1, 0.1, 0.1, 0.1])
    rows = zip(*q.values(), strict=True)
    poses = [
        tree.markers(dict(zip(q, row, strict=True)), MARKERS, load, "left_ball")
        for row, load in zip(rows, wrench, strict=True)
    ]
    seen = {name: np.array([pose[name][:3, 3] for pose in poses]) for name in MARKERS}
    seen = {name: values + NOISE * draw.standard_normal(values.shape) for name, values in seen.items()}
    recording = Recording(np.arange(60.0), positions=q, markers=seen, wrench=wrench, noise=Noise(position=NOISE))
    found = diagnose(prup_pin.load(TORSO, tool="left_ball"), recording)
    assert [(item.physics, item.location) for item in found.findings] == [("joint_compliance", "bend")]


@pytest.mark.slow
def test_a_few_joints_that_yield_are_named_and_not_all_of_them():
    soft = {"bend": 4e-4, "left_swing": 5e-4, "right_lift": 6e-4}
    found = diagnose(prup_pin.load(TORSO), bench(PosedTree(TORSO, about=soft)))
    assert sorted(named(found)) == [("joint_compliance", joint) for joint in soft]


@pytest.mark.slow
def test_gears_that_all_yield_are_one_finding_with_a_value_for_each_joint():
    soft = dict(zip(JOINTS, (1e-4, 2e-4, *(4e-4, 3e-4, 5e-4, 6e-4) * 2), strict=True))
    found = diagnose(prup_pin.load(TORSO), bench(PosedTree(TORSO, about=soft), 80))
    assert named(found) == [("joint_compliance", "robot")]
    finding = next(item for item in found.findings if item.physics == "joint_compliance")
    assert set(JOINTS) <= set(finding.candidates)
    assert found.after["heldout"] < 1.1
    for joint in ("bend", "left_swing", "right_swing", "right_lift", "left_elbow"):
        fitted = finding.parameters[joint]
        wide = fitted.interval[1] - fitted.interval[0]
        assert wide < 0.6 * soft[joint]
        assert abs(fitted.value - soft[joint]) < 0.75 * wide
    # about a vertical axis nothing turns: these data say nothing of it
    low, high = finding.parameters["turn"].interval
    assert (low, high) == (0.0, 1.0)


BEARING = """<robot name="arm">
  <link name="base"/><link name="plinth"/><link name="seat"/>
  <link name="column">{column}</link><link name="beam">{beam}</link>
  <joint name="stand" type="fixed"><parent link="base"/><child link="plinth"/><origin rpy="0.3 -0.2 0"/></joint>
  <joint name="turn" type="revolute"><parent link="plinth"/><child link="seat"/>
    <origin xyz="0 0 0.4" rpy="0 0 {turned}"/><axis xyz="0 0 1"/>{limit}</joint>
  <joint name="mount" type="fixed"><parent link="seat"/><child link="column"/><origin rpy="0 0 {back}"/></joint>
  <joint name="lift" type="revolute"><parent link="column"/><child link="beam"/><origin xyz="0.1 0 0.3"/>
    <axis xyz="0 1 0"/>{limit}</joint>
</robot>"""


def bearing(path: Path, turned: float) -> Path:
    """Write an arm on a turning joint whose frame is drawn turned about its own axis; it is the same arm."""
    parts = {
        name: f'<inertial><origin xyz="{at}"/><mass value="{mass}"/>'
        '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
        for name, at, mass in (("column", "0.1 0.05 0.2", 9), ("beam", "0.4 0 0", 5))
    }
    limit = '<limit lower="-2" upper="2" effort="1" velocity="1"/>'
    path.write_text(BEARING.format(turned=turned, back=-turned, limit=limit, **parts), encoding="utf-8")
    return path


@pytest.mark.slow
def test_a_joint_that_tilts_one_way_is_the_same_however_its_frame_is_drawn(tmp_path):
    drawn, redrawn = bearing(tmp_path / "drawn.urdf", 0.0), bearing(tmp_path / "redrawn.urdf", 0.9)
    tilts = 4e-4 * np.outer((np.cos(0.5), np.sin(0.5), 0.0), (np.cos(0.5), np.sin(0.5), 0.0))
    tree = PosedTree(drawn, across={"turn": tilts})
    q = tree.postures(("turn", "lift"), 20, 3)
    seen = tree.seen(q, ("beam", "column"), NOISE / 4, 3)
    recording = Recording(np.arange(20.0), positions=q, markers=seen, noise=Noise(position=NOISE / 4))
    found = [diagnose(prup_pin.load(path, tool="beam"), recording) for path in (drawn, redrawn)]
    for each, direction in zip(found, (0.5, -0.4), strict=True):
        finding = next(item for item in each.findings if item.physics == "joint_compliance")
        assert named(each) == [("joint_compliance", "turn")]
        assert finding.effect.place.aspect == "across by direction"
        values = finding.parameters
        assert values["compliance"].value == pytest.approx(4e-4, rel=0.02)
        assert values["share"].value < 0.05
        apart = values["direction"].value - direction
        assert abs(apart - np.pi * np.round(apart / np.pi)) < 0.02
    one, other = (each.after["fit"] for each in found)
    assert one == pytest.approx(other, rel=1e-6)
