"""Sizes that an effect would have needed to show, in words."""

import pytest

from prup_pin.diagnosis.diagnosis import Detectable
from prup_pin.views.text.diagnosis_words import hidden_rows


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
