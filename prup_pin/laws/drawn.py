"""What an effect is drawn against: the variable that drives it, and where it shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..mechanism import Mechanism, Module
from ..modules import DriveModule
from ..spatial import Array
from .deeds import Solved

_COMPONENTS = {
    "fx": "force across, along x",
    "fy": "force across, along y",
    "fz": "force along the axis",
    "mx": "moment about x",
    "my": "moment about y",
    "mz": "torque about the axis",
}
#: A load that varies less does not drive anything [N, N m].
_LEAST = 1e-6


@dataclass(frozen=True)
class Drawn:
    """The variable x (n,) that drives an effect, and what is watched (n, R) per unit of the effect.

    `labels` and `units` are those of the variable and of the effect: a deformation against a load, a torque against a
    motion. `path`: what happened before matters, so that the effect is no line over x.
    """

    x: Array
    direction: Array
    labels: tuple[str, str]
    units: tuple[str, str]
    path: bool = False


def against_component(at: Solved, module: str, component: int, path: bool = False) -> Drawn:
    """Return a module's deformation against one component of its load."""
    mechanism = at.setup.mechanism
    labels = (_component_text(mechanism, module, component), "deformation beyond the model")
    units = load_units(mechanism, module, component)
    direction = at.first.by_strain(module)[:, :, component]
    return Drawn(at.first.loads(module)[:, component], direction, labels, units, path)


def against_load(at: Solved, module: str, motion: slice, path: bool = False) -> Drawn | None:
    """Return a module's deformation against its load, of one component or along the resultant of two.

    `motion`: the components of the load. None where more act at once, as on a beam, or where the load does not vary.
    """
    if module not in at.first.rows:
        return None
    loads = at.first.loads(module)
    components = range(loads.shape[1])[motion]
    if len(components) == 1:
        varies = np.ptp(loads[:, components[0]]) > _LEAST
        return against_component(at, module, components[0], path) if varies else None
    if len(components) != 2:
        return None
    part = loads[:, motion]
    size = np.linalg.norm(part, axis=1)
    unit = part / np.maximum(size, 1e-12)[:, None]
    direction = (at.first.by_strain(module)[:, :, motion] @ unit[..., None])[..., 0]
    units = load_units(at.setup.mechanism, module, components[0])
    name = "tilting moment" if units[1] == "rad" else "radial force"
    return Drawn(size, direction, (name, "deformation along it"), units, path)


def against_motion(at: Solved, joint: str) -> Drawn | None:
    """Return what resists a joint against the joint's motion; None where it has none under load."""
    item = at.setup.mechanism.joint(joint)
    moving = {int(dof): place for place, dof in enumerate(at.first.chain.moving)}
    if item.first_v not in moving:
        return None
    motion = at.first.found.state.travel[:, item.first_v]
    direction = at.first.by_resistance([moving[item.first_v]])[:, :, 0]
    if item.slides:
        return Drawn(motion, direction, ("travel of the joint", "resisting force"), ("m", "N"), True)
    return Drawn(motion, direction, ("turn of the joint", "resisting torque"), ("rad", "N m"), True)


def _component_text(mechanism: Mechanism, module: str, component: int) -> str:
    """Return what a module's load component is called, in words."""
    return _COMPONENTS.get(mechanism.module(module).kind.loads[component], "load along the drive")


def load_units(mechanism: Mechanism, module: str, component: int) -> tuple[str, str]:
    """Return the units of a module's load and deformation."""
    item = mechanism.module(module)
    if isinstance(item.kind, DriveModule):
        turning = drive_turns(mechanism, item)
    else:
        turning = item.kind.loads[component].startswith("m")
    return ("N m", "rad") if turning else ("N", "m")


def drive_turns(mechanism: Mechanism, module: Module) -> bool:
    """Return True where a drive module's motion is a rotation: in a joint that turns, and in a motor."""
    return module.kind.kind == "motor" or not mechanism.joint(module.joint).slides
