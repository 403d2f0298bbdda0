"""Docstrings on the documentation site: plain text becomes Markdown that shows the same. mkdocs.yml names this file.

`<tags>` stay visible; 'name: what it is' of an argument or an attribute becomes an item of a list.
"""

from __future__ import annotations

import re
from typing import Any

import griffe

_TAG = re.compile(r"(`[^`]*`)|<(?=[\w/.])|\*(?=\w)")
_ITEM = re.compile(r"(?P<names>[a-z]\w*(?:, [a-z]\w*)*)(?P<shape> \([^)]*\)(?: \[[^]]*\])?)?: ")


class Docstrings(griffe.Extension):
    """Rewrites every docstring that is read."""

    def on_instance(self, *, obj: griffe.Object, **_: Any) -> None:
        if obj.docstring is not None:
            names = {parameter.name for parameter in getattr(obj, "parameters", ())} | set(obj.members)
            obj.docstring.value = markdown(obj.docstring.value, names)


def markdown(text: str, names: set[str]) -> str:
    """Return a docstring as Markdown; `names` are those that a list may begin with."""
    lines, listed = [], False
    for line in text.splitlines():
        item = _ITEM.match(line)
        if item and set(item["names"].split(", ")) <= names:
            if not listed and lines and lines[-1]:
                lines.append("")
            listed = True
            words = ", ".join(f"`{name}`" for name in item["names"].split(", "))
            lines.append(f"- {words}{item['shape'] or ''}: {_shown(line[item.end() :])}")
        elif listed and line.strip() and not line.startswith(" "):
            lines += ["", _shown(line)]
            listed = False
        else:
            lines.append(_shown(line) if not listed or not line.startswith(" ") else f"    {_shown(line.strip())}")
            listed = listed and bool(line.strip())
    return "\n".join(lines)


def _shown(text: str) -> str:
    return _TAG.sub(lambda found: found[1] or {"<": "&lt;", "*": r"\*"}[found[0]], text)
