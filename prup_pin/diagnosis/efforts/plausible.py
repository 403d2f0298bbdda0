"""Whether efforts and positions can be those of this robot: signs, units, orders of columns that give themselves away.

What a rigid robot with some friction leaves of the efforts is compared with what it would leave if a column were
something else: turned round, in degrees, another joint's. Where that leaves far less, the recording is not what it
says, and no law is to be made of it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from ...dynamics import InMotion, Motion, could_be_gravity
from ...errors import InputError
from ...numbers import number
from ...recordings.columns import LARGEST_NUMBER
from ...spatial import Array
from ..criteria import (
    EFFORT_APART,
    EFFORT_FEWEST,
    EFFORT_FOLLOWS,
    EFFORT_MEANT,
    EFFORT_RIGHT,
    EFFORT_STEP,
    EFFORT_STRANGE,
    FAR_BEYOND,
)

__all__ = ["check_efforts"]

#: Samples that are looked at.
_SAMPLES = 600
#: Numbers that a sentence shows, and joints of which some would show what one thing does to all.
_SHOWN, _FEWEST = 8, 3
#: Columns that may be meant otherwise, one after the other.
_MOST = 6


@dataclass(frozen=True)
class _Reading:
    """What some columns may be instead: `changed` makes (motion, efforts) of them."""

    words: str
    changed: Callable[[Motion, Array], tuple[Motion, Array]]


def check_efforts(at: InMotion, known: Array | None = None) -> list[str]:
    """Return suspicions. Raises InputError where columns are not what they say, with what gave them away.

    known (k,): gains of the efforts, where those are in units of their own.
    """
    _check_places(at)
    rows = np.unique(np.linspace(0, len(at) - 1, _SAMPLES).astype(int))
    motion = at.motion.select(rows)
    efforts = at.motion.band(at.motion.efforts, at.motion.piece)[rows]
    if len(rows) < EFFORT_FEWEST or not np.isfinite(efforts).all() or not efforts.any():
        return []
    rigid = at.rigid[rows]
    signed = _gains(motion, efforts, rigid)
    gains = {name: gain for name, gain in signed.items() if gain > 0}
    _check_units(motion, gains)
    units = [np.ones(len(motion.driven))]
    in_units = False
    if known is not None and not (known == 1).all():
        in_units = True
        units.append(known)
    elif _apart(gains):
        usual = float(np.median(list(gains.values())))
        units.append(np.array([abs(signed.get(name, usual)) for name in motion.driven]))
    for unit in units:
        first = _left(motion, efforts / unit, rigid)
        if first > EFFORT_STRANGE:
            _read_otherwise(at, motion, efforts / unit, first, _left_hung(at, rows, motion, efforts / unit))
            _check_limits(at, motion, first)
    if in_units or not _apart(gains):
        return []
    told = ", ".join(f"tau.{name} {number(gain, 3)}" for name, gain in list(gains.items())[:_SHOWN])
    return [
        f"the efforts follow the rigid robot's, but are other multiples of them at each joint ({told}): are they in "
        "per cent or A? Expected N m or N"
    ]


def _check_places(at: InMotion) -> None:
    """Raise InputError where an effort was recorded of a joint whose place is neither recorded nor told by loops."""
    unseen = [name for name in at.driven if name not in at.motion.names]
    if unseen and not at.mechanism.loops:
        name = unseen[0]
        raise InputError(
            f"tau.{name} was recorded, but no q.{name}: where {name} stood is not known. Add the column, constant "
            f"where the joint is held, or leave tau.{name} out"
        )


def _apart(gains: dict[str, float]) -> bool:
    """Return whether no joint's effort is in the unit of the rigid robot's."""
    apart = np.abs(np.log(list(gains.values())))
    return not (len(gains) < _FEWEST or np.median(apart) < np.log(EFFORT_APART) or apart.min() < np.log(EFFORT_RIGHT))


def _read_otherwise(at: InMotion, motion: Motion, efforts: Array, first: float, hung: float) -> None:
    """Raise InputError where the efforts make sense once some columns are read otherwise.

    hung: what is left where the robot hangs from a wall or a ceiling, which columns turned round imitate.
    """
    least = first
    words: list[str] = []
    while len(words) < _MOST:
        found = [(*_tried(at, motion, efforts, reading), reading) for reading in _readings(at, motion, efforts)]
        found = [item for item in found if item[0] < np.inf]
        if not found:
            break
        left, changed, given, reading = min(found, key=lambda item: item[0])
        if left > EFFORT_STEP * least:
            break
        least, motion, efforts = left, changed, given
        words.append(reading.words)
    if words and least < min(EFFORT_MEANT * min(first, 1.0), hung):
        raise InputError(
            f"as they stand, positions and efforts leave {_share(first)} of the efforts unexplained by the rigid robot "
            f"and friction, but {_share(least)} if {', and '.join(words)}: is it so? Expected columns of the robot "
            "file's joints, in their directions, in rad or m, and N m or N; `prup-pin import` mends signs and units by "
            "its map"
        )


def _tried(at: InMotion, motion: Motion, efforts: Array, reading: _Reading) -> tuple[float, Motion, Array]:
    changed, given = reading.changed(motion, efforts)
    try:
        rigid = at.rigid_of(changed)
    except InputError:  # loops that do not close
        return np.inf, motion, efforts
    return _left(changed, given, rigid), changed, given


def _left(motion: Motion, efforts: Array, rigid: Array) -> float:
    """Return what rigid efforts and friction leave of efforts (n, k): a share, RMS of the joints."""
    shares = _shares(motion, efforts, rigid)
    return float(np.sqrt(np.nanmean(shares))) if np.isfinite(shares).any() else 0.0


def _left_hung(at: InMotion, rows: np.ndarray, motion: Motion, efforts: Array) -> float:
    """Return the same of efforts (n, k) at some `rows` where gravity may pull any way, as strong as it is."""
    if not at.mechanism.gravity.any():
        return np.inf
    table, values = [], []
    rigid, pulled = at.rigid[rows], np.stack([at.rigid_under(axis)[rows] for axis in np.eye(3)], axis=-1)
    for column, name in enumerate(motion.driven):
        size = float(np.linalg.norm(efforts[:, column]))
        if size > 0:
            table.append(_freed(motion, name, pulled[:, column]) / size)
            values.append(_freed(motion, name, efforts[:, column] - rigid[:, column]) / size)
    more = np.linalg.lstsq(np.concatenate(table), np.concatenate(values), rcond=1e-8)[0]
    if not could_be_gravity(at.mechanism.gravity + more, at.mechanism):
        return np.inf
    shares = [float(((value - own @ more) ** 2).sum()) for own, value in zip(table, values, strict=True)]
    return float(np.sqrt(np.mean(shares)))


def _shares(motion: Motion, efforts: Array, rigid: Array) -> Array:
    """Return the same of the squares of each joint (k,); NaN of one without efforts."""
    shares = np.full(len(motion.driven), np.nan)
    for column, name in enumerate(motion.driven):
        size = float(efforts[:, column] @ efforts[:, column])
        if size > 0:
            rest = _freed(motion, name, efforts[:, column] - rigid[:, column])
            shares[column] = min(float(rest @ rest) / size, 100.0)
    return shares


def _freed(motion: Motion, joint: str, values: Array) -> Array:
    """Return values (n, ...) freed of friction at a joint."""
    if joint not in motion.names:
        return values
    column = motion.names.index(joint)
    speed = motion.speed[:, column]
    table = np.column_stack((speed / np.hypot(speed, motion.slow[column]), speed))
    return values - table @ np.linalg.lstsq(table, values, rcond=1e-10)[0]


def _readings(at: InMotion, motion: Motion, efforts: Array) -> Iterator[_Reading]:
    """Yield what columns may be instead."""
    rigid = at.rigid_of(motion)
    turned = np.flatnonzero(_shares(motion, -efforts, rigid) < EFFORT_MEANT * _shares(motion, efforts, rigid))
    names, driven = motion.names, motion.driven
    every = tuple(range(len(driven)))
    if len(turned):
        # each joint's for itself: signs of efforts say nothing of one another
        which = ", ".join(f"tau.{driven[column]}" for column in turned)
        words = f"the sign of {which} is" if len(turned) == 1 else f"the signs of {which} are"
        yield _of_efforts(f"{words} turned round", dict.fromkeys(turned.tolist(), -1.0))
    if len(driven) > 1:
        for a, b in combinations(every, 2):
            yield _in_order(f"tau.{driven[a]} and tau.{driven[b]} are exchanged", _exchanged(len(driven), a, b), "tau")
        yield _in_order("the columns of efforts are in the opposite order", every[::-1], "tau")
    if at.mechanism.loops:
        return  # whose positions would not close
    turning = [column for column, name in enumerate(names) if at.mechanism.joint(name).turns]
    for column, name in enumerate(names):
        yield _of_positions(f"the sign of q.{name} is turned round", {column: -1.0})
        if column in turning:
            yield _of_positions(f"q.{name} is in degrees", {column: np.pi / 180})
    if len(names) > 1:
        yield _of_positions("all positions are in degrees", dict.fromkeys(turning, np.pi / 180))
        yield _of_positions("the signs of all positions are turned round", dict.fromkeys(range(len(names)), -1.0))
        for a, b in combinations(range(len(names)), 2):
            yield _in_order(f"q.{names[a]} and q.{names[b]} are exchanged", _exchanged(len(names), a, b), "q")
        yield _in_order("the columns of positions are in the opposite order", tuple(range(len(names)))[::-1], "q")
    for column, name in enumerate(names):
        if name in driven:
            yield _turned_joint(name, column, driven.index(name))


def _exchanged(count: int, a: int, b: int) -> tuple[int, ...]:
    return tuple(b if place == a else a if place == b else place for place in range(count))


def _scaled(values: Array, factors: dict[int, float]) -> Array:
    out = values.copy()
    for column, factor in factors.items():
        out[:, column] *= factor
    return out


def _moved(motion: Motion, factors: dict[int, float]) -> Motion:
    return motion.with_motion(*(_scaled(x, factors) for x in (motion.position, motion.speed, motion.acceleration)))


def _of_efforts(words: str, factors: dict[int, float]) -> _Reading:
    return _Reading(words, lambda motion, efforts: (motion, _scaled(efforts, factors)))


def _of_positions(words: str, factors: dict[int, float]) -> _Reading:
    return _Reading(words, lambda motion, efforts: (_moved(motion, factors), efforts))


def _turned_joint(name: str, column: int, drive: int) -> _Reading:
    def changed(motion: Motion, efforts: Array) -> tuple[Motion, Array]:
        return _moved(motion, {column: -1.0}), _scaled(efforts, {drive: -1.0})

    return _Reading(f"q.{name} and tau.{name} count the other way round", changed)


def _in_order(words: str, order: tuple[int, ...], of: str) -> _Reading:
    places = list(order)

    def changed(motion: Motion, efforts: Array) -> tuple[Motion, Array]:
        if of == "tau":
            return motion, efforts[:, places]
        moved = (x[:, places] for x in (motion.position, motion.speed, motion.acceleration))
        return replace(motion.with_motion(*moved), slow=motion.slow[places]), efforts

    return _Reading(words, changed)


def _gains(motion: Motion, efforts: Array, rigid: Array) -> dict[str, float]:
    """Return by how much efforts are larger than the rigid robot's, of joints where they follow them or minus them."""
    gains: dict[str, float] = {}
    for column, name in enumerate(motion.driven):
        own = _freed(motion, name, np.column_stack((efforts[:, column], rigid[:, column])))
        product, sizes = float(own[:, 0] @ own[:, 1]), np.linalg.norm(own, axis=0)
        if sizes.all() and abs(product) > EFFORT_FOLLOWS * float(sizes[0] * sizes[1]):
            gains[name] = product / float(sizes[1] ** 2)
    return gains


