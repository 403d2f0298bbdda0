"""Each law against what textbooks and closed forms say, on robots of one or two parts."""

# ruff: noqa: E741  (I is the second moment of area)
from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from scipy.optimize import brentq

from prup_pin import laws
from prup_pin.laws import LAWS, Effect, Inputs, Place, Setup
from prup_pin.laws.deeds.cable import TAKE_UP
from prup_pin.laws.deviations import calibration_of
from prup_pin.laws.efforts import EFFORT_LAWS
from prup_pin.laws.joint_places import parts
from prup_pin.simulation import Simulator
from prup_pin.spatial import rotation_exp, rotation_log
from prup_pin.testing.poses import change

from ..statics.build import RobotFile, rubbing_block
from .bench import NAMES, effect, nominal, robot, simulator


def of(law, place, aspect="", **values):
    found = next(item for item in LAWS if type(item) is law)
    return Effect(found, Place(place, aspect), values)


def pulled(robot, forces, effects=(), axis=0, time=None, actuators=None, temperature=None):
    """Return the tool's displacement (N, 3) under forces (N,) along an axis, from its place without any."""
    forces = np.asarray(forces, float)
    n = len(forces)
    wrench = np.zeros((n, 6))
    wrench[:, axis] = forces
    positions = np.zeros((n, len(robot.mechanism.actuated))) if actuators is None else actuators
    time = np.arange(n, dtype=float) if time is None else time
    run = Simulator(robot, Inputs(time, positions, wrench, np.zeros(n, int), temperature)).run(effects)
    assert run.solved.all()
    return run.position - robot.pose_from_actuators(positions[0]).base_from_tool[:3, 3]


# -- a block on a spring -----------------------------------------------------------------------------------------------

K = 2e5  # N/m


@pytest.fixture
def spring(tmp_path):
    """A block on an actuated slide with a spring."""
    file = RobotFile()
    file.link("block")
    file.held("slide", "base", "block", axis=(1, 0, 0))
    file.module("spring", "joint_spring", "slide", {"stiffness": K})
    return file.load(tmp_path, "block")


@pytest.fixture
def sliding_block(tmp_path):
    """A block that rubs on the base, and a spring beside it that holds it."""
    return rubbing_block(tmp_path, K)


LIMIT, STICK = 6.0, 4e5  # N, N/m


def friction(**more):
    return of(laws.CoulombFriction, "rubbing", **{"limit": LIMIT, "presliding_stiffness": STICK, **more})


def test_stick_and_slip_encloses_what_friction_dissipates(sliding_block):
    """Prandtl's element beside a spring: the loop's area is 4 T (x_max - T / k_s)."""
    up, down = np.linspace(0, 30, 31), np.linspace(30, -30, 61)
    forces = np.concatenate((up, down[1:], down[::-1][1:]))
    x = pulled(sliding_block, forces, [friction()])[:, 0]
    assert x[30] == pytest.approx((30 - LIMIT) / K, rel=1e-9)
    cycle = slice(30, None)
    # the loop is piecewise linear with corners between samples: compare with the exact area up to a chord
    area = -np.trapezoid(x[cycle], forces[cycle]) if hasattr(np, "trapezoid") else -np.trapz(x[cycle], forces[cycle])
    assert abs(area) == pytest.approx(4 * LIMIT * (x[30] - LIMIT / STICK), rel=0.02)
    assert x[-1] == pytest.approx(x[30], rel=1e-9)


