"""Draw a concealed arm under its own weight from a seed, and write what a camera saw of its markers.

    python -m tests.reference.concealed.markers --seed 7 --robot ur5 --out DIR --sealed OTHER_DIR [--kind PHYSICS]

writes DIR/<name>.csv, <name>.json and <name>.heldout.csv, and OTHER_DIR/<name>.truth.json. Every part is a little off
within tolerances that the JSON declares, and where the camera stands is known to millimetres. An effect's size: RMS of
what it moves the marker and direction that it moves most, in multiples of the noise, of it all and of what is left
after the best fit of everything within tolerance (or half the length of that fit in tolerances); the smaller counts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from .chain import Chain
from .draw import Candidate, drawing, effect_of_size, pick, seal, unit
from .efforts import KINDS as ARMS
from .sagging import Sagging
from .scatter import TOLERANCES_TO_ONE, draw_scatter

#: One standard deviation of each kind of parameter.
ORDINARY = {
    "mass": 0.1,
    "position": 2e-4,
    "direction": 3e-4,
    "encoder_offset": 3e-4,
    "encoder_slope": 2e-4,
    "frame_position": 3e-3,
    "frame_rotation": 3e-3,
    "target_position": 1e-3,
    "stiffness": 0.2,
}
FINER, COARSER = 0.5, 1.5
#: Times that a pose is looked at.
LOOKS = 3
#: Kinds with their noise [m], markers, and how soft a joint's gear ordinarily is [N m/rad].
CAMERAS: Mapping[str, tuple[float, tuple[str, ...], float]] = {
    "ur5": (5e-5, ("tool0", "wrist_1_link", "forearm_link"), 2e4),
    "panda": (5e-5, ("panda_hand_tcp", "panda_link6", "panda_link4"), 1.2e4),
    "kinova": (5e-5, ("j2s6s200_end_effector", "j2s6s200_link_4", "j2s6s200_link_3"), 4e3),
    "xarm7": (5e-5, ("link_eef", "link5", "link4"), 1e4),
}
PHYSICS = ("joint_compliance", "joint_compliance", "encoder_offset", "lead_error", "eccentric_encoder",
           "geometric_offset", "target_misalignment", "pose_sensor_drift")  # fmt: skip
#: What can be wrong besides where the springs of the gears are told.
SPRUNG = ("stiffness_changed", "backlash", "payload")
#: Share of the soft joints that are every joint of the robot.
ALIKE = 0.25
ALIENS = ("cubic_compliance", "dragged_joint")
AKIN = {"cubic_compliance": ("joint_compliance", "stiffness_changed"), "dragged_joint": ()}


@dataclass(frozen=True)
class Sight:
    """Encoder readings (N, n), times [s] and the markers that are seen."""

    q: np.ndarray
    time: np.ndarray
    markers: tuple[str, ...]


def draw_sight(rng, robot: str, chain: Chain, poses: int, markers: tuple[str, ...]) -> Sight:
    """Return random poses about the arm's centre, each looked at `LOOKS` times."""
    joints = chain.joints
    reach = np.array([min(1.4, 0.9 * (c - j.limits[0]), 0.9 * (j.limits[1] - c)) if not j.endless else 1.4
                      for j, c in zip(joints, ARMS[robot].centre, strict=True)])  # fmt: skip
    q = np.array(ARMS[robot].centre) + rng.uniform(-1, 1, (poses, len(joints))) * reach
    time = np.cumsum(rng.uniform(8.0, 12.0, poses))
    looks = (time[:, None] + np.arange(LOOKS)).ravel()
    return Sight(np.repeat(q, LOOKS, axis=0), looks, markers)


def parameters(chain: Chain, markers: Sequence[str], springs: Mapping[str, float]) -> dict[str, str]:
    """Return what may be off, with the key of its tolerance."""
    out = {}
    for joint in chain.joints:
        out |= {f"{joint.name}.{axis}": "position" for axis in "xyz"}
        out |= {f"{joint.name}.r{axis}": "direction" for k, axis in enumerate("xyz") if abs(joint.axis[k]) < 0.9}
        out |= {f"{joint.name}.{name}": name for name in ("encoder_offset", "encoder_slope")}
    out |= {f"{name}.stiffness": "stiffness" for name in springs}
    out |= {f"{link.name}.mass": "mass" for link in chain.links if link.body >= 0 and link.mass > 0}
    out |= {f"{name}.t{axis}": "target_position" for name in markers for axis in "xyz"}
    out |= {f"pose_sensor.{axis}": "frame_position" for axis in "xyz"}
    return out | {f"pose_sensor.r{axis}": "frame_rotation" for axis in "xyz"}


