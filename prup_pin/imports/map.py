"""The map from a log to a recording: which column is which joint, in which unit, on which clock; and its file.

A file is checked against its log and its robot: all that is wrong with it is told, each with its line and key.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from ..errors import Problem, nearest_names
from ..files import named_beside
from ..mechanism import Mechanism
from ..recordings import Noise, Tolerances
from ..recordings.beside import noise_of, tolerances_of
from ..recordings.columns import NOISE_KEYS, joint_of, marker_of
from ..recordings.columns import UNITS as COLUMNS
from ..recordings.problems import KeyProblem, KeyReader, Problems, is_number, json_kind, read_bytes, shown
from .log import Log
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
class Rotation:
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


@dataclass(frozen=True, eq=False)
class LogMap:
    """A map, checked against its log: columns of the recording by name, clocks by stream.

    at_rest: rows in which a joint moves are left out. noise: standard deviations of the sensors, where they are known.
    """

    columns: Mapping[str, Column]
    clocks: Mapping[str, Clock]
    rotations: Mapping[str, Rotation] = field(default_factory=dict)
    motors: tuple[Motors, ...] = ()
    resampling: Resampling = field(default_factory=Resampling)
    robot: str | None = None
    notes: str = ""
    tolerances: Tolerances = field(default_factory=Tolerances)
    at_rest: bool = False
    noise: Noise = field(default_factory=Noise)

    @property
    def sources(self) -> frozenset[str]:
        """The log's columns that are used."""
        used = {column.source for column in self.columns.values()}
        used |= {clock.source for clock in self.clocks.values() if clock.source is not None}
        return frozenset(used | {name for rotation in self.rotations.values() for name in rotation.sources})


# -- the robot ---------------------------------------------------------------------------------------------------------


def driven(robot: Mechanism) -> list[str]:
    """Return the joints that have motors and one coordinate: no floating base."""
    several = {joint.name for joint in robot.joints if joint.nq > 2}  # an endless one has cosine and sine
    return [name for name in robot.actuated if name not in several]


# -- YAML --------------------------------------------------------------------------------------------------------------


#: A map of a thousand columns has a tenth of these characters.
_LONGEST = 1_000_000
#: Values within values.
_DEEPEST = 20


class _Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc] # the fast one, where there is one
    """Reads 2e-5 as a number, which YAML 1.1 takes for a text."""


_EXPONENT = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+$")
_Loader.add_implicit_resolver("tag:yaml.org,2002:float", _EXPONENT, list("-+.0123456789"))


def load_yaml(path: Path, problems: Problems, keys: Sequence[str]) -> tuple[dict[str, Any], dict[tuple, int]]:
    """Return the content of a map's YAML file, an object of `keys`, and the line of each key."""
    text = read_bytes(path, "a map (YAML)", (".yaml", ".yml")).decode("utf-8-sig", "replace")
    if len(text) > _LONGEST:
        problems.add(KeyProblem(f"holds {len(text)} characters; no map has more than {_LONGEST}", None, path.name))
        return {}, {}
    content: Any = None
    try:
        depth = 0
        for event in yaml.parse(text, _Loader):
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            wrong = "nests its values too deep" if depth > _DEEPEST else ""
            if isinstance(event, yaml.AliasEvent):  # a few are a value of any size, or one that holds itself
                wrong = f"*{shown(event.anchor)} is not read; write the value out"
            if wrong:
                mark = event.start_mark
                problems.add(KeyProblem(wrong, mark.line + 1 if mark is not None else None, path.name))
                return {}, {}
        loader = _Loader(text)
        node = loader.get_single_node()
        content = loader.construct_document(node) if node is not None else None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        what = getattr(error, "problem", None) or str(error)
        line = mark.line + 1 if mark is not None else None
        # A newer libyaml counts how deep brackets stand before it tells the first of them.
        wrong = "nests its values too deep" if "maximum nesting" in what else f"is not valid YAML: {shown(what)}"
        problems.add(KeyProblem(wrong, line, path.name))
        return {}, {}
    except (ValueError, TypeError, AttributeError, LookupError) as error:  # a date that is none, a number of digits
        problems.add(KeyProblem(f"holds a value that cannot be read: {shown(error)}", None, path.name))
        return {}, {}
    if not isinstance(content, dict):
        problems.add(KeyProblem(f"holds {json_kind(content)}; expected keys: {', '.join(keys)}", 1, path.name))
        return {}, {}
    lines: dict[tuple, int] = {}

    def walk(item: Any, place: tuple) -> None:
        if isinstance(item, yaml.MappingNode):
            for key, value in item.value:
                inner = (*place, key.value)
                lines[inner] = key.start_mark.line + 1
                walk(value, inner)
        elif isinstance(item, yaml.SequenceNode):
            for k, value in enumerate(item.value):
                inner = (*place, f"[{k}]")
                lines[inner] = value.start_mark.line + 1
                walk(value, inner)

    walk(node, ())
    return content, lines


