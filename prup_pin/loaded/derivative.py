"""The exact derivative of the equations, geometric stiffness included.

A load's effect on an equation changes in three ways: the frame turns in which the equation looks at it (`seen`), a dead
load's point of application moves (`_dead_force`, the geometric stiffness of a dead load), and a loop's wrench turns
with its bodies (`LoopForces`). The rest is the laws' slopes (Pinocchio's spatial algebra; Featherstone, Rigid Body
Dynamics Algorithms, ch. 2).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..mechanism import Frame, Link
from ..spatial import Array, base_wrench_from_point, cross, rotation_exp, rotation_tangent, skew
from .residual import Evaluation, ModuleLoads, inertial_loads
from .rod import LoadedRod
from .state import Conditions, State
from .structure import TOGETHER, Structure


class Motions(NamedTuple):
    """Motions of parts of the chain that stand anywhere in it: c of them, among k coordinates and L loops.

    screws (N, c, 6), twists about the base's origin. turns (k, c): the motion turns the frame in which the row looks at
    its load; above (k, c): it moves all that the row's joint carries; below (k, c): it moves what `joint` (c,) carries,
    which is a part of that. carries (c, joints): 1 where the body moves; first and second (c, L): where that end of a
    loop does.
    """

    screws: Array
    turns: np.ndarray
    joint: np.ndarray
    above: np.ndarray
    below: np.ndarray
    carries: Array
    first: Array
    second: Array


def coordinate_motions(structure: Structure, at: Evaluation) -> Motions:
    """Return the motions of all coordinates."""
    above, carries = structure.above, structure.carries
    ends = _ends_carried(structure, carries)
    return Motions(at.screws, structure.moves_frame, structure.column_joint, above, above.T & ~above, carries, *ends)


def joint_motions(
    structure: Structure, state: State, at: Evaluation, conditions: Conditions, joints: Sequence[int]
) -> Motions:
    """Return the motions by displacements of joints' drawn places (`Conditions.offsets`), six a joint.

    A joint's place stands between the modules on the parent's side and the joint's own motion.
    """
    screws = np.zeros((len(at.screws), len(joints), 6, 6))
    for index, joint in enumerate(joints):
        own = state.joints[:, joint]
        turn = at.moving[:, joint, :3, :3] @ own[:, :3, :3].mT
        point = at.moving[:, joint, :3, 3] - (turn @ own[:, :3, 3, None])[..., 0]
        offset = conditions.offsets.get(joint, np.zeros(6))
        screws[:, index] = _place_screws(turn, point, structure.fixed[joint][:3, :3], offset)
    column = np.repeat(np.asarray(joints, int), 6)
    support, row = structure.support, structure.column_joint
    same = row[:, None] == column
    above = support[np.ix_(column, row)].T > 0
    turns = (above & ~same) | (same & (structure.column_order[:, None] >= 0))
    below = (support[np.ix_(row, column)] > 0) & ~above
    carries = support[column].astype(float)
    flat = screws.reshape(len(screws), -1, 6)
    return Motions(flat, turns, column, above, below, carries, *_ends_carried(structure, carries))


def loop_end_motions(
    structure: Structure, at: Evaluation, conditions: Conditions, ends: Sequence[tuple[int, int]]
) -> Motions:
    """Return the motions by displacements of loops' ends on their bodies (`Conditions.loop_offsets`), six an end."""
    screws = np.zeros((len(at.screws), len(ends), 6, 6))
    first, second = np.zeros((2, len(ends), 6, len(structure.loops)))
    for index, (loop, end) in enumerate(ends):
        frame = (structure.loops[loop].first, structure.loops[loop].second)[end]
        body = at.placements[:, frame.joint]
        placed = body @ structure.closure.end_placements(conditions.loop_offsets)[loop + end * len(structure.loops)]
        offset = conditions.loop_offsets.get((loop, end), np.zeros(6))
        screws[:, index] = _place_screws(placed[:, :3, :3], placed[:, :3, 3], frame.placement[:3, :3], offset)
        (first, second)[end][index, :, loop] = 1.0
    count, k = 6 * len(ends), len(structure.column_joint)
    never = np.zeros((k, count), bool)
    none, still = np.zeros(count, int), np.zeros((count, structure.count))
    flat, loops = screws.reshape(len(screws), -1, 6), (count, len(structure.loops))
    return Motions(flat, never, none, never, never, still, first.reshape(loops), second.reshape(loops))