def _check_units(motion: Motion, gains: dict[str, float]) -> None:
    """Raise InputError where efforts are a thousand times the rigid robot's, and of their shape."""
    told = {name: gain for name, gain in gains.items() if 1 / 2 < gain / 1e3 < 2}
    if not told or len(told) < len(gains) or 2 * len(told) < len(motion.driven):
        return
    shown = ", ".join(f"tau.{name} {number(gain, 3)} times" for name, gain in list(told.items())[:_SHOWN])
    raise InputError(
        f"the efforts follow those of the rigid robot, but are {shown} as large: they seem to be in mN m or N mm; "
        "expected N m or N at the joints. `prup-pin import` scales them by its map"
    )


def _check_limits(at: InMotion, motion: Motion, first: float) -> None:
    """Raise InputError where joints go far beyond their limits in the robot file."""
    model = at.mechanism.model
    for column, name in enumerate(motion.names):
        joint = at.mechanism.joint(name)
        low, high = (float(limit[joint.first_q]) for limit in (model.lowerPositionLimit, model.upperPositionLimit))
        reached = float(np.abs(motion.position[:, column]).max())
        most = max(abs(low), abs(high))
        if joint.nq == 1 and 0 < most < LARGEST_NUMBER and reached > FAR_BEYOND * most:
            unit = "rad" if joint.turns else "m"
            allowed = f"{number(low)} to {number(high)} {unit}"
            raise InputError(
                f"column q.{name} reaches {number(reached)}, but the robot file allows {allowed}, and "
                f"{_share(first)} of the efforts are unexplained: are these positions of the motor before its gear, or "
                f"in another unit? Expected the joint's, in {unit}"
            )


def _share(value: float) -> str:
    return f"{number(100 * value, 3)} %" if value < 10 else "more than 1000 %"
