"""`prup-pin info`, `check`, `robots`, `kinds` and `laws` as text."""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console

from ... import robots
from ...errors import MissingExtraError, PrupPinError, UnknownNameError
from ...laws import LAWS, Law, Place, brought_laws
from ...laws.efforts import EFFORT_LAWS, EffortLaw
from ...mechanism import Mechanism
from ...mechanism.description import COMPONENTS
from ...mechanism.second_reader import second_opinion
from ...mechanism.tolerances import value_tolerances
from ...modules import KINDS, CompliantModule
from ...numbers import counted, number
from ...parameters import Parameter, Quantity
from ...recordings import KINDS_OF_TOLERANCE, Recording, Tolerances
from ...review import robot_remarks
from ...robot import Robot
from .bench_tests import print_hidden
from .terminal import bullets, capital, fits, heading, in_options, listed, make_table, paragraph, show_table, title
from .values import (
    clean,
    coordinate_dimensions,
    default_parameters,
    joint_role,
    joint_type,
    limits,
    mobility_rows,
    module_parameters,
    pose_text,
    value_text,
)

if TYPE_CHECKING:
    from ...diagnosis.prospects import Prospects


def print_info(out: Console, robot: Robot, tolerances: Tolerances | None = None) -> None:
    """Print what a robot file says and what was made of it, with its own tolerances and those of all its kinds."""
    mechanism = robot.mechanism
    description = mechanism.description
    title(out, robot.name)
    listed(out, "file", [str(description.path)])
    listed(out, "tool", [f"'{mechanism.tool.name}'" if mechanism.tool else "none: --tool FRAME says where forces act"])
    gravity = [number(clean(value), 6) for value in mechanism.gravity]
    source = "Pinocchio's own: the file gives none" if description.gravity is None else "the file's"
    listed(out, "gravity", [f"({' '.join(gravity)}) m/s^2, base axes; {source}"])
    if mechanism.tasks:
        order = " ".join(f"R{axis}" for axis in description.rotation)
        tasks = [f"{task.name} = {task.component} of the tool" for task in mechanism.tasks]
        turns = "angle" in coordinate_dimensions(robot).values()
        listed(out, "task", tasks + ([f"rotation {order}"] if turns else []), "; ")
    _print_joints(out, robot)
    _print_loops(out, robot)
    _print_mobility(out, robot)
    own = value_tolerances(mechanism, tolerances.declared if tolerances else {})
    _print_modules(out, robot, own)
    if description.lengths:
        heading(out, "Lengths that place joints")
        _print_parameters(out, [length.parameter for length in description.lengths], own, full=True)
    if tolerances is not None:
        _print_tolerances(out, tolerances)
    if description.variants:
        heading(out, "Variants")
        for name, variant in description.variants.items():
            paragraph(out, ": ".join((name, "; ".join(variant.notes))) if variant.notes else name)
    bullets(out, "Assumed", robot.assumptions or ("nothing besides small deflections",))
    _print_other_readers(out, robot)


def _print_other_readers(out: Console, robot: Robot) -> None:
    """Print whether the tools around a robot, which read its file by themselves, see the same."""
    if robot.mechanism.description.source != "URDF":
        return
    try:
        told = second_opinion(robot.mechanism)
    except MissingExtraError as error:
        told = (f"not asked: {error}",)
    bullets(out, "Other readers", told or ("yourdfpy reads the same links and joints, at the same places",))


def _print_joints(out: Console, robot: Robot) -> None:
    mechanism = robot.mechanism
    names = list(mechanism.model.names)[1:]
    heading(out, f"Joints: {len(names)}")
    rows = []
    for name in names:
        kind, span = joint_type(mechanism, name), limits(mechanism, name)
        factor, unit = (1e3, "mm") if kind == "prismatic" else (180 / np.pi, "deg")
        ends = " to ".join(number(value * factor) for value in span) if span else "-"
        rows.append((name, kind, ends, unit if span else "", joint_role(mechanism, name)))
    show_table(out, ("name", "type", ">limits", "", "role"), rows)


