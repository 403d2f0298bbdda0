"""What a robot file says, before anything is computed: plain frozen records, each with its line.

Every reader (URDF, sidecar, MJCF) produces a `RobotDescription`; everything after that is the same for all.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ParameterError, Problem, close_names, nearest_names
from ..modules import KINDS, CompliantModule
from ..parameters import SMALLEST_TOLERANCE, Parameter, Quantity, Tolerance
from ..spatial import Array

#: Components of a pose: what a loop closure may leave free, in the axes of its first frame; what of the tool's pose
#: can serve as task coordinates.
COMPONENTS = ("x", "y", "z", "rx", "ry", "rz")
#: What a loop leaves free that is closed at a point, as by a ball joint.
POINT = frozenset({"rx", "ry", "rz"})
#: Orders of rotation: "xyz" is R_x R_y R_z (Eq. 50), "zyx" is R_z R_y R_x (URDF's rpy).
ROTATION_ORDERS = ("xyz", "zyx")

#: Nobody reads on; and each unknown name is compared with all others.
MAX_PROBLEMS = 100


def kinds_by_name() -> dict[str, CompliantModule]:
    """Return all kinds of modules, those that are brought along too, by the words of robot files."""
    return {kind.kind: kind for kind in KINDS}


def quantities_of(kind: str) -> dict[str, Quantity]:
    """Return the quantities of a kind of modules by name; none of a kind that nobody knows."""
    found = kinds_by_name().get(kind)
    return {} if found is None else {quantity.name: quantity for quantity in found.quantities}


def parameter_of(
    module: str, quantity: Quantity, value: Any, source: str, before: Parameter | None = None
) -> Parameter:
    """Return a module's parameter; unit and tolerance stay those that it had `before`."""
    unit, tolerance = (quantity.unit, None) if before is None else (before.unit, before.declared_tolerance)
    label = f"{module}.{quantity.name}"
    return Parameter(label, value, unit, source, quantity.description, quantity, tolerance)


@dataclass(frozen=True)
class FrameDescription:
    """A frame of the tree by name, with an optional offset in its own axes."""

    name: str
    offset: Array | None = None  # 4 x 4


@dataclass(frozen=True)
class LoopDescription:
    """Two frames that coincide but for the relative motions in `free`, in the axes of the first."""

    name: str
    first: FrameDescription
    second: FrameDescription
    free: frozenset[str] = frozenset()
    line: int | None = None


@dataclass(frozen=True)
class TaskDescription:
    """A task coordinate: a name for one component of the tool's pose."""

    name: str
    component: str
    line: int | None = None


@dataclass(frozen=True)
class ModuleDescription:
    """A compliant module: its kind, the joint whose load it carries, its frame, and its given values.

    `seated`: it stands where the joint does, but on the body before it, and does not turn with the joint. `unread`:
    values that were given and could not be read; `whole`: whether everything else that its element says was understood.
    """

    name: str
    kind: str
    joint: str
    frame: str | None = None
    root: str | None = None
    tip: str | None = None
    axis: tuple[float, ...] | None = None
    body: str | None = None
    anchor: str = "root"
    values: Mapping[str, Parameter] = field(default_factory=dict)
    line: int | None = None
    lines: Mapping[str, int | None] = field(default_factory=dict)  # of the values
    seated: bool = False
    unread: tuple[str, ...] = ()
    whole: bool = True


@dataclass(frozen=True)
class LengthDescription:
    """A length that places joints: origin = origin in the file + (value - reference) * direction."""

    parameter: Parameter
    reference: float
    moves: tuple[tuple[str, tuple[float, ...]], ...]
    line: int | None = None


