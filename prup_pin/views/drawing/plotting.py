"""The parts of matplotlib that the pictures are made of; the only place that imports it.

Objects only, never pyplot's global state: pictures can be made anywhere, without a display.
"""

from ...errors import MissingExtraError

try:
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import ListedColormap
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch, Polygon
    from matplotlib.transforms import Bbox
except ImportError as error:
    raise MissingExtraError("matplotlib") from error

__all__ = [
    "Bbox",
    "Figure",
    "FigureCanvasAgg",
    "Line2D",
    "ListedColormap",
    "Patch",
    "PolyCollection",
    "Polygon",
    "plain_words",
]

#: Decorates what makes a figure: dollar signs in names are signs, not mathematics.
plain_words = rc_context({"text.parse_math": False})
