"""Draw a concealed arm whose gears yield and whose motors vibrate, and write what its controller logs of two motions.

    python -m tests.reference.concealed.elastic --seed 7 --robot ur5 --out DIR --sealed OTHER_DIR [--count N]
        [--kind faultless|everywhere|PHYSICS]

writes DIR/<name>.csv, <name>.json and <name>.heldout.csv, and OTHER_DIR/<name>.truth.json and <name>.true.csv: link
positions and reported efforts of the held-out motion, free of noise. Each joint has two masses, rotor and links, with
a gear between them: k delta + d delta' = tau_l, theta = q + delta, tau_m = J theta'' + friction(theta') + tau_l
(Spong 1987). Links follow a chosen motion, so motors follow by derivatives; on top of it a disturbance of 15 to 60 Hz
moves both masses, coupled by the mass matrix along the motion. Positions are those of the motors.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline, make_interp_spline
from scipy.linalg import expm
from scipy.signal import butter, lfilter, sosfilt, sosfiltfilt, sosfreqz

from .chain import Chain, example_file
from .draw import Candidate, drawing, effect_of_size, pick, seal
from .efforts import CUT, RATES, ROWS, TOLERANCE, Kind, Yardstick, also, candidate, draw_motion, places
from .efforts import KINDS as MOVING
from .excitation import Excitation
from .moving import Moving
from .scatter import draw_scatter

#: Rates [1/s] at which motors are followed, and at which the links' efforts are, which are smooth.
FINE, SMOOTH = 2000.0, 500.0
#: A motion begins so long before the log does [s], and its end is this much later.
BEFORE, AFTER = 2.0, 0.1
#: The mass matrix is taken anew after so many fine steps.
STEPS = 60
#: Slower than this a joint stands still [rad/s].
STANDING = 1e-3
#: Rotors that the drawing need not have add so much of the efforts' noise: thousands of samples do not show it.
UNSEEN = 0.01
BAND = (15.0, 60.0)  # Hz

_UR10 = example_file("ur_description/urdf/ur10_robot.urdf")
KINDS: dict[str, Kind] = {
    **{name: MOVING[name] for name in ("ur5", "panda", "xarm7", "kinova")},
    "ur10": Kind(_UR10, "ur10", "tool0", MOVING["ur5"].centre, 0.3),
}
#: group -> share of the devices.
GROUPS = {"faultless": 0.25, "everywhere": 0.40, "one": 0.35}
SINGLE = ("payload", "effort_gain", "coulomb_friction", "viscous_friction", "transmission_coupling", "effort_delay")
EXTRA = ("payload", "effort_gain", "transmission_coupling")
#: What every joint has where everything is off: physics -> name of its size.
BACKGROUND = {
    "coulomb_friction": "force",
    "viscous_friction": "damping",
    "rotor_inertia": "inertia",
    "effort_offset": "offset",
}
#: Only these act where torque sensors sit behind the gears.
BEHIND_GEARS = ("payload", "effort_gain", "effort_delay")
SIZES = (5.0, 40.0)


# ---------------------------------------------------------------------------------------------- two masses a joint
@dataclass(frozen=True)
class Drives:
    """Rotor, gear and friction of each joint, all (n,) and as the joint feels them; friction is the motor's.

    rotor J [kg m^2], stiffness k [N m/rad], damping d [N m s/rad] of the gear, coulomb [N m], viscous [N m s/rad];
    presliding [rad]; `hold` [rad/s]: bandwidth of the loop that holds the motors against the disturbance; `coupled`:
    motors that act on two joints, as `Moving._effect_transmission_coupling` lists them.
    """

    names: tuple[str, ...]
    rotor: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    coulomb: np.ndarray
    viscous: np.ndarray
    presliding: float = 1e-4
    hold: float = 30.0
    coupled: tuple[Mapping[str, Any], ...] = ()

    def friction(self, theta: np.ndarray, speed: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        """Return what motors give (N, n) against friction, and for what couples them, at their own motion."""
        out = self.viscous * speed
        for i in np.flatnonzero(self.coulomb):
            out[:, i] += self.coulomb[i] * dahl(theta[:, i], self.presliding)
        for e in self.coupled:
            i, j = self.names.index(e["location"]), self.names.index(e["other"])
            x, v, a = (values[:, i] + e["ratio"] * values[:, j] for values in (theta, speed, acceleration))
            own = e["inertia"] * a + e["damping"] * v + e["force"] * dahl(x, e["presliding"])
            out[:, i] += own
            out[:, j] += e["ratio"] * own
        return out


@dataclass(frozen=True)
class Ripple:
    """Torque of `BAND` on the motors that shakes them by so many rad/s^2 (n,), RMS, were each joint alone.

    `reported`: it is the controller's, whose efforts tell it; else the motor's own, and they do not.
    """

    size: np.ndarray
    reported: bool = True


@dataclass(frozen=True)
class Run:
    """A motion on the fine clock: links q, motors theta, their rates, what gears pass on and what motors give (N, n).

    `ripple`: the part of `motor` that is the disturbance.
    """

    t: np.ndarray
    q: np.ndarray
    theta: np.ndarray
    speed: np.ndarray
    acceleration: np.ndarray
    gear: np.ndarray
    motor: np.ndarray
    ripple: np.ndarray


def dahl(x: np.ndarray, presliding: float) -> np.ndarray:
    """Return which way dry friction points (N,), from -1 to 1, turning over a short path (Dahl 1968)."""
    step = np.diff(x, prepend=x[0])
    kept = np.exp(-np.abs(step) / presliding)
    added = np.sign(step) * (1 - kept)
    moving = np.flatnonzero(step)
    z = float(np.sign(step[moving[0]])) if len(moving) else 0.0
    out = np.empty(len(x))
    for i, (keep, add) in enumerate(zip(kept.tolist(), added.tolist(), strict=True)):
        z = keep * z + add
        out[i] = z
    return out


def mass_matrices(chain: Chain, q: np.ndarray) -> np.ndarray:
    """Return the mass matrices (N, n, n) of an open chain at q (N, n)."""
    rest = np.zeros_like(q)
    weight = chain.efforts(q, rest, rest)
    return np.stack([chain.efforts(q, rest, rest + unit) - weight for unit in np.eye(q.shape[1])], -1)


def deflected(t: np.ndarray, load: np.ndarray, drives: Drives):
    """Return the gears' deflection delta (N, n) as a spline of time: k delta + d delta' = load.

    By powers of d/k, the time in which a gear settles: below a millisecond, beside loads of a few Hz.
    """
    spline, lag = make_interp_spline(t, load, 5), drives.damping / drives.stiffness
    delta = (load - lag * spline(t, 1) + lag**2 * spline(t, 2)) / drives.stiffness
    return make_interp_spline(t, delta, 5)


class ElasticArm:
    """Links of a `Moving`, drives that yield and a disturbance; what happens in a motion of the links."""

    def __init__(self, links: Moving, drives: Drives, ripple: Ripple):
        self.links, self.drives, self.ripple = links, drives, ripple

    def run(self, excitation: Excitation, duration: float, seed: int) -> Run:
        """Return the motion from `BEFORE` the log begins to `AFTER` it ends."""
        coarse = np.arange(-BEFORE, duration + AFTER + 4 / SMOOTH, 1 / SMOOTH)
        load = make_interp_spline(coarse, self.links.rigid(self.links.chain.closed(*excitation.at(coarse))), 5)
        delta = deflected(coarse, load(coarse), self.drives)
        t = np.arange(-BEFORE, duration + AFTER, 1 / FINE)
        q, qd, qdd = excitation.at(t)
        shaken = self.shaken(t, q, seed)
        theta, speed, acceleration = (
            own + delta(t, order) + more
            for order, (own, more) in enumerate(zip((q, qd, qdd), shaken[1:4], strict=True))
        )
        gear = load(t) + shaken[4]
        motor = self.drives.rotor * acceleration + self.drives.friction(theta, speed, acceleration) + gear
        return Run(t, q + shaken[0], theta, speed, acceleration, gear, motor, shaken[5])

    def shaken(self, t: np.ndarray, q: np.ndarray, seed: int) -> tuple[np.ndarray, ...]:
        """Return what the disturbance adds (N, n) to q, theta, theta', theta'' and the gears' torques; and its torque.

        M(q) q'' = g, J theta'' + g + loop = u, g = k (theta - q) + d (theta' - q'), about the motion in q (N, n); u is
        straight between samples, for which the steps are exact.
        """
        n, drives = q.shape[1], self.drives
        if not self.ripple.size.any():
            return tuple(np.zeros_like(q) for _ in range(6))
        masses = mass_matrices(self.links.chain, q[::STEPS])
        usual = np.diagonal(masses.mean(0))
        whole = drives.rotor + usual
        spring, damper = whole * drives.hold**2, 1.4 * whole * drives.hold
        band = butter(2, BAND, "bandpass", fs=FINE, output="sos")
        noise = sosfilt(band, np.random.default_rng([seed, 41]).normal(size=q.shape), axis=0)
        u = noise * self.ripple.size / _answer(drives, usual, spring, damper, band)
        x, out = np.zeros(4 * n), np.empty((len(t), 4 * n))
        k, d, rotor = np.diag(drives.stiffness), np.diag(drives.damping), np.diag(1 / drives.rotor)
        # gear torque of the state (theta, q, theta', q')
        gear, eye, none = np.hstack([k, -k, d, -d]), np.eye(n), np.zeros((n, n))
        loop = np.hstack([np.diag(spring), none, np.diag(damper), none])
        whole_system = np.zeros((6 * n, 6 * n))
        whole_system[:n, 2 * n : 3 * n] = whole_system[n : 2 * n, 3 * n : 4 * n] = eye
        whole_system[2 * n : 3 * n, : 4 * n] = -rotor @ (gear + loop)
        whole_system[2 * n : 3 * n, 4 * n : 5 * n] = rotor
        whole_system[4 * n : 5 * n, 5 * n :] = eye * FINE  # u is straight within a step
        change = np.diff(u, axis=0, append=u[-1:])
        for at, mass in enumerate(masses):
            whole_system[3 * n : 4 * n, : 4 * n] = np.linalg.solve(mass, gear)
            step = expm(whole_system / FINE)[: 4 * n]
            rows = slice(at * STEPS, min((at + 1) * STEPS, len(t)))
            pushed = u[rows] @ step[:, 4 * n : 5 * n].T + change[rows] @ step[:, 5 * n :].T
            for i, push in zip(range(rows.start, rows.stop), pushed, strict=True):
                out[i] = x
                x = step[:, : 4 * n] @ x + push
        passed = out @ gear.T
        pulled = (u - passed - out @ loop.T) / drives.rotor
        return out[:, n : 2 * n], out[:, :n], out[:, 2 * n : 3 * n], pulled, passed, u


def _answer(drives: Drives, mass, spring, damper, band) -> np.ndarray:
    """Return RMS of theta'' (n,) for white noise of unit variance through `band`, each joint alone."""
    w, h = sosfreqz(band, 4096, fs=FINE)
    s = 2j * np.pi * w[1:, None]
    gear = drives.stiffness + drives.damping * s
    felt = drives.rotor * s**2 + spring + damper * s + gear * mass * s**2 / (mass * s**2 + gear)
    return np.sqrt(np.mean(np.abs(s**2 / felt * h[1:, None]) ** 2, axis=0))


# ---------------------------------------------------------------------------------------------- log
@dataclass(frozen=True)
class Log:
    """How a controller logs motors and efforts.

    rate [1/s]; positions' white noise [rad] or `counts` a turn; velocities' noise [rad/s] or None; jitter [s] of the
    clock, where `told` says whether stamps are those of the samples; efforts: noise (n,) [N m], of which `white` (share
    of the variance) is white and the rest decays over `lasting` [s], `bits` over `reach` (n,) [N m] to either side or
    None; low-pass of `order` (0: none) at `corner` [Hz], delay (n,) [s], gain and offset (n,); `behind`: they are
    torques behind the gears, else the motors'.
    """

    rate: float
    noise: np.ndarray
    reach: np.ndarray
    delay: np.ndarray
    gain: np.ndarray
    offset: np.ndarray
    position: float = 0.0
    counts: float | None = None
    velocity: float | None = None
    jitter: float = 0.0
    told: bool = True
    white: float = 1.0
    lasting: float = 0.05
    bits: int | None = None
    order: int = 0
    corner: float = 50.0
    behind: bool = False

    @property
    def late(self) -> np.ndarray:
        """By how much slow efforts are late (n,) [s]: the delay and the low-pass's group delay at rest."""
        return self.delay + {0: 0.0, 1: 1.0, 2: np.sqrt(2.0)}[self.order] / (2 * np.pi * self.corner)

    @property
    def spread(self) -> np.ndarray:
        """Standard deviation (n,) of noise and rounding of the efforts [N m]."""
        step = 0.0 if self.bits is None else 2 * self.reach / 2**self.bits
        return np.sqrt(self.noise**2 + step**2 / 12)

    def record(self, rng, run: Run, ripple: Ripple, duration: float) -> tuple[dict[str, np.ndarray], dict]:
        """Return what is logged, time (N,), q, qd (or none) and tau (N, n), and the truth beside: time, q, tau."""
        even = np.arange(int(duration * self.rate)) / self.rate
        shifted = even + rng.uniform(0, self.jitter, len(even)) if self.jitter else even
        at, stamps = (shifted, shifted) if self.told else (even, shifted)
        felt = run.gear if self.behind else run.motor - (0.0 if ripple.reported else run.ripple)
        if self.order:
            low = butter(self.order, self.corner, fs=FINE)
            felt = lfilter(*low, felt - felt[0], axis=0) + felt[0]
        n = felt.shape[1]
        efforts = np.stack([CubicSpline(run.t, felt[:, j])(at - self.delay[j]) for j in range(n)], -1)
        efforts = efforts * self.gain + self.offset
        q, qd, links = (CubicSpline(run.t, values)(at) for values in (run.theta, run.speed, run.q))
        q = q + self.position * rng.normal(size=q.shape)
        if self.counts:
            q = np.round(q / (2 * np.pi / self.counts)) * (2 * np.pi / self.counts)
        tau = efforts + self._disturbed(rng, len(at), n)
        if self.bits is not None:
            step = 2 * self.reach / 2**self.bits
            tau = np.round(tau / step) * step
        told = {"time": stamps, "q": q, "tau": tau}
        if self.velocity is not None:
            told["qd"] = qd + self.velocity * rng.normal(size=qd.shape)
        return told, {"time": stamps, "q": links, "tau": efforts}

    def _disturbed(self, rng, count: int, joints: int) -> np.ndarray:
        kept = float(np.exp(-1.0 / (self.rate * self.lasting)))
        fresh = rng.normal(size=(count, joints)) * np.sqrt(1 - kept**2)
        fresh[0] /= np.sqrt(1 - kept**2)
        slow = lfilter([1.0], [1.0, -kept], fresh, axis=0)
        return self.noise * (np.sqrt(self.white) * rng.normal(size=slow.shape) + np.sqrt(1 - self.white) * slow)


