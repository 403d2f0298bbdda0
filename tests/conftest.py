"""Small bench tests of concealed devices and their diagnoses, made once for all tests."""

from dataclasses import dataclass
from pathlib import Path

import pytest


@dataclass(frozen=True)
class Bench:
    """Recordings of one device: to diagnose, and held out; what is different about it; the noise of its sensors."""

    path: Path
    held_out: Path
    truth: dict
    noise: dict


def make_bench(folder, name, seed, effects, strength, poses=(5, 3), level=60.0):
    from tests.reference.concealed.draw import NOISE, draw, write

    drawn = draw(seed, effects, strength, level, poses=poses)
    write(drawn, folder, folder / "sealed", name)
    return Bench(folder / f"{name}.csv", folder / f"{name}.heldout.csv", drawn["truth"], NOISE)


@pytest.fixture(scope="session")
def bench(tmp_path_factory):
    """A 3-PRUP with play in the drive of one leg."""
    return make_bench(tmp_path_factory.mktemp("bench"), "bench", 1, ["backlash"], (15.0, 25.0), (4, 2))


@pytest.fixture(scope="session")
def clean_bench(tmp_path_factory):
    """A 3-PRUP with nothing missing, under loads too small to show its finite deflection."""
    return make_bench(tmp_path_factory.mktemp("bench"), "clean", 5, [], (15.0, 25.0), (3, 2), 8.0)


@pytest.fixture(scope="session")
def strange_bench(tmp_path_factory):
    """A 3-PRUP in which the load of one drive moves another: no law of the library."""
    return make_bench(tmp_path_factory.mktemp("bench"), "strange", 4, ["alien"], (15.0, 25.0), (4, 2))


def diagnosed_of(bench):
    import prup_pin
    from prup_pin.diagnosis import diagnose
    from prup_pin.recordings import read_recording

    robot, recording = prup_pin.load("3prup"), read_recording(bench.path)
    return robot, recording, diagnose(robot, recording)


@pytest.fixture(scope="session")
def diagnosed(bench):
    """(robot, recording, diagnosis) of `bench`."""
    return diagnosed_of(bench)


@pytest.fixture(scope="session")
def diagnosed_strange(strange_bench):
    """(robot, recording, diagnosis) of `strange_bench`."""
    return diagnosed_of(strange_bench)
