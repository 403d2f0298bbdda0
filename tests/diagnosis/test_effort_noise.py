"""Noise of efforts that no fit can hide in, and what is said of what is left where none was declared."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from prup_pin import load
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.efforts.noise import noise_of, noise_of_efforts, rounding_that_follows, true_roundings
from prup_pin.diagnosis.efforts.prepare import PreparedEfforts
from prup_pin.diagnosis.efforts.residuals import EffortResiduals
from prup_pin.diagnosis.efforts.unexplained import _saved, _worse, time_varying
from prup_pin.dynamics import InMotion, motion_of
from prup_pin.numbers import number
from prup_pin.recordings import Noise, Recording
from prup_pin.views.report.as_json import diagnosis_as_json
from prup_pin.views.text.diagnosis_words import effort_rows, noise_text

from .conftest import AXIS

STEP = 0.004


def moved(n=6000, pause=0):
    """Time, position, speed and acceleration of a smooth motion at 250 Hz, which stops in the middle for some rows."""
    way, middle = np.arange(n - pause) * STEP, (n - pause) // 2
    near = np.clip(np.abs(np.arange(n - pause) - middle) / 500, 0, 1) if pause else np.ones(n)
    speed = near**4 * (35 - 84 * near + 70 * near**2 - 20 * near**3)
    speed *= 0.11 * np.cos(1.1 * way) + 0.145 * np.cos(2.9 * way + 1)
    speed = np.concatenate((speed[:middle], np.zeros(pause), speed[middle:]))
    return np.arange(n) * STEP, np.cumsum(speed) * STEP, speed, np.gradient(speed, STEP)


def lasting(size, kept, n, seed=2):
    """Noise of which a share is kept from sample to sample."""
    rng, out = np.random.default_rng(seed), np.zeros(n)
    for row in range(1, n):
        out[row] = kept * out[row - 1] + np.sqrt(1 - kept**2) * size * rng.normal()
    return out


def recorded(disturb, n=6000, pause=0, friction=0.0, load=95.0):
    """The axis in motion: its mass, friction that turns round at once, and what disturbs the sensor."""
    time, q, v, a = moved(n, pause)
    tau = load * a + friction * np.sign(v) + disturb
    return Recording(time=time, positions={"carriage": q}, efforts={"carriage": tau})


def told(recording):
    return noise_of_efforts(recording, ["carriage"])["carriage"]


@pytest.mark.parametrize("size", [0.05, 0.5, 5.0])
def test_white_noise_on_a_smooth_motion_is_told_to_a_fifth(size):
    noise = told(recorded(size * np.random.default_rng(1).normal(size=6000)))
    assert noise.how == "innovations"
    assert noise.size == pytest.approx(size, rel=0.2)
    assert noise.rate == pytest.approx(250.0)
    assert noise.below(12.5) == pytest.approx(noise.size * np.sqrt(0.1))


def test_friction_that_turns_round_is_no_noise():
    """Forty newtons that jump at each reversal, beside half a newton of noise."""
    noise = told(recorded(0.5 * np.random.default_rng(1).normal(size=6000), friction=20.0))
    assert noise.size == pytest.approx(0.5, rel=0.2)


def test_noise_that_lasts_is_told_by_what_is_new_of_it_and_whole_at_rest():
    assert told(recorded(lasting(0.5, 0.9, 6000))).size == pytest.approx(0.5 * np.sqrt(1 - 0.81), rel=0.2)
    rests = told(recorded(lasting(0.5, 0.9, 9000), n=9000, pause=3000))
    assert rests.how == "rest"
    assert rests.size == pytest.approx(0.5, rel=0.2)
    assert rests.below(1.0) == rests.size


def test_counts_are_off_by_a_step_over_the_root_of_twelve():
    """Of so coarse counts most samples repeat the one before: they are foretold, and still off."""
    plain = recorded(0.02 * np.random.default_rng(1).normal(size=6000))
    step = 40.0
    counted = plain.with_measurements(efforts={"carriage": step * np.round(plain.efforts["carriage"] / step)})
    noise = told(counted)
    assert noise.how == "quantisation"
    assert noise.size == pytest.approx(step / np.sqrt(12), rel=1e-6)


@pytest.mark.parametrize("before", [0.02, 0.2, 0.35, 1.0])
def test_rounding_follows_a_slow_effort_but_where_noise_hides_the_steps(before):
    """The error of rounding, less what it does not tell of the effort: its mean for each effort, over many draws."""
    rng, slow = np.random.default_rng(3), np.linspace(0.0, 7.0, 400)
    counted = np.round(slow + before * rng.normal(size=(4000, 400)))
    mean = (counted - slow).mean(axis=0)
    follows = np.sqrt(max((mean**2).mean() - (before**2 + 1 / 12) / 4000, 0.0))
    assert rounding_that_follows(1.0, np.hypot(before, 1 / np.sqrt(12))) == pytest.approx(follows, rel=0.05, abs=1e-3)


def test_what_rounds_is_slow_where_no_noise_hides_it():
    rng, values = np.random.default_rng(1), recorded(0.0).efforts["carriage"]
    coarse, fine = (
        told(recorded(0.0).with_measurements(efforts={"carriage": 4 * np.round((values + each) / 4)}))
        for each in (0.02 * rng.normal(size=6000), 4 * rng.normal(size=6000))
    )
    assert coarse.below(0.01) == pytest.approx(4 / np.sqrt(12), rel=0.01)
    assert fine.below(0.01) == pytest.approx(fine.size * np.sqrt(0.02 / 250), rel=0.01)


def test_a_column_that_holds_its_samples_has_the_noise_of_those():
    values = recorded(0.5 * np.random.default_rng(1).normal(size=6000)).efforts["carriage"]
    held = recorded(0.0).with_measurements(efforts={"carriage": np.repeat(values[::4], 4)})
    noise = told(held)
    assert noise.size == pytest.approx(0.5, rel=0.2)
    assert noise.rate == pytest.approx(62.5)


def test_of_postures_it_is_what_repeats_that_tells():
    rng = np.random.default_rng(4)
    q = np.repeat(rng.uniform(-0.1, 0.1, 60), 3)
    load = 400 * q
    postures = Recording(
        time=np.arange(180.0),
        positions={"carriage": q},
        efforts={"carriage": load + 0.3 * rng.normal(size=180)},
    )
    noise = told(postures)
    assert noise.how == "repeats"
    assert noise.size == pytest.approx(0.3, rel=0.2)
    once = told(postures.select(slice(0, None, 3)))
    assert np.isnan(once.size)
    assert once.how == ""


@pytest.fixture(scope="module")
def heavy(tmp_path_factory):
    """The axis as drawn, and with a third of its mass."""
    path = tmp_path_factory.mktemp("axis") / "light.urdf"
    path.write_text(AXIS.read_text().replace('value="95"', 'value="30"'))
    return load(AXIS), load(path)


@pytest.mark.slow
def test_no_robot_file_and_no_misfit_changes_the_noise(heavy):
    recording = recorded(0.5 * np.random.default_rng(1).normal(size=4000), n=4000)
    right, wrong = (diagnose(robot, recording).efforts for robot in heavy)
    assert right.noise == pytest.approx(wrong.noise, rel=1e-12)
    assert wrong.before["fit"] > 10 * right.before["fit"]
    assert right.after["fit"] == pytest.approx(1.0, abs=0.3)
    turned = recording.with_measurements(efforts={"carriage": -recording.efforts["carriage"]})
    assert told(turned).size == pytest.approx(told(recording).size, rel=1e-9)


def test_what_no_law_takes_away_is_never_peace_and_noise_as_large_is(heavy):
    """Efforts of another machine, and as large a scatter that nothing foretells: neither was declared."""
    robot, _ = heavy
    time, *_ = moved(4000)
    other = 20 * np.sin(2 * np.pi * (0.7 * time + 0.02 * time**2)) * np.cos(0.9 * time)
    slow = recorded(other + 0.5 * np.random.default_rng(1).normal(size=4000), n=4000)
    found = diagnose(robot, slow)
    assert found.efforts.shares["all"]["heldout"] > 0.3
    assert found.efforts.after["fit"] > 10
    assert found.verdict == "unexplained"
    loud = recorded(20 * np.random.default_rng(1).normal(size=4000), n=4000)
    found = diagnose(robot, loud)
    assert found.efforts.after["fit"] == pytest.approx(1.0, abs=0.3)
    assert "unknown" not in {finding.physics for finding in found.findings}


@pytest.mark.slow
def test_shares_stand_beside_multiples(heavy):
    robot, _ = heavy
    recording = recorded(0.5 * np.random.default_rng(1).normal(size=3000), n=3000)
    found = diagnose(robot, recording)
    document = json.loads(json.dumps(diagnosis_as_json(found, robot)))
    share = found.efforts.shares["carriage"]["heldout"]
    assert document["residual"]["by_channel"]["effort carriage"]["left_share"] == pytest.approx(share)
    assert document["noise"]["source"] == "estimated"
    assert document["noise"]["how"] == {"carriage": "innovations"}
    assert document["noise"]["efforts"]["carriage"] == pytest.approx(0.5, rel=0.2)
    (row,) = effort_rows(found)
    assert row[0] == "carriage"
    assert row[1].endswith(" N")
    mostly = share > 0.5  # an effort that is hardly more than its noise says so
    assert row[3].endswith(f"→ {number(100 * share, 3)}{', mostly noise' if mostly else ''}")
    louder = replace(found, by_channel={"effort carriage": found.by_channel["effort carriage"] | {"left_share": 0.739}})
    assert effort_rows(louder)[0][3].endswith("→ 73.9, mostly noise")
    quiet = replace(found, by_channel={"effort carriage": found.by_channel["effort carriage"] | {"left_share": 0.01}})
    assert effort_rows(quiet)[0][3].endswith("→ 1")
    assert noise_text(found)[-1] == "estimated, of efforts by what their past does not foretell"
    assert "% of the efforts" in str(found)
    declared = diagnose(robot, replace(recording, noise=Noise(effort=0.5)))
    document = diagnosis_as_json(declared, robot)
    assert document["noise"]["source"] == "declared"
    assert "how" not in document["noise"]
    assert document["residual"]["by_channel"]["effort carriage"]["left_share"] > 0


# -- what follows a motion ---------------------------------------------------------------------------------------------

TWO = """<robot name="two"><link name="base"/>{}</robot>"""
JOINT = """<joint name="joint_{i}" type="revolute"><parent link="{parent}"/><child link="link_{i}"/>
<origin xyz="{x} 0 0"/><axis xyz="0 1 0"/><limit lower="-9" upper="9" effort="99" velocity="9"/></joint>
<link name="link_{i}"><inertial><origin xyz="0.2 0 0"/><mass value="2"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.04" iyz="0" izz="0.04"/></inertial></link>"""


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    """Two links that swing, each for itself, as their efforts are compared."""
    path = tmp_path_factory.mktemp("two") / "two.urdf"
    links = [JOINT.format(i=i, parent=parent, x=x) for i, parent, x in ((1, "base", 0), (2, "link_1", 0.4))]
    path.write_text(TWO.format("".join(links)))
    robot = load(path, tool="link_2")
    time = np.arange(5000) * 0.01
    q = (0.8 * np.sin(1.7 * time + np.sin(0.21 * time)), 0.9 * np.sin(2.3 * time + 2 * np.sin(0.13 * time)))
    names = ("joint_1", "joint_2")
    recording = Recording(
        time=time,
        positions=dict(zip(names, q, strict=True)),
        efforts=dict.fromkeys(names, np.zeros(5000)),
    )
    at = InMotion.of(robot.mechanism, motion_of(recording, robot.mechanism))
    rng = np.random.default_rng(8)
    return PreparedEfforts(at.measuring(at.rigid + 0.05 * rng.normal(size=at.rigid.shape)), {})


