"""Prints the tables of docs/workspace.md: which boundary gives the upper ends of the paper's compliance error ranges.

As published, z = 0.3 m, wrenches up to 300 N and 100 N m: 4.47 to 15.72 mm, 1.85 to 4.75 degrees. A boundary of one
number is moved outwards until the largest translation is 15.72 mm; does the largest turn come to 4.75 degrees there?
"""

from __future__ import annotations

import numpy as np
from _project import ROOT

import prup_pin

Z, FORCE, MOMENT = 0.3, 300.0, 100.0
UPPER = (15.72, 4.75)


def map_of(name: str, step: float, reach: float = 50.0):
    """Return theta and phi [deg], translation [mm] and turn [deg] at worst, and the joints, over a grid."""
    robot = prup_pin.load(name)
    degrees = np.arange(-reach, reach + step / 2, step)
    axis = np.radians(degrees)
    found = robot.sweep(z=Z, theta=axis, phi=axis, force=FORCE, moment=MOMENT, quantities=["extremes", "joints"])
    theta, phi = np.meshgrid(degrees, degrees, indexing="ij")
    extremes = found["extremes"] * [1e3, np.degrees(1)]
    names = [joint.name for joint in robot.mechanism.joints if joint.nv == 1]
    joints = {name: found["joints"][..., column] for column, name in enumerate(names)}
    return theta, phi, extremes[..., 0], extremes[..., 1], joints


def boundaries(theta, phi, joints):
    """Return natural measures of how far out a pose is: inside are those where it is small enough."""

    def of(ending):
        return np.stack([values for name, values in joints.items() if name.endswith(ending)], axis=-1)

    slides, branches = 1e3 * of("_slide"), 1e3 * of("_branch")
    angles = {name: np.degrees(np.abs(of(name))).max(axis=-1) for name in ("_R_phi", "_R_theta", "_R_lambda")}
    upright = np.cos(np.radians(theta)) * np.cos(np.radians(phi))
    return {
        "circle in θ, φ [deg]": np.hypot(theta, phi),
        "square in θ, φ [deg]": np.maximum(np.abs(theta), np.abs(phi)),
        "diamond in θ, φ [deg]": np.abs(theta) + np.abs(phi),
        "tilt of the star [deg]": np.degrees(np.arccos(np.clip(upright, -1, 1))),
        "longest slide, q [mm]": slides.max(axis=-1),
        "travel of the slides from z [mm]": np.abs(slides - 1e3 * Z).max(axis=-1),
        "difference of the slides [mm]": np.ptp(slides, axis=-1),
        "longest branch, b [mm]": branches.max(axis=-1),
        "largest φ_i, either way [deg]": angles["_R_phi"],
        "largest θ_i, either way [deg]": angles["_R_theta"],
        "largest λ_i, either way [deg]": angles["_R_lambda"],
    }


def first(measure, values, limit):
    """Return the measure at which the largest value inside first reaches a limit."""
    order = np.argsort(measure, kind="stable")
    return measure[order][int(np.argmax(np.maximum.accumulate(values[order]) >= limit))]


def table(step: float) -> list[str]:
    theta, phi, shift, turn, joints = map_of("3prup_as_published", step)
    good = np.isfinite(shift)
    lines = [
        f"| boundary, grid of {step:g}° | where 15.72 mm | turn there | where 4.75° | translation there |",
        "|---|---|---|---|---|",
    ]
    for name, measure in boundaries(theta, phi, joints).items():
        at = [
            first(measure[good], values[good], np.round(limit, 2) - 0.005)
            for values, limit in ((shift, UPPER[0]), (turn, UPPER[1]))
        ]
        there = [good & (measure <= end + 1e-9) for end in at]
        lines.append(
            f"| {name} | {at[0]:.4g} | {turn[there[0]].max():.2f}° | {at[1]:.4g} | {shift[there[1]].max():.2f} mm |"
        )
    return lines


def ends(name: str, step: float, longest: float = 0.5):
    """Return the ends of both ranges where no slide stands beyond `longest` [m]."""
    _, _, shift, turn, joints = map_of(name, step)
    slides = np.stack([values for joint, values in joints.items() if joint.endswith("_slide")], axis=-1)
    inside = np.isfinite(shift) & (slides.max(axis=-1) <= longest)
    return (shift[inside].min(), shift[inside].max()), (turn[inside].min(), turn[inside].max())


if __name__ == "__main__":
    assert (ROOT / "docs").is_dir()
    for step in (5.0, 0.5):
        print("\n".join(table(step)), end="\n\n")
    print("| slides up to 0.5 m | translation [mm] | turn [deg] |\n|---|---|---|")
    for name, step in (("3prup_as_published", 5.0), ("3prup", 5.0), ("3prup_as_published", 0.5), ("3prup", 0.5)):
        (a, b), (c, d) = ends(name, step)
        print(f"| {name}, grid of {step:g}° | {a:.2f} to {b:.2f} | {c:.2f} to {d:.2f} |")