def _print_loops(out: Console, robot: Robot) -> None:
    loops = robot.mechanism.loops
    heading(out, f"Loops: {len(loops) or 'none'}")
    if not loops:
        return
    free = [" ".join(axis for axis in COMPONENTS if axis in loop.free) or "nothing" for loop in loops]
    rows = [(loop.name, loop.first.name, loop.second.name, axes) for loop, axes in zip(loops, free, strict=True)]
    show_table(out, ("name", "frame 1", "frame 2", "free between them"), rows)


def _print_mobility(out: Console, robot: Robot) -> None:
    heading(out, "Mobility at home")
    try:
        home = robot.home
        found = robot.mobility(home)
    except PrupPinError as error:
        paragraph(out, f"unknown: {in_options(str(error))}")
        return
    if robot.home_not_closed:
        paragraph(out, in_options(capital(f"{robot.home_not_closed}.")))
    listed(out, "actuators", pose_text(robot, home.actuators))
    if home.coordinates:
        listed(out, "task", pose_text(robot, home.coordinates))
    for label, texts in mobility_rows(robot.mechanism, found):
        listed(out, label.lower(), texts, ", ")


def _print_modules(out: Console, robot: Robot, tolerances: Mapping[str, float]) -> None:
    modules = robot.mechanism.modules
    heading(out, f"Compliant modules: {len(modules) or 'none'}", "(equal ones are listed once)" if modules else "")
    alike: dict[tuple, list[str]] = {}
    for module in modules:
        own = module_parameters(robot, module)
        key = (module.kind.kind, tuple((p.short, str(p.value), p.source, tolerances.get(p.name)) for p in own))
        alike.setdefault(key, []).append(module.name)
    for names in alike.values():
        module = robot.mechanism.module(names[0])
        own = module_parameters(robot, module)
        out.print()
        listed(out, "", names, ", ")
        paragraph(out, f"{module.kind.kind}: {module.kind.summary}", "  ")
        given = [parameter for parameter in own if parameter.source != "default"]
        if given:
            _print_parameters(out, given, tolerances)
        defaults = [
            f"{p.short} {value_text(p.value)}{'' if p.unit == '1' or np.isinf(p.value) else f' {p.unit}'}"
            for p in default_parameters(own)
        ]
        if defaults:
            listed(out, "defaults", defaults, ", ", indent=4)


def _print_parameters(
    out: Console, parameters: Sequence[Parameter], tolerances: Mapping[str, float], full: bool = False
) -> None:
    known = any(parameter.name in tolerances for parameter in parameters)
    columns = ("parameter", ">value", "unit", *["tolerance"] * known, "source")
    rows = [
        (p.name if full else p.short, value_text(p.value), p.unit, *[_tolerance_text(p, tolerances)] * known, p.source)
        for p in parameters
    ]
    show_table(out, columns, rows, indent=4)


def _tolerance_text(parameter: Parameter, tolerances: Mapping[str, float]) -> str:
    """Return one standard deviation as a share of the value, or in its unit where it was declared so."""
    tolerance, declared = tolerances.get(parameter.name), parameter.declared_tolerance
    if tolerance is None:
        return ""
    if declared is not None and not declared.relative:
        return value_text(tolerance)
    return f"{number(100 * tolerance / abs(parameter.value), 3)} %"


def _print_tolerances(out: Console, tolerances: Tolerances) -> None:
    heading(out, "Tolerances", "(one standard deviation; the robot file's own win)")
    if not tolerances.declared:
        paragraph(out, "none: the drawing is taken at its word")
        return
    declared = [kind for kind in KINDS_OF_TOLERANCE if kind.name in tolerances.declared]
    rows = [(kind.name, number(tolerances.declared[kind.name]), kind.unit, kind.description) for kind in declared]
    show_table(out, ("kind", ">", "unit", "of"), rows)


