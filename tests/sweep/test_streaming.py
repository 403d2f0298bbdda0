"""Sweeps on disk and in other processes: nothing is lost, and no bit changes."""

import os
import signal
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from time import sleep

import numpy as np
import pytest

import prup_pin
from prup_pin.sweep import running, stream

from .test_sweep import FORCE, MOMENT

ASKED = {
    "z": [0.3, 0.35],
    "theta": np.linspace(-0.6, 0.6, 9),
    "phi": np.linspace(-0.9, 0.9, 11),
    "quantities": ["C", "extremes", "joints"],
    "force": FORCE,
    "moment": MOMENT,
}
PARTS = 7


@pytest.fixture(autouse=True)
def small_parts(monkeypatch):
    """Seven parts of 30 poses."""
    for module in (running, stream):
        monkeypatch.setattr(module, "PART", 30)


@pytest.fixture(scope="module")
def whole(robot):
    s = robot.sweep(**ASKED)
    assert 100 < s.ok.sum() < 198
    return s


def assert_same(ours, whole):
    assert (ours.status == whole.status).all()
    for name in whole:
        np.testing.assert_array_equal(ours[name], whole[name])


class Interrupted(Exception):
    pass


def interrupt_after(parts):
    def progress(done, total):
        if done >= 30 * parts:
            raise Interrupted

    return progress


@pytest.fixture(params=["s.parquet", "s.csv"])
def name(request):
    return request.param


def test_a_streamed_sweep_is_the_same(robot, whole, tmp_path, name):
    s = robot.sweep(**ASKED, out=tmp_path / name)
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert s.shape == (2, 9, 11)
    assert_same(s, whole)
    assert s.counts == whole.counts
    np.testing.assert_array_equal(s.coordinates, whole.coordinates)
    table = s.to_dataframe()
    assert len(table) == 198
    np.testing.assert_array_equal(table["theta"], whole.coordinates[..., 1].ravel())


def test_an_interrupted_sweep_goes_on(robot, whole, tmp_path, name):
    out = tmp_path / name
    with pytest.raises(Interrupted):
        robot.sweep(**ASKED, out=out, progress=interrupt_after(3))
    folder = tmp_path / f"{name}.parts"
    there = sorted(path.name for path in folder.glob("part-*"))
    assert 2 <= len(there) <= 4
    assert not out.exists()
    times = {name: (folder / name).stat().st_mtime_ns for name in there}
    told = []

    def progress(done, total):
        told.append(done)
        for name, time in times.items():
            assert (folder / name).stat().st_mtime_ns == time

    assert_same(robot.sweep(**ASKED, out=out, progress=progress), whole)
    assert told[0] == 30 * len(there)
    assert not folder.exists()


def test_half_written_and_strange_files_are_solved_again(robot, whole, tmp_path, name):
    out, folder = tmp_path / name, tmp_path / f"{name}.parts"
    with pytest.raises(Interrupted):
        robot.sweep(**ASKED, out=out, progress=interrupt_after(4))
    first, second, *_ = sorted(folder.glob("part-*"))
    first.write_bytes(first.read_bytes()[:100])
    (folder / f".{second.name}.123.part").write_bytes(b"PAR1")
    s = robot.sweep(**ASKED, out=out)
    assert len(s.remarks) == 2
    assert "solved again" in s.remarks[0]
    assert_same(s, whole)


def test_parts_of_another_sweep_are_refused(robot, tmp_path):
    out, folder = tmp_path / "s.parquet", tmp_path / "s.parquet.parts"
    with pytest.raises(Interrupted):
        robot.sweep(**ASKED, out=out, progress=interrupt_after(1))
    before = sorted(folder.iterdir())
    other = robot.with_parameters({"leg1/linear_rod.diameter": 0.022})
    for who, change, said in (
        (robot, {"force": 200.0}, "other force"),
        (robot, {"quantities": ["C"]}, "other quantities"),
        (robot, {"z": [0.3, 0.36]}, "other poses"),
        (other, {}, "other robot file and values"),
    ):
        with pytest.raises(prup_pin.InputError, match=said):
            who.sweep(**{**ASKED, **change}, out=out)
        assert sorted(folder.iterdir()) == before
    (folder / "about.json").write_text("{")
    with pytest.raises(prup_pin.InputError, match="damaged"):
        robot.sweep(**ASKED, out=out)
    (folder / "about.json").unlink()
    with pytest.raises(prup_pin.InputError, match="not what they are of"):
        robot.sweep(**ASKED, out=out)


