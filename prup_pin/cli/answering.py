"""`stiffness`: the answer about one pose, as text, JSON and pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .. import __version__
from ..robot import Robot
from ..views.report.as_json import answer_as_json, dump
from ..views.text import terminal
from ..views.text.answer import Answer
from ..views.text.answer_text import print_answer
from ..views.text.sensitivity_text import print_stiffen_first
from .files import folder_for, list_written, write, write_figures
from .options import AsJson, Frame
from .question import Question

__all__ = ["stiffness"]


def stiffness(
    question: Question,
    frame: Frame = None,
    as_json: AsJson = None,
    pictures: Annotated[Path | None, typer.Option(metavar="DIR", help="Write pose.png and shares.png there.")] = None,
    sensitivity: Annotated[
        bool, typer.Option("--sensitivity", help="Also say which values to change first to make it stiffer.")
    ] = False,
) -> None:
    """K, C, deflection and each module's share at one pose."""
    case = question.understood(frame)
    folder_for(pictures, "--pictures")
    answer = Answer(case.compliance(), case.wrench, frame)
    slopes = case.robot.sensitivity(case.pose, answer.load.wrench) if sensitivity else None
    written = [] if pictures is None else _draw(pictures, case.robot, answer)
    document = answer_as_json(case.robot, answer, case.source, case.changes, case.notes, __version__, slopes)
    if as_json == "-":
        typer.echo(dump(document))
        return
    if as_json is not None:
        write(Path(as_json), dump(document) + "\n", "--json")
        written.append(Path(as_json))
    print_answer(terminal.console(), case.robot, answer, case.source, case.changes, case.notes)
    if slopes is not None:
        print_stiffen_first(terminal.console(), slopes)
    if written:
        list_written(written)


def _draw(folder: Path, robot: Robot, answer: Answer) -> list[Path]:
    """Write the pictures of an answer and return where they are."""
    from ..views.drawing.figures import pose_figure, shares_figure

    wrench = answer.load.wrench
    figures = {"pose": pose_figure(robot, answer.compliance.pose, answer.compliance, wrench)}
    if answer.shares is not None:
        figures["shares"] = shares_figure(answer.compliance, wrench)
    return write_figures(folder, figures, "--pictures", ["png"])
