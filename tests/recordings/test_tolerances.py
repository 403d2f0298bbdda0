"""Tolerances: declared, read, written back, and refused where nobody can mean them."""

from __future__ import annotations

import json
import re
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from prup_pin.errors import InputError, RecordingFileError
from prup_pin.recordings import (
    KINDS_OF_TOLERANCE,
    TYPICAL,
    Recording,
    Tolerances,
    read_recording,
    read_tolerances,
    write_recording,
)

NAMES = [kind.name for kind in KINDS_OF_TOLERANCE]


@pytest.fixture
def beside(tmp_path):
    """Return a function that writes a small table with a JSON file beside it, and returns the table's path."""

    def write(values):
        (tmp_path / "bench.csv").write_text("time,q.a\n0,1\n")
        (tmp_path / "bench.json").write_text(json.dumps(values))
        return tmp_path / "bench.csv"

    return write


def problems(path, read=read_recording):
    with pytest.raises(RecordingFileError) as error:
        read(path)
    return [str(problem) for problem in error.value.problems]


def test_every_kind_is_a_field_and_every_field_a_kind():
    assert [item.name for item in fields(Tolerances)] == NAMES
    assert Tolerances().declared == {}
    for kind in KINDS_OF_TOLERANCE:
        assert all((kind.unit, kind.description))


def test_the_typical_set_names_every_kind():
    assert list(TYPICAL.declared) == NAMES
    for kind in KINDS_OF_TOLERANCE:
        assert 0 < TYPICAL.declared[kind.name] <= kind.largest / 5, kind.name


def test_those_beside_a_recording_are_read_and_written_back(beside, tmp_path):
    path = beside({"robot": "3prup", "tolerances": {"stiffness": 0.1, "position": 5e-5, "mass": None}})
    recording = read_recording(path)
    assert recording.tolerances == Tolerances(stiffness=0.1, position=5e-5)
    assert not [remark for remark in recording.remarks if "tolerances" in remark]
    assert recording.select([0]).tolerances == recording.tolerances
    write_recording(recording, tmp_path / "again.csv")
    assert json.loads((tmp_path / "again.json").read_text())["tolerances"] == {"stiffness": 0.1, "position": 5e-5}
    assert read_recording(tmp_path / "again.csv").tolerances == recording.tolerances


def test_none_declared_means_none(beside, tmp_path):
    for values in ({}, {"tolerances": {}}, {"tolerances": None}):
        recording = read_recording(beside(values))
        assert recording.tolerances == Tolerances()
        write_recording(recording, tmp_path / "again.csv")
        assert "tolerances" not in json.loads((tmp_path / "again.json").read_text())


def test_all_kinds_make_the_round_trip(tmp_path):
    recording = Recording(time=[0.0], positions={"a": [1.0]}, tolerances=TYPICAL)
    write_recording(recording, tmp_path / "a.csv")
    assert read_recording(tmp_path / "a.csv").tolerances == TYPICAL


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("stiffness", 0, "tolerances.stiffness: is the number 0; expected one standard deviation above 0 [relative]"),
        ("position", 1e-200, "expected one standard deviation above 0 [m]"),
        (
            "position",
            0.2,
            "is the number 0.2; expected at most 0.1 [m]: what is further off has no drawing. Is it in mm",
        ),
        ("direction", 2, "expected at most 0.5 [rad]: what is further off has no drawing. Is it in mm or degrees?"),
        ("stiffness", 10, "expected at most 1 [relative]: what is further off has no drawing. 10 % is 0.1"),
        ("wrench_bias_force", 1e4, "expected at most 1000 [N]: what is further off has no drawing. Is the unit right?"),
        ("effort_bias", 1e300, "expected at most 1000 [N or N m]"),
        ("mass", "10%", 'tolerances.mass: is the text "10%"; expected one standard deviation above 0 [relative]'),
        ("mass", True, "is true; expected"),
        ("mass", [0.1], "is a list; expected"),
        ("stifness", 0.1, "tolerances.stifness: no tolerance has this name. Did you mean 'stiffness'?"),
    ],
)
def test_a_wrong_one_is_refused(beside, key, value, expected):
    found = problems(beside({"tolerances": {key: value}}))
    assert len(found) == 1
    assert found[0].startswith("bench.json: tolerances.")
    assert expected in found[0]


