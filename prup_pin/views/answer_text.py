"""`prup-pin stiffness` as text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from rich.console import Console
from rich.text import Text

from ..robot import Robot
from ..spatial import TWIST_NAMES, WRENCH_NAMES, Array
from .answer import Answer, wrench_text
from .joints import clean, pose_text
from .quantities import fixed, number, value_text
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
    tool = answer.tool
    if answer.stiffness is None:
        directions = answer.compliance.rigid_directions
        some = "this load" if len(directions) == 1 else f"these {len(directions)} loads"
        heading(out, "K does not exist:", f"the model is rigid, no module yields, under {some}:")
        for direction in directions:
            listed(
                out,
                "",
                [
                    f"{number(value, 3)} {name}"
                    for name, value in zip(WRENCH_NAMES, direction, strict=True)
                    if abs(value) > 1e-6
                ],
                ", ",
            )
        paragraph(out, "C below is complete; give a compliance to more parts if these should yield.")
        return
    heading(out, "Stiffness K", f"at '{tool}', base axes [N/mm, N/mrad; N m/mm, N m/mrad]")
    _matrix(
        out,
        answer.stiffness * 1e-3,
        [f"{name} {'N' if i < 3 else 'N m'}" for i, name in enumerate(WRENCH_NAMES)],
        [f"{name}/{'mm' if i < 3 else 'mrad'}" for i, name in enumerate(TWIST_NAMES)],
    )


def _print_compliance(out: Console, answer: Answer) -> None:
    tool = answer.tool
    heading(out, "Compliance C", f"at '{tool}', base axes [µm/N, µm/(N m); µrad/N, µrad/(N m)]")
    _matrix(
        out,
        answer.compliance.C * 1e6,
        [f"{name} {'µm' if i < 3 else 'µrad'}" for i, name in enumerate(TWIST_NAMES)],
        [f"{name}/{'N' if i < 3 else 'N m'}" for i, name in enumerate(WRENCH_NAMES)],
    )


def _print_deflection(out: Console, answer: Answer) -> None:
    if answer.load.given:
        heading(out, "Deflection", f"under {wrench_text(answer.load.wrench)}")
    else:
        block = slice(3, 6) if answer.load.turns else slice(0, 3)
        unit, motion = ("N m", "rotation") if answer.load.turns else ("N", "translation")
        heading(
            out,
            "Deflection",
            f"per {unit} along the softest {motion}, {_direction_text(answer.load.wrench[block])}; "
            "another load with --wrench",
        )
    table = make_table(
        ("frame", "left"),
        *[(f"{name} µm", "right") for name in TWIST_NAMES[:3]],
        ("total µm", "right"),
        *[(f"{name} µrad", "right") for name in TWIST_NAMES[3:]],
    )
    rows = {answer.tool: answer.deflection}
    if answer.frame is not None and answer.frame_deflection is not None:
        rows[answer.frame] = answer.frame_deflection
    for name, values in rows.items():
        table.add_row(name, *_displacement(values))
    print_table(out, table)


def _displacement(values: Array) -> list[str]:
    """Return dx dy dz, their length, rx ry rz in µm and µrad."""
    moved = values[:3] * 1e6
    return fixed([*moved, float(np.linalg.norm(moved))]) + fixed(values[3:] * 1e6)


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
    names = sorted(shares, key=lambda name: -shares[name])
    largest = max(shares.values())
    amounts = fixed([answer.contributions[name] * 1e6 for name in names])
    for name, amount in zip(names, amounts, strict=True):
        share = shares[name]
        table.add_row(name, _bar(share / largest if largest > 0 else 0.0), _percent(share), amount)
    print_table(out, table)
    compliance = answer.compliance
    if compliance.legs:
        listed(out, "by leg", [f"{leg} {_percent(answer.share_of(part))} %" for leg, part in compliance.legs.items()])
    groups = {"bodies": compliance.bodies, "joints and drives": compliance.joints}
    listed(out, "by group", [f"{name} {_percent(answer.share_of(part))} %" for name, part in groups.items()])


def _percent(share: float | None) -> str:
    if share is None:
        return "-"
    percent = 100 * share
    return "<0.01" if 0 < percent < 0.005 else f"{percent:.2f}"


def _bar(fraction: float) -> Text:
    """Return a bar in eighths of a character."""
    eighths = round(max(0.0, min(1.0, fraction)) * _BAR * 8)
    full, rest = divmod(eighths, 8)
    return Text("█" * full + (" ▏▎▍▌▋▊▉"[rest] if rest else ""), style="cyan")


def _print_sag(out: Console, answer: Answer) -> None:
    gravity = answer.mechanism.gravity
    out.print()
    if not gravity.any():
        out.print(Text("Sag: the robot file sets no gravity"))
        return
    *moved, total = fixed([*(answer.sag[:3] * 1e6), float(np.linalg.norm(answer.sag[:3])) * 1e6])
    down = _direction_text(gravity / np.linalg.norm(gravity))
    text = Text("Sag by own weight [µm]: " + "  ".join(f"{n} {v}" for n, v in zip(TWIST_NAMES, moved, strict=False)))
    text.append(f"  total {total}; down is {down}")
    text.stylize("bold", 0, 22)
    out.print(text)


def _print_assumptions(out: Console, robot: Robot, answer: Answer) -> None:
    notes = list(robot.assumptions)
    if answer.nonlinear:
        load = answer.compliance.load
        where = "at rest" if load is None else f"at {wrench_text(load)}"
        notes.append(f"modules that stiffen with load are linearised {where}: {', '.join(answer.nonlinear)}")
    heading(out, "Assumed")
    for note in notes or ["nothing besides small deflections"]:
        paragraph(out, note, "- ")


def _matrix(out: Console, matrix: Array, rows: Sequence[str], columns: Sequence[str]) -> None:
    """Print a symmetric 6 x 6 matrix in blocks of equal units, each with its own number of decimals."""
    size = np.sqrt(np.abs(np.diagonal(matrix)))
    matrix = np.where(np.abs(matrix) < 1e-9 * size[:, None] * size, 0.0, matrix)
    cells = [[""] * 6 for _ in range(6)]
    for i in (0, 3):
        for j in (0, 3):
            texts = fixed(matrix[i : i + 3, j : j + 3].ravel())
            for index, text in enumerate(texts):
                cells[i + index // 3][j + index % 3] = text
    table = make_table(
        ("", "left"), *[(name, "right") for name in columns[:3]], ("", "left"), *[(n, "right") for n in columns[3:]]
    )
    for index, name in enumerate(rows):
        table.add_row(name, *cells[index][:3], "|", *cells[index][3:], end_section=index == 2)
    print_table(out, table)


def _direction_text(direction: Array) -> str:
    """Return '(0.71 0 -0.71)'."""
    return f"({' '.join(number(round(value, 2) + 0.0, 2) for value in direction)})"
