"""A map in the making: its lines, what was seen beside the joints, and what is not sure."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property

from ..mechanism import Mechanism
from ..spatial import Array
from .bodies import Body
from .log import Log, Stream
from .map import driven
from .units import factor_of

#: Column of a stream's time (None: stamps of the format, "": none), its unit, and what is not sure of it.
TimeColumn = tuple[str | None, str, str]


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
    scale: float = 1.0
    offset: float = 0.0
    reason: str = ""
    doubt: str = ""
    rival: str = ""

    def because(self, reason: str) -> None:
        """Note by what else the line was guessed."""
        self.reason = "; ".join(filter(None, (self.reason, reason)))


@dataclass
class Draft:
    """What has been guessed of a log so far, for a robot, or None where that is not known.

    clocks: by stream. open: driven joint whose position no column is -> the columns left that may be it by their unit.
    turns: bodies whose orientation is told, by target. others: bodies that no frame is called like, without a line.
    alike: stream without a time -> the stream that it goes with, row by row.
    rates: stream without a time -> how many rows a second it has, and how that is known.
    rests: how often the joints stood, where only these rows should be kept.
    delays: stream -> how far its clock is ahead of the joints' [s], how that is known, and what is not sure of it.
    elsewhere: whether places in the joints' own rows were seen by what stands elsewhere than the base.
    """

    log: Log
    mechanism: Mechanism | None = None
    clocks: dict[str, TimeColumn] = field(default_factory=dict)
    lines: list[Line] = field(default_factory=list)
    open: dict[str, tuple[str, ...]] = field(default_factory=dict)
    turns: dict[str, Body] = field(default_factory=dict)
    others: list[Body] = field(default_factory=list)
    delays: dict[str, tuple[float, str, str]] = field(default_factory=dict)
    rates: dict[str, tuple[float, str]] = field(default_factory=dict)
    rests: int = 0
    alike: dict[str, str] = field(default_factory=dict)
    elsewhere: bool = False

    @property
    def targets(self) -> dict[str, Line]:
        """The lines by their targets."""
        return {line.target: line for line in self.lines}

    @property
    def joints(self) -> dict[str, Line]:
        """The lines of positions, by joint."""
        return {line.target[2:]: line for line in self.lines if line.target.startswith("q.")}

    def of(self, prefix: str) -> list[Line]:
        """Return the lines whose targets begin so."""
        return [line for line in self.lines if line.target.startswith(prefix)]

    @property
    def taken(self) -> set[str]:
        """The columns of which something is made, or that a body is told by."""
        bodies = (*self.turns.values(), *self.others)
        told = {name for body in bodies for name in body.turn}
        told |= {name for body in self.others for name in body.place.values()}
        return told | {line.source for line in self.lines} | self.times

    @property
    def times(self) -> set[str]:
        """The columns that are times."""
        return {name for name, _, _ in self.clocks.values() if name}

    @cached_property
    def slides(self) -> dict[str, bool]:
        """Whether each joint of the robot slides; empty where the robot is not known."""
        return {} if self.mechanism is None else {joint.name: joint.slides for joint in self.mechanism.joints}

    @cached_property
    def driven(self) -> list[str]:
        """The joints that have motors; none where the robot is not known."""
        return [] if self.mechanism is None else driven(self.mechanism)

    def stream_of(self, line: Line) -> Stream:
        """Return the stream from which a line takes its column."""
        return self.log.stream_of(line.source)

    def values_of(self, line: Line) -> Array:
        """Return the column (N,) that a line takes, as it is."""
        return self.stream_of(line).columns[line.source]

    def in_si(self, line: Line) -> Array:
        """Return the column (N,) that a line takes in SI, by the unit that it has so far."""
        return self.values_of(line) * factor_of(line.unit) * line.scale + line.offset

    def configurations(self, joints: Mapping[str, Array], rows: Iterable[int]) -> Iterator[Array]:
        """Yield the robot's configuration in some rows of its joints' positions (N,) [m, rad]; others stand at home."""
        assert self.mechanism is not None
        q = self.mechanism.home_configuration()
        for row in rows:
            for name, values in joints.items():
                self.mechanism.set_joint(q, name, float(values[row]))
            self.mechanism.coupling.place(q)
            yield q
