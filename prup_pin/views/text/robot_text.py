"""`prup-pin info`, `robots` and `kinds` as text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from rich.console import Console
from rich.text import Text

from ... import robots
from ...errors import MissingExtraError, PrupPinError
from ...mechanism.second_reader import second_opinion
from ...mechanism.tolerances import value_tolerances
from ...modules import KINDS, CompliantModule
from ...numbers import number
from ...parameters import Parameter, Quantity
from ...recordings import KINDS_OF_TOLERANCE, Tolerances
from ...robot import Robot
from .tables import default_parameters, mobility_text, module_parameters, redundancy_text
from .terminal import bullets, fits, heading, in_options, listed, make_table, paragraph, print_table
from .values import clean, joint_role, joint_type, limits, pose_text, value_text


def print_info(out: Console, robot: Robot, tolerances: Tolerances | None = None) -> None:
    """Print what a robot file says and what was made of it, with its own tolerances and those of all its kinds."""
    mechanism = robot.mechanism
    description = mechanism.description
    out.print(Text(robot.name, style="bold"))
    listed(out, "file", [str(description.path)])
    listed(out, "tool", [f"'{mechanism.tool.name}'" if mechanism.tool else "none: --tool FRAME says where forces act"])
    gravity = [number(clean(value), 6) for value in mechanism.gravity]
    source = "Pinocchio's own: the file gives none" if description.gravity is None else "the file's"
    listed(out, "gravity", [f"({' '.join(gravity)}) m/s^2, base axes; {source}"])
    if mechanism.tasks:
        order = " ".join(f"R{axis}" for axis in description.rotation)
        tasks = [f"{task.name} = {task.component} of the tool" for task in mechanism.tasks]
        turns = any(task.component in ("rx", "ry", "rz") for task in mechanism.tasks)
        listed(out, "task", tasks + ([f"rotation {order}"] if turns else []), "; ")
    _print_joints(out, robot)
    _print_loops(out, robot)
    _print_mobility(out, robot)
    own = value_tolerances(mechanism, tolerances.declared if tolerances else {})
    _print_modules(out, robot, own)
    _print_lengths(out, robot, own)
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
    heading(out, "Other readers")
    try:
        told = second_opinion(robot.mechanism)
    except MissingExtraError as error:
        told = (f"not asked: {error}",)
    for line in told or ("yourdfpy reads the same links and joints, at the same places",):
        paragraph(out, line, "- ")


def _print_joints(out: Console, robot: Robot) -> None:
    mechanism = robot.mechanism
    names = list(mechanism.model.names)[1:]
    heading(out, f"Joints: {len(names)}")
    table = make_table(("name", "left"), ("type", "left"), ("limits", "right"), ("", "left"), ("role", "left"))
    for name in names:
        kind, span = joint_type(mechanism, name), limits(mechanism, name)
        factor, unit = (1e3, "mm") if kind == "prismatic" else (180 / np.pi, "deg")
        ends = " to ".join(number(value * factor) for value in span) if span else "-"
        table.add_row(name, kind, ends, unit if span else "", joint_role(mechanism, name))
    print_table(out, table)


def _print_loops(out: Console, robot: Robot) -> None:
    loops = robot.mechanism.loops
    heading(out, f"Loops: {len(loops) or 'none'}")
    if not loops:
        return
    table = make_table(("name", "left"), ("frame 1", "left"), ("frame 2", "left"), ("free between them", "left"))
    for loop in loops:
        free = [axis for axis in ("x", "y", "z", "rx", "ry", "rz") if axis in loop.free]
        table.add_row(loop.name, loop.first.name, loop.second.name, " ".join(free) or "nothing")
    print_table(out, table)


def _print_mobility(out: Console, robot: Robot) -> None:
    heading(out, "Mobility at home")
    try:
        home = robot.home
        found = robot.mobility(home)
    except PrupPinError as error:
        paragraph(out, f"unknown: {in_options(str(error))}")
        return
    listed(out, "actuators", pose_text(robot, home.actuators))
    if home.coordinates:
        listed(out, "task", pose_text(robot, home.coordinates))
    listed(out, "freedom", [mobility_text(robot.mechanism, found)])
    if found.closures:
        listed(out, "redundant", [redundancy_text(found)])
    listed(out, "idle joints", found.idle_joints or ["none"], ", ")


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
    first, extra = (("parameter", "left"), ("value", "right"), ("unit", "left")), (("tolerance", "left"),)
    table = make_table(*first, *(extra if known else ()), ("source", "left"))
    for parameter in parameters:
        name = parameter.name if full else parameter.short
        off = [_tolerance_text(parameter, tolerances.get(parameter.name))] if known else []
        table.add_row(name, value_text(parameter.value), parameter.unit, *off, parameter.source)
    print_table(out, table, indent=4)


def _tolerance_text(parameter: Parameter, tolerance: float | None) -> str:
    """Return one standard deviation as a share of the value, or in its unit where it was declared so."""
    if tolerance is None:
        return ""
    declared = parameter.declared_tolerance
    if declared is not None and not declared.relative:
        return value_text(tolerance)
    return f"{number(100 * tolerance / abs(parameter.value), 3)} %"


def _print_lengths(out: Console, robot: Robot, tolerances: Mapping[str, float]) -> None:
    lengths = robot.mechanism.description.lengths
    if lengths:
        heading(out, "Lengths that place joints")
        _print_parameters(out, [length.parameter for length in lengths], tolerances, full=True)


def _print_tolerances(out: Console, tolerances: Tolerances) -> None:
    heading(out, "Tolerances", "(one standard deviation; the robot file's own win)")
    if not tolerances.declared:
        paragraph(out, "none: the drawing is taken at its word")
        return
    table = make_table(("kind", "left"), ("", "right"), ("unit", "left"), ("of", "left"))
    for kind in KINDS_OF_TOLERANCE:
        if kind.name in tolerances.declared:
            table.add_row(kind.name, number(tolerances.declared[kind.name]), kind.unit, kind.description)
    print_table(out, table)


def print_robots(out: Console) -> None:
    """Print the robots that can be loaded by name, and where they come from."""
    from ...mechanism.readers import read

    folder = robots.packaged_folder()
    packaged = {name: read(folder / f"{name}.urdf") for name in robots.packaged_names()}
    for yields, which in ((True, "with compliant modules"), (False, "without compliant modules")):
        group = {name: robot for name, robot in packaged.items() if bool(robot.modules) is yields}
        if group:
            heading(out, "Packaged", which)
            table = make_table(("name", "left"), ("file", "left"), ("variants", "left"))
            for name, robot in group.items():
                variants = ", ".join(f"{name}_{variant}" for variant in robot.variants)
                table.add_row(name, f"{name}.urdf", variants or "-")
            print_table(out, table)
    examples = robots.example_folder()
    heading(out, "From example-robot-data,", "which describes no compliance: add --joint-stiffness")
    if examples is None:
        paragraph(out, "not installed: pip install example-robot-data")
    # a column says which are here only where some are not
    files = robots.example_files()
    missing = examples is None or not all((examples / file).is_file() for file in files.values())
    here = [("here", "left")] if missing else []
    for named in (True, False):  # files are named where there is room for them
        table = make_table(("name", "left"), *([("file", "left")] if named else []), *here, ("tool", "left"))
        for name, file in files.items():
            present = examples is not None and (examples / file).is_file()
            known = "known" if name in robots.EXAMPLE_TOOLS else "--tool"
            cells = [file.rpartition("/")[2]] if named else []
            table.add_row(name, *cells, *(["yes" if present else "no"] if missing else []), known)
        if fits(out, table):
            break
    print_table(out, table)
    out.print()
    paragraph(out, "For example: prup-pin stiffness ur5 --joint-stiffness 1e4. Where --tool stands, it names one: ")
    paragraph(out, "prup-pin stiffness solo12 --tool FL_FOOT --joint-stiffness 1e4", "  ")
    paragraph(out, "A path to a URDF or MJCF file works wherever a name does.")


def print_kinds(out: Console, kinds: Sequence[CompliantModule] = KINDS) -> None:
    """Print kinds of modules with their parameters."""
    for index, kind in enumerate(kinds):
        if index:
            out.print()
        out.print(Text(kind.kind, style="bold"))
        traits = ["body" if kind.is_body else "joint", f"loads {' '.join(kind.loads)}"]
        if kind.spans_frames:
            traits.append("needs root and tip")
        if kind.nonlinear:
            traits.append("nonlinear")
        paragraph(out, f"{kind.summary[0].upper()}{kind.summary[1:]}.")
        listed(out, "", traits, "; ")
        table = make_table(("parameter", "left"), ("unit", "left"), ("default", "left"), ("description", "left"))
        for quantity in kind.quantities:
            table.add_row(quantity.name, quantity.unit, _default(quantity), quantity.description)
        print_table(out, table)


def _default(quantity: Quantity) -> str:
    if quantity.default is None:
        return "required"
    if callable(quantity.default):
        return f"from {', '.join(quantity.derived_from)}" if quantity.derived_from else "derived"
    return "not given" if np.isnan(quantity.default) else number(quantity.default)