def print_robots(out: Console) -> None:
    """Print the robots that can be loaded by name, and where they come from."""
    from ...mechanism.readers import read

    folder = robots.packaged_folder()
    packaged = {name: read(folder / f"{name}.urdf") for name in robots.packaged_names()}
    for yields, which in ((True, "with compliant modules"), (False, "without compliant modules")):
        group = {name: robot for name, robot in packaged.items() if bool(robot.modules) is yields}
        if group:
            heading(out, "Packaged", which)
            rows = [
                (name, f"{name}.urdf", ", ".join(f"{name}_{variant}" for variant in robot.variants) or "-")
                for name, robot in group.items()
            ]
            show_table(out, ("name", "file", "variants"), rows)
    for source in dict.fromkeys(found.source for found in robots.brought_robots()):
        heading(out, "Brought", f"by {source}")
        there = [found for found in robots.brought_robots() if found.source == source]
        show_table(out, ("name", "file"), [(found.name, found.thing.name) for found in there])
    examples = robots.example_folder()
    heading(out, "From example-robot-data,", "which describes no compliance: add --joint-stiffness")
    if examples is None:
        paragraph(out, "not installed: pip install example-robot-data")
    files = robots.example_files()
    present = [examples is not None and (examples / file).is_file() for file in files.values()]
    columns = {
        "name": list(files),
        "file": [file.rpartition("/")[2] for file in files.values()],
        "here": ["yes" if is_there else "no" for is_there in present],
        "tool": ["known" if name in robots.EXAMPLE_TOOLS else "--tool" for name in files],
    }
    if all(present):  # a column says which are here only where some are not
        del columns["here"]
    if not fits(out, make_table(list(columns), zip(*columns.values(), strict=True))):
        del columns["file"]  # files are named where there is room for them
    show_table(out, list(columns), zip(*columns.values(), strict=True))
    out.print()
    paragraph(out, "For example: prup-pin stiffness ur5 --joint-stiffness 1e4. Where --tool stands, it names one: ")
    paragraph(out, "prup-pin stiffness solo12 --tool FL_FOOT --joint-stiffness 1e4", "  ")
    paragraph(out, "A path to a URDF or MJCF file works wherever a name does.")


def print_kinds(out: Console, kinds: Sequence[CompliantModule]) -> None:
    """Print kinds of modules with their parameters."""
    brought = {found.name: found.source for found in KINDS.brought()}
    for index, kind in enumerate(kinds):
        if index:
            out.print()
        title(out, kind.kind)
        traits = ["body" if kind.is_body else "joint", f"loads {' '.join(kind.loads)}"]
        traits += ["needs root and tip"] * kind.spans_frames + ["nonlinear"] * kind.nonlinear
        paragraph(out, f"{kind.summary[0].upper()}{kind.summary[1:]}.")
        listed(out, "", traits, "; ")
        if kind.kind in brought:
            listed(out, "brought by", [str(brought[kind.kind])])
        rows = [(each.name, each.unit, _default(each), each.description) for each in kind.quantities]
        show_table(out, ("parameter", "unit", "default", "description"), rows)


def _default(quantity: Quantity) -> str:
    if quantity.default is None:
        return "required"
    if callable(quantity.default):
        return f"from {', '.join(quantity.derived_from)}" if quantity.derived_from else "derived"
    return "not given" if np.isnan(quantity.default) else number(quantity.default)


# -- what a reviewer would say of a file -------------------------------------------------------------------------------