def comes_and_goes(two, share, noisy=0.01):
    """What is left: noise, and at the first joint a share of its effort that follows the other's speed now and then."""
    rng, every = np.random.default_rng(5), two.kept
    measured = two.rigid[every]
    sign = np.where((two.blocks // 3) % 2, 1.0, -1.0)
    follows = sign * two.at.speed("joint_2")[every]
    size = np.sqrt((measured**2).mean(axis=0))
    left = noisy * size * rng.normal(size=measured.shape)
    left[:, 0] += share * size[0] * follows / np.sqrt((follows**2).mean())
    return left, measured, 0.01 * size


def test_a_cable_to_another_joint_that_drags_now_and_then_is_found_there(two):
    left, measured, noise = comes_and_goes(two, 0.2)
    found = time_varying(two, left, measured, noise)
    assert (found.joint, found.of, found.variable) == ("joint_1", "joint_2", "speed")
    assert 0.14 < found.size < 0.2  # less what so many amounts take off anything
    assert found.share > 0.5


def test_what_is_a_little_of_the_effort_or_of_the_noise_is_no_matter(two):
    left, measured, noise = comes_and_goes(two, 0.03)
    assert time_varying(two, left, measured, noise) is None
    # more than that is left, but less of it follows
    left, measured, noise = comes_and_goes(two, 0.045, 0.045)
    assert time_varying(two, left, measured, noise) is None
    assert time_varying(two, 2 * left, measured, noise).of == "joint_2"
    left, measured, noise = comes_and_goes(two, 0.2)
    assert time_varying(two, left, measured, 30 * noise) is None


def test_the_same_at_other_times_follows_nothing(two):
    left, measured, noise = comes_and_goes(two, 0.2)
    assert time_varying(two, np.roll(left, len(left) // 3, axis=0), measured, noise) is None


def test_where_a_joint_stands_nothing_is_followed_better_or_worse():
    """Nothing is compared there: as many rows of it between the others change neither what is followed nor chance."""
    rng, lags = np.random.default_rng(7), np.linspace(0, 0.9, 10)
    left, columns, blocks = rng.normal(size=300), rng.normal(size=(300, 2)), np.arange(300) // 60
    stands = np.insert(np.zeros(300, bool), 120, np.ones(200, bool))
    among = [np.insert(each, 120, np.zeros((200, *each.shape[1:])), axis=0) for each in (left, columns, blocks)]
    among[2][stands] = 2
    plain = _saved(left, columns, blocks, np.ones(300, bool), lags)
    assert _saved(*among, ~stands, lags) == pytest.approx(plain)


def test_noise_as_large_as_the_effort_follows_nothing(two):
    _, measured, noise = comes_and_goes(two, 0.0)
    size = np.sqrt((measured**2).mean(axis=0))
    n = len(measured)
    alarms = [
        time_varying(
            two, size * np.stack([lasting(1.0, 0.9, n, seed), lasting(1.0, 0.5, n, 99 + seed)], 1), measured, noise
        )
        for seed in range(12)
    ]
    assert sum(alarm is not None for alarm in alarms) <= 1


@pytest.mark.parametrize(("noise", "told"), [(np.nan, True), (0.6, True), (0.8, False)])
def test_a_joint_that_is_predicted_worse_than_drawn_is_told_by_more_than_a_sample_scatters(noise, told):
    """sqrt(0.4^2 - 0.2^2) = 0.346 more than drawn: half of a sample's noise of 0.7."""
    rng = np.random.default_rng(6)
    measured = rng.normal(size=(400, 2))
    rigid = measured - 0.2 * rng.normal(size=(400, 2))
    held = rigid.copy()
    held[:, 1] = measured[:, 1] - 0.4 * rng.normal(size=400)
    parts = [slice(start, start + 10) for start in range(0, 400, 10)]
    final = SimpleNamespace(
        at=SimpleNamespace(driven=("a", "b")),
        efforts=SimpleNamespace(good=np.ones((400, 2), bool)),
        problem=SimpleNamespace(columns=SimpleNamespace(parts=parts)),
        noise_sizes=np.full(2, noise),
        scale=np.ones(2),
    )
    shares = {"a": {"rigid": 0.2, "heldout": 0.2}, "b": {"rigid": 0.2, "heldout": 0.4}}
    found = list(_worse(final, EffortResiduals(measured, rigid, held, held, {}, {}, {}, shares)))
    assert len(found) == told
    if not told:
        return
    (finding,) = found
    assert (finding.physics, finding.location) == ("unknown", "b")
    assert "40 %" in finding.statement
    assert "20 %" in finding.statement


def test_what_rounding_leaves_is_known_beside_a_noise_that_was_declared():
    time = np.arange(4000) * 0.004
    slow = 3 * np.sin(0.4 * time)
    recording = Recording(
        time=time, positions={"j": np.sin(time)}, efforts={"j": 0.5 * np.round(slow / 0.5)}, noise=Noise(effort=0.2)
    )
    at = SimpleNamespace(driven=("j",), motion=SimpleNamespace(rate=250.0))
    noise = noise_of(recording, at)
    assert noise["j"].size == 0.2
    seen = noise_of_efforts(replace(recording, noise=Noise()), ["j"])["j"].rounding
    assert 0.03 < seen < 0.5 / np.sqrt(12)
    assert true_roundings(noise, ["j"], np.array([2.0])) == pytest.approx([seen / 2])
