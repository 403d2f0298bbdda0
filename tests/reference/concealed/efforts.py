"""Draw a concealed robot in motion from a seed, and write what its controller logs: positions and efforts.

    python -m tests.reference.concealed.efforts --seed 7 --robot ur5 --out DIR --sealed OTHER_DIR [--kind PHYSICS]

writes DIR/<name>.csv, <name>.json and <name>.heldout.csv, and OTHER_DIR/<name>.truth.json. Every mass and inertia is a
little off, within tolerances that the JSON declares. An effect's size is the RMS, in the joint where it is strongest,
of what it changes in the efforts below 8 Hz, in multiples of the efforts' noise: of it all, and of what is left after
the best fit of masses and inertias within tolerance (or half the length of that fit in tolerances); the smaller counts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import interp1d
from scipy.signal import butter, lfilter, sosfiltfilt

from .chain import Chain, example_file, read_chain
from .draw import Candidate, drawing, effect_of_size, pick, seal, unit
from .excitation import Excitation, draw_excitation
from .moving import Moving
from .scatter import TOLERANCES_TO_ONE, draw_scatter

ROBOTS = Path(__file__).parents[2] / "robots"
#: Rate [1/s] and cut-off [1/s] at which sizes are measured.
RATE, CUT = 100.0, 8.0
#: Rows of a recording, at most.
ROWS = 24_000
RATES = (250.0, 500.0, 1000.0)
TOLERANCE = 0.05


@dataclass(frozen=True)
class Kind:
    """One of the robots: its file and how recordings call it, joints that stand still, its tool and where it moves."""

    path: Path
    called: str
    tool: str
    centre: tuple[float, ...]
    noise: float  # N m
    held: tuple[str, ...] = ()
    slow: bool = False  # too slow for a delay to be seen

    @property
    def physics(self) -> tuple[str, ...]:
        """What can be wrong with it."""
        return tuple(name for name in PHYSICS if not (self.slow and name.endswith("_delay")))

    def chain(self) -> Chain:
        return read_chain(self.path, self.held)


KINDS: dict[str, Kind] = {
    "ur5": Kind(
        example_file("ur_description/urdf/ur5_robot.urdf"),
        "ur5",
        "tool0",
        (0.0, -1.1, 1.0, -0.3, 0.5, 0.0),
        0.15,
    ),
    "panda": Kind(
        example_file("panda_description/urdf/panda.urdf"),
        "panda",
        "panda_hand_tcp",
        (0.0, -0.3, 0.0, -1.6, 0.0, 1.8, 0.5),
        0.12,
        ("panda_finger_joint1", "panda_finger_joint2"),
    ),
    "kinova": Kind(
        example_file("kinova_description/robots/kinova.urdf"),
        "kinova",
        "j2s6s200_end_effector",
        (0.0, 2.8, 2.2, 0.0, 2.6, 0.0),
        0.06,
        slow=True,
    ),
    "xarm7": Kind(
        example_file("xarm_description/urdf/xarm7.urdf"),
        "xarm7",
        "link_eef",
        (0.0, -0.2, 0.0, 1.1, 0.0, 0.8, 0.0),
        0.1,
    ),
    "five_bar": Kind(
        ROBOTS / "weighty_five_bar/weighty_five_bar.urdf",
        "weighty_five_bar.urdf",
        "plate",
        (0.0, 0.0),
        0.08,
        slow=True,
    ),
}
PHYSICS = (
    "coulomb_friction", "viscous_friction", "stribeck_friction", "rotor_inertia", "payload", "inertial_parameters",
    "counterbalance", "transmission_coupling", "effort_gain", "effort_offset", "effort_delay", "encoder_delay",
    "cogging",
)  # fmt: skip
ALIENS = ("bump_stop", "position_friction", "switching_friction", "quadratic_drag", "saturation")
#: What a law outside the library is in part: to say this of it, and that more is left, is not wrong.
AKIN = {
    "bump_stop": ("counterbalance",),
    "position_friction": ("coulomb_friction",),
    "switching_friction": ("coulomb_friction",),
    "quadratic_drag": ("viscous_friction",),
    "saturation": ("effort_gain",),
}


@dataclass(frozen=True)
class Logger:
    """How motion and efforts are logged: counts a turn, velocities' noise [rad/s] or None, and the efforts' noise.

    noise [N m], of which `white` (share of the variance) is white and the rest decays over `lasting` [s]. `wrapped`:
    endless joints are told between -pi and pi. `rough`: jitter of the clock as a share of the period, and the shares of
    rows that are told twice and that are lost.
    """

    rate: float
    counts: float
    velocity: float | None
    noise: float
    white: float
    lasting: float
    wrapped: bool = False
    rough: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def stamps(self, rng, duration: float) -> np.ndarray:
        """Return when samples are taken (N,)."""
        t = np.arange(int(duration * self.rate)) / self.rate
        jitter, _, lost = self.rough
        t = t + jitter / self.rate * rng.uniform(-0.5, 0.5, len(t)) if jitter else t
        return t[rng.random(len(t)) >= lost] if lost else t

    def disturbed(self, rng, count: int, joints: int) -> np.ndarray:
        """Return the efforts' noise (count, joints)."""
        kept = float(np.exp(-1.0 / (self.rate * self.lasting)))
        fresh = rng.normal(size=(count, joints)) * np.sqrt(1 - kept**2)
        fresh[0] /= np.sqrt(1 - kept**2)
        slow = lfilter([1.0], [1.0, -kept], fresh, axis=0)
        own = np.sqrt(self.white) * rng.normal(size=(count, joints)) + np.sqrt(1 - self.white) * slow
        return self.noise * own

    def log(self, rng, device: Moving, excitation: Excitation, duration: float, seed: int) -> dict[str, np.ndarray]:
        """Return time (N,), q, qd (or none) and tau (N, n) as they are logged."""
        t = self.stamps(rng, duration)
        q, qd, _ = device.reported(t, excitation)
        tau = device.given(t, excitation, seed) + self.disturbed(rng, *q.shape)
        step = 2 * np.pi / self.counts
        q = np.round(q / step) * step
        if self.wrapped:
            endless = [device.chain.joints[i].endless for i in device.chain.actuated]
            q[:, endless] = (q[:, endless] + np.pi) % (2 * np.pi) - np.pi
        out = {"time": t, "q": q, "tau": tau}
        if self.velocity is not None:
            out["qd"] = qd + self.velocity * rng.normal(size=qd.shape)
        if self.rough[1]:
            rows = np.repeat(np.arange(len(t)), 1 + (rng.random(len(t)) < self.rough[1]))
            stamps = np.sort(np.r_[t, t[:-1] + 0.5 * np.diff(t)])[: 2 * len(t) - 1]
            again = np.r_[False, rows[1:] == rows[:-1]]
            out = {name: values[rows] for name, values in out.items()}
            out["time"] = stamps[np.minimum(2 * rows + again, len(stamps) - 1)]
            fresh = np.r_[True, np.diff(out["time"]) > 0]
            out = {name: values[fresh] for name, values in out.items()}
        return out


