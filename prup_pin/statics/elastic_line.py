"""The elastic line of a beam: where its sections go under a load on the tool."""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Integral

import numpy as np

from ..errors import InputError, shortened
from ..mechanism import Module
from ..modules.flexibility import centre_line
from ..spatial import Array
from .castigliano import Statics

#: Sections of a line: nobody draws more.
MOST_SECTIONS = 100_000


@dataclass(frozen=True)
class ElasticLine:
    """Sections of a beam from root to tip, base axes: undeformed `points` [m], their `displacement` [m] and
    `rotation` [rad], each (p, 3)."""

    points: Array
    displacement: Array
    rotation: Array


def elastic_line(statics: Statics, name: str, wrench: Array, root: Array, count: int) -> ElasticLine:
    """Return the elastic line of beam `name` under `wrench` (6,), given the deflection (6,) of its root frame.

    All that sits on a joint's body counts as beyond that joint's beam. Where both ends are frames of one link, its root
    is among that, too (or, loaded through a joint farther out, its root is not where it should be): the beam's own
    deformation, which the root's deflection then holds (or lacks), is taken off (or added).
    """
    if not isinstance(count, Integral) or not 2 <= count <= MOST_SECTIONS:
        raise InputError(f"count = {shortened(count)}: expected a whole number of sections from 2 to {MOST_SECTIONS}")
    layout = statics.layout
    module = layout.mechanism.module(name)
    if not module.kind.spans_frames:
        raise InputError(f"module '{name}' is not a beam; only beams have an elastic line")
    slot = layout.index[name]
    group = next(group for group in layout.wrench_groups if group.slots.start <= slot < group.slots.stop)
    index = slot - group.slots.start
    at = statics.geometries[layout.groups.index(group)]
    load = (statics.jacobians[0][group.slots] @ wrench) * np.where(at.inboard_is_root, 1.0, -1.0)[:, None]
    # A module's load is what the outboard side exerts: on the tip where the root is inboard, else on the root.
    fractions = np.linspace(0.0, 1.0, count)
    law = group.kind.section_law(group.values, at)
    if law is None:
        raise InputError(f"module '{name}' is a {group.kind.kind}, which has no section law, so no elastic line")
    local = centre_line(law, at.length, load, fractions)[index]
    frame = statics.frames[group.slots][index]
    axes, length = frame[:3, :3], at.length[index]
    root = root - _own_part(statics, module, slot, wrench, frame, length)
    points = frame[:3, 3] + np.outer(fractions - 1, length * axes[:, 2])
    arms = np.outer(fractions * length, axes[:, 2])
    displacement = root[:3] + np.cross(root[3:], arms) + local[:, :3] @ axes.T
    return ElasticLine(points, displacement, root[3:] + local[:, 3:] @ axes.T)


def _own_part(statics: Statics, module: Module, slot: int, wrench: Array, frame: Array, length: float) -> Array:
    """Return what the deflection (6,) of the root frame holds too much of the beam's own deformation."""
    root = module.root
    if root is None or root.joint != module.frame.joint:
        return np.zeros(6)
    carried = bool(statics.layout.mechanism.support[module.joint, root.joint])
    if carried != module.inboard_is_root:
        return np.zeros(6)
    deformation = statics.lambdas[0][slot] @ (statics.jacobians[0][slot] @ wrench)
    moved, turned = frame[:3, :3] @ deformation[:3], frame[:3, :3] @ deformation[3:]
    at_root = np.concatenate((moved + np.cross(turned, -length * frame[:3, 2]), turned))
    return at_root if carried else -at_root
