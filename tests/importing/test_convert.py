"""What a map makes of a log: SI, signs, motors to joints, one clock; and what is wrong with a map."""

from __future__ import annotations

import numpy as np
import pytest

from prup_pin.errors import RecordingFileError
from prup_pin.imports import Log, Stream, guess
from prup_pin.imports.convert import resampled
from prup_pin.imports.log import frozen
from prup_pin.recordings import Noise, read_recording, write_recording
from prup_pin.spatial import rotation_exp

from . import logs
from .logs import converted, log_of

Q, QD, TAU = logs.motion()
N = len(logs.T)


def test_units_signs_scales_and_offsets(tmp_path, ur5):
    log = log_of({
        "ms": 5000 + 1e3 * logs.T, "a": np.degrees(Q[:, 2]), "b": QD[:, 2] * 60 / (2 * np.pi), "i": TAU[:, 2] / -0.12,
        "f": np.full(N, 2.5), "x": np.full(N, 300.0), "temp": np.full(N, 300.15), "spare": logs.T,
    })  # fmt: skip
    done = converted(
        tmp_path,
        """
robot: ur5
time: {from: ms, unit: ms}
columns:
  q.elbow_joint: {from: a, unit: deg, offset: 0.25}
  qd.elbow_joint: {from: b, unit: rpm}
  tau.elbow_joint: {from: i, unit: A, sign: -1, scale: 0.12}
  w.fz: {from: f, unit: kN}
  p.tool0.x: {from: x, unit: mm}
  temperature: {from: temp, unit: K}
""",
        log,
        ur5,
    )
    recording = done.recording
    assert np.abs(recording.time - logs.T).max() < 1e-9
    assert np.abs(recording.positions["elbow_joint"] - Q[:, 2] - 0.25).max() < 1e-12
    assert np.abs(recording.velocities["elbow_joint"] - QD[:, 2]).max() < 1e-12
    assert np.abs(recording.efforts["elbow_joint"] - TAU[:, 2]).max() < 1e-12
    assert recording.wrench_columns == ("fz",)
    assert np.allclose(recording.wrench[:, 2], 2500, rtol=1e-12)
    assert np.allclose(recording.markers["tool0"][:, 0], 0.3, rtol=1e-12)
    assert np.isnan(recording.markers["tool0"][:, 1:]).all()
    assert np.allclose(recording.temperature, 27.0)
    assert recording.robot == "ur5"
    assert done.unused == ("spare",)


def test_motors_become_joints_without_loss_of_power(tmp_path, ur5):
    matrix = np.array([[0.01, 0.0], [-0.005, 0.02]])
    at_motor = [np.linalg.solve(matrix, values[:, 4:].T).T for values in (Q, QD)]
    effort = TAU[:, 4:] @ matrix
    log = log_of({"t": logs.T, **logs.numbered("p{}", at_motor[0]), **logs.numbered("v{}", at_motor[1]),
                  **logs.numbered("m{}", effort)})  # fmt: skip
    done = converted(
        tmp_path,
        """
time: {from: t}
columns:
  q.m1: {from: p1, unit: rad}
  q.m2: {from: p2, unit: rad}
  qd.m1: {from: v1, unit: rad/s}
  qd.m2: {from: v2, unit: rad/s}
  tau.m1: {from: m1, unit: N m}
  tau.m2: {from: m2, unit: N m}
motors:
  - {names: [m1, m2], joints: [wrist_2_joint, wrist_3_joint], matrix: [[0.01, 0], [-0.005, 0.02]]}
""",
        log,
        ur5,
    )
    recording = done.recording
    assert list(recording.positions) == ["wrist_2_joint", "wrist_3_joint"]
    for k, joint in enumerate(recording.positions):
        assert np.abs(recording.positions[joint] - Q[:, 4 + k]).max() < 1e-11
        assert np.abs(recording.efforts[joint] - TAU[:, 4 + k]).max() < 1e-11
    joints = sum(recording.efforts[joint] * recording.velocities[joint] for joint in recording.efforts)
    assert np.abs(joints - (effort * at_motor[1]).sum(1)).max() < 1e-10


