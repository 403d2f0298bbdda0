"""A sweep: many poses, asked the same, in parts that may be solved anywhere and in any order."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from functools import cached_property
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, PrupPinError, imported
from ..kinematics import LoopKinematics
from ..mechanism import Mechanism
from ..numbers import number
from ..spatial import as_wrench
from .engine import Engine
from .places import Coordinates, Places, drawn, grid, scattered
from .quantities import Asked, chosen, unused
from .result import SweepFile, SweepResult
from .running import solved_parts
from .stream import Parts


class Engines:
    """The engines of one mechanism, each made once: what takes time in a short sweep is written down and compiled."""

    def __init__(self, mechanism: Mechanism, kinematics: LoopKinematics):
        self._mechanism, self._kinematics = mechanism, kinematics
        self._made: dict[tuple[Asked, bool, bool], Engine] = {}

    def completed(self, pose: Any) -> Any:
        """Return coordinates by name with home's value of those that may be left out; what is no mapping as it is."""
        return self._kinematics.completed(pose) if isinstance(pose, Mapping) else pose

    @cached_property
    def coordinates(self) -> Coordinates:
        """What poses are told by."""
        return Coordinates.of(self._mechanism, self._kinematics.length)

    def of(self, asked: Asked, compiled: bool, poses: int) -> Engine:
        """Return the engine of a question at so many poses."""
        straight = compiled or poses >= _MANY
        key = asked, compiled, straight
        if key not in self._made:
            if len(self._made) >= _ENGINES:
                self._made.clear()
            self._made[key] = Engine(self._mechanism, asked, self._kinematics, compiled, straight)
        return self._made[key]


#: So many are kept.
_ENGINES = 8
#: From so many poses on it pays to write equations down as straight lines, which takes about a second.
_MANY = 5000
#: Share of the memory that is free which a result may take.
_SHARE = 0.8


def sweep(
    mechanism: Mechanism,
    poses: Any = None,
    *,
    quantities: Sequence[str] = ("C", "K"),
    force: float | None = None,
    moment: float | None = None,
    wrench=None,
    direction: Any = None,
    length: float | None = None,
    draws: int | None = None,
    seed: int = 0,
    compiled: bool = False,
    executor: Executor | None = None,
    out: str | Path | None = None,
    progress: Callable[[int, int], None] | None = None,
    engines: Engines,
    axes: Mapping[str, Any],
) -> SweepResult | SweepFile:
    """Return what is asked for at every pose; see `Robot.sweep`."""
    asked = _asked(quantities, force, moment, wrench, direction, length)
    try:
        places = _places(engines, poses, axes, draws, seed)
    except MemoryError as error:
        raise InputError("so many poses do not fit into memory; take fewer at a time") from error
    engine = engines.of(asked, compiled, len(places))
    if compiled:
        imported("llvmlite.binding", "compiled")
    if any(item.elastic for item in engine.quantities) and not mechanism.modules:
        raise PrupPinError(
            f"'{mechanism.name}' has no compliant module: give joint stiffnesses, "
            "load(..., joint_stiffness=1e4) [N m/rad, N/m], or ask for joints and positions alone"
        )
    remarks = list(unused(asked.quantities, wrench=wrench, direction=direction))
    if compiled and engine.written is None:
        remarks.append(
            f"'{mechanism.name}' and what was asked cannot be compiled (docs/sweep.md says what can); solved by arrays"
        )
    if out is not None:
        parts = Parts(Path(out), engine, places)
        remarks += parts.remarks
        for start, part in solved_parts(engine, places, executor, remarks, progress, parts.done):
            parts.write(start, part)
        parts.finish()
        return SweepFile(engine, places, parts.out, tuple(remarks))
    free = _free_memory()
    if free is not None and _bytes_of(engine, len(places)) > _SHARE * free:
        raise _too_large(engine, len(places), free)
    try:
        whole = engine.unwritten(len(places))
        for _ in solved_parts(engine, places, executor, remarks, progress, whole=whole):
            pass
    except MemoryError as error:  # of a process that may take less than there is
        raise _too_large(engine, len(places), None) from error
    return SweepResult(engine, places, whole, tuple(remarks))


