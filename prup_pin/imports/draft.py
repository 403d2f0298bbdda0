"""A map in the making: its lines, what was seen beside the joints, and what is not sure."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from ..mechanism import Mechanism
from ..spatial import Array
from .bodies import Body
from .log import Log
from .units import UNITS, dimension_of


@dataclass
class Line:
    """One line of the map to be; `sign` and `unit` are open until numbers were compared.

    rival: another column that may as well be meant, in words; what proves units and order does not settle that.
    """

    target: str
    source: str
    unit: str | None
    sign: int = 1
    unwrap: bool = False
    offset: float = 0.0
    reason: str = ""
    doubt: str = ""
    rival: str = ""


@dataclass
class Seen:
    """Lines of places, bodies whose orientation is told, by target; and bodies that no frame is called like.

    others: those of them that have no line yet; unnamed: all of them.
    carried: name of one that moves as a body of the robot does -> how far it may sit from the frame of its lines [m].
    movers: name of one that does so as seen from another body -> that in words. copies: name -> the same marker again.
    alike: stream without a time -> the stream that it goes with, row by row.
    rests: how often the joints stood, where only these rows should be kept.
    delays: stream -> how far its clock is ahead of the joints' [s], how that is known, and what is not sure of it.
    """

    lines: dict[str, Line] = field(default_factory=dict)
    turns: dict[str, Body] = field(default_factory=dict)
    others: list[Body] = field(default_factory=list)
    unnamed: list[Body] = field(default_factory=list)
    carried: dict[str, float] = field(default_factory=dict)
    movers: dict[str, str] = field(default_factory=dict)
    copies: dict[str, str] = field(default_factory=dict)
    delays: dict[str, tuple[float, str, str]] = field(default_factory=dict)
    rests: int = 0
    alike: dict[str, str] = field(default_factory=dict)


@dataclass
class Guessing:
    """What has been guessed so far.

    open: driven joint whose position no column is -> the columns left that may be it by their unit.
    """

    lines: list[Line] = field(default_factory=list)
    open: dict[str, tuple[str, ...]] = field(default_factory=dict)


def configurations(mechanism: Mechanism, joints: Mapping[str, Array], rows: Iterable[int]) -> Iterator[Array]:
    """Yield the robot's configuration in some rows of its joints' positions (N,) [m, rad]; others stand at home."""
    q = mechanism.home_configuration()
    for row in rows:
        for name, values in joints.items():
            mechanism.set_joint(q, name, float(values[row]))
        mechanism.coupling.place(q)
        yield q


def values_of(log: Log, line: Line) -> Array:
    """Return the column (N,) that a line takes, as it is."""
    return log.stream_of(line.source).columns[line.source]


def in_si(log: Log, line: Line) -> Array:
    """Return the column (N,) that a line takes in SI, by the unit that it has so far."""
    unit = line.unit or "SI"
    values = values_of(log, line) * UNITS[dimension_of(unit) or "angle"].get(unit, 1.0)
    return values + line.offset
