"""Every law of the effort channel, one contract: neutral means nothing, proportion, fit gives back what was put in.

`prup_pin/testing/efforts.py` holds the checks that a wrong law must not pass; `test_wrong_laws_are_refused` shows it of
each.
"""

from dataclasses import replace

import numpy as np
import pytest

from prup_pin import load
from prup_pin.dynamics import INERTIAL, InMotion
from prup_pin.laws import Effect, Place
from prup_pin.laws.efforts import EFFORT_LAWS
from prup_pin.laws.efforts.coulomb_friction import SlidingFriction
from prup_pin.laws.efforts.delay import Lagging
from prup_pin.laws.efforts.effort_filter import EffortFilter, EffortsFilter, low_passed
from prup_pin.laws.efforts.effort_law import EFFORT
from prup_pin.laws.efforts.effort_sensor import EffortDelay
from prup_pin.laws.efforts.joint_compliance import YieldingGear
from prup_pin.laws.efforts.joint_coupling import FeltMotion, FeltPosition, SpringAcross
from prup_pin.laws.efforts.payload import HeldBody
from prup_pin.laws.efforts.stribeck_friction import StribeckFriction
from prup_pin.laws.efforts.viscous_friction import Damping
from prup_pin.parameters import Quantity
from prup_pin.simulation import CorrectedModel, read_model, write_model
from prup_pin.testing import efforts as contract
from prup_pin.testing.efforts import (
    check_derivative,
    check_nothing,
    check_proportion,
    check_refit,
    check_resists,
    check_simulated,
    check_units,
    in_motion,
    somewhere,
)
from prup_pin.testing.words import check_advice, check_declared, check_statement

from .effort_closed_forms import CLOSED_FORMS, Form, form_of, own

EVERY_LAW = pytest.mark.parametrize("law", EFFORT_LAWS, ids=lambda law: type(law).__name__)


@EVERY_LAW
def test_a_mechanic_is_told_what_to_do_about_it(law):
    check_advice(law, Place("elbow"), {})


TIME = np.arange(200) * 0.02
#: Where laws are tried that may act there.
MIDDLE = ("elbow_joint", "forearm_link")


@pytest.fixture(scope="module")
def at():
    return in_motion(load("ur5"))


@pytest.fixture(scope="module")
def recorded(at):
    """The same motion as a recording, and as a simulation sees it there."""
    robot = load("ur5")
    return robot, *contract.recorded(at, robot)


def check_closed_form(law, place, values, at):
    form = form_of(law)
    contract.check_closed_form(law, place, values, at, form, form.tolerance)


@EVERY_LAW
class TestEveryLaw:
    def test_it_has_words_and_units(self, law, at):
        check_declared(law)
        place, _ = somewhere(law, at, MIDDLE)
        names = {quantity.name for quantity in law.quantities_at(place, at.mechanism)}
        assert set(law.neutral) <= names
        assert place.aspect.startswith("effort")

    def test_nothing_adds_nothing(self, law, at):
        check_nothing(law, *somewhere(law, at, MIDDLE), at)

    def test_it_is_in_proportion_to_its_linear_parameters(self, law, at):
        check_proportion(law, *somewhere(law, at, MIDDLE), at)

    def test_it_is_its_equation(self, law, at):
        assert type(law) in CLOSED_FORMS, "write its closed form in effort_closed_forms.py"
        check_closed_form(law, *somewhere(law, at, MIDDLE), at)

    def test_its_columns_are_the_derivatives_of_its_efforts(self, law, at):
        check_derivative(law, *somewhere(law, at, MIDDLE), at)

    def test_a_refit_without_noise_gives_back_all_parameters(self, law, at):
        check_refit(law, *somewhere(law, at, MIDDLE), at)

    def test_what_is_simulated_is_fitted_again(self, law, recorded):
        robot, recording, seen = recorded
        check_simulated(law, *somewhere(law, seen, MIDDLE), robot, recording, seen)

    def test_friction_takes_power(self, law, at):
        check_resists(law, *somewhere(law, at, MIDDLE), at)

    def test_its_units_are_those_of_its_columns(self, law, at):
        check_units(law, *somewhere(law, at, MIDDLE), at)

    def test_a_person_reads_what_it_says(self, law, at):
        place, values = somewhere(law, at, MIDDLE)
        fitted = law.fitted(place, np.full(len(law.linear), 0.5), values)
        check_statement(law, place, {**values, **fitted}, at.mechanism)

    def test_it_survives_a_file(self, law, at, tmp_path):
        place, values = somewhere(law, at, MIDDLE)
        fitted = law.fitted(place, np.full(len(law.linear), 0.01), values)
        kept = {q.name: float({**values, **fitted}[q.name]) for q in law.quantities_at(place, at.mechanism)}
        model = CorrectedModel("ur5", (Effect(law, place, kept),))
        write_model(model, tmp_path / "model.json")
        assert read_model(tmp_path / "model.json") == model


