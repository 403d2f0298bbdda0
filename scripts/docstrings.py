"""Docstrings on the documentation site: plain text becomes Markdown that shows the same. mkdocs.yml names this file.

`<tags>` stay visible; 'name: what it is' of an argument or an attribute becomes an item of a list.
"""

from __future__ import annotations

import inspect
import itertools
import re
from typing import Any

import griffe

_TAG = re.compile(r"(`[^`]*`)|<(?=[\w/.])|\*(?=\w)")
#: 'name (shape) [unit]: ' where a line or a sentence begins.
_ITEM = re.compile(
    r"(?:\A|(?<=\n)|(?<=[.;] )|(?<=[.;]\n))(?P<names>[a-z]\w*(?:, [a-z]\w*)*)(?P<shape> \([^)]*\)(?: \[[^]]*\])?)?:\s"
)


class Docstrings(griffe.Extension):
    """Rewrites every docstring that is read."""

    def on_instance(self, *, obj: griffe.Object, **_: Any) -> None:
        if not obj.is_class:
            _rewrite(obj)

    def on_class_members(self, *, cls: griffe.Class, **_: Any) -> None:
        _rewrite(cls)  # whose attributes are known only now


def _rewrite(obj: griffe.Object) -> None:
    if obj.docstring is not None:
        names = {parameter.name for parameter in getattr(obj, "parameters", ())} | set(obj.members)
        obj.docstring.value = markdown(obj.docstring.value, names)


def markdown(text: str, names: set[str]) -> str:
    """Return a docstring as Markdown; `names` are those that a list may begin with."""
    return "\n\n".join(_paragraph(part, names) for part in re.split(r"\n\s*\n", inspect.cleandoc(text)))


def _paragraph(text: str, names: set[str]) -> str:
    """Return a paragraph as Markdown: a list where it tells what arguments or attributes are."""
    items = [found for found in _ITEM.finditer(text) if set(found["names"].split(", ")) <= names]
    if not items:
        return _shown(text)
    before, lines = text[: items[0].start()].strip(), []
    for item, after in itertools.zip_longest(items, items[1:]):
        words = ", ".join(f"`{name}`" for name in item["names"].split(", "))
        said = text[item.end() : after.start() if after else None]
        lines.append(f"- {words}{item['shape'] or ''}: {_shown(' '.join(said.split()).rstrip(';'))}")
    if before:
        lines = [_shown(f"{before[:-1]}." if before.endswith(";") else before), "", *lines]
    return "\n".join(lines)


def _shown(text: str) -> str:
    return _TAG.sub(lambda found: found[1] or {"<": "&lt;", "*": r"\*"}[found[0]], text)
