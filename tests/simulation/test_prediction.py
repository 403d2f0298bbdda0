"""`simulate`: row by row, in parts, in several processes."""

from dataclasses import replace

import numpy as np
import pytest

import prup_pin
from prup_pin.errors import InputError, ParameterError, SimulationStoppedError, UnknownNameError
from prup_pin.laws.deeds import BLOCK, RUN
from prup_pin.recordings import Recording, add_noise
from prup_pin.simulation import Simulator, compare, effect_named, inputs_of, parts, simulate
from prup_pin.spatial import rotation_log

from .bench import NOISE, inputs, three_prup


@pytest.fixture(scope="module")
def robot():
    return three_prup()


@pytest.fixture(scope="module")
def bench(robot):
    return inputs(robot)


def effect(robot, physics, place, aspect="", **values):
    return effect_named(physics, place, aspect, values, robot.mechanism)


def row(robot, wrench, z=0.4, **more):
    pose = robot.pose(z=z, theta=0.2, phi=-0.1)
    positions = {name: [value] for name, value in pose.actuators.items()}
    efforts = {name: [np.nan] for name in positions}
    return pose, Recording(time=[0.0], positions=positions, wrench=[wrench], efforts=efforts, **more)


# -- the numbers -------------------------------------------------------------------------------------------------------


def test_a_row_is_the_robots_equilibrium(robot):
    wrench = [60.0, -20, 40, 5, -3, 2]
    pose, recording = row(robot, wrench, markers={"leg1_rod_tip": [[np.nan] * 3]})
    loaded = robot.equilibrium(pose, wrench)
    found = simulate(robot, recording)
    assert found.status == ("ok",)
    np.testing.assert_allclose(found.position[0], loaded.base_from_tool[:3, 3], atol=1e-12)
    np.testing.assert_allclose(found.rotation[0], rotation_log(loaded.base_from_tool[:3, :3]), atol=1e-12)
    want = loaded.placement("leg1_rod_tip")[:3, 3]
    np.testing.assert_allclose(found.markers["leg1_rod_tip"][0], want, atol=1e-12)


def test_actuators_hold_a_vertical_load_back(robot):
    """Base z and the slides point down: 100 N down push towards positive q, so the actuators push back, all alike."""
    home = robot.pose(z=0.4, theta=0, phi=0)
    positions = {name: [value] for name, value in home.actuators.items()}
    recording = Recording(
        time=[0.0],
        positions=positions,
        wrench=[[0, 0, 100.0, 0, 0, 0]],
        efforts={name: [np.nan] for name in positions},
    )
    efforts = np.array([values[0] for values in simulate(robot, recording).efforts.values()])
    np.testing.assert_allclose(efforts, -100 / 3, rtol=1e-3)


def test_efforts_are_the_slope_of_the_potential_energy(robot):
    """Castigliano: tau = d(energy stored - work of the dead force)/dq, what the rods store in their length included."""
    wrench = np.array([80.0, -60, 50, 0, 0, 0])
    pose, recording = row(robot, wrench)
    found = simulate(robot, recording).efforts
    start = np.array(list(pose.actuators.values()))

    def potential(actuators):
        loaded = robot.equilibrium(robot.pose_from_actuators(actuators), wrench)
        return loaded.energy(1).stored - wrench[:3] @ loaded.base_from_tool[:3, 3]

    step = 1e-4 * np.array([1.0, -0.5, 0.7])
    slope = (potential(start + step) - potential(start - step)) / 2e-4
    efforts = np.array([values[0] for values in found.values()])
    assert efforts @ step / 1e-4 == pytest.approx(slope, abs=1e-4)
    assert efforts.sum() != pytest.approx(-50, abs=0.05)  # the clamps take the rest


def test_weight_is_held_where_it_is_switched_on(robot):
    _, recording = row(robot, np.zeros(6))
    weight = effect(robot, "self_weight", "robot", scale=1.0)
    masses = sum(inertia.mass for inertia in robot.model.inertias)
    without, held = (sum(simulate(robot, recording, on).efforts.values()).item() for on in ((), (weight,)))
    assert without == pytest.approx(0, abs=1e-6)
    assert held == pytest.approx(-9.80665 * masses, rel=2e-3)


