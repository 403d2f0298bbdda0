"""Many devices of one drawing, of a simulator that shares no code with the package."""

import json
import shutil
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import prup_pin
from prup_pin.cli import app
from prup_pin.diagnosis.chances import chi2_sf
from prup_pin.errors import InputError
from prup_pin.laws.deviations import calibration_of
from prup_pin.life import fleet as fleets
from prup_pin.life.fleet import devices_of, fleet
from prup_pin.life.kept import KEPT, kept
from prup_pin.recordings import read_recording, read_tolerances
from prup_pin.simulation import read_model

from ..reference.concealed.fleet import draw_fleet, write

ARM = Path(__file__).parents[1] / "robots" / "elastic_arm" / "elastic_arm.urdf"


class Fleet:
    def __init__(self, folder, count):
        drawn = draw_fleet(4, "elastic_arm", 4, count)
        self.paths = write(drawn, folder, folder / "sealed", str(ARM))
        self.truth, self.folder = drawn["truth"], folder / "fleet"
        self.devices = devices_of([read_recording(path) for path in self.paths])
        self.said, asked = {}, fleets._asked

        def kept(device, *others):
            self.said[device.name] = asked(device, *others)
            return self.said[device.name]

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(fleets, "_asked", kept)
            self.found = fleet(self.devices, self.folder, robot_name=str(ARM))


@pytest.fixture(scope="module")
def arms(once):
    return once("fleet", lambda folder: Fleet(folder, 3))


def test_what_a_device_says_of_its_parameters_holds_the_true_ones(arms):
    """Beside noise alone: the tolerances that were declared have no part in it."""
    deviations = {item.name: item for item in calibration_of(prup_pin.load(ARM).mechanism).deviations}
    for path in sorted((arms.folder / KEPT).glob("*.npz")):
        about, arrays = kept(arms.folder, path.stem)
        fits = []
        for scatter in arms.truth["scatters"]:
            true = np.array([
                np.log1p(scatter[name]) if deviations[name].relative else scatter[name] for name in about["names"]
            ])  # fmt: skip
            left = arrays["score"] - arrays["precision"] @ true
            size = np.sqrt(np.diagonal(arrays["precision"]))
            values, vectors = np.linalg.eigh(arrays["precision"] / np.outer(size, size))
            told = values > 1e-4 * values[-1]
            square = float((((left / size) @ vectors[:, told]) ** 2 / values[told]).sum())
            fits.append(chi2_sf(square, int(told.sum())))
        assert max(fits) > 1e-3  # it is one of the devices
        assert sorted(fits)[-2] < 1e-6  # and no other


def test_a_worker_that_is_lost_costs_its_device_only_and_no_bit(arms, tmp_path, monkeypatch):
    said, here = arms.said, []

    def asked(device, *others):
        here.append(device.name)
        return said[device.name]

    class Broken:
        """A pool whose worker dies at the first device, and that takes nothing after the second."""

        def __init__(self):
            self.taken = 0

        def submit(self, function, *arguments):
            self.taken += 1
            if self.taken > 2:
                raise RuntimeError("cannot schedule new futures after shutdown")
            future = Future()
            if self.taken == 1:
                future.set_exception(OSError("a child process terminated abruptly"))
            else:
                future.set_result(said[arguments[0].name])
            return future

    monkeypatch.setattr(fleets, "_asked", asked)
    alone = fleet(arms.devices, tmp_path / "alone", robot_name=str(ARM))
    assert here == ["device01", "device02", "device03"]
    here.clear()
    found = fleet(arms.devices, tmp_path / "lost", robot_name=str(ARM), executor=Broken())
    assert here == ["device01", "device03"]
    assert found.remarks == (
        "2 of 3 devices came back from no worker (one may have died) and were diagnosed in this process; the numbers "
        "are the same",
    )
    assert np.array_equal(found.own, alone.own)
    here.clear()
    (next((tmp_path / "lost" / KEPT).glob("*.npz"))).unlink()
    again = fleet(arms.devices, tmp_path / "lost", robot_name=str(ARM))
    assert len(here) == 1  # resumed from what is whole
    assert np.array_equal(again.own, alone.own)


