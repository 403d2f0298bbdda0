"""Draw a parallel robot that nobody has calibrated: everything is off, by amounts that no file tells.

    python -m tests.reference.concealed.uncalibrated --seed 7 --robot six_ups --out DIR --sealed OTHER_DIR
        [--kind PHYSICS]

The tracker stands anywhere and is turned anyhow; of zeros, ratios, places, directions, springs, masses and the target
each kind is off, or is not. Half of the robots are loaded, half of the recordings declare their noise, and of some
robots only a point is seen. An effect beyond that is as large as what is left of it beside the scatter
(`scatter.Yardstick.strength`). `Oracle` says what an estimate could predict that knows which kinds are off, by how much
they scatter, and the effects.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from . import delta, draw, scattered
from .draw import Candidate, Programme, pick, unit
from .machine import T_REF, WRENCH
from .rotations import matrix, vector
from .scatter import Yardstick, draw_scatter
from .scattered import WEIGHT, Kind

#: One standard deviation of each kind where it is off, each drawn between these multiples. Relative, m or rad.
FINER, COARSER = 0.4, 2.0
_USUAL = {"stiffness": 0.15, "bending": 0.03, "mass": 0.1, "target_position": 0.02, "target_rotation": 0.03,
          "wrench_gain": 0.01, "wrench_rotation": 0.005}  # fmt: skip
ROUGH: dict[str, dict[str, float]] = {
    "six_ups": _USUAL | {"position": 1.5e-3, "encoder_offset": 3e-3, "encoder_slope": 3e-3},
    "delta": _USUAL | {"position": 8e-4, "direction": 3e-3, "encoder_offset": 8e-3, "encoder_slope": 3e-3},
    "3prup": _USUAL | {"position": 1e-3, "direction": 3e-3, "encoder_offset": 2e-3, "encoder_slope": 3e-3},
}
#: Share of the kinds that are off, and those of which at least two are.
OFF = 0.7
GEOMETRIC = ("position", "direction", "encoder_offset", "encoder_slope")
#: Where the tracker stands, as its tolerance [m, rad].
ANYWHERE = {"frame_position": 5.0, "frame_rotation": 3.0}
#: ... and as that of the yardstick, which must not care where it is but only that it may be moved.
MOVABLE = {"frame_position": 0.05, "frame_rotation": 0.05}
#: Position noise [m], rotation noise [rad]: between these, log-uniformly.
TRACKERS = {"position": (5e-6, 5e-5), "rotation": (2e-5, 2e-4)}
FORCE_NOISE = {"force": 0.1, "moment": 0.02}
LOADED, DECLARED, TURNS_SEEN = 0.5, 0.5, 0.75
#: Poses of a robot that nothing loads, and half as many more where only a point is seen; of one that is loaded, with so
#: many samples in each; and held out.
POSES, LOADED_POSES, LOADS, HELD_OUT = (40, 71), (18, 31), 3, 20
#: Effects beyond the scatter of robots that bear a load, and of all.
ANY_LOAD = ("lead_error", "encoder_offset", "geometric_offset", "payload")
UNDER_LOAD = ("stiffness_changed", "backlash", "hertzian_contact", *ANY_LOAD)
#: A step of the oracle's differences, in standard deviations, but of a turn no more than so much [rad].
_STEP, _TURN = 0.05, 1e-5
#: Its steps, all with the derivatives of the truth.
_CHORDS = 4


def _delta_candidate(rng, physics: str) -> Candidate:
    """An effect of the Delta."""
    machine, typical = delta.Delta, 30.0  # N m
    i = int(rng.integers(3))
    drive, joint, sign = machine.DRIVES[i], machine.ACTUATED[i], float(rng.choice([-1.0, 1.0]))
    soft = typical / machine.STIFFNESS[i]
    place = {"physics": physics, "location": drive}
    if physics == "stiffness_changed":
        return Candidate(lambda x: place | {"factor": 1 / (1 + x)}, 0.05, 60.0)
    if physics == "backlash":
        smooth = float(rng.uniform(0.1, 0.4))
        return Candidate(lambda x: place | {"half_gap": x, "smooth": smooth}, 1e-3 * soft, 1e3 * soft)
    if physics == "hertzian_contact":
        f0 = float(0.02 * typical * rng.uniform(0.5, 2.0))
        return Candidate(lambda x: place | {"f0": f0, "f_ref": x}, 0.02 * typical, 1e9 * typical)
    if physics == "lead_error":
        return Candidate(lambda x: place | {"ratio": sign * x}, 1e-5, 0.15)
    if physics == "encoder_offset":
        return Candidate(lambda x: {"physics": physics, "location": joint, "offset": sign * x}, 1e-5, 0.15)
    if physics == "payload":
        place = {"physics": physics, "location": "platform", "lever": [0.0, 0.0, 0.0]}
        return Candidate(lambda x: place | {"mass": x}, 0.02, 100.0)
    assert physics == "geometric_offset"
    at, v = f"{pick(rng, delta.RODS)}_{pick(rng, ['top', 'seat'])}", unit(rng)
    place = {"physics": physics, "location": at, "place": at}
    return Candidate(lambda x: place | {"translation": list(x * v)}, 1e-5, 0.03)


KINDS: dict[str, Kind] = {
    "six_ups": scattered.KINDS["six_ups"],
    "delta": Kind(
        "delta",
        "clavel_delta/clavel_delta.urdf",
        delta.Delta,
        delta.Delta.PARAMETERS,
        delta.Delta.ACTUATED,
        delta.poses,
        _delta_candidate,
        UNDER_LOAD,
        150.0,
        0.05,
        LOADS,
        {},
    ),
    "3prup": scattered.KINDS["3prup"],
}


def _places(robot: str, effect: Mapping[str, Any]) -> list[str]:
    """Return all names of an effect's place in the robot file."""
    if robot != "delta":
        return scattered.places(robot, effect)
    location, physics = effect["location"], effect["physics"]
    out = [location]
    if location.endswith("/motor"):
        out.append(location.replace("/", "_"))
    elif physics == "encoder_offset":
        out.append(location.replace("_", "/"))
    elif physics == "geometric_offset":  # a rod's ends beside their places, and what else moves both of them
        rod = location.rpartition("_")[0]
        out += [f"{rod}_{part}" for part in ("u1", "u2", "bottom", "rod", "seat", "top")]
        out += [f"{rod[:4]}/rod_{rod[4]}"] + (["ball_x"] if rod == "leg1a" else [])
    return list(dict.fromkeys(out))


