"""What tests answered, kept in a folder by what was asked: given again, nothing is asked twice.

What one test says for itself is an `Answer`: its verdict, what is left, and which laws it names.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .. import __version__
from ..diagnosis.diagnosis import Diagnosis
from ..errors import InputError
from ..files import write_whole
from ..recordings import Recording
from ..spatial import Array

#: The folder in that of a life or a fleet.
KEPT = "kept"


@dataclass(frozen=True)
class Named:
    """A law that a test names: its physics, place and values, and what it cannot be told from."""

    physics: str
    location: str
    aspect: str
    values: Mapping[str, float]
    others: tuple[str, ...] = ()

    @property
    def key(self) -> tuple[str, str, str]:
        return self.physics, self.location, self.aspect

    def __str__(self) -> str:
        return f"{self.physics} at {self.location}"


@dataclass(frozen=True)
class Answer:
    """What a test says for itself: its verdict, what is left in multiples of the noise, and what it names."""

    verdict: str
    left: float
    named: tuple[Named, ...] = ()
    unknown: tuple[str, ...] = ()  # where something is that no law explains

    @classmethod
    def of(cls, diagnosis: Diagnosis) -> Answer:
        """Return what a diagnosis, of the robot file or against an earlier model, names that lasts."""
        named = []
        for item in diagnosis.findings:
            effect = item.effect
            if effect is None or not item.is_fault or not effect.law.lasts or effect.law.partial or not effect.values:
                continue
            places = (f"{item.physics} at {place}" for place in item.candidates if place != item.location)
            others = (*places, *item.alternatives)
            named.append(Named(item.physics, effect.place.name, effect.place.aspect, dict(effect.values), others))
        unknown = tuple(item.location for item in diagnosis.findings if item.physics == "unknown")
        after = float(diagnosis.after["fit"])
        return cls(diagnosis.verdict, after if np.isfinite(after) else 1.0, tuple(named), unknown)

    @classmethod
    def read(cls, document: Mapping[str, Any]) -> Answer:
        """Return that of `dataclasses.asdict`, read from JSON."""
        named = tuple(Named(**{**item, "others": tuple(item["others"])}) for item in document["named"])
        return cls(document["verdict"], document["left"], named, tuple(document["unknown"]))

    @property
    def told(self) -> list[str]:
        """What it names, and where something is unknown, as 'backlash at joint2/gear'."""
        return [*map(str, self.named), *(f"unknown at {location}" for location in self.unknown)]


class Kept(NamedTuple):
    """What a test answered: what JSON can hold, and arrays by name."""

    about: Mapping[str, Any]
    arrays: Mapping[str, Array]


def kept(folder: Path, key: str) -> Kept | None:
    """Return the answer of this key in a folder; None where there is none yet."""
    path = folder / KEPT / f"{key}.npz"
    if not path.exists():
        return None
    with np.load(path) as found:
        arrays = {name: found[name] for name in found.files}
    return Kept(json.loads(str(arrays.pop("about"))), arrays)


def keep(folder: Path, key: str, made: Kept) -> Kept:
    """Write an answer, all of it or nothing; return it as it is read."""
    held = BytesIO()
    everything: dict[str, Any] = {"about": np.array(json.dumps(made.about)), **made.arrays}
    np.savez(held, **everything)
    path = folder / KEPT / f"{key}.npz"
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole({path: [held.getvalue()]})
    return kept(folder, key) or made


def once(folder: Path, key: str, make: Callable[[], Kept]) -> Kept:
    """Return the answer of this key in a folder, which is made and kept where there is none yet."""
    return kept(folder, key) or keep(folder, key, make())


def digest(*parts: str | bytes) -> str:
    """Return a text that stands for all of these, and for this version."""
    found = hashlib.sha256(__version__.encode())
    for part in parts:
        found.update(hashlib.sha256(part if isinstance(part, bytes) else part.encode()).digest())
    return found.hexdigest()


def digest_of(recording: Recording) -> str:
    """Return a text that is the same for recordings of the same content, whatever they are called."""
    found = hashlib.sha256()
    for item in fields(recording):
        if item.name in ("path", "robot", "notes", "remarks", "ignored", "date"):
            continue
        value = getattr(recording, item.name)
        for name, part in sorted(value.items()) if hasattr(value, "items") else [("", value)]:
            found.update(f"{item.name} {name} ".encode())
            found.update(part.tobytes() if isinstance(part, np.ndarray) else repr(part).encode())
    return found.hexdigest()


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
