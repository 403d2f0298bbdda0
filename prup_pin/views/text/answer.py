"""A compliance and a load, ready to be shown: what text, JSON, pages and pictures have in common.

First the numbers, then tables and phrases of them, where they get their units.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, NoStiffnessError, NotConvergedError
from ...kernel import NEGLIGIBLE_ENERGY
from ...numbers import finer_units, fixed, number, percent, quantity, readable_unit
from ...review import yielding_beside
from ...robot import Robot
from ...spatial import TWIST_NAMES, WRENCH_NAMES, Array, as_wrench, motion_between, wrench_text
from ...statics import Compliance
from .values import direction_text, percent_text

if TYPE_CHECKING:
    from ...loaded import LoadedPose
    from ...sensitivity import Sensitivity, Stiffening

#: Units of translations and of rotations, each with how many of them one SI unit is.
Units = tuple[tuple[str, float], tuple[str, float]]
#: A wrench's component below this, beside a largest one of 1, is none.
_NO_COMPONENT = 1e-4
#: What a robot's six motions are called: the load along each, the motion, whether it is a turn.
_AXES = tuple(zip(WRENCH_NAMES, TWIST_NAMES, 3 * [False] + 3 * [True], strict=True))
_TURNS = np.array([turn for *_, turn in _AXES])
#: Unit of a load along a translation and along a turn.
_LOADS = {False: "N", True: "N m"}
#: Decimals of a share that are more than rounding.
_SHARE_DIGITS = 9
#: What of a displacement is rounding, as a share of it.
_ROUNDING = 1e-10
#: Digits that a table shows of each direction at least.
_LEAST_DIGITS = 3
#: Share of a deflection by which another one has to differ from it to be told beside it.
_NOTICED = 0.02


@dataclass(frozen=True)
class Load:
    """A wrench on the tool (6,) [N, N m], and whether the user gave it."""

    wrench: Array
    given: bool

    @property
    def turns(self) -> bool:
        """True where the load is a pure moment, so that rotations are what to look at."""
        return not self.wrench[:3].any()


def softest_load(compliance: Compliance) -> Load:
    """Return a unit force along the softest direction; a unit moment where no force moves the tool."""
    wrench = np.zeros(6)
    for block in (slice(0, 3), slice(3, 6)):
        values, vectors = np.linalg.eigh(compliance.C[block, block])
        if values[-1] > 0:
            direction = vectors[:, -1]
            # of equally soft directions the one nearest to a coordinate axis, so that the answer repeats
            alike = vectors[:, values > values[-1] * (1 - 1e-6)]
            if alike.shape[1] > 1:
                along = alike @ alike.T
                direction = along[:, int(np.argmax(np.round(np.diagonal(along), 6)))]
                direction = direction / np.linalg.norm(direction)
            direction = np.where(np.abs(direction) < 1e-9, 0.0, direction)
            wrench[block] = direction * np.sign(direction[int(np.argmax(np.abs(direction)))])
            return Load(wrench, given=False)
    return Load(wrench, given=False)


def ranked(shares: Mapping[str, float]) -> list[str]:
    """Return the names, the largest share first.

    Shares that differ by rounding alone (mirrored legs, parts that carry nothing) stay as the robot file has them.
    """
    return sorted(shares, key=lambda name: -round(shares[name], _SHARE_DIGITS))


def softest(shares: Mapping[str, float]) -> list[str]:
    """Return the names with the largest share: several where they differ by rounding alone."""
    first, *others = ranked(shares)
    least = round(shares[first], _SHARE_DIGITS)
    return [first, *(name for name in others if round(shares[name], _SHARE_DIGITS) == least)]


def _rounded(displacement: Array) -> Array:
    """Return a displacement (6,) without components of its translation or rotation that are only rounding of others."""
    sizes = np.abs(displacement).reshape(2, 3)
    return np.where((sizes < _ROUNDING * sizes.max(axis=1, keepdims=True)).ravel(), 0.0, displacement)


class Answer:
    """All numbers of one question, computed once. SI throughout. Of a `robot` it also knows the deformed position."""

    def __init__(self, compliance: Compliance, wrench=None, frame: str | None = None, robot: Robot | None = None):
        self.compliance = compliance
        self.robot = robot
        self.mechanism = compliance.pose.mechanism
        self.load = softest_load(compliance) if wrench is None else Load(as_wrench(wrench), given=True)
        self.frame = frame
        if frame is not None:
            self.mechanism.frame(frame)

    @property
    def tool(self) -> str:
        """Name of the tool frame."""
        assert self.mechanism.tool is not None  # without a tool there is no compliance
        return self.mechanism.tool.name

    @cached_property
    def stiffness(self) -> Array | None:
        """K, or None where some directions are rigid."""
        with suppress(NoStiffnessError):
            return self.compliance.K
        return None

    @cached_property
    def task_stiffness(self) -> Array | None:
        """K in the task coordinates of a robot with fewer than six; None where it has others or some are rigid."""
        with suppress(InputError, NoStiffnessError):
            return self.compliance.K_task if len(self.mechanism.tasks) < 6 else None
        return None

    @cached_property
    def translation_stiffness(self) -> tuple[list[int], Array] | None:
        """The base axes that yield to a force alone, and the inverse (n, n) of their block of C [N/m].

        None where no axis yields, or what is rigid among the forces lies across the axes.
        """
        c = self.compliance.C[:3, :3]
        axes = np.flatnonzero(np.diagonal(c) > NEGLIGIBLE_ENERGY * np.diagonal(c).max(initial=0.0))
        block = c[np.ix_(axes, axes)]
        if not len(axes) or np.linalg.cond(block) > 1 / NEGLIGIBLE_ENERGY:
            return None
        return axes.tolist(), np.asarray(np.linalg.inv(block), float)

    @cached_property
    def deflection(self) -> Array:
        """Deflection (6,) of the tool [m, rad]; what is only rounding is zero."""
        c, w = self.compliance.C, self.load.wrench
        bound = np.sqrt(np.abs(np.diagonal(c)) * abs(float(w @ c @ w)))  # Cauchy-Schwarz
        found = self.compliance.deflection(w)
        return np.where(np.abs(found) < _ROUNDING * bound, 0.0, found)

    @cached_property
    def frame_deflection(self) -> Array | None:
        """Deflection (6,) of the other frame asked for, rounding away, or None."""
        if self.frame is None:
            return None
        return _rounded(self.compliance.deflection(self.load.wrench, frame=self.frame))

    @cached_property
    def equilibrium(self) -> LoadedPose | NotConvergedError | None:
        """The robot in its deformed position under a load that was given, or why it finds no equilibrium; else None."""
        if self.robot is None or not self.load.given:
            return None
        try:
            return self.robot.equilibrium(self.compliance.pose, self.load.wrench)
        except NotConvergedError as error:
            return error

    @cached_property
    def deformed(self) -> dict[str, Array]:
        """Displacement (6,) of the tool, and of the other frame asked for, at the equilibrium; without one empty."""
        found, pose = self.equilibrium, self.compliance.pose
        if found is None or isinstance(found, NotConvergedError):
            return {}
        names = [self.tool, *([] if self.frame is None else [self.frame])]
        return {name: _rounded(motion_between(pose.placement(name), found.placement(name))) for name in names}

    @cached_property
    def bent(self) -> float:
        """How far the equilibrium is from the linear deflection, as a share of that; rotations count as arcs."""
        if not self.deformed:
            return 0.0
        arcs = np.repeat([1.0, self.compliance.characteristic_length], 3)
        linear, apart = (arcs * each for each in (self.deflection, self.deformed[self.tool] - self.deflection))
        size = float(np.linalg.norm(linear))
        return float(np.linalg.norm(apart)) / size if size > 0 else 0.0

    @cached_property
    def sensitivity(self) -> Sensitivity | NotConvergedError:
        """What each parameter does to the tool at the equilibrium, or why there is none."""
        assert self.robot is not None  # who asks for it has one
        try:
            return self.robot.sensitivity(self.compliance.pose, self.load.wrench)
        except NotConvergedError as error:
            return error

    @property
    def stiffen_first(self) -> tuple[Stiffening, ...]:
        """The lines of 'stiffen this first'; none where the load deflects nothing along itself, or cannot be borne."""
        if not self.amount > 0 or isinstance(self.sensitivity, NotConvergedError):
            return ()
        with suppress(InputError):
            return self.sensitivity.stiffen_first
        return ()

    @cached_property
    def sag(self) -> Array:
        """Deflection (6,) of the tool under the robot's weight [m, rad], rounding away."""
        return _rounded(self.compliance.sag())

    @cached_property
    def shares(self) -> dict[str, float] | None:
        """Share of each module in the work of the load, or None where the load deflects nothing."""
        with suppress(InputError):
            return self.compliance.shares(self.load.wrench)
        return None

    def share_of(self, part: Array) -> float | None:
        """Return the share of a (6, 6) part of C in the work of the load."""
        w = self.load.wrench
        total = float(w @ self.compliance.C @ w)
        return None if self.shares is None else float(w @ part @ w) / total

    @property
    def motion(self) -> tuple[slice, str]:
        """The part of a displacement that is shown per module: translation, or rotation under a pure moment."""
        return (slice(3, 6), "rotation") if self.load.turns else (slice(0, 3), "translation")

    @cached_property
    def amount(self) -> float:
        """Length of the tool's translation [m], or rotation [rad] under a pure moment."""
        return float(np.linalg.norm(self.deflection[self.motion[0]]))

    @cached_property
    def stiffness_along(self) -> dict[str, float | None]:
        """Stiffness along the load's force [N/m] and about its moment's axis [N m/rad], by "force" and "moment".

        |F| / the displacement along F, under F alone, all other directions free. A load of force and moment has one of
        each, None where that part alone moves nothing along itself.
        """
        found: dict[str, float | None] = {}
        for name, block in (("force", slice(0, 3)), ("moment", slice(3, 6))):
            part = self.load.wrench[block]
            if part.any():
                c, along = self.compliance.C[block, block], part / np.linalg.norm(part)
                yielded = float(along @ c @ along)
                found[name] = 1 / yielded if yielded > _ROUNDING * np.abs(c).max() else None
        return found

    @cached_property
    def contributions(self) -> dict[str, float]:
        """Each module's part of `amount`, along the direction in which the tool moves; they sum to it."""
        block, _ = self.motion
        along = self.deflection[block] / self.amount if self.amount else np.zeros(3)
        w = self.load.wrench
        parts = {name: float(along @ (self.compliance.parts[name] @ w)[block]) for name in self.compliance.names}
        return {name: part if abs(part) > _ROUNDING * self.amount else 0.0 for name, part in parts.items()}

    @cached_property
    def nonlinear(self) -> tuple[str, ...]:
        """Names of modules whose compliance depends on the load."""
        return tuple(module.name for module in self.mechanism.modules if module.kind.nonlinear)


