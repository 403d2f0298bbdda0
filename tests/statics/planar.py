"""A planar 3-RPR: hinges on the base, driven slides, hinges on the platform; its statics by plane geometry alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import prup_pin

from .build import words

ANGLES = np.radians([90.0, 210.0, 330.0])
CIRCLE = np.stack((np.cos(ANGLES), np.sin(ANGLES), 0 * ANGLES), axis=-1)
BASE, PLATFORM, STIFFNESS = 0.5, 0.1, (1e6, 1.5e6, 2e6)


def seats(x: float, y: float, phi: float) -> np.ndarray:
    """Return the platform's hinges, (3, 3)."""
    c, s = np.cos(phi), np.sin(phi)
    return PLATFORM * CIRCLE @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + [x, y, 0]


def three_rpr(folder: Path, turned: float = 0.0) -> prup_pin.Robot:
    """Return the robot whose platform stands in the middle at home, `turned` [rad]; unturned its legs are radial."""
    tree, extension = ['<link name="base"/>'], []

    def joint(name, kind, parent, child, xyz, axis=(0, 0, 1)):
        limit = '<limit lower="-3" upper="3" effort="1" velocity="1"/>' if kind != "fixed" else ""
        tree.append(
            f'<link name="{child}"/><joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="{words(xyz)}"/><axis xyz="{words(axis)}"/>{limit}</joint>'
        )

    places = seats(0, 0, turned)
    for leg, (base, seat, stiffness) in enumerate(zip(BASE * CIRCLE, places, STIFFNESS, strict=True), 1):
        joint(f"turn{leg}", "revolute", "base", f"cylinder{leg}", base)
        joint(f"slide{leg}", "prismatic", f"cylinder{leg}", f"rod{leg}", seat - base, seat - base)
        extension.append(
            f'<module name="drive{leg}" type="joint_spring" joint="slide{leg}">'
            f'<parameter name="stiffness" value="{stiffness}"/></module>'
        )
        if leg == 1:
            joint("hinge", "revolute", "rod1", "platform", (0, 0, 0))
            joint("mount", "fixed", "platform", "tool", -seat)
        else:
            joint(f"seat{leg}_mount", "fixed", "platform", f"seat{leg}", seat - places[0])
            extension.append(f'<loop name="leg{leg}" frame1="seat{leg}" frame2="rod{leg}" free="rz"/>')
    path = folder / "three_rpr.urdf"
    path.write_text(
        f'<robot name="three_rpr">{"".join(tree)}<prup_pin version="1"><tool frame="tool"/>'
        '<actuated joints="slide1 slide2 slide3"/><home slide1="0" slide2="0" slide3="0"/><task_coordinates>'
        '<coordinate name="x" component="x"/><coordinate name="y" component="y"/>'
        f'<coordinate name="phi" component="rz"/></task_coordinates>{"".join(extension)}</prup_pin></robot>'
    )
    return prup_pin.load(path)


def stiffness_of_three_rpr(x: float, y: float, phi: float) -> np.ndarray:
    """Return J^-T K_j J^-1, (3, 3), rows and columns x, y, phi: J^-1 has the legs' lines about the tool in its rows."""
    there = seats(x, y, phi)
    lines = (there - BASE * CIRCLE) / np.linalg.norm(there - BASE * CIRCLE, axis=1, keepdims=True)
    inverse_jacobian = np.column_stack((lines[:, :2], np.cross(there - [x, y, 0], lines)[:, 2]))
    return inverse_jacobian.T @ np.diag(STIFFNESS) @ inverse_jacobian
