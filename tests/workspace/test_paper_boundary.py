"""The boundary behind the paper's upper compliance errors, and what docs/workspace.md says of it."""

import numpy as np

import prup_pin

STEP = np.radians(np.arange(-50.0, 51.0, 5.0))


def ends(name, longest):
    robot = prup_pin.load(name)
    found = robot.sweep(z=0.3, theta=STEP, phi=STEP, force=300, moment=100, quantities=["extremes", "actuators"])
    inside = found.ok & (np.nan_to_num(found["actuators"], nan=9.0).max(axis=-1) <= longest)
    values = found["extremes"][inside] * [1e3, np.degrees(1)]
    return values.min(axis=0), values.max(axis=0)


def test_slides_up_to_half_a_metre_give_both_upper_ends_as_printed():
    low, high = ends("3prup_as_published", 0.5)
    assert low.round(2).tolist() == [4.47, 1.85]
    assert high.round(2).tolist() == [15.72, 4.75]
    for other in (0.49, 0.51):
        assert ends("3prup_as_published", other)[1].round(2).tolist() != [15.72, 4.75]


def test_the_correct_model_says_more():
    low, high = ends("3prup", 0.5)
    assert low.round(2).tolist() == [4.85, 1.88]
    assert high.round(2).tolist() == [17.48, 5.18]
