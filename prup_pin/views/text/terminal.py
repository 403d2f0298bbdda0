"""Building blocks of text for a terminal: readable on 80 columns, without colour, and never cut off."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable

from rich import box
from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

__all__ = ["console", "error_text", "heading", "in_options", "listed", "make_table", "paragraph", "print_table"]


#: What messages advise in Python, and the option that does it here.
_OPTIONS = {
    'load(..., tool="frame")': "--tool FRAME",
    "load(..., joint_stiffness=1e4) [N m/rad, N/m]": "--joint-stiffness 1e4 [N m/rad, N/m]",
    'load(..., actuated=["joint", …])': "--actuated JOINT,JOINT",
    "force= [N] and moment= [N m], for example force=300, moment=100": "--force 300 --moment 100 [N, N m]",
    "wrench=[fx, fy, fz, mx, my, mz] [N, N m]": "--wrench fz=-300",
    'direction=[x, y, z], base axes, or direction="tool z"': "--direction 0,0,1, base axes, or --direction 'tool z'",
    "out='FILE.parquet'": "--out FILE.parquet",
    "(or home={...})": "(or --home JOINT=VALUE,JOINT=VALUE)",
}


def in_options(message: str) -> str:
    """Return a message whose advice is in options instead of Python."""
    for python, option in _OPTIONS.items():
        message = message.replace(python, option)
    return message


def console(stderr: bool = False) -> Console:
    """Return a console between 80 and 110 columns wide; 80 in a pipe."""
    made = Console(stderr=stderr, highlight=False, markup=False, emoji=False)
    made.width = min(max(made.width, 80), 110)
    return made


def error_text(message: str, width: int) -> str:
    """Return a message wrapped to `width`, line by line; indented lines keep their indentation."""
    lines = []
    for line in message.splitlines():
        if len(line) <= width:
            lines.append(line)
            continue
        indent = line[: len(line) - len(line.lstrip())] + "  "
        lines += textwrap.wrap(line, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
    return "\n".join(lines)


def heading(out: Console, text: str, detail: str = "") -> None:
    """Print a bold heading with an unbold rest, after an empty line."""
    out.print()
    for index, line in enumerate(textwrap.wrap(f"{text}{' ' + detail if detail else ''}", out.width)):
        styled = Text(line)
        if index == 0:
            styled.stylize("bold", 0, min(len(text), len(line)))
        out.print(styled)


def listed(out: Console, label: str, items: Iterable[str], separator: str = "   ", indent: int = 2) -> None:
    """Print 'label  item   item', broken between items; an item longer than a line is wrapped."""
    start = " " * indent + (f"{label:<11} " if label else "")
    room, blank = out.width - len(start), " " * len(start)
    lines = [""]
    for item in items:
        for part in textwrap.wrap(item, room, break_on_hyphens=False) or [""]:
            joined = f"{lines[-1]}{separator}{part}" if lines[-1] else part
            if len(joined) <= room - 1:
                lines[-1] = joined
            else:
                lines[-1] += separator.rstrip() if lines[-1] else ""
                lines.append(part) if lines[-1] else lines.__setitem__(-1, part)
    for index, line in enumerate(lines):
        out.print(Text((blank if index else start) + line), soft_wrap=True)


def paragraph(out: Console, text: str, bullet: str = "") -> None:
    """Print an indented paragraph."""
    for line in textwrap.wrap(
        text, out.width, initial_indent=f"  {bullet}", subsequent_indent="  " + " " * len(bullet)
    ):
        out.print(Text(line), soft_wrap=True)


def make_table(*columns: tuple[str, str]) -> Table:
    """Return a table; `columns` are (header, 'left' or 'right'). Nothing in it is ever cut off."""
    table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, 1), header_style="bold")
    for header, justify in columns:
        table.add_column(header, justify=justify, overflow="fold")  # type: ignore[arg-type]
    return table


def print_table(out: Console, table: Table, indent: int = 2) -> None:
    """Print a table, indented."""
    out.print(Padding(table, (0, 0, 0, indent), expand=False))
