"""XML from strangers: read safely, keep line numbers, say what is wrong."""

from __future__ import annotations

from pathlib import Path

from lxml import etree

from ..errors import Problem, RobotFileError

#: Robot descriptions are text of at most a few MB; anything larger is a mistake or an attack.
MAX_BYTES = 32 * 2**20
#: Pinocchio's readers recurse over the tree; far beyond any robot they exhaust the stack.
MAX_ELEMENTS = 200_000


def read_bytes(path: Path) -> bytes:
    """Return the file's content, or raise RobotFileError."""
    if path.is_dir():
        raise RobotFileError(path, [Problem("is a folder; expected a robot file (.urdf, .xml)")])
    try:
        with path.open("rb") as file:
            content = file.read(MAX_BYTES + 1)
    except FileNotFoundError as error:
        near = sorted(other.name for other in path.parent.glob("*.urdf"))[:8] if path.parent.is_dir() else []
        also = f" The folder holds: {', '.join(near)}." if near else ""
        raise RobotFileError(path, [Problem(f"file not found.{also}")]) from error
    except OSError as error:
        raise RobotFileError(path, [Problem(f"cannot be read: {error.strerror}")]) from error
    if len(content) > MAX_BYTES:
        raise RobotFileError(path, [Problem(f"larger than {MAX_BYTES // 2**20} MB; a robot description is text of a few MB at most")])
    return content


def parse(content: bytes, path: Path, root_tag: str) -> etree._Element:
    """Return the root element, or raise RobotFileError with line and reason.

    No entity is expanded, no DTD loaded and nothing fetched: a document that declares a DOCTYPE is refused.
    """
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False, remove_comments=True)
    doctype = content.lower().find(b"<!doctype")
    if doctype >= 0:
        line = content.count(b"\n", 0, doctype) + 1
        raise RobotFileError(path, [Problem("declares a DOCTYPE; entities and external definitions are not read. Remove it", line)])
    try:
        root = etree.fromstring(content, parser)
    except etree.XMLSyntaxError as error:
        line = error.lineno or None
        raise RobotFileError(path, [Problem(f"is not well-formed XML: {error.msg}", line)]) from error
    if root.tag != root_tag:
        raise RobotFileError(path, [Problem(f"the root element is <{root.tag}>; expected <{root_tag}>", root.sourceline)])
    if sum(1 for _ in root.iter()) > MAX_ELEMENTS:
        raise RobotFileError(path, [Problem(f"has more than {MAX_ELEMENTS} elements; this is not a robot description")])
    return root
