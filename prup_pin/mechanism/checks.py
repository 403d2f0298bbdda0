"""What is wrong with a robot file once its tree stands: beams beside their loads, joints driven twice, other units."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from ..errors import Problem
from ..spatial import Array
from .frames import Frame

if TYPE_CHECKING:
    from .mechanism import Mechanism, Module

#: Of a joint, to see what it moves [m or rad].
_SMALL_MOTION = 1e-4


def driven_twice(mechanism: Mechanism) -> Iterator[Problem]:
    """Yield joints that are said to be driven, and to follow others."""
    line = mechanism.description.lines.get("actuated")
    for name in mechanism.description.actuated or ():
        if name in mechanism.coupling.names:
            leader = mechanism.coupling.leader_of(name)
            text = f"actuated: joint '{name}' follows '{leader}'; leave it out, its leader drives it"
            yield Problem(text, line)


def loose_and_loaded(mechanism: Mechanism) -> Iterator[Problem]:
    """Yield joints that follow no one knows how, where they carry load."""
    for coupling in mechanism.loose:
        below = mechanism.support[mechanism.joint_id(coupling.joint)]
        if mechanism.tool is not None and below[mechanism.tool.joint]:
            where = f"between the base and the tool '{mechanism.tool.name}'"
        elif any(below[loop.first.joint] != below[loop.second.joint] for loop in mechanism.loops):
            where = "in a loop"
        else:
            continue
        text = (
            f"{coupling.what} {where}, and carries load there. Expected one joint of one freedom that follows "
            "another movable one, in no circle, by <mimic>"
        )
        yield Problem(text, coupling.line)


def misstated_units(mechanism: Mechanism) -> Iterator[Problem]:
    """Yield values in a unit that their joint does not have: N/m where it turns, N m/rad where it slides."""
    described = {module.name: module for module in mechanism.description.modules}
    for module in mechanism.modules:
        joint, given = mechanism.joint(module.joint), described[module.name]
        for quantity in module.kind.quantities:
            value = given.values.get(quantity.name)
            unit = joint.unit_among(quantity.unit)
            if value is None or unit is None or value.unit in (unit, quantity.unit):
                continue
            text = (
                f"module '{module.name}': parameter '{quantity.name}' is in {value.unit}, but joint '{joint.name}' "
                f'{"slides" if joint.slides else "turns"}; expected unit="{unit}", and the value in it'
            )
            yield Problem(text, given.lines.get(quantity.name, given.line))


# -- beams -------------------------------------------------------------------------------------------------------------


def misplaced_beams(mechanism: Mechanism) -> Iterator[Problem]:
    """Yield beams that carry another load than their joint's, or are bent by a passive joint."""
    if mechanism.tool is None:
        return
    for module, given in zip(mechanism.modules, mechanism.description.modules, strict=True):
        if module.root is not None and (wrong := _misplaced(mechanism, module, module.root)):
            what = f"module '{module.name}': a beam from '{module.root.name}' to '{module.frame.name}'"
            yield Problem(f"{what} {wrong}; correct joint, root or tip", given.line)


def _misplaced(mechanism: Mechanism, module: Module, root: Frame) -> str:
    """Return why a beam is not where its joint's load passes, or ''."""
    paths, names, tip = mechanism.load_paths, list(mechanism.model.names), module.frame
    if not paths.carries(module.joint, root.joint, tip.joint):
        ends = [
            f"its {end}, on '{mechanism.bodies[frame.joint]}', is not"
            for end, frame in (("root", root), ("tip", tip))
            if not paths.reached(module.joint, frame.joint)
        ]
        fit = [name for at, name in enumerate(names) if at and paths.carries(at, root.joint, tip.joint)]
        hint = f"It carries the load of {', '.join(fit[:6])}" if fit else "It carries no joint's whole load"
        return f"does not lie where the load of joint '{names[module.joint]}' passes: {' and '.join(ends)}. {hint}"
    passive = {int(mechanism.dof_joint[dof]) for dof in mechanism.free_dofs} - {module.joint}
    for joint in paths.between(module.joint, root.joint, tip.joint):
        if joint in passive and _bends(mechanism, joint, root, tip):
            how = "the passive joint '{}', which bends it"
        elif joint not in passive and not mechanism.joint(joint).slides and _bends(mechanism, joint, root, tip, True):
            how = "joint '{}', which turns one end away"
        else:
            continue
        return f"spans {how.format(names[joint])}: {_before(mechanism, joint, root, tip)}"
    return ""


def _before(mechanism: Mechanism, joint: int, *ends: Frame) -> str:
    """Return what to do about a beam that reaches over a joint."""
    text = "a beam ends where a joint turns"
    for end in ends:
        if end.joint == joint and np.linalg.norm(end.placement[:3, 3]) < 1e-9:
            body = mechanism.bodies[int(mechanism.model.parents[joint])]
            return f"{text}, and '{end.name}' turns with it: fix a link to '{body}' at that place, and name that"
    return text


