"""XML from strangers: read safely, keep line numbers, say what is wrong."""

from __future__ import annotations

import difflib
import math
import os.path
import re
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from lxml import etree

from ..errors import Problem, RobotFileError, nearest_names
from ..files import opened
from ..spatial import Array, placement, rotation_rpy
from .description import MAX_PROBLEMS, RobotDescription

#: Robot descriptions are text of at most a few MB; anything larger is a mistake or an attack.
MAX_BYTES = 32 * 2**20
#: Far more than any robot has; the readers' time and memory stay small below it.
MAX_ELEMENTS = 200_000
#: The engine's matrices grow with the square of the number of joints.
MAX_JOINTS = 2000
#: Longer names are garbage, and would make the messages unreadable.
MAX_NAME = 500
#: Lengths in metres, masses in kilograms: beyond this, sums of them lose all digits.
MAX_NUMBER = 1e9
#: Moments of inertia by a URDF's names, and where they stand in the matrix.
MOMENTS = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
#: Endings of tables.
_TABLES = (".csv", ".tsv", ".txt")
#: Blanks, and what may stand before the root element: an instruction or a comment.
_ASIDE = re.compile(rb"(?:\xef\xbb\xbf)?\s*(?:<\?.*?\?>|<!--.*?-->)?", re.S)
#: Names that are more alike than this are meant to be the same: orign, Mass, but not contact.
_NEAR = 0.75


def read_bytes(path: Path, limit: int = MAX_BYTES) -> bytes:
    """Return the file's content, or raise RobotFileError. Of files above `limit` bytes no more is read."""

    def wrong(message: str) -> RobotFileError:
        return RobotFileError(path, [Problem(message)])

    with opened(path, "a robot file (.urdf, .xml)", (".urdf", ".xml"), wrong) as file:
        content = file.read(limit + 1)
    if not 0 < len(content) <= limit:
        size = f"is larger than {limit / 2**20:g} MB" if content else "is empty"
        raise wrong(f"{size}; expected a robot description, text of a few MB at most")
    return content


def parse(content: bytes, path: Path) -> etree._Element:
    """Return the root element, or raise RobotFileError with line and reason.

    The document must be UTF-8 whatever it declares, because Pinocchio reads it so. No entity is expanded, no DTD
    loaded and nothing fetched: a document that declares a DOCTYPE is refused before it is parsed.
    """
    # a DOCTYPE can stand before the root element alone: of more, a comment may speak, and a large file is not searched
    end = 0
    while (aside := _ASIDE.match(content, end)) is not None and aside.end() > end:
        end = aside.end()
    doctype = content[end : end + 9].upper() == b"<!DOCTYPE"
    if re.match(rb"(?:\xef\xbb\xbf)?\s*(?:<!doctype\s+html|<html)\b", content[end if doctype else 0 :], re.I):
        message = "is a page of HTML, as a server sends in place of a file; expected a robot file (URDF or MJCF)"
        raise RobotFileError(path, [Problem(message, 1)])
    if doctype:
        line = content.count(b"\n", 0, end) + 1
        message = "declares a DOCTYPE; entities and external definitions are not read. Remove it"
        raise RobotFileError(path, [Problem(message, line)])
    try:
        content.decode("utf-8")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        message = f"is not UTF-8 text (byte 0x{content[error.start]:02x}); expected an XML file saved as UTF-8"
        raise RobotFileError(path, [Problem(message, line)]) from error
    begins = content.removeprefix(b"\xef\xbb\xbf").lstrip()[:1]
    if begins and begins != b"<":
        message = "is no XML, which begins with '<'; expected a robot file (URDF or MJCF)"
        if path.suffix.lower() in _TABLES:
            message += ". A recording? It goes to prup-pin diagnose or check"
        if begins == b"{":
            message += ". A corrected model? It goes to prup-pin predict, or to --model of simulate and compensate"
        raise RobotFileError(path, [Problem(message, 1)])
    parser = etree.XMLParser(
        encoding="utf-8",
        resolve_entities=False,
        no_network=True,
        load_dtd=False,
        huge_tree=False,
        remove_comments=True,
        remove_pis=True,
    )
    try:
        root = etree.fromstring(content, parser)
    except etree.XMLSyntaxError as error:
        message = f"is not well-formed XML: {(error.msg or 'unknown error')[:MAX_NAME]}"
        if "Excessive depth" in message:
            message = "nests its elements more than 256 deep; this is not a robot description"
        raise RobotFileError(path, [Problem(message, error.lineno or None)]) from error
    if sum(1 for _ in root.iter()) > MAX_ELEMENTS:
        raise RobotFileError(path, [Problem(f"has more than {MAX_ELEMENTS} elements; this is not a robot description")])
    return root


