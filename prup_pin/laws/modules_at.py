"""What laws share about a robot's modules: where they can act, and what modules are there."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial

import numpy as np
import pinocchio as pin

from ..mechanism import Joint, Mechanism, Module
from ..modules import DriveModule
from ..modules.transmission import travel_per_motor_turn
from ..spatial import Array
from .deeds import Along, ChangedValue, Deed, ExtraStrain, Strain
from .drawn import drive_turns
from .law import ASPECTS, Place
from .setup import Setup

#: Poisson's ratio of steel: its shear modulus is E / 2 (1 + nu).
_POISSON = 0.3

#: The quantities that are stiffnesses, by the motion they belong to.
_STIFFNESSES = {
    "radial": ("radial_stiffness", "reference_stiffness"),
    "axial": ("axial_stiffness",),
    "tilting": ("tilting_stiffness",),
    "rotational": ("rotational_stiffness",),
}
_WHOLE = ("stiffness", "torsional_stiffness", "youngs_modulus")


def stiffness_of(module: Module, aspect: str) -> str | None:
    """Return the name of the finite stiffness of a module's motion, or None."""
    for name in _STIFFNESSES[aspect] if aspect else _WHOLE:
        value = module.values.get(name)
        if value is not None and np.ndim(value) == 0 and np.isfinite(value) and value > 0:
            return name
    return None


def yielding(mechanism: Mechanism, aspects: tuple[str, ...]) -> list[Place]:
    """Return the places of all modules that yield along one of `aspects`; '' is a drive's only motion."""
    return [
        Place(module.name, aspect)
        for module in mechanism.modules
        for aspect in aspects
        if stiffness_of(module, aspect) and not (aspect == "" and not isinstance(module.kind, DriveModule))
    ]


def of_constant_stiffness(mechanism: Mechanism) -> list[Place]:
    """Return the places of all modules that yield along themselves, but those whose stiffness follows their load."""
    nonlinear = {module.name for module in mechanism.modules if module.kind.nonlinear}
    return [place for place in yielding(mechanism, ("", "radial", "axial")) if place.name not in nonlinear]


def strained_beyond(place: Place, setup: Setup, curve: Callable[..., tuple[Array, Array]], **values: float) -> Deed:
    """Return what a module yields beyond its constant stiffness by a curve over the force on it.

    curve: of the force (N,), the `stiffness` and `values`; what is yielded [m, rad], and its slope.
    """
    name = stiffness_of(setup.mechanism.module(place.name), place.aspect)
    assert name is not None
    along = partial(curve, stiffness=setup.module_value(place.name, name), **values)
    direction = ASPECTS[place.aspect] if place.aspect else slice(0, 1)
    return ExtraStrain(place.name, Strain(Along(direction, along)))


def beams(mechanism: Mechanism) -> list[Module]:
    """Return the modules that are beams."""
    return [module for module in mechanism.modules if module.kind.bends_exactly]


def turns(mechanism: Mechanism, place: Place) -> bool:
    """Return True where a module's motion is a rotation, so that its load is a moment."""
    module = mechanism.module(place.name)
    if not isinstance(module.kind, DriveModule):
        return place.aspect in ("tilting", "rotational")
    return drive_turns(mechanism, module)


def without_shear(module: Module) -> bool:
    """Return True for a beam of one material whose shear modulus the robot file leaves out."""
    return "shear_modulus" in module.values and bool(np.isinf(module.values["shear_modulus"]))


def steel_shear_modulus(setup: Setup, module: Module) -> float:
    """Return the shear modulus that goes with a beam's present Young's modulus [Pa]."""
    return setup.module_value(module.name, "youngs_modulus") / (2 * (1 + _POISSON))


def twisting_beams(setup: Setup) -> Iterable[Deed]:
    """Return the deeds that give beams which the robot file has stiff in torsion the torsion of solid round steel.

    Without friction no torque reaches them and it makes no difference; what resists a joint twists them.
    """
    for module in beams(setup.mechanism):
        if not without_shear(module):
            continue
        given = setup.module_value(module.name, "shear_modulus"), setup.module_value(module.name, "torsion_constant")
        if np.isinf(given[0]):
            yield ChangedValue(module.name, "shear_modulus", steel_shear_modulus(setup, module))
        if np.isinf(given[1]):
            yield ChangedValue(module.name, "torsion_constant", module.values["torsion_constant"])


def lengths_of(setup: Setup, module: Module) -> Array:
    """Return a beam's length at every sample [m], (N,): it changes with the actuator it stands on."""
    mechanism = setup.mechanism
    assert module.root is not None
    home = mechanism.home_configuration()
    data = mechanism.model.createData()
    pin.forwardKinematics(mechanism.model, data, home)
    tip = data.oMi[module.frame.joint].homogeneous @ module.frame.placement
    root = data.oMi[module.root.joint].homogeneous @ module.root.placement
    length = abs(float((tip[:3, 3] - root[:3, 3]) @ tip[:3, 2]))
    ids = [mechanism.joint_id(name) for name in mechanism.actuated]
    if module.joint not in ids or module.root.joint == module.frame.joint:
        return np.full(len(setup.inputs), length)
    start = home[mechanism.joint(module.joint).first_q]
    return length + setup.inputs.actuators[:, ids.index(module.joint)] - start