def left_by_joint(time, q, true, predicted, over=None) -> np.ndarray:
    """Return RMS (n,) of what a prediction leaves of efforts below `CUT`, where all joints move.

    time (N,), all others (N, n); without noise; over (n,): what it is divided by, else the spread of the efforts.
    What is not predicted is drawn through its neighbours; a joint that is nowhere predicted is nan.
    """
    rate = 1 / float(np.median(np.diff(time)))
    even = np.arange(time[0], time[-1], 1 / rate)
    low = butter(4, CUT, fs=rate, output="sos")

    def slow(values):
        return sosfiltfilt(low, np.interp(even, time, values))

    speeds = [np.gradient(slow(column), even) for column in q.T]
    moves = (np.abs(speeds) > STANDING).all(axis=0)
    out = []
    units = over if over is not None else [max(slow(mine)[moves].std(), 1e-12) for mine in np.transpose(true)]
    for mine, other, unit in zip(np.transpose(true), np.transpose(predicted), units, strict=True):
        known = np.isfinite(other)
        if not known.any():
            out.append(np.nan)
            continue
        left = slow(mine - np.interp(time, time[known], other[known]))
        out.append(np.sqrt(np.mean(left[moves] ** 2)) / unit)
    return np.array(out)


# ---------------------------------------------------------------------------------------------- devices
def plain(rng, physics: str, chain: Chain, kind: Kind, motion: Excitation) -> Candidate:
    """Return an effect of open size at a random place: friction without load or direction."""
    found = candidate(rng, physics, chain, kind, motion)
    fixed = {"coulomb_friction": {"share": 0.0}, "viscous_friction": {"backward": 1.0}}.get(physics, {})
    return replace(found, make=lambda x: found.make(x) | fixed)


