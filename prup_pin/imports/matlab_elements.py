"""The variables of a MATLAB file, version 5 to 7.2. Nothing in it is believed: scipy, which does, ends the process.

A file is a row of elements, each of a kind, a size and so many bytes; a variable is an element that holds others:
flags, dimensions, a name, then numbers, or the fields of a structure. A packed one begins with its own size.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..spatial import Array
from .log import check_size

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