class Yardstick:
    """Sizes of effects on one arm whose parts have tolerances."""

    def __init__(self, chain: Chain, tool: str, sight: Sight, springs, tolerances: Mapping[str, float], noise: float):
        self.chain, self.tool, self.sight, self.springs, self.noise = chain, tool, sight, springs, noise
        self.rows = slice(None, None, LOOKS)
        self.nominal = self.told()
        columns = [5 * self.told(scatter={name: 0.2 * size}) - 5 * self.nominal for name, size in tolerances.items()]
        self.by_tolerance = np.sqrt(LOOKS) * np.stack([column.ravel() for column in columns], -1)
        self._normal = self.by_tolerance.T @ self.by_tolerance + np.eye(len(columns))

    def told(self, effects: Sequence[Mapping[str, Any]] = (), scatter=None) -> np.ndarray:
        """Return what is seen (poses, markers, 3), in multiples of the noise."""
        device = Sagging(self.chain, self.tool, effects, scatter, self.springs)
        return device.seen(self.sight.q[self.rows], self.sight.markers, self.sight.time[self.rows]) / self.noise

    def sizes(self, effects: Sequence[Mapping[str, Any]]) -> np.ndarray:
        """Return RMS of all and of what is left in the most moved channel, half the fit's length, and the size."""
        whole = self.told(effects) - self.nominal
        fitted = np.linalg.solve(self._normal, self.by_tolerance.T @ whole.ravel() * np.sqrt(LOOKS))
        left = whole - (self.by_tolerance @ fitted).reshape(whole.shape) / np.sqrt(LOOKS)
        rms, rest = (float(np.sqrt((x**2).mean(0)).max()) for x in (whole, left))
        strained = float(np.linalg.norm(fitted)) / TOLERANCES_TO_ONE
        return np.array([rms, rest, strained, min(rms, max(rest, strained))])


# ---------------------------------------------------------------------------------------------- effects
def candidate(rng, physics: str, chain: Chain, robot: str, sight: Sight, springs: Mapping[str, float]) -> Candidate:
    """Return an effect of open size at a random place."""
    names = [joint.name for joint in chain.joints]
    i = int(rng.integers(len(names)))
    axis, sign = chain.joints[i].axis, float(rng.choice([-1.0, 1.0]))
    place = {"physics": physics, "location": names[i]}
    if physics == "joint_compliance":
        if not springs and rng.random() < ALIKE:
            falling = np.linspace(1.0, 4.0, len(names)) * np.exp(rng.uniform(-0.5, 0.5, len(names)))
            place["location"] = "robot"
            return Candidate(lambda x: place | {"about": list(x * falling)}, 1e-9, 1e-3)
        if not springs and rng.random() < 0.5:
            return Candidate(lambda x: place | {"about": x}, 1e-9, 3e-3)
        if rng.random() < 0.3:
            only = np.cross(axis, unit(rng))
            only = list(only / np.linalg.norm(only))
            return Candidate(lambda x: place | {"across": x, "only": only}, 1e-9, 3e-3)
        return Candidate(lambda x: place | {"across": x}, 1e-9, 3e-3)
    if physics == "stiffness_changed":
        return Candidate(lambda x: place | {"factor": 1 / (1 + x)}, 0.05, 30.0)
    if physics == "backlash":
        return Candidate(lambda x: place | {"half_gap": x, "smooth": 0.3}, 1e-6, 3e-2)
    if physics == "payload":
        lever = list(rng.uniform(0, 0.1) * unit(rng))
        place = {"physics": physics, "location": ARMS[robot].tool, "lever": lever}
        return Candidate(lambda x: place | {"mass": x}, 0.01, 15.0)
    if physics == "encoder_offset":
        return Candidate(lambda x: place | {"offset": sign * x}, 1e-5, 0.1)
    if physics == "lead_error":
        return Candidate(lambda x: place | {"ratio": sign * x}, 1e-5, 0.1)
    if physics == "eccentric_encoder":
        place |= {"phase": float(rng.uniform(0, 2 * np.pi)), "waves": int(rng.choice([1, 2]))}
        return Candidate(lambda x: place | {"amplitude": x}, 1e-5, 0.1)
    if physics == "geometric_offset":
        way = unit(rng)
        if rng.random() < 0.5:
            way = way - axis * (axis @ way)
            return Candidate(lambda x: place | {"rotation": list(x * way)}, 1e-5, 0.1)
        return Candidate(lambda x: place | {"translation": list(x * way)}, 1e-5, 0.05)
    if physics == "target_misalignment":
        way = unit(rng)
        place = {"physics": physics, "location": pick(rng, sight.markers)}
        return Candidate(lambda x: place | {"translation": list(x * way)}, 1e-5, 0.05)
    if physics == "pose_sensor_drift":
        way = unit(rng)
        place = {"physics": physics, "location": "pose_sensor"}
        return Candidate(lambda x: place | {"speed": list(x * way)}, 1e-9, 1e-4)
    kind = pick(rng, ALIENS)
    least, most = {"cubic_compliance": (1e-12, 1e-2), "dragged_joint": (1e-5, 0.1)}[kind]
    place = place | {"kind": kind}
    return Candidate(lambda x: place | {"coefficient": x}, least, most)