def _programme(kind: Kind, rng, poses: int, loaded: bool) -> Programme:
    """Random poses; where it is loaded one sample of each without a load, and some with random ones."""
    block = LOADS if loaded else 1
    q = np.repeat(kind.poses(rng, poses), block, axis=0)
    w = np.zeros((len(q), 6))
    for row in range(len(q)):
        if row % block:
            size = scattered.SHARE_OF_LOAD * kind.level * rng.uniform(0.35, 1.4, 2) * [1.0, kind.lever]
            w[row] = np.r_[size[0] * unit(rng), size[1] * unit(rng)]
    return Programme(q, w, np.full(len(q), T_REF), np.arange(len(q), dtype=float))


def seen(machine: Any, run: Programme) -> dict[str, np.ndarray]:
    """Return what the bench would record without noise: q, w, p, and the orientation R (N, 3, 3)."""
    found = draw.measure(machine, run)
    return {"time": run.time, "q": found["q"], "w": found["w"], "p": found["p"], "R": matrix(found["r"])}


def _measured(machine: Any, run: Programme, rng, noise: Mapping[str, float]) -> dict[str, np.ndarray]:
    record = seen(machine, run)
    n = len(run.q)
    return record | {
        "q": np.round(record["q"], 7),
        "w": record["w"] + np.repeat([noise["force"], noise["moment"]], 3) * rng.normal(size=(n, 6)),
        "p": record["p"] + noise["position"] * rng.normal(size=(n, 3)),
        "R": matrix(noise["rotation"] * rng.normal(size=(n, 3))) @ record["R"],
    }


