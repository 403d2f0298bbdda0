"""Tables and phrases about an answer, alike in text and in the report: here numbers get their units."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...kinematics import Mobility
from ...mechanism import Mechanism, Module
from ...numbers import finer_units, fixed, number, readable_unit
from ...parameters import Parameter
from ...robot import Robot
from ...spatial import TWIST_NAMES, WRENCH_NAMES, Array, wrench_text
from .answer import Answer, yielding_beside

#: A wrench's component below this, beside a largest one of 1, is none.
_NO_COMPONENT = 1e-4
#: What a robot's six motions are called: the load along each, the motion, whether it is a turn.
_AXES = tuple(zip(WRENCH_NAMES, TWIST_NAMES, 3 * [False] + 3 * [True], strict=True))
_TURNS = np.array([turn for *_, turn in _AXES])
#: Unit of a load along a translation and along a turn.
_LOADS = {False: "N", True: "N m"}
#: A share below this many percent is rounding.
_NO_PERCENT = 1e-10


@dataclass(frozen=True)
class MatrixTable:
    """A square matrix in words: `cells` by row; rows and columns carry units."""

    title: str
    detail: str
    rows: tuple[str, ...]
    columns: tuple[str, ...]
    cells: tuple[tuple[str, ...], ...]


def stiffness_table(answer: Answer) -> MatrixTable | None:
    """Return K in N/mm and N m/mrad, or finer where it is very stiff; None where it does not exist."""
    if answer.stiffness is None:
        return None
    return _stiffness("Stiffness K", f"at '{answer.tool}', base axes", answer.stiffness)


def task_table(answer: Answer) -> MatrixTable | None:
    """Return the stiffness in the task coordinates, likewise; None where there are none, six, or some are rigid."""
    if answer.task_stiffness is None:
        return None
    tasks = [(task.name, task.name, task.component not in "xyz") for task in answer.mechanism.tasks]
    where = f"at '{answer.tool}', in the task coordinates"
    return _stiffness("Stiffness K_task", where, answer.task_stiffness, tasks)


def yielding_table(answer: Answer) -> MatrixTable | None:
    """Return the stiffness in the directions that yield, likewise; None where none does."""
    if len(answer.compliance.rigid_directions) == 6:
        return None
    where = f"at '{answer.tool}', base axes"
    return _stiffness("Stiffness where it yields", where, answer.compliance.K_yielding)


def stiffness_tables(answer: Answer) -> tuple[MatrixTable, ...]:
    """Return all that is told of the stiffness: K, and K in the task coordinates; without either, where it yields."""
    found = [table for table in (stiffness_table(answer), task_table(answer)) if table is not None]
    return tuple(found or [table for table in [yielding_table(answer)] if table is not None])


def _stiffness(title: str, where: str, stiffness: Array, axes: Sequence[tuple[str, str, bool]] = _AXES) -> MatrixTable:
    """Return a stiffness; of each of its axes the load's name, the motion's, and whether that is a turn."""
    turns = np.array([turn for *_, turn in axes])
    units = {turn: _per(stiffness[np.ix_(turns == turn, turns == turn)], "rad" if turn else "m") for turn in (0, 1)}
    kinds = sorted(set(turns.tolist()))
    blocks = "; ".join(", ".join(f"{_LOADS[load]}/{units[turn][0]}" for turn in kinds) for load in kinds)
    return MatrixTable(
        title,
        f"{where} [{blocks}]",
        tuple(f"{load} {_LOADS[turn]}" for load, _, turn in axes),
        tuple(f"{motion}/{units[turn][0]}" for _, motion, turn in axes),
        _cells(stiffness / [units[turn][1] for turn in turns.tolist()], turns),
    )


def _per(block: Array, unit: str) -> tuple[str, float]:
    """Return the coarsest small unit of which one takes less than 10 000 N (N m) along the softest axis."""
    units = finer_units(unit)
    sizes = np.abs(np.diagonal(block))
    largest = sizes.max(initial=0.0)
    softest = float(sizes[sizes > 1e-9 * largest].min(initial=np.inf)) if largest > 0 else 0.0
    return next((step for step in units if softest / step[1] < 1e4), units[-1])


def compliance_table(answer: Answer) -> MatrixTable:
    """Return C in µm/N and µrad/(N m), or in the unit in which its largest entry needs no leading zeros."""
    compliance = answer.compliance.C
    (far, moves), (arc, turns) = (
        _of_compliances(np.diagonal(compliance)[block], unit)
        for block, unit in ((slice(0, 3), "m"), (slice(3, 6), "rad"))
    )
    return MatrixTable(
        "Compliance C",
        f"at '{answer.tool}', base axes [{far}/N, {far}/(N m); {arc}/N, {arc}/(N m)]",
        tuple(f"{name} {far if i < 3 else arc}" for i, name in enumerate(TWIST_NAMES)),
        tuple(f"{name}/{'N' if i < 3 else 'N m'}" for i, name in enumerate(WRENCH_NAMES)),
        _cells(compliance * np.repeat([moves, turns], 3)[:, None], _TURNS),
    )


def _of_compliances(sizes: Array, unit: str) -> tuple[str, float]:
    """Return the unit in which the least compliance needs no leading zeros, if the largest stays short there."""
    largest = float(sizes.max())
    if not largest > 0:
        return readable_unit(1e-6, unit)
    name, factor = readable_unit(float(sizes[sizes > 1e-9 * largest].min()), unit)
    return (name, factor) if largest * factor < 1e4 else readable_unit(largest, unit)


def _cells(matrix: Array, turns: NDArray[np.bool_]) -> tuple[tuple[str, ...], ...]:
    """Return a matrix as text, each block of equal units with its own number of decimals; rounding is zero."""
    size = np.sqrt(np.abs(np.diagonal(matrix)))
    matrix = np.where(np.abs(matrix * matrix.T) < 1e-18 * np.outer(size, size) ** 2, 0.0, matrix)
    cells = np.full(matrix.shape, "", object)
    for rows in (~turns, turns):
        for columns in (~turns, turns):
            block = np.ix_(rows, columns)
            cells[block] = np.reshape(np.array(fixed(matrix[block].ravel()), object), matrix[block].shape)
    return tuple(map(tuple, cells))


def rigid_texts(answer: Answer) -> list[str]:
    """Return each wrench that deflects nothing: 'a force along z (fz)', or 'fx 1 N, my 0.5 N m'."""
    turned = answer.compliance.pose.base_from_tool[:3, :3].T
    return [_wrench_words(direction, turned) for direction in answer.compliance.rigid_directions]


def _wrench_words(direction: Array, tool_axes: Array) -> str:
    """Return a wrench by the axis it goes along, of the base or of the tool (rows); else by its components."""
    parts = wrench_text(direction, 3, _NO_COMPONENT)
    for block, words in ((slice(0, 3), "a force along"), (slice(3, 6), "a moment about")):
        along = direction[block]
        if np.linalg.norm(direction) - np.linalg.norm(along) > _NO_COMPONENT:
            continue
        for axes, whose in ((np.eye(3), ""), (tool_axes, "the tool's ")):
            found = np.flatnonzero(np.linalg.norm(np.cross(axes, along), axis=1) < _NO_COMPONENT)
            if len(found):
                return f"{words} {whose}{'xyz'[found[0]]} ({parts if whose else parts[:2]})"
    return parts


def why_rigid(robot: Robot, answer: Answer) -> str:
    """Return why there is no K: because of this pose, or because of what yields in this robot at any pose."""
    here, beside = 6 - len(answer.compliance.rigid_directions), yielding_beside(robot, answer.compliance)
    count = len(answer.compliance.names)
    modules = "the one module that yields moves" if count == 1 else f"the {count} modules that yield move"
    if beside is not None and beside > here:
        there = "all directions" if beside == 6 else f"{beside} of 6 directions"
        return (
            f"Why: this pose is singular. Here {modules} the tool in {here} of 6 directions, beside it in {there}; "
            "take another pose. C below is complete."
        )
    likewise = ", and beside this pose no more" if beside is not None else ""
    return (
        f"Why: {modules} the tool in {here} of 6 directions{likewise}. Give a compliance to more parts if the others "
        "should yield. C below is complete."
    )


def load_text(answer: Answer) -> str:
    """Return 'under fx 300 N', or what is taken where no load is given."""
    if answer.load.given:
        return f"under {wrench_text(answer.load.wrench)}"
    block = slice(3, 6) if answer.load.turns else slice(0, 3)
    unit, motion = ("N m", "rotation") if answer.load.turns else ("N", "translation")
    return f"per {unit} along the softest {motion}, {direction_text(answer.load.wrench[block])}"


def displacement_units(*values: Array) -> tuple[tuple[str, float], tuple[str, float]]:
    """Return the units of translations and of rotations in which the largest of some displacements is readable."""
    moved = max(float(np.linalg.norm(value[:3])) for value in values)
    turned = max(float(np.abs(value[3:]).max()) for value in values)
    return readable_unit(moved, "m"), readable_unit(turned, "rad")


def displacement_columns(units: tuple[tuple[str, float], tuple[str, float]]) -> tuple[str, ...]:
    """Return the columns of `displacement_cells` with their units."""
    (far, _), (arc, _) = units
    return (*(f"{n} {far}" for n in TWIST_NAMES[:3]), f"total {far}", *(f"{n} {arc}" for n in TWIST_NAMES[3:]))


def displacement_cells(values: Array, units: tuple[tuple[str, float], tuple[str, float]]) -> list[str]:
    """Return dx dy dz, their length, rx ry rz in such units."""
    (_, moves), (_, turns) = units
    return _small([*values[:3], float(np.linalg.norm(values[:3]))], moves) + _small(values[3:], turns)


def _small(values: Iterable[float], factor: float) -> list[str]:
    """Return small displacements [m, rad], times a factor; what is smaller than an atom's nucleus is rounding."""
    return fixed([factor * value if abs(value) > 1e-15 else 0.0 for value in values])


