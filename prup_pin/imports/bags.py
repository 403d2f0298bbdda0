"""Logs as MCAP files and ROS bags: every topic is a stream, every number of its messages a column.

The `rosbags` package knows ROS 1 and 2 messages, `mcap` the container; nothing of ROS is needed.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import imported
from .log import MAX_VECTOR, Log, Stream, frozen, refuse

#: (topic, time of the logger [ns], message)
Message = tuple[str, int, Any]


def read(path: Path) -> Log:
    """Return the topics of a bag. A message's own stamp is its time, the logger's where it has none.

    A JointState's numbers take the names of its joints: /joint_states.position.elbow_joint. Raises MissingExtraError
    without the extra 'bags', RecordingFileError for a file that cannot be read.
    """
    left_out: dict[str, None] = {}
    messages = _from_mcap(path, left_out) if path.suffix.lower() == ".mcap" else _from_rosbag(path, left_out)
    rows: dict[str, list[dict[str, float]]] = {}
    stamps: dict[str, list[int]] = {}
    for topic, logged, message in messages:
        numbers = dict(_numbers(topic, message))
        stamp = _stamp(message)
        stamps.setdefault(topic, []).append(stamp or logged)
        rows.setdefault(topic, []).append(numbers)
    if not rows:
        return Log(str(path), (), tuple(left_out))
    begin = min(min(times) for times in stamps.values())
    streams = []
    for topic, samples in rows.items():
        names = list(dict.fromkeys(name for numbers in samples for name in numbers))
        if not names:
            left_out[f"{topic} (no numbers)"] = None
            continue
        columns = {name: np.array([numbers.get(name, np.nan) for numbers in samples]) for name in names}
        clock = np.array([stamp - begin for stamp in stamps[topic]]) * 1e-9
        order = np.argsort(clock, kind="stable")
        clock = clock[order]
        clock.flags.writeable = False
        ordered = {name: values[order] for name, values in columns.items()}
        streams.append(Stream(topic, frozen(ordered), clock))
    return Log(str(path), tuple(streams), tuple(left_out))


def _from_rosbag(path: Path, left_out: dict[str, None]) -> Iterator[Message]:
    """Yield the messages of a ROS 1 bag, a ROS 2 bag's folder or its database."""
    rosbags = imported("rosbags.highlevel", "bags")
    types = imported("rosbags.typesys", "bags")
    folder = path.parent if path.suffix.lower() == ".db3" else path
    if folder.is_dir() and not (folder / "metadata.yaml").exists():
        raise refuse(path, "is no ROS 2 bag: there is no metadata.yaml in the folder")
    try:
        store = types.get_typestore(types.Stores.LATEST)
        with rosbags.AnyReader([folder], default_typestore=store) as reader:
            known = [c for c in reader.connections if c.msgtype in reader.typestore.types]
            left_out |= {f"{c.topic} ({c.msgtype})": None for c in reader.connections if c not in known}
            for connection, stamp, raw in reader.messages(connections=known) if known else ():
                yield connection.topic, stamp, reader.deserialize(raw, connection.msgtype)
    except rosbags.AnyReaderError as error:
        raise refuse(path, f"cannot be read as a ROS bag: {error}") from error


def _from_mcap(path: Path, left_out: dict[str, None]) -> Iterator[Message]:
    """Yield the messages of an MCAP file: ROS 1, ROS 2 and JSON."""
    container = imported("mcap.reader", "bags")
    problems = imported("mcap.exceptions", "bags")
    decoders: dict[int, Callable[[bytes], Any] | None] = {}
    try:
        with path.open("rb") as file:
            for schema, channel, message in container.make_reader(file).iter_messages():
                if channel.id not in decoders:
                    decoders[channel.id] = _decoder(schema, channel)
                decode = decoders[channel.id]
                if decode is None:
                    left_out[f"{channel.topic} ({channel.message_encoding})"] = None
                else:
                    yield channel.topic, message.log_time, decode(message.data)
    except problems.McapError as error:
        raise refuse(path, f"cannot be read as MCAP: {error or type(error).__name__}") from error


def _decoder(schema: Any, channel: Any) -> Callable[[bytes], Any] | None:
    """Return what turns a channel's bytes into a message, or None of an encoding that is not known."""
    if channel.message_encoding == "json":
        return json.loads
    kind = channel.message_encoding, schema.encoding if schema is not None else ""
    if kind not in (("cdr", "ros2msg"), ("ros1", "ros1msg")):
        return None
    types = imported("rosbags.typesys", "bags")
    store = types.get_typestore(types.Stores.EMPTY)
    name = schema.name if "/msg/" in schema.name else schema.name.replace("/", "/msg/", 1)
    store.register(types.get_types_from_msg(schema.data.decode(), name))
    decode = store.deserialize_cdr if kind[0] == "cdr" else store.deserialize_ros1
    return lambda raw: decode(raw, name)


def _members(message: Any) -> Mapping[str, Any] | None:
    """Return the fields of a message, None of what is none."""
    if isinstance(message, Mapping):
        return message
    fields = getattr(message, "__dataclass_fields__", None)
    if fields is None:
        return None
    return {name: getattr(message, name) for name in fields if name != "__msgtype__"}


def _stamp(message: Any) -> int | None:
    """Return a header's stamp [ns], None where there is none or it is zero."""
    header = (_members(message) or {}).get("header")
    stamp = _members((_members(header) or {}).get("stamp")) if header is not None else None
    if not stamp:
        return None
    nanoseconds = stamp.get("nanosec", stamp.get("nsec", 0))
    return int(stamp.get("sec", 0)) * 10**9 + int(nanoseconds) or None


def _numbers(name: str, value: Any) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a message by dotted names; of a header none."""
    members = _members(value)
    if members is not None:
        called = members.get("name")
        labels = [str(item) for item in called] if isinstance(called, list | tuple) else []
        for key, inner in members.items():
            if labels and isinstance(inner, list | tuple | np.ndarray) and len(inner) == len(labels) and key != "name":
                for label, item in zip(labels, inner, strict=True):
                    yield from _numbers(f"{name}.{key}.{label}", item)
            elif key != "header":
                yield from _numbers(f"{name}.{key}", inner)
    elif isinstance(value, bool | int | float | np.number | np.bool_):
        yield name, float(value)
    elif isinstance(value, list | tuple | np.ndarray) and 0 < len(value) <= MAX_VECTOR:
        yield from _vector(name, value)


def _vector(name: str, values: Iterable[Any]) -> Iterator[tuple[str, float]]:
    for k, item in enumerate(values):
        yield from _numbers(f"{name}[{k}]", item)
