"""A machine's life: an arm of a simulator that shares no code with the package, tested again and again."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import prup_pin
from prup_pin.cli import app
from prup_pin.diagnosis import diagnose
from prup_pin.errors import InputError, RecordingFileError
from prup_pin.life import follow as following
from prup_pin.life.follow import MODEL, follow, in_order_of_time
from prup_pin.life.kept import KEPT, digest_of
from prup_pin.recordings import read_recording, write_recording
from prup_pin.views.text.life_words import life_verdict

from ..reference.concealed.life import LIVES, draw_life, write

ARM = Path(__file__).parents[1] / "robots" / "elastic_arm" / "elastic_arm.urdf"


@pytest.fixture(scope="module")
def arm():
    return prup_pin.load(ARM)


class Life:
    """Four tests of an arm, followed three at first and then all; `asked` counts the diagnoses."""

    def __init__(self, seed, arm, folder):
        drawn = draw_life(seed, "elastic_arm", LIVES[seed % 4], (4, 3), 4)
        self.paths = write(drawn, folder, folder / "sealed", str(ARM))
        self.truth, self.folder, self.asked = drawn["truth"], folder / "life", []
        self.recordings = [read_recording(path) for path in self.paths]
        self.known: dict = {}
        self.arm = arm

    def follow(self, count, folder=None):
        return follow(self.arm, self.recordings[:count], folder or self.folder, robot_name=str(ARM))

    def diagnose(self, robot, recording, against=None, tell=None):
        """Return a diagnosis, made once: what is asked in another folder is asked of the same recordings."""
        key = digest_of(recording), against is None
        self.asked.append(recording.path)
        if key not in self.known:
            self.known[key] = diagnose(robot, recording, against=against)
        return self.known[key]


@pytest.fixture(scope="module")
def grown(arm, tmp_path_factory):
    life = Life(1, arm, tmp_path_factory.mktemp("grown"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(following, "diagnose", life.diagnose)
        life.first, life.all = life.follow(3), life.follow(4)
        life.asked_in_two = list(life.asked)
        life.at_once = life.follow(4, life.folder.with_name("at_once"))
    return life


@pytest.mark.slow
def test_play_that_came_is_told_with_its_moment_and_size(grown):
    (change,) = grown.all.changes
    assert (change.physics, change.location) == ("backlash", grown.truth["places"][0])
    assert (change.shape, change.begin) == ("step", grown.truth["begin"])
    (low, high) = change.parameters["half_gap"].interval
    assert low < grown.truth["values"][-1] < high
    begin = grown.truth["begin"]
    days = [item.date for item in grown.recordings]
    told = f"between recording {begin + 1} ({days[begin]}) and recording {begin + 2} ({days[begin + 1]})"
    assert life_verdict(grown.all).endswith(told)


def test_each_recording_tells_the_value_it_had(grown):
    (series,) = [item for item in grown.all.series if item.location == grown.truth["places"][0]]
    assert ((series.low <= grown.truth["values"]) & (grown.truth["values"] <= series.high)).all()
    assert series.value == pytest.approx(grown.truth["values"], abs=2 * (series.high - series.low).max())


def test_a_further_recording_alone_is_asked_and_the_answer_is_that_of_all_at_once(grown):
    assert grown.asked_in_two == [item.path for item in grown.recordings]
    assert repr(grown.all.changes) == repr(grown.at_once.changes)
    for one, other in zip(grown.all.series, grown.at_once.series, strict=True):
        for name in ("value", "low", "high"):
            assert np.array_equal(getattr(one, name), getattr(other, name))
    answers = sorted((grown.folder.with_name("at_once") / KEPT).glob("*.npz"))
    assert len(answers) == 2 * 4
    for path in answers:
        there = grown.folder / KEPT / path.name
        assert there.read_bytes() == path.read_bytes()


def test_the_command_goes_on_with_what_is_there_and_writes_page_table_and_document(grown, tmp_path, monkeypatch):
    monkeypatch.setattr(following, "diagnose", None)  # nothing is asked again
    out = tmp_path / "life"
    shutil.copytree(grown.folder, out)
    done = CliRunner().invoke(app, ["follow", *map(str, grown.paths), "--out", str(out)])
    assert done.exit_code == 0, done.output
    assert "4 recordings in the order of their dates" in done.output
    document = json.loads((out / "life.json").read_text())
    assert document["verdict"] == "changed"
    assert document["changes"][0]["begin"] == grown.truth["begin"] + 1
    page = (out / "life.html").read_text()
    assert "Half gap of the backlash" in page
    assert page.count("data:image/svg+xml") == 2
    table = pytest.importorskip("pyarrow.parquet").read_table(out / "life.parquet")
    assert table.num_rows == 4 * len(document["series"])


def test_a_first_model_changed_by_hand_is_refused(grown, tmp_path):
    out = tmp_path / "life"
    shutil.copytree(grown.folder, out)
    (out / MODEL).write_text((out / MODEL).read_text().replace('"value": ', '"value":  '))
    with pytest.raises(InputError, match=r"first_model.json' was changed .* remove it: .* from 01.csv"):
        grown.follow(4, out)


def test_recordings_that_are_no_life_are_refused_by_name(grown, arm, tmp_path):
    first, second, third, _ = grown.recordings
    other = tmp_path / "again.csv"
    write_recording(replace(second, date="2031-01-01"), other)
    for given, said in (
        ([first], "one recording is no life"),
        ([first, second, read_recording(second.path), third], "02.csv is the same recording as 02.csv"),
        ([first, replace(second, robot="3prup")], "02.csv is of robot '3prup', and 01.csv of 'elastic_arm'"),
        ([replace(first, device="7"), replace(second, device="8")], "02.csv is of device '8', and 01.csv of '7'"),
        ([first, replace(second, date="")], "no date in the JSON file of 02.csv"),
    ):
        with pytest.raises(InputError, match=said):
            follow(arm, given, tmp_path / "life", robot_name=str(ARM))
    assert not (tmp_path / "life").exists()


def test_recordings_out_of_order_are_put_in_order_of_their_dates(grown):
    names = [path.name for path in grown.paths[:3]]
    first, second, third = grown.recordings[:3]
    order, time, by, remarks = in_order_of_time([second, first, third], [names[1], names[0], names[2]])
    assert (order, by) == ([1, 0, 2], "their dates")
    assert remarks == ["put in order of their dates: 01.csv, 02.csv, 03.csv"]
    assert (np.diff(time) > 0).all()
    without = [replace(item, date="") for item in (second, first)]
    assert in_order_of_time(without, names[:2])[:3] == ([0, 1], pytest.approx([0.0, 1.0]), "the order given")


def test_a_recording_written_again_is_the_same_recording(grown, tmp_path):
    write_recording(grown.recordings[1], tmp_path / "copy.csv")
    copy = read_recording(tmp_path / "copy.csv")
    assert copy.date == grown.recordings[1].date
    assert digest_of(copy) == digest_of(grown.recordings[1])
    assert digest_of(replace(copy, own_sensors=("pose_sensor",))) != digest_of(copy)


def test_a_date_that_is_none_is_a_problem_of_its_file(grown, tmp_path):
    write_recording(grown.recordings[0], tmp_path / "one.csv")
    beside = tmp_path / "one.json"
    beside.write_text(beside.read_text().replace(grown.recordings[0].date, "last Monday"))
    with pytest.raises(RecordingFileError, match=r"date.*last Monday.*expected a day or a moment, as 2026-03-01"):
        read_recording(tmp_path / "one.csv")
