"""Pictures on the documentation site lead to themselves, so that a phone shows them whole. mkdocs.yml names it."""

from __future__ import annotations

import re
from typing import Any

_PICTURE = re.compile(r'(<a [^>]*>)?(<img [^>]*?src="([^"]+)"[^>]*>)')


def on_page_content(html: str, **_: Any) -> str:
    """Return a page whose pictures, but for those that lead elsewhere, are links."""
    return _PICTURE.sub(lambda found: found[0] if found[1] else f'<a href="{found[3]}">{found[2]}</a>', html)
