"""What other packages and single files bring: laws, modules, readers of logs, robots.

A package declares them as entry points of `prup_pin.laws`, `prup_pin.modules`, `prup_pin.readers` or `prup_pin.robots`;
a file lists them in `LAWS`, `MODULES`, `READERS` or `ROBOTS`, and is named by `--with` or `along`. Which files take part
stands in the environment variable `PRUP_PIN_WITH`, so that threads and worker processes see the same.
"""

from __future__ import annotations

import importlib
import os
import re
import sys
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from hashlib import sha256
from importlib import metadata
from importlib.machinery import ModuleSpec, SourceFileLoader
from importlib.util import spec_from_file_location
from pathlib import Path
from threading import RLock
from types import ModuleType
from typing import Generic, TypeVar, overload

from .errors import PluginError

__all__ = ["GROUPS", "WITH", "Library", "Plugin", "Source", "along", "checked", "plugins"]

#: Names of groups, which are entry points of `prup_pin.<group>`, and the lists of a file that hold the same.
GROUPS: Mapping[str, str] = {group: group.upper() for group in ("laws", "modules", "readers", "robots")}
#: The environment variable that holds the files, separated as in PATH, each with or without #<its SHA-256>.
WITH = "PRUP_PIN_WITH"

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
        """What to do where it is not there."""
        return f"give the file: --with {self.name}" if self.is_file else f"pip install '{self.name}=={self.version}'"


@dataclass(frozen=True, eq=False)
class Plugin:
    """One thing that is brought, under the name of its entry point or its key in a file ('' in a mere list)."""

    name: str
    thing: object
    source: Source


@contextmanager
def along(*files: str | Path) -> Iterator[None]:
    """Let files take part beside those that `PRUP_PIN_WITH` names, as they are now.

    In this process, all its threads, and in the processes that it starts meanwhile. Raises PluginError for a file that
    is not there.
    """
    before = os.environ.get(WITH)
    pinned = [f"{path}#{_digest_of(path)}" for path in map(_absolute, files)]
    os.environ[WITH] = os.pathsep.join([*filter(None, [before]), *pinned])
    try:
        yield
    finally:
        if before is None:
            os.environ.pop(WITH, None)
        else:
            os.environ[WITH] = before


def plugins(group: str) -> tuple[Plugin, ...]:
    """Return what is brought of a group: that of packages by their names, then that of files in their order.

    Raises PluginError for what cannot be imported.
    """
    with _LOCK:
        return _plugins(group, _files())


@lru_cache(maxsize=None)
def _plugins(group: str, files: tuple[tuple[Path, str], ...]) -> tuple[Plugin, ...]:
    found = []
    points = [(point.dist, point) for point in metadata.entry_points(group=f"prup_pin.{group}")]
    known = [(Source(dist.name, dist.version), point) for dist, point in points if dist is not None]
    for source, point in sorted(known, key=lambda pair: (pair[0].name, pair[1].name)):
        with _refusing(source, f"the entry point {point.name} = {point.value}"):
            found.append(Plugin(point.name, point.load(), source))
    for path, digest in files:
        source = Source(path.name, digest, is_file=True)
        listed = getattr(_module(path, digest, source), GROUPS[group], ())
        if isinstance(listed, Mapping):
            found += [Plugin(str(name), thing, source) for name, thing in listed.items()]
        elif isinstance(listed, list | tuple):
            found += [Plugin("", thing, source) for thing in listed]
        else:
            raise PluginError(source, f"{GROUPS[group]} is {listed!r}; expected a list, {GROUPS[group]} = [...]")
    return tuple(found)


def checked(
    group: str, base: type[T], word: str, own: Iterable[T], defects: Callable[[T], Iterable[str]]
) -> tuple[tuple[T, Source], ...]:
    """Return what is brought of a group as instances of `base`, each with where it comes from.

    word: the attribute by which people name them; own: the package's own ones, whose names are taken; defects: yields
    what is wrong with one. Raises PluginError for the first that cannot be used.
    """
    with _LOCK:
        return _checked(plugins(group), base, word, tuple(own), defects)


@lru_cache(maxsize=None)
def _checked(
    found: tuple[Plugin, ...], base: type[T], word: str, own: tuple[T, ...], defects: Callable[[T], Iterable[str]]
) -> tuple[tuple[T, Source], ...]:
    taken: dict[str, Source | None] = {getattr(thing, word): None for thing in own}
    things: list[tuple[T, Source]] = []
    for plugin in found:
        thing, source = plugin.thing, plugin.source
        if isinstance(thing, type) and issubclass(thing, base):
            with _refusing(source, f"{thing.__name__}()"):
                thing = thing()
        if not isinstance(thing, base):
            raise PluginError(source, f"{plugin.name or thing!r} is no {base.__name__}: derive its class from that")
        title = type(thing).__name__
        with _refusing(source, title):
            wrong = list(defects(thing))
        if wrong:
            raise PluginError(source, f"{title}: {'; '.join(wrong)}")
        name = getattr(thing, word)
        holder = taken.setdefault(name, source)
        if holder != source:
            whose = "prup_pin itself" if holder is None else str(holder)
            raise PluginError(source, f"{title}.{word} = '{name}' is a name of {whose}: choose another")
        things.append((thing, source))
    return tuple(things)


class Library(Sequence[T], Generic[T]):
    """The package's own things of one kind, then those that are brought, read whenever it is asked."""

    def __init__(self, own: Iterable[T], brought: Callable[[], Iterable[tuple[T, Source]]]):
        self.own = tuple(own)
        self._brought = brought

    def _all(self) -> tuple[T, ...]:
        return (*self.own, *(thing for thing, _ in self._brought()))

    def sources(self, word: str) -> dict[str, Source]:
        """Return where the brought ones come from, by the attribute `word`."""
        return {getattr(thing, word): source for thing, source in self._brought()}

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
_digest_met = lru_cache(maxsize=None)(_digest_of)


def _files() -> tuple[tuple[Path, str], ...]:
    found = []
    for item in filter(None, os.environ.get(WITH, "").split(os.pathsep)):
        pinned = _PINNED.fullmatch(item)
        path = _absolute(pinned["path"] if pinned else item)
        found.append((path, pinned["digest"] if pinned else _digest_met(path)))
    return tuple(dict.fromkeys(found))


def _module_name(path: Path, digest: str) -> str:
    return f"{__name__}.{re.sub(r'[^0-9A-Za-z]', '_', path.stem)}_{digest[:12]}"


def _module(path: Path, digest: str, source: Source) -> ModuleType:
    with _refusing(source, "the file"):
        module = importlib.import_module(_module_name(path, digest))
    if not any(hasattr(module, name) for name in GROUPS.values()):
        raise PluginError(source, f"brings nothing: expected one of the lists {', '.join(GROUPS.values())}")
    return module


@contextmanager
def _refusing(source: Source, what: str) -> Iterator[None]:
    """Turn whatever somebody else's code raises into a PluginError."""
    try:
        yield
    except PluginError:
        raise
    except (Exception, SystemExit) as error:
        said = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
        last = traceback.extract_tb(error.__traceback__)[-1]
        at = "" if isinstance(error, SyntaxError) else f" ({Path(last.filename).name}, line {last.lineno})"
        raise PluginError(source, f"{what} cannot be used: {said}{at}") from error


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
            for file, digest in _files():
                if fullname == _module_name(file, digest):
                    return spec_from_file_location(fullname, file, loader=_Loader(fullname, str(file)))
        return None


sys.meta_path.insert(0, _Finder)  # type: ignore[arg-type]
