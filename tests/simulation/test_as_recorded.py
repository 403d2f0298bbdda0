"""Robots as recordings see them: trees without a tool, joints that nobody recorded, a base that floats."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.prospects import prospects
from prup_pin.errors import InputError, UnknownNameError
from prup_pin.laws import Place, law_at
from prup_pin.loading import Reading
from prup_pin.recordings import Noise, Recording, write_recording
from prup_pin.simulation import CorrectedModel, as_recorded, effect_named, read_model, simulate, write_model

from ..reference.posed_tree import PosedTree, placed, turned

TORSO = Path(__file__).parents[1] / "robots/torso/torso.urdf"
JOINTS = ("turn", "bend", *(f"{side}_{name}" for side in ("left", "right") for name in ("swing", "lift", "elbow")))
MARKERS = ("left_fore", "right_fore", "chest")


def bench(
    tree: PosedTree, count: int = 4, joints=JOINTS, markers=MARKERS, noise: float = 0.0, seed: int = 3
) -> Recording:
    q = tree.postures(joints, count, seed)
    seen = tree.seen(q, markers, noise, seed)
    known = Noise(position=noise) if noise else Noise()
    return Recording(np.arange(float(count)), positions=q, markers=seen, noise=known)


def test_markers_on_several_branches_are_where_an_independent_tree_has_them():
    recording = bench(PosedTree(TORSO))
    found = simulate(prup_pin.load(TORSO), recording)
    for name in MARKERS:
        assert np.abs(found.markers[name] - recording.markers[name]).max() < 1e-12


def test_a_tree_without_a_tool_has_the_first_marker_for_one():
    adapted = as_recorded(prup_pin.load(TORSO), bench(PosedTree(TORSO)))
    assert adapted.tool == adapted.robot.mechanism.tool.name == "left_fore"
    assert any("no tool frame" in text and "left_fore" in text for text in adapted.remarks)


def test_a_chain_without_a_tool_ends_in_one_link(tmp_path):
    """What was measured without a name is of the one link that nothing follows; of two branches it may be either."""
    joint = (
        '<link name="{child}"/><joint name="to_{child}" type="{type}"><parent link="{parent}"/><child link="{child}"/>'
        '<origin xyz="0 0 0.4"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>'
    )
    chain = joint.format(child="arm", parent="base", type="revolute") + joint.format(
        child="hand", parent="arm", type="fixed"
    )
    path = tmp_path / "chain.urdf"
    path.write_text(f'<robot name="chain"><link name="base"/>{chain}</robot>')
    q = {"to_arm": np.linspace(-1, 1, 3)}
    recording = Recording(np.arange(3.0), positions=q, position=np.zeros((3, 3)))
    adapted = as_recorded(prup_pin.load(path), recording)
    assert adapted.tool == adapted.robot.mechanism.tool.name == "hand"
    assert any("no tool frame" in text and "hand" in text for text in adapted.remarks)
    assert adapted.robot.home.base_from_tool[2, 3] == pytest.approx(0.8)
    assert as_recorded(prup_pin.load(path), replace(recording, position=None)).tool is None
    path.write_text(
        f'<robot name="chain"><link name="base"/>{chain}{joint.format(child="eye", parent="arm", type="fixed")}</robot>'
    )
    assert as_recorded(prup_pin.load(path), recording).tool is None


def test_joints_off_the_way_are_held_and_named():
    adapted = as_recorded(prup_pin.load(TORSO), bench(PosedTree(TORSO)))
    assert set(adapted.robot.mechanism.actuated) == set(JOINTS)
    assert {"hip", "left_wrist", "right_wrist", "left_thumb"} <= set(adapted.held)
    told = next(text for text in adapted.remarks if "without a column q" in text)
    assert "hip" in told
    assert "--home" in told


def test_a_joint_on_the_way_that_nobody_recorded_is_asked_for():
    recording = bench(PosedTree(TORSO))
    without = replace(recording, positions={name: q for name, q in recording.positions.items() if name != "bend"})
    with pytest.raises(UnknownNameError, match=re.escape("q.bend")):
        simulate(prup_pin.load(TORSO), without)


def test_a_joint_on_the_way_may_be_held_where_the_user_says():
    tree = PosedTree(TORSO)
    q = tree.postures(JOINTS, 3, 0) | {"bend": np.full(3, 0.3)}
    seen = tree.seen(q, MARKERS, 0.0, 0)
    recording = Recording(np.arange(3.0), positions={k: v for k, v in q.items() if k != "bend"}, markers=seen)
    found = simulate(prup_pin.load(TORSO, home={"bend": 0.3}), recording)
    assert np.abs(found.markers["right_fore"] - seen["right_fore"]).max() < 1e-12


def test_a_joint_that_mimics_another_follows_it():
    wrists = (*JOINTS, "left_wrist", "left_thumb")
    tree = PosedTree(TORSO)
    q = tree.postures(wrists, 3, 2)
    seen = tree.seen(q | {"left_finger": 0.1 - 0.8 * q["left_thumb"]}, ("finger", "left_hand"), 0.0, 0)
    recording = Recording(np.arange(3.0), positions=q, markers=seen)
    found = simulate(prup_pin.load(TORSO), recording)
    assert np.abs(found.markers["finger"] - seen["finger"]).max() < 1e-12


def test_held_joints_weigh_where_they_are_held():
    whole = prup_pin.load(TORSO)
    held = whole.with_held_joints({"hip": 0.4, "left_finger": 0.0})
    assert "hip" not in held.mechanism.actuated
    assert sum(body.mass for body in held.model.inertias) == pytest.approx(sum(b.mass for b in whole.model.inertias))
    base = [float(robot.model.inertias[0].mass) for robot in (whole, held)]
    assert base[1] - base[0] == pytest.approx(5.0)  # the leg has become a part of the base


def test_a_base_that_floats_stands_still_and_is_told(tmp_path):
    text = TORSO.read_text(encoding="utf-8")
    root = '<link name="world"/><joint name="root" type="floating"><parent link="world"/><child link="base"/></joint>'
    path = tmp_path / "floating.urdf"
    path.write_text(text.replace('<robot name="torso">', f'<robot name="torso">{root}'), encoding="utf-8")
    recording = bench(PosedTree(TORSO))
    found = simulate(prup_pin.load(path), recording)
    assert any("floats" in text and "frame_position" in text for text in found.remarks)
    assert np.abs(found.markers["chest"] - recording.markers["chest"]).max() < 1e-12


def test_how_a_file_was_read_stands_in_the_model_and_comes_back(tmp_path):
    reading = Reading(
        tool="left_hand",
        joint_stiffness={"turn": 1e4, "bend": 2e4},
        home={"hip": 0.1},
        parameters={"bend.stiffness": 3e4},
        held={"hip": 0.1, "left_finger": 0.2},
    )
    write_model(CorrectedModel(str(TORSO), reading=reading), tmp_path / "model.json")
    model = read_model(tmp_path / "model.json")
    assert model.reading == reading
    robot = model.load()
    assert robot.parameters["bend.stiffness"].value == 3e4
    assert robot.mechanism.tool.name == "left_hand"
    assert "hip" not in robot.mechanism.actuated


def test_joints_that_yield_survive_the_file(tmp_path):
    mechanism = prup_pin.load(TORSO).mechanism
    place = Place("robot", "each joint")
    each = {item.name: 1e-4 for item in law_at("joint_compliance", place).quantities_at(place, mechanism)}
    effects = (
        effect_named("joint_compliance", "bend", "across", {"compliance": 2e-4}, mechanism),
        effect_named("joint_compliance", "robot", "each joint", each, mechanism),
    )
    write_model(CorrectedModel(str(TORSO), effects), tmp_path / "model.json")
    again = read_model(tmp_path / "model.json").effects
    assert [(item.law, item.place, item.values) for item in again] == [(e.law, e.place, e.values) for e in effects]


@pytest.mark.parametrize(
    ("reading", "wrong"),
    [
        ('{"tol": "left"}', "reading.tol"),
        ('{"home": [1]}', "reading.home"),
        ('{"actuated": "turn"}', "reading.actuated"),
    ],
)
def test_what_is_wrong_with_a_reading_is_named(tmp_path, reading, wrong):
    write_model(CorrectedModel(str(TORSO)), tmp_path / "model.json")
    text = (tmp_path / "model.json").read_text(encoding="utf-8")
    (tmp_path / "model.json").write_text(text.replace('"version": 1,', f'"version": 1, "reading": {reading},'))
    with pytest.raises(prup_pin.errors.RecordingFileError, match=re.escape(wrong)):
        read_model(tmp_path / "model.json")


def test_the_device_of_reference_stands_where_its_tracker_says():
    # the reference itself: a rigid motion of the tracker moves all markers alike
    tracker = placed(turned([0.3, -0.2, 1.0]), [2.0, -1.0, 0.5])
    near, far = (bench(PosedTree(TORSO, tracker=at)) for at in (np.eye(4), tracker))
    moved = near.markers["chest"] @ tracker[:3, :3].T + tracker[:3, 3]
    assert np.abs(moved - far.markers["chest"]).max() < 1e-12


def test_all_of_it_from_the_command_line(tmp_path):
    from typer.testing import CliRunner

    from prup_pin.cli import app

    tree = PosedTree(TORSO, about={"bend": 1 / 5e3})
    recording = replace(bench(tree, 40, noise=1e-4), robot=str(TORSO))
    write_recording(recording, tmp_path / "bench.csv")
    options = ["--joint-stiffness", "bend=1e6", "--set", "bend.stiffness=5e3", "--tool", "chest", "--no-report"]
    out = tmp_path / "out"
    answer = CliRunner().invoke(app, ["diagnose", str(tmp_path / "bench.csv"), "--out", str(out), *options])
    assert answer.exit_code == 0, answer.output
    model = read_model(out / "corrected_model.json")
    assert model.reading.parameters == {"bend.stiffness": 5e3}
    assert model.reading.tool == "chest"
    predicted = ["predict", str(out / "corrected_model.json"), str(tmp_path / "bench.csv"), "--out", str(out / "p.csv")]
    answer = CliRunner().invoke(app, predicted)
    assert answer.exit_code == 0, answer.output
    simulated = simulate(model.load(), recording, model.effects)
    for name in MARKERS:
        apart = simulated.markers[name] - recording.markers[name]
        assert np.sqrt(np.mean(apart**2)) < 1.1e-4


def ur5_log(**names: str) -> Recording:
    """Return a log of a ur5 in motion with columns of all six joints, some under another name."""
    time = np.linspace(0, 4, 400)
    joints = prup_pin.load("ur5").mechanism.actuated
    q = {name: 0.3 * np.sin((1 + k) * time) for k, name in enumerate(joints)}
    tau = {names.get(name, name): np.ones(len(time)) for name in joints}
    return Recording(time, positions=q, efforts=tau)


@pytest.mark.parametrize("ask", [diagnose, simulate, prospects])
def test_a_misspelt_joint_is_refused_by_all_that_read_a_recording(ask):
    said = "no joint 'elbo_joint' (column tau.elbo_joint); did you mean elbow_joint?"
    with pytest.raises(InputError, match=re.escape(said)):
        ask(prup_pin.load("ur5"), ur5_log(elbow_joint="elbo_joint"))


def test_all_misspelt_joints_are_told_at_once():
    with pytest.raises(InputError, match="elbow_joint") as told:
        as_recorded(prup_pin.load("ur5"), ur5_log(elbow_joint="elbo_joint", wrist_2_joint="wirst_2_joint"))
    assert "column tau.elbo_joint" in str(told.value)
    assert "column tau.wirst_2_joint" in str(told.value)


@pytest.mark.parametrize("group", ["positions", "velocities", "accelerations", "efforts"])
def test_a_misspelt_joint_is_refused_in_every_group_of_columns(group):
    log = ur5_log()
    columns = {name.replace("elbow", "elbwo"): values for name, values in log.positions.items()}
    with pytest.raises(InputError, match="did you mean elbow_joint"):
        as_recorded(prup_pin.load("ur5"), replace(log, **{group: columns}))


def test_letters_exchanged_in_a_short_name_are_a_misspelling():
    """The one column that is no joint's is that of the one joint without a column."""
    mechanism = prup_pin.load("3prup").mechanism
    names = {name: name for name in mechanism.actuated} | {"leg1_slide": "lge1_sldie"}
    log = Recording(time=np.arange(3.0), positions={name: np.full(3, 0.4) for name in names.values()})
    with pytest.raises(InputError, match=r"column q\.lge1_sldie.; did you mean leg1_slide"):
        as_recorded(prup_pin.load("3prup"), log)


