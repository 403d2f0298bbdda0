"""What other packages and single files bring: laws, modules, readers of logs, robots.

A package declares them as entry points of `prup_pin.laws`, `prup_pin.modules`, `prup_pin.readers` or `prup_pin.robots`;
a file lists them in `LAWS`, `MODULES`, `READERS` or `ROBOTS`, and is named by `--with` or `along`. Which files take
part stands in the environment variable `PRUP_PIN_WITH`, so that threads and worker processes see the same.
"""

from __future__ import annotations

import importlib
import os
import re
import sys
import time
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from importlib import metadata
from importlib.machinery import ModuleSpec, SourceFileLoader
from importlib.util import spec_from_file_location
from pathlib import Path
from threading import RLock
from types import ModuleType
from typing import Any, Generic, TypeVar, overload

from .errors import InputError, PluginError, PrupPinError

__all__ = ["GROUPS", "WITH", "Library", "Plugin", "Source", "along", "blaming", "brought", "files", "instances"]

#: Names of groups, which are entry points of `prup_pin.<group>`, and the lists of a file that hold the same.
GROUPS: Mapping[str, str] = {group: group.upper() for group in ("laws", "modules", "readers", "robots")}
#: The environment variable that holds the files, separated as in PATH, each with or without #<its SHA-256>.
WITH = "PRUP_PIN_WITH"

#: Processor time [s] of an import from which a person asks who takes it: this package itself takes one.
SLOW = 2.0

#: What is imported from files stands below this module: a name that holds the content's hash.
__path__: list[str] = []
_LOCK = RLock()
_PINNED = re.compile(r"(?P<path>.*)#(?P<digest>[0-9a-f]{64})")
T = TypeVar("T")


@dataclass(frozen=True)
class Source:
    """Where something comes from: a package with its version, or a file with the SHA-256 of its bytes."""

    name: str
    version: str
    is_file: bool = False

    def __str__(self) -> str:
        return f"{self.name} (sha256 {self.version[:12]})" if self.is_file else f"{self.name} {self.version}"

    @property
    def remedy(self) -> str:
        """How to get it."""
        return f"add --with {self.name}" if self.is_file else f"pip install '{self.name}=={self.version}'"

    def fails(self, what: str, error: BaseException, at: str) -> PluginError:
        """Return the error that says what its code raised, where, and what to do."""
        said = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
        without = f"leave --with {self.name} out" if self.is_file else f"pip uninstall {self.name}"
        repair = "Repair it"
        if isinstance(error, ImportError) and self.is_file and (error.name or "").startswith(__name__):
            repair = "A file of yours imports by full names, as in 'from prup_pin.laws.law import Law'. Repair it"
        return PluginError(self, f"{what}: {said}{f' ({at})' if at else ''}. {repair}, or {without}")


@dataclass(frozen=True, eq=False)
class Plugin(Generic[T]):
    """One thing that is brought, and whose it is.

    name: as people type it; of a list that gives none, ''. folder: where what says it stands, for paths beside it.
    """

    name: str
    thing: T
    source: Source
    folder: Path


#: Returns name and thing of what was declared, ready to use; raises InputError or whatever it likes for what cannot be.
Make = Callable[[Plugin[Any]], tuple[str, T]]


@contextmanager
def along(*files: str | Path) -> Iterator[None]:
    """Let files take part beside those that `PRUP_PIN_WITH` names, as they are now.

    In this process, all its threads, and in the processes that it starts meanwhile. Raises PluginError for a file that
    is not there.
    """
    before = os.environ.get(WITH)
    pinned = [f"{path}#{_digest_of(path)}" for path in map(_absolute, files)]
    if not pinned:
        yield
        return
    os.environ[WITH] = os.pathsep.join([*filter(None, [before]), *pinned])
    try:
        yield
    finally:
        if before is None:
            os.environ.pop(WITH, None)
        else:
            os.environ[WITH] = before


