"""Sizes that an effect would have needed to show, in words."""

import numpy as np
import pytest

from prup_pin.diagnosis.diagnosis import Detectable, Seen
from prup_pin.views.text.bench_tests import print_hidden
from prup_pin.views.text.diagnosis_words import hidden_rows, seen_rows, visible_rows
from prup_pin.views.text.terminal import console


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


def test_what_would_have_been_seen_has_each_size_with_its_place_and_says_which_way():
    def rows(*found):
        return seen_rows([Seen(*each, strong=1.0) for each in found])

    tilt = "root_tilt_compliance", "root_tilting_stiffness", "N m/rad"
    two = [
        (tilt[0], place, tilt[1], tilt[2], size, np.inf) for place, size in (("leg1/rod", 7.2e5), ("leg2/rod", 1.8e6))
    ]
    what = "root tilt compliance, root tilting stiffness"
    assert rows(*two) == [(what, "below 1800 N m/mrad at leg2/rod to below 720 N m/mrad at leg1/rod")]
    contact = ("hertzian_contact", "leg1/nut", "reference_load", "N", 1.9e9, 1e15)
    assert rows(contact)[0][1] == "below 1900 MN at leg1/nut"
    kept = [("stiffness_changed", place, "factor", "1", size, 1.0) for place, size in (("a", 0.98), ("b", 1.05))]
    assert rows(*kept) == [("stiffness changed, factor", "2 % at a to 5 % at b")]
    assert rows(("lead_error", "leg1/screw", "relative", "1", 3e-6, 0.0))[0][1] == "3 ppm at leg1/screw"
    assert rows(("creep", "motor", "share", "1", 84.7, 0.0))[0][1] == "85 times at motor"
    gaps = [("backlash", place, "half_gap", "m", size, 0.0) for place, size in (("a", 2e-6), ("b", 3e-6))]
    assert rows(*gaps)[0][1] == "2 µm at a to 3 µm at b"


def test_what_would_have_been_seen_begins_with_the_hardest_and_leaves_out_what_stays_hidden():
    seen = [
        Seen("backlash", "a", "half_gap", "m", 2e-6, 0.0, 2e-4),
        Seen("backlash", "b", "half_gap", "m", 3e-4, 0.0, 2e-4),  # more than a strong one
        Seen("root_tilt_compliance", "a", "root_tilting_stiffness", "N m/rad", 2e3, np.inf, 1e3),
    ]
    assert [row[0].partition(",")[0] for row in visible_rows(seen)] == ["root tilt compliance", "backlash"]
    assert visible_rows(seen)[1][1] == "2 µm at a"


def test_what_could_not_show_has_its_ends_in_units_of_their_own_with_their_places():
    loads = zip("abc", (4.29e5, 1e6, 1.3e8), strict=True)
    hidden = [
        Detectable("hertzian_contact", place, "reference_load", size, "N", "", below=False) for place, size in loads
    ]
    assert hidden_rows(hidden)[0][2] == "reference load above 429 kN at a to 130 MN at c"
    soft = [
        Detectable("stiffness_changed", place, "factor", size, "1", "", below=True)
        for place, size in zip("ab", (0.003, 0.18), strict=True)
    ]
    assert hidden_rows(soft)[0][2] == "factor below 0.18 at b to 0.003 at a"


def test_the_terminal_tells_what_another_test_may_show_and_the_rest_by_name(capsys):
    """Fifteen lines of sizes such as 'above 136 MN' told nobody what to do."""
    hidden = [
        Detectable("backlash", "a", "half_gap", 3e-4, "m", "", strong=2e-4),
        Detectable("hertzian_contact", "a", "reference_load", 1.36e8, "N", "", strong=1e3),
        Detectable("stiffness_changed", "a", "factor", 0.18, "1", "", below=True, strong=0.5),
        Detectable("stiffness_changed", "b", "factor", 0.003, "1", "", below=True, strong=0.5),
        Detectable("creep", "a", "share", None, "1", "not visible at any size", strong=0.1),
        Detectable("self_weight", "robot", "scale", None, "1", "these loads do not reach it", strong=1.0),
        Detectable("thermal_growth", "", "expansion", None, "1/K", "no temperature was recorded"),
    ]
    print_hidden(console(), hidden)
    lines = [line.strip() for line in capsys.readouterr().out.splitlines() if line.strip().startswith("-")]
    assert lines == [
        "- backlash: half gap above 300 µm, at a",
        "- self weight: these loads do not reach it, at robot",
        "- stiffness changed: factor below 0.18, at a",
        "- thermal growth: no temperature was recorded",
        "- creep, hertzian contact: at no usual size",
    ]
    assert len(hidden_rows(hidden)) == 6  # the report tells all
