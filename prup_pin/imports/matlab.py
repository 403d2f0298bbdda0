"""Logs as named arrays: MATLAB's variables and fields of structures by scipy, version 7.3 and HDF5 by h5py, numpy's."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import imported
from ..spatial import Array
from .log import MAX_VECTOR, Log, Stream, frozen, refuse, spread


def read(path: Path) -> Log:
    """Return the numeric variables of a .mat, .h5 or .npz file; `data.q` (N, 6) becomes data.q[1] to data.q[6].

    Arrays with as many samples and in the same structure are one stream. Raises MissingExtraError where a file of
    version 7.3 needs h5py, RecordingFileError for a file that cannot be read.
    """
    found: dict[str, Array] = {}
    left_out: list[str] = []
    for name, value in _variables(path):
        array = np.asarray(value)
        if array.dtype.kind not in "fiub" or array.ndim > 2:
            left_out.append(f"{name} ({array.dtype.kind if array.dtype.kind in 'OSUV' else array.shape})")
        elif array.size > 1:
            found[name] = np.atleast_2d(array).astype(float)
    streams: dict[tuple[str, int], dict[str, Array]] = {}
    lengths = [max(array.shape) for array in found.values()]
    for name, array in found.items():
        if array.shape[0] == 1 or (array.shape[1] in lengths and array.shape[1] > MAX_VECTOR > array.shape[0]):
            array = array.T  # a row of samples
        if array.shape[1] > MAX_VECTOR or array.shape[0] < 3:
            left_out.append(f"{name} {array.shape}")
            continue
        group = name.rpartition(".")[0], len(array)
        streams.setdefault(group, {}).update(spread(name, array[:, 0] if array.shape[1] == 1 else array, first=1))
    merged = _joined(streams)
    return Log(str(path), tuple(Stream(n, frozen(columns)) for n, columns in merged.items()), tuple(left_out))


def _joined(streams: Mapping[tuple[str, int], Mapping[str, Array]]) -> dict[str, dict[str, Array]]:
    """Return streams by name; where each length has one time of its own or there is one time in all, lengths decide."""
    out: dict[str, dict[str, Array]] = {}
    for (group, length), columns in streams.items():
        timed = any(_is_time(name) for name in columns)
        same = [other for (other, n), c in streams.items() if n == length and any(_is_time(name) for name in c)]
        home = group if timed or not same else same[0]
        key = home or "variables"
        several = sum(1 for g, _ in streams if g == home) > 1
        out.setdefault(f"{key} ({length} samples)" if several else key, {}).update(columns)
    return out


def _is_time(name: str) -> bool:
    return name.rpartition(".")[2].lower() in ("t", "time", "timestamp", "stamp", "tout", "sec")


def _variables(path: Path) -> Iterator[tuple[str, Any]]:
    """Yield the variables of a file, fields of structures by dotted names."""
    from scipy.io import loadmat

    if path.suffix.lower() in (".npz", ".npy"):
        yield from _of_numpy(path)
        return
    if path.suffix.lower() != ".mat":
        yield from _from_hdf(path)
        return

    try:
        content = loadmat(path, simplify_cells=True)
    except NotImplementedError:  # version 7.3
        yield from _from_hdf(path)
        return
    except (ValueError, TypeError) as error:
        if _is_hdf(path):  # of version 7.3, written by others than MATLAB
            yield from _from_hdf(path)
            return
        raise refuse(path, f"cannot be read as a MATLAB file: {error}") from error
    except (OSError, KeyError, EOFError) as error:
        raise refuse(path, f"cannot be read as a MATLAB file: {error}") from error
    for name, value in content.items():
        if not name.startswith("__"):
            yield from _fields(name, value)


def _of_numpy(path: Path) -> Iterator[tuple[str, Any]]:
    """Yield the arrays of a file of numpy; objects are not unpacked, for they could be programs."""
    try:
        content = np.load(path, allow_pickle=False)
        arrays = content if path.suffix.lower() == ".npz" else {path.stem: content}
        for name in arrays:
            try:
                yield name, arrays[name]
            except ValueError:
                yield name, np.array("object")
    except (ValueError, OSError, EOFError, zipfile.BadZipFile) as error:
        raise refuse(path, f"cannot be read as a file of numpy: {error}") from error


def _is_hdf(path: Path) -> bool:
    with path.open("rb") as file:
        head = file.read(1024)
    return any(head[at : at + 8] == b"\x89HDF\r\n\x1a\n" for at in (0, 512))


def _fields(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _fields(f"{name}.{key}", inner)
    else:
        yield name, value


def _from_hdf(path: Path) -> Iterator[tuple[str, Any]]:
    hdf = imported("h5py", "mat")

    def inside(name: str, item: Any) -> Iterator[tuple[str, Any]]:
        if isinstance(item, hdf.Group):
            for key in item:
                if not key.startswith("#"):
                    yield from inside(f"{name}.{key}" if name else key, item[key])
        elif item.attrs.get("MATLAB_class", b"double") in (b"char", b"cell") or item.dtype.kind not in "fiub":
            yield name, np.array("text")
        elif "MATLAB_empty" not in item.attrs:
            yield name, item[()].T if matlab else item[()]  # MATLAB stores column by column

    try:
        with hdf.File(path) as file:
            matlab = path.suffix.lower() == ".mat"
            yield from inside("", file)
    except OSError as error:
        raise refuse(path, f"cannot be read as a MATLAB file of version 7.3 or HDF5: {error}") from error
