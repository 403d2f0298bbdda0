"""What every law owes to the rest of the package; a new law needs a line in `LAWS` and nothing here."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from prup_pin.errors import InputError, ParameterError, UnknownNameError
from prup_pin.laws import LAWS, Effect, Everywhere, Place, Torsion, law_at
from prup_pin.laws.deeds import Strain
from prup_pin.laws.guide_play import GuidePlay
from prup_pin.laws.thermal_growth import GrowthFromSupport
from prup_pin.testing.poses import (
    change,
    check_derivatives,
    check_interval,
    check_leaves_alone,
    check_neutral,
    check_quantities,
    check_refit,
    check_shows,
    size_at_start,
    unlike,
)
from prup_pin.testing.words import check_advice, check_declared, check_small_sizes, check_statement

from .bench import ACTUATORS, NAMES, bench, robot, simulator

DOCS = Path(__file__).parents[2] / "docs"
#: The words of the table of laws.
DOCUMENTED = set(re.findall(r"^\| `(\w+)` \|", (DOCS / "laws.md").read_text(encoding="utf-8"), re.MULTILINE))
PARTS = (
    *("linear_rod", "ball_screw", "ball_nut", "support_bearing", "timing_belt", "motor"),
    *("R_lambda", "R_phi", "R_theta_P", "moving_star_branch", "base"),
)
PLACES = {f"leg{leg}/{part}" for leg in (1, 2, 3) for part in PARTS}
PLACES |= {"moving_star", "target", "wrench_sensor", "pose_sensor", "environment", "base", "robot"}
PLACES |= {f"leg{leg}_slide" for leg in (1, 2, 3)}  # guides, beside the drives that are parts
#: Laws that no pose shows alone: torsion, since no torque reaches the beams unless a joint resists.
HIDDEN = (Torsion,)
#: Robots that are there for what no other one has: slides without a screw, a slide in a tree.
ONLY = {"six_ups": GrowthFromSupport, "lift": GuidePlay}
#: In this order the first robot with a place for a law fits it again: those that are simulated in the least time come
#: first, and what is found on each robot is asked of the intervals.
QUICK = ("ur5", "five_bar", *NAMES)
#: The five-bar's gravity is perpendicular to its plane.
HIDDEN_ON = {("five_bar", "payload")}


def title(value):
    if isinstance(value, Everywhere):
        return f"Everywhere-{title(value.law)}"
    return value if isinstance(value, str) else type(value).__name__


def first_of(names, law):
    return next((name for name in names if law.places(robot(name).mechanism)), None)


def cases():
    """Every law on every robot, with the places at which it acts."""
    for name in NAMES:
        for law in LAWS:
            if name == "3prup_as_published" and law.physics != "model_equation_error":
                continue
            if name in ONLY and not isinstance(law, ONLY[name]):
                continue
            if places := law.places(robot(name).mechanism):
                yield name, law, places


def param(name, law, places, slow=False):
    return pytest.param(name, law, places, id=f"{name}-{title(law)}", marks=[pytest.mark.slow] if slow else [])


EVERY_ROBOT = pytest.mark.parametrize(("name", "law", "places"), [param(*case) for case in cases()])
#: Daily on the robot that is simulated in the least time, on all others among the slow tests.
ONE_ROBOT_DAILY = pytest.mark.parametrize(
    ("name", "law", "places"), [param(*case, slow=case[0] != first_of(QUICK, case[1])) for case in cases()]
)


@pytest.mark.parametrize("law", LAWS, ids=title)
def test_a_mechanic_is_told_what_to_do_about_it(law):
    place, values = Place("robot", "ball_nut") if isinstance(law, Everywhere) else Place("leg1/part"), {"relative": 0.0}
    check_advice(law, place, values)
    said = law.advice(place, values)
    if "{place}" in law.remedy:
        assert ("each ball_nut" if isinstance(law, Everywhere) else "leg1/part") in said


def test_a_wrong_lead_is_told_as_a_scale():
    law = law_at("lead_error", Place("leg1/ball_screw", "proportional"))
    said = law.advice(Place("leg1/ball_screw", "proportional"), {"relative": 3e-4})
    assert said.startswith("set the scale of the encoder at leg1/ball_screw to 1/1.0003 ")


def at_each_place(test, robots=EVERY_ROBOT):
    """Ask a test of a law at a place on every robot, at all places that are unlike each other, one after the other."""

    @robots
    def asked(name, law, places):
        for place in unlike(places, robot(name).mechanism):
            test(name, law, place)

    return asked


def at_each_place_of_one_robot_daily(test):
    return at_each_place(test, ONE_ROBOT_DAILY)


EVERY_LAW = pytest.mark.parametrize("law", LAWS, ids=title)


@EVERY_LAW
def test_declares_what_a_person_reads(law):
    assert law.physics in DOCUMENTED
    check_declared(law)
    assert any(law.places(robot(name).mechanism) for name in NAMES), "no test robot has a place for it"


@at_each_place
def test_quantities_have_units_and_starts_lie_inside_bounds(name, law, place):
    check_quantities(bench(name, law), law, place)


@EVERY_LAW
def test_places_of_the_three_prup_are_names_of_the_specification(law):
    for name in ("3prup", "3prup_as_published"):
        places = law.places(robot(name).mechanism)
        assert len(set(places)) == len(places)
        assert {place.name for place in places} <= PLACES


@EVERY_ROBOT
def test_is_found_again_by_its_places(name, law, places):
    mechanism = robot(name).mechanism
    for place in places:
        assert law_at(law.physics, place, mechanism) is law
        assert place in law_at(law.physics, place).places(mechanism)


@at_each_place_of_one_robot_daily
def test_neutral_values_change_nothing(name, law, place):
    check_neutral(bench(name, law), law, place)


@at_each_place_of_one_robot_daily
def test_start_values_change_the_pose(name, law, place):
    if not idle(name, law):
        check_shows(bench(name, law), law, place, shown(name, law))


@at_each_place_of_one_robot_daily
def test_acting_leaves_the_callers_inputs_alone(name, law, place):
    check_leaves_alone(bench(name, law), law, place)


@at_each_place
def test_strains_are_what_their_derivatives_say(name, law, place):
    check_derivatives(bench(name, law), law, place)


@pytest.mark.slow  # daily each law is fitted for its intervals, which hold the truth
@EVERY_LAW
def test_what_is_simulated_is_fitted_again(law):
    if not isinstance(law, HIDDEN):
        name = first_of(QUICK, law)
        places = unlike(law.places(robot(name).mechanism), robot(name).mechanism)
        check_refit(bench(name, law), law, max(places, key=lambda place: size_at_start(bench(name, law), law, place)))


def idle(name, law):
    """Return whether nothing balances a law: the delta's rods spin about themselves."""
    return name == "delta" and law.physics in ("coulomb_friction", "viscous_friction")