def apart(record: Mapping[str, np.ndarray], other: Mapping[str, np.ndarray], noise, turns: bool) -> np.ndarray:
    """Return by how much a record is off another one (N, 3 or 6), in multiples of the noise."""
    moved = (record["p"] - other["p"]) / noise["position"]
    if not turns:
        return moved
    return np.hstack([moved, vector(record["R"] @ other["R"].mT) / noise["rotation"]])


class Oracle:
    """The best linear estimate of everything that is off, by one who knows which kinds are and by how much.

    As it knows the effects too, and where to begin, what it leaves of other poses is what the data allow.
    """

    def __init__(self, drawn: Mapping[str, Any]):
        self.drawn = drawn
        kind = KINDS[drawn["robot"]]
        scatter, self.known = drawn["scatter"], drawn["actual"] | ANYWHERE
        self.sd = np.array([self.known[kind.parameters[name]] for name in scatter])
        turn = np.array([kind.parameters[name] == "frame_rotation" for name in scatter])
        steps = np.where(turn, _TURN, _STEP * self.sd)
        run = replace(drawn["run"], q=drawn["fit"]["q"])
        here, columns = self._told(scatter, run), []
        for name, step in zip(scatter, steps, strict=True):
            moved = self._told(scatter | {name: scatter[name] + step}, run)
            columns.append(self._apart(moved, here).ravel() / step)
        jacobian = np.stack(columns, -1) * self.sd
        normal = jacobian.T @ jacobian + np.eye(len(self.sd))
        self.scatter = dict(scatter)
        for _ in range(_CHORDS):
            left = self._apart(drawn["fit"], here).ravel()
            amounts = np.array(list(self.scatter.values())) / self.sd
            step = np.linalg.solve(normal, jacobian.T @ left - amounts) * self.sd
            self.scatter, here = self._stepped(step, run)

    def left_over(self) -> float:
        """Return what it leaves of the held-out poses, in multiples of the noise."""
        held = self.drawn["heldout"]
        told = self._told(self.scatter, replace(self.drawn["held_run"], q=held["q"]))
        return float(np.sqrt(np.mean(np.square(self._apart(held, told)))))

    def _stepped(self, step: np.ndarray, run: Programme) -> tuple[dict[str, float], dict[str, np.ndarray]]:
        """Return where a step leads, and what is seen there; half of it where the reference finds no equilibrium."""
        while True:
            moved = {name: value + by for (name, value), by in zip(self.scatter.items(), step, strict=True)}
            try:
                return moved, self._told(moved, run)
            except RuntimeError:
                step = step / 2

    def _told(self, scatter: Mapping[str, float], run: Programme) -> dict[str, np.ndarray]:
        return seen(KINDS[self.drawn["robot"]].machine(self.drawn["effects"], scatter=scatter), run)

    def _apart(self, record, other) -> np.ndarray:
        return apart(record, other, self.drawn["noise"], self.drawn["turns"])


def is_loaded(seed: int, robot: str, effects: Sequence[str] = ()) -> bool:
    """Whether a robot is drawn with loads on it."""
    return bool(_draws(seed, robot).random() < LOADED) or bool(set(effects) - set(ANY_LOAD))


def _draws(seed: int, robot: str) -> np.random.Generator:
    return np.random.default_rng([seed, 61, *robot.encode()])