def draw_background(rng, load: np.ndarray, speeds: np.ndarray, mass: np.ndarray, names) -> dict[str, dict[str, float]]:
    """Return friction, rotors and offsets of all joints, by physics and joint.

    load (n,): RMS of the joints' efforts, mass (n,): what their rotors are like, speeds (n,): the fastest.
    """
    n = len(names)
    usual = np.maximum(load, 0.1 * load.max())
    heavy = np.maximum(mass, 0.01 * mass.max())
    drawn = {
        "coulomb_friction": usual * np.exp(rng.uniform(np.log(0.04), np.log(0.25), n)),
        "viscous_friction": usual / speeds * np.exp(rng.uniform(np.log(0.04), np.log(0.25), n)),
        "rotor_inertia": heavy * rng.uniform(0.15, 1.0, n),
        "effort_offset": usual * rng.uniform(0.01, 0.06, n) * rng.choice([-1.0, 1.0], n),
    }
    return {physics: dict(zip(names, values.tolist(), strict=True)) for physics, values in drawn.items()}


def draw_log(rng, kind: Kind, load: np.ndarray, peak: np.ndarray, declared: bool, behind: bool) -> Log:
    """Return a controller's log at random; load and peak (n,): RMS and largest of the efforts [N m]."""
    n = len(load)
    noise = kind.noise * float(np.exp(rng.uniform(np.log(0.5), np.log(2.0)))) * np.ones(n)
    if not declared:  # one number need not do for all
        noise *= np.clip(np.sqrt(load / load.max()), 0.15, 1.0) * rng.uniform(0.7, 1.3, n)
    rounded, counted = rng.random(2) < (0.4, 0.5)
    order = int(rng.choice([0, 1, 2], p=[0.3, 0.35, 0.35]))
    jitter = float(rng.uniform(0.05e-3, 0.5e-3)) if rng.random() < 1 / 3 else 0.0
    return Log(
        rate=float(pick(rng, RATES)),
        noise=noise,
        reach=peak * rng.uniform(1.3, 3.0, n),
        delay=np.full(n, float(rng.uniform(1e-3, 8e-3)) if rng.random() < 0.6 else 0.0),
        gain=np.ones(n),
        offset=np.zeros(n),
        position=0.0 if counted else float(np.exp(rng.uniform(np.log(1e-6), np.log(1e-4)))),
        counts=2.0 ** int(rng.integers(12, 21)) if counted else None,
        velocity=float(np.exp(rng.uniform(np.log(2e-4), np.log(3e-3)))) if rng.random() < 0.5 else None,
        jitter=jitter,
        told=bool(rng.random() < 0.5),
        white=float(rng.uniform(0.2, 0.9)),
        lasting=float(np.exp(rng.uniform(np.log(0.01), np.log(0.2)))),
        bits=int(rng.integers(8, 17)) if rounded else None,
        order=order,
        corner=float(np.exp(rng.uniform(np.log(15.0), np.log(80.0)))),
        behind=behind,
    )


