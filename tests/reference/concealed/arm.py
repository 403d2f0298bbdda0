"""A serial arm with six elastic joints that is not quite the nominal one, from each joint's torque as deformed.

Outwards through the chain every joint's axis and centre, and every link's centre of mass, are placed where the turned
joints have them; a joint bears the moment about its axis of all that hangs or pulls beyond it, and yields under it.
That each joint stands where its yielding drive has it are the six equations.

SI units and radians; gravity along -z. Joints count from 1 in names such as "joint1".
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from .machine import SENSOR_PARAMETERS, G, Machine, newton
from .rotations import matrix

JOINTS = range(1, 7)
AXES = np.array([[0, 0, 1], [0, 1, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0]], float)
ORIGINS = np.array([[0, 0, 0.30], [0.16, 0, 0.14], [0, 0, 0.56], [0.14, 0, 0.11], [0.42, 0, 0], [0.09, 0, 0]])  # m
TOOL = np.array([0.13, 0.02, 0.05])  # m, in the last link
MASSES = np.array([21.0, 16.0, 11.0, 6.5, 2.5, 1.2])  # kg
CENTRES = np.array([[0.06, 0.01, 0.05], [0.01, -0.05, 0.25], [0.05, 0.03, 0.06], [0.18, 0, 0.01], [0.03, 0, 0],
                    [0.05, 0, 0.02]])  # m, in each link  # fmt: skip
DRIVES = tuple(f"joint{i}/drive" for i in JOINTS)


class Arm(Machine):
    """The arm of tests/robots/elastic_arm/elastic_arm.urdf."""

    DRIVES: ClassVar = DRIVES
    ACTUATED: ClassVar = tuple(f"joint{i}" for i in JOINTS)
    STIFFNESS: ClassVar = np.array([6e5, 7e5, 4e5, 1.2e5, 9e4, 5e4])  # N m/rad
    PARAMETERS: ClassVar = {
        **{f"joint{i}/drive.stiffness": "stiffness" for i in JOINTS},
        **{f"joint{i}.{axis}": "position" for i in JOINTS for axis in "xyz"},
        **{f"joint{i}.r{axis}": "direction" for i in JOINTS for k, axis in enumerate("xyz") if not AXES[i - 1][k]},
        **{f"joint{i}.{name}": name for i in JOINTS for name in ("encoder_offset", "encoder_slope")},
        **{f"link{i}.mass": "mass" for i in JOINTS},
        **SENSOR_PARAMETERS,
    }

    def __init__(self, effects=(), scatter=None):
        self.origins, self.turns = ORIGINS.copy(), np.zeros((6, 3))
        super().__init__(effects, scatter)

    def _misplace(self, place, turned, axis, amount):
        """A joint is shifted along the axes of the link before it, or turned about its own."""
        (self.turns if turned else self.origins)[int(place[5]) - 1, axis] += amount

    def _chain(self, angles):
        """Centres, axes and frames of the joints, base frame: (..., 6, 3), (..., 6, 3), (..., 6, 3, 3)."""
        rot, at = np.broadcast_to(np.eye(3), (*angles.shape[:-1], 3, 3)), np.zeros((*angles.shape[:-1], 3))
        places, axes, frames = [], [], []
        for i in range(6):
            at = at + rot @ self.origins[i]
            rot = rot @ matrix(self.turns[i])
            axes.append(rot @ AXES[i])
            rot = rot @ matrix(angles[..., i : i + 1] * AXES[i])
            places.append(at)
            frames.append(rot)
        return np.stack(places, -2), np.stack(axes, -2), np.stack(frames, -3)

    def _torques(self, angles, w):
        """Moments (..., 6) that act about the joints' axes."""
        places, axes, frames = self._chain(angles)
        tip = places[..., 5, :] + frames[..., 5, :, :] @ TOOL
        total = self._on_tool(w, tip, frames[..., 5, :, :])
        force, moment = total[..., None, :3], total[..., None, 3:]
        bent = moment + np.cross(tip[..., None, :] - places, np.broadcast_to(force, places.shape))
        if self.weighs:
            for i in range(6):
                weight = np.array([0.0, 0.0, -G * MASSES[i] * self._factor(f"link{i + 1}")])
                centre = places[..., i, :] + frames[..., i, :, :] @ CENTRES[i]
                bent[..., : i + 1, :] += np.cross(centre[..., None, :] - places[..., : i + 1, :], weight)
        return (axes * bent).sum(-1)

    def _weights(self, standing):
        places, _, frames = self._chain(standing)
        return [
            (
                np.array([0.0, 0.0, -G * MASSES[i] * self._factor(f"link{i + 1}")]),
                places[:, i] + frames[:, i] @ CENTRES[i],
            )
            for i in range(6)
        ]

    def _equilibrium(self, standing, w):
        def left(angles):
            return angles - standing - self._yields(self._torques(angles, w))

        angles, residual = newton(left, standing, np.full(6, 1e-6))
        places, _, frames = self._chain(angles)
        return places[:, 5] + frames[:, 5] @ TOOL, frames[:, 5], residual


def robot_file() -> str:
    """The nominal arm as a robot file."""

    def numbers(values):
        return " ".join(f"{value:.15g}" for value in values)

    lines = [
        '<?xml version="1.0"?>',
        "<!-- An arm of six elastic joints. -->",
        '<robot name="elastic_arm">',
        '  <link name="base"/>',
    ]
    for i in JOINTS:
        lines += [
            f'  <link name="link{i}"><inertial><origin xyz="{numbers(CENTRES[i - 1])}"/>'
            f'<mass value="{MASSES[i - 1]:g}"/>'
            '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>',
            f'  <joint name="joint{i}" type="revolute"><parent link="{f"link{i - 1}" if i > 1 else "base"}"/>'
            f'<child link="link{i}"/><origin xyz="{numbers(ORIGINS[i - 1])}"/><axis xyz="{numbers(AXES[i - 1])}"/>'
            '<limit lower="-3" upper="3" effort="1000" velocity="3"/></joint>',
        ]
    lines += [
        '  <link name="tool"/>',
        '  <joint name="tool" type="fixed"><parent link="link6"/><child link="tool"/>'
        f'<origin xyz="{numbers(TOOL)}"/></joint>',
        '  <prup_pin version="1">',
        f'    <gravity xyz="0 0 -{G}"/>',
        '    <tool frame="tool"/>',
        f'    <actuated joints="{" ".join(Arm.ACTUATED)}"/>',
        *(
            f'    <module name="{DRIVES[i - 1]}" type="joint_spring" joint="joint{i}">'
            f'<parameter name="stiffness" value="{Arm.STIFFNESS[i - 1]:g}" unit="N m/rad"/></module>'
            for i in JOINTS
        ),
        "  </prup_pin>",
        "</robot>",
        "",
    ]
    return "\n".join(lines)


def poses(rng, count: int) -> np.ndarray:
    """Encoder readings (count, 6) of random poses in front of the arm."""
    low, high = [-0.9, -0.5, -0.4, -0.9, -0.9, -0.9], [0.9, 0.7, 0.9, 0.9, 0.9, 0.9]
    return rng.uniform(low, high, (count, 6))
