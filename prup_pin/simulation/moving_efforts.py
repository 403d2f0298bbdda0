"""What drives must give in a recorded motion, and what laws of the effort channel add to what they hold at rest."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..dynamics import Explained, InMotion, Motion, is_standing, motion_of
from ..errors import InputError
from ..laws import Effect
from ..laws.efforts import EffortLaw
from ..laws.efforts.effort_sensor import EffortUnit
from ..mechanism import Mechanism
from ..numbers import number
from ..recordings import Recording
from ..recordings.columns import AS_LOGGED
from ..robot import Robot
from ..spatial import Array


def is_of_efforts(recording: Recording, robot: Robot, effects: Sequence[Effect] = ()) -> bool:
    """Return whether a recording is of drives' efforts alone: no pose is asked for that anything deforms.

    In motion; or at rest, where `effects` are what such efforts told of the rigid robot.
    """
    mechanism = robot.mechanism
    posed = recording.position is not None or recording.rotation is not None
    if posed or any(name in mechanism.frame_names for name in recording.marker_names):
        return False
    driven = [name for name in mechanism.actuated if name in recording.efforts]
    there = [name for name in mechanism.actuated if name in recording.positions]
    told = any(isinstance(effect.law, EffortLaw) for effect in effects)
    return bool(driven and there) and (told or not is_standing(recording, there))


def efforts_in_motion(
    robot: Robot,
    recording: Recording,
    effects: Sequence[Effect] = (),
    band: Mapping[str, float] | None = None,
) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Return the efforts (N,) [N or N m] of each driven joint that has a column tau, at every row; and remarks.

    Speeds and accelerations are those of the motion below `band` [Hz] by joint, where a diagnosis told it; rows without
    an answer are NaN. Raises InputError where the motion cannot be told.
    """
    mechanism = robot.mechanism
    driven = [name for name in mechanism.actuated if name in recording.efforts]
    if not driven:
        raise InputError("no column tau.<joint> of an actuated joint says which efforts to predict")
    motion = motion_of(recording, mechanism, driven, band=band or None)
    at = InMotion.of(mechanism, motion)
    total = at.rigid + _added(at, effects)
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
    laws = (effect.law for effect in effects if isinstance(effect.law, EffortLaw))
    beyond = [text for law in laws for text in law.left_range(at)]
    beyond += [
        f"{effect.law.physics} at {effect.place} has no effect: the recording has no column temperature."
        for effect in effects
        if isinstance(effect.law, EffortLaw) and "temperature" in effect.law.needs and motion.temperature is None
    ]
    found = dict(zip(driven, out.T, strict=True))
    logged = {effect.place.name for effect in effects if isinstance(effect.law, EffortUnit)}
    units = {name: AS_LOGGED if name in logged else mechanism.joint(name).effort_unit for name in driven}
    return found, (*motion.remarks, *beyond, *_missed_at_turns(recording, found, motion, units, band or {}))


def _missed_at_turns(
    recording: Recording,
    predicted: Mapping[str, Array],
    motion: Motion,
    units: Mapping[str, str],
    band: Mapping[str, float],
) -> Iterator[str]:
    """Yield joints that miss most where they turn round: dry friction goes over there within less than the band.

    That is none of a model's parameters; what is left of all other rows is to be beside the noise.
    """
    told = []
    for name, values in predicted.items():
        if name not in band or name not in motion.names:
            continue
        speed = motion.speed[:, motion.names.index(name)]
        turned = motion.time[1:][(np.diff(np.sign(speed)) != 0) & (np.diff(motion.piece) == 0)]
        if not len(turned):
            continue
        after = np.searchsorted(turned, recording.time)
        beside = [turned[np.clip(at, 0, len(turned) - 1)] for at in (after - 1, after)]
        nearest = np.min(np.abs(recording.time - np.array(beside)), axis=0)
        left = recording.efforts[name] - values
        known, turns = np.isfinite(left), nearest < 0.5 / band[name]
        there, elsewhere = (left[known & rows] for rows in (turns, ~turns))
        if not (len(there) and len(elsewhere)):
            continue
        sizes = [float(np.sqrt(np.mean(part**2))) for part in (there, elsewhere)]
        if sizes[0] > 3.0 * sizes[1]:  # by so much more it is told
            size, share = f"{number(sizes[0], 3)} {units[name]}", number(100 * turns.mean(), 2)
            told.append(f"{name} {number(sizes[1], 3)} instead of {size} ({share} % of the rows)")
    if told:
        yield (
            "most of what is left is where joints turn round, within half a period of the band: dry friction goes over "
            "there faster than the band lets through, and before a first motion its side is not known. Root mean "
            f"square elsewhere: {'; '.join(told)}"
        )


def share_left(
    recording: Recording, predicted: Mapping[str, Array], mechanism: Mechanism, band: Mapping[str, float]
) -> dict[str, float]:
    """Return what a prediction leaves of each joint's effort as a diagnosis says it: a share, root mean square.

    Below `band` [Hz] by joint, where the joint moves and its drive is at no limit. predicted: (N,) [N or N m] by joint.
    Empty of postures.
    """
    motion = motion_of(recording, mechanism, band=band)
    if motion.separate:
        return {}
    found = np.full(motion.efforts.shape, np.nan)
    for column, name in enumerate(motion.driven):
        known = np.isfinite(predicted.get(name, np.empty(0)))
        if known.any():
            found[:, column] = np.interp(motion.time, recording.time[known], predicted[name][known])
    told = np.isfinite(found).all(axis=0)
    counts, measured = motion.compared, motion.band(motion.efforts, motion.piece)
    left = measured - motion.band(np.where(told, found, 0.0), motion.piece)
    squares, whole = (np.where(counts, values**2, 0.0).sum(axis=0) for values in (left, measured))
    return {
        name: float(np.sqrt(squares[column] / whole[column]))
        for column, name in enumerate(motion.driven)
        if told[column] and whole[column] > 0
    }


def efforts_at_rest(robot: Robot, recording: Recording, effects: Sequence[Effect], held: Array) -> Array:
    """Return what drives that hold (N, k) [N or N m] at rest give with the laws of the effort channel, (N, k).

    `held`: of the joints with a column tau, as these stand in the recording; NaN where it is unknown, and stays so.
    Laws that need motion add nothing: friction takes any value at rest.
    """
    mechanism = robot.mechanism
    driven = [name for name in recording.efforts if name in mechanism.actuated]
    there = [name for name in mechanism.actuated if name in recording.positions]
    rows = np.flatnonzero(np.isfinite(held).all(axis=1))
    out = held.copy()
    told = any(isinstance(effect.law, EffortLaw) for effect in effects)
    if not (told and driven and len(rows)) or not is_standing(recording, there):
        return out
    motion = motion_of(recording.select(rows), mechanism, driven)
    at = replace(InMotion.of(mechanism, motion), rigid=held[rows][motion.rows])
    out[rows[motion.rows]] += _added(at, effects)
    return out


def _added(at: InMotion, effects: Sequence[Effect]) -> Array:
    """Return what laws of the effort channel add (N, k), one after the other."""
    explained = Explained(at)
    for effect in effects:
        if isinstance(effect.law, EffortLaw) and effect.law.is_told_by(at.motion):
            law, place, values = effect.law, effect.place, effect.values
            bodies = law.of_body(place, at.mechanism)
            inertial = {joint: per @ law.coefficients(place, values) for joint, per in bodies.items()}
            explained.add(law.efforts(place, values, explained.known), law.of_bodies, inertial)
    return explained.efforts
