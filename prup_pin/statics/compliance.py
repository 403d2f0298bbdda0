"""Castigliano's assembly: C and K of the mechanism, and the part of every module.

With s_m = J_m w the loads of module m and Lambda_m its compliance, the strain energy is U = 1/2 sum s_m^T Lambda_m s_m,
and the deflection of the tool is dU/dw = (sum J_m^T Lambda_m J_m) w = C w (Eqs. 17-26). Overconstrained mechanisms
carry self-stress besides; by the principle of least complementary energy it takes the value that minimises U.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property

import numpy as np

from ..errors import InputError, NoStiffnessError, PrupPinError, UnknownNameError, UnreachablePoseError
from ..kinematics import ClosedPose
from ..modules import ModuleGeometry
from ..spatial import WRENCH_NAMES, Array, as_wrench
from .weight import weight_strains
from .wrench_jacobians import (
    StaticsLayout,
    loads_at_frame,
    module_loads,
    self_stress_wrenches,
    transmitted_wrenches,
)

__all__ = ["Compliance", "assemble"]

#: Directions softer than this share of the softest one count as rigid.
RIGID = 1e-12


class _Named(Mapping):
    """Read-only view of stacked arrays by module name."""

    def __init__(self, names: tuple[str, ...], get):
        self._index = {name: index for index, name in enumerate(names)}
        self._get = get

    def __getitem__(self, name: str) -> Array:
        try:
            index = self._index[name]
        except KeyError:
            raise UnknownNameError("module", name, list(self._index)) from None
        return self._get(index)

    def __contains__(self, name: object) -> bool:
        return name in self._index

    def __iter__(self) -> Iterator[str]:
        return iter(self._index)

    def __len__(self) -> int:
        return len(self._index)


class Compliance:
    """C, K and their parts at one pose.

    All matrices are at the tool point in base axes, SI, (force, moment) -> (translation, rotation).
    """

    def __init__(self, layout, pose: ClosedPose, length: float, jacobians, stress, lambdas, geometries, load: Array | None):
        self.pose = pose
        self.load = load
        self._layout: StaticsLayout = layout
        self._length = length
        self._wrench_jacobians, self._drive_jacobians = jacobians
        self._stress = stress
        self._lambdas = lambdas
        self._wrench_lambdas, self._drive_lambdas = lambdas
        self._geometries: list[ModuleGeometry] = geometries
        wrench = np.swapaxes(self._wrench_jacobians, -1, -2) @ (self._wrench_lambdas @ self._wrench_jacobians)
        drive = np.swapaxes(self._drive_jacobians, -1, -2) @ (self._drive_lambdas @ self._drive_jacobians)
        self._parts = np.concatenate((wrench, drive))
        c = self._parts.sum(axis=0)
        self.C: Array = (c + c.T) / 2
        for array in (self._parts, self.C, self._wrench_jacobians, self._drive_jacobians):
            array.flags.writeable = False

    # -- the whole -----------------------------------------------------------------------------------------------

    @cached_property
    def _spectrum(self) -> tuple[Array, Array, Array]:
        """Eigenvalues and vectors of the dimensionless C, and the scaling."""
        scale = np.array([1.0, 1.0, 1.0, self._length, self._length, self._length])
        values, vectors = np.linalg.eigh(self.C * scale[:, None] * scale)
        return values, vectors, scale

    @cached_property
    def rigid_directions(self) -> Array:
        """Wrenches that deflect nothing, (n, 6), each scaled to a largest component of 1; n = 0 where K exists."""
        values, vectors, scale = self._spectrum
        rigid = values <= RIGID * max(values.max(), 0.0)
        directions = (vectors[:, rigid] * scale[:, None]).T
        return directions / np.abs(directions).max(axis=1, keepdims=True) if rigid.any() else np.zeros((0, 6))

    @cached_property
    def K(self) -> Array:  # noqa: N802 - the field's symbol
        """Stiffness, (6, 6). Raises NoStiffnessError where some directions are rigid."""
        values, vectors, scale = self._spectrum
        if values[0] <= RIGID * values[-1]:
            rigid = self.rigid_directions
            listed = "; ".join(_direction(direction) for direction in rigid)
            raise NoStiffnessError(
                f"no K: these {len(rigid)} of 6 directions are rigid (no module yields to them): {listed}. "
                "C is complete; give a compliance to more joints or bodies if these directions should yield",
                rigid,
            )
        k = np.linalg.inv(self.C * scale[:, None] * scale) * scale[:, None] * scale
        k = (k + k.T) / 2
        k.flags.writeable = False
        return k

    def deflection(self, wrench, frame: str | None = None) -> Array:
        """Return the deflection (6,) [m, rad] of the tool, or of any named frame, under a wrench (6,) on the tool.

        The deflection of another frame is that of a point fixed to its body, base axes, by Castigliano's dummy load.
        """
        w = as_wrench(wrench)
        if frame is None:
            return self.C @ w
        return self._displacement(frame, [(lam @ (jac @ w)[..., None])[..., 0] for lam, jac in self._lambdas_and_jacobians()])

    def _lambdas_and_jacobians(self):
        return ((self._wrench_lambdas, self._wrench_jacobians), (self._drive_lambdas, self._drive_jacobians))

    def _displacement(self, frame: str | None, strains) -> Array:
        """Return the displacement (6,) of the tool or a frame when modules deform by `strains`: sum J_m^T e_m."""
        if frame is None:
            virtual = (self._wrench_jacobians, self._drive_jacobians)
        else:
            found = self.pose.mechanism.frame(frame)
            loads = loads_at_frame(self.pose, found.joint, found.placement)
            virtual = module_loads(self._layout, self.pose, transmitted_wrenches(self._layout, self.pose, loads))
            if self._stress is not None:
                virtual = _least_energy(virtual, self._stress, (self._wrench_lambdas, self._drive_lambdas))
        return sum(np.einsum("nkc,nk->c", jacobian, strain) for jacobian, strain in zip(virtual, strains, strict=True))

    # -- the parts -----------------------------------------------------------------------------------------------

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the modules, in the order of the robot file."""
        return tuple(module.name for module in self.pose.mechanism.modules)

    @property
    def _stacked_names(self) -> tuple[str, ...]:
        return self._layout.wrench_names + self._layout.drive_names

    @cached_property
    def parts(self) -> Mapping[str, Array]:
        """Compliance J_m^T Lambda_m J_m of each module, (6, 6); they sum to C."""
        return _Named(self._stacked_names, self._parts.__getitem__)

    @cached_property
    def wrench_jacobians(self) -> Mapping[str, Array]:
        """WCMJ of each module, (k, 6): loads in the module's own frame per unit wrench on the tool."""
        count = len(self._wrench_jacobians)
        return _Named(
            self._stacked_names,
            lambda i: self._wrench_jacobians[i] if i < count else self._drive_jacobians[i - count],
        )

    @cached_property
    def module_compliances(self) -> Mapping[str, Array]:
        """Lambda of each module, (k, k), in its own frame."""
        count = len(self._wrench_jacobians)
        return _Named(
            self._stacked_names, lambda i: self._wrench_lambdas[i] if i < count else self._drive_lambdas[i - count]
        )

    def _sum(self, wanted) -> Array:
        chosen = [name for module in self.pose.mechanism.modules if wanted(module) for name in (module.name,)]
        return sum((self.parts[name] for name in chosen), np.zeros((6, 6)))

    @cached_property
    def legs(self) -> dict[str, Array]:
        """Compliance of each leg (modules named '<leg>/…'), (6, 6)."""
        names = dict.fromkeys(module.leg for module in self.pose.mechanism.modules if module.leg)
        return {leg: self._sum(lambda module, leg=leg: module.leg == leg) for leg in names}

    @cached_property
    def bodies(self) -> Array:
        """Compliance of all bodies: rods, branches and screw shafts (Eq. 18), (6, 6)."""
        return self._sum(lambda module: module.kind.is_body)

    @cached_property
    def joints(self) -> Array:
        """Compliance of all joints and drives (Eq. 18), (6, 6)."""
        return self._sum(lambda module: not module.kind.is_body)

    def shares(self, wrench=None, direction=None) -> dict[str, float]:
        """Return each module's share of a deflection, summing to 1, in the order of the robot file.

        `wrench` alone: shares of the work w^T C w. `direction` alone (6,): of the compliance d^T C d along it. Both: of
        the deflection d^T C w along `direction` under `wrench`; single shares can then be negative.
        """
        if wrench is None and direction is None:
            raise InputError("shares need a wrench, a direction, or both; for example shares([0, 0, -300, 0, 0, 0])")
        w = as_wrench(wrench if wrench is not None else direction, "wrench" if wrench is not None else "direction")
        d = as_wrench(direction, "direction") if direction is not None else w
        total = float(d @ self.C @ w)
        size = np.sqrt(max(float(d @ self.C @ d), 0.0) * max(float(w @ self.C @ w), 0.0))
        if abs(total) <= 1e-12 * size or size == 0:
            raise InputError("this load deflects nothing along this direction; shares of zero have no meaning")
        return {name: float(d @ self.parts[name] @ w) / total for name in self.names}

    # -- weight ----------------------------------------------------------------------------------------------------

    def sag(self, frame: str | None = None) -> Array:
        """Return the deflection (6,) [m, rad] of the tool (or another frame) under the weight of all bodies.

        Weights of links act at their centres; a beam that names its body carries its weight as a continuous load.
        Small deflections; gravity is the robot file's.
        """
        return self._displacement(frame, weight_strains(self._layout, self.pose, self._geometries, self._lambdas))

    def __repr__(self) -> str:
        at = ", ".join(f"{name}={value:.4g}" for name, value in self.pose.coordinates.items())
        return f"<Compliance of {self.pose.mechanism.name} at {at or 'a pose'}: {len(self._parts)} modules>"


