"""Castigliano's theorem: loads and compliances of all modules at a pose, self-stress included.

With s_m = J_m w the loads of module m and Lambda_m its compliance, the strain energy is U = 1/2 sum s_m^T Lambda_m s_m,
and the deflection of the tool is dU/dw = (sum J_m^T Lambda_m J_m) w = C w (Eqs. 17-26). Overconstrained mechanisms
carry self-stress besides; by the principle of least complementary energy it takes the value that minimises U.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import PrupPinError, UnreachablePoseError
from ..kernel import NEGLIGIBLE, ROUNDING_OF_LOADS, semidefinite_inverse
from ..kinematics import ClosedPose
from ..modules import ModuleGeometry
from ..spatial import Array, product, symmetric
from .wrench_jacobians import StaticsLayout, load_maps, loads_from_frame, self_stress_loads

_LOAD_ITERATIONS = 50


def _counting(loads: Array, self_stress: Array) -> Array:
    """Return loads (..., n, h) that span what closure forces (..., c, h) do to the modules.

    Combinations of those forces that load no module more than negligibly beside themselves are left out, whole; of all
    others every load counts, the smallest too, but rounding: where what is loaded is rigid it would be all that has
    energy.
    """
    size = np.abs(self_stress).max(axis=(-1, -2))[..., None]
    loads = np.where(np.abs(loads) > ROUNDING_OF_LOADS * size[..., None], loads, 0.0)
    u, values, _ = np.linalg.svd(loads, full_matrices=False)
    u = np.where(loads.any(axis=-1, keepdims=True), u, 0.0)
    return u * np.where(values > NEGLIGIBLE * size, values, 0.0)[..., None, :]


def _least_solution(matrix: Array, right: Array) -> Array:
    return semidefinite_inverse(matrix) @ right


class Energies(NamedTuple):
    """Two steps that compare sizes, for those who write equations down instead of computing them.

    `counting` leaves out what is small, see `_counting`; `solved` solves semidefinite systems (..., h, h) of energies.
    """

    counting: Callable[[Array, Array], Array] = _counting
    solved: Callable[[Array, Array], Array] = _least_solution


_COMPUTED = Energies()


class Statics(NamedTuple):
    """The solved statics of a pose: loads and compliances of all modules, wrench modules and drive modules apart.

    Of many poses, all but the layout has their leading axis; compliances that are the same at all of them need not.
    loads: (load rows, 6), compatible where the mechanism is overconstrained; jacobians, views of them: (n, 6, 6) and
    (m, 1, 6); varying: compliances of the layout's varying groups, (n, k, k) each; stress: module loads per unit
    self-stress (load rows, h), or None; maps (rows, 6), see `load_maps`.
    """

    layout: StaticsLayout
    pose: ClosedPose
    maps: Array
    geometries: list[ModuleGeometry]
    loads: Array
    jacobians: tuple[Array, Array]
    varying: list[Array]
    stress: Array | None

    @property
    def frames(self) -> Array:
        """base_from_module of all wrench modules, (n, 4, 4)."""
        return self.layout.frames(self.pose)

    @property
    def lambdas(self) -> tuple[Array, Array]:
        """Compliances of all modules, (n, 6, 6) and (m, 1, 1)."""
        return _stacked(self.layout, self.varying, self.pose.q.shape[:-1])

    @property
    def deformations(self) -> tuple[Array, Array, Array]:
        """Deformations of the modules under unit wrenches on the tool, (load rows, 6); views by module, (n, 6, 6) and
        (m, 1, 6)."""
        plain, others = self.layout.plain_compliances
        rows = self.loads * plain
        into = self.layout.split(rows)
        for half, slots, varies in others:
            lam = self.layout.constant_compliances[half][slots] if varies is None else self.varying[varies]
            times = np.multiply if half else np.matmul
            times(lam, self.jacobians[half][..., slots, :, :], into[half][..., slots, :, :])
        return rows, *into

    def compliance(self, deformations: Array) -> Array:
        """Return C (..., 6, 6), the sum over modules of J^T (Lambda J), as one product of all their rows, of the
        deformations (load rows, 6)."""
        return symmetric(product(self.loads.mT, deformations))

    def displacement(self, strains, frame: str | None) -> Array:
        """Return the displacement (..., 6) of the tool, or of a named frame, when modules deform by `strains`.

        By virtual work, sum J_m^T e_m with the loads J_m of unit wrenches on that frame.
        """
        return sum(
            (jacobian.mT @ strain[..., None])[..., 0].sum(axis=-2)
            for jacobian, strain in zip(self._virtual(frame), strains, strict=True)
        )

    def compliance_of(self, frame: str) -> Array:
        """Return the displacement of a named frame per wrench on the tool, (..., 6, 6)."""
        return sum(
            (virtual.mT @ lam @ jacobian).sum(axis=-3)
            for virtual, lam, jacobian in zip(self._virtual(frame), self.lambdas, self.jacobians, strict=True)
        )

    def _virtual(self, frame: str | None) -> tuple[Array, Array]:
        """Return the modules' loads under unit wrenches on the tool, or on a named frame."""
        if frame is None:
            return self.jacobians
        virtual = loads_from_frame(self.layout, self.pose, self.maps, self.pose.mechanism.frame(frame))
        if self.stress is not None:
            virtual = _least_energy(self.layout, virtual, self.stress, self.lambdas)
        return self.layout.split(virtual)


