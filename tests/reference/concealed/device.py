"""A physical 3-PRUP robot that is not quite the nominal one, simulated on its own terms.

Nothing here comes from the package: the geometry, the statics and the numbers are written out again, so that
the package's loaded simulation can be checked against it and its diagnosis tried blind.

Formulation. Every leg is followed from the point where its bush touches the platform's branch, in both
directions. Inwards, the branch is a Kirchhoff rod (large rotations, axial force acting on the bent shape,
stretch) integrated from its loaded end to the hub; outwards come the bush's spring, the U-joint's springs,
the offset, the R_lambda bearing, the linear rod (a Kirchhoff rod as well) integrated from its tip to the guide
in the top plate, and the drive. Since the end loads of both rods are known in the frames of their own ends, no
boundary-value problem is left: the guide's pose relative to the hub is an explicit function of six unknowns a
leg, the two bush forces normal to the branch, the distance b along it and the joint angles theta, phi, lambda.
The guide's pose must be the machine's (18 equations) and the hub be in equilibrium (6), which with the
platform's pose makes 24 equations. Newton's method solves them for all samples at once.

SI units and radians. Base frame: origin in the top plate, z along the rods towards the platform, gravity along
+z. Legs count from 0 in the arrays and from 1 in names such as "leg1/ball_nut". Quaternions are (w, x, y, z).
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .ground import Ground

G = 9.80665  # m/s^2, along +z
ALPHA = np.radians([0.0, 120.0, 240.0])  # rad, legs around the base
ENDLESS = 1e12  # N m or N, a limit that nothing reaches
T_REF = 20.0  # degC

NOMINAL: dict[str, float] = {
    "a": 0.181,  # m, radius of the base triangle
    "d": 0.100,  # m, R_lambda to the U-joint's centre
    "linear_rod.E": 201e9,  # Pa
    "linear_rod.A": 314.16e-6,  # m^2
    "linear_rod.I": 7854e-12,  # m^4
    "moving_star_branch.E": 201e9,
    "moving_star_branch.A": 113.1e-6,
    "moving_star_branch.I": 1017.9e-12,
    "ball_screw.E": 206e9,
    "ball_screw.A": 176.7e-6,
    "ball_screw.length": 0.610,  # m
    "ball_nut.axial": 505e6,  # N/m
    "support_bearing.axial": 34.64e6,
    "timing_belt.stiffness": 18.04e6,
    "motor.torsional": 6875.5,  # N m/rad
    "R_lambda.radial": 96.9e6,
    "R_lambda.axial": 46.4e6,
    "R_lambda.tilting": 6268.45,
    "R_phi.axial": 25e6,
    "R_phi.radial": 117.5e6,
    "R_theta_P.radial": 65.2e6,
    "lead": 0.010,  # m
}
# Eqs. (97)-(102): motor torque per axial force, R P eta / (2 pi), and belt force per axial force, 2/D_PM times it
TORQUE_PER_FORCE = (100.0 / 35.0) * 0.010 * 0.8 / (2.0 * np.pi)  # m
BELT_PER_FORCE = 2.0 / 0.100 * TORQUE_PER_FORCE  # 1
STEEL = 7850.0  # kg/m^3
POISSON = 0.3
WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")
SHEAR_COEFFICIENT = 0.9  # of a full circle

#: What may scatter in a module, by the robot file's names: the key here, and the key of its tolerance.
PAR_OF = {
    "linear_rod.youngs_modulus": "linear_rod.E",
    "moving_star_branch.youngs_modulus": "moving_star_branch.E",
    "ball_screw.youngs_modulus": "ball_screw.E",
    "ball_nut.stiffness": "ball_nut.axial",
    "support_bearing.stiffness": "support_bearing.axial",
    "timing_belt.stiffness": "timing_belt.stiffness",
    "motor.torsional_stiffness": "motor.torsional",
    "R_lambda.radial_stiffness": "R_lambda.radial",
    "R_lambda.axial_stiffness": "R_lambda.axial",
    "R_lambda.tilting_stiffness": "R_lambda.tilting",
    "R_phi.axial_stiffness": "R_phi.axial",
    "R_phi.radial_stiffness": "R_phi.radial",
    "R_theta_P.radial_stiffness": "R_theta_P.radial",
}
#: Every parameter that may scatter, and the key of its tolerance. Relative where that is relative, else m and rad.
PARAMETERS: dict[str, str] = {
    **{f"leg{leg}/{name}": "bending" if name.startswith(("linear", "moving")) else "stiffness"
       for leg in (1, 2, 3) for name in PAR_OF},
    **{f"leg{leg}_slide.{axis}": "position" for leg in (1, 2, 3) for axis in "xyz"},
    **{f"leg{leg}_slide.r{axis}": "direction" for leg in (1, 2, 3) for axis in "xy"},
    **{f"leg{leg}_slide.{name}": name for leg in (1, 2, 3) for name in ("encoder_offset", "encoder_slope")},
    **{f"{body}.mass": "mass" for body in ("hub", *(f"{part}" for leg in (1, 2, 3)
                                                    for part in (f"leg{leg}_rod", f"star_{leg}")))},
    **{f"wrench_sensor.gain_{name}": "wrench_gain" for name in WRENCH},
    **{f"wrench_sensor.r{axis}": "wrench_rotation" for axis in "xyz"},
    **{f"target.{axis}": "target_position" for axis in "xyz"},
    **{f"target.r{axis}": "target_rotation" for axis in "xyz"},
    **{f"pose_sensor.{axis}": "frame_position" for axis in "xyz"},
    **{f"pose_sensor.r{axis}": "frame_rotation" for axis in "xyz"},
}  # fmt: skip


# ------------------------------------------------------------------------------------------------ small algebra
def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _add(a, b):
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def _sub(a, b):
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _neg(a):
    return -a[0], -a[1], -a[2]


def _scale(s, a):
    return s * a[0], s * a[1], s * a[2]


def _qmul(p, q):
    return (
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
        p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
    )


def _qinv(q):
    return q[0], -q[1], -q[2], -q[3]


def _qrot(q, v):
    """R(q) v."""
    t = _cross(q[1:], v)
    t = (2 * t[0], 2 * t[1], 2 * t[2])
    u = _cross(q[1:], t)
    return v[0] + q[0] * t[0] + u[0], v[1] + q[0] * t[1] + u[1], v[2] + q[0] * t[2] + u[2]


def _qexp(v):
    """Quaternion of a rotation vector."""
    a2 = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    h = 0.5 * np.sqrt(a2)
    s = 0.5 * np.sinc(h / np.pi)
    return np.cos(h), s * v[0], s * v[1], s * v[2]


def _qlog(q):
    """Rotation vector of a quaternion, of angle below pi."""
    sign = np.where(q[0] < 0, -1.0, 1.0)
    n = np.sqrt(q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
    angle = 2 * np.arctan2(n, sign * q[0])
    f = np.where(n > 1e-12, angle / np.where(n > 1e-12, n, 1.0), 2.0) * sign
    return f * q[1], f * q[2], f * q[3]


def _rot_x(c, s, v):
    return v[0], c * v[1] - s * v[2], s * v[1] + c * v[2]


def _rot_y(c, s, v):
    return c * v[0] + s * v[2], v[1], -s * v[0] + c * v[2]


def _rot_z(c, s, v):
    return c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]


def _qmat(q):
    """Rotation matrix, (..., 3, 3)."""
    w, x, y, z = q
    return np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], -1),
            np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], -1),
            np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], -1),
        ],
        -2,
    )


# ------------------------------------------------------------------------------------------------ rods
def integrate_rod(axis, length, force, moment, ei, ea, gj_inv, ga_inv, weight, steps):
    """A rod from its loaded end (origin, frame of that end) backwards over `length` [m].

    `force` [N] and `moment` [N m] act on the end, in its frame; `weight` [N/m] is a line load in that frame;
    `axis` 0 or 2 says which axis of the frame points along the rod and out of the end. `gj_inv` [1/(N m^2)] and
    `ga_inv` [1/N] may be 0: no twist, no shear. Returns the other end's position, quaternion, and the force and
    moment that the rod carries there, all in the loaded end's frame.

    Kirchhoff's rod with stretch (and shear): q' from curvature m/EI in the section's frame, x' from the
    tangent, m' = -x' x n, Runge-Kutta of fourth order.
    """
    ei_inv, ea_inv = 1.0 / ei, 1.0 / ea
    one = np.ones_like(force[1] * length)
    zero = np.zeros_like(one)
    x, q, m = (zero, zero, zero), (one, zero, zero, zero), tuple(c * one for c in moment)
    h = length / steps
    shear = np.any(np.asarray(ga_inv) != 0)
    heavy = any(np.any(np.asarray(c) != 0) for c in weight)

    def rate(q, m, s):
        n = tuple(force[k] + weight[k] * s for k in range(3)) if heavy else force
        w, a, b, c = q
        if axis == 2:
            t = (2 * (a * c + w * b), 2 * (b * c - w * a), 1 - 2 * (a * a + b * b))
        else:
            t = (1 - 2 * (b * b + c * c), 2 * (a * b + w * c), 2 * (a * c - w * b))
        nt = n[0] * t[0] + n[1] * t[1] + n[2] * t[2]
        stretch = 1.0 + nt * ea_inv
        dx = (-stretch * t[0], -stretch * t[1], -stretch * t[2])
        if shear:
            dx = tuple(dx[k] - ga_inv * (n[k] - nt * t[k]) for k in range(3))
        # rotation rate as a vector in the end's frame: bending about the normals, twist about the tangent
        mt = m[0] * t[0] + m[1] * t[1] + m[2] * t[2]
        twist = mt * (gj_inv - ei_inv)
        k = tuple(-0.5 * (ei_inv * m[j] + twist * t[j]) for j in range(3))
        dq = (
            -(k[0] * a + k[1] * b + k[2] * c),
            k[0] * w + k[1] * c - k[2] * b,
            k[1] * w + k[2] * a - k[0] * c,
            k[2] * w + k[0] * b - k[1] * a,
        )
        return dx, dq, _neg(_cross(dx, n))

    for i in range(steps):
        s = i * h
        x1, q1, m1 = rate(q, m, s)
        x2, q2, m2 = rate(*_step(q, m, q1, m1, h / 2), s + h / 2)
        x3, q3, m3 = rate(*_step(q, m, q2, m2, h / 2), s + h / 2)
        x4, q4, m4 = rate(*_step(q, m, q3, m3, h), s + h)
        f = h / 6
        x = tuple(x[k] + f * (x1[k] + 2 * (x2[k] + x3[k]) + x4[k]) for k in range(3))
        m = tuple(m[k] + f * (m1[k] + 2 * (m2[k] + m3[k]) + m4[k]) for k in range(3))
        q = tuple(q[k] + f * (q1[k] + 2 * (q2[k] + q3[k]) + q4[k]) for k in range(4))
    norm = 1.0 / np.sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
    q = tuple(norm * c for c in q)
    n = tuple(force[k] + weight[k] * length for k in range(3)) if heavy else force
    return x, q, n, m


def _step(q, m, dq, dm, h):
    return tuple(q[k] + h * dq[k] for k in range(4)), tuple(m[k] + h * dm[k] for k in range(3))


# ------------------------------------------------------------------------------------------------ laws of a spring
def _play(force, half_gap, smooth):
    """Displacement [m] of a joint with play: half_gap with the sign of the force, rounded within `smooth` [N]."""
    return half_gap * np.tanh(force / smooth)


def _hertz(force, k, f0, f_ref, secant):
    """Force over displacement [N/m] of a contact that stiffens with load, force [N] >= 0.

    dF/du = k ((F + f0)/f_ref)^(1/3) gives u = 1.5 f_ref^(1/3)/k ((F + f0)^(2/3) - f0^(2/3)).
    """
    if secant:
        return k * np.cbrt((force + f0) / f_ref)
    u = 1.5 * np.cbrt(f_ref) / k * (np.cbrt(force + f0) ** 2 - np.cbrt(f0) ** 2)
    return np.where(u > 0, force / np.where(u > 0, u, 1.0), k * np.cbrt(f0 / f_ref))


@dataclass
class Response:
    """What a run returns, sample by sample.

    p [m] (N, 3) and r [rad] (N, 3): pose as the pose sensor sees it, without noise; bush_force [N] (N, 3, 3) on
    the platform in the base frame; angles [rad] (N, 3, 3) theta, phi, lambda; branch [m] (N, 3) distance b;
    drive_force [N] (N, 3) along z on the rods' roots; residual (N,) of the equations in scaled units;
    iterations, the largest number of Newton steps.
    """

    p: np.ndarray
    r: np.ndarray
    bush_force: np.ndarray
    angles: np.ndarray
    branch: np.ndarray
    drive_force: np.ndarray
    residual: np.ndarray
    iterations: int
    loads: dict[str, np.ndarray] = field(default_factory=dict)


class Device:
    """One device: the nominal robot and its effects.

    `effects` is a sequence of mappings with "physics", "location" and the sizes that the docstring of
    the method `_effect_<physics>` lists. `steps` is the number of Runge-Kutta steps a rod. `scatter` says by how much
    parameters are off that nobody left out, by the names of `PARAMETERS`.
    """

    def __init__(self, effects: Any = (), steps: int = 4, scatter: Mapping[str, float] | None = None):
        self.effects = [dict(e) for e in effects]
        self.steps = steps
        self.par: dict[str, np.ndarray] = {k: np.full((3, 1), v) for k, v in NOMINAL.items()}
        self.gap: dict[str, tuple[np.ndarray, float]] = {}  # module.direction -> half gap (3, 1), smoothing
        self.gap_by_axis: dict[str, tuple[np.ndarray, float]] = {}  # likewise, each of two directions for itself
        self.hertz: dict[str, list[dict]] = {}
        self.friction: dict[str, dict[str, np.ndarray]] = {}  # joint -> limit, presliding (3, 1)
        self.friction_kept = False
        self.encoder_delay = np.zeros(3)
        self.base = np.zeros((3, 3))  # (leg, radial/tangential/height)
        self.base_shift = np.zeros((3, 3))  # (leg, x/y/z)
        self.tilt = np.zeros((3, 2))  # rad, of the guide in the top plate, about the base's x and y
        self.offset_extra = np.zeros((3, 1))  # yoke longer without a shorter rod
        self.clamp = np.zeros((3, 1))  # rad/(N m), rod's clamp
        self.hub_clamp = np.zeros((3, 1))
        self.shear = self.torsion = False
        self.weight: dict | None = None
        self.payload: list[dict] = []
        self.springs: list[dict] = []
        self.thermal: list[dict] = []
        self.lead: list[dict] = []
        self.encoder = np.zeros((3, 1))
        self.creep: list[dict] = []
        self.alien: list[dict] = []
        self.wrench_gain = np.ones(6)
        self.wrench_bias = np.zeros(6)
        self.wrench_turn = np.zeros(3)
        self.wrench_talk = np.eye(6)
        self.pose_turn = np.zeros(3)
        self.pose_shift = np.zeros(3)
        self.pose_scale = 1.0
        self.ground = Ground()
        self.tool_soft = np.zeros((2, 3))
        self.target_turn = np.zeros(3)
        self.target_shift = np.zeros(3)
        self.mass = {"rod": np.ones((3, 1)), "branch": np.ones((3, 1)), "hub": 1.0}  # factors
        for name, amount in (scatter or {}).items():
            self._take(name, float(amount))
        for e in self.effects:
            getattr(self, "_effect_" + e["physics"])(e)

    # ---- scatter -----------------------------------------------------------------------------------------------
    def _take(self, name: str, amount: float):
        """Let one parameter be off by `amount` in the unit of its tolerance."""
        place, _, what = name.rpartition(".")
        leg = int(place[3]) - 1 if place.startswith("leg") else 0
        axis = "xyz".find(what[-1])
        if "/" in place:
            self.par[PAR_OF[name.split("/", 1)[1]]][leg] *= 1.0 + amount
        elif what == "mass":
            if place == "hub":
                self.mass["hub"] *= 1.0 + amount
            else:
                kind, leg = ("branch", int(place[-1]) - 1) if place.startswith("star") else ("rod", leg)
                self.mass[kind][leg] *= 1.0 + amount
        elif place == "wrench_sensor":
            if what.startswith("gain"):  # true = (1 + amount) times what is reported, then turned by exp(r)
                self.wrench_gain[WRENCH.index(what[5:])] /= 1.0 + amount
            else:
                self.wrench_turn[axis] -= amount
        elif place in ("pose_sensor", "target"):
            kind = "pose" if place == "pose_sensor" else "target"
            getattr(self, f"{kind}_{'turn' if what[0] == 'r' else 'shift'}")[axis] += amount
        elif what == "encoder_offset":
            self.encoder[leg] += amount
        elif what == "encoder_slope":
            self.lead.append({"q0": 0.0, "phase": 0.0, "legs": [leg], "ratio": amount})
        elif what[0] == "r":
            self.tilt[leg, axis] += amount
        else:
            self.base_shift[leg, axis] += amount

    # ---- effects -----------------------------------------------------------------------------------------------
    @staticmethod
    def _legs(e) -> list[int]:
        loc = e.get("location", "robot")
        return [int(loc[3]) - 1] if loc.startswith("leg") else [0, 1, 2]

    @staticmethod
    def _module(e) -> str:
        loc = e["location"]
        return loc.split("/", 1)[1] if "/" in loc else loc

    def _effect_stiffness_changed(self, e):
        """parameter (key of NOMINAL without the module, default the only one), factor (1)."""
        name = f"{e.get('module', self._module(e))}.{e['parameter']}"
        for i in self._legs(e):
            self.par[name][i] *= e["factor"]

    def _effect_backlash(self, e):
        """direction (axial, radial), half_gap (m), smooth (N, default 0.5), by_axis (bool).

        A radial gap is round, or, with `by_axis`, each of the two directions across has play for itself: along the
        axes of the part that the robot file gives the bearing's stiffnesses in.
        """
        key = f"{self._module(e)}.{e.get('direction', 'axial')}"
        gaps = self.gap_by_axis if e.get("by_axis") else self.gap
        gap, _ = gaps.get(key, (np.zeros((3, 1)), 0.0))
        for i in self._legs(e):
            gap[i] += e["half_gap"]
        gaps[key] = (gap, e.get("smooth", 0.5))

    def _effect_hertzian_contact(self, e):
        """direction (radial), f0 (N), f_ref (N): dF/du = k0 ((|F| + f0)/f_ref)^(1/3), along the force.

        With secant=True the same expression is force over displacement.
        """
        self.hertz.setdefault(f"{self._module(e)}.{e.get('direction', 'radial')}", []).append(
            {"legs": self._legs(e), "f0": e["f0"], "f_ref": e["f_ref"], "secant": e.get("secant", False)}
        )

    def _effect_coulomb_friction(self, e):
        """joint (theta, phi, lambda, slide), limit (N m; N for slide), presliding (rad or m), kept (bool).

        Elastoplastic: torque = limit/presliding times the motion since the reference, held within +-limit; the
        reference is dragged along. It is the unloaded position at every new pose, unless `kept`.
        Rods and branches twist (torsion, default True): only friction can twist a branch, and its twist between
        bush and hub then adds to the presliding.
        """
        j = e.get("joint") or {"R_theta_P": "theta", "R_phi": "phi", "R_lambda": "lambda"}[self._module(e)]
        f = self.friction.setdefault(j, {"limit": np.zeros((3, 1)), "presliding": np.full((3, 1), 2.3e-4)})
        for i in self._legs(e):
            f["limit"][i] = e["limit"]
            f["presliding"][i] = e.get("presliding", 2.3e-4)
        self.friction_kept |= bool(e.get("kept", False))
        self.torsion |= bool(e.get("torsion", True))

    def _effect_viscous_friction(self, e):
        """joint (theta, phi, lambda, slide), damping (N m s/rad; N s/m for slide): torque by the way since the sample
        before, over the time since; none at the first sample of a pose. Rods and branches twist, as above."""
        j = e.get("joint") or {"R_theta_P": "theta", "R_phi": "phi", "R_lambda": "lambda"}[self._module(e)]
        f = self.friction.setdefault(j, {"limit": np.zeros((3, 1)), "presliding": np.full((3, 1), 2.3e-4)})
        f["viscous"] = True
        for i in self._legs(e):
            # a spring from where the joint was one second before, which nothing limits
            f["limit"][i] = ENDLESS
            f["presliding"][i] = ENDLESS / e["damping"]
        self.torsion |= bool(e.get("torsion", True))

    def _effect_encoder_delay(self, e):
        """delay (s): an encoder reports where its actuator was."""
        for i in self._legs(e):
            self.encoder_delay[i] += e["delay"]

    def _effect_self_weight(self, e):
        """density (kg/m^3), branch_length, rod_length (m), hub_mass (kg), g (m/s^2), branches.

        branches "distributed": a line load on the bent branch, what is beyond the bush included; "hub": the
        branches' whole weight at P. The rod's part above the guide (rod_length None: no such part) pushes on
        the drive alone.
        """
        self.weight = {
            "density": STEEL,
            "branch_length": 0.26,
            "rod_length": 0.5,
            "hub_mass": 4.0,
            "g": G,
            "branches": "distributed",
        } | {k: v for k, v in e.items() if k not in ("physics", "location")}

    def _effect_shear(self, e):
        """All rods and branches shear: G = E/(2 (1 + 0.3)), coefficient 0.9; parameters optional."""
        self.shear = e.get("coefficient", SHEAR_COEFFICIENT)

    def _effect_torsion(self, e):
        """All rods and branches twist: G as for shear, J = 2 I."""
        self.torsion = True

    def _effect_root_tilt_compliance(self, e):
        """stiffness (N m/rad) of the clamp of the linear rod, both tilts."""
        for i in self._legs(e):
            self.clamp[i] = 1.0 / e["stiffness"]

    def _effect_hub_root_compliance(self, e):
        """stiffness (N m/rad) of the branch's clamp at the hub, both tilts."""
        for i in self._legs(e):
            self.hub_clamp[i] = 1.0 / e["stiffness"]

    def _effect_thermal_growth(self, e):
        """coefficient (1/K), of: the length that grows, against 20 degC.

        of "q": from the base to the U-joint's centre (the screw's default); "q-d": the rod below the guide (the
        rod's default); "full": the whole screw; "top": the screw above the nut.
        """
        of = "q-d" if self._module(e) == "linear_rod" else "q"
        self.thermal.append({"coefficient": 1.17e-5, "of": of, "legs": self._legs(e)} | e)

    def _effect_lead_error(self, e):
        """kind proportional: ratio (1), about q0 (m); kind periodic: amplitude (m), phase (rad)."""
        self.lead.append({"q0": 0.0, "phase": 0.0, "legs": self._legs(e)} | e)

    def _effect_eccentric_encoder(self, e):
        """amplitude (m), phase (rad), waves in a turn of the motor: the belt takes the screw round faster."""
        period = 0.100 / 0.035 * NOMINAL["lead"] / e["waves"]
        self.lead.append({"kind": "periodic", "phase": 0.0, "legs": self._legs(e), "period": period} | e)

    def _effect_geometric_offset(self, e):
        """radial, tangential, height (m) of A_i; offset (m): longer yoke, the U-joint's centre moves with it.

        tilt (rad, 2): the guide's direction is turned by exp(tilt_x, tilt_y, 0), base axes, about A_i.
        """
        for i in self._legs(e):
            self.tilt[i] += e.get("tilt", (0.0, 0.0))
            self.base[i] += [e.get("radial", 0.0), e.get("tangential", 0.0), e.get("height", 0.0)]
            self.offset_extra[i] += e.get("offset", 0.0)

    def _effect_encoder_offset(self, e):
        """offset (m): true position = reported + offset."""
        for i in self._legs(e):
            self.encoder[i] += e["offset"]

    def _effect_wrench_sensor_misalignment(self, e):
        """rotation (rad, 3): reported = exp([rotation]) true, force and moment alike."""
        self.wrench_turn += np.asarray(e["rotation"], float)

    def _effect_wrench_sensor_gain(self, e):
        """gain (6 or scalar): reported = gain * true, by component."""
        self.wrench_gain = self.wrench_gain * np.asarray(e["gain"], float)

    def _effect_wrench_sensor_crosstalk(self, e):
        """Channel `channel` reports `share` of what another one, `of`, is loaded with."""
        self.wrench_talk[WRENCH.index(e["channel"]), WRENCH.index(e["of"])] += e["share"]

    def _effect_wrench_sensor_bias(self, e):
        """bias (6; N, N m): reported = true + bias."""
        self.wrench_bias += np.asarray(e["bias"], float)

    def _effect_tool_compliance(self, e):
        """translation (m/N) and rotation (rad/(N m)) of what holds the target on the platform, by its axes."""
        self.tool_soft += [np.broadcast_to(np.asarray(e[key], float), 3) for key in ("translation", "rotation")]

    def _effect_pose_sensor_misalignment(self, e):
        """rotation (rad, 3), translation (m, 3): measured p = exp([rotation]) p + translation, R likewise."""
        self.pose_turn += np.asarray(e["rotation"], float)
        self.pose_shift += np.asarray(e.get("translation", np.zeros(3)), float)

    def _effect_pose_sensor_scale(self, e):
        """error (1): measured p is 1 + error times what it is in the sensor's own frame."""
        self.pose_scale *= 1 + e["error"]

    def _effect_target_misalignment(self, e):
        """rotation (rad, 3), translation (m, 3) of the target on the hub: p + R translation, R exp([rotation])."""
        self.target_turn += np.asarray(e["rotation"], float)
        self.target_shift += np.asarray(e.get("translation", np.zeros(3)), float)

    def _effect_creep(self, e):
        """direction (as in NOMINAL), ratio (1), time_constant (s).

        The module deforms on by `ratio` times its elastic deformation (Kelvin-Voigt element in series). A load
        acts from right after the sample before and is held until its own sample.
        """
        self.creep.append({"legs": self._legs(e), "module": self._module(e)} | e)

    def _effect_payload(self, e):
        """mass (kg), lever (m, 3, platform frame), g (m/s^2, along +z)."""
        self.payload.append({"lever": np.zeros(3), "g": G} | e)

    def _effect_base_compliance(self, e):
        """translation (m/N) and rotation (rad/(N m)) of what the robot stands on, one number or one by axis."""
        self.ground.give(e)

    def _effect_external_spring(self, e):
        """stiffness (N/m) of a hose from P to where it is slack, at `rest` (m, 3, base frame)."""
        self.springs.append(e)

    def _effect_alien(self, e):
        """Physics outside every library, by `kind`.

        cubic: extra drive displacement coefficient (m/N^3) F^3; drift: displacement coefficient (m/(N s)) |w| t
        of the drive; periodic_stiffness: drive compliance times
        1 + amplitude (1 + sin(2 pi q/period + phase))/2, period (m);
        coupling: extra drive displacement, coefficient (m/N) times the drive force of leg `of` (1..3);
        quadratic: extra drive displacement coefficient (m/N^2) F |F|; one_sided: drive compliance
        coefficient (m/N) added where the rod is pushed towards +z; tilt_quadratic: extra tilt of R_lambda,
        coefficient (rad/(N m)^2) M |M|, by component; angle_stiffness: compliance of R_theta_P times
        1 + amplitude sin(2 theta + phase).
        """
        self.alien.append({"legs": self._legs(e)} | e)

    # ---- sensors -----------------------------------------------------------------------------------------------
    def report_wrench(self, w: np.ndarray) -> np.ndarray:
        """Wrench (N, 6) that the sensor reports for a true one, without noise."""
        rot = _qmat(_qexp(tuple(self.wrench_turn)))
        turned = np.hstack([w[:, :3] @ rot.T, w[:, 3:] @ rot.T])
        return (turned @ self.wrench_talk.T) * self.wrench_gain + self.wrench_bias

    def report_position(self, q: np.ndarray, speeds: np.ndarray) -> np.ndarray:
        """Positions (N, 3) that the encoders report at true ones and speeds, without noise."""
        return q - self.encoder_delay * speeds

    def true_wrench(self, reported: np.ndarray) -> np.ndarray:
        """Inverse of `report_wrench`."""
        rot = _qmat(_qexp(tuple(self.wrench_turn)))
        w = np.linalg.solve(self.wrench_talk, ((reported - self.wrench_bias) / self.wrench_gain).T).T
        return np.hstack([w[:, :3] @ rot, w[:, 3:] @ rot])

    # ---- one leg -----------------------------------------------------------------------------------------------
    def _spring(self, key, components, extra, turn=None):
        """Displacement, one per component, of a bearing in one of its directions (radial: two components).

        `turn` (cosine, sine) leads from the components at hand to the bearing's own two axes.
        """
        k = self._k[key]
        size = None
        if key in self.hertz or key in self.gap:
            size = np.abs(components[0]) if len(components) == 1 else np.sqrt(sum(c * c for c in components) + 1e-12)
        for h in self.hertz.get(key, ()):
            mask = np.zeros((3, 1))
            mask[h["legs"]] = 1.0
            hk = _hertz(size, k, h["f0"], h["f_ref"], h["secant"])
            k = np.where(mask > 0, hk, k)
        out = [c / k for c in components]
        if key in self.gap:
            gap, smooth = self.gap[key]
            ratio = _play(size, gap, smooth) / np.maximum(size, 1e-12)
            out = [o + ratio * c for o, c in zip(out, components, strict=True)]
        if key in self.gap_by_axis:
            gap, smooth = self.gap_by_axis[key]
            a, b = components
            c, s = (1.0, 0.0) if turn is None else turn
            along, across = _play(c * a - s * b, gap, smooth), _play(s * a + c * b, gap, smooth)
            out = [out[0] + c * along + s * across, out[1] - s * along + c * across]
        if extra is not None:
            out = [o + x for o, x in zip(out, extra, strict=True)]
        return out

    def _aliens(self, kind):
        """The alien effects of one kind, with masks (3, 1) of their legs."""
        for e in self.alien:
            if e["kind"] == kind:
                mask = np.zeros((3, 1))
                mask[e["legs"]] = 1.0
                yield e, mask

    def _torque(self, joint, value, refs):
        """Friction torque that a joint's motion drags along, from its reference (relaxed) value."""
        if joint not in refs:
            return 0.0
        f, s = self.friction[joint], refs[joint]
        k = s["on"] * f["limit"] / f["presliding"]
        return np.clip(k * (value - s["ref"]), -f["limit"], f["limit"])

    def _leg(self, u, c):
        """All three legs for unknowns u = (f_v, f_w, b, theta, phi, lambda), each (P, 3, N).

        Returns the guide's position and quaternion relative to the hub (in the leg's own turned frame), the
        force and moment of the branch on the hub in that frame, the drive's displacement, and loads.
        """
        fv, fw, b, th, ph, la = u
        par = self.par
        k = self._k
        ct, st, cp, sp, cl, sl = np.cos(th), np.sin(th), np.cos(ph), np.sin(ph), np.cos(la), np.sin(la)
        refs = c["refs"]
        t_th, t_ph, t_la = (self._torque(j, v, refs) for j, v in (("theta", th), ("phi", ph), ("lambda", la)))
        fa = -self._torque("slide", b, refs) + 0.0 * fv
        # moment of the platform on the leg at the U-joint's centre, from its three components along the joint axes
        mb = (t_la + sp * t_th) / cp
        m3 = (t_th + 0.0 * fv, ct * t_ph + st * mb, -st * t_ph + ct * mb)
        f3 = (fa, fv, fw)
        extra = c["extra"]

        # branch: from its loaded end, where the frame is T3, to the hub
        n, m = _neg(f3), _neg(m3)
        gw = c["branch_weight"]  # line weight in T3, lagged
        if self.weight is not None:
            over = self.weight["branch_length"] - b
            n = _add(n, _scale(over, gw))
            m = _add(m, _cross((0.5 * over * over, 0.0, 0.0), gw))
        x_h, q_h, n_h, m_h = integrate_rod(
            0, b, n, m, k["branch.EI"], k["branch.EA"], k["branch.GJ_inv"], k["branch.GA_inv"], gw, self.steps
        )
        n_r, m_r = _qrot(_qinv(q_h), n_h), _qrot(_qinv(q_h), m_h)
        if self.hub_clamp.any():
            tilt = _qexp((0.0 * fv, -self.hub_clamp * m_r[1], -self.hub_clamp * m_r[2]))
            q_h = _qmul(q_h, tilt)
            n_r, m_r = _qrot(_qinv(tilt), n_r), _qrot(_qinv(tilt), m_r)

        # bush and U-joint: branch end relative to the leg moves by +F/k
        dv, dw = self._spring("R_theta_P.radial", (fv, fw), extra.get("R_theta_P.radial"), (ct, st))
        for e, mask in self._aliens("angle_stiffness"):
            more = mask * e["amplitude"] * np.sin(2 * th + e.get("phase", 0.0)) / k["R_theta_P.radial"]
            dv, dw = dv + more * fv, dw + more * fw
        f2 = _rot_x(ct, st, f3)
        dx, dz = self._spring("R_phi.radial", (f2[0], f2[2]), extra.get("R_phi.radial"))
        (dy,) = self._spring("R_phi.axial", (f2[1],), extra.get("R_phi.axial"))
        f1 = _rot_y(cp, sp, f2)
        # position of the U-joint's centre on the leg's side, seen from the branch end, in T1
        x = _neg(_rot_y(cp, sp, _add(_rot_x(ct, st, (0.0, dv, dw)), (dx, dy, dz))))
        d = par["d"] + self.offset_extra
        x = (x[0], x[1], x[2] - d)
        m1 = _rot_y(cp, sp, _rot_x(ct, st, m3))
        m1 = (m1[0] - d * f1[1], m1[1] + d * f1[0], m1[2])
        # R_lambda bearing, in the frame before its turn
        f0, m0, x = _rot_z(cl, sl, f1), _rot_z(cl, sl, m1), _rot_z(cl, sl, x)
        ex, ey = self._spring("R_lambda.radial", (f0[0], f0[1]), extra.get("R_lambda.radial"), (cl, -sl))
        (ez,) = self._spring("R_lambda.axial", (f0[2],), extra.get("R_lambda.axial"))
        tx, ty = self._spring("R_lambda.tilting", (m0[0], m0[1]), extra.get("R_lambda.tilting"))
        for e, mask in self._aliens("tilt_quadratic"):
            tx = tx + mask * e["coefficient"] * m0[0] * np.abs(m0[0])
            ty = ty + mask * e["coefficient"] * m0[1] * np.abs(m0[1])
        x = _sub(x, (ex, ey, ez))
        tilt = _qexp((tx, ty, 0.0 * fv))  # yoke relative to the rod's tip
        ft, mt, x = _qrot(tilt, f0), _qrot(tilt, m0), _qrot(tilt, x)
        # linear rod from its tip to the guide
        rw = c["rod_weight"]
        x_g, q_g, n_g, m_g = integrate_rod(
            2, c["rod_length"], ft, mt, k["rod.EI"], k["rod.EA"], k["rod.GJ_inv"], k["rod.GA_inv"], rw, self.steps
        )
        x_g = _add(x, x_g)  # from the branch end, in the tip's frame
        n_g, m_g = _qrot(_qinv(q_g), n_g), _qrot(_qinv(q_g), m_g)
        if self.clamp.any():
            turn = _qexp((-self.clamp * m_g[0], -self.clamp * m_g[1], 0.0 * fv))
            q_g = _qmul(q_g, turn)
            n_g = _qrot(_qinv(turn), n_g)
        drive = self._drive(n_g[2] + c["drive_extra_force"], c)

        # tip frame seen from T3, then everything relative to the hub
        q31 = _qmul(
            _qmul((np.cos(th / 2), -np.sin(th / 2), 0.0, 0.0), (np.cos(ph / 2), 0.0, -np.sin(ph / 2), 0.0)),
            (np.cos(la / 2), 0.0, 0.0, -np.sin(la / 2)),
        )
        q3t = _qmul(q31, _qinv(tilt))
        back = _qinv(q_h)
        x_rel = _qrot(back, _sub(_qrot(q3t, x_g), x_h))
        q_rel = _qmul(_qmul(back, q3t), q_g)
        return {
            "x": x_rel, "q": q_rel, "f": n_r, "m": m_r, "drive": drive,
            "q_bush": back, "q_tip": _qmul(back, q3t), "f3": f3, "drive_force": n_g[2] + c["drive_extra_force"],
            "loads": {"R_theta_P.radial": (fv, fw), "R_phi.radial": (f2[0], f2[2]), "R_phi.axial": (f2[1],),
                      "R_lambda.radial": (f0[0], f0[1]), "R_lambda.axial": (f0[2],),
                      "R_lambda.tilting": (m0[0], m0[1]), "drive": (n_g[2] + c["drive_extra_force"],)},
        }  # fmt: skip

    def _drive(self, force, c):
        """Displacement [m] of the rod's root along z under an axial force [N]: screw, nut, bearing, belt, motor."""
        out = force * c["drive_compliance"]
        for key in ("ball_nut.axial", "support_bearing.axial"):
            if key in self.gap:
                gap, smooth = self.gap[key]
                out = out + _play(force, gap, smooth)
        for e, mask in self._aliens("cubic"):
            out = out + mask * e["coefficient"] * force**3
        for e, mask in self._aliens("quadratic"):
            out = out + mask * e["coefficient"] * force * np.abs(force)
        for e, mask in self._aliens("one_sided"):
            out = out + mask * e["coefficient"] * 0.5 * (force + np.sqrt(force**2 + 0.01))
        if "drive" in c["extra"]:
            out = out + c["extra"]["drive"][0]
        return out

    # ---- whole robot -------------------------------------------------------------------------------------------
    def _prepare(self):
        """Spring constants that do not depend on the sample, (3, 1)."""
        p = self.par
        k = {key: v for key, v in p.items() if key.split(".")[0] in ("R_lambda", "R_phi", "R_theta_P")}
        for short, name in (("rod", "linear_rod"), ("branch", "moving_star_branch")):
            e, area, second = p[name + ".E"], p[name + ".A"], p[name + ".I"]
            shear_modulus = e / (2 * (1 + POISSON))
            k[short + ".EI"], k[short + ".EA"] = e * second, e * area
            k[short + ".GJ_inv"] = 1 / (shear_modulus * 2 * second) if self.torsion else np.zeros((3, 1))
            k[short + ".GA_inv"] = 1 / (self.shear * shear_modulus * area) if self.shear else np.zeros((3, 1))
        self._k = k

    def _context(self, q, w, temperature, time):
        """What belongs to the samples: lengths, drive compliance, weights; arrays (3, N)."""
        p = self.par
        q = q.T + self.encoder
        nominal_q = q.copy()
        dt = temperature - T_REF
        for e in self.lead:
            for i in e["legs"]:
                if e.get("kind", "proportional") == "proportional":
                    q[i] += e["ratio"] * (nominal_q[i] - e["q0"])
                else:
                    turns = nominal_q[i] / e.get("period", NOMINAL["lead"])
                    q[i] += e["amplitude"] * np.sin(2 * np.pi * turns + e["phase"])
        for e in self.thermal:
            for i in e["legs"]:
                base = {"q": nominal_q[i], "q-d": nominal_q[i] - NOMINAL["d"], "full": NOMINAL["ball_screw.length"],
                        "top": NOMINAL["ball_screw.length"] - nominal_q[i]}[e["of"]]  # fmt: skip
                q[i] += e["coefficient"] * dt * base
        l2 = nominal_q
        l1 = p["ball_screw.length"] - l2
        compliance = (
            1 / (p["ball_screw.E"] * p["ball_screw.A"] * (1 / l1 + 1 / l2))
            + 1 / p["ball_nut.axial"]
            + 1 / p["support_bearing.axial"]
            + BELT_PER_FORCE**2 / p["timing_belt.stiffness"]
            + TORQUE_PER_FORCE**2 / p["motor.torsional"]
        )
        n = q.shape[1]
        extra: dict[str, list[np.ndarray]] = {}
        for a in self.alien:
            for i in a["legs"]:
                if a["kind"] == "periodic_stiffness":
                    wave = np.sin(2 * np.pi * q[i] / a["period"] + a.get("phase", 0.0))
                    compliance[i] *= 1 + 0.5 * a["amplitude"] * (1 + wave)
                elif a["kind"] == "drift":
                    extra.setdefault("drive", [np.zeros((3, n))])[0][i] += (
                        a["coefficient"] * np.linalg.norm(w[:, :3], axis=1) * time
                    )
        zero = np.zeros((3, n))
        return {
            "q": q, "rod_length": q - p["d"], "drive_compliance": compliance, "extra": extra, "refs": {},
            "branch_weight": (zero, zero, zero), "rod_weight": (zero, zero, zero), "drive_extra_force": zero,
        }  # fmt: skip

    def _rigid(self, q):
        """Rigid pose at q (N, 3): p, R and the legs' b, theta, phi, lambda, by the README's closed form."""
        a = NOMINAL["a"]
        e = np.stack([np.cos(ALPHA), np.sin(ALPHA)], -1)

        def pose(v):
            th, ph = v[:, 1], v[:, 2]
            la = np.arctan2(-np.sin(th) * np.sin(ph), np.cos(th) + np.cos(ph))
            rot = np.einsum("nij,njk,nkl->nil", _rx(th), _ry(ph), _rz(la))
            A, B, D = rot[:, 0, 0], rot[:, 0, 1], rot[:, 1, 1]
            det = A * D - B * B
            p = np.stack([a * (A * (A - D) / 2 - B * B) / det, a * B * (A - 3 * D) / (2 * det), v[:, 0]], -1)
            se = np.einsum("nij,lj->nli", rot[:, :2, :2], e)
            b = np.einsum("nli,nli->nl", a * e[None] - p[:, None, :2], se) / np.einsum("nli,nli->nl", se, se)
            qq = p[:, None, 2] + b * np.einsum("nj,lj->nl", rot[:, 2, :2], e)
            return p, rot, b, qq

        v = np.stack([q.mean(1), 0 * q[:, 0], 0 * q[:, 0]], -1)
        for _ in range(30):
            _, _, _, q0 = pose(v)
            err = q - q0
            if np.abs(err).max() < 1e-11:
                break
            J = np.stack([(pose(v + dv)[3] - q0) / 1e-7 for dv in 1e-7 * np.eye(3)], -1)
            v = v + np.linalg.solve(J, err[..., None])[..., 0]
        p, rot, b, _ = pose(v)
        angles = []
        for alpha in ALPHA:
            m = _rz(np.full(len(q), -alpha)) @ rot @ _rz(np.full(len(q), alpha))
            angles.append(np.stack([np.arctan2(m[:, 2, 1], m[:, 2, 2]), -np.arcsin(m[:, 2, 0]),
                                    np.arctan2(m[:, 1, 0], m[:, 0, 0])], 0))  # fmt: skip
        return p, rot, b, np.stack(angles, 1)  # angles (3 kinds, 3 legs, N)

    def _solve(self, c, w, start, tol=1e-4, max_iter=60):
        """Newton's method from `start` = (p (3, N), qR, u (6, 3, N)); returns the same, leg outputs, residual."""
        p, quat, u = start
        n = w.shape[0]
        steps = np.array([1e-4, 1e-4, 1e-7, 1e-6, 1e-6, 1e-6])
        base, guides = self._base_points(), self._guides()
        along = _qrot(guides, (0.0, 0.0, 1.0))
        tilted = bool(self.tilt.any())
        qa = (np.cos(ALPHA / 2)[:, None], 0.0, 0.0, np.sin(ALPHA / 2)[:, None])
        bump = np.concatenate([np.zeros((6, 1)), np.diag(steps)], 1)  # (6, 7)
        row = np.array([1e6, 1e6, 1e6, 1e5, 1e5, 1e5])  # 1 um, 10 urad
        limit = np.array([200.0, 200.0, 0.02, 0.2, 0.2, 0.2])
        last, norm0, share = np.full(n, np.inf), np.full(n, np.inf), np.ones(n)
        origin = taken = None
        search_from = 2 if c["refs"] else 6
        for it in range(max_iter):
            self._lag_weights(c, quat, u, qa)
            out = self._leg(tuple(u[j][None] + bump[j][:, None, None] for j in range(6)), c)
            c["q_bush"], c["q_tip"] = (tuple(_first(v) for v in out[key]) for key in ("q_bush", "q_tip"))
            qhub = _qmul(quat, qa)
            x = np.stack(_qrot(qhub, out["x"]))  # (3, P, 3, N)
            ex = p[:, None, None] + x - base[:, None]
            if tilted:
                ex = ex - np.stack([out["drive"] * part for part in along])
            else:
                ex[2] = ex[2] - out["drive"]
            qe = _qmul(_qmul(qhub, out["q"]), _qinv(qa))
            if tilted:
                qe = _qmul(qe, _qinv(guides))
            er = np.stack(_qlog(qe))
            e = np.concatenate([ex, er]) * row[:, None, None, None]
            f, m = np.stack(_qrot(qhub, out["f"])), np.stack(_qrot(qhub, out["m"]))
            wrench = np.concatenate([f, m])  # (6, P, 3, N)
            total, stiffness = self._external(w, quat)
            for spring in self.springs:
                total[:3] -= spring["stiffness"] * (p - np.reshape(spring["rest"], (3, 1)))
            eq = wrench[:, 0].sum(1) + total
            res = np.concatenate([e[:, 0].transpose(1, 0, 2).reshape(18, n), eq * 1e2])
            size = np.abs(res).max(0)
            worst = np.nanmax(size)
            if (it > 1 and worst < tol) or (it > 4 and worst < 10 * tol and np.all(size >= 0.5 * last)):
                break
            last = size
            norm = np.where(np.isfinite(size), np.sqrt((res**2).sum(0)), np.inf)
            worse = (norm > 0.999 * norm0) & (share > 1e-3) & (size > tol) & (it > search_from)
            norm0 = np.where(worse, norm0, norm)
            J = np.zeros((n, 24, 24))
            de = (e[:, 1:] - e[:, :1]) / steps[None, :, None, None]  # (6 eq, 6 u, 3, N)
            dw = (wrench[:, 1:] - wrench[:, :1]) / steps[None, :, None, None]
            for i in range(3):
                J[:, 6 * i : 6 * i + 6, 6 + 6 * i : 12 + 6 * i] = de[:, :, i].transpose(2, 0, 1)
                J[:, 18:, 6 + 6 * i : 12 + 6 * i] = dw[:, :, i].transpose(2, 0, 1) * 1e2
                J[:, 6 * i : 6 * i + 3, 3:6] = -_skew(x[:, 0, i]) * 1e6
                J[:, 6 * i : 6 * i + 3, :3] = 1e6 * np.eye(3)
                J[:, 6 * i + 3 : 6 * i + 6, 3:6] = 1e5 * np.eye(3)
                J[:, 18:21, 3:6] -= _skew(f[:, 0, i]) * 1e2
                J[:, 21:24, 3:6] -= _skew(m[:, 0, i]) * 1e2
            J[:, 18:, 3:6] += stiffness * 1e2
            for spring in self.springs:
                J[:, 18:21, :3] -= 1e2 * spring["stiffness"] * np.eye(3)
            step = -np.linalg.solve(J, res.T[..., None])[..., 0].T  # (24, N)
            du = step[6:].reshape(3, 6, n).transpose(1, 0, 2)
            cut = (np.abs(du) / limit[:, None, None]).max((0, 1))
            cut = np.minimum(1.0, 1.0 / np.maximum(cut, 1e-30))
            # a step that made things worse (a kink: friction, play) is taken back and halved
            share = np.where(worse, 0.5 * share, 1.0)
            here = (p, np.stack(np.broadcast_arrays(*quat)), u)
            move = (cut * step[:3], cut * step[3:6], cut * du)
            origin = here if origin is None else tuple(np.where(worse, a, b) for a, b in zip(origin, here, strict=True))
            taken = move if taken is None else tuple(np.where(worse, a, b) for a, b in zip(taken, move, strict=True))
            p = origin[0] + share * taken[0]
            quat = _qmul(_qexp(tuple(share * taken[1])), tuple(origin[1]))
            u = origin[2] + share * taken[2]
        return (p, quat, u), {key: _first(val) for key, val in out.items()}, size, it

    def _base_points(self):
        """Guides' rest positions (3 xyz, 3 legs, 1)."""
        r = NOMINAL["a"] + self.base[:, 0]
        t = self.base[:, 1]
        points = np.stack([r * np.cos(ALPHA) - t * np.sin(ALPHA), r * np.sin(ALPHA) + t * np.cos(ALPHA),
                           self.base[:, 2]])  # fmt: skip
        return (points + self.base_shift.T)[:, :, None]

    def _guides(self):
        """Directions of the guides in the top plate (w, x, y, z), (3, 1) each."""
        return _qexp((self.tilt[:, :1], self.tilt[:, 1:], np.zeros((3, 1))))

    def _external(self, w, quat):
        """Wrench on the hub (6, N) by load, payload and weight, and its derivative by a turn, (N, 6, 3)."""
        total = w.T.copy()
        d = np.zeros((w.shape[0], 6, 3))
        if self.weight is not None:
            total[2] += self.mass["hub"] * self.weight["hub_mass"] * self.weight["g"]
            if self.weight["branches"] == "hub":
                area = (self.mass["branch"] * self.par["moving_star_branch.A"]).sum()
                total[2] += self.weight["density"] * area * self.weight["branch_length"] * self.weight["g"]
        for e in self.payload:
            lever = np.stack(np.broadcast_arrays(*_qrot(quat, tuple(e["lever"]))))
            f = np.array([0.0, 0.0, e["mass"] * e["g"]])
            total[:3] += f[:, None]
            total[3:] += np.stack(np.broadcast_arrays(*_cross(lever, f)))
            d[:, 3:] += _skew_const(f) @ _skew(lever)  # d(l x f) = -[f](w x l) = [f][l] w
        return total, d

    def _lag_weights(self, c, quat, u, qa):
        """Line weights of rods and branches in the frames of their ends, from the angles at hand."""
        if self.weight is None:
            return
        g, rho = self.weight["g"], self.weight["density"]
        rod = self.mass["rod"] * rho * self.par["linear_rod.A"] * g
        branch = self.mass["branch"] * rho * self.par["moving_star_branch.A"] * g
        if "q_bush" in c:
            hub = _qmul(quat, qa)
            q3, qt = _qmul(hub, c["q_bush"]), _qmul(hub, c["q_tip"])
            if self.weight["branches"] == "distributed":
                c["branch_weight"] = _scale(branch, _qrot(_qinv(q3), (0.0, 0.0, 1.0)))
            c["rod_weight"] = _scale(rod, _qrot(_qinv(qt), (0.0, 0.0, 1.0)))
        body = self.weight["rod_length"]
        above = 0.0 if body is None else body - c["rod_length"]
        c["drive_extra_force"] = rod * above + np.zeros_like(c["rod_length"])

    def _start(self, q):
        """Unloaded start at true positions q (3, N)."""
        p, rot, b, angles = self._rigid(q.T)
        u = np.zeros((6, 3, q.shape[1]))
        u[2] = b.T
        u[3:] = angles
        return p.T.copy(), tuple(_qfrom(rot)), u

    def _robust(self, c, w, start):
        """Solve; samples that fail are solved again with the load brought up in ten steps."""
        state, out, size, it = self._solve(c, w, start)
        bad = ~(size < 1e-2)
        if bad.any():
            cols = np.flatnonzero(bad)
            cb, s = _columns(c, cols, len(bad)), self._start(c["q"][:, cols])
            for share in np.linspace(0, 1, 11):
                s, o, sz, _ = self._solve(cb, share * w[cols], s)
            p, quat, u = state
            p[:, cols], u[:, :, cols] = s[0], s[2]
            for k in range(4):
                quat[k][cols] = s[1][k]
            _put(out, o, cols)
            size[cols] = sz
        return state, out, size, it

    def simulate(self, q, w, temperature=None, time=None, new_pose=None) -> Response:
        """Equilibria at encoder readings q [m] (N, 3) under true wrenches w [N, N m] (N, 6) on P, base frame.

        temperature [degC] (N,) and time [s] (N,) default to 20 and 0, 1, 2, ...; new_pose (N,) marks the samples
        where the robot has just moved (friction starts relaxed there, before any load acts; default: where q differs
        from the sample before). The pose returned is what the pose sensor sees; the wrench sensor is `report_wrench`.
        """
        q, w = np.atleast_2d(np.asarray(q, float)), np.atleast_2d(np.asarray(w, float))
        n = len(q)
        time = np.arange(n, dtype=float) if time is None else np.asarray(time, float)
        temperature = np.full(n, T_REF) if temperature is None else np.asarray(temperature, float)
        if new_pose is None:
            new_pose = np.r_[True, np.abs(np.diff(q, axis=0)).max(1) > 1e-6]
        self._prepare()
        c = self._context(q, w, temperature, time)
        c0 = {k: [np.array(x) for x in v] for k, v in c["extra"].items()}
        start = self._start(c["q"])
        rounds = 8 if self.creep or any(a["kind"] == "coupling" for a in self.alien) else 1
        for turn in range(rounds):
            if self.friction:
                state, out, size, it = self._chains(c, w, start, np.asarray(new_pose, bool))
            else:
                state, out, size, it = self._robust(c, w, start)
            start = state
            if rounds > 1:
                before, c["extra"] = c["extra"], self._slow(out["loads"], c, c0, time)
                if (
                    turn
                    and max(np.abs(x - y).max() for k in before for x, y in zip(before[k], c["extra"][k], strict=True))
                    < 1e-10
                ):
                    break
        p, quat, u = state
        rot, p = _qmat(quat), p.T
        if self.tool_soft.any():
            total, _ = self._external(w, quat)
            pull, about = ((rot.swapaxes(1, 2) @ each[..., None])[..., 0] for each in (total[:3].T, total[3:].T))
            p = p + (rot @ (self.tool_soft[0] * pull)[..., None])[..., 0]
            rot = rot @ _qmat(_qexp(tuple((self.tool_soft[1] * about).T)))
        if self.ground.is_soft:
            shift, lean = self._leans(w, quat, p, rot)
            p, rot = (lean @ p[..., None])[..., 0] + shift, lean @ rot
        if self.target_turn.any() or self.target_shift.any():
            p = p + rot @ self.target_shift
            rot = rot @ _qmat(_qexp(tuple(self.target_turn)))
        turn = _qmat(_qexp(tuple(self.pose_turn)))
        p = self.pose_scale * (p @ turn.T + self.pose_shift)
        r = np.stack(_qlog(_qfrom(turn @ rot)), -1)
        qhub = _qmul(quat, (np.cos(ALPHA / 2)[:, None], 0.0, 0.0, np.sin(ALPHA / 2)[:, None]))
        bush = np.stack(_qrot(qhub, out["f"]), -1).transpose(1, 0, 2)
        return Response(p, r, bush, u[3:].transpose(2, 1, 0), u[2].T.copy(), out["drive_force"].T.copy(), size, it,
                        {k: np.stack(v) for k, v in out["loads"].items()})  # fmt: skip

    def _leans(self, w, quat, p, rot):
        """Shift (N, 3) and turn (N, 3, 3) of what the robot stands on; at home its centre of mass is above the origin.

        The rods' weight acts where they are guided, whatever the pose; a turn of the loads with the robot is left out.
        """
        total, _ = self._external(w, quat)
        pulls, rest = [(total[:3].T, p)], []
        if self.weight is not None:
            share = self.weight["density"] * self.par["moving_star_branch.A"][:, 0] * self.mass["branch"][:, 0]
            branch = share * self.weight["branch_length"] * self.weight["g"]
            hub = self.mass["hub"] * self.weight["hub_mass"] * self.weight["g"]
            if self.weight["branches"] == "distributed":
                for i, alpha in enumerate(ALPHA):
                    arm = rot @ (0.5 * self.weight["branch_length"] * np.array([np.cos(alpha), np.sin(alpha), 0.0]))
                    pulls.append((np.array([0.0, 0.0, branch[i]]), p + arm))
            rest = [(np.array([0.0, 0.0, hub + branch.sum()]), np.zeros(3))]
        return self.ground.leans(pulls, total[3:].T, rest)

    def _chains(self, c, w, start, new_pose):
        """Samples in order within each pose (poses side by side), because dry friction remembers."""
        n = len(w)
        new_pose = new_pose.copy()
        new_pose[0] = True
        begin = np.flatnonzero(new_pose)
        if self.friction_kept:
            begin = begin[:1]
        ends = np.r_[begin[1:], n]
        p, quat, u = start
        p, quat, u = p.copy(), tuple(np.array(x) for x in quat), u.copy()
        size, out, most = np.zeros(n), None, 0
        ref: dict[str, np.ndarray] = {}
        value_row = {"slide": 2, "theta": 3, "phi": 4, "lambda": 5}
        for j in range((ends - begin).max()):
            live = np.flatnonzero(begin + j < ends)
            cols = begin[live] + j
            cj = _columns(c, cols, n)
            if j == 0:
                s = (p[:, cols], tuple(x[cols] for x in quat), u[:, :, cols])
                ref = self._relaxed(cj, s, value_row)
                cj["refs"] = {k: {"ref": ref[k], "on": 1.0} for k in self.friction}
            else:
                cj["refs"] = {k: {"ref": ref[k][:, live], "on": 1.0} for k in self.friction}
                prev = cols - 1
                s = (p[:, prev], tuple(x[prev] for x in quat), u[:, :, prev])
                if np.abs(c["q"][:, cols] - c["q"][:, prev]).max() > 1e-4:  # friction kept over a move: start afresh
                    s = (p[:, cols], tuple(x[cols] for x in quat), u[:, :, cols])
            (sp, sq, su), o, sz, it = self._robust(cj, w[cols], s)
            most = max(most, it)
            p[:, cols], u[:, :, cols], size[cols] = sp, su, sz
            for k in range(4):
                quat[k][cols] = sq[k]
            if out is None:
                out = _blank(o, n)
            _put(out, o, cols)
            for k, f in self.friction.items():
                v = su[value_row[k]]
                r, pre = ref[k][:, live], 0.0 if f.get("viscous") else f["presliding"]
                ref[k][:, live] = np.clip(r, v - pre, v + pre)
        return (p, quat, u), out, size, most

    def _relaxed(self, c, start, value_row):
        """Where the joints with friction stand when a move ends: nothing loads the robot yet, its weight neither."""
        loads = self.weight, self.payload
        self.weight, self.payload = None, []
        (_, _, u), _, _, _ = self._robust(c | {"refs": {}}, np.zeros((c["q"].shape[1], 6)), start)
        self.weight, self.payload = loads
        return {k: u[value_row[k]].copy() for k in self.friction}

    def _slow(self, loads, c, c0, time):
        """Displacements that follow from the loads' past (creep) or from another leg's load (coupling)."""
        n = len(time)
        extra = {k: [np.array(x) for x in v] for k, v in c0.items()}
        for e in self.creep:
            direction = e.get("direction", "axial")
            drive = e["module"] in ("ball_screw", "ball_nut", "support_bearing", "timing_belt", "motor")
            key = "drive" if drive else f"{e['module']}.{direction}"
            for j, force in enumerate(loads[key]):
                for i in e["legs"]:
                    soft = _part_compliance(self.par, e["module"], c["q"], i) if drive else 1.0 / self.par[key][i]
                    goal = e["ratio"] * force[i] * soft
                    y = np.zeros(n)
                    for k in range(1, n):
                        keep = np.exp(-(time[k] - time[k - 1]) / e["time_constant"])
                        y[k] = keep * y[k - 1] + (1 - keep) * goal[k]
                    extra.setdefault(key, [np.zeros((3, n)) for _ in loads[key]])[j][i] += y
        for a in self.alien:
            if a["kind"] == "coupling":
                add = a["coefficient"] * loads["drive"][0][a["of"] - 1]
                extra.setdefault("drive", [np.zeros((3, n))])[0][a["legs"]] += add
        return extra


