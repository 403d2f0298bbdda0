"""Commands of a compensation against the loaded robot, and against a simulator that shares no code with it."""

from __future__ import annotations

import pickle
from functools import cache

import numpy as np
import pytest

import prup_pin
from prup_pin.compensation import compensate
from prup_pin.errors import InputError, UnknownNameError
from prup_pin.laws.deviations import calibration_of
from prup_pin.recordings import Recording, ToolPath
from prup_pin.simulation import effect_named, simulate
from prup_pin.spatial import rotation_exp
from tests.laws.bench import ROBOTS
from tests.reference.concealed.device import Device

ROBOT = prup_pin.load("3prup")
NAMES = ROBOT.mechanism.actuated
#: Commands are right to this, in m and rad.
CLOSE = 3e-9


def effect(physics, place, aspect="", **values):
    return effect_named(physics, place, aspect, values, ROBOT.mechanism)


def path(rows=8, holds=False):
    """A curve through the workspace under a load that turns; `holds`: four poses, the load cycled in each."""
    share = np.linspace(0, 1, rows)
    at = np.floor(4 * share) / 4 if holds else share
    where = {
        "z": 0.38 + 0.04 * np.sin(5 * at),
        "theta": 0.2 * np.cos(5 * at),
        "phi": 0.2 * np.sin(4 * at) - 0.05,
    }
    wrench = np.zeros((rows, 6))
    wrench[:, 0], wrench[:, 2], wrench[:, 5] = 150 * np.sin(9 * share), -80.0, 20 * np.cos(7 * share)
    return ToolPath.of(where, wrench, time=20 * share)


def coordinates(position, rotation):
    """Task coordinates (N, 3) of the tool, R = R_x(theta) R_y(phi) R_z(lambda)."""
    return np.column_stack(
        (position[:, 2], np.arctan2(-rotation[:, 1, 2], rotation[:, 2, 2]), np.arcsin(rotation[:, 0, 2]))
    )


def missed(run, wanted):
    return coordinates(run.position, rotation_exp(run.rotation)) - np.column_stack(list(wanted.coordinates.values()))


def positions(found):
    return np.column_stack([found.commands.positions[name] for name in NAMES])


@cache
def plain():
    return ROBOT.compensate(path())


def test_the_loaded_robot_stands_where_it_was_wanted():
    """By `equilibrium`, pose by pose: nothing of the simulation that compensation runs."""
    wanted = path()
    found = plain()
    assert found.status == ("ok",) * len(wanted)
    for row, command in enumerate(positions(found)):
        at = ROBOT.equilibrium(ROBOT.pose_from_actuators(command), wanted.recording.wrench[row]).base_from_tool
        left = coordinates(at[None, :3, 3], at[None, :3, :3])[0] - [v[row] for v in wanted.coordinates.values()]
        assert np.abs(left).max() < CLOSE
        undeformed = ROBOT.pose(**{name: values[row] for name, values in wanted.coordinates.items()})
        loaded = ROBOT.equilibrium(undeformed, wanted.recording.wrench[row]).base_from_tool
        before = coordinates(loaded[None, :3, 3], loaded[None, :3, :3])[0] - list(undeformed.coordinates.values())
        np.testing.assert_allclose(found.before[row], before, atol=CLOSE)
        np.testing.assert_allclose(found.plain[row], list(undeformed.actuators.values()), atol=1e-12)
    assert np.abs(found.before).max() > 1e-3
    np.testing.assert_allclose(found.pose_before[:, 2], found.before[:, 0], atol=1e-9)
    assert np.abs(found.pose_after[:, :2]).max() > 1e-4  # which three actuators cannot move


LAWS_ALONG = {
    "play": [effect("backlash", "leg2/ball_nut", half_gap=6e-5, closing_load=1.0)],
    "friction": [
        effect("coulomb_friction", f"leg{leg}/R_theta_P", limit=2.0, presliding_stiffness=20000.0) for leg in (1, 2, 3)
    ],
    "creep": [effect("creep", "leg1/linear_rod", share=20.0, time_constant=5.0)],
    "screw": [effect("lead_error", "leg3/ball_screw", "periodic", sine=3e-5, cosine=1e-5)],
    "encoder": [effect("encoder_offset", "leg1/motor", offset=3e-4)],
    "weight": [effect("self_weight", "robot", scale=1.0)],
    "calibrated": [
        prup_pin.laws.Effect(
            calibration_of(ROBOT.mechanism),
            calibration_of(ROBOT.mechanism).places(ROBOT.mechanism)[0],
            {"leg1/linear_rod.youngs_modulus": 1.9e11, "leg2/R_lambda.axial_stiffness": 3e7},
        )
    ],
}
#: Those that remember while the robot was to stand still.
HOLDING = [("friction", True), pytest.param("creep", True, marks=pytest.mark.slow)]