def test_an_angle_that_jumps_by_whole_turns_is_made_continuous(tmp_path):
    far = 3.0 * logs.T
    log = log_of({"t": logs.T, "a": np.degrees((far + np.pi) % (2 * np.pi) - np.pi)})
    done = converted(tmp_path, "time: {from: t}\ncolumns:\n  q.j: {from: a, unit: deg, unwrap: true}\n", log)
    assert np.abs(done.recording.positions["j"] - far).max() < 1e-10


def test_several_clocks_come_to_one_without_delay(tmp_path):
    fast = np.arange(0.0, 6.0, 0.001) + 0.0003
    wave = np.sin(2 * np.pi * fast)
    other = Stream("ft", frozen({"fz": 10 * wave, "hum": np.sin(2 * np.pi * 125.0 * fast)}), fast + 0.02)
    log = Log("log.mcap", (Stream("arm", frozen({"q": Q[:, 0]}), logs.T), other))
    text = """
time:
  arm: {{}}
  ft: {{delay: 0.02}}
columns:
  q.j: {{from: q, unit: rad}}
  w.fz: {{from: fz, unit: N}}
  w.mz: {{from: hum, unit: N m}}
resample: {{{how}}}
"""
    for how, rate in (("clock: arm", 250), ("rate: 100", 100), ("rate: 2000", 2000)):
        done = converted(tmp_path, text.format(how=how), log)
        time = done.recording.time
        assert np.allclose(np.diff(time), 1 / rate)
        begin = 0.0 if how.startswith("clock") else 0.0003
        force = done.recording.wrench[:, 2]
        width = 1 / rate if rate < 600 else 0.0
        expected = 10 * np.sin(2 * np.pi * (time + begin)) * np.sinc(width)
        known = np.isfinite(force)
        assert known[5:-5].all()
        assert np.abs(force - expected)[5:-5].max() < 3e-4
        loudness = np.std(done.recording.wrench[5:-5, 5])
        assert loudness < 0.3 if width else loudness > 0.65
        assert np.abs(done.recording.positions["j"] - logs.motion(time + begin)[0][:, 0])[5:-5].max() < 2e-3
        assert any(f"ft (1000/s) is put on {'the clock of arm' if 'clock' in how else 'an even clock'}" in remark
                   for remark in done.remarks)  # fmt: skip


def test_efforts_of_a_scale_that_nobody_knows_need_a_gain_that_is_open(tmp_path, ur5):
    columns = {"t": logs.T} | logs.numbered("q{}", Q) | logs.numbered("current_{}", TAU / 9)
    made = guess(log_of(columns), ur5, "ur5")
    assert "# tolerances: {effort_gain: 1, mass: 0.1, inertia: 0.1}" in made.text
    with pytest.raises(RecordingFileError, match=r"needs a `scale`.*effort_gain: 1"):
        converted(tmp_path, made.text, log_of(columns), ur5)
    done = converted(tmp_path, made.text.replace("# tolerances", "tolerances"), log_of(columns), ur5)
    assert np.array_equal(done.recording.efforts["elbow_joint"], TAU[:, 2] / 9)
    assert done.recording.tolerances.effort_gain == 1
    assert "at a scale that the declared effort_gain leaves to the diagnosis" in done.remarks[-1]


def test_a_gap_is_not_filled():
    at = np.r_[np.arange(0, 1, 0.01), np.arange(2, 3, 0.01)]
    time = np.arange(0, 3, 0.004)
    out = resampled(at, at**2, time)
    assert np.isnan(out[(time > 1.0) & (time < 1.99)]).all()
    inside = (time < 0.985) | ((time > 2.0) & (time < 2.985))
    assert np.abs(out - time**2)[inside].max() < 1e-4


