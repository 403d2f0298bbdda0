"""A fleet: many devices of one drawing, what is common to them, and what is each one's own.

Each device is diagnosed by itself, one a task of any executor, and then linearised about its own corrected model: what
its tests say of every calibrated parameter, without the tolerances that were declared, with the values of its laws and
where its tracker and targets stand integrated out. What they say together is a linear mixed model
(`random_effects.py`).
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from ..diagnosis.chances import WITHIN_95
from ..diagnosis.corrected import corrected_model
from ..diagnosis.criteria import LITTLE, MOST_LISTED, ROUNDING
from ..diagnosis.diagnose import diagnose
from ..errors import InputError
from ..laws.deviations import Calibration, calibration_of
from ..loading import Reading
from ..numbers import some
from ..recordings import KINDS_OF_TOLERANCE, SENSORS, Recording
from ..recordings.writer import json_lines, write_whole
from ..robot import Robot
from ..simulation import CorrectedModel
from ..simulation.model_file import model_document
from ..spatial import Array
from ..sweep.running import returned
from .follow import KEPT, check_given_once, digest_of, digest_of_parts, digest_of_robot, keep_arrays, named_in_errors
from .life import Answer, answer_of, linearised
from .random_effects import COMMON, Likelihoods, mixed_model

__all__ = ["Device", "Fleet", "Off", "Scatter", "devices_of", "fleet"]

#: What is set up for a test and is no part of a device.
_SET_UP = {*SENSORS["pose_sensor"], *SENSORS["target"]}


class Device(NamedTuple):
    """A device by its name, with its recordings."""

    name: str
    recordings: tuple[Recording, ...]


@dataclass(frozen=True)
class Off:
    """A parameter that is off by a value with its 95 % interval: the drawing's, or one device's beyond its like.

    In the parameter's unit, or as a share of the drawn value where `relative`. others: parameters of which the tests
    cannot tell it.
    """

    device: str
    parameter: str
    kind: str
    unit: str
    relative: bool
    value: float
    interval: tuple[float, float]
    others: tuple[str, ...]


@dataclass(frozen=True)
class Scatter:
    """By how much a kind of parameter scatters over a fleet, one standard deviation with its 95 % interval.

    told: whether a spread is seen and known to a factor of three. declared: what the recordings declare, where they do;
    count: parameters of the kind.
    """

    kind: str
    unit: str
    value: float
    interval: tuple[float, float]
    told: bool
    declared: float | None
    count: int


@dataclass(frozen=True)
class Fleet:
    """What devices of one drawing say together.

    common: errors of the drawing; outliers: single devices; scatter: by kind; laws: how many devices have a law at a
    place, by 'physics at place'; own: of each device by how much each of `parameters` is off beside what is common.
    """

    devices: tuple[str, ...]
    answers: tuple[Answer, ...]
    common: tuple[Off, ...]
    outliers: tuple[Off, ...]
    scatter: tuple[Scatter, ...]
    laws: Mapping[str, int]
    parameters: tuple[str, ...]
    own: Array
    remarks: tuple[str, ...] = ()

    @property
    def tolerances(self) -> dict[str, float]:
        """The kinds whose spread is told, as `tolerances` of a recording declare them; three digits."""
        return {item.kind: float(f"{item.value:.3g}") for item in self.scatter if item.told}


def devices_of(recordings: Sequence[Recording]) -> list[Device]:
    """Return recordings by device: that which they say (`device`), else each file is one, or its folder.

    Raises InputError where fewer than three devices are left, or a recording is given twice.
    """
    stems = [Path(item.path).stem for item in recordings]
    names = stems if len(set(stems)) == len(stems) else [Path(item.path).resolve().parent.name for item in recordings]
    check_given_once(recordings, [item.path for item in recordings])
    found: dict[str, list[Recording]] = {}
    for item, name in zip(recordings, names, strict=True):
        found.setdefault(item.device or name, []).append(item)
    if len(found) < 3:
        raise InputError(
            f"a fleet of {len(found)} ({', '.join(some(list(found), MOST_LISTED))}): expected recordings of three "
            'devices or more. Which device a recording is of, its JSON file says ("device": "number 7"), or its name'
        )
    return [Device(name, tuple(items)) for name, items in found.items()]


def _silent(done: int, total: int) -> None:
    pass


def fleet(
    devices: Sequence[Device],
    folder: str | Path,
    *,
    robot_name: str,
    reading: Reading | None = None,
    executor: Executor | None = None,
    tell: Callable[[int, int], None] = _silent,
) -> Fleet:
    """Return what devices of one drawing have in common, by how much kinds of parameters scatter, and who stands apart.

    robot_name, reading: what the robot is loaded from, here and by workers, and how it is read. executor: any of
    `concurrent.futures`, or a Dask client's; one device is a task, and one whose worker is lost is diagnosed here. What
    a device answered is kept in `folder`, by the content of its recordings and the robot's: what is there is not
    asked again. The bits do not depend on any of this. `tell(done, total)` hears how far it is.

    Raises InputError where devices cannot be compared, and as `diagnose` does, with the device's name.
    """
    folder, reading = Path(folder), reading or Reading()
    robot = reading.load(robot_name)
    of_robot = digest_of_robot(robot)
    keys = [digest_of_parts("device", of_robot, *map(digest_of, item.recordings)) for item in devices]
    kept = folder / KEPT
    asked = [place for place, key in enumerate(keys) if not (kept / f"{key}.npz").exists()]
    tell(len(devices) - len(asked), len(devices))
    kept.mkdir(parents=True, exist_ok=True)
    lost = 0
    for count, (place, found, was_lost) in enumerate(_tasks(asked, devices, robot_name, reading, executor), 1):
        lost += was_lost
        _keep(kept, keys[place], devices[place].name, found, folder)
        tell(len(devices) - len(asked) + count, len(devices))
    remarks = []
    if lost:
        remarks.append(
            f"{lost} of {len(asked)} devices came back from no worker (one may have died) and were diagnosed in this "
            "process; the numbers are the same"
        )
    said = [_read(kept / f"{key}.npz") for key in keys]
    with threadpool_limits(1, user_api="blas"):
        return _together(robot, devices, said, remarks)


# -- one device --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Said:
    """What one device says: its answer, its model's file, and precision and score of parameters by name."""

    answer: Answer
    model: dict[str, Any]
    names: tuple[str, ...]
    precision: Array
    score: Array