def _direction(vector: Array) -> str:
    """Return '+1 fx -0.5 my' of a wrench, small components left out."""
    return " ".join(
        f"{value:+.3g} {name}" for name, value in zip(WRENCH_NAMES, vector, strict=True) if abs(value) > 1e-6
    )


def assemble(layout: StaticsLayout, pose: ClosedPose, length: float, load: Array | None = None) -> Compliance:
    """Return the compliance at a pose; with `load` (6,) nonlinear modules are taken at that wrench.

    Raises PrupPinError where no module is compliant, UnreachablePoseError where a module's equation does not hold.
    """
    mechanism = layout.mechanism
    if not mechanism.modules:
        raise PrupPinError(
            f"'{mechanism.name}' has no compliant module: give joint stiffnesses, load(..., joint_stiffness=1e4) [N m/rad, N/m], "
            "or describe modules in a <prup_pin> element of the robot file"
        )
    tool = mechanism.tool
    transmitted = transmitted_wrenches(layout, pose, loads_at_frame(pose, tool.joint, tool.placement))
    jacobians = module_loads(layout, pose, transmitted)
    values = layout.joint_values(pose.q)
    groups = (*layout.wrench_groups, *layout.drive_groups)
    geometries = [group.geometry(pose.placements, values) for group in groups]
    for group, at in zip(groups, geometries, strict=True):
        bad = group.kind.problems(group.values, at)
        if bad is not None and bad.any():
            index = int(np.argmax(bad))
            raise UnreachablePoseError(
                f"module '{group.modules[index].name}' at this pose: {group.kind.problem_text(group.values, at, index)}",
                pose.coordinates,
            )
    redundant = pose.balance.self_stress.shape[-1] > 0
    stress = module_loads(layout, pose, self_stress_wrenches(layout, pose)) if redundant else None
    nonlinear = load is not None and any(group.kind.nonlinear for group in groups)
    loads = None
    for _ in range(50):
        lambdas = _lambdas(layout, geometries, loads)
        compatible = _least_energy(jacobians, stress, lambdas) if stress is not None else jacobians
        if not nonlinear:
            break
        previous, loads = loads, [jacobian @ load for jacobian in compatible]
        if previous is not None and all(np.allclose(a, b, rtol=1e-12, atol=1e-12) for a, b in zip(previous, loads, strict=True)):
            break
    return Compliance(layout, pose, length, compatible, stress, lambdas, geometries, load)