@pytest.mark.parametrize(
    ("name", "holds"),
    [
        *((name, False) for name in ("play", "weight", "encoder")),
        *(
            pytest.param(name, False, marks=pytest.mark.slow)
            for name in LAWS_ALONG
            if name not in ("creep", "play", "weight", "encoder")
        ),
        *HOLDING,
    ],
)
def test_what_laws_do_along_the_path_is_cancelled(name, holds):
    wanted, effects = path(holds=holds), LAWS_ALONG[name]
    found = ROBOT.compensate(wanted, effects=effects)
    assert found.status == ("ok",) * len(wanted)
    left = missed(simulate(ROBOT, found.commands, effects), wanted)
    np.testing.assert_allclose(left, found.after, atol=1e-11)
    assert np.abs(left).max() < CLOSE
    ignorant = ROBOT.compensate(wanted).commands
    assert np.abs(missed(simulate(ROBOT, ignorant, effects), wanted)).max() > 1e-6, "the law does nothing here"


CONCEALED = {
    "play": (
        {"physics": "backlash", "location": "leg2/ball_nut", "direction": "axial", "half_gap": 6e-5, "smooth": 1.0},
        LAWS_ALONG["play"],
    ),
    "a soft rod": (
        {"physics": "stiffness_changed", "location": "leg1/linear_rod", "parameter": "E", "factor": 0.5},
        [effect("stiffness_changed", "leg1/linear_rod", factor=0.5)],
    ),
}


@pytest.mark.parametrize("name", CONCEALED)
def test_an_independent_device_goes_where_it_was_wanted(name):
    """At most 1 % of what it misses without compensation is left; the rest is what the two simulators differ by."""
    device, effects = CONCEALED[name]
    wanted = path()
    found = ROBOT.compensate(wanted, effects=effects)
    device = Device([device])
    errors = []
    for command in (found.plain, positions(found)):
        seen = device.simulate(command, wanted.recording.wrench, np.full(len(wanted), 20.0), wanted.recording.time)
        at = coordinates(seen.p, rotation_exp(seen.r))
        errors.append(at - np.column_stack(list(wanted.coordinates.values())))
    weights = np.array([1.0, ROBOT.characteristic_length, ROBOT.characteristic_length])
    before, after = (np.linalg.norm(weights * error, axis=1) for error in errors)
    assert (after < 0.01 * before).all()
    assert np.sqrt((after**2).mean() / (before**2).mean()) < 0.002


def test_a_model_of_the_pose_sensor_moves_no_actuator():
    turned = dict.fromkeys(("rx", "ry", "rz"), 0.01) | dict.fromkeys(("tx", "ty", "tz"), 0.002)
    found = ROBOT.compensate(path(), effects=[effect("pose_sensor_misalignment", "pose_sensor", **turned)])
    np.testing.assert_array_equal(positions(found), positions(plain()))
    assert "pose_sensor_misalignment" in found.remarks[0]


def test_positions_of_actuators_are_a_path_too():
    """The tool is wanted where the undeformed robot would have it."""
    wanted = path()
    given = dict(zip(NAMES, plain().plain.T, strict=True))
    same = ToolPath(Recording(wanted.recording.time, positions=given, wrench=wanted.recording.wrench))
    found = ROBOT.compensate(same)
    np.testing.assert_allclose(positions(found), positions(plain()), atol=CLOSE)


def test_an_arm_is_put_right_in_all_six_ways():
    arm = prup_pin.load("ur5", joint_stiffness=1e4)
    at = dict(zip(arm.task_coordinates, [0.2, -1.1, 1.4, -0.5, 0.7, 0.3], strict=True))
    wrench = [[60.0, -20, 40, 3, 2, 5], [-30.0, 50, 10, 1, 0, 2]]
    found = arm.compensate(at, wrench)
    wanted = arm.pose(**at).base_from_tool
    for row, load in enumerate(wrench):
        command = [found.commands.positions[name][row] for name in arm.mechanism.actuated]
        tool = arm.equilibrium(arm.pose_from_actuators(command), load).base_from_tool
        assert np.abs(tool - wanted).max() < CLOSE
    assert np.abs(found.before).max() > 1e-3


def test_three_actuators_put_right_what_they_can_move():
    delta = prup_pin.load(ROBOTS / "delta/robot.urdf", tool="platform", joint_stiffness=100)
    given = {name: np.array([0.1, 0.2]) for name in delta.mechanism.actuated}
    found = delta.compensate(ToolPath(Recording([0.0, 1.0], positions=given, wrench=np.full((2, 6), 5.0))))
    assert found.status == ("ok", "ok")
    assert np.abs(found.before[:, :3]).max() > 1e-3
    assert np.abs(found.pose_after[:, :3]).max() < CLOSE
    assert "3 actuators" in found.remarks[0]


