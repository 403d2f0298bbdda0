"""Loop closures: how far the ends of each loop are apart, and which forces hold them together.

The gap of a loop is measured in its first frame: the distance of the origins along the constrained axes, and entries
of E = R_1^T R_2 that vanish when only free rotations differ. Both are linear in E and R_1^T (p_2 - p_1), so that all
derivatives below are exact on and off closure.

Every function takes the placements of all joints with any leading axes: one pose, or many.
"""

from __future__ import annotations

from collections.abc import Mapping
from operator import itemgetter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..mechanism import Mechanism
from ..spatial import Array, product, rotation_exp, skew
from .program import Expression

#: Of an entry that is 1 where frames meet as they should, and -1 half a turn off.
_LEAST_ALIGNED = 0.9
_GENERATORS = np.stack([skew(axis) for axis in np.eye(3)])


class LoopGaps(NamedTuple):
    """The loops at joint placements (..., nj, 4, 4): c scalar constraints of L loops.

    gap (..., c) [m, rad]; wrenches (..., c, 6), base wrenches on the second frame's body of unit closure forces;
    turn (..., L, 3, 3), E = R_1^T R_2; axes (..., L, 3, 3), R_1; point (..., L, 3), the second frame's origin p_2.
    """

    gap: Array
    wrenches: Array
    turn: Array
    axes: Array
    point: Array


class LoopForces(NamedTuple):
    """What each loop carries under closure forces: on its second frame's body, reversed on the first's.

    force (..., L, 3) and moment (..., L, 3) about the loop's point, base axes; wrench (..., L, 6), the same about the
    base's origin. by_first and by_second (..., L, 6, 6): change of that wrench per base twist of either body.
    """

    force: Array
    moment: Array
    wrench: Array
    by_first: Array
    by_second: Array