def _place_screws(turn: Array, point: Array, drawn: Array, offset: Array) -> Array:
    """Return the six twists of a place's displacement (N, 6, 6), for a place at (turn, point) that is `offset` now.

    offset: (6,) or (N, 6). The rotation of the place is parent drawn exp(offset): translations are along the parent's
    axes.
    """
    now = offset[..., 3:]
    parent = turn @ rotation_exp(now).mT @ drawn.T
    spin = turn @ rotation_tangent(now).mT
    screws = np.zeros((len(turn), 6, 6))
    screws[:, :3, :3] = parent.mT
    screws[:, 3:, 3:] = spin.mT
    screws[:, 3:, :3] = cross(point[:, None], spin.mT)
    return screws


def _ends_carried(structure: Structure, carries: Array) -> tuple[Array, Array]:
    return (
        carries[:, [loop.first.joint for loop in structure.loops]],
        carries[:, [loop.second.joint for loop in structure.loops]],
    )


# ------------------------------------------------------------------------------------------------------------- columns


def matrix(structure: Structure, state: State, at: Evaluation, conditions: Conditions) -> Array:
    """Return d(residual)/d(unknowns), (N, m, m)."""
    nq, nd, ne, nc = structure.sizes
    n, columns = len(at.screws), nq + nd + ne
    observers, motions = _observers(structure, at), coordinate_motions(structure, at)
    loads = np.zeros((n, columns, columns + nc))
    _add_seen(structure, at, conditions, observers, motions, loads[:, :, :columns])
    start = 0
    for index, loop in enumerate(structure.loops):
        rows = slice(start, start + loop.size)
        weight = motions.second[:, index] - motions.first[:, index]
        loads[:, :, columns:][:, :, rows] = (weight[:, None] * observers) @ at.gaps.wrenches[:, rows].mT
        start += loop.size
    turned = _turned_loads(structure, state, at, loads[:, nq + nd :]) if ne else None
    out = np.zeros((n, columns + nc, columns + nc))
    _write_laws(structure, at, loads, turned, out)
    out[:, columns:, :columns] = _opened(structure, at, motions)
    own = np.arange(nq + nd, nq + nd + ne)
    out[:, own, own] += 1.0
    out[:, nq : nq + nd, : nq + nd] += structure.alone[nq:]
    for slot, place, rate, _ in structure.sliding_beams:
        out[:, nq + nd + 6 * slot : nq + nd + 6 * slot + 6, place] -= rate * at.modules.slopes.by_length[:, slot]
        if structure.root_inboard[slot]:
            rod, beam = at.modules.slopes.rods[slot]
            strain, change = rod.root_strain[:, beam], rod.root_rate[:, beam]
            out[:, place, place] += rate**2 * (change[:, 2] + (strain * change).sum(-1))
    return out


def motion_columns(structure: Structure, at: Evaluation, conditions: Conditions, motions: Motions) -> Array:
    """Return d(residual)/d(motions other than the coordinates'), (N, m, c).

    A weight that is spread along a beam keeps its direction in the beam's axes, as in `matrix`.
    """
    columns = at.screws.shape[1]
    observers = _observers(structure, at)
    out = np.zeros((len(at.screws), sum(structure.sizes), motions.screws.shape[1]))
    seen = np.zeros((*observers.shape[:2], out.shape[2]))
    _add_seen(structure, at, conditions, observers, motions, seen)
    _write_held_laws(structure, at, seen, out)
    out[:, columns:] = _opened(structure, at, motions)
    return out


def load_columns(structure: Structure, at: Evaluation) -> Array:
    """Return d(residual)/d(wrench on the tool), (N, m, 6)."""
    unit = base_wrench_from_point(at.tool[:, :3, 3])
    return wrench_columns(structure, at, np.full(6, structure.tool.joint), unit)


def wrench_columns(structure: Structure, at: Evaluation, bodies: np.ndarray, wrenches: Array) -> Array:
    """Return d(residual) of base wrenches (N, 6, c) on the bodies of joints (c,), (N, m, c)."""
    loads = (_observers(structure, at) @ wrenches) * structure.carries[:, bodies]
    out = np.zeros((len(loads), sum(structure.sizes), loads.shape[2]))
    _write_held_laws(structure, at, loads, out)
    return out


def mass_columns(structure: Structure, at: Evaluation, gravity: Array, links: Sequence[Link]) -> Array:
    """Return d(residual)/d(mass [kg] of links, at their centres), (N, m, c), under gravity (3,) or (N, 3).

    With gravity (N, 6): under a wrench per mass about the centre, weight and inertia in one.
    """
    joints = [link.joint for link in links]
    placed, levers = at.placements[:, joints], np.array([link.lever for link in links])
    centres = (placed[..., :3, :3] @ levers[:, :, None])[..., 0] + placed[..., :3, 3]
    field = np.reshape(gravity, (-1, 1, np.shape(gravity)[-1]))
    down = np.broadcast_to(field[..., :3], centres.shape)
    weights = np.concatenate((down, cross(centres, down)), axis=-1)
    if field.shape[-1] == 6:
        weights[..., 3:] += field[..., 3:]
    return wrench_columns(structure, at, np.array(joints, int), weights.mT)


