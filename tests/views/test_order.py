"""Tables of shares are in one order, whatever the last bits of the shares are."""

import numpy as np

import prup_pin
from prup_pin.views.text.answer import Answer, ranked


def test_larger_shares_come_first():
    assert ranked({"a": 0.1, "b": 0.7, "c": 0.2}) == ["b", "c", "a"]
    assert ranked({"a": 1e-7, "b": 2e-7}) == ["b", "a"]


def test_shares_that_differ_by_rounding_stay_as_the_robot_file_has_them():
    shares = {"leg1/rod": 0.25 - 1e-16, "leg2/rod": 0.25 + 1e-16, "leg1/nut": 1e-25, "leg2/nut": 3e-24, "star": 0.5}
    assert ranked(shares) == ["star", "leg1/rod", "leg2/rod", "leg1/nut", "leg2/nut"]


def test_mirrored_legs_stand_in_the_order_of_the_file():
    """Down on the 3-PRUP at the symmetric pose all legs are alike: the first leg's part comes first, for every part."""
    robot = prup_pin.load("3prup")
    shares = Answer(robot.compliance(robot.pose(z=0.4, theta=0, phi=0)), [0, 0, 300, 0, 0, 0]).shares
    rng = np.random.default_rng(1)
    order = ranked(shares)
    parts = [name.partition("/")[2] for name in order]
    assert [name.partition("/")[0] for name in order if name.endswith("/linear_rod")] == ["leg1", "leg2", "leg3"]
    assert parts.index("linear_rod") + 2 == len(parts) - 1 - parts[::-1].index("linear_rod")
    for _ in range(20):
        noisy = {name: share * (1 + 1e-15 * rng.normal()) + 1e-17 * rng.normal() for name, share in shares.items()}
        assert ranked(noisy) == order
