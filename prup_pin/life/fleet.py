"""A fleet: many devices of one drawing, what is common to them, and what is each one's own.

Each device is diagnosed by itself, one a task of any executor, and then linearised about its own corrected model: what
its tests say of every calibrated parameter, without the tolerances that were declared, with the values of its laws and
where its tracker and targets stand integrated out. What they say together is a linear mixed model
(`random_effects.py`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from ..diagnosis.chances import WITHIN_95
from ..diagnosis.corrected import corrected_model
from ..diagnosis.criteria import LITTLE, MOST_LISTED
from ..diagnosis.diagnose import diagnose
from ..diagnosis.linearised import Linearised
from ..diagnosis.nuisance import Nuisance
from ..errors import InputError
from ..files import json_lines, write_whole
from ..laws.deviations import Calibration, Deviation, calibration_of
from ..loading import Reading
from ..numbers import some
from ..recordings import KINDS_OF_TOLERANCE, SENSORS, Recording
from ..robot import Robot
from ..simulation import CorrectedModel
from ..simulation.model_file import model_document
from ..spatial import Array
from ..sweep.running import lost_remark, returned_in_order
from .change_points import Likelihood
from .kept import Answer, Kept, check_given_once, digest, digest_of, keep, kept, named_in_errors
from .random_effects import COMMON, FixedEffect, Likelihoods, mixed_model

#: What is set up for a test and is no part of a device.
_SET_UP = {*SENSORS["pose_sensor"], *SENSORS["target"]}
#: Units by kind of tolerance.
_UNITS = {item.name: item.unit for item in KINDS_OF_TOLERANCE}


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
    place, by 'physics at place'; own: of each device by how much each of `parameters`, of `kinds`, is off
    beside what is common, (devices, parameters).
    """

    devices: tuple[str, ...]
    answers: tuple[Answer, ...]
    common: tuple[Off, ...]
    outliers: tuple[Off, ...]
    scatter: tuple[Scatter, ...]
    laws: Mapping[str, int]
    parameters: tuple[str, ...]
    kinds: tuple[str, ...]
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
    keys = [digest("device", robot.mechanism.fingerprint, *map(digest_of, item.recordings)) for item in devices]
    said = [kept(folder, key) for key in keys]
    asked = [place for place, item in enumerate(said) if item is None]
    finished, lost, remarks = len(devices) - len(asked), 0, []
    tell(finished, len(devices))
    models = folder.resolve() / "devices"
    jobs = [
        (devices[place], robot_name, reading, models / f"{_file_name(devices[place].name)}.json") for place in asked
    ]
    back = iter([None] * len(jobs)) if executor is None else returned_in_order(executor, _asked, jobs)
    for count, (place, job, found) in enumerate(zip(asked, jobs, back, strict=True), 1):
        lost += found is None
        model, answer = found or _asked(*job)
        models.mkdir(parents=True, exist_ok=True)
        write_whole({job[-1]: json_lines(model)})
        said[place] = keep(folder, keys[place], answer)
        tell(finished + count, len(devices))
    if lost and executor is not None:
        remarks.append(lost_remark(lost, len(asked), "devices", "diagnosed"))
    with threadpool_limits(1, user_api="blas"):
        return _together(robot, devices, [item for item in said if item is not None], remarks)


# -- one device --------------------------------------------------------------------------------------------------------


def _asked(device: Device, robot_name: str, reading: Reading, path: Path) -> tuple[Mapping[str, Any], Kept]:
    """Return a device's corrected model, as a file has it, and what it names and its tests say of its parameters.

    path: the file of its corrected model, beside which the robot file is named; a worker may stand in another folder.
    """
    robot = reading.load(robot_name)
    recordings = list(device.recordings)
    with threadpool_limits(1, user_api="blas"), named_in_errors(device.name):
        found = diagnose(robot, recordings)
        if found.posterior is None:
            raise InputError("holds nothing that devices could be compared by: expected poses (columns p.x … r.z)")
        notes = f"diagnosis of {device.name}, one of a fleet"
        model = corrected_model(found, robot, recordings, robot_name, reading, notes)
        answer = Answer.of(found)
        names, said = _likelihood(robot, recordings, model, max(1.0, answer.left))
    document = model_document(model, path)
    return document, Kept({"answer": asdict(answer), "names": names}, said._asdict())