def test_residual_of_a_noisy_recording_is_its_noise(robot):
    quiet = inputs(robot, poses=6, cycle=(0, 0.5, 1, -0.5, -1))
    added = [effect(robot, "stiffness_changed", "leg1/R_lambda", "tilting", factor=0.3)]
    exact = simulate(robot, quiet, added)
    measured = add_noise(quiet.with_measurements(position=exact.position, rotation=exact.rotation), NOISE, 1)
    before = {item.channel: item.in_noise for item in compare(measured, simulate(robot, measured))}
    after = {item.channel: item.in_noise for item in compare(measured, simulate(robot, measured, added))}
    assert before["position"] > 5
    assert set(after) == {"position", "rotation"}
    for value in after.values():
        assert value == pytest.approx(1, abs=0.25)


def test_compare_turns_and_what_is_missing(robot, bench):
    found = simulate(robot, bench)
    turned = found.rotation.copy()
    turned[0] += 1e-4
    turned[1] = np.nan
    item = compare(bench.with_measurements(rotation=turned), found)
    assert [(each.channel, each.count) for each in item] == [("rotation", 3 * (len(bench) - 1))]
    assert item[0].rms == pytest.approx(1e-4 / np.sqrt(len(bench) - 1), rel=0.05)
    assert item[0].noise == bench.noise.rotation
    assert compare(bench, found) == ()


# -- inputs ------------------------------------------------------------------------------------------------------------


def test_inputs_of_a_recording(robot, bench):
    found = inputs_of(bench, robot)
    assert found.actuators.shape == (6, 3)
    np.testing.assert_array_equal(found.blocks, [0, 0, 0, 1, 1, 1])
    assert found.speeds is None
    assert found.temperature is None
    fast = replace(bench, velocities={"leg2_slide": np.full(6, 0.1)}, temperature=np.full(6, 25.0))
    found = inputs_of(fast, robot)
    np.testing.assert_array_equal(found.speeds[:, 1], 0.1)
    assert np.isnan(found.speeds[:, [0, 2]]).all()
    np.testing.assert_array_equal(found.warming, 5.0)
    with pytest.raises(UnknownNameError, match=r"q\.leg3_slide"):
        inputs_of(
            replace(bench, positions={name: bench.positions[name] for name in ("leg1_slide", "leg2_slide")}), robot
        )


def test_temperature_not_measured_is_the_reference_and_said(robot, bench):
    grow = effect(robot, "thermal_growth", "leg2/ball_screw", expansion=1e-5)
    warm = np.full(6, 40.0)
    warm[[1, 4]] = np.nan
    found = simulate(robot, replace(bench, temperature=warm), [grow])
    cold = simulate(robot, bench)
    moved = np.linalg.norm(found.position - cold.position, axis=1)
    np.testing.assert_allclose(moved[[1, 4]], 0, atol=1e-12)
    assert (moved[[0, 2, 3, 5]] > 1e-5).all()
    assert found.remarks == ("thermal_growth at leg2/ball_screw: 2 rows without temperature are taken at 20 degrees "
                             "Celsius.",)  # fmt: skip
    assert "no column temperature" in simulate(robot, bench, [grow]).remarks[0]


def test_a_speed_not_measured_is_no_input_for_a_law_that_needs_it(robot, bench):
    late = effect(robot, "encoder_delay", "leg2/motor", delay=0.01)
    speeds = np.full(6, 0.02)
    speeds[3] = np.nan
    found = simulate(robot, replace(bench, velocities={"leg2_slide": speeds}), [late])
    assert found.failures.keys() == {"no input"}
    np.testing.assert_array_equal(found.failures["no input"], [3])
    assert "no column qd" in simulate(robot, bench, [late]).remarks[0]


def test_columns_that_are_not_of_the_robot_are_said(robot, bench):
    more = replace(
        bench, efforts={"leg9_slide": np.zeros(6), "leg1_slide": np.zeros(6)}, markers={"nose": np.zeros((6, 3))}
    )
    found = simulate(robot, more)
    assert list(found.efforts) == ["leg1_slide"]
    assert not found.markers
    assert any("tau.leg9_slide" in text for text in found.remarks)
    assert any("p.nose" in text for text in found.remarks)


def test_effects_that_do_not_fit_are_refused(robot, bench):
    gap = effect(robot, "backlash", "leg2/ball_nut", half_gap=3e-5, closing_load=1.0)
    with pytest.raises(UnknownNameError):
        simulate(robot, bench, [replace(gap, place=gap.place._replace(name="leg4/ball_nut"))])
    with pytest.raises(ParameterError):
        simulate(robot, bench, [replace(gap, values={"half_gap": -1.0, "closing_load": 1.0})])
    with pytest.raises(InputError, match="closing_load"):
        simulate(robot, bench, [replace(gap, values={"half_gap": 1e-5})])
    with pytest.raises(InputError, match="workers"):
        simulate(robot, bench, workers=0)


