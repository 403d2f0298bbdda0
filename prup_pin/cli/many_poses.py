"""The commands about many poses: `sweep`, over the workspace; `compensate`, along a path."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from ..compensation import compensate as compensated
from ..compensation import read_path as path_of
from ..compensation import write_commands
from ..errors import InputError, PrupPinError, UnknownNameError, shortened
from ..numbers import number
from ..recordings import robot_named_beside
from ..review import yielding_beside
from ..robot import Robot
from ..sweep import QUANTITIES
from ..sweep.places import MAX_DRAWS
from ..sweep.running import processes
from ..sweep.table import FORMATS
from ..views.text import terminal
from ..views.text.many_poses import print_compensation, print_sweep
from ..views.text.values import coordinate_dimensions, coordinate_text, dimension
from . import progress
from .files import check_csv, check_folder, folder_for, list_written, write_figures
from .options import Effects, ModelOption, Reading, RobotName, RobotOption, SetParameters, Workers
from .recorded import model_typed, modelled, refuse_unanswered, robot_beside
from .typed import parse_list, parse_quantity, parse_wrench


def sweep(
    robot: RobotName = "3prup",
    over: Annotated[
        list[str] | None,
        typer.Option(
            "--over",
            metavar="theta=-30deg..30deg:41",
            help="A coordinate: a value, or from … to : how many. Repeatable, in the order of the axes.",
        ),
    ] = None,
    draws: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Draw N poses between the ends of --over instead of a grid.")
    ] = None,
    seed: Annotated[int, typer.Option(metavar="N", help="Of --draws: the same seed draws the same poses.")] = 0,
    quantities: Annotated[
        str | None,
        typer.Option(
            metavar="C,K,extremes,…",
            help="What is wanted of each pose; list: --quantities help. Default: translational, homogenised_ksi ("
            "or K_task, where there is no K); with --force or --moment extremes, with --wrench deflection.",
            show_default=False,
        ),
    ] = None,
    force: Annotated[
        str | None, typer.Option(metavar="300", help="Half the side of the box of wrenches, forces.")
    ] = None,
    moment: Annotated[str | None, typer.Option(metavar="100", help="The same, moments.")] = None,
    wrench: Annotated[
        str | None, typer.Option(metavar="fx=300,mz=100", help="Load for deflection, shares and buckling_margin.")
    ] = None,
    direction: Annotated[
        str | None, typer.Option(metavar="0,0,1|'tool z'", help="Of 'directional', base axes or the tool's.")
    ] = None,
    length: Annotated[
        str | None, typer.Option(metavar="250mm", help="Makes rotations arcs in homogenised indices.")
    ] = None,
    compiled: Annotated[
        bool, typer.Option("--compiled", help="As machine code (extra: compiled); for many thousand poses.")
    ] = False,
    workers: Workers = 1,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="FILE.csv", help="Write the table, .csv or .parquet; an interrupted sweep goes on."
        ),
    ] = None,
    plots: Annotated[
        Path | None, typer.Option("--plots", metavar="DIR", help="Write a map of each quantity there, as PNG and SVG.")
    ] = None,
    set_parameters: SetParameters = None,
    *,
    reading: Reading,
) -> None:
    """Stiffness over the workspace: grids or draws of poses, indices, extremes over a box of loads."""
    names = [name.strip() for name in (quantities or "").split(",") if name.strip()]
    if names == ["help"]:
        rows = [(quantity.name, quantity.summary, quantity.unit) for quantity in QUANTITIES.values()]
        terminal.show_table(terminal.console(), ("name", "what", "unit"), rows)
        return
    folder_for(plots, "--plots")
    check_folder(out, "--out")
    if out is not None and out.suffix not in FORMATS:
        raise InputError(f"--out: '{out}': expected a name that ends in .csv or .parquet, '{out.with_suffix('.csv')}'")
    loaded, _ = reading.changed(robot, set_parameters)
    if quantities is None:
        loaded_by = {"extremes": force is not None or moment is not None, "deflection": wrench is not None}
        names = [*(name for name, given in loaded_by.items() if given), "translational", *_index(loaded)]
    asked: dict[str, Any] = _axes(loaded, over or [], draws)
    kinds = _dimensions(loaded)
    whole = loaded._kinematics.completed(asked)
    text = {"over": "; ".join(_axis(name, kinds[name], value) for name, value in asked.items())}
    if len(whole) > len(asked):
        text["at home"] = "; ".join(_axis(name, kinds[name], whole[name]) for name in whole if name not in asked)
    for name, given, kind in (("force", force, "force"), ("moment", moment, "moment"), ("length", length, "length")):
        if given is not None:
            asked[name] = parse_quantity(given, kind, f"--{name}")
    if wrench is not None:
        asked["wrench"] = parse_wrench(wrench)
    if direction is not None:
        asked["direction"] = direction if "tool" in direction else parse_list(direction, 3 * ["number"], "xyz",
                                                                              "--direction")  # fmt: skip
    if force is not None or moment is not None:
        units = {"force": "N", "moment": "N m"}
        sizes = [f"{name}s up to {number(asked[name])} {unit}" for name, unit in units.items() if asked.get(name)]
        text["loads"] = f"{', '.join(sizes)}, each component, all signs"
    if draws is not None:
        asked |= {"draws": draws, "seed": seed}
    if plots is not None:
        from ..views.drawing.sweep_figures import check_drawn, figures_of

        check_drawn(names, scattered=not any(isinstance(asked.get(name), np.ndarray) for name in kinds))
    with progress.rows() as show, processes(workers) as executor:
        found = loaded.sweep(quantities=names, compiled=compiled, executor=executor, out=out, progress=show, **asked)
    written = [] if out is None else [out]
    if plots is not None:
        written += write_figures(plots, figures_of(found), "--plots")
    print_sweep(terminal.console(), found, text)
    if written:
        list_written(written)


def _index(robot: Robot) -> list[str]:
    """Return what tells a stiffness where nothing else is asked for: of K one index, else K_task where there is one.

    Home may be singular where other poses are not, as that of a stretched arm is: what yields beside it counts.
    """
    with suppress(PrupPinError):
        home = robot.compliance(robot.home)
        if not len(home.rigid_directions) or yielding_beside(robot, home) == 6:
            return ["homogenised_ksi"]
    return ["K_task"] if robot.mechanism.tasks else []


def _axes(robot: Robot, over: Sequence[str], draws: int | None) -> dict[str, Any]:
    """Return coordinates as `Robot.sweep` takes them, of 'theta=-30deg..30deg:41'."""
    dimensions = _dimensions(robot)
    values: dict[str, Any] = {}
    for item in over:
        name, equals, text = item.partition("=")
        name = name.strip()
        if not equals:
            raise InputError(f"--over {item}: expected NAME=VALUE or NAME=FROM..TO:COUNT, for example z=0.3")
        if name not in dimensions:
            raise UnknownNameError("coordinate", name, list(dimensions))
        if name in values:
            raise InputError(f"--over {item}: '{name}' is given twice")
        values[name] = _values(text, dimensions[name], item, draws is not None)
    if not over:
        example = " ".join(f"--over {name}=…" for name in dimensions)
        raise InputError(f"which poses? Give {example}; each a value, or FROM..TO:COUNT such as -30deg..30deg:41")
    return values


def _values(text: str, dimension: str, item: str, ends: bool) -> Any:
    """Return a number, an array from .. to, or, where poses are drawn, the two ends."""
    low, dots, rest = text.partition("..")
    if not dots:
        if ":" in text:
            meant = text.replace(":", "..", 1)
            hint = f": {meant}" if ":" in meant else ""
            raise InputError(f"--over {item}: expected a value, or FROM..TO:COUNT with two dots between the ends{hint}")
        return parse_quantity(text, dimension, "--over", item, len(item) - len(text))
    high, colon, count = rest.partition(":")
    starts = len(item) - len(text), len(item) - len(rest)
    first, last = (
        parse_quantity(part, dimension, "--over", item, start) for part, start in zip((low, high), starts, strict=True)
    )
    if ends:
        if colon:
            raise InputError(f"--over {item}: with --draws, give the two ends alone, without ':{count}'")
        return first, last
    if re.fullmatch("0*[1-9][0-9]*", count.strip()) is None:
        raise InputError(f"--over {item}: expected how many values after ':', for example {low}..{high}:41")
    if len(count.strip()) > 20 or int(count) > MAX_DRAWS:
        raise InputError(f"--over {shortened(item)}: expected at most {MAX_DRAWS} values on one axis")
    if first >= last:
        raise InputError(f"--over {item}: from {low} to {high} is a reversed or empty range; give the lower end first")
    return np.linspace(first, last, int(count))


def _dimensions(robot: Robot) -> Mapping[str, str]:
    """Return the dimension of each coordinate of a sweep: of tasks, of a tree's joints, else of actuated joints."""
    mechanism = robot.mechanism
    return coordinate_dimensions(robot) or {name: dimension(mechanism, name) for name in mechanism.actuated}


