"""Ways to read a log: which are tried, and how one of them is found by whatever a channel measures."""

from dataclasses import replace

import numpy as np
import pytest

from prup_pin.diagnosis import readings as ways
from prup_pin.diagnosis.readings import READINGS, Columns, Kind, Tried, likeliest, readings
from prup_pin.recordings import WORDS, Convention, Drawn, Recording, convention_of, read_as, written_as
from prup_pin.recordings.conventions import AS_WRITTEN, merged

JOINTS = ("a", "b", "c", "d")
LOG = Recording(
    time=np.arange(5.0),
    positions={name: np.linspace(0, 1 + k, 5) for k, name in enumerate(JOINTS)},
    efforts={name: np.linspace(1, 2, 5) ** k for k, name in enumerate(JOINTS)},
)
ARM = Columns(q=JOINTS, tau=JOINTS)
OF = sorted({kind.of for kind in READINGS})


def every(columns=ARM, log=LOG, of=OF):
    return [reading for some in readings(log, columns, *of) for reading in some]


def test_every_reading_is_tried_once_and_can_be_declared():
    tried = every()
    assert len(set(tried)) == len(tried)
    table = {"q": JOINTS, "tau": JOINTS}
    for item in {item for reading in tried for item in reading}:
        assert convention_of(item.columns, item.said, table) == item


def test_every_word_that_a_log_of_joints_poses_and_loads_may_need_is_tried_but_what_is_found_by_numbers():
    """An effort's unit and a sensor's point are fitted; clocks and gravity have channels of their own; `wrapped` says
    what no single pose tells."""
    slide = Columns(q=JOINTS, tau=JOINTS, slides=frozenset(JOINTS))
    tried = {(item.group, item.word) for columns in (ARM, slide) for reading in every(columns) for item in reading}
    needed = {
        (group, word.name) for word in WORDS for group in word.groups if group in ("q", "tau", "p", "r", "wrench")
    }
    left = {(group, word) for group, word in needed - tried if word not in (AS_WRITTEN, "gain", "about", "wrapped")}
    units = {(group, word.name) for word in WORDS for group in word.groups if group == "tau" and word.factor}
    assert left - units == {("p", "reversed"), ("wrench", "reversed")}  # a mirror, which axes are too, and a reaction


def test_what_is_declared_to_be_as_written_is_not_tried():
    log = replace(LOG, conventions=(Convention("q.b", AS_WRITTEN),))
    assert not any(item.joint == "b" and item.group == "q" for reading in every(log=log) for item in reading)
    assert any(item.joint == "a" and item.group == "q" for reading in every(log=log) for item in reading)


def test_what_comes_one_after_the_other_is_told_as_one():
    turned, quarter = Convention("q.a", "reversed"), Convention("q.a", "quarter_turns", (3.0,))
    steps = (turned, quarter, Convention("tau.a", "reversed"), turned, Convention("tau.a", "reversed"))
    read = read_as(LOG, steps, Drawn())
    told = merged(steps, JOINTS, JOINTS)
    assert told == (Convention("q.a", "quarter_turns", (1.0,)),)
    whole = (read_as(LOG, told, Drawn()).positions["a"] - read.positions["a"]) / (2 * np.pi)
    np.testing.assert_allclose(whole, np.round(whole), atol=1e-12)


def far(log, true):
    return float(sum(np.log(1e-6 + np.abs(log.positions[name] - true.positions[name]).sum()) for name in JOINTS))


@pytest.mark.parametrize("said", [("q=deg",), ("q.b=deg", "q.d=reversed"), ("q=order:d,b,c,a",)], ids=" ".join)
def test_the_likeliest_readings_are_found_by_any_measure_of_what_is_left(said):
    true = LOG
    way = [convention_of(*text.split("="), {"q": JOINTS, "tau": JOINTS}) for text in said]
    written = written_as(true, way, Drawn())

    def tries(read, left, taken, first=None, only=()):
        tried = [(reading, read_as(read, reading, Drawn())) for reading in every(Columns(q=JOINTS), of=["joints"])]
        found = [Tried(far(log, true) + 1e-3 * len(reading), reading, log, far(log, true)) for reading, log in tried]
        return [item for item in found if item.cost < left]

    found = likeliest(written, far(written, true), tries, 0.0)
    assert sorted(map(str, found.conventions)) == sorted(said)


def test_a_reading_of_ones_own_is_one_function_and_one_line(monkeypatch):
    """The page on architecture says so."""

    def every_other_joint_reversed(columns):
        yield tuple(Convention(f"q.{name}", "reversed") for name in columns.q[::2])

    monkeypatch.setattr(ways, "READINGS", (*READINGS, Kind("joints", 1, every_other_joint_reversed)))
    assert (Convention("q.a", "reversed"), Convention("q.c", "reversed")) in every()