def solve_statics(
    layout: StaticsLayout, pose: ClosedPose, load: Array | None = None, energies: Energies = _COMPUTED
) -> Statics:
    """Return the statics of a pose; with `load` (6,) nonlinear modules are taken at that wrench.

    Of many poses at once, of one pose with a leading axis, and of expressions (with their `energies`), at rest:
    `problems_of` and `invalid` tell where equations do not hold.
    Raises PrupPinError where no module is compliant, UnreachablePoseError where a module's equation does not hold at
    this pose, ParameterError where it holds at none.
    """
    mechanism = layout.mechanism
    if not mechanism.modules:
        raise PrupPinError(
            f"'{mechanism.name}' has no compliant module: give joint stiffnesses, "
            "load(..., joint_stiffness=1e4) [N m/rad, N/m], or describe modules in a <prup_pin> element of the file"
        )
    tool, point = mechanism.need_tool(), None
    if pose.q.ndim == 1 and not pose.q.dtype.hasobject:
        maps, geometries, point = layout.at_one(pose)
        for index, group in layout.varying:
            if fault := group.fault(geometries[index]):
                raise UnreachablePoseError(f"at this pose, {fault}", pose.coordinates)
    else:
        frames, geometries = layout.placed(pose)
        maps = load_maps(layout, pose, frames)
    unit = loads_from_frame(layout, pose, maps, tool, point)
    stress: Array | None = None
    if pose.balance.self_stress.shape[-1]:
        # Forces that cancel between closures leave in the modules what the drawing of frames and rounding leave; it
        # must not pass for a load.
        stress = energies.counting(self_stress_loads(layout, pose, maps), pose.balance.self_stress)
    loads = None
    if load is not None and any(group.kind.nonlinear for group in layout.groups):
        loads = _loads_under(layout, geometries, unit @ load, stress)
    varying = _varying(layout, geometries, loads)
    if stress is not None:
        unit = _least_energy(layout, unit, stress, _stacked(layout, varying, pose.q.shape[:-1]), energies.solved)
    return Statics(layout, pose, maps, geometries, unit, layout.split(unit), varying, stress)


def _loads_under(layout: StaticsLayout, geometries, loads: Array, stress: Array | None) -> tuple[Array, Array]:
    """Return the modules' loads (n, 6) and (m, 1) with the self-stress of least complementary energy, nonlinear modules
    included.

    The energy's gradient over the self-stress x is sum B^T e(s), its Hessian sum B^T Lambda(s) B: Newton, with steps
    halved where they overshoot (a nut that lifts off has a kink in its compliance).
    """
    if stress is None:
        return _by_module(layout, loads)
    gradient = _gap(layout, geometries, loads, stress)
    for _ in range(_LOAD_ITERATIONS):
        at = _by_module(layout, loads)
        hessian = _energies(layout, stress, compliances(layout, geometries, at), stress)
        step = -semidefinite_inverse(hessian) @ gradient
        slope, share = abs(gradient @ step), 1.0
        if slope == 0.0:
            return at
        while True:
            trial = loads + share * (stress @ step)
            ahead = _gap(layout, geometries, trial, stress)
            if abs(ahead @ step) <= slope or share < 1e-6:
                break
            share /= 2
        change = np.abs(trial - loads).max(initial=0.0)
        loads, gradient = trial, ahead
        if change <= 1e-12 * np.abs(loads).max(initial=0.0):
            return _by_module(layout, loads)
    raise PrupPinError(
        f"the self-stress of nonlinear modules did not settle in {_LOAD_ITERATIONS} steps; try a smaller load"
    )


