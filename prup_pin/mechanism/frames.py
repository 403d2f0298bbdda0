"""Frames on the bodies of a mechanism, and the loops that close between two of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from ..errors import named
from ..spatial import Array, skew
from .description import FrameDescription, LoopDescription


@dataclass(frozen=True)
class Frame:
    """A frame fixed to the body of joint `joint` (0: the base): `placement` is joint_from_frame, 4 x 4."""

    name: str
    joint: int
    placement: Array

    def at(self, placements: Array) -> Array:
        """Return base_from_frame, (..., 4, 4), where those of all joints are (..., njoints, 4, 4)."""
        placed: Array = placements[..., self.joint, :, :] @ self.placement
        return placed


@dataclass(frozen=True)
class LoopClosure:
    """Two frames that coincide but for the relative motions in `free`.

    `rotation_rows` (r, 9) turns vec(R_1^T R_2) into the r rotational residuals; `translation_axes` are the axes of
    the first frame along which the origins must coincide.
    """

    name: str
    first: Frame
    second: Frame
    free: frozenset[str]
    translation_axes: tuple[int, ...]
    rotation_rows: Array

    @property
    def size(self) -> int:
        """Number of scalar constraints."""
        return len(self.translation_axes) + len(self.rotation_rows)


def loop_closure(loop: LoopDescription, frames: Mapping[str, Frame]) -> LoopClosure:
    """Return a loop between frames of the mechanism, which are looked up by name. Raises UnknownNameError."""
    translations = tuple(i for i, name in enumerate("xyz") if name not in loop.free)
    ends = (_end_of(loop.first, frames), _end_of(loop.second, frames))
    return LoopClosure(loop.name, *ends, loop.free, translations, _rotation_rows(loop.free))


def _end_of(end: FrameDescription, frames: Mapping[str, Frame]) -> Frame:
    frame = named("frame", end.name, frames)
    return frame if end.offset is None else replace(frame, placement=frame.placement @ end.offset)


def _rotation_rows(free: frozenset[str]) -> Array:
    """Return the rows that vanish when only the free rotations differ, on vec(E) (row-major), E = R_1^T R_2.

    None free: the skew part of E (weld). One free, about k: e_k x (E e_k) across k. Two free, i then j in cyclic
    order: e_i . (E e_j), a universal joint with e_i fixed in the first and e_j in the second frame.
    """
    turning, unit = [axis for axis, name in enumerate(("rx", "ry", "rz")) if name in free], np.eye(3)
    rows: list[Array] = []
    if not turning:
        rows = [0.5 * skew(axis) for axis in unit]
    elif len(turning) == 1:
        k = turning[0]
        i, j = (k + 1) % 3, (k + 2) % 3
        # e_k x (E e_k) = -E_jk e_i + E_ik e_j, minus the free component
        rows = [-np.outer(unit[j], unit[k]), np.outer(unit[i], unit[k])]
    elif len(turning) == 2:
        k = ({0, 1, 2} - set(turning)).pop()
        rows = [-np.outer(unit[(k + 1) % 3], unit[(k + 2) % 3])]
    return np.array(rows).reshape(-1, 9) + 0.0


def frames_by_name(model: pin.Model) -> dict[str, Frame]:
    """Return every frame of the model; where a link and a joint share a name, the link's."""
    frames: dict[str, Frame] = {}
    for wanted_body in (True, False):
        for frame in model.frames:
            if (frame.type == pin.FrameType.BODY) == wanted_body and frame.name not in frames:
                frames[frame.name] = Frame(frame.name, int(frame.parentJoint), np.array(frame.placement.homogeneous))
    return frames
