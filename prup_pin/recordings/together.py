"""Several recordings of one device as one: which sample is from which, and which sensors each has for itself.

The device is the same, and so is all that is off about it. A recording may have been taken with sensors of its own: a
tracker that was set up anew, a target that was mounted again, encoders that were homed. Then what is off about these is
its own as well.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from ..spatial import Array
from .columns import AXES, fields_of
from .recording import Recording
from .tolerances import KINDS_OF_TOLERANCE, SENSORS, Tolerances


@dataclass(frozen=True, eq=False)
class Source:
    """One of several recordings: as it was given, its name for people, and the sensors that are its own."""

    name: str
    recording: Recording
    own: tuple[str, ...] = ()


class Group(NamedTuple):
    """What shares a sensor, by its places among `Together.setups`; `label` is '' for what has none of its own."""

    label: str
    sources: tuple[int, ...]
    tolerances: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Together:
    """Recordings one after the other.

    recording: all N samples, each run a run of its own. which (N,): place of each sample's recording among `sources`;
    rows (N,): its row there, from 0. by_run: sensors that were set up anew for each run.
    """

    recording: Recording
    sources: tuple[Source, ...]
    which: NDArray[np.int64]
    rows: NDArray[np.int64]
    by_run: tuple[str, ...] = ()

    @classmethod
    def of(cls, recordings: Recording | Sequence[Recording], joints: Sequence[str], gravity: ArrayLike) -> Together:
        """Return one or several recordings together.

        joints: the robot's actuated ones, which each recording needs; gravity (3,): the robot file's, for recordings
        without columns of their own [m/s^2]. Raises InputError where these are no recordings of one device, or one of
        them twice.
        """
        given = [recordings] if isinstance(recordings, Recording) else list(recordings)
        if not given:
            raise InputError("no recording was given")
        names = _names(given)
        if len(given) == 1:
            n = len(given[0])
            source = Source(names[0], given[0], given[0].own_sensors)
            return cls(given[0], (source,), np.zeros(n, np.int64), np.arange(n), given[0].own_by_run)
        _check(given, names, joints)
        sources = tuple(
            Source(name, recording, own) for name, recording, own in zip(names, given, _own_sensors(given), strict=True)
        )
        sizes = [len(recording) for recording in given]
        return cls(
            _joined(given, names, np.asarray(gravity, float)),
            sources,
            np.repeat(np.arange(len(given)), sizes),
            np.concatenate([np.arange(size) for size in sizes]),
            tuple(dict.fromkeys(name for recording in given for name in recording.own_by_run)),
        )

    @property
    def several(self) -> bool:
        return len(self.sources) > 1

    def select(self, rows: ArrayLike) -> Together:
        """Return some samples, by indices."""
        index = np.asarray(rows, np.int64)
        return replace(self, recording=self.recording.select(index), which=self.which[index], rows=self.rows[index])

    def within(self, kinds: Mapping[str, float]) -> Together:
        """Return the same recordings with one standard deviation of some kinds declared, which then hold for all."""

        def declaring(recording: Recording) -> Recording:
            return replace(recording, tolerances=replace(recording.tolerances, **kinds))

        sources = tuple(replace(source, recording=declaring(source.recording)) for source in self.sources)
        return replace(self, recording=declaring(self.recording), sources=sources)

    def with_own(self, sensor: str) -> Together:
        """Return the same recordings, each with a sensor of its own."""
        own = (replace(source, own=tuple(dict.fromkeys((*source.own, sensor)))) for source in self.sources)
        return replace(self, sources=tuple(own))

    def with_runs_of(self, sensor: str) -> Together:
        """Return the same recordings, each run with a sensor of its own."""
        return replace(self, by_run=tuple(dict.fromkeys((*self.by_run, sensor))))

    @property
    def setups(self) -> NDArray[np.int64]:
        """For what each sample's own sensors were set up, (N,): its recording, or its run."""
        return self.recording.run if self.by_run else self.which

    def _setups_of(self, places: Sequence[int]) -> tuple[int, ...]:
        return tuple(np.unique(self.setups[np.isin(self.which, places)]).tolist()) if self.by_run else tuple(places)

    @property
    def stations(self) -> tuple[Group, ...]:
        """Each run by itself, where the pose sensor was set up anew for each: it stands wherever its run fits best."""
        return self._runs(SENSORS["pose_sensor"]) if "pose_sensor" in self.by_run else ()

    def _runs(self, kinds: Sequence[str]) -> tuple[Group, ...]:
        runs, first = np.unique(self.recording.run, return_index=True)
        return tuple(
            Group(self.recording.run_names[run], (run,), self._tolerances((place,), kinds))
            for run, place in zip(runs.tolist(), self.which[first].tolist(), strict=True)
        )

    def each(self) -> Iterator[tuple[Source, np.ndarray]]:
        """Yield every recording with the mask (N,) of its samples here."""
        for place, source in enumerate(self.sources):
            yield source, self.which == place

    def told(self, source: Source, text: str) -> str:
        """Return a sentence about one recording, with its name where there are several."""
        return f"{source.name}: {text}" if self.several else text

    @property
    def groups(self) -> dict[str, tuple[Group, ...]]:
        """Who shares a sensor with whom, by the sensor; those that all share are left out.

        Of a pose sensor with a station for each run none: where it stands is no parameter (`stations`).
        """
        found: dict[str, tuple[Group, ...]] = {}
        for sensor, kinds in SENSORS.items():
            if sensor in self.by_run:
                found[sensor] = () if self.stations and sensor == "pose_sensor" else self._runs(kinds)
                continue
            own = [place for place, source in enumerate(self.sources) if sensor in source.own]
            if not self.several or not own:
                continue
            shared = tuple(place for place in range(len(self.sources)) if place not in own)
            parts = [("", shared)] if shared else []
            parts += [(self.sources[place].name, (place,)) for place in own]
            found[sensor] = tuple(
                Group(label, self._setups_of(places), self._tolerances(places, kinds)) for label, places in parts
            )
        return found

    @property
    def alone(self) -> tuple[Group, ...]:
        """Each recording by itself, where there are several."""
        named = enumerate(self.sources) if self.several else ()
        return tuple(Group(source.name, self._setups_of((place,)), {}) for place, source in named)

    def _tolerances(self, places: tuple[int, ...], kinds: Sequence[str]) -> dict[str, float]:
        """Return what recordings that share a sensor say of it, and where they say nothing what the others do."""
        declared = [source.recording.tolerances.declared for source in self.sources]
        found: dict[str, float] = {}
        for item in (*(declared[place] for place in places), *declared):
            found = {**{kind: item[kind] for kind in kinds if kind in item}, **found}
        return found


