"""A fleet in words: what is wrong with the drawing, who stands apart, by how much kinds of parameters scatter."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console

from ...numbers import counted, number, quantity, readable_unit
from .terminal import bullets, heading, paragraph, show_table

if TYPE_CHECKING:  # the command line begins without it
    from ...life.fleet import Fleet, Off, Scatter


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
