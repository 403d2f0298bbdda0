"""Planar robots of hinges about z: the five-bar and the 3-RRR."""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from ..robot import Robot
from ..spatial import Array
from .urdf_file import STEEL_DENSITY, STEEL_MODULUS, UrdfFile, bar_mass, disc, in_metres, positive, round_bar, thinner


def three_rrr(
    *,
    base_radius: float,
    platform_radius: float,
    arm: float,
    rod: float,
    motor_stiffness: float,
    arm_diameter: float,
    rod_diameter: float,
    youngs_modulus: float = STEEL_MODULUS,
    density: float = STEEL_DENSITY,
    platform_mass: float = 0.0,
    name: str = "three_rrr",
) -> Robot:
    """Return a platform that three legs move in the plane: a motor on the base, an arm, a hinge, a rod, a hinge.

    base_radius, platform_radius: circles of the motors and of the platform's hinges, both at 90, 210 and 330 degrees;
        at home the platform stands in the middle, unturned [m]. arm, rod: lengths [m], elbows to the left.
    motor_stiffness: about the motor's axis [N m/rad].
    arm_diameter, rod_diameter, youngs_modulus, density: round bars that bend, stretch and twist.

    In the plane a rod carries force along itself alone, so K = sum of s_i s_i^T / c_i with the rods' unit lines s_i
    about the tool and c_i = L^2/motor_stiffness + (arm's tip, along the rod) + rod/(E A), L the force's lever at the
    motor.
    Raises InputError where the legs do not reach.
    """
    in_metres(base_radius=base_radius, platform_radius=platform_radius)
    angles = np.radians([90.0, 210.0, 330.0])
    circle = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=-1)
    motors, seats = base_radius * circle, platform_radius * circle
    file = UrdfFile(
        name,
        """
A planar 3-RRR: motors on the base, an arm and a rod each, a platform between the rods. All axes are z.
Drawn at home, where all joints are at zero and all links have the base's axes.
""",
    )
    file.link("base")
    for leg, (motor, seat) in enumerate(zip(motors, seats, strict=True), 1):
        elbow = _elbow(motor, seat, arm, rod, left=True)
        _leg(file, f"leg{leg}", motor, elbow, seat, arm_diameter, rod_diameter, density)
        if leg == 1:
            file.link("platform", platform_mass, -seat, disc(platform_mass, platform_radius))
            file.joint("leg1_hinge", "revolute", "leg1_rod", "platform", seat - elbow)
        else:
            file.frame(f"leg{leg}_seat", "platform", seat - seats[0])
    closed_on_leg_1(file, seats[0], "motor")
    for leg in (1, 2, 3):
        _modules(file, f"leg{leg}", motor_stiffness, arm_diameter, rod_diameter, youngs_modulus)
    return file.robot()


def closed_on_leg_1(file: UrdfFile, seat: Array, driven: str) -> None:
    """Write the tool and the loops of a platform that leg 1 carries at its seat (3,), whose legs drive a joint each."""
    file.comment("the platform's centre")
    file.frame("tool", "platform", -seat)
    file.tool("tool", "platform", [f"leg{leg}_{driven}" for leg in (1, 2, 3)], {"x": "x", "y": "y", "phi": "rz"})
    file.comment("legs 2 and 3 end in hinges at the platform that leg 1 carries", "extension")
    for leg in (2, 3):
        file.loop(f"leg{leg}", f"leg{leg}_seat", f"leg{leg}_rod_end", "rz")