def _names(recordings: Sequence[Recording]) -> list[str]:
    """Return a name of each for people: its file's, as short as tells them apart."""
    short = [Path(recording.path).name for recording in recordings]
    told = (own if short.count(own) == 1 else each.path for own, each in zip(short, recordings, strict=True))
    return [name or f"recording {place}" for place, name in enumerate(told, 1)]


def _check(recordings: Sequence[Recording], names: Sequence[str], joints: Sequence[str]) -> None:
    """Raise InputError where recordings cannot be of one device, or one of them is there twice."""
    robots = [recording.robot for recording in recordings]
    named = [(name, robot) for name, robot in zip(names, robots, strict=True) if robot]
    if len({Path(robot).stem for _, robot in named}) > 1:
        listed = ", ".join(f"{name} of '{robot}'" for name, robot in named)
        raise InputError(f"these are recordings of different robots: {listed}. Expected recordings of one device")
    for name, recording in zip(names, recordings, strict=True):
        if not len(recording):
            raise InputError(f"{name} holds no samples")
        if joints and not any(joint in recording.positions for joint in joints):
            there = ", ".join(f"q.{joint}" for joint in recording.positions) or "no q. column at all"
            raise InputError(
                f"{name} is of another robot: it has {there}; expected the actuated joints of this one, "
                f"{', '.join(f'q.{joint}' for joint in joints)}"
            )
        missing = [f"q.{joint}" for joint in joints if joint not in recording.positions]
        if missing:
            raise InputError(f"{name} lacks {', '.join(missing)}: every recording needs all actuated joints")
    for (first, one), (second, other) in combinations(zip(names, recordings, strict=True), 2):
        told = f"{first} and {second} hold the same samples, to the last digit"
        if one.path and other.path and Path(one.path).resolve() == Path(other.path).resolve():
            told = f"{Path(one.path).name} is given twice"
        elif not _same(one, other):
            continue
        raise InputError(f"{told}: its noise would count as two measurements. Give each recording once")