def _asked(device: Device, robot_name: str, reading: Reading, into: str) -> _Said:
    """Return what a device says. into: the file that will hold its corrected model."""
    robot = reading.load(robot_name)
    recordings = list(device.recordings)
    with threadpool_limits(1, user_api="blas"), named_in_errors(device.name):
        found = diagnose(robot, recordings)
        if found.posterior is None:
            raise InputError("holds nothing that devices could be compared by: expected poses (columns p.x … r.z)")
        notes = f"diagnosis of {device.name}, one of a fleet"
        model = corrected_model(found, robot, recordings, robot_name, reading, notes)
        answer = answer_of(found, robot.mechanism)
        names, precision, score = _likelihood(robot, recordings, model, answer.left)
    return _Said(answer, model_document(model, into), names, precision, score)


def _likelihood(
    robot: Robot, recordings: Sequence[Recording], model: CorrectedModel, left: float
) -> tuple[tuple[str, ...], Array, Array]:
    """Return what recordings say of a device's parameters: names, and precision and score of how far off they are.

    A law that does what parameters of its own place do is told as these; values of other laws are free.
    """
    earlier, prepared, _, residual, by_x, rows = linearised(robot, recordings, model)
    kept, toleranced = len(rows), prepared.toleranced
    assert toleranced.root is not None
    assert toleranced.centre is not None
    root = toleranced.root[:kept, :kept] * toleranced.tolerances[:kept, None]
    by_value = np.linalg.solve(root.T, by_x[:, :kept].T).T
    owners = [earlier.effects[earlier.posterior.values[row].effect] for row in rows]
    calibrated = np.array([isinstance(effect.law, Calibration) for effect in owners], bool)
    deviations, off = toleranced.law.deviations[:kept], toleranced.centre[:kept].copy()
    own = calibrated & np.array([item.kind not in _SET_UP for item in deviations], bool)
    free = ~own
    for place in np.flatnonzero(~calibrated):
        effect, name = owners[place], earlier.posterior.values[rows[place]].name
        where = (effect.law.physics, effect.place.name)
        like = [k for k in np.flatnonzero(own) if (deviations[k].physics, deviations[k].place) == where]
        shares = np.linalg.lstsq(by_value[:, like], by_value[:, place], rcond=None)[0]
        rest = by_value[:, place] - by_value[:, like] @ shares
        if np.linalg.norm(rest) < LITTLE * np.linalg.norm(by_value[:, place]):
            value, neutral = effect.values[name], effect.law.neutral_at(effect.place, robot.mechanism)[name]
            off[like] += shares * (np.log(value / neutral) if deviations[place].relative else value - neutral)
            free[place] = False
    others = np.concatenate((by_value[:, free], by_x[:, kept:]), axis=1)
    target = residual.ravel() + by_value[:, own] @ off[own]
    names = tuple(item.name for item, mine in zip(deviations, own.tolist(), strict=True) if mine)
    return names, *_beside(by_value[:, own], others, target, 1 / max(1.0, left) ** 2)


def _beside(jacobian: Array, free: Array, target: Array, weight: float) -> tuple[Array, Array]:
    """Return precision and score of values by their Jacobian, beside others that nothing holds."""
    size = np.linalg.norm(free, axis=0)
    left, sizes, _ = np.linalg.svd(free[:, size > 0] / size[size > 0], full_matrices=False)
    basis = left[:, sizes > ROUNDING**0.5]
    rest = jacobian - basis @ (basis.T @ jacobian)
    return weight * rest.T @ rest, weight * rest.T @ target


