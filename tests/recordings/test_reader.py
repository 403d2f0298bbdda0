"""Reading recordings: what is tolerated, and what is refused with file, line and column."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from prup_pin.errors import RecordingFileError
from prup_pin.recordings import KeyProblem, Noise, TableProblem, read_recording, suspicions, table, write_recording

from ..elsewhere import EMPS, PRACTICE, needs_emps, needs_practice

HEADER = "time,q.slide,q.turn,tau.slide,w.fx,w.mz,p.x,p.y,p.z,r.x,r.y,r.z"
ROWS = (
    "0,0.1,0.5,12,0,0,0.01,0.02,0.3,0.001,0.002,0.003",
    "1,0.1,0.5,13,5,0.1,0.011,0.02,0.3,0.001,0.002,0.0031",
    "2,0.2,0.5,12,10,0.2,0.012,0.02,0.3,0.001,0.0021,0.003",
)
TABLE = "\n".join((HEADER, *ROWS)) + "\n"


@pytest.fixture
def write(tmp_path):
    """Return a function that writes a table (text or bytes) and, if given, the JSON beside it."""

    def write_files(table=TABLE, beside=None, name="bench.csv"):
        path = tmp_path / name
        path.write_bytes(table if isinstance(table, bytes) else table.encode())
        if beside is not None:
            path.with_suffix(".json").write_text(beside if isinstance(beside, str) else json.dumps(beside))
        return path

    return write_files


def refused(path):
    """Return the problems of a file as (line, column or key, message)."""
    with pytest.raises(RecordingFileError) as caught:
        read_recording(path)
    for problem in caught.value.problems:
        assert problem.file
        assert str(problem) in str(caught.value)
    return [
        (problem.line, getattr(problem, "column", getattr(problem, "key", None)), problem.message)
        for problem in caught.value.problems
    ]


def only(path):
    """Return the one problem of a file."""
    problems = refused(path)
    assert len(problems) == 1, problems
    return problems[0]


def with_cell(row, column, text):
    """Return the table with another text in one cell; rows count from 0."""
    lines = TABLE.splitlines()
    cells = lines[row + 1].split(",")
    cells[HEADER.split(",").index(column)] = text
    lines[row + 1] = ",".join(cells)
    return "\n".join(lines) + "\n"


def test_values(write):
    beside = {"robot": "3prup", "position_noise": 2e-6, "effort_noise": 1, "notes": "cold morning"}
    recording = read_recording(write(beside=beside))
    assert len(recording) == 3
    assert recording.time.tolist() == [0, 1, 2]
    assert {name: values.tolist() for name, values in recording.positions.items()} == {
        "slide": [0.1, 0.1, 0.2],
        "turn": [0.5] * 3,
    }
    assert recording.efforts["slide"].tolist() == [12, 13, 12]
    assert recording.wrench.tolist() == [[0] * 6, [5, 0, 0, 0, 0, 0.1], [10, 0, 0, 0, 0, 0.2]]
    assert recording.wrench_columns == ("fx", "mz")
    assert recording.has_wrench
    assert recording.position[1].tolist() == [0.011, 0.02, 0.3]
    assert recording.rotation[1].tolist() == [0.001, 0.002, 0.0031]
    assert recording.temperature is None
    assert recording.run.tolist() == [0, 0, 0]
    assert recording.run_names == ("",)
    assert recording.noise == Noise(position=2e-6, effort=1)
    assert (recording.robot, recording.notes) == ("3prup", "cold morning")
    remarks = "\n".join(recording.remarks)
    assert "There is no column w.fy, w.fz, w.mx, w.my: these components of the wrench are taken as zero." in remarks
    assert "tau.turn" in remarks
    assert "temperature" in remarks
    assert "rotation_noise, force_noise, moment_noise are not declared" in remarks


def test_a_log_of_efforts_alone_is_not_told_what_a_bench_would_have_measured(write):
    log = read_recording(write("time,q.slide,tau.slide\n0,0.1,3\n1,0.2,4\n"))
    assert not [remark for remark in log.remarks if "There is no column" in remark]
    bench = read_recording(write("time,q.slide,tau.slide,p.x,p.y,p.z\n0,0.1,3,0,0,0\n1,0.2,4,0,0,0\n"))
    assert [remark for remark in bench.remarks if "There is no column w.fx" in remark]


def test_other_columns(write):
    table = (
        "time,q.leg/a.b,qd.leg/a.b,qdd.leg/a.b,p.tip.x,p.tip.z,r.z,temperature,run\n"
        '0,1,2,3,4,5,6,7,cold\n1,1,2,3,4,5,6,7,"warm, later"\n2,1,2,3,4,5,6,7,cold\n'
    )
    recording = read_recording(write(table))
    assert list(recording.positions) == list(recording.velocities) == list(recording.accelerations) == ["leg/a.b"]
    np.testing.assert_array_equal(recording.markers["tip"], [[4, np.nan, 5]] * 3)
    np.testing.assert_array_equal(recording.rotation, [[np.nan, np.nan, 6]] * 3)
    assert recording.position is None
    assert recording.temperature.tolist() == [7] * 3
    assert not recording.has_wrench
    assert recording.wrench.shape == (3, 6)
    assert recording.run.tolist() == [0, 1, 0]
    assert recording.run_names == ("cold", "warm, later")
    remarks = "\n".join(recording.remarks)
    for part in ("p.tip.y: this part", "p.x, p.y, p.z: the position", "r.x, r.y", "wrench is taken as zero", "tau."):
        assert part in remarks, part


@pytest.mark.parametrize(
    "change",
    [
        lambda text: "\ufeff" + text,
        lambda text: text.replace("\n", "\r\n"),
        lambda text: text.replace("\n", "\r"),
        lambda text: text + "\n\n  \n\r\n",
        lambda text: text.rstrip("\n"),
        lambda text: "\n".join(",".join(f'"{cell}"' for cell in line.split(",")) for line in text.split("\n")[:-1]),
        lambda text: text.replace(",", ", "),
        lambda text: text.replace(",13,", ",1.3e+1,").replace(",12,", ",+12.0,"),
    ],
    ids=["bom", "crlf", "cr", "blank lines at the end", "no last line end", "quoted", "spaces", "number formats"],
)
def test_tolerated(write, change):
    plain, other = read_recording(write()), read_recording(write(change(TABLE)))
    np.testing.assert_array_equal(plain.time, other.time)
    np.testing.assert_array_equal(plain.efforts["slide"], other.efforts["slide"])
    np.testing.assert_array_equal(plain.rotation, other.rotation)
    assert plain.remarks == other.remarks


@pytest.mark.parametrize("empty", ["", "nan", "NaN", " ", '""'])
@pytest.mark.parametrize("column", ["q.turn", "tau.slide", "p.x", "r.z", "w.fx"])
def test_empty_cells(write, empty, column):
    recording = read_recording(write(with_cell(1, column, empty)))
    values = {
        "q.turn": recording.positions["turn"],
        "tau.slide": recording.efforts["slide"],
        "p.x": recording.position[:, 0],
        "r.z": recording.rotation[:, 2],
        "w.fx": recording.wrench[:, 0],
    }
    for name, array in values.items():
        assert np.isnan(array).tolist() == [False, name == column, False]


def test_neighbouring_empty_cells(write):
    table = "time,q.a,p.x,p.y,p.z,run,note\n0,1,,,,,\n1,,,,2,b,\n2,1,2,3,,,ok\n"
    recording = read_recording(write(table))
    np.testing.assert_array_equal(recording.position, [[np.nan] * 3, [np.nan, np.nan, 2], [2, 3, np.nan]])
    np.testing.assert_array_equal(recording.positions["a"], [1, np.nan, 1])
    assert [recording.run_names[code] for code in recording.run] == ["", "b", ""]


def test_blank_line_within_is_skipped_and_told(write):
    table = "\n".join((HEADER, ROWS[0], "", ROWS[1], ROWS[2])) + "\n"
    recording = read_recording(write(table))
    assert len(recording) == 3
    assert "1 blank lines within the table are skipped, the first is line 3." in recording.remarks
    line, column, _ = only(write(table.replace(",13,", ",13x,")))
    assert (line, column) == (4, "tau.slide")  # as the editor counts


def test_unknown_columns_are_ignored_and_told(write):
    table = TABLE.replace("tau.slide", "motor current").replace(",12,", ",high,").replace("w.mz", "w.mzz")
    recording = read_recording(write(table))
    assert not recording.efforts
    assert "The unknown column 'motor current' is ignored." in recording.remarks
    assert "The unknown column 'w.mzz' is ignored. Did you mean 'w.mz'" in "\n".join(recording.remarks)
    (misspelt,) = recording.misspelt
    assert "'w.mzz'" in misspelt


def test_a_misspelt_key_is_told_with_the_one_that_was_meant(write):
    recording = read_recording(write(beside={"postition_noise": 1e-5, "weather": "fine"}))
    (misspelt,) = recording.misspelt
    assert misspelt.endswith("the unknown key 'postition_noise' is ignored. Did you mean 'position_noise'?")
    assert misspelt in recording.remarks
    assert any("the unknown key 'weather' is ignored" in text for text in recording.remarks)


def test_a_misspelt_key_is_told_with_what_else_is_wrong(write):
    first, second = refused(write(beside={"force_nois": "a", "position_noise": 0, "weather": "fine"}))
    assert "position_noise" in str(first[2]) or "above 0" in first[2]
    assert second[2] == "unknown key. Did you mean 'force_noise'?"


@pytest.mark.parametrize("name", ["torque.slide", "Effort.slide [N]"])
def test_a_joints_column_in_a_programs_words_is_told_its_own_name(write, name):
    recording = read_recording(write(TABLE.replace("tau.slide", name)))
    assert not recording.efforts
    assert f"The unknown column '{name}' is ignored. Did you mean 'tau.slide'?" in recording.remarks


@pytest.mark.parametrize(
    ("column", "text", "message"),
    [
        ("w.fx", "abc", "'abc' is not a number; expected digits"),
        ("time", "12:30:01", "'12:30:01' is not a number"),
        ("q.slide", "inf", "'inf' is infinite"),
        ("q.slide", "-Infinity", "'-Infinity' is infinite"),
        ("q.slide", "1e400", "'1e400' is too large"),
        ("p.y", "N/A", "leave the cell empty"),
        ("p.y", "#DIV/0!", "leave the cell empty"),
        ("r.x", "1_000", "'1_000' is not a number"),
        ("r.x", "１２", "'１２' is not a number"),
        ("r.x", "0x1p3", "not a number"),
        ("r.x", '"0,5"', "'0,5' has a decimal comma; export the table with decimal points"),
        ("time", "", "is empty; every sample needs its time"),
        ("time", "nan", "is empty"),
        ("time", "0", "0 s after 0 s (line 2): time must increase"),
        ("time", "-3", "-3 s after 0 s (line 2): time must increase"),
        ("tau.slide", "x" * 500, "x…' is not a number"),
        ("tau.slide", "a\x1bb", r"'a\x1bb' is not a number"),
    ],
)
def test_bad_cells(write, column, text, message):
    line, where, found = only(write(with_cell(1, column, text)))
    assert (line, where) == (3, column)
    assert message in found
    assert len(found) < 200


def test_all_problems_at_once(write):
    lines = with_cell(0, "w.fx", "abc").splitlines()
    lines[2] += ",7"
    lines[3] = lines[3].replace("0.0021", "?")
    lines[0] = lines[0].replace("w.mz", "w.MZ")
    problems = refused(write("\n".join(lines), beside={"force_noise": 0, "robot": 3}))
    assert [(line, column) for line, column, _ in problems] == [
        (1, "w.MZ"),
        (2, "w.fx"),
        (3, None),
        (4, "r.y"),
        (None, "force_noise"),
        (None, "robot"),
    ]


def test_ragged_rows(write):
    lines = TABLE.splitlines()
    lines[1] = lines[1].rsplit(",", 2)[0]
    lines[3] += ",8,9"
    few, many = refused(write("\n".join(lines)))
    assert few[:2] == (2, "r.y")
    assert "10 cells, 12 expected" in few[2]
    assert many[:2] == (4, None)
    assert "14 cells, 12 expected; the first one too many is '8'" in many[2]


def test_ragged_rows_that_cancel_out(write):
    lines = TABLE.splitlines()
    lines[1] += ",1"
    lines[2] = lines[2].rsplit(",", 1)[0]
    assert [problem[0] for problem in refused(write("\n".join(lines)))] == [2, 3]


def test_unquoted_decimal_commas(write):
    table = "time,q.a,q.b\n0,0,5,0,25\n1,0,5,0,25\n"
    problems = refused(write(table))
    assert [problem[0] for problem in problems] == [2, 3]
    assert "decimal commas" in problems[0][2]


def advice(path):
    """Return what the error about a table advises to type."""
    with pytest.raises(RecordingFileError) as caught:
        read_recording(path)
    assert str(caught.value).endswith(caught.value.advice)
    return caught.value.advice


@pytest.mark.parametrize("encoding", ["cp932", "cp1252", "utf-16", "utf-8"])
def test_a_log_of_another_program_is_told_how_it_becomes_a_recording(write, encoding):
    heading = "時刻,第1軸角度" if encoding != "cp1252" else "Zeit [s],Winkel [°]"
    told = advice(write(f"{heading}\n0,1\n1,2\n".encode(encoding)))
    assert told.startswith("Is it a log of another program? This makes a recording of it:\n  prup-pin import ")
    assert told.endswith(" --robot ROBOT")
    assert advice(write("0,1\n1,2\n")) == told
    assert advice(write("# of Monday\ntime,q.a\n0,1\n")) == told


def test_a_recording_with_a_mistake_in_it_is_not_taken_for_a_log(write):
    assert advice(write("time,q.a\n0,1\n0,x\n")) == ""
    assert advice(write("Time,q.a,p.x\n0,1,1\n")) == ""


@pytest.mark.parametrize(("separator", "word"), [(";", "semicolons"), ("\t", "tabs"), ("|", "vertical bars")])
def test_other_separators(write, separator, word):
    line, _, message = only(write(TABLE.replace(",", separator)))
    assert line == 1
    assert f"separated by {word}; export the table again with commas" in message
    assert "decimal" not in message
    assert "--robot ROBOT" in advice(write(TABLE.replace(",", separator)))
    commas = TABLE.replace(",", separator).replace(".", ",").replace("q,", "q.")
    assert "decimal points instead of decimal commas" in only(write(commas))[2]


@pytest.mark.parametrize(
    ("name", "wanted"),
    [
        ("w.fx [N]", "w.fx"),
        ("W.FX", "w.fx"),
        ("w_fx", "w.fx"),
        ("F_x", "w.fx"),
        ("Force x [N]", "w.fx"),
        ("Time", "time"),
        ("time [s]", "time"),
        ("time (s)", "time"),
        ("Q.slide", "q.slide"),
        ("q.slide [m]", "q.slide"),
        ("P.X", "p.x"),
        ("Tau.slide", "tau.slide"),
        ("p.tip.X", "p.tip.x"),
        ("Temperature", "temperature"),
        ("RUN", "run"),
    ],
)
def test_nearly_right_headers(write, name, wanted):
    header = HEADER.replace(wanted, name) if f",{wanted}," in f",{HEADER}," else HEADER.replace("w.mz", name)
    line, column, message = only(write("\n".join((header, *ROWS))))
    assert (line, column) == (1, name)
    assert f"Did you mean '{wanted}'?" in message


def test_a_remark_above_the_header(write):
    line, _, message = only(write("# Monday\n" + TABLE))
    assert line == 1
    assert "is a remark ('#'); expected the header" in message


def test_columns_like_nothing_known_are_told_together(write):
    table = "\n".join(f"{line},0,0" if at else f"{line},lamp,door" for at, line in enumerate(TABLE.splitlines()))
    assert "The unknown columns 'lamp', 'door' are ignored." in read_recording(write(table)).remarks


def test_a_quaternion_is_told_as_one(write):
    """Its vector part is no rotation vector: nobody is to be led to rename r.qx to r.x."""
    names = "r.qw,r.qx,r.qy,r.qz"
    table = "\n".join(f"{line},1,0,0,0" if at else f"{line},{names}" for at, line in enumerate(TABLE.splitlines()))
    recording = read_recording(write(table))
    (said,) = (remark for remark in recording.remarks if "r.qw" in remark)
    assert "'r.qw', 'r.qx', 'r.qy', 'r.qz' are ignored: they seem to be a quaternion" in said
    assert said in recording.misspelt
    assert not any("Did you mean" in remark for remark in recording.remarks)


def test_a_second_column_of_the_same_meaning_is_ignored(write):
    recording = read_recording(write(TABLE.replace("w.mz", "w.fx [raw]")))
    assert "The unknown column 'w.fx [raw]' is ignored." in "\n".join(recording.remarks)


@pytest.mark.parametrize(
    ("old", "new", "column", "message"),
    [
        ("w.mz", "w.fx", "w.fx", "stands twice in the header (column 5 and column 6)"),
        ("w.mz", "", "", "the name of column 6 of 12 is empty"),
        ("time", "stamp", "time", "is missing: the seconds at which each row was measured. Number poses"),
        ("q.", "x.", "q.<joint>", "no column q.<joint>"),
        ("q.", "q_", "q.<joint>", "Is it column 'q_slide'?"),
    ],
)
def test_bad_headers(write, old, new, column, message):
    line, where, found = only(write("\n".join((HEADER.replace(old, new), *ROWS))))
    assert (line, where) == (1, column)
    assert message in found


def test_no_header(write):
    line, _, message = only(write("\n".join(ROWS)))
    assert line == 1
    assert "the first row holds numbers; expected the header" in message


def test_blank_first_row(write):
    assert "the first row is blank" in only(write("\n" + TABLE))[2]


def test_row_of_units(write):
    units = "s,m,rad,N,N,Nm,m,m,m,rad,rad,rad"
    line, _, message = only(write("\n".join((HEADER, units, *ROWS))))
    assert line == 2
    assert "is a row of words, such as units" in message


@pytest.mark.parametrize("text", ["", "\n\n \n", "\ufeff"])
def test_empty_file(write, text):
    assert only(write(text))[2].startswith("is empty; expected a table")


@pytest.mark.parametrize("end", ["", "\n", "\n\n\n"])
def test_header_only(write, end):
    line, _, message = only(write(HEADER + end))
    assert line == 1
    assert "holds a header but no rows" in message


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"PK\x03\x04" + bytes(range(200)), "is a spreadsheet or an archive"),
        (TABLE.encode("utf-16"), "is UTF-16 text; save it as UTF-8"),
        (bytes(range(256)) * 4 + bytes(1000), "is not text"),
        (np.random.default_rng(1).bytes(5000), "is not text"),
        (b"time," + np.random.default_rng(2).bytes(5000), "is not text"),
        (b'{"robot": "3prup"}', "looks like JSON"),
        (b"<robot name='a'/>", "looks like XML"),
    ],
)
def test_not_a_table(write, content, message):
    assert message in only(write(content))[2]


def test_other_encoding(write):
    content = TABLE.replace(",13,", ",13°,").replace("0.0021", "5µ").encode("latin-1")
    first, second = refused(write(content))
    assert first[:2] == (3, "tau.slide")
    assert second[:2] == (4, "r.y")
    assert "is not UTF-8 text (byte 0xb0)" in first[2]


def test_zero_bytes(write):
    content = TABLE.encode().replace(b",13,", b",1\0,") + bytes(50)
    first, second = refused(write(content))
    assert first[:2] == (3, "tau.slide")
    assert second[0] == 5
    assert "NUL" in first[2]


def test_open_quotation_mark(write):
    (line, _, message) = only(write(with_cell(1, "q.turn", '"0.5')))
    assert line == 3
    assert "quotation mark" in message


def test_time_may_restart_in_a_new_run(write):
    table = "time,q.a,run\n0,1,a\n1,1,a\n0,1,b\n1,1,b\n"
    assert read_recording(write(table)).time.tolist() == [0, 1, 0, 1]
    line, column, message = only(write(table + "2,1,a\n1.5,1,b\n1.5,1,b\n"))
    assert (line, column) == (8, "time")
    assert "1.5 s after 1.5 s (line 7): time must increase within a run" in message
    line, column, message = only(write("time,q.a\n0,1\n1,1\n0,1\n1,1\n"))
    assert (line, column) == (4, "time")
    assert "another label in a column 'run'" in message


def test_a_clock_rounded_too_coarsely_is_one_problem_with_its_remedy(write):
    def table(times):
        return write("time,q.a\n" + "".join(f"{time:.15g},{k / 7:.5f}\n" for k, time in enumerate(times)))

    rounded = np.arange(1000) // 5 / 100
    line, column, message = only(table(rounded))
    assert (line, column) == (3, "time")
    assert "800 of 1000 rows have the time of the row before: the clock is rounded to 0.01 s" in message
    assert "about 500 rows a second" in message
    assert "'rate: 500'" in message
    # a clock of no grid, and one that also goes back, are told line by line
    uneven = np.maximum.accumulate(np.where(np.arange(1000) % 4, 0.0, np.arange(1000) ** 1.1))
    for times in (uneven, np.concatenate((rounded, rounded))):
        assert all("must increase" in problem[2] for problem in refused(table(times))[:-1])


def test_long_lists_are_cut(write):
    table = "time,q.a,q.b\n" + "".join(f"{k},x,1.0\n" for k in range(500)) + "501,1,y\n"
    problems = refused(write(table))
    assert (502, "q.b") in [problem[:2] for problem in problems]  # a bad column does not hide the others
    assert problems[-1] == (None, "q.a", "480 more are not listed (not a number)")
    names = ",".join(f"q.j{k}" for k in range(30))
    table = f"time,{names}\n" + "".join(f"{k}{',x' * 30}\n" for k in range(50))
    problems = refused(write(table))
    assert len(problems) == 100
    assert "more problems are not listed" in problems[-1][2]


def test_large_tables_in_pieces(write):
    rows = [f"{k},0.1,{k % 7}.5,{'a' if k < 30_000 else 'b'}" for k in range(45_000)]
    recording = read_recording(write("time,q.a,tau.a,run\n" + "\n".join(rows)))
    assert len(recording) == 45_000
    assert recording.efforts["a"][44_999] == 44_999 % 7 + 0.5
    rows[41_234] = "41234,0.1,oops,b"
    assert only(write("time,q.a,tau.a,run\n" + "\n".join(rows)))[:2] == (41_236, "tau.a")


@pytest.fixture
def in_pieces(monkeypatch):
    """Have tables read in pieces of a few rows."""
    monkeypatch.setattr(table, "_BLOCK", 400)


def _long(change=lambda rows: None):
    rows = [f'{k},{k / 7:.5f},{"" if k % 5 else k},"{"a" if k < 300 else "b"}"' for k in range(600)]
    change(rows)
    return "time,q.a,tau.a,run\n" + "\n".join(rows) + "\n"


def test_a_table_read_in_pieces_is_the_table(write, monkeypatch):
    path = write(_long())
    whole = read_recording(path)
    monkeypatch.setattr(table, "_BLOCK", 400)
    pieces = read_recording(path)
    assert np.array_equal(whole.efforts["a"], pieces.efforts["a"], equal_nan=True)
    assert np.array_equal(whole.positions["a"], pieces.positions["a"])
    assert pieces.run_names == ("a", "b")
    assert np.array_equal(whole.run, pieces.run)
    assert pieces.remarks == whole.remarks


@pytest.mark.parametrize(
    ("row", "text", "place", "message"),
    [
        (517, "517,1,oops,b", (519, "tau.a"), "'oops' is not a number"),
        (517, "0.5,1,2,a", (519, "time"), "0.5 s after 299 s (line 301): time must increase"),
        (517, "517,1,2", (519, "run"), "the row has 3 cells, 4 expected"),
        (517, "517,1e12,2,b", (519, "q.a"), "1e+12 is too large"),
        (517, "517,1\0,2,b", (519, "q.a"), "holds zero (NUL) bytes"),
        (517, '517,"1\n",2,b\n518.1,x,2,b\n519.1,1,2,b', (520, "q.a"), "'x' is not a number"),
    ],
)
def test_what_is_wrong_in_a_late_piece_has_its_line(write, in_pieces, row, text, place, message):
    def change(rows):
        rows[row : row + text.count("\n") + 1] = text.replace("1\n", "1").split("\n") if "\n" in text else [text]

    problem = only(write(_long(change)))
    assert problem[:2] == place
    assert message in problem[2]


def test_of_more_rows_than_are_needed_pieces_are_kept_and_all_are_checked(write, in_pieces, monkeypatch):
    monkeypatch.setattr(table, "MOST_ROWS", 100)
    monkeypatch.setattr(table, "PIECES", 4)
    recording = read_recording(write(_long()))
    assert recording.time.tolist() == [*range(25), *range(191, 216), *range(383, 408), *range(575, 600)]
    assert recording.remarks[0].startswith("600 rows are more than are needed")
    assert "4 pieces of 25 rows, evenly spread, were kept" in recording.remarks[0]
    problem = only(write(_long(lambda rows: rows.__setitem__(100, "100,1,oops,a"))))
    assert problem[:2] == (102, "tau.a")


@pytest.mark.parametrize(
    ("beside", "line", "key", "message"),
    [
        ('{"robot": "3prup",\n "position_noise": }', 2, None, "is not valid JSON"),
        ("time,q.a\n0,1\n", 1, None, "is not valid JSON: it looks like a table, a recording perhaps; expected a JSON"),
        ('<robot name="a"/>', 1, None, "is not valid JSON: it looks like XML, a robot file perhaps; expected a JSON"),
        ("[1, 2]", None, None, "holds a list; expected an object"),
        ('{"notes": "a", "notes": "b"}', None, "notes", "stands 2 times"),
        ({"position_noise": 0}, None, "position_noise", "is the number 0; expected one standard deviation above 0 [m]"),
        ({"force_noise": -1}, None, "force_noise", "is the number -1"),
        ({"effort_noise": "2 N"}, None, "effort_noise", 'is the text "2 N"'),
        ({"moment_noise": True}, None, "moment_noise", "is true"),
        ('{"rotation_noise": NaN}', None, "rotation_noise", "is the number nan"),
        ('{"rotation_noise": 1e999}', None, "rotation_noise", "is the number inf"),
        ({"robot": ["3prup"]}, None, "robot", "is a list; expected a text"),
        ({"notes": 5}, None, "notes", "is the number 5; expected a text"),
    ],
)
def test_bad_json_beside(write, beside, line, key, message):
    where = only(write(beside=beside))
    assert where[:2] == (line, key)
    assert message in where[2]
    with pytest.raises(RecordingFileError) as caught:
        read_recording(write(beside=beside))
    assert caught.value.problems[0].file == "bench.json"


def test_json_beside(write):
    recording = read_recording(write(beside={"position_nois": 1, "robot": None, "effort_noise": None}))
    assert "bench.json: the unknown key 'position_nois' is ignored. Did you mean 'position_noise'" in "\n".join(
        recording.remarks
    )
    assert recording.noise == Noise()
    assert recording.robot is None


def test_no_such_file(write, tmp_path):
    write()
    assert "file not found. The folder holds: bench.csv." in only(tmp_path / "bensh.csv")[2]
    assert "is a folder" in only(tmp_path)[2]
    assert "cannot be read" in only("bench\0.csv")[2]


def test_problems_say_file_line_and_column(write):
    with pytest.raises(RecordingFileError, match=r"bench\.csv:3: column 'w\.fx': 'abc' is not a number") as caught:
        read_recording(write(with_cell(1, "w.fx", "abc")))
    assert isinstance(caught.value.problems[0], TableProblem)
    with pytest.raises(RecordingFileError, match=r"bench\.json: robot: is true") as caught:
        read_recording(write(beside={"robot": True}))
    assert isinstance(caught.value.problems[0], KeyProblem)


@needs_practice
def test_practice_recordings():
    paths = [path for device in range(1, 11) for path in sorted(PRACTICE.glob(f"p{device:02d}.*csv"))]
    assert len(paths) == 20
    for path in paths:
        recording = read_recording(path)
        held_out = "heldout" in path.name
        assert len(recording) == (162 if held_out else 378)
        assert list(recording.positions) == ["leg1_slide", "leg2_slide", "leg3_slide"]
        assert len(recording.wrench_columns) == 6
        assert np.isfinite(recording.position).all()
        assert np.isfinite(recording.rotation).all()
        assert (recording.noise == Noise()) == held_out
        assert (recording.temperature is not None) == path.name.startswith("p06")
        assert recording.blocks()[-1] == (5 if held_out else 13)
        assert not suspicions(recording), path


@needs_emps
def test_real_recording():
    recording = read_recording(EMPS)
    assert len(recording) == 24_841
    assert list(recording.positions) == list(recording.efforts) == ["carriage"]
    assert recording.position is None
    assert not recording.has_wrench
    assert len(np.unique(recording.blocks())) > 1000


# -- sizes -------------------------------------------------------------------------------------------------------------


def sized(tmp_path, column="w.fz", value="1", beside=None):
    columns = {"time": "0", "q.a": "0.1", "w.fz": "1"}
    columns[column] = value
    path = tmp_path / "bench.csv"
    path.write_text(f"{','.join(columns)}\n{','.join(columns.values())}\n")
    if beside is not None:
        path.with_suffix(".json").write_text(beside)
    return path


@pytest.mark.parametrize("column", ["time", "w.fz", "q.a"])
def test_numbers_of_no_bench_are_refused(tmp_path, column):
    with pytest.raises(RecordingFileError, match=f"column '{column}': 1e[+]300 is too large; expected at most"):
        read_recording(sized(tmp_path, column, "1e300"))


@pytest.mark.parametrize("noise", ["1e300", "1e-300", "1e7"])
def test_noise_of_no_sensor_is_refused(tmp_path, noise):
    with pytest.raises(
        RecordingFileError, match=r"moment_noise: is the number .*; expected one standard deviation from"
    ):
        read_recording(sized(tmp_path, beside=f'{{"moment_noise": {noise}}}'))


def test_half_a_character_in_the_json_is_refused(tmp_path):
    with pytest.raises(RecordingFileError, match="holds half a character"):
        read_recording(sized(tmp_path, beside='{"notes": "\\ud800"}'))


def test_of_thousands_of_unknown_columns_the_first_are_named(tmp_path):
    names = [f"c{index}" for index in range(3000)]
    path = tmp_path / "wide.csv"
    path.write_text(",".join(["time", "q.a", *names]) + "\n" + ",".join(["0"] * 3002) + "\n")
    read = read_recording(path)
    assert len(read.ignored) == 3000
    assert len(read.remarks) < 60
    assert "2960 more columns are unknown, and ignored." in read.remarks


def test_more_columns_and_keys_than_anybody_means_are_not_gone_through(write):
    wide = ",".join(["time", "q.slide", *(f"c{k}" for k in range(10_000))])
    assert only(write(f"{wide}\n{','.join(['0'] * 10_002)}\n"))[2] == "holds 10002 columns; expected at most 10000"
    many = {f"k{k}": 1 for k in range(10_001)}
    for beside in (many, {"tolerances": many}):
        line, key, message = only(write(beside=beside))
        assert (line, key) == (None, "k0")
        assert message == "holds an object of 10001 keys; expected at most 10000"


def named(folder, robot):
    """Return the path of a small recording that names its robot."""
    folder.mkdir(exist_ok=True)
    (folder / "log.csv").write_text("time,q.a,p.x\n0,0.1,0.2\n1,0.2,0.3\n")
    (folder / "log.json").write_text(json.dumps({"robot": robot, "position_noise": 1e-5}))
    return folder / "log.csv"


def test_a_robot_s_path_is_beside_the_json_file_that_names_it(tmp_path, monkeypatch):
    """It was looked for in the working folder, where another robot may have the same name."""
    monkeypatch.chdir(tmp_path)
    path = named(tmp_path / "rest", "arm.urdf")
    for folder in (tmp_path, path.parent):
        (folder / "arm.urdf").write_text("<robot/>")
    read = read_recording("rest/log.csv")
    assert read.robot == str(Path("rest/arm.urdf"))
    assert not any("beside" in text for text in read.remarks)
    (tmp_path / "other").mkdir()
    write_recording(read, "other/again.csv")
    assert json.loads(Path("other/again.json").read_text())["robot"] == "../rest/arm.urdf"
    assert Path(read_recording("other/again.csv").robot).resolve() == path.parent / "arm.urdf"
    (path.parent / "arm.urdf").unlink()
    read = read_recording("rest/log.csv")
    assert read.robot == "arm.urdf"
    assert "log.json: there is no 'arm.urdf' beside it" in read.misspelt[0]


def test_a_robot_s_name_stays_a_name(tmp_path):
    path = named(tmp_path, "3prup")
    (tmp_path / "3prup").mkdir()
    read = read_recording(path)
    assert read.robot == "3prup"
    write_recording(read, tmp_path / "again.csv")
    assert json.loads((tmp_path / "again.json").read_text())["robot"] == "3prup"


def test_a_part_of_a_position_that_was_not_measured_is_told_once(tmp_path):
    path = tmp_path / "log.csv"
    empty = ("p.x,p.y,p.z", ",", "p.z is empty in every row")
    for header, cell, said in (("p.x,p.y", "", "There is no column p.z"), empty):
        path.write_text(f"time,q.a,{header}\n0,0.1,0.2,0.3{cell}\n1,0.2,0.3,0.4{cell}\n")
        read = read_recording(path)
        told = [text for text in (*read.remarks, *suspicions(read)) if "p.z" in text]
        assert len(told) == 1, told
        assert told[0].startswith(said)


def test_semicolons_in_one_row_are_called_so(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("time,q.a,p.x\n0,0.1,0.2\n1;0.2;0.3\n")
    with pytest.raises(RecordingFileError, match="the cells of this row are separated by semicolons"):
        read_recording(path)