def test_repeated_stamps_are_left_out_and_a_clock_that_runs_backwards_is_refused(tmp_path):
    t = np.array([0.0, 0.01, 0.01, 0.02, np.nan, 0.03])
    text = "time: {from: t}\ncolumns: {q.j: {from: q, unit: rad}}\n"
    done = converted(tmp_path, text, log_of({"t": t, "q": np.arange(6.0)}))
    assert done.recording.positions["j"].tolist() == [0, 1, 3, 5]
    assert "1 rows (20 %) repeat" in " ".join(done.remarks)
    assert "1 rows without a time" in " ".join(done.remarks)
    t = np.array([0.0, 0.01, 0.02, 0.005, 0.01])
    with pytest.raises(RecordingFileError, match=r"'t' runs backwards 1 times, first in row 4: 0.005 after 0.02"):
        converted(tmp_path, text, log_of({"t": t, "q": np.arange(5.0)}))


@pytest.mark.parametrize("manner", ["quaternion_xyzw", "quaternion_wxyz", "rpy"])
def test_orientations_however_they_are_logged(tmp_path, manner):
    from scipy.spatial.transform import Rotation

    angles = np.column_stack([0.3 * np.sin(logs.T), 0.2 * np.cos(logs.T), logs.T])
    turns = Rotation.from_euler("xyz", angles)
    values = {"quaternion_xyzw": turns.as_quat(), "quaternion_wxyz": turns.as_quat()[:, [3, 0, 1, 2]],
              "rpy": np.degrees(angles)}[manner]  # fmt: skip
    columns = logs.numbered("r{}", values)
    unit = ", unit: deg" if manner == "rpy" else ""
    text = f"""
time: {{from: t}}
columns: {{q.j: {{from: t, unit: rad}}}}
rotations: {{r: {{from: [{", ".join(columns)}], as: {manner}{unit}}}}}
resample: {{rate: 50}}
"""
    done = converted(tmp_path, text, log_of({"t": logs.T} | columns))
    t = done.recording.time
    expected = Rotation.from_euler("xyz", np.column_stack([0.3 * np.sin(t), 0.2 * np.cos(t), t])).as_matrix()
    assert np.abs(rotation_exp(np.array(done.recording.rotation)) - expected).max() < 1e-5


WRONG = """robot: ur5
time: {from: tt, unit: fortnight}
columns:
  q.elbow: {from: a, unit: deg}
  q.wrist_1_joint: {from: b, unit: mm}
  tau.elbow_joint: {from: a, unit: "%"}
  qd.elbow_joint: {from: a, unit: rad/s, sign: 2}
  w.fq: {from: a}
  qdd.elbow_joint: {from: nothing}
  p.tool1.x: {from: a, unit: m, scale: zero}
motors:
  - {names: [m1, m2], joints: [wrist_2_joint, wrist_3_joint], matrix: [[1, 1], [1, 1]]}
resample: {rate: 250, clock: table}
colour: red
"""