def _tasks(
    places: Sequence[int], devices: Sequence[Device], robot_name: str, reading: Reading, executor: Executor | None
) -> Iterator[tuple[int, _Said, bool]]:
    """Yield (device, what it says, whether its worker was lost), in their order."""
    jobs = [(devices[place], robot_name, reading, f"{devices[place].name}.json") for place in places]
    futures: list[Future | None] = []
    for job in jobs:
        try:
            futures.append(None if executor is None else executor.submit(_asked, *job))
        except RuntimeError:  # a pool that has lost a worker takes nothing more
            futures.append(None)
    for place, job, future in zip(places, jobs, futures, strict=True):
        found = None if future is None else returned(future)
        yield place, found or _asked(*job), executor is not None and found is None


# -- what is kept ------------------------------------------------------------------------------------------------------


def _keep(kept: Path, key: str, name: str, said: _Said, folder: Path) -> None:
    """Write what a device said: its corrected model for people, and the rest to go on from, that last."""
    models = folder / "devices"
    models.mkdir(exist_ok=True)
    write_whole({models / f"{_file_name(name)}.json": json_lines(said.model)})
    about = json.dumps({"answer": asdict(said.answer), "names": said.names})
    keep_arrays(kept / f"{key}.npz", about=np.array(about), precision=said.precision, score=said.score)


def _file_name(name: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "-_." else "_" for letter in name)


class _Kept(NamedTuple):
    answer: Answer
    names: list[str]
    precision: Array
    score: Array


def _read(path: Path) -> _Kept:
    with np.load(path) as found:
        about = json.loads(str(found["about"]))
        return _Kept(Answer.of(about["answer"]), about["names"], found["precision"], found["score"])


# -- all of them -------------------------------------------------------------------------------------------------------


def _together(robot: Robot, devices: Sequence[Device], said: Sequence[_Kept], remarks: Sequence[str]) -> Fleet:
    """Return what devices say together."""
    every = {name for item in said for name in item.names}
    deviations = [item for item in calibration_of(robot.mechanism).deviations if item.name in every]
    declared: dict[str, float] = {}
    for device in devices:
        for recording in device.recordings:
            declared |= recording.tolerances.declared
    kinds = list(dict.fromkeys(item.kind for item in deviations))
    answers = tuple(item.answer for item in said)
    laws = Counter(f"{each.physics} at {each.location}" for answer in answers for each in answer.named)
    names = tuple(device.name for device in devices)
    if not deviations:
        told = (
            *remarks,
            "no parameter was calibrated: declare tolerances (--tolerances typical), and their spread is told",
        )
        return Fleet(names, answers, (), (), (), dict(laws), (), np.zeros((len(devices), 0)), told)
    place = {item.name: index for index, item in enumerate(deviations)}
    p = len(deviations)
    precision, score = np.zeros((len(said), p, p)), np.zeros((len(said), p))
    for index, item in enumerate(said):
        where = [place[name] for name in item.names]
        precision[index][np.ix_(where, where)] = item.precision
        score[index][where] = item.score
    kind = np.array([kinds.index(item.kind) for item in deviations])
    told_by = {item.name: item for item in KINDS_OF_TOLERANCE}
    relative = [name in told_by and told_by[name].unit == "relative" for name in kinds]
    start = np.array([declared.get(name, _usual(precision, kind == index)) for index, name in enumerate(kinds)])
    model = mixed_model(Likelihoods(precision, score, kind, start))
    common: list[Off] = []
    outliers: list[Off] = []
    for effect in model.fixed:
        off, reach = deviations[effect.parameter], WITHIN_95 * effect.deviation
        found = Off(
            "" if effect.device == COMMON else names[effect.device],
            off.name,
            off.kind,
            off.unit,
            off.relative,
            effect.value,
            (effect.value - reach, effect.value + reach),
            tuple(deviations[other].name for other in effect.others),
        )
        (common if effect.device == COMMON else outliers).append(found)
    scatter = tuple(
        Scatter(
            name,
            "relative" if relative[index] else next(item.unit for item in deviations if item.kind == name),
            float(model.tau[index]),
            (float(model.interval[index, 0]), float(model.interval[index, 1])),
            bool(model.told[index]) and name in told_by,
            declared.get(name),
            int((kind == index).sum()),
        )
        for index, name in enumerate(kinds)
    )
    parameters = tuple(item.name for item in deviations)
    return Fleet(
        names, answers, tuple(common), tuple(outliers), scatter, dict(laws.most_common()), parameters, model.own,
        tuple(remarks),
    )  # fmt: skip


def _usual(precision: Array, here: np.ndarray) -> float:
    """Return a size to begin with, of a kind of which nothing was declared: what a device tells of it alone."""
    told = np.einsum("ijj->ij", precision)[:, here]
    return float(1 / np.sqrt(np.median(told[told > 0]))) if (told > 0).any() else 1.0
