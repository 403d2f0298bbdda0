"""What no equation determines: idle motions, and self-stress that only rigid modules carry.

Where joints can move without moving the tool, or closures repeat what others say and nothing yields to the forces
between them, the derivative A of the equations is singular, and which of its singular values pass for zero would depend
on how the robot's frames are drawn. So that is not asked: the rigid pose knows it. Its null vectors border the matrix,

    [A  U] [dx]   [-r]
    [V  0] [s ] = [ 0],

which makes it regular: of all solutions it picks the one with the least idle motion and self-stress. V measures
self-stress by the loops' wrenches about the tool, moments over a length, which no drawing of frames changes. The slack
s is zero where the equations can be met: what they ask along U is then no more than what the others say.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..kernel import NEGLIGIBLE, semidefinite_null
from ..kinematics import ClosedPose
from ..spatial import Array, base_wrench_from_point
from .structure import TOGETHER, Structure

if TYPE_CHECKING:
    from .residual import Evaluation

#: A matrix of a greater condition number is singular: no digit of its inverse is right.
_SINGULAR = 1e15


@dataclass(frozen=True, eq=False)
class Border:
    """Borders of N matrices (m, m): left (N, m, k), right (N, k, m); samples with fewer than k are filled up.

    corner (N, k, k) is zero, and the identity where it is filled up.
    """

    left: Array
    right: Array
    corner: Array

    @property
    def size(self) -> int:
        return self.corner.shape[-1]

    @property
    def holds(self) -> np.ndarray:
        """Which samples are bordered at all, (N,)."""
        return np.asarray(self.right.any(axis=(1, 2)))

    def take(self, rows) -> Border:
        return Border(self.left[rows], self.right[rows], self.corner[rows])

    def without(self, rows: np.ndarray) -> Border:
        """Return the border with some samples set free."""
        left, right, corner = self.left.copy(), self.right.copy(), self.corner.copy()
        left[rows], right[rows], corner[rows] = 0.0, 0.0, np.eye(self.size)
        return Border(left, right, corner)

    def around(self, matrix: Array) -> Array:
        """Return the bordered matrices, (N, m + k, m + k)."""
        if not self.size:
            return matrix
        upper = np.concatenate((matrix, self.left), axis=2)
        return np.concatenate((upper, np.concatenate((self.right, self.corner), axis=2)), axis=1)


def no_border(samples: int, unknowns: int) -> Border:
    """Return the border of matrices that need none."""
    return Border(np.zeros((samples, unknowns, 0)), np.zeros((samples, 0, unknowns)), np.zeros((samples, 0, 0)))


def undetermined(structure: Structure, pose: ClosedPose, at: Evaluation, matrix: Array) -> Border:
    """Return the border at one rigid pose, with the evaluation and the matrix (m, m) there, without load."""
    nq, nd, ne, nc = structure.sizes
    motions, idle, every = nq + nd + ne, pose.balance.idle, pose.balance.self_stress
    stress = every @ semidefinite_null(_energy(structure, every, at, matrix))
    length = _length(pose, at.tool[0, :3, 3])
    # What counts for idle motions: slides over a length; for self-stress: the wrenches that the loops carry.
    slides = ~np.any(at.screws[0, :nq, 3:], axis=1)
    by_motion = np.where(slides, 1 / length**2, 1.0)[:, None] * idle
    about_tool = at.gaps.wrenches[0] @ base_wrench_from_point(-at.tool[0, :3, 3]).T
    about_tool[:, 3:] /= length
    loop = structure.closure.row_loop
    by_force = np.where(loop[:, None] == loop, about_tool @ about_tool.T, 0.0) @ stress
    count, k = idle.shape[1], idle.shape[1] + stress.shape[1]
    left, right = np.zeros((1, motions + nc, k)), np.zeros((1, k, motions + nc))
    left[0, :nq, :count], left[0, motions:, count:] = idle, stress
    right[0, :count, :nq], right[0, count:, motions:] = by_motion.T, by_force.T
    return Border(left, right, np.zeros((1, k, k)))


def _energy(structure: Structure, stress: Array, at: Evaluation, matrix: Array) -> Array:
    """Return what the modules store under unit self-stresses, sum B^T Lambda B, (h, h).

    Self-stress that cancels in a module leaves there what the drawing of frames and rounding leave: no load.
    """
    nq, nd, ne, _ = structure.sizes
    deformed = matrix[nq + nd + ne :, : nq + nd + ne].T @ stress
    deformed[: nq + nd] = structure.borne(deformed[None, : nq + nd])[0]
    deformed = deformed[nq:]
    loads = np.where(np.abs(deformed) > NEGLIGIBLE * np.abs(stress).max(initial=0.0), deformed, 0.0)
    drive, wrench = loads[:nd], loads[nd:].reshape(ne // 6, 6, stress.shape[1])
    strains = np.nan_to_num(at.modules.slopes.by_load[0]) @ wrench
    return (wrench.mT @ strains).sum(axis=0) + drive.T @ (np.nan_to_num(at.drives.slope[0])[:, None] * drive)


def _length(pose: ClosedPose, tool: Array) -> float:
    """Return the root mean square distance of the joints from the tool [m]."""
    size = float(np.sqrt(((pose.placements[1:, :3, 3] - tool) ** 2).sum(axis=1).mean()))
    return size if size > 0 else 1.0


def gathered(each: dict[int, Border], rows: np.ndarray, unknowns: int) -> Border:
    """Return the borders of samples `rows` (N,) by the poses in which they stand; those that miss have none."""
    k = max((border.size for border in each.values()), default=0)
    if not k:
        return no_border(len(rows), unknowns)
    left, right = np.zeros((len(rows), unknowns, k)), np.zeros((len(rows), k, unknowns))
    corner = np.broadcast_to(np.eye(k), (len(rows), k, k)).copy()
    for pose, border in each.items():
        here, own = rows == pose, border.size
        left[here, :, :own], right[here, :own], corner[here, :own, :own] = border.left, border.right, 0.0
    return Border(left, right, corner)


def inverted(matrix: Array, border: Border) -> Array:
    """Return the inverses (N, m, m) of bordered matrices, without the border; NaN where one is singular."""
    m = matrix.shape[-1]
    return _inverse(border.around(matrix))[:, :m, :m]


def left_solved(matrix: Array, border: Border, rows: Array) -> Array:
    """Return rows (N, r, m) times the same inverse, more accurately; NaN where a matrix is singular."""
    padded = np.zeros((*rows.shape[:-1], matrix.shape[-1] + border.size))
    padded[..., : matrix.shape[-1]] = rows
    return _left_solved(matrix, border, padded)


def slack(matrix: Array, border: Border) -> Array:
    """Return what the slack is per residual (N, k, m): not zero for what no step of the unknowns can meet."""
    units = np.eye(matrix.shape[-1] + border.size)[matrix.shape[-1] :]
    return -_left_solved(matrix, border, np.broadcast_to(units, (len(matrix), *units.shape)))


def _left_solved(matrix: Array, border: Border, rows: Array) -> Array:
    """Return rows (N, r, m + k) times the inverse of bordered matrices, (N, r, m) of them."""
    found, whole = np.empty_like(rows), border.around(matrix)
    for begin in range(0, len(rows), TOGETHER):
        some = slice(begin, begin + TOGETHER)
        scaled, by_row, by_column = _scaled(whole[some])
        found[some] = _each(np.linalg.solve, scaled.mT, (rows[some] / by_column).mT).mT / by_row.mT
    return found[..., : matrix.shape[-1]]


def _scaled(matrix: Array) -> tuple[Array, Array, Array]:
    """Return matrices whose rows and columns have a largest entry of 1, and the factors that were divided out."""
    rows = np.abs(matrix).max(axis=2, keepdims=True, initial=0.0)
    rows = np.where(rows > 0, rows, 1.0)
    scaled = matrix / rows
    columns = np.abs(scaled).max(axis=1, keepdims=True, initial=0.0)
    columns = np.where(columns > 0, columns, 1.0)
    return scaled / columns, rows, columns


def _inverse(matrix: Array) -> Array:
    finite = np.isfinite(matrix).all(axis=(1, 2))
    if not finite.all():
        inverse = np.full_like(matrix, np.nan)
        if finite.any():
            inverse[finite] = _inverse(matrix[finite])
        return inverse
    scaled, rows, columns = _scaled(matrix)
    inverse = _each(np.linalg.inv, scaled)
    # The product of Frobenius norms bounds the condition number from above.
    bound = np.linalg.norm(inverse, axis=(1, 2)) * np.linalg.norm(scaled, axis=(1, 2))
    inverse[~(bound < _SINGULAR)] = np.nan
    return inverse / columns.mT / rows.mT


def _each(solve: Callable[..., Array], matrices: Array, *rest: Array) -> Array:
    """Return what `solve` gives for a stack of matrices; NaN for those that are exactly singular."""
    try:
        return solve(matrices, *rest)
    except np.linalg.LinAlgError:
        if len(matrices) == 1:
            return np.full_like(rest[0] if rest else matrices, np.nan)
        singles = [_each(solve, *(array[i : i + 1] for array in (matrices, *rest))) for i in range(len(matrices))]
        return np.concatenate(singles)
