"""A beam under load, geometrically exact: large rotations, axial force on bending, foreshortening.

A Kirchhoff-Cosserat rod, followed from its loaded end. With (n, m) the wrench that acts on the tip, in the tip's axes,
the section at the distance u from the tip, placed at (R, p) in the tip frame, carries R^T n and R^T (m - p x n), so its
strains are known and

    dR/du = -R [kappa]x,    dp/du = -R (e_z + epsilon)

is an initial-value problem without unknowns (Antman, Nonlinear Problems of Elasticity, ch. 8). It is integrated by
Gauss collocation, whose rotations stay orthonormal. Its derivative with respect to the tip's wrench obeys a linear
equation along the same sections. At small loads the tip compliance of `modules.flexibility` is its limit.

All functions take leading axes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..modules.flexibility import SectionFlexibilities
from ..spatial import Array, cross, rotation_exp, rotation_tangent, skew

_STAGES = 6
_POINTS, _LAST = np.polynomial.legendre.leggauss(_STAGES)
_NODES, _LAST = (_POINTS + 1) / 2, _LAST / 2
# _MATRIX[i, j] integrates the j-th Lagrange polynomial of the nodes from 0 to node i.
_POWERS = np.arange(_STAGES)
_MATRIX = (_NODES[:, None] ** (_POWERS + 1) / (_POWERS + 1)) @ np.linalg.inv(_NODES[:, None] ** _POWERS)

_SWEEPS = 40
_ROUNDING = 1e-15
#: A rod whose sweeps end farther apart than this has no answer: it is returned as NaN.
_SETTLED = 1e-12
#: A piece turns by no more than this [rad], so that the sweeps of collocation contract.
_TURN = 0.5
_MOST_PIECES = 32
#: Uneven sections are integrated in this many pieces between their breaks.
_UNEVEN_PIECES = 8


class LoadedRod(NamedTuple):
    """A rod's root seen from its tip.

    rotation (..., 3, 3) and position (..., 3) place the root's section in the tip frame; `tangent` (..., 6, 6) is its
    spatial twist (in the tip frame) per change of the tip's wrench, None where it was not asked for; `root_strain`
    (..., 6) are stretch and curvature of the section at the root, `tip_strain` those at the tip; `root_wrench` (..., 6)
    is carried at the root, in its axes, `root_slope` (..., 6, 6) its change with the tip's wrench (or None). Per length
    that is added at the root, `root_rate` (..., 6) is the change of that wrench, `root_motion` (..., 6) the velocity of
    the root's point and its spin in the tip's axes. `energy` (...) [J] is stored along the rod. NaN where nothing was
    found.
    """

    rotation: Array
    position: Array
    tangent: Array | None
    root_strain: Array
    tip_strain: Array
    root_wrench: Array
    root_slope: Array | None
    root_rate: Array
    root_motion: Array
    energy: Array


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def loaded_rod(
    law: SectionFlexibilities,
    length: Array,
    wrench: Array,
    root_tilting: Array | float = 0.0,
    weight: Callable[[Array], Array] | None = None,
    gravity: Array | None = None,
    pieces: int | None = None,
    with_tangent: bool = True,
) -> LoadedRod:
    """Return a rod of `length` (...) under `wrench` (..., 6) on its tip, in the tip's axes.

    `root_tilting` [rad/(N m)] (...) is the compliance of the root's clamp about x and y. `weight` gives kg/m at
    distances (..., points) from the tip, `gravity` (..., 3) is in the tip's axes. Each interval between breaks is
    integrated in `pieces`; by default what `piece_count` says of all rods.
    """
    batch = np.broadcast_shapes(np.shape(length), wrench.shape[:-1])
    length = np.broadcast_to(length, batch)
    wrench = np.broadcast_to(wrench, (*batch, 6))
    rotation = np.broadcast_to(np.eye(3), (*batch, 3, 3))
    position = np.zeros((*batch, 3))
    tangent = np.zeros((*batch, 6, 6)) if with_tangent else None
    spread = np.zeros((*batch, 6, 6))  # of the wrench of the weight so far, per change of the tip's wrench
    energy = np.zeros(batch)
    carried = np.zeros((*batch, 6))  # of the weight so far, about the tip
    settled = np.ones(batch, bool)
    edges = length[..., None] * np.broadcast_to(law.breaks, (*batch, law.breaks.shape[-1]))
    if pieces is None:
        pieces = int(piece_count(law, length, wrench).max(initial=1))
    for start, end in zip(np.moveaxis(edges, -1, 0)[:-1], np.moveaxis(edges, -1, 0)[1:], strict=True):
        for piece in range(pieces):
            left = start + (end - start) * (piece / pieces)
            step = (end - start) / pieces
            u = left[..., None] + step[..., None] * _NODES
            flexibility = _flexibilities(law, u)
            line = None
            if weight is not None and gravity is not None:
                line = weight(u)[..., None] * gravity[..., None, :]
            piece_of = _followed(rotation, position, step, flexibility, wrench, carried, line)
            last = step[..., None] * _LAST
            settled &= piece_of.settled
            if tangent is not None:
                matrix = step[..., None, None] * _MATRIX
                r, p, n, m = piece_of.sections()
                tangent, spread, found = _advance_tangent(tangent, spread, r, p, flexibility, n, m, line, matrix, last)
                settled &= found
            energy = energy + piece_of.energy
            rotation, position, carried = piece_of.rotation, piece_of.position, piece_of.carried
    rotation = np.where(settled[..., None, None], rotation, np.nan)
    n, m = wrench[..., :3] + carried[..., :3], wrench[..., 3:] + carried[..., 3:]
    root = _in_section(rotation, position, n, m)
    root_strain = _flexibilities(law, length[..., None])[..., 0, :] * root
    tip_strain = _flexibilities(law, np.zeros((*batch, 1)))[..., 0, :] * wrench
    bend, stretched = root_strain[..., 3:], root_strain[..., :3] + _AXIS
    turned = cross(bend, root[..., :3])
    if line is not None:
        assert weight is not None
        assert gravity is not None
        turned += (gravity[..., None, :] @ rotation)[..., 0, :] * weight(length[..., None])
    moment_rate = cross(bend, root[..., 3:]) + cross(stretched, root[..., :3])
    rate = np.concatenate((turned, moment_rate), axis=-1)
    velocity, spin = -(rotation @ stretched[..., None])[..., 0], -(rotation @ bend[..., None])[..., 0]
    slope = None if tangent is None else _root_slope(rotation, position, n, m, tangent, spread)
    tilting = np.asarray(root_tilting, float)
    if np.any(tilting > 0):
        spin = spin - _tilt_spin(tilting, root, moment_rate, rotation)
        rotation, tangent, energy = _tilt(tilting, root, rotation, position, tangent, spread, energy, n, m)
    motion = np.concatenate((velocity, spin), axis=-1)
    return LoadedRod(rotation, position, tangent, root_strain, tip_strain, root, slope, rate, motion, energy)


class _Piece(NamedTuple):
    """A piece of rods, followed: its sections (r, p) and what they carry about the tip, (n, m), components first.

    Of its end, `rotation` (..., 3, 3), `position` (..., 3) and the wrench `carried` (..., 6) of the weight so far about
    the tip; `energy` (...) in it, and where the sweeps `settled`.
    """

    r: Array  # (3, 3, stages, rods)
    p: Array  # (3, stages, rods)
    n: Array
    m: Array
    rotation: Array
    position: Array
    carried: Array
    energy: Array
    settled: np.ndarray

    def sections(self) -> tuple[Array, Array, Array, Array]:
        """Return r (..., stages, 3, 3), and p, n and m (..., stages, 3)."""
        batch = self.settled.shape
        r = self.r.transpose(3, 2, 0, 1).reshape(*batch, _STAGES, 3, 3)
        vectors = (np.broadcast_to(x, self.p.shape) for x in (self.p, self.n, self.m))
        p, n, m = (x.T.reshape(*batch, _STAGES, 3) for x in vectors)
        return r, p, n, m


def _followed(
    rotation: Array, position: Array, step: Array, flexibility: Array, wrench: Array, carried: Array, line: Array | None
) -> _Piece:
    """Return a piece of length `step` (...) that begins at (rotation, position), by sweeps of collocation.

    flexibility (..., stages, 6) of its sections, wrench (..., 6) on the tip, line (..., stages, 3) weight per length.
    Rods stand along the last axis while they are followed: many small products are slow.
    """
    batch = step.shape
    begin_r = np.ascontiguousarray(rotation.reshape(-1, 9).T).reshape(3, 3, 1, -1)
    begin_p = np.ascontiguousarray(position.reshape(-1, 3).T)[:, None]
    lengths = step.reshape(-1)
    soft = np.ascontiguousarray(flexibility.reshape(-1, _STAGES, 6).T)
    load, before = (np.ascontiguousarray(each.reshape(-1, 6).T)[:, None] for each in (wrench, carried))
    n, m = load[:3], load[3:]
    both = np.zeros((6, _STAGES, len(lengths)))
    if line is not None:
        both[:3] = line.reshape(-1, _STAGES, 3).T
        n = n + (before[:3] + lengths * (_MATRIX @ both[:3]))
    r = np.repeat(begin_r, _STAGES, axis=2)
    p = begin_p - (lengths * _NODES[:, None]) * begin_r[:, 2]
    change = np.zeros(len(lengths))
    strain, local, turning = np.empty_like(both), np.empty_like(both), np.empty_like(r)
    for _ in range(_SWEEPS):
        if line is not None:
            _cross_into(both[3:], p, both[:3])
            m = load[3:] + (before[3:] + lengths * (_MATRIX @ both[3:]))
        about = _cross_into(np.empty_like(p), n, p)
        about += m
        for vector, own in ((n, local[:3]), (about, local[3:])):
            np.multiply(r[0], vector[0], out=own)
            own += r[1] * vector[1]
            own += r[2] * vector[2]
        np.multiply(soft, local, out=strain)
        _cross_into(turning.swapaxes(0, 1), strain[3:, None], r.swapaxes(0, 1))  # r [-kappa]x, row by row
        new_r = _MATRIX @ turning
        new_r *= lengths
        new_r += begin_r
        moving = new_r[:, 0] * strain[0]
        moving += new_r[:, 1] * strain[1]
        moving += new_r[:, 2] * (strain[2] + 1.0)
        new_p = begin_p - lengths * (_MATRIX @ moving)
        last = change
        r -= new_r
        p -= new_p
        change = np.maximum(np.abs(r, out=r).max((0, 1, 2)), np.abs(p, out=p).max((0, 1)))
        r, p = new_r, new_p
        # What the next sweep would move, as they contract alike. What is lost (NaN) does not hold up, or hurry, others.
        ahead = change * np.fmin(change / last, 1.0)
        if not (ahead > _ROUNDING).any():
            break
    end_r = begin_r[:, :, 0] + lengths * (_LAST @ turning)
    end_p = begin_p[:, 0] - lengths * (_LAST @ moving)
    gathered = before[:, 0] + lengths * (_LAST @ both)
    energy = 0.5 * lengths * (_LAST @ (strain * local).sum(0))
    return _Piece(
        r,
        p,
        n,
        m,
        np.ascontiguousarray(end_r.reshape(9, -1).T).reshape(*batch, 3, 3),
        np.ascontiguousarray(end_p.T).reshape(*batch, 3),
        np.ascontiguousarray(gathered.T).reshape(*batch, 6),
        energy.reshape(batch),
        (ahead <= _SETTLED).reshape(batch),
    )


def _cross_into(out: Array, a: Array, b: Array) -> Array:
    """Write a x b into `out` by components along the first axes, and return it: many large arrays are slow to make."""
    for own, after, last in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.multiply(a[after], b[last], out=out[own])
        out[own] -= a[last] * b[after]
    return out


def piece_count(law: SectionFlexibilities, length: Array, wrench: Array) -> np.ndarray:
    """Return into how many pieces the intervals of each rod are divided, (...,): powers of two.

    With the most flexible section everywhere, 1/2 EI kappa^2 + n . e_z is the same along the rod (Kirchhoff), which
    bounds its curvature kappa.
    """
    middle = _flexibilities(law, length[..., None] * np.array([0.02, 0.5, 0.98]))
    bending = middle[..., 3:5].max((-2, -1))
    even = (np.ptp(middle, axis=-2) <= 1e-12 * middle.max(-2)).all(-1)
    force = np.linalg.norm(wrench[..., :3], axis=-1)
    moment = np.linalg.norm(wrench[..., 3:], axis=-1)
    turn = np.nan_to_num(length * np.sqrt((bending * moment) ** 2 + 4 * bending * force))
    wanted = np.maximum(turn / _TURN, np.where(even, 1, _UNEVEN_PIECES))
    return np.minimum(2 ** np.ceil(np.log2(wanted)), _MOST_PIECES).astype(int)


_AXIS = np.array([0.0, 0.0, 1.0])


def _flexibilities(law: SectionFlexibilities, u: Array) -> Array:
    """Return the six flexibilities of sections at u (..., points), (..., points, 6): stretch and curvature."""
    parts = (law.shear_x, law.shear_y, law.axial, law.bending_x, law.bending_y, law.torsion)
    flexibilities = np.empty((*u.shape, 6))
    for index, part in enumerate(parts):
        flexibilities[..., index] = part(u)
    return flexibilities


def _in_section(r: Array, p: Array, n: Array, m: Array) -> Array:
    """Return the wrench (n, m) about the tip as the section placed at (r, p) carries it, in its axes, (..., 6)."""
    both = np.stack(np.broadcast_arrays(n, m - cross(p, n)), axis=-2)
    return (both @ r).reshape(*p.shape[:-1], 6)


def _advance_tangent(tangent, spread, r, p, flexibility, n, m, line, matrix, last):
    """Return the twist of the section at the end of a piece per change of the tip's wrench, (..., 6, 6).

    With Ad the section's adjoint, A = Ad Lambda Ad^T its flexibility about the tip, B(n, m) the change of a dead
    wrench with the section's twist, and E what the weight between moves its own wrench, Y' = -A (I + E + B Y). Besides,
    E at the end of the piece, and where the sweeps settle.
    """
    adjoint, b = _adjoint(r, p), _turning(n, m)
    a = -(adjoint * flexibility[..., None, :]) @ adjoint.mT
    flat = (*a.shape[:-2], 36)
    start, before = tangent[..., None, :, :], spread[..., None, :, :]
    y, e = np.broadcast_to(start, a.shape), before
    pulled = None
    if line is not None:
        # A weight f at p moves with the section: d(p x f) = -[f]x (v - [p]x w).
        pulled = np.zeros_like(a)
        pulled[..., 3:, :3] = -skew(line)
        pulled[..., 3:, 3:] = skew(line) @ skew(p)
    for _ in range(_SWEEPS):
        if pulled is not None:
            fallen = (pulled @ y).reshape(flat)
            e = before + (matrix @ fallen).reshape(a.shape)
        rate = (a @ (_IDENTITY + e + b @ y)).reshape(flat)
        new = start + (matrix @ rate).reshape(a.shape)
        change, size = np.abs(new - y).max((-3, -2, -1)), np.abs(new).max((-3, -2, -1))
        y = new
        if not (change > _ROUNDING * size).any():
            break
    tangent = tangent + (last[..., None, :] @ rate)[..., 0, :].reshape(tangent.shape)
    if pulled is not None:
        spread = spread + (last[..., None, :] @ fallen)[..., 0, :].reshape(spread.shape)
    return tangent, spread, change <= _SETTLED * size


_IDENTITY = np.eye(6)


def _adjoint(r: Array, p: Array) -> Array:
    """Return Ad (..., 6, 6) of a section placed at (r, p): its twists as seen from the tip."""
    adjoint = np.zeros((*r.shape[:-2], 6, 6))
    adjoint[..., :3, :3] = adjoint[..., 3:, 3:] = r
    adjoint[..., :3, 3:] = skew(p) @ r
    return adjoint


def _turning(n: Array, m: Array) -> Array:
    """Return B (..., 6, 6): the change of a dead wrench (n, m) about the tip with a section's twist."""
    b = np.zeros((*n.shape[:-1], 6, 6))
    b[..., :3, 3:] = b[..., 3:, :3] = skew(n)
    b[..., 3:, 3:] = skew(m)
    return b