# -- tables and phrases ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class MatrixTable:
    """A square matrix in words: `cells` by row; rows and columns carry units. note: how its diagonal is meant."""

    title: str
    detail: str
    rows: tuple[str, ...]
    columns: tuple[str, ...]
    cells: tuple[tuple[str, ...], ...]
    note: str = ""

    @property
    def headers(self) -> tuple[str, ...]:
        """Headers of all columns, '>' before those of numbers."""
        return ("", *(f">{name}" for name in self.columns))

    @property
    def lines(self) -> list[tuple[str, ...]]:
        """Rows with their names."""
        return [(name, *cells) for name, cells in zip(self.rows, self.cells, strict=True)]


#: What the stiffness along a load is.
ALONG = "load over the displacement in its own direction, all other directions free"
#: What K's diagonal is; most people take it for the stiffness along a load.
_DIAGONAL = (
    "The diagonal of K is the stiffness in each direction while the other five are held; along a load they are free, "
    "and it is no larger."
)
#: Which stiffness is for what, where there are several.
_TASK = "The one for loads in the task coordinates alone, with the tool free to give way in all other directions."
_FORCES = "The one for forces alone, with the tool free to turn; where moments act as well, take K_yielding."
#: What K_yielding depends on, where what is rigid mixes forces with moments.
_AS_ARCS = (
    "What is rigid mixes a force with a moment: K_yielding counts rotations as arcs of {} mm, the robot's "
    "characteristic length, and would be another with another length."
)


