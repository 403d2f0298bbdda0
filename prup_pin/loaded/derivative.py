"""The exact derivative of the equations, geometric stiffness included.

A load's effect on an equation changes in three ways: the frame turns in which the equation looks at it (`seen`), a dead
load's point of application moves (`_dead_force`, the geometric stiffness of a dead load), and a loop's wrench turns
with its bodies (`LoopForces`). The rest is the laws' slopes (Pinocchio's spatial algebra; Featherstone, Rigid Body
Dynamics Algorithms, ch. 2).
"""

from __future__ import annotations

import numpy as np

from ..mechanism import Frame
from ..spatial import Array, base_wrench_from_point, skew
from .residual import Evaluation, ModuleLoads, masses_of
from .rod import LoadedRod
from .state import Conditions, State
from .structure import Structure

__all__ = ["conjugate_moment_slope", "frame_columns", "load_columns", "matrix"]


def matrix(structure: Structure, state: State, at: Evaluation, conditions: Conditions) -> Array:
    """Return d(residual)/d(unknowns), (N, m, m)."""
    nq, nd, ne, nc = structure.sizes
    n, columns = len(at.screws), nq + nd + ne
    observers = _observers(structure, at)
    seen = _seen(structure, at, conditions, observers)
    by_force = np.zeros((n, columns, nc))
    by_motion = np.zeros((n, nc, columns))
    start = 0
    for loop in structure.loops:
        rows = slice(start, start + loop.size)
        weight = structure.carries[:, loop.second.joint] - structure.carries[:, loop.first.joint]
        by_force[:, :, rows] = (weight[:, None] * observers) @ at.gaps.wrenches[:, rows].mT
        by_motion[:, rows] = at.gaps.wrenches[:, rows] @ (weight[:, None] * at.screws).mT
        start += loop.size
    loads = np.concatenate((seen, by_force), axis=-1)
    out = np.zeros((n, columns + nc, columns + nc))
    out[:, :nq] = loads[:, :nq]
    out[:, nq : nq + nd] = -at.drives.slope[..., None] * loads[:, nq : nq + nd]
    index = np.arange(nq, nq + nd)
    out[:, index, index] += 1.0
    out[:, columns:, :columns] = by_motion
    if ne:
        turned = _turned_loads(structure, state, at, loads[:, nq + nd :])
        _write_module_rows(structure, at, turned, out)
        _write_sliding_rows(structure, at, turned, out)
    return out


def load_columns(structure: Structure, at: Evaluation) -> Array:
    """Return d(residual)/d(wrench on the tool), (N, m, 6)."""
    nq, nd, ne, _ = structure.sizes
    n = len(at.screws)
    unit = base_wrench_from_point(at.tool[:, :3, 3])
    held = structure.carries[:, structure.tool.joint, None] * _observers(structure, at)
    loads = held @ unit
    out = np.zeros((n, sum(structure.sizes), 6))
    out[:, :nq] = loads[:, :nq]
    out[:, nq : nq + nd] = -at.drives.slope[..., None] * loads[:, nq : nq + nd]
    if ne:
        turned = _in_law_axes(structure, at, loads[:, nq + nd :].reshape(n, len(structure.modules), 6, 6))
        out[:, nq + nd : nq + nd + ne] = -(at.modules.slopes.by_load @ turned).reshape(n, ne, 6)
        for slot, place, rate, _ in structure.sliding_beams:
            rod, column = at.modules.slopes.rods[slot]
            out[:, place] = rate * _slid(structure, rod, column, slot, turned[:, slot])
    return out


def frame_columns(structure: Structure, at: Evaluation, frame: Frame) -> Array:
    """Return d(translation and turn of a frame fixed to a body)/d(unknowns), (N, 6, m), base axes."""
    n, columns = len(at.screws), at.screws.shape[1]
    point = (at.placements[:, frame.joint] @ frame.placement)[:, :3, 3]
    twists = (structure.carries[:, frame.joint, None] * at.screws).mT
    out = np.zeros((n, 6, sum(structure.sizes)))
    out[:, :, :columns] = twists
    out[:, :3, :columns] -= skew(point) @ twists[:, 3:]
    return out


# ---------------------------------------------------------------------------------------------- what equations look at


