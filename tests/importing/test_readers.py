"""What is in a log comes out of it, whatever wrote it: text, Parquet, MATLAB, MCAP and bags."""

from __future__ import annotations

import h5py
import numpy as np
import pyarrow
import pytest
import scipy.io
from pyarrow import parquet
from scipy.spatial.transform import Rotation

from prup_pin.errors import RecordingFileError
from prup_pin.imports import read_log

from . import logs

Q, QD, TAU = logs.motion()
TABLE = {"t": logs.T, **logs.numbered("q{}", Q)}


def only(log):
    (stream,) = log.streams
    return stream


@pytest.mark.parametrize(
    ("ending", "how"),
    [
        ("csv", {}),
        ("csv", {"separator": ";", "decimal": ","}),
        ("tsv", {"separator": "\t"}),
        ("txt", {"separator": " "}),
        ("csv", {"above": ["# a controller", "# of ours"]}),
        ("csv", {"separator": ";", "below": ["s;deg;deg;deg;deg;deg;deg"]}),
    ],
)
def test_tables_of_text(tmp_path, ending, how):
    stream = only(read_log(logs.csv(tmp_path / f"log.{ending}", TABLE, **how)))
    assert list(stream.columns) == list(TABLE)
    assert np.abs(stream.columns["q4"] - Q[:, 3]).max() < 1e-9
    assert stream.units == ({"t": "s"} | {f"q{k}": "deg" for k in range(1, 7)} if "below" in how else {})


