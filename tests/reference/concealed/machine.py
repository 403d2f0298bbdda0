"""What concealed machines other than the 3-PRUP share: drives that yield, and sensors that stand somewhere.

Nothing here comes from the package. A machine is a mechanism between drives and a platform; each drive yields under
its load by a law of its own, and the sensors report what they make of wrench, position and pose. SI units and radians.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from .ground import Ground
from .rotations import matrix, vector

G = 9.80665  # m/s^2, along -z
T_REF = 20.0  # degC
MOVES = 1e-6  # m, rad, that an encoder reports as a move
WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")
SENSOR_PARAMETERS: dict[str, str] = {
    **{f"wrench_sensor.gain_{name}": "wrench_gain" for name in WRENCH},
    **{f"wrench_sensor.r{axis}": "wrench_rotation" for axis in "xyz"},
    **{f"target.{axis}": "target_position" for axis in "xyz"},
    **{f"target.r{axis}": "target_rotation" for axis in "xyz"},
    **{f"pose_sensor.{axis}": "frame_position" for axis in "xyz"},
    **{f"pose_sensor.r{axis}": "frame_rotation" for axis in "xyz"},
}


@dataclass
class Seen:
    """What a run returns, sample by sample: the pose sensor's p [m] (N, 3) and r [rad] (N, 3), without noise.

    residual (N,): what is left of the equations, 1 means 1e-9 m or rad.
    """

    p: np.ndarray
    r: np.ndarray
    residual: np.ndarray


@dataclass(frozen=True)
class Frame:
    """Where something is measured: p' = turn p + shift and turn R outside, p + R shift and R turn on the body."""

    turn: np.ndarray
    shift: np.ndarray


def hardened(linear, doubling):
    """x with x (1 + (x / doubling)^2) = linear, by bisection: x lies between zero and linear."""
    low, high = np.zeros_like(linear), np.abs(linear)
    for _ in range(100):
        middle = (low + high) / 2
        less = middle * (1 + (middle / doubling) ** 2) < np.abs(linear)
        low, high = np.where(less, middle, low), np.where(less, high, middle)
    return np.sign(linear) * high