# -- the file ----------------------------------------------------------------------------------------------------------


#: Prefix of a joint's column -> what it measures, of joints that turn and of joints that slide.
JOINT_DIMENSIONS = {
    "q": ("angle", "length"),
    "qd": ("angular velocity", "velocity"),
    "qdd": ("angular acceleration", "acceleration"),
    "tau": ("moment", "force"),
}
#: What a map may hold.
KEYS = ("robot", "time", "columns", "rotations", "motors", "resample", "at_rest", "noise", "tolerances", "notes")


def robot_named(path: str | Path) -> str | None:
    """Return the robot that a map names, None where it names none; a path is beside the map, if it is there.

    Raises RecordingFileError for what is no map.
    """
    path = Path(path)
    problems = Problems(path)
    content, _ = load_yaml(path, problems, KEYS)
    problems.raise_all()
    named = content.get("robot")
    return named_beside(named, path) if isinstance(named, str) else None


#: What stands before the doubt of a line that was guessed.
CHECK = "# CHECK: "


def unanswered(path: str | Path) -> list[Problem]:
    """Return the lines of a map that still ask to be looked at, each with what is not sure of it.

    A line is answered when the word is gone from it, with the line or without. Raises RecordingFileError for what is
    no map.
    """
    path = Path(path)
    problems = Problems(path)
    load_yaml(path, problems, KEYS)
    problems.raise_all()
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
    content, lines = load_yaml(path, problems, KEYS)
    problems.raise_all()
    reader = _Reader(problems, lines, log, mechanism)
    found = reader.whole(content)
    problems.raise_all()
    return found


