"""The map from a log to a recording: which column is which joint, in which unit, on which clock; and its file.

A file is checked against its log and its robot: all that is wrong with it is told, each with its line and key.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from ..errors import Problem, RecordingFileError, nearest_names
from ..files import named_beside
from ..mechanism import Mechanism
from ..recordings import Noise, Tolerances
from ..recordings.beside import noise_of, tolerances_of
from ..recordings.columns import NOISE_KEYS, joint_of, marker_of
from ..recordings.columns import UNITS as COLUMNS
from ..recordings.problems import KeyProblem, Problems, ValueReader, json_kind, read_bytes, shown
from .log import Log, Stream
from .units import Unit, unit_for, units_in_words

#: How the orientation of a body may be logged, and how many columns that takes. Matrices turn the body's axes into the
#: base's, row by row or column by column; of three angles the letters tell the axes in the order in which they are
#: listed, small ones those of the base, capital ones those of the body: rpy = xyz, A B C of KUKA = ZYX.
ROTATIONS = {"quaternion_xyzw": 4, "quaternion_wxyz": 4, "rpy": 3, "rotation_vector": 3, "matrix_rows": 9,
             "matrix_columns": 9, "transform_rows": 16, "transform_columns": 16,
             **{f"euler_{order}": 3 for order in ("ZYX", "XYZ", "ZYZ", "XZY", "YXZ", "YZX", "ZXY", "ZXZ",
                                                  "zyx", "xyz", "zyz", "xzy", "yxz", "yzx", "zxy", "zxz")}}  # fmt: skip


@dataclass(frozen=True)
class Column:
    """Where a column of the recording comes from: SI = sign x scale x (value in `unit`, as SI) + offset.

    unwrap: an angle that jumps by whole turns is made continuous.
    """

    source: str
    unit: Unit
    sign: int = 1
    scale: float = 1.0
    offset: float = 0.0
    unwrap: bool = False


@dataclass(frozen=True)
class Clock:
    """The time of a stream: a column of it, or None for the stamps that the format gives; delay [s] is taken off.

    rate [1/s]: where nothing tells the time, rows come so many a second. like: or row by row with another stream.
    """

    source: str | None
    unit: Unit
    delay: float = 0.0
    rate: float | None = None
    like: str | None = None


@dataclass(frozen=True)
class Orientation:
    """An orientation by several columns, `manner` a key of ROTATIONS; angles of rpy in `unit`."""

    sources: tuple[str, ...]
    manner: str
    unit: Unit


@dataclass(frozen=True, eq=False)
class Motors:
    """Joints that several motors move: positions of the joints = matrix x positions of the motors."""

    names: tuple[str, ...]
    joints: tuple[str, ...]
    matrix: np.ndarray


@dataclass(frozen=True)
class Resampling:
    """One clock for all: an even one of `rate` [1/s], or the stamps of a stream; neither: rows stay as they are."""

    rate: float | None = None
    clock: str | None = None

    @property
    def as_they_are(self) -> bool:
        """Whether rows stay as they are."""
        return self.rate is None and self.clock is None


@dataclass(frozen=True, eq=False)
class LogMap:
    """A map, checked against its log: columns of the recording by name, clocks by stream.

    at_rest: rows in which a joint moves are left out. noise: standard deviations of the sensors, where they are known.
    """

    columns: Mapping[str, Column]
    clocks: Mapping[str, Clock]
    rotations: Mapping[str, Orientation] = field(default_factory=dict)
    motors: tuple[Motors, ...] = ()
    resampling: Resampling = field(default_factory=Resampling)
    robot: str | None = None
    notes: str = ""
    tolerances: Tolerances = field(default_factory=Tolerances)
    at_rest: bool = False
    noise: Noise = field(default_factory=Noise)

    @property
    def measured(self) -> frozenset[str]:
        """The log's columns of what was measured."""
        turns = (name for rotation in self.rotations.values() for name in rotation.sources)
        return frozenset((*(column.source for column in self.columns.values()), *turns))

    @property
    def sources(self) -> frozenset[str]:
        """The log's columns that are used, times among them."""
        return self.measured | {clock.source for clock in self.clocks.values() if clock.source is not None}


# -- the robot ---------------------------------------------------------------------------------------------------------


def driven(robot: Mechanism) -> list[str]:
    """Return the joints that have motors and one coordinate: no floating base."""
    several = {joint.name for joint in robot.joints if joint.nq > 2}  # an endless one has cosine and sine
    return [name for name in robot.actuated if name not in several]


# -- YAML --------------------------------------------------------------------------------------------------------------


