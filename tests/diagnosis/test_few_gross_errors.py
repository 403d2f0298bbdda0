"""A few poses that were read wrong hide neither what is wrong with a robot nor how its log is written."""

import re
from dataclasses import replace

import numpy as np
import pytest

import prup_pin
from prup_pin.diagnosis.gross_errors import Outlier, are_few, outliers_told
from prup_pin.diagnosis.prepare import drawn_problem, silent
from prup_pin.diagnosis.spread import gross_errors_beside
from prup_pin.recordings import Together, read_recording

from ..conftest import make_bench

#: Rows that a tracker read wrong, and by how much [m].
ROWS, FAR = (9, 40), 5e-4


@pytest.fixture(scope="module")
def read_wrong(bench):
    recording = read_recording(bench.path)
    position = recording.position.copy()
    for sign, row in enumerate(ROWS):
        position[row] += FAR * np.array([1.0, -1.0, 1.0]) / np.sqrt(3) * (-1) ** sign
    return replace(recording, position=position)


def test_play_is_found_beside_gross_errors_and_these_are_told(read_wrong, bench):
    found = prup_pin.diagnose(prup_pin.load("3prup"), read_wrong)
    assert found.verdict == "explained"
    assert bench.truth["effects"][0]["location"] in found.findings[0].candidates
    assert found.findings[0].physics == "backlash"
    told = [text for text in found.remarks if "gross" in text]
    assert len(told) == 1
    assert "left out are 2 gross errors" in told[0]
    assert all(re.search(rf"line {row + 2} \(position, 50\d µm off\)", told[0]) for row in ROWS)


def test_what_is_left_out_is_told_with_lines_and_exchanged_channels(read_wrong):
    together = Together.of([read_wrong], prup_pin.load("3prup").mechanism.actuated, None)
    one = Outlier(3, "marker a position", 40.0, 1e-3, "m", "marker b position")
    other = replace(one, channel="marker b position", exchanged=one.channel)
    told = list(outliers_told([one, other], together))
    assert told[0].startswith("left out are 2 gross errors, which all other samples contradict: line 5 (marker a")
    assert told[1].startswith("marker a position and marker b position are exchanged in line 5:")
    assert "no load was recorded" in next(outliers_told([one], together, "forces of some 20 N"))
    assert not list(outliers_told([], together))


def test_they_are_told_from_a_softer_module_that_was_not_found_yet(tmp_path):
    """Beside the robot file alone much else is far off."""
    soft = make_bench(tmp_path, "soft", 3, ["stiffness_changed"], (15.0, 25.0), (12, 2))
    recording = read_recording(soft.path)
    position = recording.position.copy()
    position[list(ROWS)] += FAR * np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    drawn = drawn_problem(prup_pin.load("3prup"), [replace(recording, position=position)], silent)
    found = gross_errors_beside(drawn.problem, drawn.together, ())
    assert {(item.sample, item.channel) for item in found} == {(row, "position") for row in ROWS}
    assert are_few(found, drawn.problem.stack)
    assert not are_few([], drawn.problem.stack)
