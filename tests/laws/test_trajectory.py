"""Where actuators are between the samples of a motion."""

import numpy as np
import pytest

from prup_pin.laws import Inputs, Trajectory

TIME = np.arange(200) / 100.0
TURN = np.column_stack((np.sin(3 * TIME), np.cos(2 * TIME)))
ONE = np.zeros(200, int)


def test_a_motion_goes_on_between_its_samples():
    motion = Trajectory.of(TIME, TURN, ONE)
    for delay in (7e-3, -4e-3):
        moved = motion.later(TIME[5:-5], ONE[5:-5], 0, delay)
        assert moved == pytest.approx(np.sin(3 * (TIME[5:-5] + delay)) - TURN[5:-5, 0], abs=1e-8)


def test_it_is_told_of_rows_that_were_left_out_and_of_each_run_for_itself():
    runs = np.repeat([0, 1], 100)
    time = np.concatenate((TIME[:100], TIME[:100]))
    motion = Trajectory.of(time, TURN, runs)
    assert motion.later(time[110:190:7], runs[110:190:7], 1, 5e-3) == pytest.approx(
        np.cos(2 * (TIME[110:190:7] + 5e-3)) - TURN[110:190:7, 1], abs=1e-7
    )


def test_postures_are_no_motion():
    assert Trajectory.of(TIME, np.random.default_rng(0).uniform(size=(200, 2)), ONE) is None
    assert Trajectory.of(TIME, np.repeat(np.random.default_rng(0).uniform(size=(20, 2)), 10, axis=0), ONE) is None
    assert Trajectory.of(TIME, np.ones((200, 2)) + 1e-7 * np.random.default_rng(0).normal(size=(200, 2)), ONE) is None
    assert Trajectory.of(TIME[::-1], TURN, ONE) is None


def test_where_only_speeds_are_known_a_delay_is_of_first_order():
    inputs = Inputs(TIME, TURN, np.zeros((200, 6)), ONE, speeds=np.ones((200, 2)))
    assert inputs.moves
    assert inputs.later(1, 2e-3) == pytest.approx(np.full(200, 2e-3))
    still = Inputs(TIME, TURN, np.zeros((200, 6)), ONE)
    assert not still.moves
    assert still.later(1, 2e-3) is None


@pytest.mark.parametrize("jitter", [0.0, 1e-7])
def test_postures_that_are_held_for_some_samples_are_no_motion(jitter):
    """Long after one another, so that the first row of a posture is foretold by the second, which is like it."""
    generator = np.random.default_rng(4)
    time = (300.0 * np.arange(12)[:, None] + 2.0 * np.arange(9)).ravel()
    held = np.repeat(generator.uniform(0.5, 0.8, (12, 3)), 9, axis=0)
    assert Trajectory.of(time, held + jitter * generator.standard_normal(held.shape), np.zeros(len(time), int)) is None
    assert Trajectory.of(time, np.sin(1e-3 * time)[:, None], np.zeros(len(time), int)) is not None
