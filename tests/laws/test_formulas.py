"""Formulas as laws: every term of the library keeps the contract, and its file is what was proposed."""

import numpy as np
import pytest

from prup_pin import load
from prup_pin.errors import InputError, PluginError
from prup_pin.laws import LAWS, Place
from prup_pin.laws.efforts import EFFORT_LAWS, FINE_CURVES
from prup_pin.laws.formulas import (
    KNOWN,
    SHAPES,
    Factor,
    Formula,
    JointFormula,
    Remainder,
    Term,
    law_file,
    library,
    tried,
    word_of,
)
from prup_pin.laws.formulas.strain_formula import StrainFormula, strain_library
from prup_pin.plugins import along
from prup_pin.robots import examples_folder
from prup_pin.testing import check_law, efforts, words


@pytest.fixture(scope="module")
def at():
    return efforts.in_motion(load(examples_folder() / "elastic_arm.urdf"))


JOINT = "joint3"


def fitted(term, at, values=None):
    """Return a formula of one term, with values among those that are tried; wide ones, so that its turning shows."""
    every = list(tried(term, at, JOINT))
    law = Formula.of(JOINT, (term,), at)
    middle = every[-2 if "width" in term.parameters else len(every) // 2]
    own = dict(zip(law.settled, middle if values is None else values, strict=True))
    return law.with_values({**dict.fromkeys(law.linear, 1.3), **own}, {})


def test_every_term_of_the_library_keeps_the_contract_of_a_law(at):
    terms = list(library(at, JOINT))
    assert {term.shape for term in terms} == set(SHAPES)
    assert {factor.name for term in terms for factor in term.factors} == set(KNOWN)
    for term in terms:
        law = fitted(term, at)
        place = law.places(at.mechanism)[0]
        values = dict(law.scanned(place, at)[0])
        for check in efforts.CHECKS:
            check(law, place, values, at)
        words.check_declared(law)
        words.check_statement(law, place, {q.name: float(q.default) for q in law.quantities}, at.mechanism)
        words.check_small_sizes(law, place, at.mechanism)


def test_a_file_is_the_formula_that_it_was_written_from(at):
    pairs = list(
        zip(list(library(at, JOINT)), [*list(library(at, JOINT))[7:], *list(library(at, JOINT))[:7]], strict=True)
    )
    for both in pairs[::5]:
        law = Formula.of(JOINT, both, at)
        firsts = [next(iter(tried(term, at, JOINT))) for term in both]
        own = dict(zip(law.settled, [value for values in firsts for value in values], strict=True))
        law = law.with_values({**dict.fromkeys(law.linear, -0.7), **own}, dict.fromkeys(law.linear, (-0.8, -0.6)))
        read = {}
        exec(compile(law_file(law, "bench.csv", ["A remark"]), "law.py", "exec"), read)
        (written,) = (cls() for cls in read["LAWS"])
        assert (written.physics, written.equation, written.linear) == (word_of(law), law.equation, law.linear)
        assert written.recorded.keys() == law.recorded.keys()
        assert "bench.csv" in written.source
        assert [(q.name, q.unit) for q in written.quantities] == [(q.name, q.unit) for q in law.quantities]
        place = law.places(at.mechanism)[0]
        values = {q.name: float(q.default) for q in law.quantities}
        assert written.efforts(place, values, at) == pytest.approx(law.efforts(place, values, at), rel=1e-9)
        near = {q.name: float(q.default) for q in written.quantities}
        assert near == pytest.approx(values, rel=1e-5)


def test_units_compose(at):
    speed, place = Factor("speed", JOINT), Factor("position", JOINT)

    def units(*term):
        return {q.name: q.unit for q in Formula.of(JOINT, (Term(*term),), at).quantities}

    assert units("signed_square", speed) == {"coefficient": "N m s^2/rad^2"}
    turning = Factor("direction", JOINT)
    assert units("bump", place, turning) == {
        "coefficient": "N m", "presliding": "rad", "centre": "rad", "width": "rad"
    }  # fmt: skip
    assert units("stop_above", place) == {"preload": "N m", "stiffness": "N m/rad", "start": "rad"}
    assert units("decay", Factor("time", JOINT), speed) == {"coefficient": "N m s/rad", "reach": "s"}
    assert units("square", Factor("load", JOINT), turning) == {"coefficient": "1/(N m)", "presliding": "rad"}


def test_what_counts_from_where_a_recording_begins_says_so(at):
    begun = [t for t in library(at, JOINT) if Formula.of(JOINT, (t,), at).since_begun]
    assert {factor.name for term in begun for factor in term.factors if factor is term.factor} == {"time", "travelled"}


def test_shapes_are_what_they_say():
    x = np.linspace(-2.0, 2.0, 401)
    assert SHAPES["signed_square"].of(x) == pytest.approx(x * np.abs(x))
    assert SHAPES["outside"].of(x, 0.5) == pytest.approx(np.sign(x) * np.maximum(np.abs(x) - 0.5, 0))
    assert SHAPES["stop_above"].of(x, 0.505)[:, 0] == pytest.approx((x > 0.505) * 1.0)
    assert SHAPES["stop_below"].of(x, 0.5)[:, 1] == pytest.approx(np.minimum(x - 0.5, 0))
    peak = SHAPES["detent"].of(x, 0.25, 0.5)
    assert x[np.argmax(peak)] == pytest.approx(0.25 + 0.5 / np.sqrt(2), abs=0.006)
    assert SHAPES["wave"].of(x, 1.6)[:, 1] == pytest.approx(np.sin(2 * np.pi * x / 1.6))


def test_the_curve_beside_a_formula_bends_between_its_knots_and_stays_beyond_them(at):
    (curve,) = (one for one in FINE_CURVES if one.variant == "effort against position, finely")
    place, q = Place(JOINT, curve.variant), at.position(JOINT)
    values = curve.scanned(place, at)[0]
    knots = np.array([values[f"at {index}"] for index in range(curve.count)])
    waves = 2 * np.pi * 5 / np.ptp(q)
    drawn = at.effort_of(JOINT, curve.efforts_per(place, values, at) @ np.sin(waves * knots))
    assert drawn == pytest.approx(np.sin(waves * q), abs=0.012)
    assert np.abs(np.interp(q, knots, np.sin(waves * knots)) - np.sin(waves * q)).max() > 0.04  # by straight lines
    half = {name: 0.5 * value for name, value in values.items()}
    beyond = q > 0.5 * knots[-1]
    drawn = at.effort_of(JOINT, curve.efforts_per(place, half, at) @ np.arange(curve.count))
    assert drawn[beyond] == pytest.approx(curve.count - 1)


@pytest.mark.parametrize("curve", FINE_CURVES, ids=lambda curve: curve.variant)
def test_a_file_gives_the_formula_and_the_curve_that_was_fitted_beside_it(at, curve):
    law = fitted(Term("detent", Factor(curve.variable, JOINT)), at)
    place, beside = law.places(at.mechanism)[0], Place(JOINT, curve.variant)
    knots = curve.scanned(beside, at)[0]
    fit = {**knots, **dict(zip(curve.linear, np.random.default_rng(1).normal(size=curve.count), strict=True))}
    read = {}
    exec(compile(law_file(law, "bench.csv", beside=Remainder.of(curve, fit, "N m")), "law.py", "exec"), read)
    (written,) = (cls() for cls in read["LAWS"])
    values = {q.name: float(q.default) for q in written.quantities}
    both = law.efforts(place, values, at) + curve.efforts(beside, fit, at)
    assert written.efforts(place, values, at) == pytest.approx(both, abs=1e-3)
    assert values["remainder"] == pytest.approx(max(abs(fit[name]) for name in curve.linear), rel=1e-4)
    assert written.equation.endswith(" curve(" + KNOWN[curve.variable].symbol + ")")
    # the ends of a curve by speed or load are numbers: they do not grow with a motion that is played faster
    for check in efforts.CHECKS if curve.variable == "position" else ():
        check(written, place, {name: values[name] for name in written.settled}, at)


def test_a_spring_that_slips_gives_back_what_it_took_and_no_more(at):
    strain = KNOWN["yielding"].of(at, JOINT, 0.1)
    assert np.abs(strain).max() == pytest.approx(0.1)
    steps = np.diff(at.position(JOINT), prepend=at.position(JOINT)[0])
    inside = np.abs(strain) < 0.0999
    assert np.diff(strain)[inside[1:] & inside[:-1]] == pytest.approx(steps[1:][inside[1:] & inside[:-1]])
    held, step_by_step = 0.0, []
    for step in steps.tolist():
        held = min(max(held + step, -0.1), 0.1)
        step_by_step.append(held)
    assert strain == pytest.approx(np.array(step_by_step), abs=1e-12)


GOOD = "return [signed_square(speed(at, self.joint))]"


@pytest.mark.parametrize(
    ("instead", "said"),
    [
        ("return [signed_square(speed(at, self.joint))] * 2", "returns 2 columns"),
        ("return [speed(at, self.joint)[:5]]", r"shapes \(5,\)"),
        ("return [speed(at, self.joint) / 0.0]", "no number at sample 0"),
        ('return [values["drag"] * speed(at, self.joint)]', "fails: KeyError: 'drag'"),
    ],
)
def test_a_formula_edited_into_nonsense_is_told_in_a_sentence(at, tmp_path, instead, said):
    law = fitted(Term("signed_square", Factor("speed", JOINT)), at)
    text = law_file(law, "bench.csv")
    assert GOOD in text
    path = tmp_path / "law.py"
    path.write_text(text.replace(GOOD, instead))
    with along(path):
        (own,) = (item for item in EFFORT_LAWS if isinstance(item, JointFormula))
        with pytest.raises(InputError, match=f"joint3_by_speed: 'columns' .*{said}"):
            own.efforts(own.places(at.mechanism)[0], {"coefficient": 1.0}, at)


@pytest.mark.parametrize(
    ("before", "instead", "said"),
    [
        ('("speed", "joint3")', '("sped", "joint3")', "recorded names sped; variables are position, speed"),
        ('("speed", "joint3")', '"speed"', "expected a variable and where it is for each"),
        ("found = {", "found = 3 or {", "found is 3; expected two ends each"),
        ('linear = ("coefficient",)', 'linear = "coefficient"', "linear is 'coefficient'; expected a tuple of names"),
        ("settled = ()", 'settled = ("width",)', r"settled is \('width',\); expected a tuple of names"),
        ('equation = "', 'equation = 3 or "', "equation is 3; expected a text"),
        ("found = {", 'found = {"coefficient": (2.0, 1.0)} or {', r"\(2.0, 1.0\)}; expected two ends each"),
        ("recorded = {", 'recorded = {("speed", "joint3"): (float("nan"), 1.0)} or {', "expected two ends each"),
        ('joint = "joint3"', "joint = 3", "joint is 3; expected the name of a joint"),
        ('neutral = {"coefficient": 0}', 'neutral = {"coefficient": 2}', "expected 0 for each of coefficient"),
    ],
)
def test_so_is_what_it_declares(at, tmp_path, before, instead, said):
    text = law_file(fitted(Term("signed_square", Factor("speed", JOINT)), at), "bench.csv")
    assert before in text
    path = tmp_path / "law.py"
    path.write_text(text.replace(before, instead))
    with along(path), pytest.raises(PluginError, match=said):
        list(EFFORT_LAWS)


@pytest.mark.parametrize(
    ("before", "instead", "said"),
    [
        ("signed_square(load)", 'signed_square(load["fz"])', "'deformation' fails: IndexError"),
        ("signed_square(load)", "signed_square(load) / 0.0", "'deformation' fails: ValueError: it is no number"),
        ("    of = 2", "    of = 20", "'deformation' fails: IndexError"),
    ],
)
def test_and_a_formula_of_a_module(tmp_path, before, instead, said):
    robot, loads = load("3prup"), np.linspace(-45.0, 45.0, 101)[:, None] * np.eye(6)[2]
    laws = strain_library("leg3/R_lambda", 2, loads, ("fx", "fy", "fz", "mx", "my", "mz"), robot.mechanism, 1e-5)
    (square,) = (law for law in laws if law.shape == "signed_square")
    text = law_file(square.with_values({"coefficient": 2e-7}, {"coefficient": (1e-7, 3e-7)}), "bench.csv")
    assert before in text
    path = tmp_path / "law.py"
    path.write_text(text.replace(before, instead))
    with along(path):
        (law,) = (item for item in LAWS if isinstance(item, StrainFormula))
        (deed,) = law.deeds(law.places(robot.mechanism)[0], {"coefficient": 2e-7}, None)
        with pytest.raises(InputError, match=said):
            deed.strain(loads)
    path = tmp_path / "other.py"
    path.write_text(text.replace("recorded = {", "recorded = {} or 3 or {"))
    with along(path), pytest.raises(PluginError, match="recorded is 3; expected two ends each"):
        list(LAWS)


def test_where_a_motion_leaves_what_was_seen_is_told(at):
    law = fitted(Term("signed_square", Factor("speed", JOINT)), at)
    assert not list(law.left_range(at))
    low, high = law.recorded["speed", JOINT]
    law.recorded["speed", JOINT] = low, 0.5 * high
    (told,) = law.left_range(at)
    assert f"the speed of {JOINT} is outside" in told
    assert "an extrapolation" in told


def test_formulas_of_a_module_keep_the_contract_and_are_what_they_were_written_from(tmp_path):
    robot, module = load("3prup"), "leg3/R_lambda"
    loads = np.linspace(-1.0, 1.0, 101)[:, None] * [0.0, 0.0, 45.0, 0.0, 0.0, 0.0]
    laws = list(strain_library(module, 2, loads, ("fx", "fy", "fz", "mx", "my", "mz"), robot.mechanism, 1e-5))
    assert len(laws) == 8
    for law in laws:
        for number, start in enumerate(law.starts(law.places(robot.mechanism)[0], robot.mechanism)[:1]):
            own = law.with_values(dict(start), {"coefficient": (0.0, 1.0)})
            path = tmp_path / f"{law.shape}_{number}.py"
            path.write_text(law_file(own, "bench.csv"))
            with along(path):
                (written,) = (item for item in LAWS if isinstance(item, StrainFormula))
                assert (written.physics, written.equation) == ("leg3_r_lambda_by_fz", law.equation)
                x = np.linspace(-60.0, 60.0, 77)
                assert written.deformation(x, start) == pytest.approx(law.deformation(x, start))
                words.check_declared(written)
                words.check_statement(written, written.places(robot.mechanism)[0], start, robot.mechanism)
    (square,) = (law for law in laws if law.shape == "signed_square")
    assert square.quantities[0].unit == "m/N^2"
    check_law(square.with_values({"coefficient": 2e-7}, {}), robot)
