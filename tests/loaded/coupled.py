"""Machines with joints that follow others, and their potential energy written out: nothing of it is the package's.

Equilibrium is where the gradient vanishes, compliance the inverse of the Hessian: both by steps along the imaginary
axis, which leave no rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..statics.build import RobotFile

GRAVITY = np.array([0.8, -9.5, 2.0])
_STEP = 1e-30


@dataclass
class Machine:
    """A robot file and the same machine as a potential.

    `places(q, u)`: from the drives' positions and what yields (all zero: nothing) the tool's rotation and point, and
    for each mass its point; `stiffness` of each u; `masses` [kg]; `drive`: places in u of the drives' springs.
    """

    file: RobotFile
    commands: dict[str, float]
    places: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray, list[np.ndarray]]]
    stiffness: np.ndarray
    masses: np.ndarray
    drive: dict[str, int]

    def potential(self, u, force, weighs):
        _, point, centres = self.places(np.array([*self.commands.values()]), u)
        weight = sum(mass * (GRAVITY @ centre) for mass, centre in zip(self.masses, centres, strict=True))
        return 0.5 * (self.stiffness * u * u).sum() - force @ point - weighs * weight

    def gradient(self, u, force, weighs):
        steps = 1j * _STEP * np.eye(len(u))
        return np.array([self.potential(u + step, force, weighs).imag for step in steps]) / _STEP

    def rest(self, force, weighs=True):
        """Return u in equilibrium."""
        u = np.zeros(len(self.stiffness))
        for _ in range(60):
            here = self.gradient(u, force, weighs)
            sizes = 1e-5 / np.sqrt(self.stiffness)
            bent = np.array(
                [
                    (self.gradient(u + step, force, weighs) - self.gradient(u - step, force, weighs)) / (2 * size)
                    for size, step in zip(sizes, np.diag(sizes), strict=True)
                ]
            )
            change = np.linalg.solve((bent + bent.T) / 2, here)
            u = u - change
            if np.abs(change).max() < 1e-15:
                break
        return u

    def tool(self, u):
        turn, point, _ = self.places(np.array([*self.commands.values()]), u)
        return turn, point

    def compliance(self):
        """Return C (6, 6) of the unloaded machine."""
        motions = []
        for step in 1j * _STEP * np.eye(len(self.stiffness)):
            turn, point = self.tool(step)
            spin = (turn.imag / _STEP) @ turn.real.T
            motions.append([*point.imag / _STEP, spin[2, 1], spin[0, 2], spin[1, 0]])
        jacobian = np.array(motions).T
        return jacobian / self.stiffness @ jacobian.T


def _turn(axis, angle):
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def _rotation(vector):
    """Return exp of a rotation vector, complex ones too."""
    x, y, z = vector
    cross, square = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]), vector @ vector
    if abs(square) < 1e-8:
        first, second = 1 - square / 6, 0.5 - square / 24
    else:
        size = np.sqrt(square)
        first, second = np.sin(size) / size, (1 - np.cos(size)) / square
    return np.eye(3) + first * cross + second * cross @ cross


def lifting_column(fault: float = 0.0) -> Machine:
    """Two stages that share one lift, which is a link of its own; the second one's screw yields, the first one's guide.

    On top an arm whose joint yields. `fault`: share by which the second stage's ratio is off in the potential.
    """
    file = RobotFile(GRAVITY)
    file.link("nut", 4.0, (0.0, 0.1, 0.0))
    file.link("first", 9.0, (0.05, 0.0, -0.3))
    file.link("second", 7.0, (-0.02, 0.03, -0.2))
    file.link("arm", 5.0, (0.3, 0.0, 0.05))
    file.driven("lift", "prismatic", "base", "nut", xyz=(0.3, 0.0, 0.0))
    led = 'joint="lift" multiplier="{}" offset="{}"'
    file.joint("stage1", "prismatic", "base", "first", follows=led.format(0.4, -0.1))
    file.joint("stage2", "prismatic", "first", "second", xyz=(0.02, 0.0, 0.4), follows=led.format(0.7, 0.2))
    file.driven("shoulder", "revolute", "second", "arm", xyz=(0.1, 0.05, 0.3), axis=(0, 1, 0))
    file.frame("tool", "arm", (0.7, 0.1, -0.05))
    file.module("lift/screw", "joint_spring", "lift", {"stiffness": 2e5})
    file.module("stage2/screw", "joint_spring", "stage2", {"stiffness": 3e5})
    file.module("shoulder/gear", "joint_spring", "shoulder", {"stiffness": 4e3})
    soft = np.array([1e-6, 2e-6, 3e-6, 2e-5, 4e-5, 1e-5])
    file.module("stage1/guide", "compliance_matrix", "stage1", {"matrix": np.diag(soft)})

    def places(q, u):
        lift, angle = q[0] + u[0], q[1] + u[2]
        nut = np.array([0.3, 0.1, lift])
        turn1, at1 = _rotation(u[6:9]), np.array([0, 0, 0.4 * lift - 0.1]) + u[3:6]
        at2 = at1 + turn1 @ np.array([0.02, 0.0, 0.4 + 0.7 * (1 + fault) * lift + 0.2 + u[1]])
        at3, turn3 = at2 + turn1 @ np.array([0.1, 0.05, 0.3]), turn1 @ _turn((0, 1, 0), angle)
        centres = [
            nut,
            at1 + turn1 @ np.array([0.05, 0.0, -0.3]),
            at2 + turn1 @ np.array([-0.02, 0.03, -0.2]),
            at3 + turn3 @ np.array([0.3, 0.0, 0.05]),
        ]
        return turn3, at3 + turn3 @ np.array([0.7, 0.1, -0.05]), centres

    stiffness = np.concatenate(([2e5, 3e5, 4e3], 1 / soft))
    commands = {"lift": 0.6, "shoulder": 0.4}
    return Machine(file, commands, places, stiffness, np.array([4.0, 9.0, 7.0, 5.0]), {"lift": 0, "shoulder": 2})


def belted_arm(fault: float = 0.0) -> Machine:
    """A shoulder that a belt hands on to the elbow, and the elbow to the wrist; the second belt yields."""
    file = RobotFile(GRAVITY)
    for name, mass in (("upper", 6.0), ("fore", 4.0), ("hand", 2.0)):
        file.link(name, mass, (0.2, 0.02, 0.01))
    file.driven("shoulder", "revolute", "base", "upper", axis=(0, 0, 1))
    follows = 'joint="shoulder" multiplier="-1.5" offset="0.3"'
    file.joint("elbow", "revolute", "upper", "fore", xyz=(0.5, 0, 0.05), axis=(0, 0, 1), follows=follows)
    follows = 'joint="elbow" multiplier="0.5"'
    file.joint("wrist", "revolute", "fore", "hand", xyz=(0.4, 0, -0.02), axis=(0, 1, 0), follows=follows)
    file.frame("tool", "hand", (0.3, 0.1, 0.02))
    file.module("shoulder/gear", "joint_spring", "shoulder", {"stiffness": 3e3})
    file.module("wrist/belt", "joint_spring", "wrist", {"stiffness": 8e2})

    def places(q, u):
        shoulder = q[0] + u[0]
        elbow = -1.5 * (1 + fault) * shoulder + 0.3
        wrist = 0.5 * elbow + u[1]
        one = _turn((0, 0, 1), shoulder)
        two = one @ _turn((0, 0, 1), elbow)
        three = two @ _turn((0, 1, 0), wrist)
        at2 = one @ np.array([0.5, 0, 0.05])
        at3 = at2 + two @ np.array([0.4, 0, -0.02])
        centre = np.array([0.2, 0.02, 0.01])
        return three, at3 + three @ np.array([0.3, 0.1, 0.02]), [one @ centre, at2 + two @ centre, at3 + three @ centre]

    masses = np.array([6.0, 4.0, 2.0])
    return Machine(file, {"shoulder": 0.7}, places, np.array([3e3, 8e2]), masses, {"shoulder": 0})


#: Drawn points of the four-bar between two gears: cranks' pivots, their elbows, and where the rods meet.
_PIVOTS, _ELBOWS = np.array([[-0.2, 0], [0.2, 0]]), np.array([[-0.34, 0.26], [0.36, 0.25]])
_TIP = np.array([0.02, 0.68])


def _four_bar(follows: str, leader: str) -> RobotFile:
    file = RobotFile(GRAVITY)
    for side, mass in (("left", 3.0), ("right", 2.0)):
        file.link(f"{side}_crank", mass, (0.03, 0.05, 0.0))
        file.link(f"{side}_rod", mass / 2, (0.04, -0.02, 0.0))
    file.driven("left", "revolute", "base", "left_crank", xyz=(*_PIVOTS[0], 0))
    coupling = f'joint="{leader}" {follows}'
    file.joint("right", "revolute", "base", "right_crank", xyz=(*_PIVOTS[1], 0), follows=coupling)
    for index, side in enumerate(("left", "right")):
        elbow, rod = _ELBOWS[index] - _PIVOTS[index], _TIP - _ELBOWS[index]
        file.joint(f"{side}_elbow", "revolute", f"{side}_crank", f"{side}_rod", xyz=(*elbow, 0))
        file.frame(f"{side}_tip", f"{side}_rod", (*rod, 0))
    file.frame("tool", "left_rod", (*(_TIP - _ELBOWS[0] + [0.05, 0.03]), 0.02))
    file.loop("meet", "left_tip", "right_tip", "rz")
    file.module("left/gear", "joint_spring", "left", {"stiffness": 2e3})
    return file


def _plane(angle):
    return np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])


def _three(point):
    return np.array([*point, 0.0 * point[0]])


def _assembled(left, elbow, right):
    """Return what `Machine.places` does, of the turns of the left crank, its rod against it, and the right crank."""
    crank, rod, other = _plane(left), _plane(left + elbow), _plane(right)
    pivots, elbows, tip = (np.array([_three(p) for p in part]) for part in (_PIVOTS, _ELBOWS, [_TIP]))
    one, two = (pivots[i] + turn @ (elbows[i] - pivots[i]) for i, turn in enumerate((crank, other)))
    meets = one + rod @ (tip[0] - elbows[0])
    # the right rod points from its elbow to where the rods meet
    drawn, now = tip[0] - elbows[1], meets - two
    length = drawn @ drawn
    cosine, sine = (drawn @ now) / length, (drawn[0] * now[1] - drawn[1] * now[0]) / length
    second = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    centres = [pivots[0] + crank @ np.array([0.03, 0.05, 0]), pivots[1] + other @ np.array([0.03, 0.05, 0])]
    centres += [one + rod @ np.array([0.04, -0.02, 0]), two + second @ np.array([0.04, -0.02, 0])]
    point = one + rod @ (tip[0] - elbows[0] + np.array([0.05, 0.03, 0.02]))
    return (rod, point, centres), now @ now - length


def _closed(turns: Callable[[Any], tuple[Any, Any, Any]]):
    """Return the machine where its loop is closed by x, from x to the three turns, by Newton's method."""
    x: Any = 0.0
    for _ in range(30):
        gap = _assembled(*turns(x))[1]
        slope = (_assembled(*turns(x + 1e-6))[1] - _assembled(*turns(x - 1e-6))[1]) / 2e-6
        x = x - gap / slope
    return _assembled(*turns(x))[0]


