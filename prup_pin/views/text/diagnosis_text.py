"""A diagnosis as text for a terminal."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.text import Text

from ...diagnosis import Diagnosis, Finding
from ...numbers import counted, number
from ...recordings import Recording
from ...robot import Robot
from .diagnosis_words import (
    alternative_text,
    by_place,
    channel_rows,
    cost_text,
    effort_rows,
    finding_text,
    hidden_rows,
    length_of,
    noise_text,
    parameter_texts,
    recording_rows,
    verdict_text,
)
from .terminal import heading, lines_of, listed, make_table, paragraph, print_table


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
        heading(out, "Left out")
        for index, finding in enumerate(diagnosis.findings, 1):
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
    if diagnosis.not_detectable:
        heading(out, "What these data could not show", "(and from which size they would)")
        for physics, where, needed in hidden_rows(diagnosis.not_detectable):
            paragraph(out, f"{physics}{f' ({where})' if where else ''}: {needed}", "- ")
    why = diagnosis.next_experiment.get("why")
    if why:
        heading(out, "Next experiment")
        paragraph(out, str(why))
    if diagnosis.remarks:
        heading(out, "Remarks")
        for text in diagnosis.remarks:
            paragraph(out, text, "- ")


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
    for name, value, interval in () if places else parameter_texts(finding.parameters):
        paragraph(out, f"{name} {value} (95 %: {interval})", "   ")
    if finding.curve is not None:
        pairs = zip(finding.curve.load, finding.curve.deformation, strict=True)
        points = "  ".join(f"{number(load, 3)}: {number(1e6 * moved, 3)}" for load, moved in pairs)
        paragraph(out, f"curve, load [N, N m]: deformation [µm, µrad]  {points}", "   ")
    for text in (*alternative_text(diagnosis, finding), cost_text(finding)):
        if text:
            paragraph(out, text, "   ")
    if finding.remedy:
        paragraph(out, f"to do: {finding.remedy}", "   ")
