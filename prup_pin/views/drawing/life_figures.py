"""A picture of a machine's life: values over time with their intervals, and when they changed. Needs matplotlib."""

from __future__ import annotations

import numpy as np

from ...life.life import Life, Series
from ...numbers import readable_unit
from ...recordings.recording import moment
from ..text.life_words import what_is_followed
from .plotting import Figure, MaxNLocator, page_figure, panels, plain_axes, plain_words

_VALUE, _MOMENT, _SPAN = "#0B6AA8", "#B4442C", "#F6DDD6"


@plain_words
def life_figure(life: Life, *, narrow: bool = False) -> Figure:
    """Return a panel for each parameter that is followed: its value in each recording, with when it changed marked.

    A line where a step lies or growth begins, and a band over all moments that cannot be told from it (95 %).
    """
    columns = 1 if narrow or len(life.series) == 1 else 2
    rows = -(-len(life.series) // columns)
    figure = page_figure(0.5 + 2.5 * rows, narrow)
    x = np.arange(1, len(life.names) + 1) if not life.dates[0] else np.array([moment(day) for day in life.dates])
    for axes, series in zip(panels(figure, len(life.series), columns, sharex=True), life.series, strict=True):
        _panel(axes, life, series, x)
    if life.dates[0]:
        figure.autofmt_xdate(rotation=30)
    return figure


def _panel(axes, life: Life, series: Series, x) -> None:
    unit, factor = readable_unit(float(np.abs(series.value).max()), series.unit)
    plain_axes(axes, 8, labels=("" if life.dates[0] else "recording", unit))
    axes.set_title(what_is_followed(series), fontsize=9, loc="left")
    for change in life.changes:
        if (change.physics, change.location, change.aspect) != series.key or change.begin is None:
            continue
        after = 1 if change.shape == "step" else 0
        first, last = change.between
        axes.axvspan(x[first], x[min(last + 1, len(x) - 1)], color=_SPAN, lw=0, zorder=0)
        begun = x[change.begin] if not after else x[change.begin] + (x[change.begin + 1] - x[change.begin]) / 2
        axes.axvline(begun, color=_MOMENT, lw=1.5, ls="--" if after else "-", zorder=1)
    value, low, high = (factor * each for each in (series.value, series.low, series.high))
    axes.errorbar(x, value, [value - low, high - value], fmt="o", ms=4, lw=1.2, capsize=2.5, color=_VALUE, zorder=3)
    if not life.dates[0]:
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