def brought(group: str, own: Iterable[str], make: Make[T], several: bool = False) -> tuple[Plugin[T], ...]:
    """Return what is brought of a group: that of packages by their names, then that of files in their order.

    own: the package's own names, which are taken; make: a function of a module, or one that is made once. several: one
    package or file may bring several things of one name. Raises PluginError for the first that cannot be used.
    """
    with _LOCK:
        return _made(_declared(group, files()), tuple(own), make, several)


def _entry_points(group: str) -> list[tuple[Source, metadata.EntryPoint]]:
    points = [(point.dist, point) for point in metadata.entry_points(group=f"prup_pin.{group}")]
    found = [(Source(dist.name, dist.version), point) for dist, point in points if dist is not None]
    return sorted(found, key=lambda pair: (pair[0].name, pair[1].name))


@cache
def _declared(group: str, files: tuple[tuple[Path, str], ...]) -> tuple[Plugin[Any], ...]:
    found = []
    for source, point in _entry_points(group):
        with _timed(source), _refusing(source, f"its entry point {point.name} = {point.value}"):
            thing, module = point.load(), sys.modules[point.module]
            found.append(Plugin(point.name, thing, source, Path(module.__file__ or "").parent))
    for path, digest in files:
        source = Source(path.name, digest, is_file=True)
        listed = getattr(_module(path, digest, source), GROUPS[group], ())
        if isinstance(listed, Mapping):
            found += [Plugin(str(name), thing, source, path.parent) for name, thing in listed.items()]
        elif isinstance(listed, list | tuple):
            found += [Plugin("", thing, source, path.parent) for thing in listed]
        else:
            raise PluginError(source, f"{GROUPS[group]} is {listed!r}; expected a list, {GROUPS[group]} = [...]")
    return tuple(found)


@cache
def _made(
    declared: tuple[Plugin[Any], ...], own: tuple[str, ...], make: Make[T], several: bool
) -> tuple[Plugin[T], ...]:
    taken: dict[str, Source | None] = dict.fromkeys(own)
    found = []
    for plugin in declared:
        with _refusing(plugin.source, getattr(plugin.thing, "__name__", plugin.name or repr(plugin.thing))):
            name, thing = make(plugin)
        if name in taken and not (several and taken[name] == plugin.source):
            whose = "prup_pin itself" if taken[name] is None else str(taken[name])
            raise PluginError(plugin.source, f"'{name}' is a name of {whose} already: choose another")
        taken[name] = plugin.source
        found.append(Plugin(name, thing, plugin.source, plugin.folder))
    return tuple(found)


def instances(base: type[T], word: str, defects: Callable[[T], Iterable[str]]) -> Make[T]:
    """Return what makes instances of a class, by their attribute `word`, in which `defects` finds nothing wrong."""

    def make(plugin: Plugin[Any]) -> tuple[str, T]:
        thing = plugin.thing() if isinstance(plugin.thing, type) and issubclass(plugin.thing, base) else plugin.thing
        if not isinstance(thing, base):
            raise InputError(f"is no {base.__name__}; expected a class that derives from it, or one of its instances")
        if wrong := list(defects(thing)):
            raise InputError("; ".join(wrong))
        return getattr(thing, word), thing

    return make


@contextmanager
def blaming() -> Iterator[None]:
    """Turn what is raised in the code of a package or file into a PluginError that says whose, and in which line."""
    try:
        yield
    except PrupPinError:
        raise
    except Exception as error:
        owners = {_module_name(path, digest): Source(path.name, digest, True) for path, digest in files()}
        for group in GROUPS:
            owners |= {point.module.partition(".")[0]: source for source, point in _entry_points(group)}
        for frame, line in reversed(list(traceback.walk_tb(error.__traceback__))):
            name = str(frame.f_globals.get("__name__"))
            if (source := owners.get(name) or owners.get(name.partition(".")[0])) is not None:
                at = f"{Path(frame.f_code.co_filename).name}, line {line}"
                raise source.fails("its code raises", error, at) from error
        raise


