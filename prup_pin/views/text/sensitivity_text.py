"""'Stiffen this first': what a per cent of each value does to the deflection along the load, as text."""

from __future__ import annotations

from rich.console import Console

from ...numbers import fixed, number
from ...sensitivity import Sensitivity
from ...spatial import wrench_text
from .quantities import workshop_text
from .terminal import heading, make_table, paragraph, print_table

#: Lines that are printed; JSON holds all.
_MOST = 12


def print_stiffen_first(out: Console, sensitivity: Sensitivity) -> None:
    """Print the values that change the deflection along the load the most. Raises InputError where there is none."""
    lines = sensitivity.stiffen_first
    load = wrench_text(sensitivity.loaded.wrench)
    heading(out, "Stiffen this first:", f"% of the deflection along the load ({load}) per % of the value")
    heavier = any(line.per_kilogram is not None for line in lines[:_MOST])
    columns = [("parameter", "left"), ("value", "right"), ("% per %", "right")]
    table = make_table(*columns, *([("% per kg", "right")] if heavier else []))
    percents = fixed([line.percent for line in lines[:_MOST]], 3)
    for line, percent in zip(lines, percents, strict=False):
        value = workshop_text(line.parameter.value, line.parameter.unit)
        gained = "" if line.per_kilogram is None else number(line.per_kilogram, 3)
        table.add_row(line.parameter.name, value, percent, *([gained] if heavier else []))
    print_table(out, table)
    if len(lines) > _MOST:
        paragraph(out, f"{len(lines) - _MOST} more move it less; --json FILE writes all.")
