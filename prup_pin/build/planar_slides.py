"""The planar 3-PRR: three slides along the sides of a triangle, and a rod from each to the platform."""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from ..robot import Robot
from ..spatial import Array
from .planar import closed_on_leg_1
from .urdf_file import STEEL_DENSITY, STEEL_MODULUS, UrdfFile, bar_mass, disc, in_metres, positive, round_bar, thinner


def three_prr(
    *,
    base_radius: float,
    platform_radius: float,
    rod: float,
    drive_stiffness: float,
    rod_diameter: float,
    stroke: float | None = None,
    youngs_modulus: float = STEEL_MODULUS,
    density: float = STEEL_DENSITY,
    platform_mass: float = 0.0,
    carriage_mass: float = 0.0,
    name: str = "three_prr",
) -> Robot:
    """Return a platform that three slides move in the plane: on each a carriage, a hinge, a rod, a hinge.

    base_radius: how far the slides run from the middle, each across the directions of 90, 210 and 330 degrees [m].
    platform_radius: circle of the platform's hinges, in the same directions; at home the platform stands in the
        middle, unturned [m]. rod: length [m]. A carriage stands at home where its rod reaches it, to the right of its
        hinge as seen from the middle; its slide's value is how much farther left it is.
    stroke: of a slide, to either side of home [m]; by default a third of the rod.
    drive_stiffness: along each slide [N/m].
    rod_diameter, youngs_modulus, density: round bars that stretch, bend and twist. carriage_mass: each [kg].

    In the plane a rod carries force along itself alone, so K = sum of s_i s_i^T / c_i with the rods' unit lines s_i
    about the tool and c_i = (u_i . a_i)^2/drive_stiffness + rod/(E A), a_i the direction of the slide.
    Raises InputError where the rods do not reach.
    """
    in_metres(base_radius=base_radius, platform_radius=platform_radius, rod=rod)
    reach = rod / 3 if stroke is None else stroke
    in_metres(stroke=reach)
    positive(drive_stiffness=drive_stiffness, youngs_modulus=youngs_modulus)
    thinner(rod, rod_diameter=rod_diameter)
    across = abs(base_radius - platform_radius)
    if not across < rod:
        raise InputError(
            f"rod = {rod:g} m does not reach at home: the platform's hinges are {across:.6g} m from the slides; "
            f"expected more than that"
        )
    beside = np.sqrt(rod**2 - across**2)
    file = UrdfFile(
        name,
        """
A planar 3-PRR: three driven slides on the base, a rod each, a platform between the rods. All hinges are about z.
Drawn at home, where all joints are at zero and all links have the base's axes.
""",
    )
    file.link("base")
    mass = bar_mass(rod, rod_diameter, density)
    seats: list[Array] = []
    for leg, angle in enumerate(np.radians([90.0, 210.0, 330.0]), 1):
        outwards, left = np.array([np.cos(angle), np.sin(angle), 0.0]), np.array([-np.sin(angle), np.cos(angle), 0.0])
        start, seat = base_radius * outwards - beside * left, platform_radius * outwards
        line = seat - start
        file.comment(f"leg {leg}: the carriage slides on the base, the rod turns on the carriage")
        file.link(f"leg{leg}_carriage", carriage_mass, shape=disc(carriage_mass, rod_diameter))
        limits = (-reach, reach)
        file.joint(f"leg{leg}_slide", "prismatic", "base", f"leg{leg}_carriage", start, axis=left, limits=limits)
        file.link(f"leg{leg}_rod", mass, line / 2, round_bar(mass, line, rod_diameter))
        file.joint(f"leg{leg}_hinge", "revolute", f"leg{leg}_carriage", f"leg{leg}_rod")
        file.frame(f"leg{leg}_rod_end", f"leg{leg}_rod", line)
        if leg == 1:
            file.link("platform", platform_mass, -seat, disc(platform_mass, platform_radius))
            file.joint("leg1_seat", "revolute", "leg1_rod", "platform", line)
        else:
            file.frame(f"leg{leg}_seat", "platform", seat - seats[0])
        seats.append(seat)
    closed_on_leg_1(file, seats[0], "slide")
    for leg in (1, 2, 3):
        file.spring(f"leg{leg}/drive", f"leg{leg}_slide", drive_stiffness, "N/m")
        file.bar(f"leg{leg}/rod", f"leg{leg}_hinge", f"leg{leg}_carriage", f"leg{leg}_rod_end", rod_diameter,
                 youngs_modulus)  # fmt: skip
    return file.robot()