def shown(name, law):
    return not (idle(name, law) or isinstance(law, HIDDEN) or (name, law.physics) in HIDDEN_ON)


@pytest.mark.parametrize(
    ("name", "law", "places"),
    [  # the slow test that follows has all of them
        param(*case) for case in cases() if case[0] == first_of(QUICK, case[1])
    ],
)
def test_the_truth_lies_in_the_intervals_of_what_is_fitted(name, law, places):
    if shown(name, law):
        check_interval(bench(name, law), law, places[0])


@pytest.mark.slow
@at_each_place
def test_the_truth_lies_in_the_intervals_at_every_place(name, law, place):
    if shown(name, law):
        check_interval(bench(name, law), law, place)


@at_each_place
def test_statement_is_a_sentence_for_people(name, law, place):
    mechanism = robot(name).mechanism
    check_statement(law, place, law.starts(place, mechanism)[0], mechanism)


def test_growth_from_farther_off_than_the_robot_reaches_is_told_as_no_support():
    (law,) = (law for law in LAWS if isinstance(law, GrowthFromSupport))
    mechanism = robot("six_ups").mechanism
    place = law.places(mechanism)[0]
    near, far = (law.statement(place, {"expansion": 2e-6, "length": way}, mechanism) for way in (0.3, 4.5))
    assert "from a support" in near
    assert "support" not in far
    assert "wherever it stands" in far


@at_each_place
def test_a_statement_tells_small_sizes_in_small_units(name, law, place):
    check_small_sizes(law, place, robot(name).mechanism)


# -- composition -------------------------------------------------------------------------------------------------------