def draw_uncalibrated(seed: int, robot: str, effects: Sequence[str] = (), multiple=(6.0, 60.0)) -> dict[str, Any]:
    """A robot that nobody has calibrated: what is seen of it in two tests, and the truth.

    `effects`: words of `ANY_LOAD`, or of `UNDER_LOAD`, which then is loaded; `multiple`: the range of each one's size.
    """
    kind = KINDS[robot]
    loaded, rng = is_loaded(seed, robot, effects), _draws(seed, robot)
    rng.random()  # that decides `loaded`
    declared, turns = bool(rng.random() < DECLARED), bool(rng.random() < TURNS_SEEN)
    noise = {name: float(f"{np.exp(rng.uniform(*np.log(ends))):.2g}") for name, ends in TRACKERS.items()} | FORCE_NOISE
    names = [name for name in ROUGH[robot] if loaded or not name.startswith("wrench")]
    off = {name for name in names if rng.random() < OFF}
    while len(off & set(GEOMETRIC)) < 2:
        off.add(pick(rng, GEOMETRIC))
    actual = {
        name: float(f"{ROUGH[robot][name] * np.exp(rng.uniform(np.log(FINER), np.log(COARSER))):.2g}")
        for name in names
        if name in off
    }
    scatter = draw_scatter(rng, kind.parameters, actual)
    turn, shift = rng.uniform(0, 3.0) * unit(rng), rng.uniform(0.5, 4.0) * unit(rng)
    frame = dict(
        zip((f"pose_sensor.{axis}" for axis in ("rx", "ry", "rz", "x", "y", "z")), (*turn, *shift), strict=True)
    )
    always = dict(WEIGHT) | ({"branches": "hub"} if robot == "3prup" else {})
    poses = int(rng.integers(*(LOADED_POSES if loaded else POSES))) * (2 if turns else 3) // 2
    run = _programme(kind, rng, poses, loaded)
    held_run = _programme(kind, rng, HELD_OUT, loaded)
    chosen, truths = [always], []
    if effects:
        yardstick = Yardstick(kind.machine, draw.measure, run, kind.parameters, actual | MOVABLE, noise, [always])
    for name in effects:
        effect = draw.effect_of_size(
            rng, name, multiple, chosen[1:], lambda name=name: kind.candidate(rng, name),
            lambda some: np.atleast_1d(yardstick.strength(some).max()),
        )  # fmt: skip
        size = yardstick.strength([effect])
        chosen.append(effect)
        truths.append(
            draw._truth(effect, size[:6], 0.0)
            | {
                "size": round(float(size.max()), 3),
                "strained": round(float(size[6]), 3),
                "places": _places(robot, effect),
            }
        )
    machine = kind.machine(chosen, scatter=scatter | frame)
    own = np.random.default_rng([seed, 62])
    return {
        "robot": robot,
        "device": machine,
        "effects": chosen,
        "scatter": scatter | frame,
        "actual": actual,
        "run": run,
        "held_run": held_run,
        "fit": _measured(machine, run, own, noise),
        "heldout": _measured(machine, held_run, own, noise),
        "noise": noise,
        "loaded": loaded,
        "declared": declared,
        "turns": turns,
        "truth": {
            "seed": seed,
            "robot": robot,
            "effects": truths,
            "tolerances": actual,
            "scatter": scatter | frame,
            "misjudged": False,
            "beyond": [],
        },
    }


def write(drawn: Mapping[str, Any], out: Path, sealed: Path, name: str, robot_file: str | None = None) -> None:
    """Recordings into `out`, the answer into `sealed`; `robot_file` is how the recording calls its robot."""
    kind = KINDS[drawn["robot"]]
    about: dict[str, Any] = {"robot": robot_file or kind.file}
    if drawn["declared"]:
        used = {"position": True, "rotation": drawn["turns"], "force": drawn["loaded"], "moment": drawn["loaded"]}
        about |= {f"{key}_noise": value for key, value in drawn["noise"].items() if used[key]}
    draw.seal(out, sealed, name, about, drawn["truth"])
    for part, ending in (("fit", ".csv"), ("heldout", ".heldout.csv")):
        record = drawn[part]
        head, columns = ["time", *(f"q.{joint}" for joint in kind.actuated)], [record["time"][:, None], record["q"]]
        if drawn["loaded"]:
            head, columns = [*head, *(f"w.{one}" for one in WRENCH)], [*columns, record["w"]]
        head, columns = [*head, "p.x", "p.y", "p.z"], [*columns, record["p"]]
        if drawn["turns"]:
            head, columns = [*head, "r.x", "r.y", "r.z"], [*columns, vector(record["R"])]
        np.savetxt(out / f"{name}{ending}", np.hstack(columns), "%.10g", ",", header=",".join(head), comments="")


def main(argv=None) -> None:
    ap = draw.drawing(__doc__, list(KINDS))
    a = ap.parse_args(argv)
    for seed in range(a.seed, a.seed + a.count):
        write(draw_uncalibrated(seed, a.robot, a.kind, tuple(a.multiple)), a.out, a.sealed, f"{a.robot}-{seed:04d}")
        print(f"{a.robot}-{seed:04d} written")


if __name__ == "__main__":
    main()