def places(effect: Mapping[str, Any], chain: Chain, markers: Sequence[str]) -> list[str]:
    """Return all names of an effect's place; of one marker among several only its own."""
    location, physics = effect["location"], effect["physics"]
    out = [location]
    if physics == "payload":
        body = chain.frames[location][0]
        out += [chain.joints[body].name, *(name for name, (of, _, _) in chain.frames.items() if of == body)]
    elif physics == "target_misalignment" and len(markers) == 1:
        out.append("target")
    elif physics == "joint_compliance" and location == "robot":
        out += [joint.name for joint in chain.joints]
    elif location == "pose_sensor":
        out.append("robot")
    return list(dict.fromkeys(out))


def also(effect: Mapping[str, Any], chain: Chain, markers: Sequence[str]) -> list[dict[str, Any]]:
    """Return what else is true of an effect: an encoder's zero is also a joint turned about its own axis."""
    here = places(effect, chain, markers)
    words: Sequence[str] = ()
    if effect["physics"] == "alien":
        words = AKIN.get(effect["kind"], ())
    elif effect["physics"] == "encoder_offset":
        words = ("geometric_offset",)
    elif effect["physics"] == "stiffness_changed":
        words = ("joint_compliance",)
    return [{"physics": word, "places": here} for word in words]


