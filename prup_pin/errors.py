"""Everything that can go wrong, as one small tree of exceptions.

Every message says what was given, where, what was expected and what to do next. Exceptions carry the same
facts as attributes, so that a program need not parse the sentence.
"""

from __future__ import annotations

import difflib
import importlib
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import TypeVar

__all__ = [
    "InfeasibleDesignError",
    "InputError",
    "JointLimitWarning",
    "MissingExtraError",
    "NoStiffnessError",
    "NotConvergedError",
    "ParameterError",
    "PluginError",
    "Problem",
    "PrupPinError",
    "RecordingFileError",
    "RobotFileError",
    "SimulationStoppedError",
    "SingularPoseError",
    "UnknownNameError",
    "UnreachablePoseError",
    "folder_holds",
    "imported",
    "limits_heard",
]


Entry = TypeVar("Entry")
#: Files of a folder that a sentence lists.
_MOST_FILES = 8


def folder_holds(folder: Path, *endings: str) -> str:
    """Return the end of a sentence: files of a folder that may have been meant, by endings ('.csv'); '' of none."""
    near = sorted(other.name for ending in endings for other in folder.glob(f"*{ending}"))
    more = ", …" if len(near) > _MOST_FILES else ""
    return f" The folder holds: {', '.join(near[:_MOST_FILES])}{more}." if near else ""


class PrupPinError(Exception):
    """Root of all errors raised on purpose by this package. They travel between processes with all their facts."""

    def __reduce__(self):
        return _travelled, (type(self), self.args, self.__dict__)


def _travelled(kind: type[PrupPinError], args: tuple, facts: dict) -> PrupPinError:
    error = kind.__new__(kind, *args)
    error.__dict__.update(facts)
    return error


@dataclass(frozen=True)
class Problem:
    """One defect of a robot file: what is wrong and on which line."""

    message: str
    line: int | None = None
    file: str | None = None

    def __str__(self) -> str:
        place = ":".join(str(part) for part in (self.file, self.line) if part is not None)
        return f"{place}: {self.message}" if place else self.message


class _FileError(PrupPinError):
    def __init__(self, path: str | Path, problems: Sequence[Problem], advice: str = ""):
        self.path, self.advice = str(path), advice
        self.problems = tuple(
            problem if problem.file else replace(problem, file=Path(path).name) for problem in problems
        )
        count = len(self.problems)
        lines = "\n".join([*(f"  {problem}" for problem in self.problems), *filter(None, [advice])])
        super().__init__(f"{path}: {count} problem{'s' if count != 1 else ''}\n{lines}")


class RobotFileError(_FileError):
    """A robot file that cannot be used. `problems` lists all that was found, not only the first."""


class RecordingFileError(_FileError):
    """A recording, test plan or corrected model that cannot be used. `problems` lists all that was found.

    advice: what else can be done with such a file, or ''; it ends the message.
    """


class PluginError(PrupPinError):
    """What another package or a file brings, and cannot be used. `source` says whose it is."""

    def __init__(self, source: object, message: str):
        self.source = str(source)
        super().__init__(f"{source}: {message}")


class InputError(PrupPinError, ValueError):
    """An argument of the wrong shape, kind or range."""


class UnknownNameError(InputError):
    """A name that does not exist, with the nearest ones that do."""

    def __init__(self, kind: str, name: object, valid: Iterable[str], hint: str = ""):
        self.kind, self.name, self.valid = kind, str(name), tuple(valid)
        given = f"'{name}'" if isinstance(name, str) else f"{shortened(name)}: a name is a text"
        near = nearest_names(self.name, self.valid) if self.valid or not hint else ""
        super().__init__(f"no {kind} named {given}. {' '.join(filter(None, (near, hint)))}")


class ParameterError(InputError):
    """A parameter whose value is outside its physical range."""


class UnreachablePoseError(PrupPinError):
    """No closed configuration reaches the wanted coordinates.

    `requested` and `nearest` are the coordinates asked for and the nearest feasible ones (SI), or None where no
    feasible pose could be found; `residual`, (metres, radians), is how far these are apart, or, without a nearest one,
    by how much the loops stayed open; None where a joint's limit is in the way.
    """

    def __init__(
        self,
        message: str,
        requested: Mapping[str, float] | None = None,
        nearest: Mapping[str, float] | None = None,
        residual: tuple[float, float] | None = None,
    ):
        self.requested = dict(requested or {})
        self.nearest = dict(nearest) if nearest else None
        self.residual = residual
        super().__init__(message)


class SingularPoseError(UnreachablePoseError):
    """A pose in which the locked actuators do not hold the tool, or the coordinates do not determine it."""


class NoStiffnessError(PrupPinError):
    """K does not exist: some wrenches deflect nothing. `directions` is (n, 6), those wrenches, largest component 1."""

    def __init__(self, message: str, directions):
        self.directions = directions
        super().__init__(message)


