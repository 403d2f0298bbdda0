"""Joints that do not sit, or do not point, where the drawing has them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import ClassVar

import numpy as np

from ..kernel import rank_of
from ..kinematics import LoopKinematics
from ..mechanism import Joint, Mechanism
from ..modules import WrenchModule
from ..parameters import Quantity
from ..spatial import Array, axis_as_z
from .deeds import Deed, MovedJoint
from .law import Law, Place
from .setup import Setup

_AXES = "xyz"
#: Share of a gap that rounding may leave open.
_ASKEW = 1e-6


class JointPosition(Law):
    """A joint and all that it carries sit beside their place in the drawing, in the axes of the parent's frame.

    At joints that no length of the robot file moves; the others are places of the lengths' own law.
    """

    physics = "geometric_offset"
    summary = "a joint is not where the drawing has it"
    variant = "position"
    cost = 3.0
    quantities = tuple(
        Quantity(axis, "m", f"of the joint along {axis} of its parent", 1e-4, lower=-0.05, upper=0.05) for axis in _AXES
    )
    neutral: ClassVar = dict.fromkeys(_AXES, 0.0)

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        drawn = {name for length in mechanism.description.lengths for name, _ in length.moves}
        able = _taken_up(mechanism)
        return [
            Place(name, self.variant)
            for name, joint in parts(mechanism).items()
            if joint.name not in drawn and _is_set_up(joint, mechanism) and able(joint, np.eye(6)[:3])
        ]

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        joint = parts(setup.mechanism)[place.name]
        yield MovedJoint(joint.name, (*(values[axis] for axis in _AXES), 0.0, 0.0, 0.0))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        listed = ", ".join(f"{axis} {1e3 * values[axis]:+.3g} mm" for axis in _AXES)
        return f"the joint at {place.name} is not where the drawing has it: {listed}"


class JointDirection(Law):
    """A joint, and all that it carries, points beside its drawn direction: turned about both axes across its own."""

    physics = "geometric_offset"
    summary = "a joint does not point where the drawing has it"
    variant = "direction"
    cost = 3.0
    quantities: ClassVar[tuple[Quantity, ...]] = tuple(
        Quantity(name, "rad", "turn about an axis across the joint's", 1e-3, lower=-0.1, upper=0.1)
        for name in ("rx", "ry")
    )
    neutral: ClassVar = {}

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        able = _taken_up(mechanism)
        return [
            Place(name, self.variant)
            for name, joint in parts(mechanism).items()
            if joint.nv == 1 and _is_set_up(joint, mechanism) and able(joint, _turns(joint))
        ]

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        return tuple(
            Quantity(name, "rad", f"turn {_about(name)}", 1e-3, lower=-0.1, upper=0.1)
            for name in across(parts(mechanism)[place.name].axis)
        )

    def neutral_at(self, place: Place, mechanism: Mechanism) -> Mapping[str, float]:
        return {quantity.name: 0.0 for quantity in self.quantities_at(place, mechanism)}

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        joint = parts(setup.mechanism)[place.name]
        turn = sum((values[name] * axis for name, axis in across(joint.axis).items()), np.zeros(3))
        yield MovedJoint(joint.name, (0.0, 0.0, 0.0, *turn.tolist()))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        listed = ", ".join(f"{1e3 * value:+.3g} mrad {_about(name)}" for name, value in values.items())
        return f"the axis at {place.name} does not point where the drawing has it: turned by {listed}"


def across(axis: Array) -> dict[str, Array]:
    """Return two rotations (3,) that tilt an axis, by name: about the frame's own axes where these are across it."""
    drawn = np.flatnonzero(np.abs(axis) > 1 - 1e-9)
    if len(drawn):
        return {f"r{name}": np.eye(3)[index] for index, name in enumerate(_AXES) if index != drawn[0]}
    turn = axis_as_z(axis)
    return {"tilt_1": turn[:, 0], "tilt_2": turn[:, 1]}


def _turns(joint: Joint) -> Array:
    """Return the rotations that tilt a joint, as displacements (2, 6)."""
    return np.array([(0.0, 0.0, 0.0, *turn) for turn in across(joint.axis).values()])


def _is_set_up(joint: Joint, mechanism: Mechanism) -> bool:
    """Return True for joints that a builder aligns: on the base, driven, slides, all of a serial arm."""
    on_base = int(mechanism.model.parents[joint.id]) == 0
    return on_base or joint.slides or joint.name in mechanism.actuated or not mechanism.loops


def _taken_up(mechanism: Mechanism) -> Callable[[Joint, Array], bool]:
    """Return whether the robot at home can take up displacements (k, 6) of a joint's place, as in `MovedJoint`.

    A planar loop does not close askew, unless its modules yield.
    """
    if not mechanism.loops:
        return lambda joint, displacements: True
    kinematics = LoopKinematics(mechanism)
    at = kinematics.evaluate(kinematics.home)
    incidence = kinematics.closure.incidence
    soft = [module.joint for module in mechanism.modules if isinstance(module.kind, WrenchModule)]
    columns = [at.closure, *(incidence[joint][:, None] * at.wrenches for joint in dict.fromkeys(soft))]
    basis = rank_of(np.concatenate(columns, axis=1)).left

    def able(joint: Joint, displacements: Array) -> bool:
        parent, own = at.placements[int(mechanism.model.parents[joint.id])], at.placements[joint.id]
        moved, turned = displacements[:, :3] @ parent[:3, :3].T, displacements[:, 3:] @ own[:3, :3].T
        twists = np.concatenate((moved - np.cross(turned, own[:3, 3]), turned), axis=1)
        gaps = (incidence[joint.id][:, None] * at.wrenches) @ twists.T
        return bool(np.abs(basis.T @ gaps).max(initial=0.0) < _ASKEW * max(np.abs(gaps).max(initial=0.0), 1e-300))

    return able


def _about(name: str) -> str:
    return f"about {name[1]}" if name[0] == "r" else f"across ({name[-1]})"


def parts(mechanism: Mechanism) -> dict[str, Joint]:
    """Return the joints by the place's name: the beam that stands at one, else another module, else their own."""
    found: dict[str, Joint] = {}
    for joint in mechanism.joints:
        own = [module for module in mechanism.modules if module.joint == joint.id]
        beams = [module for module in own if module.kind.bends_exactly]
        found[(beams or own)[0].name if own else joint.name] = joint
    return found
