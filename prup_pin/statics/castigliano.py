"""Castigliano's theorem: loads and compliances of all modules at a pose, self-stress included.

With s_m = J_m w the loads of module m and Lambda_m its compliance, the strain energy is U = 1/2 sum s_m^T Lambda_m s_m,
and the deflection of the tool is dU/dw = (sum J_m^T Lambda_m J_m) w = C w (Eqs. 17-26). Overconstrained mechanisms
carry self-stress besides; by the principle of least complementary energy it takes the value that minimises U.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import PrupPinError, UnreachablePoseError
from ..kinematics import ClosedPose
from ..modules import ModuleGeometry
from ..spatial import Array
from .wrench_jacobians import (
    StaticsLayout,
    loads_at_frame,
    module_loads,
    self_stress_wrenches,
    transmitted_wrenches,
)

__all__ = ["Statics", "solve_statics"]

_LOAD_ITERATIONS = 50


@dataclass(frozen=True)
class Statics:
    """The solved statics of a pose: loads and compliances of all modules, wrench modules and drive modules apart.

    jacobians: (n, 6, 6) and (m, 1, 6), compatible where the mechanism is overconstrained; lambdas: (n, 6, 6) and
    (m, 1, 1); stress: module loads per unit self-stress, or None; frames: (n, 4, 4), base_from_module.
    """

    layout: StaticsLayout
    pose: ClosedPose
    frames: Array
    geometries: list[ModuleGeometry]
    jacobians: tuple[Array, Array]
    lambdas: tuple[Array, Array]
    stress: tuple[Array, Array] | None

    def displacement(self, strains, frame: str | None) -> Array:
        """Return the displacement (6,) of the tool, or of a named frame, when modules deform by `strains`.

        By virtual work, sum J_m^T e_m with the loads J_m of unit wrenches on that frame.
        """
        virtual = self.jacobians
        if frame is not None:
            loads = loads_at_frame(self.pose, self.pose.mechanism.frame(frame))
            transmitted = transmitted_wrenches(self.layout, self.pose, loads)
            virtual = module_loads(self.layout, self.pose, self.frames, transmitted)
            if self.stress is not None:
                virtual = _least_energy(virtual, self.stress, self.lambdas)
        return sum(
            (np.swapaxes(jacobian, -1, -2) @ strain[..., None])[..., 0].sum(axis=0)
            for jacobian, strain in zip(virtual, strains, strict=True)
        )


def solve_statics(layout: StaticsLayout, pose: ClosedPose, load: Array | None = None) -> Statics:
    """Return the statics of a pose; with `load` (6,) nonlinear modules are taken at that wrench.

    Raises PrupPinError where no module is compliant, UnreachablePoseError where a module's equation does not hold.
    """
    mechanism = layout.mechanism
    if not mechanism.modules:
        raise PrupPinError(
            f"'{mechanism.name}' has no compliant module: give joint stiffnesses, "
            "load(..., joint_stiffness=1e4) [N m/rad, N/m], or describe modules in a <prup_pin> element of the robot file"
        )
    frames = layout.frames(pose)
    transmitted = transmitted_wrenches(layout, pose, loads_at_frame(pose, mechanism.tool))
    jacobians = module_loads(layout, pose, frames, transmitted)
    geometries = layout.geometries(pose, frames)
    _refuse_impossible(layout, pose, geometries)
    stress = None
    if pose.balance.self_stress.shape[-1]:
        stress = module_loads(layout, pose, frames, self_stress_wrenches(layout, pose))
    nonlinear = load is not None and any(group.kind.nonlinear for group in layout.groups)
    compatible, loads = jacobians, None
    for _ in range(_LOAD_ITERATIONS):
        lambdas = _lambdas(layout, geometries, loads)
        if stress is not None:
            compatible = _least_energy(jacobians, stress, lambdas)
        if not nonlinear:
            break
        previous, loads = loads, [jacobian @ load for jacobian in compatible]
        if previous is not None and all(
            np.allclose(a, b, rtol=1e-12, atol=1e-12) for a, b in zip(previous, loads, strict=True)
        ):
            break
    else:
        raise PrupPinError(
            f"the loads of nonlinear modules did not settle in {_LOAD_ITERATIONS} rounds at this wrench; try a smaller load"
        )
    return Statics(layout, pose, frames, geometries, compatible, lambdas, stress)


def _refuse_impossible(layout: StaticsLayout, pose: ClosedPose, geometries: list[ModuleGeometry]) -> None:
    """Raise UnreachablePoseError where a module's equation does not hold, such as a nut beyond its screw."""
    for group, at in zip(layout.groups, geometries, strict=True):
        bad = group.kind.problems(group.values, at)
        if bad is not None and bad.any():
            index = int(np.argmax(bad))
            text = group.kind.problem_text(group.values, at, index)
            raise UnreachablePoseError(f"module '{group.modules[index].name}' at this pose: {text}", pose.coordinates)


def _lambdas(layout: StaticsLayout, geometries, loads) -> tuple[Array, Array]:
    """Return the stacked module compliances, (n, 6, 6) and (m, 1, 1), at the modules' loads (None: at rest)."""
    count = len(layout.wrench_groups)
    blocks = []
    for index, (group, at) in enumerate(zip(layout.groups, geometries, strict=True)):
        block = layout.constant_compliances[index]
        if block is None:
            load = None if loads is None else loads[int(index >= count)][group.slots]
            block = group.kind.compliance(group.values, at, load)
        blocks.append(block)
    return (
        np.concatenate(blocks[:count]) if count else np.zeros((0, 6, 6)),
        np.concatenate(blocks[count:]) if len(blocks) > count else np.zeros((0, 1, 1)),
    )


def _least_energy(jacobians, stress, lambdas) -> tuple[Array, Array]:
    """Return the wrench Jacobians with the self-stress of least complementary energy added.

    Minimising 1/2 sum (J w + B x)^T Lambda (J w + B x) over x gives x = -D^+ (sum B^T Lambda J) w, D = sum B^T Lambda B.
    Self-stress that only rigid modules carry has no energy: it stays undetermined, and C does not depend on it.
    """
    d, g = 0.0, 0.0
    for jacobian, unit, lam in zip(jacobians, stress, lambdas, strict=True):
        weighted = np.swapaxes(unit, -1, -2) @ lam
        d = d + (weighted @ unit).sum(axis=-3)
        g = g + (weighted @ jacobian).sum(axis=-3)
    diagonal = np.diagonal(d)
    scale = 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    x = -scale[:, None] * (np.linalg.pinv(d * scale[:, None] * scale, rcond=1e-11, hermitian=True) @ (scale[:, None] * g))
    return tuple(jacobian + unit @ x for jacobian, unit in zip(jacobians, stress, strict=True))