#: What a map may hold.
KEYS = ("robot", "time", "columns", "rotations", "motors", "resample", "at_rest", "noise", "tolerances", "notes")
#: What stands before the doubt of a line that was guessed.
CHECK = "# CHECK: "
#: A map of a thousand columns has a tenth of these characters.
_LONGEST = 1_000_000
_TOO_DEEP = "nests its values too deep"


class _Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc] # the fast one, where there is one
    """Reads 2e-5 as a number, which YAML 1.1 takes for a text."""


_EXPONENT = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+$")
_Loader.add_implicit_resolver("tag:yaml.org,2002:float", _EXPONENT, list("-+.0123456789"))


def load_yaml(path: Path, problems: Problems) -> tuple[dict[str, Any], dict[str, int]]:
    """Return the content of a map's YAML file, an object, and the line of each key. Raises RecordingFileError."""
    text = read_bytes(path, "a map (YAML)", (".yaml", ".yml")).decode("utf-8-sig", "replace")

    def refused(message: str, mark: Any = None) -> RecordingFileError:
        return problems.error(KeyProblem(message, mark.line + 1 if mark is not None else None, path.name))

    if len(text) > _LONGEST:
        raise refused(f"holds {len(text)} characters; no map has more than {_LONGEST}")
    content: Any = None
    try:
        depth = 0
        for event in yaml.parse(text, _Loader):
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            if isinstance(event, yaml.AliasEvent):  # a few are a value of any size, or one that holds itself
                raise refused(f"*{shown(event.anchor)} is not read; write the value out", event.start_mark)
            if depth > 20:
                raise refused(_TOO_DEEP, event.start_mark)
        loader = _Loader(text)
        node = loader.get_single_node()
        content = loader.construct_document(node) if node is not None else None
    except yaml.YAMLError as error:
        what = getattr(error, "problem", None) or str(error)
        # A newer libyaml counts how deep brackets stand before it tells the first of them.
        wrong = _TOO_DEEP if "maximum nesting" in what else f"is not valid YAML: {shown(what)}"
        raise refused(wrong, getattr(error, "problem_mark", None)) from None
    except (ValueError, TypeError, AttributeError, LookupError) as error:  # a date that is none, a number of digits
        raise refused(f"holds a value that cannot be read: {shown(error)}") from None
    if not isinstance(content, dict):
        message = f"holds {json_kind(content)}; expected keys: {', '.join(KEYS)}"
        raise problems.error(KeyProblem(message, 1, path.name))
    lines: dict[str, int] = {}

    def walk(item: Any, place: str) -> None:
        pairs = item.value if isinstance(item, yaml.MappingNode) else ()
        named = [(key.value, key.start_mark, value) for key, value in pairs]
        if isinstance(item, yaml.SequenceNode):
            named = [(f"[{k}]", value.start_mark, value) for k, value in enumerate(item.value)]
        for name, mark, value in named:
            inner = _Reader.joined(place, name)
            lines[inner] = mark.line + 1
            walk(value, inner)

    walk(node, "")
    return content, lines


# -- the file ----------------------------------------------------------------------------------------------------------


#: Prefix of a joint's column -> what it measures, of joints that turn and of joints that slide.
JOINT_DIMENSIONS = {
    "q": ("angle", "length"),
    "qd": ("angular velocity", "velocity"),
    "qdd": ("angular acceleration", "acceleration"),
    "tau": ("moment", "force"),
}
_SECONDS = Unit("s", 1.0)


def robot_named(path: str | Path) -> str | None:
    """Return the robot that a map names, None where it names none; a path is beside the map, if it is there.

    Raises RecordingFileError for what is no map.
    """
    path = Path(path)
    named = load_yaml(path, Problems(path))[0].get("robot")
    return named_beside(named, path) if isinstance(named, str) else None


def unanswered(path: str | Path) -> list[Problem]:
    """Return the lines of a map that still ask to be looked at, each with what is not sure of it.

    A line is answered when the word is gone from it, with the line or without. Raises RecordingFileError for what is
    no map.
    """
    path = Path(path)
    load_yaml(path, Problems(path))
    text = path.read_text(encoding="utf-8-sig", errors="replace")
    ends: dict[int, int] = {}  # of each line's last value: what follows it is a comment
    for token in yaml.scan(text, _Loader):
        ends[token.end_mark.line] = max(ends.get(token.end_mark.line, 0), token.end_mark.column)
    found = []
    for number, line in enumerate(text.split("\n")):
        _, asked, doubt = line[ends.get(number, 0) :].partition(CHECK)
        if asked:
            key = line[: line.rindex(CHECK)].partition(": {")[0].strip(" #'\"")
            found.append(Problem(f"{key}: {doubt.strip()}" if key else doubt.strip(), number + 1, path.name))
    return found