def test_a_delay_is_the_effort_of_a_little_ago(at):
    delays = [law for law in EFFORT_LAWS if law.physics == "effort_delay"]
    law = next(law for law in delays if law.places(at.mechanism)[0].name == "robot")
    late = law.efforts(law.places(at.mechanism)[0], {"delay": 0.02}, at)
    # one sample of 20 ms
    assert (at.predicted + late)[1:] == pytest.approx(at.predicted[:-1], abs=1e-9)


def test_a_late_encoder_shifts_the_friction_of_its_joint_alone(at):
    law = next(law for law in EFFORT_LAWS if law.physics == "encoder_delay" and law.variant == "effort")
    place = Place("elbow_joint", law.variant)
    rubs = 3.0 * np.column_stack([at.speed(name) for name in at.driven])
    bare, rubbing = (law.efforts(place, {"delay": 0.02}, at.knowing(known, at.left)) for known in (0 * rubs, rubs))
    more, column = rubbing - bare, at.driven.index("elbow_joint")
    # one sample of 20 ms
    assert (rubs[:, column] + more[:, column])[:-1] == pytest.approx(rubs[1:, column], abs=1e-9)
    assert not np.delete(more, column, axis=1).any()


def test_a_load_makes_friction_grow(at):
    law = next(law for law in EFFORT_LAWS if law.variant == "effort by load")
    place, values = somewhere(law, at, MIDDLE)
    columns = law.efforts_per(place, values, at)[:, at.driven.index(place.name)]
    load = np.abs(at.rigid[:, at.driven.index(place.name)])
    assert columns[:, 1] == pytest.approx(columns[:, 0] * load)


def test_a_coupled_motor_acts_on_both_joints_with_the_power_of_one(at):
    law = next(law for law in EFFORT_LAWS if law.physics == "transmission_coupling")
    place, values = somewhere(law, at, MIDDLE)
    other = law.same_places(place, at.mechanism)[0]
    damping = law.efforts_per(place, {**values, "ratio": -1.0}, at)[:, :, 1]
    speed = at.speed(place.name) - at.speed(other)
    power = sum(damping[:, at.driven.index(name)] * at.speed(name) for name in (place.name, other))
    assert power == pytest.approx(speed**2)


class Drag(Damping):
    """tau = d |v| v, right as it is: no law of the library, here to be got wrong."""

    linear = ("drag",)
    resists = linear
    quantities = (Quantity("drag", "N m s^2/rad^2", "effort per speed squared", 1.0, upper=1e9),)
    neutral = {"drag": 0.0}  # noqa: RUF012
    power = 1

    def quantities_at(self, place, mechanism):
        return self.quantities

    def efforts_per(self, place, values, at):
        speed = at.speed(place.name)
        return at.along(place.name, np.abs(speed) * speed**self.power)[..., None]


CLOSED_FORMS[Drag] = Form(own(lambda joint, x: x["drag"] * np.abs(joint.v) * joint.v))


class SteepDrag(Drag):
    """tau = d |v| v^3 under the same unit."""

    power = 3


class PushingDamping(Damping):
    """tau = -d v."""

    def efforts_per(self, place, values, at):
        return -super().efforts_per(place, values, at)


class RestlessDamping(Damping):
    """Five is said to be nothing."""

    neutral = {"damping": 5.0}  # noqa: RUF012


class SquaredDamping(Damping):
    """tau = d^2 v, in proportion to what it is not."""

    def efforts(self, place, values, at):
        return self.efforts_per(place, values, at)[..., 0] * values["damping"] ** 2


class ShiftedDamping(Damping):
    """tau = d (v + 0.1): by no speed there is an effort."""

    def efforts_per(self, place, values, at):
        return super().efforts_per(place, values, at) + at.along(place.name, np.full(len(at), 0.1))[..., None]


