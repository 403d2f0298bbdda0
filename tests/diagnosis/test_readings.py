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

    def tries(read, left, *_):
        tried = [(reading, read_as(read, reading, Drawn())) for reading in every(Columns(q=JOINTS), of=["joints"])]
        found = [Tried(far(log, true) + 1e-3 * len(reading), reading, log, far(log, true)) for reading, log in tried]
        return [item for item in found if item.cost < left]

    found = likeliest(written, far(written, true), tries, 0.0)
    assert sorted(map(str, found.conventions)) == sorted(said)


#: What each reading leaves of a log, and of one that is read by another before.
LEAVES = {
    "deg": {"": 90.0, "reversed": 1.0},
    "mm": {"": 85.0, "reversed": 40.0},
    "reversed": {"": 99.0, "deg": 1.0, "mm": 40.0},
}


def searched(leaves, wins_below, as_good=0.1, firsts=3):
    """What is found where readings of q leave so much of a log of which 100 are left as it is written."""

    def tries(read, left, taken, first, only):
        had = first.reading[0].word if first else taken[-1].word if taken else ""
        tried = []
        for word, left_beside in leaves.items():
            reading = (Convention("q", word),)
            if had in left_beside and (not only or reading == only):
                whole, now = (*(first.reading if first else ()), *reading), left_beside[had]
                wins = now < left * wins_below ** len(whole)
                log = replace(LOG, positions={"a": LOG.time + sum(map(ord, had + word))})
                tried.append(Tried(float(np.log(now)), whole, log, now, wins=wins))
        return tried

    return likeliest(LOG, 100.0, tries, as_good, firsts)


def test_two_readings_are_told_of_which_neither_alone_brings_a_log_nearer():
    assert [item.word for item in searched(LEAVES, 1 / 3).conventions] == ["deg", "reversed"]
    assert searched(LEAVES, 1 / 3, firsts=0).conventions == ()


def test_two_readings_are_to_win_by_the_margin_of_both():
    almost = LEAVES | {"deg": {"": 90.0, "reversed": 30.0}, "reversed": {"": 99.0, "deg": 30.0, "mm": 40.0}}
    assert searched(almost, 1 / 3).conventions == ()
    assert len(searched(almost, 0.6).conventions) == 2


@pytest.mark.parametrize(("beside", "others"), [(0.5, 0), (0.01, 1)])
def test_what_was_as_good_as_a_first_reading_is_asked_again_beside_the_second(beside, others):
    """In degrees or by a gear of 35 a log was as far off while another joint was turned round; beside it only one is
    near, and yet both were told, and the log refused."""
    left = {"deg": {"": 20.0}, "revolutions": {"": 20.5}, "reversed": {"": 99.0, "deg": 0.01, "revolutions": beside}}
    found = searched(left, 1 / 3)
    assert [item.word for item in found.conventions] == ["deg", "reversed"]
    assert [[item.word for item in other] for other in found.others] == [["revolutions", "reversed"]] * others


def test_a_reading_of_ones_own_is_one_function_and_one_line(monkeypatch):
    """The page on architecture says so."""

    def every_other_joint_reversed(columns):
        yield tuple(Convention(f"q.{name}", "reversed") for name in columns.q[::2])

    monkeypatch.setattr(ways, "READINGS", (*READINGS, Kind("joints", 1, every_other_joint_reversed)))
    assert (Convention("q.a", "reversed"), Convention("q.c", "reversed")) in every()
