"""What the pictures are made of: sheets, axes, and labels that cover nothing of what is drawn.

The only place that imports matplotlib: objects only, never pyplot's global state, so that pictures can be made
anywhere, without a display.
"""

from collections.abc import Sequence
from io import BytesIO
from typing import Any, Literal

import numpy as np
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import Bbox

from ...spatial import Array
from ..scene.colours import PALE

__all__ = [
    "Bbox",
    "Figure",
    "FigureCanvasAgg",
    "Line2D",
    "LineCollection",
    "ListedColormap",
    "MaxNLocator",
    "Patch",
    "PolyCollection",
]

#: Decorates what makes a figure: dollar signs in names are signs, not mathematics.
plain_words = rc_context({"text.parse_math": False})


def sheet(width: float, height: float, dpi: float | None = 130, layout: Literal["constrained"] | None = None) -> Figure:
    """Return an empty white figure [in] that can be drawn without a display."""
    figure = Figure(figsize=(width, height), dpi=dpi, layout=layout, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def page_figure(height: float, narrow: bool, title: str = "", width: float = 9.5) -> Figure:
    """Return an empty figure of some inches, or as wide as a phone, whose title and panels find their places."""
    figure = sheet(5.2 if narrow else width, height, layout="constrained")
    figure.get_layout_engine().set(w_pad=0.08, h_pad=0.08)  # type: ignore[union-attr, call-arg]
    if title:
        figure.suptitle(title, x=0.02, ha="left", fontsize=11.5 if narrow else 13, weight="bold")
    return figure


def zero_lines(axes, x: Sequence[float] | Array = ()) -> None:
    """Draw a pale line where values are zero, and one where `x` is, if it has both signs."""
    axes.axhline(0, color=PALE, lw=0.8, zorder=1)
    if len(x) and min(x) < 0 < max(x):
        axes.axvline(0, color=PALE, lw=0.8, zorder=1)


def plain_axes(
    axes,
    letters: float | None,
    grid: str | None = "both",
    sides: Sequence[str] = ("top", "right"),
    labels: Sequence[str] = (),
) -> None:
    """Draw axes without the lines at some sides, with a pale grid behind all.

    letters: the size of its numbers; that of `labels`, along x and y, is 1 more.
    """
    if letters is not None:
        axes.tick_params(labelsize=letters)
    for say, text in zip((axes.set_xlabel, axes.set_ylabel), labels, strict=False):
        say(text, fontsize=None if letters is None else letters + 1)
    if grid is not None:
        axes.grid(axis=grid, color="#EDF0F2", zorder=0)
        axes.set_axisbelow(True)
    axes.spines[list(sides)].set_visible(False)


def panels(figure: Figure, count: int, columns: int, **options) -> list[Any]:
    """Return so many axes of a figure, row by row, at most so many in one."""
    across = min(columns, max(count, 1))
    grid = figure.subplots(-(-max(count, 1) // across), across, squeeze=False, **options).ravel()
    for axes in grid[count:]:
        axes.set_visible(False)
    return list(grid[:count])


def encoded(figure: Figure, kind: str, dpi: float | str = 200, letters: bool = False) -> bytes:
    """Return a figure as a file of a kind, "png" or "svg"; the same figure gives the same bytes.

    letters: whether an SVG holds its letters as shapes, for pages on which no font is known.
    """
    content = BytesIO()
    metadata = {"Date": None, "Creator": None} if kind == "svg" else {"Software": None}
    with rc_context({"svg.hashsalt": "prup_pin", "svg.fonttype": "path" if letters else "none"}):
        figure.savefig(content, format=kind, dpi=dpi, metadata=metadata)
    return content.getvalue()


# -- labels -----------------------------------------------------------------------------------------------------------


#: Where a label may stand about its point: how far away [dots], near places first, in which direction, (n, 1 and 2).
_RADII = np.repeat([6.0, 14.0, 26.0, 42.0, 62.0], 24)[:, None]
_ANGLES = np.tile(np.radians(np.arange(0, 360, 15)), 5)
_DIRECTIONS = np.column_stack((np.cos(_ANGLES), np.sin(_ANGLES)))


class Labels:
    """Places labels near their points where they cover neither lines nor other labels."""

    def __init__(self, figure: Figure, axes):
        self.figure, self.axes = figure, axes
        self.obstacles: list[Array] = []
        self.boxes: list[Bbox] = []

    def put(
        self, text: str, at: Array, colour: str, towards: Array | None = None, size: float = 10, weight="normal"
    ) -> None:
        """Write `text` beside the point `at`, rather in the direction `towards`."""
        renderer = self.figure.canvas.get_renderer()  # type: ignore[attr-defined]
        transform = self.axes.transData
        dots = transform.transform(np.concatenate(self.obstacles)) if self.obstacles else np.zeros((0, 2))
        label = self.axes.text(
            *at, text, color=colour, fontsize=size, ha="center", va="center", zorder=1000, weight=weight
        )
        label.set_bbox({"facecolor": "white", "alpha": 0.55, "edgecolor": "none", "pad": 0.8})
        extent = label.get_window_extent(renderer)
        half = np.array([extent.width, extent.height]) / 2 + 2
        centre = transform.transform(at)
        bounds = self.axes.get_window_extent(renderer)
        middles = centre + _DIRECTIONS * (_RADII + np.abs(_DIRECTIONS) @ half[:, None])
        low, high = middles - half, middles + half
        inside = (dots > (low - 4)[:, None]) & (dots < (high + 4)[:, None])  # (places, dots, 2)
        covered = np.count_nonzero(inside.all(axis=2), axis=1)
        clashes = sum(((low <= box.max) & (high >= box.min)).all(axis=1) for box in self.boxes)
        outside = (np.maximum(bounds.min - low, 0) + np.maximum(high - bounds.max, 0)).sum(axis=1)
        cost = 30 * covered + 5000 * clashes + 50 * outside + _RADII[:, 0]
        if towards is not None and np.linalg.norm(towards) > 1e-9:
            cost += 25 * (1 - _DIRECTIONS @ (np.asarray(towards) / np.linalg.norm(towards)))
        place = middles[np.argmin(cost)]
        label.set_position(transform.inverted().transform(place))
        self.boxes.append(Bbox([place - half, place + half]))
