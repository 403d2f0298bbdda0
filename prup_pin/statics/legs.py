"""Legs side by side: the stiffness of a robot whose legs each join the base to the platform.

A leg passes on only what its free joints let it: wrenches G x, with as many x as it constrains motions. They strain it
by B = sum (J G)^T Lambda (J G) over its modules, so that it answers a twist t of the platform with G B^-1 G^T t. All
legs move with the platform: K = sum G B^-1 G^T, and C = K^-1, also where they constrain it more often than six times.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..kernel import NEGLIGIBLE, NEGLIGIBLE_ENERGY, independent
from ..kinematics import ClosedPose
from ..modules import ModuleGeometry
from ..spatial import Array, skew
from .castigliano import compliances
from .wrench_jacobians import StaticsLayout, load_maps

Indices = NDArray[np.int_]
#: From square matrices (..., n, n) and right sides (..., n, c) to the solutions.
Solver = Callable[[Array, Array], Array]


def _solved(matrix: Array, right: Array) -> Array:
    return np.asarray(np.linalg.solve(matrix, right), float)


@dataclass(frozen=True)
class _Leg:
    """`modules`, `drives`: places of its modules among the loads of either kind; `free`: velocities of its free joints.

    `closures` are the rows of the loop that it passes, none where it belongs to the tree or is welded to the platform.
    Of what its free joints ask of its wrench, `held` is independent; that settles some components, `chosen` are free.
    """

    modules: Indices
    drives: Indices
    free: Indices
    closures: Indices
    held: Indices
    settled: Indices
    chosen: Indices


class Legs:
    """The legs of one mechanism, by `of`."""

    def __init__(self, layout: StaticsLayout, legs: list[_Leg], points: Indices):
        """`points` are joints, one a leg: its wrenches are told about their places."""
        self._layout, self._legs, self._points = layout, legs, points
        self._of_module = np.zeros(len(layout.wrench_names), int)
        self._of_dof = np.zeros(layout.mechanism.model.nv, int)
        for index, leg in enumerate(legs):
            self._of_module[leg.modules] = index
            self._of_dof[leg.free] = index
            self._of_dof[layout.drive_dofs[layout.drive_rows[leg.drives]]] = index

    @classmethod
    def of(cls, layout: StaticsLayout, home: ClosedPose) -> Legs | None:
        """Return a mechanism's legs; None where loads take other ways, or a leg does not yield to all it passes on."""
        mechanism = layout.mechanism
        ways = mechanism.load_paths.legs()
        if len(ways) < 2 or not mechanism.modules:
            return None
        legs, points, none = [], [], np.zeros(0, int)
        for way in ways:
            loops = [-1 - edge for edge in way if edge < 0]
            if len(loops) > 1:
                return None
            joints = np.array([edge for edge in way if edge > 0], int)
            free = layout.free[np.isin(mechanism.dof_joint[layout.free], joints)]
            drives = np.flatnonzero(np.isin(mechanism.dof_joint[layout.drive_dofs[layout.drive_rows]], joints))
            modules = np.flatnonzero(np.isin(layout.wrench_joints, joints))
            closures = np.flatnonzero(np.isin(layout.closure_loops, loops))
            legs.append(_Leg(modules, drives, free, closures, none, none, none))
            points.append(_crossing(home, free, joints))
        found = cls(layout, legs, np.array(points, int))
        ordered = []
        for leg, (asked, _) in zip(legs, found._asked(home), strict=True):
            held, settled = independent(asked)
            chosen = np.setdiff1d(np.arange(asked.shape[-1]), settled)
            ordered.append(replace(leg, held=held, settled=settled, chosen=chosen))
        found = cls(layout, ordered, found._points)
        return found if all(map(_definite, found._side_by_side(home, _solved)[1])) else None

    def stiffness(self, pose: ClosedPose, solve: Solver = _solved) -> tuple[Array, list[ModuleGeometry]]:
        """Return K (..., 6, 6) at the tool in base axes, and what the pose tells each group of modules.

        Of many poses, or of expressions, for which `solve` writes down what it does.
        """
        wrenches, yielding, geometries = self._side_by_side(pose, solve)
        stiffness = np.zeros(())
        for g, b in zip(wrenches, yielding, strict=True):
            stiffness = stiffness + g @ solve(b, g.mT)
        return (stiffness + stiffness.mT) * 0.5, geometries

    def idle(self, pose: ClosedPose, solve: Solver = _solved) -> Array:
        """Return what is left of demands on the legs' wrenches that were met with others at home, (..., k) [m, 1].

        Zero as long as the joints that turn idly there do so here.
        """
        left = [np.zeros((*pose.q.shape[:-1], 0), pose.q.dtype)]
        for leg, (asked, _) in zip(self._legs, self._asked(pose), strict=True):
            others = np.setdiff1d(np.arange(len(leg.free)), leg.held)
            if len(others):
                rest = asked[..., others, :] @ self._left_over(leg, asked, solve)
                left.append(rest.reshape(*rest.shape[:-2], -1))
        return np.concatenate(left, axis=-1)

    def _side_by_side(self, pose: ClosedPose, solve: Solver) -> tuple[list[Array], list[Array], list[ModuleGeometry]]:
        """Return of each leg what it passes on, (..., 6, n) about the tool, and how it yields to that, (..., n, n)."""
        layout = self._layout
        frames, geometries = layout.placed(pose)
        points = self._places(pose)
        frames = frames.copy()
        frames[..., :3, 3] = frames[..., :3, 3] - points[..., self._of_module, :]
        maps = load_maps(layout, replace(pose, jacobian=self._jacobian(pose, points)), frames)
        modules, drives = layout.split((maps * layout.row_ratios)[..., : layout.load_rows, :])
        tool = layout.mechanism.need_tool()
        away = points - (pose.placements[..., tool.joint, :, :] @ tool.placement)[..., None, :3, 3]
        lambdas = compliances(layout, geometries, None, pose.q.shape[:-1])
        wrenches, yielding = [], []
        for index, (leg, (asked, spanned)) in enumerate(zip(self._legs, self._asked(pose), strict=True)):
            wrench = spanned @ self._left_over(leg, asked, solve)
            b = np.zeros(())
            for kind, of_kind, lam in zip((modules, drives), (leg.modules, leg.drives), lambdas, strict=True):
                loads = kind[..., of_kind, :, :] @ wrench[..., None, :, :]
                rows = (*loads.shape[:-3], loads.shape[-3] * loads.shape[-2], loads.shape[-1])
                b = b + loads.reshape(rows).mT @ (lam[..., of_kind, :, :] @ loads).reshape(rows)
            force = wrench[..., :3, :]
            moment = wrench[..., 3:, :] + skew(away[..., index, :]) @ force
            wrenches.append(np.concatenate((force, moment), axis=-2))
            yielding.append((b + b.mT) * 0.5)
        return wrenches, yielding, geometries

    def _asked(self, pose: ClosedPose) -> list[tuple[Array, Array]]:
        """Return of each leg what its free joints ask of its wrench, (..., f, c) y = 0, and that, (..., 6, c) y."""
        points = self._places(pose)
        jacobian = self._jacobian(pose, points)
        found = []
        for index, leg in enumerate(self._legs):
            along = jacobian[..., leg.free].mT
            if not len(leg.closures):
                found.append((along, np.eye(6)))
                continue
            forces = pose.closure_wrenches[..., leg.closures, :].mT
            moments = forces[..., 3:, :] - skew(points[..., index, :]) @ forces[..., :3, :]
            spanned = np.concatenate((forces[..., :3, :], moments), axis=-2)
            found.append((along @ spanned, spanned))
        return found

    @staticmethod
    def _left_over(leg: _Leg, asked: Array, solve: Solver) -> Array:
        """Return a basis (..., c, n) of what the free joints leave of a wrench: each chosen component in turn."""
        count, chosen = asked.shape[-1], len(leg.chosen)
        basis = np.zeros((*asked.shape[:-2], count, chosen), asked.dtype)
        basis[..., leg.chosen, range(chosen)] = 1.0
        held = asked[..., leg.held, :]
        if len(leg.settled):
            basis[..., leg.settled, :] = -solve(held[..., leg.settled], held[..., leg.chosen])
        return basis

    def _places(self, pose: ClosedPose) -> Array:
        """Return where each leg's wrenches are told about, (..., legs, 3)."""
        return pose.placements[..., self._points, :, :][..., :3, 3]

    def _jacobian(self, pose: ClosedPose, points: Array) -> Array:
        """Return the joints' base twists (..., 6, nv), each about its leg's point."""
        turns = pose.jacobian[..., 3:, :].mT
        moved = (skew(turns) @ points[..., self._of_dof, :, None])[..., 0]
        return np.concatenate((pose.jacobian[..., :3, :] + moved.mT, turns.mT), axis=-2)


def _crossing(home: ClosedPose, free: Indices, joints: Indices) -> int:
    """Return a leg's joint through whose place most axes of its free joints go: they ask nothing of a force there."""
    twists = home.jacobian[:, free].T
    best, most = 0, -1
    for joint in joints.tolist():
        point = home.placements[joint, :3, 3]
        apart = np.abs(twists[:, :3] + np.cross(twists[:, 3:], point)).max(axis=1, initial=0.0)
        through = int(((apart < NEGLIGIBLE) & (np.abs(twists[:, 3:]).max(axis=1, initial=0.0) > 0.0)).sum())
        if through > most:
            best, most = joint, through
    return best


def _definite(matrix: Array) -> bool:
    """Return True where energies (n, n) are above what counts as none."""
    size = np.sqrt(np.diagonal(matrix))
    return bool(size.all() and np.linalg.eigvalsh(matrix / np.outer(size, size))[0] > NEGLIGIBLE_ENERGY)
