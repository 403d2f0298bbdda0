"""Writing recordings and predictions: what is read again is what was written."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest

from prup_pin.errors import InputError
from prup_pin.recordings import Noise, Recording, read_recording, write_prediction, write_recording


def full(n=7):
    """Return a recording that uses every column there is."""
    random = np.random.default_rng(5)
    position = random.normal(size=(n, 3))
    position[2, 1] = np.nan
    rotation = random.normal(size=(n, 3))
    rotation[:, 2] = np.nan
    effort = random.normal(size=n) * 1e-7
    effort[3] = np.nan
    wrench = np.zeros((n, 6))
    wrench[:, [0, 5]] = random.normal(size=(n, 2)) * 1234.5
    return Recording(
        time=1.7e9 + 0.001 * np.arange(n),
        positions={"leg 1/slide": random.normal(size=n), 'b,"c"': random.normal(size=n)},
        velocities={"leg 1/slide": random.normal(size=n)},
        accelerations={"leg 1/slide": random.normal(size=n)},
        efforts={"leg 1/slide": effort},
        wrench=wrench,
        wrench_columns=("fx", "mz"),
        position=position,
        rotation=rotation,
        markers={"tip": random.normal(size=(n, 3))},
        temperature=random.normal(size=n),
        run=np.arange(n) // 3,
        run_names=("cold", "", 'warm, "later"'),
        noise=Noise(position=2e-6, effort=0.1),
        robot="3prup",
        notes="first line\nsecond: 20 °C",
    )


def assert_same(a, b, rtol=5e-9):
    for name in ("time", "wrench", "position", "rotation", "temperature"):
        x, y = getattr(a, name), getattr(b, name)
        assert (x is None) == (y is None), name
        if x is not None:
            np.testing.assert_allclose(x, y, rtol=1e-14 if name == "time" else rtol, atol=0)
    for name in ("positions", "velocities", "accelerations", "efforts", "markers"):
        x, y = getattr(a, name), getattr(b, name)
        assert list(x) == list(y)
        for key in x:
            np.testing.assert_allclose(x[key], y[key], rtol=rtol, atol=0)
    np.testing.assert_array_equal(a.run, b.run)
    for name in ("run_names", "noise", "robot", "notes", "wrench_columns"):
        assert getattr(a, name) == getattr(b, name), name


def test_round_trip(tmp_path):
    path = tmp_path / "bench.csv"
    write_recording(full(), path)
    back = read_recording(path)
    assert_same(full(), back)
    assert np.diff(back.time) == pytest.approx(0.001, rel=1e-3)
    write_recording(back, tmp_path / "again.csv")
    assert (tmp_path / "again.csv").read_bytes() == path.read_bytes()
    assert (tmp_path / "again.json").read_bytes() == path.with_suffix(".json").read_bytes()
    assert sorted(file.name for file in tmp_path.iterdir()) == ["again.csv", "again.json", "bench.csv", "bench.json"]


def test_only_columns_that_exist(tmp_path):
    write_recording(Recording(time=[0, 0.1], positions={"a": [1 / 3, np.nan]}), tmp_path / "a.csv")
    assert (tmp_path / "a.csv").read_text() == "time,q.a\n0,0.333333333\n0.1,\n"
    assert json.loads((tmp_path / "a.json").read_text()) == {}
    recording = full()
    write_recording(recording, tmp_path / "b.csv")
    header = next(csv.reader((tmp_path / "b.csv").read_text().splitlines()))
    assert [name for name in header if name[0] in "wr"] == ["w.fx", "w.mz", "r.x", "r.y", "run"]


def test_unmeasured_triple_keeps_its_columns(tmp_path):
    recording = Recording(time=[0, 1], positions={"a": [1, 2]}, position=np.full((2, 3), np.nan))
    write_recording(recording, tmp_path / "a.csv")
    assert_same(recording, read_recording(tmp_path / "a.csv"))


def test_many_rows(tmp_path):
    n = 45_000
    recording = Recording(
        np.arange(n) * 0.001, {"a": np.arange(n) * 0.5}, run=np.arange(n) // 30_000, run_names=("x", "y")
    )
    write_recording(recording, tmp_path / "a.csv")
    assert_same(recording, read_recording(tmp_path / "a.csv"))


@pytest.mark.parametrize(
    ("recording", "message"),
    [
        (Recording(time=[], positions={"a": []}), "without samples"),
        (Recording(time=[0.0]), "without the position of any actuated joint"),
        (Recording(time=[0, 1], positions={"a": [1, np.inf]}), "column 'q.a' has infinite values, the first in row 1"),
        (Recording(time=[0, 0], positions={"a": [1, 2]}), "time must increase within a run; it does not in row 1"),
        (Recording(time=[0, np.nan], positions={"a": [1, 2]}), "row 1"),
        (Recording(time=[0, 1], positions={"a\n": [1, 2]}), "line end"),
    ],
)
def test_what_could_not_be_read_is_not_written(tmp_path, recording, message):
    with pytest.raises(InputError, match=message):
        write_recording(recording, tmp_path / "a.csv")
    assert not list(tmp_path.iterdir())


def test_a_failure_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "a.csv"
    write_recording(full(), path)
    before = path.read_bytes()

    def full_disk(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("prup_pin.files.os.replace", full_disk)
    with pytest.raises(InputError, match="No space left on device"):
        write_recording(full(9), path)
    assert path.read_bytes() == before
    assert sorted(file.name for file in tmp_path.iterdir()) == ["a.csv", "a.json"]


def test_bad_paths(tmp_path):
    with pytest.raises(InputError, match="No such file or directory"):
        write_recording(full(), tmp_path / "none" / "a.csv")
    with pytest.raises(InputError, match=r"expected \.csv"):
        write_recording(full(), tmp_path / "a.json")
    with pytest.raises(InputError, match="it is a folder"):
        write_prediction(tmp_path, [0.0])


def test_prediction(tmp_path):
    path = tmp_path / "prediction.csv"
    nan = np.nan
    write_prediction(
        path,
        time=[0, 0.5],
        position=[[1, 2, 3], [nan, nan, nan]],
        rotation=[[0.1, nan, 0.3], [nan, nan, nan]],
        efforts={"a": [5.5, nan]},
        status=["ok", "unreachable"],
        run=["x", "y, z"],
    )
    assert path.read_text() == (
        'time,p.x,p.y,p.z,r.x,r.y,r.z,tau.a,run,status\n0,1,2,3,0.1,,0.3,5.5,x,ok\n0.5,,,,,,,,"y, z",unreachable\n'
    )
    write_prediction(path, time=[0, 1], efforts={"a": [1, 2]}, markers={"tip": np.zeros((2, 3))})
    assert path.read_text() == "time,p.tip.x,p.tip.y,p.tip.z,tau.a,status\n0,0,0,0,1,ok\n1,0,0,0,2,ok\n"
    assert not path.with_suffix(".json").exists()


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"position": np.zeros((3, 3))}, "column 'p.x' has shape"),
        ({"rotation": np.zeros(2)}, r"need an array \(N, 3\)"),
        ({"efforts": {"a": [1.0]}}, "column 'tau.a'"),
        ({"status": ["ok"]}, "column 'status'"),
        ({"run": ["a", "b", "c"]}, "column 'run'"),
    ],
)
def test_prediction_of_other_length(tmp_path, values, message):
    with pytest.raises(InputError, match=message):
        write_prediction(tmp_path / "a.csv", [0.0, 1.0], **values)
    assert not list(tmp_path.iterdir())