class Library(Sequence[T]):
    """The package's own things of one kind, then those that are brought, which are read whenever it is asked."""

    def __init__(self, own: Iterable[T], brought: Callable[[], Iterable[Plugin[T]]]):
        self.own = tuple(own)
        self.brought = brought

    def _all(self) -> tuple[T, ...]:
        return (*self.own, *(plugin.thing for plugin in self.brought()))

    @overload
    def __getitem__(self, index: int) -> T: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[T]: ...
    def __getitem__(self, index: int | slice) -> T | Sequence[T]:
        return self._all()[index]

    def __iter__(self) -> Iterator[T]:
        return iter(self._all())

    def __len__(self) -> int:
        return len(self._all())


# -- files -------------------------------------------------------------------------------------------------------------


def _absolute(path: str | Path) -> Path:
    return Path(os.path.abspath(os.path.expanduser(path)))


def _digest_of(path: Path) -> str:
    try:
        return sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise PluginError(str(path), f"cannot be read: {error.strerror or error}") from error


#: A file whose hash is not given is the one that a process meets first, as with any import.
_digest_met = cache(_digest_of)


def files() -> tuple[tuple[Path, str], ...]:
    """Return the files that take part, each with the SHA-256 of its bytes. Raises PluginError."""
    found: dict[tuple[str, str], tuple[Path, str]] = {}
    for item in filter(None, os.environ.get(WITH, "").split(os.pathsep)):
        pinned = _PINNED.fullmatch(item)
        path = _absolute(pinned["path"] if pinned else item)
        digest = pinned["digest"] if pinned else _digest_met(path)
        found.setdefault((path.name, digest), (path, digest))  # copies of one file are that file
    return tuple(found.values())


def _module_name(path: Path, digest: str) -> str:
    return f"{__name__}.{re.sub(r'[^0-9A-Za-z]', '_', path.stem)}_{digest[:12]}"


def _module(path: Path, digest: str, source: Source) -> ModuleType:
    with _timed(source), _refusing(source, "the file"):
        module = importlib.import_module(_module_name(path, digest))
    if not any(hasattr(module, name) for name in GROUPS.values()):
        raise PluginError(source, f"brings nothing: expected one of the lists {', '.join(GROUPS.values())}")
    return module


@contextmanager
def _timed(source: Source) -> Iterator[None]:
    began = time.process_time()
    yield
    if (took := time.process_time() - began) > SLOW:
        text = f"{source} took {took:.1f} s to be imported; what is heavy should be imported where it is used"
        warnings.warn(text, stacklevel=2)


@contextmanager
def _refusing(source: Source, what: str) -> Iterator[None]:
    """Turn whatever somebody else's code raises into a PluginError."""
    try:
        yield
    except PluginError:
        raise
    except InputError as error:
        raise PluginError(source, f"{what}: {error}") from error
    except (Exception, SystemExit) as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        at = "" if isinstance(error, SyntaxError) else f"{Path(last.filename).name}, line {last.lineno}"
        raise source.fails(f"{what} cannot be used", error, at) from error


class _Loader(SourceFileLoader):
    """Runs the bytes that were named by their hash, and writes nothing beside the file."""

    def get_data(self, path: str) -> bytes:
        data = super().get_data(path)
        if not self.name.endswith(sha256(data).hexdigest()[:12]):
            raise ImportError("it was changed while it was in use; start again")
        return data

    def path_stats(self, path: str) -> Mapping[str, float]:
        raise OSError  # nothing compiled is looked for


class _Finder:
    """Finds the files by their names below this module, so that what they define can be pickled."""

    @staticmethod
    def find_spec(fullname: str, path: object = None, target: object = None) -> ModuleSpec | None:
        if fullname.startswith(f"{__name__}."):
            for file, digest in files():
                if fullname == _module_name(file, digest):
                    return spec_from_file_location(fullname, file, loader=_Loader(fullname, str(file)))
        return None


sys.meta_path.insert(0, _Finder)
