"""A robot in motion that is not quite the nominal one, and what its drives report of their efforts.

Rigid bodies by `chain`; on top of them what drives are made of: friction with a memory of its direction, rotors,
springs, gears that couple two joints, sensors with gains, offsets and delays. SI units and radians; an effort is what
the drive gives, so friction and inertia add to it in the direction of motion.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator

from .chain import Chain, Link
from .excitation import Excitation

#: Positions, velocities and accelerations of all joints, and how they follow the actuated ones.
Followed = tuple[np.ndarray, ...]
#: How fast a drive at rest lets go of what friction held for it [s].
LETTING_GO = 0.3


class Moving:
    """One robot with its effects, mappings of "physics", "location" and the sizes that `_effect_<physics>` lists.

    `scatter`: relative deviations by "<link>.mass", "<link>.inertia", "<joint>.effort_gain", and "<joint>.effort_bias".
    """

    def __init__(
        self,
        chain: Chain,
        tool: str,
        effects: Sequence[Mapping[str, Any]] = (),
        scatter: Mapping[str, float] | None = None,
    ):
        self.tool = tool
        self.names = [joint.name for joint in chain.joints]
        self.driven = list(chain.names)
        links = {link.name: link for link in chain.links}
        self.gain, self.bias = np.ones(len(self.driven)), np.zeros(len(self.driven))
        for name, amount in (scatter or {}).items():
            place, _, what = name.rpartition(".")
            if what == "mass":
                links[place] = replace(links[place], mass=links[place].mass * (1 + amount))
            elif what == "inertia":
                links[place] = replace(links[place], inertia=links[place].inertia * (1 + amount))
            elif what == "effort_gain":
                self.gain[self.driven.index(place)] *= 1 + amount
            else:
                self.bias[self.driven.index(place)] += amount
        self.links, self.chain = links, chain
        self.rotor = np.zeros(len(self.names))
        self.at_joints: list[tuple[Any, Mapping[str, Any]]] = []
        self.effort_delay, self.encoder_delay = np.zeros(len(self.driven)), np.zeros(len(self.driven))
        self.limit = np.full(len(self.driven), np.inf)
        for effect in effects:
            getattr(self, "_effect_" + effect["physics"])(dict(effect))
        self.chain = chain.with_links(list(self.links.values()))

    # ---- effects -------------------------------------------------------------------------------------------------
    def _driven(self, e) -> list[int]:
        """The drives of an effect: that of its location, or all at "robot"."""
        every = e["location"] == "robot"
        return list(range(len(self.driven))) if every else [self.driven.index(e["location"])]

    def _effect_payload(self, e):
        """mass [kg] at lever [m] (3, tool frame), a ball of `radius` [m]."""
        body, turn, at = self.chain.frames[self.tool]
        ball = 0.4 * e["mass"] * e["radius"] ** 2 * np.eye(3)
        self.links["payload"] = Link("payload", body, e["mass"], at + turn @ np.asarray(e["lever"], float), ball)

    def _effect_inertial_parameters(self, e):
        """mass, inertia (factors) and shift [m] (3) of the centre, in the axes of the link's joint."""
        link = self.links[e["location"]]
        mass, inertia = link.mass * e["mass"], link.inertia * e["inertia"]
        centre = link.centre + np.asarray(e["shift"], float)
        self.links[link.name] = replace(link, mass=mass, inertia=inertia, centre=centre)

    def _effect_rotor_inertia(self, e):
        """inertia [kg m^2, kg] as its joint feels it."""
        self.rotor[self.names.index(e["location"])] += e["inertia"]

    def _effect_coulomb_friction(self, e):
        """force [N m, N], share of the joint's own load on top, presliding [rad, m]."""
        self.at_joints.append((self._coulomb, e))

    def _coulomb(self, e, m):
        i = self.names.index(e["location"])
        size = e["force"] + e.get("share", 0.0) * np.abs(m.load[:, i])
        return {i: size * m.direction(m.q[:, i], e["presliding"])}

    def _effect_viscous_friction(self, e):
        """damping [N m s/rad], and `backward` times it where the joint runs backwards."""
        self.at_joints.append((self._viscous, e))

    def _viscous(self, e, m):
        i = self.names.index(e["location"])
        v = m.qd[:, i]
        return {i: e["damping"] * v * np.where(v < 0, e.get("backward", 1.0), 1.0)}

    def _effect_stribeck_friction(self, e):
        """coulomb and breakaway [N m], speed [rad/s]: what exceeds Coulomb friction decays as exp(-(v/speed)^2)."""
        self.at_joints.append((self._stribeck, e))

    def _stribeck(self, e, m):
        i = self.names.index(e["location"])
        more = (e["breakaway"] - e["coulomb"]) * np.exp(-((m.qd[:, i] / e["speed"]) ** 2))
        return {i: (e["coulomb"] + more) * m.direction(m.q[:, i], e["presliding"])}

    def _effect_counterbalance(self, e):
        """A spring that helps its drive: kind "torsion", stiffness [N m/rad] and rest [rad]; or "pulling", a spring
        without length between two arms: amplitude [N m] and rest [rad], where it pulls along the arm."""
        self.at_joints.append((self._counterbalance, e))

    def _counterbalance(self, e, m):
        i = self.names.index(e["location"])
        turned = m.q[:, i] - e["rest"]
        return {i: e["stiffness"] * turned if e["kind"] == "torsion" else e["amplitude"] * np.sin(turned)}

    def _effect_transmission_coupling(self, e):
        """The motor of `location` sees its joint plus `ratio` times joint `other`: damping, force (Coulomb) and inertia
        of that motor act on the sum, and so on both joints."""
        self.at_joints.append((self._coupled, e))

    def _coupled(self, e, m):
        i, j = self.names.index(e["location"]), self.names.index(e["other"])
        x, v, a = (values[:, i] + e["ratio"] * values[:, j] for values in (m.q, m.qd, m.qdd))
        own = e["inertia"] * a + e["damping"] * v + e["force"] * m.direction(x, e["presliding"])
        return {i: own, j: e["ratio"] * own}

    def _effect_cogging(self, e):
        """amplitude [N m] of a torque with so many periods `per_turn`, and its phase [rad]."""
        self.at_joints.append((self._cogging, e))

    def _cogging(self, e, m):
        i = self.names.index(e["location"])
        return {i: e["amplitude"] * np.sin(e["per_turn"] * m.q[:, i] + e["phase"])}

    def _effect_effort_gain(self, e):
        """gain: reported = (1 + gain) times true."""
        self.gain[self._driven(e)] *= 1 + e["gain"]

    def _effect_effort_offset(self, e):
        """offset [N m] on what is reported."""
        self.bias[self._driven(e)] += e["offset"]

    def _effect_effort_delay(self, e):
        """delay [s] of what is reported."""
        self.effort_delay[self._driven(e)] += e["delay"]

    def _effect_encoder_delay(self, e):
        """delay [s] of positions and velocities."""
        self.encoder_delay[self._driven(e)] += e["delay"]

    def _effect_alien(self, e):
        """Physics outside every library, by kind: bump_stop (coefficient times the way beyond rest), position_friction
        and switching_friction (coefficient x direction, as a wave of position, or on and off every `every` seconds),
        quadratic_drag (coefficient v |v|), saturation (efforts end at `limit`)."""
        if e["kind"] == "saturation":
            self.limit[self._driven(e)] = e["limit"]
        else:
            self.at_joints.append((self._alien, e))

    def _alien(self, e, m):
        i, c = self.names.index(e["location"]), e["coefficient"]
        q, v = m.q[:, i], m.qd[:, i]
        if e["kind"] == "bump_stop":
            return {i: c * np.maximum(q - e["rest"], 0.0)}
        if e["kind"] == "quadratic_drag":
            return {i: c * v * np.abs(v)}
        way = m.direction(q, e["presliding"])
        if e["kind"] == "position_friction":
            return {i: c * way * (1 + 0.95 * np.sin(e["waves"] * q + e["phase"]))}
        return {i: c * way * (np.floor(m.t / e["every"]) % 2)}

    def _effect_strange(self, e):
        """Physics outside every library, of another kind; see `strange`."""
        self.at_joints.append((self._strange, e))

    def _strange(self, e, m):
        from .strange import effort  # which draws such robots

        i, j = self.names.index(e["location"]), self.names.index(e["other"])
        return {i: effort(e, i, j, m)}

    # ---- what happens --------------------------------------------------------------------------------------------
    def rigid(self, followed: Followed) -> np.ndarray:
        """Return the efforts (N, actuated) that the rigid bodies alone need in a motion of all joints."""
        *motion, share = followed
        return (share.swapaxes(-1, -2) @ self.chain.efforts(*motion)[..., None])[..., 0]

    def given(
        self, t: np.ndarray, excitation: Excitation, seed: int = 0, followed: Followed | None = None
    ) -> np.ndarray:
        """Return the efforts (N, actuated) that the drives report at times t (N,), free of noise.

        `followed`: what `Chain.closed` makes of the excitation, where that is known.
        """
        q, qd, qdd, share = self.chain.closed(*excitation.at(t)) if followed is None else followed
        load = self.chain.efforts(q, qd, qdd)
        m = _Moment(t, q, qd, qdd, load, seed)
        total = load + self.rotor * qdd
        for act, e in self.at_joints:
            for i, effort in act(e, m).items():
                total[:, i] += effort
        out = (share.swapaxes(-1, -2) @ total[..., None])[..., 0]
        for k in np.flatnonzero(self.effort_delay):
            out[:, k] = PchipInterpolator(t, out[:, k])(np.maximum(t - self.effort_delay[k], t[0]))
        return np.clip(out, -self.limit, self.limit) * self.gain + self.bias

    def reported(self, t: np.ndarray, excitation: Excitation) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return q, qd, qdd (N, actuated) as the encoders report them at times t, free of noise."""
        out = tuple(np.empty((len(t), len(self.driven))) for _ in range(3))
        for delay in np.unique(self.encoder_delay):
            late = self.encoder_delay == delay
            for mine, true in zip(out, excitation.at(t - delay), strict=True):
                mine[:, late] = true[:, late]
        return out


class _Moment:
    """A motion of all joints as effects see it."""

    def __init__(self, t, q, qd, qdd, load, seed):
        self.t, self.q, self.qd, self.qdd, self.load = t, q, qd, qdd, load
        self._rng = np.random.default_rng([seed, 21])

    def direction(self, x: np.ndarray, presliding: float) -> np.ndarray:
        """Return which way dry friction points (N,), from -1 to 1: it turns over a small path and keeps at rest.

        At rest a drive lets go of part of what friction holds for it, each time another part.
        """
        step, wait = np.diff(x, prepend=x[0]), np.diff(self.t, prepend=self.t[0])
        moving = np.flatnonzero(np.abs(step) > 1e-12)
        z = float(np.sign(step[moving[0]])) if len(moving) else 0.0
        out, kept = np.empty(len(x)), None
        for k, (dx, dt) in enumerate(zip(step.tolist(), wait.tolist(), strict=True)):
            if abs(dx) > 1e-12:
                way = 1.0 if dx > 0 else -1.0
                z = way + (z - way) * float(np.exp(-abs(dx) / presliding))
                kept = None
            else:
                kept = z * self._rng.uniform(0.2, 1.0) if kept is None else kept
                z = kept + (z - kept) * float(np.exp(-dt / LETTING_GO))
            out[k] = z
        return out
