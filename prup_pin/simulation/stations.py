"""A prediction as it was seen from stations: each run put where its first points say that its pose sensor stood."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

import numpy as np

from ..recordings import Recording
from ..spatial import Array, rigid_motion, rotation_exp, rotation_log
from .prediction import Prediction

#: So many rows of a run in which something was measured say where its pose sensor stood; fewer do where no more were.
FIRST_POINTS = 8
_FEWEST = 3


def seen_from_stations(prediction: Prediction, recording: Recording) -> Prediction:
    """Return what a sensor would measure that was set up anew for each run of the recording.

    A run without measured positions, or with too few to tell, stays as the sensor's frame is drawn; that is told.
    """
    position, rotation = prediction.position.copy(), prediction.rotation.copy()
    markers = {name: values.copy() for name, values in prediction.markers.items()}
    turns = {name: values.copy() for name, values in prediction.marker_rotations.items()}
    measured = [(recording.position, position)] if position.shape[1] else []
    measured += [(recording.markers.get(name), values) for name, values in markers.items()]
    lost = []
    for run, name in enumerate(recording.run_names):
        rows = np.flatnonzero(recording.run == run)
        motion = _station([(seen[rows], here[rows]) for seen, here in measured if seen is not None])
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
    told = [f"the pose sensor of each run is put where its first {FIRST_POINTS} measured points say that it stood"]
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


def _station(channels: list[tuple[Array, Array]]) -> tuple[Array, Array] | None:
    """Return the motion from predicted to measured positions (n, 3) of a run's first rows that have any, or None."""
    known = [np.asarray(np.isfinite(seen + here).all(axis=1), bool) for seen, here in channels]
    if not known:
        return None
    first = np.flatnonzero(np.any(known, axis=0))[:FIRST_POINTS]
    rows = [first[good[first]] for good in known]
    aims = np.concatenate([seen[here] for (seen, _), here in zip(channels, rows, strict=True)])
    points = np.concatenate([there[here] for (_, there), here in zip(channels, rows, strict=True)])
    return rigid_motion(points, aims, np.ones(len(points))) if len(points) >= _FEWEST else None