def draw_group(rng) -> str:
    """Return what kind of device is drawn."""
    return str(rng.choice(list(GROUPS), p=list(GROUPS.values())))


def draw_elastic(seed: int, robot: str, what: str | None = None, longest: float = 60.0) -> dict[str, Any]:
    """Return an arm with gears that yield: what is logged of two motions, what is declared, and the truth.

    `what`: "faultless", "everywhere", or one of `SINGLE`; drawn where it is None. `longest` [s]: of the motion.
    """
    kind = KINDS[robot]
    chain, names = kind.chain(), kind.chain().names
    rng = np.random.default_rng([seed, 51, *robot.encode()])
    group, turn = draw_group(rng), SINGLE[(seed + sum(robot.encode())) % len(SINGLE)]
    if kind.slow and turn == "effort_delay":
        turn = "payload"
    what = what or (turn if group == "one" else group)
    if what not in (*SINGLE, "faultless", "everywhere"):
        raise ValueError(f"{what!r} is none of faultless, everywhere, {', '.join(SINGLE)}")
    group = "one" if what in SINGLE else what
    declared = bool(rng.random() < 0.5)
    behind = bool(rng.random() < 0.5) and (group == "faultless" or what in BEHIND_GEARS)
    pauses = int(rng.integers(1, 3)) if rng.random() < 0.3 else 0
    most = float(rng.uniform(20.0, 60.0))
    shorter = min(float(rng.uniform(10.0, 15.0)), longest)
    fit, held = (draw_motion(rng, chain, kind, lasting, some) for lasting, some in ((most, pauses), (shorter, 0)))

    coarse = np.arange(0.0, min(most, longest), 0.02)
    q, qd, qdd = fit.at(coarse)
    drawn = Moving(chain, kind.tool).rigid(chain.closed(q, qd, qdd))
    load, peak, top = np.sqrt((drawn**2).mean(0)), np.abs(drawn).max(0), np.abs(qd).max(0)
    log = draw_log(rng, kind, load, np.maximum(peak, 0.1 * peak.max()), declared, behind)
    duration = min(most, longest, ROWS / log.rate)

    # masses
    weighed = [link.name for link in chain.links if link.body >= 0 and link.mass > 0]
    parameters = {f"{name}.{part}": part for name in weighed for part in ("mass", "inertia")}
    scatter = draw_scatter(rng, parameters, {"mass": TOLERANCE, "inertia": TOLERANCE} if declared else {})
    if group == "everywhere":
        scatter = {key: float(rng.uniform(0.1, 0.2) * rng.choice([-1.0, 1.0])) for key in parameters}

    # effects
    yardstick = Yardstick(chain, kind.tool, fit, duration, log.spread, dict.fromkeys(parameters, TOLERANCE))
    singles: list[dict[str, Any]] = []
    chosen = [what] if group == "one" else []
    if group == "everywhere" and rng.random() < 0.3:
        chosen = [pick(rng, EXTRA)]
    for physics in chosen:
        drawer = partial(plain, rng, physics, chain, kind, fit)
        singles.append(effect_of_size(rng, physics, SIZES, [], drawer, yardstick.sizes))
    here = {physics: [e for e in singles if e["physics"] == physics] for physics in SINGLE}
    links = Moving(chain, kind.tool, here["payload"], scatter)
    mass = np.diagonal(mass_matrices(links.chain, q[:: max(len(q) // 200, 1)]).mean(0))
    background: dict[str, dict[str, float]] = {}
    if group == "everywhere":
        background = draw_background(rng, load, top, mass, names)
        log = replace(log, offset=np.array(list(background["effort_offset"].values())))
    delayed, scaled = (Moving(chain, kind.tool, here[physics]) for physics in ("effort_delay", "effort_gain"))
    log = replace(log, delay=log.delay + delayed.effort_delay, gain=scaled.gain)

    # drives
    own = {physics: np.array([background.get(physics, {}).get(name, 0.0) for name in names]) for physics in BACKGROUND}
    for physics, size in BACKGROUND.items():
        for e in here.get(physics, ()):
            own[physics][names.index(e["location"])] += e[size]
    light = UNSEEN * log.noise / np.sqrt((qdd**2).mean(0))
    carried = np.abs(links.rigid(chain.closed(q, qd, qdd))).max(0)
    stiffness = np.maximum(mass * (2 * np.pi * rng.uniform(*BAND, len(names))) ** 2, carried / 0.008)
    drives = Drives(
        names=names,
        rotor=own["rotor_inertia"] + light * (group != "everywhere"),
        stiffness=stiffness,
        damping=2 * rng.uniform(0.01, 0.06, len(names)) * np.sqrt(stiffness * mass),
        coulomb=own["coulomb_friction"],
        viscous=own["viscous_friction"],
        presliding=float(np.exp(rng.uniform(np.log(2e-5), np.log(3e-4)))),
        hold=float(2 * np.pi * rng.uniform(3.0, 8.0)),
        coupled=tuple(here["transmission_coupling"]),
    )
    shake = float(np.exp(rng.uniform(np.log(0.5), np.log(5.0)))) * (rng.random() < 0.85)
    ripple = Ripple(shake * rng.uniform(0.5, 1.5, len(names)), reported=bool(rng.random() < 0.7))
    arm = ElasticArm(links, drives, ripple)

    # logs
    sensors = np.random.default_rng([seed, 52])
    logs, beside = [], []
    for number, (motion, lasting) in enumerate(((fit, duration), (held, shorter))):
        told, truth = log.record(sensors, arm.run(motion, lasting, 2 * seed + number), ripple, lasting)
        logs.append(told)
        beside.append(truth)
    known = beside[1]
    at = np.clip(known["time"], 0.0, None)
    nominal = Moving(chain, kind.tool).rigid(chain.closed(*held.at(at)))
    before, by_noise = (
        left_by_joint(known["time"], known["q"], known["tau"], nominal, over) for over in (None, log.spread)
    )
    about = {
        **{key: getattr(log, key) for key in Log.__dataclass_fields__},
        "shake": ripple.size,
        "ripple_reported": ripple.reported,
        "resonance": np.sqrt(stiffness / mass) / (2 * np.pi),
        **{key: getattr(drives, key) for key in ("rotor", "stiffness", "damping", "presliding", "hold")},
    }
    truths = _background_truths(chain, kind, yardstick, background, scatter) if background else []
    truths += [_single_truth(e, chain, kind, yardstick) for e in singles]
    return {
        "robot": robot,
        "arm": arm,
        "log": log,
        "declared": declared,
        "fit": logs[0],
        "heldout": logs[1],
        "true": known,
        "truth": {
            "seed": seed,
            "robot": robot,
            "group": group,
            "declared": declared,
            "everywhere": group == "everywhere",
            "joints": list(names),
            "effects": truths,
            "values": _values(truths, group, log, names),
            "late": bool(log.late.max() > 0),
            "size": "multiples of the efforts' noise below 8 Hz: RMS by joint (strength), of single effects also of "
            "what is left after the best fit of masses within 5 %, in the strongest joint (size); yielding: by how "
            "much rigid bodies at the motors' positions need other efforts than at the links', by joint",
            "left_by_the_file": before.tolist(),
            "left_by_noise": by_noise.tolist(),
            "noise": log.spread.tolist(),
            "yielding": _yielding(arm, fit, duration, log.spread).tolist(),
            "scatter": scatter,
            "device": {key: value.tolist() if isinstance(value, np.ndarray) else value for key, value in about.items()},
        },
    }


def _yielding(arm: ElasticArm, motion: Excitation, duration: float, noise: np.ndarray) -> np.ndarray:
    """Return RMS (n,), over the noise, by which efforts at the motors' positions differ from those at the links'."""
    t = np.arange(0.0, min(duration, 25.0), 0.01)
    own, chain = motion.at(t), arm.links.chain
    load = arm.links.rigid(chain.closed(*own))
    delta = deflected(t, load, arm.drives)
    seen = arm.links.rigid(chain.closed(*(values + delta(t, order) for order, values in enumerate(own))))
    return np.sqrt(np.mean((seen - load)[20:-20] ** 2, axis=0)) / noise


def _single_truth(e: Mapping[str, Any], chain: Chain, kind: Kind, yardstick: Yardstick) -> dict[str, Any]:
    sizes, n = yardstick.sizes([e]), len(chain.names)
    return {
        "physics": e["physics"],
        "location": e["location"],
        "places": places(e, chain, kind),
        "parameters": {key: value for key, value in e.items() if key not in ("physics", "location")},
        "size": round(float(sizes[-1]), 3),
        "strength": [round(float(x), 3) for x in sizes[:n]],
        "also": also(e, chain, kind),
    }


def _background_truths(chain: Chain, kind: Kind, yardstick: Yardstick, background, scatter) -> list[dict[str, Any]]:
    """Return what is off at all joints, as single effects are told: sizes by joint or link, strengths by joint."""

    def strength(*args) -> list[float]:
        return [round(float(x), 3) for x in np.sqrt((yardstick.beyond(Moving(chain, kind.tool, *args)) ** 2).mean(0))]

    out = []
    for physics, values in background.items():
        key = BACKGROUND[physics]
        acting = [{"physics": physics, "location": name, key: x, "presliding": 1e-4} for name, x in values.items()]
        rms = strength(acting)
        out.append({"physics": physics, "location": "robot", "places": ["robot", *values],
                    "parameters": {key: values}, "size": max(rms), "strength": rms, "also": []})  # fmt: skip
    heavy = list(dict.fromkeys(name.rpartition(".")[0] for name in scatter))
    rms = strength((), scatter)
    here = ["robot", *chain.names, *heavy, *(name for name, (body, _, _) in chain.frames.items() if body >= 0)]
    out.append({"physics": "inertial_parameters", "location": "robot", "places": list(dict.fromkeys(here)),
                "parameters": {"relative": scatter}, "size": max(rms), "strength": rms,
                "also": [{"physics": "payload", "places": here}]})  # fmt: skip
    return out


def _values(truths: Sequence[Mapping[str, Any]], group: str, log: Log, names) -> dict[str, dict[str, float]]:
    """Return sizes that a finding's parameters can be compared with, by physics and joint, tool or robot.

    A payload's mass beside masses that are off, which could be any of theirs, is none.
    """
    out: dict[str, dict[str, float]] = {}
    keys = BACKGROUND | {"effort_gain": "gain", "payload": "mass"}
    for true in truths:
        physics, key = true["physics"], keys.get(true["physics"])
        if key is None or (physics == "payload" and group == "everywhere"):
            continue
        value = true["parameters"][key]
        out.setdefault(physics, {}).update(value if isinstance(value, dict) else {true["location"]: value})
    if log.late.any():
        late = dict(zip(names, log.late.tolist(), strict=True))
        out["effort_delay"] = late | ({"robot": float(log.late[0])} if np.ptp(log.late) < 1e-12 else {})
        if log.order == 1 and not log.delay.any():  # of a delay as well or a second order, it is nobody's time constant
            out["effort_filter"] = dict(out["effort_delay"])
    return out


# ---------------------------------------------------------------------------------------------- files
def write(drawn: Mapping[str, Any], out: Path, sealed: Path, name: str) -> None:
    """Recordings into `out`, the answer into `sealed`."""
    about: dict[str, Any] = {"robot": KINDS[drawn["robot"]].called}
    if drawn["declared"]:
        noise = float(f"{drawn['log'].spread.max():.3g}")
        about |= {"effort_noise": noise, "tolerances": {"mass": TOLERANCE, "inertia": TOLERANCE}}
    seal(out, sealed, name, about, drawn["truth"])
    tables = (
        (out / f"{name}.csv", "fit"),
        (out / f"{name}.heldout.csv", "heldout"),
        (sealed / f"{name}.true.csv", "true"),
    )
    for path, part in tables:
        record = drawn[part]
        groups = [key for key in ("q", "qd", "tau") if key in record]
        head = ["time", *(f"{key}.{joint}" for key in groups for joint in drawn["truth"]["joints"])]
        table = np.column_stack([record["time"], *(record[key] for key in groups)])
        np.savetxt(path, table, "%.9g", ",", header=",".join(head), comments="")


def main(argv=None) -> None:
    parser = drawing(__doc__)
    parser.add_argument("--robot", choices=list(KINDS), default="ur5")
    parser.add_argument("--kind", choices=["faultless", "everywhere", *SINGLE], help="default: drawn at random")
    a = parser.parse_args(argv)
    for seed in range(a.seed, a.seed + a.count):
        drawn = draw_elastic(seed, a.robot, a.kind)
        write(drawn, a.out, a.sealed, f"{a.robot}-{seed:04d}")
        print(json.dumps({"name": f"{a.robot}-{seed:04d}", "rows": len(drawn["fit"]["time"])}))


if __name__ == "__main__":
    main()