def read_map(path: str | Path, log: Log, mechanism: Mechanism | None = None) -> LogMap:
    """Return a map for a log. Raises RecordingFileError with all that is wrong with it, each with its line and key.

    mechanism: the robot whose joints and frames the names have to be; None where it is not known.
    """
    path = Path(path)
    problems = Problems(path)
    content, lines = load_yaml(path, problems)
    found = _Reader(problems, lines, log, mechanism).map(content)
    problems.raise_all()
    return found


class _Reader(ValueReader):
    """Reads a map; what is wrong is collected, each with its line."""

    between = ": "

    def __init__(self, problems: Problems, lines: Mapping[str, int], log: Log, mechanism: Mechanism | None):
        super().__init__(problems, lines=lines)
        self.log, self.mechanism = log, mechanism
        self.slides = {} if mechanism is None else {joint.name: joint.slides for joint in mechanism.joints}

    def known(self, value: Any, key: str, *allowed: str) -> dict[str, Any]:
        """Return an object whose keys are allowed; {} of none at all, and after reporting."""
        return {} if value is None else self.entries(value, key, allowed)

    def source(self, name: Any, key: str) -> str:
        """Return the name of one of the log's columns, '' after reporting."""
        if name in self.log.names:
            return str(name)
        if name is None:
            self.wrong(key, "lacks `from`, the name of a column of the log")
        else:
            near = nearest_names(str(name), self.log.names)
            self.wrong(key, f"the log has no column '{shown(name)}'. {near}")
        return ""

    def unit(self, text: Any, dimensions: tuple[str, ...], key: str) -> Unit:
        unit = unit_for(str(text), dimensions)
        if unit is None:
            given = "is missing" if text is None else f"'{shown(text)}' is no unit of it"
            self.wrong(f"{key}: unit", f"{given}; expected {units_in_words(dimensions)}")
        return unit or Unit("?", 1.0)

    def map(self, content: Mapping[str, Any]) -> LogMap:
        self.entries(content, "", KEYS)
        tolerances = tolerances_of(self, content.get("tolerances"), "tolerances")
        noise = noise_of(self, self.known(content.get("noise"), "noise", *NOISE_KEYS))
        clocks = self.clocks(content.get("time"))
        listed = content.get("motors") or []
        motors = [
            group
            for k, item in enumerate(self.items(listed, "motors", "groups of motors") if listed else [])
            if (group := self.motors(item, f"motors: [{k}]")) is not None
        ]
        moved = {name for group in motors for name in group.names}
        columns: dict[str, Column] = {}
        given = content.get("columns")
        if not isinstance(given, dict) or not given:
            self.wrong("columns", "is missing or empty; expected lines such as `q.elbow: {from: NAME, unit: rad}`")
            given = {}
        for name, item in given.items():
            column = self.column(str(name), item, moved, tolerances.effort_gain is not None)
            if column is not None:
                columns[str(name)] = column
        for group in motors:
            self.complete(group, columns)
        turned = self.known(content.get("rotations"), "rotations").items()
        read = {str(name): self.rotation(str(name), item) for name, item in turned}
        rotations = {name: rotation for name, rotation in read.items() if rotation is not None}
        if given and not any(name.startswith("q.") for name in columns):
            self.wrong("columns", "has no position of any joint; expected one line q.<joint> at least")
        robot, notes = self.text(content.get("robot"), "robot"), self.text(content.get("notes"), "notes")
        resampling = self.resampling(content.get("resample"), columns, rotations)
        at_rest = self.flag(content.get("at_rest", False), "at_rest")
        named = robot and named_beside(robot, self.problems.path)
        return LogMap(
            columns, clocks, rotations, tuple(motors), resampling, named, notes or "", tolerances, at_rest, noise
        )

    def clocks(self, given: Any) -> dict[str, Clock]:
        """Return the clock of each stream; a log of one stream may leave its name out."""
        names = [stream.name for stream in self.log.streams]
        plain = isinstance(given, dict) and bool(given) and set(given) <= {"from", "unit", "delay", "rate", "like"}
        if plain and len(names) > 1:
            self.wrong("time", f"needs the name of each stream: {', '.join(names)}")
            return {}
        listed = {names[0]: given} if plain else self.known(given, "time", *names)
        out = {}
        for stream in self.log.streams:
            key = "time" if plain else self.joined("time", stream.name)
            clock = None if stream.clock is None else Clock(None, _SECONDS)
            if stream.name in listed:
                clock = self.clock(stream, listed[stream.name], key)
            if clock is not None:
                out[stream.name] = clock
        if not out and not len(self.problems):
            self.wrong("time", "is missing; expected `{from: NAME, unit: s}`, the column that is the time")
        return out

    def clock(self, stream: Stream, item: Any, key: str) -> Clock | None:
        """Return the clock of one stream, None after reporting."""
        given = self.known(item, key, "from", "unit", "delay", "rate", "like")
        if "like" in given:
            other = next((each for each in self.log.streams if each.name == given["like"] != stream.name), None)
            if other is None or len(other) != len(stream) or set(given) != {"like"}:
                message = f"expected another stream of {len(stream)} rows, and nothing beside it"
                self.wrong(f"{key}: like", message)
                return None
            return Clock(None, _SECONDS, like=other.name)
        rate = self.number(given["rate"], f"{key}: rate") if "rate" in given else None
        if rate is not None and (rate <= 0 or "from" in given):
            self.wrong(f"{key}: rate", "expected a number of rows a second, above 0, and no `from` beside it")
            return None
        delay = self.number(given.get("delay", 0.0), f"{key}: delay")
        if rate is not None or (given.get("from") is None and stream.clock is not None):
            return Clock(None, _SECONDS, delay, rate)
        source = self.source(given.get("from"), key)
        unit = self.unit(given.get("unit", "s"), ("time",), key)
        if source and self.log.stream_of(source).name != stream.name:
            self.wrong(key, f"'{source}' is a column of {self.log.stream_of(source).name}")
            return None
        return Clock(source, unit, delay) if source else None

    def dimensions(self, name: str, moved: set[str]) -> tuple[str, ...]:
        """Return what a column of the recording measures; () after reporting a name that is none."""
        key, prefix = f"columns: {shown(name)}", name.partition(".")[0]
        if joint := joint_of(name):
            both = JOINT_DIMENSIONS[prefix]
            if joint[1] in self.slides and joint[1] not in moved:
                return (both[self.slides[joint[1]]],)
            if self.mechanism is not None and joint[1] not in moved:
                near = nearest_names(joint[1], self.mechanism.actuated)
                self.wrong(key, f"the robot has no joint '{joint[1]}'. {near}")
            return both
        if marker := marker_of(name):
            frames = self.mechanism.frame_names if self.mechanism is not None else (marker[1],)
            if marker[1] not in frames:
                self.wrong(key, f"the robot has no frame '{marker[1]}'. {nearest_names(marker[1], frames)}")
            return ("length",) if marker[0] == "markers" else ("angle",)
        if name == "time":
            self.wrong(key, "is told under the key `time`, not among the columns")
            return ()
        if name not in COLUMNS:
            valid = [*COLUMNS, *(f"{prefix}.<joint>" for prefix in JOINT_DIMENSIONS), "p.<frame>.x"]
            self.wrong(key, f"is no column of a recording. {nearest_names(name, valid)}")
            return ()
        fixed = {"p": "length", "r": "angle", "g": "acceleration", "temperature": "temperature", "run": "label"}
        return (fixed.get(prefix) or {"f": "force", "m": "moment"}[name[2]],)

    def column(self, name: str, item: Any, moved: set[str], gains_open: bool) -> Column | None:
        """Return where a column comes from, None after reporting; gains_open: nobody needs to know those of efforts."""
        key, dimensions = f"columns: {shown(name)}", self.dimensions(name, moved)
        item = {"from": item} if isinstance(item, str) else item
        given = self.known(item, key, "from", "unit", "sign", "scale", "offset", "unwrap")
        source = self.source(given.get("from"), key)
        if not dimensions or not source:
            return None
        unit = Unit("1" if dimensions == ("label",) else "SI", 1.0)
        if "unit" in given:
            unit = self.unit(given["unit"], dimensions, key)
        effort = name.startswith("tau.")
        if unit.needs_scale and "scale" not in given and not (effort and gains_open):
            how = ", or `tolerances: {effort_gain: 1}` where nobody knows" * effort
            self.wrong(key, f"a unit '{unit.name}' needs a `scale`: how much SI is one {unit.name}{how}")
        sign = given.get("sign", 1)
        if sign not in (1, -1) or isinstance(sign, bool):
            self.wrong(f"{key}: sign", f"is {json_kind(sign)}; expected 1 or -1")
            sign = 1
        scale = self.number(given.get("scale", 1.0), f"{key}: scale")
        if scale == 0 and given.get("scale") == 0:
            self.wrong(f"{key}: scale", "is 0: nothing would be left")
        offset = self.number(given.get("offset", 0.0), f"{key}: offset")
        unwrap = self.flag(given.get("unwrap", False), f"{key}: unwrap")
        return Column(source, unit, int(sign), scale, offset, unwrap)

    def rotation(self, name: str, item: Any) -> Orientation | None:
        """Return how a body is turned, None after reporting."""
        key = f"rotations: {shown(name)}"
        given = self.known(item, key, "from", "as", "unit")
        prefix, _, body = name.partition(".")
        if prefix != "r" or (body and self.mechanism is not None and body not in self.mechanism.frame_names):
            self.wrong(key, "is no orientation; expected r (the tool's) or r.<frame>")
            return None
        manner = given.get("as")
        if not isinstance(manner, str) or manner not in ROTATIONS:
            plain = [name for name in ROTATIONS if not name.startswith("euler")]
            self.wrong(f"{key}: as", f"is '{shown(manner)}'; expected one of {', '.join(plain)}, euler_ZYX …")
            return None
        names, count = given.get("from"), ROTATIONS[manner]
        if not isinstance(names, list) or len(names) != count:
            self.wrong(f"{key}: from", f"expected a list of {count} columns of the log")
            return None
        sources = tuple(self.source(source, f"{key}: from") for source in names)
        unit = self.unit(given.get("unit", "rad"), ("angle",), key) if count == 3 else Unit("1", 1.0)
        return Orientation(sources, manner, unit) if all(sources) else None

    def motors(self, item: Any, key: str) -> Motors | None:
        """Return motors that move joints together, None after reporting."""
        given = self.known(item, key, "names", "joints", "matrix")
        for name in ("names", "joints"):
            value = given.get(name)
            if not isinstance(value, list) or not all(isinstance(word, str) for word in value):
                self.wrong(f"{key}: {name}", "expected a list of names")
                return None
        names, joints = tuple(given["names"]), tuple(given["joints"])
        try:
            matrix = np.array(given.get("matrix"), float)
        except (TypeError, ValueError):
            matrix = np.zeros(0)
        n = len(joints)
        if matrix.shape != (n, len(names)) or len(names) != n or not np.isfinite(matrix).all():
            self.wrong(f"{key}: matrix", f"expected {n} rows of {n} numbers: joint = matrix x motor")
            return None
        if abs(np.linalg.det(matrix / max(np.abs(matrix).max(), 1e-300))) < 1e-9:
            self.wrong(f"{key}: matrix", "has no inverse: several motors would do the same")
            return None
        driven = self.mechanism.actuated if self.mechanism is not None else joints
        for joint in joints:
            if joint not in driven:
                near = nearest_names(joint, driven)
                self.wrong(f"{key}: joints", f"the robot has no actuated joint '{joint}'. {near}")
        return Motors(names, joints, matrix)

    def complete(self, group: Motors, columns: Mapping[str, Column]) -> None:
        """A joint's value needs that of every motor of its group."""
        for prefix in JOINT_DIMENSIONS:
            there = [name for name in group.names if f"{prefix}.{name}" in columns]
            if there and len(there) < len(group.names):
                lacking = [f"{prefix}.{name}" for name in group.names if name not in there]
                self.wrong("columns", f"lacks {', '.join(lacking)}, which the motors of {', '.join(group.joints)} need")
            for joint in group.joints:
                if there and f"{prefix}.{joint}" in columns and joint not in group.names:
                    self.wrong(f"columns: {prefix}.{joint}", "comes from its motors already")

    def resampling(self, given: Any, columns: Mapping[str, Column], rotations: Mapping[str, Orientation]) -> Resampling:
        sources = [column.source for column in columns.values()]
        sources += [name for rotation in rotations.values() for name in rotation.sources]
        used = {self.log.stream_of(name).name for name in sources}
        key = "resample"
        if given is None:
            if len(used) > 1:
                how = "expected `resample: {clock: NAME}` or `resample: {rate: 250}`"
                self.wrong(key, f"the columns come on {len(used)} clocks ({', '.join(sorted(used))}); {how}")
            return Resampling()
        item, names = self.known(given, key, "rate", "clock"), [stream.name for stream in self.log.streams]
        if len(item) != 1:
            self.wrong(key, "expected either `rate`, in samples a second, or `clock`, the name of a stream")
        elif "rate" in item:
            return Resampling(rate=self.number(item["rate"], f"{key}: rate", "1/s", 0.0, above=True))
        elif "clock" in item and item["clock"] not in names:
            near = nearest_names(str(item["clock"]), names)
            self.wrong(f"{key}: clock", f"the log has no stream '{shown(item['clock'])}'. {near}")
        return Resampling(clock=item.get("clock"))