class NotConvergedError(PrupPinError):
    """No equilibrium was found under a load: the robot gives way before, or the search was lost.

    `pose` is the rigid pose and `wrench` (6,) the wrench on the tool [N, N m]; `reached` is the largest share of it
    under which an equilibrium was found, the load growing in proportion from zero.
    """

    def __init__(self, message: str, pose, wrench, reached: float):
        self.pose = pose
        self.wrench = wrench
        self.reached = reached
        super().__init__(message)


class InfeasibleDesignError(PrupPinError):
    """Targets that no design within its bounds meets.

    `values` are those of the design that comes nearest, by the names of what was free; `reached` (targets,) what it
    comes to.
    """

    def __init__(self, message: str, values: Mapping[str, float], reached: Sequence[float]):
        self.values, self.reached = dict(values), tuple(reached)
        super().__init__(message)


class SimulationStoppedError(PrupPinError):
    """A simulation that was asked to stop at the first sample without an answer.

    `row` is that sample's, counted from 0, `status` says what is wrong with it; `prediction` holds the rows before it.
    """

    def __init__(self, message: str, row: int, status: str, prediction):
        self.row, self.status, self.prediction = row, status, prediction
        super().__init__(message)


class MissingExtraError(PrupPinError, ImportError):
    """A package is not installed; the message holds the command that installs it.

    `extra`: the extra of prup_pin that brings it along.
    """

    def __init__(self, package: str, extra: str):
        self.package, self.extra = package, extra
        super().__init__(
            f"this needs the package '{package}', which is not installed: pip install {package} (it is part of "
            f"prup_pin's extra '{extra}')"
        )


def imported(package: str, extra: str) -> ModuleType:
    """Return an optional package that is installed. Raises MissingExtraError."""
    try:
        return importlib.import_module(package)
    except ImportError as error:
        raise MissingExtraError(package.partition(".")[0], extra) from error


class JointLimitWarning(UserWarning):
    """A joint value outside the limits of a plain tree's file; the result is still defined."""


def named(kind: str, name: object, table: Mapping[str, Entry], hint: str = "") -> Entry:
    """Return the entry of that name in a table, or raise UnknownNameError."""
    if isinstance(name, str) and name in table:
        return table[name]
    raise UnknownNameError(kind, name, list(table), hint)


def shortened(value: object, limit: int = 80) -> str:
    """Return what was given, as it can stand in a message."""
    try:
        text = repr(value)
    except ValueError:  # an integer of thousands of digits
        text = f"a number of the kind {type(value).__name__}"
    return text if len(text) <= limit else f"{text[: limit - 1]}…"


#: Letters of a word that is worth comparing by itself.
_SHORTEST_WORD = 5


def close_names(name: str, valid: Sequence[str], count: int = 4) -> list[str]:
    """Return the names that one may have been meant to be, the closest first."""
    lowered = {candidate.lower(): candidate for candidate in valid}
    if close := difflib.get_close_matches(name.lower(), list(lowered), n=count, cutoff=0.6):
        return [lowered[match] for match in close]
    # one word of several: 'frictoin' of 'coulomb_friction'
    words = {word for candidate in lowered for word in candidate.split("_") if len(word) >= _SHORTEST_WORD}
    near = difflib.get_close_matches(name.lower(), sorted(words), n=1, cutoff=0.8)
    return [lowered[candidate] for candidate in lowered if {*near} & {*candidate.split("_")}][:count]


#: Comparing more names would take longer than reading.
_MOST_COMPARED = 2000


def did_you_mean(name: str, valid: Sequence[str], count: int = 4) -> str:
    """Return 'Did you mean …' where something is close, else ''."""
    close = close_names(name, valid, count) if len(valid) <= _MOST_COMPARED else []
    return "Did you mean " + " or ".join(f"'{match}'" for match in close) + "?" if close else ""


def nearest_names(name: str, valid: Sequence[str], count: int = 4) -> str:
    """Return 'Did you mean …' where something is close, else the valid names."""
    if meant := did_you_mean(name, valid, count):
        return meant
    if len(valid) > _MOST_COMPARED:
        return f"There are {len(valid)} names, for example {', '.join(list(valid)[:4])}."
    if not valid:
        return "There are none."
    shown = ", ".join(valid[:30])
    return f"Valid: {shown}{', …' if len(valid) > 30 else ''}."


@contextmanager
def limits_heard() -> Iterator[dict[str, None]]:
    """Yield what hears, each once and in order, that joints stand beyond their limits; other warnings go their way."""
    heard: dict[str, None] = {}
    with warnings.catch_warnings():
        usual = warnings.showwarning
        warnings.simplefilter("always", JointLimitWarning)

        def show(message, category, *place, **more) -> None:
            if issubclass(category, JointLimitWarning):
                heard[str(message)] = None
            else:
                usual(message, category, *place, **more)

        warnings.showwarning = show
        yield heard


def postures_beyond(heard: Iterable[str]) -> tuple[str, ...]:
    """Return one remark on all postures that `limits_heard` heard of; nothing where there are none."""
    first = next(iter(heard), None)
    return () if first is None else (f"some postures are beyond the joint limits of the robot file, such as: {first}",)