def _asked(quantities, force, moment, wrench, direction, length) -> Asked:
    if (force is None) != (moment is None):  # a box of forces alone has no moments, and the other way round
        force, moment = (0.0 if side is None else side for side in (force, moment))
    chosen(quantities, force, moment, wrench, direction)
    for name, value, unit in (("force", force, "N"), ("moment", moment, "N m"), ("length", length, "m")):
        if value is None:
            continue
        try:
            good = 0 < float(value) < np.inf or (name != "length" and 0 == value < max(force, moment))
        except (TypeError, ValueError):
            good = False
        if not good:
            what = "a length that makes rotations arcs" if name == "length" else "half the side of the box of wrenches"
            raise InputError(f"{name} = {value!r}: expected {what}, above 0 [{unit}]")
    line, of_tool = _direction(direction)
    return Asked(
        tuple(dict.fromkeys(quantities)),
        None if force is None else float(force),
        None if moment is None else float(moment),
        None if wrench is None else tuple(as_wrench(wrench).tolist()),
        line,
        of_tool,
        None if length is None else float(length),
    )


def _direction(given: Any) -> tuple[tuple[float, ...] | None, bool]:
    """Return a direction (3,), and whether it is in the tool's axes."""
    if given is None:
        return None, False
    if isinstance(given, str):
        words = {f"tool {name}": tuple(axis) for name, axis in zip("xyz", np.eye(3).tolist(), strict=True)}
        if given not in words:
            raise InputError(f"direction={given!r}: expected three numbers, or one of {', '.join(map(repr, words))}")
        return words[given], True
    try:
        line = np.asarray(given, float)
    except (TypeError, ValueError):
        line = np.zeros(0)
    if line.shape != (3,) or not np.isfinite(line).all() or not line.any():
        raise InputError(f"direction={given!r}: expected three numbers, base axes, not all zero; or 'tool z'")
    return tuple((line / np.linalg.norm(line)).tolist()), False


def _places(engines: Engines, poses: Any, axes: Mapping[str, Any], draws: int | None, seed: int) -> Places:
    coordinates = engines.coordinates
    if poses is not None:
        if axes or draws is not None:
            given = ", ".join([*axes, *(["draws"] if draws is not None else [])])
            raise InputError(f"poses= says where all poses are; leave out {given}")
        one_by_one = isinstance(poses, Iterable) and not isinstance(poses, np.ndarray | Mapping | str)
        return scattered(coordinates, map(engines.completed, poses) if one_by_one else poses)
    if draws is not None:
        return drawn(coordinates, engines.completed(axes), draws, seed)
    return grid(coordinates, engines.completed(axes))


def _bytes_of(engine: Engine, count: int) -> int:
    """Return what the numbers asked for take at so many poses."""
    return count * (8 * sum(prod(item.shape(engine.mechanism)) for item in engine.quantities) + 1)


def _too_large(engine: Engine, count: int, free: int | None) -> InputError:
    """Return the error of a sweep that does not fit; free: the bytes that there are, None where nobody tells."""
    size = _bytes_of(engine, count)
    there = "this process may take" if free is None else f"the {number(free / 1e9, 3)} GB of free memory hold"
    return InputError(
        f"{count} poses of {size // count} bytes each are {number(size / 1e9, 3)} GB, more than {there}. Give "
        "out='FILE.parquet', which takes any number; ask for fewer quantities; or take fewer poses"
    )


def _free_memory() -> int | None:
    """Return the bytes that can still be had, or None where the system does not tell."""
    try:
        with open("/proc/meminfo", encoding="ascii") as file:
            for line in file:
                if line.startswith("MemAvailable:"):
                    return 1024 * int(line.split()[1])
    except OSError:
        pass
    try:
        return os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, OSError, ValueError):
        return None
