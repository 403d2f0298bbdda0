"""`import`: somebody's log as a recording, by a map that is guessed first and corrected then."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError
from ..recordings import write_recording
from ..views.text import terminal
from .files import check_folder, list_written
from .options import Reading, RobotOption, robot_beside

__all__ = ["import_"]


def import_(
    logs: Annotated[
        list[Path],
        typer.Argument(
            metavar="LOG...",
            help=".csv, .tsv, .parquet, .mat, .h5, .npz, .mcap, .bag, .db3, or a ROS 2 bag's folder; several of one "
            "motion, such as the robot's and a camera's.",
        ),
    ],
    map_file: Annotated[
        Path | None,
        typer.Option(
            "--map", metavar="MAP.yaml", help="Which column is what; guessed and written where there is none."
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="RECORDING.csv", help="The recording. Default: only the map.")
    ] = None,
    robot: RobotOption = None,
    *,
    reading: Reading,
) -> None:
    """Somebody's log as a recording: units, signs, motors to joints, one clock; docs/import.md."""
    from ..imports import convert, guess, read_logs, read_map, robot_named
    from ..imports.guess import write_text
    from ..views.text.import_text import print_conversion, print_log

    plan = map_file if map_file is not None else Path(f"{logs[0].stem}.map.yaml")
    _check(logs, plan, out)
    content = read_logs(logs)
    there = plan.exists()
    name = robot if robot is not None or not there else robot_named(plan)
    if name is not None and robot is None:
        name = robot_beside(name, plan)
    mechanism = reading.load(name).mechanism if name is not None else None
    shown = terminal.console()
    if not there:
        first = guess(content, mechanism, robot)
        write_text(plan, first.text)
        if out is None:
            print_log(shown, content)
            typer.echo()
            typer.echo(first.text.rstrip())
            _tell(first.doubts)
            list_written((plan,))
            return
        if first.doubts:
            lines = "\n".join(f"  {doubt}" for doubt in first.doubts)
            raise InputError(
                f"a map was guessed and written: {plan}. {_count(first.doubts)} in it must be looked at before a "
                f"recording is made of it:\n{lines}\nCorrect the lines, then give the same command again"
            )
    understood = read_map(plan, content, mechanism)
    if out is None:
        raise InputError(f"'{plan}' is there already; give --out RECORDING.csv to make a recording by it")
    done = convert(content, understood, mechanism)
    write_recording(done.recording, out)
    print_conversion(shown, content, understood, done)
    if not there:
        typer.echo("\nThe map was guessed, every line by a name or by proof; read it once.")
    list_written((*(() if there else (plan,)), out, out.with_suffix(".json")))


def _check(logs: list[Path], plan: Path, out: Path | None) -> None:
    """Raise InputError, before anything is read, where a file could not be written or would be written over."""
    check_folder(plan, "--map")
    if plan.suffix.lower() not in (".yaml", ".yml"):
        raise InputError(f"--map: '{plan}' has the ending '{plan.suffix}'; expected .yaml")
    check_folder(out, "--out")
    if out is not None and out.suffix.lower() != ".csv":
        raise InputError(f"--out: '{out}' has the ending '{out.suffix}'; expected .csv")
    if out is not None and out.exists() and any(log.exists() and out.samefile(log) for log in logs):
        raise InputError(f"--out: '{out}' is the log itself; give another name")


def _tell(doubts: tuple[str, ...]) -> None:
    if doubts:
        typer.echo(f"\n{_count(doubts)} must be looked at (CHECK). Then: --map and --out RECORDING.csv.")
    else:
        typer.echo("\nNothing in it is doubtful; read it once. Then: --map and --out RECORDING.csv.")


def _count(doubts: tuple[str, ...]) -> str:
    return f"{len(doubts)} line{'s' if len(doubts) != 1 else ''}"