def test_a_joint_sticks_until_it_slides(sliding_block):
    forces = np.array([0.0, 3.0, 9.0, 30.0, 27.0, 0.0])
    x = pulled(sliding_block, forces, [friction()])[:, 0]
    breakaway = LIMIT * (K + STICK) / STICK  # 9 N
    assert breakaway == pytest.approx(9.0)
    expected = [0, 3 / (K + STICK), 9 / (K + STICK), (30 - LIMIT) / K]
    expected.append(expected[-1] - 3 / (K + STICK))
    expected.append((0 + LIMIT) / K)  # from 30 N to 0 more than two limits: slides back, and stays off by T/k
    np.testing.assert_allclose(x, expected, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("closing_load", [1.0, 0.1, 0.03])
def test_friction_beside_a_gap_that_opens_and_closes(sliding_block, closing_load):
    """The ram's spring has a gap: where that is open the block moves otherwise than in all other samples of its pose.

    One equation a sample, e(F - T) = x with T of Prandtl's element, by bisection.
    """
    gap = 4e-4
    forces = np.concatenate((np.linspace(0, 12, 13), np.linspace(11, -12, 24), np.linspace(-11, 3, 15)))
    play = of(laws.Backlash, "spring", half_gap=gap, closing_load=closing_load)
    x = pulled(sliding_block, forces, [friction(), play])[:, 0]
    slid, expected = 0.0, []
    for force in forces:

        def torque(at, slid=slid):
            return np.clip(STICK * (at - slid), -LIMIT, LIMIT)

        def open_(at, force=force, torque=torque):
            left = force - torque(at)
            return left / K + gap * np.tanh(left / closing_load) - at

        expected.append(brentq(open_, -1.0, 1.0, xtol=1e-15, rtol=1e-14))
        slid = float(np.clip(slid, expected[-1] - LIMIT / STICK, expected[-1] + LIMIT / STICK))
    np.testing.assert_allclose(x, expected, rtol=1e-6, atol=1e-8)
    assert np.abs(expected).max() > gap  # it was closed, and opened again


def test_an_actuator_that_moves_relaxes_the_joint(sliding_block):
    inputs = Inputs(
        np.arange(4.0),
        np.array([[0.0], [0.0], [0.1], [0.1]]),
        np.outer([0.0, 30.0, 0.0, 3.0], np.eye(6)[0]),
        np.array([0, 0, 1, 1]),
    )
    x = Simulator(sliding_block, inputs).run([friction()]).position[:, 0] - inputs.actuators[:, 0]
    np.testing.assert_allclose(x, [0, (30 - LIMIT) / K, 0, 3 / (K + STICK)], rtol=1e-9, atol=1e-15)


def test_a_damper_beside_a_spring_lags_by_its_time_constant(sliding_block):
    """k x + c dx/dt = F over equal steps, by the backward difference that samples in one pose stand for."""
    c, step = 4e5, 0.1
    time = step * np.arange(200)
    x = pulled(sliding_block, np.r_[0, np.full(199, 10.0)], [of(laws.ViscousFriction, "rubbing", damping=c)], time=time)
    expected = 10 / K * (1 - (1 + K * step / c) ** -np.arange(200.0))
    np.testing.assert_allclose(x[:, 0], expected, rtol=1e-8, atol=1e-14)
    exact = 10 / K * (1 - np.exp(-K * time / c))
    assert np.abs(x[:, 0] - exact).max() < 0.02 * 10 / K


# -- gaps and contacts -------------------------------------------------------------------------------------------------


def test_a_gap_in_series_with_a_spring(spring):
    """Piecewise linear where the closing load is small: x = F/k + gap sign(F)."""
    gap, loads = 4e-5, np.array([-40.0, -5.0, 5.0, 40.0])
    x = pulled(spring, loads, [of(laws.Backlash, "spring", half_gap=gap, closing_load=0.02)])[:, 0]
    np.testing.assert_allclose(x, loads / K + gap * np.sign(loads), rtol=1e-9)
    closing = pulled(spring, [1.0, 2.0], [of(laws.Backlash, "spring", half_gap=gap, closing_load=1.0)])[:, 0]
    np.testing.assert_allclose(closing, [1 / K + gap * np.tanh(1), 2 / K + gap * np.tanh(2)], rtol=1e-9)


def test_two_gaps_in_series_add_up(tmp_path):
    file = RobotFile()
    file.link("block")
    file.held("slide", "base", "block", axis=(1, 0, 0))
    file.module("nut", "ball_nut", "slide", {"stiffness": K})
    file.module("bearing", "support_bearing", "slide", {"stiffness": 3 * K})
    two = [of(laws.Backlash, name, half_gap=gap, closing_load=0.02) for name, gap in (("nut", 1e-5), ("bearing", 3e-5))]
    x = pulled(file.load(tmp_path, "block"), [-20.0, 20.0], two)[:, 0]
    np.testing.assert_allclose(x, np.array([-1, 1]) * (20 / K + 20 / (3 * K) + 4e-5), rtol=1e-9)


def test_a_contact_deforms_by_the_load_to_two_thirds(spring):
    """Hertz: x ~ F^(2/3) far above the preload; its stiffness is the file's at the reference load."""
    loads = np.array([10.0, 80.0, 640.0])
    x = pulled(spring, loads, [of(laws.HertzianContact, "spring", reference_load=640.0, preload=0.01)])[:, 0]
    np.testing.assert_allclose(x[1:] / x[:-1], 4.0, rtol=0.02)
    assert x[2] == pytest.approx(1.5 * 640 / K, rel=1e-3)
    near = np.array([640.0 - 0.5, 640.0 + 0.5])
    slope = np.diff(
        pulled(spring, near, [of(laws.HertzianContact, "spring", reference_load=640.0, preload=0.01)])[:, 0]
    )
    assert slope[0] == pytest.approx(1 / K, rel=1e-4)


def test_a_drive_hardens_with_the_square_of_its_deformation(spring):
    """Duffing's spring: F = k x (1 + (x / x_0)^2), pushed and pulled, at all loads; nothing where x_0 is far."""
    doubling = 4e-5
    loads = np.array([-64.0, -1.0, 1e-3, 0.5, 2 * K * doubling, 64.0, 2000.0])
    x = pulled(spring, loads, [of(laws.Hardening, "spring", doubling_load=2 * K * doubling)])[:, 0]
    np.testing.assert_allclose(K * x * (1 + (x / doubling) ** 2), loads, rtol=1e-9)
    assert x[4] == pytest.approx(doubling, rel=1e-9)
    np.testing.assert_allclose(pulled(spring, loads, [of(laws.Hardening, "spring", doubling_load=1e15)])[:, 0],
                               loads / K, rtol=1e-12)  # fmt: skip


def test_a_contact_acts_along_its_load():
    """A radial contact has no preferred direction across its axle: deformation follows the load as it turns."""
    place = of(laws.HertzianContact, "leg1/R_theta_P", "radial", reference_load=2e4, preload=3.0)
    setup = simulator("3prup").setup([place])
    load = np.tile([3.0, 4.0, 7.0, 0.0, 0.0, 0.0], (len(setup.inputs), 1))
    (strain,) = setup.strains["leg1/R_theta_P"]
    one, turned = strain(load)[0], strain(load[:, [1, 0, 2, 3, 4, 5]])[0]
    np.testing.assert_allclose(one[:, 1] / one[:, 0], 4 / 3, rtol=1e-12)
    np.testing.assert_allclose(one[:, :2], turned[:, [1, 0]], rtol=1e-12)
    assert not one[:, 2:].any()


# -- time --------------------------------------------------------------------------------------------------------------


def test_creep_follows_a_step_exponentially(spring):
    time = np.array([0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 80.0])
    x = pulled(
        spring, np.r_[0, np.full(6, 10.0)], [of(laws.CreepLaw, "spring", share=0.4, time_constant=2.0)], time=time
    )
    expected = 10 / K * (1 + 0.4 * (1 - np.exp(-time / 2.0)))
    np.testing.assert_allclose(x[1:, 0], expected[1:], rtol=1e-6)


def test_creep_goes_back_after_the_load(spring):
    time = np.array([0.0, 100.0, 101.0, 103.0])
    x = pulled(spring, [0.0, 10.0, 0.0, 0.0], [of(laws.CreepLaw, "spring", share=0.4, time_constant=2.0)], time=time)
    expected = 4 / K * np.exp(-np.array([1.0, 3.0]) / 2.0)
    np.testing.assert_allclose(x[2:, 0], expected, rtol=1e-6)


def test_a_guide_that_is_softer_about_its_own_axis_turns_more(tmp_path):
    """M / k about the axle, and nothing else of it: its stiffness there is a word of its own."""
    file = RobotFile()
    file.link("block")
    file.held("slide", "base", "block", axis=(1, 0, 0))
    file.module("guide", "bearing", "slide", {"rotational_stiffness": 2e3}, axis=(0, 0, 1))
    found = file.load(tmp_path, "block")
    soft = of(laws.StiffnessChanged, "guide", "rotational", factor=0.4)
    assert soft.place in soft.law.places(found.mechanism)
    loads = Inputs(np.zeros(1), np.zeros((1, 1)), np.array([[0.0, 30.0, 0.0, 0.0, 5.0, 10.0]]), np.zeros(1, int))
    run = Simulator(found, loads).run([soft])
    np.testing.assert_allclose(rotation_log(run.rotation[0]), [0, 0, 10.0 / 800.0], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(
    ("module", "aspect"),
    [
        ("leg1/moving_star_branch", ""),
        ("leg1/linear_rod", ""),
        ("leg1/R_lambda", "tilting"),
        ("leg1/R_theta_P", "radial"),
        ("leg1/motor", ""),
    ],
)
def test_a_part_that_has_crept_out_is_a_softer_part(module, aspect):
    base = simulator("3prup").inputs
    slow = Inputs(1e4 * base.time, base.actuators, base.wrench, base.blocks)
    crept = Simulator(robot("3prup"), slow).run([of(laws.CreepLaw, module, aspect, share=0.25, time_constant=1.0)])
    soft = simulator("3prup").run([of(laws.StiffnessChanged, module, aspect, factor=0.8)])
    moved = np.abs(change(soft, nominal("3prup"))).max()
    assert np.abs(change(crept, soft)).max() < 0.01 * moved  # creep follows the linear law


# -- beams -------------------------------------------------------------------------------------------------------------

E, L, D = 201e9, 0.4, 0.03
A, I = pi / 4 * D**2, pi / 64 * D**4
G = E / 2.6


@pytest.fixture
def cantilever(tmp_path):
    """A beam along x from the wall, loaded at its end; it stands on an actuator that can feed it."""
    file = RobotFile(gravity=(0.0, 0.0, -9.81))
    file.link("arm")
    file.held("hold", "base", "arm", axis=(1, 0, 0))
    file.frame("wall", "base", (0, 0, 0), (0, pi / 2, 0))
    file.frame("end", "arm", (L, 0, 0), (0, pi / 2, 0))
    file.frame("tool", "arm", (L, 0, 0))
    file.module("beam", "beam", "hold", {"diameter": D, "youngs_modulus": E}, root="wall", tip="end")
    return file.load(tmp_path)


def test_shear_is_timoshenkos(cantilever):
    force = 50.0
    more = pulled(cantilever, [force], [of(laws.Shear, "robot", scale=2.0)], axis=2) - pulled(
        cantilever, [force], axis=2
    )
    assert more[0, 2] == pytest.approx(2 * force * L / (0.886 * G * A), rel=1e-4)


def test_torsion_is_saint_venants(cantilever):
    wrench = np.zeros((1, 6))
    wrench[0, 3] = 20.0
    inputs = Inputs(np.zeros(1), np.zeros((1, 1)), wrench, np.zeros(1, int))
    turned = Simulator(cantilever, inputs).run([of(laws.Torsion, "robot", scale=1.0)]).rotation[0]
    assert turned[2, 1] == pytest.approx(20 * L / (G * 2 * I), rel=1e-6)
    assert Simulator(cantilever, inputs).run().rotation[0] == pytest.approx(np.eye(3), abs=1e-12)


def test_a_clamp_that_tilts(cantilever):
    force, stiffness = 50.0, 3e4
    tilting = of(laws.RootTiltCompliance, "beam", root_tilting_stiffness=stiffness)
    more = pulled(cantilever, [force], [tilting], axis=2) - pulled(cantilever, [force], axis=2)
    assert more[0, 2] == pytest.approx(force * L**2 / stiffness, rel=1e-4)
    twice = pulled(cantilever, [force], [tilting, tilting], axis=2) - pulled(cantilever, [force], axis=2)
    assert twice[0, 2] == pytest.approx(2 * force * L**2 / stiffness, rel=1e-4)


def test_a_clamp_at_the_hub_tilts(tmp_path):
    """The same beam clamped on the moving side: the tool, on the clamp, moves by the moment over its stiffness."""
    file = RobotFile()
    file.link("arm")
    file.held("hold", "base", "arm", axis=(1, 0, 0))
    file.frame("tip", "base", (0, 0, 0), (0, -pi / 2, 0))
    file.frame("hub", "arm", (L, 0, 0), (0, -pi / 2, 0))
    file.frame("tool", "arm", (L, 0, 0))
    file.module("beam", "beam", "hold", {"diameter": D, "youngs_modulus": E}, root="hub", tip="tip")
    loaded = file.load(tmp_path)
    assert not laws.RootTiltCompliance().places(loaded.mechanism)
    wrench = np.zeros((1, 6))
    wrench[0, 4] = 5.0
    inputs = Inputs(np.zeros(1), np.zeros((1, 1)), wrench, np.zeros(1, int))
    bench = Simulator(loaded, inputs)
    tilting = of(laws.HubRootCompliance, "beam", root_tilting_stiffness=2e4)
    more = bench.run([tilting]).rotation[0] @ bench.run().rotation[0].T
    assert -more[2, 0] == pytest.approx(5.0 / 2e4, rel=1e-6)


def test_a_softer_material_bends_and_stretches_more(cantilever):
    for axis, compliance in ((0, L / (E * A)), (2, L**3 / (3 * E * I))):
        soft = pulled(cantilever, [10.0], [of(laws.StiffnessChanged, "beam", factor=0.5)], axis=axis)
        assert soft[0, axis] == pytest.approx(20 * compliance, rel=1e-5)


def test_the_paper_s_printed_equation_is_corrected():
    """With the missing part added, the rod as printed bends as statics says."""
    wrong, right = simulator("3prup_as_published"), robot("3prup_as_published")
    other = effect("3prup_as_published", laws.ModelEquationError, "robot", "linear_rod", share=1.0)
    module = next(item for item in right.mechanism.modules if item.name == "leg1/linear_rod")
    (strain,) = wrong.setup([other]).strains["leg1/linear_rod"]
    load = np.zeros((len(wrong.inputs), 6))
    load[:, 1] = 1.0
    length = wrong.inputs.actuators[:, 0] - 0.1
    bending = module.values["youngs_modulus"] * module.values["second_moment_x"]
    # printed and right turn the tip by opposite angles F l^2 / 2EI
    np.testing.assert_allclose(np.abs(strain(load)[0][:, 3]), length**2 / bending, rtol=1e-9)
    np.testing.assert_allclose(strain(load)[0][:, 1], 0.0, atol=1e-20)


# -- warmth and screws -------------------------------------------------------------------------------------------------


def test_a_rod_grows_by_its_length(cantilever):
    grown = pulled(cantilever, [0.0], [of(laws.ThermalGrowth, "beam", expansion=1.2e-5)], temperature=np.array([45.0]))
    assert grown[0, 0] == pytest.approx(1.2e-5 * 25 * L, rel=1e-9)
    assert np.abs(grown[0, 1:]).max() < 1e-15


def test_what_was_not_measured_is_not_warm(cantilever):
    grow = of(laws.ThermalGrowth, "beam", expansion=1.2e-5)
    assert not pulled(cantilever, [0.0], [grow]).any()
    assert not pulled(cantilever, [0.0], [grow], temperature=np.array([np.nan])).any()


@pytest.fixture
def screw(tmp_path):
    file = RobotFile()
    file.link("nut")
    file.held("slide", "base", "nut", axis=(0, 0, 1))
    file.module("screw", "ball_screw", "slide", {"length": 0.6, "area": 1.8e-4, "youngs_modulus": 206e9})
    drive = {
        "screw_lead": 0.01,
        "reverse_efficiency": 0.8,
        "motor_pulley_diameter": 0.1,
        "screw_pulley_diameter": 0.035,
    }
    file.module("motor", "motor", "slide", {"torsional_stiffness": 7e3, **drive})
    return file.load(tmp_path, "nut")


TRAVEL = np.array([[0.1], [0.2], [0.3025]])


def wave(times):
    """Return by how much an encoder errs so often in a turn of the motor, which takes the nut 1/35 m."""
    angle = times * 2 * pi * 35 * TRAVEL[:, 0]
    return 3e-6 * np.sin(angle) + 4e-6 * np.cos(angle)


@pytest.mark.parametrize(
    ("law", "expected"),
    [
        (of(laws.ThermalGrowth, "screw", expansion=1.2e-5), 1.2e-5 * np.array([0, 10, 20]) * TRAVEL[:, 0]),
        (
            of(laws.GrowthFromSupport, "screw", "from its support", expansion=1.2e-5, length=-0.4),
            1.2e-5 * np.array([0, 10, 20]) * (TRAVEL[:, 0] - 0.4),
        ),
        (of(laws.LeadError, "screw", "proportional", relative=2e-4), 2e-4 * TRAVEL[:, 0]),
        (of(laws.PeriodicLeadError, "screw", "periodic", sine=3e-6, cosine=4e-6), np.array([4e-6, 4e-6, 3e-6])),
        (of(laws.EccentricEncoder, "motor", "once a turn", sine=3e-6, cosine=4e-6), wave(1)),
        (of(laws.OvalEncoder, "motor", "twice a turn", sine=3e-6, cosine=4e-6), wave(2)),
        (of(laws.EncoderOffset, "motor", offset=-3e-4), np.full(3, -3e-4)),
        (of(laws.EncoderDelay, "motor", delay=2e-3), 2e-3 * np.array([0.0, 0.1, -0.1])),
    ],
    ids=lambda value: type(value.law).__name__ if isinstance(value, Effect) else "",
)
def test_the_nut_is_where_the_law_puts_it(screw, law, expected):
    inputs = Inputs(
        np.arange(3.0),
        TRAVEL,
        np.zeros((3, 6)),
        np.arange(3),
        temperature=np.array([20.0, 30.0, 40.0]),
        speeds=np.array([[0.0], [0.1], [-0.1]]),
    )
    z = Simulator(screw, inputs).run([law]).position[:, 2]
    np.testing.assert_allclose(z, TRAVEL[:, 0] + expected, rtol=0, atol=1e-13)


@pytest.mark.parametrize(("law", "times"), [(laws.EccentricEncoder, 1), (laws.OvalEncoder, 2)])
def test_a_hinges_encoder_errs_by_the_hinges_own_turn(law, times):
    base = simulator("ur5")
    bent = base.inputs.actuators.copy()
    bent[:, 2] += 0.02 * np.sin(times * bent[:, 2]) - 0.03 * np.cos(times * bent[:, 2])
    aspect = {1: "once a turn", 2: "twice a turn"}[times]
    found = base.run([of(law, "elbow_joint", aspect, sine=0.02, cosine=-0.03)])
    expected = Simulator(robot("ur5"), replace(base.inputs, actuators=bent)).run()
    np.testing.assert_allclose(found.position, expected.position, rtol=0, atol=1e-11)


@pytest.mark.parametrize("leg", [1, 2, 3])
def test_an_encoders_offset_is_a_column_of_the_jacobian(leg):
    base, step = nominal("3prup"), 1e-6
    unloaded = Inputs(np.zeros(1), simulator("3prup").inputs.actuators[:1], np.zeros((1, 6)), np.zeros(1, int))
    bench = Simulator(robot("3prup"), unloaded)
    moved = change(bench.run([of(laws.EncoderOffset, f"leg{leg}/motor", offset=step)]), bench.run())[0]
    ends = []
    for sign in (1, -1):
        actuators = unloaded.actuators[0].copy()
        actuators[leg - 1] += sign * step
        ends.append(robot("3prup").pose_from_actuators(actuators).base_from_tool)
    np.testing.assert_allclose(moved[:3], (ends[0][:3, 3] - ends[1][:3, 3]) / 2, atol=1e-5 * step)
    assert base.solved.all()


@pytest.mark.parametrize(
    ("place", "lengths"),
    [("leg1/base", {"radius": 2e-4, "tangential": -1e-4, "height": 3e-4}), ("leg2/base", {"height": -2e-4})],
)
def test_a_geometric_offset_is_the_robot_with_other_lengths(place, lengths):
    law = effect("3prup", laws.GeometricOffset, place, **{"radius": 0.0, "tangential": 0.0, "height": 0.0, **lengths})
    run = simulator("3prup").run([law])
    given = robot("3prup").parameters
    other = robot("3prup").with_parameters(
        {f"{place}.{k}": given[f"{place}.{k}"].value + v for k, v in lengths.items()}
    )
    expected = Simulator(other, simulator("3prup").inputs).run()
    assert np.abs(change(run, expected)).max() < 1e-11
    assert np.abs(change(run, nominal("3prup"))).max() > 1e-5


def test_a_longer_yoke_moves_what_it_carries():
    """The robot file counts an actuator's position to the yoke's far end; a longer yoke is farther out all the same."""
    yoke = effect("3prup", laws.GeometricOffset, "leg1/R_lambda", offset=1e-4)
    out = effect("3prup", laws.EncoderOffset, "leg1/motor", offset=1e-4)
    base = simulator("3prup").inputs
    bench = Simulator(robot("3prup"), Inputs(base.time, base.actuators, 0 * base.wrench, base.blocks))
    assert np.abs(change(bench.run([yoke]), bench.run([out]))).max() < 1e-11


# -- weights and sensors -----------------------------------------------------------------------------------------------


def acting(*effects):
    return simulator("3prup").setup(effects)


def test_a_hose_shares_the_load_with_the_spring(spring):
    """K u + k (u - slack) = F: what it pulls follows the block."""
    hose, slack = 5e4, 2e-3
    laid = of(laws.ExternalSpring, "environment", stiffness=hose, x=slack, y=0.0, z=0.0)
    forces = np.array([0.0, 300.0, -200.0])
    moved = pulled(spring, forces, [laid])
    np.testing.assert_allclose(moved[:, 0], (forces + hose * slack) / (K + hose), rtol=1e-9)
    across = of(laws.UnevenSpring, "environment", "by direction", x=slack, y=0.1, z=0.1, stiffness_x=0.0,
                stiffness_y=hose, stiffness_z=hose)  # fmt: skip
    np.testing.assert_allclose(pulled(spring, forces, [across])[:, 0], forces / K, rtol=1e-9)


def test_a_cable_pulls_once_it_is_taut_and_never_pushes(spring):
    """K u + k max(u - gap, 0) = F along the slide, but for the take-up of 3 mm about the gap."""
    k, gap = 5e4, 2e-3
    forces = np.array([-300.0, 0.0, 50.0, 99.0, 800.0, 1000.0])
    behind = of(laws.SlackCable, "environment", stiffness=k, slack_length=0.5 + gap, x=-0.5, y=0.0, z=0.0)
    free = forces / K
    expected = np.where(free > gap, (forces + k * gap) / (K + k), free)
    assert (np.abs(expected - gap) > TAKE_UP / 2).all()
    np.testing.assert_allclose(pulled(spring, forces, [behind])[:, 0], expected, rtol=1e-9, atol=1e-15)
    within = pulled(spring, [0.0, 400.0], [behind])[1, 0]  # about half of the way is taken up
    assert K * within + k * (within - gap + TAKE_UP / 2) ** 2 / (2 * TAKE_UP) == pytest.approx(400.0, rel=1e-9)


def test_a_cable_pulls_towards_its_anchor(spring):
    k, anchor, length = 5e4, np.array([0.01, 0.02]), 0.015
    beside = of(laws.SlackCable, "environment", stiffness=k, slack_length=length, x=anchor[0], y=0.0, z=anchor[1])

    def balance(u, force):
        way = anchor - [u, 0.0]
        far = np.hypot(*way)
        return K * u - force - k * (far - length) * way[0] / far

    forces = np.array([-300.0, 0.0, 80.0, 400.0])
    expected = [brentq(balance, -0.01, 0.01, args=(force,), xtol=1e-14) for force in forces]
    np.testing.assert_allclose(pulled(spring, forces, [beside])[:, 0], expected, rtol=1e-9)


@pytest.fixture
def boom(tmp_path):
    """4 kg on a rigid slide along x that begins at (0.5, 0, 1)."""
    file = RobotFile(gravity=(0.0, 0.0, -9.80665))
    file.link("trolley", mass=4.0)
    file.held("slide", "base", "trolley", xyz=(0.5, 0.0, 1.0), axis=(1, 0, 0))
    return file.load(tmp_path, "trolley")


def test_a_base_gives_way_under_what_pulls_at_the_tool(boom):
    """It is shifted by c F and turned by r (p x F) about its origin; a turn moves the tool by turn x p."""
    forces = np.array([0.0, 300.0, -200.0])  # along y: the moment is F (-1, 0, 0.5)
    alike = of(laws.BaseCompliance, "base", translation=2e-8, rotation=1e-8)
    moved = pulled(boom, forces, [alike], axis=1)
    np.testing.assert_allclose(moved[:, 1], forces * (2e-8 + 1e-8 * (1.0 + 0.25)), rtol=1e-5)
    np.testing.assert_allclose(moved[:, [0, 2]], 0, atol=1e-10)
    shifts = {f"translation_{axis}": 0.0 for axis in "xyz"}
    tilts = of(
        laws.UnevenBaseCompliance, "base", "by axis", **shifts, rotation_x=3e-8, rotation_y=5e-8, rotation_z=7e-8
    )
    np.testing.assert_allclose(pulled(boom, forces, [tilts], axis=1)[:, 1], forces * (3e-8 + 7e-8 / 4), rtol=1e-5)


def test_a_base_stands_at_zero_under_the_weight_at_home(boom):
    """Where a pose moves the weight outwards by 0.3 m, the base turns by r m g 0.3."""
    weight, out = of(laws.SelfWeight, "robot", scale=1.0), np.array([[0.0], [0.3]])
    soft = of(laws.BaseCompliance, "base", translation=1e-7, rotation=1e-6)
    moved = pulled(boom, [0.0, 0.0], [weight, soft], actuators=out)
    np.testing.assert_allclose(moved[0], 0, atol=1e-15)
    turn = 1e-6 * 4.0 * 9.80665 * 0.3
    np.testing.assert_allclose(moved[1] - [0.3, 0, 0], [turn * 1.0, 0, -turn * 0.8], rtol=1e-4, atol=1e-12)


def test_a_tool_gives_way_under_what_acts_on_it_whatever_the_robot_weighs(boom):
    """By c F in its direction; the boom is rigid, and its own 4 kg pass by the tool."""
    forces = np.array([0.0, 300.0, -200.0])
    weight, mass = of(laws.SelfWeight, "robot", scale=1.0), of(laws.Payload, "trolley", mass=3.0)
    soft = of(laws.ToolCompliance, "trolley", translation=2e-7, rotation=1e-5)
    np.testing.assert_allclose(pulled(boom, forces, [weight, soft], axis=1)[:, 1], 2e-7 * forces, rtol=1e-12)
    sags = pulled(boom, forces, [soft, mass], axis=1)
    np.testing.assert_allclose(sags[:, 1:], np.stack((2e-7 * forces, np.full(3, -6e-7 * 9.80665)), 1), atol=1e-15)


def test_a_stem_bends_as_a_cantilever_seen_half_way_along_it():
    """At its tip l^3 / (3 EI) F + l^2 / (2 EI) M and l^2 / (2 EI) F + l / EI M across; in the tool's axes."""
    length, bends = 0.2, 1e-3
    across = {"translation": length**3 / 12 * bends, "rotation": length * bends}
    values = {f"{name}_{axis}": 0.0 for name in across for axis in "xyz"} | {"x": 0.0, "y": 0.0, "z": -length / 2}
    values |= {f"{name}_{axis}": value for name, value in across.items() for axis in "xy"}
    law = of(laws.UnevenToolAtPoint, "moving_star", "by axis, about a point", **values)
    base, run = nominal("3prup"), simulator("3prup").run([law])
    load = run.setup.wrench.reshape(-1, 2, 3) @ base.rotation  # force and moment in the tool's axes
    (fx, fy, _), (mx, my, _) = load.transpose(1, 2, 0)
    turn = bends * np.stack((length * mx - length**2 / 2 * fy, length * my + length**2 / 2 * fx, 0 * fx), 1)
    shift = bends * np.stack(
        (length**3 / 3 * fx + length**2 / 2 * my, length**3 / 3 * fy - length**2 / 2 * mx, 0 * fx), 1
    )
    np.testing.assert_allclose(run.position - base.position, (base.rotation @ shift[..., None])[..., 0], atol=1e-15)
    turned = base.rotation.mT @ run.rotation
    np.testing.assert_allclose(turned, rotation_exp(turn), atol=1e-12)


def test_a_marker_on_the_body_before_a_soft_tool_stays():
    name = next(name for name in NAMES if len(robot(name).mechanism.frame_names) > 3)
    mechanism = robot(name).mechanism
    soft = of(laws.ToolCompliance, mechanism.tool_part, translation=1e-6, rotation=1e-5)
    base, run = nominal(name), simulator(name).run([soft])
    for frame in mechanism.frames.values():
        moved = np.nanmax(np.abs(run.pose_of(frame)[0] - base.pose_of(frame)[0]))
        assert (moved > 1e-6) == (frame.name == mechanism.tool.name)


def test_a_payload_is_a_dead_force():
    setup = acting(of(laws.Payload, "moving_star", mass=2.5))
    np.testing.assert_allclose(setup.wrench - setup.inputs.wrench, [[0, 0, 2.5 * 9.80665, 0, 0, 0]] * 10, atol=1e-12)


def test_a_payload_beside_the_tool_point_turns_with_it():
    setup = acting(of(laws.OffCentrePayload, "moving_star", "off centre", mass=2.0, x=0.03, y=-0.01, z=0.02))
    tool = nominal("3prup").geometry.poses[int(nominal("3prup").geometry.rows[0])].base_from_tool
    arm = tool[:3, :3] @ [0.03, -0.01, 0.02]
    expected = np.cross(arm, [0, 0, 2 * 9.80665])
    np.testing.assert_allclose((setup.wrench - setup.inputs.wrench)[0, 3:], expected, atol=1e-12)


def test_weight_hangs_on_the_arm(tmp_path):
    file = RobotFile(gravity=(0.0, 0.0, -9.81))
    file.link("arm", mass=4.0, centre=(0.5, 0.0, 0.0))
    file.joint("hinge", "revolute", "base", "arm", axis=(0, 1, 0))
    file._actuated.append("hinge")
    file.module("gear", "joint_spring", "hinge", {"stiffness": 8e3})
    file.frame("tool", "arm", (1.0, 0, 0))
    sag = pulled(file.load(tmp_path), [0.0], [of(laws.SelfWeight, "robot", scale=0.5)])[0, 2]
    angle = 0.5 * 4 * 9.81 * 0.5 / 8e3
    assert sag == pytest.approx(-np.sin(angle), rel=1e-5)


REPORTED = np.array([10.0, -20.0, 30.0, 1.0, 2.0, -3.0])


def sensed(*effects):
    mechanism = robot("3prup").mechanism
    inputs = Inputs(np.zeros(1), np.array([[0.4, 0.4, 0.4]]), REPORTED[None], np.zeros(1, int))
    setup = Setup.nominal(mechanism, inputs)
    for item in effects:
        setup.take(item.deeds(setup))
    return setup.wrench[0]


def test_a_wrench_sensor_by_hand():
    quarter = of(laws.WrenchSensorMisalignment, "wrench_sensor", rx=0.0, ry=0.0, rz=pi / 2)
    np.testing.assert_allclose(sensed(quarter), [20, 10, 30, -2, 1, -3], atol=1e-13)
    gain = of(laws.WrenchSensorGain, "wrench_sensor", fx=1.1, fy=1.0, fz=0.9, mx=2.0, my=1.0, mz=0.5)
    np.testing.assert_allclose(sensed(gain), [11, -20, 27, 2, 2, -1.5])
    np.testing.assert_allclose(
        sensed(of(laws.WrenchSensorCommonGain, "wrench_sensor", "all channels", gain=1.2)), 1.2 * REPORTED
    )
    talk = of(laws.WrenchSensorCrosstalk, "wrench_sensor", "fx by fz", share=0.1)
    np.testing.assert_allclose(sensed(talk), [7, -20, 30, 1, 2, -3])
    moment = of(laws.WrenchSensorCrosstalk, "wrench_sensor", "mz by my", share=-0.5)
    np.testing.assert_allclose(sensed(moment), [10, -20, 30, 1, 2, -2])
    bias = of(laws.WrenchSensorBias, "wrench_sensor", fx=1.0, fy=2.0, fz=3.0, mx=0.1, my=0.2, mz=0.3)
    np.testing.assert_allclose(sensed(bias), REPORTED - [1, 2, 3, 0.1, 0.2, 0.3])
    forces = of(laws.WrenchSensorForceBias, "wrench_sensor", "forces", fx=1.0, fy=2.0, fz=3.0)
    np.testing.assert_allclose(sensed(forces), REPORTED - [1, 2, 3, 0, 0, 0])
    np.testing.assert_allclose(sensed(bias, gain), (REPORTED - [1, 2, 3, 0.1, 0.2, 0.3]) * [1.1, 1, 0.9, 2, 1, 0.5])


def test_a_wrench_sensor_knows_nothing_of_a_payload():
    gain = of(laws.WrenchSensorCommonGain, "wrench_sensor", "all channels", gain=1.2)
    mass = of(laws.Payload, "moving_star", mass=1.0)
    for order in ((gain, mass), (mass, gain)):
        np.testing.assert_allclose(sensed(*order), 1.2 * REPORTED + [0, 0, 9.80665, 0, 0, 0])


def test_a_pose_sensors_frame_is_turned_and_shifted():
    turn = rotation_exp(np.array([0.1, -0.2, 0.3]))
    law = of(laws.PoseSensorMisalignment, "pose_sensor", rx=0.1, ry=-0.2, rz=0.3, tx=0.01, ty=0.02, tz=0.03)
    base, run = nominal("3prup"), simulator("3prup").run([law])
    np.testing.assert_allclose(run.position, base.position @ turn.T + [0.01, 0.02, 0.03], atol=1e-11)
    np.testing.assert_allclose(run.rotation, turn @ base.rotation, atol=1e-10)


def test_a_pose_sensor_wanders_along_a_line():
    law = of(laws.PoseSensorDrift, "pose_sensor", "drift", vx=1e-4, vy=-2e-4, vz=3e-4)
    base, run, time = nominal("3prup"), simulator("3prup").run([law]), simulator("3prup").inputs.time
    wandered = (time - time[0])[:, None] * [1e-4, -2e-4, 3e-4]
    np.testing.assert_allclose(run.position, base.position + wandered, atol=1e-11)
    np.testing.assert_allclose(run.rotation, base.rotation, atol=1e-12)


def test_a_pose_sensors_scale_stretches_positions_from_its_own_origin():
    law = of(laws.PoseSensorScale, "pose_sensor", error=8e-4)
    base, run = nominal("3prup"), simulator("3prup").run([law])
    np.testing.assert_allclose(run.position, 1.0008 * base.position, atol=1e-14)
    np.testing.assert_allclose(run.rotation, base.rotation, atol=1e-14)


def test_a_pose_sensors_scale_is_of_all_it_sees_wherever_it_stands():
    """Whatever is off besides, in whatever order: where the target sits, where the sensor stands, how it wanders."""
    turn, tilt = (rotation_exp(np.array(vector)) for vector in ([0.1, -0.2, 0.3], [-0.2, 0.1, 0.05]))
    scale = of(laws.PoseSensorScale, "pose_sensor", error=0.02)
    frame = of(laws.PoseSensorMisalignment, "pose_sensor", rx=0.1, ry=-0.2, rz=0.3, tx=0.01, ty=0.02, tz=0.03)
    target = of(laws.TargetMisalignment, "target", x=0.01, y=0.02, z=0.03, rx=-0.2, ry=0.1, rz=0.05)
    base, time = nominal("3prup"), simulator("3prup").inputs.time
    sits = base.position + base.rotation @ [0.01, 0.02, 0.03]
    wandered = (time - time[0])[:, None] * [1e-4, -2e-4, 3e-4]
    drift = of(laws.PoseSensorDrift, "pose_sensor", "drift", vx=1e-4, vy=-2e-4, vz=3e-4)
    for effects, true in (
        ([scale, frame, target], sits @ turn.T + [0.01, 0.02, 0.03]),
        ([target, scale, frame], sits @ turn.T + [0.01, 0.02, 0.03]),
        ([drift, scale], base.position + wandered),
        ([scale, drift], base.position + wandered),
    ):
        run = simulator("3prup").run(effects)
        np.testing.assert_allclose(run.position, 1.02 * true, atol=1e-11)
        if frame in effects:
            np.testing.assert_allclose(run.rotation, turn @ base.rotation @ tilt, atol=1e-10)


def test_a_target_sits_beside_the_tool():
    turn = rotation_exp(np.array([0.1, -0.2, 0.3]))
    law = of(laws.TargetMisalignment, "target", x=0.01, y=0.02, z=0.03, rx=0.1, ry=-0.2, rz=0.3)
    base, run = nominal("3prup"), simulator("3prup").run([law])
    np.testing.assert_allclose(run.position, base.position + base.rotation @ [0.01, 0.02, 0.03], atol=1e-11)
    np.testing.assert_allclose(run.rotation, base.rotation @ turn, atol=1e-10)


@pytest.mark.parametrize(
    ("law", "named"),
    [
        (laws.JointPosition, "{place}.{key}"),
        (laws.JointDirection, "{place}.{key}"),
        (laws.SeatPosition, "{place}.seat_{key}"),
    ],
)
def test_a_part_elsewhere_is_the_deviation_that_redrawn_robots_have(law, named):
    """`test_moved_parts` compares the deviations with robots that are drawn that way."""
    name = next(name for name in NAMES if of(law, "").law.places(robot(name).mechanism))
    mechanism, one = robot(name).mechanism, of(law, "").law
    place = one.places(mechanism)[0]
    values = {q.name: 1e-4 * (index + 1) for index, q in enumerate(one.quantities_at(place, mechanism))}
    at = {key: part.name for key, part in parts(mechanism).items()}.get(place.name, place.name)
    deviations = {named.format(place=at, key=key): value for key, value in values.items()}
    every = calibration_of(mechanism)
    assert deviations.keys() <= {item.name for item in every.deviations}
    run, same = (
        simulator(name).run([effect])
        for effect in (Effect(one, place, values), Effect(every, Place("robot"), deviations))
    )
    assert np.abs(change(run, nominal(name))).max() > 1e-6
    assert np.abs(change(run, same)).max() < 1e-11


def test_a_loops_end_elsewhere_is_the_deviation_that_redrawn_robots_have():
    mechanism, law = robot("six_ups").mechanism, of(laws.LoopEndPosition, "").law
    place = law.places(mechanism)[0]
    values = {q.name: 1e-4 for q in law.quantities_at(place, mechanism)}
    loop = next(loop for loop in mechanism.loops if place.name in (loop.first.name, loop.second.name))
    deviations = {f"{loop.name}.{place.name}.{key}": value for key, value in values.items()}
    run = simulator("six_ups").run([Effect(law, place, values)])
    same = simulator("six_ups").run([Effect(calibration_of(mechanism), Place("robot"), deviations)])
    assert np.abs(change(run, nominal("six_ups"))).max() > 1e-6
    assert np.abs(change(run, same)).max() < 1e-11


def test_a_law_at_many_places_is_the_law_at_each():
    for name, law in (("ur5", of(laws.EveryJointCompliance, "").law), ("3prup", laws.Everywhere(laws.EncoderOffset()))):
        mechanism = robot(name).mechanism
        place = law.places(mechanism)[0]
        start = law.starts(place, mechanism)[0]
        single = law.apart(place, mechanism)
        if single:
            each = [of(laws.JointCompliance, *place, compliance=start[key]) for key, place in single.items()]
        else:
            each = [Effect(law.law, other, start) for other in law.at(place, mechanism)]
        run, same = simulator(name).run([Effect(law, place, start)]), simulator(name).run(each)
        assert len(each) > 1
        assert np.abs(change(run, nominal(name))).max() > 1e-7
        assert np.abs(change(run, same)).max() < 1e-11


def test_one_clock_makes_all_encoders_late_whatever_joints_are_called():
    """An arm's joints with names of their own are no like parts of legs; their zeros are each its own."""
    late, off = laws.Everywhere(laws.EncoderDelay()), laws.Everywhere(laws.EncoderOffset())
    mechanism = robot("ur5").mechanism
    groups = {place.aspect: [each.name for each in late.at(place, mechanism)] for place in late.places(mechanism)}
    assert groups["each drive"] == list(mechanism.actuated)
    assert set(groups) - {place.aspect for place in off.places(mechanism)} == {"each drive"}
    assert late.advice(Place("robot", "each drive"), {"delay": 1e-3}).startswith("stamp the encoder at each drive and")
    # where legs are alike they are all there are, and told so once
    assert len(late.places(robot("3prup").mechanism)) == 1


def test_friction_lets_the_beams_twist():
    """The torque of a joint that sticks twists its branch: both yield, in series."""
    soft = acting(of(laws.CoulombFriction, "leg1/R_theta_P", limit=0.5, presliding_stiffness=4e3))
    named = acting(of(laws.Torsion, "robot", scale=1.0))
    assert soft.values["leg1/moving_star_branch.shear_modulus"] == pytest.approx(201e9 / 2.6)
    for key in ("leg1/linear_rod.shear_modulus", "leg2/moving_star_branch.shear_modulus"):
        assert soft.values[key] == named.values[key]
    scaled = acting(
        of(laws.Torsion, "robot", scale=3.0),
        of(laws.CoulombFriction, "leg1/R_theta_P", limit=0.5, presliding_stiffness=4e3),
    )
    assert scaled.values["leg1/linear_rod.torsion_constant"] == pytest.approx(1.5708e-8 / 3)


def test_where_a_hose_pulls_is_told_as_far_as_it_is_known():
    values = {"stiffness_x": 323.0, "stiffness_y": 182.0, "stiffness_z": 110.0, "x": 0.307, "y": 0.472, "z": -6e-15}
    hose = effect("3prup", laws.UnevenSpring, "environment", "by direction", **values)
    known = {name: (0.9 * value, 1.1 * value) for name, value in hose.values.items()}
    mechanism = robot("3prup").mechanism
    told = hose.law.told(hose.place, hose.values, {**known, "z": (-100.0, 100.0), "stiffness_z": (0.0, 1e7)}, mechanism)
    assert "(307, 472, ?) mm, with 323, 182, ? N/m" in told


def test_words_say_on_which_side_a_sensor_is_and_no_stiffness_that_nobody_knows():
    """'-9.99 % of it too much', 'off by -34.3 mrad' and '3.88e18 N/m' stood in a stranger's verdicts."""
    mechanism = robot("ur5").mechanism
    drive = Place(mechanism.actuated[0])
    effort = {law.physics: law for law in reversed(EFFORT_LAWS)}
    gain, offset = effort["effort_gain"], effort["encoder_offset"]
    assert gain.statement(drive, {"gain": -0.0999}, mechanism).endswith(" is 9.99 % of it too little")
    assert gain.statement(drive, {"gain": 0.0999}, mechanism).endswith(" is 9.99 % of it too much")
    assert " mm too much" in offset.statement(drive, {"offset": -0.0343}, mechanism).replace("mrad", "mm")
    assert " too little" in offset.statement(drive, {"offset": 0.0343}, mechanism)
    (stand,) = (law for law in LAWS if law.physics == "base_compliance" and law.variant == "by axis")
    values = {quantity.name: 1e-6 for quantity in stand.quantities} | {"translation_z": 2.6e-19}
    intervals = {"translation_z": (0.0, 1e-8), "rotation_x": (9e-7, 1.1e-6), "settled": (0.0, 0.005)}
    told = stand.told(Place("base", stand.variant), values, intervals, mechanism)
    assert told == "what the robot stands on gives way, with 1e6, 1e6, more than 1e8 N/m and 1e6 N m/rad"
    assert stand.statement(Place("base", stand.variant), values, mechanism).count("3.8") == 1