def test_text_of_two_bytes_a_letter(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t;q1\n0;1,5\n1;2,5\n", encoding="utf-16")
    assert only(read_log(path)).columns["q1"].tolist() == [1.5, 2.5]


def test_names_that_stand_in_a_comment_and_cells_that_are_empty(tmp_path):
    path = tmp_path / "log.dat"
    path.write_text("% recorded on Monday\n% t, q1, note\n0, 1.5, a\n1, , b\n2, nan, c\n3, 2.5, d\n")
    log = read_log(path)
    assert np.array_equal(only(log).columns["q1"], [1.5, np.nan, np.nan, 2.5], equal_nan=True)
    assert log.left_out == ("note (text)",)


@pytest.mark.parametrize("decimal", [".", ","])
def test_a_column_of_text_does_not_keep_a_table_from_being_streamed(tmp_path, decimal, monkeypatch):
    from prup_pin.imports import text_table

    monkeypatch.setattr(text_table, "_HEAD", 20_000)
    monkeypatch.delattr(text_table._Strange, "read")
    table = TABLE | {"mode": ["run"] * len(Q)}
    log = read_log(logs.csv(tmp_path / "log.csv", table, separator=";", decimal=decimal))
    assert log.left_out == ("mode (text)",)
    assert np.abs(only(log).columns["q6"] - Q[:, 5]).max() < 1e-9


def test_a_log_of_many_rows_is_read_piece_by_piece_and_thinned(tmp_path, monkeypatch):
    from prup_pin.imports import text_table
    from prup_pin.recordings import table

    cells = [f"{k},{'' if k % 3 else k / 10},{'null' if k == 205 else k}" for k in range(400)]
    path = tmp_path / "log.csv"
    path.write_text("t;q1;q2\n".replace(";", ",") + "\n".join(cells) + "\n")
    whole = only(read_log(path)).columns
    monkeypatch.setattr(text_table, "_PIECE", 70)
    pieces = only(read_log(path)).columns
    assert all(np.array_equal(whole[name], pieces[name], equal_nan=True) for name in whole)
    assert np.isnan(whole["q2"][205])
    assert np.nansum(whole["q1"]) == pytest.approx(sum(range(0, 400, 3)) / 10)
    monkeypatch.setattr(table, "MOST_ROWS", 120)
    monkeypatch.setattr(table, "PIECES", 4)
    log = read_log(path)
    assert only(log).columns["t"].tolist() == [*range(30), *range(123, 153), *range(246, 276), *range(370, 400)]
    assert "400 rows are more than are needed" in log.remarks[0]
    cells[300] = "300,oops,1"
    path.write_text("t,q1,q2\n" + "\n".join(cells) + "\n")
    with pytest.raises(RecordingFileError, match=r"log\.csv:302: column 'q1': 'oops' is not a number"):
        read_log(path)


def test_cells_that_are_no_numbers_are_told_with_line_and_column(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t,q1\n0,1\n1,1.2x\n2,3\n3\n4,5\n")
    with pytest.raises(RecordingFileError) as raised:
        read_log(path)
    text = str(raised.value)
    assert "log.csv:3: column 'q1': '1.2x' is not a number" in text
    assert "log.csv:5: 1 cells; expected 2" in text


@pytest.mark.parametrize(
    ("name", "content", "text"),
    [
        ("log.xyz", b"1", "has the ending '.xyz'; expected one of .csv"),
        ("log.xlsx", b"PK", "Export the sheet as CSV"),
        ("log.mat", b"not a matlab file" * 20, "cannot be read as a MATLAB file"),
        ("log.parquet", b"PAR", "cannot be read as Parquet"),
        ("log.mcap", b"no mcap at all here", "cannot be read as MCAP"),
        ("log.bag", b"no bag at all", "cannot be read as a ROS bag"),
        ("log.db3", b"", "no metadata.yaml"),
        ("log.csv", b"", "is empty"),
        ("log.csv", b"t,q1\n", "no rows"),
        ("log.csv", b"t,q1\na,b\nc,d\n", "holds no columns of numbers"),
        ("log.csv", b"# nothing\n# else\n", "holds comments alone"),
    ],
)
def test_files_that_are_no_logs(tmp_path, name, content, text):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(RecordingFileError, match=text):
        read_log(tmp_path / name)


def test_a_file_that_is_not_there(tmp_path):
    logs.csv(tmp_path / "log.csv", TABLE)
    with pytest.raises(RecordingFileError, match=r"file not found. The folder holds: log.csv"):
        read_log(tmp_path / "lag.csv")


def test_parquet_with_lists_and_stamps(tmp_path):
    stamps = pyarrow.array((1.7e18 + logs.T * 1e9).astype("int64"), pyarrow.timestamp("ns"))
    table = pyarrow.table({"stamp": stamps, "q": list(Q), "tau1": TAU[:, 0], "state": ["ok"] * len(Q)})
    parquet.write_table(table, tmp_path / "log.parquet")
    log = read_log(tmp_path / "log.parquet")
    columns = only(log).columns
    assert np.abs(columns["stamp"] - logs.T).max() < 1e-6
    assert np.array_equal(columns["q[2]"], Q[:, 2])
    assert np.array_equal(columns["tau1"], TAU[:, 0])
    assert log.left_out == ("state (string)",)


@pytest.mark.parametrize("ending", ["npz", "mat"])
def test_stacks_of_matrices_are_poses_or_rotations(tmp_path, ending):
    turned = Rotation.from_rotvec(np.column_stack([0.3 + 0.1 * logs.T, 0.2 * logs.T, -0.1 * logs.T]))
    poses = np.tile(np.eye(4), (len(logs.T), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = turned.as_matrix(), Q[:, :3]
    poses[7, :3, :3] = np.nan
    arrays = {"q": Q, "camera": poses, "body": turned.as_matrix(), "gains": np.ones((len(logs.T), 4, 4))}
    if ending == "npz":
        np.savez(tmp_path / "log.npz", **arrays)
    else:  # a sample a page
        scipy.io.savemat(
            tmp_path / "log.mat", {n: v if v.ndim < 3 else np.moveaxis(v, 0, -1) for n, v in arrays.items()}
        )
    log = read_log(tmp_path / f"log.{ending}")
    columns = only(log).columns
    seen = np.delete(np.arange(len(logs.T)), 7)
    assert np.column_stack([columns[f"camera.{axis}"] for axis in "xyz"])[seen] == pytest.approx(Q[seen, :3])
    for name, rows in (("camera", seen), ("body", slice(None))):
        found = Rotation.from_quat(np.column_stack([columns[f"{name}.q{axis}"] for axis in "xyzw"])[rows])
        assert np.abs((found * turned[rows].inv()).magnitude()).max() < 1e-9
    assert np.isnan([columns[name][7] for name in columns if name.startswith("camera")]).all()
    assert [name.partition(" ")[0] for name in log.left_out] == ["gains"]


def test_matlab_structures(tmp_path):
    data = {"t": logs.T, "q": Q, "tau": TAU.T, "name": "ur5"}
    scipy.io.savemat(tmp_path / "log.mat", {"data": data, "fs": 250.0})
    log = read_log(tmp_path / "log.mat")
    columns = only(log).columns
    assert np.array_equal(columns["data.t"], logs.T)
    assert np.array_equal(columns["data.q[3]"], Q[:, 2])
    assert np.array_equal(columns["data.tau[6]"], TAU[:, 5])


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("kind", ["i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "f8", "?"])
def test_matlab_numbers_of_every_kind(tmp_path, kind, compressed):
    values = (np.arange(12) % 7).astype(kind).reshape(4, 3)
    data = {"a": values, "nested": {"inner": {"row": values[:, 0]}}, "one": 2.5, "words": ["a", "b"], "z": values * 1j}
    scipy.io.savemat(tmp_path / "log.mat", data, do_compression=compressed)
    log = read_log(tmp_path / "log.mat")
    columns = {name: stream.columns[name] for stream in log.streams for name in stream.columns}
    assert set(columns) == {"a[1]", "a[2]", "a[3]", "nested.inner.row"}
    assert np.array_equal(np.column_stack([columns[f"a[{k}]"] for k in (1, 2, 3)]), values)
    assert np.array_equal(columns["nested.inner.row"], values[:, 0])
    assert [name.partition(" ")[0] for name in log.left_out] == ["words", "z"]


def test_matlab_of_version_4(tmp_path):
    scipy.io.savemat(tmp_path / "log.mat", {"t": logs.T, "q": Q}, format="4")
    assert np.array_equal(only(read_log(tmp_path / "log.mat")).columns["q[3]"], Q[:, 2])


def test_matlab_of_version_7_3(tmp_path):
    with h5py.File(tmp_path / "log.mat", "w", userblock_size=512) as file:
        group = file.create_group("data")
        for name, values in (("t", logs.T[:, None]), ("q", Q)):
            group.create_dataset(name, data=values.T).attrs["MATLAB_class"] = np.bytes_("double")
        label = group.create_dataset("name", data=np.array([[117], [114]], np.uint16))
        label.attrs["MATLAB_class"] = np.bytes_("char")
    with (tmp_path / "log.mat").open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    log = read_log(tmp_path / "log.mat")
    columns = only(log).columns
    assert np.array_equal(columns["data.t"], logs.T)
    assert np.array_equal(columns["data.q[3]"], Q[:, 2])
    assert len(columns) == 7


def test_matlab_streams_of_several_lengths(tmp_path):
    slow = logs.T[::5]
    scipy.io.savemat(tmp_path / "log.mat", {"arm": {"time": logs.T, "q": Q}, "ft": {"time": slow, "fz": 3 * slow}})
    arm, ft = read_log(tmp_path / "log.mat").streams
    assert (arm.name, len(arm), ft.name, len(ft)) == ("arm", len(logs.T), "ft", len(slow))
    assert np.array_equal(ft.columns["ft.fz"], 3 * slow)


@pytest.mark.parametrize("storage", ["sqlite3", "mcap"])
def test_a_ros_2_bag_tells_joints_by_their_names_and_stamps_by_their_headers(tmp_path, storage):
    log = read_log(logs.ros2_bag(tmp_path / "bag", logs.T, Q, QD, TAU, storage))
    by_name = {stream.name: stream for stream in log.streams}
    states, forces = by_name["/joint_states"], by_name["/ft"]
    assert np.abs(states.clock - logs.T).max() < 1e-8
    assert np.abs(forces.clock - logs.T[::5] - 0.003).max() < 1e-8
    for k, joint in enumerate(logs.JOINTS):
        assert np.array_equal(states.columns[f"/joint_states.position.{joint}"], Q[:, k])
        assert np.array_equal(states.columns[f"/joint_states.effort.{joint}"], TAU[:, k])
    assert len(states.columns) == 18
    assert forces.columns["/ft.wrench.force.z"][1] == 8.0
    assert "/log (no numbers)" in log.left_out


@pytest.mark.parametrize("encoding", ["ros2msg", "json"])
def test_an_mcap_file(tmp_path, encoding):
    log = read_log(logs.mcap_file(tmp_path / "log.mcap", logs.T, Q, QD, TAU, encoding))
    states = only(log)
    assert np.abs(states.clock - logs.T).max() < 1e-8
    assert np.array_equal(states.columns["/joint_states.velocity.elbow_joint"], QD[:, 2])
    assert log.left_out == ("/camera (protobuf)",)


def test_a_reader_that_is_not_installed_says_what_to_install(tmp_path, monkeypatch):
    from prup_pin.errors import MissingExtraError

    logs.mcap_file(tmp_path / "log.mcap", logs.T[:5], Q, QD, TAU)
    monkeypatch.setitem(__import__("sys").modules, "mcap.stream_reader", None)
    with pytest.raises(MissingExtraError, match=r"pip install mcap.*extra 'bags'"):
        read_log(tmp_path / "log.mcap")


@pytest.mark.parametrize(
    ("encoding", "name"),
    [
        ("cp932", "第1軸角度[deg]"),
        ("utf-16", "第1軸角度[deg]"),
        ("latin-1", "Größe är [°]"),
        ("cp1252", "Weg – äußerer [mm]"),
        ("cp1252", "Größe [mm]"),
        ("gbk", "关节1角度(deg)"),
    ],
)
def test_headings_of_other_encodings_are_read(tmp_path, encoding, name):
    path = tmp_path / "log.csv"
    path.write_bytes(f"t;{name}\n0;1,5\n1;2,5\n2;3,5\n".encode(encoding))
    columns = read_log(path).streams[0].columns
    assert list(columns)[1] == name
    assert columns[name].tolist() == [1.5, 2.5, 3.5]