def test_everything_wrong_with_a_map_is_told_at_once_with_line_and_key(tmp_path, ur5):
    log = log_of({"t": logs.T, "a": Q[:, 0], "b": Q[:, 1]})
    with pytest.raises(RecordingFileError) as raised:
        converted(tmp_path, WRONG, log, ur5)
    text = str(raised.value)
    for part in (
        "map.yaml:2: time: the log has no column 'tt'",
        "map.yaml:2: time: unit: 'fortnight' is no unit of it; expected s, ms",
        "map.yaml:4: columns: q.elbow: the robot has no joint 'elbow'. Did you mean 'elbow_joint'",
        "map.yaml:5: columns: q.wrist_1_joint: unit: 'mm' is no unit of it; expected rad",
        "map.yaml:6: columns: tau.elbow_joint: a unit '%' needs a `scale`",
        "map.yaml:7: columns: qd.elbow_joint: sign: is the number 2; expected 1 or -1",
        "map.yaml:8: columns: w.fq: is no column of a recording. Did you mean 'w.f",
        "map.yaml:9: columns: qdd.elbow_joint: the log has no column 'nothing'",
        "map.yaml:10: columns: p.tool1.x: the robot has no frame 'tool1'. Did you mean 'tool0'",
        'map.yaml:10: columns: p.tool1.x: scale: is the text "zero"; expected a number',
        "map.yaml:12: motors: [0]: matrix: has no inverse",
        "map.yaml:13: resample: expected either `rate`",
        "map.yaml:14: colour: unknown key. ",
    ):
        assert part in text


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time: {from: t}\n", "columns: is missing or empty"),
        ("columns: {q.j: {from: a, unit: rad}}\n", "time: is missing"),
        ("time: {from: t}\ncolumns: {tau.j: {from: a, unit: N m}}\n", "has no position of any joint"),
        ("time: [\n", "is not valid YAML"),
        ("- 1\n", "holds a list"),
        ("a: &a [1, 1]\nb: [*a, *a]\n", r"map\.yaml:2: \*a is not read; write the value out"),
        ("a: &a [*a]\n", r"map\.yaml:1: \*a is not read"),
        ("time: " + "[" * 50_000, "map.yaml:1: nests its values too deep"),
        ("time: 2020-13-45\n", "holds a value that cannot be read: month must be in 1..12"),
        ("x" * 1_000_001, "holds 1000001 characters; no map has more than"),
        ("rotations: 5\ncolumns: {q.j: {from: a, unit: rad}}\n", "rotations: is the number 5; expected an object"),
        ("rotations: {r: {from: [t, t, t], as: [1]}}\n", r"as: is '\[1\]'; expected one of quaternion_xyzw"),
        ("motors: [{names: [m], joints: [j], matrix: [[.inf]]}]\n", "matrix: expected 1 rows of 1 numbers"),
        ("noise: {position_noise: -1, force: 2}\n", "map.yaml:1: noise: position_noise: is the number -1; expected"),
        ("time: {from: t}\nresample: {clok: table}\n", "map.yaml:2: resample: clok: unknown key. Did you mean 'clock'"),
        ("tolerances: {mas: 1}\n", "map.yaml:1: tolerances: mas: no tolerance has this name. Did you mean 'mass'"),
        ("noise: {position_nois: 1}\n", "noise: position_nois: unknown key. Did you mean 'position_noise'"),
        ("time: {from: t}\ncolumns: {q.j: {from: a, unit: rad}}\nresample: {rate: 1e300}\n",
         r"resample: rate: 1e\+300/s over 5\.996 s are more than 10000000 rows; give a lower rate"),
        ("time: {from: t}\ncolumns: {q.m1: {from: a, unit: rad}, q.j: {from: a, unit: rad}}\n"
         "motors: [{names: [m1, m2], joints: [j1, j2], matrix: [[1, 0], [1, 1]]}]\n", "lacks q.m2, which the motors"),
    ],
)  # fmt: skip
def test_a_map_that_is_none(tmp_path, text, message):
    with pytest.raises(RecordingFileError, match=message):
        converted(tmp_path, text, log_of({"t": logs.T, "a": Q[:, 0]}))


@pytest.mark.parametrize("line", ["scale: 1e300", "scale: 1e308, unit: rev/s", "offset: -1e12", "offset: -1e308"])
def test_numbers_of_no_bench_are_refused_with_their_column(tmp_path, line):
    text = f"time: {{from: t}}\ncolumns: {{q.j: {{from: a, unit: rad}}, qd.j: {{from: b, {line}}}}}\n"
    log = log_of({"t": logs.T, "a": Q[:, 0], "b": 1 + logs.T})
    message = r"qd\.j: becomes \S+ in row 1; expected at most 1e\+09\. Are unit, scale"
    with pytest.raises(RecordingFileError, match=message):
        converted(tmp_path, text, log)


