"""`prup-pin check` as text: all that a reviewer would say of a robot file, and what a recording could show."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress

import numpy as np
from rich.console import Console
from rich.text import Text

from ...diagnosis.prospects import Prospects
from ...errors import MissingExtraError, NoStiffnessError, PrupPinError
from ...mechanism.second_reader import second_opinion
from ...modules import WrenchModule
from ...numbers import counted, number, quantity
from ...recordings import Recording
from ...robot import Robot
from ...statics import Compliance
from .diagnosis_words import hidden_rows
from .tables import mobility_text, redundancy_text, some
from .terminal import bullets, heading, in_options, listed, make_table, paragraph, print_table

#: Share of the largest module's load below which one carries nothing.
_NOTHING = 1e-9
#: How far a coordinate is moved to see whether it can be [m, rad].
_STEP = 1e-4
#: An axle that is more beside its joint's axis than this was not meant to be [rad].
_ASKEW = 0.01
#: What to do with drives that a robot has beyond its degrees of freedom.
_SURPLUS = (
    ". Positions of more never fit one another to the last digit: leave surplus drives out of <actuated>, give each "
    "a joint_spring, which holds it where the others put it"
)
#: No beam is softer [Pa].
_SOFT = 1e6


def robot_remarks(robot: Robot) -> Iterator[str]:
    """Yield what a reviewer would ask about a robot file that can be read."""
    mechanism = robot.mechanism
    try:
        home = robot.home
    except PrupPinError as error:
        yield in_options(str(error))
        return
    with suppress(MissingExtraError):  # a second reader is an opinion more, no condition
        yield from second_opinion(mechanism)
    found = robot.mobility(home)
    driven = len(mechanism.actuated_dofs)
    moving = found.mobility - len(found.idle_joints)
    if mechanism.loops and moving != driven:
        yield (
            f"{counted(found.mobility, 'degree')} of freedom, {len(found.idle_joints)} of them idle, and "
            f"{counted(driven, 'actuated joint')}: expected as many actuated joints as degrees of freedom that move "
            "the tool" + (_SURPLUS if driven > moving else "")
        )
    yield from _fixed_coordinates(robot)
    yield from _odd_beams(robot)
    yield from _odd_axles(robot)
    if found.idle_joints:
        yield f"joints that turn idly, holding nothing: {', '.join(found.idle_joints)}"
    if found.redundant:
        yield f"overconstrained by {redundancy_text(found)}: loads depend on how exactly its parts are made"
    if mechanism.tool is None:
        yield "no tool is given, so that nothing can be loaded: --tool FRAME"
        return
    yield from _tool_of_a_walker(robot)
    idle = [str(mechanism.model.names[joint]) for joint in sorted(mechanism.load_paths.idle)]
    if idle:
        yield f"joints beside the way from tool to base, which carry nothing: {', '.join(some(idle))}"
    if not mechanism.modules:
        yield "no module is compliant: everything is rigid"
        return
    try:
        compliance = robot.compliance(home)
    except PrupPinError as error:
        yield f"stiffness at home: {in_options(str(error))}"
        return
    yield from _stiffness(compliance)


def _fixed_coordinates(robot: Robot) -> Iterator[str]:
    """Yield the task coordinates along which the tool cannot leave home, the others kept."""
    home = robot.home.coordinates
    fixed = [name for name in (task.name for task in robot.mechanism.tasks) if not _moves(robot, home, name)]
    if fixed:
        yield f"task coordinates that cannot be changed alone, beginning at home: {', '.join(fixed)}"


def _moves(robot: Robot, home: Mapping[str, float], name: str) -> bool:
    for step in (_STEP, -_STEP):
        with suppress(PrupPinError):
            robot.pose(**{**home, name: home[name] + step})
            return True
    return False


def _odd_beams(robot: Robot) -> Iterator[str]:
    """Yield beams whose numbers are those of another unit."""
    for module in robot.mechanism.modules:
        if module.root is None:
            continue
        ends = [robot.home.placements[frame.joint] @ frame.placement for frame in (module.root, module.frame)]
        span = ends[1][:3, 3] - ends[0][:3, 3]
        length, diameter = float(np.linalg.norm(span)), float(module.values.get("diameter", np.nan))
        if diameter > length:
            yield (
                f"beam '{module.name}' is thicker ({quantity(diameter, 'm')}) than long ({quantity(length, 'm')}): is "
                "its diameter in metres?"
            )
        modulus = float(np.min(module.values.get("youngs_modulus", np.inf)))
        if modulus < _SOFT:
            yield f"beam '{module.name}': youngs_modulus {number(modulus)} Pa: is it in GPa? Steel has 2.1e11 Pa"


def _odd_axles(robot: Robot) -> Iterator[str]:
    """Yield bearings whose axle is not what their joint turns about."""
    mechanism = robot.mechanism
    for module in mechanism.modules:
        joint = mechanism.joint(module.joint)
        if not isinstance(module.kind, WrenchModule) or module.kind.is_body or not joint.turns:
            continue
        if (angle := mechanism.askew(module)) > _ASKEW:
            yield (
                f"bearing '{module.name}': its axle lies {number(np.degrees(angle), 3)} deg beside the axis of joint "
                f"'{joint.name}', so that along and across are not those of that joint; its axis is given "
                f"in the axes of '{module.frame.name}', and is 0 0 1 where the file says nothing"
            )


def _tool_of_a_walker(robot: Robot) -> Iterator[str]:
    mechanism = robot.mechanism
    branches = sum(int(parent) == 0 for parent in list(mechanism.model.parents)[1:])
    size = float(np.linalg.norm(mechanism.gravity))
    assert mechanism.tool is not None
    down = mechanism.gravity / size if size else np.array([0.0, 0.0, -1.0])
    below = float(down @ robot.home.placement(mechanism.tool.name)[:3, 3])
    if (mechanism.description.floats or branches > 1) and not mechanism.loops and below > 0:
        yield (
            f"the tool '{mechanism.tool.name}' lies {number(below, 3)} m below the base '{mechanism.bodies[0]}', "
            "which is taken as fixed: of a robot that walks, it is the foot that stands"
        )


def _stiffness(compliance: Compliance) -> Iterator[str]:
    sizes = {name: float(np.abs(jacobian).max()) for name, jacobian in compliance.wrench_jacobians.items()}
    largest = max(sizes.values())
    nothing = [name for name, size in sizes.items() if size <= _NOTHING * largest]
    if nothing:
        yield f"modules that carry nothing at home, whatever acts on the tool: {', '.join(nothing)}"
    rigid = [name for name, part in compliance.parts.items() if name not in nothing and not np.abs(part).max() > 0]
    if rigid:
        yield f"modules that carry load and do not yield: {', '.join(rigid)}"
    try:
        _ = compliance.K
    except NoStiffnessError as error:
        count = len(error.directions)
        yield f"K does not exist at home: nothing yields under {count} of 6 loads; C does (prup-pin stiffness)"


def print_check(out: Console, robot: Robot) -> None:
    """Print what the file holds, what a reviewer would ask, and what is assumed."""
    mechanism = robot.mechanism
    out.print(Text(robot.name, style="bold"))
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
        listed(out, "freedom", [mobility_text(mechanism, found)])
        if found.closures:
            listed(out, "redundant", [redundancy_text(found)])
    except PrupPinError:
        pass  # among the remarks
    print_remarks(out, list(robot_remarks(robot)), list(robot.assumptions))


def print_remarks(out: Console, remarks: list[str], assumed: list[str]) -> None:
    """Print remarks, or that there are none, and what is taken for granted."""
    heading(out, "To look at" if remarks else "Nothing to object")
    for text in remarks:
        paragraph(out, text, "- ")
    bullets(out, "Assumed", assumed)


# -- what a recording could show ---------------------------------------------------------------------------------------


def print_prospects(out: Console, robot: Robot, recording: Recording, found: Prospects) -> None:
    """Print how the joints move, what could not be told apart or seen, and remarks."""
    listed(out, "robot", [robot.name])
    listed(out, "recording", [counted(len(recording), "sample")])
    bullets(out, "Written otherwise than it says", found.conventions)
    if found.joints:
        heading(out, "Motion")
        names = (
            ("joint", "left"),
            ("travel", "right"),
            ("top speed", "right"),
            ("at rest", "right"),
            ("effort", "right"),
        )
        table = make_table(*names)
        for item in found.joints:
            slides = item.unit == "m"
            table.add_row(
                item.joint,
                f"{number(item.travel, 3)} {item.unit}",
                f"{number(item.speed, 3)} {item.unit}/s",
                f"{100 * item.rest:.0f} %",
                "not recorded" if item.effort is None else f"up to {number(item.effort, 3)} {'N' if slides else 'N m'}",
            )
        print_table(out, table)
    if found.alike:
        heading(out, "What this motion cannot tell apart")
        for text in _alike(found.alike):
            paragraph(out, text, "- ")
    if found.not_detectable:
        heading(out, "What these data could not show", "(and from which size they would)")
        for physics, where, needed in hidden_rows(found.not_detectable):
            paragraph(out, f"{physics}{f' ({where})' if where else ''}: {needed}", "- ")
    bullets(out, "Remarks", found.remarks)


def _alike(pairs: Sequence[tuple[str, str]]) -> list[str]:
    """Return what cannot be told apart, pairs of 'law at place': a sentence for each two laws, with their places."""
    groups: dict[tuple[str, str], list[tuple[str, str]]] = {}
    for pair in pairs:
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