def _axis(name: str, kind: str, value: Any) -> str:
    """Return 'theta -30 deg … 30 deg in 41' of an axis, its two ends where poses are drawn, or one value."""
    grid = isinstance(value, np.ndarray)
    ends = (value[0], value[-1]) if grid else value if isinstance(value, tuple) else (value,)
    text = " … ".join(coordinate_text(end, kind, 4) for end in ends)
    return f"{name} {text} in {len(value)}" if grid else f"{name} {text}"


# -- compensate --------------------------------------------------------------------------------------------------------


def compensate(
    path: Annotated[
        Path, typer.Argument(metavar="PATH.csv", help="Where the tool shall be, and its load; docs/compensation.md.")
    ],
    out: Annotated[Path, typer.Option("--out", metavar="FILE.csv", help="Where to write the commands.")],
    model: ModelOption = None,
    robot: RobotOption = None,
    effect: Effects = None,
    plots: Annotated[
        Path | None, typer.Option("--plots", metavar="DIR", help="Write path.png and path.svg there.")
    ] = None,
    workers: Workers = 1,
    set_parameters: SetParameters = None,
    *,
    reading: Reading,
) -> None:
    """Commands that put the loaded tool where it was wanted, along a path with its loads."""
    check_csv(out, path, "path")
    folder_for(plots, "--plots")
    corrected = model_typed(model) if model is not None else None
    name, loaded, effects = modelled(
        reading, corrected, robot, lambda: robot_beside(robot_named_beside(path), path), effect, set_parameters
    )
    read = path_of(loaded, path)
    with progress.stages() as tell:
        found = compensated(loaded, read, effects=effects, workers=workers, tell=tell)
    if all(word in found.failures and word != "not cancelled" for word in set(found.status)):
        refuse_unanswered(len(found), "a command", found.reasons)
    commands = replace(found.commands, robot=name)
    written = [out, out.with_suffix(".json")]
    write_commands(replace(found, commands=commands), out)
    if plots is not None:
        from ..views.drawing.sweep_figures import path_figure

        written += write_figures(plots, {"path": path_figure(found)}, "--plots")
    print_compensation(terminal.console(), loaded, effects, found)
    list_written(written)