# ------------------------------------------------------------------------------------------------ array helpers
def _part_compliance(par, module, q, i):
    """Axial compliance [m/N] of one part of leg i's drive."""
    if module == "ball_screw":
        length = par["ball_screw.length"][i]
        return 1 / (par["ball_screw.E"][i] * par["ball_screw.A"][i] * (1 / (length - q[i]) + 1 / q[i]))
    if module == "timing_belt":
        return BELT_PER_FORCE**2 / par["timing_belt.stiffness"][i]
    if module == "motor":
        return TORQUE_PER_FORCE**2 / par["motor.torsional"][i]
    return 1 / par[module + ".axial"][i]


def _first(v):
    """First of the perturbed copies, arrays (3, N), through tuples and dictionaries."""
    if isinstance(v, dict):
        return {k: _first(x) for k, x in v.items()}
    if isinstance(v, tuple):
        return tuple(_first(x) for x in v)
    return v[0] if v.ndim == 3 else v


def _columns(v, cols, n):
    """The samples `cols` of everything that has n of them."""
    if isinstance(v, dict):
        return {k: _columns(x, cols, n) for k, x in v.items()}
    if isinstance(v, tuple):
        return tuple(_columns(x, cols, n) for x in v)
    if isinstance(v, list):
        return [_columns(x, cols, n) for x in v]
    return v[..., cols] if isinstance(v, np.ndarray) and v.shape[-1] == n and v.ndim > 1 else v