def frame_columns(structure: Structure, at: Evaluation, frame: Frame) -> Array:
    """Return d(translation and turn of a frame fixed to a body)/d(unknowns), (N, 6, m), base axes."""
    out = np.zeros((len(at.screws), 6, sum(structure.sizes)))
    out[:, :, : at.screws.shape[1]] = frame_motions(at, frame, coordinate_motions(structure, at))
    return out


def frame_motions(at: Evaluation, frame: Frame, motions: Motions) -> Array:
    """Return the translation and turn of a frame fixed to a body by motions, (N, 6, c), base axes."""
    point = frame.at(at.placements)[:, :3, 3]
    twists = (motions.carries[:, frame.joint, None] * motions.screws).mT
    out = twists.copy()
    out[:, :3] -= skew(point) @ twists[:, 3:]
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
        block[:, :, 3:, :3] = cross(at.seen.point[..., None, :], axes)
        observers[:, nq + nd :] = block.reshape(len(observers), -1, 6)
    return observers


def _add_seen(
    structure: Structure, at: Evaluation, conditions: Conditions, observers: Array, motions: Motions, seen: Array
) -> None:
    """Add to seen (N, k, c) the change of what all observers see by motions, closure forces held."""
    carries, screws = structure.carries, motions.screws
    carried = at.carried[:, structure.column_joint]
    # what observers see as their frame turns
    v, w = observers[..., :3], observers[..., 3:]
    f, m = carried[..., :3], carried[..., 3:]
    turning = np.concatenate((cross(w, f), cross(v, f) + cross(w, m)), axis=-1)
    masked, plain = [(turning, screws, motions.turns)], []
    # what the loads do as their points move
    form = _dead_force(conditions.force_at(at.tool[:, :3, 3]), at.tool[:, :3, 3])
    for spring in conditions.springs:
        form = form - _spring(spring.stiffness_at(at.tool[:, :3, 3]), at.tool[:, :3, 3])
    at_tool = motions.carries[:, structure.tool.joint, None] * screws
    if motions.carries[:, structure.tool.joint].any():
        plain.append(((carries[:, structure.tool.joint, None] * observers) @ form, at_tool))
    for index, loop in enumerate(structure.loops):
        weight = carries[:, loop.second.joint] - carries[:, loop.first.joint]
        if not weight.any():
            continue
        held = weight[:, None] * observers
        for moves, form in ((motions.first, at.loops.by_first), (motions.second, at.loops.by_second)):
            if moves[:, index].any():
                plain.append((held @ form[:, index], moves[:, index, None] * screws))
    if conditions.gravity is not None or conditions.inertia is not None:
        masked += _weight_seen(structure, at, observers, conditions, motions)
    masked = [each for each in masked if each[2].any()]
    # by few samples at a time: large products wait for memory
    factors = [np.concatenate(each, axis=-1) for each in zip(*plain, strict=True)]
    for begin in range(0, len(seen), TOGETHER):
        some = slice(begin, begin + TOGETHER)
        own = seen[some]
        if factors:
            own += factors[0][some] @ factors[1][some].mT
        for observed, moved, mask in masked:
            part = observed[some] @ moved[some].mT
            part *= mask
            own += part


def _opened(structure: Structure, at: Evaluation, motions: Motions) -> Array:
    """Return the change of the loops' gaps by motions, (N, closures, c)."""
    out = np.zeros((len(at.screws), structure.closure_count, motions.screws.shape[1]))
    start = 0
    for index, loop in enumerate(structure.loops):
        rows = slice(start, start + loop.size)
        weight = motions.second[:, index] - motions.first[:, index]
        out[:, rows] = at.gaps.wrenches[:, rows] @ (weight[:, None] * motions.screws).mT
        start += loop.size
    return out


def _weight_seen(
    structure: Structure, at: Evaluation, observers: Array, conditions: Conditions, motions: Motions
) -> list[tuple[Array, Array, np.ndarray]]:
    """Return factors of what observers see more of the bodies' weights and inertia by motions, (N, k, c), masked."""
    screws = motions.screws
    form = np.zeros((len(screws), structure.count, 6, 6))
    if conditions.gravity is not None:
        masses, levers = structure.weighed(conditions.mass_factors)
        mass = structure.support @ masses
        centres = (at.placements[..., :3, :3] @ levers[:, :, None])[..., 0] + at.placements[..., :3, 3]
        first = structure.support @ (masses[:, None] * centres)
        g = skew(conditions.gravity)[..., None, :, :]
        form[..., 3:, :3] = -mass[:, None, None] * g
        form[..., 3:, 3:] = g @ skew(first)
    if conditions.inertia is not None:
        wrench, centres = inertial_loads(structure, at.placements, conditions)
        links = structure.support @ structure.body_of
        forces = skew(wrench[..., :3])
        form[..., 3:, :3] -= np.einsum("jl,nlab->njab", links, forces)
        form[..., 3:, 3:] += np.einsum("jl,nlab->njab", links, forces @ skew(centres))
    row = form[:, structure.column_joint]
    column = row if motions.joint is structure.column_joint else form[:, motions.joint]
    return [
        ((observers[..., None, :] @ row)[..., 0, :], screws, motions.above),
        (observers, (column @ screws[..., None])[..., 0], motions.below),
    ]


