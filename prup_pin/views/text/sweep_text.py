"""What a sweep came to, as text: how many poses answered, and how each number is spread over them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from rich.console import Console
from rich.text import Text

from ...numbers import counted, fixed, readable_unit
from ...sweep import QUANTITIES, SweepFile, SweepResult
from .terminal import bullets, heading, listed, make_table, paragraph, print_table
from .values import coordinate_text

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
    bullets(out, "Remarks", found.remarks)


def _print_spread(out: Console, found: SweepResult | SweepFile, ok: np.ndarray) -> None:
    table = make_table(
        ("", "left"), ("least", "right"), ("mean", "right"), ("95 %", "right"), ("largest", "right"), ("unit", "left")
    )
    rows, large = 0, []
    for name in found:
        entries = QUANTITIES[name].entries(found.mechanism)
        if len(entries) > _ENTRIES:
            large.append(name)
            continue
        values = found[name][ok]
        for labels, place in entries:
            entry = QUANTITIES[name].entry(values, place)
            finite = entry[np.isfinite(entry)]
            if not len(finite):
                continue
            unit = QUANTITIES[name].unit_of(found.mechanism, place)
            unit, factor = ("°", 180 / np.pi) if unit == "rad" else readable_unit(float(np.abs(finite).max()), unit)
            shown = (finite.min(), finite.mean(), np.percentile(finite, 95), finite.max())
            table.add_row(" ".join((name, *labels)), *fixed(factor * value for value in shown), unit)
            rows += 1
    if rows:
        heading(out, "Over the poses that answered")
        print_table(out, table)
    if large:
        listed(out, "in --out", [f"{', '.join(large)}: of each pose more than {_ENTRIES} numbers, not listed here"])


def axis_text(name: str, kind: str, values: Sequence[float], count: int | None = None) -> str:
    """Return 'theta -30 deg … 30 deg in 41' of an axis' ends, or of one value; a `kind` is 'length' or 'angle'."""
    ends = " … ".join(coordinate_text(value, kind, 4) for value in values)
    return f"{name} {ends}" + ("" if count is None else f" in {count}")
