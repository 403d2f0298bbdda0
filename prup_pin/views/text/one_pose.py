"""`prup-pin stiffness` as text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from ...errors import NotConvergedError
from ...numbers import fixed, number, readable_unit, some
from ...review import number_remarks
from ...robot import Robot
from ...spatial import TWIST_NAMES, wrench_text
from . import answer as words
from .answer import Answer, MatrixTable, ranked
from .terminal import bullets, fits, heading, in_options, listed, make_table, paragraph, print_table, show_table, title
from .values import direction_text, percent_text, pose_text, position_text, value_text, workshop_text

#: Shares below 0.005 % are told in one line where there are more of them than so many.
_SMALL_ROWS = 3


def print_answer(
    out: Console,
    robot: Robot,
    answer: Answer,
    pose_source: str,
    changes: Mapping[str, float],
    notes: Sequence[str] = (),
) -> None:
    """Print pose, K, C, deflection, shares, sag and assumptions."""
    if doubts := [in_options(text) for text in number_remarks(robot)]:  # what is wrong there is in every number
        bullets(out, "To look at first", doubts)
        out.print()
    _print_pose(out, robot, answer, pose_source, changes)
    if answer.stiffness is None:
        directions = words.rigid_texts(answer)
        loads = "this load" if len(directions) == 1 else f"these {len(directions)} loads"
        heading(out, "K does not exist:", f"no module yields, the model is rigid, under {loads}:")
        for direction in directions:
            listed(out, "", [direction])
        paragraph(out, words.why_rigid(robot, answer))
    for table in (*words.stiffness_tables(answer), words.compliance_table(answer)):
        _print_matrix(out, table)
    _print_deflection(out, answer)
    for what, text in words.along_texts(answer).items():
        heading(out, f"{what}:", f"{text}; {words.ALONG}")
    _print_shares(out, answer)
    _print_sag(out, answer)
    bullets(out, "Assumed", words.assumptions(robot, answer))
    for note in notes:
        paragraph(out, note, "- ")


def _print_pose(out: Console, robot: Robot, answer: Answer, pose_source: str, changes: Mapping[str, float]) -> None:
    pose = answer.compliance.pose
    given = {
        "home": "(the robot's home; another one with --at)",
        "task coordinates": "(by --at; what it does not name is at home)",
        "actuators": "(from the actuators)",
    }
    title(out, robot.name)
    for name, value in changes.items():
        listed(out, "changed", [f"{name} = {value_text(value)} {robot.parameters[name].unit}"])
    if robot.mechanism.locked:
        listed(out, "locked", sorted(robot.mechanism.locked), ", ")
    heading(out, "Pose", given[pose_source])
    if pose.coordinates and robot.mechanism.tasks:
        listed(out, "task", pose_text(robot, pose.coordinates))
    if pose.actuators:
        beside = {str(robot.mechanism.model.names[joint]) for joint in robot.mechanism.load_paths.idle}
        on_the_way = {name: value for name, value in pose.actuators.items() if name not in beside}
        listed(out, "actuators", pose_text(robot, on_the_way))
        if len(on_the_way) < len(pose.actuators):
            count = len(pose.actuators) - len(on_the_way)
            listed(out, "", [f"{' ' * 12}{count} more that are not on the path from tool to base and carry nothing"])
    at = (f"{axis} {position_text(value)}" for axis, value in zip("xyz", pose.base_from_tool[:3, 3], strict=True))
    listed(out, "tool", [f"'{answer.tool}' at {' '.join(at)} mm"])


def _print_deflection(out: Console, answer: Answer) -> None:
    heading(out, "Deflection", words.load_text(answer) + ("" if answer.load.given else "; another load with --wrench"))
    columns, cells, _ = words.displacements(answer)
    table = make_table(["frame", *(f">{name}" for name in columns)], [(name, *own) for name, own in cells.items()])
    if fits(out, table):
        print_table(out, table)
    else:
        for name, own in cells.items():
            paragraph(out, name if name == words.DEFORMED else f"'{name}'")
            shown = [column.replace(" ", f" {cell} ", 1) for column, cell in zip(columns, own, strict=True)]
            listed(out, "moves", shown[:4])
            listed(out, "turns", shown[4:])
    if said := words.deformed_text(answer):
        paragraph(out, said)


def _print_shares(out: Console, answer: Answer) -> None:
    if answer.shares is None:
        heading(out, "Shares:", "this load deflects nothing, so no module has a share")
        return
    unit, factor = readable_unit(answer.amount, "rad" if answer.load.turns else "m")
    total = fixed([answer.amount * factor])[0]
    heading(
        out,
        "Shares of the modules:",
        f"% of the load's work; {unit} of the tool's {answer.motion[1]} ({total} {unit}), along it",
    )
    shares = answer.shares
    names = ranked(shares)
    joints = {module.name: module.joint for module in answer.mechanism.modules}
    small = [name for name in names if abs(shares[name]) < 5e-5]
    carried = [name for name in small if joints[name] not in answer.mechanism.load_paths.idle]
    names = [name for name in names if name not in small] if len(small) > _SMALL_ROWS else names
    largest = max(shares.values())
    amounts = fixed([answer.contributions[name] * factor for name in names])
    rows: list[tuple[str | Text, ...]] = [
        (name, _bar(shares[name] / largest if largest > 0 else 0.0), percent_text(shares[name]), amount)
        for name, amount in zip(names, amounts, strict=True)
    ]
    table = make_table(("module", "", ">%", f">{unit}"), rows)
    if out.width < 80 and not fits(out, table):
        table = make_table(("module", ">%", f">{unit}"), [(row[0], *row[2:]) for row in rows])
    print_table(out, table)
    if len(small) > _SMALL_ROWS and carried:
        listed(out, "below 0.01", some(carried, 20), ", ")
    for label, texts in words.group_rows(answer):
        listed(out, label.lower(), texts)


def _bar(fraction: float) -> Text:
    """Return a bar in eighths of a character, a full one of 20 characters."""
    eighths = round(max(0.0, min(1.0, fraction)) * 20 * 8)
    full, rest = divmod(eighths, 8)
    return Text("█" * full + (" ▏▎▍▌▋▊▉"[rest] if rest else ""), style="cyan")


def _print_sag(out: Console, answer: Answer) -> None:
    gravity = answer.mechanism.gravity
    if not gravity.any():
        heading(out, "Sag by own weight:", "the robot file sets no gravity")
        return
    down = f"down is {direction_text(gravity / np.linalg.norm(gravity))}"
    unit, factor = readable_unit(float(np.linalg.norm(answer.sag[:3])), "m")
    *moved, total = words.displacement_cells(answer.sag, ((unit, factor), ("rad", 1.0)))[:4]
    if total == "0":
        heading(out, "Sag by own weight:", f"none at the tool; {down}")
        return
    heading(out, f"Sag by own weight [{unit}]")
    listed(out, "", [*map(" ".join, zip(TWIST_NAMES, moved, strict=False)), f"total {total}", down])


def _print_matrix(out: Console, matrix: MatrixTable) -> None:
    """Print a matrix, 6 x 6 in blocks of equal units; where that is too wide, forces above moments."""
    heading(out, matrix.title, matrix.detail)
    six = len(matrix.rows) == 6
    whole = _matrix_table(matrix, *((slice(0, 3), slice(3, 6)) if six else (slice(None),)))
    if not six or fits(out, whole):
        print_table(out, whole)
    else:
        print_table(out, _matrix_table(matrix, slice(0, 3)))
        out.print()
        print_table(out, _matrix_table(matrix, slice(3, 6)))
    if matrix.note:
        paragraph(out, matrix.note)


def _matrix_table(matrix: MatrixTable, *blocks: slice) -> Table:
    """Return some columns of a matrix; blocks of equal units are set apart."""
    headers = [name for block in blocks for name in ("", *(f">{name}" for name in matrix.columns[block]))]
    rows = [
        (name, *[cell for block in blocks for cell in ("|", *cells[block])][1:])
        for name, cells in zip(matrix.rows, matrix.cells, strict=True)
    ]
    table = make_table(headers, rows)
    if len(blocks) > 1:
        table.rows[2].end_section = True
    return table


# -- 'stiffen this first': what a per cent of each value does to the deflection along the load -------------------------


#: Lines that are printed; JSON holds all.
_MOST = 12


def print_stiffen_first(out: Console, answer: Answer) -> None:
    """Print the values that change the deflection along the load the most. Raises InputError where there is none."""
    if isinstance(answer.sensitivity, NotConvergedError):
        heading(out, "Stiffen this first:", "not told, as no equilibrium was found under the load")
        return
    lines = answer.sensitivity.stiffen_first
    load = wrench_text(answer.load.wrench)
    what = f"% of the deflection along the load ({load}) per % of the value, {words.STIFFENED}"
    heading(out, "Stiffen this first:", what)
    shown = lines[:_MOST]
    columns = [
        [line.parameter.name for line in shown],
        [workshop_text(line.parameter.value, line.parameter.unit) for line in shown],
        fixed([line.percent for line in shown], 3),
        ["" if line.per_kilogram is None else number(line.per_kilogram, 3) for line in shown],
    ]
    wide = 4 if any(columns[3]) else 3  # what a kilogram brings, where any value brings mass
    names = ("parameter", ">value", ">% per %", ">% per kg")
    show_table(out, names[:wide], zip(*columns[:wide], strict=True))
    if len(lines) > _MOST:
        paragraph(out, f"{len(lines) - _MOST} more move it less; --json FILE writes all.")
