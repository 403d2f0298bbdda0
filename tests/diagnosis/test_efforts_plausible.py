"""Columns of efforts and positions that are not what they say are told with the numbers that gave them away."""

from dataclasses import replace

import numpy as np
import pytest

from prup_pin import load
from prup_pin.diagnosis.efforts.plausible import check_efforts
from prup_pin.dynamics import InMotion, motion_of
from prup_pin.errors import InputError
from prup_pin.recordings import Recording


@pytest.fixture(scope="module")
def ur5():
    return load("ur5").mechanism


@pytest.fixture(scope="module")
def recording(ur5):
    """A motion whose efforts are the rigid robot's with a little friction and noise."""
    rng, time = np.random.default_rng(3), np.arange(2000) * 0.004
    home = np.array([0.0, -1.1, 1.0, -0.3, 0.5, 0.0])
    q = home + sum(
        rng.uniform(0.2, 0.6, 6) * np.sin(rate * time[:, None] + rng.uniform(0, 6, 6)) for rate in (1.3, 2.9)
    )
    silent = Recording(time=time, positions=dict(zip(ur5.actuated, q.T, strict=True)))
    motion = motion_of(silent, ur5, ur5.actuated)
    known = InMotion.of(ur5, motion)
    tau = known.rigid + 0.8 * np.sign(motion.speed) + 0.1 * rng.normal(size=known.rigid.shape)
    return replace(silent.select(motion.rows), efforts=dict(zip(ur5.actuated, tau.T, strict=True)))


def checked(ur5, recording):
    return check_efforts(InMotion.of(ur5, motion_of(recording, ur5)))


def changed(recording, group, factors):
    columns = getattr(recording, group)
    return replace(recording, **{group: {name: values * factors.get(name, 1.0) for name, values in columns.items()}})


def in_order(recording, group, order):
    columns = getattr(recording, group)
    return replace(recording, **{group: dict(zip(columns, [list(columns.values())[k] for k in order], strict=True))})


def test_efforts_of_the_robot_raise_no_doubt(ur5, recording):
    assert checked(ur5, recording) == []


@pytest.mark.parametrize(
    ("group", "factors", "told"),
    [
        ("efforts", {"elbow_joint": -1}, "the sign of tau.elbow_joint is turned round"),
        ("positions", {"shoulder_lift_joint": -1}, "the sign of q.shoulder_lift_joint is turned round"),
        ("positions", {"elbow_joint": 180 / np.pi}, "q.elbow_joint is in degrees"),
        (
            "efforts",
            {"elbow_joint": -1, "wrist_1_joint": -1},
            "the signs of tau.elbow_joint, tau.wrist_1_joint are turned round",
        ),
    ],
)
def test_signs_and_degrees_of_single_joints_are_told(ur5, recording, group, factors, told):
    with pytest.raises(InputError, match=r"leave \d+.* % of the efforts unexplained .* but \d\.?\d* % if ") as caught:
        checked(ur5, changed(recording, group, factors))
    assert told in str(caught.value)


def test_a_robot_that_hangs_from_the_ceiling_has_no_sign_turned_round(ur5, recording):
    """Its weight pulls at the shoulder and the elbow as if both efforts were told the other way round."""
    known = InMotion.of(ur5, motion_of(recording, ur5))
    other = dict(zip(known.driven, known.rigid_under(-2 * ur5.gravity).T, strict=True))
    hung = {name: values + other[name] for name, values in recording.efforts.items()}
    assert not any("turned round" in doubt for doubt in checked(ur5, replace(recording, efforts=hung)))
    both = {"shoulder_lift_joint": -1, "wrist_2_joint": -1}
    with pytest.raises(InputError, match="turned round"):
        checked(ur5, changed(recording, "efforts", both))


def test_all_in_degrees_and_columns_in_another_order_are_told(ur5, recording):
    wrong = changed(recording, "positions", dict.fromkeys(recording.positions, 180 / np.pi))
    with pytest.raises(InputError, match="% if all positions are in degrees"):
        checked(ur5, wrong)
    with pytest.raises(InputError, match=r"% if tau\.shoulder_lift_joint and tau\.elbow_joint are exchanged"):
        checked(ur5, in_order(recording, "efforts", (0, 2, 1, 3, 4, 5)))
    with pytest.raises(InputError, match="% if the columns of positions are in the opposite order"):
        checked(ur5, in_order(recording, "positions", (5, 4, 3, 2, 1, 0)))


def test_efforts_in_another_unit_are_told_by_their_sizes(ur5, recording):
    names = list(recording.efforts)
    with pytest.raises(InputError, match=r"tau\.shoulder_lift_joint \d{3,4} times.*seem to be in mN m or N mm"):
        checked(ur5, changed(recording, "efforts", dict.fromkeys(names, 1e3)))
    amperes = dict(zip(names, (1 / 12, 1 / 12, 1 / 12, 1 / 8, 1 / 8, 1 / 8), strict=True))
    (doubt,) = checked(ur5, changed(recording, "efforts", amperes))
    assert "tau.elbow_joint 0.08" in doubt
    assert "are they in per cent or A?" in doubt
    with pytest.raises(InputError, match=r"the sign of tau\.elbow_joint is turned round"):
        checked(ur5, changed(recording, "efforts", amperes | {"elbow_joint": -1 / 12}))
    per_cent = dict(zip(names, [100 / most for most in (150, 150, 150, 28, 28, 28)], strict=True))
    (doubt,) = checked(ur5, changed(recording, "efforts", per_cent))
    assert "tau.elbow_joint 0.6" in doubt
    assert "are they in per cent or A?" in doubt


def test_positions_of_motors_are_told_by_the_limits_of_the_joints(ur5, recording):
    names = list(recording.positions)
    wrong = changed(recording, "positions", dict.fromkeys(names, 100.0))
    wrong = changed(wrong, "efforts", dict.fromkeys(names, 0.01))
    with pytest.raises(InputError, match=r"reaches \d+.*allows -6\.283 to 6\.283 rad.*motor before its gear"):
        checked(ur5, wrong)


def test_a_position_that_never_changes_while_its_speed_does_is_told(ur5, recording):
    positions = dict(recording.positions)
    speed = np.gradient(positions["elbow_joint"], recording.time)
    positions["elbow_joint"] = np.full(len(recording), 1.0)
    wrong = replace(recording, positions=positions, velocities={"elbow_joint": speed})
    with pytest.raises(InputError, match=r"q\.elbow_joint never changes, but qd\.elbow_joint"):
        checked(ur5, wrong)
