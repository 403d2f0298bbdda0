"""A prediction as it was seen from stations: each run put where its first postures say that its pose sensor stood."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from ..recordings import Recording
from ..spatial import Array, rigid_motion, rotation_exp, rotation_log
from .prediction import Prediction

#: So many postures of a run in which something was measured, by the first row of each, say where its pose sensor stood;
#: fewer do where no more were.
FIRST_POSTURES = 8
#: Length [m] over which an orientation is worth a place, where their noises are not declared.
_LEVER = 0.1


def seen_from_stations(prediction: Prediction, recording: Recording) -> Prediction:
    """Return what a sensor would measure that was set up anew for each run of the recording.

    A run without measured positions, or with too few to tell, stays as the sensor's frame is drawn; that is told.
    """
    position, rotation = prediction.position.copy(), prediction.rotation.copy()
    markers = {name: values.copy() for name, values in prediction.markers.items()}
    turns = {name: values.copy() for name, values in prediction.marker_rotations.items()}
    measured = [(recording.position, position), *((recording.markers.get(name), own) for name, own in markers.items())]
    turned = [
        (recording.rotation, rotation),
        *((recording.marker_rotations.get(name), own) for name, own in turns.items()),
    ]
    noise, postures = recording.noise, recording.blocks()
    lever = noise.position / noise.rotation if noise.position and noise.rotation else _LEVER
    lost = []
    for run, name in enumerate(recording.run_names):
        rows = np.flatnonzero(recording.run == run)
        points, frames = (
            [(seen[rows], here[rows]) for seen, here in pairs if seen is not None and here.shape[1]]
            for pairs in (measured, turned)
        )
        motion = _station(points, frames, postures[rows], lever)
        if motion is None:
            lost += [name] if len(rows) else []
            continue
        turn, shift = motion
        for values in (position, *markers.values()):
            if values.shape[1]:
                values[rows] = values[rows] @ turn.T + shift
        for values in (rotation, *turns.values()):
            if values.shape[1]:
                values[rows] = rotation_log(turn @ rotation_exp(values[rows]))
    told = [f"the pose sensor of each run is put where its first {FIRST_POSTURES} postures say that it stood"]
    if lost:
        told.append(f"too few were measured of {', '.join(lost)}: left in the frame of the base")
    return replace(
        prediction,
        position=position,
        rotation=rotation,
        markers=MappingProxyType(markers),
        marker_rotations=MappingProxyType(turns),
        remarks=(*prediction.remarks, *told),
    )


_Channels = Sequence[tuple[Array, Array]]


def _station(points: _Channels, frames: _Channels, postures: np.ndarray, lever: float) -> tuple[Array, Array] | None:
    """Return the motion from predicted to measured positions and rotation vectors (n, 3) of the first row of each of a
    run's first postures (n,), or None where these do not tell it. lever: see `_LEVER`.

    A frame's axes count as points on both sides of the middle of all, so that they tell the turn alone.
    """
    known = np.any([_known(*channel) for channel in points] or [np.zeros(len(postures), bool)], axis=0)
    there = np.flatnonzero(known)
    first = there[np.unique(postures[there], return_index=True)[1]][:FIRST_POSTURES]
    aims, begins = _those_known(points, first)
    if not len(aims):
        return None
    middle, aim = begins.mean(axis=0), aims.mean(axis=0)
    axes_aimed, axes = (
        lever / 2 * rotation_exp(vectors).swapaxes(1, 2).reshape(-1, 3) for vectors in _those_known(frames, first)
    )
    if len(aims) < 3 and not len(axes):  # three points tell a motion; one will do with its orientation
        return None
    begins, aims = (
        np.concatenate((places, centre + own, centre - own))
        for places, centre, own in ((begins, middle, axes), (aims, aim, axes_aimed))
    )
    return rigid_motion(begins, aims, np.ones(len(begins)))


def _known(seen: Array, here: Array) -> np.ndarray:
    return np.asarray(np.isfinite(seen + here).all(axis=1), bool)


def _those_known(channels: _Channels, first: np.ndarray) -> tuple[Array, Array]:
    """Return what was measured and predicted (m, 3) at some rows, of all channels one after the other."""
    parts = [(seen[first], here[first]) for seen, here in channels]
    good = [_known(*part) for part in parts]
    measured, predicted = ([part[side][own] for part, own in zip(parts, good, strict=True)] for side in (0, 1))
    return np.concatenate([np.zeros((0, 3)), *measured]), np.concatenate([np.zeros((0, 3)), *predicted])
