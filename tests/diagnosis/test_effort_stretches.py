"""A robot that is stopped by brakes, or runs into something: that stretch is told, and nothing is made of it."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.efforts.outliers import OutlierInterval, is_outlying
from prup_pin.dynamics import motion_of
from prup_pin.recordings import Noise, Recording
from prup_pin.views.text.diagnosis_words import summary_text, verdict_text
from tests.diagnosis.test_efforts import axis, named


def struck(recording, *blows):
    """Return a recording with efforts that no body explains, by (begin, end [s], size [N])."""
    tau = recording.efforts["carriage"].copy()
    for begin, end, size in blows:
        there = (recording.time >= begin) & (recording.time <= end)
        tau[there] += size * np.sin(np.pi * (recording.time[there] - begin) / (end - begin))
    return recording.with_measurements(efforts={"carriage": tau})


def test_a_blow_is_told_by_its_time_and_left_out_of_all_else(carriage):
    found = diagnose(carriage, struck(axis(2500, damping=200.0, limit=20.0), (4.0, 4.4, -150.0)))
    assert found.verdict == "unexplained"
    words = {("viscous_friction", "carriage"), ("coulomb_friction", "carriage")}
    assert named(found) == words | {("unknown", "carriage")}
    (unknown,) = (finding for finding in found.findings if finding.physics == "unknown")
    told = re.match(r"between t = ([\d.]+) s and ([\d.]+) s: described by no law", unknown.statement)
    begin, end = map(float, told.groups())
    assert 3.8 < begin < 4.1
    assert 4.3 < end < 4.6
    values = {finding.physics: finding.parameters for finding in found.findings}
    assert values["viscous_friction"]["damping"].value == pytest.approx(200.0, rel=0.01)
    assert values["coulomb_friction"]["limit"].value == pytest.approx(20.0, rel=0.01)
    assert found.efforts.shares["all"]["heldout"] < 0.04
    assert not ((found.efforts.time > begin) & (found.efforts.time < end)).any()
    assert f"describes what happened {unknown.when}, which was left out" in verdict_text(found)
    assert "the rest" not in verdict_text(found)
    assert f"To do first: find out what happened {unknown.when}, or record again without it." in summary_text(found)


@pytest.mark.slow
def test_blows_all_along_are_the_robots_own(carriage):
    blows = [(1.2 * k, 1.2 * k + 0.2, 150.0) for k in range(1, 8)]
    found = diagnose(carriage, struck(axis(2500), *blows))
    assert not any("described by no law" in finding.statement for finding in found.findings)
    assert np.ptp(np.diff(found.efforts.time)) < 1e-9


def test_too_little_between_two_stretches_goes_with_them(carriage):
    recording = axis(2000)
    motion = motion_of(recording, carriage.mechanism, without=[(500, 600), (607, 700)])
    assert np.isin([490, 710], motion.rows // 10 * 10).all()
    assert not ((motion.rows >= 500) & (motion.rows <= 700)).any()
    assert len(np.unique(motion.piece)) == 2
    assert np.diff(motion.rows)[np.diff(motion.piece) == 0].max() < 100


@pytest.mark.slow
def test_nothing_is_judged_by_the_ends_of_a_recording(carriage):
    """There a filter has no other side, and what a late signal was before is unknown."""
    recording = replace(axis(2000), noise=Noise(effort=0.5))
    first = struck(recording, (-0.02, 0.02, 400.0))
    found = diagnose(carriage, first)
    assert found.verdict == "nothing_missing"
    assert found.after["fit"] < 1.1
    second = struck(recording, (-0.02, 0.4, 60.0))
    assert diagnose(carriage, second).verdict == "unexplained"


def test_a_stretch_that_settled_laws_describe_is_none():
    """Friction that is far beyond the noise where a joint is slow looks like a blow beside rough values of it."""
    rng = np.random.default_rng(3)
    left, rows, good = rng.normal(size=(400, 2)), 10 * np.arange(400), np.ones((400, 2), bool)
    stretch = OutlierInterval(2.0, 3.0, ("carriage",), 90.0, (2000, 2200))
    assert not is_outlying(stretch, rows, left, good)
    left[205:216, 1] += 12.0
    assert is_outlying(stretch, rows, left, good)
    good[200:221, 1] = False
    assert not is_outlying(stretch, rows, left, good)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hold", "verdict"),
    [(20.0, "explained"), pytest.param(60.0, "unexplained", marks=[pytest.mark.slow])],
)
def test_what_friction_may_hold_where_a_joint_hardly_moves_is_no_event(carriage, hold, verdict):
    """It rubs with 20 N; for half a second it creeps, and is held by as much or by more."""
    rng, time = np.random.default_rng(1), np.arange(6000) * 0.004
    stands = (time > 8.0) & (time < 8.5)
    clock = np.where(time > 8.5, time - 0.5, np.where(time > 8.0, 8.0 + 2e-5 * (time - 8.0), time))
    smooth = np.hanning(51) / np.hanning(51).sum()
    clock = np.convolve(np.pad(clock, 25, mode="edge"), smooth, "valid")
    q = 0.1 * np.sin(1.1 * clock) + 0.05 * np.sin(2.9 * clock + 1)
    v = np.gradient(q, time)
    coloured = lfilter([0.5 * np.sqrt(0.19)], [1.0, -0.9], rng.normal(size=6000))
    tau = 95 * np.gradient(v, time) + 200 * v + np.where(stands, hold, 20 * np.sign(v)) + coloured
    q = np.round((q + 1e-8 * rng.normal(size=6000)) * 1e7) / 1e7
    found = diagnose(carriage, Recording(time=time, positions={"carriage": q}, efforts={"carriage": tau}))
    assert found.verdict == verdict
    assert {("viscous_friction", "carriage"), ("coulomb_friction", "carriage")} <= named(found)
    assert any("hardly moved" in remark for remark in found.remarks) == (verdict == "explained")
