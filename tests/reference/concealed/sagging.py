"""An arm that sags under its own weight, and markers on it that a camera sees from somewhere.

Every joint yields about its axis and tilts across it, by the moment of all weights beyond it where they hang when
everything has yielded. Rotations are finite. SI units and radians; samples come first.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from .chain import GRAVITY, Chain
from .rotations import matrix

AXES = "xyz"


class Sagging:
    """One arm with its effects, mappings of "physics", "location" and the sizes that `_effect_<physics>` lists.

    `springs`: stiffness about the axis [N m/rad] by joint; the others are rigid. `scatter`, in the units of the
    tolerances: "<joint>.x" to ".z" and ".rx" to ".rz", ".encoder_offset", ".encoder_slope", ".stiffness",
    "<link>.mass", "<frame>.tx" to ".tz" of a marker, and "pose_sensor.x" to ".rz".
    """

    def __init__(
        self,
        chain: Chain,
        tool: str,
        effects: Sequence[Mapping[str, Any]] = (),
        scatter: Mapping[str, float] | None = None,
        springs: Mapping[str, float] | None = None,
    ):
        self.tool, self.names = tool, [joint.name for joint in chain.joints]
        n = len(self.names)
        self.joints = list(chain.joints)
        self.frames = dict(chain.frames)
        self.weights = {link.name: [link.mass, link.body, link.centre] for link in chain.links if link.body >= 0}
        self.about, self.across = np.zeros(n), np.zeros((n, 3, 3))  # compliance [rad/(N m)]
        for name, stiffness in (springs or {}).items():
            self.about[self.names.index(name)] = 1.0 / stiffness
        self.gap, self.smooth, self.cubic = np.zeros(n), np.ones(n), np.zeros(n)
        self.offset, self.slope = np.zeros(n), np.zeros(n)
        self.wave, self.phase, self.waves = np.zeros(n), np.zeros(n), np.zeros(n)
        self.drag = np.zeros((n, n))
        self.target: dict[str, np.ndarray] = {}
        self.shift, self.turn, self.drift = np.zeros(3), np.zeros(3), np.zeros(3)
        for name, amount in (scatter or {}).items():
            self._take(name, float(amount))
        for effect in effects:
            getattr(self, "_effect_" + effect["physics"])(dict(effect))

    # ---- scatter -------------------------------------------------------------------------------------------------
    def _take(self, name: str, amount: float) -> None:
        place, _, what = name.rpartition(".")
        along = amount * np.eye(3)[AXES.find(what[-1])]
        if what == "mass":
            self.weights[place][0] *= 1 + amount
        elif place == "pose_sensor":
            if what[0] == "r":
                self.turn = self.turn + along
            else:
                self.shift = self.shift + along
        elif what[0] == "t":
            self.target[place] = self.target.get(place, np.zeros(3)) + along
        else:
            i = self.names.index(place)
            if what == "stiffness":
                self.about[i] /= 1 + amount
            elif what == "encoder_offset":
                self.offset[i] += amount
            elif what == "encoder_slope":
                self.slope[i] += amount
            else:
                self._misplace(i, what[0] == "r", along)

    def _misplace(self, i: int, turned: bool, amount: np.ndarray) -> None:
        """Shift a joint along the axes of the body before it, or turn it about its own."""
        joint = self.joints[i]
        if turned:
            self.joints[i] = replace(joint, turn=joint.turn @ matrix(amount))
        else:
            self.joints[i] = replace(joint, origin=joint.origin + amount)

    # ---- effects -------------------------------------------------------------------------------------------------
    def _effect_joint_compliance(self, e):
        """about [rad/(N m)], across [rad/(N m)] alike in both directions, or in that of the unit vector `only` (3),
        in the axes of the joint at its zero. At "robot" every joint yields about its axis: `about` by joint."""
        if e["location"] == "robot":
            self.about += np.asarray(e["about"], float)
            return
        i = self.names.index(e["location"])
        self.about[i] += e.get("about", 0.0)
        axis = self.joints[i].axis
        only = e.get("only")
        self.across[i] += e.get("across", 0.0) * (
            np.eye(3) - np.outer(axis, axis) if only is None else np.outer(only, only)
        )

    def _effect_stiffness_changed(self, e):
        """factor of a spring's stiffness."""
        self.about[self.names.index(e["location"])] /= e["factor"]

    def _effect_backlash(self, e):
        """half_gap [rad] and smooth [N m]: half_gap tanh(moment/smooth) about the axis besides."""
        i = self.names.index(e["location"])
        self.gap[i] += e["half_gap"]
        self.smooth[i] = e["smooth"]

    def _effect_encoder_offset(self, e):
        """offset [rad]: true = reported + offset."""
        self.offset[self.names.index(e["location"])] += e["offset"]

    def _effect_lead_error(self, e):
        """ratio: the joint turns by so much more than its encoder says."""
        self.slope[self.names.index(e["location"])] += e["ratio"]

    def _effect_geometric_offset(self, e):
        """translation [m] (3) or rotation [rad] (3) of a joint."""
        i = self.names.index(e["location"])
        for turned, key in ((False, "translation"), (True, "rotation")):
            if key in e:
                self._misplace(i, turned, np.asarray(e[key], float))

    def _effect_payload(self, e):
        """mass [kg] at lever [m] (3, tool frame)."""
        body, turn, at = self.frames[self.tool]
        self.weights["payload"] = [e["mass"], body, at + turn @ np.asarray(e["lever"], float)]

    def _effect_target_misalignment(self, e):
        """translation [m] (3) of a marker, in the axes of its frame."""
        here = self.target.get(e["location"], np.zeros(3))
        self.target[e["location"]] = here + np.asarray(e["translation"], float)

    def _effect_pose_sensor_drift(self, e):
        """speed [m/s] (3) of what the camera reports, since time 0."""
        self.drift = self.drift + np.asarray(e["speed"], float)

    def _effect_eccentric_encoder(self, e):
        """amplitude [rad], phase [rad], waves in a turn: true = reported + amplitude sin(waves q + phase)."""
        i = self.names.index(e["location"])
        self.wave[i], self.phase[i], self.waves[i] = e["amplitude"], e["phase"], e["waves"]

    def _effect_alien(self, e):
        """Physics outside every library, by kind: cubic_compliance (coefficient x moment^3 about the axis),
        dragged_joint (coefficient x the position of the joint before, or after the first)."""
        i = self.names.index(e["location"])
        if e["kind"] == "cubic_compliance":
            self.cubic[i] = e["coefficient"]
        else:
            self.drag[i, i - 1 if i else 1] = e["coefficient"]

    # ---- what happens --------------------------------------------------------------------------------------------
    def _placed(self, q: np.ndarray, tilt: np.ndarray):
        """Return frames (N, 3, 3), centres (N, 3) and housings (N, 3, 3) of the joints; q (N, n), tilt (N, n, 3)."""
        turns, places, housings = [], [], []
        still, zero = np.broadcast_to(np.eye(3), (len(q), 3, 3)), np.zeros((len(q), 3))
        for i, joint in enumerate(self.joints):
            rot, at = (still, zero) if joint.parent < 0 else (turns[joint.parent], places[joint.parent])
            places.append(at + rot @ joint.origin)
            housings.append(rot @ joint.turn)
            turns.append(housings[i] @ matrix(tilt[:, i]) @ matrix(q[:, i : i + 1] * joint.axis))
        return turns, places, housings

    def _before(self, body: int) -> list[int]:
        out = []
        while body >= 0:
            out.append(body)
            body = self.joints[body].parent
        return out

    def _moments(self, turns, places, housings) -> np.ndarray:
        """Return the moments (N, n, 3) of all weights beyond each joint, in the axes of its housing."""
        total = np.zeros((len(places[0]), len(self.joints), 3))
        for mass, body, centre in self.weights.values():
            at = places[body] + turns[body] @ centre
            for i in self._before(body):
                total[:, i] += np.cross(at - places[i], mass * GRAVITY)
        return np.stack([(housings[i].swapaxes(-1, -2) @ total[:, i, :, None])[..., 0]
                         for i in range(len(self.joints))], 1)  # fmt: skip

    def settled(self, q: np.ndarray):
        """Return frames and centres of the joints at encoder readings q (N, n), when everything has yielded."""
        standing = q + self.offset + self.slope * q + self.wave * np.sin(self.waves * q + self.phase)
        standing = standing + q @ self.drag.T
        bent, tilt = np.zeros_like(q), np.zeros((*q.shape, 3))
        for _ in range(100):
            placed = self._placed(standing + bent, tilt)
            moment = self._moments(*placed)
            about = np.stack([moment[:, i] @ joint.axis for i, joint in enumerate(self.joints)], 1)
            new = about * self.about + self.gap * np.tanh(about / self.smooth) + self.cubic * about**3
            leant = (self.across @ moment[..., None])[..., 0]
            change = max(np.abs(new - bent).max(), np.abs(leant - tilt).max())
            bent, tilt = new, leant
            if change < 1e-13:
                return placed
        raise RuntimeError(f"the arm does not settle: {change:.3g} rad")

    def seen(self, q: np.ndarray, markers: Sequence[str], time: np.ndarray) -> np.ndarray:
        """Return positions (N, markers, 3) as the camera tells them, free of noise."""
        turns, places, _ = self.settled(q)
        camera = matrix(self.turn)
        out = []
        for name in markers:
            body, turn, at = self.frames[name]
            local = at + turn @ self.target.get(name, np.zeros(3))
            true = local if body < 0 else places[body] + turns[body] @ local
            out.append(true @ camera.T + self.shift + np.outer(time, self.drift))
        return np.stack(out, 1)