class Machine:
    """One machine: the nominal one, its effects, and by how much its parameters are off (`PARAMETERS`).

    `effects` is a sequence of mappings with "physics", "location" and the sizes that `_effect_<physics>` lists.
    Subclasses give `DRIVES` (names), `ACTUATED` (the drives' joints), `STIFFNESS` of the drives, `PARAMETERS`, and
    the methods `_place`, `_misplace` and `_equilibrium`.
    """

    DRIVES: ClassVar[tuple[str, ...]]
    ACTUATED: ClassVar[tuple[str, ...]]
    STIFFNESS: ClassVar[np.ndarray]
    HOME: ClassVar[np.ndarray] = np.zeros(6)  # where the drives stand at home
    PARAMETERS: ClassVar[dict[str, str]]

    def __init__(self, effects: Sequence[Mapping[str, Any]] = (), scatter: Mapping[str, float] | None = None):
        n = len(self.DRIVES)
        self.stiffness = np.array(self.STIFFNESS, float)
        self.offset, self.slope, self.growth = np.zeros(n), np.zeros(n), np.zeros(n)
        self.gap, self.smooth = np.zeros(n), np.ones(n)
        self.contact: list[dict] = []
        self.harder: list[dict] = []
        self.alien: list[dict] = []
        self.mass: dict[str, float] = {}  # factors of bodies
        self.payload: list[dict] = []
        self.springs: list[dict] = []
        self.weighs = False
        self.ground = Ground()
        self.gain, self.bias, self.turn = np.ones(6), np.zeros(6), np.zeros(3)
        self.frame = Frame(np.zeros(3), np.zeros(3))
        self.pose_scale = 1.0
        self.target = Frame(np.zeros(3), np.zeros(3))
        self.moved = np.zeros(0, bool)  # samples of the present run before which the drives moved
        for name, amount in (scatter or {}).items():
            self._take(name, float(amount))
        for effect in effects:
            getattr(self, "_effect_" + effect["physics"])(dict(effect))

    # ---- scatter -------------------------------------------------------------------------------------------------
    def _take(self, name: str, amount: float) -> None:
        """Let one parameter be off by `amount`, in the unit of its tolerance."""
        place, _, what = name.rpartition(".")
        axis = "xyz".find(what[-1])
        if what == "stiffness":
            self.stiffness[self.DRIVES.index(place)] *= 1 + amount
        elif what == "encoder_offset":
            self.offset[self.ACTUATED.index(place)] += amount
        elif what == "encoder_slope":
            self.slope[self.ACTUATED.index(place)] += amount
        elif what == "mass":
            self.mass[place] = self.mass.get(place, 1.0) * (1 + amount)
        elif what.startswith("gain_"):  # true = (1 + amount) times what is reported, then turned by exp(r)
            self.gain[WRENCH.index(what[5:])] /= 1 + amount
        elif place == "wrench_sensor":
            self.turn[axis] -= amount
        elif place in ("target", "pose_sensor"):
            frame = self.target if place == "target" else self.frame
            (frame.turn if what[0] == "r" else frame.shift)[axis] += amount
        else:
            self._misplace(place, what[0] == "r", axis, amount)

    def _misplace(self, place: str, turned: bool, axis: int, amount: float) -> None:
        """Shift [m] or turn [rad] a joint along or about one axis."""
        raise NotImplementedError

    # ---- effects -------------------------------------------------------------------------------------------------
    def _at(self, e) -> list[int]:
        """The drives of an effect: that of its location, or all alike at "robot"."""
        here = e["location"]
        return list(range(len(self.DRIVES))) if here == "robot" else [self.DRIVES.index(here)]

    def _effect_self_weight(self, e):
        """All bodies weigh."""
        self.weighs = True

    def _effect_stiffness_changed(self, e):
        """factor (1) of a drive's stiffness."""
        self.stiffness[self._at(e)] *= e["factor"]

    def _effect_backlash(self, e):
        """half_gap (m, rad) and smooth (N, N m): half_gap tanh(load/smooth) on top of the elastic part."""
        i = self.DRIVES.index(e["location"])
        self.gap[i] += e["half_gap"]
        self.smooth[i] = e["smooth"]

    def _effect_hertzian_contact(self, e):
        """f0, f_ref (N, N m): dF/du = k ((|F| + f0)/f_ref)^(1/3) instead of k."""
        self.contact.append(e)

    def _effect_hardening(self, e):
        """doubling (m, rad): load = k x (1 + (x / doubling)^2) instead of k x."""
        self.harder.append(e)

    def _effect_lead_error(self, e):
        """ratio (1): the drive moves by so much more than its encoder says."""
        self.slope[self.DRIVES.index(e["location"])] += e["ratio"]

    def _effect_encoder_offset(self, e):
        """offset (m, rad): true = reported + offset."""
        self.offset[self.ACTUATED.index(e["location"])] += e["offset"]

    def _effect_thermal_growth(self, e):
        """coefficient (1/K) of the length that a drive holds, against 20 degC."""
        self.growth[self._at(e)] += e["coefficient"]

    def _effect_geometric_offset(self, e):
        """place (a joint of `PARAMETERS`), translation (m, 3), rotation (rad, 3)."""
        for turned, key in ((False, "translation"), (True, "rotation")):
            for axis, amount in enumerate(e.get(key, ())):
                if amount:
                    self._misplace(e["place"], turned, axis, amount)

    def _effect_payload(self, e):
        """mass (kg) at lever (m, 3, tool frame)."""
        self.payload.append({"lever": np.zeros(3)} | e)

    def _effect_external_spring(self, e):
        """stiffness (N/m) of a hose from the tool point to where it is slack, at `rest` (m, 3, base frame)."""
        self.springs.append(e)

    def _effect_base_compliance(self, e):
        """translation (m/N) and rotation (rad/(N m)) of what the robot stands on, one number or one by axis."""
        self.ground.give(e)

    def _effect_wrench_sensor_misalignment(self, e):
        """rotation (rad, 3): reported = exp([rotation]) true."""
        self.turn += np.asarray(e["rotation"], float)

    def _effect_wrench_sensor_gain(self, e):
        """gain (6 or scalar): reported = gain * true, by component."""
        self.gain = self.gain * np.asarray(e["gain"], float)

    def _effect_wrench_sensor_bias(self, e):
        """bias (6; N, N m): reported = true + bias."""
        self.bias += np.asarray(e["bias"], float)

    def _effect_pose_sensor_misalignment(self, e):
        """rotation (rad, 3), translation (m, 3): measured p = exp([rotation]) p + translation, R likewise."""
        self._move(self.frame, e)

    def _effect_pose_sensor_scale(self, e):
        """error (1): measured p is 1 + error times what it is in the sensor's own frame."""
        self.pose_scale *= 1 + e["error"]

    def _effect_target_misalignment(self, e):
        """rotation (rad, 3), translation (m, 3): measured p + R translation, R exp([rotation])."""
        self._move(self.target, e)

    @staticmethod
    def _move(frame: Frame, e) -> None:
        frame.turn[:] += np.asarray(e["rotation"], float)
        frame.shift[:] += np.asarray(e.get("translation", np.zeros(3)), float)

    def _effect_alien(self, e):
        """Physics outside every library, by kind: cubic (coefficient x load^3), quadratic (coefficient x load |load|),
        one_sided (compliance coefficient only where the load is positive), coupling (coefficient x another drive's
        load, `of` counted from 1)."""
        self.alien.append(e)

    # ---- drives --------------------------------------------------------------------------------------------------
    def _standing(self, q, temperature):
        """Where the drives stand (N, n) when their encoders report q, before anything yields."""
        grown = self.growth * (temperature - T_REF)[:, None]
        return q + self.offset + self.slope * q + grown * self._held_length(q)

    def _held_length(self, q):
        """The length (N, n) that each drive holds and that grows, at joint positions q."""
        return np.zeros_like(q)

    def _yields(self, load):
        """Displacement (..., n) of the drives under loads (..., n) that act in their positive direction."""
        out = load / self.stiffness + self.gap * np.tanh(load / self.smooth)
        for e in self.contact:
            i = self.DRIVES.index(e["location"])
            size = np.abs(load[..., i])
            soft = 1.5 * np.cbrt(e["f_ref"]) / self.stiffness[i]
            bent = soft * (np.cbrt(size + e["f0"]) ** 2 - np.cbrt(e["f0"]) ** 2)
            out[..., i] += np.sign(load[..., i]) * bent - load[..., i] / self.stiffness[i]
        for e in self.harder:
            i = self.DRIVES.index(e["location"])
            linear = load[..., i] / self.stiffness[i]
            out[..., i] += hardened(linear, e["doubling"]) - linear
        for e in self.alien:
            i = self.DRIVES.index(e["location"])
            x, c = load[..., i], e["coefficient"]
            if e["kind"] == "cubic":
                out[..., i] += c * x**3
            elif e["kind"] == "quadratic":
                out[..., i] += c * x * np.abs(x)
            elif e["kind"] == "one_sided":
                out[..., i] += c * 0.5 * (x + np.sqrt(x * x + 0.01))
            else:
                out[..., i] += c * load[..., e["of"] - 1]
        return out

    def _factor(self, body: str) -> float:
        return self.mass.get(body, 1.0)

    def _on_tool(self, w, p, rot):
        """Wrenches (..., 6) on the tool point: what is applied, payloads and springs. p (..., 3), rot (..., 3, 3)."""
        total = np.broadcast_to(w, (*p.shape[:-1], 6)).copy()
        for e in self.payload:
            force = np.array([0.0, 0.0, -G * e["mass"]])
            total[..., :3] += force
            total[..., 3:] += np.cross(rot @ np.asarray(e["lever"], float), force)
        for e in self.springs:
            total[..., :3] -= e["stiffness"] * (p - np.asarray(e["rest"], float))
        return total

    # ---- sensors -------------------------------------------------------------------------------------------------
    def report_wrench(self, w):
        """Wrench (N, 6) that the sensor reports for a true one, without noise."""
        rot = matrix(self.turn)
        return np.hstack([w[:, :3] @ rot.T, w[:, 3:] @ rot.T]) * self.gain + self.bias

    def true_wrench(self, reported):
        """Inverse of `report_wrench`."""
        rot = matrix(self.turn)
        w = (reported - self.bias) / self.gain
        return np.hstack([w[:, :3] @ rot, w[:, 3:] @ rot])

    def simulate(self, q, w, temperature=None, time=None) -> Seen:
        """Equilibria at encoder readings q (N, n) under true wrenches w [N, N m] (N, 6) on the tool, base frame."""
        q, w = np.atleast_2d(np.asarray(q, float)), np.atleast_2d(np.asarray(w, float))
        temperature = np.full(len(q), T_REF) if temperature is None else np.asarray(temperature, float)
        self.moved = np.append(True, np.abs(np.diff(q, axis=0)).max(axis=1) > MOVES)
        standing = self._standing(q, temperature)
        p, rot, residual = self._leaning(standing, w) if self.ground.is_soft else self._equilibrium(standing, w)
        p = p + rot @ self.target.shift
        rot = rot @ matrix(self.target.turn)
        turn = matrix(self.frame.turn)
        return Seen(self.pose_scale * (p @ turn.T + self.frame.shift), vector(turn @ rot), residual)

    def _leaning(self, standing, w):
        """The same on ground that gives way: the robot leans, and what pulls at its tool keeps its direction."""
        weights = self._weights(standing) if self.weighs else []
        rest = [(force, centre[0]) for force, centre in self._weights(self.HOME[None])] if self.weighs else []
        shift, lean = np.zeros((len(w), 3)), np.broadcast_to(np.eye(3), (len(w), 3, 3))
        for _ in range(3):
            own = np.hstack([(lean.mT @ part[..., None])[..., 0] for part in np.split(w, 2, axis=1)])
            p, rot, residual = self._equilibrium(standing, own)
            p, rot = (lean @ p[..., None])[..., 0] + shift, lean @ rot
            total = self._on_tool(w, p, rot)
            shift, lean = self.ground.leans([(total[:, :3], p), *weights], total[:, 3:], rest)
        return p, rot, residual

    def _weights(self, standing):
        """Weights (3,) and centres (N, 3) of the bodies of a robot whose drives stand there, before anything yields."""
        raise NotImplementedError

    def _equilibrium(self, standing, w):
        """True p (N, 3) and R (N, 3, 3) of the tool, and what is left of the equations (N,)."""
        raise NotImplementedError


def newton(residual, unknowns, steps, rounds=40, good=1e-9):
    """Solve residual(x) = 0 for all samples at once; x (N, n), residual maps (..., N, n) to the same shape.

    Derivatives are differences over `steps` (n,); a step that makes it worse is halved. Returns x and the largest
    residual over `good` (N,).
    """
    x = np.array(unknowns, float)
    r = residual(x)
    for _ in range(rounds):
        if np.abs(r).max() < 0.01 * good:
            break
        moved = residual(x[None] + np.diag(steps)[:, None, :])  # (n, N, n)
        back = residual(x[None] - np.diag(steps)[:, None, :])
        jacobian = np.moveaxis((moved - back) / (2 * steps[:, None, None]), 0, -1)
        step = np.linalg.solve(jacobian, r[..., None])[..., 0]
        share, old = np.ones(len(x)), np.abs(r).max(1)
        for _ in range(6):
            new = residual(x - share[:, None] * step)
            worse = (np.abs(new).max(1) > old) & (old > good)
            if not worse.any():
                break
            share = np.where(worse, 0.5 * share, share)
        x = x - share[:, None] * step
        r = residual(x)
    return x, np.abs(r).max(1) / good
