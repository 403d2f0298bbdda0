"""An exported model as text: what the robot file holds, what it leaves out, what to know of it."""

from __future__ import annotations

from rich.console import Console

from ...export import Exported
from ...numbers import number
from .terminal import heading, listed, make_table, print_table

#: Values of an effect that are listed; the file's comment holds all of them.
_MOST_VALUES = 6


def print_exported(out: Console, made: Exported) -> None:
    """Print which effects the file holds, and of what is left out how much it explained."""
    heading(out, "In the file", "" if made.said else "  the robot as it was drawn")
    if made.said:
        rows = [(item.physics, item.place, _values(item.values)) for item in made.said]
        print_table(out, make_table(("physics", "place", "values"), rows))
    if made.left_out:
        heading(out, "Left out", "  and what its effect explained of the held-out squared residual")
        lost = [(item.physics, item.place, item.what, _share(item.share)) for item in made.left_out]
        print_table(out, make_table(("physics", "place", "what", ">explained"), lost))
    if made.remarks:
        heading(out, "To know")
        listed(out, "", made.remarks)


def _values(values: tuple[str, ...]) -> str:
    more = len(values) - _MOST_VALUES
    return "\n".join((*values[:_MOST_VALUES], *([f"and {more} more"] if more > 0 else [])))


def _share(share: float | None) -> str:
    return "unknown" if share is None else f"{number(100 * share, 3)} %"