def _by_module(layout: StaticsLayout, loads: Array) -> tuple[Array, Array]:
    """Return loads (load rows,) of wrench modules (n, 6) and drive modules (m, 1)."""
    wrench, drive = layout.split(loads[:, None])
    return wrench[..., 0], drive[..., 0]


def _gap(layout: StaticsLayout, geometries, loads: Array, stress: Array) -> Array:
    """Return sum B^T e(s): how far the modules' deformations are from fitting together, (h,)."""
    count, at = len(layout.wrench_groups), _by_module(layout, loads)
    deformed = np.empty_like(loads)
    into = _by_module(layout, deformed)
    for index, (group, geometry) in enumerate(zip(layout.groups, geometries, strict=True)):
        half = int(index >= count)
        into[half][group.slots] = group.kind.deformation(group.values, geometry, at[half][group.slots])
    return stress.T @ deformed


def compliances(layout: StaticsLayout, geometries, loads, lead: tuple[int, ...] = ()) -> tuple[Array, Array]:
    """Return the stacked module compliances, (n, 6, 6) and (m, 1, 1), at the modules' loads (None: at rest).

    Those that pose or load change have the leading axes `lead` of the poses.
    """
    return _stacked(layout, _varying(layout, geometries, loads), lead)


def _varying(layout: StaticsLayout, geometries, loads) -> list[Array]:
    """Return the compliances (..., n, k, k) of the groups that pose or load change."""
    found = []
    for index, group in layout.varying:
        load = None if loads is None else loads[int(index >= len(layout.wrench_groups))][group.slots]
        found.append(group.kind.compliance(group.values, geometries[index], load))
    return found


def _stacked(layout: StaticsLayout, varying: list[Array], lead: tuple[int, ...]) -> tuple[Array, Array]:
    """Return all compliances, as `compliances` does, from those that pose or load change."""
    constant = layout.constant_compliances
    stacks = [*constant]
    for (index, group), compliance in zip(layout.varying, varying, strict=True):
        half = int(index >= len(layout.wrench_groups))
        if stacks[half] is constant[half]:
            stacks[half] = np.empty((*lead, *constant[half].shape), compliance.dtype)
            stacks[half][...] = constant[half]
        stacks[half][..., group.slots, :, :] = compliance
    return stacks[0], stacks[1]


def problems_of(layout: StaticsLayout, geometries: list[ModuleGeometry]) -> list[NDArray]:
    """Return, by group of modules that a pose can put out of range, which of them are, (..., n)."""
    found = (group.kind.problems(group.values, geometries[index]) for index, group in layout.varying)
    return [problems for problems in found if problems is not None]


def invalid(statics: Statics) -> NDArray[np.bool_]:
    """Return at which of many poses the equation of a module does not hold, (...)."""
    bad = np.zeros(statics.pose.q.shape[:-1], bool)
    for problems in problems_of(statics.layout, statics.geometries):
        bad |= problems.any(axis=-1)
    return bad


def _least_energy(layout: StaticsLayout, loads: Array, stress: Array, lambdas, solved=_least_solution) -> Array:
    """Return loads (..., load rows, 6) with the self-stress of least complementary energy added.

    Minimising 1/2 sum (J w + B x)^T Lambda (J w + B x) over x gives x = -D^+ (sum B^T Lambda J) w with
    D = sum B^T Lambda B.
    Self-stress that only rigid modules carry has no energy: it stays undetermined, and C does not depend on it.
    """
    x = -solved(_energies(layout, stress, lambdas, stress), _energies(layout, stress, lambdas, loads))
    return loads + stress @ x


def _energies(layout: StaticsLayout, left: Array, lambdas: tuple[Array, Array], right: Array) -> Array:
    """Return the sum over modules of B^T Lambda J, of loads B (..., load rows, h) and J (..., load rows, c)."""
    total = np.zeros(())
    for one, lam, other in zip(layout.split(left), lambdas, layout.split(right), strict=True):
        total = total + (one.mT @ lam @ other).sum(axis=-3)
    return total
