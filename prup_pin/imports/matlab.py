"""Logs as named arrays: MATLAB's variables and fields of structures, version 7.3 and HDF5 by h5py, numpy's."""

from __future__ import annotations

import math
import struct
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat
from scipy.spatial.transform import Rotation

from ..errors import RecordingFileError, imported
from ..recordings.problems import shown
from ..spatial import Array
from .log import MAX_COLUMNS, MAX_VECTOR, Log, Stream, check_size, frozen, reading, refuse, spread

#: Shapes of a rotation and of a pose; matrices whose columns are not orthonormal to so much are neither.
_MATRICES, _RIGID = ((3, 3), (4, 4)), 1e-3


def read(path: Path) -> Log:
    """Return the numeric variables of a .mat, .h5 or .npz file; `data.q` (N, 6) becomes data.q[1] to data.q[6].

    Poses as matrices (N, 4, 4) and rotations (N, 3, 3), or (4, 4, N) and (3, 3, N), become x, y, z and a quaternion.
    Arrays with as many samples and in the same structure are one stream. Raises MissingExtraError where a file of
    version 7.3 needs h5py, RecordingFileError for a file that cannot be read.
    """
    found: dict[str, Array] = {}
    streams: dict[tuple[str, int], dict[str, Array]] = {}
    left_out: list[str] = []
    whole = 0
    for name, value in _variables(path):
        try:
            array = np.asarray(value)
        except ValueError:  # lists of several lengths
            array = np.array("lists")
        pose = _pose_of(array)
        if pose:
            check_size(path, whole + array.nbytes)
            whole += array.nbytes
            group = name.rpartition(".")[0], len(pose["qw"])
            streams.setdefault(group, {}).update({f"{name}.{axis}": values for axis, values in pose.items()})
        elif array.dtype.kind not in "fiub" or array.ndim > 2:
            left_out.append(f"{name} ({array.dtype.kind if array.dtype.kind in 'OSUV' else array.shape})")
        elif array.size > 1:
            whole += 8 * array.size
            check_size(path, whole)
            found[name] = np.atleast_2d(array).astype(float)
    lengths = {max(array.shape) for array in found.values()}
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


def _pose_of(array: Array) -> dict[str, Array]:
    """Return the columns x, y, z (of poses) and qx, qy, qz, qw of a stack of matrices, none of what is no such stack.

    A matrix that was not measured (nan, zeros) is nan.
    """
    if array.ndim != 3 or array.dtype.kind not in "fi":
        return {}
    stack = array.astype(float)
    if stack.shape[1:] not in _MATRICES:  # a sample a page, as MATLAB has them
        stack = np.moveaxis(stack, -1, 0)
    if stack.shape[1:] not in _MATRICES:
        return {}
    told = np.isfinite(stack).all(axis=(1, 2)) & stack.any(axis=(1, 2))
    turned, poses = stack[told, :3, :3], stack.shape[1] == 4
    rigid = np.abs(turned @ turned.mT - np.eye(3)).max(initial=0.0) < _RIGID and (np.linalg.det(turned) > 0).all()
    if not (told.any() and rigid) or (poses and not np.allclose(stack[told, 3], [0.0, 0.0, 0.0, 1.0])):
        return {}
    columns = np.full((len(stack), 7), np.nan)
    columns[told] = np.column_stack((stack[told, :3, -1], Rotation.from_matrix(turned).as_quat()))
    named = dict(zip(("x", "y", "z", "qx", "qy", "qz", "qw"), columns.T, strict=True))
    return named if poses else {name: named[name] for name in named if name.startswith("q")}


def _joined(streams: Mapping[tuple[str, int], Mapping[str, Array]]) -> dict[str, dict[str, Array]]:
    """Return streams by name; where each length has one time of its own or there is one time in all, lengths decide."""
    timed: dict[int, list[str]] = {}
    for (group, length), columns in streams.items():
        if any(_is_time(name) for name in columns):
            timed.setdefault(length, []).append(group)
    lengths = Counter(group for group, _ in streams)
    out: dict[str, dict[str, Array]] = {}
    for (group, length), columns in streams.items():
        same = timed.get(length, [group])
        home = group if group in same else same[0]
        key = home or "variables"
        out.setdefault(f"{key} ({length} samples)" if lengths[home] > 1 else key, {}).update(columns)
    return out


def _is_time(name: str) -> bool:
    return name.rpartition(".")[2].lower() in ("t", "time", "timestamp", "stamp", "tout", "sec")


