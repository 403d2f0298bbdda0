"""Draw a concealed device and its bench test from a seed, and write what a bench test leaves behind.

    python -m tests.reference.concealed.draw --seed 7 --out DIR --sealed OTHER_DIR [--effects N] [--kind PHYSICS]
        [--multiple LOW HIGH] [--level NEWTON] [--variants practice|physical|mixed]

writes DIR/<name>.csv, <name>.json and <name>.heldout.csv, and OTHER_DIR/<name>.truth.json with what is different
about the device. The size of each effect is chosen so that, alone, it moves the strongest of the six pose channels
by a given multiple of that channel's noise (RMS over the samples of the fitting part, against the nominal robot in
its deformed equilibrium, at the wrench that the sensor reports). Units SI, radians, degC.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from .device import ALPHA, NOMINAL, T_REF, Device

NOISE = {"position": 2e-6, "rotation": 1e-5, "force": 0.03, "moment": 0.002}  # m, rad, N, N m
LEVELS = np.array([0.0, 0.5, 1.0, 0.5, 0.0, -0.5, -1.0, -0.5, 0.0])  # one cycle along a wrench direction


# ---------------------------------------------------------------------------------------------- bench test
@dataclass
class Programme:
    """Commands of a bench test: q [m] (N, 3), true wrench w (N, 6), temperature [degC] (N,), time [s] (N,).

    speeds [m/s] (N, 3): where the robot moves slowly while it is measured, else None.
    """

    q: np.ndarray
    w: np.ndarray
    temperature: np.ndarray
    time: np.ndarray
    speeds: np.ndarray | None = None


def actuator_positions(z, theta, phi):
    """q [m] (N, 3) of rigid poses z [m], theta, phi [rad]: the closed form of the three loops."""
    ct, st, cp, sp = np.cos(theta), np.sin(theta), np.cos(phi), np.sin(phi)
    la = np.arctan2(-st * sp, ct + cp)
    cl, sl = np.cos(la), np.sin(la)
    # R = Rx Ry Rz, first two columns
    c0 = np.stack([cp * cl, ct * sl + st * sp * cl, st * sl - ct * sp * cl], -1)
    c1 = np.stack([-cp * sl, ct * cl - st * sp * sl, st * cl + ct * sp * sl], -1)
    a, b, d = c0[:, 0], c1[:, 0], c1[:, 1]
    det = a * d - b * b
    radius = NOMINAL["a"]
    p = radius * np.stack([(a * (a - d) / 2 - b * b) / det, b * (a - 3 * d) / (2 * det)], -1)
    q = []
    for alpha in ALPHA:
        e = np.array([np.cos(alpha), np.sin(alpha)])
        along = c0 * e[0] + c1 * e[1]
        se = along[:, :2]
        q.append(z + ((radius * e - p) * se).sum(1) / (se * se).sum(1) * along[:, 2])
    return np.stack(q, -1)


def programme(rng, poses: int, level: float, warm: bool = False, directions: int = 3) -> Programme:
    """Random poses, and at each one cycles along random wrench directions.

    `level` [N] is a typical force: forces are 0.35 to 1.4 times it, moments 0.35 to 1.4 times level x 0.2 m.
    With `warm` the structure's temperature drifts upwards from 20 degC, a few kelvin a pose at random.
    """
    z = rng.uniform(0.30, 0.48, poses)
    tilt = rng.uniform(-0.3, 0.3, (poses, 2))
    block = len(LEVELS) * directions
    q = np.repeat(actuator_positions(z, tilt[:, 0], tilt[:, 1]), block, axis=0)
    w = []
    for _ in range(poses * directions):
        f, m = rng.normal(size=3), rng.normal(size=3)
        f *= level * rng.uniform(0.35, 1.4) / np.linalg.norm(f)
        m *= 0.2 * level * rng.uniform(0.35, 1.4) / np.linalg.norm(m)
        w.append(np.outer(LEVELS, np.r_[f, m]))
    n = len(q)
    temperature = np.full(n, T_REF)
    if warm:
        steps = np.r_[0.0, rng.normal(0.8, 1.6, poses - 1)]
        temperature = temperature + np.repeat(np.cumsum(steps), block) + rng.normal(0, 0.05, n)
    return Programme(q, np.vstack(w), temperature, np.arange(n, dtype=float))


def measure(device: Device, run: Programme, rng=None, noise=NOISE) -> dict[str, np.ndarray]:
    """What the bench records: q, w, p, r, and the temperature and time; without `rng`, free of noise."""
    s = device.simulate(run.q, run.w, run.temperature, run.time)
    if s.residual.max() > 0.2:
        raise RuntimeError(f"equilibrium not found: residual {s.residual.max():.3g}")
    w, q, p, r = device.report_wrench(run.w), run.q, s.p, s.r
    if run.speeds is not None:
        q = device.report_position(q, run.speeds)
    if rng is not None:
        n = len(q)
        q = np.round(q, 7)
        w = w + np.hstack([noise["force"] * rng.normal(size=(n, 3)), noise["moment"] * rng.normal(size=(n, 3))])
        p = p + noise["position"] * rng.normal(size=(n, 3))
        r = r + noise["rotation"] * rng.normal(size=(n, 3))
    moving = {} if run.speeds is None else {"qd": run.speeds}
    return {"q": q, "w": w, "p": p, "r": r, "temperature": run.temperature, "time": run.time} | moving


def strength(effects, run: Programme, noise=NOISE) -> np.ndarray:
    """RMS over the run of what the effects change, by pose channel, in multiples of its noise (6,)."""
    seen = measure(Device(effects), run)
    expected = Device().simulate(seen["q"], seen["w"], run.temperature, run.time)
    e = np.hstack([(seen["p"] - expected.p) / noise["position"], (seen["r"] - expected.r) / noise["rotation"]])
    return np.sqrt((e**2).mean(0))


# ---------------------------------------------------------------------------------------------- effects
@dataclass
class Candidate:
    """An effect whose size is one positive number x: make(x), bounds of x, and what the truth calls it."""

    make: Callable[[float], dict]
    low: float
    high: float
    fixed: bool = False


STIFFNESSES = [
    ("linear_rod", "E"), ("moving_star_branch", "E"), ("ball_screw", "E"), ("ball_nut", "axial"),
    ("support_bearing", "axial"), ("timing_belt", "stiffness"), ("motor", "torsional"), ("R_lambda", "radial"),
    ("R_lambda", "axial"), ("R_lambda", "tilting"), ("R_phi", "axial"), ("R_phi", "radial"), ("R_theta_P", "radial"),
]  # fmt: skip
GAPS = [("ball_nut", "axial"), ("R_lambda", "axial"), ("R_phi", "axial"), ("R_theta_P", "radial")]
CONTACTS = [("R_theta_P", "radial"), ("R_lambda", "radial"), ("R_phi", "radial")]
CREEPS = [("support_bearing", "axial"), ("R_lambda", "tilting"), ("R_lambda", "axial"),
          ("R_phi", "axial"), ("R_theta_P", "radial")]  # fmt: skip
ALIENS = {  # kind: bounds of its coefficient
    "cubic": (1e-13, 1e-8), "quadratic": (1e-12, 1e-6), "one_sided": (1e-10, 1e-5), "drift": (1e-12, 1e-7),
    "periodic_stiffness": (0.05, 300.0), "coupling": (1e-9, 1e-5), "tilt_quadratic": (1e-8, 1e-3),
    "angle_stiffness": (0.05, 60.0),
}  # fmt: skip
# on request only, as are shear, which stays below the noise at ordinary loads, torsion, which only friction causes, and
# base_compliance
RARE = ["viscous_friction", "encoder_delay"]
PHYSICS = [
    "stiffness_changed", "backlash", "hertzian_contact", "coulomb_friction", "self_weight",
    "root_tilt_compliance", "hub_root_compliance", "thermal_growth", "lead_error", "geometric_offset",
    "encoder_offset", "wrench_sensor_misalignment", "wrench_sensor_gain", "wrench_sensor_bias",
    "pose_sensor_misalignment", "creep", "payload", "alien",
]  # fmt: skip


def pick(rng, items):
    """One of some items."""
    return items[int(rng.integers(len(items)))]


def unit(rng) -> np.ndarray:
    """A random direction (3,)."""
    v = rng.normal(size=3)
    return v / np.linalg.norm(v)


def candidate(rng, physics: str, variants: str = "practice") -> Candidate:
    """A random place and kind of one physics, its size still open.

    `variants` chooses between readings of one physics: "practice" takes play rounded within 0.5 to 1 N, a contact's
    tangent stiffness and the star's weight at P; "physical" sharper play, either contact law and branches loaded
    along their length; "mixed" one of the two at random.
    """
    if variants == "mixed":
        variants = pick(rng, ["practice", "physical"])
    plain = variants == "practice"
    leg = f"leg{int(rng.integers(1, 4))}"
    sign = float(rng.choice([-1.0, 1.0]))

    def effect(module, **size):
        return {"physics": physics, "location": f"{leg}/{module}" if module else "robot", **size}

    if physics == "stiffness_changed":
        module, parameter = pick(rng, STIFFNESSES)
        return Candidate(lambda x: effect(module, parameter=parameter, factor=1.0 / (1.0 + x)), 0.05, 60.0)
    if physics == "backlash":
        module, direction = pick(rng, GAPS)
        smooth = float(rng.choice([0.5, 1.0]) if plain else rng.uniform(0.1, 0.5))
        return Candidate(lambda x: effect(module, direction=direction, half_gap=x, smooth=smooth), 1e-6, 3e-4)
    if physics == "hertzian_contact":
        module, direction = pick(rng, CONTACTS)
        f0, secant = float(rng.uniform(1.0, 10.0)), bool(not plain and rng.random() < 0.5)
        return Candidate(
            lambda x: effect(module, direction=direction, f0=f0, f_ref=x, secant=secant), 10.0, 1e10
        )  # fmt: skip
    if physics == "coulomb_friction":
        joint, module = pick(rng, [("theta", "R_theta_P"), ("phi", "R_phi"), ("lambda", "R_lambda"),
                                    ("slide", "R_theta_P")])  # fmt: skip
        if joint == "slide":
            pre = float(rng.uniform(1e-4, 5e-4))
            return Candidate(lambda x: effect(module, joint=joint, limit=x, presliding=pre), 0.2, 60.0)
        per_moment = float(rng.uniform(2e-4, 2.5e-4) if plain else rng.uniform(5e-5, 1e-3))  # rad at 1 N m
        return Candidate(lambda x: effect(module, joint=joint, limit=x, presliding=per_moment * x), 0.01, 8.0)
    if physics == "viscous_friction":
        joint, module = pick(rng, [("theta", "R_theta_P"), ("phi", "R_phi"), ("lambda", "R_lambda"),
                                    ("slide", "R_theta_P")])  # fmt: skip
        low, high = (10.0, 1e7) if joint == "slide" else (1.0, 1e5)
        return Candidate(lambda x: effect(module, joint=joint, damping=x), low, high)
    if physics == "encoder_delay":
        return Candidate(lambda x: effect("motor", delay=x), 1e-5, 0.2)
    if physics == "self_weight":
        return Candidate(lambda x: effect("", branches="hub" if plain else "distributed"), 1, 1, fixed=True)
    if physics in ("shear", "torsion"):
        return Candidate(lambda x: effect(""), 1, 1, fixed=True)
    if physics == "root_tilt_compliance":
        return Candidate(lambda x: effect("linear_rod", stiffness=1.0 / x), 1e-7, 2e-3)
    if physics == "hub_root_compliance":
        return Candidate(lambda x: effect("moving_star_branch", stiffness=1.0 / x), 1e-7, 5e-3)
    if physics == "thermal_growth":
        module = pick(rng, ["ball_screw", "ball_screw", "linear_rod"])
        return Candidate(lambda x: effect(module, coefficient=x), 1e-7, 2e-4)
    if physics == "lead_error":
        if rng.random() < 0.5:
            return Candidate(lambda x: effect("ball_screw", kind="proportional", ratio=sign * x), 1e-6, 2e-2)
        phase = float(rng.uniform(0, 2 * np.pi))
        return Candidate(lambda x: effect("ball_screw", kind="periodic", amplitude=x, phase=phase), 1e-6, 5e-4)
    if physics == "geometric_offset":
        which = pick(rng, ["radial", "tangential", "height", "both", "offset"])
        turn = rng.uniform(0, 2 * np.pi)
        if which == "both":
            return Candidate(lambda x: effect("base", radial=x * np.cos(turn), tangential=x * np.sin(turn)), 1e-6, 5e-3)
        module = "R_lambda" if which == "offset" else "base"
        return Candidate(lambda x: effect(module, **{which: sign * x}), 1e-6, 5e-3)
    if physics == "encoder_offset":
        module = "ball_screw"
        return Candidate(lambda x: effect(module, offset=sign * x), 1e-6, 5e-3)
    if physics == "wrench_sensor_misalignment":
        v = unit(rng)
        return Candidate(
            lambda x: {"physics": physics, "location": "wrench_sensor", "rotation": list(x * v)}, 1e-4, 0.2
        )
    if physics == "wrench_sensor_gain":
        which = pick(rng, [[0, 1, 2], [3, 4, 5], list(range(6)), [int(rng.integers(6))]])

        def gain(x):
            g = np.ones(6)
            g[which] += sign * x
            return {"physics": physics, "location": "wrench_sensor", "gain": list(g)}

        return Candidate(gain, 1e-4, 0.4)
    if physics == "wrench_sensor_bias":
        v = np.r_[unit(rng), np.zeros(3)] if rng.random() < 0.5 else np.r_[np.zeros(3), 0.15 * unit(rng)]
        return Candidate(lambda x: {"physics": physics, "location": "wrench_sensor", "bias": list(x * v)}, 0.02, 60.0)
    if physics == "pose_sensor_misalignment":
        v, t = unit(rng), unit(rng) * (0.0 if rng.random() < 0.5 else 0.2)

        def pose(x):
            return {"physics": physics, "location": "pose_sensor", "rotation": list(x * v), "translation": list(x * t)}

        return Candidate(pose, 1e-6, 0.05)
    if physics == "creep":
        module, direction = pick(rng, CREEPS)
        tau = float(rng.uniform(1.0, 20.0))
        return Candidate(
            lambda x: effect(module, direction=direction, ratio=x, time_constant=tau), 0.02, 20.0
        )  # fmt: skip
    if physics == "payload":
        lever = list(rng.uniform(0, 0.05) * unit(rng)) if rng.random() < 0.5 else [0.0, 0.0, 0.0]
        return Candidate(
            lambda x: {"physics": physics, "location": "moving_star", "mass": x, "lever": lever}, 0.02, 40.0
        )  # fmt: skip
    if physics == "base_compliance":
        return soft_ground(rng)
    if physics == "alien":
        return _alien(rng, leg, sign)
    raise ValueError(f"no such physics: {physics}")


def soft_ground(rng) -> Candidate:
    """A frame that tilts more or less than it shifts; half of them alike in all directions."""
    tilt = float(np.exp(rng.uniform(np.log(1.0), np.log(30.0))))  # turn over way, by unit moment and force
    along, about = np.ones((2, 3)) if rng.random() < 0.5 else np.exp(rng.uniform(-1.5, 1.5, (2, 3)))
    place = {"physics": "base_compliance", "location": "base"}
    return Candidate(
        lambda x: place | {"translation": list(x * along), "rotation": list(x * tilt * about)}, 1e-11, 1e-4
    )


def _alien(rng, leg, sign) -> Candidate:
    kind = pick(rng, list(ALIENS))
    low, high = ALIENS[kind]
    place = {"drift": "ball_screw", "periodic_stiffness": "ball_screw", "cubic": "ball_nut", "quadratic": "timing_belt",
             "one_sided": "support_bearing", "coupling": "support_bearing", "tilt_quadratic": "R_lambda",
             "angle_stiffness": "R_theta_P"}[kind]  # fmt: skip
    e = {"physics": "alien", "location": f"{leg}/{place}", "kind": kind}
    key = "amplitude" if kind in ("periodic_stiffness", "angle_stiffness") else "coefficient"
    if kind == "periodic_stiffness":
        e |= {"period": float(rng.uniform(0.02, 0.15)), "phase": float(rng.uniform(0, 2 * np.pi))}
    if kind == "angle_stiffness":
        e |= {"phase": float(np.pi / 2)}
    if kind == "coupling":
        e |= {"of": (int(leg[3]) % 3) + 1}
    flip = sign if kind in ("drift", "coupling") else 1.0
    return Candidate(lambda x: e | {key: flip * x}, low, high)


def scaled(cand: Candidate, run: Programme | None, target: float, noise=NOISE, sized=None) -> tuple[dict, np.ndarray]:
    """The effect at the size that gives `target` in its strongest channel (or at its bound), and its strengths.

    `sized(effects)` returns strengths by another yardstick.
    """
    if sized is None:
        sized = partial(strength, run=run, noise=noise)
    if cand.fixed:
        e = cand.make(1.0)
        return e, sized([e])

    def excess(x):
        return sized([cand.make(x)])

    x = np.sqrt(cand.low * cand.high)
    s = excess(x)
    lo, hi = cand.low, cand.high  # bracket
    for _ in range(12):
        top = s.max()
        if abs(top / target - 1) < 0.03 or hi / lo < 1.02:
            break
        if top < target:
            lo = x
        else:
            hi = x
        guess = x * target / max(top, 1e-9)
        x = (
            guess
            if lo * 1.01 < guess < hi / 1.01
            else (min(max(guess, lo), hi) if _end(guess, cand) else np.sqrt(lo * hi))
        )
        s = excess(x)
    return cand.make(float(x)), s


def effect_of_size(
    rng,
    name: str,
    multiple: tuple[float, float],
    chosen: Sequence[Mapping[str, Any]],
    drawn: Callable[[], Candidate],
    sizes: Callable[[Sequence[Mapping[str, Any]]], np.ndarray],
) -> dict:
    """An effect, elsewhere than those chosen, whose size, the last of `sizes`, is drawn log-uniformly from a range."""

    def size(effects):
        return sizes(effects)[-1:]

    target = float(np.exp(rng.uniform(*np.log(multiple))))
    taken = [(effect["physics"], effect["location"]) for effect in chosen]
    best = None
    for tries in range(16):  # where a size is out of reach, the place is drawn again
        try:
            effect, found = scaled(drawn(), None, target, sized=size)
        except RuntimeError:  # so large that nothing balances
            continue
        miss = abs(np.log(max(found[0], 1e-9) / target))
        if (effect["physics"], effect["location"]) in taken:
            miss += 10.0
        if best is None or miss < best[0]:
            best = miss, effect
        if best[0] < 0.2:
            break
        if tries > 4 and best[0] < 5 and size([best[1]])[0] > 0.95 * multiple[0]:
            break
    if best is None:
        raise RuntimeError(f"no {name} of size {target:.3g} found")
    return best[1]


def _end(guess, cand):
    return guess <= cand.low or guess >= cand.high


# ---------------------------------------------------------------------------------------------- device and files
def draw(seed: int, effects=None, multiple=(4.0, 40.0), level: float | None = None, poses=(14, 6),
         variants: str = "practice", noise=NOISE) -> dict:  # fmt: skip
    """A device and its bench test: device, fit and held-out records (noisy), and the truth.

    `effects`: None for a random number (0 to 3, mostly 1), a number, or a list of names of PHYSICS. `multiple`: the
    range of each effect's strength in its strongest channel, drawn log-uniformly. `level` [N]: typical force,
    None for 15 to 150 N. `noise`: standard deviations of the sensors.
    """
    rng = np.random.default_rng(seed)
    if level is None:
        level = float(np.exp(rng.uniform(np.log(15.0), np.log(150.0))))
    if effects is None:
        effects = int(rng.choice([0, 1, 2, 3], p=[0.15, 0.6, 0.2, 0.05]))
    free = isinstance(effects, int)
    names = [pick(rng, PHYSICS) for _ in range(effects)] if free else list(effects)
    warm = "thermal_growth" in names or bool(rng.random() < 0.15)
    fit, held = (programme(rng, n, level, warm) for n in poses)
    if "encoder_delay" in names:
        for run in (fit, held):  # a slow crawl, at another speed in each pose
            moves = np.r_[True, np.abs(np.diff(run.q, axis=0)).max(1) > 0]
            run.speeds = rng.uniform(-0.02, 0.02, (int(moves.sum()), 3))[np.cumsum(moves) - 1]
    chosen, truths = [], []
    for name in names:
        target = float(np.exp(rng.uniform(*np.log(multiple))))
        best = None
        for _ in range(16):  # where a size is out of reach, the place (or, if free, the physics) is drawn again
            cand = candidate(rng, name, variants)
            e, s = scaled(cand, fit, target, noise)
            miss = 0.0 if cand.fixed else abs(np.log(max(s.max(), 1e-9) / target))
            if (e["physics"], e["location"]) in {(c["physics"], c["location"]) for c in chosen}:
                miss += 10.0
            if best is None or miss < best[0]:
                best = (miss, e, s)
            if best[0] < 0.2:
                break
            if free:
                name = pick(rng, PHYSICS)
                warm_needed = name == "thermal_growth" and not warm
                name = "encoder_offset" if warm_needed else name
        _, e, s = best
        chosen.append(e)
        truths.append(_truth(e, s, target))
    device = Device(chosen)
    sensors = np.random.default_rng([seed, 1])
    return {
        "device": device,
        "fit": measure(device, fit, sensors, noise),
        "heldout": measure(device, held, sensors, noise),
        "noise": noise,
        "warm": warm,
        "truth": {
            "seed": seed,
            "effects": truths,
            "level": level,
            "strength_together": [round(v, 3) for v in strength(chosen, fit, noise).tolist()] if chosen else [0.0] * 6,
            "channels": ["p.x", "p.y", "p.z", "r.x", "r.y", "r.z"],
            "unit": "multiples of the channel's noise, RMS over the fitting part",
        },
    }


def _truth(e, s, target) -> dict:
    size = {k: v for k, v in e.items() if k not in ("physics", "location")}
    physics = "unknown" if e["physics"] == "alien" else e["physics"]
    return {"physics": physics, "location": e["location"], "parameters": size,
            "strength": [round(v, 3) for v in s.tolist()], "requested": round(target, 3)}  # fmt: skip


SLIDES = ("leg1_slide", "leg2_slide", "leg3_slide")


def write_csv(path: Path, rec: dict[str, np.ndarray], temperature: bool, actuated=SLIDES) -> None:
    """One recording as a table: time, encoders, wrench, pose and, if asked for, temperature."""
    head = ["time", *(f"q.{name}" for name in actuated), *(f"w.{c}" for c in ("fx", "fy", "fz", "mx", "my", "mz")),
            "p.x", "p.y", "p.z", "r.x", "r.y", "r.z"]  # fmt: skip
    cols = [rec["time"][:, None], rec["q"], rec["w"], rec["p"], rec["r"]]
    if temperature:
        head.append("temperature")
        cols.append(rec["temperature"][:, None])
    if "qd" in rec:
        head += [f"qd.{name}" for name in actuated]
        cols.append(rec["qd"])
    np.savetxt(path, np.hstack(cols), delimiter=",", header=",".join(head), comments="", fmt="%.9g")


def write(drawn: dict, out: Path, sealed: Path, name: str, declared: bool = True) -> None:
    """Recordings into `out`, the answer into `sealed`; `declared`: whether the recordings tell their noise."""
    about = {"robot": "3prup", "frame": "base"}
    if declared:
        about |= {f"{k}_noise": v for k, v in drawn["noise"].items()}
    seal(out, sealed, name, about, drawn["truth"])
    write_csv(out / f"{name}.csv", drawn["fit"], drawn["warm"])
    write_csv(out / f"{name}.heldout.csv", drawn["heldout"], drawn["warm"])


def seal(out: Path, sealed: Path, name: str, about: Mapping[str, Any], truth: Mapping[str, Any]) -> None:
    """Make the folders; write what the recording says of itself into `out` and the answer into `sealed`."""
    out.mkdir(parents=True, exist_ok=True)
    sealed.mkdir(parents=True, exist_ok=True)
    (out / f"{name}.json").write_text(json.dumps(about, indent=1) + "\n")
    (sealed / f"{name}.truth.json").write_text(json.dumps(truth, indent=1) + "\n")


def write_records(
    drawn: Mapping[str, Any],
    out: Path,
    sealed: Path,
    robot_file: str,
    actuated: Sequence[str],
    named: Mapping[str, dict],
) -> list[Path]:
    """Write a table with its JSON for each of the `records` into `out`, and the answers into `sealed`.

    named: by the names of the tables what the JSON of each says besides. Return the tables.
    """
    noise = {f"{key}_noise": value for key, value in drawn["noise"].items()}
    about = {"robot": robot_file, **noise, "tolerances": drawn["tolerances"]}
    paths = []
    for record, (name, more) in zip(drawn["records"], named.items(), strict=True):
        seal(out, sealed, name, {**about, **more}, drawn["truth"])
        paths.append(out / f"{name}.csv")
        write_csv(paths[-1], record, False, actuated)
    return paths


def drawing(doc: str, robots: Sequence[str] = ()) -> argparse.ArgumentParser:
    """The command line of those who draw devices: seeds, folders, and of some kinds the robot and what is wrong."""
    ap = argparse.ArgumentParser(description=doc.split("\n\n")[0])
    ap.add_argument("--seed", type=int, required=True)
    ap.add_argument("--count", type=int, default=1, help="devices from consecutive seeds")
    ap.add_argument("--out", type=Path, required=True)
    ap.add_argument("--sealed", type=Path, required=True, help="directory of the answers")
    if robots:
        ap.add_argument("--robot", choices=list(robots), default=robots[0])
        ap.add_argument("--kind", action="append", default=[], help="this physics (repeatable); none: scatter alone")
        ap.add_argument("--multiple", type=float, nargs=2, default=(3.0, 40.0), help="range of sizes")
    return ap


def main(argv=None) -> None:
    ap = drawing(__doc__)
    ap.add_argument("--effects", type=int, help="number of effects; default: random, mostly one")
    ap.add_argument(
        "--kind",
        action="append",
        choices=[*PHYSICS, *RARE, "shear", "torsion", "base_compliance"],
        help="this physics (repeatable)",
    )
    ap.add_argument("--multiple", type=float, nargs=2, default=(4.0, 40.0), help="range of strength in noise")
    ap.add_argument("--level", type=float, help="typical force in N")
    ap.add_argument("--variants", choices=["practice", "physical", "mixed"], default="practice")
    a = ap.parse_args(argv)
    for seed in range(a.seed, a.seed + a.count):
        drawn = draw(seed, a.kind or a.effects, tuple(a.multiple), a.level, variants=a.variants)
        write(drawn, a.out, a.sealed, f"d{seed:04d}")
        print(f"d{seed:04d} written")


if __name__ == "__main__":
    main()