def _bends(mechanism: Mechanism, joint: int, root: Frame, tip: Frame, across: bool = False) -> bool:
    """Return True where a joint's motion takes a beam's root off its axis, or, if not asked `across` alone, changes its
    length: that of a rod which a drive pushes out does.
    """
    home, spans = mechanism.home_configuration(), []
    for step in (0.0, _SMALL_MOTION):
        velocity = np.zeros(mechanism.model.nv)
        velocity[mechanism.joint(joint).dofs] = step
        placed = mechanism.placements(pin.integrate(mechanism.model, home, velocity))
        ends = [frame.at(placed) for frame in (root, tip)]
        spans.append(ends[1][:3, :3].T @ (ends[0][:3, 3] - ends[1][:3, 3]))
    length = max(float(np.linalg.norm(spans[0])), 1e-9)
    moved = spans[1] - spans[0]
    if across:
        moved = np.cross(spans[0] / length, moved)
    return float(np.linalg.norm(moved)) > 1e-3 * _SMALL_MOTION * length


# -- what acts on a link beside a beam on it ---------------------------------------------------------------------------


#: How far before the end that it is fixed to something may lie, as a share of the beam's length.
_BEFORE = 0.05
#: What lies farther beside a beam's axis, as a share of its length, is held by another part of the link.
_BESIDE = 0.5


@dataclass(frozen=True, eq=False)
class AtOtherEnd:
    """Something that the model fixes to an end of a beam beyond which it does not lie.

    A beam is loaded through one joint. All that acts on its link on the far side of that joint is rigid with the beam's
    outer end, and all on the near side with its inner end, wherever it lies. Of a link of three joints that may not be
    what its drawing says: a loop that closes behind the beam's root is none of the beam's load.

    what: 'loop x' or 'joint y' or 'the tool'; end: the frame that it is rigid with; along: where it lies along the beam
    from the other end towards that one, as a share of the length, below 1; length [m]: the beam's; instead: the joint
    that carries what does lie beyond the end and nothing else, if there is one.
    """

    module: Module
    what: str
    link: str
    end: Frame
    along: float
    length: float
    instead: str | None


def at_other_ends(mechanism: Mechanism, placements: Array) -> Iterator[AtOtherEnd]:
    """Yield what lies elsewhere than the end of a beam to which it is fixed.

    placements: base_from_joint of a configuration with closed loops, (njoints, 4, 4).
    """
    paths = mechanism.load_paths
    for module in mechanism.modules:
        if module.root is None or module.joint in paths.idle:
            continue
        inner, outer = (module.root, module.frame) if module.inboard_is_root else (module.frame, module.root)
        met = paths.ends(module.joint, inner.joint, outer.joint)
        for end, other, (edges, passed) in ((inner, outer, met[0]), (outer, inner, met[1])):
            if not paths.same(end.joint, 0):  # all that is on the ground is rigid with it
                yield from _astray(mechanism, placements, module, (end, other), edges, passed)


def _astray(
    mechanism: Mechanism,
    placements: Array,
    module: Module,
    ends: tuple[Frame, Frame],
    edges: list[int],
    passed: int,
) -> Iterator[AtOtherEnd]:
    end, (start, stop) = ends[0], (frame.at(placements)[:3, 3] for frame in ends[::-1])
    line = stop - start
    length = float(np.linalg.norm(line))
    if not length:
        return
    if passed:
        seat = _of_edge(mechanism, placements, passed, end.joint, line, passed)
        if seat is None or np.linalg.norm(seat - stop) < _BEFORE * length:
            return  # the beam begins where the joint sits: no part of it lies on this body
    near: dict[int, float] = {}
    for edge in edges:
        place = _of_edge(mechanism, placements, edge, end.joint, line, module.joint)
        if place is None:
            continue
        share = float((place - start) @ line) / length**2
        if share < 1 - _BEFORE and np.linalg.norm(place - start - share * line) < _BESIDE * length:
            near[edge] = share
    rest = [edge for edge in edges if edge not in near]
    instead = mechanism.joint(rest[0]).name if len(rest) == 1 and rest[0] > 0 else None
    for edge, share in near.items():
        if edge > 0:
            what = f"joint '{mechanism.joint(edge).name}'"
        else:
            what = f"loop '{mechanism.loops[-1 - edge].name}'" if edge else "the load on the tool"
        yield AtOtherEnd(module, what, mechanism.bodies[end.joint], end, share, length, instead)


def _of_edge(
    mechanism: Mechanism, placements: Array, edge: int, body: int, line: Array, loaded_through: int = 0
) -> Array | None:
    """Return where a joint (its id), a loop (-1 - its place) or the tool's load (0) acts on a body, base axes (3,).

    Where another beam on that body carries a joint's load, not that of `loaded_through`, it is where that beam begins.
    None for a slide, which has no one place, and for a loop that slides along the beam's `line` (3,).
    """
    paths = mechanism.load_paths
    if edge == 0:
        return mechanism.need_tool().at(placements)[:3, 3]
    if edge < 0:
        loop = mechanism.loops[-1 - edge]
        slides = loop.first.at(placements)[:3, ["xyz".index(x) for x in loop.free & set("xyz")]]
        if (np.abs(line @ slides) > _BEFORE * np.linalg.norm(line)).any():
            return None
        return (loop.first if paths.same(loop.first.joint, body) else loop.second).at(placements)[:3, 3]
    for module in mechanism.modules:
        if module.root is None or module.joint != edge or edge == loaded_through:
            continue
        ends = [end for end in (module.root, module.frame) if paths.same(end.joint, body)]
        outward = paths.same(int(mechanism.model.parents[edge]), body)
        if len(ends) == 2:
            return ends[0 if module.inboard_is_root == outward else 1].at(placements)[:3, 3]
        if ends:
            return ends[0].at(placements)[:3, 3]
    return None if mechanism.joint(edge).slides else placements[edge, :3, 3]