@dataclass(frozen=True)
class VariantDescription:
    """Changes that make another model of the same robot: kinds of modules, values and tolerances of parameters, and
    notes on it alone."""

    name: str
    kinds: Mapping[str, str]
    values: Mapping[str, tuple[float, str]]
    line: int | None = None
    tolerances: Mapping[str, Tolerance] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class CouplingDescription:
    """A joint that follows another one (URDF's <mimic>, MJCF's <equality><joint>).

    `what` says so in words, as the beginning of a sentence. It stands at ratio times the position of `leader` plus
    `offset` [m or rad]; None: where it stands is not known.
    """

    joint: str
    what: str
    line: int | None = None
    leader: str | None = None
    ratio: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class RobotDescription:
    """All that a robot file says."""

    name: str
    path: Path
    source: str  # the format: "URDF" or "MJCF"
    content: bytes
    tool: str | None = None
    tool_part: str | None = None
    gravity: tuple[float, ...] | None = None  # None: that of Pinocchio's models, as everywhere the file says nothing
    actuated: tuple[str, ...] | None = None
    rotation: str = "xyz"
    tasks: tuple[TaskDescription, ...] = ()
    home: Mapping[str, float] = field(default_factory=dict)
    loops: tuple[LoopDescription, ...] = ()
    modules: tuple[ModuleDescription, ...] = ()
    lengths: tuple[LengthDescription, ...] = ()
    variants: Mapping[str, VariantDescription] = field(default_factory=dict)
    coupled: tuple[CouplingDescription, ...] = ()
    held: Mapping[str, float] = field(default_factory=dict)  # joints that stand still, and where [m, rad]
    notes: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()  # what can be read in one way only, and was hardly meant so
    package_folders: tuple[Path, ...] = ()  # where package:// may point besides the robot's own folder
    meshes_missing: tuple[str, ...] = ()
    described: bool = False  # True where the file says more than a tree
    lines: Mapping[str, int | None] = field(default_factory=dict)

    def with_variant(self, name: str) -> RobotDescription:
        """Return the description with the changes of a variant applied (names are already checked)."""
        variant = self.variants[name]
        modules = []
        for module in self.modules:
            values = dict(module.values)
            for key, (value, source) in variant.values.items():
                owner, _, short = key.rpartition(".")
                if owner == module.name:
                    quantity, before = quantities_of(module.kind)[short], values.get(short)
                    changed = replace(parameter_of(owner, quantity, value, source, before), unit=quantity.unit)
                    tolerance = variant.tolerances.get(key) or changed.declared_tolerance
                    values[short] = replace(changed, declared_tolerance=tolerance)
            modules.append(replace(module, kind=variant.kinds.get(module.name, module.kind), values=values))
        notes = (*self.notes, *variant.notes)
        return replace(self, name=f"{self.name}_{name}", modules=tuple(modules), notes=notes)


def check_references(
    robot: RobotDescription,
    joints: Collection[str],
    bodies: Collection[str],
    fixed_joints: Collection[str] = (),
    sites: Collection[str] = (),
) -> list[Problem]:
    """Return a problem for every name in the description that does not exist or is used twice.

    `joints` are the movable joints. A frame is a body, a joint or a site.
    """
    problems: list[Problem] = []
    frames = {*joints, *bodies, *fixed_joints, *sites}

    def need(kind: str, name: str | None, valid: Collection[str], line: int | None, where: str) -> None:
        if name is not None and name not in valid and len(problems) < MAX_PROBLEMS:
            problems.append(Problem(f"{where}: no {kind} named '{name}'. {nearest_names(name, sorted(valid))}", line))

    def unique(kind: str, named: Iterable[tuple[str, int | None]]) -> None:
        seen: dict[str, int | None] = {}
        for name, line in named:
            if name in seen:
                first = f" (first on line {seen[name]})" if seen[name] not in (None, line) else ""
                problems.append(Problem(f"two {kind}s are named '{name}'{first}; names must be unique", line))
            seen.setdefault(name, line)

    lines = robot.lines
    need("frame", robot.tool, frames, lines.get("tool"), "tool")
    for name in robot.actuated or ():
        need("movable joint", name, joints, lines.get("actuated"), "actuated")
    unique("actuated joint", ((name, lines.get("actuated")) for name in robot.actuated or ()))
    for name in robot.home:
        need("movable joint", name, joints, lines.get("home"), "home")
    unique("loop", ((loop.name, loop.line) for loop in robot.loops))
    for loop in robot.loops:
        for frame in (loop.first, loop.second):
            need("frame", frame.name, frames, loop.line, f"loop '{loop.name}'")
        if loop.first.name == loop.second.name:
            problems.append(Problem(f"loop '{loop.name}' joins '{loop.first.name}' to itself", loop.line))
    unique("task coordinate", ((task.name, task.line) for task in robot.tasks))
    unique("module", ((module.name, module.line) for module in robot.modules))
    for module in robot.modules:
        where = f"module '{module.name}'"
        if module.joint in fixed_joints:
            text = (
                f"{where}: joint '{module.joint}' is fixed, and no load is taken there. Name the movable joint that "
                "carries the module's load; where there is none, make this one movable and driven, without a spring"
            )
            problems.append(Problem(text, module.line))
        else:
            need("movable joint", module.joint, joints, module.line, where)
        for frame_name in (module.frame, module.root, module.tip):
            need("frame", frame_name, frames, module.line, where)
        need("link", module.body, bodies, module.line, where)
    for length in robot.lengths:
        for name, _ in length.moves:
            need("joint", name, {*joints, *fixed_joints}, length.line, f"length '{length.parameter.name}'")
    names = {module.name: module for module in robot.modules}
    for variant in robot.variants.values():
        where = f"variant '{variant.name}'"
        for name, kind in variant.kinds.items():
            need("module", name, names, variant.line, where)
            need("kind of module", kind, kinds_by_name(), variant.line, where)
        for key in variant.values:
            owner, _, short = key.rpartition(".")
            need("module", owner, names, variant.line, where)
            if owner in names and (quantities := quantities_of(names[owner].kind)):
                need(f"parameter of '{owner}'", short, quantities, variant.line, where)
    return problems


