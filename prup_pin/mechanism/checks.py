"""What is wrong with a robot file once its tree stands: beams beside their loads, joints driven twice, other units."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from ..errors import Problem
from .frames import Frame

if TYPE_CHECKING:
    from .mechanism import Mechanism, Module

#: Of a joint, to see what it moves [m or rad].
_SMALL_MOTION = 1e-4


def driven_twice(mechanism: Mechanism) -> Iterator[Problem]:
    """Yield joints that are said to be driven, and to follow others."""
    line = mechanism.description.lines.get("actuated")
    for name in mechanism.description.actuated or ():
        if name in mechanism.coupling.names:
            leader = mechanism.coupling.leader_of(name)
            text = f"actuated: joint '{name}' follows '{leader}'; leave it out, its leader drives it"
            yield Problem(text, line)


def loose_and_loaded(mechanism: Mechanism) -> Iterator[Problem]:
    """Yield joints that follow no one knows how, where they carry load."""
    for coupling in mechanism.loose:
        below = mechanism.support[mechanism.joint_id(coupling.joint)]
        if mechanism.tool is not None and below[mechanism.tool.joint]:
            where = f"between the base and the tool '{mechanism.tool.name}'"
        elif any(below[loop.first.joint] != below[loop.second.joint] for loop in mechanism.loops):
            where = "in a loop"
        else:
            continue
        text = (
            f"{coupling.what} {where}, and carries load there. Expected one joint of one freedom that follows "
            "another movable one, in no circle, by <mimic>"
        )
        yield Problem(text, coupling.line)


def misstated_units(mechanism: Mechanism) -> Iterator[Problem]:
    """Yield values in a unit that their joint does not have: N/m where it turns, N m/rad where it slides."""
    described = {module.name: module for module in mechanism.description.modules}
    for module in mechanism.modules:
        joint, given = mechanism.joint(module.joint), described[module.name]
        for quantity in module.kind.quantities:
            value = given.values.get(quantity.name)
            unit = joint.unit_among(quantity.unit)
            if value is None or unit is None or value.unit in (unit, quantity.unit):
                continue
            text = (
                f"module '{module.name}': parameter '{quantity.name}' is in {value.unit}, but joint '{joint.name}' "
                f'{"slides" if joint.slides else "turns"}; expected unit="{unit}", and the value in it'
            )
            yield Problem(text, given.lines.get(quantity.name, given.line))


# -- beams -------------------------------------------------------------------------------------------------------------


def misplaced_beams(mechanism: Mechanism) -> Iterator[Problem]:
    """Yield beams that carry another load than their joint's, or are bent by a passive joint."""
    if mechanism.tool is None:
        return
    for module, given in zip(mechanism.modules, mechanism.description.modules, strict=True):
        if module.root is not None and (wrong := _misplaced(mechanism, module, module.root)):
            what = f"module '{module.name}': a beam from '{module.root.name}' to '{module.frame.name}'"
            yield Problem(f"{what} {wrong}; correct joint, root or tip", given.line)


def _misplaced(mechanism: Mechanism, module: Module, root: Frame) -> str:
    """Return why a beam is not where its joint's load passes, or ''."""
    paths, names, tip = mechanism.load_paths, list(mechanism.model.names), module.frame
    if not paths.carries(module.joint, root.joint, tip.joint):
        ends = [
            f"its {end}, on '{mechanism.bodies[frame.joint]}', is not"
            for end, frame in (("root", root), ("tip", tip))
            if not paths.reached(module.joint, frame.joint)
        ]
        fit = [name for at, name in enumerate(names) if at and paths.carries(at, root.joint, tip.joint)]
        hint = f"It carries the load of {', '.join(fit[:6])}" if fit else "It carries no joint's whole load"
        return f"does not lie where the load of joint '{names[module.joint]}' passes: {' and '.join(ends)}. {hint}"
    passive = {int(mechanism.dof_joint[dof]) for dof in mechanism.free_dofs} - {module.joint}
    for joint in paths.between(module.joint, root.joint, tip.joint):
        if joint in passive and _bends(mechanism, joint, root, tip):
            how = "the passive joint '{}', which bends it"
        elif joint not in passive and not mechanism.joint(joint).slides and _bends(mechanism, joint, root, tip, True):
            how = "joint '{}', which turns one end away"
        else:
            continue
        return f"spans {how.format(names[joint])}: {_before(mechanism, joint, root, tip)}"
    return ""


def _before(mechanism: Mechanism, joint: int, *ends: Frame) -> str:
    """Return what to do about a beam that reaches over a joint."""
    text = "a beam ends where a joint turns"
    for end in ends:
        if end.joint == joint and np.linalg.norm(end.placement[:3, 3]) < 1e-9:
            body = mechanism.bodies[int(mechanism.model.parents[joint])]
            return f"{text}, and '{end.name}' turns with it: fix a link to '{body}' at that place, and name that"
    return text


def _bends(mechanism: Mechanism, joint: int, root: Frame, tip: Frame, across: bool = False) -> bool:
    """Return True where a joint's motion takes a beam's root off its axis, or, if not asked `across` alone, changes its
    length: that of a rod which a drive pushes out does.
    """
    home, spans = mechanism.home_configuration(), []
    for step in (0.0, _SMALL_MOTION):
        velocity = np.zeros(mechanism.model.nv)
        velocity[mechanism.joint(joint).dofs] = step
        placed = mechanism.placements(pin.integrate(mechanism.model, home, velocity))
        ends = [frame.at(placed) for frame in (root, tip)]
        spans.append(ends[1][:3, :3].T @ (ends[0][:3, 3] - ends[1][:3, 3]))
    length = max(float(np.linalg.norm(spans[0])), 1e-9)
    moved = spans[1] - spans[0]
    if across:
        moved = np.cross(spans[0] / length, moved)
    return float(np.linalg.norm(moved)) > 1e-3 * _SMALL_MOTION * length
