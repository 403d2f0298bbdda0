"""Robots in motion as they are drawn: what effects add to efforts, sizes, noise, answers, files that are readable."""

from __future__ import annotations

import json

import numpy as np
import pytest

from prup_pin.recordings import read_recording
from tests.reference.concealed.chain import GRAVITY
from tests.reference.concealed.efforts import KINDS, PHYSICS, Logger, draw_efforts, draw_motion, write
from tests.reference.concealed.excitation import Excitation
from tests.reference.concealed.moving import Moving

UR5, BAR = KINDS["ur5"], KINDS["five_bar"]
T = np.arange(0.0, 12.0, 0.004)
RUN = Excitation(np.array(UR5.centre), np.full((6, 2), 0.2), np.full((6, 2), -0.1), 9.0, ((4.0, 1.5),))


def more(effect, t=T):
    """Return what an effect adds to the efforts of a nominal ur5 (N, 6)."""
    chain = UR5.chain()
    return Moving(chain, UR5.tool, [effect]).given(t, RUN) - Moving(chain, UR5.tool).given(t, RUN)


def test_a_standstill_slows_down_without_a_jump():
    q, qd, qdd = RUN.at(T)
    assert np.abs(np.gradient(q, T, axis=0)[2:-2] - qd[2:-2]).max() < 1e-4
    assert np.abs(np.gradient(qd, T, axis=0)[2:-2] - qdd[2:-2]).max() < 1e-2
    still = (np.abs(qd) == 0).all(axis=1)
    assert 1.4 < still.sum() * 0.004 < 1.6
    assert np.ptp(q[still], axis=0).max() == 0


def test_motor_friction_acts_against_its_own_joint_alone():
    _, qd, _ = RUN.at(T)
    place = {"location": "elbow_joint", "presliding": 1e-4}
    added = more({"physics": "coulomb_friction", "force": 3.0} | place)
    fast = np.abs(qd[:, 2]) > 0.05
    assert np.abs(added[fast, 2] - 3.0 * np.sign(qd[fast, 2])).max() < 1e-3
    assert np.abs(np.delete(added, 2, axis=1)).max() == 0
    still = np.abs(qd).max(1) == 0
    assert (np.abs(added[still, 2]) <= 3.0).all()
    assert np.ptp(added[still, 2]) > 0.1
    slow = more({"physics": "viscous_friction", "damping": 4.0, "backward": 0.5, "location": "elbow_joint"})
    assert np.abs(slow[:, 2] - qd[:, 2] * np.where(qd[:, 2] < 0, 2.0, 4.0)).max() < 1e-12


def test_stribeck_friction_falls_from_breakaway_to_coulomb():
    _, qd, _ = RUN.at(T)
    sizes = {"coulomb": 2.0, "breakaway": 5.0, "speed": 0.05, "presliding": 1e-5}
    added = np.abs(more({"physics": "stribeck_friction", "location": "wrist_1_joint"} | sizes)[:, 3])
    assert added.max() == pytest.approx(5.0, rel=0.02)
    assert np.abs(added[np.abs(qd[:, 3]) > 0.25] - 2.0).max() < 1e-3


def test_a_coupled_motor_acts_on_both_joints():
    _, qd, qdd = RUN.at(T)
    sizes = {"damping": 2.0, "force": 0.0, "inertia": 0.3, "presliding": 1e-4, "ratio": -1.0}
    added = more({"physics": "transmission_coupling", "location": "wrist_3_joint", "other": "wrist_2_joint"} | sizes)
    own = 2.0 * (qd[:, 5] - qd[:, 4]) + 0.3 * (qdd[:, 5] - qdd[:, 4])
    assert np.abs(added[:, 5] - own).max() < 1e-12
    assert np.abs(added[:, 4] + own).max() < 1e-12


def test_a_payload_at_rest_weighs_about_every_joint():
    t = T[(np.abs(RUN.at(T)[1]) == 0).all(axis=1)]
    place = {"physics": "payload", "location": "tool0", "lever": [0.02, 0.0, 0.08], "radius": 0.03}
    added = more(place | {"mass": 2.4}, t)
    chain = UR5.chain()
    motion = chain.moved(*RUN.at(t))
    body, turn, at = chain.frames["tool0"]
    where, _ = chain.point(motion, body, at + turn @ [0.02, 0.0, 0.08])
    lifted = -(chain.jacobian(motion, body, where) * (2.4 * GRAVITY)[:, None]).sum(1)
    assert np.abs(added - lifted).max() < 1e-10
    assert np.abs(lifted).max() > 5