def _observers(structure: Structure, at: Evaluation) -> Array:
    """Return the screws along which every equation looks at what it carries, (N, k, 6)."""
    nq, nd, _, _ = structure.sizes
    observers = at.screws.copy()
    if structure.modules:
        axes = at.frames.inboard[..., :3, :3].mT
        block = np.zeros((len(observers), len(structure.modules), 6, 6))
        block[:, :, :3, :3] = axes
        block[:, :, 3:, 3:] = axes
        block[:, :, 3:, :3] = np.cross(at.seen.point[..., None, :], axes)
        observers[:, nq + nd :] = block.reshape(len(observers), -1, 6)
    return observers


def _seen(structure: Structure, at: Evaluation, conditions: Conditions, observers: Array) -> Array:
    """Return the change of what all observers see as the coordinates move, closure forces held, (N, k, k)."""
    carries, screws = structure.carries, at.screws
    carried = at.carried[:, structure.column_joint]
    # what observers see as their frame turns
    v, w = observers[..., :3], observers[..., 3:]
    f, m = carried[..., :3], carried[..., 3:]
    turning = np.concatenate((np.cross(w, f), np.cross(v, f) + np.cross(w, m)), axis=-1)
    seen = (turning @ screws.mT) * structure.moves_frame
    # what the loads do as their points move
    left, right = [], []
    form = _dead_force(conditions.wrench[:, :3], at.tool[:, :3, 3])
    on_tool = carries[:, structure.tool.joint]
    left.append((on_tool[:, None] * observers) @ form)
    right.append(on_tool[:, None] * screws)
    for index, loop in enumerate(structure.loops):
        first, second = carries[:, loop.first.joint], carries[:, loop.second.joint]
        weight = second - first
        if not weight.any():
            continue
        held = weight[:, None] * observers
        left += [held @ at.loops.by_first[:, index], held @ at.loops.by_second[:, index]]
        right += [first[:, None] * screws, second[:, None] * screws]
    seen += np.concatenate(left, axis=-1) @ np.concatenate(right, axis=-1).mT
    if conditions.gravity is not None:
        seen += _weight_seen(structure, at, observers, conditions)
    return seen


def _weight_seen(structure: Structure, at: Evaluation, observers: Array, conditions: Conditions) -> Array:
    """Return what observers see more of the bodies' weights as these move, (N, k, k)."""
    screws, joint, above = at.screws, structure.column_joint, structure.above
    masses = masses_of(structure, conditions)
    mass = structure.support @ masses
    centres = (at.placements[..., :3, :3] @ structure.levers[:, :, None])[..., 0] + at.placements[..., :3, 3]
    first = structure.support @ (masses[:, None] * centres)
    form = np.zeros((len(screws), structure.count, 6, 6))
    assert conditions.gravity is not None
    g = skew(conditions.gravity)
    form[..., 3:, :3] = -mass[:, None, None] * g
    form[..., 3:, 3:] = g @ skew(first)
    column = form[:, joint]
    deep = ((observers[..., None, :] @ column)[..., 0, :] @ screws.mT) * above
    shallow = observers @ (column @ screws[..., None])[..., 0].mT * (above.T & ~above)
    return deep + shallow


def _dead_force(force: Array, point: Array) -> Array:
    """Return B (N, 6, 6): y . B x is what a screw y sees more of a dead force as its point moves with the twist x."""
    form = np.zeros((len(force), 6, 6))
    cross = skew(force)
    form[:, 3:, :3] = -cross
    form[:, 3:, 3:] = cross @ skew(point)
    return form


# ---------------------------------------------------------------------------------------------------------- module rows


def _in_law_axes(structure: Structure, at: Evaluation, loads: Array) -> Array:
    """Return changes of loads (N, n, 6, c), in the axes of the inboard frames, in the axes of the modules' laws."""
    turned = loads.copy()
    plain, tips = ~structure.is_beam, structure.at_outer
    if plain.any():
        turned[:, plain, 3:] = at.frames.tangent[:, plain].mT @ loads[:, plain, 3:]
    if tips.any():
        back = at.frames.turn[:, tips].mT
        turned[:, tips, :3] = back @ loads[:, tips, :3]
        turned[:, tips, 3:] = back @ loads[:, tips, 3:]
    return turned