def check_modules(robot: RobotDescription, told: Sequence[Problem]) -> list[Problem]:
    """Return a problem for every module whose kind, frames or values do not fit together, in any variant.

    told: problems found before. Variants are looked at without any; of what is not understood of a module nothing
    follows.
    """
    problems = _check_kinds(replace(robot, modules=tuple(module for module in robot.modules if module.whole)))
    if not told and not problems:
        for variant in robot.variants.values():
            found = _check_kinds(robot.with_variant(variant.name))
            problems += [Problem(f"variant '{variant.name}': {problem.message}", variant.line) for problem in found]
    return problems


def _check_kinds(robot: RobotDescription) -> list[Problem]:
    problems: list[Problem] = []
    for module in robot.modules:
        where = f"module '{module.name}'"
        kind = kinds_by_name().get(module.kind)
        if kind is None:
            near = nearest_names(module.kind, list(kinds_by_name()))
            problems.append(Problem(f"{where}: no kind of module named '{module.kind}'. {near}", module.line))
            continue
        if kind.spans_frames and not (module.root and module.tip):
            problems.append(Problem(f'{where}: a {kind.kind} needs both frames, root="…" and tip="…"', module.line))
        try:
            resolve_values(module)
            told = [
                (name, f"{where}: parameter '{name}': {text}")
                for name, parameter in module.values.items()
                if (text := _wrong_tolerance(parameter))
            ]
        except ModuleValuesError as error:
            told = error.problems
        problems += [Problem(text, module.lines.get(name) or module.line) for name, text in told]
    return problems


def _wrong_tolerance(parameter: Parameter) -> str:
    """Return what is wrong with a declared tolerance for this value of a module, or ''."""
    tolerance, quantity, value = parameter.declared_tolerance, parameter.quantity, parameter.value
    if tolerance is None or quantity is None:
        return ""
    if quantity.shape:
        return f"tolerance {tolerance} of a table; only a single number has one"
    if value == quantity.lower and not quantity.positive:
        return f"tolerance {tolerance} of {value:g}, the end of its range ({quantity.expected()}): it has none"
    if tolerance.of(value) > abs(value):
        return f"tolerance {tolerance} {quantity.unit} is more than the value itself, {value:g}; expected less"
    if tolerance.of(value) < SMALLEST_TOLERANCE * abs(value):
        return f"tolerance {tolerance}: nothing is made so well; leave it out where nothing is off"
    return ""


def same_description(one: Any, other: Any) -> bool:
    """Return True where two descriptions, or two parts of them, say the same; arrays are compared by their entries."""
    if one is other:
        return True
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        return np.shape(one) == np.shape(other) and np.array_equal(one, other, equal_nan=True)
    if type(one) is not type(other):
        return False
    if is_dataclass(one):
        return all(same_description(getattr(one, item.name), getattr(other, item.name)) for item in fields(one))
    if isinstance(one, Mapping):
        return list(one) == list(other) and all(same_description(one[key], other[key]) for key in one)
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(same_description, one, other))
    return bool(one == other) or (isinstance(one, float) and one != one and other != other)


