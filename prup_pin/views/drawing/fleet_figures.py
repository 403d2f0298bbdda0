"""A picture of a fleet: by how much kinds of parameters scatter, and each device among its like. Needs matplotlib."""

from __future__ import annotations

import numpy as np

from ...life.fleet import Fleet, Off
from ...numbers import some
from .plotting import Figure, MaxNLocator, page_figure, panels, plain_axes, plain_words

_VALUE, _WRONG, _LIKE, _PALE = "#0B6AA8", "#B4442C", "#9AA5B1", "#EEF1F4"
#: Names of devices that stand below the picture; of more devices every so many.
_MOST_NAMES = {False: 24, True: 12}


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
        axes.errorbar(value, row, xerr=reach, fmt="o", ms=5, lw=1.2, capsize=2.5, color=_VALUE, zorder=3)
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
    axes.axhspan(-2, 2, color=_PALE, lw=0, zorder=0)
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
            _apart(axes, fleet.devices.index(item.device), item, spread[item.kind], n)
    shown = range(0, n, -(-n // _MOST_NAMES[narrow]))
    axes.set_xticks(list(shown), [fleet.devices[place] for place in shown], rotation=60, ha="right")
    axes.set_xlim(-0.7, n - 0.3)
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))


def _apart(axes, place: int, item: Off, spread: float, count: int) -> None:
    """Draw a device that stands apart, with the parameter's name on the side where there is room."""
    value = item.value / spread
    axes.plot(place, value, "o", ms=6, color=_WRONG, zorder=4)
    right = place > count / 2
    axes.annotate(
        " or ".join(some([item.parameter, *item.others], 2)), (place, value), (-7 if right else 7, 0),
        textcoords="offset points", ha="right" if right else "left", va="center", fontsize=8, color=_WRONG,
    )  # fmt: skip
