"""`load`: from a name or a file to a robot."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from . import robots
from .errors import InputError, ParameterError, named, shortened
from .mechanism import Mechanism, Module
from .mechanism.description import ModuleDescription, RobotDescription, kinds_by_name
from .mechanism.readers import read
from .parameters import Parameter
from .robot import Robot

__all__ = ["Reading", "load"]


def load(
    robot: str | Path,
    *,
    tool: str | None = None,
    joint_stiffness: float | Mapping[str, float] | None = None,
    actuated: Sequence[str] | None = None,
    home: Mapping[str, float] | None = None,
    variant: str | None = None,
    package_folders: Sequence[str | Path] | str | Path | None = None,
) -> Robot:
    """Load a robot by name or from a file.

    robot: a packaged name ('3prup', '3prup_as_published'), a robot of example-robot-data ('ur5'), or a path to a URDF
        or MJCF file; its root element says which. Loop closures of a URDF come from <prup_pin> and <loop_joint>, else
        from '<stem>.yaml' or 'robot.yaml' beside it (closed_loop, type, name_mot, joint_name, joint_type), else from
        links named closing_<name>_1 and _2, which close a point; those of MJCF from connect and weld.
    tool: name of the tool frame (a link, body, joint or site), where the file does not say.
    joint_stiffness: stiffness of the actuated joints [N m/rad or N/m], one number or one per joint name. A joint
        named here that is not actuated becomes a sprung joint; one that yields already is refused.
    actuated: names of the actuated joints, where the file does not say (MJCF: with <actuator>); of a tree all are.
    home: joint values near which the loops close, where the file does not say.
    variant: a <variant> of the file.
    package_folders: folders that package:// paths may point into besides the robot's own.

    Raises RobotFileError with every problem of the file, UnknownNameError, ParameterError.
    """
    path, found_folders, found_variant = robots.find(str(robot))
    description = read(path, (*found_folders, *robots.folders(package_folders)))
    if tool is None and description.tool is None:
        tool = robots.EXAMPLE_TOOLS.get(str(robot))
    changes: dict[str, Any] = {}
    if tool is not None:
        changes.update(tool=tool, tool_part=None)
    if actuated is not None:
        changes["actuated"] = _names("actuated", actuated)
    if home is not None:
        changes["home"] = {**description.home, **_values("home", home)}
        changes["lines"] = {**description.lines, "home": None}
    description = replace(description, **changes)
    wanted = found_variant if variant is None else variant
    if wanted is not None:
        named(f"variant of '{description.name}'", wanted, description.variants)
        description = description.with_variant(wanted)
    mechanism = Mechanism(description)
    if tool is not None:
        mechanism.frame(tool)
    for name in changes.get("actuated", ()):
        mechanism.joint(name)
    mechanism.home_configuration()
    if joint_stiffness is not None:
        mechanism = Mechanism(_with_joint_springs(description, mechanism, joint_stiffness), model=mechanism.model)
    if mechanism.loops and description.actuated is None:
        raise InputError(
            f"'{description.name}' has loops, but nothing says which joints are actuated: "
            f'load(..., actuated=["joint", …]) with names from {", ".join(list(mechanism.model.names)[1:])}'
        )
    return Robot(mechanism).prepared()


@dataclass(frozen=True)
class Reading:
    """How a robot's file is read beyond what it says: the arguments of `load`, and what is changed afterwards.

    parameters: other values by full name; held: joints that stand still, and where [m, rad].
    """

    variant: str | None = None
    tool: str | None = None
    joint_stiffness: float | Mapping[str, float] | None = None
    actuated: Sequence[str] | None = None
    home: Mapping[str, float] | None = None
    package_folders: Sequence[str | Path] | None = None
    parameters: Mapping[str, Any] = field(default_factory=dict)
    held: Mapping[str, float] = field(default_factory=dict)

    def load(self, name: str) -> Robot:
        """Return the robot of that name or file, read so. Raises as `load` and the changes do."""
        robot = load(
            name,
            tool=self.tool,
            joint_stiffness=self.joint_stiffness,
            variant=self.variant,
            actuated=self.actuated,
            home=self.home,
            package_folders=self.package_folders,
        )
        robot = robot.with_parameters(self.parameters) if self.parameters else robot
        return robot.with_held_joints(self.held)


def _names(what: str, given: Sequence[str]) -> tuple[str, ...]:
    names = (given,) if isinstance(given, str) else tuple(given) if isinstance(given, Iterable) else ()
    if not all(isinstance(name, str) for name in names) or not (names or isinstance(given, Iterable)):
        raise InputError(f"{what} = {shortened(given)}: expected names of joints, ['joint', …]")
    return names


def _values(what: str, given: Mapping[str, float]) -> dict[str, float]:
    """Return finite numbers by name, or raise InputError."""
    try:
        values = {name: float(value) for name, value in given.items()}
    except (AttributeError, OverflowError, TypeError, ValueError):
        values = {"": np.nan}
    if not all(isinstance(name, str) and np.isfinite(value) for name, value in values.items()):
        raise InputError(f"{what} = {shortened(given)}: expected finite numbers by joint, {{'joint': 0.1, …}}")
    return values


def _refuse_series(mechanism: Mechanism, joints: Iterable[str]) -> None:
    """Raise InputError where one of the joints gives way along its own motion already: springs would be in series."""
    yielding: dict[str, list[Module]] = {}
    for module in mechanism.modules:
        if mechanism.gives_way(module):
            yielding.setdefault(mechanism.joint(module.joint).name, []).append(module)
    found = {name: yielding[name] for name in joints if name in yielding}
    if not found:
        return
    listed = "; ".join(f"'{name}' by {', '.join(module.name for module in of)}" for name, of in found.items())
    values = [
        f"{module.name}.{known.name}" for module in next(iter(found.values())) for known in module.kind.quantities
    ]
    value = next((name for name in values if name.endswith(".stiffness")), values[0])
    without = [name for name in mechanism.actuated if name not in yielding]
    rest = f", or give springs to {', '.join(without)} alone, by name" if without else ""
    raise InputError(
        f"joint_stiffness: joints that yield already, so that springs would be in series with what the file says: "
        f"{listed}. Change that instead, with_parameters({{'{value}': …}}) or --set {value}=…{rest}"
    )


def _with_joint_springs(description: RobotDescription, mechanism: Mechanism, stiffness) -> RobotDescription:
    """Return the description with a spring on every actuated joint, or on the joints of a mapping."""
    springs = dict(stiffness) if isinstance(stiffness, Mapping) else dict.fromkeys(mechanism.actuated, stiffness)
    quantity = kinds_by_name()["joint_spring"].quantities[0]
    taken = {module.name for module in description.modules}
    _refuse_series(mechanism, springs)
    modules = list(description.modules)
    for name, value in springs.items():
        joint = mechanism.joint(name)
        if name in taken:
            raise InputError(f"joint_stiffness: the robot file already has a module named '{name}'")
        try:
            checked = quantity.check(value, name)
        except ParameterError as error:
            raise ParameterError(f"joint_stiffness: {error}") from None
        unit = "N/m" if joint.slides else "N m/rad"
        parameter = Parameter(f"{name}.stiffness", checked, unit, "joint_stiffness", quantity.description, quantity)
        modules.append(ModuleDescription(name, "joint_spring", name, values={"stiffness": parameter}))
    return replace(description, modules=tuple(modules))
