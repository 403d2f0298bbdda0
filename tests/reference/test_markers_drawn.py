"""Arms under their own weight as they are drawn: where markers end up, sizes, answers, and files that are readable."""

from __future__ import annotations

import json

import numpy as np
import pinocchio as pin
import pytest

import prup_pin
from prup_pin.recordings import Recording, read_recording
from prup_pin.simulation import effect_named, simulate
from tests.reference.concealed.chain import GRAVITY
from tests.reference.concealed.efforts import KINDS
from tests.reference.concealed.markers import CAMERAS, PHYSICS, SPRUNG, draw_markers, options, write
from tests.reference.concealed.rotations import matrix
from tests.reference.concealed.sagging import Sagging

UR5 = KINDS["ur5"]
MARKERS = ("tool0", "forearm_link")


def poses(count=5):
    return np.array(UR5.centre) + np.random.default_rng(1).uniform(-1, 1, (count, 6))


@pytest.mark.parametrize("robot", CAMERAS)
def test_a_rigid_arm_holds_its_markers_where_the_robot_file_has_them(robot):
    kind, markers = KINDS[robot], CAMERAS[robot][1]
    q = np.array(kind.centre) + np.random.default_rng(2).uniform(-1, 1, (3, len(kind.centre)))
    seen = Sagging(kind.chain(), kind.tool).seen(q, markers, np.zeros(3))
    loaded = prup_pin.load(robot)
    model = loaded.mechanism.model
    data = model.createData()
    for k, pose in enumerate(q):
        full = pin.neutral(model)
        for joint, x in zip(kind.chain().joints, pose, strict=True):
            found = model.joints[model.getJointId(joint.name)]
            full[found.idx_q : found.idx_q + found.nq] = x if found.nq == 1 else [np.cos(x), np.sin(x)]
        pin.framesForwardKinematics(model, data, full)
        there = [data.oMf[model.getFrameId(name)].translation for name in markers]
        assert np.abs(seen[k] - there).max() < 1e-12


def test_an_arm_of_springs_sags_as_the_package_has_it():
    springs = {joint.name: 4000.0 / (1 + i) for i, joint in enumerate(UR5.chain().joints)}
    robot = prup_pin.load("ur5", joint_stiffness=springs)
    q = poses()
    recording = Recording(
        time=np.arange(5.0),
        positions={name: q[:, i] for i, name in enumerate(springs)},
        markers={name: np.zeros((5, 3)) for name in MARKERS},
    )
    ours = Sagging(UR5.chain(), UR5.tool, springs=springs).seen(q, MARKERS, np.zeros(5))
    rigid = Sagging(UR5.chain(), UR5.tool).seen(q, MARKERS, np.zeros(5))
    weight = effect_named("self_weight", "robot", "", {"scale": 1.0}, robot.mechanism)
    theirs = simulate(robot, recording, [weight]).markers
    assert np.abs(ours - rigid).max() > 0.01
    for k, name in enumerate(MARKERS):
        assert np.abs(ours[:, k] - theirs[name]).max() < 1e-8


def test_a_joint_that_tilts_bears_the_moment_of_what_hangs_beyond_it():
    """One soft joint: it is turned by compliance times moment, where the arm hangs when turned."""
    chain, q = UR5.chain(), poses()
    effect = {"physics": "joint_compliance", "location": "wrist_1_joint", "about": 2e-3, "across": 5e-3}
    soft, rigid = Sagging(chain, UR5.tool, [effect]), Sagging(chain, UR5.tool)
    turns, places, housings = soft.settled(q)
    firm, _, _ = rigid.settled(q)
    moment = np.zeros((len(q), 3))
    for link in chain.links:
        if link.body >= 3:
            centre = places[link.body] + turns[link.body] @ link.centre
            moment += np.cross(centre - places[3], link.mass * GRAVITY)
    local = (housings[3].swapaxes(-1, -2) @ moment[..., None])[..., 0]
    axis = chain.joints[3].axis
    about = local @ axis
    tilt = 5e-3 * (local - about[:, None] * axis)
    expected = housings[3] @ matrix(tilt) @ matrix((q[:, 3] + 2e-3 * about)[:, None] * axis)
    assert np.abs(turns[3] - expected).max() < 1e-11
    assert np.abs(turns[3] - firm[3]).max() > 5e-3


def test_what_is_off_shows_where_it_should():
    chain, q = UR5.chain(), poses()
    usual = Sagging(chain, UR5.tool).seen(q, MARKERS, np.zeros(5))

    def seen(scatter=None, *effects):
        return Sagging(chain, UR5.tool, effects, scatter).seen(q, MARKERS, np.arange(5.0)) - usual

    turned = seen({"pose_sensor.rz": 0.01, "pose_sensor.x": 0.002})
    expected = usual @ matrix([0, 0, 0.01]).T + [0.002, 0, 0] - usual
    assert np.abs(turned - expected).max() < 1e-12
    moved = seen({"tool0.tx": 0.003, "elbow_joint.encoder_slope": 0.0})
    assert np.linalg.norm(moved[:, 0], axis=-1) == pytest.approx(np.full(5, 0.003))
    assert np.abs(moved[:, 1]).max() == 0
    late = seen({"elbow_joint.encoder_offset": 0.002})
    same = seen(None, {"physics": "encoder_offset", "location": "elbow_joint", "offset": 0.002})
    by_hand = Sagging(chain, UR5.tool).seen(q + 0.002 * np.eye(6)[2], MARKERS, np.zeros(5)) - usual
    assert np.abs(late - by_hand).max() < 1e-12
    assert np.abs(same - by_hand).max() < 1e-12
    away = seen(None, {"physics": "pose_sensor_drift", "location": "pose_sensor", "speed": [0, 1e-4, 0]})
    assert np.abs(away - np.arange(5.0)[:, None, None] * [0, 1e-4, 0]).max() < 1e-12


def test_an_effect_has_its_size_and_a_seed_decides_everything():
    drawn, again = (draw_markers(7, "panda", ["joint_compliance"], (5.0, 8.0)) for _ in range(2))
    (effect,) = drawn["truth"]["effects"]
    assert 4.7 < effect["size"] < 8.5
    assert effect["strength"] > 0.97 * effect["size"]
    assert max(effect["left"], effect["strained"]) > 0.97 * effect["size"]
    assert drawn["truth"] == again["truth"]
    assert (drawn["fit"]["p"] == again["fit"]["p"]).all()


@pytest.mark.parametrize("sprung", [False, True])
def test_the_recording_tells_what_was_seen_and_no_more(sprung, tmp_path):
    drawn = draw_markers(6, "xarm7", sprung=sprung)
    write(drawn, tmp_path / "out", tmp_path / "sealed", "device")
    recording = read_recording(tmp_path / "out/device.csv")
    assert set(recording.markers) == set(drawn["truth"]["markers"])
    assert len(recording.time) == len(drawn["fit"]["time"])
    about = json.loads((tmp_path / "out/device.json").read_text())
    assert set(about) - {"notes"} == {"robot", "position_noise", "tolerances"}
    assert ("stiffness" in about["tolerances"]) == ("notes" in about) == bool(options(drawn)) == sprung


def test_every_physics_that_is_drawn_can_be_acted_out():
    assert all(hasattr(Sagging, f"_effect_{name}") for name in (*PHYSICS, *SPRUNG, "alien"))
