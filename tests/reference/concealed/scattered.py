"""Draw a concealed device whose parameters scatter, of one of three robots, and write what a bench test leaves behind.

    python -m tests.reference.concealed.scattered --seed 7 --robot six_ups --out DIR --sealed OTHER_DIR
        [--kind PHYSICS] [--misjudged]

writes what `draw` writes, and the tolerances into the JSON beside the recording. A misjudged device is one whose
tolerances are declared half as wide or twice as wide as they are, each kind for itself. The size of an effect is
chosen beside the scatter: `scatter.Yardstick.strength`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from . import arm, device, draw, platform
from .draw import LEVELS, Candidate, Programme, scaled
from .machine import T_REF
from .scatter import BEYOND, ORDINARY, Yardstick, draw_scatter

#: Each kind's tolerance is drawn between these multiples of the ordinary one.
FINER, COARSER = 0.5, 1.5
#: Full load is this much more than what scattered devices bear.
SHARE_OF_LOAD = 0.6
WEIGHT = {"physics": "self_weight", "location": "robot"}
#: Share of the effects that could be one part's which are all like parts' alike.
ALIKE = 0.3


@dataclass(frozen=True)
class Kind:
    """One of the robots: how it is made, moved and loaded, what can be wrong with it, and its sensors.

    `level` [N] is a typical force at full load and `lever` [m] turns it into a moment; `candidate(rng, physics)`
    returns an effect of open size; `file` is the robot file in tests/robots, or the name of a packaged robot.
    """

    name: str
    file: str
    machine: Callable[..., Any]
    parameters: Mapping[str, str]
    actuated: tuple[str, ...]
    poses: Callable[[Any, int], np.ndarray]
    candidate: Callable[..., Candidate]
    physics: tuple[str, ...]
    level: float
    lever: float
    directions: int
    noise: Mapping[str, float]
    tolerances: Mapping[str, float] = field(default_factory=lambda: ORDINARY)

    def programme(self, rng, poses: int, warm: bool = False) -> Programme:
        """Random poses, and at each one cycles along random wrench directions at 0.6 of full load."""
        level = SHARE_OF_LOAD * self.level
        block = len(LEVELS) * self.directions
        q = np.repeat(self.poses(rng, poses), block, axis=0)
        w = []
        for _ in range(poses * self.directions):
            size = level * rng.uniform(0.35, 1.4, 2) * [1.0, self.lever]
            w.append(np.outer(LEVELS, np.r_[size[0] * draw.unit(rng), size[1] * draw.unit(rng)]))
        temperature = np.full(len(q), T_REF)
        if warm:
            steps = np.r_[0.0, rng.normal(0.8, 1.6, poses - 1)]
            temperature = temperature + np.repeat(np.cumsum(steps), block) + rng.normal(0, 0.05, len(q))
        return Programme(q, np.vstack(w), temperature, np.arange(len(q), dtype=float))


# ---------------------------------------------------------------------------------------------- effects
def _prup_candidate(rng, physics: str) -> Candidate:
    """An effect of the 3-PRUP: those of devices without scatter, tilted rods, and gaps of each direction for itself."""
    if physics == "geometric_offset" and rng.random() < 0.4:
        turn, leg = rng.uniform(0, 2 * np.pi), int(rng.integers(1, 4))
        place = {"physics": physics, "location": f"leg{leg}/linear_rod"}
        return Candidate(lambda x: place | {"tilt": [x * np.cos(turn), x * np.sin(turn)]}, 1e-6, 5e-2)
    if physics == "backlash" and rng.random() < 0.25:
        module, leg = draw.pick(rng, ["R_theta_P", "R_lambda"]), int(rng.integers(1, 4))
        place = {"physics": physics, "location": f"leg{leg}/{module}", "direction": "radial", "by_axis": True}
        return Candidate(lambda x: place | {"half_gap": x, "smooth": 0.5}, 1e-6, 3e-4)
    if physics == "target_misalignment":
        return _frame(rng, physics, "target")
    if physics == "external_spring":
        return _hose(rng, np.array([0.0, 0.0, 0.4]))
    if physics == "base_compliance":
        return draw.soft_ground(rng)
    found = draw.candidate(rng, physics)
    if physics in ("thermal_growth", "stiffness_changed") and rng.random() < ALIKE:
        return _alike(found)
    return found


def _alike(found: Candidate) -> Candidate:
    """The same at every like place of the robot."""

    def make(x):
        effect = found.make(x)
        module = effect["location"].split("/", 1)[1]
        more = {"of": "q-d"} if module == "linear_rod" else {}
        return effect | more | {"location": "robot", "module": module}

    return Candidate(make, found.low, found.high)


def _hose(rng, middle) -> Candidate:
    place = {"physics": "external_spring", "location": "environment", "rest": list(middle + rng.uniform(-0.1, 0.1, 3))}
    return Candidate(lambda x: place | {"stiffness": x}, 0.1, 1e6)


def _frame(rng, physics, location) -> Candidate:
    turn, shift = draw.unit(rng), draw.unit(rng) * (0.0 if rng.random() < 0.5 else 0.3)
    place = {"physics": physics, "location": location}
    return Candidate(lambda x: place | {"rotation": list(x * turn), "translation": list(x * shift)}, 1e-6, 0.2)


def _machine_candidate(rng, physics: str, robot: str) -> Candidate:
    """An effect of the platform or the arm."""
    serial = robot == "elastic_arm"
    machine = arm.Arm if serial else platform.Platform
    i = int(rng.integers(6))
    drive, joint, sign = machine.DRIVES[i], machine.ACTUATED[i], float(rng.choice([-1.0, 1.0]))
    unit, typical = (1.0, 100.0) if serial else (1.0, 500.0)  # N m, N
    soft = typical / machine.STIFFNESS[i]  # what a drive yields under a typical load
    place = {"physics": physics, "location": drive}
    if physics == "stiffness_changed":
        return Candidate(lambda x: place | {"factor": 1 / (1 + x)}, 0.05, 60.0)
    if physics == "thermal_growth" and rng.random() < ALIKE:
        return _alike(Candidate(lambda x: place | {"coefficient": x}, 1e-7, 1e-3))
    if physics == "backlash":
        smooth = float(unit * rng.uniform(0.2, 0.8))
        return Candidate(lambda x: place | {"half_gap": x, "smooth": smooth}, 1e-3 * soft, 1e3 * soft)
    if physics == "coulomb_friction" and not serial:
        rubs = draw.pick(rng, ["slide", "slide", "u1", "u2"])
        way = float(np.exp(rng.uniform(np.log(1e-6), np.log(1e-5)))) * (1.0 if rubs == "slide" else 10.0)  # m, rad
        place = {"physics": physics, "location": f"leg{i + 1}_{rubs}"}
        return Candidate(lambda x: place | {"limit": x, "presliding": way}, 1.0, 500.0)
    if physics == "hertzian_contact":
        f0 = float(0.02 * typical * rng.uniform(0.5, 2.0))
        return Candidate(lambda x: place | {"f0": f0, "f_ref": x}, 0.02 * typical, 1e9 * typical)
    if physics == "hardening":
        return Candidate(lambda x: place | {"doubling": soft / np.sqrt(x)}, 1e-4, 1e2)
    if physics == "lead_error":
        return Candidate(lambda x: place | {"ratio": sign * x}, 1e-6, 0.05)
    if physics == "encoder_offset":
        return Candidate(lambda x: {"physics": physics, "location": joint, "offset": sign * x}, 1e-6, 0.05)
    if physics == "thermal_growth":
        return Candidate(lambda x: place | {"coefficient": x}, 1e-7, 1e-3)
    if physics == "geometric_offset":
        v = draw.unit(rng)
        if serial:
            turned = bool(rng.random() < 0.5)
            v = v * (1 - arm.AXES[i]) if turned else v
            key, at, location = ("rotation" if turned else "translation"), joint, joint
        else:
            key, at, location = "translation", f"leg{i + 1}_{draw.pick(rng, ['u1', 'seat'])}", f"leg{i + 1}"
        place = {"physics": physics, "location": location, "place": at}
        return Candidate(lambda x: place | {key: list(x * v)}, 1e-6, 0.05)
    if physics == "payload":
        lever = list(rng.uniform(0, 0.05) * draw.unit(rng)) if rng.random() < 0.5 else [0.0, 0.0, 0.0]
        body = "tool" if serial else "platform"
        most = 40.0 if serial else 400.0
        return Candidate(lambda x: {"physics": physics, "location": body, "mass": x, "lever": lever}, 0.02, most)
    if physics == "base_compliance":
        return draw.soft_ground(rng)
    if physics == "external_spring":
        return _hose(rng, np.array([0.7, 0.0, 1.3]) if serial else platform.HOME)
    if physics in ("pose_sensor_misalignment", "target_misalignment"):
        return _frame(rng, physics, physics.removesuffix("_misalignment"))
    if physics == "wrench_sensor_bias":
        v = np.r_[draw.unit(rng), np.zeros(3)] if rng.random() < 0.5 else np.r_[np.zeros(3), 0.3 * draw.unit(rng)]
        place = {"physics": physics, "location": "wrench_sensor"}
        return Candidate(lambda x: place | {"bias": list(x * v)}, 1e-4 * typical, 4.0 * typical)
    if physics == "alien":
        kind = draw.pick(rng, ["cubic", "quadratic", "one_sided", "coupling"])
        power = {"cubic": 3, "quadratic": 2}.get(kind, 1)
        place = {"physics": physics, "location": drive, "kind": kind}
        if kind == "coupling":
            place["of"] = i % 6 + 1 if i < 5 else 1
            place["of"] = place["of"] + 1 if place["of"] == i + 1 else place["of"]
        size = soft / typical**power * typical
        return Candidate(lambda x: place | {"coefficient": x}, 1e-3 * size / typical, 1e4 * size / typical)
    return draw.candidate(rng, physics)


def _of(robot: str) -> Callable[..., Candidate]:
    return lambda rng, physics: _machine_candidate(rng, physics, robot)


def places(robot: str, effect: Mapping[str, Any]) -> list[str]:
    """Return all names of an effect's place in the robot file, the vocabulary's first."""
    location, physics = effect["location"], effect["physics"]
    out = [location]
    if location == "robot" and "module" in effect:  # the same at all like places
        out += [effect["module"], *(f"leg{leg}/{effect['module']}" for leg in range(1, 4 if robot == "3prup" else 7))]
    elif robot == "3prup":
        joint = f"{location.split('/')[0]}_slide"
        if physics == "geometric_offset" and ("tilt" in effect or location.endswith("/base")):
            out.append(joint)
        if physics in ("encoder_offset", "encoder_delay", "lead_error") and location.startswith("leg"):
            out += [joint, f"{location.split('/')[0]}/motor", f"{location.split('/')[0]}/ball_screw"]
    elif physics == "geometric_offset" and robot == "six_ups":
        out += [effect["place"], *(f"{location}_u1", f"{location}_u2") * (effect["place"][-2:] == "u1")]
        if location == "leg1" and effect["place"].endswith("seat"):
            out += [f"leg1_s{k}" for k in (1, 2, 3)]
    elif location.endswith("/drive"):
        out.append(location.replace("/drive", "_slide" if robot == "six_ups" else ""))
    elif physics == "encoder_offset":
        out.append(location.replace("_slide", "") + "/drive")
    return list(dict.fromkeys(out))


def beyond(kind: Kind, scatter: Mapping[str, float], declared: Mapping[str, float]) -> list[str]:
    """Return the places of parameters that are beyond three declared tolerances: misjudged devices have some."""
    out: list[str] = []
    for name, amount in scatter.items():
        if abs(amount) > BEYOND * declared[kind.parameters[name]]:
            place = name.rpartition(".")[0]
            leg = place.partition("_")[0]
            out.append(place)
            if kind.name == "3prup" and place.endswith("_slide"):
                out += [f"{leg}/{part}" for part in ("base", "linear_rod", "motor", "ball_screw")]
            elif kind.name == "six_ups" and place.startswith("leg"):
                out += [leg, f"{leg}/drive", f"{leg}_u1", f"{leg}_u2", f"{leg}_slide"]
            elif place.startswith("joint"):
                out += [f"{place}/drive", place.removesuffix("/drive")]
    return sorted(set(out))


# ---------------------------------------------------------------------------------------------- robots
_SENSOR_FAULTS = ("wrench_sensor_misalignment", "wrench_sensor_gain", "wrench_sensor_bias",
                  "pose_sensor_misalignment", "target_misalignment")  # fmt: skip
_DRIVE_FAULTS = ("stiffness_changed", "backlash", "hertzian_contact", "lead_error", "encoder_offset",
                 "geometric_offset", "payload", "external_spring")  # fmt: skip


def _prup_poses(rng, count: int) -> np.ndarray:
    tilt = rng.uniform(-0.3, 0.3, (count, 2))
    return draw.actuator_positions(rng.uniform(0.30, 0.48, count), tilt[:, 0], tilt[:, 1])


KINDS: dict[str, Kind] = {
    "3prup": Kind(
        "3prup",
        "3prup",
        device.Device,
        device.PARAMETERS,
        draw.SLIDES,
        _prup_poses,
        _prup_candidate,
        (
            *(name for name in draw.PHYSICS if name not in ("self_weight", "alien")),
            "target_misalignment",
            "external_spring",
        ),
        170.0,
        0.2,
        3,
        draw.NOISE,
    ),
    "six_ups": Kind(
        "six_ups",
        "six_ups/six_ups.urdf",
        platform.Platform,
        platform.Platform.PARAMETERS,
        platform.Platform.ACTUATED,
        platform.poses,
        _of("six_ups"),
        (*_DRIVE_FAULTS, "thermal_growth", *(name for name in _SENSOR_FAULTS if name != "wrench_sensor_bias")),
        1700.0,
        0.13,
        2,
        {"position": 2e-6, "rotation": 6e-6, "force": 0.5, "moment": 0.1},
    ),
    "elastic_arm": Kind(
        "elastic_arm",
        "elastic_arm/elastic_arm.urdf",
        arm.Arm,
        arm.Arm.PARAMETERS,
        arm.Arm.ACTUATED,
        arm.poses,
        _of("elastic_arm"),
        (*_DRIVE_FAULTS, *_SENSOR_FAULTS),
        500.0,
        0.3,
        2,
        {"position": 1e-5, "rotation": 2e-5, "force": 0.1, "moment": 0.02},
        ORDINARY | {"position": 1e-4, "encoder_offset": 2e-4},
    ),
}


# ---------------------------------------------------------------------------------------------- device and files
def draw_tolerances(rng, kind: Kind) -> dict[str, float]:
    """True tolerances of a robot's parameters, by their kinds: finer or coarser than a workshop's ordinary ones."""
    used = set(kind.parameters.values())
    return {
        key: float(f"{value * np.exp(rng.uniform(np.log(FINER), np.log(COARSER))):.2g}")
        for key, value in kind.tolerances.items()
        if key in used
    }


def draw_always(rng, robot: str) -> dict[str, Any]:
    """What acts on every robot: its weight, of a 3-PRUP in one of two ways."""
    return dict(WEIGHT) | ({"branches": draw.pick(rng, ["hub", "distributed"])} if robot == "3prup" else {})


def draw_scattered(
    seed: int,
    robot: str = "3prup",
    effects=(),
    multiple=(3.0, 40.0),
    misjudged: bool = False,
    poses=(14, 6),
    sensors: float = 1.0,
) -> dict:
    """A device whose parameters scatter and its bench test: records (noisy), what is declared, and the truth.

    `effects`: names of the kind's physics, or "alien"; `multiple`: the range of each one's size beside noise and
    tolerances, drawn log-uniformly; `sensors`: multiple of the kind's noise.
    """
    kind = KINDS[robot]
    rng = np.random.default_rng([seed, 11])
    noise = {name: sensors * value for name, value in kind.noise.items()}
    actual = draw_tolerances(rng, kind)
    declared = {key: value * (float(rng.choice([0.5, 2.0])) if misjudged else 1.0) for key, value in actual.items()}
    scatter = draw_scatter(rng, kind.parameters, actual)
    always = draw_always(rng, robot)
    warm = "thermal_growth" in effects or bool(rng.random() < 0.15)
    fit, held = (kind.programme(rng, n, warm) for n in poses)
    chosen, truths = [], []
    if effects:
        yardstick = Yardstick(kind.machine, draw.measure, fit, kind.parameters, actual, noise, [always])
    for name in effects:
        target = float(np.exp(rng.uniform(*np.log(multiple))))
        best = None
        for tries in range(16):  # where a size is out of reach, the place is drawn again
            try:
                effect, size = scaled(kind.candidate(rng, name), fit, target, noise, yardstick.strength)
            except RuntimeError:  # so large that nothing balances
                continue
            miss = abs(np.log(max(size.max(), 1e-9) / target))
            if any((effect["physics"], effect["location"]) == (e["physics"], e["location"]) for e in chosen):
                miss += 10.0
            if best is None or miss < best[0]:
                best = (miss, effect, size)
            reached = 0.95 * multiple[0] < best[2].max() < 1.05 * multiple[1]
            if best[0] < 0.2 or (tries > 2 and reached and best[0] < 5):
                break
        if best is None:
            raise RuntimeError(f"no {name} of size {target:.3g} found for seed {seed}")
        _, effect, size = best
        chosen.append(effect)
        truths.append(draw._truth(effect, size[:6], target) | {
            "size": round(float(size.max()), 3),
            "strained": round(float(size[6]), 3),
            "places": places(robot, effect),
        })  # fmt: skip
    machine = kind.machine([always, *chosen], scatter=scatter)
    own = np.random.default_rng([seed, 12])
    return {
        "robot": robot,
        "device": machine,
        "fit": draw.measure(machine, fit, own, noise),
        "heldout": draw.measure(machine, held, own, noise),
        "noise": noise,
        "warm": warm,
        "tolerances": declared,
        "truth": {
            "seed": seed,
            "robot": robot,
            "effects": truths,
            "misjudged": misjudged,
            "weight": always,
            "tolerances": actual,
            "scatter": scatter,
            "beyond": beyond(kind, scatter, declared),
            "channels": ["p.x", "p.y", "p.z", "r.x", "r.y", "r.z"],
            "unit": "multiples of the channel's noise, RMS over the fitting part, after the best fit of all "
            "parameters within tolerance; 'strained': how far that fit is from the drawing, in two tolerances",
        },
    }


def write(drawn: dict, out: Path, sealed: Path, name: str, robot_file: str | None = None) -> None:
    """Recordings into `out`, the answer into `sealed`; `robot_file` is how the recording calls its robot."""
    kind = KINDS[drawn["robot"]]
    about = {
        "robot": robot_file or kind.file,
        **{f"{key}_noise": value for key, value in drawn["noise"].items()},
        "tolerances": drawn["tolerances"],
    }
    draw.seal(out, sealed, name, about, drawn["truth"])
    for part, ending in (("fit", ".csv"), ("heldout", ".heldout.csv")):
        draw.write_csv(out / f"{name}{ending}", drawn[part], drawn["warm"], kind.actuated)


def main(argv=None) -> None:
    ap = draw.drawing(__doc__, list(KINDS))
    ap.add_argument("--misjudged", action="store_true", help="declare wrong tolerances")
    a = ap.parse_args(argv)
    for seed in range(a.seed, a.seed + a.count):
        drawn = draw_scattered(seed, a.robot, a.kind, tuple(a.multiple), a.misjudged)
        write(drawn, a.out, a.sealed, f"{a.robot}-{seed:04d}")
        print(f"{a.robot}-{seed:04d} written")


if __name__ == "__main__":
    main()