@pytest.mark.slow
def test_dask_with_a_killed_worker_gives_the_same_bits(arms, tmp_path):
    """A scheduler and two workers, each a process of its own; one is killed when the first device is back."""
    pytest.importorskip("distributed")
    from scripts.dask_sweep import cluster

    killed = []
    with cluster(workers=2) as (client, workers), client.get_executor(retries=3) as executor:

        def progress(done, total):
            if done and not killed:
                killed.append(workers[0].pid)
                workers[0].kill()

        there = fleet(arms.devices, tmp_path, robot_name=str(ARM), executor=executor, tell=progress)
    assert killed
    assert there.own.tobytes() == arms.found.own.tobytes()
    assert repr((there.common, there.outliers, there.scatter)) == repr(
        (arms.found.common, arms.found.outliers, arms.found.scatter)
    )
    answers = sorted((arms.folder / KEPT).glob("*.npz"))
    assert len(answers) == 3
    for path in answers:
        assert (tmp_path / KEPT / path.name).read_bytes() == path.read_bytes()
    for path in sorted((tmp_path / "devices").iterdir()):
        assert read_model(path).load().name == "elastic_arm"  # wherever the worker stood


def test_the_model_of_each_device_is_loaded_from_where_it_lies(arms):
    paths = sorted((arms.folder / "devices").iterdir())
    assert [path.stem for path in paths] == ["device01", "device02", "device03"]
    assert all(read_model(path).load().name == "elastic_arm" for path in paths)


def test_the_command_writes_tolerances_that_the_next_diagnosis_takes(arms, tmp_path, monkeypatch):
    monkeypatch.setattr(fleets, "_asked", None)  # nothing is asked again
    out = tmp_path / "fleet"
    shutil.copytree(arms.folder, out)
    done = CliRunner().invoke(app, ["fleet", *map(str, arms.paths), "--out", str(out)])
    assert done.exit_code == 0, done.output
    document = json.loads((out / "fleet.json").read_text())
    told = {item["kind"]: item["value"] for item in document["scatter"] if item["told"]}
    declared = read_tolerances(out / "tolerances.json").declared
    assert "position" in declared
    for kind, value in declared.items():
        assert value == pytest.approx(told[kind], rel=0.01)
    assert "By how much devices scatter" in done.output
    table = pytest.importorskip("pyarrow.parquet").read_table(out / "fleet.parquet")
    assert table.num_rows == 3 * len(arms.found.parameters)
    page = (out / "fleet.html").read_text(encoding="utf-8")
    assert "What 3 devices of one drawing say together" in page
    assert page.count("data:image/svg+xml") == 2  # wide, and for a phone
    assert all(item.name in page for item in arms.devices)


def test_devices_are_told_apart_by_what_they_say_or_by_their_files(arms):
    one, two, three = (item.recordings[0] for item in arms.devices)
    assert [item.name for item in arms.devices] == ["device01", "device02", "device03"]
    said = [replace(item, device=name) for item, name in ((one, "7"), (two, "8"), (three, "9"))]
    assert [item.name for item in devices_of(said)] == ["7", "8", "9"]
    in_folders = [
        replace(item, path=f"fleet/{name}/bench.csv") for item, name in ((one, "a"), (two, "b"), (three, "c"))
    ]
    assert [item.name for item in devices_of(in_folders)] == ["a", "b", "c"]
    with pytest.raises(InputError, match=r"a fleet of 2 \(7, 8\): expected recordings of three devices or more"):
        devices_of([replace(one, device="7"), replace(two, device="7"), replace(three, device="8")])
    with pytest.raises(InputError, match=r"device01.csv is the same recording as .*device01.csv; give each once"):
        devices_of([one, one, two, three])
