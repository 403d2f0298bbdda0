"""Logs of a ur5 as other people's programs write them, of one motion that is known."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from prup_pin.imports import Log, Stream, convert, read_map
from prup_pin.imports.log import frozen

JOINTS = ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint")
T = np.arange(0.0, 6.0, 0.004)


def motion(t=T):
    """Return q, qd, tau (N, 6) at times t."""
    w = 0.7 + 0.21 * np.arange(6)
    q = 0.3 * np.arange(1, 7) - 1.0 + 0.8 * np.sin(np.outer(t, w))
    tau = 20.0 * np.cos(np.outer(t, w)) / np.arange(1, 7)
    return q, 0.8 * w * np.cos(np.outer(t, w)), tau


def log_of(columns, *others):
    """Return a log of one table beside other streams."""
    return Log("log.csv", (Stream("table", frozen(columns)), *others))


def converted(tmp_path, text, log, mechanism=None):
    """Return what a map makes of a log."""
    (tmp_path / "map.yaml").write_text(text)
    return convert(log, read_map(tmp_path / "map.yaml", log, mechanism), mechanism)


def assert_motion(recording, *groups):
    """Assert that positions, velocities or efforts are those of the motion, joint by joint in the robot's order."""
    found = {"q": recording.positions, "qd": recording.velocities, "tau": recording.efforts}
    for name, true in zip(found, motion(T[: len(recording)]), strict=True):
        if name in groups:
            assert list(found[name]) == list(JOINTS)
            assert np.abs(np.column_stack(list(found[name].values())) - true).max() < 1e-6


def csv(path: Path, columns, separator=",", decimal=".", above=(), below=()):
    """Write a table of text; `above` and `below` are lines before and after the names."""
    rows = zip(*(np.asarray(values).tolist() for values in columns.values()), strict=True)
    texts = [[x if isinstance(x, str) else f"{x:.10g}".replace(".", decimal) for x in row] for row in rows]
    cells = [separator.join(row) for row in texts]
    path.write_text("\n".join([*above, separator.join(columns), *below, *cells, ""]), encoding="utf-8")
    return path


def numbered(form, values, first=1):
    """Return columns named by a form with the joint's number: 'q{}'."""
    return {form.format(first + k): values[:, k] for k in range(values.shape[1])}


JOINT_STATE = """\
std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


def joint_states(store, t, q, qd, tau, epoch=1_700_000_000):
    """Yield stamps [ns] and JointState messages, joints in another order than the robot's."""
    names = ("sensor_msgs/msg/JointState", "std_msgs/msg/Header", "builtin_interfaces/msg/Time")
    state, header, time = (store.types[name] for name in names)
    order = [2, 0, 1, 3, 4, 5]
    for k in range(len(t)):
        stamp = epoch * 10**9 + round(t[k] * 1e9)
        yield stamp, state(
            header(time(stamp // 10**9, stamp % 10**9), "base"), [JOINTS[i] for i in order],
            q[k, order], qd[k, order], tau[k, order],
        )  # fmt: skip


def ros2_bag(path: Path, t, q, qd, tau, storage="sqlite3"):
    """Write a ROS 2 bag: joint states, and a wrench at a fifth of their rate, three milliseconds later."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    plugin = {"sqlite3": StoragePlugin.SQLITE3, "mcap": StoragePlugin.MCAP}[storage]
    with Writer(path, version=9, storage_plugin=plugin) as bag:
        states = bag.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=store)
        forces = bag.add_connection("/ft", "geometry_msgs/msg/WrenchStamped", typestore=store)
        texts = bag.add_connection("/log", "std_msgs/msg/String", typestore=store)
        for k, (stamp, message) in enumerate(joint_states(store, t, q, qd, tau)):
            bag.write(states, stamp + 400_000, store.serialize_cdr(message, "sensor_msgs/msg/JointState"))
            if k % 5 == 0:
                late = stamp + 3_000_000
                vector = store.types["geometry_msgs/msg/Vector3"]
                wrench = store.types["geometry_msgs/msg/Wrench"](vector(1.0, 2.0, 3.0 + k), vector(0.1, 0.2, 0.3))
                time = store.types["builtin_interfaces/msg/Time"](late // 10**9, late % 10**9)
                header = store.types["std_msgs/msg/Header"](time, "tool0")
                stamped = store.types["geometry_msgs/msg/WrenchStamped"](header, wrench)
                bag.write(forces, late + 400_000, store.serialize_cdr(stamped, "geometry_msgs/msg/WrenchStamped"))
        text = store.types["std_msgs/msg/String"]("hello")
        bag.write(texts, stamp, store.serialize_cdr(text, "std_msgs/msg/String"))
    return path


def mcap_file(path: Path, t, q, qd, tau, encoding="ros2msg"):
    """Write an MCAP file of joint states, as ROS 2 messages or as JSON."""
    from mcap.writer import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    name = "sensor_msgs/msg/JointState"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        if encoding == "json":
            schema = writer.register_schema("JointState", "jsonschema", b"{}")
        else:
            schema = writer.register_schema(name, "ros2msg", JOINT_STATE.encode())
        kind = "json" if encoding == "json" else "cdr"
        channel = writer.register_channel("/joint_states", kind, schema)
        odd = writer.register_channel("/camera", "protobuf", writer.register_schema("Image", "protobuf", b""))
        for stamp, message in joint_states(store, t, q, qd, tau):
            if encoding == "json":
                plain = {key: list(map(float, getattr(message, key))) for key in ("position", "velocity", "effort")}
                data = json.dumps({"name": message.name, **plain}).encode()
            else:
                data = bytes(store.serialize_cdr(message, name))
            writer.add_message(channel, log_time=stamp, data=data, publish_time=stamp)
        writer.add_message(odd, log_time=stamp, data=b"\0", publish_time=stamp)
        writer.finish()
    return path


def ros1_bag(path: Path, t, q, qd, tau, compression=None):
    """Write a ROS 1 bag of joint states, packed by bz2, lz4 or not at all."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store, name = get_typestore(Stores.ROS1_NOETIC), "sensor_msgs/msg/JointState"
    bag = Writer(path)
    if compression:
        bag.set_compression(Writer.CompressionFormat[compression.upper()])
    header, time = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    with bag:
        states = bag.add_connection("/joint_states", name, typestore=store)
        for k in range(len(t)):
            stamp = 10**12 + round(t[k] * 1e9)
            told = header(k, time(stamp // 10**9, stamp % 10**9), "")
            message = store.types[name](told, list(JOINTS), q[k], qd[k], tau[k])
            bag.write(states, stamp, store.serialize_ros1(message, name))
    return path