def test_all_that_is_wrong_is_told_at_once(beside):
    found = problems(beside({"force_noise": 0, "tolerances": {"mass": 0, "masss": 1, "inertia": -1, "stiffness": 0.1}}))
    assert [text.split(": ")[1] for text in found] == [
        "force_noise",
        "tolerances.mass",
        "tolerances.masss",
        "tolerances.inertia",
    ]


@pytest.mark.parametrize("value", [3, "typical", [0.1], True])
def test_they_are_an_object(beside, value):
    (found,) = problems(beside({"tolerances": value}))
    assert found.startswith("bench.json: tolerances: is ")
    assert found.endswith("expected an object")


def test_a_mistyped_key_beside_the_table_is_named(beside):
    (remark,) = [text for text in read_recording(beside({"tolerance": {}})).remarks if "unknown key" in text]
    assert "Did you mean 'tolerances'?" in remark


@pytest.mark.parametrize("kind", KINDS_OF_TOLERANCE, ids=lambda kind: kind.name)
@pytest.mark.parametrize("value", [0, -1.0, np.nan, np.inf, "0.1", True, 1e-13])
def test_in_python_wrong_ones_are_refused_too(kind, value):
    with pytest.raises(InputError, match=f"tolerance {kind.name} = .*expected one standard deviation above 0"):
        Tolerances(**{kind.name: value})


@pytest.mark.parametrize("kind", KINDS_OF_TOLERANCE, ids=lambda kind: kind.name)
def test_the_largest_that_can_be_meant_is_accepted_and_nothing_larger(kind):
    assert Tolerances(**{kind.name: kind.largest}).declared == {kind.name: kind.largest}
    with pytest.raises(InputError, match="expected at most"):
        Tolerances(**{kind.name: kind.largest * 1.001})


def test_a_file_of_tolerances(tmp_path):
    path = tmp_path / "shop.json"
    path.write_text('{"stiffness": 0.2, "mass": 0.1}')
    assert read_tolerances(path) == Tolerances(stiffness=0.2, mass=0.1)
    path.write_text('{"robot": "3prup", "tolerances": {"stiffness": 0.2}}')
    assert read_tolerances(path) == Tolerances(stiffness=0.2)
    path.write_text('{"stifness": 0.2}')
    assert "shop.json: stifness: no tolerance has this name. Did you mean 'stiffness'?" in problems(
        path, read_tolerances
    )
    for nothing in ("{}", '{"tolerances": {}}', '{"tolerances": null}'):
        path.write_text(nothing)
        assert "declares no tolerance; expected some of stiffness, bending" in problems(path, read_tolerances)[0]
    path.write_text("[0.1]")
    assert "holds a list; expected an object" in problems(path, read_tolerances)[0]
    assert "file not found" in problems(tmp_path / "none.json", read_tolerances)[0]


def test_what_is_shown_of_them_is_what_is_declared():
    assert repr(Tolerances(stiffness=0.1, position=5e-5)) == "Tolerances(stiffness=0.1, position=5e-05)"
    assert replace(TYPICAL, mass=None).declared.keys() == set(NAMES) - {"mass"}


def test_the_page_lists_every_kind_with_its_unit_and_typical_value():
    page = (Path(__file__).parents[2] / "docs" / "tolerances.md").read_text(encoding="utf-8")
    rows = dict(re.findall(r"^\| `(\w+)` \| ([^|]+ \|[^|]+\| [^|]+) \|", page, re.M))
    assert list(rows) == NAMES
    for kind in KINDS_OF_TOLERANCE:
        unit, _, typical = (cell.strip() for cell in rows[kind.name].split("|"))
        assert unit == kind.unit
        assert float(typical) == TYPICAL.declared[kind.name]