class ModuleValuesError(Exception):
    """All that is wrong with the values of one module: pairs of a parameter's name (or '') and what is wrong."""

    def __init__(self, problems: list[tuple[str, str]]):
        self.problems = problems
        super().__init__("; ".join(text for _, text in problems))


def _meant_instead(module: ModuleDescription) -> str:
    """Return 'Did you mean …' where a kind for the same loads needs nothing but the one value given; or ''.

    Compared are name and unit: people know that they have a spring, not what this format calls it.
    """
    kind = kinds_by_name()[module.kind]
    needed = {other.kind: [one for one in other.quantities if one.default is None] for other in KINDS}
    if len(module.values) != 1 or len(needed[kind.kind]) < 2:
        return ""
    ((name, given),) = module.values.items()
    alike = [other for other in KINDS if other.loads == kind.loads and len(needed[other.kind]) == 1]
    fits = [
        other
        for other in alike
        for quantity in needed[other.kind]
        if name == quantity.name or given.unit in quantity.unit.split(" or ")
    ]
    return " ".join(f"Did you mean '{other.kind}', {other.summary}?" for other in fits)


def resolve_values(module: ModuleDescription, kind: CompliantModule | None = None) -> dict[str, Any]:
    """Return the value of every quantity of the module's kind, derived defaults included.

    kind: by default that of the module's word. Raises ModuleValuesError with all unknown names, values out of range
    and missing quantities.
    """
    kind = kinds_by_name()[module.kind] if kind is None else kind
    problems: list[tuple[str, str]] = []
    failed = {*module.unread}
    known = {quantity.name for quantity in kind.quantities}
    for name in (*module.values, *module.unread):
        if name not in known:
            near = nearest_names(name, sorted(known))
            failed.update(close_names(name, sorted(known - module.values.keys()), 1))  # what it was meant to be
            problems.append((name, f"module '{module.name}': a {kind.kind} has no parameter '{name}'. {near}"))
    values: dict[str, Any] = {}
    lengths = set()
    for quantity in kind.quantities:
        try:
            if quantity.name in module.values:
                stated = module.values[quantity.name]
                value = quantity.check(stated.value, module.name, stated.unit)
                quantity.check_within({**values, quantity.name: value}, module.name)
            else:
                value = quantity.default(values) if callable(quantity.default) else quantity.default
            if value is None or (quantity.shape == () and callable(quantity.default) and np.isnan(value)):
                values[quantity.name] = np.nan
                reported = failed & {quantity.name, *quantity.derived_from}
                failed.add(quantity.name)
                if reported:
                    continue  # is one already reported, or follows from it
                sources = quantity.derived_from
                also = f", or what it follows from ({', '.join(sources)})" if sources else ""
                text = (
                    f"module '{module.name}': parameter '{quantity.name}' [{quantity.unit}] is missing; give it{also}"
                )
                problems.append(("", text))
                continue
            if callable(quantity.default) and quantity.shape == ():
                value = quantity.check(value, module.name)
            values[quantity.name] = value
            if quantity.shape == (-1,) and np.ndim(value) == 1:
                lengths.add(len(value))
        except ParameterError as error:
            values[quantity.name] = np.nan
            derived = () if quantity.name in module.values else quantity.derived_from
            given = {name: module.values[name].value for name in derived if name in module.values}
            if not failed & given.keys():  # what follows from the same values is told once
                from_these = ", ".join(f"{name} = {value}" for name, value in given.items())
                problems.append((quantity.name, f"{error}. It follows from {from_these}" if given else str(error)))
            failed |= {quantity.name, *given}
        except (TypeError, KeyError):
            values[quantity.name] = np.nan  # follows from a value already reported
    if problems and module.kind in kinds_by_name() and (meant := _meant_instead(module)):
        problems.insert(0, ("", f"module '{module.name}' is a {kind.kind}, {kind.summary}. {meant}"))
    if len(lengths) > 1:
        text = f"module '{module.name}': its tables have {sorted(lengths)} entries; all must have as many as 'stations'"
        problems.append(("", text))
    if problems:
        raise ModuleValuesError(problems)
    return values
