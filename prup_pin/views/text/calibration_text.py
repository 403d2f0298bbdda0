"""A calibration as text for a terminal."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.text import Text

from ...diagnosis.calibration import Calibration
from ...numbers import counted, number, readable_unit
from ...recordings import Recording
from ...robot import Robot
from .tables import some
from .terminal import heading, lines_of, listed, make_table, paragraph, print_table

#: Parameters that are shown: the best known ones, and all that lie far from the robot file.
_SHOWN, _FAR = 20, 2.0
#: What is learned less than this was not seen.
_UNSEEN = 0.01
#: Of parameters that were not seen so many of a kind are named, and how many more there are.
_NAMED = 3


def print_calibration(out: Console, robot: Robot, recordings: Sequence[Recording], found: Calibration) -> None:
    """Print before and after, what was learned, what these data tell only together and what they never saw."""
    for line in lines_of(_verdict(found), out.width):
        out.print(Text(line, style="bold"), soft_wrap=True)
    out.print()
    listed(out, "robot", [robot.name])
    for recording in recordings:
        name = [Path(recording.path).name] if len(recordings) > 1 else []
        listed(out, "recording", [*name, counted(len(recording), "sample")], ", ")
    listed(out, "used", [counted(found.samples, "sample")])
    listed(out, "parameters", [f"{len(found.parameters)} that may be off"], ", ")
    acting = [effect.statement(robot.mechanism) for effect in found.effects[1:]]
    if acting:
        listed(out, "acting", acting)
    heading(out, "What was learned", "(off: in tolerances; known: share of the tolerance that is left)")
    table = make_table(("", "left"), ("calibrated", "right"), ("", "left"), ("off", "right"), ("known", "right"))
    known = [item for item in found.parameters if item.learned > _UNSEEN]
    for place, item in enumerate(known):
        if place < _SHOWN or abs(item.x) > _FAR:
            unit, factor = readable_unit(max(abs(item.value), item.sd), item.deviation.unit)
            table.add_row(
                item.name,
                f"{number(factor * item.value, 5)} ± {number(factor * item.sd, 2)}",
                unit,
                f"{item.x:+.2f}",
                f"{number(100 * item.share, 3)} %",
            )
    print_table(out, table)
    if found.twins:
        heading(out, "Told only together")
        for group in found.twins:
            paragraph(out, ", ".join(group), "- ")
    unseen = [item.name for item in found.parameters if item.learned <= _UNSEEN]
    if unseen:
        heading(out, "Never seen by these data", f"({len(unseen)} parameters)")
        alike: dict[str, list[str]] = {}
        for parameter in unseen:
            owner, _, kind = parameter.rpartition(".")
            alike.setdefault(kind, []).append(owner)
        for kind, owners in alike.items():
            paragraph(out, f"{kind} of {', '.join(some(owners, _NAMED))}", "- ")
    if found.remarks:
        heading(out, "Remarks")
        for text in found.remarks:
            paragraph(out, text, "- ")


def _verdict(found: Calibration) -> str:
    before, after = number(found.nominal, 3), number(found.calibrated, 3)
    end = "which is noise" if found.is_explained else "more than noise: something is left out, see prup-pin diagnose"
    return f"The drawing leaves {before} times the noise; within its tolerances it leaves {after}, {end}."
