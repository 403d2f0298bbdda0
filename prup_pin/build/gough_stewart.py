"""The 6-UPS platform of Gough and Stewart."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..errors import InputError
from ..robot import Robot
from ..spatial import Array
from .urdf_file import STEEL_MODULUS, UrdfFile, disc, in_metres, positive, round_bar, thinner

LEGS = range(1, 7)
#: How much longer a leg is than it is thick where nothing says so.
_SLENDER = 20


def stewart(
    *,
    base_radius: float,
    platform_radius: float,
    height: float,
    drive_stiffness: float | Sequence[float],
    base_spread: float = math.radians(20),
    platform_spread: float = math.radians(20),
    stroke: float | None = None,
    leg_diameter: float | None = None,
    youngs_modulus: float = STEEL_MODULUS,
    platform_mass: float = 0.0,
    cylinder_mass: float = 0.0,
    cylinder_centre: float | None = None,
    rod_mass: float = 0.0,
    rod_centre: float | None = None,
    name: str = "stewart",
) -> Robot:
    """Return a platform on six legs: a universal joint on the base, a driven slide, a ball joint at the platform.

    base_radius, platform_radius, height: circles of the joints, and how far the platform's stands above the base's at
        home [m]. The base's joints stand in pairs about 0, 120 and 240 degrees, the platform's about 60, 180 and 300.
    base_spread, platform_spread: angle between the two joints of a pair [rad].
    drive_stiffness: of a leg along itself, one number or six [N/m].
    leg_diameter, youngs_modulus: if given, each leg also stretches as a round bar from joint to joint.
    stroke: how far a leg can get longer or shorter from home [m]; a third of its length where not given.
    platform_mass: centred at the tool [kg]. cylinder_mass, rod_mass: of a leg's two parts [kg], their centres so far
        from the base's joint and from the platform's [m]; a quarter of the leg where not given. Their inertias are
        those of uniform bars of half the leg.

    Legs carry force along themselves alone, so K = sum of k_i s_i s_i^T with the legs' unit lines s_i about the tool,
    and 1/k_i = 1/drive_stiffness + length/(E A). Raises InputError for sizes that are not positive.
    """
    in_metres(base_radius=base_radius, platform_radius=platform_radius, height=height)
    positive(youngs_modulus=youngs_modulus)
    stiffness = np.ravel(np.asarray(drive_stiffness, float))
    if len(stiffness) not in (1, 6):
        raise InputError(f"drive_stiffness has {len(stiffness)} numbers; expected one, or one for each of six legs")
    for value in stiffness:
        positive(drive_stiffness=float(value))
    stiffness = np.broadcast_to(stiffness, 6)
    base = _pairs(base_radius, base_spread, 0.0)
    # Each leg goes to the next pair's nearer joint: 1 and 2 cross to either side of the base's first pair.
    seats = np.roll(_pairs(platform_radius, platform_spread, np.pi / 3), 1, axis=0)
    legs = seats - base + np.array([0.0, 0.0, height])
    lengths = np.linalg.norm(legs, axis=1)
    reach = float(lengths.min() / 3 if stroke is None else stroke)
    in_metres(stroke=reach)
    if leg_diameter is not None:
        thinner(float(lengths.min()), leg_diameter=leg_diameter)

    file = UrdfFile(
        name,
        f"""
A 6-UPS platform (Gough, Stewart): universal joints on the base, driven slides, ball joints at the platform.
Drawn at home, where all joints are at zero: a slide's value is how much its leg is longer than
{np.array2string(lengths, precision=6, separator=", ")} m. Links have the base's axes at home.
""",
    )
    file.link("base")
    for leg, at, line, length in zip(LEGS, base, legs, lengths, strict=True):
        along = line / length
        across = np.cross([0.0, 0.0, 1.0], along)
        across /= np.linalg.norm(across)
        file.comment(f"leg {leg}: two turns of the universal joint, then the slide along the leg")
        file.link(f"leg{leg}_yoke")
        file.joint(f"leg{leg}_u1", "revolute", "base", f"leg{leg}_yoke", at, axis=across)
        near = length / 4 if cylinder_centre is None else cylinder_centre
        far = length / 4 if rod_centre is None else rod_centre
        thick = length / _SLENDER if leg_diameter is None else leg_diameter
        file.link(f"leg{leg}_cylinder", cylinder_mass, near * along, round_bar(cylinder_mass, line / 2, thick))
        file.joint(f"leg{leg}_u2", "revolute", f"leg{leg}_yoke", f"leg{leg}_cylinder", axis=np.cross(along, across))
        file.link(f"leg{leg}_rod", rod_mass, -far * along, round_bar(rod_mass, line / 2, thick))
        file.joint(
            f"leg{leg}_slide",
            "prismatic",
            f"leg{leg}_cylinder",
            f"leg{leg}_rod",
            line,
            axis=along,
            limits=(-reach, reach),
        )
        if leg == 1:
            _ball_joint(file, "leg1", "leg1_rod", "leg1_ball")
            file.link("platform", platform_mass, -seats[0], disc(platform_mass, platform_radius))
            file.joint("platform", "fixed", "leg1_ball", "platform")
        else:
            file.frame(f"leg{leg}_seat", "platform", seats[leg - 1] - seats[0])
    file.comment("the platform's centre, in the plane of its ball joints")
    file.frame("tool", "platform", -seats[0])

    slides = [f"leg{leg}_slide" for leg in LEGS]
    file.tool("tool", "platform", slides, {axis: axis for axis in ("x", "y", "z", "rx", "ry", "rz")})
    file.comment("legs 2 to 6 end in ball joints at the platform that leg 1 carries", "extension")
    for leg in LEGS[1:]:
        file.loop(f"leg{leg}", f"leg{leg}_seat", f"leg{leg}_rod", "rx ry rz")
    for leg, value in zip(LEGS, stiffness, strict=True):
        file.spring(f"leg{leg}/drive", f"leg{leg}_slide", value, "N/m")
        if leg_diameter is not None:
            file.bar(f"leg{leg}/bar", f"leg{leg}_slide", f"leg{leg}_cylinder", f"leg{leg}_rod", leg_diameter,
                     youngs_modulus)  # fmt: skip
    return file.robot()


def _pairs(radius: float, spread: float, first: float) -> Array:
    """Return six points on a circle, in pairs a third of a turn apart, (6, 3)."""
    angles = first + np.repeat(np.arange(3) * 2 * np.pi / 3, 2) + np.tile([-spread / 2, spread / 2], 3)
    return radius * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=-1)


def _ball_joint(file: UrdfFile, name: str, parent: str, child: str) -> None:
    """Add three turns about one point."""
    for axis in "xyz":
        link = child if axis == "z" else f"{name}_s{axis}"
        file.link(link)
        file.joint(f"{name}_ball_{axis}", "revolute", parent, link, axis=[float(axis == a) for a in "xyz"])
        parent = link