class ForgetfulFriction(SlidingFriction):
    """Its smoothing does nothing, so no fit tells it."""

    def efforts_per(self, place, values, at):
        return super().efforts_per(place, {**values, "smoothing": 0.5}, at)


class MislabelledDamping(Damping):
    """Its unit is that of an inertia."""

    def quantities_at(self, place, mechanism):
        return (replace(self.quantities[0], unit="kg m^2"),)


class HalfSaidDamping(Damping):
    """Its columns are not what its efforts are made of."""

    def efforts(self, place, values, at):
        return 2 * super().efforts(place, values, at)


CHECKS = [
    *(check_nothing, check_closed_form, check_proportion, check_derivative),
    *(check_refit, check_resists, check_units),
]
#: By check the laws that it must refuse.
REFUSED = {
    check_nothing: [RestlessDamping()],
    check_closed_form: [PushingDamping(), SteepDrag(), ShiftedDamping(), HalfSaidDamping()],
    check_proportion: [SquaredDamping()],
    check_derivative: [SquaredDamping(), HalfSaidDamping()],
    check_refit: [SquaredDamping(), ForgetfulFriction()],
    check_resists: [PushingDamping()],
    check_units: [ShiftedDamping(), SteepDrag(), MislabelledDamping()],
}


@pytest.mark.parametrize("check", CHECKS)
def test_a_right_law_passes_every_check(check, at):
    for law in (Drag(), Damping(), SlidingFriction()):
        check(law, *somewhere(law, at, MIDDLE), at)


@pytest.mark.parametrize(
    ("check", "law"),
    [(check, law) for check, laws in REFUSED.items() for law in laws],
    ids=lambda given: getattr(given, "__name__", type(given).__name__),
)
def test_wrong_laws_are_refused(check, law, at):
    assert set(REFUSED) == set(CHECKS)
    with pytest.raises(AssertionError):
        check(law, *somewhere(law, at, MIDDLE), at)


@pytest.mark.parametrize("law", [SquaredDamping(), HalfSaidDamping()], ids=lambda law: type(law).__name__)
def test_a_wrong_law_is_not_found_in_its_own_simulation(law, recorded):
    robot, recording, seen = recorded
    with pytest.raises(AssertionError):
        check_simulated(law, *somewhere(law, seen, MIDDLE), robot, recording, seen)


#: What is wrong with a law's efforts (N, k).
FAULTS = {
    "its sign is flipped": lambda efforts: -efforts,
    "it is 2 % too large": lambda efforts: 1.02 * efforts,
    "it acts on the next joint": lambda efforts: np.roll(efforts, 1, axis=1),
    "it is a sample late": lambda efforts: np.roll(efforts, 1, axis=0),
}


@EVERY_LAW
@pytest.mark.parametrize("fault", FAULTS)
def test_no_law_may_be_wrong(law, fault, at):
    class Wrong(type(law)):
        def efforts(self, place, values, at):
            return FAULTS[fault](super().efforts(place, values, at))

    if fault == "it is a sample late" and law.linear == ("offset",) and law.physics == "effort_offset":
        return  # a constant is always the same
    with pytest.raises(AssertionError):
        check_closed_form(Wrong(), *somewhere(law, at, MIDDLE), at)


def filtered_cosine(time, rate, time_constant):
    """Return cos(rate t) behind a filter that is settled at its start, in closed form."""
    share = 1 / (1 + (rate * time_constant) ** 2)
    steady = share * (np.cos(rate * time) + rate * time_constant * np.sin(rate * time))
    return steady + (1 - share) * np.exp(-time / time_constant)


@pytest.mark.parametrize("time_constant", [1e-3, 5e-3, 2e-2, 0.15])
def test_a_filter_answers_a_wave_by_its_closed_form(at, time_constant):
    wave = np.cos(4.0 * TIME)
    known = at.knowing(np.tile(wave[:, None], 6) - at.rigid, at.left)
    law = EffortsFilter()
    added = law.efforts(law.places(at.mechanism)[0], {"time_constant": time_constant}, known)
    truth = filtered_cosine(TIME, 4.0, time_constant)
    assert wave[:, None] + added == pytest.approx(np.tile(truth[:, None], 6), abs=2e-6)


