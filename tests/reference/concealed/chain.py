"""Rigid bodies of a URDF in motion: forces and moments at every mass in base axes, summed over what a joint bears.

Newton and Euler are written for each link at its own centre of mass, in base axes: f = m (a - g), n = I dw + w x I w.
The effort of a joint is what its axis feels of all f and n beyond it (virtual work), without any recursion of spatial
vectors. A planar loop is closed by a point that two bodies share: its Jacobian carries the efforts of passive joints to
the actuated ones. Samples come first: (N, ...). SI units.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import metadata
from pathlib import Path

import numpy as np
from lxml import etree

from .rotations import matrix

GRAVITY = np.array([0.0, 0.0, -9.81])  # m/s^2, as a file means that says nothing


@dataclass(frozen=True)
class Link:
    """A mass on a moving body: `body` is the index of the joint that carries it; centre and inertia in its frame."""

    name: str
    body: int
    mass: float
    centre: np.ndarray
    inertia: np.ndarray  # (3, 3) about the centre


@dataclass(frozen=True)
class Joint:
    """A joint that moves: `parent` is the index of the joint before it, -1 the base; origin and turn in its frame."""

    name: str
    parent: int
    origin: np.ndarray
    turn: np.ndarray
    axis: np.ndarray
    slides: bool
    endless: bool
    limits: tuple[float, float]
    speed: float


@dataclass(frozen=True)
class Chain:
    """Joints from the base outwards, the masses on them, where every link's frame sits, and a loop's two points."""

    joints: tuple[Joint, ...]
    links: tuple[Link, ...]
    frames: Mapping[str, tuple[int, np.ndarray, np.ndarray]]  # link -> (body, turn, origin)
    actuated: tuple[int, ...]
    loop: tuple[tuple[int, np.ndarray], tuple[int, np.ndarray]] | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the actuated joints."""
        return tuple(self.joints[i].name for i in self.actuated)

    @property
    def passive(self) -> tuple[int, ...]:
        """Indices of the joints that follow the actuated ones."""
        return tuple(i for i in range(len(self.joints)) if i not in self.actuated)

    def with_links(self, links: Sequence[Link]) -> Chain:
        """Return the chain with other masses."""
        return replace(self, links=tuple(links))

    # ---- motion --------------------------------------------------------------------------------------------------
    def moved(self, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> Motion:
        """Return frames, rates and accelerations of all bodies in base axes; q, qd, qdd (N, all joints)."""
        out = Motion()
        still, zero = np.broadcast_to(np.eye(3), (len(q), 3, 3)), np.zeros((len(q), 3))
        for i, joint in enumerate(self.joints):
            base = joint.parent < 0
            rot, at = (still, zero) if base else (out.turn[joint.parent], out.at[joint.parent])
            rate, spin, pull = (zero, zero, zero) if base else out.rates(joint.parent)
            frame = rot @ joint.turn
            axis = frame @ joint.axis
            x, v, a = (k[:, i : i + 1] for k in (q, qd, qdd))
            arm = rot @ joint.origin + (axis * x if joint.slides else 0.0)
            pull = pull + np.cross(spin, arm) + np.cross(rate, np.cross(rate, arm))
            if joint.slides:
                pull = pull + axis * a + 2 * np.cross(rate, axis * v)
            else:
                frame = frame @ matrix(x * joint.axis)
                spin = spin + axis * a + np.cross(rate, axis * v)
                rate = rate + axis * v
            out.take(frame, at + arm, axis, rate, spin, pull)
        return out

    def point(self, motion: Motion, body: int, local: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return position and acceleration (N, 3) of a point of a body."""
        if body < 0:
            at = np.broadcast_to(local, (len(motion.at[0]), 3))
            return at, np.zeros_like(at)
        arm = motion.turn[body] @ local
        rate, spin, pull = motion.rates(body)
        return motion.at[body] + arm, pull + np.cross(spin, arm) + np.cross(rate, np.cross(rate, arm))

    def before(self, body: int) -> list[int]:
        """Return a body's joint and all before it."""
        out = []
        while body >= 0:
            out.append(body)
            body = self.joints[body].parent
        return out

    def jacobian(self, motion: Motion, body: int, at: np.ndarray) -> np.ndarray:
        """Return what the joints do to a point `at` (N, 3) of a body: (N, 3, joints)."""
        out = np.zeros((len(at), 3, len(self.joints)))
        for i in self.before(body):
            out[:, :, i] = motion.axis[i] if self.joints[i].slides else np.cross(motion.axis[i], at - motion.at[i])
        return out

    # ---- loop ----------------------------------------------------------------------------------------------------
    def _gap(self, motion: Motion):
        """Return gap, its bias acceleration and its Jacobian in the loop's plane: x and z."""
        (body1, local1), (body2, local2) = self.loop
        (at1, pull1), (at2, pull2) = self.point(motion, body1, local1), self.point(motion, body2, local2)
        jacobian = self.jacobian(motion, body2, at2) - self.jacobian(motion, body1, at1)
        return (at2 - at1)[:, [0, 2]], (pull2 - pull1)[:, [0, 2]], jacobian[:, [0, 2], :]

    def closed(self, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return q, qd, qdd (N, all joints) and what one unit of each actuated joint does to all: (N, all, actuated).

        Actuated motion (N, actuated) given; the loop stays in the branch in which it is drawn.
        """
        n, driven, free = len(q), list(self.actuated), list(self.passive)
        whole, rate, pull = (np.zeros((n, len(self.joints))) for _ in range(3))
        share = np.zeros((n, len(self.joints), len(driven)))
        share[:, driven, range(len(driven))] = 1.0
        whole[:, driven], rate[:, driven], pull[:, driven] = q, qd, qdd
        if self.loop is None:
            return whole, rate, pull, share
        for part in (0.34, 0.67, 1.0):  # from the drawing to the pose, so that the branch is kept
            whole[:, driven] = part * q
            for _ in range(20):
                gap, _, jacobian = self._gap(self.moved(whole, 0 * rate, 0 * pull))
                if np.abs(gap).max() < (1e-13 if part == 1.0 else 1e-3):
                    break
                whole[:, free] -= np.linalg.solve(jacobian[:, :, free], gap[..., None])[..., 0]
        if np.abs(gap).max() > 1e-12:
            raise RuntimeError(f"the loop does not close: {np.abs(gap).max():.3g} m")
        follow = -np.linalg.solve(jacobian[:, :, free], jacobian[:, :, driven])
        share[:, free] = follow
        rate[:, free] = (follow @ qd[..., None])[..., 0]
        _, bias, _ = self._gap(self.moved(whole, rate, pull))
        pull[:, free] = -np.linalg.solve(jacobian[:, :, free], bias[..., None])[..., 0]
        return whole, rate, pull, share

    # ---- efforts -------------------------------------------------------------------------------------------------
    def efforts(self, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
        """Return the efforts (N, all joints) [N, N m] that the tree needs, loops open, weight included."""
        motion = self.moved(q, qd, qdd)
        n = len(q)
        force = [np.zeros((n, 3)) for _ in self.joints]  # of all that a joint bears
        moment = [np.zeros((n, 3)) for _ in self.joints]  # about the base's origin
        for link in self.links:
            if link.body < 0 or not (link.mass or link.inertia.any()):
                continue
            turn = motion.turn[link.body]
            rate, spin, _ = motion.rates(link.body)
            at, pull = self.point(motion, link.body, link.centre)
            inertia = turn @ link.inertia @ turn.swapaxes(-1, -2)
            f = link.mass * (pull - GRAVITY)
            whirl = (inertia @ rate[..., None])[..., 0]
            m = (inertia @ spin[..., None])[..., 0] + np.cross(rate, whirl) + np.cross(at, f)
            for i in self.before(link.body):
                force[i] += f
                moment[i] += m
        out = np.empty((n, len(self.joints)))
        for i, joint in enumerate(self.joints):
            felt = force[i] if joint.slides else moment[i] - np.cross(motion.at[i], force[i])
            out[:, i] = (motion.axis[i] * felt).sum(1)
        return out


@dataclass
class Motion:
    """Frames (N, 3, 3), origins, axes, rates, their derivatives and accelerations (N, 3) of the bodies, base axes."""

    turn: list[np.ndarray] = field(default_factory=list)
    at: list[np.ndarray] = field(default_factory=list)
    axis: list[np.ndarray] = field(default_factory=list)
    _rates: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = field(default_factory=list)

    def take(self, turn, at, axis, rate, spin, pull) -> None:
        """Add a body."""
        self.turn.append(turn)
        self.at.append(at)
        self.axis.append(axis)
        self._rates.append((rate, spin, pull))

    def rates(self, body: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return angular velocity, angular acceleration and the origin's acceleration of a body."""
        return self._rates[body]


# ---------------------------------------------------------------------------------------------- files
def example_file(name: str) -> Path:
    """Return a robot file of example-robot-data by its path below `robots`."""
    folder = metadata.distribution("example-robot-data").locate_file("cmeel.prefix/share/example-robot-data/robots")
    return Path(str(folder)) / name


def _triple(element, name: str, fallback=(0.0, 0.0, 0.0)) -> np.ndarray:
    text = None if element is None else element.get(name)
    return np.array(fallback if text is None else [float(x) for x in text.split()], float)


def _placed(element) -> tuple[np.ndarray, np.ndarray]:
    """Return turn (3, 3) and origin (3,) of an <origin>: about x, then y, then z, all fixed."""
    roll, pitch, yaw = _triple(element, "rpy")
    turn = matrix([0, 0, yaw]) @ matrix([0, pitch, 0]) @ matrix([roll, 0, 0])
    return turn, _triple(element, "xyz")


def read_chain(path: Path, held: Sequence[str] = ()) -> Chain:
    """Return the chain of a URDF; joints of the names in `held` stay at zero, those of <actuated> alone are driven."""
    root = etree.parse(str(path)).getroot()
    elements = {e.find("child").get("link"): e for e in root.findall("joint")}
    links = {e.get("name"): e for e in root.findall("link")}
    joints: list[Joint] = []
    frames: dict[str, tuple[int, np.ndarray, np.ndarray]] = {}

    def place(name: str) -> tuple[int, np.ndarray, np.ndarray]:
        if name in frames:
            return frames[name]
        element = elements.get(name)
        if element is None:
            frames[name] = -1, np.eye(3), np.zeros(3)
            return frames[name]
        body, turn, at = place(element.find("parent").get("link"))
        own, shift = _placed(element.find("origin"))
        turn, at = turn @ own, at + turn @ shift
        kind = element.get("type")
        if kind in ("revolute", "continuous", "prismatic") and element.get("name") not in held:
            axis = _triple(element.find("axis"), "xyz", (1.0, 0.0, 0.0))
            limit = element.find("limit")
            span = [float(limit.get(key, 0.0)) for key in ("lower", "upper", "velocity")] if limit is not None else []
            joints.append(
                Joint(element.get("name"), body, at, turn, axis / np.linalg.norm(axis), kind == "prismatic",
                      kind == "continuous", (span[0], span[1]), span[2])
            )  # fmt: skip
            body, turn, at = len(joints) - 1, np.eye(3), np.zeros(3)
        frames[name] = body, turn, at
        return frames[name]

    masses = []
    for name, element in links.items():
        body, turn, at = place(name)
        inertial = element.find("inertial")
        if inertial is None:
            continue
        own, centre = _placed(inertial.find("origin"))
        table = {key: float(value) for key, value in inertial.find("inertia").attrib.items()}
        inertia = np.array([[table["i" + "".join(sorted(a + b))] for b in "xyz"] for a in "xyz"])
        turned = turn @ own
        mass = float(inertial.find("mass").get("value"))
        masses.append(Link(name, body, mass, at + turn @ centre, turned @ inertia @ turned.T))
    named = [joint.name for joint in joints]
    driven = root.find("prup_pin/actuated")
    actuated = range(len(joints)) if driven is None else [named.index(name) for name in driven.get("joints").split()]
    loop = root.find("prup_pin/loop")
    ends = None
    if loop is not None:
        (b1, _, at1), (b2, _, at2) = (frames[loop.get(key)] for key in ("frame1", "frame2"))
        ends = (b1, at1), (b2, at2)
    return Chain(tuple(joints), tuple(masses), frames, tuple(actuated), ends)


__all__ = ["GRAVITY", "Chain", "Joint", "Link", "Motion", "example_file", "read_chain"]