def five_bar(
    *,
    base: float,
    arm: float,
    rod: float,
    height: float,
    motor_stiffness: float,
    arm_diameter: float,
    rod_diameter: float,
    youngs_modulus: float = STEEL_MODULUS,
    density: float = STEEL_DENSITY,
    name: str = "five_bar",
) -> Robot:
    """Return a five-bar: two motors on the base, an arm and a rod each, the rods hinged to one another at the tool.

    base: distance of the motors, at -base/2 and base/2 on the x axis. height: the tool's y at home, between them; the
        elbows point outwards. arm, rod: lengths [m].
    motor_stiffness: about each motor's axis [N m/rad].
    arm_diameter, rod_diameter, youngs_modulus, density: round bars that bend, stretch and twist.

    A force in the plane is shared by the two rods along themselves: C_xy = U^-T diag(c_1, c_2) U^-1, the rods' unit
    vectors in the columns of U, c_i as in `three_rrr`. Raises InputError where the legs do not reach.
    """
    in_metres(base=base, height=height)
    tool = np.array([0.0, height, 0.0])
    file = UrdfFile(
        name,
        """
A planar five-bar: two motors on the base, an arm and a rod each, hinged at the tool. All axes are z.
Drawn at home, where all joints are at zero and all links have the base's axes.
""",
    )
    file.link("base")
    for side, sign in (("left", -1.0), ("right", 1.0)):
        motor = np.array([sign * base / 2, 0.0, 0.0])
        elbow = _elbow(motor, tool, arm, rod, left=sign < 0)
        _leg(file, side, motor, elbow, tool, arm_diameter, rod_diameter, density)
    file.tool("left_rod_end", "left_rod", ["left_motor", "right_motor"], {"x": "x", "y": "y"})
    file.comment("the rods are hinged to one another at the tool", "extension")
    file.loop("tool", "left_rod_end", "right_rod_end", "rz")
    for side in ("left", "right"):
        _modules(file, side, motor_stiffness, arm_diameter, rod_diameter, youngs_modulus)
    return file.robot()


def _elbow(motor: Array, end: Array, arm: float, rod: float, left: bool) -> Array:
    """Return where arm and rod meet, to the left or right of the line from motor to end."""
    in_metres(arm=arm, rod=rod)
    line = end - motor
    distance = float(np.linalg.norm(line))
    if not abs(arm - rod) < distance < arm + rod:
        raise InputError(
            f"arm = {arm:g} m and rod = {rod:g} m do not meet at home: the motor is {distance:.6g} m from the rod's "
            f"end; expected between {abs(arm - rod):g} and {arm + rod:g} m"
        )
    along = line / distance
    near = (distance**2 + arm**2 - rod**2) / (2 * distance)
    across = np.array([-along[1], along[0], 0.0]) * (1 if left else -1)
    return motor + near * along + np.sqrt(arm**2 - near**2) * across


def _leg(file, name: str, motor: Array, elbow: Array, end: Array, arm_diameter, rod_diameter, density) -> None:
    """Add a motor, an arm and a rod; frames at the ends of both, on the moving side and on the fixed one."""
    arm, rod = elbow - motor, end - elbow
    file.comment(f"{name}: the arm turns about its motor, the rod about the arm's end")
    thinner(float(np.linalg.norm(arm)), arm_diameter=arm_diameter)
    thinner(float(np.linalg.norm(rod)), rod_diameter=rod_diameter)
    masses = [
        bar_mass(float(np.linalg.norm(line)), diameter, density)
        for line, diameter in ((arm, arm_diameter), (rod, rod_diameter))
    ]
    file.frame(f"{name}_mount", "base", motor)
    file.link(f"{name}_arm", masses[0], arm / 2, round_bar(masses[0], arm, arm_diameter))
    file.joint(f"{name}_motor", "revolute", f"{name}_mount", f"{name}_arm")
    file.frame(f"{name}_elbow", f"{name}_arm", arm)
    file.link(f"{name}_rod", masses[1], rod / 2, round_bar(masses[1], rod, rod_diameter))
    file.joint(f"{name}_hinge_at_elbow", "revolute", f"{name}_elbow", f"{name}_rod")
    file.frame(f"{name}_rod_end", f"{name}_rod", rod)


def _modules(file, name: str, motor_stiffness, arm_diameter, rod_diameter, modulus) -> None:
    positive(motor_stiffness=motor_stiffness, youngs_modulus=modulus)
    file.spring(f"{name}/motor", f"{name}_motor", motor_stiffness, "N m/rad")
    file.bar(f"{name}/arm", f"{name}_motor", f"{name}_mount", f"{name}_elbow", arm_diameter, modulus)
    file.bar(f"{name}/rod", f"{name}_hinge_at_elbow", f"{name}_elbow", f"{name}_rod_end", rod_diameter, modulus)
