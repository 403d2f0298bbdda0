"""What looks wrong in a recording that can be read: units off by a thousand, dead channels, noise that cannot be."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..numbers import number
from ..spatial import WRENCH_NAMES, Array
from .columns import AXES, NOISE_UNITS
from .recording import Recording

#: Larger than any bench that is measured in metres and radians.
_LARGEST_POSITION = 50.0
#: A motion of so many rows, this slow [s] a row and by so little of its travel [1], is more likely in milliseconds.
_MOVING_ROWS, _SLOW_ROW, _SHORT_WAY = 500, 0.5, 0.01


def suspicions(recording: Recording) -> tuple[str, ...]:
    """Return sentences for a person on values that are hardly meant so. An empty tuple if nothing stands out."""
    return (
        *_time(recording),
        *_units(recording),
        *_gravity(recording),
        *_channels(recording),
        *_duplicates(recording),
        *_noise(recording),
    )


def _time(recording: Recording) -> Iterator[str]:
    step = float(np.median(np.diff(recording.time))) if len(recording) > _MOVING_ROWS else 0.0
    if not step > _SLOW_ROW or not recording.efforts:
        return
    ways = [
        (float(np.nanmedian(np.abs(np.diff(q)))), float(np.nanmax(q) - np.nanmin(q)))
        for q in recording.positions.values()
        if np.isfinite(q).sum() > 1
    ]
    if any(travel > 0 for _, travel in ways) and all(way < _SHORT_WAY * travel for way, travel in ways if travel > 0):
        yield (
            f"time goes on by {number(step, 3)} a row, and joints that move hardly move from row to row: is it in "
            "milliseconds? Expected seconds."
        )


def _gravity(recording: Recording) -> Iterator[str]:
    if recording.gravity is None or not np.isfinite(recording.gravity).any():
        return
    size = float(np.nanmedian(np.linalg.norm(recording.gravity, axis=1)))
    if abs(size - 1) < 0.1:
        yield f"g.x g.y g.z have the size {number(size, 4)}: are they multiples of g? Expected m/s^2."


def _largest(values: Array | None) -> float:
    return 0.0 if values is None or not np.isfinite(values).any() else float(np.nanmax(np.abs(values)))


def _units(recording: Recording) -> Iterator[str]:
    turns = (("r", recording.rotation), *((f"r.{key}", value) for key, value in recording.marker_rotations.items()))
    for name, values in turns:
        if (largest := _largest(values)) > 2 * np.pi:
            yield (
                f"{name}.x {name}.y {name}.z reach {number(largest, 4)} rad, more than a full turn: are they degrees? "
                "Expected radians."
            )
    for name, values in (("p", recording.position), *((f"p.{key}", value) for key, value in recording.markers.items())):
        if values is not None and (largest := _largest(values)) > _LARGEST_POSITION:
            columns = [f"{name}.{axis}" for k, axis in enumerate(AXES) if np.isfinite(values[:, k]).any()]
            reach, them = ("reaches", "is it") if len(columns) == 1 else ("reach", "are they")
            yield f"{' '.join(columns)} {reach} {number(largest, 4)} m: {them} millimetres? Expected metres."
    for joint, values in recording.positions.items():
        if (largest := _largest(values)) > _LARGEST_POSITION:
            yield (
                f"q.{joint} reaches {number(largest, 4)}: is it in millimetres or degrees? Expected metres or radians."
            )
    force, moment = _largest(recording.wrench[:, :3]), _largest(recording.wrench[:, 3:])
    for name, largest, unit in (("w.fx w.fy w.fz", force, "N"), ("w.mx w.my w.mz", moment, "N m")):
        if largest > 1e5:  # no bench pulls so hard
            yield f"{name} reach {number(largest, 4)} {unit}: is the unit right? Expected {unit}."
    if force > 1 and moment > 20.0 * force:  # so many metres of lever are N mm sooner
        yield (
            f"w.mx w.my w.mz reach {number(moment, 4)} N m at forces up to {number(force, 4)} N, a lever of "
            f"{number(moment / force, 3)} m: are they N mm, 1000 times too large? Expected N m."
        )
    if recording.temperature is not None:
        temperature = recording.temperature
        if np.isfinite(temperature).any() and np.nanmin(temperature) < -60:
            yield f"temperature falls to {number(np.nanmin(temperature), 4)} degrees Celsius: is the sensor connected?"
        elif _largest(temperature) > 200:
            yield f"temperature reaches {number(_largest(temperature), 4)}: is it kelvin? Expected degrees Celsius."


def never_changing(recording: Recording) -> list[str]:
    """Return the columns that have one and the same number in every row that has any, but for gravity's."""
    columns = ((name, values[np.isfinite(values)]) for name, values in recording.columns() if name[:2] != "g.")
    return [name for name, known in columns if len(known) > 2 and known.min() == known.max()]


