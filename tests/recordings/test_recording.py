"""The recording in memory: selection, standstill, and what looks wrong in it."""

from __future__ import annotations

import numpy as np
import pytest

from prup_pin.errors import InputError, UnknownNameError
from prup_pin.recordings import Noise, Recording, Together, suspicions
from prup_pin.recordings.columns import fields_of
from prup_pin.spatial import WRENCH_NAMES


def bench(n=60, seed=3, **changes):
    """Return a recording of three poses under changing force, with white noise of 1 um, 10 urad, 10 mN, 1 mN m."""
    random = np.random.default_rng(seed)
    pose = np.repeat(np.arange(3), n // 3)
    wrench = np.zeros((n, 6))
    wrench[:, 0] = 10 * (np.arange(n) // 2 % 3)
    wrench[:, 3:] = 0.5
    values = {
        "time": np.arange(n) * 0.5,
        "positions": {"a": 0.3 + 0.1 * pose, "b": 0.5 - 0.05 * pose},
        "efforts": {"a": 20 + 5 * pose + 0.1 * random.standard_normal(n)},
        "wrench": wrench + np.repeat((0.01, 0.001), 3) * random.standard_normal((n, 6)),
        "position": 0.3 + 0.1 * pose[:, None] + 1e-6 * (wrench[:, :3] + random.standard_normal((n, 3))),
        "rotation": 0.1 * pose[:, None] + 1e-5 * random.standard_normal((n, 3)),
        "markers": {"tip": 0.4 + 1e-6 * random.standard_normal((n, 3))},
        "temperature": 20 + 0.01 * random.standard_normal(n),
        "noise": Noise(1e-6, 1e-5, 0.01, 0.001, 0.1),
    }
    return Recording(**{**values, **changes})


def test_actuator_positions():
    recording = bench()
    np.testing.assert_array_equal(
        recording.actuator_positions(["b", "a"]),
        np.column_stack([recording.positions["b"], recording.positions["a"]]),
    )
    assert recording.actuator_positions([]).shape == (60, 0)
    with pytest.raises(UnknownNameError) as caught:
        recording.actuator_positions(["a", "leg3_slide", "c"])
    message = str(caught.value)
    assert "no column named 'q.leg3_slide'" in message
    assert "has: q.a, q.b." in message
    assert "stood is not known: add the column, constant where the joint was held" in message
    assert "Also missing: q.c." in message
    wrists = Recording(time=[0.0], positions={"wrist_1_joint": [0.0]})
    with pytest.raises(UnknownNameError) as caught:
        wrists.actuator_positions(["elbow_joint", "wrist_1_joint"])
    assert "Did you mean" not in str(caught.value)  # the wrist's column is the wrist's
    with pytest.raises(UnknownNameError, match=r"no q\. column at all"):
        Recording(time=[0.0]).actuator_positions(["a"])


def test_arrays_are_read_only_and_the_callers_stay_writable():
    time = np.arange(3.0)
    recording = Recording(time=time, positions={"a": np.zeros(3)})
    with pytest.raises(ValueError, match="read-only"):
        recording.time[0] = 5
    time[0] = -1
    with pytest.raises(TypeError):
        recording.positions["b"] = time


def test_defaults():
    recording = Recording(time=np.arange(3.0), positions={"a": np.zeros(3)})
    assert recording.wrench.shape == (3, 6)
    assert not recording.has_wrench
    assert recording.position is None
    assert recording.run.tolist() == [0, 0, 0]
    assert Recording(time=[0.0, 1.0], wrench=np.ones((2, 6))).has_wrench


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"time": np.zeros((3, 2))}, r"time must have shape \(N,\)"),
        ({"positions": {"a": np.zeros(4)}}, r"positions\['a'\] must have shape \(60,\)"),
        ({"wrench": np.zeros((60, 3))}, r"wrench must have shape \(60, 6\)"),
        ({"rotation": np.zeros((60, 3, 3))}, r"rotation must have shape \(60, 3\)"),
        ({"markers": {"tip": np.zeros(60)}}, r"markers\['tip'\]"),
        ({"run": np.ones(60)}, "run must be 60 indices into run_names, which has 1 entries"),
        ({"wrench_columns": ("fx", "fq")}, "no component of a wrench named 'fq'"),
    ],
)
def test_wrong_shapes(changes, message):
    with pytest.raises(InputError, match=message):
        bench(**changes)


