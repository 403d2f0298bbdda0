"""Writes small robot files for tests: links, joints and a <prup_pin> element, one call each."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import prup_pin

ORIGIN = (0.0, 0.0, 0.0)


def words(values: Any) -> str:
    return " ".join(repr(float(value)) for value in np.ravel(values))


class RobotFile:
    """A URDF in the making. `held` joints are actuated slides: they weld, and modules are loaded through them."""

    def __init__(self, gravity: Sequence[float] = ORIGIN, mount_rpy: Sequence[float] | None = None):
        self._tree: list[str] = []
        self._extension = [f'<gravity xyz="{words(gravity)}"/>']
        self._actuated: list[str] = []
        self._home: dict[str, float] = {}
        self.link("base")
        if mount_rpy is not None:
            self.link("world")
            self.fixed("mount", "world", "base", rpy=mount_rpy)

    def link(self, name: str, mass: float = 0.0, centre: Sequence[float] = ORIGIN) -> str:
        inertia = ""
        if mass:
            moments = " ".join(
                f'{key}="{0.01 if key[1] == key[2] else 0}"' for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
            )
            inertia = (
                f'<inertial><origin xyz="{words(centre)}"/><mass value="{mass!r}"/><inertia {moments}/></inertial>'
            )
        self._tree.append(f'<link name="{name}">{inertia}</link>')
        return name

    def joint(
        self, name: str, kind: str, parent: str, child: str, xyz=ORIGIN, rpy=ORIGIN, axis=(0, 0, 1), follows: str = ""
    ) -> str:
        """Add a joint; `follows`: attributes of its <mimic>."""
        limits = '<limit lower="-3" upper="3" effort="1" velocity="1"/>' if kind != "fixed" else ""
        self._tree.append(
            f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="{words(xyz)}" rpy="{words(rpy)}"/><axis xyz="{words(axis)}"/>{limits}'
            f"{f'<mimic {follows}/>' if follows else ''}</joint>"
        )
        return name

    def driven(self, name: str, *args: Any, **places: Any) -> str:
        self._actuated.append(name)
        return self.joint(name, *args, **places)

    def fixed(self, name: str, parent: str, child: str, xyz=ORIGIN, rpy=ORIGIN) -> str:
        return self.joint(name, "fixed", parent, child, xyz, rpy)

    def frame(self, name: str, parent: str, xyz=ORIGIN, rpy=ORIGIN) -> str:
        """Add a massless link fixed to another one."""
        self.link(name)
        self.fixed(f"{name}_mount", parent, name, xyz, rpy)
        return name

    def held(self, name: str, parent: str, child: str, xyz=ORIGIN, rpy=ORIGIN, axis=(0, 0, 1)) -> str:
        self._actuated.append(name)
        return self.joint(name, "prismatic", parent, child, xyz, rpy, axis)

    def between_holds(self, wall: str, length: float, loaded_at: str, root: str) -> dict[str, str]:
        """Hold the links arm and end in a row along x, the arm's load passing one of two joints; return its ends.

        A beam in the arm's place may be loaded through a joint at the wall or at its end, and be described from either.
        """
        first, second = ("hold", "rest") if loaded_at == "wall" else ("rest", "hold")
        self.held(first, wall, "arm")
        self.held(second, "arm", "end", xyz=(length, 0, 0))
        return {"root": wall, "tip": "end"} if root == "wall" else {"root": "end", "tip": wall}

    def loop(self, name: str, first: str, second: str, free: str = "") -> None:
        self._extension.append(f'<loop name="{name}" frame1="{first}" frame2="{second}" free="{free}"/>')

    def module(self, name: str, kind: str, joint: str, parameters: dict[str, Any], **places: Any) -> None:
        places = {key: value if isinstance(value, str) else words(value) for key, value in places.items()}
        attributes = " ".join(f'{key}="{value}"' for key, value in places.items())
        values = "".join(f'<parameter name="{key}" value="{words(value)}"/>' for key, value in parameters.items())
        self._extension.append(f'<module name="{name}" type="{kind}" joint="{joint}" {attributes}>{values}</module>')

    def text(self, tool: str) -> str:
        actuated = f'<actuated joints="{" ".join(self._actuated)}"/>'
        extension = "".join((f'<tool frame="{tool}"/>', actuated, *self._extension))
        return f'<robot name="test">{"".join(self._tree)}<prup_pin version="1">{extension}</prup_pin></robot>'

    def load(self, folder: Path, tool: str = "tool") -> prup_pin.Robot:
        path = folder / "robot.urdf"
        path.write_text(self.text(tool))
        return prup_pin.load(path)


def at_rest(robot: prup_pin.Robot) -> prup_pin.Compliance:
    """Return the compliance where all actuators stand at zero."""
    return robot.compliance(robot.pose_from_actuators([0.0] * len(robot.mechanism.actuated)))


def rubbing_block(folder: Path, stiffness: float) -> prup_pin.Robot:
    """Return a block that may rub on the base at 'rubbing', held by a spring beside it [N/m]."""
    file = RobotFile()
    file.link("block")
    file.link("ram")
    file.joint("rubbing", "prismatic", "base", "block", axis=(1, 0, 0))
    file.held("slide", "base", "ram", axis=(1, 0, 0))
    file.module("spring", "joint_spring", "slide", {"stiffness": stiffness})
    file.loop("together", "block", "ram", free="y z rx ry rz")
    return file.load(folder, "block")