def _channels(recording: Recording) -> Iterator[str]:
    empty, constant = [], never_changing(recording)
    columns = [(name, values[np.isfinite(values)]) for name, values in recording.columns() if name[:2] != "g."]
    measured = {name.rpartition(".")[0] for name, known in columns if name[:2] in ("p.", "r.") and len(known)}
    for name, known in columns:
        if not len(known) and name.rpartition(".")[0] not in measured:
            empty.append(name)  # a part of a triple stands among the reader's remarks
    if empty:
        yield f"Nothing was measured in {', '.join(empty)}: every cell is empty."
    if constant:
        change = "changes" if len(constant) == 1 else "change"
        yield f"{', '.join(constant)} never {change}, in no digit: a dead or unused channel?"


def _duplicates(recording: Recording) -> Iterator[str]:
    columns = [values for _, values in recording.columns()]
    if len(recording) < 2 or (recording.position is None and recording.rotation is None and not recording.efforts):
        return
    # Equal rows have equal sums of their bits times odd random numbers; the converse fails once in 2^64.
    factors = np.random.default_rng(0).integers(0, 2**63, size=len(columns), dtype=np.uint64) * np.uint64(2)
    mixed = np.zeros(len(recording), np.uint64)
    for values, factor in zip(columns, factors + np.uint64(1), strict=True):
        bits = np.where(np.isnan(values), np.nan, values + 0.0).view(np.uint64)  # one zero, one NaN
        mixed += (bits ^ (bits >> np.uint64(32))) * factor
    count = len(mixed) - len(np.unique(mixed))
    if count:
        yield (
            f"{count} of {len(mixed)} rows repeat an earlier row in every digit but the time: a section copied twice, "
            "a frozen logger, or a simulation without noise?"
        )


def _repeats(recording: Recording) -> Array:
    """Return a mask (N - 1,) of consecutive samples with the same actuator positions and the same load."""
    same = np.diff(recording.blocks()) == 0
    declared = {"f": recording.noise.force, "m": recording.noise.moment}
    largest = {"f": _largest(recording.wrench[:, :3]), "m": _largest(recording.wrench[:, 3:])}
    for k, name in enumerate(WRENCH_NAMES):
        if name in recording.wrench_columns:
            load = recording.wrench[:, k]
            noise = declared[name[0]]
            allowed = 6 * noise if noise is not None else 1e-2 * largest[name[0]]
            same &= ~(np.abs(np.diff(load)) > allowed)
    if recording.gravity is not None:
        same &= ~(np.abs(np.diff(recording.gravity, axis=0)) > 1e-2 * _largest(recording.gravity)).any(axis=1)
    return same


def _noise(recording: Recording) -> Iterator[str]:
    """Yield where the declared noise exceeds all that was measured, or is far below what repeats differ by."""
    if len(recording) < 3:
        return
    efforts = np.column_stack(list(recording.efforts.values())) if recording.efforts else None
    has_wrench = recording.has_wrench
    channels = {
        "position": recording.position,
        "rotation": recording.rotation,
        "force": recording.wrench[:, :3] if has_wrench else None,
        "moment": recording.wrench[:, 3:] if has_wrench else None,
        "effort": efforts,
    }
    same = _repeats(recording)
    for name, values in channels.items():
        noise, unit = getattr(recording.noise, name), NOISE_UNITS[name]
        if noise is None or values is None or not np.isfinite(values).any():
            continue
        known = values[:, np.isfinite(values).any(axis=0)]
        spread = float(np.nanstd(known, axis=0).max())
        if 0 < spread < 0.9 * noise:
            yield (
                f"{name}_noise is declared as {number(noise, 3)} {unit}, but the whole recording varies by "
                f"{number(spread, 3)} only (standard deviation): is its unit right?"
            )
        steps = np.diff(known, axis=0)[same]
        steps = steps[np.isfinite(steps)]
        if len(steps) < 5 or name in ("force", "moment"):
            continue  # too few to tell, or chosen by these very loads
        repeat = float(np.sqrt(np.mean(steps**2) / 2))
        if noise < repeat / 100:
            yield (
                f"{name}_noise is declared as {number(noise, 3)} {unit}, but samples at the same actuator positions "
                f"and load differ by {number(repeat, 3)} (standard deviation): is its unit right?"
            )
