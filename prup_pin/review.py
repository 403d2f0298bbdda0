"""What a reviewer would say of a robot: remarks on its file, and on singular poses."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress

import numpy as np
import pinocchio as pin

from .errors import MissingExtraError, NoStiffnessError, PrupPinError, limits_heard
from .kinematics import Mobility
from .mechanism import Mechanism
from .mechanism.assumed import without_weight
from .mechanism.checks import at_other_ends
from .mechanism.second_reader import second_opinion
from .modules import WrenchModule
from .modules.joint_spring import JointSpring
from .numbers import counted, number, quantity, some
from .parameters import meant_otherwise
from .robot import Robot
from .spatial import Array
from .statics import Compliance

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
    yield from mechanism.description.doubts
    yield from without_weight(mechanism)
    try:
        home = robot.home
    except PrupPinError as error:
        yield str(error)  # and of home which positions are hardly in m and rad
        return
    yield from _home_in_degrees(mechanism)
    yield from _moved_home(robot)
    with suppress(MissingExtraError):  # a second reader is an opinion more, no condition
        yield from second_opinion(mechanism)
    if mechanism.tool is None:
        yield 'no tool is given, so that nothing can be loaded: load(..., tool="frame")'
    found = robot.mobility(home)
    yield from _drives_and_freedoms(mechanism, found)
    if mechanism.tool is not None:  # without, they are those of any link
        yield from _fixed_coordinates(robot)
    yield from _odd_modules(robot)
    if found.idle_joints:
        yield f"joints that turn idly, holding nothing: {', '.join(found.idle_joints)}"
    if found.redundant:
        yield f"overconstrained by {redundancy_text(found)}: loads depend on how exactly its parts are made"
    if mechanism.tool is None:
        return
    idle = [str(mechanism.model.names[joint]) for joint in sorted(mechanism.load_paths.idle)]
    if idle:
        yield f"joints that are not on the path from tool to base and carry nothing: {', '.join(some(idle))}"
    if not mechanism.modules:
        yield "no module is compliant: everything is rigid"
        return
    try:
        compliance = robot.compliance(home)
    except PrupPinError as error:
        yield f"stiffness at home: {error!s}"
        return
    yield from _stiffness(compliance)


def number_remarks(robot: Robot) -> Iterator[str]:
    """Yield what of these remarks makes a stiffness wrong, wherever the robot stands; nothing that takes long."""
    yield from robot.mechanism.description.doubts
    with suppress(PrupPinError):  # of a robot that cannot stand at its home
        yield from _moved_home(robot)
        yield from _drives_and_freedoms(robot.mechanism, robot.mobility(robot.home))
        yield from _odd_modules(robot)


def _moved_home(robot: Robot) -> Iterator[str]:
    """Yield where home is not where the file has it."""
    if told := robot.home_not_closed:
        yield told


def _home_in_degrees(mechanism: Mechanism) -> Iterator[str]:
    """Yield where home is hardly in m and rad."""
    given = mechanism.description.home.items()
    home = [(name, meant_otherwise(value, mechanism.joint(name).unit or "")) for name, value in given]
    if odd := [f"{name} = {told}" for name, told in home if told]:
        yield f"home has {'; '.join(some(odd))}"


def _drives_and_freedoms(mechanism: Mechanism, found: Mobility) -> Iterator[str]:
    """Yield where drives are more or less than the degrees of freedom."""
    driven = len(mechanism.actuated_dofs)
    moving = found.mobility - len(found.idle_joints)
    if mechanism.loops and moving != driven:
        yield (
            f"{counted(found.mobility, 'degree')} of freedom, {len(found.idle_joints)} of them idle, and "
            f"{counted(driven, 'actuated joint')}: expected as many actuated joints as degrees of freedom that move "
            "the tool" + (_SURPLUS if driven > moving else "")
        )


def _odd_modules(robot: Robot) -> Iterator[str]:
    """Yield modules whose numbers or places are hardly meant so."""
    yield from _odd_beams(robot)
    yield from _beams_with_more(robot)
    yield from _odd_axles(robot)
    yield from _springs_of_no_drive(robot)


def redundancy_text(found: Mobility) -> str:
    """Return '1 closure equation', with the loops it can be blamed on."""
    if not found.redundant:
        return "nothing: no loop is overconstrained"
    loops = f", in {', '.join(found.redundant_loops)}" if found.redundant_loops else ""
    return f"{found.redundant} closure equation{'s' if found.redundant != 1 else ''}{loops}"


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


def _beams_with_more(robot: Robot) -> Iterator[str]:
    """Yield beams that carry what acts elsewhere on their links, as if it were fixed to their ends."""
    for found in at_other_ends(robot.mechanism, robot.home.placements):
        module, far = found.module, found.length * (1 - found.along)
        joint = robot.mechanism.joint(module.joint).name
        if found.instead:
            links = f"with its root and its tip on '{found.link}'"
            instead = f"where it bears only what lies beyond that end, load it through joint '{found.instead}', {links}"
        else:
            instead = "no joint carries what lies beyond that end alone: a driven one that stands still there would"
        yield (
            f"beam '{module.name}' is loaded with all that joint '{joint}' carries, also with what {found.what} brings "
            f"to '{found.link}' {quantity(far, 'm')} before its end '{found.end.name}': as if that were fixed to this "
            f"end. Right if it is; {instead}"
        )


def _odd_axles(robot: Robot) -> Iterator[str]:
    """Yield bearings whose axle is not what their joint turns about."""
    mechanism = robot.mechanism
    for module in mechanism.modules:
        joint = mechanism.joint(module.joint)
        if not isinstance(module.kind, WrenchModule) or module.kind.is_body or not joint.turns:
            continue
        if (angle := mechanism.askew(module)) > _ASKEW:
            yield (
                f"bearing '{module.name}': its axle lies {number(np.degrees(angle), 3)} deg off the axis of joint "
                f"'{joint.name}', so that along and across are not those of that joint; its axis is given "
                f"in the axes of '{module.frame.name}', and is 0 0 1 where the file says nothing"
            )


def _springs_of_no_drive(robot: Robot) -> Iterator[str]:
    """Yield springs at passive joints where a drive is rigid although others of the robot yield."""
    mechanism = robot.mechanism
    yielding = {module.joint for module in mechanism.modules if mechanism.gives_way(module)}
    driven = {mechanism.joint_id(name): name for name in mechanism.actuated}
    rigid = [name for joint, name in driven.items() if joint not in yielding | mechanism.load_paths.idle]
    astray = [
        f"'{module.name}' at '{mechanism.joint(module.joint).name}'"
        for module in mechanism.modules
        if isinstance(module.kind, JointSpring) and module.joint not in driven
    ]
    if rigid and len(rigid) < len(driven) and astray:
        yield (
            f"springs at joints that are not actuated: {', '.join(some(astray))}, while other drives yield and "
            f"{', '.join(some(rigid))} {'is' if len(rigid) == 1 else 'are'} rigid: does a spring belong there?"
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


# -- singular poses ----------------------------------------------------------------------------------------------------


#: What counts as beside a pose: so far on [rad, robot's sizes], each joint by another step.
_BESIDE = 0.05


def yielding_beside(robot: Robot, compliance: Compliance) -> int | None:
    """Return in how many directions the tool yields a little beside a pose, or None where no such pose is found."""
    pose = compliance.pose
    with limits_heard():
        try:
            if pose.mechanism.loops:
                units = [pose.mechanism.joint(name).unit for name in pose.actuators]
                size = np.array([1.0 if unit == "rad" else robot.characteristic_length for unit in units])
                moved = np.array([*pose.actuators.values()]) + _BESIDE * _unequal(len(size)) * size
                beside = robot.pose_from_actuators(moved, near=pose)
            else:
                model = pose.mechanism.model
                beside = robot.pose_from_configuration(pin.integrate(model, pose.q, _BESIDE * _unequal(model.nv)))
            return 6 - len(robot.compliance(beside, compliance.load).rigid_directions)
        except PrupPinError:
            return None


def _unequal(count: int) -> Array:
    """Return numbers (count,) between 1 and 2 of which no two are alike."""
    return np.asarray(1.0 + (np.arange(1, count + 1) * 0.618034) % 1.0, float)
