"""`prup-pin stiffness` as text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rich.console import Console
from rich.text import Text

from ...robot import Robot
from ...spatial import TWIST_NAMES
from .answer import Answer, ranked
from .joints import clean, pose_text
from .quantities import fixed, number, value_text
from .tables import (
    DISPLACEMENT_COLUMNS,
    MatrixTable,
    assumptions,
    compliance_table,
    displacement_cells,
    load_text,
    percent_text,
    rigid_texts,
    sag_cells,
    stiffness_table,
    yielding_table,
)
from .terminal import heading, listed, make_table, paragraph, print_table

__all__ = ["print_answer"]

#: Width of a full bar.
_BAR = 20


def print_answer(
    out: Console,
    robot: Robot,
    answer: Answer,
    pose_source: str,
    changes: Mapping[str, float],
    notes: Sequence[str] = (),
) -> None:
    """Print pose, K, C, deflection, shares, sag and assumptions."""
    _print_pose(out, robot, answer, pose_source, changes)
    _print_stiffness(out, answer)
    _print_compliance(out, answer)
    _print_deflection(out, answer)
    _print_shares(out, answer)
    _print_sag(out, answer)
    _print_assumptions(out, robot, answer)
    for note in notes:
        paragraph(out, note, "- ")


def _print_pose(out: Console, robot: Robot, answer: Answer, pose_source: str, changes: Mapping[str, float]) -> None:
    pose = answer.compliance.pose
    given = {
        "home": "(the robot's home; another one with --at)",
        "task coordinates": "(as given)",
        "actuators": "(from the actuators)",
    }
    title = Text(robot.name, style="bold")
    out.print(title)
    for name, value in changes.items():
        listed(out, "changed", [f"{name} = {value_text(value)} {robot.parameters[name].unit}"])
    if robot.mechanism.locked:
        listed(out, "locked", sorted(robot.mechanism.locked), ", ")
    heading(out, "Pose", given[pose_source])
    if pose.coordinates:
        listed(out, "task", pose_text(robot, pose.coordinates))
    if pose.actuators:
        listed(out, "actuators", pose_text(robot, pose.actuators))
    at = pose.base_from_tool[:3, 3] * 1e3
    tool = answer.tool
    listed(
        out,
        "tool",
        [f"'{tool}' at {' '.join(f'{axis} {number(clean(v), 6)}' for axis, v in zip('xyz', at, strict=True))} mm"],
    )


def _print_stiffness(out: Console, answer: Answer) -> None:
    table = stiffness_table(answer)
    if table is None:
        directions = rigid_texts(answer)
        some = "this load" if len(directions) == 1 else f"these {len(directions)} loads"
        heading(out, "K does not exist:", f"the model is rigid, no module yields, under {some}:")
        for direction in directions:
            listed(out, "", direction, ", ")
        paragraph(out, "C below is complete; give a compliance to more parts if these should yield.")
        if len(directions) < 6:
            _print_matrix(out, yielding_table(answer))
        return
    _print_matrix(out, table)


def _print_compliance(out: Console, answer: Answer) -> None:
    _print_matrix(out, compliance_table(answer))


def _print_deflection(out: Console, answer: Answer) -> None:
    heading(out, "Deflection", load_text(answer) + ("" if answer.load.given else "; another load with --wrench"))
    table = make_table(("frame", "left"), *[(name, "right") for name in DISPLACEMENT_COLUMNS])
    rows = {answer.tool: answer.deflection}
    if answer.frame is not None and answer.frame_deflection is not None:
        rows[answer.frame] = answer.frame_deflection
    for name, values in rows.items():
        table.add_row(name, *displacement_cells(values))
    print_table(out, table)


def _print_shares(out: Console, answer: Answer) -> None:
    if answer.shares is None:
        heading(out, "Shares:", "this load deflects nothing, so no module has a share")
        return
    motion, unit = answer.motion[1], "µrad" if answer.load.turns else "µm"
    total = fixed([answer.amount * 1e6])[0]
    heading(
        out,
        "Shares of the modules:",
        f"% of the load's work; {unit} of the tool's {motion} ({total} {unit}), along it",
    )
    table = make_table(("module", "left"), ("", "left"), ("%", "right"), (unit, "right"))
    shares = answer.shares
    names = ranked(shares)
    largest = max(shares.values())
    amounts = fixed([answer.contributions[name] * 1e6 for name in names])
    for name, amount in zip(names, amounts, strict=True):
        share = shares[name]
        table.add_row(name, _bar(share / largest if largest > 0 else 0.0), percent_text(share), amount)
    print_table(out, table)
    compliance = answer.compliance
    if compliance.legs:
        legs = [f"{leg} {percent_text(answer.share_of(part))} %" for leg, part in compliance.legs.items()]
        listed(out, "by leg", legs)
    groups = {"bodies": compliance.bodies, "joints and drives": compliance.joints}
    listed(out, "by group", [f"{name} {percent_text(answer.share_of(part))} %" for name, part in groups.items()])


def _bar(fraction: float) -> Text:
    """Return a bar in eighths of a character."""
    eighths = round(max(0.0, min(1.0, fraction)) * _BAR * 8)
    full, rest = divmod(eighths, 8)
    return Text("█" * full + (" ▏▎▍▌▋▊▉"[rest] if rest else ""), style="cyan")


def _print_sag(out: Console, answer: Answer) -> None:
    out.print()
    found = sag_cells(answer)
    if found is None:
        out.print(Text("Sag: the robot file sets no gravity"))
        return
    (*moved, total), down = found
    text = Text("Sag by own weight [µm]: " + "  ".join(f"{n} {v}" for n, v in zip(TWIST_NAMES, moved, strict=False)))
    text.append(f"  total {total}; down is {down}")
    text.stylize("bold", 0, 22)
    out.print(text)


def _print_assumptions(out: Console, robot: Robot, answer: Answer) -> None:
    heading(out, "Assumed")
    for note in assumptions(robot, answer):
        paragraph(out, note, "- ")


def _print_matrix(out: Console, matrix: MatrixTable) -> None:
    """Print a 6 x 6 matrix in blocks of equal units."""
    heading(out, matrix.title, matrix.detail)
    columns = [(name, "right") for name in matrix.columns]
    table = make_table(("", "left"), *columns[:3], ("", "left"), *columns[3:])
    for index, (name, cells) in enumerate(zip(matrix.rows, matrix.cells, strict=True)):
        table.add_row(name, *cells[:3], "|", *cells[3:], end_section=index == 2)
    print_table(out, table)
