"""What a recording could show, as text for a terminal."""

from __future__ import annotations

from rich.console import Console

from ...diagnosis.before import Prospects
from ...numbers import counted, number
from ...recordings import Recording
from ...robot import Robot
from .diagnosis_words import hidden_rows
from .terminal import heading, listed, make_table, paragraph, print_table


def print_prospects(out: Console, robot: Robot, recording: Recording, found: Prospects) -> None:
    """Print how the joints move, what could not be told apart or seen, and remarks."""
    listed(out, "robot", [robot.name])
    listed(out, "recording", [counted(len(recording), "sample")])
    if found.conventions:
        heading(out, "Written otherwise than it says")
        for text in found.conventions:
            paragraph(out, text, "- ")
    if found.joints:
        heading(out, "Motion")
        names = (
            ("joint", "left"),
            ("travel", "right"),
            ("top speed", "right"),
            ("at rest", "right"),
            ("effort", "right"),
        )
        table = make_table(*names)
        for item in found.joints:
            slides = item.unit == "m"
            table.add_row(
                item.joint,
                f"{number(item.travel, 3)} {item.unit}",
                f"{number(item.speed, 3)} {item.unit}/s",
                f"{100 * item.rest:.0f} %",
                "not recorded" if item.effort is None else f"up to {number(item.effort, 3)} {'N' if slides else 'N m'}",
            )
        print_table(out, table)
    if found.alike:
        heading(out, "What this motion cannot tell apart")
        for first, second in found.alike:
            paragraph(out, f"{first.replace('_', ' ', 1)} and {second.replace('_', ' ', 1)}", "- ")
    if found.not_detectable:
        heading(out, "What these data could not show", "(and from which size they would)")
        for physics, where, needed in hidden_rows(found.not_detectable):
            paragraph(out, f"{physics}{f' ({where})' if where else ''}: {needed}", "- ")
    if found.remarks:
        heading(out, "Remarks")
        for text in found.remarks:
            paragraph(out, text, "- ")
