"""Draw an arm that nobody has calibrated and that a tracker sees, moving or still, and write what both of them log.

    python -m tests.reference.concealed.tracked --seed 7 --robot ur5 --out DIR --sealed OTHER_DIR [--count N]

writes DIR/<name>.csv, <name>.json and <name>.heldout.csv, and OTHER_DIR/<name>.truth.json. Zeros, links, masses, where
the tracker stands and its target sits are off, and no file tells by how much. Links follow the encoders, less what the
gears yield under the torque that Newton and Euler ask for in the motion. What encoders or the tracker tell may be old.
In the tracker's place there may be a second encoder behind each gear, whose poses are those of the drawing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import make_interp_spline

from .chain import Chain
from .draw import drawing, seal, unit
from .efforts import KINDS as ARMS
from .excitation import Excitation, draw_excitation
from .rotations import matrix, vector
from .sagging import Sagging
from .scatter import draw_scatter

#: One standard deviation of each kind of parameter, where it is off.
ROUGH = {"position": 1e-3, "direction": 2e-3, "encoder_offset": 8e-3, "mass": 0.05, "target_position": 1e-2}
#: Noise of the tracker's points [m] and turns [rad], between these, and of the encoders [rad].
POINTS, TURNS, ENCODERS = (2e-5, 1e-4), (1e-4, 5e-4), 2e-6
#: Noise of encoders behind the gears [rad], between these.
BEHIND_GEARS = (5e-6, 3e-5)
#: Share of arms whose gears yield, that are seen by a tracker, that declare the noise, whose encoders share one clock,
#: and of encoders that are not late where they do not.
SHARE, ON_TIME = 0.5, 0.4
#: No delay is longer [s].
LATEST = 1e-2
#: What a gear yields [rad/(N m)], between these.
GEARS = (2e-5, 1e-4)
#: Joints are followed at this rate [1/s] where gears yield.
FINE = 500.0
ROBOTS = ("ur5", "panda", "kinova", "xarm7")


class Tracked(Sagging):
    """An arm in motion: scatter, effects and springs as of `Sagging`, of which only linear compliance about the axes
    and encoders' waves count. late (n,) [s]: how old each encoder's positions are; behind [s]: how old what the
    tracker tells is."""

    def __init__(self, chain: Chain, tool: str, scatter=None, about=None, late=None, behind: float = 0.0, effects=()):
        super().__init__(chain, tool, effects, scatter)
        n = len(self.names)
        self.compliance = np.zeros(n) if about is None else np.asarray(about, float)
        self.late = np.zeros(n) if late is None else np.broadcast_to(np.asarray(late, float), (n,))
        self.behind = behind
        links = [replace(link, mass=self.weights[link.name][0]) if link.body >= 0 else link for link in chain.links]
        self.chain = replace(chain, joints=tuple(self.joints), links=tuple(links))

    def links(self, q: np.ndarray, t: np.ndarray | None) -> np.ndarray:
        """Return where the links are (N, n) for motors at q (N, n); t (N,) [s], evenly spaced, or None at rest."""
        standing = q * (1 + self.slope) + self.offset + self.wave * np.sin(self.waves * q + self.phase)
        still, out = np.zeros_like(standing), standing
        spline = None if t is None else make_interp_spline(t, standing, 5)
        # what gears yield changes slowly: its own accelerations are micrometres
        rates = (still, still) if spline is None else (spline(t, 1), spline(t, 2))
        for _ in range(8):
            out = standing - self.compliance * self.chain.efforts(out, *rates)
        return out

    def told(
        self, motion: Excitation, t: np.ndarray, noise: float = 0.0, rng=None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return q, qd (N, n) as the encoders tell them at t (N,), and position (N, 3) and turn (N, 3, 3) of the tool
        as the tracker does, all free of noise but that [rad] of encoders behind the gears, where these are seen."""
        fine = np.arange(t[0] - 0.5, t[-1] + 0.5, 1 / FINE)
        at = make_interp_spline(fine, self.links(motion.at(fine)[0], fine), 5)(t - self.behind)
        q, qd = np.empty_like(at), np.empty_like(at)
        for i, late in enumerate(self.late):
            q[:, i], qd[:, i] = (values[:, i] for values in motion.at(t - late)[:2])
        return q, qd, *self.posed(at + noise * rng.normal(size=at.shape) if noise else at)

    def scattered(self, q: np.ndarray, noise: float) -> tuple[float, float]:
        """Return the noise of a position [m] and of a turn [rad], one axis, where that of each joint is `noise`."""
        rng, (at, turned) = np.random.default_rng(0), self.posed(q)
        moved, other = self.posed(q + noise * rng.normal(size=q.shape))
        return tuple(
            float(f"{np.sqrt(np.mean(np.square(apart))):.2g}") for apart in (moved - at, vector(turned.mT @ other))
        )

    def posed(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return position (N, 3) and turn (N, 3, 3) of the target as the tracker sees them, links at q (N, n)."""
        moved = self.chain.moved(q, 0 * q, 0 * q)
        body, turn, at = self.frames[self.tool]
        local = at + turn @ self.target.get(self.tool, np.zeros(3))
        camera = matrix(self.turn)
        seen = moved.at[body] + moved.turn[body] @ local
        return seen @ camera.T + self.shift, camera @ moved.turn[body] @ turn


def parameters(chain: Chain, tool: str) -> dict[str, str]:
    """Return what may be off, with its kind."""
    out = {}
    for joint in chain.joints:
        out |= {f"{joint.name}.{axis}": "position" for axis in "xyz"}
        out |= {f"{joint.name}.r{axis}": "direction" for k, axis in enumerate("xyz") if abs(joint.axis[k]) < 0.9}
        out[f"{joint.name}.encoder_offset"] = "encoder_offset"
    out |= {f"{link.name}.mass": "mass" for link in chain.links if link.body >= 0 and link.mass > 0}
    return out | {f"{tool}.t{axis}": "target_position" for axis in "xyz"}


def draw_tracked(
    seed: int,
    robot: str = "ur5",
    *,
    moving: bool = True,
    rows: int = 2500,
    yields: bool | None = None,
    late: float | Sequence[float] | None = None,
    behind: float | None = None,
    kinds: Sequence[str] | None = None,
    turns: bool = True,
    speeds: bool | None = None,
    wavy: float = 0.0,
    behind_gears: bool = False,
    declared: bool = False,
) -> dict[str, Any]:
    """A device and two of its logs; what is None is drawn. late, behind: ages [s] of encoders and tracker; kinds: those
    of `ROUGH` that are off; wavy [rad]: amplitude of waves in all encoders, two to five in a turn. behind_gears: poses
    are told by encoders there, in the drawing's geometry; declared: the recording tells its noise."""
    kind = ARMS[robot]
    chain = kind.chain()
    rng = np.random.default_rng([seed, 71, *robot.encode()])
    names = chain.names
    off = {key: size for key, size in ROUGH.items() if kinds is None or key in kinds}
    scatter = draw_scatter(rng, parameters(chain, kind.tool), off)
    turn, shift = rng.uniform(0, 3.0) * unit(rng), rng.uniform(0.5, 4.0) * unit(rng)
    if behind_gears:
        scatter, turn, shift = (
            {key: off for key, off in scatter.items() if key.endswith(".mass")},
            np.zeros(3),
            np.zeros(3),
        )
    scatter |= {f"pose_sensor.{axis}": float(amount) for axis, amount in zip(("rx", "ry", "rz", "x", "y", "z"),
                                                                             (*turn, *shift), strict=True)}  # fmt: skip
    soft, drawn_late = bool(rng.random() < 0.5), float(rng.uniform(0.0, 1e-2))
    about = np.exp(rng.uniform(*np.log(GEARS), len(names)))
    about = about * (soft if yields is None else yields)
    drawn_speeds = bool(rng.random() < 0.5)
    late = drawn_late if late is None else late
    own = np.random.default_rng([seed, 72])
    waves = [{"physics": "eccentric_encoder", "location": name, "amplitude": wavy, "waves": int(own.integers(2, 6)),
              "phase": float(own.uniform(0, 2 * np.pi))} for name in names]  # fmt: skip
    device = Tracked(chain, kind.tool, scatter, about, late, 0.0 if behind is None else behind, waves)
    points, spins = (float(f"{np.exp(rng.uniform(*np.log(span))):.2g}") for span in (POINTS, TURNS))
    rate = float(rng.choice([50.0, 100.0, 200.0]))
    own_noise = np.exp(own.uniform(*np.log(BEHIND_GEARS))) if behind_gears else 0.0
    records = []
    for count in (rows, max(rows // 4, 40)):
        motion = _motion(rng, chain, kind)
        if moving:
            t = np.arange(count) / rate
            q, qd, p, turned = device.told(motion, t, own_noise, own)
        else:
            t = 5.0 * np.arange(count)
            q = motion.centre + rng.uniform(-0.8, 0.8, (count, len(names)))
            qd = np.zeros_like(q)
            p, turned = device.posed(device.links(q, None))
        records.append(
            {
                "time": t,
                "q": q + ENCODERS * rng.normal(size=q.shape),
                "qd": qd + 1e-4 * rng.normal(size=q.shape),
                "p": p if behind_gears else p + points * rng.normal(size=p.shape),
                "r": vector(turned if behind_gears else turned @ matrix(spins * rng.normal(size=p.shape))),
            }
        )
    if behind_gears:  # what noise of the joints' own encoders makes of poses, root mean square
        points, spins = device.scattered(records[0]["q"], own_noise)
    return {
        "robot": robot,
        "device": device,
        "fit": records[0],
        "heldout": records[1],
        "turns": turns,
        "speeds": moving and (drawn_speeds if speeds is None else speeds),
        "noise": {"position": points, "rotation": spins},
        "declared": declared,
        "truth": {"seed": seed, "robot": robot, "late": np.asarray(device.late).tolist(), "behind": device.behind,
                  "about": device.compliance.tolist(), "scatter": scatter, "joints": list(names)},
    }  # fmt: skip


def how(seed: int, robot: str) -> dict[str, Any]:
    """Return how an arm of the trials is drawn: the arguments of `draw_tracked`."""
    rng = np.random.default_rng([seed, 73, *robot.encode()])
    yields, behind_gears, declared, one_clock = (bool(item) for item in rng.random(4) < SHARE)
    count = len(ARMS[robot].chain().names)
    each = np.where(rng.random(count) < ON_TIME, 0.0, rng.uniform(0.0, LATEST, count))
    late = [float(rng.uniform(0.0, LATEST))] * count if one_clock else each.tolist()
    return {"seed": seed, "robot": robot, "yields": yields, "behind_gears": behind_gears, "declared": declared,
            "late": late}  # fmt: skip


def _motion(rng, chain: Chain, kind) -> Excitation:
    """Return a motion about the arm's usual place."""
    centre = np.array(kind.centre)
    room = np.array([np.inf if j.endless else min(c - j.limits[0], j.limits[1] - c)
                     for j, c in zip(chain.joints, centre, strict=True)])  # fmt: skip
    reach = np.minimum(rng.uniform(0.5, 1.3, len(centre)), 0.95 * room)
    return draw_excitation(rng, centre, reach, np.minimum([j.speed for j in chain.joints], 1.5), 60.0)


def columns(drawn: Mapping[str, Any], part: str) -> tuple[list[str], np.ndarray]:
    """Return names and values of the table of "fit" or "heldout"."""
    record, names = drawn[part], drawn["truth"]["joints"]
    head, values = ["time", *(f"q.{name}" for name in names)], [record["time"][:, None], record["q"]]
    if drawn["speeds"]:
        head, values = [*head, *(f"qd.{name}" for name in names)], [*values, record["qd"]]
    head, values = [*head, "p.x", "p.y", "p.z"], [*values, record["p"]]
    if drawn["turns"]:
        head, values = [*head, "r.x", "r.y", "r.z"], [*values, record["r"]]
    return head, np.hstack(values)


def write(drawn: Mapping[str, Any], out: Path, sealed: Path, name: str) -> None:
    """Recordings into `out`, the answer into `sealed`."""
    about: dict[str, Any] = {"robot": ARMS[drawn["robot"]].called}
    if drawn["declared"]:
        about |= {f"{key}_noise": value for key, value in drawn["noise"].items()}
    seal(out, sealed, name, about, drawn["truth"])
    for part, ending in (("fit", ".csv"), ("heldout", ".heldout.csv")):
        head, values = columns(drawn, part)
        np.savetxt(out / f"{name}{ending}", values, "%.10g", ",", header=",".join(head), comments="")


def main(argv=None) -> None:
    ap = drawing(__doc__, list(ROBOTS))
    a = ap.parse_args(argv)
    for seed in range(a.seed, a.seed + a.count):
        write(draw_tracked(seed, a.robot), a.out, a.sealed, f"{a.robot}-{seed:04d}")
        print(f"{a.robot}-{seed:04d} written")


if __name__ == "__main__":
    main()
