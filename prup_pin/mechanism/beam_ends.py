"""What acts on a link beside a beam on it, and at which of the beam's ends the model takes it to be fixed.

A beam is loaded through one joint. All that acts on its link on the far side of that joint is rigid with the beam's
outer end, and all on the near side with its inner end, wherever it lies. Of a link of three joints that may not be what
its drawing says: a loop that closes behind the beam's root is none of the beam's load.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..spatial import Array
from .frames import Frame
from .mechanism import Mechanism, Module

#: How far before the end that it is fixed to something may lie, as a share of the beam's length.
_BEFORE = 0.05
#: What lies farther beside a beam's axis, as a share of its length, is held by another part of the link.
_BESIDE = 0.5


@dataclass(frozen=True, eq=False)
class AtOtherEnd:
    """Something that the model fixes to an end of a beam beyond which it does not lie.

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
    end, (start, stop) = ends[0], (_place(placements, frame) for frame in ends[::-1])
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
        return _place(placements, mechanism.need_tool())
    if edge < 0:
        loop = mechanism.loops[-1 - edge]
        slides = (placements[loop.first.joint] @ loop.first.placement)[
            :3, ["xyz".index(x) for x in loop.free & set("xyz")]
        ]
        if (np.abs(line @ slides) > _BEFORE * np.linalg.norm(line)).any():
            return None
        return _place(placements, loop.first if paths.same(loop.first.joint, body) else loop.second)
    for module in mechanism.modules:
        if module.root is None or module.joint != edge or edge == loaded_through:
            continue
        ends = [end for end in (module.root, module.frame) if paths.same(end.joint, body)]
        outward = paths.same(int(mechanism.model.parents[edge]), body)
        if len(ends) == 2:
            return _place(placements, ends[0] if module.inboard_is_root == outward else ends[1])
        if ends:
            return _place(placements, ends[0])
    return None if mechanism.joint(edge).slides else placements[edge, :3, 3]


def _place(placements: Array, frame: Frame) -> Array:
    """Return a frame's origin in base axes, (3,)."""
    placed: Array = placements[frame.joint, :3, :3] @ frame.placement[:3, 3] + placements[frame.joint, :3, 3]
    return placed
