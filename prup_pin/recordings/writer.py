"""Writes recordings and predictions, and text files of any kind: whole or not at all."""

from __future__ import annotations

import csv
import io
import json
import os
import secrets
import shutil
import stat
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError
from ..spatial import Array
from .columns import AXES, NOISE_KEYS
from .conventions import as_json
from .recording import Recording

#: Significant digits of all columns but the time.
DIGITS = 9
#: Time is exact to what a float holds: with 9 digits, seconds since 1970 would stand still.
TIME_DIGITS = 15
_CHUNK = 20_000


def write_recording(recording: Recording, path: str | Path, status: Sequence[str] | None = None) -> None:
    """Write a recording as CSV, and noise, tolerances, robot and notes as JSON of the same stem beside it.

    Only columns that exist are written; `status` (N,) words become a column of that name. Both files are replaced as a
    whole or not at all; a JSON file that was there before never stays, because it would speak of another table.

    Raises InputError where the recording could not be read again, or the files cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() == ".json":
        raise InputError(f"cannot write the table to {path}: its JSON file has this name; expected .csv")
    columns: dict[str, Array | list[str]] = {"time": recording.time, **_there(recording)}
    if recording.run_names != ("",):
        columns["run"] = [recording.run_names[code] for code in recording.run.tolist()]
    if status is not None:
        columns["status"] = [str(word) for word in status]
    _check(recording, columns)
    beside: dict[str, Any] = {} if recording.robot is None else {"robot": recording.robot}
    for key, name in NOISE_KEYS.items():
        if getattr(recording.noise, name) is not None:
            beside[key] = float(getattr(recording.noise, name))
    if recording.tolerances.declared:
        beside["tolerances"] = {name: float(value) for name, value in recording.tolerances.declared.items()}
    if recording.own_by_run:
        beside["own_sensors"] = {"by_run": list(recording.own_by_run)}
    elif recording.own_sensors:
        beside["own_sensors"] = list(recording.own_sensors)
    if recording.conventions:
        beside["conventions"] = as_json(recording.conventions)
    for name in ("notes", "date", "device"):
        if getattr(recording, name):
            beside[name] = getattr(recording, name)
    write_whole({path: _lines(columns), path.with_suffix(".json"): json_lines(beside)})


def write_prediction(
    path: str | Path,
    time: ArrayLike,
    position: ArrayLike | None = None,
    rotation: ArrayLike | None = None,
    efforts: Mapping[str, ArrayLike] | None = None,
    status: Sequence[str] | None = None,
    run: Sequence[str] | None = None,
    markers: Mapping[str, ArrayLike] | None = None,
    marker_rotations: Mapping[str, ArrayLike] | None = None,
) -> None:
    """Write predicted measurements as CSV: time, p, r, tau, a run where given, and a column `status`.

    time: (N,) [s]; position, rotation: (N, 3) [m, rad]; efforts: joint name -> (N,) [N or N m]; markers and
    marker_rotations: frame name -> (N, 3) [m, rad]. NaN, no prediction for this sample, becomes an empty cell.
    status: (N,) 'ok' or a short word on why there is no prediction; all 'ok' by default. run: (N,) labels.

    Raises InputError where lengths differ or the file cannot be written.
    """
    path = Path(path)
    times = np.asarray(time, float)
    n = len(times)
    columns: dict[str, Array | list[str]] = {"time": times}
    columns |= _triple("p", position) | _triple("r", rotation)
    for prefix, marked in (("p", markers), ("r", marker_rotations)):
        for name, values in (marked or {}).items():
            columns |= _triple(f"{prefix}.{name}", values)
    columns |= {f"tau.{joint}": np.asarray(values, float) for joint, values in (efforts or {}).items()}
    if run is not None:
        columns["run"] = [str(label) for label in run]
    columns["status"] = ["ok"] * n if status is None else [str(word) for word in status]
    for name, column in columns.items():
        if np.shape(column) != (n,):
            raise InputError(f"column '{name}' has shape {np.shape(column)}; expected ({n},), as many as times")
    write_whole({path: _lines(columns)})


def _there(recording: Recording) -> dict[str, Array]:
    """Return the columns of a recording; of a position or an orientation an axis without numbers goes beside others."""
    found = dict(recording.columns())
    known = {name for name, values in found.items() if not np.isnan(values).all()}
    measured = {name.rpartition(".")[0] for name in known}
    return {
        name: values
        for name, values in found.items()
        if name in known or name[:2] not in ("p.", "r.") or name.rpartition(".")[0] not in measured
    }


def _triple(prefix: str, values: ArrayLike | None) -> dict[str, Array]:
    """Return the columns of an (N, 3) array."""
    if values is None:
        return {}
    array = np.asarray(values, float)
    if array.ndim == 2 and array.shape[1] == 0:
        return {}  # nothing was asked for
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"columns {prefix}.x {prefix}.y {prefix}.z need an array (N, 3); got {array.shape}")
    return {f"{prefix}.{axis}": array[:, k] for k, axis in enumerate(AXES)}


def _check(recording: Recording, columns: Mapping[str, Array | list[str]]) -> None:
    """Raise InputError for what the reader would refuse."""
    if not len(recording):
        raise InputError("a recording without samples cannot be written")
    if not recording.positions:
        raise InputError("a recording without the position of any actuated joint cannot be written")
    for name, values in columns.items():
        if name != name.strip() or "\n" in name or "\r" in name:
            raise InputError(f"column {name!r} cannot be written: the name has spaces around it or a line end")
        if isinstance(values, np.ndarray) and np.isinf(values).any():
            raise InputError(f"column '{name}' has infinite values, the first in row {np.argmax(np.isinf(values))}")
    order = np.argsort(recording.run, kind="stable")
    time, run = recording.time[order], recording.run[order]
    wrong = np.isnan(time[1:]) | (np.diff(time) <= 0) & (np.diff(run) == 0)
    if np.isnan(time[0]) or wrong.any():
        row = 0 if np.isnan(time[0]) else int(order[1:][wrong].min())
        raise InputError(f"time must increase within a run; it does not in row {row} (time {recording.time[row]:g} s)")


def _lines(columns: Mapping[str, Array | list[str]]) -> Iterable[str]:
    """Yield a CSV file in pieces."""
    yield ",".join(_quoted(name) for name in columns) + "\n"
    n = len(next(iter(columns.values())))
    for start in range(0, n, _CHUNK):
        cells = [_cells(name, values[start : start + _CHUNK]) for name, values in columns.items()]
        yield "".join(map("{}\n".format, map(",".join, zip(*cells, strict=True))))


def _cells(name: str, values: Array | list[str]) -> list[str]:
    if isinstance(values, list):
        known = {label: _quoted(label) for label in set(values)}
        return [known[label] for label in values]
    form = f"%.{TIME_DIGITS if name == 'time' else DIGITS}g"
    return [form % value if value == value else "" for value in values.tolist()]


def _quoted(text: str) -> str:
    stream = io.StringIO()
    csv.writer(stream, lineterminator="").writerow([text])
    # A lone empty cell is quoted by the csv module, lest the row look blank; here it stands in a row of others.
    return "" if not text else stream.getvalue()


# -- whole files -------------------------------------------------------------------------------------------------------


def json_lines(value: Any) -> Iterable[str]:
    """Return a JSON file in pieces."""
    return (json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False) + "\n",)


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
    """Write text files of a folder, by their names: all of them are there, or all that were before.

    Those of `known` that are not written are removed; other files stay. The folder is made anew beside the old one,
    which it then replaces; where other files live in it, or it cannot be replaced, its first file goes first and comes
    last: what is interrupted is seen to be so. Raises InputError.
    """
    known = tuple(known)
    for name in {*known, *files}:
        check_replaceable(folder / name)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        target = folder.resolve()
        others = {path.name for path in target.iterdir()} - {*known, *files}
    except OSError as error:
        raise InputError(f"cannot make the folder '{folder}': {error.strerror or error}") from error
    if any((target / name).is_symlink() for name in known):
        write_whole({folder / name: pieces for name, pieces in reversed(list(files.items()))})  # links are followed
        return
    here = Path.cwd()
    inside = others or target == here or target in here.parents
    new = _staging(target if inside else target.parent, target)
    try:
        for name, pieces in files.items():
            _fill(new / name, pieces, folder / name, like=target / name)
        if inside or not _swapped(new, target):
            _moved(new, target, tuple(files), known)
    except OSError as error:
        raise InputError(f"cannot write to '{folder}': {error.strerror or error}") from error
    finally:
        shutil.rmtree(new, ignore_errors=True)


def check_replaceable(path: Path) -> None:
    """Raise InputError where something that is not a file stands where one is to be written."""
    if os.path.lexists(path):
        writable(path)


def _staging(beside: Path, target: Path) -> Path:
    """Return a new folder there, or in the target itself where nothing can be made beside it."""
    for place in dict.fromkeys((beside, target)):
        new = place / f".{secrets.token_hex(6)}.part"
        try:
            new.mkdir(mode=0o700)
        except OSError as error:
            wrong = error
        else:
            return new
    raise InputError(f"cannot write to '{target}': {wrong.strerror or wrong}")


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


def _swapped(new: Path, target: Path) -> bool:
    """Put a folder in another one's place; False where that cannot be done and nothing has changed."""
    if new.parent != target.parent:
        return False
    old = new.with_suffix(".old")
    try:
        os.chmod(new, stat.S_IMODE(target.stat().st_mode))
        os.rename(target, old)
    except OSError:  # where something is mounted, for one
        return False
    try:
        os.rename(new, target)
    except BaseException:
        os.rename(old, target)
        raise
    shutil.rmtree(old, ignore_errors=True)
    return True


def _moved(new: Path, target: Path, names: tuple[str, ...], known: tuple[str, ...]) -> None:
    """Move files into a folder in which others live; where one of them cannot be, the old ones come back."""
    kept = new / "old"
    kept.mkdir()
    try:
        for name in dict.fromkeys((*names, *known)):
            if os.path.lexists(target / name):
                os.rename(target / name, kept / name)
        for name in reversed(names):
            os.rename(new / name, target / name)
    except BaseException:
        for name in names:
            if not (new / name).exists():
                (target / name).unlink(missing_ok=True)
        for path in kept.iterdir():
            os.rename(path, target / path.name)
        raise