def test_an_answer_is_a_function_of_its_question():
    again = pickle.loads(pickle.dumps(ROBOT)).compensate(path())
    np.testing.assert_array_equal(positions(again), positions(plain()))
    assert repr(pickle.loads(pickle.dumps(again))) == repr(again)


# -- what cannot be ----------------------------------------------------------------------------------------------------


def test_rows_that_cannot_be_are_said_and_left_without_a_command():
    found = ROBOT.compensate(
        {"z": [0.4, 0.4, 0.4, 0.7], "theta": [0.1, 0.1, 2.0, 0.0], "phi": 0.0},
        [[100.0, 0, 0, 0, 0, 0], [0, 0, -1e8, 0, 0, 0], [0] * 6, [0] * 6],
    )
    assert found.status == ("ok", "not converged", "unreachable", "unreachable")
    assert np.isnan(positions(found)).any(axis=1).tolist() == [False, True, True, True]
    assert "theta" in found.reasons["unreachable"]
    assert found.reasons["unreachable"].endswith("Are theta, phi in degrees? Expected rad, with which it could")
    assert {word: rows.tolist() for word, rows in found.failures.items()} == {
        "not converged": [1],
        "unreachable": [2, 3],
    }
    assert np.abs(found.after[0]).max() < CLOSE


def test_what_the_actuators_cannot_move_is_not_called_compensated(tmp_path):
    """A robot file may name more coordinates than its actuators command."""
    text = (ROBOTS.parents[1] / "urdf" / "3prup.urdf").read_text(encoding="utf-8")
    more = text.replace('<coordinate name="z"', '<coordinate name="x" component="x"/><coordinate name="z"')
    assert more != text
    (tmp_path / "more.urdf").write_text(more)
    robot = prup_pin.load(tmp_path / "more.urdf")
    given = {name: plain().plain[:2, column] for column, name in enumerate(NAMES)}
    found = robot.compensate(ToolPath(Recording([0.0, 1.0], positions=given, wrench=path().recording.wrench[:2])))
    assert set(found.status) == {"not cancelled"}
    assert "3 actuators cannot put the tool where it was wanted" in found.reasons["not cancelled"]
    assert np.isfinite(positions(found)).all()


@pytest.mark.parametrize(
    ("given", "wrench", "says"),
    [
        ({}, None, "at least one row"),
        ({"z": [], "theta": 0, "phi": 0}, None, "at least one row"),
        ({"z": 400, "theta": 0, "phi": 0}, None, "400 m: is it in mm? Expected m, which would be 0.4"),
        ({"z": 0.4, "theta": [0, -15], "phi": 0}, None, "theta in row 1: -15 rad: is it in degrees?"),
        ({"z": 0.4, "theta": 0}, None, "missing: phi"),
        ({"z": np.nan, "theta": 0, "phi": 0}, None, "'z' is not finite in row 0"),
        ({"z": "high", "theta": 0, "phi": 0}, None, "numbers of one shape"),
        ({"z": [0.4, 0.4], "theta": [0, 0, 0], "phi": 0}, None, "numbers of one shape"),
        ({"z": 0.4, "theta": 0, "phi": 0}, [1, 2, 3], "expected (6,) or (N, 6)"),
        ({"z": [0.4, 0.4], "theta": 0, "phi": 0}, np.zeros((3, 6)), "2 rows of coordinates and 3 of wrenches"),
        ({"z": 0.4, "theta": 0, "phi": 0}, [np.inf, 0, 0, 0, 0, 0], "wrench is not finite"),
    ],
)
def test_bad_paths_are_refused_in_words(given, wrench, says):
    with pytest.raises(InputError, match=r".") as error:
        ROBOT.compensate(given, wrench)
    assert says in str(error.value)


def test_a_strange_coordinate_is_refused_with_those_that_are_near():
    with pytest.raises(UnknownNameError, match="Did you mean 'theta'"):
        ROBOT.compensate({"z": 0.4, "tehta": 0, "phi": 0})


def test_times_must_increase():
    with pytest.raises(InputError, match="time must be 2 numbers that increase"):
        ROBOT.compensate({"z": [0.4, 0.4], "theta": 0, "phi": 0}, time=[1.0, 1.0])


def test_a_path_that_was_read_has_its_own_wrench():
    with pytest.raises(InputError, match="its own wrench"):
        compensate(ROBOT, path(), np.zeros(6))