def stiffness_table(answer: Answer) -> MatrixTable | None:
    """Return K in N/mm and N m/mrad, or finer where it is very stiff; None where it does not exist."""
    if answer.stiffness is None:
        return None
    return _stiffness("Stiffness K", f"at '{answer.tool}', base axes", answer.stiffness, _DIAGONAL)


def stiffness_tables(answer: Answer) -> tuple[MatrixTable, ...]:
    """Return all that is told of the stiffness: K, and K in the task coordinates; without either, what yields."""
    at, k = f"at '{answer.tool}'", stiffness_table(answer)
    found = [] if k is None else [k]
    if answer.task_stiffness is not None:
        tasks = [(task.name, task.name, task.component not in "xyz") for task in answer.mechanism.tasks]
        where = f"{at}, in the task coordinates"
        found.append(_stiffness("Stiffness K_task", where, answer.task_stiffness, _TASK, tasks))
    if found:
        return tuple(found)
    if answer.translation_stiffness is not None:
        directions, block = answer.translation_stiffness
        forces, where = [_AXES[i] for i in directions], f"inv(C_tt), {at}, under forces alone, base axes"
        found.append(_stiffness("Translational stiffness", where, block, _FORCES, forces))
    rigid = answer.compliance.rigid_directions
    if len(rigid) < 6:
        parts = [np.linalg.matrix_rank(rigid[:, block], tol=_NO_COMPONENT) for block in (slice(0, 3), slice(3, 6))]
        arcs = sum(parts) > len(rigid)  # not where forces and moments are rigid each for itself
        note = _AS_ARCS.format(number(answer.compliance.characteristic_length * 1e3, 4)) if arcs else ""
        where = f"{at}, K where it yields, base axes"
        found.append(_stiffness("K_yielding", where, answer.compliance.K_yielding, note))
    return tuple(found)