def test_a_filter_settles_anew_in_each_piece(at):
    halves = replace(at.motion, piece=np.repeat([0, 1], 100))
    broken = InMotion.of(at.mechanism, halves)
    law, place = EffortFilter(), Place("elbow_joint", EFFORT)
    added = law.efforts(place, {"time_constant": 0.05}, broken)
    column = broken.driven.index("elbow_joint")
    assert not added[[0, 100]].any()
    assert not np.delete(added, column, axis=1).any()
    alone = low_passed(broken.rigid[100:, column], 0.05, 0.02) - broken.rigid[100:, column]
    assert added[100:, column] == pytest.approx(alone, abs=1e-12)


def test_slow_efforts_are_as_late_by_a_filter_as_by_a_delay(at):
    """They differ by T^2 / 2 times the second derivative: of a wave by (w T)^2 / 2."""
    wave, lag = np.sin(0.5 * TIME), 0.004
    known = at.knowing(np.tile(wave[:, None], 6) - at.rigid, at.left)
    place = Place("elbow_joint", EFFORT)
    behind = EffortFilter().efforts(place, {"time_constant": lag}, known)[10:, 2]
    late = EffortDelay().efforts(place, {"delay": lag}, known)[10:, 2]
    assert np.abs(behind).max() > 1.9e-3
    assert behind == pytest.approx(late, abs=1.01 * (0.5 * lag) ** 2 / 2)


def test_one_signal_lags_in_one_way():
    lagging = [law for law in EFFORT_LAWS if isinstance(law, Lagging)]
    assert {law.physics for law in lagging} == {"effort_delay", "encoder_delay", "effort_filter"}
    assert len({law.family for law in lagging}) == 1


def test_a_lag_agrees_with_the_chord_it_was_fitted_by():
    law = EffortDelay()
    assert law.agrees(np.array([0.012]), {"age": 0.016})
    assert not law.agrees(np.array([0.012]), {"age": 0.04})  # three times the curvature of its own


def test_a_cable_acts_on_one_joint_alone_by_the_motion_of_its_neighbour(at):
    law = FeltMotion()
    place = next(place for place in law.places(at.mechanism) if place.name == "elbow_joint")
    assert place == ("elbow_joint", "effort of shoulder_lift_joint")
    values = {"limit": 0.0, "damping": -1.5, "inertia": 0.3, "presliding": 1e-5}
    added = law.efforts(place, values, at)
    motion = at.motion
    assert added[:, 2] == pytest.approx(-1.5 * motion.speed[:, 1] + 0.3 * motion.acceleration[:, 1], abs=1e-12)
    assert not np.delete(added, 2, axis=1).any()
    dry = law.efforts(place, {**values, "limit": 2.0}, at) - added
    fast = np.abs(motion.speed[:, 1]) > 0.3
    assert dry[fast, 2] == pytest.approx(2.0 * np.sign(motion.speed[fast, 1]), abs=1e-9)


def test_a_neighbours_position_is_felt_both_ways_round(at):
    law = FeltPosition()
    pairs = {(place.name, law.other(place)) for place in law.places(at.mechanism)}
    assert pairs == {pair for a, b in zip(at.driven[:-1], at.driven[1:], strict=True) for pair in ((a, b), (b, a))}
    place = Place("shoulder_lift_joint", "effort by the position of elbow_joint")
    added = law.efforts(place, {"stiffness": -2.0, "preload": 0.5}, at)
    assert added[:, 1] == pytest.approx(0.5 - 2.0 * at.motion.position[:, 2], abs=1e-12)


def test_a_spring_across_two_joints_gives_the_derivatives_of_its_energy(at):
    law = SpringAcross()
    place = next(place for place in law.places(at.mechanism) if place.name == "elbow_joint")
    k, rest, ratio = 3.0, 0.4, -0.7
    added = law.efforts(place, {"stiffness": k, "preload": -k * rest, "ratio": ratio}, at)

    def energy(own, other):
        return 0.5 * k * (own + ratio * other - rest) ** 2

    own, other, step = at.motion.position[:, 2], at.motion.position[:, 1], 1e-4
    slope = (energy(own + step, other) - energy(own - step, other)) / (2 * step)
    cross = (energy(own, other + step) - energy(own, other - step)) / (2 * step)
    assert added[:, 2] == pytest.approx(slope, abs=1e-9)
    assert added[:, 1] == pytest.approx(cross, abs=1e-9)
    assert not np.delete(added, [1, 2], axis=1).any()