def sag_cells(answer: Answer) -> tuple[list[str], str, str] | None:
    """Return dx dy dz and their length under the robot's weight, their unit, where down is; None without gravity."""
    gravity = answer.mechanism.gravity
    if not gravity.any():
        return None
    total = float(np.linalg.norm(answer.sag[:3]))
    unit, factor = readable_unit(total, "m")
    return _small([*answer.sag[:3], total], factor), unit, direction_text(gravity / np.linalg.norm(gravity))


def direction_text(direction: Array) -> str:
    """Return '(0.71 0 -0.71)'."""
    return f"({' '.join(number(round(value, 2) + 0.0, 2) for value in direction)})"


def percent_text(share: float | None, coarse: bool = False) -> str:
    """Return a share in percent, without the sign; `coarse`: with one decimal from one percent on."""
    if share is None:
        return "-"
    percent = 100 * share
    if abs(percent) < _NO_PERCENT:
        return "0"
    if 0 < percent < 0.005:
        return "<0.01"
    return f"{percent:.{1 if coarse and percent >= 1 else 2}f}"


def some(names: Sequence[str], most: int = 8) -> list[str]:
    """Return names, and how many more there are beyond the first of them."""
    return list(names) if len(names) <= most + 1 else [*names[:most], f"and {len(names) - most} more"]


def assumptions(robot: Robot, answer: Answer) -> list[str]:
    """Return what the answer takes for granted, never nothing."""
    notes = list(robot.assumptions)
    if answer.nonlinear:
        load = answer.compliance.load
        where = "at rest" if load is None else f"at {wrench_text(load)}"
        notes.append(f"modules that stiffen with load are linearised {where}: {', '.join(answer.nonlinear)}")
    return notes or ["nothing besides small deflections"]


def mobility_text(mechanism: Mechanism, found: Mobility) -> str:
    """Return '3 degrees of freedom = …'; a tree's are its joints'."""
    freedoms = f"{found.mobility} degree{'s' if found.mobility != 1 else ''} of freedom"
    if not found.closures:
        return f"{freedoms}, {len(mechanism.actuated_dofs)} actuated"
    return (
        f"{freedoms} = {found.velocities} joint velocities - rank {found.rank} of "
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