class Yardstick:
    """Sizes of effects in one motion of a robot whose masses and inertias have tolerances."""

    def __init__(self, chain: Chain, tool: str, excitation: Excitation, duration: float, noise: float, tolerances):
        self.chain, self.tool, self.excitation, self.noise = chain, tool, excitation, noise
        self.t = np.arange(0.0, min(duration, 25.0), 1 / RATE)
        self.followed = chain.closed(*excitation.at(self.t))
        self.low = butter(4, CUT, fs=RATE, output="sos")
        self.nominal = Moving(chain, tool)
        off = [Moving(chain, tool, scatter={name: tolerance}) for name, tolerance in tolerances.items()]
        columns = [self.beyond(device).ravel() for device in off]
        self.by_tolerance = np.stack(columns, -1)
        self._normal = self.by_tolerance.T @ self.by_tolerance + np.eye(len(columns))

    def beyond(self, device: Moving) -> np.ndarray:
        """Return a device's efforts (N, n) less those of the nominal robot, below the cut-off, by the noise."""
        seen = self.followed
        if device.encoder_delay.any():
            seen = self.chain.closed(*device.reported(self.t, self.excitation))
        left = device.given(self.t, self.excitation, followed=self.followed) - self.nominal.rigid(seen)
        return sosfiltfilt(self.low, left, axis=0) / self.noise

    def sizes(self, effects: Sequence[Mapping[str, Any]]) -> np.ndarray:
        """Return RMS by joint of all and of what is left (2 n), half the fit's length in tolerances, and the size."""
        whole = self.beyond(Moving(self.chain, self.tool, effects))
        own = whole
        if effects[0]["physics"] == "stribeck_friction":  # its own is what Coulomb and viscous friction cannot do
            own = self._without_friction(whole, effects[0])
        fitted = np.linalg.solve(self._normal, self.by_tolerance.T @ own.ravel())
        left = own - (self.by_tolerance @ fitted).reshape(own.shape)
        rms, rest = (np.sqrt((x**2).mean(0)) for x in (whole, left))
        strained = np.linalg.norm(fitted) / TOLERANCES_TO_ONE
        size = min(rms.max(), max(rest.max(), strained))
        return np.r_[rms, rest, strained, size]

    def _without_friction(self, whole: np.ndarray, effect: Mapping[str, Any]) -> np.ndarray:
        place = {"location": effect["location"]}
        sliding = {"physics": "coulomb_friction", "force": 1.0, "presliding": effect["presliding"]} | place
        columns = [
            self.beyond(Moving(self.chain, self.tool, [e])).ravel()
            for e in (sliding, {"physics": "viscous_friction", "damping": 1.0} | place)
        ]
        basis = np.stack(columns, -1)
        return whole - (basis @ np.linalg.lstsq(basis, whole.ravel(), rcond=None)[0]).reshape(whole.shape)


