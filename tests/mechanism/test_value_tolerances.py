"""Which values of a robot are off, and how far."""

from dataclasses import replace

import numpy as np
import pytest

import prup_pin
from prup_pin.mechanism.tolerances import kind_of_value, value_tolerances, values_following
from prup_pin.modules import KINDS
from prup_pin.recordings import TYPICAL, Tolerances
from prup_pin.robots import packaged_folder


def own(tmp_path, *changes):
    """Return the 3-PRUP with changes to its file."""
    text = (packaged_folder() / "3prup.urdf").read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    (tmp_path / "own.urdf").write_text(text)
    return prup_pin.load(tmp_path / "own.urdf").mechanism


def test_every_stiffness_of_the_3prup_falls_under_a_kind():
    mechanism = prup_pin.load("3prup").mechanism
    found = value_tolerances(mechanism, {"stiffness": 0.1, "bending": 0.03})
    assert len(found) == 39
    for name, deviation in found.items():
        share = 0.03 if name.rpartition(".")[0].endswith(("linear_rod", "branch")) else 0.1
        assert deviation == pytest.approx(share * mechanism.parameters[name].value), name
    assert value_tolerances(mechanism, {}) == {}
    assert len(value_tolerances(mechanism, {"bending": 0.03})) == 6
    assert value_tolerances(mechanism, replace(TYPICAL, stiffness=None, bending=None).declared) == {}


def test_the_robot_files_own_tolerance_wins(tmp_path):
    mechanism = own(
        tmp_path,
        ('value="6268.45"', 'value="6268.45" tolerance="25%"'),
        ('name="density"', 'tolerance="1%" name="density"'),
        ('value="0.181"', 'value="0.181" tolerance="8e-5"'),
    )
    found = value_tolerances(mechanism, TYPICAL.declared)
    assert found["leg1/R_lambda.tilting_stiffness"] == pytest.approx(0.25 * 6268.45)
    assert found["leg2/R_lambda.tilting_stiffness"] == pytest.approx(0.1 * 6268.45)
    assert found["leg1/linear_rod.density"] == pytest.approx(78.5)
    assert found["leg1/base.radius"] == pytest.approx(8e-5)
    assert len(found) == 41
    alone = value_tolerances(mechanism, {})
    assert alone == {name: found[name] for name in alone}
    assert len(alone) == 3


def test_a_section_with_a_tolerance_of_its_own_settles_the_bending(tmp_path):
    found = value_tolerances(own(tmp_path, ('value="7854e-12"', 'value="7854e-12" tolerance="1%"')), TYPICAL.declared)
    assert found["leg1/linear_rod.second_moment"] == pytest.approx(78.54e-12)
    assert "leg1/linear_rod.youngs_modulus" not in found
    assert "leg2/linear_rod.youngs_modulus" in found


def test_a_catalogues_rating_with_a_tolerance_settles_the_stiffness_that_follows(tmp_path):
    nut = '<parameter name="stiffness" value="505e6" unit="N/m" source="Table 1, k_ax; Eq. (112)"/>'
    ratings = (
        '<parameter name="rated_stiffness" value="500e6"/><parameter name="dynamic_load_rating" value="2e4"/>'
        '<parameter name="preload" value="1e3"/>'
    )
    plain = value_tolerances(own(tmp_path, (nut, ratings)), TYPICAL.declared)
    assert plain["leg1/ball_nut.stiffness"] > 0
    assert "leg1/ball_nut.rated_stiffness" not in plain
    declared = ratings.replace('name="rated_stiffness"', 'tolerance="5%" name="rated_stiffness"')
    found = value_tolerances(own(tmp_path, (nut, declared)), TYPICAL.declared)
    assert found["leg1/ball_nut.rated_stiffness"] == pytest.approx(25e6)
    assert "leg1/ball_nut.stiffness" not in found


def test_what_is_rigid_is_not_off():
    mechanism = prup_pin.load("3prup").with_parameters({"leg1/motor.torsional_stiffness": np.inf}).mechanism
    found = value_tolerances(mechanism, TYPICAL.declared)
    assert "leg1/motor.torsional_stiffness" not in found
    assert "leg2/motor.torsional_stiffness" in found


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.kind)
def test_no_kind_of_module_is_off_twice_for_one_stiffness(kind):
    counted = [quantity for quantity in kind.quantities if kind_of_value(kind, quantity)]
    for quantity in counted:
        assert not {other.name for other in counted} & set(quantity.derived_from)
        assert not quantity.shape
        assert kind_of_value(kind, quantity) in Tolerances.__dataclass_fields__
    if kind.kind not in ("section_beam", "compliance_matrix"):  # which are tables
        assert counted


def test_what_is_tabulated_beside_a_diameter_follows_it_in_proportion():
    mechanism = prup_pin.load("3prup").mechanism
    found = values_following(mechanism, "leg1/linear_rod.diameter", 0.0202)
    given = mechanism.module("leg1/linear_rod").values
    assert found.keys() == {"diameter", "area", "second_moment_x", "second_moment_y", "torsion_constant"}
    assert found["diameter"] == 0.0202
    assert found["area"] == pytest.approx(given["area"] * 1.01**2, rel=1e-12)
    for name in ("second_moment_x", "second_moment_y", "torsion_constant"):
        assert found[name] == pytest.approx(given[name] * 1.01**4, rel=1e-12)
    nominal = values_following(mechanism, "leg1/linear_rod.diameter", 0.02)
    assert nominal == {"diameter": 0.02}


def test_a_value_from_which_nothing_follows_stands_alone():
    mechanism = prup_pin.load("3prup").mechanism
    for name in ("leg1/linear_rod.density", "leg1/motor.screw_lead", "leg1/support_bearing.count"):
        value = 1.1 * mechanism.parameters[name].value
        assert values_following(mechanism, name, value) == {name.rpartition(".")[2]: value}


def test_a_stiffness_follows_its_rating(tmp_path):
    nut = '<parameter name="stiffness" value="505e6" unit="N/m" source="Table 1, k_ax; Eq. (112)"/>'
    ratings = (
        '<parameter name="rated_stiffness" value="500e6"/><parameter name="dynamic_load_rating" value="2e4"/>'
        '<parameter name="preload" value="1e3"/>'
    )
    mechanism = own(tmp_path, (nut, ratings))
    found = values_following(mechanism, "leg1/ball_nut.rated_stiffness", 450e6)
    before = mechanism.module("leg1/ball_nut").values["stiffness"]
    assert found == {"rated_stiffness": 450e6, "stiffness": pytest.approx(0.9 * before)}