def test_a_foreign_joint_is_not_used_and_no_misspelling():
    robot, log = prup_pin.load("ur5"), ur5_log()
    log = replace(log, efforts={**log.efforts, "gripper_joint": np.ones(len(log))})
    assert "tau.gripper_joint" in prospects(robot, log).unused_columns


@pytest.mark.parametrize("foreign", ["gripper_joint", "wrist_4_joint", "left_shoulder_pan_joint"])
def test_a_foreign_joint_stays_so_beside_joints_without_a_column(foreign):
    log = ur5_log()
    as_recorded(prup_pin.load("ur5"), replace(log, efforts={foreign: np.ones(len(log))}))


@pytest.mark.parametrize("ask", [diagnose, prospects])
def test_a_log_without_any_joint_of_the_robot_is_of_another(ask):
    log = ur5_log()
    foreign = {name: f"panda_joint{k}" for k, name in enumerate(log.positions, start=1)}
    log = replace(
        log,
        positions={foreign[name]: values for name, values in log.positions.items()},
        efforts={foreign[name]: values for name, values in log.efforts.items()},
    )
    with pytest.raises(InputError, match=r"another robot: it has q\.panda_joint1, .*; expected joints of 'ur5', q\.sh"):
        ask(prup_pin.load("ur5"), log)