def _stiffness(
    title: str, where: str, stiffness: Array, note: str, axes: Sequence[tuple[str, str, bool]] = _AXES
) -> MatrixTable:
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
        note,
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
    """Return a matrix as text, each block of equal units with its own number of decimals; rounding is zero.

    A row that is small beside the others of its block, as of a stiff direction, has as many as show three digits of it.
    """
    size = np.sqrt(np.abs(np.diagonal(matrix)))
    matrix = np.where(np.abs(matrix * matrix.T) < 1e-18 * np.outer(size, size) ** 2, 0.0, matrix)
    cells = np.full(matrix.shape, "", object)
    for rows in (~turns, turns):
        for columns in (~turns, turns):
            block = np.ix_(rows, columns)
            values = matrix[block]
            texts = np.reshape(np.array(fixed(values.ravel()), object), values.shape)
            decimals = max((len(text.partition(".")[2]) for text in texts.ravel()), default=0)
            reach = np.abs(values).max(axis=1, initial=0.0)
            own = np.abs(np.diagonal(values)) if (rows == columns).all() else reach
            for row in np.flatnonzero(own > 1e-9 * reach.max(initial=0.0)):
                wanted, whole = (int(np.floor(np.log10(each))) for each in (own[row], reach[row]))
                if _LEAST_DIGITS - 1 - wanted > decimals:
                    texts[row] = fixed(values[row], _LEAST_DIGITS + whole - wanted)
            cells[block] = texts
    return tuple(map(tuple, cells))


def rigid_texts(answer: Answer) -> list[str]:
    """Return each wrench that deflects nothing: 'a force along z (fz)', or 'fx 1 N, my 0.5 N m'."""
    tool_axes = answer.compliance.pose.base_from_tool[:3, :3].T
    return [_wrench_words(direction, tool_axes) for direction in answer.compliance.rigid_directions]


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
    likewise = ", and near this pose in no more" if beside is not None else ""
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


