"""The Delta robot of Clavel."""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from ..robot import Robot
from .urdf_file import STEEL_DENSITY, STEEL_MODULUS, UrdfFile, bar_mass, disc, in_metres, positive, round_bar, thinner


def delta(
    *,
    base_radius: float,
    platform_radius: float,
    arm: float,
    rod: float,
    rod_spacing: float,
    height: float,
    motor_stiffness: float,
    rod_diameter: float,
    arm_diameter: float | None = None,
    youngs_modulus: float = STEEL_MODULUS,
    density: float = STEEL_DENSITY,
    platform_mass: float = 0.0,
    name: str = "delta",
) -> Robot:
    """Return a Delta robot: three arms on motors, each with a pair of parallel rods to the platform below.

    base_radius, platform_radius: circles of the motors' axes and of the middles between the rods' lower ends, at 0,
        120 and 240 degrees. height: how far the platform hangs below the motors at home, in the middle [m].
    arm, rod, rod_spacing: lengths, and the distance between the two rods of a pair [m]; elbows point outwards.
    motor_stiffness: about the motor's axis [N m/rad].
    rod_diameter, arm_diameter, youngs_modulus, density: round bars; without arm_diameter arms are rigid and weigh
        nothing.

    Rods hang on ball joints and carry force along themselves alone: with their unit lines in the columns of S (6, 6),
    C = S^-T (diag(rod/(E A)) + G^T G / motor_stiffness + arms) S^-1, G (3, 6) the motors' torques per unit rod force.
    Raises InputError where arms and rods do not reach.
    """
    in_metres(
        base_radius=base_radius, platform_radius=platform_radius, arm=arm, rod=rod, rod_spacing=rod_spacing,
        height=height,
    )  # fmt: skip
    positive(motor_stiffness=motor_stiffness, youngs_modulus=youngs_modulus)
    thinner(rod, rod_diameter=rod_diameter)
    if arm_diameter is not None:
        thinner(arm, arm_diameter=arm_diameter)
    # In the plane of an arm: r outwards, z up. The elbow is where the circles about motor and platform joint meet.
    across, down = base_radius - platform_radius, height
    distance = float(np.hypot(across, down))
    if not abs(arm - rod) < distance < arm + rod:
        raise InputError(
            f"arm = {arm:g} m and rod = {rod:g} m do not meet at home: motor and platform joint are {distance:.6g} m "
            f"apart; expected between {abs(arm - rod):g} and {arm + rod:g} m"
        )
    near = (distance**2 + arm**2 - rod**2) / (2 * distance)
    along = np.array([-across, -down]) / distance
    elbow = near * along + np.sqrt(arm**2 - near**2) * np.array([-along[1], along[0]])

    file = UrdfFile(
        name,
        """
A Delta robot: three arms on motors, each with two parallel rods on ball joints, and the platform below.
Drawn at home, where all joints are at zero and all links have the base's axes.
""",
    )
    file.link("base")
    angles = np.radians([0.0, 120.0, 240.0])
    seats = {}
    for leg, angle in enumerate(angles, 1):
        outwards = np.array([np.cos(angle), np.sin(angle), 0.0])
        sideways = np.array([-np.sin(angle), np.cos(angle), 0.0])
        arm_line = elbow[0] * outwards + [0, 0, elbow[1]]
        rod_line = platform_radius * outwards - [0, 0, height] - (base_radius * outwards + arm_line)
        file.comment(f"leg {leg}: the arm turns about its motor, the two rods on universal joints at its end")
        file.frame(f"leg{leg}_mount", "base", base_radius * outwards)
        mass = 0.0 if arm_diameter is None else bar_mass(arm, arm_diameter, density)
        file.link(f"leg{leg}_arm", mass, arm_line / 2, round_bar(mass, arm_line, arm_diameter or 0.0))
        file.joint(f"leg{leg}_motor", "revolute", f"leg{leg}_mount", f"leg{leg}_arm", axis=-sideways)
        file.frame(f"leg{leg}_elbow", f"leg{leg}_arm", arm_line)
        for side, sign in (("a", 1.0), ("b", -1.0)):
            rod_name = f"leg{leg}{side}"
            offset = sign * rod_spacing / 2 * sideways
            seats[rod_name] = platform_radius * outwards + offset
            file.frame(f"{rod_name}_top", f"leg{leg}_elbow", offset)
            file.link(f"{rod_name}_fork")
            file.joint(f"{rod_name}_u1", "revolute", f"{rod_name}_top", f"{rod_name}_fork", axis=sideways)
            mass = bar_mass(rod, rod_diameter, density)
            file.link(f"{rod_name}_rod", mass, rod_line / 2, round_bar(mass, rod_line, rod_diameter))
            turning = np.cross(rod_line / rod, sideways)
            file.joint(f"{rod_name}_u2", "revolute", f"{rod_name}_fork", f"{rod_name}_rod", axis=turning)
            file.frame(f"{rod_name}_bottom", f"{rod_name}_rod", rod_line)
    file.comment("the platform hangs on the first rod's ball joint")
    first = seats.pop("leg1a")
    parent = "leg1a_bottom"
    for axis in "xyz":
        link = "platform" if axis == "z" else f"ball_{axis}"
        file.link(link, *((platform_mass, -first, disc(platform_mass, platform_radius)) if axis == "z" else ()))
        file.joint(f"ball_{axis}", "revolute", parent, link, axis=[float(axis == a) for a in "xyz"])
        parent = link
    for rod_name, seat in seats.items():
        file.frame(f"{rod_name}_seat", "platform", seat - first)
    file.frame("tool", "platform", -first)
    file.tool("tool", "platform", [f"leg{leg}_motor" for leg in (1, 2, 3)], {axis: axis for axis in "xyz"})
    file.comment("the other five rods end in ball joints at the platform", "extension")
    for rod_name in seats:
        file.loop(rod_name, f"{rod_name}_seat", f"{rod_name}_bottom", "rx ry rz")
    for leg in (1, 2, 3):
        file.spring(f"leg{leg}/motor", f"leg{leg}_motor", motor_stiffness, "N m/rad")
        if arm_diameter is not None:
            file.bar(f"leg{leg}/arm", f"leg{leg}_motor", f"leg{leg}_mount", f"leg{leg}_elbow", arm_diameter,
                     youngs_modulus)  # fmt: skip
        for side in "ab":
            file.bar(f"leg{leg}/rod_{side}", f"leg{leg}{side}_u2", f"leg{leg}{side}_top", f"leg{leg}{side}_bottom",
                     rod_diameter, youngs_modulus)  # fmt: skip
    return file.robot()
