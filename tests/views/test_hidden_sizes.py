"""Sizes that an effect would have needed to show, in words."""

import numpy as np
import pytest

from prup_pin.diagnosis.diagnosis import Detectable
from prup_pin.diagnosis.since import Seen
from prup_pin.views.text.diagnosis_words import hidden_rows, seen_rows


@pytest.mark.parametrize(
    ("sizes", "told"),
    [
        ([9.9e19, 1e12], "never visible in this test"),
        ([9.9e19, 3e-4], "half gap above 300 µm"),
        ([3e-4], "half gap above 300 µm"),
    ],
)
def test_absurd_sizes_are_never_visible(sizes, told):
    hidden = [Detectable("backlash", f"leg{i}", "half_gap", size, "m", "") for i, size in enumerate(sizes)]
    assert [row[2] for row in hidden_rows(hidden)] == [told]


def test_what_would_have_been_seen_shares_a_unit_and_says_which_way():
    def rows(*found):
        return seen_rows([Seen(*each) for each in found])

    tilt = "root_tilt_compliance", "root_tilting_stiffness", "N m/rad"
    two = [
        (tilt[0], place, tilt[1], tilt[2], size, np.inf) for place, size in (("leg1/rod", 7.2e5), ("leg2/rod", 1.8e6))
    ]
    what = "root tilt compliance, root tilting stiffness"
    assert rows(*two) == [(what, "leg2/rod to leg1/rod", "below 1800 to 720 N m/mrad")]
    contact = ("hertzian_contact", "leg1/nut", "reference_load", "N", 1.9e9, 1e15)
    assert rows(contact)[0][2] == "below 1900 MN"
    kept = [("stiffness_changed", place, "factor", "1", size, 1.0) for place, size in (("a", 0.98), ("b", 1.05))]
    assert rows(*kept) == [("stiffness changed, factor", "a to b", "2 to 5 %")]
    assert rows(("lead_error", "leg1/screw", "relative", "1", 3e-6, 0.0))[0][2] == "3e-6"
    gaps = [("backlash", place, "half_gap", "m", size, 0.0) for place, size in (("a", 2e-6), ("b", 3e-6))]
    assert rows(*gaps)[0][2] == "2 to 3 µm"