def test_sensors_report_late_and_wrong():
    chain, usual = UR5.chain(), Moving(UR5.chain(), UR5.tool)
    late = Moving(chain, UR5.tool, [{"physics": "effort_delay", "location": "robot", "delay": 0.01}])
    assert np.abs(late.given(T, RUN)[5:] - usual.given(T - 0.01, RUN)[5:]).max() < 5e-3
    behind = Moving(chain, UR5.tool, [{"physics": "encoder_delay", "location": "elbow_joint", "delay": 0.02}])
    for mine, true, then in zip(behind.reported(T, RUN), RUN.at(T), RUN.at(T - 0.02), strict=True):
        assert (mine[:, 2] == then[:, 2]).all()
        assert (np.delete(mine, 2, axis=1) == np.delete(true, 2, axis=1)).all()
    scaled = Moving(chain, UR5.tool, [
        {"physics": "effort_gain", "location": "elbow_joint", "gain": 0.2},
        {"physics": "effort_offset", "location": "wrist_1_joint", "offset": -0.7},
    ])  # fmt: skip
    expected = usual.given(T, RUN) * [1, 1, 1.2, 1, 1, 1] + [0, 0, 0, -0.7, 0, 0]
    assert np.abs(scaled.given(T, RUN) - expected).max() < 1e-12


def test_friction_in_a_passive_joint_of_a_loop_is_felt_by_both_motors():
    """By power: what the motors give more is what the passive joint burns."""
    chain = BAR.chain()
    run = draw_motion(np.random.default_rng(2), chain, BAR, 12.0, 0)
    burning = Moving(chain, BAR.tool, [{"physics": "viscous_friction", "location": "left_elbow", "damping": 0.8}])
    added = burning.given(T, run) - Moving(chain, BAR.tool).given(T, run)
    _, rates, _, _ = chain.closed(*run.at(T))
    burnt = 0.8 * rates[:, [joint.name for joint in chain.joints].index("left_elbow")] ** 2
    assert np.abs((added * run.at(T)[1]).sum(1) - burnt).max() < 1e-10
    assert np.abs(added).max(axis=0).min() > 0.05


def test_noise_has_its_size_and_lasts():
    logger = Logger(500.0, 2**20, None, 0.3, 0.4, 0.05)
    noise = logger.disturbed(np.random.default_rng(1), 200_000, 1)[:, 0]
    assert noise.std() == pytest.approx(0.3, rel=0.03)
    alike = np.corrcoef(noise[:-25], noise[25:])[0, 1]
    assert alike == pytest.approx(0.6 * np.exp(-1.0), abs=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["ur5", pytest.param("five_bar", marks=pytest.mark.slow)])
def test_an_effect_has_its_size_beside_noise_and_tolerances(robot):
    drawn = draw_efforts(5, robot, ["inertial_parameters"], (5.0, 8.0))
    (effect,) = drawn["truth"]["effects"]
    assert 4.7 < effect["size"] < 8.5
    assert max(effect["strength"]) > 0.97 * effect["size"]
    assert max(*effect["left"], effect["strained"]) > 0.97 * effect["size"]


def test_a_seed_decides_everything():
    first, second, other = (draw_efforts(seed, "xarm7") for seed in (3, 3, 4))
    assert first["truth"] == second["truth"]
    assert all((first["fit"][key] == second["fit"][key]).all() for key in first["fit"])
    assert first["truth"]["scatter"] != other["truth"]["scatter"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "robot", [name if name in ("ur5", "five_bar") else pytest.param(name, marks=pytest.mark.slow) for name in KINDS]
)
def test_the_recording_tells_what_its_controller_logs_and_no_more(robot, tmp_path):
    drawn = draw_efforts(6, robot)
    write(drawn, tmp_path / "out", tmp_path / "sealed", "device")
    recording = read_recording(tmp_path / "out/device.csv")
    assert list(recording.efforts) == list(KINDS[robot].chain().names) == list(recording.positions)
    assert len(recording.time) == len(drawn["fit"]["time"]) > 2000
    about = json.loads((tmp_path / "out/device.json").read_text())
    assert set(about) - {"effort_noise"} == {"robot", "tolerances"}
    assert set(json.loads((tmp_path / "sealed/device.truth.json").read_text())) >= {"effects", "scatter", "joints"}


def test_every_physics_that_is_drawn_can_be_acted_out():
    assert all(hasattr(Moving, f"_effect_{name}") for name in (*PHYSICS, "alien"))
