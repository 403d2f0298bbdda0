"""Templates of the pages, and figures as they stand in them."""

from __future__ import annotations

import base64
import re
import warnings
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

from ... import __version__
from ..text.terminal import capital, with_units_held

if TYPE_CHECKING:
    from ...robot import Robot
    from ..drawing.plotting import Figure


def page(template: str, robot: Robot, **parts: Any) -> str:
    """Return a page about a robot of its template, which calls what makes the words of `parts`, and draws by itself."""
    about = {"name": robot.name, "path": robot.mechanism.description.path.name, "version": __version__}
    return page_template(template).render(robot=robot, **about, **{"script_hashes": [], **parts})


def page_template(name: str):
    """Return a page's template, which escapes whatever is put into it."""
    import jinja2  # a notebook's cell begins without it
    import markupsafe  # which jinja2 escapes with

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("prup_pin", "views/report"),
        autoescape=True,  # names come from files that anybody may have written
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=lambda value: with_units_held(value) if type(value) is str else value,  # not what is markup already
    )
    environment.filters["sentence"] = as_sentence
    # a name alone may break between its words, and not in the middle of one
    environment.filters["breakable"] = lambda text: (
        text
        if " " in text
        else markupsafe.Markup(re.sub(r"(?<=\w)[_/](?=\w)", r"\g<0><wbr>", str(markupsafe.escape(text))))
    )
    environment.globals["picture"] = picture
    return environment.get_template(name)


class Picture(NamedTuple):
    """A figure as two data addresses: for paper and screens, and for a phone."""

    wide: str
    narrow: str


def picture(draw: Callable[..., Figure], *about: Any, pixels: bool = False) -> Picture:
    """Return what `draw` draws of something, wide and `narrow`, as data addresses, for pages of any width.

    As an image a figure can neither run scripts nor fetch anything. With `pixels` it is a PNG, for very many points.
    """
    from ..drawing.plotting import encoded

    kind, mime, dpi = ("png", "png", 160) if pixels else ("svg", "svg+xml", "figure")
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph")  # a name in a script that matplotlib's font lacks
        found = (encoded(draw(*about, narrow=narrow), kind, dpi, letters=True) for narrow in (False, True))
        return Picture(*(f"data:image/{mime};base64,{base64.b64encode(each).decode('ascii')}" for each in found))


def as_sentence(text: str) -> str:
    """Return a text with a capital and a full stop; a text that begins with a name keeps its letters."""
    started = capital(text)
    return started if not started or started.endswith(".") else f"{started}."