class Closure:
    """The loops of one mechanism as index arrays.

    row_loop (c,) is the loop of each constraint, is_translation (c,) tells distances from angles; sign (c, nv) is 1
    where a velocity moves the second end of the row's loop only, -1 where it moves the first only, else 0; incidence
    (nj, c) tells the same of what a joint carries of each closure force.
    """

    def __init__(self, mechanism: Mechanism):
        loops = mechanism.loops
        self.count = len(loops)
        ends = [*(loop.first for loop in loops), *(loop.second for loop in loops)]
        self._ends = np.array([end.joint for end in ends], int)
        self._end_placements = np.array([end.placement for end in ends]).reshape(-1, 4, 4)
        self._first, self._second = self._ends[: self.count], self._ends[self.count :]
        # Each loop has room for three translations and three rotations; `_rows` picks those that are constrained.
        rotations = np.zeros((self.count, 3, 3, 3))
        self._aligned = np.zeros((self.count, 3, 3))
        chosen = []
        for index, loop in enumerate(loops):
            rotations[index, : len(loop.rotation_rows)] = loop.rotation_rows.reshape(-1, 3, 3)
            chosen += [6 * index + axis for axis in loop.translation_axes]
            chosen += [6 * index + 3 + row for row in range(len(loop.rotation_rows))]
            turning = [axis for axis, name in enumerate(("rx", "ry", "rz")) if name in loop.free]
            if len(turning) < 2:
                # E is the identity, or keeps the free axis: these entries are then 1, half a turn off -1.
                self._aligned[index, turning or range(3), turning or range(3)] = 1.0
        self._least_aligned = _LEAST_ALIGNED * self._aligned
        aligned_at = [12 * loop + 4 * row + column for loop, row, column in np.argwhere(self._aligned).tolist()]
        # With the 1 that rows end in, twice: of one entry alone no tuple would come.
        self._aligned_of = itemgetter(*aligned_at, -1, -1)
        self._rows = np.array(chosen, int)
        self._all_rows = len(chosen) == 6 * self.count
        self.size = len(chosen)
        self.row_loop = self._rows // 6
        self.is_translation = self._rows % 6 < 3
        first, second = self._first[self.row_loop], self._second[self.row_loop]
        support = mechanism.support
        self.incidence = support[:, second] - support[:, first]
        self.sign = np.ascontiguousarray(self.incidence[mechanism.dof_joint].T)
        # On the relative placement [E | d] of the ends, row by row: the gap, and the map from the second end's twist
        # as the first sees it, (v, w) about the first's origin, to the gap's change. A distance changes by v + w x d,
        # an angle with a turn about axis c of the first frame by sum_ab A_ab ([e_c]x E)_ab.
        turning = np.einsum("lrab,cad->lrcdb", rotations, _GENERATORS)
        linear, constant = np.zeros((self.count, 42, 3, 4)), np.zeros((42, 1))
        linear[:, range(3), range(3), 3] = 1.0
        linear[:, 3:6, :, :3] = rotations
        twist_map = linear[:, 6:].reshape(self.count, 6, 6, 3, 4)
        twist_map[:, :3, 3:, :, 3] = -_GENERATORS.transpose(1, 2, 0)
        twist_map[:, 3:, 3:, :, :3] = turning
        constant[[6, 13, 20]] = 1.0
        self._turning = turning.reshape(-1, 9, 9)
        self._linear, self._constant = linear.reshape(self.count, 42, 12), constant
        #: The same of all loops as one product with their [E | d] row by row and a 1, (12 L + 1,): gaps of constraints
        #: (c,), then twist maps (L, 6, 6).
        width = 12 * self.count + 1
        product = np.zeros((self.count, 42, width))
        for index in range(self.count):
            product[index, :, 12 * index : 12 * (index + 1)] = self._linear[index]
        product[..., -1:] = constant
        gaps = product[:, :6].reshape(-1, width)[self._rows]
        self.product = np.asfortranarray(np.concatenate((gaps, product[:, 6:].reshape(-1, width))))
        # ... and with two of them, d2(angle r)/d(axis c)d(axis d)
        twice = np.einsum("cae,edf->cdaf", _GENERATORS, _GENERATORS.transpose(1, 0, 2))
        self._bending = np.einsum("lrab,cdaf->lrcdfb", rotations, twice).reshape(self.count, 27, 9)

    def end_placements(self, offsets: Mapping[tuple[int, int], Array] | None = None) -> Array:
        """Return body_from_end of all loops' first ends, then of their second ones, (2 L, 4, 4).

        `offsets`, by (loop, 0 or 1 for the end), displace them: (6,), a translation in the axes of the body and a
        rotation vector in the end's own.
        """
        if not offsets:
            return self._end_placements
        moved = self._end_placements.copy()
        for (loop, end), offset in offsets.items():
            place = moved[loop + end * self.count]
            place[:3, 3] += offset[:3]
            place[:3, :3] = place[:3, :3] @ rotation_exp(offset[3:])
        return moved

    def gaps(self, placements: Array, offsets: Mapping[tuple[int, int], Array] | None = None) -> LoopGaps:
        """Return how far the loops are open at joint placements (..., nj, 4, 4), with their ends displaced."""
        ends = placements[..., self._ends, :, :] @ self.end_placements(offsets)
        first, second = ends[..., : self.count, :3, :], ends[..., self.count :, :3, :]
        axes, origin, point = first[..., :3], first[..., 3], second[..., 3].copy()
        to_first = axes.mT
        second[..., 3] -= origin
        relative = to_first @ second
        gap, twist_map = self.of_relative(relative)
        lead = point.shape[:-1]
        action = np.zeros((*lead, 6, 6), placements.dtype)
        action[..., :3, :3] = action[..., 3:, 3:] = to_first
        action[..., :3, 3:] = to_first @ skew(-origin)
        wrenches = (twist_map @ action).reshape(*lead[:-1], 6 * self.count, 6)
        gap = gap.reshape(*lead[:-1], 6 * self.count)
        if not self._all_rows:
            gap, wrenches = gap[..., self._rows], wrenches[..., self._rows, :]
        return LoopGaps(gap, wrenches, relative[..., :3], axes, point)

    def of_relative(self, relative: Array) -> tuple[Array, Array]:
        """Return gaps (..., L, 6) and twist maps (..., L, 6, 6) of relative placements [E | d] (..., L, 3, 4).

        A twist map turns the second end's twist against the first, seen by the first about its origin, into the gap's
        change. Rows of free motions are among them: see `constrained`.
        """
        lead = relative.shape[:-2]
        values = (self._linear @ relative.reshape(*lead, 12, 1) + self._constant)[..., 0]
        return values[..., :6], values[..., 6:].reshape(*lead, 6, 6)

    @property
    def constrained(self) -> NDArray[np.int_] | None:
        """Which of all loops' six rows are constraints, (c,); None where all are."""
        return None if self._all_rows else self._rows

    def jacobian(self, wrenches: Array, jacobian: Array) -> Array:
        """Return d(gap)/d(velocities) (..., c, nv) of the joints' base twists `jacobian` (..., 6, nv)."""
        rows = product(wrenches, jacobian)
        rows *= self.sign
        return rows

    def assembled(self, relative: Array) -> bool:
        """Return False where an angle vanishes at the wrong root, frames turned by half a turn; of one configuration.

        relative (12 L + 1,): see `product`.
        """
        return min(self._aligned_of(relative.tolist())) >= _LEAST_ALIGNED

    def assembled_each(self, turn: Array) -> NDArray[np.bool_]:
        """Return `assembled` of many configurations, (...) of turn (..., L, 3, 3)."""
        return np.asarray(~(turn * self._aligned < self._least_aligned).any(axis=(-1, -2, -3)))

    def assembled_conditions(self, turn: Array) -> list[Expression]:
        """Return conditions on turn (L, 3, 3), expressions, that are 1 where `assembled` is True."""
        return [turn[at] >= self._least_aligned[at] for at in zip(*np.nonzero(self._aligned), strict=True)]

    def forces(self, at: LoopGaps, forces: Array) -> LoopForces:
        """Return what the loops carry under closure forces (..., c) [N, N m], and how it changes as bodies move."""
        lead = at.point.shape[:-1]
        each = np.zeros((*lead[:-1], 6 * self.count))
        each[..., self._rows] = forces
        each = each.reshape(*lead, 6)
        flat = at.turn.reshape(*lead, 9, 1)
        moments = (self._turning @ flat).reshape(*lead, 3, 3)
        bending = (self._bending @ flat).reshape(*lead, 3, 9)
        axes, to_first = at.axes, at.axes.mT
        force = (axes @ each[..., :3, None])[..., 0]
        moment = (axes @ (each[..., None, 3:] @ moments).mT)[..., 0]
        bent = axes @ (each[..., None, 3:] @ bending).reshape(*lead, 3, 3) @ to_first
        f, m, p = skew(force), skew(moment), skew(at.point)
        wrench = np.concatenate((force, moment + (p @ force[..., None])[..., 0]), axis=-1)
        by_first, by_second = np.zeros((*lead, 6, 6)), np.zeros((*lead, 6, 6))
        by_first[..., :3, 3:] = -f
        by_first[..., 3:, 3:] = -m - bent - p @ f
        by_second[..., 3:, :3] = -f
        by_second[..., 3:, 3:] = bent + f @ p
        return LoopForces(force, moment, wrench, by_first, by_second)
