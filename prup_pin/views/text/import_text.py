"""What became of a log, as text: which column is which, in which unit, what was done, what was not used."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich.console import Console
from rich.text import Text

from ...imports import Conversion, Log, LogMap
from ...imports.map import Column
from ...imports.units import SI_WORDS, dimension_of
from ...numbers import counted, number
from ...recordings import suspicions
from ...recordings.columns import unit_of
from ...spatial import WRENCH_NAMES
from .terminal import bullets, heading, listed, make_table, paragraph, print_table


def print_log(out: Console, log: Log) -> None:
    """Print what a log holds, stream by stream."""
    out.print(Text(log.path, style="bold"))
    for stream in log.streams:
        size = f"{counted(len(stream), 'row')}, {counted(len(stream.columns), 'column')}"
        listed(out, "", [f"{stream.name}: {size} of numbers"])


def print_conversion(out: Console, log: Log, plan: LogMap, done: Conversion) -> None:
    """Print a recording column by column beside the columns it came from, and the remarks."""
    print_log(out, log)
    recording = done.recording
    span = recording.time[-1] - recording.time[0]
    steps = np.diff(recording.time)
    rate = 1 / float(np.median(steps)) if len(steps) else 0.0
    sizes = f"{counted(len(recording), 'row')}, {number(float(span), 4)} s, {number(rate, 4)} rows a second"
    listed(out, "recording", [sizes])
    heading(out, "Columns", "(SI = sign x scale x value + offset)")
    names = [("recording", "left"), ("column of the log", "left"), ("in", "left")]
    table = make_table(*names, ("from", "right"), ("to", "right"), ("", "left"))
    for name, column in plan.columns.items():
        values = _values(done, name)
        ends = [number(float(x), 4) for x in (np.nanmin(values), np.nanmax(values))] if values is not None else ["", ""]
        factor = f" x {number(column.sign * column.scale, 4)}" if column.sign * column.scale != 1 else ""
        table.add_row(name, column.source, column.unit.name + factor, *ends, _si_of(name, column))
    print_table(out, table)
    for group in plan.motors:
        paragraph(out, f"{', '.join(group.joints)} from the motors {', '.join(group.names)} by their matrix.", "- ")
    odd = [*done.remarks, *suspicions(recording), *recording.remarks]
    bullets(out, "Remarks", odd)
    _print_unused(out, (*done.unused, *log.left_out))


def _si_of(name: str, column: Column) -> str:
    """Return the SI unit of a column of the recording."""
    dimension = dimension_of(column.unit.name)
    return SI_WORDS[dimension] if dimension is not None else unit_of(name)


def _print_unused(out: Console, names: Sequence[str]) -> None:
    if names:
        heading(out, "Not used")
        listed(out, "", names, indent=2)


def _values(done: Conversion, name: str) -> np.ndarray | None:
    """Return a column of the recording, None of one that motors took the place of or that holds no number."""
    recording = done.recording
    prefix, _, rest = name.partition(".")
    groups = {"q": recording.positions, "qd": recording.velocities, "qdd": recording.accelerations,
              "tau": recording.efforts}  # fmt: skip
    if prefix in groups:
        values = groups[prefix].get(rest)
    elif prefix == "w":
        values = recording.wrench[:, WRENCH_NAMES.index(rest)] if recording.wrench is not None else None
    elif prefix in ("p", "r", "g"):
        body, _, axis = rest.rpartition(".")
        whole = {"p": recording.position, "r": recording.rotation, "g": recording.gravity}[prefix]
        marked = {"p": recording.markers, "r": recording.marker_rotations}.get(prefix, {})
        source = marked.get(body) if body else whole
        values = None if source is None else source[:, "xyz".index(axis)]
    else:
        values = recording.temperature if name == "temperature" else None
    return values if values is not None and np.isfinite(values).any() else None