# ---------------------------------------------------------------------------------------------- effects
def candidate(rng, physics: str, chain: Chain, kind: Kind, excitation: Excitation) -> Candidate:
    """Return an effect of open size at a random place."""
    driven = list(chain.names)
    joint = pick(rng, driven)
    sign = float(rng.choice([-1.0, 1.0]))
    small = float(np.exp(rng.uniform(np.log(2e-5), np.log(3e-4))))  # rad of presliding
    most = 1e3 * kind.noise
    if physics in ("coulomb_friction", "viscous_friction") and chain.loop is not None and rng.random() < 0.3:
        joint = chain.joints[pick(rng, chain.passive)].name
    place = {"physics": physics, "location": joint}
    if physics == "coulomb_friction":
        share = float(rng.uniform(0.02, 0.15)) if rng.random() < 0.3 else 0.0
        return Candidate(lambda x: place | {"force": x, "share": share, "presliding": small}, 1e-3 * kind.noise, most)
    if physics == "viscous_friction":
        backward = float(rng.uniform(0.4, 0.8)) ** sign if rng.random() < 0.35 else 1.0
        return Candidate(lambda x: place | {"damping": x, "backward": backward}, 1e-3 * kind.noise, most)
    if physics == "stribeck_friction":
        ratio, top = float(rng.uniform(1.6, 3.0)), np.abs(excitation.at(np.arange(0, 20, 0.01))[1]).max(0)
        speed = float(rng.uniform(0.05, 0.25)) * float(top[driven.index(joint)])
        more = {"speed": speed, "presliding": small}
        return Candidate(lambda x: place | more | {"coulomb": x, "breakaway": ratio * x}, 1e-2 * kind.noise, most)
    if physics == "rotor_inertia":
        return Candidate(lambda x: place | {"inertia": x}, 1e-5, 50.0)
    if physics == "payload":
        lever = list(rng.uniform(0, 0.12) * unit(rng))
        place = {"physics": physics, "location": kind.tool, "lever": lever, "radius": float(rng.uniform(0.02, 0.06))}
        return Candidate(lambda x: place | {"mass": x}, 0.01, 20.0)
    if physics == "inertial_parameters":
        heavy = [link.name for link in chain.links if link.body >= 0 and link.mass > 0.1]
        place = {"physics": physics, "location": pick(rng, heavy), "mass": 1.0, "inertia": 1.0, "shift": [0.0] * 3}
        if rng.random() < 0.3:
            way = unit(rng)
            return Candidate(lambda x: place | {"shift": list(x * way)}, 1e-3, 0.12)
        if sign < 0:
            return Candidate(lambda x: place | {"mass": 1 - x, "inertia": 1 - x}, 0.2, 0.75)
        return Candidate(lambda x: place | {"mass": 1 + x, "inertia": 1 + x}, 0.2, 3.0)
    if physics == "counterbalance":
        kind_of = pick(rng, ["torsion", "pulling"])
        key = "stiffness" if kind_of == "torsion" else "amplitude"
        rest = float(excitation.centre[driven.index(joint)] + rng.uniform(-1.0, 1.0))
        return Candidate(lambda x: place | {"kind": kind_of, "rest": rest, key: sign * x}, 1e-3 * kind.noise, most)
    if physics == "transmission_coupling":
        at = int(rng.integers(1, len(driven)))
        pair = {"location": driven[at], "other": driven[at - 1], "ratio": pick(rng, [1.0, 1.0, -1.0])}
        part = rng.dirichlet([1.5, 1.5, 0.7]) * [1.0, 1.0, 0.2]
        return Candidate(
            lambda x: {"physics": physics, **pair, "damping": x * part[0], "force": x * part[1], "inertia": x * part[2],
                       "presliding": small}, 1e-2 * kind.noise, most)  # fmt: skip
    if physics == "effort_gain":
        if sign < 0:
            return Candidate(lambda x: place | {"gain": -x}, 0.005, 0.7)
        return Candidate(lambda x: place | {"gain": x}, 0.005, 2.0)
    if physics == "effort_offset":
        return Candidate(lambda x: place | {"offset": sign * x}, 1e-2 * kind.noise, most)
    if physics in ("effort_delay", "encoder_delay"):
        place["location"] = "robot" if rng.random() < 0.5 else joint
        return Candidate(lambda x: place | {"delay": x}, 5e-4, 0.04)
    if physics == "cogging":
        more = {"per_turn": int(rng.integers(3, 41)), "phase": float(rng.uniform(0, 2 * np.pi))}
        return Candidate(lambda x: place | more | {"amplitude": x}, 1e-2 * kind.noise, most)
    return _alien(rng, place, chain, kind, excitation, small)