def test_where_nothing_can_be_written_nothing_is_computed(robot, tmp_path):
    told = []
    (tmp_path / "file").write_text("")
    for out, said in (
        (tmp_path / "nowhere" / "s.parquet", "no folder"),
        (tmp_path, "is a folder"),
        (tmp_path / "s.xlsx", "ends in .csv or .parquet"),
        (tmp_path / "file" / "s.parquet", "no folder"),
    ):
        with pytest.raises(prup_pin.InputError, match=said):
            robot.sweep(**ASKED, out=out, progress=lambda *at: told.append(at))
    assert not told


def test_a_folder_without_the_right_to_write(robot, tmp_path, monkeypatch):
    from pathlib import Path

    def refused(self, *_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "mkdir", refused)
    with pytest.raises(prup_pin.InputError, match=r"cannot write.*Permission denied"):
        robot.sweep(**ASKED, out=tmp_path / "s.parquet")


# -- executors ---------------------------------------------------------------------------------------------------------


def test_threads_give_the_same_bits(robot, whole):
    with ThreadPoolExecutor(3) as executor:
        s = robot.sweep(**ASKED, executor=executor)
    assert not s.remarks
    assert_same(s, whole)


@pytest.mark.slow
def test_processes_give_the_same_bits(robot, whole):
    with ProcessPoolExecutor(2, get_context("spawn")) as executor:
        s = robot.sweep(**ASKED, executor=executor)
    assert not s.remarks
    assert_same(s, whole)


class Shuffled(Executor):
    """Ends what it is given in another order, and loses some of it."""

    def __init__(self, lost):
        self.lost, self.count = lost, 0

    def submit(self, function, /, *arguments, **more):
        future, self.count = Future(), self.count + 1
        if self.count in self.lost:
            future.set_exception(BrokenProcessPool("a worker came to an end"))
        else:
            future.set_result(function(*arguments, **more))
        return future


def test_what_a_dying_worker_held_is_solved_here(robot, whole):
    s = robot.sweep(**ASKED, executor=Shuffled({2, 5}))
    assert "2 of 7 parts came back from no worker" in s.remarks[0]
    assert_same(s, whole)


class Refusing(Shuffled):
    def submit(self, function, /, *arguments, **more):
        if self.count >= 2:
            raise BrokenProcessPool("no longer usable")
        return super().submit(function, *arguments, **more)


def test_a_pool_that_takes_nothing_more_is_no_end(robot, whole):
    s = robot.sweep(**ASKED, executor=Refusing(set()))
    assert "5 of 7 parts" in s.remarks[0]
    assert_same(s, whole)


class Killing(ProcessPoolExecutor):
    """Kills one of its own workers once the second part is handed out."""

    given = 0

    def submit(self, function, /, *arguments, **more):
        future = super().submit(function, *arguments, **more)
        self.given += 1
        if self.given == 2:
            os.kill(next(iter(self._processes)), signal.SIGKILL)
        return future


def test_a_killed_worker_of_a_pool_loses_nothing(robot, whole):
    with Killing(2, get_context("spawn")) as executor:
        s = robot.sweep(**ASKED, executor=executor)
    assert "came back from no worker" in s.remarks[0]
    assert_same(s, whole)


@pytest.mark.slow
def test_dask_with_a_killed_worker_gives_the_same_bits(robot, whole):
    """A scheduler and two workers, each a process of its own; one is killed while it works."""
    pytest.importorskip("distributed")
    from scripts.dask_sweep import cluster

    killed = []
    with cluster(workers=2) as (client, workers), client.get_executor(retries=3) as executor:

        def progress(done, total):
            if done >= 30 and not killed:
                killed.append(workers[0].pid)
                workers[0].kill()

        s = robot.sweep(**ASKED, executor=executor, progress=progress)
        for _ in range(200):  # until the scheduler has noticed
            if len(client.scheduler_info(n_workers=-1)["workers"]) < 2:
                break
            sleep(0.05)
        else:
            pytest.fail("no worker was lost")
    assert killed
    assert_same(s, whole)