def parse_again(content: bytes) -> etree._Element:
    """Return the root of a file that was read before, comments included."""
    return etree.fromstring(content, etree.XMLParser(encoding="utf-8", resolve_entities=False, no_network=True))


def words(values: Iterable[float]) -> str:
    """Return numbers as a file has them, all digits."""
    return " ".join(repr(float(value) + 0.0) for value in values)


def found_or_added(parent: etree._Element, tag: str, **attributes: str) -> etree._Element:
    """Return an element that stands once in another one, added with some attributes where it is missing."""
    found = parent.find(tag)
    return etree.SubElement(parent, tag, **attributes) if found is None else found


def moments_of(values: Mapping[str, float]) -> Array:
    """Return moments of inertia (3, 3) by the names of `MOMENTS`."""
    moments = np.zeros((3, 3))
    for key, (row, column) in MOMENTS.items():
        moments[row, column] = moments[column, row] = values[key]
    return moments


def _place(problem: Problem) -> tuple[str, float]:
    return problem.file or "", math.inf if problem.line is None else problem.line


class Document(ABC):
    """Reads one XML document and collects problems instead of stopping at the first."""

    def __init__(self, root: etree._Element, path: Path):
        self.root, self.path = root, path
        self.problems: list[Problem] = []
        self.lines: dict[str, int | None] = {}

    @abstractmethod
    def read(self, content: bytes) -> RobotDescription:
        """Return what the document says; what is wrong with it is in `problems`."""

    def raise_problems(self) -> None:
        """Raise RobotFileError where there are problems: the document's own first, in the order of its lines."""
        if self.problems:
            raise RobotFileError(self.path, sorted(self.problems, key=_place))

    def problem(self, element: etree._Element, message: str) -> None:
        self.problems.append(Problem(message, element.sourceline))
        if len(self.problems) >= MAX_PROBLEMS:
            self.problems.append(Problem(f"more than {MAX_PROBLEMS} problems; the rest is not listed"))
            self.raise_problems()

    def attribute(self, element: etree._Element, name: str, what: str) -> str | None:
        """Return an attribute that must be there, or None after reporting."""
        value = element.get(name) or ""
        if not value.strip():
            self.problem(element, f'{what}: attribute {name}="…" is missing')
            return None
        if len(value) > MAX_NAME:
            self.problem(element, f"{what}: {name} has {len(value)} characters; expected at most {MAX_NAME}")
            return None
        return value

    def linked(
        self, element: etree._Element, tag: str, what: str, more: str = ""
    ) -> tuple[etree._Element | None, str | None]:
        """Return a child that names a link, and that name; None after reporting. `more`: what else the child holds."""
        child = element.find(tag)
        if child is None:
            self.problem(element, f'{what}: <{tag} link="…"{more}/> is missing')
            return None, None
        return child, self.attribute(child, "link", f"{what}, <{tag}>")

    def numbers(
        self,
        element: etree._Element,
        name: str,
        count: int | None,
        what: str,
        default: Sequence[float] | None = None,
        largest: float = math.inf,
    ) -> tuple[float, ...] | None:
        """Return the numbers of an attribute, each at most `largest` in size, or None after reporting."""
        text = element.get(name)
        if text is None:
            if default is None:
                self.problem(element, f'{what}: attribute {name}="…" is missing')
            return None if default is None else tuple(default)
        return self.parse_numbers(element, text, count, f'{what}: {name}="{text[:60]}"', largest)

    def parse_numbers(
        self, element: etree._Element, text: str, count: int | None, label: str, largest: float = math.inf
    ) -> tuple[float, ...] | None:
        """Return the numbers of a text, or None after reporting."""
        try:
            # Python also reads 1_000 and other scripts' digits; Pinocchio does not.
            values = tuple(float(word) for word in text.split()) if text.isascii() and "_" not in text else ()
        except ValueError:
            values = ()
        if not values or (count is not None and len(values) != count) or not all(map(math.isfinite, values)):
            if values and len(values) == (count or len(values)):
                self.problem(element, f"{label}: expected {'a finite number' if count == 1 else 'finite numbers'}")
                return None
            want = "a number" if count == 1 else f"{count or ''} numbers, separated by spaces".lstrip()
            self.problem(element, f"{label}: expected {want}, with a decimal point")
            return None
        if max(map(abs, values)) > largest:
            self.problem(element, f"{label}: expected numbers between {-largest:g} and {largest:g}")
            return None
        return values

    def direction(self, element: etree._Element, name: str, what: str) -> tuple[float, ...] | None:
        """Return the three numbers of an axis, or None after reporting; an axis of length zero has no direction."""
        axis = self.numbers(element, name, 3, what, largest=MAX_NUMBER)
        if axis and math.hypot(*axis) < 1 / MAX_NUMBER:
            self.problem(element, f"{what}: its axis is zero; expected a direction")
            return None
        return axis

    def origin(self, element: etree._Element, what: str) -> Array | None:
        """Return the placement of an element with xyz and rpy, or None after reporting."""
        xyz = self.numbers(element, "xyz", 3, what, (0, 0, 0), MAX_NUMBER)
        rpy = self.numbers(element, "rpy", 3, what, (0, 0, 0), MAX_NUMBER)
        return placement(rotation_rpy(*rpy), np.array(xyz)) if xyz and rpy else None

    def known_children(
        self, element: etree._Element, names: Sequence[str], what: str, once: Collection[str] = ()
    ) -> None:
        """Report children named almost like a known one, and a second one of those that stand `once`.

        URDF's readers pass over both without a word; what bears quite another name may be anybody's.
        """
        lines: dict[str, int | None] = {}
        for child in element:
            tag = str(child.tag)
            if tag not in names and tag not in lines:
                near = difflib.get_close_matches(tag[:MAX_NAME].lower(), names, 1, _NEAR)
                if near:
                    self.problem(child, f"{what}: <{tag[:60]}> is not read. Did you mean <{near[0]}>?")
            elif tag in once and tag in lines:
                self.problem(child, f"{what}: a second <{tag}> (first on line {lines[tag]}); expected one")
            lines.setdefault(tag, child.sourceline)

    def only(self, element: etree._Element, attributes: Sequence[str], what: str) -> None:
        """Report every attribute that is not in the list."""
        for name in element.attrib:
            if name not in attributes:
                near = nearest_names(name[:60], attributes)
                self.problem(element, f"{what}: unknown attribute '{name[:60]}'. {near}")


