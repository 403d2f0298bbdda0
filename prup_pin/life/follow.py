"""`follow`: recordings of one device in order of time, each asked once; what was answered is kept in a folder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from ..diagnosis.corrected import corrected_model
from ..diagnosis.criteria import LITTLE, MOST_LISTED
from ..diagnosis.diagnose import diagnose
from ..diagnosis.prepare import Tell, silent
from ..errors import InputError
from ..loading import Reading
from ..numbers import some
from ..recordings import Recording
from ..recordings.recording import moment
from ..robot import Robot
from ..simulation import CorrectedModel, read_model, write_model
from ..spatial import Array
from .followed import evidence_of, followed
from .kept import Answer, Kept, check_given_once, digest, digest_of, keep, kept, named_in_errors, once
from .life import Life, changes_of

#: In the folder of a life: the corrected model of its first recording.
MODEL = "first_model.json"


def follow(
    robot: Robot,
    recordings: Sequence[Recording],
    folder: str | Path,
    *,
    robot_name: str,
    reading: Reading | None = None,
    tell: Tell = silent,
) -> Life:
    """Return what changed during a machine's life, by its recordings.

    robot_name, reading: what the robot is loaded from, and how it was read. What a recording answers is kept in
    `folder`, by its content, the robot's and the first model's: with a further recording only that one is asked, and
    the answer is, to the bit, that of all at once. `tell(stage, share)` hears how far it is.

    Raises InputError where there are fewer than two recordings, or two are the same, of other robots or other devices,
    or only some say when they were made, or the first model in the folder was changed by hand; and as `diagnose` does.
    """
    folder = Path(folder)
    names = [Path(item.path).name or f"recording {place}" for place, item in enumerate(recordings, 1)]
    order, time, ordered_by, remarks = in_order_of_time(recordings, names)
    _check(recordings, names)
    tests = [(names[place], recordings[place]) for place in order]
    for name, item in tests[1:]:
        anew = [sensor.replace("_", " ") for sensor in (*item.own_sensors, *item.own_by_run)]
        remarks += [f"{name}: set up again, and so free: {' and '.join(anew)}"] if anew else []

    def heard(place: int, length: float) -> Tell:
        return lambda stage, share: tell(f"{tests[place][0]}: {stage}", place / len(tests) + length * share)

    with threadpool_limits(1, user_api="blas"):
        with named_in_errors(tests[0][0]):
            model, answer = _first(robot, *tests[0], folder, robot_name, reading, heard(0, LITTLE))
        of_model, answers = digest(robot.mechanism.fingerprint, (folder / MODEL).read_bytes()), [answer]
        for place, (name, item) in enumerate(tests[1:], 1):
            key, part = digest("answer", of_model, digest_of(item)), heard(place, 1 / len(tests))
            with named_in_errors(name):
                said = once(folder, key, partial(_answer, robot, item, model, part))
            answers.append(Answer.read(said.about))
        if answer.verdict == "unexplained":
            remarks.append(
                f"{tests[0][0]} was left unexplained itself: what its model lacks is told as changed wherever later "
                "poses and loads show more of it. Look what it lacks before anything is repaired"
            )
        laws = followed(model, answers, robot.mechanism)
        of_laws = repr([(item.named.key, sorted(item.named.values.items())) for item in laws])
        evidence = []
        for place, ((name, item), answer) in enumerate(zip(tests, answers, strict=True) if laws else ()):
            key = digest("evidence", of_model, digest_of(item), of_laws, repr(answer), repr(place == 0))
            with named_in_errors(name):
                said = once(folder, key, partial(evidence_of, robot, item, model, laws, answer, place == 0))
            evidence.append(said)
    changes, series = changes_of(model, answers, laws, evidence, time, robot.mechanism)
    dates = tuple(item.date for _, item in tests)
    return Life(
        tuple(name for name, _ in tests), dates, ordered_by, tuple(answers), changes, series, tuple(remarks), model
    )


def _answer(robot: Robot, recording: Recording, model: CorrectedModel, tell: Tell) -> Kept:
    """Return what a recording says against the first one's model."""
    return Kept(asdict(Answer.of(diagnose(robot, recording, against=model, tell=tell))), {})


def in_order_of_time(recordings: Sequence[Recording], names: Sequence[str]) -> tuple[list[int], Array, str, list[str]]:
    """Return the order of recordings, when they were made (n,) in that order [days], by what, and remarks.

    By the dates in their JSON files, or else as they are given, one after the other. Raises InputError where only some
    say when they were made.
    """
    undated = [name for item, name in zip(recordings, names, strict=True) if not item.date]
    if len(undated) == len(recordings):
        return list(range(len(recordings))), np.arange(float(len(recordings))), "the order given", []
    if undated:
        files = f"{'file' if len(undated) == 1 else 'files'} of {', '.join(some(undated, MOST_LISTED))}"
        raise InputError(
            f"no date in the JSON {files}, "
            'and one in those of the others. Expected "date": "2026-03-01" in all of them, or in none: then they are '
            "taken in the order given"
        )
    when = np.array([moment(item.date).timestamp() / 86400 for item in recordings])
    order = np.argsort(when, kind="stable").tolist()
    told = ", ".join(some([names[place] for place in order], MOST_LISTED))
    remarks = [] if order == sorted(order) else [f"put in order of their dates: {told}"]
    return order, when[order], "their dates", remarks


def _check(recordings: Sequence[Recording], names: Sequence[str]) -> None:
    """Raise InputError where recordings are no life of one device."""
    if len(recordings) < 2:
        raise InputError(
            f"{'one recording' if recordings else 'no recording'} is no life: expected two or more of one device. What "
            "a single one says, prup-pin diagnose tells"
        )
    check_given_once(recordings, names)
    for what, said in (
        ("robot", [Path(item.robot or "").stem for item in recordings]),
        ("device", [item.device for item in recordings]),
    ):
        first, *others = [pair for pair in zip(said, names, strict=True) if pair[0]] or [("", "")]
        for value, name in others:
            if value != first[0]:
                raise InputError(
                    f"{name} is of {what} '{value}', and {first[1]} of '{first[0]}' ({what} in their JSON files). "
                    "Expected recordings of one device: follow each by itself"
                )


def _first(
    robot: Robot,
    name: str,
    recording: Recording,
    folder: Path,
    robot_name: str,
    reading: Reading | None,
    tell: Tell,
) -> tuple[CorrectedModel, Answer]:
    """Return the corrected model of the first recording, as its file has it, and what that recording says."""
    path, key = folder / MODEL, digest("first", robot.mechanism.fingerprint, digest_of(recording))
    said = kept(folder, key) if path.exists() else None
    if said is None:
        found = diagnose(robot, recording, tell=tell)
        if found.posterior is None:
            raise InputError(
                f"{name} holds nothing that later recordings could be compared with: expected poses of the tool or of "
                "markers (columns p.x … r.z)"
            )
        folder.mkdir(parents=True, exist_ok=True)
        notes = f"diagnosis of {name}, the first of a life"
        write_model(corrected_model(found, robot, [recording], robot_name, reading, notes), path)
        about = {"model": digest(path.read_bytes()), "answer": asdict(Answer.of(found))}
        said = keep(folder, key, Kept(about, {}))
    if digest(path.read_bytes()) != said.about["model"]:
        raise InputError(
            f"'{path}' was changed since it was written, by hand or by another life: what later recordings were asked "
            f"is not known of it any more. Put it back as it was, or remove it: it is then made again from {name}"
        )
    return read_model(path), Answer.read(said.about["answer"])
