"""`prup-pin import`, as a user meets it: a map is guessed, corrected, and a recording made by it."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import prup_pin
from prup_pin.recordings import read_recording

from .importing import logs

Q, QD, TAU = logs.motion()
RECORDED = {"t_ms": 1e3 * logs.T, **logs.numbered("q{}_deg", np.degrees(Q)), **logs.numbered("i{}_current", TAU / 5)}


def test_a_map_is_guessed_corrected_and_carried_out(run):
    logs.csv(Path("run.csv"), RECORDED | {"note": ["x"] * len(Q)})
    first = run("import", "run.csv", "--robot", "ur5")
    assert first.exit_code == 0, first.output
    assert "6 lines must be looked at" in first.output
    assert "run.map.yaml" in first.output
    text = Path("run.map.yaml").read_text()
    assert text.count("CHECK") == 7
    assert "q.elbow_joint: {from: q3_deg, unit: deg}" in text
    assert "#   note (text)" in text
    lines = [line.replace("unit: A}", "unit: A, scale: 5}") for line in text.splitlines()]
    Path("run.map.yaml").write_text("\n".join(lines))
    asked = run("import", "run.csv", "--map", "run.map.yaml", "--out", "bench.csv")
    assert asked.exit_code == 2  # the word still stands there
    Path("run.map.yaml").write_text("\n".join(line.partition("  # CHECK")[0] for line in lines))
    second = run("import", "run.csv", "--map", "run.map.yaml", "--out", "bench.csv")
    assert second.exit_code == 0, second.output
    recording = read_recording("bench.csv")
    assert recording.robot == "ur5"
    assert list(recording.positions) == list(recording.efforts) == list(logs.JOINTS)
    assert np.abs(recording.positions["elbow_joint"] - Q[:, 2]).max() < 1e-8
    assert np.abs(recording.efforts["elbow_joint"] - TAU[:, 2]).max() < 1e-6
    assert np.abs(recording.time - logs.T).max() < 1e-9
    flat = " ".join(second.output.split())
    assert "1500 rows, 5.996 s, 250 rows a second" in flat
    assert "tau.elbow_joint i3_current A x 5" in flat
    assert "Not used note (text)" in flat


def test_where_nothing_is_doubtful_one_command_does(run):
    columns = {"time": logs.T, **logs.numbered("actual_q_{}", Q, 0), **logs.numbered("actual_torque_{}", TAU, 0)}
    logs.csv(Path("run.csv"), columns)
    done = run("import", "run.csv", "--robot", "ur5", "--map", "m.yaml", "--out", "bench.csv")
    assert done.exit_code == 0, done.output
    assert "The map was guessed" in done.output
    assert Path("m.yaml").exists()
    assert np.abs(read_recording("bench.csv").efforts["wrist_3_joint"] - TAU[:, 5]).max() < 1e-6


def test_where_something_is_doubtful_no_recording_is_made_of_it(run):
    logs.csv(Path("run.csv"), RECORDED)
    done = run("import", "run.csv", "--robot", "ur5", "--map", "m.yaml", "--out", "bench.csv")
    assert done.exit_code == 2
    assert "the map 'm.yaml' was guessed and written. 6 lines in it must be looked at" in " ".join(done.stderr.split())
    assert "tau.shoulder_pan_joint: in A: write how much SI one A is" in " ".join(done.stderr.split())
    assert "(and so on to line " in " ".join(done.stderr.split())
    guessed = Path("m.yaml").read_text()
    for _ in range(2):  # nothing was answered, so the same is asked
        again = run("import", "run.csv", "--robot", "ur5", "--map", "m.yaml", "--out", "bench.csv")
        assert again.exit_code == 2
        asked = [" ".join(text.split()).partition("must be")[2] for text in (done.stderr, again.stderr)]
        assert asked[0] == asked[1]
    assert Path("m.yaml").read_text() == guessed
    assert not Path("bench.csv").exists()


def test_a_column_called_like_the_word_of_a_doubt_asks_nothing(run):
    odd = {f"q{k} # CHECK: no [deg]": np.degrees(Q[:, k]) for k in range(6)}
    logs.csv(Path("run.csv"), {"t": logs.T} | odd)
    done = run("import", "run.csv", "--robot", "ur5", "--map", "m.yaml", "--out", "bench.csv")
    assert done.exit_code == 0, done.output


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("nothing.csv",), "file not found. The folder holds: run.csv"),
        (("run.csv", "--map", "m.txt"), "has the ending '.txt'; expected .yaml"),
        (("run.csv", "--out", "run.csv"), "is the log itself"),
        (("run.csv", "--out", "run.parquet"), "has the ending '.parquet'; expected .csv"),
        (("run.csv", "--out", "nowhere/run.csv"), "there is no folder 'nowhere'"),
        (("run.csv", "--robot", "ur55"), "no robot named 'ur55'"),
        (("run.csv", "--map", "there.yaml"), "give --out RECORDING.csv"),
        (("run.csv", "--map", "wrong.yaml", "--out", "b.csv"), "wrong.yaml:1: columns: q.j: the log has no column 'x'"),
    ],
)
def test_what_cannot_be_done_is_said_before_anything_is_written(run, arguments, text):
    logs.csv(Path("run.csv"), RECORDED)
    Path("there.yaml").write_text("time: {from: t_ms, unit: ms}\ncolumns: {q.j: {from: q1_deg, unit: deg}}\n")
    Path("wrong.yaml").write_text("columns: {q.j: {from: x, unit: deg}}\ntime: {from: t_ms, unit: ms}\n")
    before = set(Path().iterdir())
    done = run("import", *arguments)
    assert done.exit_code == 2, done.output
    assert text in " ".join(done.stderr.split())
    assert set(Path().iterdir()) == before


def test_three_angles_beside_a_place_are_offered_as_what_turns_the_tool(run):
    """Which one turns about which axis no heading says: A is KUKA's turn about z, and a machine tool's about x."""
    robot = prup_pin.load("ur5")
    turns = [robot.pose(**dict(zip(logs.JOINTS, q, strict=True))).base_from_tool[:3, :3] for q in Q[::300]]
    angles = Rotation.from_matrix(turns).as_euler("xyz", degrees=True)
    table = dict(zip(logs.JOINTS, Q[::300].T, strict=True)) | {f"{axis} [mm]": np.arange(5.0) for axis in "XYZ"}
    logs.csv(Path("run.csv"), table | {f"{name} [deg]": angles[:, k] for k, name in enumerate("ABC")})
    run("import", "run.csv", "--robot", "ur5", "--map", "a.yaml")
    text = Path("a.yaml").read_text()
    offered = "# rotations: {r: {from: ['A [deg]', 'B [deg]', 'C [deg]'], as: euler_ZYX, unit: deg}}"
    assert offered in text
    text = text.replace(offered, offered[2:].replace("euler_ZYX", "euler_xyz"))
    Path("a.yaml").write_text("\n".join(line.partition("  # CHECK")[0] for line in text.splitlines()))
    done = run("import", "run.csv", "--map", "a.yaml", "--out", "bench.csv")
    assert done.exit_code == 0, done.output
    found = Rotation.from_rotvec(read_recording("bench.csv").rotation.copy())
    assert "r from A [deg], B [deg], C [deg] in deg, as euler_xyz." in " ".join(done.output.split())
    assert (found.inv() * Rotation.from_matrix(turns)).magnitude().max() < 1e-7


def test_a_map_of_another_robot_is_told_whose_it_is(run):
    logs.csv(Path("run.csv"), {"time": logs.T, **logs.numbered("actual_q_{}", Q, 0)})
    assert run("import", "run.csv", "--robot", "ur5").exit_code == 0
    for more in ((), ("--out", "bench.csv")):
        done = run("import", "run.csv", "--robot", "3prup", *more)
        assert done.exit_code == 2
        said = " ".join(done.stderr.split())
        assert "'run.map.yaml' was made for ur5, --robot says 3prup: delete it, or give another one with --map" in said
        assert "has no joint" not in said
    assert run("import", "run.csv", "--robot", "ur5_limited", "--out", "bench.csv").exit_code == 0  # of the same joints