def _root_slope(rotation: Array, position: Array, n: Array, m: Array, tangent: Array, spread: Array) -> Array:
    """Return the change of the wrench that the root carries, in its axes, with the tip's: Ad^T (I + E + B Y)."""
    return _adjoint(rotation, position).mT @ (_IDENTITY + spread + _turning(n, m) @ tangent)


def _tilt_spin(tilting: Array, root: Array, moment_rate: Array, rotation: Array) -> Array:
    """Return the spin of the tilt at the root per length added there, in the tip's axes, (..., 3)."""
    across = np.asarray(tilting)[..., None] * np.array([1.0, 1.0, 0.0])
    tangent = rotation_tangent(-across * root[..., 3:])
    return (rotation @ (tangent @ (across * moment_rate)[..., None]))[..., 0]


def _tilt(tilting, root, rotation, position, tangent, spread, energy, n, m):
    """Return rotation, tangent and energy with the clamp at the root tilting under the root's moment."""
    compliance = np.zeros((*rotation.shape[:-2], 6))
    compliance[..., 3] = compliance[..., 4] = tilting
    turn = compliance * root
    tilted = rotation @ rotation_exp(-turn[..., 3:])
    energy = energy + 0.5 * (turn * root).sum(-1)
    if tangent is None:
        return tilted, tangent, energy
    turned = np.zeros((*rotation.shape[:-2], 6, 6))
    turned[..., 3:, 3:] = rotation @ rotation_tangent(-turn[..., 3:])
    turned[..., :3, 3:] = skew(position) @ turned[..., 3:, 3:]
    a = (turned * compliance[..., None, :]) @ _adjoint(rotation, position).mT
    return tilted, tangent - a @ (_IDENTITY + spread + _turning(n, m) @ tangent), energy
