"""Logs as MCAP files and ROS bags: every topic is a stream, every number of its messages a column.

The `rosbags` package knows ROS 1 and 2 messages, `mcap` the container; nothing of ROS is needed.
"""

from __future__ import annotations

import bz2
import json
import sqlite3
from array import array
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ..errors import imported
from ..recordings.problems import is_number, shown
from ..spatial import Array
from .log import MAX_COLUMNS, MAX_NUMBERS, MAX_VECTOR, Log, Stream, check_size, frozen, reading, refuse

#: (topic, time of the logger [ns], message)
Message = tuple[str, int, Any]
#: Messages within messages that are looked into.
_DEEPEST = 20
#: Stamps are counted in so many bits [ns].
_STAMP = 2**63


@dataclass
class _Topic:
    """What was read of a topic: stamps [ns], and the rows and values of each number by its name."""

    stamps: list[int] = field(default_factory=list)
    cells: dict[str, tuple[array, array]] = field(default_factory=dict)

    def add(self, stamp: int, numbers: Iterable[tuple[str, float]]) -> None:
        row = len(self.stamps)
        self.stamps.append(stamp)
        for name, value in numbers:
            rows, values = self.cells.setdefault(name, (array("q"), array("d")))
            rows.append(row)
            values.append(value)

    def columns(self) -> dict[str, Array]:
        """Return the columns (N,), nan where a message has no such number."""
        out = {}
        for name, (rows, values) in self.cells.items():
            out[name] = np.full(len(self.stamps), np.nan)
            out[name][np.frombuffer(rows, np.int64)] = np.frombuffer(values)
        return out


def read(path: Path) -> Log:
    """Return the topics of a bag. A message's own stamp is its time, the logger's where it has none.

    A JointState's numbers take the names of its joints: /joint_states.position.elbow_joint. Raises MissingExtraError
    without the extra 'bags', RecordingFileError for a file that cannot be read.
    """
    left_out: dict[str, None] = {}
    messages = _from_mcap(path, left_out) if path.suffix.lower() == ".mcap" else _from_rosbag(path, left_out)
    topics: dict[str, _Topic] = {}
    for name, logged, message in messages:
        topic = topics.setdefault(name, _Topic())
        if len(topic.cells) <= MAX_COLUMNS:
            topic.add(_stamp(message) or logged, _numbers(name, message))
    begin = min((min(topic.stamps) for topic in topics.values()), default=0)
    streams = []
    for name, topic in topics.items():
        if not 0 < len(topic.cells) <= MAX_COLUMNS:
            why = f"more than {MAX_COLUMNS} names of numbers" if topic.cells else "no numbers"
            left_out[f"{name} ({why})"] = None
            continue
        check_size(path, 8 * len(topic.cells) * len(topic.stamps), f"topic '{shown(name)}'")
        clock = np.array([stamp - begin for stamp in topic.stamps], float) * 1e-9
        order = np.argsort(clock, kind="stable")
        clock = clock[order]
        clock.flags.writeable = False
        streams.append(Stream(name, frozen({column: x[order] for column, x in topic.columns().items()}), clock))
    return Log(str(path), tuple(streams), tuple(left_out))


def _from_rosbag(path: Path, left_out: dict[str, None]) -> Iterator[Message]:
    """Yield the messages of a ROS 1 bag, a ROS 2 bag's folder or its database."""
    rosbags = imported("rosbags.highlevel", "bags")
    types = imported("rosbags.typesys", "bags")
    folder = path.parent if path.suffix.lower() == ".db3" else path
    if folder.is_dir() and not (folder / "metadata.yaml").exists():
        raise refuse(path, "is no ROS 2 bag: there is no metadata.yaml in the folder")
    with reading(path, "a ROS bag") as here:
        for file in sorted(folder.iterdir()) if folder.is_dir() else (path,):
            here.at = file.name if folder.is_dir() else ""
            _check(file)
        here.at = ""
        store = types.get_typestore(types.Stores.LATEST)
        with rosbags.AnyReader([folder], default_typestore=store) as reader:
            known = [c for c in reader.connections if c.msgtype in reader.typestore.types]
            left_out |= {f"{c.topic} ({c.msgtype})": None for c in reader.connections if c not in known}
            counts: Counter[str] = Counter()
            for connection, stamp, raw in reader.messages(connections=known) if known else ():
                here.at = _place(connection.topic, counts)
                yield connection.topic, stamp, reader.deserialize(raw, connection.msgtype)


def _place(topic: str, counts: Counter[str]) -> str:
    """Return where a message stands, and count it."""
    counts[topic] += 1
    return f"message {counts[topic]} of '{shown(topic)}'"


def _check(file: Path) -> None:
    """Raise where a file of a bag is not what it declares to be: what `rosbags` unpacks, it unpacks without a bound."""
    ending = file.suffix.lower()
    if ending == ".bag":
        _check_chunks(file)
    elif ending == ".mcap":
        with file.open("rb") as stream:
            for _ in _records(file, stream, lambda place: None):
                pass
    elif ending == ".db3":
        if set("?#%") & set(str(file)):
            raise refuse(file, "has ?, # or % in its path, which mean something else to a database; rename it")
        with closing(sqlite3.connect(f"file:{file}?mode=ro&immutable=1", uri=True)) as database:
            found = database.execute("PRAGMA quick_check(1)").fetchone()
        if found != ("ok",):
            raise ValueError(f"the database is damaged: {found[0] if found else 'no answer'}")


