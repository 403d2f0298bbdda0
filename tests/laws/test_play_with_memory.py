"""Gaps that stay where they were pushed, and drives that lose motion as they turn back, on an arm simulated here."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.corrected import corrected_model
from prup_pin.laws.backlash import _play
from prup_pin.laws.hardening import TwoStages
from prup_pin.laws.play_with_memory import HeldBacklash, HeldGap, LostMotion
from prup_pin.recordings import Noise, Recording
from prup_pin.simulation import effect_named, simulate

UPPER, FORE, STIFF, GAP, STICKS, STAGE, NOISE = 0.4, 0.35, (3e4, 1.2e4), 4e-4, 0.8, 6.0, 1.2e-5
FILE = """<robot name="scara">
  <link name="base"/><link name="upper"/><link name="fore"/><link name="tool"/>
  <joint name="A1" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="200" velocity="4"/></joint>
  <joint name="A2" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0.4 0 0"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="100" velocity="5"/></joint>
  <joint name="flange" type="fixed"><parent link="fore"/><child link="tool"/><origin xyz="0.35 0 0"/></joint>
  <prup_pin version="1">
    <tool frame="tool"/><actuated joints="A1 A2"/><home A1="0.3" A2="0.8"/>
    <module name="A1/gear" type="joint_spring" joint="A1"><parameter name="stiffness" value="3e4"
      unit="N m/rad" source="catalogue"/></module>
    <module name="A2/gear" type="joint_spring" joint="A2"><parameter name="stiffness" value="1.2e4"
      unit="N m/rad" source="catalogue"/></module>
  </prup_pin>