# ---------------------------------------------------------------------------------------------- device and files
def draw_markers(seed: int, robot: str, effects: Sequence[str] = (), multiple=(3.0, 40.0), sprung: bool = False):
    """An arm under its own weight: what is seen in two tests, what is declared, and the truth.

    `effects`: words of `PHYSICS`, with `sprung` (the gears' stiffness is told) also of `SPRUNG`, or "alien".
    """
    chain, tool = ARMS[robot].chain(), ARMS[robot].tool
    rng = np.random.default_rng([seed, 41, *robot.encode()])
    usual, all_markers, stiff = CAMERAS[robot]
    noise = float(f"{usual * np.exp(rng.uniform(np.log(0.5), np.log(3.0))):.2g}")
    markers = all_markers[: int(rng.integers(1, 4))]
    names = [joint.name for joint in chain.joints]
    springs: dict[str, float] = {}
    if sprung:
        falling = np.linspace(1.0, 0.25, len(names)) * np.exp(rng.uniform(-0.3, 0.3, len(names)))
        springs = {name: float(f"{stiff * share:.3g}") for name, share in zip(names, falling, strict=True)}
    fit = draw_sight(rng, robot, chain, int(rng.integers(40, 91)), markers)
    held = draw_sight(rng, robot, chain, 20, markers)
    off = parameters(chain, markers, springs)
    declared = {
        key: float(f"{value * np.exp(rng.uniform(np.log(FINER), np.log(COARSER))):.2g}")
        for key, value in ORDINARY.items()
        if key in off.values()
    }
    scatter = draw_scatter(rng, off, declared)
    tolerances = {name: declared[kind] for name, kind in off.items()}
    chosen: list[dict] = []
    truths: list[dict] = []
    yardstick = Yardstick(chain, tool, fit, springs, tolerances, noise) if effects else None
    for name in effects:
        effect = effect_of_size(
            rng, name, multiple, chosen, partial(candidate, rng, name, chain, robot, fit, springs), yardstick.sizes
        )
        whole, left, strained, size = yardstick.sizes([effect]).tolist()
        chosen.append(effect)
        truths.append(
            {
                "physics": "unknown" if name == "alien" else name,
                "location": effect["location"],
                "places": places(effect, chain, markers),
                "parameters": {key: value for key, value in effect.items() if key not in ("physics", "location")},
                "size": round(size, 3),
                "strength": round(whole, 3),
                "left": round(left, 3),
                "strained": round(strained, 3),
                "also": also(effect, chain, markers),
            }
        )
    device = Sagging(chain, tool, chosen, scatter, springs)
    own = np.random.default_rng([seed, 42])
    records = []
    for sight in (fit, held):
        # the camera has come back to where it began before the other poses are looked at
        seen = device.seen(sight.q, markers, sight.time * (sight is fit))
        q = sight.q + own.uniform(-5e-7, 5e-7, sight.q.shape)
        records.append({"time": sight.time, "q": q, "p": seen + noise * own.normal(size=seen.shape)})
    nominal = Sagging(chain, tool, (), None, springs)
    before = records[1]["p"] - nominal.seen(held.q, markers, held.time)
    return {
        "robot": robot,
        "device": device,
        "noise": noise,
        "tolerances": declared,
        "springs": springs,
        "fit": records[0],
        "heldout": records[1],
        "truth": {
            "seed": seed,
            "robot": robot,
            "effects": truths,
            "size": "multiples of the noise: RMS in the most moved channel, and of what is left after the best fit "
            "within tolerance (or half its length in tolerances); the smaller",
            "joints": names,
            "markers": list(markers),
            "springs": springs,
            "scatter": scatter,
            "before": float(np.sqrt(np.mean(before**2))) / noise,
        },
    }


def options(drawn: Mapping[str, Any]) -> list[str]:
    """Return what `prup-pin diagnose` is told besides the recording: the springs of the gears, where they are known."""
    springs = ",".join(f"{name}={value:g}" for name, value in drawn["truth"]["springs"].items())
    return ["--joint-stiffness", springs] if springs else []


def write(drawn: Mapping[str, Any], out: Path, sealed: Path, name: str) -> None:
    """Recordings into `out`, the answer into `sealed`."""
    truth = drawn["truth"]
    about = {"robot": ARMS[drawn["robot"]].called, "position_noise": drawn["noise"], "tolerances": drawn["tolerances"]}
    if drawn["springs"]:
        about["notes"] = "the gears' springs are known: " + " ".join(options(drawn))
    seal(out, sealed, name, about, truth)
    columns = ["time", *(f"q.{joint}" for joint in truth["joints"])]
    columns += [f"p.{marker}.{axis}" for marker in truth["markers"] for axis in "xyz"]
    for part, ending in (("fit", ".csv"), ("heldout", ".heldout.csv")):
        record = drawn[part]
        table = np.column_stack([record["time"], record["q"], record["p"].reshape(len(record["time"]), -1)])
        np.savetxt(out / f"{name}{ending}", table, "%.10g", ",", header=",".join(columns), comments="")


def main(argv=None) -> None:
    ap = drawing(__doc__, list(CAMERAS))
    ap.add_argument("--sprung", action="store_true", help="the gears' springs are told")
    a = ap.parse_args(argv)
    for seed in range(a.seed, a.seed + a.count):
        write(
            draw_markers(seed, a.robot, a.kind, tuple(a.multiple), a.sprung), a.out, a.sealed, f"{a.robot}-{seed:04d}"
        )
        print(f"{a.robot}-{seed:04d} written")


if __name__ == "__main__":
    main()
