"""`follow`: recordings of one device in order of time, each asked once; what was answered is kept in a folder."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, fields
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from .. import __version__
from ..diagnosis.corrected import corrected_model
from ..diagnosis.criteria import LITTLE, MOST_LISTED
from ..diagnosis.diagnose import diagnose
from ..diagnosis.prepare import Tell, silent
from ..errors import InputError
from ..loading import Reading
from ..numbers import some
from ..recordings import Recording
from ..recordings.recording import moment
from ..recordings.writer import json_lines, write_whole
from ..robot import Robot
from ..simulation import CorrectedModel, read_model, write_model
from ..spatial import Array
from .life import Answer, Evidence, Life, answer_of, evidence_of, followed, life_of

__all__ = [
    "KEPT",
    "MODEL",
    "check_given_once",
    "digest_of",
    "digest_of_parts",
    "digest_of_robot",
    "follow",
    "in_order_of_time",
    "keep_arrays",
    "named_in_errors",
]

#: In the folder of a life: the corrected model of its first recording, and what each recording answered.
MODEL, KEPT = "first_model.json", "kept"


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
    recordings, names = [recordings[place] for place in order], [names[place] for place in order]
    for item, name in zip(recordings[1:], names[1:], strict=True):
        anew = [sensor.replace("_", " ") for sensor in (*item.own_sensors, *item.own_by_run)]
        remarks += [f"{name}: set up again, and so free: {' and '.join(anew)}"] if anew else []
    count = len(recordings)
    with threadpool_limits(1, user_api="blas"):
        model, first = _first(robot, recordings[0], names[0], folder, robot_name, reading, tell)
        of_model = digest_of_parts(digest_of_robot(robot), (folder / MODEL).read_bytes())
        answers = [first]
        for place in range(1, count):
            key = digest_of_parts("answer", of_model, digest_of(recordings[place]))
            heard = partial(_part, tell, names[place], place / count, 1 / count)
            with named_in_errors(names[place]):
                asked = partial(_asked, robot, recordings[place], model, heard)
                answers.append(Answer.of(_kept_document(folder, key, asked)))
        if first.verdict == "unexplained":
            remarks.append(
                f"{names[0]} was left unexplained itself: what its model lacks is told as changed wherever later poses "
                "and loads show more of it. Look what it lacks before anything is repaired"
            )
        laws = followed(model, answers, robot.mechanism)
        of_laws = repr([(item.named.key, sorted(item.named.values.items())) for item in laws])
        evidence = []
        for place, (item, answer) in enumerate(zip(recordings, answers, strict=True) if laws else ()):
            key = digest_of_parts("evidence", of_model, digest_of(item), of_laws, repr(answer), repr(place == 0))
            with named_in_errors(names[place]):
                made = partial(evidence_of, robot, item, model, laws, answer, place == 0)
                evidence.append(_kept_evidence(folder, key, made))
    return life_of(robot, model, recordings, answers, laws, evidence, time, ordered_by, names, remarks)


def _asked(robot: Robot, recording: Recording, model: CorrectedModel, tell: Tell) -> dict[str, Any]:
    return asdict(answer_of(diagnose(robot, recording, against=model, tell=tell), robot.mechanism))


def _part(tell: Tell, name: str, begin: float, length: float, stage: str, share: float) -> None:
    """Tell how far one recording is, as a part of all."""
    tell(f"{name}: {stage}", begin + length * share)


def in_order_of_time(recordings: Sequence[Recording], names: Sequence[str]) -> tuple[list[int], Array, str, list[str]]:
    """Return the order of recordings, when they were made (n,) in that order [days], by what, and remarks.

    By the dates in their JSON files, or else as they are given, one after the other. Raises InputError where only some
    say when they were made.
    """
    silent = [name for item, name in zip(recordings, names, strict=True) if not item.date]
    if len(silent) == len(recordings):
        return list(range(len(recordings))), np.arange(float(len(recordings))), "the order given", []
    if silent:
        raise InputError(
            f"no date in the JSON {'file' if len(silent) == 1 else 'files'} of {', '.join(some(silent, MOST_LISTED))}, "
            'and one in those of the others. Expected "date": "2026-03-01" in all of them, or in none: then they are '
            "taken in the order given"
        )
    when = [moment(item.date).timestamp() / 86400 for item in recordings]
    order = sorted(range(len(when)), key=when.__getitem__)
    told = ", ".join(some([names[place] for place in order], MOST_LISTED))
    remarks = [] if order == sorted(order) else [f"put in order of their dates: {told}"]
    return order, np.array([when[place] for place in order]), "their dates", remarks


def _check(recordings: Sequence[Recording], names: Sequence[str]) -> None:
    """Raise InputError where recordings are no life of one device."""
    if len(recordings) < 2:
        raise InputError(
            f"{'one recording' if recordings else 'no recording'} is no life: expected two or more of one device. What "
            "a single one says, prup-pin diagnose tells"
        )
    check_given_once(recordings, names)
    for what, of in (
        ("robot", lambda item: Path(item.robot).stem if item.robot else ""),
        ("device", lambda x: x.device),
    ):
        first = next(((of(item), name) for item, name in zip(recordings, names, strict=True) if of(item)), ("", ""))
        for item, name in zip(recordings, names, strict=True):
            if of(item) and of(item) != first[0]:
                raise InputError(
                    f"{name} is of {what} '{of(item)}', and {first[1]} of '{first[0]}' ({what} in their JSON files). "
                    "Expected recordings of one device: follow each by itself"
                )


def check_given_once(recordings: Sequence[Recording], names: Sequence[str]) -> None:
    """Raise InputError where two recordings are the same."""
    seen: dict[str, str] = {}
    for item, name in zip(recordings, names, strict=True):
        key = digest_of(item)
        if key in seen:
            raise InputError(f"{name} is the same recording as {seen[key]}; give each once")
        seen[key] = name


@contextmanager
def named_in_errors(name: str) -> Iterator[None]:
    """Say in an error which recording or device it is about."""
    try:
        yield
    except InputError as error:
        if name in str(error):
            raise
        raise InputError(f"{name}: {error}") from error


# -- what is kept ------------------------------------------------------------------------------------------------------


def digest_of(recording: Recording) -> str:
    """Return a text that is the same for recordings of the same content, whatever they are called."""
    found = hashlib.sha256()
    for item in fields(recording):
        if item.name in ("path", "notes", "remarks", "ignored", "date"):
            continue
        value = getattr(recording, item.name)
        for name, part in sorted(value.items()) if hasattr(value, "items") else [("", value)]:
            found.update(f"{item.name} {name} ".encode())
            found.update(part.tobytes() if isinstance(part, np.ndarray) else repr(part).encode())
    return found.hexdigest()


def digest_of_robot(robot: Robot) -> str:
    """Return a text that is the same for robots of the same file and values."""
    file = robot.mechanism.description.path
    values = [(name, np.asarray(item.value).tolist()) for name, item in sorted(robot.parameters.items())]
    return digest_of_parts(file.read_bytes() if file.is_file() else str(file).encode(), repr(values))


def digest_of_parts(*parts: str | bytes) -> str:
    """Return a text that stands for all of these, and for this version."""
    found = hashlib.sha256(__version__.encode())
    for part in parts:
        found.update(hashlib.sha256(part if isinstance(part, bytes) else part.encode()).digest())
    return found.hexdigest()


def _first(
    robot: Robot,
    recording: Recording,
    name: str,
    folder: Path,
    robot_name: str,
    reading: Reading | None,
    tell: Tell,
) -> tuple[CorrectedModel, Answer]:
    """Return the corrected model of the first recording, as its file has it, and what that recording says."""
    path = folder / MODEL
    key = folder / KEPT / f"{digest_of_parts('first', digest_of_robot(robot), digest_of(recording))}.json"
    if key.exists() and path.exists():
        kept = json.loads(key.read_text(encoding="utf-8"))
        if hashlib.sha256(path.read_bytes()).hexdigest() != kept["model"]:
            raise InputError(
                f"'{path}' was changed since it was written, by hand or by another life: what later recordings were "
                "asked is not known of it any more. Put it back as it was, or remove it: it is then made again from "
                f"{name}"
            )
        return read_model(path), Answer.of(kept["answer"])
    with named_in_errors(name):
        found = diagnose(robot, recording, tell=partial(_part, tell, name, 0.0, LITTLE))
    if found.posterior is None:
        raise InputError(
            f"{name} holds nothing that later recordings could be compared with: expected poses of the tool or of "
            "markers (columns p.x … r.z)"
        )
    (folder / KEPT).mkdir(parents=True, exist_ok=True)
    model = corrected_model(found, robot, [recording], robot_name, reading, f"diagnosis of {name}, the first of a life")
    write_model(model, path)
    answer = asdict(answer_of(found, robot.mechanism))
    document = {"recording": name, "model": hashlib.sha256(path.read_bytes()).hexdigest(), "answer": answer}
    write_whole({key: json_lines(document)})
    return read_model(path), Answer.of(json.loads(json.dumps(answer)))


def _kept_document(folder: Path, key: str, make: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """Return what a file of this key holds, made and written where there is none yet."""
    path = folder / KEPT / f"{key}.json"
    if not path.exists():
        write_whole({path: json_lines(make())})
    return json.loads(path.read_text(encoding="utf-8"))


def keep_arrays(path: Path, **arrays: Any) -> None:
    """Write arrays by name, all of them or none."""
    held = BytesIO()
    np.savez(held, **arrays)
    write_whole({path: [held.getvalue()]})


def _kept_evidence(folder: Path, key: str, make: Callable[[], Evidence]) -> Evidence:
    """Return the evidence of this key, made and written where there is none yet."""
    path = folder / KEPT / f"{key}.npz"
    if not path.exists():
        made = make()
        keep_arrays(path, precision=made.precision, score=made.score, library=made.library)
    with np.load(path) as found:
        return Evidence(found["precision"], found["score"], int(found["library"]))
