"""Sweeps and compensations as text: how many poses answered, how numbers are spread, what paths missed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from rich.console import Console

from ...compensation import Compensation
from ...laws import Effect
from ...numbers import counted, fixed, number, readable_unit
from ...robot import Robot
from ...sweep import QUANTITIES, Quantity, SweepFile, SweepResult
from .bench_tests import effects_told, print_failures
from .terminal import bullets, heading, in_options, listed, paragraph, show_table, title
from .values import clean, coordinate_text

#: Quantities with more entries are named, not listed.
_ENTRIES = 8
#: Of a value as a share of the largest of its unit, what is rounding; and of displacements what is nothing [m, rad].
_ROUNDING, _NOTHING = 1e-10, {"m": 1e-15, "rad": 1e-15}


def print_sweep(out: Console, found: SweepResult | SweepFile, about: Mapping[str, str]) -> None:
    """Print the summary of a sweep; `about` says where it went and under what."""
    robot = found.mechanism
    title(out, f"{robot.name}, {counted(found.status.size, 'pose')}")
    for label, text in about.items():
        listed(out, label, [text])
    counts = found.counts
    listed(out, "status", [f"{count} {word}" for word, count in counts.items()], "; ")
    for word, reason in found.reasons.items():
        if word != "ok":
            paragraph(out, f"{word}: {reason}", "  ")
    ok = found.status == "ok"
    if ok.any():
        _print_spread(out, found, ok)
    bullets(out, "Remarks", [in_options(text) for text in found.remarks])


def _print_spread(out: Console, found: SweepResult | SweepFile, ok: np.ndarray) -> None:
    poses = np.flatnonzero(ok)
    rows, places, listed_here, large = [], [], [], []
    for name in found:
        quantity = QUANTITIES[name]
        if len(quantity.entries(found.mechanism)) > _ENTRIES:
            large.append(name)
            continue
        listed_here.append(quantity)
        for entry in entries_of(found, name, found[name][ok]):
            known = np.flatnonzero(np.isfinite(entry.values))
            if not len(known):
                continue
            finite = entry.values[known]
            unit, factor = entry.readable(finite)
            texts = fixed(factor * np.array([finite.min(), finite.mean(), np.percentile(finite, 95), finite.max()]))
            rows.append((entry.title, *texts, unit))
            if texts[0] != texts[-1]:
                ends = (poses[known[at]] for at in (finite.argmin(), finite.argmax()))
                places.append((entry.title, *(_where(found, int(pose)) for pose in ends)))
    if rows:
        heading(out, "Over the poses that answered")
        show_table(out, ("", ">least", ">mean", ">95 %", ">largest", "unit"), rows)
        for quantity in listed_here:
            paragraph(out, f"{quantity.name}: {summary_of(quantity)}", "  ")
    if places:
        heading(out, "Where")
        show_table(out, ("", "least at", "largest at"), places)
    if large:
        listed(out, "in --out", [f"{', '.join(large)}: of each pose more than {_ENTRIES} numbers, not listed here"])


class Entry(NamedTuple):
    """One number of a quantity at many poses [`unit`, SI]; `angle`: a pose's, told in degrees."""

    title: str
    labels: tuple[str, ...]
    unit: str
    values: np.ndarray
    angle: bool

    def readable(self, beside: np.ndarray) -> tuple[str, float]:
        """Unit in which people read such values, and how many of it one SI unit is: mm at most, % of shares."""
        if self.angle:
            return "°", 180 / np.pi
        unit, factor = readable_unit(float(np.nanmax(np.abs(beside), initial=0.0)), self.unit)
        return ("mm", 1e3) if unit == "m" else (unit, factor)


def entries_of(found: SweepResult | SweepFile, name: str, values: np.ndarray) -> list[Entry]:
    """Return a quantity's values (..., *shape) entry by entry; what is rounding beside others of its unit is zero."""
    quantity, mechanism = QUANTITIES[name], found.mechanism
    made, largest = [], dict[str, float]()
    for labels, place in quantity.entries(mechanism):
        unit, entry = quantity.unit_of(mechanism, place), quantity.entry(values, place)
        size = float(np.abs(entry).max(initial=0.0, where=np.isfinite(entry)))
        largest[unit] = max(largest.get(unit, _NOTHING.get(unit, 0.0) / _ROUNDING), size)
        angle = unit == "rad" and not quantity.elastic
        made.append(Entry(quantity.title(mechanism, place), labels, unit, entry, angle))
    rounded = [
        each._replace(values=np.where(np.abs(each.values) < _ROUNDING * largest[each.unit], 0.0, each.values))
        for each in made
    ]
    return [each._replace(unit="%", values=100 * each.values) for each in rounded] if name == "shares" else rounded


def summary_of(quantity: Quantity) -> str:
    """Return what a quantity is, without the marks of arguments in Python."""
    return quantity.summary.replace("`", "")


def _where(found: SweepResult | SweepFile, pose: int) -> str:
    """Return the coordinates of a pose that are not the same at all poses."""
    units = found.coordinate_units
    moved = {name: value for name, value in found.coordinates_of(pose).items() if name not in found.fixed}
    return ", ".join(f"{name} {coordinate_text(clean(value), units[name], 4, '°')}" for name, value in moved.items())


# -- a compensation: what the path missed, what the commands leave -----------------------------------------------------


#: What is smaller is not told apart from nothing [um, urad].
_LEAST_ERROR = 1e-2


def print_compensation(out: Console, robot: Robot, effects: Sequence[Effect], found: Compensation) -> None:
    """Print what the tool missed before and after, and the largest correction of each actuator."""
    title(out, f"{robot.name}, loaded, put where it was wanted")
    listed(out, "with", effects_told(effects), "; ")
    count = found.status.count("ok")
    good = "all compensated" if count == len(found) else f"{count} compensated"
    listed(out, "rows", [f"{len(found)}, {good}", f"{found.passes} passes of the loaded robot"], "; ")
    print_failures(out, found.failures, found.reasons)
    heading(out, "What the tool misses", "(root mean square and largest of all rows, by the loaded robot)")
    rows = []
    for column, (name, unit) in enumerate(zip(found.names, found.units, strict=True)):
        both = np.isfinite(found.after[:, column])
        cells = []
        for errors in (found.before, found.after):
            error = 1e6 * errors[both, column]
            sizes = (np.sqrt(np.mean(error**2)), np.abs(error).max()) if len(error) else (np.nan, np.nan)
            cells += [f"< {_LEAST_ERROR:g}" if size < _LEAST_ERROR else number(float(size), 4) for size in sizes]
        rows.append((name, *cells, "µm" if unit == "m" else "µrad"))
    show_table(out, ("", ">before", ">largest", ">after", ">largest", ""), rows)
    moved = []
    for name in robot.mechanism.actuated:
        known = found.corrections[name][np.isfinite(found.corrections[name])]
        largest = number(1e3 * float(np.abs(known).max()), 4) if len(known) else "-"
        moved.append(f"{name} by up to {largest} {'mm' if robot.mechanism.joint(name).unit == 'm' else 'mrad'}")
    listed(out, "moved", moved, ", ")
    bullets(out, "Remarks", [*found.path.recording.remarks, *found.remarks])
