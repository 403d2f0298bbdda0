"""The same robot, drawn otherwise: frames turned, the whole turned in space, other names, another order."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from lxml import etree

from prup_pin.spatial import placement, rotation_rpy


def turn(rpy) -> np.ndarray:
    return placement(rotation_rpy(*rpy), np.zeros(3))


def redrawn(source: Path, target: Path, moved: Mapping[str, np.ndarray], mount=None, reverse: bool = False) -> Path:
    """Write a URDF with the frame of each link in `moved` drawn at old_from_new (4, 4).

    A joint's axis is told in its child's axes and follows. `mount` (4, 4) places all that stands on the base in a
    turned base; `reverse` writes the joints in the opposite order.
    """
    root = etree.parse(str(source)).getroot()
    at = {name: np.array(value, float) for name, value in moved.items()}
    for joint in root.iterfind("joint"):
        parent, child = joint.find("parent").get("link"), joint.find("child").get("link")
        origin = joint.find("origin")
        if origin is None:
            origin = etree.SubElement(joint, "origin")
        before = at.get(parent, np.eye(4))
        if mount is not None and parent == "base":
            before = np.linalg.inv(mount)
        new = np.linalg.inv(before) @ _pose(origin) @ at.get(child, np.eye(4))
        _write(origin, new)
        axis = joint.find("axis")
        if axis is not None and child in at:
            values = np.array([float(word) for word in axis.get("xyz").split()]) @ at[child][:3, :3]
            axis.set("xyz", _words(values))
    for link in root.iterfind("link"):
        origin = link.find("inertial/origin")
        if origin is not None and link.get("name") in at:
            _write(origin, np.linalg.inv(at[link.get("name")]) @ _pose(origin))
    if reverse:
        joints = root.findall("joint")
        for joint in joints:
            root.remove(joint)
        for joint in reversed(joints):
            root.insert(0, joint)
    target.write_bytes(etree.tostring(root))
    return target


def _pose(origin) -> np.ndarray:
    xyz, rpy = ([float(word) for word in origin.get(key, "0 0 0").split()] for key in ("xyz", "rpy"))
    return placement(rotation_rpy(*rpy), np.array(xyz))


def _write(origin, value: np.ndarray) -> None:
    r = value[:3, :3]
    pitch = np.arctan2(-r[2, 0], np.hypot(r[0, 0], r[1, 0]))
    roll, yaw = np.arctan2(r[2, 1], r[2, 2]), np.arctan2(r[1, 0], r[0, 0])
    assert np.abs(rotation_rpy(roll, pitch, yaw) - r).max() < 1e-12
    origin.set("xyz", _words(value[:3, 3]))
    origin.set("rpy", _words([roll, pitch, yaw]))


def _words(values) -> str:
    return " ".join(repr(float(value)) for value in values)