def _variables(path: Path) -> Iterator[tuple[str, Any]]:
    """Yield the variables of a file, fields of structures by dotted names."""
    ending = path.suffix.lower()
    if ending in (".npz", ".npy"):
        yield from _of_numpy(path)
    elif ending != ".mat" or _is_hdf(path):  # version 7.3, and what others write
        yield from _from_hdf(path)
    else:
        with reading(path, "a MATLAB file"):
            with path.open("rb") as file:
                old = b"\0" in file.read(4)  # version 4 begins with numbers
            if not old:
                yield from variables(path)
                return
            content = loadmat(path, squeeze_me=True)
        yield from ((name, value) for name, value in content.items() if not name.startswith("__"))


def _of_numpy(path: Path) -> Iterator[tuple[str, Any]]:
    """Yield the arrays of a file of numpy; objects are not unpacked, for they could be programs."""
    with reading(path, "a file of numpy") as here:
        if path.suffix.lower() == ".npy":
            check_size(path, path.stat().st_size)
            yield path.stem, _of_npy(path.read_bytes())
            return
        with zipfile.ZipFile(path) as archive:
            check_size(path, sum(member.file_size for member in archive.infolist()))
            for member in archive.infolist():
                here.at = f"array '{shown(member.filename)}'"
                yield member.filename.removesuffix(".npy"), _of_npy(archive.read(member))  # with its checksum


def _of_npy(content: bytes) -> Array:
    """Return an array that is as large as its header says, else raise ValueError; a text where it holds no numbers."""
    file = BytesIO(content)
    version = np.lib.format.read_magic(file)
    header = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}.get(version)
    if header is None:  # fields with names
        return np.array("fields")
    shape, _, kind = header(file)
    if kind.hasobject:
        return np.array("object")
    declared, there = math.prod(shape) * kind.itemsize, len(content) - file.tell()
    if declared != there:
        raise ValueError(f"declares {declared} bytes of numbers, and holds {there}")
    return np.load(BytesIO(content), allow_pickle=False)


def _is_hdf(path: Path) -> bool:
    with path.open("rb") as file:
        head = file.read(4096)
    return any(head[at : at + 8] == b"\x89HDF\r\n\x1a\n" for at in (0, 512, 1024, 2048))


def _from_hdf(path: Path) -> Iterator[tuple[str, Any]]:
    """Yield the datasets of an HDF5 file. Raises RecordingFileError where one of them is kept in another file."""
    hdf = imported("h5py", "mat")
    matlab = path.suffix.lower() == ".mat"
    seen: set[int] = set()
    whole = 0
    with reading(path, "a MATLAB file of version 7.3 or HDF5") as here, hdf.File(path) as file:
        left: list[tuple[str, Any]] = [("", file)]
        while left:
            name, item = left.pop()
            here.at = f"'{shown(name)}'" if name else ""
            address = hdf.h5o.get_info(item.id).addr
            if address in seen:  # a circle, or a second name
                continue
            seen.add(address)
            if len(seen) > 2 * MAX_COLUMNS:
                raise refuse(path, f"holds more than {2 * MAX_COLUMNS} groups and datasets; export those of one run")
            if isinstance(item, hdf.Group):
                for key in reversed([key for key in item if not key.startswith("#")]):
                    inner = f"{name}.{key}" if name else key
                    link = item.get(key, getlink=True)
                    if isinstance(link, hdf.ExternalLink):
                        raise _elsewhere(path, inner, link.filename)
                    if isinstance(link, hdf.HardLink):  # a soft one is a second name
                        left.append((inner, item[key]))
            elif isinstance(item, hdf.Dataset):
                for source in (item.virtual_sources() if item.is_virtual else item.external) or ():
                    raise _elsewhere(path, name, source[0] if item.external else source.file_name)
                if not item.size:
                    continue
                if item.attrs.get("MATLAB_class", b"double") in (b"char", b"cell") or item.dtype.kind not in "fiub":
                    yield name, np.array("text")
                elif "MATLAB_empty" not in item.attrs:
                    whole += max(item.size, math.prod(item.chunks or ())) * max(8, item.dtype.itemsize)
                    check_size(path, whole, f"'{shown(name)}'")
                    yield name, item[()].T if matlab else item[()]  # MATLAB stores column by column


def _elsewhere(path: Path, name: str, other: str) -> RecordingFileError:
    """Return the error of a dataset that another file holds: what a log names is not read."""
    where = "another dataset (it is a virtual one)" if other == "." else f"another file, '{shown(other, 300)}'"
    return refuse(path, f"'{shown(name)}' is kept in {where}, which is not read; copy the numbers into this one")


# -- versions 5 to 7.2 -------------------------------------------------------------------------------------------------


