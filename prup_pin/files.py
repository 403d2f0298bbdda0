"""Text files that are written whole or not at all, one or a folder of them; paths of files that they name."""

from __future__ import annotations

import json
import math
import os
import secrets
import stat
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from .errors import InputError, PrupPinError, folder_holds


def json_lines(value: Any) -> Iterable[str]:
    """Return a JSON file in pieces."""
    return (json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False) + "\n",)


def plain(value: Any) -> Any:
    """Return lists, dicts and finite floats; what is not finite becomes None."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float | np.floating):
        return (float(value) + 0.0) if math.isfinite(value) else None
    return value


def text_of(text: str) -> str:
    """Return a text that can be written: bytes of a file's name that are no UTF-8 become question marks."""
    return text.encode("utf-8", "replace").decode("utf-8")


def writable(path: Path) -> Path:
    """Return the file that a path stands for, links followed, or raise InputError where none can be written there."""
    try:
        target = path.resolve()
        if target.is_dir():
            raise InputError(f"cannot write {path}: it is a folder")
        # what /dev/stdout leads to is there, though its path may be none
        if not path.is_file() and (path.exists() or os.path.lexists(target)):
            raise InputError(f"cannot write {path}: it is a pipe or a device, not a file")
        if not target.parent.is_dir():
            raise InputError(f"cannot write {path}: No such file or directory: there is no folder {path.parent}")
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror or error}") from error
    except (RuntimeError, ValueError) as error:  # links in a circle, a NUL character
        raise InputError(f"cannot write {path}: {error}") from error
    return target


def check_takes_files(folder: Path) -> None:
    """Raise InputError where no file can be made in a folder: one is made, for there are folders that only look so."""
    probe = folder / f".{secrets.token_hex(6)}.part"
    try:
        probe.touch(exist_ok=False)
        probe.unlink()
    except OSError as error:
        raise InputError(f"cannot write to '{folder}': {error.strerror or error}") from error


def write_whole(files: Mapping[Path, Iterable[str | bytes]]) -> None:
    """Write files so that each is there as a whole or as it was before; text as UTF-8.

    Links are followed; a file that was there keeps its mode. Raises InputError.
    """
    staged: list[tuple[Path, Path]] = []
    try:
        for path, pieces in files.items():
            target = writable(path)
            part = target.with_name(f".{secrets.token_hex(6)}.part")
            staged.append((part, target))
            _fill(part, pieces, path, like=target)
        for (part, target), path in zip(staged, files, strict=True):
            try:
                os.replace(part, target)
            except OSError as error:
                raise InputError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        for part, _ in staged:
            with suppress(OSError):
                part.unlink(missing_ok=True)


def check_folder_for(folder: Path, names: Iterable[str]) -> None:
    """Raise InputError, before anything is computed, where a file of --out would replace what it must not."""
    try:
        for name in names:
            check_replaceable(folder / name)
    except (InputError, OSError) as error:
        raise InputError(f"--out: {error}") from error


def write_folder(folder: Path, files: Mapping[str, Iterable[str]], known: Iterable[str]) -> None:
    """Write text files of a folder, by their names, as `write_whole` does, the first one last.

    Those of `known` that are not written are removed; other files stay. Raises InputError.
    """
    known = tuple(known)
    for name in {*known, *files}:
        check_replaceable(folder / name)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot make the folder '{folder}': {error.strerror or error}") from error
    write_whole({folder / name: pieces for name, pieces in reversed(list(files.items()))})
    for name in known:
        if name not in files:
            (folder / name).unlink(missing_ok=True)


def check_replaceable(path: Path) -> None:
    """Raise InputError where something that is not a file stands where one is to be written."""
    if os.path.lexists(path):
        writable(path)


def _fill(part: Path, pieces: Iterable[str | bytes], path: Path, like: Path) -> None:
    """Write a new file with the mode of the one that it is to replace."""
    try:
        with part.open("xb") as stream:
            for piece in pieces:
                stream.write(piece if isinstance(piece, bytes) else piece.encode("utf-8"))
        with suppress(FileNotFoundError):
            os.chmod(part, stat.S_IMODE(like.stat().st_mode))
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror or error}") from error
    except UnicodeEncodeError as error:
        raise InputError(f"cannot write {path}: it would hold half a character ({error.reason})") from error


# -- files that are read -----------------------------------------------------------------------------------------------


@contextmanager
def opened(path: Path, what: str, endings: Sequence[str], wrong: Callable[[str], PrupPinError]) -> Iterator[BinaryIO]:
    """Open a file to be read within the block, or raise the error that `wrong` makes of what is wrong with it.

    what: in words what was expected; endings: those of files that are named where this one is not found.
    """
    try:
        if path.is_dir():
            raise wrong(f"is a folder; expected {what}")
        if path.exists() and not path.is_file():
            raise wrong(f"is not a regular file; expected {what}")
        with path.open("rb") as file:
            yield file
    except FileNotFoundError as error:
        raise wrong(f"file not found.{folder_holds(path.parent, *endings)}") from error
    except OSError as error:
        raise wrong(f"cannot be read: {error.strerror}") from error
    except ValueError as error:  # a NUL character in the path
        raise wrong(f"cannot be read: {error}") from error


# -- files that others name --------------------------------------------------------------------------------------------


def as_path(name: str | Path) -> Path:
    """Return a path with ~ replaced by the user's home, as far as there is such a user."""
    try:
        return Path(name).expanduser()
    except RuntimeError:
        return Path(name)


def is_file(path: Path) -> bool:
    """Return True where there is such a file; a path that no file can have (too long, a NUL character) is none."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def is_path(name: str) -> bool:
    """Return True of what is written as a path of a file, and not as a robot's name."""
    return bool(Path(name).suffix) or len(Path(name).parts) > 1


def named_beside(name: str, file: str | Path) -> str:
    """Return a robot that a file names, as `load` takes it from here: a path is beside that file, if it is there."""
    beside = Path(file).parent / as_path(name)
    return str(beside) if is_path(name) and is_file(beside) else name


def written_beside(name: str, file: str | Path) -> str:
    """Return a robot, as `load` takes it from here, as a file is to name it: a path relative to that file's folder."""
    path = as_path(name)
    if not (is_path(name) and is_file(path)):
        return name
    return Path(os.path.relpath(path.resolve(), Path(file).resolve().parent)).as_posix()
