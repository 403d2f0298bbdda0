"""What drives must give in a recorded motion: inverse dynamics and the laws of the effort channel."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..dynamics import InMotion, is_standing, motion_of
from ..errors import InputError
from ..laws import Effect
from ..laws.efforts import EffortLaw
from ..recordings import Recording
from ..robot import Robot
from ..spatial import Array

__all__ = ["efforts_in_motion", "is_of_efforts"]


def is_of_efforts(recording: Recording, robot: Robot) -> bool:
    """Return whether a recording is of drives' efforts alone, in motion: no pose is asked for that anything deforms."""
    mechanism = robot.mechanism
    posed = recording.position is not None or recording.rotation is not None
    if posed or any(name in mechanism.frame_names for name in recording.marker_names):
        return False
    driven = [name for name in mechanism.actuated if name in recording.efforts]
    there = [name for name in mechanism.actuated if name in recording.positions]
    return bool(driven and there) and not is_standing(recording, there)


def efforts_in_motion(robot: Robot, recording: Recording, effects: Sequence[Effect] = ()) -> dict[str, Array]:
    """Return the efforts (N,) [N or N m] of each driven joint that has a column tau, at every row.

    What speeds and accelerations need is filtered as in a diagnosis; rows without an answer are NaN. Raises InputError
    where the motion cannot be told.
    """
    mechanism = robot.mechanism
    driven = [name for name in mechanism.actuated if name in recording.efforts]
    if not driven:
        raise InputError("no column tau.<joint> of an actuated joint says which efforts are asked for")
    motion = motion_of(recording, mechanism, driven)
    at = InMotion.of(mechanism, motion)
    added, bodies = np.zeros_like(at.rigid), np.zeros_like(at.rigid)
    for effect in effects:
        if isinstance(effect.law, EffortLaw):
            knowing = at.knowing(added.copy(), np.zeros_like(added), bodies.copy())
            more = effect.law.efforts(effect.place, effect.values, knowing)
            added += more
            if effect.law.of_bodies:
                bodies += more
    total = at.rigid + added
    out = np.full((len(recording), len(driven)), np.nan)
    for label in np.unique(motion.piece):
        own = np.flatnonzero(motion.piece == label)
        first, last = int(motion.rows[own[0]]), int(motion.rows[own[-1]])
        rows = np.arange(first, last + 1)
        if len(own) == 1:
            out[rows] = total[own]
            continue
        for column in range(len(driven)):
            out[rows, column] = np.interp(recording.time[rows], motion.time[own], total[own, column])
    return dict(zip(driven, out.T, strict=True))
