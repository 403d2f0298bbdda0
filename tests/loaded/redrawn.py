"""The same robot, drawn otherwise: frames turned, the whole turned in space, other names, another order."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from lxml import etree

from prup_pin.spatial import placement, rotation_rpy


@dataclass(frozen=True)
class Drawing:
    """Another drawing of a robot file.

    `moved`: old_from_new (4, 4) of links' frames; a joint's axis is told in its child's axes and follows. `ground`
    (3, 3): the whole robot stands turned on a new ground, gravity with it. `names`: other names of joints. `digits`:
    so many behind the point, all where None.
    """

    moved: Mapping[str, np.ndarray] = field(default_factory=dict)
    ground: np.ndarray = field(default_factory=lambda: np.eye(3))
    names: Mapping[str, str] = field(default_factory=dict)
    digits: int | None = None

    def write(self, source: Path, folder: Path) -> Path:
        """Write a URDF and its sidecar, if it has one, drawn this way."""
        root = etree.parse(str(source)).getroot()
        for joint in root.iterfind("joint"):
            ends = [joint.find(end).get("link") for end in ("parent", "child")]
            before, after = (self.moved.get(link, np.eye(4)) for link in ends)
            origin = joint.find("origin")
            if origin is None:
                origin = etree.SubElement(joint, "origin")
            self._place(origin, np.linalg.inv(before) @ _pose(origin) @ after)
            axis = joint.find("axis")
            if axis is not None:
                axis.set("xyz", self._words(_numbers(axis.get("xyz")) @ after[:3, :3]))
            for module in root.iter("module"):
                own = module.get("tip") is None and module.get("frame") is None
                if own and module.get("joint") == joint.get("name") and module.get("axis"):
                    module.set("axis", self._words(_numbers(module.get("axis")) @ after[:3, :3]))
        for link in root.iterfind("link"):
            origin = link.find("inertial/origin")
            if origin is not None and link.get("name") in self.moved:
                self._place(origin, np.linalg.inv(self.moved[link.get("name")]) @ _pose(origin))
        if not np.array_equal(self.ground, np.eye(3)):
            etree.SubElement(root, "link", name="ground")
            joint = etree.SubElement(root, "joint", name="mount", type="fixed")
            etree.SubElement(joint, "parent", link="ground")
            etree.SubElement(joint, "child", link="base")
            self._place(etree.SubElement(joint, "origin"), placement(self.ground, np.zeros(3)))
            for gravity in root.iter("gravity"):
                gravity.set("xyz", self._words(self.ground @ _numbers(gravity.get("xyz"))))
        text = etree.tostring(root).decode()
        beside = source.with_suffix(".yaml")
        sidecar = beside.read_text() if beside.exists() else ""
        for old, new in self.names.items():
            text, sidecar = (re.sub(rf"\b{old}\b", new, each) for each in (text, sidecar))
        if sidecar:
            (folder / "robot.yaml").write_text(sidecar)
        target = folder / "robot.urdf"
        target.write_text(text)
        return target

    def _place(self, origin, value: np.ndarray) -> None:
        r = value[:3, :3]
        pitch = np.arctan2(-r[2, 0], np.hypot(r[0, 0], r[1, 0]))
        roll, yaw = np.arctan2(r[2, 1], r[2, 2]), np.arctan2(r[1, 0], r[0, 0])
        assert np.abs(rotation_rpy(roll, pitch, yaw) - r).max() < 1e-12
        origin.set("xyz", self._words(value[:3, 3]))
        origin.set("rpy", self._words([roll, pitch, yaw]))

    def _words(self, values) -> str:
        return " ".join(repr(float(v)) if self.digits is None else f"{float(v):.{self.digits}f}" for v in values)


def at(rpy, xyz=(0.0, 0.0, 0.0)) -> np.ndarray:
    """Return the placement of a frame turned by roll, pitch, yaw and moved."""
    return placement(rotation_rpy(*rpy), np.asarray(xyz, float))


def _numbers(text: str) -> np.ndarray:
    return np.array([float(word) for word in text.split()])


def _pose(origin) -> np.ndarray:
    xyz, rpy = (_numbers(origin.get(key, "0 0 0")) for key in ("xyz", "rpy"))
    return at(rpy, xyz)