def _alien(rng, place, chain: Chain, kind: Kind, excitation: Excitation, small: float) -> Candidate:
    what = pick(rng, ALIENS)
    place = place | {"kind": what}
    at = chain.names.index(place["location"])
    most = 1e3 * kind.noise
    if what == "saturation":
        usual = np.abs(Moving(chain, kind.tool).given(np.arange(0, 20, 0.02), excitation)).max(0)[at]
        return Candidate(lambda x: place | {"limit": float(usual / (1 + x))}, 0.05, 3.0)
    if what == "bump_stop":
        rest = float(excitation.centre[at] + rng.uniform(-0.1, 0.1))
        return Candidate(lambda x: place | {"rest": rest, "coefficient": x}, 1e-2 * kind.noise, most)
    more: dict[str, Any] = {"presliding": small}
    if what == "position_friction":
        more |= {"waves": float(rng.uniform(2.0, 6.0)), "phase": float(rng.uniform(0, 2 * np.pi))}
    elif what == "switching_friction":
        more |= {"every": float(rng.uniform(4.0, 9.0))}
    return Candidate(lambda x: place | more | {"coefficient": x}, 1e-2 * kind.noise, most)


def places(effect: Mapping[str, Any], chain: Chain, kind: Kind) -> list[str]:
    """Return all names of an effect's place: what a joint carries is also named by the joint."""
    location, physics = effect["location"], effect["physics"]
    out = [location]
    if physics == "transmission_coupling":
        out.append(effect["other"])
    if physics in ("payload", "inertial_parameters"):
        body = chain.frames[location][0]
        out.append(chain.joints[body].name)
        if physics == "payload":
            out += [name for name, (of, _, _) in chain.frames.items() if of == body]
    return list(dict.fromkeys(out))


