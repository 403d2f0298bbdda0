"""Small bench tests of concealed devices and their diagnoses, made once for all tests.

Workers wait for each other by a lock on a file, as POSIX has it: the tests do not run on Windows.
"""

import fcntl
import gc
import hashlib
import os
import pickle
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest


def pytest_collection(session):
    """What is imported and collected is hardly garbage: to look for some took half of the time of collection."""
    gc.disable()


def pytest_collection_finish(session):
    """Thousands of collected tests stay to the end: the collector of garbage need not look at them again and again."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 20, 20)
    gc.enable()


@dataclass(frozen=True)
class Bench:
    """Recordings of one device: to diagnose, and held out; what is different about it; the noise of its sensors."""

    path: Path
    held_out: Path
    truth: dict
    noise: dict


def make_bench(folder, name, seed, effects, strength, poses=(5, 3), level=60.0, as_written=False):
    from tests.as_written import declare_as_written
    from tests.reference.concealed.draw import NOISE, draw, write

    drawn = draw(seed, effects, strength, level, poses=poses)
    write(drawn, folder, folder / "sealed", name)
    if as_written:
        declare_as_written(folder / f"{name}.csv")
    return Bench(folder / f"{name}.csv", folder / f"{name}.heldout.csv", drawn["truth"], NOISE)


@pytest.fixture(scope="session")
def once(tmp_path_factory):
    """A function that makes something once for a whole run: of several workers the first that asks, the others wait."""
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent  # that of all workers

    def made(name, make):
        kept = folder / f"{name}.pickle"
        with (folder / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not kept.exists():
                (folder / name).mkdir(exist_ok=True)
                kept.write_bytes(pickle.dumps(make(folder / name)))
            return pickle.loads(kept.read_bytes())

    return made


@pytest.fixture(scope="session")
def robot():
    """The 3-PRUP; what it was asked before changes no answer (tests/kinematics/test_no_history.py)."""
    import prup_pin

    return prup_pin.load("3prup")


@pytest.fixture(scope="session")
def bench(once):
    """A 3-PRUP with play in the drive of one leg."""
    return once(
        "bench", lambda folder: make_bench(folder, "bench", 1, ["backlash"], (15.0, 25.0), (4, 2), as_written=True)
    )


@pytest.fixture(scope="session")
def clean_bench(once):
    """A 3-PRUP with nothing missing, under loads too small to show its finite deflection."""
    return once("clean", lambda folder: make_bench(folder, "clean", 5, [], (15.0, 25.0), (3, 2), 8.0))


@pytest.fixture(scope="session")
def strange_bench(once):
    """A 3-PRUP in which the load of one drive moves another: no law of the library."""
    return once(
        "strange", lambda folder: make_bench(folder, "strange", 4, ["alien"], (15.0, 25.0), (2, 2), as_written=True)
    )


@pytest.fixture
def run(monkeypatch, tmp_path):
    """A function that types a command of `prup-pin` in an empty folder, on a terminal of 100 columns."""
    from typer.testing import CliRunner

    from prup_pin.cli import app

    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.chdir(tmp_path)
    runner = CliRunner()
    return lambda *arguments: runner.invoke(app, [str(argument) for argument in arguments])


@dataclass(frozen=True)
class Answer:
    """What `prup-pin diagnose` left in a folder and said, and the diagnosis that it made for that."""

    robot: Any
    diagnosis: Any
    folder: Path
    stdout: str


def answer_on(bench, folder, *options):
    from typer.testing import CliRunner

    from prup_pin import diagnosis
    from prup_pin.cli import app

    made, out = [], folder / "new" / "folder"
    diagnose = diagnosis.diagnose

    def kept(robot, *arguments, **more):
        made.append((robot, diagnose(robot, *arguments, **more)))
        return made[-1][1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(diagnosis, "diagnose", kept)
        arguments = ["diagnose", str(bench.path), "--out", str(out), *options]
        done = CliRunner(env={"COLUMNS": "100"}).invoke(app, arguments)
    assert done.exit_code == 0, done.output
    return Answer(*made[0], out, done.stdout)


@pytest.fixture(scope="session")
def answer(once, bench):
    """What `prup-pin diagnose` says of `bench`."""
    return once("answer", lambda folder: answer_on(bench, folder))


@pytest.fixture(scope="session")
def answer_strange(once, strange_bench):
    """What `prup-pin diagnose` says of `strange_bench`, without a report."""
    return once("answer_strange", lambda folder: answer_on(strange_bench, folder, "--no-report"))


@pytest.fixture(scope="session")
def diagnosed_clean(once, clean_bench):
    """(robot, recording, diagnosis) of `clean_bench`."""

    def diagnosed(folder):
        import prup_pin
        from prup_pin.recordings import read_recording

        robot, recording = prup_pin.load("3prup"), read_recording(clean_bench.path)
        return robot, recording, prup_pin.diagnose(robot, recording)

    return once("diagnosed_clean", diagnosed)


def diagnosed_of(answer, bench):
    from prup_pin.recordings import read_recording

    return answer.robot, read_recording(bench.path), answer.diagnosis


@pytest.fixture(scope="session")
def diagnosed(answer, bench):
    """(robot, recording, diagnosis) of `bench`."""
    return diagnosed_of(answer, bench)


@pytest.fixture(scope="session")
def diagnosed_strange(answer_strange, strange_bench):
    """(robot, recording, diagnosis) of `strange_bench`."""
    return diagnosed_of(answer_strange, strange_bench)


@pytest.fixture
def without_pictures(monkeypatch):
    """Pages have blank pictures: to draw them takes most of the time, and tests of words do not look at them."""
    from prup_pin.views.report import diagnosis_report, pages

    blank = pages.Picture(*2 * ("data:image/svg+xml;base64,PHN2ZyB4bWxucz0iaHR0cDovL3d3dy53My5vcmcvMjAwMC9zdmciLz4=",))
    for module in (pages, diagnosis_report):
        monkeypatch.setattr(module, "picture", lambda *about, **how: blank)


@pytest.fixture
def remembered(once, monkeypatch):
    """Diagnoses and calibrations are made once for all pages: the same question has the same answer."""
    import prup_pin.diagnosis
    from prup_pin.recordings import Recording

    def kept(name, function):
        def asked(robot, recordings, **options):
            several = [recordings] if isinstance(recordings, Recording) else recordings
            question = [robot.name, robot.mechanism.description.content, robot.mechanism.parameters]
            question += [(Path(one.path).read_bytes(), one.tolerances) for one in several]
            question += sorted((key, value) for key, value in options.items() if key != "tell")
            key = hashlib.sha256(repr(question).encode()).hexdigest()[:24]
            return once(f"{name}-{key}", lambda folder: function(robot, recordings, **options))

        return asked

    for name in ("diagnose", "calibrate"):
        monkeypatch.setattr(prup_pin.diagnosis, name, kept(name, getattr(prup_pin.diagnosis, name)))
