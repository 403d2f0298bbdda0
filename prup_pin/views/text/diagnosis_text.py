"""A diagnosis and a calibration as text for a terminal."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.text import Text

from ...diagnosis import Diagnosis, Finding
from ...diagnosis.calibration import Calibration
from ...numbers import counted, number, readable_unit
from ...recordings import Recording
from ...robot import Robot
from .diagnosis_words import (
    MOST_PARAMETERS,
    alternative_text,
    by_place,
    channel_rows,
    cost_text,
    effort_rows,
    finding_text,
    hidden_rows,
    length_of,
    multiple_text,
    noise_text,
    parameter_texts,
    recording_rows,
    verdict_text,
)
from .tables import some
from .terminal import bullets, heading, lines_of, listed, make_table, paragraph, print_table


def print_diagnosis(
    out: Console, robot: Robot, recording: Recording | Sequence[Recording], diagnosis: Diagnosis
) -> None:
    """Print the verdict, the findings with intervals, the residuals before and after, doubts and remarks."""
    _verdict(out, verdict_text(diagnosis))
    out.print()
    listed(out, "robot", [robot.name])
    recordings = [recording] if isinstance(recording, Recording) else list(recording)
    if len(recordings) > 1:
        for name, *texts in recording_rows(diagnosis):
            listed(out, "recording", [name, *texts], ", ")
    else:
        used = len(diagnosis.samples)
        held = length_of(diagnosis, recordings[0])
        listed(out, "recording", [f"{counted(len(recordings[0]), 'sample')}, {used} used", held], ", ")
    listed(out, "noise", noise_text(diagnosis), ", ")
    if diagnosis.findings:
        heading(out, "How to simulate it" if diagnosis.verdict == "nothing_missing" else "Left out")
        for index, finding in enumerate(diagnosis.told, 1):
            _print_finding(out, diagnosis, index, finding)
    heading(out, "Measured less simulated", "(root mean square)")
    table = make_table(("", "left"), ("before", "right"), ("after", "right"), ("", "left"))
    for row in channel_rows(diagnosis):
        table.add_row(*row)
    print_table(out, table)
    if rows := effort_rows(diagnosis):
        heading(out, "Efforts, joint by joint", "(held out)")
        table = make_table(("joint", "left"), ("noise", "right"), ("× noise", "right"), ("% of the effort", "right"))
        for row in rows:
            table.add_row(*row)
        print_table(out, table)
        if note := multiple_text(diagnosis):
            paragraph(out, f"({note})")
    if diagnosis.not_detectable:
        heading(out, "What these data could not show", "(and from which size they would)")
        for physics, where, needed in hidden_rows(diagnosis.not_detectable):
            paragraph(out, f"{physics}{f' ({where})' if where else ''}: {needed}", "- ")
    why = diagnosis.next_experiment.get("why")
    if why:
        heading(out, "Next experiment")
        paragraph(out, str(why))
    bullets(out, "Remarks", diagnosis.remarks)


def _verdict(out: Console, text: str) -> None:
    """Print a bold paragraph at the margin."""
    for line in lines_of(text, out.width):
        out.print(Text(line, style="bold"), soft_wrap=True)


def _print_finding(out: Console, diagnosis: Diagnosis, index: int, finding: Finding) -> None:
    paragraph(out, finding_text(finding), f"{index}  ")
    paragraph(out, finding.statement, "   ")
    places = by_place(finding)
    for place, texts in places.items():
        told = ", ".join(f"{name} {value} (95 %: {interval})" for name, value, interval in texts)
        paragraph(out, f"{place}: {told}", "   ")
    alone = [] if places else parameter_texts(finding.parameters)
    shown = MOST_PARAMETERS if len(alone) > MOST_PARAMETERS + 1 else len(alone)
    for name, value, interval in alone[:shown]:
        paragraph(out, f"{name} {value} (95 %: {interval})", "   ")
    if shown < len(alone):
        paragraph(out, f"and {len(alone) - shown} more, in diagnosis.json", "   ")
    if finding.curve is not None:
        pairs = zip(finding.curve.load, finding.curve.deformation, strict=True)
        points = "  ".join(f"{number(load, 3)}: {number(1e6 * moved, 3)}" for load, moved in pairs)
        paragraph(out, f"curve, load [N, N m]: deformation [µm, µrad]  {points}", "   ")
    for text in (*alternative_text(diagnosis, finding), cost_text(finding)):
        if text:
            paragraph(out, text, "   ")
    if finding.remedy:
        paragraph(out, f"to do: {finding.remedy}", "   ")


# -- a calibration -----------------------------------------------------------------------------------------------------


#: Parameters that are shown: the best known ones, and all that lie far from the robot file.
_SHOWN, _FAR = 20, 2.0
#: What is learned less than this was not seen.
_UNSEEN = 0.01
#: Of parameters that were not seen so many of a kind are named, and how many more there are.
_NAMED = 3


def print_calibration(out: Console, robot: Robot, recordings: Sequence[Recording], found: Calibration) -> None:
    """Print before and after, what was learned, what these data tell only together and what they never saw."""
    _verdict(out, _within_tolerances(found))
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
    bullets(out, "Remarks", found.remarks)


def _within_tolerances(found: Calibration) -> str:
    before, after = number(found.nominal, 3), number(found.calibrated, 3)
    end = "which is noise" if found.is_explained else "more than noise: something is left out, see prup-pin diagnose"
    return f"The drawing leaves {before} times the noise; within its tolerances it leaves {after}, {end}."