# -- meshes ------------------------------------------------------------------------------------------------------------


def mesh_problem(name: str, home: Path, package_folders: Sequence[Path]) -> str | None:
    """Return what is wrong with a mesh's path, or None.

    It must lie in the robot's folder `home` or in a declared package folder, links and '..' resolved.
    """
    folders = [home, *package_folders]
    shown = name if len(name) <= 120 else f"{name[:120]}…"
    scheme = name.replace("\\", "/").rpartition("://")[0]
    if scheme and scheme not in ("package", "file", "model"):
        return f"mesh '{shown}': nothing is downloaded; copy the file next to the robot file"
    places = mesh_places(name, folders)
    try:
        existing = [place for place in places if os.path.lexists(place)]
        if existing:
            allowed = all(_inside(os.path.realpath(place), folders) for place in existing)
        else:
            allowed = any(_inside(os.path.normpath(place), folders) for place in places)
    except (OSError, ValueError):  # a NUL character, or a name longer than any file's
        allowed = False
    if allowed:
        return None
    return (
        f"mesh '{shown}' lies outside the robot's folder {home} and the declared package folders; "
        "move it there, or declare its folder with package_folders=[…]"
    )


def mesh_places(name: str, folders: Sequence[Path]) -> list[str]:
    """Return where a mesh may lie. Nothing is loaded here; viewers load what `mesh_problem` lets pass."""
    scheme, _, rest = name.replace("\\", "/").rpartition("://")
    places = [os.path.join(folder, rest) for folder in folders]
    if scheme in ("package", "model") and "/" in rest:
        # package://name/… : a folder may be the package itself, or the one that holds it
        places += [os.path.join(folder, rest.split("/", 1)[1]) for folder in folders]
    return places


def _inside(place: str, folders: Sequence[Path]) -> bool:
    return any(Path(place).is_relative_to(known) for folder in folders for known in (folder, os.path.realpath(folder)))