def _dead_force(force: Array, point: Array) -> Array:
    """Return B (N, 6, 6): y . B x is what a screw y sees more of a dead force as its point moves with the twist x."""
    form = np.zeros((len(force), 6, 6))
    cross = skew(force)
    form[:, 3:, :3] = -cross
    form[:, 3:, 3:] = cross @ skew(point)
    return form


def _spring(stiffness: Array, point: Array) -> Array:
    """Return B (N, 6, 6): y . B x is what a screw y sees less of a spring as its point moves with the twist x."""
    moves = np.concatenate((np.broadcast_to(np.eye(3), (len(point), 3, 3)), -skew(point)), axis=2)
    return moves.mT @ stiffness @ moves


# ---------------------------------------------------------------------------------------------------------- module rows


def _turn_into_law_axes(structure: Structure, at: Evaluation, loads: Array) -> None:
    """Turn changes of loads (N, n, 6, c) from the axes of the inboard frames into those of the modules' laws."""
    plain, tips = ~structure.is_beam, structure.at_outer
    if plain.any():
        loads[:, plain, 3:] = at.frames.tangent[:, plain].mT @ loads[:, plain, 3:]
    if tips.any():
        back = at.frames.turn[:, tips].mT
        loads[:, tips, :3] = back @ loads[:, tips, :3]
        loads[:, tips, 3:] = back @ loads[:, tips, 3:]


def _turned_loads(structure: Structure, state: State, at: Evaluation, rows: Array) -> Array:
    """Return the change of the modules' loads in the axes of their laws by all unknowns, (N, n, 6, m).

    `rows` (N, 6 n, m): the change of what their observers see; what is returned takes its place in memory.
    """
    nq, nd, _, _ = structure.sizes
    n, count = len(rows), len(structure.modules)
    turned = rows.reshape(n, count, 6, -1)
    index = np.arange(count)
    own = nq + nd + 6 * index[:, None] + np.arange(6)
    seen: ModuleLoads = at.seen
    # A load's point moves with the module's own translation: dm = f x dt.
    cross = skew(seen.force)
    for slot in index[~structure.at_inner]:
        turned[:, slot, 3:, own[slot, :3]] += cross[:, slot].transpose(2, 0, 1)
    _turn_into_law_axes(structure, at, turned)
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


def _write_laws(structure: Structure, at: Evaluation, loads: Array, turned: Array | None, out: Array) -> None:
    """Write what balances and laws make of changed loads.

    `loads` (N, k, c): the change of what all observers see; `turned` (N, n, 6, c): of the modules' loads, law's axes.
    """
    nq, nd, ne, _ = structure.sizes
    slopes, along = at.modules.slopes, loads[:, : nq + nd]
    if turned is not None:
        np.matmul(-slopes.by_load, turned, out=out[:, nq + nd : nq + nd + ne].reshape(turned.shape))
        along = along.copy() if structure.sliding_beams else along
        for slot, place, rate, _ in structure.sliding_beams:
            rod, column = slopes.rods[slot]
            along[:, place] = rate * _slid(structure, rod, column, slot, turned[:, slot])
    along = structure.borne(along)
    out[:, :nq] = along[:, :nq]
    out[:, nq : nq + nd] = -at.drives.slope[..., None] * along[:, nq:]


def _write_held_laws(structure: Structure, at: Evaluation, loads: Array, out: Array) -> None:
    """Write the same of loads that change while no module deforms more."""
    nq, nd, ne, _ = structure.sizes
    turned = None
    if ne:
        turned = loads[:, nq + nd :].reshape(len(loads), len(structure.modules), 6, -1)
        _turn_into_law_axes(structure, at, turned)
    _write_laws(structure, at, loads, turned, out)


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
    once = cross(vector, moment)
    twice = cross(vector, once)
    along = second_rate * twice[..., :, None] - first_rate * once[..., :, None]
    return first * skew(moment) - second * (skew(once) + skew(vector) @ skew(moment)) + along * vector[..., None, :]