def print_check(out: Console, robot: Robot) -> None:
    """Print what the file holds, what a reviewer would ask, and what is assumed."""
    mechanism = robot.mechanism
    title(out, robot.name)
    listed(out, "file", [str(mechanism.description.path)])
    listed(
        out,
        "holds",
        [
            f"{counted(len(mechanism.joints), 'joint')}, {len(mechanism.actuated)} actuated",
            counted(len(mechanism.loops), "loop"),
            counted(len(mechanism.modules), "compliant module"),
        ],
        ", ",
    )
    mass = sum(float(body.mass) for body in mechanism.model.inertias)
    listed(out, "mass", [f"{number(mass)} kg that move"])
    try:
        found = robot.mobility(robot.home)
        for label, texts in mobility_rows(mechanism, found)[:-1]:  # idle joints are among the remarks
            listed(out, label.lower(), texts)
    except PrupPinError:
        pass  # among the remarks
    remarks = list(robot_remarks(robot))
    if not remarks:
        heading(out, "Nothing to object")
    bullets(out, "To look at", map(in_options, remarks))
    bullets(out, "Assumed", [text for text in robot.assumptions if text not in remarks])


# -- what a recording could show ---------------------------------------------------------------------------------------


def print_prospects(out: Console, robot: Robot, recording: Recording, found: Prospects) -> None:
    """Print what comes first, remarks, how the joints move, and last the long list of what could not be seen."""
    listed(out, "robot", [robot.name])
    listed(out, "recording", [counted(len(recording), "sample")])
    bullets(out, "First of all", map(capital, found.premises))
    bullets(out, "Written otherwise than it says", found.conventions)
    bullets(out, "Remarks", map(capital, found.remarks))
    if found.joints:
        heading(out, "Motion")
        rows = []
        for item in found.joints:
            travel, speed = f"{number(item.travel, 3)} {item.unit}", f"{number(item.speed, 3)} {item.unit}/s"
            unit = robot.mechanism.joint(item.joint).effort_unit
            effort = "not recorded" if item.effort is None else f"up to {number(item.effort, 3)} {unit}"
            rows.append((item.joint, travel, speed, f"{100 * item.rest:.0f} %", effort))
        show_table(out, ("joint", ">travel", ">top speed", ">at rest", ">effort"), rows)
    bullets(out, "What this motion cannot tell apart", _alike(found.alike))
    print_hidden(out, found.not_detectable)


def _alike(pairs: Sequence[tuple[str, str]]) -> list[str]:
    """Return what cannot be told apart, pairs of 'law at place': a sentence for each two laws, with their places."""
    groups: dict[tuple[str, str], list[tuple[str, str]]] = {}
    for pair in pairs:
        if pair[0] == pair[1]:
            continue
        (one, _, here), (other, _, there) = (name.partition(" at ") for name in pair)
        groups.setdefault((one.replace("_", " "), other.replace("_", " ")), []).append((here, there))
    texts = []
    for (one, other), places in groups.items():
        if len(places) == 1:
            texts.append(f"{one} at {places[0][0]} and {other} at {places[0][1]}")
            continue
        where = ", ".join(here if here == there else f"{here} and {there}" for here, there in places)
        texts.append(f"{one} and {other}: at {where}" if one != other else f"{one}: at {where}")
    return texts


# -- laws --------------------------------------------------------------------------------------------------------------


_NEEDS = {
    "temperature": "the column temperature",
    "speed": "columns qd.<joint>",
    "gravity": "gravity",
    "wrench": "columns w.fx … w.mz",
}


def laws_named(word: str | None, mechanism: Mechanism) -> list[Law]:
    """Return the laws of a name; without one all; else those that verdicts or people speak of by that word.

    Raises UnknownNameError where none is.
    """
    every = (*LAWS, *EFFORT_LAWS)
    if word is None:
        return list(every)
    plain = "_".join(re.split(r"[\s_-]+", word.strip().lower()))
    physics = {law.physics for law in every if law.physics == plain}
    if not physics and word.strip():
        said = re.compile(rf"\b{re.escape(word.strip())}", re.IGNORECASE)
        physics = {law.physics for law in every if said.search(_spoken(law, mechanism))}
    if not physics:
        raise UnknownNameError("law", word, sorted({law.physics for law in every}))
    return [law for law in every if law.physics in physics]