def outcome(effects):
    """Return a setup as something that can be compared."""
    setup = simulator("3prup").setup(effects)
    load = np.random.default_rng(2).normal(size=(len(setup.inputs), 6)) * 10
    wide = {name: 6 if name in robot("3prup")._statics.wrench_names else 1 for name in setup.strains}
    strained = {
        name: sum(strain(load[:, : wide[name]])[0] for strain in strains) for name, strains in setup.strains.items()
    }
    seen = np.zeros((len(load), 3)), np.broadcast_to(np.eye(3), (len(load), 3, 3))
    seen = setup.reported(*seen, "tool")
    modules = {module.name: module for module in setup.mechanism.modules}
    values = {  # without those that are what the robot file says
        name: value
        for name, value in setup.values.items()
        if value != modules[name.rpartition(".")[0]].values[name.rpartition(".")[2]]
    }
    names = sorted(values), sorted(setup.parameters), sorted(strained)
    numbers = [setup.wrench, setup.travel, *(strained[name] for name in names[2]), *seen, [setup.weight]]
    numbers += [[values[name] for name in names[0]], [setup.parameters[name] for name in names[1]]]
    return (*names, sorted(map(repr, setup.resistances)), setup.spread_weight), numbers


#: What a wrench sensor does to a wrench has an order: amplifier, cross talk and frame do not commute.
ORDERED = {"wrench_sensor_misalignment", "wrench_sensor_gain", "wrench_sensor_crosstalk", "wrench_sensor_bias"}


def test_laws_compose_in_any_order():
    """All at once, forwards and backwards: every two of them stand once this way and once that way."""
    mechanism = robot("3prup").mechanism
    there = [(law, law.places(mechanism)[0]) for law in LAWS if law.places(mechanism)]
    effects = [Effect(law, place, law.starts(place, mechanism)[0]) for law, place in there]
    sensor = [effect for effect in effects if effect.law.physics in ORDERED]
    others = [effect for effect in effects if effect.law.physics not in ORDERED]
    (names, numbers), (same_names, same_numbers) = outcome([*others, *sensor]), outcome([*sensor, *reversed(others)])
    assert names == same_names
    for first, second in zip(numbers, same_numbers, strict=True):
        np.testing.assert_allclose(first, second, rtol=1e-11, atol=1e-18)


def test_two_laws_of_a_kind_add_up():
    place = Place("leg1/motor")
    half, whole = (Effect(law_at("encoder_offset", place), place, {"offset": size}) for size in (5e-5, 1e-4))
    one, two = simulator("3prup").run([whole]), simulator("3prup").run([half, half])
    assert np.abs(change(one, two)).max() < 1e-12


# -- what does not fit -------------------------------------------------------------------------------------------------


def effect_of(physics, place, **values):
    at = Place(*place) if isinstance(place, tuple) else Place(place)
    return Effect(law_at(physics, at), at, values).checked(robot("3prup").mechanism)


def test_unknown_place_names_the_nearest():
    with pytest.raises(UnknownNameError, match=r"no place of backlash named 'leg1/ballnut'.*leg1/ball_nut"):
        effect_of("backlash", "leg1/ballnut", half_gap=1e-5, closing_load=1.0)
    with pytest.raises(UnknownNameError, match=r"R_phi \(radial\)"):
        effect_of("backlash", "leg1/R_phi", half_gap=1e-5, closing_load=1.0)


def test_a_robot_without_a_place_says_so():
    place = Place("robot")
    with pytest.raises(UnknownNameError, match="no place for shear"):
        law_at("shear", place, robot("ur5").mechanism)
    with pytest.raises(UnknownNameError, match="no place for shear"):
        Effect(law_at("shear", place), place, {"scale": 1.0}).checked(robot("ur5").mechanism)


def test_unknown_law_names_the_nearest():
    with pytest.raises(UnknownNameError, match=r"no law named 'back_lash'.*backlash"):
        law_at("back_lash", Place("leg1/ball_nut"))


def test_unknown_missing_and_impossible_parameters():
    with pytest.raises(UnknownNameError, match=r"no parameter of backlash named 'gap'.*half_gap"):
        effect_of("backlash", "leg1/ball_nut", gap=1e-5, closing_load=1.0)
    with pytest.raises(InputError, match="backlash at leg1/ball_nut: no value for closing_load"):
        effect_of("backlash", "leg1/ball_nut", half_gap=1e-5)
    with pytest.raises(ParameterError, match=r"half_gap = -1e-05 m: expected > 0 and <= 0.005 m"):
        effect_of("backlash", "leg1/ball_nut", half_gap=-1e-5, closing_load=1.0)
    with pytest.raises(ParameterError, match="expected a number"):
        effect_of("backlash", "leg1/ball_nut", half_gap="wide", closing_load=1.0)


def test_a_strain_of_nothing_is_nothing():
    strain = Strain(lambda load: (0 * load, np.zeros((*load.shape, 1))))
    assert strain.take([0])(np.ones((1, 1)))[0] == 0


def test_every_robot_of_these_tests_is_loaded():
    assert set(ACTUATORS) == set(NAMES)
