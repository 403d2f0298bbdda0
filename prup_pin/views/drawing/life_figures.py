"""Pictures of a machine's life, values over time and when they changed, and of a fleet, each device among its like."""

from __future__ import annotations

import numpy as np

from ...life.fleet import Fleet
from ...life.life import Life, Series
from ...numbers import readable_unit, some
from ...recordings.recording import moment
from ..scene.colours import AFTER
from ..text.life_words import what_is_followed
from .plotting import Figure, MaxNLocator, page_figure, panels, plain_axes, plain_words

#: What changed, and who stands apart; moments that may be meant; what is like all others, and its band.
_MOMENT, _SPAN, _LIKE, _BAND = "#B4442C", "#F6DDD6", "#9AA5B1", "#EEF1F4"
#: Names of devices that stand below the picture; of more devices every so many.
_MOST_NAMES = {False: 24, True: 12}


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
    axes.errorbar(x, value, [value - low, high - value], fmt="o", ms=4, lw=1.2, capsize=2.5, color=AFTER, zorder=3)
    if not life.dates[0]:
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))


# -- many devices of one drawing ---------------------------------------------------------------------------------------


@plain_words
def fleet_figure(fleet: Fleet, *, narrow: bool = False) -> Figure:
    """Return two panels: the spread of each kind beside what was declared, and how far each device is off.

    The first has, by kind, one standard deviation with its 95 % interval in multiples of the declared one. The second
    has a dot for every parameter of every device, in multiples of its kind's spread, beside what is common to all
    devices; red where a device stands apart.
    """
    rows = max(sum(item.told and item.declared is not None for item in fleet.scatter), 1)
    figure = page_figure(2.2 + 0.32 * rows + (3.4 if narrow else 1.2), narrow)
    scatter, devices = panels(figure, 2, 1 if narrow else 2)
    _spreads(scatter, fleet)
    _devices(devices, fleet, narrow)
    return figure


def _spreads(axes, fleet: Fleet) -> None:
    told = [item for item in fleet.scatter if item.told and item.declared is not None]
    plain_axes(axes, 8, "x", labels=("spread over what was declared",))
    axes.set_title("By how much kinds of parameters scatter", fontsize=9, loc="left")
    axes.axvline(1, color=_LIKE, lw=1, zorder=1)
    for row, item in enumerate(told):
        value, low, high = (size / (item.declared or 1.0) for size in (item.value, *item.interval))
        reach = [[value - low], [high - value]]
        axes.errorbar(value, row, xerr=reach, fmt="o", ms=5, lw=1.2, capsize=2.5, color=AFTER, zorder=3)
    axes.set_yticks(range(len(told)), [item.kind.replace("_", " ") for item in told])
    axes.set_ylim(len(told) - 0.5, -0.5)
    axes.set_xlim(left=0)
    if not told:
        axes.text(
            0.5, 0.5, "no spread is known beside a declared one", transform=axes.transAxes, ha="center", fontsize=8
        )


def _devices(axes, fleet: Fleet, narrow: bool) -> None:
    plain_axes(axes, 8, "y", labels=("", "beside what is common [spreads of its kind]"))
    axes.set_title("Each device among its like", fontsize=9, loc="left")
    axes.axhspan(-2, 2, color=_BAND, lw=0, zorder=0)
    n = len(fleet.devices)
    spread = {item.kind: item.value for item in fleet.scatter if item.told}
    kinds = list(fleet.kinds)
    own = [column for column, kind in enumerate(kinds) if kind in spread]
    sizes = np.array([spread[kinds[column]] for column in own])
    if own:
        x = np.repeat(np.arange(n), len(own)) + np.tile(np.linspace(-0.3, 0.3, len(own)), n)
        axes.plot(x, (fleet.own[:, own] / sizes).ravel(), "o", ms=2.2, color=_LIKE, mec="none", zorder=2)
    for item in fleet.outliers:
        if item.kind in spread:
            # a device that stands apart, with the parameter's name on the side where there is room
            place, value = fleet.devices.index(item.device), item.value / spread[item.kind]
            axes.plot(place, value, "o", ms=6, color=_MOMENT, zorder=4)
            right = place > n / 2
            axes.annotate(
                " or ".join(some([item.parameter, *item.others], 2)), (place, value), (-7 if right else 7, 0),
                textcoords="offset points", ha="right" if right else "left", va="center", fontsize=8, color=_MOMENT,
            )  # fmt: skip
    shown = range(0, n, -(-n // _MOST_NAMES[narrow]))
    axes.set_xticks(list(shown), [fleet.devices[place] for place in shown], rotation=60, ha="right")
    axes.set_xlim(-0.7, n - 0.3)
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