def _likelihood(
    robot: Robot, recordings: Sequence[Recording], model: CorrectedModel, noise: float
) -> tuple[list[str], Likelihood]:
    """Return what recordings say of a device's parameters: names, and by how much each is off the drawing.

    A law that does what parameters of its own place do is told as these; values of other laws are free.
    """
    test = Linearised.of(robot, recordings, model)
    assert model.posterior is not None
    assert test.prepared.toleranced.centre is not None
    values = [model.posterior.values[row] for row in test.rows]
    effects = [model.effects[item.effect] for item in values]
    deviations = test.prepared.toleranced.law.deviations[: len(values)]
    off = test.prepared.toleranced.centre[: len(values)].copy()
    calibrated = np.array([isinstance(effect.law, Calibration) for effect in effects], bool)
    own = calibrated & np.array([item.kind not in _SET_UP for item in deviations], bool)
    free = ~own
    for place in np.flatnonzero(~calibrated):
        effect, change = effects[place], test.by_value[:, place]
        where = (effect.law.physics, effect.place.name)
        like = [k for k in np.flatnonzero(own) if (deviations[k].physics, deviations[k].place) == where]
        shares = np.linalg.lstsq(test.by_value[:, like], change, rcond=None)[0]
        if np.linalg.norm(change - test.by_value[:, like] @ shares) < LITTLE * np.linalg.norm(change):
            name = values[place].name
            value, neutral = effect.values[name], effect.law.neutral_at(effect.place, robot.mechanism)[name]
            off[like] += shares * (np.log(value / neutral) if deviations[place].relative else value - neutral)
            free[place] = False
    nuisance = Nuisance.free(np.column_stack((test.by_value[:, free], test.anew)))
    target = test.residual.ravel() + test.by_value[:, own] @ off[own]
    names = [item.name for item, mine in zip(deviations, own.tolist(), strict=True) if mine]
    return names, Likelihood.of(test.by_value[:, own] / noise, target / noise, nuisance)


def _file_name(name: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "-_." else "_" for letter in name)


# -- all of them -------------------------------------------------------------------------------------------------------


def _together(robot: Robot, devices: Sequence[Device], said: Sequence[Kept], remarks: Sequence[str]) -> Fleet:
    """Return what devices say together."""
    every = {name for item in said for name in item.about["names"]}
    deviations = [item for item in calibration_of(robot.mechanism).deviations if item.name in every]
    declared: dict[str, float] = {}
    for device in devices:
        for recording in device.recordings:
            declared |= recording.tolerances.declared
    answers = tuple(Answer.read(item.about["answer"]) for item in said)
    laws = Counter(str(each) for answer in answers for each in answer.named)
    names = tuple(device.name for device in devices)
    parameters, kind_of = tuple(item.name for item in deviations), tuple(item.kind for item in deviations)
    p, kinds = len(deviations), list(dict.fromkeys(kind_of))
    if not p:
        why = "no parameter was calibrated: declare tolerances (--tolerances typical), and their spread is told"
        own = np.zeros((len(devices), 0))
        return Fleet(names, answers, (), (), (), dict(laws.most_common()), (), (), own, (*remarks, why))
    precision, score = np.zeros((len(said), p, p)), np.zeros((len(said), p))
    for index, item in enumerate(said):
        where = [parameters.index(name) for name in item.about["names"]]
        precision[index][np.ix_(where, where)] = item.arrays["precision"]
        score[index][where] = item.arrays["score"]
    kind = np.array([kinds.index(name) for name in kind_of])
    start = np.array([declared.get(name, _usual(precision, kind == index)) for index, name in enumerate(kinds)])
    model = mixed_model(Likelihoods(precision, score, kind, start))
    off = [_off(effect, deviations, names) for effect in model.fixed]
    scatter = tuple(
        Scatter(
            name,
            "relative" if _UNITS.get(name) == "relative" else deviations[kind_of.index(name)].unit,
            float(model.tau[index]),
            (float(model.interval[index, 0]), float(model.interval[index, 1])),
            bool(model.told[index]) and name in _UNITS,
            declared.get(name),
            kind_of.count(name),
        )
        for index, name in enumerate(kinds)
    )
    common, outliers = (tuple(item for item in off if bool(item.device) == single) for single in (False, True))
    return Fleet(
        names, answers, common, outliers, scatter, dict(laws.most_common()), parameters, kind_of, model.own,
        tuple(remarks),
    )  # fmt: skip


def _off(effect: FixedEffect, deviations: Sequence[Deviation], names: Sequence[str]) -> Off:
    """Return an error of the drawing, or of one device, by its parameter's name."""
    item, reach = deviations[effect.parameter], WITHIN_95 * effect.deviation
    return Off(
        "" if effect.device == COMMON else names[effect.device], item.name, item.kind, item.unit, item.relative,
        effect.value, (effect.value - reach, effect.value + reach),
        tuple(deviations[other].name for other in effect.others),
    )  # fmt: skip


def _usual(precision: Array, here: np.ndarray) -> float:
    """Return a size to begin with, of a kind of which nothing was declared: what a device tells of it alone."""
    told = np.einsum("ijj->ij", precision)[:, here]
    return float(1 / np.sqrt(np.median(told[told > 0]))) if (told > 0).any() else 1.0
