"""What is off all over is told in its own unit; of what is known as a share of its value, as a share."""

from types import SimpleNamespace

import numpy as np
import pytest

from prup_pin import load
from prup_pin.diagnosis import all_over as everywhere
from prup_pin.diagnosis.all_over import _apart, _sizes
from prup_pin.diagnosis.calibrate import CalibratedParameter
from prup_pin.diagnosis.diagnosis import Finding
from prup_pin.laws.deviations import deviations_of


def off(deviation, amount):
    value = deviation.value(amount)
    return CalibratedParameter(deviation, 1.0, 0.5, value, 0.1, 0.1, deviation.nominal)


@pytest.mark.parametrize(("kind", "told"), [("stiffness", "50 %"), ("position", "2 mm")])
def test_sizes_of_a_kind(kind, told):
    every = [item for item in deviations_of(load("3prup").mechanism, {kind: 0.1}) if item.kind == kind][:4]
    signs = np.resize([1.0, -1.0], len(every))
    amount = np.log(1.5) if kind == "stiffness" else 2e-3
    items = [off(item, sign * amount) for item, sign in zip(every, signs, strict=True)]
    assert _sizes(items) == f"{told} in the root mean square of {len(items)}"


def test_one_that_stands_apart_from_its_sisters_is_told():
    every = [item for item in deviations_of(load("3prup").mechanism, {"stiffness": 0.1}) if item.kind == "stiffness"]
    amounts = np.log([0.39, 1.15, 0.85, 0.87, 1.1])
    items = [off(item, amount) for item, amount in zip(every, amounts, strict=False)]
    (told,) = _apart(items, items, 3.0)
    assert told.startswith(f"; {items[0].deviation.place} stands apart, with -61 % where the others have 14.6 %")
    assert not list(_apart(items[1:], items[1:], 3.0))
    assert not list(_apart(items, items[1:], 3.0))  # of which nobody can be sure


def test_what_to_do_about_places_is_not_what_to_do_about_a_base_out_of_level():
    many = Finding("geometric_offset", "robot", ("robot", "a", "b"), {"a.x": None, "b.x": None}, 0.5, "")
    assert "level" not in many.remedy
    assert "measure" in many.remedy


@pytest.mark.parametrize(
    ("found", "told"),
    [
        ({"lead_error": (0.4, True), "geometric_offset": (0.0, False)}, ["lead_error"]),  # the second foretells nothing
        ({"lead_error": (0.4, True), "geometric_offset": (0.1, False)}, ["lead_error", "geometric_offset"]),
        ({"lead_error": (0.0, True), "geometric_offset": (0.01, False)}, ["lead_error"]),  # a place of it is sure
        ({"lead_error": (0.0, False), "geometric_offset": (0.01, False)}, ["geometric_offset"]),
    ],
)
def test_a_kind_that_foretells_nothing_and_has_no_sure_place_is_no_finding(found, told, monkeypatch):
    def finding(problem, fit, items, words, labels, held):
        physics = items[0].deviation.physics
        gain, is_sure = found[physics]
        return SimpleNamespace(physics=physics, heldout_gain=gain), is_sure

    monkeypatch.setattr(everywhere, "_finding", finding)
    monkeypatch.setattr(everywhere, "cross_validated", lambda *_, **__: 1.0)
    kinds = {"encoder_slope": 1e-3, "position": 1e-3}
    items = [off(item, 1e-3) for item in deviations_of(load("3prup").mechanism) if item.kind in kinds]
    fit = SimpleNamespace(samples=np.arange(4))
    answered = everywhere.all_over(None, fit, items, list(kinds), np.arange(4))
    assert {each.physics for each in answered} == set(told)
    # beside what is told already, the best of those that foretell nothing is no finding
    beside = everywhere.all_over(None, fit, items, list(kinds), np.arange(4), alone=False)
    assert {each.physics for each in beside} == {each for each in told if max(found[each]) > 0}
