"""A pose sensor set up anew for each run: found, left out of what is compared, and predicted from first points."""

from __future__ import annotations

import importlib
from dataclasses import replace

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

import prup_pin
from prup_pin.channels import Stations
from prup_pin.laws import Effect, Place
from prup_pin.laws.self_weight import SelfWeight
from prup_pin.recordings import Noise, Recording
from prup_pin.simulation import seen_from_stations, simulate
from prup_pin.spatial import rotation_exp, rotation_log

from ..reference.posed_tree import PosedTree
from .test_joint_compliance import MARKERS, NOISE, TORSO, bench
from .test_registration import SOMEWHERE
from .test_spread import drawn

RUNS, EACH = 5, 10


def stationed(recording: Recording, apart: float, seed: int = 5) -> Recording:
    """Return a recording in runs, each seen from a station of its own: `apart` [rad, m], one standard deviation."""
    draw = np.random.default_rng(seed)
    run = np.arange(len(recording)) * RUNS // len(recording)
    turns, shifts = rotation_exp(apart * draw.standard_normal((RUNS, 3))), apart * draw.standard_normal((RUNS, 3))
    markers = {
        name: (turns[run] @ values[..., None])[..., 0] + shifts[run] for name, values in recording.markers.items()
    }
    return replace(recording, markers=markers, run=run, run_names=tuple(f"run {place}" for place in range(RUNS)))


def asked(recording):
    with threadpool_limits(1, user_api="blas"):
        return importlib.import_module("prup_pin.diagnosis.prepare").prepare(
            prup_pin.load(TORSO), recording, lambda stage, share: None
        )


def test_stations_are_left_out_as_by_their_covariance():
    draw = np.random.default_rng(1)
    labels, turn, shift, noise = np.repeat([0, 1], 6), 3e-4, 2e-3, (1e-4, 2e-4)
    motions, angles = draw.normal(size=(12, 6, 6)), np.arange(6) > 2
    for station in (0, 1):
        rows = labels == station
        placing = Stations(labels, turn, shift, noise).placing(np.arange(12), motions, angles)
        weights = np.tile(np.where(angles, *noise[::-1]), 6)
        moved = motions[rows].reshape(36, 6)
        covariance = np.diag(weights**2) + moved @ np.diag(np.repeat([turn, shift], 3) ** 2) @ moved.T
        one, other = draw.normal(size=(2, 12, 6))
        left, right = ((placing.without(values)[rows].ravel() / weights) for values in (one, other))
        expected = one[rows].ravel() @ np.linalg.solve(covariance, other[rows].ravel())
        assert left @ right == pytest.approx(expected, rel=1e-9)
        anywhere = Stations(labels, noise=noise).placing(np.arange(12), motions, angles)
        assert np.abs(anywhere.without(motions[..., 2])).max() < 1e-12
        assert np.abs(anywhere.without(one)).max() > 0.1


@pytest.mark.parametrize(
    "apart", [2e-3, pytest.param(0.3, marks=pytest.mark.slow)], ids=["nearby", "in another corner of the hall"]
)
def test_stations_are_found_where_they_are(apart):
    """With columns g and a declared noise, on a machine on which everything is off."""
    recording = stationed(bench(drawn(), RUNS * EACH), apart)
    recording = replace(recording, noise=Noise(position=NOISE), gravity=np.tile([0.3, -0.2, -9.8], (len(recording), 1)))
    given = asked(recording)
    assert given.together.by_run == ("pose_sensor",)
    assert {"encoder_offset", "position", "target_position"} <= set(given.spread.kinds)
    assert given.spread.scale[0] == pytest.approx(1.0, abs=0.15)
    assert any('"own_sensors": {"by_run": ["pose_sensor"]}' in text for text in given.remarks)
    assert not [item for item in given.library if item.law.sensor == "pose_sensor"]


@pytest.mark.slow
def test_one_tracker_for_all_runs_is_left_where_it_is():
    recording = stationed(bench(drawn(), RUNS * EACH), 0.0)
    given, alone = asked(recording), asked(replace(recording, run=None, run_names=("",)))
    assert given.together.by_run == ()
    assert given.spread.kinds == alone.spread.kinds


@pytest.mark.slow
def test_columns_g_beside_a_declared_noise_stop_nothing():
    recording = replace(bench(drawn(), 45), noise=Noise(position=NOISE))
    plain, tilted = asked(recording), asked(replace(recording, gravity=np.tile([0.0, 0.0, -9.81], (45, 1))))
    assert tilted.spread.kinds == pytest.approx(plain.spread.kinds, rel=1e-6)
    assert len(plain.spread.kinds) > 2


@pytest.mark.slow
def test_what_is_declared_is_found_and_predicted():
    robot, weight = prup_pin.load(TORSO), Effect(SelfWeight(), Place("robot"), {"scale": 1.0})
    true = bench(PosedTree(TORSO, tracker=SOMEWHERE), RUNS * EACH)
    recording = replace(stationed(true, 0.3), own_by_run=("pose_sensor",), noise=Noise(position=NOISE))
    found = prup_pin.diagnose(robot, recording)
    assert found.verdict == "nothing_missing"
    assert found.own_by_run == ("pose_sensor",)
    # a run that says nothing after its first points is predicted from these
    blank = {
        name: np.where((np.arange(len(true)) % EACH < 8)[:, None], p, np.nan) for name, p in recording.markers.items()
    }
    predicted = seen_from_stations(
        simulate(robot, replace(recording, markers=blank), [weight]), replace(recording, markers=blank)
    )
    for name in MARKERS:
        assert np.abs(predicted.markers[name] - recording.markers[name]).max() < 20 * NOISE
    none = {name: np.full_like(values, np.nan) for name, values in recording.markers.items()}
    told = seen_from_stations(
        simulate(robot, replace(recording, markers=none), [weight]), replace(recording, markers=none)
    )
    assert "too few were measured of run 0, run 1" in told.remarks[-1]


@pytest.mark.parametrize("turns", [True, False])
def test_rows_of_one_posture_say_where_a_sensor_stood_by_orientations_alone(turns):
    """A load that changes moves a tool by micrometres, which tells no turn; of places it is the postures that do."""
    robot = prup_pin.load(TORSO.parents[1] / "six_ups" / "six_ups.urdf")
    home, ways = np.array(list(robot.home.actuators.values())), np.random.default_rng(2).normal(size=(4, 6))
    wrench = np.zeros((20, 6))
    wrench[:, 2] = -40.0 * (np.arange(20) % 5)
    actuators = (home + 0.01 * ways).repeat(5, axis=0)
    names = robot.mechanism.actuated
    table = {name: actuators[:, k] for k, name in enumerate(names)}
    asked = Recording(time=np.arange(20.0), positions=table, wrench=wrench)
    drawn = simulate(robot, asked)
    turn, shift = rotation_exp(np.array([0.3, -1.1, 0.7])), np.array([1.0, 2.0, -0.5])
    seen = drawn.position @ turn.T + shift
    frames = rotation_log(turn @ rotation_exp(drawn.rotation))
    recording = replace(asked, position=seen, rotation=frames if turns else None)
    found = seen_from_stations(simulate(robot, recording), recording)
    assert found.position == pytest.approx(seen, abs=1e-9)
    if turns:
        assert found.rotation == pytest.approx(frames, abs=1e-9)
        first = recording.select(np.arange(5))
        assert seen_from_stations(simulate(robot, first), first).position == pytest.approx(seen[:5], abs=1e-9)
    else:
        told = seen_from_stations(simulate(robot, recording.select(np.arange(5))), recording.select(np.arange(5)))
        assert "too few" in told.remarks[-1]
