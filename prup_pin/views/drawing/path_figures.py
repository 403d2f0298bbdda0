"""A path before and after compensation. Needs matplotlib."""

from __future__ import annotations

import numpy as np

from ...compensation import Compensation
from ...spatial import Array
from ..scene.colours import INK
from .plotting import Figure, plain_axes, plain_words, sheet

_BEFORE, _AFTER = "#C2255C", "#0B6AA8"
_PREFIXES = ((1.0, ""), (1e3, "m"), (1e6, "µ"), (1e9, "n"))


@plain_words
def path_figure(found: Compensation) -> Figure:
    """Return what the tool misses along a path before and after compensation, a panel for each coordinate.

    What is left stands beside it at its own scale.
    """
    count = len(found.names)
    figure = sheet(7.2, 1.55 * count + 0.9, None, "constrained")
    grid = figure.subplots(count, 2, sharex=True, squeeze=False)
    time, several = found.commands.time, len(found.commands.run_names) > 1
    across = np.arange(1, len(found) + 1) if several else time
    for row, (name, unit) in enumerate(zip(found.names, found.units, strict=True)):
        left, right = grid[row]
        errors = found.before[:, row], found.after[:, row]
        factor, prefix = _scale(errors[0])
        left.axhline(0, color=INK, lw=0.6)
        left.plot(across, factor * errors[0], color=_BEFORE, lw=1.4, label="before")
        left.plot(across, factor * errors[1], color=_AFTER, lw=1.4, label="after")
        left.set_ylabel(f"{name} [{prefix}{unit}]")
        factor, prefix = _scale(errors[1])
        right.axhline(0, color=INK, lw=0.6)
        right.plot(across, factor * errors[1], color=_AFTER, lw=1.2)
        right.set_ylabel(f"{name} [{prefix}{unit}]")
    grid[0, 0].set_title("What the loaded tool misses", fontsize=10, color=INK)
    grid[0, 1].set_title("What compensation leaves of it", fontsize=10, color=INK)
    lines, words = grid[0, 0].get_legend_handles_labels()
    figure.legend(lines, words, frameon=False, fontsize=8, ncols=2, loc="outside upper left")
    for axes in grid[-1]:
        axes.set_xlabel("row" if several else "time [s]")
    for axes in grid.flat:
        plain_axes(axes, 8, None)
    return figure


def _scale(values: Array) -> tuple[float, str]:
    """Return the factor and the prefix with which the largest value is between 1 and 1000."""
    largest = float(np.abs(np.nan_to_num(values)).max(initial=0.0))
    for factor, prefix in _PREFIXES:
        if factor * largest >= 1:
            return factor, prefix
    return _PREFIXES[-1] if largest else _PREFIXES[1]