def also(effect: Mapping[str, Any], chain: Chain, kind: Kind) -> list[dict[str, Any]]:
    """Return what else is true of an effect, {"physics", "places"}: to name it beside is not wrong."""
    physics, here = effect["physics"], places(effect, chain, kind)
    words: Sequence[str] = ()
    if physics == "alien":
        words = AKIN[effect["kind"]]
    elif physics == "stribeck_friction":
        words = ("coulomb_friction",)
    elif physics == "transmission_coupling":
        words = ("coulomb_friction", "viscous_friction", "rotor_inertia")
    elif physics == "payload":
        words = ("inertial_parameters",)
    elif physics == "inertial_parameters" and chain.frames[effect["location"]][0] == chain.frames[kind.tool][0]:
        words, here = ("payload",), [*here, kind.tool]
    return [{"physics": word, "places": here} for word in words]


# ---------------------------------------------------------------------------------------------- device and files
def draw_logger(rng, kind: Kind) -> Logger:
    """Return a controller's log at random."""
    noise = kind.noise * float(np.exp(rng.uniform(np.log(0.5), np.log(2.0))))
    rough = (float(rng.uniform(0.1, 0.6)), float(rng.uniform(0, 0.05)), float(rng.uniform(0, 0.03)))
    return Logger(
        rate=float(pick(rng, RATES)),
        counts=2.0 ** int(rng.integers(17, 21)),
        velocity=float(rng.uniform(2e-4, 2e-3)) if rng.random() < 0.6 else None,
        noise=float(f"{noise:.2g}"),
        white=float(rng.uniform(0.1, 0.7)),
        lasting=float(np.exp(rng.uniform(np.log(0.01), np.log(0.2)))),
        wrapped=kind.called == "kinova" and bool(rng.random() < 0.2),
        rough=rough if rng.random() < 0.1 else (0.0, 0.0, 0.0),
    )


def draw_motion(rng, chain: Chain, kind: Kind, duration: float, pauses: int) -> Excitation:
    """Return a motion about a place near the kind's own, inside the limits of its joints."""
    joints = [chain.joints[i] for i in chain.actuated]
    centre = np.array(kind.centre) + rng.uniform(-0.25, 0.25, len(joints)) * (chain.loop is None)
    room = np.array([np.inf if j.endless else min(c - j.limits[0], j.limits[1] - c)
                     for j, c in zip(joints, centre, strict=True)])  # fmt: skip
    wish = rng.uniform(0.5, 1.3, len(joints)) * np.array(
        [3.0 if j.endless and rng.random() < 0.4 else 1.0 for j in joints]
    )
    reach = np.minimum(wish, 0.95 * room)
    speeds = np.minimum([j.speed for j in joints], 2.5) * rng.uniform(0.5, 0.9)
    return draw_excitation(rng, centre, reach, speeds, duration, pauses)


def left_by_the_file(log: Mapping[str, np.ndarray], device: Moving, nominal: Moving, excitation: Excitation) -> float:
    """Return RMS of what the nominal robot leaves of logged efforts over RMS of these, all joints moving.

    Their noise is among both, as it is among what a prediction leaves of them.
    """
    t = np.arange(log["time"][0], log["time"][-1], 1 / RATE)
    motion = device.reported(t, excitation)
    told, moves = interp1d(log["time"], log["tau"], axis=0)(t), (np.abs(motion[1]) > 1e-3).all(axis=1)
    left = sosfiltfilt(
        butter(4, CUT, fs=RATE, output="sos"), told - nominal.rigid(nominal.chain.closed(*motion)), axis=0
    )
    return float(np.sqrt(np.mean(left[moves] ** 2) / np.mean(told[moves] ** 2)))


