"""What the pictures are made of: sheets, axes, one projected drawing and labels that cover nothing of it.

The only place that imports matplotlib: objects only, never pyplot's global state, so that pictures can be made
anywhere, without a display.
"""

from collections.abc import Mapping, Sequence
from io import BytesIO
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import Bbox

from ...spatial import Array
from ..scene.camera import Camera
from ..scene.colours import INK, PALE

__all__ = ["Bbox", "Figure", "FigureCanvasAgg", "Line2D", "ListedColormap", "MaxNLocator", "Patch", "Polygon"]

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


# -- one drawing of the mechanism -------------------------------------------------------------------------------------


class Layout(NamedTuple):
    """Where the pieces of a drawing stand, in shares of its width and height; `size` in inches, `line` in letters."""

    size: tuple[float, float]
    drawing: tuple[float, float, float, float]
    beside: tuple[float, float, float, float]  # what explains it: an ellipsoid, a small chart
    compass: tuple[float, float, float, float]
    legend: tuple[float, float]
    scale: tuple[float, float, float, float]
    line: int


#: For paper and screens, and for a phone, on which letters keep their size.
WIDE = Layout(
    (11, 7.2), (0.02, 0.02, 0.67, 0.83), (0.70, 0.42, 0.29, 0.42), (0.015, 0.02, 0.13, 0.19), (0.715, 0.39),
    (0.725, 0.035, 0.16, 0.02), 130,
)  # fmt: skip
NARROW = Layout(
    (5.2, 9.2), (0.02, 0.39, 0.96, 0.49), (0.03, 0.045, 0.42, 0.27), (0.0, 0.36, 0.24, 0.13), (0.46, 0.35),
    (0.50, 0.045, 0.38, 0.014), 58,
)  # fmt: skip


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

    def avoid(self, line: Array) -> None:
        """Keep labels off a line (n, 2) in data coordinates."""
        line = np.asarray(line, float).reshape(-1, 2)
        for start, end in pairwise(line):
            self.obstacles.append(start + np.linspace(0, 1, 25)[:, None] * (end - start))
        if len(line) == 1:
            self.obstacles.append(line)

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


class Drawing:
    """One drawing on 2-D axes of its own, at a `place` of the figure, of points on the page from `low` to `high`."""

    def __init__(self, figure: Figure, place: tuple[float, ...], camera: Camera, low, high):
        self.figure, self.camera = figure, camera
        self.axes: Any = figure.add_axes(place)  # type: ignore[arg-type]
        self.axes.set_aspect("equal")
        self.axes.axis("off")
        self.axes.set_xlim(low[0], high[0])
        self.axes.set_ylim(low[1], high[1])
        figure.canvas.draw()  # labels are placed on the page
        self.labels = Labels(figure, self.axes)

    def write(self, texts, legs: Mapping[str, Array], points: Array, size: float) -> None:
        """Write (text, at, colour, towards) beside their points, and the names of legs away from the middle."""
        for text, at, colour, towards in texts:
            self.labels.put(text, at, colour, towards)
        middle = self.camera.flat(points).mean(axis=0)
        for leg, point in legs.items():
            at = self.camera.flat(point)
            self.labels.put(leg, at, INK, at - middle + 0.3 * size * self.camera.flat(self.camera.up), 11, "bold")

    def line(self, points: Array, colour: str, width: float, lift: float = 0.0, halo: bool = True, **style) -> None:
        """Draw a line; nearer lines cross farther ones with a white edge."""
        flat, depth = self.camera.flat(points), self.camera.depth(points)
        order = 10 + depth + lift
        if halo:
            self.axes.plot(*flat.T, color="white", lw=width + 2.5, solid_capstyle="butt", zorder=order)
        self.axes.plot(*flat.T, color=colour, lw=width, solid_capstyle="round", zorder=order + 1e-6, **style)
        self.labels.avoid(flat)

    def sign(self, label: str, colour: str, width: float) -> None:
        """Let a line stand in the legend for what is drawn in several colours or as an arrow."""
        self.axes.plot([], [], color=colour, lw=width, label=label)

    def rod(self, points: Array, colour: str, label: str) -> None:
        """Draw a beam: a thick line with a light along its middle."""
        self.line(points, colour, 7.0, label=label)
        flat, depth = self.camera.flat(points), self.camera.depth(points)
        self.axes.plot(*flat.T, color="white", alpha=0.35, lw=2.0, solid_capstyle="round", zorder=10 + depth + 2e-6)

    def arrow(
        self, start: Array, end: Array, colour: str, width: float, head: float = 12.0, lift: float = 50.0
    ) -> None:
        """Draw an arrow with a head of constant size."""
        a, b = self.camera.flat(start), self.camera.flat(end)
        style = {"arrowstyle": "-|>", "color": colour, "lw": width, "mutation_scale": head, "shrinkA": 0, "shrinkB": 0}
        self.axes.annotate("", xy=b, xytext=a, zorder=10 + lift, arrowprops=style)
        self.labels.avoid(np.array([a, b]))

    def mark(self, point: Array, sign: str, size: float, face: str, edge: str, lift: float = 20.0, **style) -> None:
        """Draw a marker of constant size, nearer ones over farther ones."""
        flat, order = self.camera.flat(point), 10 + lift + 0.01 * self.camera.depth(point)
        self.axes.plot(*flat, sign, ms=size, mfc=face, mec=edge, zorder=order, **{"mew": 1.3, **style})
        self.labels.avoid(flat)
