"""A machine's life and a fleet in words: what changed when, what is wrong with the drawing, who stands apart."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console

from ...numbers import counted, number, quantity, readable_unit
from .terminal import bullets, heading, listed, paragraph, show_table

if TYPE_CHECKING:  # the command line begins without it
    from ...life.fleet import Fleet, Off, Scatter
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


# -- many devices of one drawing ---------------------------------------------------------------------------------------


def fleet_verdict(fleet: Fleet) -> str:
    """Return what devices have in common, in a sentence or two."""
    said = []
    if fleet.common:
        said.append(f"the drawing is wrong: {'; '.join(map(off_text, fleet.common))}")
    if fleet.outliers:
        said.append("; ".join(f"{item.device} stands apart: {off_text(item)}" for item in fleet.outliers))
    if not said:
        return "the drawing is right as far as these devices tell, and none stands apart"
    return "; ".join(said)


def off_by(item: Off) -> tuple[str, str]:
    """Return ('+771 µm', '+657 to +885 µm'): by how much a parameter is off, and the 95 % interval."""
    ends, unit = np.array([item.value, *item.interval]), item.unit
    if item.relative:
        ends, unit = 100 * np.expm1(ends), "%"
    value, low, high = ends.tolist()
    name, factor = readable_unit(max(abs(low), abs(high)), unit)
    by, least, most = (number(factor * each, 3, True) for each in (value, low, high))
    return f"{by} {name}", f"{least} to {most} {name}"


def off_text(item: Off) -> str:
    """Return 'joint4.y is off by +771 µm (95 %: +657 to +885 µm)', and what it cannot be told from."""
    by, within = off_by(item)
    text = f"{item.parameter} is off by {by} (95 %: {within})"
    return f"{text}, or {' or '.join(item.others)}, which these tests cannot tell from it" if item.others else text


def off_rows(fleet: Fleet) -> list[tuple[str, str, str, str, str]]:
    """Return a row for each error of the drawing and of single devices: where, parameter, by, 95 %, told from."""
    return [
        (item.device or "the drawing", item.parameter, *off_by(item), ", ".join(item.others))
        for item in (*fleet.common, *fleet.outliers)
    ]


def law_texts(fleet: Fleet) -> list[str]:
    """Return each law at its place with the number of devices that have it."""
    return [f"{what}: {counted(count, 'device')} of {len(fleet.devices)}" for what, count in fleet.laws.items()]


def device_rows(fleet: Fleet) -> list[tuple[str, str, str, str]]:
    """Return a row for each device: its name, verdict, what it leaves in multiples of the noise, what it names."""
    return [
        (name, answer.verdict.replace("_", " "), number(answer.left, 3), ", ".join(answer.told) or "nothing")
        for name, answer in zip(fleet.devices, fleet.answers, strict=True)
    ]


def scatter_rows(fleet: Fleet) -> list[tuple[str, str, str, str, str]]:
    """Return a row for each kind: how many parameters, its spread, the 95 % interval, what was declared."""
    return [
        (
            item.kind,
            str(item.count),
            _size(item.value, item) if item.told else "not told",
            f"{_size(item.interval[0], item)} to {_size(item.interval[1], item)}",
            "" if item.declared is None else _size(item.declared, item),
        )
        for item in fleet.scatter
    ]


def _size(value: float, item: Scatter) -> str:
    if not np.isfinite(value):
        return "any"
    if item.unit == "relative":
        return f"{number(100 * value, 3)} %"
    return quantity(value, item.unit.partition(",")[0])


def print_fleet(out: Console, fleet: Fleet) -> None:
    """Print what is common, who stands apart, the spreads, the laws by how many devices have them, and remarks."""
    paragraph(out, f"{fleet_verdict(fleet)}.")
    if fleet.scatter:
        heading(out, "By how much devices scatter", "(one standard deviation; tolerances.json holds what is told)")
        columns = ("kind", ">parameters", ">scatters by", ">95 %", ">declared")
        show_table(out, columns, scatter_rows(fleet))
    bullets(out, "What they have that the robot file lacks", law_texts(fleet))
    unknown = [name for name, answer in zip(fleet.devices, fleet.answers, strict=True) if answer.unknown]
    bullets(out, "With something that no law explains", unknown)
    bullets(out, "Remarks", fleet.remarks)
