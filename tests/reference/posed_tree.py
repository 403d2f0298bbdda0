"""A tree of rigid links on joints that yield about and across their axes, posed under its weight and seen by markers.

It shares no code with the package: Pinocchio reads the file, the rest is here. Every joint turns by its compliance
times the moment that the subtree beyond it puts on it, in the deformed position, by fixed-point steps.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

FREE_FALL = np.array([0.0, 0.0, -9.81])
_STEPS, _STILL = 80, 1e-13
#: Of a link that bends.
_PIECES = 50


def turned(vector) -> np.ndarray:
    """Return the rotation by a vector, by Rodrigues' formula."""
    angle = float(np.linalg.norm(vector))
    if angle < 1e-14:
        return np.eye(3)
    x, y, z = np.asarray(vector) / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def _per_vector(vector) -> np.ndarray:
    """Return the turn per change of a rotation vector, in the axes before the rotation (left Jacobian), by series."""
    x, y, z = vector
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + cross / 2 + cross @ cross / 6 + cross @ cross @ cross / 24


def crossed(one, other) -> np.ndarray:
    """Return the cross product of two vectors; numpy's takes ten times as long."""
    (a, b, c), (x, y, z) = one, other
    return np.array([b * z - c * y, c * x - a * z, a * y - b * x])


def placed(rotation=None, shift=(0.0, 0.0, 0.0)) -> np.ndarray:
    """Return a placement (4, 4)."""
    out = np.eye(4)
    out[:3, :3] = np.eye(3) if rotation is None else rotation
    out[:3, 3] = shift
    return out


