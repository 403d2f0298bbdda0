"""No unit makes a log nearer by making all of it one point: what fits is weighed by how far apart it is read."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.conventions import read_logs
from prup_pin.errors import InputError
from prup_pin.recordings import Tolerances
from prup_pin.spatial import rotation_exp

from ..laws.test_play_with_memory import FILE, bench

ANYWHERE = Tolerances(frame_position=10.0, frame_rotation=3.0)


def seen_from_elsewhere(log):
    """The same log by a tracker that stands somewhere in the hall."""
    turn = rotation_exp(np.array([0.01, 0.0, 0.6]))
    return replace(log, position=(log.position - [2.3, -1.1, 0.8]) @ turn, tolerances=ANYWHERE)


def arm_with(tmp_path, reach):
    path = tmp_path / "scara.urdf"
    path.write_text(FILE.replace('<origin xyz="0.4 0 0"/>', f'<origin xyz="{reach} 0 0"/>'))
    return prup_pin.load(path)


def test_an_encoder_that_is_dead_is_asked_about_and_no_unit_is_told(tmp_path):
    log = seen_from_elsewhere(bench(1, poses=10))
    dead = replace(log, positions={**log.positions, "A2": np.full(len(log), 1.0)})
    with pytest.raises(InputError, match=r"this is another robot.* The same in every row: q\.A2"):
        diagnose(arm_with(tmp_path, 0.4), dead)


def test_a_link_that_is_drawn_too_long_is_no_other_unit(tmp_path):
    log = seen_from_elsewhere(bench(1, poses=10))
    assert read_logs(arm_with(tmp_path, 0.45), log).conventions == ((),)


@pytest.mark.slow
def test_two_readings_as_good_of_a_log_without_efforts_are_both_named(tmp_path):
    """An arm in a plane whose first joint counts the other way is one whose second does, seen in a mirror."""
    log = seen_from_elsewhere(bench(1, poses=10))
    turned = replace(log, positions={**log.positions, "A1": -log.positions["A1"]}, wrench=-log.wrench)
    with pytest.raises(InputError, match=r"q\.A1=reversed or --convention q\.A2=reversed"):
        read_logs(arm_with(tmp_path, 0.4), turned)
