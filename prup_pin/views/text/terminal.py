"""Building blocks of text for a terminal: readable on 80 columns, without colour, and never cut off."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Sequence
from typing import Literal

from rich import box
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table
from rich.text import Text

#: Wider than any table.
_UNBOUNDED = 10_000


#: What messages advise in Python, and the option that does it here.
_OPTIONS = {
    'load(..., tool="frame")': "--tool FRAME",
    "load(..., joint_stiffness=1e4) [N m/rad, N/m]": "--joint-stiffness 1e4 [N m/rad, N/m]",
    'load(..., actuated=["joint", …])': "--actuated JOINT,JOINT",
    "force= [N] and moment= [N m], for example force=300, moment=100": "--force 300 --moment 100 [N, N m]",
    "wrench=[fx, fy, fz, mx, my, mz] [N, N m]": "--wrench fz=-300",
    'direction=[x, y, z], base axes, or direction="tool z"': "--direction 0,0,1, base axes, or --direction 'tool z'",
    "out='FILE.parquet'": "--out FILE.parquet",
    "wrench is not used by": "--wrench is not used by",
    "direction is not used by": "--direction is not used by",
    "(or home={...})": "(or --home JOINT=VALUE,JOINT=VALUE)",
}


def in_options(message: str) -> str:
    """Return a message whose advice is in options instead of Python."""
    for python, option in _OPTIONS.items():
        message = message.replace(python, option)
    return message


def console(stderr: bool = False) -> Console:
    """Return a console between 40 and 110 columns wide; 80 in a pipe."""
    made = Console(stderr=stderr, highlight=False, markup=False, emoji=False)
    made.width = min(max(made.width, 40), 110)
    return made


#: Spaces at which no line ends: between a number and its unit, inside a unit, a short bracket or an equation.
_KEPT = re.compile(
    r"(?<=\d) (?=(?:[mµnkM]?m|[mµn]?rad|deg|[kM]?N|Pa|[kM]?Hz|m?s|kg|°|%|±)(?![\w]))"
    r"|(?<=\bN) (?=m\b|µ?mm?\b)|(?<=[\w%]) (?=[=±×] )|(?<= [=±×]) |(?<=[(\d]) (?=-?[\d.]+(?: -?[\d.]+)*\))"
)
_HELD = "\N{NO-BREAK SPACE}"


def with_units_held(text: str) -> str:
    """Return a text in which no line ends between a number and its unit, by no-break spaces."""
    return _KEPT.sub(_HELD, text)


def capital(text: str) -> str:
    """Return a text as a sentence begins; one that begins with a column, a place or a name keeps its letters."""
    first = text.partition(" ")[0]
    named = any(letter in "/_." or letter.isdigit() for letter in first)
    return text if named else f"{text[:1].upper()}{text[1:]}"


def lines_of(text: str, width: int, first: str = "", then: str = "") -> list[str]:
    """Return a text broken into lines, in which a number keeps its unit.

    A path too long for a line is broken at its folders, a list of names at its bars; no other word is cut.
    """
    room = width - max(len(first), len(then))
    words = (_pieces(word, room) if len(word) > room else word for word in text.split(" "))
    broken = textwrap.wrap(
        with_units_held(" ".join(words)),
        width,
        initial_indent=first,
        subsequent_indent=then,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return [line.replace(_HELD, " ") for line in broken]


def _pieces(word: str, room: int) -> str:
    """Return a path, or a list without spaces, cut after slashes or bars into pieces that fill lines."""
    pieces = [""]
    for part in re.findall(r"[^/|]*[/|]|[^/|]+$", word):
        if len(pieces[-1]) + len(part) > room:
            pieces.append("")
        pieces[-1] += part
    return " ".join(piece for piece in pieces if piece)


def error_text(message: str, width: int) -> str:
    """Return a message wrapped to `width`, line by line; indented lines keep their indentation."""
    lines = []
    for line in message.splitlines():
        if len(line) <= width:
            lines.append(line)
            continue
        indent = line[: len(line) - len(line.lstrip())]
        lines += lines_of(line.lstrip(), width, indent, indent + "  ")
    return "\n".join(lines)


def heading(out: Console, text: str, detail: str = "") -> None:
    """Print a bold heading with an unbold rest, after an empty line."""
    out.print()
    for index, line in enumerate(lines_of(f"{text}{' ' + detail if detail else ''}", out.width)):
        styled = Text(line)
        if index == 0:
            styled.stylize("bold", 0, min(len(text), len(line)))
        out.print(styled, soft_wrap=True)


def title(out: Console, text: str) -> None:
    """Print what all that follows is about, bold and at the margin."""
    for line in lines_of(text, out.width):
        out.print(Text(line, style="bold"), soft_wrap=True)


def listed(out: Console, label: str, items: Iterable[str], separator: str = "   ", indent: int = 2) -> None:
    """Print 'label  item   item', broken between items; an item longer than a line is wrapped."""
    start = " " * indent + (f"{label:<11} " if label else "")
    room, blank = out.width - len(start), " " * len(start)
    lines = [""]
    for item in items:
        first, *more = lines_of(item, room - len(separator.rstrip())) or [""]
        joined = f"{lines[-1]}{separator}{first}" if lines[-1] else first
        if lines[-1] and len(joined) > room - 1:
            lines[-1] += separator.rstrip()
            lines.append(first)
        else:
            lines[-1] = joined
        lines += more
    for index, line in enumerate(lines):
        out.print(Text((blank if index else start) + line), soft_wrap=True)


def paragraph(out: Console, text: str, bullet: str = "") -> None:
    """Print an indented paragraph."""
    for line in lines_of(text, out.width, f"  {bullet}", "  " + " " * len(bullet)):
        out.print(Text(line), soft_wrap=True)


def bullets(out: Console, title: str, texts: Iterable[str], detail: str = "") -> None:
    """Print a heading and a paragraph for each text; nothing where there is none."""
    for index, text in enumerate(texts):
        if not index:
            heading(out, title, detail)
        paragraph(out, text, "- ")


def make_table(columns: Sequence[str], rows: Iterable[Sequence[str | Text]]) -> Table:
    """Return a table by its headers, '>' before those of numbers, and rows. Nothing in it is ever cut off."""
    table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, 1), header_style="bold")
    for header in columns:
        justify: Literal["left", "right"] = "right" if header.startswith(">") else "left"
        table.add_column(header.removeprefix(">"), justify=justify, overflow="fold")
    for row in rows:
        table.add_row(*row)
    return table


def show_table(out: Console, columns: Sequence[str], rows: Iterable[Sequence[str | Text]], indent: int = 2) -> None:
    """Print a table by its headers and rows, as `make_table` takes them and `print_table` fits them in."""
    print_table(out, make_table(columns, rows), indent)


def fits(out: Console, table: Table, indent: int = 2) -> bool:
    """Return True where a table fits with nothing in it broken, its columns closer to each other if need be."""
    width = _width(out, table)
    if width + indent > out.width:
        table.padding = (0, 1, 0, 0)
        width = _width(out, table)
    return width + indent <= out.width


def _width(out: Console, table: Table) -> int:
    return Measurement.get(out, out.options.update(max_width=_UNBOUNDED), table).maximum


def print_table(out: Console, table: Table, indent: int = 2) -> None:
    """Print a table, indented. Where it is too wide, columns of words are broken between words; a number, a name or a
    unit never is: a row that is still too wide has its name on a line above it.
    """
    room = out.width - indent
    names: list[str] = []
    width = room
    if not fits(out, table, indent):
        _narrow(out, table, _width(out, table) - room)
        names, table = _names_apart(out, table, room)
        width = max(room, _width(out, table))
    lines = out.render_lines(table, out.options.update(width=width), pad=False, new_lines=False)
    for row, line in enumerate(lines, len(names) - len(lines)):
        if names and row >= 0:
            out.print(Text(f"{' ' * indent}{names[row]}"), soft_wrap=True)
        text = Text.assemble(" " * indent, *((segment.text, segment.style or "") for segment in line))
        text.rstrip()
        out.print(text, soft_wrap=True)


def _names_apart(out: Console, table: Table, room: int) -> tuple[list[str], Table]:
    """Return the names of rows that are too wide, and the table without them; no names where that does not help."""
    first, *others = table.columns
    in_lines = not any("\n" in str(cell) for column in table.columns for cell in column.cells)
    if _width(out, table) <= room or first.justify != "left" or not in_lines:
        return [], table
    rest = Table(box=table.box, show_edge=False, pad_edge=False, padding=table.padding, header_style="bold")
    for column in others:
        rest.add_column(column.header, justify=column.justify, no_wrap=True)
    for row in zip(*(column.cells for column in others), strict=True):
        rest.add_row(*row)
    return ([str(name) for name in first.cells], rest) if _width(out, rest) <= room else ([], table)


def _narrow(out: Console, table: Table, excess: int) -> None:
    """Take `excess` away from the widths of columns of words, the widest first, none below its longest word."""
    unbounded = out.options.update(max_width=_UNBOUNDED)
    for column in table.columns:
        texts = [column.header, *column.cells]
        spans = [Measurement.get(out, unbounded, text) for text in texts]
        column.width = max(span.maximum for span in spans)
        # a column of units, of which none is longer, is as narrow as can be
        column.min_width = max(span.minimum for span in spans) if column.width > 12 else column.width
    while excess > 0:
        loose = [c for c in table.columns if c.justify == "left" and (c.width or 0) > (c.min_width or 0)]
        if not loose:
            break
        widest = max(loose, key=lambda column: column.width or 0)
        widest.width = (widest.width or 0) - 1
        excess -= 1
