"""A first map, guessed from names, units and numbers, for its user to correct.

A table whose columns are called as in a recording is one, but for its separators.

What a name says counts first, then what the numbers allow: joints hardly turn further than twice around, and positions
are the integral of velocities, which settles degrees, revolutions and milliseconds at once. Whatever is guessed without
proof is a doubt, and says so in the map.
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
import yaml

from ..errors import InputError
from ..files import write_whole
from ..mechanism import Mechanism
from ..numbers import some
from ..recordings.columns import is_known, joint_of, unit_of
from ..recordings.problems import shown
from .carriers import carry
from .clocks import set_beside
from .columns import Clocks, add_by_unit, add_joints, place_lines, seen_poses, time_column, wrench_lines
from .draft import Guessing, Line, Seen
from .log import Log
from .map import CHECK, driven
from .unit_by_numbers import doubt_efforts, settle_units
from .units import DRIVING, UNSCALED, WISHED, dimension_of, words_of


def guess(log: Log, mechanism: Mechanism | None = None, robot: str | None = None) -> Guess:
    """Return a first map of a log. mechanism and robot: the robot and its name, where they are known."""
    if len(log.streams) == 1 and "time" in log.names and all(map(is_known, log.names)):
        lines = [Line(name, name, _si(name, mechanism)) for name in log.names if name not in ("time", "run")]
        return written(log, {log.streams[0].name: ("time", "s", "")}, Guessing(lines), Seen(), mechanism, robot)
    clocks = {stream.name: time_column(stream) for stream in log.streams}
    times = {name for name, _, _ in clocks.values() if name}
    found = Guessing()
    for stream in log.streams:
        add_joints(stream, times, mechanism, found)
    taken = {line.source for line in found.lines}
    loads = wrench_lines(log, taken)
    found.lines += loads
    seen = seen_poses(log, taken | {line.source for line in loads} | times, mechanism)
    found.lines += seen.lines.values()
    if mechanism is not None:
        places = {name for body in seen.others for name in body.place.values()}
        turns = {name for body in (*seen.turns.values(), *seen.others) for name in body.turn}
        add_by_unit(log, {line.source for line in found.lines} | places | turns | times, mechanism, found)
    unsaid = {line.target for line in found.lines if line.unit is None and line.target.startswith("tau.")}
    settle_units(log, clocks, found, mechanism)
    doubt_efforts(log, found, unsaid, mechanism)
    carry(log, clocks, found, seen, mechanism)
    set_beside(log, clocks, found, seen, mechanism)
    return written(log, clocks, found, seen, mechanism, robot)


def _si(name: str, mechanism: Mechanism | None) -> str:
    """Return the unit of a column that is called as in a recording; joints that nobody knows turn."""
    if name == "temperature":
        return "degC"
    units, joint = unit_of(name).split(" or "), joint_of(name)
    sliding = {item.name for item in mechanism.joints if item.slides} if mechanism is not None else set()
    return units[0] if joint is not None and joint[1] in sliding else units[-1]


# -- the map as YAML, with CHECK on each line that is not sure ---------------------------------------------------------


_FOUND_BY_MASSES = "diagnose finds it against the masses; no `scale` then:"
#: A body whose axes are turned further against its frame's was drawn without regard to the frame [rad].
_ASKEW = 0.2


@dataclass
class Guess:
    """A map as text, and what in it is not sure, sentence by sentence."""

    text: str
    doubts: tuple[str, ...]


def written(
    log: Log, clocks: Clocks, found: Guessing, seen: Seen, mechanism: Mechanism | None, robot: str | None
) -> Guess:
    """Return the map as YAML with a word on every line that was guessed."""
    page = _Page(log, clocks, found, seen, mechanism)
    unknown = "# robot: NAME or FILE.urdf, which also tells the joints' names" if mechanism is None else ""
    lines = [
        f"# Map from {shown(Path(log.path).name)} to a recording, guessed by prup-pin import. "
        "Lines with CHECK are not sure.",
        "# SI = sign x scale x (value in unit) + offset; docs/import.md says what may stand here.",
        *filter(None, [f"robot: {_text(robot)}" if robot is not None else unknown]),
        *page.times(),
        *page.columns(),
        *_of_others(seen, mechanism, page.doubts),
        *page.rotations(),
        *page.resampling(),
        *page.tolerances(),
        *page.unused(),
    ]
    return Guess("\n".join(lines) + "\n", tuple(page.doubts))


@dataclass
class _Page:
    """The parts of a map, as lines, and the doubts that stand on them, in their order."""

    log: Log
    clocks: Clocks
    found: Guessing
    seen: Seen
    mechanism: Mechanism | None
    doubts: list[str] = field(default_factory=list)

    def told(self, text: str, doubt: str, what: str, reason: str = "") -> str:
        """Return a line with what is not sure of it, which is noted, or else with what it was guessed by."""
        if doubt:
            self.doubts.append(f"{what}: {doubt}")
            return f"{text}  {CHECK}{doubt}"
        return f"{text}  # {reason}" if reason else text

    @cached_property
    def chosen(self) -> list[Line]:
        """The lines of columns in the order in which they are written."""
        order = {prefix: k for k, prefix in enumerate(("q", "qd", "qdd", "tau", "w", "p"))}
        return sorted(self.found.lines, key=lambda line: order.get(line.target.partition(".")[0], 9))

    def of(self, kind: str) -> list[Line]:
        """Return the lines of columns whose names begin so."""
        return [line for line in self.chosen if line.target.startswith(kind)]

    @cached_property
    def streams(self) -> set[str]:
        """The streams of which columns are used."""
        used = {self.log.stream_of(line.source).name for line in self.found.lines}
        return used | {body.stream.name for body in self.seen.turns.values()}

    def times(self) -> Iterator[str]:
        yield from ("", "time:")
        alone = len(self.log.streams) == 1
        for stream in self.log.streams:
            name, unit, doubt = self.clocks[stream.name]
            inside = [] if name is None else [f"from: {_text(name)}", f"unit: {unit}"] if name else ["rate: 1"]
            if stream.name in self.seen.alike:
                inside, doubt = [f"like: {_text(self.seen.alike[stream.name])}"], ""
            delay, known, unsure = self.seen.delays.get(stream.name, (0.0, "", ""))
            entry = ", ".join([*inside, *[f"delay: {delay:.9g}"] * (delay != 0)])
            if stream.name in self.streams or alone:
                what = "time" if alone else f"time of {stream.name}"
                yield self.told(f"  {_text(stream.name)}: {{{entry}}}", unsure or doubt, what, known)

    def columns(self) -> Iterator[str]:
        yield from ("", "columns:")
        for line in self.chosen:
            parts = [f"from: {_text(line.source)}", f"unit: {_text(line.unit or 'SI')}"]
            parts += [f"sign: {line.sign}"] * (line.sign != 1) + ["unwrap: true"] * line.unwrap
            parts += [f"offset: {line.offset:.12g}"] * (line.offset != 0)
            doubt = "; ".join(filter(None, (line.doubt, line.rival)))
            yield self.told(f"  {_text(line.target)}: {{{', '.join(parts)}}}", doubt, line.target, line.reason)
        if self.of("q."):
            yield from _without(self.found, self.mechanism, self.told)
        else:
            none = "no column was found that is the position of a joint; write lines q.<joint>"
            yield self.told("  # q.<joint>: {from: NAME, unit: rad}", none, "columns")

    def rotations(self) -> Iterator[str]:
        if self.seen.turns:
            yield from ("", "rotations:")
        for target, body in self.seen.turns.items():
            unit = f", unit: {_text(body.unit)}" if body.unit else ""
            text = f"{target}: {{from: [{', '.join(map(_text, body.turn))}], as: {body.manner}{unit}}}"
            if body.askew is not None and body.askew > _ASKEW:
                angle = f"{np.degrees(body.askew):.0f} deg"
                yield f"  # {text}  # not used: the body's axes are turned by {angle} against the frame's"
            else:
                yield self.told(f"  {text}", body.doubt, target)

    def resampling(self) -> Iterator[str]:
        """Yield the clock that streams are put on, and whether rests alone are kept."""
        if len(self.streams) > 1:
            first = next(iter(self.of("tau.") or self.of("p") or self.of("q.")), None)
            home = self.log.stream_of(first.source).name if first is not None else min(self.streams)
            yield from ("", f"resample: {{clock: {_text(home)}}}  # or {{rate: 250}}, in samples a second")
        if self.seen.rests:
            why = "while joints move, a delay between clocks would look like an error of position"
            yield from ("", f"at_rest: true  # {self.seen.rests} rests: {why}")

    def tolerances(self) -> Iterator[str]:
        """Yield what may be off of which the log tells nothing: scales of efforts, where a camera stands."""
        if any(line.unit in UNSCALED for line in self.of("tau.")):
            yield from ("", f"# Where nobody knows the scale of the efforts, {_FOUND_BY_MASSES}")
            yield "# tolerances: {effort_gain: 1, mass: 0.1, inertia: 0.1}"
        reach = max(self.seen.carried.values(), default=0.0)
        if any(self.log.stream_of(line.source).name in self.seen.delays for line in self.of("p.")):
            reach = max(reach, 0.05)
        if reach:
            yield ""
            yield f"# The camera may stand anywhere; the point it saw may be {100 * reach:g} cm away from its frame:"
            yield f"tolerances: {{frame_position: 10, frame_rotation: 3, target_position: {reach:g}}}"

    def unused(self) -> Iterator[str]:
        """Yield the columns of which nothing is made, with doubts where something might be."""
        sources = {line.source for line in self.chosen}
        sources |= {name for body in self.seen.turns.values() for name in body.turn}
        sources |= {name for name, _, _ in self.clocks.values() if name}
        unused = [name for name in self.log.names if name not in sources]
        for unit, names in _left(self.log, unused, self.found, self.mechanism).items():
            which = ", ".join(some(names, 6))
            doubt = f"in {unit}, and nothing is made of it: {which}. tau.<joint>, or w.fx … w.mz at the tool? Else none"
            yield self.told("", doubt, unit).strip()
        if unused or self.log.left_out:
            yield from ("", "# Not used:", *(f"#   {name}" for name in (*unused, *self.log.left_out)))
        units = {name: self.log.stream_of(name).unit_of(name) or "" for name in unused}
        angles = [name for name, unit in units.items() if dimension_of(unit) == "angle"]
        if len(angles) == 3 and not self.seen.turns and any(line.target == "p.x" for line in self.chosen):
            turn = f"r: {{from: [{', '.join(map(_text, angles))}], as: euler_ZYX, unit: {units[angles[0]]}}}"
            yield "# Where these angles turn the tool, in the order in which your log turns it:"
            yield f"# rotations: {{{turn}}}  # or euler_XYZ, euler_xyz, rotation_vector"


#: Joints without a column that have a line each; of more, such as a hand's, the names are listed.
_LISTED = 4
_AT_HOME = "no column is its position; it is taken to stand at home"


def _without(found: Guessing, mechanism: Mechanism | None, told: Callable[[str, str, str], str]) -> list[str]:
    """Return lines of comment for driven joints whose position no column is; `told` notes what is not sure of one.

    Where such a joint stood decides where the tool is, but for one that carries no tool, such as a finger.
    """
    lines, many, beside = [], [], []
    for joint, columns in found.open.items():
        slides = mechanism is not None and any(item.slides for item in mechanism.joints if item.name == joint)
        text = f"  # q.{joint}: {{from: NAME, unit: {'m' if slides else 'rad'}}}"
        own = any(line.target.endswith(f".{joint}") for line in found.lines)
        if columns or own:
            lines.append(told(text, f"{_AT_HOME}{_is_it(columns)}", f"q.{joint}"))
        elif _carries_the_tool(joint, mechanism):
            many.append((joint, text))
        else:
            beside.append((joint, text))
    if len(many) > _LISTED:
        doubt = f"{len(many)} joints are without a column, and taken to stand at home: {', '.join(j for j, _ in many)}"
        lines.append(told("  # q.JOINT: {from: NAME, unit: rad}", doubt, "q.JOINT"))
    else:
        lines += [told(text, _AT_HOME, f"q.{joint}") for joint, text in many]
    if len(beside) > _LISTED:
        names = textwrap.wrap(", ".join(j for j, _ in beside), 110, initial_indent="  #   ", subsequent_indent="  #   ")
        lines += [f"  # {len(beside)} joints are without a column, and taken to stand at home:", *names]
    else:
        lines += [f"{text}  # {_AT_HOME}" for _, text in beside]
    return lines


def _is_it(columns: Sequence[str]) -> str:
    return f". Is it {' or '.join(columns[:6])}?" if columns else ""


def _carries_the_tool(joint: str, mechanism: Mechanism | None) -> bool:
    """Return whether a joint may be on the way from the base to the tool."""
    if mechanism is None or mechanism.tool is None:
        return True
    return mechanism.joint_id(joint) not in mechanism.load_paths.idle


def _left(log: Log, unused: Sequence[str], found: Guessing, mechanism: Mechanism | None) -> dict[str, list[str]]:
    """Return columns of forces, moments and currents that nothing is made of, by their unit.

    Currents are asked for where a drive is without an effort. What a controller wishes was not measured.
    """
    efforts = {line.target for line in found.lines}
    lacking = mechanism is None or any(f"tau.{joint}" not in efforts for joint in driven(mechanism))
    left: dict[str, list[str]] = {}
    for name in unused:
        unit = log.stream_of(name).unit_of(name) or ""
        loads = dimension_of(unit) in ("force", "moment") or (lacking and unit in DRIVING)
        if loads and not {*words_of(name)} & {*WISHED}:
            left.setdefault(unit, []).append(name)
    return left


def _of_others(seen: Seen, mechanism: Mechanism | None, doubts: list[str]) -> list[str]:
    """Return a line of comment for each body that no frame is called like, to be completed."""
    lines = [f"  # marker {again} is marker {first} again, number by number" for again, first in seen.copies.items()]
    for called, moves in seen.movers.items():
        moving = f"marker {called or 'without a name'} {moves}"
        lines.append(f"  {CHECK}{moving}")
        doubts.append(moving)
    if not seen.others:
        return lines
    lines.append("  # Seen as well; in the place of FRAME the frame of the robot that carries it:")
    for body in seen.others:
        for line in place_lines("p.FRAME", body, True):
            lines.append(f"  # {line.target}: {{from: {_text(line.source)}, unit: {line.unit}}}")
    if not (seen.lines or seen.turns or seen.carried or seen.movers):
        called = ", ".join(body.called or "a body without a name" for body in seen.others[:6])
        there = f": {', '.join(list(mechanism.frame_names)[-8:])} …" if mechanism is not None else ""
        doubts.append(f"seen were {called}, and no frame of the robot is called like one; write lines p.FRAME.x{there}")
        lines.append(f"  {CHECK}{doubts[-1]}")
    return lines


def _text(text: str) -> str:
    """Return a text as YAML that is read as that text, also within braces."""
    return yaml.safe_dump([text], default_flow_style=True, width=10_000, allow_unicode=True).strip()[1:-1]


def write_text(path: Path, text: str) -> None:
    """Write a map. Raises InputError where that is not possible, or where a file of this name is there already."""
    if path.exists():
        raise InputError(f"'{path}' is there already; it is not written over")
    write_whole({path: [text]})