def along_texts(answer: Answer) -> dict[str, str]:
    """Return the stiffness along the load by what it is called, that of a force beside a moment; {} without a load."""
    found = {}
    for name, value in answer.stiffness_along.items():
        alone = {"force": "along the force alone", "moment": "about the moment's axis alone"}[name]
        which = alone if len(answer.stiffness_along) > 1 else "along the load"
        unit = "N/m" if name == "force" else "N m/rad"
        found[f"Stiffness {which}"] = "rigid" if value is None else quantity(value, unit, 4)
    return found


#: What the row of the tool's equilibrium is called.
DEFORMED = "deformed"
#: Which question 'stiffen this first' answers.
STIFFENED = "at the equilibrium in the deformed position, the actuators held"


def deformed_text(answer: Answer) -> str:
    """Return what the deformed position says of a load that was given, where that differs from the deflection."""
    found = answer.equilibrium
    if isinstance(found, NotConvergedError):
        return (
            "In the deformed position no equilibrium was found: raised from zero, this load could be followed to "
            f"{percent(found.reached)} of itself. Expect the robot to give way; what is told here is linear about the "
            "unloaded pose."
        )
    if not answer.bent > _NOTICED:
        return ""
    return (
        f"'{DEFORMED}' is where the tool finds its equilibrium in the deformed position, the actuators held: "
        f"{percent(answer.bent, 2)} off the linear deflection. All else here is linear about the unloaded pose."
    )


def displacements(answer: Answer) -> tuple[tuple[str, ...], dict[str, list[str]], Units]:
    """Return the table of the tool's displacement and that of the other frame asked for: columns, rows, their units."""
    rows = {answer.tool: answer.deflection}
    if answer.frame is not None and answer.frame_deflection is not None:
        rows[answer.frame] = answer.frame_deflection
    if answer.bent > _NOTICED:
        rows[DEFORMED] = answer.deformed[answer.tool]
    moved = max(float(np.linalg.norm(value[:3])) for value in rows.values())
    turned = max(float(np.abs(value[3:]).max()) for value in rows.values())
    (far, _), (arc, _) = units = readable_unit(moved, "m"), readable_unit(turned, "rad")
    columns = (*(f"{n} {far}" for n in TWIST_NAMES[:3]), f"total {far}", *(f"{n} {arc}" for n in TWIST_NAMES[3:]))
    return columns, {name: displacement_cells(values, units) for name, values in rows.items()}, units


def displacement_cells(values: Array, units: Units) -> list[str]:
    """Return dx dy dz, their length, rx ry rz in such units."""
    (_, moves), (_, turns) = units
    rows = ([*values[:3], float(np.linalg.norm(values[:3]))], moves), (values[3:], turns)
    # what is smaller than an atom's nucleus is rounding
    return [text for each, factor in rows for text in fixed(factor * value * (abs(value) > 1e-15) for value in each)]


def assumptions(robot: Robot, answer: Answer) -> list[str]:
    """Return what the answer takes for granted, never nothing."""
    notes = list(robot.assumptions)
    if answer.nonlinear:
        load = answer.compliance.load
        where = "at rest" if load is None else f"at {wrench_text(load)}"
        notes.append(f"modules that stiffen with load are linearised {where}: {', '.join(answer.nonlinear)}")
    return notes or ["nothing besides small deflections"]


def group_rows(answer: Answer) -> list[tuple[str, list[str]]]:
    """Return the shares of legs, and those of bodies beside those of joints, by label; none of a rigid robot."""
    compliance = answer.compliance
    if answer.shares is None:
        return []
    kinds = {"bodies": compliance.bodies, "joints and drives": compliance.joints}
    rows = [("By leg", compliance.legs), ("By group", kinds)]
    return [
        (label, [f"{name} {percent_text(answer.share_of(part))} %" for name, part in parts.items()])
        for label, parts in rows
        if parts
    ]


def first_shares(shares: Mapping[str, float], most: int) -> list[tuple[str, float]]:
    """Return the largest shares, at most so many, and that of all others together; one more is named."""
    names = ranked(shares)
    shown = names[:most] if len(names) > most + 1 else names
    rows, rest = [(name, shares[name]) for name in shown], names[len(shown) :]
    return [*rows, (f"{len(rest)} others", sum(shares[name] for name in rest))] if rest else rows
