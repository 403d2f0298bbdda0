"""What a small change of a loaded robot does to the frames that are watched, to first order about its equilibria.

With the equations r(x) = 0 of the deformed mechanism and the watched frames y(x), a change dr of the equations moves
the frames by dy = -Y R^-1 dr, with R = dr/dx and Y = dy/dx at the loaded equilibrium, geometric stiffness included. By
duality a module's deformation beyond its law appears through the wrench Jacobian that carries the load to it.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from ..kernel import NEGLIGIBLE
from ..mechanism import Frame, Link, MovedParts
from ..spatial import Array, cross, motion_between, rotation_exp, skew
from . import derivative
from .border import left_solved
from .border import slack as slack_of
from .equilibrium import Equilibria
from .other_values import group_of, law_rows, present_values
from .state import Conditions, State, with_actuators


class FirstOrder:
    """First-order changes about equilibria of n samples.

    What is watched has 6 rows a frame: translation and small turn in base axes [m, rad]; `R` is their number.
    """

    def __init__(self, found: Equilibria, frames: Sequence[Frame] | None = None):
        """`frames` are watched, by default the tool alone."""
        self.found = found
        self.chain, self.structure = found.chain, found.chain.structure
        mechanism = self.chain.mechanism
        self.frames = (self.chain.tool,) if frames is None else tuple(mechanism.own(frame) for frame in frames)
        nq, nd, _, _ = self.chain.sizes
        #: Rows of the equations that state each module's deformation.
        self.rows: dict[str, slice] = {}
        for slot, name in enumerate(self.chain.structure.names):
            self.rows[name] = slice(nq + nd + 6 * slot, nq + nd + 6 * slot + 6)
        layout, ratios = self.chain.structure.layout, self.chain.values.drive_ratios
        for index, name in enumerate(layout.drive_names):
            row = nq + int(layout.drive_rows[index])
            self.rows[name] = slice(row, row + 1)
        #: Load of a drive module per force along its joint.
        self.ratio = {name: float(ratios[index, 0, 0]) for index, name in enumerate(layout.drive_names)}
        self._kept: dict[Hashable, Any] = {}
        self._latest: dict[Hashable, tuple[Hashable, Any]] = {}

    def __len__(self) -> int:
        return len(self.found.converged)

    def once(self, key: Hashable, compute: Callable[[], Any]) -> Any:
        """Return what `compute` gives, which depends on the equilibria and the key alone; computed once."""
        if key not in self._kept:
            self._kept[key] = compute()
        return self._kept[key]

    def latest(self, key: Hashable, question: Hashable, compute: Callable[[], Any]) -> Any:
        """Return what `compute` gives: a function of equilibria, key and question. Of each key the last one is kept."""
        kept = self._latest.get(key)
        if kept is None or kept[0] != question:
            kept = self._latest[key] = (question, compute())
        return kept[1]

    @cached_property
    def matrix(self) -> Array:
        """d(equations)/d(unknowns), (n, m, m)."""
        return self.found.matrix()

    @cached_property
    def by_row(self) -> Array:
        """Minus what is watched per residual of the equations, (n, R, m)."""
        columns = [derivative.frame_columns(self.structure, self.found.evaluation, frame) for frame in self.frames]
        return left_solved(self.matrix, self.found.rigid.border, np.concatenate(columns, axis=1))

    @cached_property
    def by_wrench(self) -> Array:
        """What is watched per wrench on the tool, (n, R, 6): at the tool the compliance under load."""
        return -self.by_row @ derivative.load_columns(self.structure, self.found.evaluation)

    def loads(self, module: str) -> Array:
        """Return a module's loads (n, k) in the axes of its law."""
        return module_loads(self.found, module)

    def by_strain(self, module: str) -> Array:
        """Return what is watched per deformation of a module, (n, R, k): its wrench Jacobian, transposed."""
        return self.by_row[:, :, self.rows[module]] * self.ratio.get(module, 1.0)

    def by_resistance(self, places: Sequence[int]) -> Array:
        """Return what is watched per resisting torque in free or driven joints, (n, R, r).

        places: among the chain's moving joints, as in all that is told of them here.
        """
        return self.by_torque[:, :, list(places)]

    @cached_property
    def by_torque(self) -> Array:
        """What is watched per resisting torque in each free and driven joint, (n, R, j)."""
        torque = self.chain.by_torque(self.found.evaluation)
        return -self.by_row[:, :, : torque.shape[1]] * torque[:, None]

    def of_joints(self, places: Sequence[int]) -> FirstOrder:
        """Return the same with joints watched in the place of frames: R displacements [m, rad].

        places: among the moving joints. For what loads the robot or lets it give way; where parts are displaced joints
        stand elsewhere without any load, too.
        """
        other = FirstOrder(self.found, ())
        other.matrix, other.by_row = self.matrix, self._joints_by_row[:, list(places)]
        return other

    def joints_by_resistance(self, places: tuple[int, ...]) -> Array:
        """Return d(displacement)/d(resisting torque) of joints, (n, r, r)."""
        return self._joints_by_torque[:, list(places)][:, :, list(places)]

    @cached_property
    def _joints_by_torque(self) -> Array:
        """d(displacement)/d(torque) of all free and driven joints, (n, j, j)."""
        torque = self.chain.by_torque(self.found.evaluation)
        return -self._joints_by_row[:, :, : torque.shape[1]] * torque[:, None]

    @cached_property
    def _joints_by_row(self) -> Array:
        """Minus the displacement of all free and driven joints per residual of the equations, (n, j, m)."""
        count = len(self.chain.moving)
        rows = np.zeros((len(self), count, self.matrix.shape[-1]))
        rows[:, np.arange(count), np.arange(count)] = 1.0
        return left_solved(self.matrix, self.found.rigid.border, rows)

    def by_joint(self, joint: int) -> Array:
        """Return what is watched per displacement of a joint's drawn place, (n, R, 6), as in `Conditions.offsets`."""
        joints = self._neighbours(joint)

        def compute() -> Array:
            found = self.found
            return self._by_motions(
                derivative.joint_motions(self.structure, found.state, found.evaluation, found.conditions, joints)
            )

        start = 6 * (joint - joints[0])
        return self.once(("joints", joints[0]), compute)[..., start : start + 6]

    def _neighbours(self, joint: int) -> range:
        """Return the joints that are taken together with one: what equations look at is the same for all of them."""
        count = max(1, _TOGETHER // max(6 * len(self) * sum(self.chain.sizes), 1))
        first = joint - (joint - 1) % count
        return range(first, min(first + count, self.chain.structure.count))

    def by_joint_motion(self, joint: int) -> Array:
        """Return what is watched per motion of a joint beyond its own, (n, R, 6).

        Translation and small turn of its moving side, in that side's axes about its origin.
        """

        def compute() -> Array:
            found = self.found
            own, offset = found.state.joints[:, joint], found.conditions.offsets.get(joint, np.zeros(6))
            turn = own[:, :3, :3]
            shift = self.by_joint(joint)[..., :3] @ (
                self.chain.structure.fixed[joint][:3, :3] @ rotation_exp(offset[..., 3:])
            )
            lever = skew(own[:, :3, 3]) @ turn
            turned = self.by_joint(joint)[..., 3:] @ turn + shift @ lever
            return np.concatenate((shift @ turn, turned), axis=-1)

        return self.once(("joint motion", joint), compute)

    def joint_loads(self, joint: int) -> Array:
        """Return the wrench that a joint carries, (n, 6), in the axes of its moving side about its origin."""
        at = self.found.evaluation
        axes, point = at.moving[:, joint, :3, :3].mT, at.moving[:, joint, :3, 3]
        force, moment = at.carried[:, joint, :3], at.carried[:, joint, 3:]
        about = moment - cross(point, force)
        return np.concatenate(((axes @ force[..., None])[..., 0], (axes @ about[..., None])[..., 0]), axis=1)

    def by_loop_end(self, loop: int, end: int) -> Array:
        """Return what is watched per displacement of a loop's end, (n, R, 6), as in `Conditions.loop_offsets`."""

        def compute() -> Array:
            at, conditions = self.found.evaluation, self.found.conditions
            ends = [(each, end) for each in range(len(self.structure.loops)) for end in (0, 1)]
            return self._by_motions(derivative.loop_end_motions(self.structure, at, conditions, ends))

        start = 6 * (2 * loop + end)
        return self.once("loop ends", compute)[..., start : start + 6]

    def by_parts(self, parts: MovedParts) -> Array:
        """Return what is watched, (n, R), per amount by which parts of the robot are displaced together.

        Beams and other modules keep their places. NaN where redundant loops do not close any more.
        """
        found, structure = self.found, self.structure
        at, conditions = found.evaluation, found.conditions
        watched, change = np.zeros(self.by_row.shape[:2]), np.zeros((len(self), sum(structure.sizes)))
        for shifts, motions_of in (
            (parts.joints, lambda places: derivative.joint_motions(structure, found.state, at, conditions, places)),
            (parts.loop_ends, lambda places: derivative.loop_end_motions(structure, at, conditions, places)),
        ):
            if not shifts:
                continue
            motions, amounts = motions_of([*shifts]), np.zeros((len(shifts), 6))
            amounts[:, :3] = [*shifts.values()]
            moved = [derivative.frame_motions(at, frame, motions) for frame in self.frames]
            watched += np.concatenate(moved, axis=1) @ amounts.ravel()
            change += derivative.motion_columns(structure, at, conditions, motions) @ amounts.ravel()
        for index, frame in enumerate(self.frames):
            if frame.name in parts.frames:
                watched[:, 6 * index : 6 * index + 3] += (
                    at.placements[:, frame.joint, :3, :3] @ parts.frames[frame.name]
                )
        change += self._displaced_loads(parts)
        return np.where(self._askew(change[..., None]), np.nan, watched + self.by_residual(change))

    def _displaced_loads(self, parts: MovedParts) -> Array:
        """Return the change of the equations' residual, (n, m), by loads on the tool and on links that are displaced.

        On their own bodies: what the displacement of whole bodies does is in these bodies' motions.
        """
        at, conditions, tool = self.found.evaluation, self.found.conditions, self.chain.tool
        change = np.zeros((len(self), sum(self.chain.sizes)))
        if tool.name in parts.frames:
            shift = at.placements[:, tool.joint, :3, :3] @ parts.frames[tool.name]
            more = np.zeros((len(self), 6))
            for spring in conditions.springs:
                more[:, :3] -= (spring.stiffness_at(at.tool[:, :3, 3]) @ shift[..., None])[..., 0]
            more[:, 3:] = cross(shift, conditions.force_at(at.tool[:, :3, 3]))
            change += (derivative.load_columns(self.structure, at) @ more[..., None])[..., 0]
        for index, link in enumerate(self.chain.mechanism.links):
            if link.name not in parts.links or (conditions.gravity is None and conditions.inertia is None):
                continue
            factor = 1.0 if conditions.mass_factors is None else conditions.mass_factors[index]
            force = np.zeros((len(self), 3))
            if conditions.gravity is not None:
                force += factor * link.mass * conditions.gravity
            if conditions.inertia is not None:
                force += factor * conditions.inertia[:, index, :3]
            shift = at.placements[:, link.joint, :3, :3] @ parts.links[link.name]
            wrench = np.concatenate((np.zeros_like(force), cross(shift, force)), axis=1)
            change += derivative.wrench_columns(self.structure, at, np.array([link.joint]), wrench[..., None])[..., 0]
        return change

    def by_mass(self, link: Link, gravity: Array) -> Array:
        """Return what is watched per mass of a link, (n, R), under gravity (3,) or (n, 3), or as in `mass_columns`."""
        return -(self.by_row @ derivative.mass_columns(self.structure, self.found.evaluation, gravity, [link]))[..., 0]

    def by_values(self, module: str, ahead: Mapping[str, Any], behind: Mapping[str, Any]) -> Array:
        """Return what is watched, (n, R), between two sets of values of a module, both near the present ones."""
        return self._by_law(law_rows(self.found, module, behind), law_rows(self.found, module, ahead))

    def by_weight_of(self, module: str, heavier: Conditions) -> Array:
        """Return what is watched, (n, R), where a module's own weight is that of other conditions, its loads held."""
        values, other = present_values(self.chain, module), replace(self.found, conditions=heavier)
        return self._by_law(law_rows(self.found, module, values), law_rows(other, module, values))

    def _by_law(self, before: Mapping[int, Array], after: Mapping[int, Array]) -> Array:
        """Return what is watched, (n, R), between two states of one module's rows of the residual."""
        rows = list(after)
        change = np.stack([after[row] - before[row] for row in rows], axis=-1)
        return -(self.by_row[:, :, rows] @ change[..., None])[..., 0]

    def _by_motions(self, motions: derivative.Motions) -> Array:
        """Return what is watched per motion of parts that are no coordinates, (n, R, c).

        NaN where redundant loops do not close any more.
        """
        found = self.found
        moved = [derivative.frame_motions(found.evaluation, frame, motions) for frame in self.frames]
        columns = derivative.motion_columns(self.structure, found.evaluation, found.conditions, motions)
        watched = np.concatenate(moved, axis=1) - self.by_row @ columns
        return np.where(self._askew(columns)[:, None], np.nan, watched)

    def _askew(self, change: Array) -> np.ndarray:
        """Return which changes (n, m, c) of the residual leave no equilibrium near, (n, c).

        What the equations ask beyond what the robot can do has none: a planar loop does not close askew.
        """
        border = self.found.rigid.border
        if not border.size:
            return np.zeros((len(change), change.shape[2]), bool)
        slack = self.once("slack", lambda: slack_of(self.matrix, border))
        # by equations of like size: what is zero is rounding beside the largest slack and the largest change, or a unit
        rows = np.abs(self.matrix).max(axis=2)
        rows = np.where(rows > 0, rows, 1.0)
        sizes = np.abs(slack) * rows[:, None, :]
        changes = (np.abs(change) / rows[..., None]).max(axis=1)[:, None, :]
        rounding = NEGLIGIBLE * sizes.max(axis=2)[..., None] * changes + _ROUNDING * sizes.sum(axis=2)[..., None]
        return np.asarray((np.abs(slack @ change) > rounding).any(axis=1))

    def by_residual(self, change: Array) -> Array:
        """Return what is watched, (n, R), per change (n, m) of the equations' residual."""
        return -(self.by_row @ change[..., None])[..., 0]

    def by_equations(self, state: State, conditions: Conditions) -> Array:
        """Return what is watched, (n, R), where state or conditions are a little other than at the equilibria.

        NaN where there is none near: where redundant loops no longer close.
        """
        at = self.chain.evaluate(self.found.rigid, state, conditions)
        before = self.found.evaluation
        change = at.residual - before.residual
        moved = [motion_between(frame.at(before.placements), frame.at(at.placements)) for frame in self.frames]
        watched = np.concatenate(moved, axis=1) + self.by_residual(change)
        return np.where(self._askew(change[..., None]), np.nan, watched)

    def by_conditions(self, after: Conditions) -> Array:
        """Return what is watched, (n, R), from the equilibria's conditions to others at the present state."""
        other = self.chain.evaluate(self.found.rigid, self.found.state, after)
        return self.by_residual(other.residual - self.found.evaluation.residual)

    def by_travel(self, column: int) -> Array:
        """Return what is watched per travel of an actuated joint, (n, R)."""

        def compute() -> Array:
            # The joint moves, and with it the length of a beam that it pushes out of its clamp.
            now = self.found.conditions
            step = np.zeros((len(self), len(self.chain.mechanism.actuated_dofs)))
            step[:, column] = _STEP
            state = with_actuators(self.structure, self.found.state, step)
            moved = replace(now, actuators=step if now.actuators is None else now.actuators + step)
            return self.by_equations(state, moved) / _STEP

        return self.once(("travel", column), compute)


#: Numbers in the largest arrays by which joints are taken together.
_TOGETHER = 4_000_000
#: Step of differences at the present state [m, rad], and what is rounding beside a unit of all unknowns.
_STEP, _ROUNDING = 1e-6, 1e-12


def module_loads(found: Equilibria, module: str) -> Array:
    """Return a module's loads (n, k) in the axes of its law."""
    layout = found.chain.structure.layout
    if module in layout.wrench_names:
        return found.evaluation.loads[:, layout.wrench_names.index(module)]
    slot = layout.drive_names.index(module)
    force = found.evaluation.drive_loads[:, int(layout.drive_rows[slot])]
    return (force * found.chain.values.drive_ratios[slot, 0, 0])[:, None]


def elastic_deformation(found: Equilibria, module: str) -> Array:
    """Return a module's elastic deformation under its present load, (n, k); of a nonlinear one as at rest."""
    layout, values = found.chain.structure.layout, found.chain.values
    if module in layout.wrench_names:
        slot = layout.wrench_names.index(module)
        index, column = group_of(values.wrench_groups, slot)
        group, at = values.wrench_groups[index], found.rigid.geometries[index]
        load = found.evaluation.loads[:, group.slots]
        lam = group.kind.compliance(group.values, at, None)
        return (np.broadcast_to(lam, (*load.shape, load.shape[-1])) @ load[..., None])[:, column, :, 0]
    slot = layout.drive_names.index(module)
    index, column = group_of(values.drive_groups, slot)
    group, at = values.drive_groups[index], found.rigid.geometries[len(values.wrench_groups) + index]
    force = found.evaluation.drive_loads[:, layout.drive_rows[group.slots]]
    load = force * values.drive_ratios[group.slots, 0, 0]
    return group.kind.deformation(group.values, at, load[..., None])[:, column]
