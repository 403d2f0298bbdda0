"""A machine's life in words: the verdict, each change with its moment, values over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console

from ...numbers import counted, number, quantity, readable_unit
from .terminal import bullets, heading, listed, paragraph, show_table

if TYPE_CHECKING:  # the command line begins without it
    from ...life.life import Change, Life, Series


def life_verdict(life: Life) -> str:
    """Return what happened during a life, in one sentence."""
    changed = [item for item in life.changes if item.begin is not None]
    if not changed:
        if life.verdict == "unexplained":
            return "something that no law explains is in some of the recordings; no law or parameter is seen to change"
        return "nothing has changed beyond what the tests could know"
    sentences = [change_sentence(life, item) for item in changed]
    if all(item.sensor for item in changed):
        what = "the tracker was" if {item.sensor for item in changed} == {"pose_sensor"} else "sensors were"
        return f"only {what} moved: {'; '.join(sentences)}"
    return "; ".join(sentences)


def change_sentence(life: Life, change: Change) -> str:
    """Return a change with its moment."""
    if change.begin is None:
        return f"{change.statement}: it was there from the first recording on, which alone did not tell it"
    if change.shape == "ramp":
        told = f"{change.statement}, in proportion to time, from {_named(life, change.begin)} to the last"
    else:
        told = f"{change.statement}, between {_named(life, change.begin)} and {_named(life, change.begin + 1)}"
    first, last = change.between
    if first == last:
        return told
    return f"{told} (it may have begun after any of recordings {first + 1} to {last + 1}: 95 %)"


def _named(life: Life, place: int) -> str:
    """Return 'recording 6 (2026-03-01)'."""
    return f"recording {place + 1} ({life.dates[place] or life.names[place]})"


def by_how_much(change: Change) -> list[tuple[str, str, str]]:
    """Return (parameter, by how much, 95 % interval) of a change."""
    rows = []
    for name, fitted in change.parameters.items():
        unit, factor = readable_unit(max(map(abs, (fitted.value, *fitted.interval))), fitted.unit)
        value, low, high = (number(factor * each, 3, True) for each in (fitted.value, *sorted(fitted.interval)))
        rows.append((name.replace("_", " "), f"{value} {unit}".strip(), f"{low} to {high} {unit}".strip()))
    return rows


def what_is_followed(series: Series) -> str:
    """Return 'backlash at leg2/nut: half gap'."""
    return f"{series.physics.replace('_', ' ')} at {series.location}: {series.parameter.replace('_', ' ')}"


def values_over_time(series: Series) -> tuple[str, list[str]]:
    """Return a unit, and a parameter's value in each recording in it, half its 95 % interval beside it."""
    unit, factor = readable_unit(float(np.abs(series.value).max()), series.unit)
    return unit, [
        f"{number(factor * value, 3)} ±{number(factor * (high - low) / 2, 2)}"
        for value, low, high in zip(series.value, series.low, series.high, strict=True)
    ]


def seen_texts(life: Life) -> list[str]:
    """Return what the smallest change of each followed value is that would have been seen in the middle of the life."""
    return [
        f"{what_is_followed(item)}: {quantity(item.seen, item.unit, 2)}"
        for item in life.series
        if item.seen is not None
    ]


def recording_rows_of(life: Life) -> list[tuple[str, str, str, str, str]]:
    """Return a row for each recording: its number, name, date, what it leaves, what it names for itself."""
    rows = []
    for place, (name, day, answer) in enumerate(zip(life.names, life.dates, life.answers, strict=True), 1):
        rows.append((str(place), name, day, number(answer.left, 3), ", ".join(answer.told) or "nothing"))
    return rows


def print_life(out: Console, life: Life) -> None:
    """Print the verdict, the changes, the values over time, what each recording said, and remarks."""
    paragraph(out, f"{life_verdict(life)}.")
    for place, change in enumerate(life.changes, 1):
        heading(out, f"{place}. {change.physics.replace('_', ' ')} at {change.location}")
        if len(life.changes) > 1:
            paragraph(out, change_sentence(life, change))
        listed(out, "by", [f"{name} {value} ({interval})" for name, value, interval in by_how_much(change)])
        if change.others:
            paragraph(out, f"these tests cannot tell it from {', '.join(change.others)}")
    if life.series:
        heading(out, "Over time", "(± half of the 95 % interval)")
        for item in life.series:
            unit, cells = values_over_time(item)
            listed(out, "", [f"{what_is_followed(item)} [{unit}]" if unit else what_is_followed(item)])
            listed(out, "", [f"{place}: {cell}" for place, cell in enumerate(cells, 1)], indent=4)
    bullets(out, "A step in the middle would have been seen from", seen_texts(life))
    heading(out, counted(len(life.names), "recording"), f"in the order of {life.ordered_by}; named: beside the first")
    show_table(out, (">", "recording", "date", ">left [noise]", "named"), recording_rows_of(life))
    bullets(out, "Remarks", life.remarks)