def _check_chunks(path: Path) -> None:
    """Raise where a chunk of a ROS 1 bag unpacks to another size than it declares."""
    frames = imported("lz4.frame", "bags")
    with path.open("rb") as file:
        file.readline()
        while size := int.from_bytes(file.read(4), "little"):
            head, fields = file.read(size), {}
            while head:
                end = 4 + int.from_bytes(head[:4], "little")
                key, _, value = head[4:end].partition(b"=")
                fields[key], head = value, head[end:]
            begin, length = file.tell() + 4, int.from_bytes(file.read(4), "little")
            packed = fields.get(b"compression", b"none")
            if packed in (b"bz2", b"lz4"):
                declared = int.from_bytes(fields[b"size"], "little")
                check_size(path, declared, f"the chunk at byte {begin}")
                unpacking = bz2.BZ2Decompressor() if packed == b"bz2" else frames.LZ4FrameDecompressor()
                _exactly(declared, unpacking.decompress(file.read(length), declared + 1), begin)
            file.seek(begin + length)


def _exactly(declared: int, content: bytes, begin: int) -> bytes:
    if len(content) != declared:
        raise ValueError(f"the chunk before byte {begin} does not unpack to the {declared} bytes that it declares")
    return content


def _records(path: Path, file: BinaryIO, at: Callable[[str], None]) -> Iterator[Any]:
    """Yield the records of an MCAP file in their order, those of chunks too, all compared with their checksums.

    The index at its end is not needed, and says nothing that is believed.
    """
    reader, kinds = imported("mcap.stream_reader", "bags"), imported("mcap.records", "bags")
    stream = reader.StreamReader(file, emit_chunks=True, validate_crcs=True, record_size_limit=MAX_NUMBERS)
    for record in stream.records:
        at(f"before byte {file.tell()}")
        if isinstance(record, kinds.Chunk):
            check_size(path, record.uncompressed_size, f"the chunk before byte {file.tell()}")
            yield from reader.breakup_chunk(_unpacked(record, file.tell()), validate_crc=True)
        else:
            yield record
        at(f"after byte {file.tell()}")


def _unpacked(chunk: Any, begin: int) -> Any:
    """Return a chunk with its bytes unpacked, no more of them than it declares."""
    content, size = chunk.data, chunk.uncompressed_size
    if chunk.compression == "zstd":
        content = imported("zstandard", "bags").ZstdDecompressor().stream_reader(content).read(size + 1)
    elif chunk.compression == "lz4":
        content = imported("lz4.frame", "bags").LZ4FrameDecompressor().decompress(content, size + 1)
    elif chunk.compression:
        raise ValueError(f"packed by '{shown(chunk.compression)}', which is not known; expected zstd or lz4")
    return replace(chunk, compression="", data=_exactly(size, content, begin))


def _from_mcap(path: Path, left_out: dict[str, None]) -> Iterator[Message]:
    """Yield the messages of an MCAP file: ROS 1, ROS 2 and JSON."""
    kinds = imported("mcap.records", "bags")
    schemas: dict[int, Any] = {0: None}
    channels: dict[int, tuple[Any, Callable[[bytes], Any] | None]] = {}
    counts: Counter[str] = Counter()
    with reading(path, "MCAP") as here, path.open("rb") as file:
        for record in _records(path, file, lambda place: setattr(here, "at", place)):
            if isinstance(record, kinds.Schema):
                schemas[record.id] = record
            elif isinstance(record, kinds.Channel) and record.id not in channels:
                here.at = f"the types of '{shown(record.topic)}'"
                if record.schema_id not in schemas:
                    raise ValueError(f"there is no schema {record.schema_id}")
                channels[record.id] = record, _decoder(schemas[record.schema_id], record)
            elif isinstance(record, kinds.Message):
                if record.channel_id not in channels:
                    raise ValueError(f"a message is of channel {record.channel_id}, which there is not")
                channel, decode = channels[record.channel_id]
                here.at = _place(channel.topic, counts)
                if decode is None:
                    left_out[f"{channel.topic} ({channel.message_encoding})"] = None
                else:
                    yield channel.topic, record.log_time, decode(record.data)


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
    parts = stamp.get("sec", 0), stamp.get("nanosec", stamp.get("nsec", 0))
    if not all(is_number(part) and abs(part) < _STAMP for part in parts):
        return None
    stamped = int(parts[0]) * 10**9 + int(parts[1])
    return stamped if 0 < stamped < _STAMP else None


def _numbers(name: str, value: Any, depth: int = 0) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a message by dotted names; of a header none."""
    members = _members(value) if depth < _DEEPEST else None
    if members is not None:
        called = members.get("name")
        labels = [str(item) for item in called] if isinstance(called, list | tuple) else []
        for key, inner in members.items():
            if labels and isinstance(inner, list | tuple | np.ndarray) and len(inner) == len(labels) and key != "name":
                for label, item in zip(labels, inner, strict=True):
                    yield from _numbers(f"{name}.{key}.{label}", item, depth + 1)
            elif key != "header":
                yield from _numbers(f"{name}.{key}", inner, depth + 1)
    elif isinstance(value, bool | int | float | np.number | np.bool_):
        try:
            yield name, float(value)
        except OverflowError:  # an integer beyond all floats
            yield name, np.nan
    elif isinstance(value, list | tuple | np.ndarray) and 0 < len(value) <= MAX_VECTOR and depth < _DEEPEST:
        for k, item in enumerate(value):
            yield from _numbers(f"{name}[{k}]", item, depth + 1)