@dataclass
class PosedTree:
    """What is true of the device. By joint: compliance about and across its axis [rad/(N m), m/N for a slide's own],
    alike both ways across or a matrix (3, 3) in the axes of its seat; for a slide's guide the clearance and the length
    over which it holds at zero [m], and the moment [N m] that tilts what it holds by three quarters of one over the
    other, less the more it is out; 1 / EI [1/(N m^2)] of the link before it, which bends; what its
    position is beyond the reported one,
    where it is beyond its drawing, in the parent's axes, how it is turned there, how much heavier its body is; by
    frame: where the marker sits on it. `tracker` is (4, 4), tracker from base.
    """

    path: Path
    about: Mapping[str, float] = field(default_factory=dict)
    across: Mapping[str, float | np.ndarray] = field(default_factory=dict)
    guides: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    bending: Mapping[str, float] = field(default_factory=dict)
    offsets: Mapping[str, float] = field(default_factory=dict)
    moved: Mapping[str, np.ndarray] = field(default_factory=dict)
    tilted: Mapping[str, np.ndarray] = field(default_factory=dict)
    heavier: Mapping[str, float] = field(default_factory=dict)
    targets: Mapping[str, np.ndarray] = field(default_factory=dict)
    tracker: np.ndarray = field(default_factory=lambda: np.eye(4))
    weighs: bool = True

    def __post_init__(self) -> None:
        self.model = pin.buildModelFromUrdf(str(self.path))
        told = {joint.get("name"): joint.find("mimic") for joint in ElementTree.parse(self.path).iter("joint")}
        self.follows = {
            name: (mimic.get("joint"), float(mimic.get("multiplier", 1)), float(mimic.get("offset", 0)))
            for name, mimic in told.items()
            if mimic is not None
        }
        self.twists: list[np.ndarray] = [np.zeros(6)]
        for joint in list(self.model.joints)[1:]:
            data = joint.createData()
            joint.calc(data, pin.neutral(self.model))
            self.twists.append(np.array(data.S).reshape(6, -1)[:, 0] if joint.nv == 1 else np.zeros(6))

    def frame(self, name: str):
        return self.model.frames[self.model.getFrameId(name)]

    def bodies(self, q: Mapping[str, float], wrench=None, tool: str = "") -> list[np.ndarray]:
        """Return the placements of all joints' bodies in equilibrium, [base_from_body]."""
        count = self.model.njoints
        turn, slid, bent = np.zeros((count, 3)), np.zeros(count), np.zeros((count, 6))
        for _ in range(_STEPS):
            bodies, seats = self._chain(q, turn, slid, bent)
            force, moment = self._carried(bodies, wrench, tool)
            before = turn.copy(), slid.copy(), bent.copy()
            for joint in range(1, count):
                own = moment[joint] - crossed(bodies[joint][:3, 3], force[joint])
                self._yield(joint, self._at(q, joint), seats[joint][:3, :3].T, force[joint], own, turn, slid)
                at_end = moment[joint] - crossed(seats[joint][:3, 3], force[joint])
                bent[joint] = self._bend(joint, seats[joint][:3, :3].T, force[joint], at_end)
            if max(np.abs(now - old).max() for now, old in zip((turn, slid, bent), before, strict=True)) < _STILL:
                return bodies
        raise RuntimeError("no equilibrium")

    def _chain(self, q, turn, slid, bent) -> tuple[list[np.ndarray], list[np.ndarray]]:
        bodies, seats = [np.eye(4)], [np.eye(4)]
        for joint in range(1, self.model.njoints):
            name, twist, drawn = self.model.names[joint], self.twists[joint], self.model.jointPlacements[joint]
            rotation = drawn.rotation @ turned(self.tilted.get(name, np.zeros(3)))
            seat = bodies[self.model.parents[joint]] @ placed(rotation, drawn.translation + self.moved.get(name, 0.0))
            seat = seat @ placed(turned(bent[joint][3:]), bent[joint][:3])
            at = self._at(q, joint)
            seats.append(seat)
            slide = placed(shift=twist[:3] * (at + slid[joint]))
            own = at + (slid[joint] if np.any(twist[3:]) else 0.0)
            bodies.append(seat @ slide @ placed(turned(turn[joint])) @ placed(turned(twist[3:] * own)))
        return bodies, seats

    def _at(self, q, joint) -> float:
        """Return where a joint stands but for what it yields."""
        name = self.model.names[joint]
        leader, ratio, offset = self.follows.get(name, (name, 1.0, 0.0))
        return ratio * q.get(leader, 0.0) + offset + self.offsets.get(name, 0.0)

    def _carried(self, bodies, wrench, tool) -> tuple[np.ndarray, np.ndarray]:
        """Return force and moment about the base's origin on every joint's subtree."""
        count = self.model.njoints
        force, moment = np.zeros((count, 3)), np.zeros((count, 3))
        for joint in range(1, count) if self.weighs else ():
            inertia = self.model.inertias[joint]
            weight = inertia.mass * self.heavier.get(self.model.names[joint], 1.0) * FREE_FALL
            force[joint] += weight
            moment[joint] += crossed(bodies[joint][:3, :3] @ inertia.lever + bodies[joint][:3, 3], weight)
        if wrench is not None:
            frame = self.frame(tool)
            point = (bodies[frame.parentJoint] @ frame.placement.homogeneous)[:3, 3]
            force[frame.parentJoint] += wrench[:3]
            moment[frame.parentJoint] += np.asarray(wrench[3:]) + crossed(point, wrench[:3])
        for joint in range(count - 1, 0, -1):
            force[self.model.parents[joint]] += force[joint]
            moment[self.model.parents[joint]] += moment[joint]
        return force, moment

    def _yield(self, joint, at, axes, force, moment, turn, slid) -> None:
        """Let a joint yield that stands at `at`; `axes` are those of its seat, `moment` is about the joint.

        The moment that tilts is conjugate to the vector of the tilt: nothing but a potential is stored.
        """
        name, twist = self.model.names[joint], self.twists[joint]
        about, across = self.about.get(name, 0.0), self.across.get(name, 0.0)
        slides = not np.any(twist[3:])
        axis = twist[:3] if slides else twist[3:]
        felt = _per_vector(turn[joint]).T @ axes @ moment
        own = axes @ force if slides else turned(turn[joint]).T @ axes @ moment
        slid[joint] = about * float(axis @ own)
        tilted = felt - axis * float(axis @ felt)
        turn[joint] = across @ tilted if np.ndim(across) else across * tilted
        if name in self.guides:
            clearance, held, moment_to_tilt = self.guides[name]
            size = float(np.linalg.norm(tilted))
            turn[joint] += clearance / (held - at) * np.tanh(size / moment_to_tilt) / max(size, 1e-300) * tilted

    def _bend(self, joint, axes, force, moment) -> np.ndarray:
        """Return shift and turn (6,) of the end of the link before a joint, in the axes of its seat.

        Each short piece of it turns all beyond it by the moment across the link that it carries, over EI.
        """
        flexibility, drawn = self.bending.get(self.model.names[joint], 0.0), self.model.jointPlacements[joint]
        link = drawn.rotation.T @ drawn.translation
        out, length = np.zeros(6), float(np.linalg.norm(link))
        for middle in (np.arange(_PIECES) + 0.5) / _PIECES if flexibility else ():
            arm = (1 - middle) * link
            carried = axes @ moment + crossed(arm, axes @ force)
            kink = flexibility * length / _PIECES * (carried - link * (link @ carried) / length**2)
            out += np.concatenate((crossed(kink, arm), kink))
        return out

    def markers(self, q, names: Sequence[str], wrench=None, tool: str = "") -> dict[str, np.ndarray]:
        """Return where the tracker sees the markers on these frames, (4, 4) each."""
        bodies = self.bodies(q, wrench, tool)
        found = {}
        for name in names:
            frame = self.frame(name)
            seat = bodies[frame.parentJoint] @ frame.placement.homogeneous
            found[name] = self.tracker @ seat @ placed(shift=self.targets.get(name, np.zeros(3)))
        return found

    def postures(self, joints: Sequence[str], count: int, seed: int, reach: float = 0.8) -> dict[str, np.ndarray]:
        """Return positions (count,) of joints, drawn within a share of their limits, or of +-2 rad."""
        draw = np.random.default_rng(seed)
        found = {}
        for name in joints:
            joint = self.model.joints[self.model.getJointId(name)]
            low, high = -2.0, 2.0
            if joint.nq == 1:
                low = max(low, float(self.model.lowerPositionLimit[joint.idx_q]))
                high = min(high, float(self.model.upperPositionLimit[joint.idx_q]))
            middle, half = (low + high) / 2, reach * (high - low) / 2
            found[name] = draw.uniform(middle - half, middle + half, count)
        return found

    def seen(self, q: Mapping[str, np.ndarray], names: Sequence[str], noise: float, seed: int, **load):
        """Return the markers' positions by frame, (N, 3), with noise."""
        draw = np.random.default_rng([seed, 1])
        rows = zip(*q.values(), strict=True)
        poses = [self.markers(dict(zip(q, row, strict=True)), names, **load) for row in rows]
        return {
            name: np.array([pose[name][:3, 3] for pose in poses]) + noise * draw.standard_normal((len(poses), 3))
            for name in names
        }