def _turned_loads(structure: Structure, state: State, at: Evaluation, rows: Array) -> Array:
    """Return the change of the modules' loads in the axes of their laws by all unknowns, (N, n, 6, m).

    `rows` (N, 6 n, m): the change of what their observers see.
    """
    nq, nd, _, _ = structure.sizes
    n, count = len(rows), len(structure.modules)
    rows = rows.reshape(n, count, 6, -1).copy()
    index = np.arange(count)
    own = nq + nd + 6 * index[:, None] + np.arange(6)
    seen: ModuleLoads = at.seen
    # A load's point moves with the module's own translation: dm = f x dt.
    cross = skew(seen.force)
    for slot in index[~structure.at_inner]:
        rows[:, slot, 3:, own[slot, :3]] += cross[:, slot].transpose(2, 0, 1)
    turned = _in_law_axes(structure, at, rows)
    plain = ~structure.is_beam
    if plain.any():
        bent = conjugate_moment_slope(state.strain[..., 3:], seen.moment)
        for slot in index[plain]:
            turned[:, slot, 3:, own[slot, 3:]] += bent[:, slot].transpose(2, 0, 1)
    for slot in index[structure.at_outer]:
        back, tangent = at.frames.turn[:, slot].mT, at.frames.tangent[:, slot]
        turned[:, slot, :3, own[slot, 3:]] += (back @ cross[:, slot] @ tangent).transpose(2, 0, 1)
        turned[:, slot, 3:, own[slot, 3:]] += (back @ skew(seen.moment[:, slot]) @ tangent).transpose(2, 0, 1)
    return turned


def _write_module_rows(structure: Structure, at: Evaluation, turned: Array, out: Array) -> None:
    """Write the rows strain - law(load) of all wrench modules."""
    nq, nd, ne, _ = structure.sizes
    first = nq + nd
    slopes = at.modules.slopes
    out[:, first : first + ne] = -(slopes.by_load @ turned).reshape(len(out), ne, -1)
    diagonal = np.arange(first, first + ne)
    out[:, diagonal, diagonal] += 1.0
    for slot, place, rate, _ in structure.sliding_beams:
        out[:, first + 6 * slot : first + 6 * slot + 6, place] -= rate * slopes.by_length[:, slot]


def _write_sliding_rows(structure: Structure, at: Evaluation, turned: Array, out: Array) -> None:
    """Write the rows of the forces that move slides along their beams."""
    for slot, place, rate, _ in structure.sliding_beams:
        rod, column = at.modules.slopes.rods[slot]
        out[:, place] = rate * _slid(structure, rod, column, slot, turned[:, slot])
        if structure.root_inboard[slot]:
            strain, change = rod.root_strain[:, column], rod.root_rate[:, column]
            out[:, place, place] += rate**2 * (change[:, 2] + (strain * change).sum(-1))


def _slid(structure: Structure, rod: LoadedRod, column: int, slot: int, loads: Array) -> Array:
    """Return the change of the force along a slide, (N, c), with that of its beam's load, (N, 6, c)."""
    if not structure.root_inboard[slot]:
        return -loads[:, 2] - (rod.tip_strain[:, column, None, :] @ loads)[:, 0]
    assert rod.root_slope is not None
    share = rod.root_strain[:, column] + np.eye(6)[2]
    return (share[:, None] @ (rod.root_slope[:, column] @ loads))[:, 0]


def conjugate_moment_slope(vector: Array, moment: Array) -> Array:
    """Return d(T(r)^T m)/dr of rotation vectors r and moments m (..., 3), (..., 3, 3); T as in `rotation_tangent`.

    With T = I + a [r]x + b [r]x^2 and a, b functions of |r|.
    """
    squared = (vector * vector).sum(-1)[..., None, None]
    small = squared < 1e-2
    angle = np.sqrt(np.where(small, 1.0, squared))
    sine, cosine = np.sin(angle), np.cos(angle)
    first = np.where(small, 0.5 - squared / 24 + squared**2 / 720 - squared**3 / 40320, (1 - cosine) / angle**2)
    second = np.where(small, 1 / 6 - squared / 120 + squared**2 / 5040 - squared**3 / 362880, (angle - sine) / angle**3)
    # a'/|r| and b'/|r|
    first_rate = np.where(
        small, -1 / 12 + squared / 180 - squared**2 / 6720, (angle * sine - 2 * (1 - cosine)) / angle**4
    )
    second_rate = np.where(
        small, -1 / 60 + squared / 1260 - squared**2 / 60480, (angle * (1 - cosine) - 3 * (angle - sine)) / angle**5
    )
    once = np.cross(vector, moment)
    twice = np.cross(vector, once)
    along = second_rate * twice[..., :, None] - first_rate * once[..., :, None]
    return first * skew(moment) - second * (skew(once) + skew(vector) @ skew(moment)) + along * vector[..., None, :]
