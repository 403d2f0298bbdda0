"""How far a long computation is: a bar on a terminal, elsewhere a plain line now and then."""

import pytest

from prup_pin.cli import progress
from prup_pin.views.text import terminal


@pytest.fixture
def clock(monkeypatch):
    """A clock that is set by hand [s]."""
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    return now


def test_where_no_bar_can_be_drawn_the_stage_is_told_now_and_then(clock, capsys):
    with progress.stages() as tell:
        for seconds, stage in ((1, "reading"), (11, "which law"), (15, "another law"), (22, "intervals")):
            clock[0] = seconds
            tell(stage, seconds / 25)
    assert capsys.readouterr().err == "which law (44 %), 11 s\nintervals (88 %), 22 s\n"


def test_rows_are_counted_there_too(clock, capsys):
    with progress.rows() as show:
        for seconds in (1, 12, 13):
            clock[0] = seconds
            show(10 * seconds, 200)
    assert capsys.readouterr().err == "120 of 200 rows, 12 s\n"


def test_a_terminal_has_a_bar_and_no_lines(clock, capsys, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    assert terminal.console(stderr=True).is_terminal
    with progress.stages() as tell:
        clock[0] = 30.0
        tell("which law", 0.5)
    shown = capsys.readouterr().err
    assert "which law" in shown
    assert "50 %" not in shown
