"""The parts of matplotlib that the pictures are made of; the only place that imports it.

Objects only, never pyplot's global state: pictures can be made anywhere, without a display.
"""

from collections.abc import Sequence
from io import BytesIO
from typing import Literal

from ...errors import MissingExtraError
from ...spatial import Array

try:
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.colors import ListedColormap
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch, Polygon
    from matplotlib.ticker import MaxNLocator
    from matplotlib.transforms import Bbox
except ImportError as error:
    raise MissingExtraError("matplotlib") from error

__all__ = [
    "Bbox",
    "Figure",
    "FigureCanvasAgg",
    "Line2D",
    "ListedColormap",
    "MaxNLocator",
    "Patch",
    "Polygon",
    "encoded",
    "page_figure",
    "plain_axes",
    "plain_words",
    "sheet",
    "zero_lines",
]

#: Decorates what makes a figure: dollar signs in names are signs, not mathematics.
plain_words = rc_context({"text.parse_math": False})

#: Dots per inch of pictures that are written as PNG.
_DPI = 200


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
    axes.axhline(0, color="#C3C9D0", lw=0.8, zorder=1)
    if len(x) and min(x) < 0 < max(x):
        axes.axvline(0, color="#C3C9D0", lw=0.8, zorder=1)


def plain_axes(axes, letters: float | None, grid: str | None = "both", sides: Sequence[str] = ("top", "right")) -> None:
    """Draw axes without the lines at some sides, with a pale grid behind all; `letters`: the size of its numbers."""
    if letters is not None:
        axes.tick_params(labelsize=letters)
    if grid is not None:
        axes.grid(axis=grid, color="#EDF0F2", zorder=0)
        axes.set_axisbelow(True)
    axes.spines[list(sides)].set_visible(False)


def encoded(figure: Figure, kind: str) -> bytes:
    """Return a figure as a file of a kind, "png" or "svg"; the same figure gives the same bytes."""
    content = BytesIO()
    with rc_context({"svg.hashsalt": "prup_pin", "svg.fonttype": "none"}):
        figure.savefig(content, format=kind, dpi=_DPI, metadata={"Date": None} if kind == "svg" else None)
    return content.getvalue()
