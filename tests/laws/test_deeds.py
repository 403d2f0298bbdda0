"""What deeds compute by themselves, against the equations that they state."""

import numpy as np
import pytest

from prup_pin.laws.deeds import Moved
from prup_pin.laws.deeds.resistance import _balanced, _balanced_alone
from prup_pin.spatial import rotation_exp, turn_between


@pytest.mark.parametrize("joints", [1, 2, 3, 6])
def test_dry_joints_that_move_each_other_obey_their_own_law(joints):
    rng = np.random.default_rng(joints)
    square = rng.normal(size=(9, joints, joints))
    influence, free = -1e-3 * square @ square.mT, 1e-2 * rng.normal(size=(9, joints))
    slid, last = 1e-3 * rng.normal(size=(2, 9, joints))
    stiffness, limit, viscous = (
        10 ** rng.uniform(2, 4, joints),
        rng.uniform(0.05, 0.5, joints),
        np.full((9, joints), 3.0),
    )
    answers = [_balanced(np.zeros_like(free), slid, last, stiffness, limit, free, influence, viscous)]
    if joints == 1:
        own = influence[:, 0]
        apart = 1 - own * (viscous + stiffness), 1 - own * viscous
        answers.append(_balanced_alone(slid, last, stiffness[0], limit[0], free, own, viscous, *apart))
    for torque, x in answers:
        stretched = stiffness * (x - slid)
        assert (np.abs(stretched) > limit).any()
        assert torque == pytest.approx(viscous * (x - last) + np.clip(stretched, -limit, limit), abs=1e-9)
        assert x == pytest.approx(free + (influence @ torque[..., None])[..., 0], abs=1e-12)


def test_a_moved_frame_and_target_report_the_change_that_their_reports_differ_by():
    rng = np.random.default_rng(1)
    target = Moved.on_body(0.1 * rng.normal(size=3), rotation_exp(rng.normal(size=3)))
    frame = Moved.from_frame(rotation_exp(rng.normal(size=3)), rng.normal(size=3))
    report = target.then(frame).then(Moved.scaled(1.3))
    true, moved = np.tile(np.eye(4), (7, 1, 1)), 1e-2 * rng.normal(size=(7, 6))
    true[:, :3, :3], true[:, :3, 3] = rotation_exp(rng.normal(size=(7, 3))), rng.normal(size=(7, 3))
    before = report(true[:, :3, 3], true[:, :3, :3])
    after = report(true[:, :3, 3] + moved[:, :3], rotation_exp(moved[:, 3:]) @ true[:, :3, :3])
    expected = np.concatenate((after[0] - before[0], turn_between(before[1], after[1])), axis=1)
    assert report.change(true, moved) == pytest.approx(expected, abs=1e-13)


def test_reports_one_after_the_other_are_one():
    """Whatever is scaled before what."""
    rng = np.random.default_rng(2)
    turns, shifts = rotation_exp(rng.normal(size=(3, 3))), rng.normal(size=(3, 3))
    parts = Moved.on_body(shifts[0], turns[0]), Moved.from_frame(turns[1], shifts[1]), Moved.scaled(1.3)
    poses = rng.normal(size=(7, 3)), rotation_exp(rng.normal(size=(7, 3)))
    for first in parts:
        for second in parts:
            expected, found = second(*first(*poses)), first.then(second)(*poses)
            for one, other in zip(found, expected, strict=True):
                assert one == pytest.approx(other, abs=1e-13)