def _lambdas(layout: StaticsLayout, geometries, loads) -> tuple[Array, Array]:
    """Return the stacked module compliances, (n, 6, 6) and (m, 1, 1)."""
    count = len(layout.wrench_groups)
    stacked = []
    for index, (groups, size) in enumerate(((layout.wrench_groups, 6), (layout.drive_groups, 1))):
        blocks = [
            group.kind.compliance(group.values, at, None if loads is None else loads[index][group.slots])
            for group, at in zip(groups, geometries[:count] if index == 0 else geometries[count:], strict=True)
        ]
        stacked.append(np.concatenate(blocks, axis=-3) if blocks else np.zeros((0, size, size)))
    return stacked[0], stacked[1]


def _least_energy(jacobians, stress, lambdas) -> tuple[Array, Array]:
    """Return the wrench Jacobians with the self-stress of least complementary energy added.

    Minimising 1/2 sum (J w + B x)^T Lambda (J w + B x) over x gives x = -D^+ (sum B^T Lambda J) w, D = sum B^T Lambda B.
    Self-stress that only rigid modules carry has no energy: it stays undetermined, and C does not depend on it.
    """
    d = sum((np.swapaxes(b, -1, -2) @ lam @ b).sum(axis=-3) for b, lam in zip(stress, lambdas, strict=True))
    g = sum((np.swapaxes(b, -1, -2) @ lam @ j).sum(axis=-3) for b, lam, j in zip(stress, lambdas, jacobians, strict=True))
    scale = 1 / np.sqrt(np.where(np.diagonal(d) > 0, np.diagonal(d), 1.0))
    x = -scale[:, None] * (np.linalg.pinv(d * scale[:, None] * scale, rcond=1e-11, hermitian=True) @ (scale[:, None] * g))
    return tuple(j + b @ x for j, b in zip(jacobians, stress, strict=True))
