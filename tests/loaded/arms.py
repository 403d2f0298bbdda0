"""Small machines with textbook answers, and differences to hold derivatives against: what these tests share."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import prup_pin
from prup_pin.loaded import Conditions, Equilibria, find_equilibria
from prup_pin.spatial import rotation_log

from ..statics.build import RobotFile

E, G, LENGTH = 201e9, 77e9, 0.7
SECOND_MOMENT = np.pi / 64 * 0.01**4
EI = E * SECOND_MOMENT
#: A thin rod that does not stretch.
SLENDER: dict[str, Any] = {"area": 1e10, "second_moment": SECOND_MOMENT, "youngs_modulus": E, "shear_modulus": G}
#: What holds the arm may be described from either end, and be loaded through a joint at either end.
DESCRIPTIONS = [(at, root) for at in ("wall", "end") for root in ("wall", "end")]


def cantilever(
    folder: Path, values: dict | None = None, kind: str = "beam", loaded_at: str = "wall", root: str = "wall"
) -> tuple[prup_pin.Robot, prup_pin.ClosedPose]:
    """An arm along x, clamped at the origin."""
    file = RobotFile((0, 0, -9.81))
    file.link("arm", mass=3.0, centre=(0.3, 0, 0) if loaded_at == "wall" else (0.3 - LENGTH, 0, 0))
    file.link("end")
    ends = file.between_holds("base", LENGTH, loaded_at, root)
    file.module("beam", kind, "hold", values or SLENDER, **ends)
    robot = file.load(folder, "end")
    return robot, robot.pose_from_actuators([0.0, 0.0])


def single_module(folder: Path, kind: str, values: dict) -> tuple[prup_pin.Robot, prup_pin.ClosedPose]:
    """One module between the ground and a lever, askew; drives act along a slide."""
    file = RobotFile((1.0, -2.0, -9.0))
    file.link("arm", mass=2.0, centre=(0.1, -0.05, 0.2))
    file.link("end", mass=1.0, centre=(0.0, 0.05, 0.0))
    file.held("hold", "base", "arm", (0.1, -0.2, 0.3), (0.3, 0.5, -0.8))
    file.held("rest", "arm", "end", (0.2, 0.1, 0.5), (0.2, -0.1, 0.4))
    file.frame("foot", "base", (0.1, -0.2, 0.3), (0.3, 0.5, -0.8))
    file.frame("flange", "arm", (0.0, 0.0, 0.45))
    instance = prup_pin.modules.KINDS[[each.kind for each in prup_pin.modules.KINDS].index(kind)]
    if instance.spans_frames:
        file.module("part", kind, "hold", values, root="foot", tip="flange")
    elif isinstance(instance, prup_pin.modules.DriveModule):
        file.module("part", kind, "hold", values)
    else:
        file.module("part", kind, "hold", values, frame="flange", axis=(0.2, -0.3, 1.0))
    robot = file.load(folder, "end")
    return robot, robot.pose_from_actuators([0.2, 0.0])


def rod_through_a_collar(folder: Path, root: str) -> tuple[prup_pin.Robot, prup_pin.ClosedPose]:
    """A rod that slides freely through a hinged collar; its end is pinned to a driven carriage.

    The beam lies between the collar's mouth and the rod's end, with a clamp that tilts at its `root`, one of the two.
    """
    file = RobotFile((0, -9.81, 0))
    file.link("carriage", mass=1.0, centre=(0.1, 0.1, 0))
    file.link("collar")
    file.link("rod", mass=0.5, centre=(-0.2, 0, 0))
    file.held("drive", "base", "carriage", axis=(0, 1, 0))
    file.module("spring", "joint_spring", "drive", {"stiffness": 40e3})
    file.frame("pin", "carriage", (0.3, 0.2, 0))
    file.joint("hinge", "revolute", "base", "collar", (-0.2, 0.2, 0))
    file.joint("slide", "prismatic", "collar", "rod", (0.5, 0, 0), axis=(1, 0, 0))
    file.frame("mouth", "collar", (0.15, 0, 0))
    file.frame("rod_end", "rod")
    file.frame("tool", "rod", (0.05, 0.1, 0.1))
    values = {"diameter": 0.012, "youngs_modulus": E, "shear_modulus": G, "root_tilting_stiffness": 500.0}
    ends = {"root": "mouth", "tip": "rod_end"} if root == "collar" else {"root": "rod_end", "tip": "mouth"}
    file.module("beam", "beam", "slide", values, **ends)
    file.loop("pin", "pin", "rod_end", free="rz")
    robot = file.load(folder, "tool")
    return robot, robot.pose_from_actuators([0.0])


def difference_compliance(robot: prup_pin.Robot, pose, wrench, steps=(1.0, 0.1), **weight) -> np.ndarray:
    """Return d(translation, spin)/d(wrench) (6, 6) by central differences of fourth order."""
    chain = robot._chain
    sizes = np.repeat(steps, 3)
    offsets = np.concatenate([factor * np.diag(sizes) for factor in (-2, -1, 1, 2)])
    found = find_equilibria(chain, [pose], np.zeros(24, int), Conditions(np.asarray(wrench, float) + offsets, **weight))
    assert found.converged.all()
    middle = find_equilibria(chain, [pose], np.zeros(1, int), Conditions(np.asarray(wrench, float)[None], **weight))
    moved = np.concatenate(
        (
            found.tool[:, :3, 3] - middle.tool[0, :3, 3],
            rotation_log(found.tool[:, :3, :3] @ middle.tool[0, :3, :3].T),
        ),
        axis=1,
    ).reshape(4, 6, 6)
    slope = (moved[0] - 8 * moved[1] + 8 * moved[2] - moved[3]) / 12
    return (slope / sizes[:, None]).T


def difference_matrix(found: Equilibria, step: float = 1e-5) -> np.ndarray:
    """Return d(residual)/d(unknowns) (m, m) of the first sample by central differences of fourth order."""
    chain, count = found.chain, found.evaluation.residual.shape[1]
    sizes = np.full(count, step)
    sizes[count - chain.structure.closure_count :] = 1e-2  # forces
    change = np.concatenate([factor * np.diag(sizes) for factor in (-2, -1, 1, 2)])
    rows = np.zeros(4 * count, int)
    state = chain.step(found.state.take(rows), change)
    residual = chain.evaluate(found.rigid.take(rows), state, found.conditions.take(rows)).residual
    at = residual.reshape(4, count, count)
    return ((at[0] - 8 * at[1] + 8 * at[2] - at[3]) / 12 / sizes[:, None]).T


def scaled_error(value: np.ndarray, expected: np.ndarray, length: float = 0.3) -> float:
    """Largest difference of two compliances as a share of the largest entry, rotations as arcs of `length` [m]."""
    scale = np.repeat([1.0, length], 3)
    both = np.outer(scale, scale)
    return float(np.abs((value - expected) * both).max() / np.abs(expected * both).max())