def joint_places(mechanism: Mechanism) -> dict[str, str]:
    """Return the free joints with one freedom by the place's name: the module that they carry, else their own."""
    free = set(mechanism.free_dofs.tolist())
    found: dict[str, str] = {}
    for module in mechanism.modules:
        joint = mechanism.joint(module.joint)
        if joint.nv == 1 and joint.first_v in free:
            found[module.name] = joint.name
    carrying = set(found.values())
    for joint in mechanism.joints:
        if joint.name not in carrying and joint.nv == 1 and joint.first_v in free:
            found[joint.name] = joint.name
    return found


def driven_slides(mechanism: Mechanism) -> dict[str, str]:
    """Return the actuated slides that give way along themselves, by their own names: their guides rub beside drives."""
    moving = {module.joint for module in mechanism.modules if isinstance(module.kind, DriveModule)}
    slides = [joint.name for joint in map(mechanism.joint, mechanism.actuated) if joint.slides and joint.id in moving]
    return {name: name for name in slides}


def joint_at(place: str, mechanism: Mechanism) -> Joint:
    """Return the joint of a place, free or a driven slide."""
    return mechanism.joint((joint_places(mechanism) | driven_slides(mechanism))[place])


def actuator_places(mechanism: Mechanism) -> dict[str, int]:
    """Return the actuated joints' columns by the place of their encoder: the motor module, else the joint."""
    found: dict[str, int] = {}
    for column, name in enumerate(mechanism.actuated):
        joint = mechanism.joint_id(name)
        motors = [module.name for module in mechanism.modules if module.joint == joint and module.kind.kind == "motor"]
        found[motors[0] if motors else name] = column
    return found


def actuator_slides(place: str, mechanism: Mechanism) -> bool:
    """Return True where the actuator whose encoder stands at a place moves a slide."""
    return mechanism.joint(mechanism.actuated[actuator_places(mechanism)[place]]).slides


def screws(mechanism: Mechanism) -> dict[str, tuple[int, float]]:
    """Return actuated screws by name: their actuator's column and lead [m] (nan where no module tells it)."""
    found: dict[str, tuple[int, float]] = {}
    ids = [mechanism.joint_id(name) for name in mechanism.actuated]
    for module in mechanism.modules:
        if module.kind.kind == "ball_screw" and module.joint in ids:
            leads = [
                m.values["screw_lead"]
                for m in mechanism.modules
                if m.joint == module.joint and "screw_lead" in m.values
            ]
            found[module.name] = ids.index(module.joint), float(leads[0]) if leads else np.nan
    return found


def travel_per_turn(mechanism: Mechanism, column: int) -> float:
    """Return an actuator's way per turn of its encoder [m, rad]: a hinge's own turn, a slide's motor's; else nan."""
    joint = mechanism.joint(mechanism.actuated[column])
    if not joint.slides:
        return 2 * np.pi
    for module in mechanism.modules:
        if module.joint == joint.id and module.kind.kind == "motor":
            return float(travel_per_motor_turn(module.values))
    return np.nan


def travels(mechanism: Mechanism) -> dict[str, int]:
    """Return the actuated joints' columns by what makes their travel: a screw, a drive module, else the joint."""
    found: dict[str, int] = {}
    by_screw = {column: name for name, (column, _) in screws(mechanism).items()}
    for column, name in enumerate(mechanism.actuated):
        drives = drive_of(name, mechanism)
        found[by_screw.get(column) or (drives[0] if drives else name)] = column
    return found


def drive_of(place: str, mechanism: Mechanism) -> list[str]:
    """Return the modules of the drive that a module or joint belongs to: they share its travel."""
    joints = {module.joint for module in mechanism.modules if module.name == place}
    joints |= {joint.id for joint in mechanism.joints if joint.name == place}
    return [
        module.name for module in mechanism.modules if module.joint in joints and isinstance(module.kind, DriveModule)
    ]


def bush_of(own: Joint, mechanism: Mechanism) -> list[str]:
    """Return the modules of the joint that shares a slide's bush: it turns about the line that the slide follows."""
    model = mechanism.model
    parent = int(model.parents[own.id])
    fixed = model.jointPlacements[own.id]
    if not own.slides or not parent or mechanism.joint(parent).nv != 1 or np.linalg.norm(fixed.translation) > 1e-9:
        return []
    if abs(abs(float(fixed.rotation @ own.axis @ mechanism.joint(parent).axis)) - 1) > 1e-9:
        return []
    return [module.name for module in mechanism.modules if module.joint == parent]