def draw_efforts(seed: int, robot: str, effects: Sequence[str] = (), multiple=(3.0, 40.0)) -> dict[str, Any]:
    """A robot in motion: what is logged of two motions, what is declared, and the truth.

    `effects`: words of `PHYSICS`, or "alien"; `multiple`: range of each one's size, drawn log-uniformly.
    """
    kind = KINDS[robot]
    chain = kind.chain()
    rng = np.random.default_rng([seed, 31, *robot.encode()])
    logger = draw_logger(rng, kind)
    longest = min(60.0, ROWS / logger.rate)
    duration, shorter = float(rng.uniform(20.0, max(longest, 21.0))), float(rng.uniform(10.0, 15.0))
    pauses = int(rng.integers(1, 4)) if rng.random() < 0.4 else 0
    fit = draw_motion(rng, chain, kind, duration, pauses)
    held = draw_motion(rng, chain, kind, shorter, min(pauses, 1))
    weighed = [link.name for link in chain.links if link.body >= 0 and link.mass > 0]
    parameters = {f"{name}.{what}": what for name in weighed for what in ("mass", "inertia")}
    declared = {"mass": TOLERANCE, "inertia": TOLERANCE}
    if rng.random() < 0.2:
        declared |= {"effort_gain": 0.01, "effort_bias": float(f"{0.5 * logger.noise:.2g}")}
        parameters |= {f"{name}.{what}": what for name in chain.names for what in ("effort_gain", "effort_bias")}
    scatter = draw_scatter(rng, parameters, declared)
    tolerances = {name: declared[what] for name, what in parameters.items()}
    chosen: list[dict] = []
    truths: list[dict] = []
    yardstick = Yardstick(chain, kind.tool, fit, duration, logger.noise, tolerances) if effects else None
    for name in effects:
        effect = effect_of_size(
            rng, name, multiple, chosen, partial(candidate, rng, name, chain, kind, fit), yardstick.sizes
        )
        sizes = yardstick.sizes([effect])
        n = len(chain.names)
        chosen.append(effect)
        truths.append(
            {
                "physics": "unknown" if name == "alien" else name,
                "location": effect["location"],
                "places": places(effect, chain, kind),
                "parameters": {key: value for key, value in effect.items() if key not in ("physics", "location")},
                "size": round(float(sizes[-1]), 3),
                "strength": [round(float(x), 3) for x in sizes[:n]],
                "left": [round(float(x), 3) for x in sizes[n : 2 * n]],
                "strained": round(float(sizes[-2]), 3),
                "also": also(effect, chain, kind),
            }
        )
    device = Moving(chain, kind.tool, chosen, scatter)
    own = np.random.default_rng([seed, 32])
    logs = [
        logger.log(own, device, motion, lasting, number)
        for motion, lasting, number in ((fit, duration, seed), (held, shorter, seed + 1))
    ]
    declares = bool(rng.random() > 0.15)
    return {
        "robot": robot,
        "logger": logger,
        "device": device,
        "tolerances": declared,
        "declared": declares,
        "fit": logs[0],
        "heldout": logs[1],
        "truth": {
            "seed": seed,
            "robot": robot,
            "effects": truths,
            "size": "multiples of the efforts' noise below 8 Hz: RMS in the strongest joint, and of what is left after "
            "the best fit within tolerance (or half its length in tolerances); the smaller",
            "joints": list(chain.names),
            "left_by_the_file": left_by_the_file(logs[1], device, Moving(chain, kind.tool), held),
            "scatter": scatter,
            "logger": {key: getattr(logger, key) for key in Logger.__dataclass_fields__},
            "pauses": [list(pause) for pause in fit.pauses],
        },
    }


def write(drawn: Mapping[str, Any], out: Path, sealed: Path, name: str, robot_file: str | None = None) -> None:
    """Recordings into `out`, the answer into `sealed`; `robot_file` is how the recording calls its robot."""
    kind = KINDS[drawn["robot"]]
    about: dict[str, Any] = {"robot": robot_file or kind.called}
    if drawn["declared"]:
        about["effort_noise"] = drawn["logger"].noise
    seal(out, sealed, name, about | {"tolerances": drawn["tolerances"]}, drawn["truth"])
    for part, ending in (("fit", ".csv"), ("heldout", ".heldout.csv")):
        record = drawn[part]
        groups = [key for key in ("q", "qd", "tau") if key in record]
        names = ["time", *(f"{key}.{joint}" for key in groups for joint in drawn["truth"]["joints"])]
        table = np.column_stack([record["time"], *(record[key] for key in groups)])
        np.savetxt(out / f"{name}{ending}", table, "%.9g", ",", header=",".join(names), comments="")


def main(argv=None) -> None:
    a = drawing(__doc__, list(KINDS)).parse_args(argv)
    for seed in range(a.seed, a.seed + a.count):
        write(draw_efforts(seed, a.robot, a.kind, tuple(a.multiple)), a.out, a.sealed, f"{a.robot}-{seed:04d}")
        print(f"{a.robot}-{seed:04d} written")


if __name__ == "__main__":
    main()
