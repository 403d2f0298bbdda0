"""Maps of a sweep: any quantity over two coordinates, shares of modules, two models side by side; a path's errors.

Needs matplotlib.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil
from typing import Any

import numpy as np

from ...compensation import Compensation
from ...errors import InputError
from ...numbers import readable_unit
from ...spatial import Array
from ...sweep import QUANTITIES, SweepFile, SweepResult
from ..scene.colours import AFTER, FAINT, FOUND, INK, map_rgb
from ..text.many_poses import entries_of, summary_of
from ..text.values import coordinate_text
from .plotting import Figure, ListedColormap, MaxNLocator, Patch, panels, plain_axes, plain_words, sheet

#: Quantities that no map shows: where the robot stands, and matrices.
_NO_MAP = {"C", "K", "K_yielding", "q", "softest"}
#: Modules with a map of their own, and colours of those that dominate.
_SHARES = 5
_DOMINANT = ("#4477aa", "#ee6677", "#228833", "#ccbb44", "#66ccee", "#aa3377", "#bbbbbb")
#: Decimals of a share that are more than rounding: of parts that share alike the robot file's first comes first.
_SHARE_DIGITS = 9
#: Dashes and marks of curves in one drawing, so that two that are one are seen as two.
_STYLES = ("-", (0, (4, 2)), (0, (1, 1.5)), (0, (6, 2, 1, 2)))
_MARKS = "os^Dv"
_SIZE = 2.9  # of a map [in]

#: A sweep in memory or in a file.
Swept = SweepResult | SweepFile
#: A title, its unit, and the values over two axes (n, m), or over one (n,).
Panel = tuple[str, str, Array]


def check_drawn(names: Sequence[str], scattered: bool = False) -> None:
    """Raise InputError where a sweep of these quantities has no picture, or where its poses span no grid."""
    if scattered:
        raise InputError(
            "scattered poses, or one alone, have no map; give coordinates as rising arrays, which span a grid (on the "
            "command line --over x=FROM..TO:COUNT without --draws)"
        )
    if set(names) <= _NO_MAP:
        listed = ", ".join(names)
        raise InputError(f"nothing of {listed} can be drawn as a map; ask for extremes, shares or ksi as well")


def figures_of(found: Swept) -> dict[str, Figure]:
    """Return the pictures of a sweep over one or two coordinates, by the names of what they show.

    Of more than two that vary the others stand at their middle. Raises InputError for scattered poses.
    """
    check_drawn(list(found), scattered=not found._places.axes)
    figures = {}
    for name in found:
        if name == "shares":
            figures["shares"] = share_figure(found)
        elif name not in _NO_MAP:
            figures[name] = map_figure(found, name)
    return figures


@plain_words
def map_figure(found: Swept, name: str) -> Figure:
    """Return maps of one quantity, a panel for each of its entries; of one axis curves."""
    panels = _panels(found, name)
    summary = summary_of(QUANTITIES[name])
    if len(found._places.axes) == 1:
        return _curves(found, panels, summary, name)
    figure, grid = _sheets(len(panels))
    figure.suptitle(_heading(found, summary), fontsize=10, color=INK, wrap=True)
    for axes, panel in zip(grid, panels, strict=True):
        _draw(axes, found, panel, _levels(panel[2]))
    return figure


@plain_words
def beside_figure(
    columns: Sequence[tuple[str, Swept]],
    names: Sequence[str],
    title: str,
    keep: Mapping[str, Sequence[str]] | None = None,
) -> Figure:
    """Return maps of several sweeps over the same grid side by side, a row for each entry; each row has one scale.

    keep: of quantities by name, the entries that are drawn; all of others.
    """
    swept = [found for _, found in columns]
    each = [
        [panel for name in names for panel in _panels(found, name, (keep or {}).get(name), beside=swept)]
        for found in swept
    ]
    count, wide = len(each[0]), 2 if len(each[0]) > 4 else 1
    rows, across = ceil(count / wide), wide * len(columns)
    figure = sheet(_SIZE * 1.25 * across + 0.4, _SIZE * rows + 0.7, None, "constrained")
    grid = panels(figure, count * len(columns), across)
    figure.suptitle(title, fontsize=11, color=INK)
    for place in range(count):
        levels = _levels(np.concatenate([panels[place][2].ravel() for panels in each]))
        for column, (word, found) in enumerate(columns):
            title, unit, values = each[column][place]
            _draw(grid[place * len(columns) + column], found, (f"{word}: {title}", unit, values), levels)
    return figure


@plain_words
def share_figure(found: Swept) -> Figure:
    """Return which module has the largest share of the work where, and the shares of those that matter most."""
    modules = [module.name for module in found.mechanism.modules]
    if len(found._places.axes) == 1:
        means = np.nanmean(found["shares"], axis=0)
        most = np.argsort(-np.round(means, _SHARE_DIGITS), kind="stable")[:_SHARES]
        panels = [(modules[index], "%", 100 * found["shares"][:, index]) for index in most]
        return _curves(found, panels, "largest shares of the work", "share of the work")
    shares = _plane(found, found["shares"])
    flat = shares.reshape(-1, len(modules))
    most = np.argsort(-np.round(np.nan_to_num(flat).max(axis=0), _SHARE_DIGITS), kind="stable")[:_SHARES]
    figure, grid = _sheets(len(most) + 1)
    known = np.isfinite(shares).all(axis=-1)
    largest = np.where(known, np.round(np.nan_to_num(shares), _SHARE_DIGITS).argmax(axis=-1), -1)
    often = np.bincount(largest[known], minlength=len(modules))
    there = [index for index in np.argsort(-often, kind="stable") if often[index]]
    shown = there[: len(_DOMINANT) - 1]
    codes = np.full(largest.shape, np.nan)
    for place, index in enumerate(shown):
        codes[largest == index] = place
    codes[known & np.isnan(codes)] = len(_DOMINANT) - 1
    (_, x), (_, y) = _axes(found)
    grid[0].pcolormesh(
        x, y, codes.T, cmap=ListedColormap(_DOMINANT), vmin=-0.5, vmax=len(_DOMINANT) - 0.5, rasterized=True
    )
    grid[0].set_title("largest share of the work", fontsize=9, color=INK)
    handles = [Patch(color=_DOMINANT[place], label=modules[index]) for place, index in enumerate(shown)]
    if len(there) > len(shown):
        handles.append(Patch(color=_DOMINANT[-1], label="another"))
    grid[0].legend(handles=handles, fontsize=6, loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=2, frameon=False)
    _label(grid[0], found)
    levels = _levels(100 * shares[..., most])
    for axes, index in zip(grid[1:], most, strict=True):
        _draw(axes, found, (modules[index], "%", 100 * shares[..., index]), levels)
    return figure


# -- panels ------------------------------------------------------------------------------------------------------------


def _panels(found: Swept, name: str, keep: Sequence[str] | None = None, beside: Sequence[Swept] = ()) -> list[Panel]:
    """Return the entries of a quantity with their titles, over the axes that are drawn; units fit `beside` too."""
    several = [entries_of(each, name, _plane(each, each[name])) for each in (found, *beside)]
    panels = []
    for entry, *others in zip(*several, strict=True):
        if keep is None or set(entry.labels) & set(keep):
            unit, factor = entry.readable(np.concatenate([each.values.ravel() for each in (entry, *others)]))
            panels.append((entry.title, unit, factor * entry.values))
    return panels


def _with_unit(words: str, unit: str) -> str:
    return f"{words} [{unit}]" if unit else words


def _axes(found: Swept) -> list[tuple[str, Array]]:
    """Return the axes that are drawn, the last ones, by what they are called, in mm or degrees."""
    shown = {"m": ("mm", 1e3), "rad": ("°", 180 / np.pi)}
    units = {name: shown.get(unit, (unit, 1.0)) for name, unit in found.coordinate_units.items()}
    axes = list(found._places.axes.items())[-2:]
    return [(_with_unit(name, units[name][0]), units[name][1] * axis) for name, axis in axes]


def _plane(found: Swept, values: Array) -> Array:
    """Return values over the axes that are drawn; other axes stand at their middle."""
    for axis in list(found._places.axes.values())[:-2]:
        values = values[len(axis) // 2]
    return values


def _heading(found: Swept, summary: str) -> str:
    """Return what is drawn of which robot, and where the coordinates stand that are not drawn."""
    units = found.coordinate_units
    held = dict(found._places.fixed)
    held |= {name: axis[len(axis) // 2] for name, axis in list(found._places.axes.items())[:-2]}
    others = ", ".join(f"{name} {coordinate_text(value, units[name], 4, '°')}" for name, value in held.items())
    return f"{found.mechanism.name}: {summary}{others and f'{chr(10)}at {others}'}"


# -- drawing -----------------------------------------------------------------------------------------------------------


def _sheets(count: int) -> tuple[Figure, list[Any]]:
    """Return a figure with so many panels, three in a row."""
    columns = min(count, 3)
    figure = sheet(_SIZE * 1.25 * columns + 0.3, _SIZE * ceil(count / columns) + 0.5, None, "constrained")
    return figure, panels(figure, count, columns)


def _curves(found: Swept, panels: Sequence[Panel], summary: str, what: str) -> Figure:
    """Draw entries of `what` over one axis, those of one unit together; one that lies on another shows through it."""
    by_unit: dict[str, list[Panel]] = {}
    for panel in panels:
        by_unit.setdefault(panel[1], []).append(panel)
    figure = sheet(_SIZE * 1.9 * len(by_unit) + 0.3, _SIZE + 0.7, None, "constrained")
    figure.suptitle(_heading(found, summary), fontsize=10, color=INK, wrap=True)
    ((along, across),) = _axes(found)
    for axes, (unit, group) in zip(figure.subplots(1, len(by_unit), squeeze=False)[0], by_unit.items(), strict=True):
        for place, (title, _, values) in enumerate(group):
            colour, style = _DOMINANT[place % len(_DOMINANT)], _STYLES[place % len(_STYLES)]
            # about six marks on a curve, each curve's beside those of others
            every = max(len(group), len(across) // 6)
            first = place * every // len(group)
            marks = {"marker": _MARKS[place % len(_MARKS)], "markevery": (first, every), "ms": 4}
            axes.plot(across, values, lw=1.8, ls=style, color=colour, label=title, **marks)
        axes.set_xlabel(along, fontsize=8)
        axes.set_ylabel(_with_unit(group[0][0] if len(group) == 1 else what, unit), fontsize=8)
        if len(group) > 1:
            axes.legend(fontsize=7, frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
        plain_axes(axes, 7, None)
    return figure


def _levels(values: Array) -> Array:
    """Return the borders of the colours: round numbers."""
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    if high - low <= 1e-9 * max(abs(high), 1e-300):
        low, high = low - 0.5 * abs(low or 1.0), high + 0.5 * abs(high or 1.0)
    return np.asarray(MaxNLocator(12).tick_values(low, high))


def _draw(axes, found: Swept, panel: Panel, levels: Array) -> None:
    """Draw one map with its title and scale; what has no answer stays white."""
    (_, x), (_, y) = _axes(found)
    title, unit, values = panel
    colours = ListedColormap(map_rgb(np.linspace(0, 1, len(levels) - 1)))
    drawn = axes.contourf(x, y, values.T, levels=levels, cmap=colours)
    axes.contour(x, y, values.T, levels=levels, colors="white", linewidths=0.3)
    axes.set_title(_with_unit(title, unit), fontsize=9, color=INK)
    axes.figure.colorbar(drawn, ax=axes, shrink=0.85).ax.tick_params(labelsize=7)
    _label(axes, found)


def _label(axes, found: Swept) -> None:
    for (along, _), say in zip(_axes(found), (axes.set_xlabel, axes.set_ylabel), strict=True):
        say(along, fontsize=8)
    axes.tick_params(labelsize=7)
    axes.set_facecolor("#f3f4f6")
    axes.spines[:].set_color(FAINT)
    axes.spines[:].set_linewidth(0.6)


# -- a path before and after compensation ------------------------------------------------------------------------------


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
        before, after = found.before[:, row], found.after[:, row]
        drawn = (("before", before, FOUND), ("after", after, AFTER))
        for axes, curves in ((left, drawn), (right, drawn[1:])):
            shown, factor = readable_unit(float(np.nanmax(np.abs(curves[0][1]), initial=0.0)), unit)
            axes.axhline(0, color=INK, lw=0.6)
            for word, errors, colour in curves:
                axes.plot(across, factor * errors, color=colour, lw=1.4, label=word)
            axes.set_ylabel(f"{name} [{shown}]")
    grid[0, 0].set_title("What the loaded tool misses", fontsize=10, color=INK)
    grid[0, 1].set_title("What compensation leaves of it", fontsize=10, color=INK)
    lines, words = grid[0, 0].get_legend_handles_labels()
    figure.legend(lines, words, frameon=False, fontsize=8, ncols=2, loc="outside upper left")
    for axes in grid[-1]:
        axes.set_xlabel("row" if several else "time [s]")
    for axes in grid.flat:
        plain_axes(axes, 8, None)
    return figure