def test_noise_is_positive():
    with pytest.raises(InputError, match="noise force = 0"):
        Noise(force=0)


@pytest.mark.parametrize(
    "rows", [np.arange(60) % 2 == 0, np.arange(0, 60, 2), slice(0, None, 2), list(range(0, 60, 2))]
)
def test_select(rows):
    recording = bench(run=np.arange(60) // 30, run_names=("x", "y"))
    chosen = recording.select(rows)
    assert len(chosen) == 30
    np.testing.assert_array_equal(chosen.time, recording.time[::2])
    np.testing.assert_array_equal(chosen.positions["b"], recording.positions["b"][::2])
    np.testing.assert_array_equal(chosen.markers["tip"], recording.markers["tip"][::2])
    np.testing.assert_array_equal(chosen.run, recording.run[::2])
    assert chosen.run_names == ("x", "y")
    assert chosen.noise == recording.noise


def test_select_none_and_wrong():
    assert len(bench().select([])) == 0
    assert bench().select([]).blocks().shape == (0,)
    with pytest.raises(InputError, match="a mask must have shape"):
        bench().select([True, False])
    with pytest.raises(InputError, match="rows must be"):
        bench().select([0.5])


def test_with_measurements():
    recording = bench()
    other = recording.with_measurements(position=np.ones((60, 3)), efforts={"b": np.zeros(60)})
    assert (other.position == 1).all()
    assert list(other.efforts) == ["b"]
    assert other.rotation is not None
    np.testing.assert_array_equal(other.rotation, recording.rotation)
    with pytest.raises(InputError, match="position must have shape"):
        recording.with_measurements(position=np.ones((3, 60)))


def test_repr():
    text = repr(bench(path="x.csv", run=np.arange(60) // 30, run_names=("x", "y")))
    assert text == (
        "<Recording x.csv: 60 samples; 2 runs; joints a, b; "
        "with wrench, position, rotation, efforts, temperature, marker tip>"
    )


def blocks(values, run=None, **options):
    names = tuple("" for _ in set(run or [0]))
    values = np.array(values, float)
    return Recording(np.arange(len(values)), {"a": values}, run=run, run_names=names).blocks(**options).tolist()


def test_blocks():
    assert bench().blocks().tolist() == np.repeat([0, 1, 2], 20).tolist()
    assert blocks([0.1, 0.1, 0.2, 0.2, 0.1]) == [0, 0, 1, 1, 2]
    assert blocks([0.1, 0.1, 0.1, 0.1], run=[0, 0, 1, 1]) == [0, 0, 1, 1]
    assert blocks([]) == []


def test_blocks_bear_jitter_but_not_creep():
    random = np.random.default_rng(1)
    jitter = 4e-6 * random.choice([-1, 0, 1], 50)
    assert set(blocks(0.3 + jitter)) == {0}
    creep = 0.3 + 4e-6 * np.arange(9)
    assert blocks(creep) == [0, 0, 0, 1, 1, 1, 2, 2, 2]
    assert set(blocks(creep, tolerance=1e-3)) == {0}


def test_blocks_bear_unmeasured_positions():
    nan = np.nan
    assert blocks([nan, 0.1, nan, 0.1, nan, 0.2, nan]) == [0, 0, 0, 0, 0, 1, 1]
    assert blocks([nan, nan]) == [0, 0]


def test_nothing_suspicious():
    assert suspicions(bench()) == ()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda r: {"rotation": np.degrees(r.rotation)}, "degrees"),
        (lambda r: {"position": r.position * 1000}, "p.x p.y p.z reach 500 m: are they millimetres"),
        (lambda r: {"markers": {"tip": r.markers["tip"] * 1000}}, "p.tip.x p.tip.y p.tip.z reach 400 m"),
        (lambda r: {"positions": {"a": r.positions["a"] * 1000}}, "q.a reaches 500: is it in millimetres or degrees"),
        (lambda r: {"wrench": r.wrench * 1e5}, "w.fx w.fy w.fz reach 2.00"),
        (lambda r: {"wrench": r.wrench * [1, 1, 1, 1e3, 1e3, 1e3]}, "are they N mm, 1000 times too large"),
        (lambda r: {"temperature": r.temperature + 273}, "is it kelvin"),
        (lambda r: {"temperature": r.temperature * 0 - 273}, "temperature falls to -273"),
        (lambda r: {"position": r.position * [1, 0, 1]}, "p.y never changes"),
        (lambda r: {"efforts": {"a": np.full(60, np.nan)}}, "Nothing was measured in tau.a"),
        (
            lambda r: {
                "position": np.where(np.arange(60)[:, None] > 0, r.position, np.nan),
                "noise": Noise(position=2),
            },
            "position_noise is declared as 2 m, but the whole recording varies by",
        ),
        (lambda r: {"noise": Noise(rotation=1e-8)}, "rotation_noise is declared as 1e-8 rad, but samples at the same"),
        (lambda r: {"noise": Noise(force=1000)}, "force_noise is declared as 1000 N"),
        (lambda r: {"noise": Noise(effort=1e-4, force=0.01, moment=0.001)}, "effort_noise is declared as 0.0001"),
    ],
)
def test_suspicions(change, message):
    recording = bench(**change(bench()))
    found = suspicions(recording)
    assert any(message in sentence for sentence in found), found


