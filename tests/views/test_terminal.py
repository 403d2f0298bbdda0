"""Text for terminals of any width: nothing is cut, no number loses its unit."""

import io
import re
import warnings

import numpy as np
import pytest
from rich.console import Console

import prup_pin
from prup_pin.errors import JointLimitWarning, limits_heard, postures_beyond
from prup_pin.views.text.answer import Answer
from prup_pin.views.text.bench_tests import print_failures
from prup_pin.views.text.one_pose import print_answer
from prup_pin.views.text.robot_files import print_info
from prup_pin.views.text.terminal import capital, lines_of, listed, make_table, print_table


def console(width: int) -> Console:
    return Console(file=io.StringIO(), width=width, highlight=False, markup=False, emoji=False)


@pytest.fixture(scope="module")
def arm():
    return prup_pin.load("panda", joint_stiffness=1e4)


@pytest.mark.parametrize("width", [60, 80, 100])
def test_an_answer_fits_and_breaks_no_name_and_no_number(arm, width):
    out = console(width)
    answer = Answer(arm.compliance(arm.home))
    print_answer(out, arm, answer, "home", {})
    text = out.file.getvalue()
    assert max(map(len, text.splitlines())) <= width
    names = {answer.tool, *answer.compliance.names} - {"panda_finger_joint1", "panda_finger_joint2"}  # carry nothing
    assert all(re.search(rf"(?<![\w]){re.escape(name)}(?![\w])", text) for name in names)
    wide = console(200)
    print_answer(wide, arm, answer, "home", {})

    def numbers(text: str) -> set[str]:
        return set(re.findall(r"-?\d+\.\d+", text))

    assert numbers(text) == numbers(wide.file.getvalue())


def test_a_long_path_is_broken_at_its_folders(arm):
    out = console(60)
    print_info(out, arm)
    text = out.file.getvalue().partition("Joints")[0]
    assert max(map(len, text.splitlines())) <= 60
    assert "".join(text.split()).count(str(arm.mechanism.description.path)) == 1


def test_a_number_keeps_its_unit_at_the_end_of_a_line():
    for width in range(12, 40):
        lines = lines_of("it moves by 16.4 µm, turns by 3 mrad and takes 250 N m/mrad; down is (0 0 -1)", width)
        for whole in ("16.4 µm", "3 mrad", "250 N m/mrad", "(0 0 -1)"):
            assert sum(whole in line for line in lines) == 1, (width, lines)


def test_a_table_that_is_too_wide_breaks_words_alone():
    row = ("root_tilting_stiffness", "1234567.25", "how far the clamp of a beam gives way as it is turned")
    table = make_table(("name", ">value", "what it is"), [row])
    out = console(44)
    print_table(out, table)
    text = out.file.getvalue()
    assert re.search("root_tilting_stiffness +1234567.25", text)
    assert len(text.splitlines()) > 5
    assert not any(line.endswith(" ") for line in text.splitlines())


def test_an_item_longer_than_a_line_is_wrapped_without_separators():
    out = console(40)
    listed(out, "noise", ["0.2 N m", "told by what the past does not foretell"], ", ")
    assert [line.strip() for line in out.file.getvalue().splitlines()] == [
        "noise       0.2 N m,",
        "told by what the past",
        "does not foretell",
    ]


def test_a_name_too_long_for_its_row_has_a_line_of_its_own():
    name, numbers = "left_shoulder_of_the_second_arm", ["12.345 N m", "6.789", "1.2 → 3.4"]
    out = console(40)
    print_table(out, make_table(("joint", ">noise", ">times", ">left"), [(name, *numbers)]))
    *_, above, row = out.file.getvalue().splitlines()
    assert above.strip() == name
    assert row.split() == " ".join(numbers).split()
    assert len(row) <= 40


# -- words that several pages share ------------------------------------------------------------------------------------


def test_a_sentence_that_begins_with_a_place_or_a_name_keeps_its_letters():
    assert [capital(text) for text in ("leg1/ball_nut has a play", "tool0 carries 2 kg", "w.fx is a reaction", "")] == [
        "leg1/ball_nut has a play",
        "tool0 carries 2 kg",
        "w.fx is a reaction",
        "",
    ]
    assert capital("the base yields") == "The base yields"


def test_of_rows_without_an_answer_eight_are_listed():
    out = console(80)
    print_failures(out, {"unreachable": np.arange(9)}, {})
    assert "9 rows: lines 2, 3, 4, 5, 6, 7, 8, 9, …" in out.file.getvalue()


def test_joint_limits_are_heard_once_each_and_other_warnings_go_their_way():
    with warnings.catch_warnings(record=True) as others:
        warnings.simplefilter("always")
        with limits_heard() as heard:
            for text in ("joint1 is beyond", "joint2 is beyond", "joint1 is beyond"):
                warnings.warn(text, JointLimitWarning, stacklevel=1)
            warnings.warn("something else", UserWarning, stacklevel=1)
    assert list(heard) == ["joint1 is beyond", "joint2 is beyond"]
    assert [str(other.message) for other in others] == ["something else"]
    (remark,) = postures_beyond(heard)
    assert remark.endswith("such as: joint1 is beyond")
    assert postures_beyond({}) == ()
