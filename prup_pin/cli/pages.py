"""`view` and `report`: pages about one pose."""

from __future__ import annotations

import time
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import InputError
from ..recordings.writer import text_of
from .files import check_folder, file_name, say_written, write
from .options import Frame, Open, Scale
from .question import Question, Sight

if TYPE_CHECKING:
    from ..views.meshcat.explorer import Explorer
    from ..views.meshcat.view import View

__all__ = ["report", "view"]


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
    typer.echo(f"Serving {url} on this machine; Ctrl-C stops it")
    if open_browser:
        webbrowser.open(url)
    try:
        while True:
            time.sleep(3600)
    except KeyboardInterrupt:
        typer.echo("Stopped")
    finally:
        shown.close()