def _spoken(law: Law, mechanism: Mechanism) -> str:
    """Return a law's name, what it is, what else it is called, and what a verdict says of it."""
    text = f"{law.physics.replace('_', ' ')}; {law.summary}; {law.called}"
    place = next(iter(law.places(mechanism)), None)
    return text if place is None else f"{text}; {law.statement(place, law.starts(place, mechanism)[0], mechanism)}"


def print_laws(out: Console, laws: Sequence[Law], robot: Robot) -> None:
    """Print laws with the places where they can act on a robot, their parameters and sources.

    Of several names, which are not all, what each is.
    """
    mechanism = robot.mechanism
    brought = {found.name: found.source for found in brought_laws()}
    names = dict.fromkeys(law.physics for law in laws)
    if 1 < len(names) < len({law.physics for law in (*LAWS, *EFFORT_LAWS)}):
        for name in names:
            alike = dict.fromkeys(law.summary for law in laws if law.physics == name)
            listed(out, "", [f"{name}: {next(iter(alike))}"])
        paragraph(out, "One of them whole: prup-pin laws NAME")
        return
    for index, law in enumerate(laws):
        if index:
            out.print()
        title(out, law.physics + (", in efforts" if isinstance(law, EffortLaw) else ""))
        for text in (inspect.getdoc(law) or law.summary).split("\n\n"):
            paragraph(out, " ".join(text.split()))
        if law.source:
            listed(out, "source", [law.source])
        if law.physics in brought:
            listed(out, "brought by", [str(brought[law.physics])])
        if law.needs:
            listed(out, "needs", [_NEEDS.get(name, name) for name in law.needs], ", ")
        places = list(law.places(mechanism))
        if any(deed.memory for place in places[:1] for deed in law.outline(place, mechanism)):
            listed(out, "memory", ["what happened before matters"])
        listed(out, "places", _grouped(places) or [f"none on '{robot.name}'"], ", ")
        for quantities, there in _parameters(law, places, mechanism):
            if len(places) > len(there):
                listed(out, "at", _grouped(there), ", ")
            starts = [number(float(x.default)) if isinstance(x.default, int | float) else "-" for x in quantities]
            rows = [(x.name, x.unit, _range(x), at, x.description) for x, at in zip(quantities, starts, strict=True)]
            show_table(out, ("parameter", "unit", "range", ">start", ""), rows)


def _grouped(places: Sequence[Place]) -> list[str]:
    """Return places as they are typed; 'leg1|leg2/R_phi:radial|axial' stands for four."""
    aspects: dict[str, list[str]] = {}
    for place in places:
        aspects.setdefault(place.name, []).append(place.aspect)
    legs: dict[tuple[str, str], list[str]] = {}
    for name, found in aspects.items():
        leg, slash, part = name.rpartition("/")
        aspect = f":{'|'.join(found)}" if any(found) else ""
        legs.setdefault((f"{slash}{part}", aspect), []).append(leg)
    return [f"{'|'.join(alike)}{part}{aspect}" for (part, aspect), alike in legs.items()]


def _parameters(
    law: Law, places: Sequence[Place], mechanism: Mechanism
) -> list[tuple[tuple[Quantity, ...], list[Place]]]:
    """Return sets of parameters, each with the places where they hold."""
    found: dict[tuple[Quantity, ...], list[Place]] = {}
    for place in places:
        found.setdefault(law.quantities_at(place, mechanism), []).append(place)
    return list(found.items()) or [(law.quantities, [])]


def _range(quantity: Quantity) -> str:
    low = f"{'>' if quantity.positive else '>='} {number(quantity.lower)}" if np.isfinite(quantity.lower) else ""
    high = f"<= {number(quantity.upper)}" if np.isfinite(quantity.upper) else ""
    return ", ".join(part for part in (low, high) if part) or "any"
