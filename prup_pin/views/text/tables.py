"""Tables and phrases about an answer, alike in text and in the report: here numbers get their units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...kinematics import Mobility
from ...mechanism import Mechanism, Module
from ...parameters import Parameter
from ...robot import Robot
from ...spatial import TWIST_NAMES, WRENCH_NAMES, Array
from .answer import Answer, wrench_text
from .quantities import fixed, number

__all__ = [
    "DISPLACEMENT_COLUMNS",
    "MatrixTable",
    "assumptions",
    "compliance_table",
    "default_parameters",
    "direction_text",
    "displacement_cells",
    "given_parameters",
    "load_text",
    "mobility_text",
    "module_parameters",
    "percent_text",
    "redundancy_text",
    "rigid_texts",
    "sag_cells",
    "stiffness_table",
    "yielding_table",
]

#: Columns of `displacement_cells`.
DISPLACEMENT_COLUMNS = (*(f"{n} µm" for n in TWIST_NAMES[:3]), "total µm", *(f"{n} µrad" for n in TWIST_NAMES[3:]))


@dataclass(frozen=True)
class MatrixTable:
    """A 6 x 6 matrix in words: `cells` by row; rows and columns carry units."""

    title: str
    detail: str
    rows: tuple[str, ...]
    columns: tuple[str, ...]
    cells: tuple[tuple[str, ...], ...]


def stiffness_table(answer: Answer) -> MatrixTable | None:
    """Return K in N/mm and N m/mrad, or None where it does not exist."""
    if answer.stiffness is None:
        return None
    return _stiffness("Stiffness K", answer, answer.stiffness)


def yielding_table(answer: Answer) -> MatrixTable:
    """Return the stiffness in the directions that yield, likewise."""
    return _stiffness("Stiffness where it yields", answer, answer.compliance.K_yielding)


def _stiffness(title: str, answer: Answer, stiffness: Array) -> MatrixTable:
    return MatrixTable(
        title,
        f"at '{answer.tool}', base axes [N/mm, N/mrad; N m/mm, N m/mrad]",
        tuple(f"{name} {'N' if i < 3 else 'N m'}" for i, name in enumerate(WRENCH_NAMES)),
        tuple(f"{name}/{'mm' if i < 3 else 'mrad'}" for i, name in enumerate(TWIST_NAMES)),
        _cells(stiffness * 1e-3),
    )


def compliance_table(answer: Answer) -> MatrixTable:
    """Return C in µm/N and µrad/(N m)."""
    return MatrixTable(
        "Compliance C",
        f"at '{answer.tool}', base axes [µm/N, µm/(N m); µrad/N, µrad/(N m)]",
        tuple(f"{name} {'µm' if i < 3 else 'µrad'}" for i, name in enumerate(TWIST_NAMES)),
        tuple(f"{name}/{'N' if i < 3 else 'N m'}" for i, name in enumerate(WRENCH_NAMES)),
        _cells(answer.compliance.C * 1e6),
    )


def _cells(matrix: Array) -> tuple[tuple[str, ...], ...]:
    """Return a symmetric 6 x 6 matrix as text, each block of equal units with its own number of decimals."""
    size = np.sqrt(np.abs(np.diagonal(matrix)))
    matrix = np.where(np.abs(matrix) < 1e-9 * size[:, None] * size, 0.0, matrix)
    cells = [[""] * 6 for _ in range(6)]
    for i in (0, 3):
        for j in (0, 3):
            for index, text in enumerate(fixed(matrix[i : i + 3, j : j + 3].ravel())):
                cells[i + index // 3][j + index % 3] = text
    return tuple(tuple(row) for row in cells)


def rigid_texts(answer: Answer) -> list[list[str]]:
    """Return each wrench that deflects nothing as ['1 fx', '0.5 my']."""
    return [
        [f"{number(value, 3)} {name}" for name, value in zip(WRENCH_NAMES, direction, strict=True) if abs(value) > 1e-6]
        for direction in answer.compliance.rigid_directions
    ]


def load_text(answer: Answer) -> str:
    """Return 'under fx 300 N', or what is taken where no load is given."""
    if answer.load.given:
        return f"under {wrench_text(answer.load.wrench)}"
    block = slice(3, 6) if answer.load.turns else slice(0, 3)
    unit, motion = ("N m", "rotation") if answer.load.turns else ("N", "translation")
    return f"per {unit} along the softest {motion}, {direction_text(answer.load.wrench[block])}"


def displacement_cells(values: Array) -> list[str]:
    """Return dx dy dz, their length, rx ry rz in µm and µrad."""
    moved = values[:3] * 1e6
    return fixed([*moved, float(np.linalg.norm(moved))]) + fixed(values[3:] * 1e6)


def sag_cells(answer: Answer) -> tuple[list[str], str] | None:
    """Return dx dy dz and their length in µm under the robot's weight, and where down is; None without gravity."""
    gravity = answer.mechanism.gravity
    if not gravity.any():
        return None
    cells = fixed([*(answer.sag[:3] * 1e6), float(np.linalg.norm(answer.sag[:3])) * 1e6])
    return cells, direction_text(gravity / np.linalg.norm(gravity))


def direction_text(direction: Array) -> str:
    """Return '(0.71 0 -0.71)'."""
    return f"({' '.join(number(round(value, 2) + 0.0, 2) for value in direction)})"


def percent_text(share: float | None) -> str:
    """Return a share in percent, without the sign."""
    if share is None:
        return "-"
    percent = 100 * share
    return "<0.01" if 0 < percent < 0.005 else f"{percent:.2f}"


def assumptions(robot: Robot, answer: Answer) -> list[str]:
    """Return what the answer takes for granted, never nothing."""
    notes = list(robot.assumptions)
    if answer.nonlinear:
        load = answer.compliance.load
        where = "at rest" if load is None else f"at {wrench_text(load)}"
        notes.append(f"modules that stiffen with load are linearised {where}: {', '.join(answer.nonlinear)}")
    return notes or ["nothing besides small deflections"]


def mobility_text(mechanism: Mechanism, found: Mobility) -> str:
    """Return '3 degrees of freedom = …'."""
    return (
        f"{found.mobility} degrees of freedom = {found.velocities} joint velocities - rank {found.rank} of "
        f"{found.closures} closures; {len(mechanism.actuated_dofs)} actuated"
    )


def redundancy_text(found: Mobility) -> str:
    """Return '1 closure equation', with the loops it can be blamed on."""
    loops = f", in {', '.join(found.redundant_loops)}" if found.redundant_loops else ""
    return f"{found.redundant} closure equation{'s' if found.redundant != 1 else ''}{loops}"


def module_parameters(robot: Robot, module: Module) -> list[Parameter]:
    """Return the parameters of a module in the order of its kind."""
    return [robot.parameters[f"{module.name}.{quantity.name}"] for quantity in module.kind.quantities]


def given_parameters(parameters: Sequence[Parameter]) -> list[Parameter]:
    """Return the parameters that somebody gave a value."""
    return [parameter for parameter in parameters if parameter.source not in ("default", "derived")]


def default_parameters(parameters: Sequence[Parameter]) -> list[Parameter]:
    """Return the parameters that nobody gave a value but that have one."""
    return [p for p in parameters if p.source == "default" and not np.isnan(np.asarray(p.value, float)).all()]