def test_noise_of_the_map_is_the_recordings_own(tmp_path):
    text = "time: {from: t}\ncolumns: {q.j: {from: a, unit: rad}}\nnoise: {position_noise: 2e-5, effort_noise: 0.1}\n"
    done = converted(tmp_path, text, log_of({"t": logs.T, "a": Q[:, 0]}))
    assert done.recording.noise == Noise(position=2e-5, effort=0.1)
    write_recording(done.recording, tmp_path / "recording.csv")
    assert read_recording(tmp_path / "recording.csv").noise == done.recording.noise


@pytest.mark.parametrize("clock", ["", "resample: {rate: 100}\n"])
def test_rows_that_are_left_out_between_rests_are_told(tmp_path, clock):
    t = np.arange(0.0, 10.0, 0.01)
    a = np.interp(t, [0, 2, 3, 5, 6, 10], [0, 0, 1, 1, 0.5, 0.5])
    t[100] = np.nan  # a row without a time counts as one of the log
    text = f"time: {{from: t}}\ncolumns: {{q.j: {{from: a, unit: rad}}}}\nat_rest: true\n{clock}"
    done = converted(tmp_path, text, log_of({"t": t, "a": a}))
    (remark,) = (text for text in done.remarks if "joint moved" in text)
    spans = done.moving
    assert len(spans) == 2
    for (first, last), (begin, end) in zip(spans, [(1.85, 3.15), (4.85, 6.15)], strict=True):
        assert abs(t[first - 1] - begin) < 0.03
        assert abs(t[last - 1] - end) < 0.03
        assert f"rows {first} to {last} ({t[first - 1]:.4g} to {t[last - 1]:.4g} s)" in remark
    lost = sum(last - first + 1 for first, last in spans)
    assert remark.startswith(f"{lost} rows in which a joint moved were left out: rows ")
    assert remark.endswith("; 3 rests remain.")
    assert len(done.recording) + lost == (len(t) if clock else len(t) - 1)


def test_of_many_rests_the_first_spans_are_told(tmp_path):
    t = np.arange(0.0, 60.0, 0.02)
    a = np.floor(t / 2) + np.clip(t % 2 - 1, 0, 0.1) * 10
    text = "time: {from: t}\ncolumns: {q.j: {from: a, unit: rad}}\nat_rest: true\n"
    done = converted(tmp_path, text, log_of({"t": t, "a": a}))
    (remark,) = done.remarks
    assert remark.count("rows ") == 13
    assert f"{len(done.moving) - 12} more spans" in remark


def test_columns_of_several_clocks_need_one(tmp_path):
    log = Log("x.mcap", (Stream("a", frozen({"q": Q[:, 0]}), logs.T), Stream("b", frozen({"f": Q[:, 1]}), logs.T + 99)))
    text = "columns: {q.j: {from: q, unit: rad}, w.fx: {from: f, unit: N}}\n"
    with pytest.raises(RecordingFileError, match=r"the columns come on 2 clocks \(a, b\)"):
        converted(tmp_path, text, log)
    with pytest.raises(RecordingFileError, match="the streams do not overlap in time"):
        converted(tmp_path, text + "resample: {rate: 10}\n", log)


def test_a_unit_that_is_not_the_log_s_own_is_told(tmp_path):
    """Millimetres by name, which the map takes as metres: the robot would be 600 m away, and nobody said so first."""
    log = log_of({"t": logs.T, "a": Q[:, 2], "X [mm]": np.full(N, 300.0), "Y [mm]": np.full(N, 300.0)})
    text = """
time: {from: t, unit: s}
columns:
  q.elbow_joint: {from: a, unit: rad}
  p.x: {from: 'X [mm]', unit: UNIT}
  p.y: {from: 'Y [mm]', unit: mm}
"""
    told = converted(tmp_path, text.replace("UNIT", "m"), log).remarks
    assert told[0] == "p.x: the map takes 'X [mm]' in m, and the log says mm: right only if the log is wrong."
    assert not any("the log says" in text for text in converted(tmp_path, text.replace("UNIT", "mm"), log).remarks)
