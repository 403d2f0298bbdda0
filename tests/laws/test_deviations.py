"""What is off by the robot file's own tolerances, beside what is off by kind."""

from pathlib import Path

import numpy as np
import pytest

import prup_pin
from prup_pin.laws import Effect, Place
from prup_pin.laws.deviations import Calibration, amounts_of, deviations_of, without_effect
from prup_pin.recordings import KINDS_OF_TOLERANCE, TYPICAL
from prup_pin.robots import packaged_folder
from prup_pin.simulation import Simulator

from . import bench


def robot_of(tmp_path, *changes):
    """Return the 3-PRUP with changes to its file."""
    text = (packaged_folder() / "3prup.urdf").read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    (tmp_path / "own.urdf").write_text(text)
    return prup_pin.load(tmp_path / "own.urdf")


def test_a_value_with_a_tolerance_of_its_own_is_a_parameter(tmp_path):
    declared = ('name="diameter" value="0.020"', 'tolerance="1%" name="diameter" value="0.020"')
    mechanism = robot_of(tmp_path, declared).mechanism
    found = {item.name: item for item in deviations_of(mechanism)}
    assert found["leg1/linear_rod.diameter"].unit == "m"
    assert "leg2/linear_rod.diameter" not in found
    amounts = amounts_of(tuple(found.values()), mechanism, {"bending": 0.03})
    assert amounts["leg1/linear_rod.diameter"] == pytest.approx(0.01)
    assert "leg1/linear_rod.youngs_modulus" not in amounts
    assert amounts["leg2/linear_rod.youngs_modulus"] == pytest.approx(0.03)


def test_a_diameter_that_is_off_takes_the_tabulated_section_along(tmp_path):
    declared = ('name="diameter" value="0.020"', 'tolerance="1%" name="diameter" value="0.020"')
    robot = robot_of(tmp_path, declared)
    items = {item.name: item for item in deviations_of(robot.mechanism)}
    thicker = items["leg1/linear_rod.diameter"]
    assert thicker.value(np.log(1.01)) == pytest.approx(0.0202)

    inputs = bench.inputs("3prup")
    run = Simulator(robot, inputs).run([Effect(Calibration([thicker]), Place("robot"), {thicker.name: 0.0202})])
    name, given = "leg1/linear_rod", robot.mechanism.module("leg1/linear_rod").values
    changed = robot.with_parameters({f"{name}.diameter": 0.0202}).with_parameters(
        {f"{name}.area": given["area"] * 1.01**2, f"{name}.second_moment": given["second_moment"] * 1.01**4}
    )
    expected = Simulator(changed, inputs).run()
    assert np.abs(expected.position - Simulator(robot, inputs).run().position).max() > 1e-6
    np.testing.assert_allclose(run.position, expected.position, atol=1e-12)


@pytest.mark.parametrize("own", [False, True])
def test_a_beams_moduli_are_off_together_unless_the_shear_modulus_has_a_tolerance_of_its_own(tmp_path, own):
    """E and G of one material: one is off with the other, in bending and in torsion by as much."""
    text = (Path(__file__).parents[2] / "examples" / "elastic_arm.urdf").read_text()
    given = 'name="shear_modulus"'
    (tmp_path / "arm.urdf").write_text(text.replace(given, f'tolerance="2%" {given}') if own else text)
    robot = prup_pin.load(tmp_path / "arm.urdf")
    beam = next(module for module in robot.mechanism.modules if np.isfinite(module.values.get("shear_modulus", np.inf)))
    item = {each.name: each for each in deviations_of(robot.mechanism)}[f"{beam.name}.youngs_modulus"]
    load = bench.load_cycle([[0.3] * len(robot.mechanism.actuated)], bench.WRENCH, bench.CYCLE)
    softer = {item.name: 0.97 * beam.values["youngs_modulus"]}
    run = Simulator(robot, load).run([Effect(Calibration([item]), Place("robot"), softer)])
    if not own:
        softer[f"{beam.name}.shear_modulus"] = 0.97 * beam.values["shear_modulus"]
    expected = Simulator(robot.with_parameters(softer), load).run()
    np.testing.assert_allclose(run.position, expected.position, atol=1e-12)
    np.testing.assert_allclose(run.rotation, expected.rotation, atol=1e-12)


@pytest.mark.parametrize("leg", [1, 2])
def test_what_a_length_with_a_tolerance_places_is_not_off_twice(tmp_path, leg):
    declared = (f'<length name="leg{leg}/base.radius"', f'<length tolerance="2e-4" name="leg{leg}/base.radius"')
    mechanism = robot_of(tmp_path, declared).mechanism
    items = deviations_of(mechanism)
    amounts = amounts_of(items, mechanism, {"position": 5e-5})

    def covariance(joint):
        """Of the displacement of a joint's place, by lengths and positions together, (3, 3) [m^2]."""
        total, setup = np.zeros((3, 3)), Simulator(prup_pin.load("3prup"), bench.inputs("3prup")).setup()
        for item in items:
            if item.kind in ("length", "position") and item.name in amounts and "." in item.name:
                for deed in item.act(item.value(amounts[item.name]), setup):
                    if getattr(deed, "joint", None) == joint:
                        moved = np.array(deed.displacement[:3])
                        total += np.outer(moved, moved)
        return total

    named = f"leg{leg}/base.radius"
    moves = next(length.moves for length in mechanism.description.lengths if length.parameter.name == named)
    radial = np.array(dict(moves)[f"leg{leg}_slide"])
    along = np.outer(radial, radial)
    expected = 4e-8 * along + 2.5e-9 * (np.eye(3) - along)
    np.testing.assert_allclose(covariance(f"leg{leg}_slide"), expected, rtol=1e-6, atol=1e-20)
    np.testing.assert_allclose(covariance("leg3_slide"), 2.5e-9 * np.eye(3), rtol=1e-6, atol=1e-20)


def test_tolerances_that_change_nothing_are_told():
    told = without_effect({"stiffness": 0.1, "inertia": 0.1, "effort_gain": 0.05, "effort_bias": 1.0})
    assert len(told) == 2
    assert "the tolerance inertia changes nothing here: a robot at rest does not feel its inertia" in told
    assert any("effort_gain and effort_bias" in text for text in told)
    assert without_effect({"mass": 0.1}) == []


def test_every_word_of_the_tolerances_is_of_something():
    """What a pose does not feel is told as such, and is of a motion's efforts."""
    mechanism = prup_pin.load("3prup").mechanism
    declared = {kind.name: getattr(TYPICAL, kind.name) for kind in KINDS_OF_TOLERANCE}
    amounts = amounts_of(deviations_of(mechanism, ["star_2"]), mechanism, declared)
    seen = {item.kind for item in deviations_of(mechanism, ["star_2"]) if amounts.get(item.name)}
    felt_in_motion = {kind for kind in declared if without_effect({kind: 1.0})}
    assert seen | felt_in_motion == set(declared)
    assert felt_in_motion == {"inertia", "effort_gain", "effort_bias"}