# -- failures ----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def broken(robot):
    """Six rows: fine, no load, out of reach, fine, more than it can bear, no position."""
    _, one = row(robot, np.zeros(6))
    table = {name: np.repeat(values, 6) for name, values in one.positions.items()}
    wrench = np.tile([10.0, 20, 30, 1, 2, 3], (6, 1))
    wrench[1, 2] = np.nan
    table["leg1_slide"][2] = 0.7
    wrench[4, 0] = 1e9
    table["leg3_slide"][5] = np.nan
    return Recording(time=np.arange(6.0), positions=table, wrench=wrench)


STATUS = ("ok", "no input", "unreachable", "ok", "not converged", "no input")


def test_failing_rows_are_told_and_the_run_goes_on(robot, broken):
    seen = []
    found = simulate(robot, broken, progress=lambda done, total: seen.append((done, total)))
    assert found.status == STATUS
    assert {word: rows.tolist() for word, rows in found.failures.items()} == {
        "no input": [1, 5],
        "unreachable": [2],
        "not converged": [4],
    }
    assert "leg1_slide" in found.reasons["unreachable"]
    assert set(found.reasons) == set(found.failures)
    good = np.array([word == "ok" for word in found.status])
    for values in (found.position, found.rotation):
        np.testing.assert_array_equal(np.isfinite(values).all(axis=1), good)
        assert np.isnan(values[~good]).all()
    assert seen[-1] == (6, 6)
    assert "1 unreachable" in repr(found)


@pytest.mark.slow
def test_failing_rows_do_not_disturb_laws_that_remember(robot, broken):
    rub = effect(robot, "coulomb_friction", "leg1/R_theta_P", limit=0.5, presliding_stiffness=800.0)
    slow = effect(robot, "creep", "leg1/ball_nut", share=0.5, time_constant=2.0)
    found = simulate(robot, broken, [rub, slow])
    assert found.status == STATUS
    good = np.array([word == "ok" for word in STATUS])
    alone = simulate(robot, broken.select(good), [rub, slow])
    np.testing.assert_allclose(found.position[good], alone.position, atol=1e-9)


def test_a_law_that_moves_the_poses_out_of_reach(robot, bench):
    away = effect(robot, "encoder_offset", "leg1/motor", offset=0.05)
    assert simulate(robot, bench, [away]).status == ("ok",) * 6


@pytest.mark.parametrize(("rows", "first", "word"), [(slice(None), 1, "no input"), (slice(2, None), 0, "unreachable")])
def test_stopping_keeps_what_was_computed(robot, broken, rows, first, word):
    with pytest.raises(SimulationStoppedError, match=f"line {first + 2} of .*{word}") as caught:
        simulate(robot, broken.select(rows), stop=True)
    assert (caught.value.row, caught.value.status) == (first, word)
    assert caught.value.prediction.status == ("ok",) * first


def test_no_rows(robot, bench):
    found = simulate(robot, bench.select(slice(0, 0)))
    assert len(found) == 0
    assert found.failures == {}


# -- parts and processes -----------------------------------------------------------------------------------------------


def test_parts_are_bounded_and_cut_where_nothing_is_remembered(robot, monkeypatch):
    monkeypatch.setattr(parts, "SAMPLES", 4)
    given = inputs_of(inputs(robot, poses=3), robot)  # three rows a pose
    given = replace(given, runs=np.array([0] * 6 + [1] * 3))

    def sizes(*memory):
        return [[len(rows) for rows in chain] for chain in parts.plan_parts(given, set(memory))]

    assert sizes() == [[4], [4], [1]]
    assert sizes(BLOCK) == [[3], [3], [3]]
    assert sizes(RUN) == [[4, 2], [3]]
    monkeypatch.setattr(parts, "SAMPLES", 2)
    assert sizes(BLOCK) == [[2, 1], [2, 1], [2, 1]]
    monkeypatch.setattr(parts, "SAMPLES", 512)
    monkeypatch.setattr(parts, "POSES", 2)
    assert sizes() == [[6], [3]]


