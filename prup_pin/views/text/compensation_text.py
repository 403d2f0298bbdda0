"""A compensation as text for a terminal: what the path missed, what the commands leave."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich.console import Console
from rich.text import Text

from ...compensation import Compensation
from ...laws import Effect
from ...numbers import number
from ...robot import Robot
from .simulation_text import effect_text, print_failures
from .terminal import heading, listed, make_table, paragraph, print_table

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
    table = make_table(
        ("", "left"), ("before", "right"), ("largest", "right"), ("after", "right"), ("largest", "right"), ("", "left")
    )
    for column, (name, unit) in enumerate(zip(found.names, found.units, strict=True)):
        both = np.isfinite(found.after[:, column])
        cells = []
        for errors in (found.before, found.after):
            error = 1e6 * errors[both, column]
            sizes = (np.sqrt(np.mean(error**2)), np.abs(error).max()) if len(error) else (np.nan, np.nan)
            cells += [f"< {_ROUNDING:g}" if size < _ROUNDING else number(float(size), 4) for size in sizes]
        table.add_row(name, *cells, "µm" if unit == "m" else "µrad")
    print_table(out, table)
    moved = [
        f"{name} by up to {_largest(found, name)} {'mm' if robot.mechanism.joint(name).unit == 'm' else 'mrad'}"
        for name in robot.mechanism.actuated
    ]
    listed(out, "moved", moved, ", ")
    remarks = [*found.path.recording.remarks, *found.remarks]
    if remarks:
        heading(out, "Remarks")
        for text in remarks:
            paragraph(out, text, "- ")


def _largest(found: Compensation, name: str) -> str:
    """Return the largest correction of an actuator [mm or mrad]."""
    moved = found.corrections[name]
    known = moved[np.isfinite(moved)]
    return number(1e3 * float(np.abs(known).max()), 4) if len(known) else "-"