def test_a_spring_of_a_negative_ratio_is_settled_upwards_too():
    law = SpringAcross()
    assert law.scaled({"ratio": 2.0}, [1.5]) == {"ratio": 3.0}
    assert law.scaled({"ratio": -2.0}, [1.5])["ratio"] == pytest.approx(-2.0 / 1.5)


def test_friction_without_a_step_is_viscous_when_slow_and_dry_when_fast(at):
    law, place = SlidingFriction(), Place("elbow_joint", SlidingFriction.variant)
    speed = at.motion.speed[:, 2]
    step = law.efforts(place, {"limit": 3.0, "presliding": 0.0}, at)[:, 2]
    assert np.abs(step[np.abs(speed) > 0.1]) == pytest.approx(3.0)
    smooth = law.efforts(place, {"limit": 3.0, "presliding": 0.0, "smoothing": 0.4}, at)[:, 2]
    assert smooth == pytest.approx(step * (2 / (1 + np.exp(-2 * np.abs(speed) / 0.4)) - 1), abs=1e-12)
    slow = law.efforts(place, {"limit": 3.0, "presliding": 0.0, "smoothing": 1e3}, at)[:, 2]
    assert slow == pytest.approx(1e-3 * step * np.abs(speed), rel=1e-4)
    fast = law.efforts(place, {"limit": 3.0, "presliding": 0.0, "smoothing": 1e-9}, at)[:, 2]
    assert fast == pytest.approx(step)


def test_a_film_is_looked_for_from_a_wide_one_downwards(at):
    """A way that has shrunk to nothing says nothing of the speed below which a film shears."""
    for law in (SlidingFriction(), StribeckFriction()):
        place = Place("elbow_joint", law.variant)
        (first, *_) = law.scanned(place, at)
        usual = law.otherwise(place, first, at)
        assert usual["presliding"] == 0.0
        assert usual["smoothing"] > 0
        assert law.otherwise(place, {**first, "presliding": 1e-12}, at)["smoothing"] == usual["smoothing"]
        assert law.free(usual)[-1] == "smoothing"


def test_a_centre_that_no_motion_tells_is_told_as_that(at):
    law = HeldBody()
    (place,) = law.places(at.mechanism)
    values = {"mass": 1.3, "x": 0.03, "y": 0.001, "z": -1.5e-13, **dict.fromkeys(INERTIAL[4:], 0.0)}
    close = {name: (value - 1e-3, value + 1e-3) for name, value in values.items()}
    assert "centred at (30, 1, -1.5e-10) mm in its axes;" in law.told(place, values, close, at.mechanism)
    far = law.told(place, values, {**close, "z": (-5.0, 5.0)}, at.mechanism)
    assert "centred at (30, 1, ?) mm in its axes, where of z this motion tells nothing;" in far
    none = law.told(place, values, {**close, **dict.fromkeys("xyz", (-5.0, 5.0))}, at.mechanism)
    assert "carries 1.3 kg; of its centre this motion tells nothing;" in none


def test_links_behind_a_gear_stand_back_by_what_the_gear_passes_on(at):
    """Efforts at q = theta - c tau_l(q), iterated: to first order in c what the law adds, with nothing else known."""
    law = YieldingGear()
    place = law.places(at.mechanism)[1]
    column, compliance = at.motion.names.index(place.name), 1e-7
    told = at.knowing(np.zeros_like(at.rigid), np.zeros_like(at.rigid))
    passed = at.effort_of(place.name, at.rigid)
    rate = at.rate(passed)
    rates = [passed, rate, at.rate(rate)]
    moved = []
    for table, back in zip((at.motion.position, at.motion.speed, at.motion.acceleration), rates, strict=True):
        other = table.copy()
        other[:, column] -= compliance * back
        moved.append(other)
    exact = at.rigid_of(at.motion.with_motion(*moved)) - at.rigid
    added = law.efforts(place, {"compliance": compliance}, told)
    assert np.abs(added - exact).max() < 5e-3 * np.abs(exact).max()
    assert np.abs(1.01 * added - exact).max() > 5e-3 * np.abs(exact).max()