@pytest.mark.parametrize(
    "physics",
    [
        ("coulomb_friction", "leg1/R_theta_P", {"limit": 0.3, "presliding_stiffness": 800.0}),
        ("viscous_friction", "leg1/R_theta_P", {"damping": 100.0}),
        ("creep", "leg2/linear_rod", {"share": 0.5, "time_constant": 3.0}),
    ],
)
def test_what_is_remembered_is_handed_on_from_part_to_part(robot, monkeypatch, physics):
    name, place, values = physics
    added = [effect(robot, name, place, **values)]
    bench = inputs(robot, cycle=(0, 0.5, 1, 0.5, 0, -0.5, -1))
    bench = replace(bench, run=np.repeat([0, 1], 7), run_names=("a", "b"))
    whole = simulate(robot, bench, added)
    monkeypatch.setattr(parts, "SAMPLES", 3)
    pieces = simulate(robot, bench, added)
    np.testing.assert_allclose(pieces.position, whole.position, rtol=0, atol=1e-10)
    without = simulate(robot, bench)
    assert np.abs(whole.position - without.position).max() > 1e-7


def test_creep_starts_anew_with_every_run(robot):
    slow = [effect(robot, "creep", "leg2/linear_rod", share=0.5, time_constant=3.0)]
    bench = inputs(robot, poses=1, cycle=(1.0, 1, 1, 1, 1, 1))
    halves = replace(bench, run=np.repeat([0, 1], 3), run_names=("a", "b"))
    found = simulate(robot, halves, slow)
    together = Simulator(robot, inputs_of(halves, robot)).run(slow)  # as the diagnosis does
    np.testing.assert_allclose(together.position, found.position, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.position[3:], found.position[:3], atol=1e-12)
    assert np.abs(simulate(robot, bench, slow).position[3:] - found.position[3:]).max() > 1e-6


def test_several_processes_give_identical_numbers(robot, bench, monkeypatch):
    monkeypatch.setattr(parts, "SAMPLES", 2)
    changed = robot.with_parameters({"leg1/linear_rod.diameter": 0.021, "leg1/base.radius": 0.182})
    recording = bench.with_measurements(efforts={"leg1_slide": np.full(6, np.nan)})
    recording = replace(recording, markers={"leg1_rod_tip": np.full((6, 3), np.nan)})
    added = [effect(robot, "backlash", "leg2/ball_nut", half_gap=3e-5, closing_load=1.0)]
    alone = simulate(changed, recording, added)
    seen = []
    both = simulate(changed, recording, added, workers=2, progress=lambda done, total: seen.append(done))
    assert both.remarks == alone.remarks == ()
    assert seen == [2, 4, 6]
    for name in ("position", "rotation"):
        np.testing.assert_array_equal(getattr(both, name), getattr(alone, name))
    np.testing.assert_array_equal(both.efforts["leg1_slide"], alone.efforts["leg1_slide"])
    np.testing.assert_array_equal(both.markers["leg1_rod_tip"], alone.markers["leg1_rod_tip"])


def test_a_robot_that_cannot_be_sent_is_computed_in_one_process(robot, bench, monkeypatch):
    monkeypatch.setattr(parts, "SAMPLES", 2)
    known = effect(robot, "backlash", "leg2/ball_nut", half_gap=3e-5, closing_load=1.0)

    class OfAPrompt(type(known.law)):
        """A law that no other process finds by its name."""

    found = simulate(robot, bench, [replace(known, law=OfAPrompt())], workers=2)
    assert found.status == ("ok",) * 6
    assert "computed in one" in found.remarks[0]
    np.testing.assert_array_equal(found.position, simulate(robot, bench, [known]).position)


@pytest.mark.slow
def test_processes_that_die_are_replaced_and_it_is_said(robot, bench, monkeypatch):
    monkeypatch.setattr(parts, "SAMPLES", 2)
    monkeypatch.setattr(parts, "_packed", lambda wanted: b"not a pickle")
    found = simulate(robot, bench, workers=2)
    np.testing.assert_array_equal(found.position, simulate(robot, bench).position)
    assert "__main__" in found.remarks[0]


def test_a_serial_robot_with_springs(monkeypatch):
    monkeypatch.setattr(parts, "SAMPLES", 2)
    arm = prup_pin.load("ur5", joint_stiffness=1e4, tool="tool0")
    names = arm.mechanism.actuated
    recording = Recording(
        time=np.arange(4.0),
        positions={name: np.linspace(0.1, 0.4, 4) for name in names},
        wrench=np.tile([0, 0, -50.0, 0, 0, 0], (4, 1)),
        efforts={name: np.full(4, np.nan) for name in names},
    )
    found = simulate(arm, recording, workers=2)
    assert found.status == ("ok",) * 4
    pose = arm.pose_from_actuators([0.1] * len(names))
    arms = pose.jacobian[:3] - np.cross(pose.base_from_tool[:3, 3], pose.jacobian[3:], axis=0)
    held = np.array([found.efforts[name][0] for name in names])
    np.testing.assert_allclose(held, 50.0 * arms[2], atol=0.5)  # the arm sags a little