def geared_four_bar(fault: float = 0.0) -> Machine:
    """Two cranks that gears couple carry two rods that meet; the left one is driven, and the right gear yields."""
    file = _four_bar('multiplier="-0.8" offset="0.05"', "left")
    file.module("right/gear", "joint_spring", "right", {"stiffness": 1e3})

    def places(q, u):
        left = q[0] + u[0]
        right = -0.8 * (1 + fault) * left + 0.05 + u[1]
        return _closed(lambda elbow: (left, elbow, right))

    masses = np.array([3.0, 2.0, 1.5, 1.0])
    return Machine(file, {"left": 0.3}, places, np.array([2e3, 1e3]), masses, {"left": 0})


def knee_geared_four_bar(fault: float = 0.0) -> Machine:
    """The same cranks; the right one follows the left elbow, which nothing drives."""
    file = _four_bar('multiplier="0.6" offset="-0.02"', "left_elbow")

    def places(q, u):
        left = q[0] + u[0]
        return _closed(lambda elbow: (left, elbow, 0.6 * (1 + fault) * elbow - 0.02))

    masses = np.array([3.0, 2.0, 1.5, 1.0])
    return Machine(file, {"left": 0.2}, places, np.array([2e3]), masses, {"left": 0})


MACHINES = {each.__name__: each for each in (lifting_column, belted_arm, geared_four_bar, knee_geared_four_bar)}