class _Reader:
    """Reads a map; what is wrong is collected, each with its line."""

    def __init__(self, problems: Problems, lines: Mapping[tuple, int], log: Log, mechanism: Mechanism | None):
        self.problems, self.lines = problems, lines
        self.log, self.mechanism = log, mechanism
        self.gains_open = False

    def wrong(self, message: str, *place: str) -> None:
        """Note what is wrong with a key, or with its value."""
        self.problems.add(KeyProblem(message, self.lines.get(place), key=": ".join(map(str, place))))

    def known(self, given: Any, keys: Sequence[str], *place: str) -> dict[str, Any]:
        """Return an object whose keys are known ones; what is none is a problem and gives {}."""
        if given is None:
            return {}
        if not isinstance(given, dict):
            self.wrong(f"is {json_kind(given)}; expected keys: {', '.join(keys)}", *place)
            return {}
        for key in given:
            if key not in keys:
                self.wrong(f"is no key here. {nearest_names(str(key), list(keys))}", *place, str(key))
        return given

    def number(self, given: Mapping[str, Any], key: str, fallback: float, *place: str) -> float:
        """Return a number, the fallback where there is none; a value that is no number is a problem."""
        value = given.get(key, fallback)
        if not is_number(value):
            self.wrong(f"is {json_kind(value)}; expected a number", *place, key)
            return fallback
        return float(value)

    def source(self, name: Any, *place: str) -> str | None:
        """Return a name of one of the log's columns."""
        if name in self.log.names:
            return str(name)
        if name is None:
            self.wrong("lacks `from`, the name of a column of the log", *place)
        else:
            self.wrong(f"the log has no column '{shown(name)}'. {nearest_names(str(name), self.log.names)}", *place)
        return None

    def unit(self, text: Any, dimensions: tuple[str, ...], *place: str) -> Unit:
        unit = unit_for(str(text), dimensions)
        if unit is None:
            given = f"'{shown(text)}' is no unit of it" if text is not None else "is missing"
            self.wrong(f"{given}; expected {units_in_words(dimensions)}", *place, "unit")
            return Unit("?", 1.0)
        return unit

    def whole(self, content: Mapping[str, Any]) -> LogMap:
        given = self.known(content, KEYS)
        keys, tolerances = KeyReader(self.problems), Tolerances()
        if given.get("tolerances") is not None:
            tolerances = tolerances_of(keys, given["tolerances"], "tolerances")
        noise = noise_of(keys, self.known(given.get("noise"), tuple(NOISE_KEYS), "noise"))
        self.gains_open = tolerances.effort_gain is not None
        clocks = self.clocks(given.get("time"))
        raw = given.get("motors") or []
        if not isinstance(raw, list):
            self.wrong(f"is {json_kind(raw)}; expected a list", "motors")
            raw = []
        motors = tuple(m for k, item in enumerate(raw) if (m := self.motors(item, k)) is not None)
        moved = {name for group in motors for name in group.names}
        columns: dict[str, Column] = {}
        listed = given.get("columns")
        if not isinstance(listed, dict) or not listed:
            self.wrong("is missing or empty; expected lines such as `q.elbow: {from: NAME, unit: rad}`", "columns")
            listed = {}
        for name, item in listed.items():
            column = self.column(str(name), item, moved)
            if column is not None:
                columns[str(name)] = column
        for group in motors:
            self.complete(group, columns)
        rotations = {}
        turned = given.get("rotations")
        for name, item in self.known(turned, list(turned) if isinstance(turned, dict) else (), "rotations").items():
            rotation = self.rotation(str(name), item)
            if rotation is not None:
                rotations[str(name)] = rotation
        if not any(name.startswith("q.") for name in columns) and listed:
            self.wrong("has no position of any joint; expected one line q.<joint> at least", "columns")
        texts = {key: given.get(key) for key in ("robot", "notes")}
        for key, value in texts.items():
            if value is not None and not isinstance(value, str):
                self.wrong(f"is {json_kind(value)}; expected a text", key)
        resampling = self.resampling(given.get("resample"), columns, rotations)
        named = texts["robot"] and named_beside(str(texts["robot"]), self.problems.path)
        rest = given.get("at_rest", False)
        if not isinstance(rest, bool):
            self.wrong(f"is {json_kind(rest)}; expected true or false", "at_rest")
        return LogMap(
            columns, clocks, rotations, motors, resampling, named, texts["notes"] or "", tolerances, rest,
            noise,
        )  # fmt: skip

    def clocks(self, given: Any) -> dict[str, Clock]:
        """Return the clock of each stream; a log of one stream may leave its name out."""
        names = [stream.name for stream in self.log.streams]
        if given is None and all(stream.clock is not None for stream in self.log.streams):
            given = {name: {} for name in names}
        keys = ("from", "unit", "delay", "rate", "like")
        plain = isinstance(given, dict) and set(given) <= set(keys) and bool(given)
        if plain and len(names) > 1:
            self.wrong(f"needs the name of each stream: {', '.join(names)}", "time")
            return {}
        listed = {names[0]: given} if plain else self.known(given, names, "time")
        out = {}
        for name in names:
            place = ("time",) if plain else ("time", name)
            stream = next(stream for stream in self.log.streams if stream.name == name)
            if name not in listed:
                if stream.clock is not None:
                    out[name] = Clock(None, Unit("s", 1.0))
                continue
            item = self.known(listed[name], keys, *place)
            if "like" in item:
                other = next((each for each in self.log.streams if each.name == item["like"] != name), None)
                if other is None or len(other) != len(stream) or set(item) != {"like"}:
                    message = f"expected another stream of {len(stream)} rows, and nothing beside it"
                    self.wrong(message, *place, "like")
                else:
                    out[name] = Clock(None, Unit("s", 1.0), like=other.name)
                continue
            rate = self.number(item, "rate", 1.0, *place) if "rate" in item else None
            if rate is not None and (rate <= 0 or "from" in item):
                self.wrong("expected a number of rows a second, above 0, and no `from` beside it", *place, "rate")
                continue
            if rate is not None or (item.get("from") is None and stream.clock is not None):
                source, unit = None, Unit("s", 1.0)
            else:
                source = self.source(item.get("from"), *place)
                unit = self.unit(item.get("unit", "s"), ("time",), *place)
                if source is not None and self.log.stream_of(source).name != name:
                    self.wrong(f"'{source}' is a column of {self.log.stream_of(source).name}", *place)
                    source = None
                if source is None:
                    continue
            out[name] = Clock(source, unit, self.number(item, "delay", 0.0, *place), rate)
        if not out and not len(self.problems):
            self.wrong("is missing; expected `{from: NAME, unit: s}`, the column that is the time", "time")
        return out

    def dimensions(self, name: str, moved: set[str]) -> tuple[str, ...] | None:
        """Return what a column of the recording measures; a name that is none is a problem."""
        joint = joint_of(name)
        if joint is not None:
            return self.joint_dimensions(name, joint[1], moved)
        marker = marker_of(name)
        if marker is not None:
            frames = self.mechanism.frame_names if self.mechanism is not None else None
            if frames is not None and marker[1] not in frames:
                self.wrong(f"the robot has no frame '{marker[1]}'. {nearest_names(marker[1], frames)}", "columns", name)
            return ("length",) if marker[0] == "markers" else ("angle",)
        if name == "time":
            self.wrong("is told under the key `time`, not among the columns", "columns", name)
            return None
        if name not in COLUMNS:
            valid = [*COLUMNS, *(f"{prefix}.<joint>" for prefix in JOINT_DIMENSIONS), "p.<frame>.x"]
            self.wrong(f"is no column of a recording. {nearest_names(name, valid)}", "columns", name)
            return None
        return {
            "w.f": ("force",), "w.m": ("moment",), "p": ("length",), "r": ("angle",), "g": ("acceleration",),
            "temperature": ("temperature",), "run": ("label",),
        }[name[:3] if name.startswith("w.") else name.partition(".")[0]]  # fmt: skip

    def joint_dimensions(self, name: str, joint: str, moved: set[str]) -> tuple[str, ...]:
        turning, sliding = JOINT_DIMENSIONS[name.partition(".")[0]]
        if joint in moved or self.mechanism is None:
            return turning, sliding
        known = {item.name: item for item in self.mechanism.joints}
        if joint not in known:
            near = nearest_names(joint, self.mechanism.actuated)
            self.wrong(f"the robot has no joint '{joint}'. {near}", "columns", name)
            return turning, sliding
        return (sliding,) if known[joint].slides else (turning,)

    def column(self, name: str, item: Any, moved: set[str]) -> Column | None:
        place = ("columns", name)
        if isinstance(item, str):
            item = {"from": item}
        dimensions = self.dimensions(name, moved)
        keys = ("from", "unit", "sign", "scale", "offset", "unwrap")
        given = self.known(item, keys, *place)
        source = self.source(given.get("from"), *place)
        if dimensions is None or source is None:
            return None
        if "unit" in given:
            unit = self.unit(given["unit"], dimensions, *place)
        else:
            unit = Unit({"label": "1"}.get(dimensions[0], "SI"), 1.0)
        effort = name.startswith("tau.")
        if unit.needs_scale and "scale" not in given and not (effort and self.gains_open):
            how = ", or `tolerances: {effort_gain: 1}` where nobody knows" * effort
            self.wrong(f"a unit '{unit.name}' needs a `scale`: how much SI is one {unit.name}{how}", *place)
        sign = given.get("sign", 1)
        if sign not in (1, -1) or isinstance(sign, bool):
            self.wrong(f"is {json_kind(sign)}; expected 1 or -1", *place, "sign")
            sign = 1
        scale = self.number(given, "scale", 1.0, *place)
        if scale == 0:
            self.wrong("is 0: nothing would be left", *place, "scale")
        unwrap = given.get("unwrap", False)
        if not isinstance(unwrap, bool):
            self.wrong(f"is {json_kind(unwrap)}; expected true or false", *place, "unwrap")
            unwrap = False
        return Column(source, unit, int(sign), scale, self.number(given, "offset", 0.0, *place), unwrap)

    def rotation(self, name: str, item: Any) -> Rotation | None:
        place = ("rotations", name)
        given = self.known(item, ("from", "as", "unit"), *place)
        frames = ("", *(self.mechanism.frame_names if self.mechanism is not None else ()))
        body = name.removeprefix("r").removeprefix(".")
        if name.partition(".")[0] != "r" or (self.mechanism is not None and body not in frames):
            self.wrong("is no orientation; expected r (the tool's) or r.<frame>", *place)
            return None
        manner = given.get("as")
        if not isinstance(manner, str) or manner not in ROTATIONS:
            plain = [name for name in ROTATIONS if not name.startswith("euler")]
            self.wrong(f"is '{shown(manner)}'; expected one of {', '.join(plain)}, euler_ZYX …", *place, "as")
            return None
        names = given.get("from")
        if not isinstance(names, list) or len(names) != ROTATIONS[manner]:
            self.wrong(f"expected a list of {ROTATIONS[manner]} columns of the log", *place, "from")
            return None
        sources = [self.source(source, *place, "from") for source in names]
        angles = ROTATIONS[manner] == 3
        unit = self.unit(given.get("unit", "rad"), ("angle",), *place) if angles else Unit("1", 1.0)
        return Rotation(tuple(s for s in sources if s), manner, unit) if all(sources) else None

    def motors(self, item: Any, k: int) -> Motors | None:
        place = ("motors", f"[{k}]")
        given = self.known(item, ("names", "joints", "matrix"), *place)
        for key in ("names", "joints"):
            value = given.get(key)
            if not isinstance(value, list) or not all(isinstance(word, str) for word in value):
                self.wrong("expected a list of names", *place, key)
                return None
        names, joints = tuple(given["names"]), tuple(given["joints"])
        try:
            matrix = np.array(given.get("matrix"), float)
        except (TypeError, ValueError):
            matrix = np.zeros(0)
        n = len(joints)
        if matrix.shape != (n, len(names)) or len(names) != n or not np.isfinite(matrix).all():
            self.wrong(f"expected {n} rows of {n} numbers: joint = matrix x motor", *place, "matrix")
            return None
        if abs(np.linalg.det(matrix / max(np.abs(matrix).max(), 1e-300))) < 1e-9:
            self.wrong("has no inverse: several motors would do the same", *place, "matrix")
            return None
        driven = self.mechanism.actuated if self.mechanism is not None else joints
        for joint in joints:
            if joint not in driven:
                near = nearest_names(joint, driven)
                self.wrong(f"the robot has no actuated joint '{joint}'. {near}", *place, "joints")
        return Motors(names, joints, matrix)

    def complete(self, group: Motors, columns: Mapping[str, Column]) -> None:
        """A joint's value needs that of every motor of its group."""
        for prefix in JOINT_DIMENSIONS:
            there = [name for name in group.names if f"{prefix}.{name}" in columns]
            if there and len(there) < len(group.names):
                lacking = [f"{prefix}.{name}" for name in group.names if name not in there]
                self.wrong(f"lacks {', '.join(lacking)}, which the motors of {', '.join(group.joints)} need", "columns")
            for joint in group.joints:
                if there and f"{prefix}.{joint}" in columns and joint not in group.names:
                    self.wrong("comes from its motors already", "columns", f"{prefix}.{joint}")

    def resampling(self, given: Any, columns: Mapping[str, Column], rotations: Mapping[str, Rotation]) -> Resampling:
        used = {self.log.stream_of(column.source).name for column in columns.values()}
        used |= {self.log.stream_of(name).name for rotation in rotations.values() for name in rotation.sources}
        if given is None:
            if len(used) > 1:
                self.wrong(
                    f"the columns come on {len(used)} clocks ({', '.join(sorted(used))}); expected "
                    "`resample: {clock: NAME}` or `resample: {rate: 250}`",
                    "resample",
                )
            return Resampling()
        item = self.known(given, ("rate", "clock"), "resample")
        if len(item) != 1:
            self.wrong("expected either `rate`, in samples a second, or `clock`, the name of a stream", "resample")
            return Resampling()
        if "clock" in item:
            names = [stream.name for stream in self.log.streams]
            if item["clock"] not in names:
                near = nearest_names(str(item["clock"]), names)
                self.wrong(f"the log has no stream '{shown(item['clock'])}'. {near}", "resample", "clock")
                return Resampling()
            return Resampling(clock=item["clock"])
        rate = self.number(item, "rate", 0.0, "resample")
        if rate <= 0:
            self.wrong("expected a number of samples a second, above 0", "resample", "rate")
        return Resampling(rate=rate)
