"""Templates of the pages, and figures as they stand in them."""

from __future__ import annotations

import base64
import io
import re
import warnings
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

from ..text.terminal import with_units_held

if TYPE_CHECKING:
    from ..drawing.plotting import Figure


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
    # a name alone may break between its words, and not in the middle of one
    environment.filters["breakable"] = lambda text: (
        text
        if " " in text
        else markupsafe.Markup(re.sub(r"(?<=\w)[_/](?=\w)", r"\g<0><wbr>", str(markupsafe.escape(text))))
    )
    return environment.get_template(name)


class Picture(NamedTuple):
    """A figure as two data addresses: for paper and screens, and for a phone."""

    wide: str
    narrow: str


def picture(draw: Callable[..., Figure], *about: Any, pixels: bool = False) -> Picture:
    """Return what `draw` draws of something, wide and `narrow`, as data addresses, for pages of any width.

    As an image a figure can neither run scripts nor fetch anything. With `pixels` it is a PNG, for very many points.
    """
    kind, metadata = ("png", {"Software": None}) if pixels else ("svg", {"Date": None, "Creator": None})
    address = f"data:image/{'png' if pixels else 'svg+xml'};base64,"
    found = []
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph")  # a name in a script that matplotlib's font lacks
        for narrow in (False, True):
            buffer = io.BytesIO()
            draw(*about, narrow=narrow).savefig(buffer, format=kind, dpi=160 if pixels else "figure", metadata=metadata)
            found.append(address + base64.b64encode(buffer.getvalue()).decode("ascii"))
    return Picture(*found)


def as_sentence(text: str) -> str:
    """Return a text with a capital and a full stop; a text that begins with a name keeps its letters."""
    first = text.split(" ", 1)[0]
    named = any(letter in "/_" or letter.isdigit() for letter in first)
    started = text if named else text[:1].upper() + text[1:]
    return started if not started or started.endswith(".") else f"{started}."
