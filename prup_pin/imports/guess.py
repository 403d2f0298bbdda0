"""A first map, guessed from names, units and numbers, for its user to correct.

A table whose columns are called as in a recording is one, but for its separators.

What a name says counts first, then what the numbers allow: joints hardly turn further than twice around, and positions
are the integral of velocities, which settles degrees, revolutions and milliseconds at once. Whatever is guessed without
proof is a doubt, and says so in the map.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
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
from .columns import LOAD_WORDS, add_by_unit, add_joints, add_poses, place_lines, time_column, wrench_lines
from .draft import Draft, Line
from .log import Log
from .map import CHECK
from .motion import add_nameless, set_beside
from .unit_by_numbers import settle_rate, settle_units
from .units import DRIVING, UNSCALED, WISHED, dimension_of, words_of


@dataclass
class Guess:
    """A map as text, and what in it is not sure, sentence by sentence."""

    text: str
    doubts: tuple[str, ...]


def guess(log: Log, mechanism: Mechanism | None = None, robot: str | None = None) -> Guess:
    """Return a first map of a log. mechanism and robot: the robot and its name, where they are known."""
    draft = Draft(log, mechanism)
    if len(log.streams) == 1 and "time" in log.names and all(map(is_known, log.names)):
        draft.clocks[log.streams[0].name] = "time", "s", ""
        names = [name for name in log.names if name not in ("time", "run")]
        draft.lines = [Line(name, name, _si(name, draft)) for name in names]
        return _Page(draft).written(robot)
    draft.clocks |= {stream.name: time_column(stream) for stream in log.streams}
    for stream in log.streams:
        add_joints(draft, stream)
    add_nameless(draft)
    draft.lines += wrench_lines(log, {line.source for line in draft.lines})
    add_poses(draft)
    if mechanism is not None:
        add_by_unit(draft)
    settle_units(draft)
    settle_rate(draft)
    set_beside(draft)
    return _Page(draft).written(robot)


def _si(name: str, draft: Draft) -> str:
    """Return the unit of a column that is called as in a recording; joints that nobody knows turn."""
    if name == "temperature":
        return "degC"
    units, joint = unit_of(name).split(" or "), joint_of(name)
    return units[0] if joint is not None and draft.slides.get(joint[1]) else units[-1]


# -- the map as YAML, with CHECK on each line that is not sure ---------------------------------------------------------


#: Joints without a column that have a line each; of more, such as a hand's, the names are listed.
_LISTED = 4
_AT_HOME = "no column is its position; it is taken to stand at home"


@dataclass
class _Page:
    """The parts of a map, as lines, and the doubts that stand on them, in their order."""

    draft: Draft
    doubts: list[str] = field(default_factory=list)

    def written(self, robot: str | None) -> Guess:
        """Return the map as YAML with a word on every line that was guessed."""
        named = [] if robot is None else [f"robot: {_text(robot)}"]
        if robot is None and self.draft.mechanism is None:
            named = ["# robot: NAME or FILE.urdf, which also tells the joints' names"]
        lines = [
            f"# Map from {shown(Path(self.draft.log.path).name)} to a recording, guessed by prup-pin import. "
            "Lines with CHECK are not sure.",
            "# SI = sign x scale x (value in unit) + offset; docs/import.md says what may stand here.",
            *named,
            *self.times(),
            *self.columns(),
            *self.without_position(),
            *self.bodies(),
            *self.rotations(),
            *self.resampling(),
            *self.tolerances(),
            *self.unused(),
        ]
        return Guess("\n".join(lines) + "\n", tuple(self.doubts))

    def told(self, text: str, doubt: str, what: str, reason: str = "") -> str:
        """Return a line with what is not sure of it, which is noted, or else with what it was guessed by."""
        if doubt:
            self.doubts.append(f"{what}: {doubt}" if what else doubt)
            return f"{text}  {CHECK}{doubt}"
        return f"{text}  # {reason}" if reason else text

    @cached_property
    def streams(self) -> set[str]:
        """The streams of which columns are used."""
        used = {self.draft.stream_of(line).name for line in self.draft.lines}
        return used | {body.stream.name for body in self.draft.turns.values()}

    def times(self) -> Iterator[str]:
        yield from ("", "time:")
        alone = len(self.draft.log.streams) == 1
        for stream in self.draft.log.streams:
            name, unit, doubt = self.draft.clocks[stream.name]
            rate, why = self.draft.rates.get(stream.name, (1.0, ""))
            inside = (
                [] if name is None else [f"from: {_text(name)}", f"unit: {unit}"] if name else [f"rate: {rate:.9g}"]
            )
            if stream.name in self.draft.alike:
                inside, doubt = [f"like: {_text(self.draft.alike[stream.name])}"], ""
            delay, known, unsure = self.draft.delays.get(stream.name, (0.0, "", ""))
            entry = ", ".join([*inside, *[f"delay: {delay:.9g}"] * (delay != 0)])
            if stream.name in self.streams or alone:
                what = "time" if alone else f"time of {stream.name}"
                yield self.told(f"  {_text(stream.name)}: {{{entry}}}", unsure or doubt, what, known or why)

    def columns(self) -> Iterator[str]:
        yield from ("", "columns:")
        order = {prefix: k for k, prefix in enumerate(("q", "qd", "qdd", "tau", "w", "p"))}
        self.draft.lines.sort(key=lambda line: order.get(line.target.partition(".")[0], 9))
        for line in self.draft.lines:
            parts = [f"from: {_text(line.source)}", f"unit: {_text(line.unit or 'SI')}"]
            parts += [f"sign: {line.sign}"] * (line.sign != 1) + ["unwrap: true"] * line.unwrap
            parts += [f"scale: {line.scale:.3g}"] * (line.scale != 1)
            parts += [f"offset: {line.offset:.12g}"] * (line.offset != 0)
            doubt = "; ".join(filter(None, (line.doubt, line.rival)))
            yield self.told(f"  {_text(line.target)}: {{{', '.join(parts)}}}", doubt, line.target, line.reason)

    def without_position(self) -> Iterator[str]:
        """Yield comments for driven joints whose position no column is.

        Where such a joint stood decides where the tool is, but for one that carries no tool, such as a finger.
        """
        draft = self.draft
        if not draft.joints:
            none = "no column was found that is the position of a joint; write lines q.<joint>"
            yield self.told("  # q.<joint>: {from: NAME, unit: rad}", none, "columns")
            return
        lines = {j: f"  # q.{j}: {{from: NAME, unit: {'m' if draft.slides.get(j) else 'rad'}}}" for j in draft.open}
        nothing = [j for j in lines if not draft.open[j] and not any(x.target.endswith(f".{j}") for x in draft.lines)]
        for joint in (joint for joint in lines if joint not in nothing):
            columns = draft.open[joint]
            is_it = f". Is it {' or '.join(columns[:6])}?" if columns else ""
            yield self.told(lines[joint], f"{_AT_HOME}{is_it}", f"q.{joint}")
        beside = [] if draft.mechanism is None or draft.mechanism.tool is None else [
            joint for joint in nothing if draft.mechanism.joint_id(joint) in draft.mechanism.load_paths.idle
        ]  # fmt: skip
        many = [joint for joint in nothing if joint not in beside]
        several = "joints are without a column, and taken to stand at home:"
        if len(many) > _LISTED:
            doubt = f"{len(many)} {several} {', '.join(many)}"
            yield self.told("  # q.JOINT: {from: NAME, unit: rad}", doubt, "q.JOINT")
        else:
            yield from [self.told(lines[joint], _AT_HOME, f"q.{joint}") for joint in many]
        if len(beside) > _LISTED:
            yield f"  # {len(beside)} {several}"
            yield from textwrap.wrap(", ".join(beside), 110, initial_indent="  #   ", subsequent_indent="  #   ")
        else:
            yield from [f"{lines[joint]}  # {_AT_HOME}" for joint in beside]

    def bodies(self) -> Iterator[str]:
        """Yield a comment for each body that no frame is called like, to be completed."""
        draft = self.draft
        if not draft.others:
            return
        yield "  # Seen as well; in the place of FRAME the frame of the robot that carries it:"
        for body in draft.others:
            for line in place_lines("p.FRAME", body, True):
                yield f"  # {line.target}: {{from: {_text(line.source)}, unit: {line.unit}}}"
        if not (draft.of("p") or draft.turns):
            called = ", ".join(body.called or "a body without a name" for body in draft.others[:6])
            there = f": {', '.join(list(draft.mechanism.frame_names)[-8:])} …" if draft.mechanism is not None else ""
            none = f"seen were {called}, and no frame of the robot is called like one; write lines p.FRAME.x{there}"
            yield self.told("", none, "")

    def rotations(self) -> Iterator[str]:
        if self.draft.turns:
            yield from ("", "rotations:")
        for target, body in self.draft.turns.items():
            unit = f", unit: {_text(body.unit)}" if body.unit else ""
            text = f"{target}: {{from: [{', '.join(map(_text, body.turn))}], as: {body.manner}{unit}}}"
            if body.askew is not None and body.askew > 0.2:  # drawn without regard to the frame
                angle = f"{np.degrees(body.askew):.0f} deg"
                yield f"  # {text}  # not used: the body's axes are turned by {angle} against the frame's"
            else:
                yield self.told(f"  {text}", body.doubt, target)

    def resampling(self) -> Iterator[str]:
        """Yield the clock that streams are put on, and whether rests alone are kept."""
        if len(self.streams) > 1:
            first = next(iter(self.draft.of("tau.") or self.draft.of("p") or self.draft.of("q.")), None)
            home = self.draft.stream_of(first).name if first is not None else min(self.streams)
            yield from ("", f"resample: {{clock: {_text(home)}}}  # or {{rate: 250}}, in samples a second")
        if self.draft.rests:
            why = "while joints move, a delay between clocks would look like an error of position"
            yield from ("", f"at_rest: true  # {self.draft.rests} rests: {why}")

    def tolerances(self) -> Iterator[str]:
        """Yield what may be off of which the log tells nothing: scales of efforts, where a camera stands."""
        if any(line.unit in UNSCALED for line in self.draft.of("tau.")):
            known = "diagnose finds it against the masses; no `scale` then:"
            yield from ("", f"# Where nobody knows the scale of the efforts, {known}")
            yield "# tolerances: {effort_gain: 1, mass: 0.1, inertia: 0.1}"
        beside = any(self.draft.stream_of(line).name in self.draft.delays for line in self.draft.of("p."))
        if beside or self.draft.elsewhere:
            yield ""
            yield "# The camera may stand anywhere; the point it saw may be 5 cm away from its frame:"
            yield "tolerances: {frame_position: 10, frame_rotation: 3, target_position: 0.05}"
        elif any(line.doubt for line in self.draft.of("p")):
            yield from ("", "# Where the sensor of p stands anywhere, diagnose finds where that is [m, rad]:")
            yield "# tolerances: {frame_position: 10, frame_rotation: 3}"

    def unused(self) -> Iterator[str]:
        """Yield the columns of which nothing is made, with doubts where something might be."""
        log, targets = self.draft.log, self.draft.targets
        sources = {line.source for line in targets.values()} | self.draft.times
        sources |= {name for body in self.draft.turns.values() for name in body.turn}
        unused = {name: log.stream_of(name).unit_of(name) or "" for name in log.names if name not in sources}
        for unit, names in self._left(unused).items():
            which = ", ".join(some(names, 6))
            doubt = f"in {unit}, and nothing is made of it: {which}. tau.<joint>, or w.fx … w.mz at the tool? Else none"
            yield self.told("", doubt, unit).strip()
        for name, unit in self._loads_by_name(unused).items():
            line = f"w.{'f' if unit == 'N' else 'm'}z: {{from: {_text(name)}, unit: {unit}}}"
            asked = f"a load on the tool, along z of the base, in {unit}?"
            yield self.told(f"# {line}", f"{asked} Then this line is one of the columns; else none", name)
        moving = bool(self.draft.joints) and all(target.startswith(("q.", "qd.", "qdd.")) for target in targets)
        if unused and moving and not (self.draft.turns or self.draft.others or self.doubts):
            which = ", ".join(some(list(unused), 6))
            doubt = (
                "nothing but the joints' motion is used, which tells nothing by itself: what else was measured, "
                f"efforts (tau.<joint>) or a place (p.x, p.FRAME.x)? Is it {which}? Else none"
            )
            yield self.told("", doubt, "columns").strip()
        if unused or log.left_out:
            yield from ("", "# Not used:", *(f"#   {name}" for name in (*unused, *log.left_out)))
        angles = [name for name, unit in unused.items() if dimension_of(unit) == "angle"]
        if len(angles) == 3 and not self.draft.turns and "p.x" in targets:
            turn = f"r: {{from: [{', '.join(map(_text, angles))}], as: euler_ZYX, unit: {unused[angles[0]]}}}"
            yield "# Where these angles turn the tool, in the order in which your log turns it:"
            yield f"# rotations: {{{turn}}}  # or euler_XYZ, euler_xyz, rotation_vector"

    def _loads_by_name(self, unused: dict[str, str]) -> dict[str, str]:
        """Return columns without a unit that are called a load, with the unit that it has; none beside known loads."""
        if any(target.startswith(("w.", "tau.")) for target in self.draft.targets):
            return {}
        spoken = {name: {*words_of(name)} for name, unit in unused.items() if not unit}
        return {
            name: unit
            for name, words in spoken.items()
            for unit, called in LOAD_WORDS.items()
            if words & called and not words & {*WISHED}
        }

    def _left(self, unused: dict[str, str]) -> dict[str, list[str]]:
        """Return columns of forces, moments and currents that nothing is made of, by their unit.

        Currents are asked for where a drive is without an effort. What a controller wishes was not measured.
        """
        efforts = {line.target[4:] for line in self.draft.of("tau.")}
        lacking = self.draft.mechanism is None or not efforts.issuperset(self.draft.driven)
        left: dict[str, list[str]] = {}
        for name, unit in unused.items():
            loads = dimension_of(unit) in ("force", "moment") or (lacking and unit in DRIVING)
            if loads and not {*words_of(name)} & {*WISHED}:
                left.setdefault(unit, []).append(name)
        return left


def _text(text: str) -> str:
    """Return a text as YAML that is read as that text, also within braces."""
    return yaml.safe_dump([text], default_flow_style=True, width=10_000, allow_unicode=True).strip()[1:-1]


def write_text(path: Path, text: str) -> None:
    """Write a map. Raises InputError where that is not possible, or where a file of this name is there already."""
    if path.exists():
        raise InputError(f"'{path}' is there already; it is not written over")
    write_whole({path: [text]})
