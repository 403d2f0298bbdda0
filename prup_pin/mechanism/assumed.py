"""What is taken for granted where a robot file says nothing: gravity, masses, a home, meshes, a base that stands."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..modules import WrenchModule
from ..modules.joint_spring import JointSpring
from ..numbers import number
from .mechanism import Mechanism

#: Names that a sentence lists.
_LISTED = 6


def assumed(mechanism: Mechanism) -> Iterator[str]:
    """Yield sentences on what the file leaves open and is taken for granted."""
    description, model = mechanism.description, mechanism.model
    floating = [joint.name for joint in mechanism.joints if joint.nv == 6]
    if floating:
        yield f"the base is taken as fixed: the floating joint {', '.join(floating)} stands still"
    if not mechanism.joints:
        return
    if mechanism.coupling:
        yield f"joints that follow others, and load them: {_listed(mechanism.coupling.names)}"
    if mechanism.loose and description.source == "URDF":
        yield (
            "coupled joints (<mimic>) whose leader does not move by one freedom carry no load and move on their own "
            f"here: {_listed(item.joint for item in mechanism.loose)}"
        )
    # an end that its loop holds in every direction is a piece of the body at the other end
    pieces = {end.joint for loop in mechanism.loops if not loop.free for end in (loop.first, loop.second)}
    light = [mechanism.bodies[joint.id] for joint in mechanism.joints if not model.inertias[joint.id].mass > 0]
    named = [name for name in light if name not in {mechanism.bodies[piece] for piece in pieces}]
    if description.gravity is None and len(light) < len(mechanism.joints):
        pull = " ".join(number(value, 6) for value in mechanism.gravity)
        yield f"no gravity is given: it is that of Pinocchio's models, ({pull}) m/s^2 in base axes"
    yield from without_weight(mechanism)
    if named and len(light) < len(mechanism.joints):
        yield f"without mass: {_listed(named)}"
    yielding = {module.joint for module in mechanism.modules if mechanism.gives_way(module)}
    stiff = [
        name for name in mechanism.actuated if mechanism.joint_id(name) not in yielding | mechanism.load_paths.idle
    ]
    if mechanism.modules and stiff:
        yield f"drives that are rigid, as no module yields along them: {_listed(stiff)}"
    if mechanism.modules:
        yield from _taken_as_rigid(mechanism)
    if not description.home:
        yield "no home is given: home is every joint at 0, or at its nearest limit"
    if description.meshes_missing:
        yield f"meshes that are not there, and not drawn: {_listed(description.meshes_missing)}"


def _taken_as_rigid(mechanism: Mechanism) -> Iterator[str]:
    """Yield what a robot that is more than springs at its joints leaves out: bearings of hinges, shear of beams."""
    modules = mechanism.modules
    if all(isinstance(module.kind, JointSpring) for module in modules):
        return  # which is told as a whole
    held = {module.joint for module in modules if isinstance(module.kind, WrenchModule) and not module.kind.is_body}
    bare = [
        joint.name for joint in mechanism.joints if joint.turns and joint.id not in held | mechanism.load_paths.idle
    ]
    if bare:
        yield f"hinges that are rigid but for their own turning, as no bearing is given: {_listed(bare)}"
    # with a coefficient of shear that is zero
    stiff = [module.name for module in modules if not np.any(module.values.get("shear_coefficient", 1.0))]
    if stiff and not any("shear" in note for note in mechanism.description.notes):  # the file says it itself
        yield f"beams that bend without shear, as no shear coefficient is given: {_listed(stiff)}"


def without_weight(mechanism: Mechanism) -> Iterator[str]:
    """Yield a sentence where neither what moves nor a module has a mass."""
    light = not any(mechanism.model.inertias[joint.id].mass > 0 for joint in mechanism.joints)
    if mechanism.joints and light and not {module.body for module in mechanism.modules} - {None}:
        yield "no masses are given: sag, weight and vibration are those of a robot without weight"


def masses_in_doubt(mechanism: Mechanism) -> Iterator[str]:
    """Yield a sentence where what moves has no mass, or one that nobody measured: the same number all over."""
    inertias = {mechanism.bodies[joint.id]: mechanism.model.inertias[joint.id] for joint in mechanism.joints}
    light = [name for name, inertia in inertias.items() if not inertia.mass > 0]
    if len(light) == len(inertias):
        yield "the robot file gives no masses: all that bodies take is found as other inertial parameters"
    elif light:
        yield f"the robot file gives no mass to {_listed(light)}: what they take is found as other inertial parameters"
    alike = {(inertia.mass, *inertia.inertia.diagonal()) for inertia in inertias.values() if inertia.mass > 0}
    if len(alike) == 1 and len(inertias) - len(light) > 2:  # two may be so by chance
        yield "all links have the same mass and inertia in the robot file: these are hardly the robot's own"


def _listed(names) -> str:
    names = list(dict.fromkeys(names))
    return ", ".join(names[:_LISTED]) + (f" and {len(names) - _LISTED} more" if len(names) > _LISTED else "")
