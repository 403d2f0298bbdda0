"""The parts of matplotlib that the pictures are made of; the only place that imports it.

Objects only, never pyplot's global state: pictures can be made anywhere, without a display.
"""

from io import BytesIO

from ...errors import MissingExtraError

try:
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import PolyCollection
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
    "PolyCollection",
    "Polygon",
    "encoded",
    "plain_words",
]

#: Decorates what makes a figure: dollar signs in names are signs, not mathematics.
plain_words = rc_context({"text.parse_math": False})

#: Dots per inch of pictures that are written as PNG.
_DPI = 200


def encoded(figure: Figure, kind: str) -> bytes:
    """Return a figure as a file of a kind, "png" or "svg"; the same figure gives the same bytes."""
    content = BytesIO()
    with rc_context({"svg.hashsalt": "prup_pin", "svg.fonttype": "none"}):
        figure.savefig(content, format=kind, dpi=_DPI, metadata={"Date": None} if kind == "svg" else None)
    return content.getvalue()