def test_a_column_beside_its_joint_s_own_is_no_misspelling():
    log = ur5_log()
    as_recorded(prup_pin.load("ur5"), replace(log, efforts={**log.efforts, "elbo_joint": np.ones(len(log))}))


@pytest.mark.parametrize("group", ["positions", "efforts"])
def test_the_one_column_too_many_is_that_of_the_one_joint_without_a_column(group):
    robot, log = prup_pin.load("ur5"), ur5_log()
    columns = {name.replace("wrist_3", "wrist_4"): values for name, values in log.positions.items()}
    with pytest.raises(InputError, match=re.escape("did you mean wrist_3_joint?")):
        as_recorded(robot, replace(log, **{group: columns}))
    # two foreign ones, or two without a column, are another device's
    as_recorded(robot, replace(log, **{group: {**columns, "wrist_5_joint": np.ones(len(log))}}))
    as_recorded(robot, replace(log, **{group: {k: v for k, v in columns.items() if k != "wrist_2_joint"}}))


@pytest.mark.parametrize(
    ("asked", "motion", "why"),
    [
        (False, False, "no column tau.<joint>"),
        (True, False, "each row is a posture at rest"),
        (True, True, "next to poses each row is taken at rest"),
    ],
)
def test_a_law_of_efforts_that_changes_nothing_says_so(asked, motion, why):
    log = ur5_log()
    log = replace(log, time=log.time * (1 if motion else 1000), efforts=log.efforts if asked else {})
    log = replace(log, position=np.ones((len(log), 3))).select(slice(0, 20))
    robot = prup_pin.load("ur5", tool="tool0")
    rubs = effect_named(
        "coulomb_friction", "elbow_joint", "effort", {"limit": 1.0, "presliding": 1e-3}, robot.mechanism
    )
    told = [text for text in simulate(robot, log, [rubs]).remarks if "has no effect" in text]
    assert len(told) == 1, told
    assert why in told[0]
    alone = replace(ur5_log(), position=None)
    assert not any("has no effect" in text for text in simulate(robot, alone, [rubs]).remarks)