</robot>"""


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    path = tmp_path_factory.mktemp("arm") / "scara.urdf"
    path.write_text(FILE)
    return prup_pin.load(path)


def tip(q):
    first, second = q[0], q[0] + q[1]
    return np.array([UPPER * np.cos(first) + FORE * np.cos(second), UPPER * np.sin(first) + FORE * np.sin(second), 0.0])


def bench(seed, held=False, reversal=False, staged=False, poses=8, forces=(0, 30, 60, 30, 0, -30, -60, -30, 0)):
    """A bench test, solved by fixed-point steps: the first joint's gap, held or left behind as it moves.

    staged: the second joint's gear is twice as soft below 6 N m.
    """
    rng, rows, side, last = np.random.default_rng(seed), [], 0.0, None
    for _ in range(poses):
        q = np.array([rng.uniform(-1.5, 1.5), rng.choice([-1, 1]) * rng.uniform(0.4, 2.2)])
        if reversal and last is not None:
            side = -np.sign(q[0] - last)
        last, angle = q[0], rng.uniform(0, 2 * np.pi)
        for size in forces:
            force = size * np.array([np.cos(angle), np.sin(angle)])
            bent = q.copy()
            for _ in range(20):
                at = tip(bent)
                torque = np.array([at[0] * force[1] - at[1] * force[0], 0.0])
                fore = FORE * np.array([np.cos(bent.sum()), np.sin(bent.sum())])
                torque[1] = fore[0] * force[1] - fore[1] * force[0]
                now = np.sign(torque[0]) if held and abs(torque[0]) > STICKS else side
                more = np.clip(torque[1], -STAGE, STAGE) / STIFF[1] if staged else 0.0
                bent = q + torque / STIFF + [GAP * now, more]
            side = now
            rows.append((*q, *force, *(tip(bent) + NOISE * rng.normal(size=3))))
    table = np.array(rows)
    wrench = np.zeros((len(table), 6))
    wrench[:, :2] = table[:, 2:4]
    return Recording(
        time=2.0 * np.arange(len(table)),
        positions={"A1": table[:, 0], "A2": table[:, 1]},
        wrench=wrench,
        position=table[:, 4:],
        noise=Noise(position=NOISE),
    )


@pytest.mark.slow
def test_play_that_stays_where_it_was_pushed_is_named_and_foretells_another_test(arm):
    found = diagnose(arm, bench(1, held=True))
    (law,) = (item for item in found.findings if item.physics not in ("finite_deflection", "self_weight"))
    assert found.verdict == "explained"
    assert (law.physics, law.location) == ("backlash", "A1/gear")
    gap, holding = law.parameters["half_gap"], law.parameters["holding_load"]
    assert gap.value == pytest.approx(GAP, rel=0.03)
    assert holding.interval[0] < STICKS < holding.interval[1]
    other = bench(2, held=True)
    left = simulate(arm, other, found.effects).position - other.position
    assert np.sqrt(np.mean(left[1:] ** 2)) < 1.15 * NOISE


def test_a_drive_that_loses_motion_as_it_turns_back_is_named(arm):
    found = diagnose(arm, bench(3, reversal=True, poses=24, forces=(0, 60, -60)))
    (law,) = (item for item in found.findings if item.physics not in ("finite_deflection", "self_weight"))
    assert found.verdict == "explained"
    assert (law.physics, law.location) == ("backlash", "A1")
    assert law.parameters["half_gap"].value == pytest.approx(GAP, rel=0.03)
    assert "from either side" in law.statement


@pytest.mark.slow
def test_a_gear_of_two_stages_is_no_play(arm):
    found = diagnose(arm, bench(4, staged=True))
    (law,) = (item for item in found.findings if item.physics not in ("finite_deflection", "self_weight"))
    assert found.verdict == "explained"
    assert (law.physics, law.location) == ("hardening", "A2/gear")
    assert law.parameters["softer"].value == pytest.approx(1.0, rel=0.1)
    assert law.parameters["turning_load"].value == pytest.approx(STAGE, rel=0.1)


def test_a_tracker_that_was_pushed_is_told_with_its_moment_and_nothing_else(arm):
    still = bench(5, poses=12)
    moved = still.position + np.where(np.arange(len(still)) >= 50, 1.0, 0.0)[:, None] * [1.2e-4, -5e-5, 0.0]
    found = diagnose(arm, replace(still, position=moved))
    (law,) = (item for item in found.findings if item.physics not in ("finite_deflection", "self_weight"))
    assert found.verdict == "explained"
    assert law.physics == "pose_sensor_misalignment"
    assert "from 100 s on" in law.statement  # a row is 2 s
    assert law.parameters["tx"].value == pytest.approx(1.2e-4, abs=3e-5)
    kept = corrected_model(found, arm, [still], "scara.urdf").effects
    assert not any("pose_sensor" in effect.place.name and effect.values.get("tx") for effect in kept)


@pytest.mark.slow
def test_a_target_that_was_hit_is_told_with_its_moment_and_nothing_else(arm):
    """A sound shoulder was an unknown part, and a drift and an eccentric encoder took most of it."""
    still = bench(5, poses=12)
    turn = still.positions["A1"] + still.positions["A2"]
    x, y = 3e-4, -2e-4
    shift = np.column_stack((x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn), 0 * turn))
    moved = still.position + np.where(np.arange(len(still)) >= 50, 1.0, 0.0)[:, None] * shift
    found = diagnose(arm, replace(still, position=moved))
    (law,) = (item for item in found.findings if item.physics not in ("finite_deflection", "self_weight"))
    assert found.verdict == "explained"
    assert law.physics == "target_misalignment"
    assert "from 100 s on" in law.statement  # a row is 2 s
    assert law.parameters["x"].value == pytest.approx(3e-4, abs=3e-5)
    assert law.parameters["y"].value == pytest.approx(-2e-4, abs=3e-5)
    kept = corrected_model(found, arm, [still], "scara.urdf").effects
    assert not any("target" in effect.place.name and effect.values.get("x") for effect in kept)


def test_without_a_holding_load_it_is_a_gap_without_memory():
    load = np.random.default_rng(0).normal(size=(50, 1))
    play = HeldGap(2e-4, 0.0, 0.3, 0.5)
    held, _ = play(load, np.arange(50.0), np.zeros(50, int), None)
    strain, slope = play.strain(load, held)
    there, rate = _play(np.abs(load[:, 0]), 2e-4, 0.3)
    np.testing.assert_allclose(strain[:, 0], np.sign(load[:, 0]) * there, atol=1e-18)
    np.testing.assert_allclose(slope[:, 0, 0], rate, rtol=1e-9)


def test_a_large_load_leaves_it_at_its_end_and_a_small_one_where_it_was():
    loads = np.array([0.1, 5.0, 0.0, -0.5, -5.0, 0.9, 0.0])[:, None]
    play = HeldGap(1e-4, 1.0, 0.01, 0.0)
    held, (run, last) = play(loads, np.arange(7.0), np.zeros(7, int), None)
    strain, _ = play.strain(loads, held)
    np.testing.assert_allclose(strain[:, 0], 1e-4 * np.array([0, 1, 1, 1, -1, -1, -1]), atol=1e-12)
    again, _ = play(loads[:1], np.arange(1.0), np.zeros(1, int), (run, last))
    assert again[0, 0] == last == pytest.approx(-1e-4)


def test_a_gap_in_a_closed_loop_ends_where_its_load_has_it():
    """Where the loop gives way the gap takes some of the load: the two are solved together."""
    robot = prup_pin.load("3prup")
    home = robot.pose(z=0.4).actuators
    sizes = np.array([0, 1, 0, -1, 0, 0.5])
    recording = Recording(
        time=np.arange(6.0),
        positions={name: np.full(6, value) for name, value in home.items()},
        wrench=np.outer(sizes, [80.0, -60.0, 90.0, 8.0, 5.0, -6.0]),
        position=np.zeros((6, 3)),
        rotation=np.zeros((6, 3)),
    )
    play = {"half_gap": 3e-5, "holding_load": 3.0, "closing_load": 0.5, "begun": 0.0}
    told = simulate(
        robot, recording, [effect_named("backlash", "leg2/ball_nut", HeldBacklash.variant, play, robot.mechanism)]
    )
    apart = np.linalg.norm(told.position - simulate(robot, recording).position, axis=1)
    assert apart[0] < 1e-9
    assert apart[[2, 4]].min() > 5e-6  # unloaded again it stays where it was pushed
    np.testing.assert_allclose(
        told.position[2] - told.position[0], -(told.position[4] - told.position[0]), rtol=0.02, atol=1e-8
    )


def test_a_gear_turns_as_its_catalogue_says(arm):
    """K1 = 10 N m/mrad up to T1 = 14 N m and K2 = 14 N m/mrad beyond it, the robot file's being K2."""
    first, second, turning = 10e3, 14e3, 14.0
    robot = arm.with_parameters({"A1/gear.stiffness": second})
    loads = np.array([0.0, 10.0, 14.0, 20.0, -20.0])
    wrench = np.zeros((5, 6))
    wrench[:, 5] = loads
    recording = Recording(
        time=np.arange(5.0), positions={"A1": np.zeros(5), "A2": np.zeros(5)}, wrench=wrench, position=np.zeros((5, 3))
    )
    values = {"softer": second / first - 1, "turning_load": turning}
    law = effect_named("hardening", "A1/gear", TwoStages.variant, values, robot.mechanism)
    at = simulate(robot, recording, [law]).rotation[:, 2]
    gear = np.sign(loads) * np.where(
        np.abs(loads) < turning, np.abs(loads) / first, turning / first + (np.abs(loads) - turning) / second
    )
    np.testing.assert_allclose(at, gear + loads / STIFF[1], rtol=1e-9, atol=1e-12)


def test_small_motions_move_within_the_gap(arm):
    """Back and forth within the gap the joint stands still, and the actuator moves."""
    q = np.array([0.0, 1e-4, 2e-4, 1e-4, 5e-4, 4.5e-4])
    recording = Recording(time=np.arange(6.0), positions={"A1": q, "A2": np.full(6, 0.5)}, position=np.zeros((6, 3)))
    law = effect_named("backlash", "A1", LostMotion.variant, {"half_gap": 1e-4, "begun": 1.0}, arm.mechanism)
    turned = simulate(arm, recording, [law]).position
    angle = np.arctan2(turned[:, 1], turned[:, 0])
    np.testing.assert_allclose(angle - angle[0], [0, 0, 0, 0, 3e-4, 3e-4], atol=1e-12)