#: Kinds of elements: numbers by code; a variable, and a packed one.
_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_VARIABLE, _PACKED = 14, 15
#: Classes of variables: structures and objects, numbers, those of another form (functions, tables); and a flag.
_STRUCTURE, _OBJECT, _NUMERIC, _OTHERWISE, _COMPLEX = 2, 3, range(6, 16), (16, 17), 0x800
#: Variables within variables that are looked into.
_DEEPEST = 50


def variables(path: Path) -> Iterator[tuple[str, Any]]:
    """Yield the variables by name, fields of structures by dotted names; a text in the place of what holds no numbers.

    Raises RecordingFileError where they are too large for memory, ValueError where an element cannot be one.
    """
    with path.open("rb") as file:
        order = {b"IM": "<", b"MI": ">"}.get(file.read(128)[126:])
        if order is None:
            raise ValueError("its header is not that of version 5 to 7.2")
        whole = 0
        while len(tag := file.read(8)) == 8:
            begin = file.tell() - 8
            kind, size = struct.unpack(f"{order}II", tag)
            content = file.read(size)
            if kind == _PACKED:
                unpacking = zlib.decompressobj()
                kind, size = struct.unpack(f"{order}II", unpacking.decompress(content, 8))
                check_size(path, whole + size)
                content = unpacking.decompress(unpacking.unconsumed_tail, size + 1)
                if not unpacking.eof:  # its checksum stands at its end
                    unpacking.decompress(unpacking.unconsumed_tail, 1)
                if not unpacking.eof:
                    raise ValueError(f"what is packed at byte {begin} is not of the {size} bytes that it declares")
            whole += size
            check_size(path, whole)
            if kind != _VARIABLE or len(content) != size:
                wrong = f"of the kind {kind}, not a variable" if kind != _VARIABLE else "cut off"
                raise ValueError(f"the element at byte {begin} is {wrong}")
            yield from _variable(memoryview(content), order, f"the variable at byte {begin}")


def _variable(content: memoryview, order: str, where: str, name: str = "", depth: int = 0) -> Iterator[tuple[str, Any]]:
    """Yield what a variable holds; `name`: that of a field, which has none of its own."""
    parts = _parts(content, order, where)

    def numbers(what: str) -> Array:
        kind, data = next(parts, (0, memoryview(b"")))
        if kind not in _NUMBERS:
            raise ValueError(f"{where} lacks {what}")
        return np.frombuffer(data, np.dtype(order + _NUMBERS[kind]))

    flags = int((*numbers("its flags"), 0)[0])
    called = flags & 255
    if called in _OTHERWISE:
        yield name or "object", np.array("object")
        return
    shape = [int(x) for x in numbers("its dimensions")]
    own = numbers("its name").tobytes().decode("latin-1")
    name = name or own
    if called in _NUMERIC:
        values = numbers("its numbers")
        if len(values) != math.prod(shape):
            raise ValueError(f"{where} declares {math.prod(shape)} numbers, and holds {len(values)}")
        yield name, np.array("complex") if flags & _COMPLEX else values.reshape(shape, order="F").squeeze()
    elif called not in (_STRUCTURE, _OBJECT) or math.prod(shape) != 1 or depth >= _DEEPEST:
        yield name, np.array("text, a cell array, several structures")
    else:
        if called == _OBJECT:
            numbers("the name of its class")
        (length,), fields = numbers("the length of its fields' names").tolist(), numbers("its fields").tobytes()
        if not 0 < length <= max(len(fields), 1):
            raise ValueError(f"{where} has fields of names of {length} letters")
        for k in range(0, len(fields), length):
            field = fields[k : k + length].partition(b"\0")[0].decode("latin-1")
            kind, inner = next(parts, (0, memoryview(b"")))
            if kind != _VARIABLE:
                raise ValueError(f"{where} lacks its field '{field}'")
            if len(inner):
                yield from _variable(inner, order, where, f"{name}.{field}", depth + 1)


def _parts(content: memoryview, order: str, where: str) -> Iterator[tuple[int, memoryview]]:
    """Yield (kind, bytes) of the elements that a variable holds."""
    at = 0
    while at + 8 <= len(content):
        kind, size = struct.unpack_from(f"{order}II", content, at)
        begin, step = at + 8, 8 + size + -size % 8
        if kind >> 16:  # a small one, in the place of its size
            kind, size, begin, step = kind & 65535, kind >> 16, at + 4, 8
        if begin + size > (at + 8 if begin < at + 8 else len(content)):
            raise ValueError(f"{where} holds an element of {size} bytes, which is longer than what holds it")
        yield kind, content[begin : begin + size]
        at += step
