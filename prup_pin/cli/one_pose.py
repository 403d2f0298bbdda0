"""The commands about one pose: `stiffness`, in text, JSON and pictures; `view` and `report`, pages about it."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .. import __version__
from ..errors import InputError
from ..files import text_of
from ..robot import Robot
from ..views.report.as_json import answer_as_json, dump
from ..views.text import terminal
from ..views.text.answer import Answer
from ..views.text.one_pose import print_answer, print_stiffen_first
from .files import check_folder, file_name, folder_for, list_written, say_written, write, write_figures
from .options import AsJson, Frame, Open, Question, Scale, Sight

if TYPE_CHECKING:
    from ..views.meshcat.explorer import Explorer
    from ..views.meshcat.view import View


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
    folder_for(pictures, "--pictures")
    check_folder(None if as_json in (None, "-") else Path(as_json), "--json")
    case = question.understood(frame)
    answer = Answer(case.compliance(), case.wrench, frame, case.robot)
    written = [] if pictures is None else _draw(pictures, case.robot, answer)
    document = answer_as_json(case.robot, answer, case.source, case.changes, case.notes, __version__, sensitivity)
    if as_json == "-":
        typer.echo(dump(document))
        return
    if as_json is not None:
        write(Path(as_json), dump(document) + "\n", "--json")
        written.append(Path(as_json))
    print_answer(terminal.console(), case.robot, answer, case.source, case.changes, case.notes)
    if sensitivity:
        print_stiffen_first(terminal.console(), answer)
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


def view(
    question: Sight,
    scale: Scale = None,
    html: Annotated[
        Path | None,
        typer.Option("--html", "--out", metavar="FILE", help="Where to write the page. Default: ./ROBOT.html."),
    ] = None,
    serve: Annotated[bool, typer.Option("--serve", help="Serve it on this machine until Ctrl-C; no file.")] = False,
    live: Annotated[
        bool, typer.Option("--live", help="Sliders for pose and load, in the browser, until Ctrl-C; no file.")
    ] = False,
    open_browser: Annotated[
        bool | None, typer.Option("--open/--no-open", help="Open it in the browser. Default: with --live.")
    ] = None,
) -> None:
    """The robot in 3-D: its pose, its deflection, what yields."""
    from ..views.meshcat.explorer import Explorer
    from ..views.meshcat.view import view as shown_in_3d

    given = [name for name, wanted in (("--serve", serve), ("--live", live), ("--html", html is not None)) if wanted]
    if len(given) > 1:
        raise InputError(f"{' and '.join(given)} exclude each other; give one of them")
    check_folder(html, "--html")
    case = question.understood()
    # a robot on which nothing yields can still be looked at
    compliance = case.compliance() if case.robot.mechanism.modules or case.wrench is not None else None
    shown: View | Explorer
    if live:
        shown = Explorer(case.robot, case.pose, case.wrench, scale)
    else:
        shown = shown_in_3d(case.robot, case.pose, case.wrench, scale, compliance=compliance)
    for note in case.notes:
        typer.echo(f"- {note}")
    if isinstance(shown, Explorer) or serve:
        _serve(shown, live if open_browser is None else open_browser)
        return
    path = html if html is not None else Path(f"{file_name(question.robot)}.html")
    write(path, text_of(shown.static_html()), "--html")
    say_written(path, bool(open_browser))


def report(
    question: Question,
    frame: Frame = None,
    scale: Scale = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "--html", metavar="FILE", help="Where to write it. Default: ./ROBOT_report.html."),
    ] = None,
    open_browser: Open = False,
) -> None:
    """One page with everything about one pose, to print or hand on."""
    from ..views.report import report_html

    check_folder(out, "--out")
    case = question.understood(frame)
    page = report_html(
        case.robot,
        case.pose,
        case.wrench,
        scale=scale,
        frame=frame,
        compliance=case.compliance(),
        changes=case.changes,
        notes=case.notes,
    )
    path = out if out is not None else Path(f"{file_name(question.robot)}_report.html")
    write(path, text_of(page), "--out")
    say_written(path, open_browser)


def _serve(shown: View | Explorer, open_browser: bool) -> None:
    """Serve a view or an explorer until Ctrl-C."""
    url = shown.serve()
    try:
        typer.echo(f"Serving {url} on this machine; Ctrl-C stops it")
        if open_browser:
            webbrowser.open(url)
        shown.wait()
    except KeyboardInterrupt:
        typer.echo("Stopped")
    finally:
        shown.close()
