"""Sweeps and compensations as text: how many poses answered, how numbers are spread, what paths missed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from rich.console import Console
from rich.text import Text

from ...compensation import Compensation
from ...laws import Effect
from ...numbers import counted, fixed, number, readable_unit
from ...robot import Robot
from ...sweep import QUANTITIES, Quantity, SweepFile, SweepResult
from .bench_tests import effect_text, print_failures
from .terminal import bullets, heading, in_options, listed, paragraph, show_table
from .values import clean, coordinate_text

#: Quantities with more entries are named, not listed.
_ENTRIES = 8


def print_sweep(out: Console, found: SweepResult | SweepFile, about: Mapping[str, str]) -> None:
    """Print the summary of a sweep; `about` says where it went and under what."""
    robot = found.mechanism
    out.print(Text(f"{robot.name}, {counted(found.status.size, 'pose')}", style="bold"))
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
        entries = quantity.entries(found.mechanism)
        if len(entries) > _ENTRIES:
            large.append(name)
            continue
        values = found[name][ok]
        listed_here.append(quantity)
        for _, place in entries:
            entry = quantity.entry(values, place)
            known = np.flatnonzero(np.isfinite(entry))
            if not len(known):
                continue
            finite, title = entry[known], quantity.title(found.mechanism, place)
            unit, factor = _readable(quantity, quantity.unit_of(found.mechanism, place), finite)
            shown = (finite.min(), finite.mean(), np.percentile(finite, 95), finite.max())
            texts = fixed(factor * value for value in shown)
            rows.append((title, *texts, unit))
            if texts[0] != texts[-1]:
                ends = (poses[known[at]] for at in (finite.argmin(), finite.argmax()))
                places.append((title, *(_where(found, int(pose)) for pose in ends)))
    if rows:
        heading(out, "Over the poses that answered")
        show_table(out, ("", ">least", ">mean", ">95 %", ">largest", "unit"), rows)
        for quantity in listed_here:
            paragraph(out, f"{quantity.name}: {quantity.summary}", "  ")
    if places:
        heading(out, "Where")
        show_table(out, ("", "least at", "largest at"), places)
    if large:
        listed(out, "in --out", [f"{', '.join(large)}: of each pose more than {_ENTRIES} numbers, not listed here"])


def _readable(quantity: Quantity, unit: str, values: np.ndarray) -> tuple[str, float]:
    """Return the unit in which people read values, and how many of it one SI unit is."""
    if quantity.name == "shares":
        return "%", 100.0
    return ("°", 180 / np.pi) if unit == "rad" else readable_unit(float(np.abs(values).max()), unit)


def _where(found: SweepResult | SweepFile, pose: int) -> str:
    """Return the coordinates of a pose that are not the same at all poses."""
    units = found.coordinate_units
    moved = {name: value for name, value in found.coordinates_of(pose).items() if name not in found.fixed}
    return ", ".join(f"{name} {coordinate_text(clean(value), units[name], 4, '°')}" for name, value in moved.items())


# -- a compensation: what the path missed, what the commands leave -----------------------------------------------------


#: What is smaller is rounding [um, urad].
_ROUNDING = 1e-2


def print_compensation(out: Console, robot: Robot, effects: Sequence[Effect], found: Compensation) -> None:
    """Print what the tool missed before and after, and the largest correction of each actuator."""
    out.print(Text(f"{robot.name}, loaded, put where it was wanted", style="bold"))
    listed(out, "with", [effect_text(effect) for effect in effects] or ["nothing added to the robot file"], "; ")
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
            cells += [f"< {_ROUNDING:g}" if size < _ROUNDING else number(float(size), 4) for size in sizes]
        rows.append((name, *cells, "µm" if unit == "m" else "µrad"))
    show_table(out, ("", ">before", ">largest", ">after", ">largest", ""), rows)
    moved = [
        f"{name} by up to {_largest(found, name)} {'mm' if robot.mechanism.joint(name).unit == 'm' else 'mrad'}"
        for name in robot.mechanism.actuated
    ]
    listed(out, "moved", moved, ", ")
    remarks = [*found.path.recording.remarks, *found.remarks]
    bullets(out, "Remarks", remarks)


def _largest(found: Compensation, name: str) -> str:
    """Return the largest correction of an actuator [mm or mrad]."""
    moved = found.corrections[name]
    known = moved[np.isfinite(moved)]
    return number(1e3 * float(np.abs(known).max()), 4) if len(known) else "-"