def test_repeated_rows():
    recording = bench().select(np.r_[0:60, 5:10])
    (sentence,) = suspicions(recording)
    assert "5 of 65 rows repeat an earlier row" in sentence


def test_suspicions_of_next_to_nothing():
    assert suspicions(Recording(time=[0.0], positions={"a": [0.1]})) == ()
    assert suspicions(bench().select([])) != ()  # nothing was measured


def test_a_clock_in_milliseconds_is_suspected():
    """A motion of 30 s that seems to take eight hours; postures one after the other may take as long."""
    time = np.arange(0, 30, 0.02)
    motion = {"time": time, "positions": {"axis": np.sin(time)}, "efforts": {"axis": np.cos(time)}}
    assert not suspicions(Recording(**motion))
    (said,) = suspicions(Recording(**(motion | {"time": 1e3 * time})))
    assert "is it in milliseconds?" in said
    postures = {"axis": np.random.default_rng(1).uniform(-1, 1, len(time))}
    assert not suspicions(Recording(**(motion | {"time": 1e3 * time, "positions": postures})))


def test_columns_and_fields_say_the_same():
    recording = bench(
        6, gravity=np.ones((6, 3)), marker_rotations={"tip": np.ones((6, 3))}, wrench_columns=WRENCH_NAMES[:2]
    )
    fields = fields_of(dict(recording.columns()), 6)
    again = Recording(recording.time, **fields)
    assert dict(again.columns()).keys() == dict(recording.columns()).keys()
    for (_, mine), (_, theirs) in zip(again.columns(), recording.columns(), strict=True):
        np.testing.assert_array_equal(mine, theirs)


def test_recordings_together_have_no_load_where_one_has_no_column_of_it_and_keep_what_was_turned():
    """A wrench that was read in other axes has components beside the logged ones."""
    turned = Recording(np.arange(2.0), {"a": np.zeros(2)}, wrench=np.ones((2, 6)), wrench_columns=("fx",))
    bare = Recording(np.arange(3.0), {"a": np.ones(3)}, gravity=np.ones((3, 3)))
    joined = Together.of([turned, bare], ["a"], (0, 0, -9.81)).recording
    np.testing.assert_array_equal(joined.wrench, np.repeat([[1.0], [0.0]], [2, 3], axis=0) * np.ones(6))
    assert joined.wrench_columns == ("fx",)
    np.testing.assert_array_equal(joined.gravity[:, 2], [-9.81, -9.81, 1, 1, 1])


def test_a_recording_of_another_robot_says_whose_it_is():
    log = Recording(time=np.arange(2.0), positions={"left": np.zeros(2), "right": np.zeros(2)}, robot="five_bar.urdf")
    with pytest.raises(UnknownNameError, match=r"None of this robot's joints has a column: .*'five_bar.urdf'"):
        log.actuator_positions(["elbow", "wrist"])
    with pytest.raises(UnknownNameError, match="add the column, constant where the joint was held"):
        log.actuator_positions(["left", "wrist"])
