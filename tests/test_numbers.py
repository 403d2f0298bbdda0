"""Numbers as people read them."""

import pytest

from prup_pin.numbers import fixed, number, percent, quantity, readable_unit, uncertain


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (2500, 3, "2500"),
        (999.96, 4, "1000"),
        (99999.6, 4, "100000"),
        (0.00012, 3, "0.00012"),
        (1.2e-5, 3, "1.2e-5"),
        (4.3e8, 3, "4.3e8"),
        (float("inf"), 3, "infinite"),
        (float("nan"), 3, "-"),
    ],
)
def test_a_number_is_short(value, digits, text):
    assert number(value, digits) == text


def test_a_number_with_its_sign():
    assert [number(value, 3, signed=True) for value in (0.25, -0.25, 0)] == ["+0.25", "-0.25", "0"]


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.00032e-3, "m/N", "320 nm/N"),
        (0.32e-6, "m", "320 nm"),
        (16.42e-6, "m", "16.4 µm"),
        (4.7e-3, "m", "4.7 mm"),
        (-3.852e-37, "m", "0 mm"),
        (307_800, "N/m", "308 N/mm"),
        (1.197e8, "N/m", "120 N/µm"),
        (2.0, "kg", "2 kg"),
        (0.25, "1", "0.25"),
        (2108, "N", "2108 N"),
        (4.3e5, "N", "430 kN"),
        (float("inf"), "N/m", "infinite"),
    ],
)
def test_the_unit_is_the_one_that_needs_no_leading_zeros(value, unit, text):
    assert quantity(value, unit) == text


def test_a_thousand_of_one_unit_is_one_of_the_next():
    assert readable_unit(1e-6, "m")[0] == "µm"
    assert readable_unit(0.999e-6, "m")[0] == "nm"


def test_rounding_is_zero_beside_what_is_not_and_by_itself():
    assert fixed([12.5, 1.2e-27, -3e-16]) == ["12.50", "0", "0"]
    assert fixed([1.2e-27, -3.9e-31]) == ["0", "0"]
    assert fixed([4e9, 1e-7]) == ["4.000e9", "0"]


@pytest.mark.parametrize(
    ("value", "deviation", "text"),
    [
        (34.7123, 0.2671, "34.71 ± 0.27"),
        (-0.00012, 0.0996, "0.00 ± 0.10"),
        (123456.0, 2345.0, "123500 ± 2300"),
        (8.7654, 25.3, "9 ± 25"),
        (1.23456, 0.0, "1.235 ± 0"),
    ],
)
def test_a_value_has_the_digits_that_its_deviation_leaves(value, deviation, text):
    assert uncertain(value, deviation) == text


@pytest.mark.parametrize(
    ("share", "text"),
    [(0.618, "62 %"), (0.9968, "99.7 %"), (0.99996, "99.996 %"), (1.0, "100 %"), (0.0345, "3.45 %"), (1.27, "127 %")],
)
def test_a_share_is_a_hundred_percent_only_where_it_is_whole(share, text):
    assert percent(share) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0, "0"),
        (1234.5, "1234"),
        (0.1, "0.1"),
        (-2.5e11, "-2.5e11"),
        (float("inf"), "infinite"),
        (7.854e-9, "7.854e-9"),
    ],
)
def test_numbers_have_four_digits_unless_more_are_asked_for(value, text):
    assert number(value) == text
