"""A sweep larger than memory: parts on disk while it runs, one table in the end, Parquet or CSV.

Parts stand in a folder beside the table, FILE.parts, each an array of rows that is written whole. A sweep that was
interrupted finds them there and goes on; what does not belong to it, it refuses, and what is damaged, it solves again.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..files import write_whole
from ..kernel import NEGLIGIBLE
from .engine import Answer, Engine
from .places import Places
from .result import table_columns
from .running import PART
from .table import FORMATS

_ABOUT = "about.json"
#: Of the format of parts; another one is not read.
_VERSION = 2


class Parts:
    """The parts of one sweep on disk."""

    def __init__(self, out: Path, engine: Engine, places: Places):
        """Begin, or take up what is there. Raises InputError where nothing can be written or others' parts stand."""
        if out.is_dir():
            raise InputError(f"out: '{out}' is a folder; give a file in it, such as sweep.parquet")
        if out.suffix not in FORMATS:
            raise InputError(f"out: '{out}': expected a name that ends in .csv or .parquet")
        self._format = FORMATS[out.suffix]
        self._format.check()
        if not out.parent.is_dir():
            raise InputError(f"out: cannot write '{out}': there is no folder '{out.parent}'")
        self.out, self.folder = out, out.with_name(f"{out.name}.parts")
        self._engine, self._places = engine, places
        self._asked = {**engine.about(), **_fingerprint(engine, places)}
        self.remarks: list[str] = []
        try:
            self.folder.mkdir(exist_ok=True)
            self._check_asked()
        except OSError as error:
            raise InputError(f"out: cannot write '{self.folder}': {error.strerror or error}") from error
        self.done = self._found()

    def _check_asked(self) -> None:
        path = self.folder / _ABOUT
        if not path.exists():
            if any(self.folder.iterdir()):
                raise InputError(
                    f"'{self.folder}' holds files, but not what they are of; remove it, or give another file"
                )
            write_whole({path: [json.dumps(self._asked, sort_keys=True)]})
            return
        try:
            there = json.loads(path.read_text(encoding="utf-8"))
        except ValueError:
            raise InputError(f"'{path}' is damaged; remove '{self.folder}' to begin anew") from None
        differs = [key for key in self._asked if there.get(key) != json.loads(json.dumps(self._asked[key]))]
        if differs:
            raise InputError(
                f"'{self.folder}' holds parts of another sweep (other {', '.join(differs)}); finish that one, remove "
                "the folder, or give another file"
            )

    def _found(self) -> frozenset[int]:
        """Return where the parts begin that are whole; the others are removed."""
        done = set()
        for path in sorted(self.folder.iterdir()):
            if path.name == _ABOUT:
                continue
            start = int(path.stem.partition("-")[2]) if path.stem.startswith("part-") else -1
            if start >= 0 and _rows_in(path) == min(PART, len(self._places) - start):
                done.add(start)
            else:
                path.unlink()
                self.remarks.append(f"{path.name} was not written to its end; solved again")
        return frozenset(done)

    def write(self, start: int, answer: Answer) -> None:
        """Write the part that begins at a pose."""
        rows = self._places.rows(start, start + len(answer.status))
        columns = table_columns(self._engine, rows, answer)
        kinds = [(name, values.dtype) for name, values in columns.items()]
        held = BytesIO()
        np.save(held, np.rec.fromarrays([*columns.values()], kinds))
        write_whole({self._path(start): [held.getvalue()]})

    def finish(self) -> None:
        """Put all parts into one table, and remove them once it is whole."""
        parts = map(np.load, map(self._path, range(0, len(self._places), PART)))
        columns = ({name: part[name] for name in part.dtype.names} for part in parts)
        try:
            self._format.write(self.out, columns, self.about())
        except OSError as error:
            raise InputError(
                f"out: cannot write '{self.out}': {error.strerror or error}; the parts are in '{self.folder}'"
            ) from error
        shutil.rmtree(self.folder)

    def about(self) -> dict[str, Any]:
        """Return what the table says of itself, its axes included."""
        places = self._places
        axes = {name: axis.tolist() for name, axis in places.axes.items()}
        return {**self._engine.about(), "shape": places.shape, "axes": axes, "fixed": places.fixed}

    def _path(self, start: int) -> Path:
        return self.folder / f"part-{start:012d}.npy"


def _rows_in(path: Path) -> int:
    """Return how many rows a part has, -1 where it is damaged."""
    try:
        return len(np.load(path, mmap_mode="r"))
    except (OSError, ValueError, EOFError):
        return -1


def _fingerprint(engine: Engine, places: Places) -> dict[str, Any]:
    """Return what tells sweeps apart: the robot, where it is asked, and how."""
    where = hashlib.sha256(repr((places.names, places.shape, sorted(places.fixed.items()))).encode())
    for name, axis in places.axes.items():
        where.update(name.encode() + axis.tobytes())
    if not places.axes and places.dims == ("pose",):
        where.update(np.ascontiguousarray(places.rows()).tobytes())
    return {
        "version": [_VERSION, PART, NEGLIGIBLE],
        "compiled": engine.compiled,
        "robot file and values": engine.mechanism.fingerprint,
        "poses": where.hexdigest(),
    }