def _same(one: Recording, other: Recording) -> bool:
    """Return whether two recordings are one, copied: all that is measured or commanded is the same."""
    mine, theirs = ({"time": item.time, **dict(item.columns())} for item in (one, other))
    if len(one) != len(other) or mine.keys() != theirs.keys():
        return False
    return all(np.array_equal(mine[name], theirs[name], equal_nan=True) for name in mine)


def _own_sensors(recordings: Sequence[Recording]) -> list[tuple[str, ...]]:
    """Return the sensors that each recording has for itself: by its own word, or by another tolerance."""
    other = {
        sensor for sensor, kinds in SENSORS.items() if any(len({*_declared(recordings, k).values()}) > 1 for k in kinds)
    }
    return [tuple(each for each in SENSORS if each in item.own_sensors or each in other) for item in recordings]


def _declared(recordings: Sequence[Recording], kind: str) -> dict[int, float]:
    """Return the tolerances of one kind by the places of the recordings that declare it."""
    found = {place: recording.tolerances.declared.get(kind) for place, recording in enumerate(recordings)}
    return {place: value for place, value in found.items() if value is not None}


def _joined(recordings: Sequence[Recording], names: Sequence[str], gravity: Array) -> Recording:
    """Return all samples as one recording; what one of them did not measure is NaN there."""
    tables = [dict(recording.columns()) for recording in recordings]
    every = dict.fromkeys(name for table in tables for name in table)
    lacking = {f"g.{axis}": value for axis, value in zip(AXES, gravity.tolist(), strict=True)}
    columns = {
        name: np.concatenate(
            [
                table.get(name, np.full(len(recording), lacking.get(name, np.nan)))
                for table, recording in zip(tables, recordings, strict=True)
            ]
        )
        for name in every
        if not name.startswith("qd.") or all(name in table for table in tables)
    }
    time = np.concatenate([recording.time for recording in recordings])
    fields = fields_of(columns, len(time))
    fields["wrench"] = np.concatenate([recording.wrench for recording in recordings])  # read in other axes, it has more
    runs, run_names, first = [], [], 0
    for name, recording in zip(names, recordings, strict=True):
        runs.append(recording.run + first)
        run_names += [f"{name}: {label}" if label else name for label in recording.run_names]
        first += len(recording.run_names)
    return Recording(
        time=time,
        **fields,
        run=np.concatenate(runs),
        run_names=tuple(run_names),
        noise=recordings[0].noise,
        tolerances=_one_device(recordings, names),
        robot=next((recording.robot for recording in recordings if recording.robot), None),
        ignored=tuple(dict.fromkeys(name for recording in recordings for name in recording.ignored)),
        remarks=_remarks(recordings, names),
    )


def _one_device(recordings: Sequence[Recording], names: Sequence[str]) -> Tolerances:
    """Return the tolerances of the device. Raises InputError where recordings declare two of one kind."""
    sensors = {kind for kinds in SENSORS.values() for kind in kinds}
    found = {}
    for kind in (item.name for item in KINDS_OF_TOLERANCE):
        declared = _declared(recordings, kind)
        if len(set(declared.values())) > 1 and kind not in sensors:
            listed = ", ".join(f"{value:g} in {names[place]}" for place, value in declared.items())
            raise InputError(
                f"the tolerance '{kind}' is {listed}: one device has one. Expected the same in all recordings, or in "
                "one of them only; sensors' frames, targets and zeros may differ"
            )
        if declared:
            found[kind] = next(iter(declared.values()))
    return Tolerances(**found)


def _remarks(recordings: Sequence[Recording], names: Sequence[str]) -> tuple[str, ...]:
    """Return sentences on what some recordings have and others lack, where that matters."""
    remarks = []
    cold = [name for name, recording in zip(names, recordings, strict=True) if recording.temperature is None]
    if cold and len(cold) < len(names):
        remarks.append(f"{', '.join(cold)}: no temperature was recorded; taken at 20 degrees Celsius")
    speeds = {joint for recording in recordings for joint in recording.velocities}
    lost = sorted(joint for joint in speeds if any(joint not in recording.velocities for recording in recordings))
    if lost:
        remarks.append(f"not used: {', '.join(f'qd.{joint}' for joint in lost)} (not in every recording)")
    return tuple(remarks)