def _blank(v, n):
    if isinstance(v, dict):
        return {k: _blank(x, n) for k, x in v.items()}
    if isinstance(v, tuple):
        return tuple(_blank(x, n) for x in v)
    return np.zeros((*v.shape[:-1], n))


def _put(into, v, cols):
    if isinstance(v, dict):
        for k, x in v.items():
            _put(into[k], x, cols)
    elif isinstance(v, tuple):
        for a, x in zip(into, v, strict=True):
            _put(a, x, cols)
    else:
        into[..., cols] = v


def _skew(v):
    """(3, N) to (N, 3, 3)."""
    m = np.zeros((v.shape[1], 3, 3))
    m[:, 0, 1], m[:, 0, 2], m[:, 1, 2] = -v[2], v[1], -v[0]
    m[:, 1, 0], m[:, 2, 0], m[:, 2, 1] = v[2], -v[1], v[0]
    return m


def _skew_const(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def _rx(a):
    c, s, o, z = np.cos(a), np.sin(a), np.ones_like(a), np.zeros_like(a)
    return np.stack([np.stack([o, z, z], -1), np.stack([z, c, -s], -1), np.stack([z, s, c], -1)], -2)


def _ry(a):
    c, s, o, z = np.cos(a), np.sin(a), np.ones_like(a), np.zeros_like(a)
    return np.stack([np.stack([c, z, s], -1), np.stack([z, o, z], -1), np.stack([-s, z, c], -1)], -2)


def _rz(a):
    c, s, o, z = np.cos(a), np.sin(a), np.ones_like(a), np.zeros_like(a)
    return np.stack([np.stack([c, -s, z], -1), np.stack([s, c, z], -1), np.stack([z, z, o], -1)], -2)


def _qfrom(rot):
    """Quaternion components (N,) of matrices (N, 3, 3), angles below pi."""
    w = 0.5 * np.sqrt(np.maximum(1 + rot[:, 0, 0] + rot[:, 1, 1] + rot[:, 2, 2], 1e-12))
    return (w, (rot[:, 2, 1] - rot[:, 1, 2]) / (4 * w), (rot[:, 0, 2] - rot[:, 2, 0]) / (4 * w),
            (rot[:, 1, 0] - rot[:, 0, 1]) / (4 * w))  # fmt: skip


def closed_form_compliance(q) -> np.ndarray:
    """The nominal robot's C (N, 6, 6) about P at rigid poses q [m] (N, 3), module by module; a check of the limit.

    One wrench on P gives the six bush forces (two a leg, normal to the branch); each is moved down its leg and
    squeezes every module: C = sum of J^T Lambda J.
    """
    q = np.atleast_2d(np.asarray(q, float))
    _, rot, b, angles = Device()._rigid(q)
    par = NOMINAL
    out = []
    for s in range(len(q)):
        frames = [rot[s] @ _rz(np.array(alpha)) for alpha in ALPHA]  # T3: x along the branch
        bush = [b[s, i] * frames[i][:, 0] for i in range(3)]
        wrenches = np.array([np.r_[f[:, k], np.cross(x, f[:, k])] for f, x in zip(frames, bush, strict=True)
                             for k in (1, 2)]).T  # fmt: skip
        share = np.linalg.inv(wrenches)  # forces of the platform on the legs for w on P
        C = np.zeros((6, 6))
        for i in range(3):
            f3 = np.zeros((3, 6))
            f3[1:] = share[2 * i : 2 * i + 2]
            th, ph, la = angles[:, i, s]
            f2 = _rx(np.array(th)) @ f3
            f1 = _ry(np.array(ph)) @ f2
            f0 = _rz(np.array(la)) @ f1
            m0 = np.cross([0, 0, par["d"]], f0.T).T
            length = q[s, i] - par["d"]
            ei = par["moving_star_branch.E"] * par["moving_star_branch.I"]
            ej, ea = par["linear_rod.E"] * par["linear_rod.I"], par["linear_rod.E"] * par["linear_rod.A"]
            screw = par["ball_screw.E"] * par["ball_screw.A"] * (1 / (par["ball_screw.length"] - q[s, i]) + 1 / q[s, i])
            drive = 1 / screw + 1 / par["ball_nut.axial"] + 1 / par["support_bearing.axial"]
            drive += BELT_PER_FORCE**2 / par["timing_belt.stiffness"] + TORQUE_PER_FORCE**2 / par["motor.torsional"]
            bend = [[length**3 / (3 * ej), length**2 / (2 * ej)], [length**2 / (2 * ej), length / ej]]
            parts = [
                (f3[1:], (b[s, i] ** 3 / (3 * ei) + 1 / par["R_theta_P.radial"]) * np.eye(2)),
                (f2, np.diag([1 / par["R_phi.radial"], 1 / par["R_phi.axial"], 1 / par["R_phi.radial"]])),
                (f0, np.diag([1 / par["R_lambda.radial"]] * 2 + [1 / par["R_lambda.axial"]])),
                (m0[:2], np.eye(2) / par["R_lambda.tilting"]),
                (np.array([f0[0], m0[1]]), np.array(bend)),
                (np.array([f0[1], -m0[0]]), np.array(bend)),
                (f0[2:], np.array([[length / ea + drive]])),
            ]
            C += sum(J.T @ lam @ J for J, lam in parts)
        out.append(C)
    return np.array(out)
