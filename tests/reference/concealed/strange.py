"""Draw a robot in motion with physics that is in no law of any library, and what it logs, from a seed.

One joint has one strange thing, of KINDS: each a formula from a textbook or a shape that a machine builder knows, not
always an elementary one. Masses and inertias are a little off, as in `efforts`, whose robots and loggers these are.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from .chain import Chain
from .draw import Candidate, effect_of_size, pick
from .efforts import KINDS as ROBOTS
from .efforts import TOLERANCE, Kind, Yardstick, draw_logger, draw_motion
from .excitation import Excitation
from .moving import Moving
from .scatter import draw_scatter

#: How much farther the third motion goes than the first.
BEYOND = 1.2


def effort(e: Mapping[str, Any], i: int, j: int, m) -> np.ndarray:
    """Return the effort (N,) at joint i of an effect; j: another joint; m: the moment, as `Moving` has it."""
    c, q, v, t = e["coefficient"], m.q[:, i], m.qd[:, i], m.t - m.t[0]
    kind = e["kind"]
    way = m.direction(q, e["presliding"])
    if kind == "quadratic_drag":
        return c * v * np.abs(v)
    if kind == "stiffening_spring":
        return c * (q - e["rest"]) ** 3
    if kind == "magnetic_detent":  # a dipole that passes another one
        y = (q - e["rest"]) / e["width"]
        return c * y / (1 + y**2) ** 2
    if kind == "rail_bump":  # a raised cosine
        y = np.clip((q - e["rest"]) / e["width"], -1, 1)
        return c * way * 0.5 * (1 + np.cos(np.pi * y))
    if kind == "preloaded_stop":
        return c * (q > e["rest"]) * (e["preload"] + (q - e["rest"]))
    if kind == "rubber_stop":  # Hertz
        return -c * np.maximum(e["rest"] - q, 0.0) ** 1.5
    if kind == "belt":  # a belt whose stiffness follows its position
        return c * (q - e["rest"]) * (1 + e["slope"] * (q - e["rest"]))
    if kind == "two_speeds":
        return c * v * m.qd[:, j]
    if kind == "warming_grease":
        return c * v * np.exp(-t / e["time"])
    if kind == "hose":  # three springs that slip, one after the other
        return c * sum(_slipping(q, share * e["reach"]) for share in (0.6, 1.0, 1.4)) / e["reach"] / 3
    if kind == "wear":
        return c * way * np.cumsum(np.abs(np.diff(q, prepend=q[:1])))
    if kind == "shear_thinning":  # Carreau, with an index of nothing
        return c * v / np.sqrt(1 + (v / e["speed"]) ** 2)
    if kind == "squared_load":
        return c * way * m.load[:, i] ** 2
    if kind == "waved_rail":
        return c * way * (1 + 0.95 * np.sin(e["waves"] * q + e["phase"]))
    raise ValueError(kind)


def _slipping(x: np.ndarray, reach: float) -> np.ndarray:
    out, held = np.empty(len(x)), 0.0
    for k, step in enumerate(np.diff(x, prepend=x[:1]).tolist()):
        held = min(max(held + step, -reach), reach)
        out[k] = held
    return out


#: What may be wrong, and which terms of a formula say it: (times, shape, variable); '*' for any.
KINDS: Mapping[str, tuple[tuple[str, str, str], ...]] = {
    "quadratic_drag": (("", "signed_square", "speed"),),
    "stiffening_spring": (("", "cube_about", "position"),),
    "magnetic_detent": (("", "detent", "position"),),
    "rail_bump": (("direction", "bump", "position"),),
    "preloaded_stop": (("", "stop_above", "position"),),
    "rubber_stop": (("", "below", "position"), ("", "below_squared", "position")),
    "belt": (("", "square_about", "position"),),
    "two_speeds": (("speed", "linear", "speed"),),
    "warming_grease": (("speed", "decay", "time"),),
    "hose": (("", "linear", "hysteresis"), ("", "linear", "yielding")),
    "wear": (("direction", "linear", "travelled"),),
    "shear_thinning": (("", "saturation", "speed"),),
    "squared_load": (("direction", "square", "load"),),
    "waved_rail": (("direction", "wave", "position"),),
}


def candidate(rng, what: str, chain: Chain, kind: Kind, excitation: Excitation, joint: str | None = None) -> Candidate:
    """Return an effect of open size at a random joint."""
    names = list(chain.names)
    joint = pick(rng, names) if joint is None else joint
    i = names.index(joint)
    other = pick(rng, [name for name in names if name != joint])
    q, v, _ = excitation.at(np.linspace(0, excitation.period, 2000))
    low, high, fast = q[:, i].min(), q[:, i].max(), np.abs(v[:, i]).max()
    span = high - low
    place = {
        "physics": "strange", "kind": what, "location": joint, "other": other,
        "presliding": float(np.exp(rng.uniform(np.log(2e-5), np.log(3e-4)))),
        "rest": float(low + span * rng.uniform(0.25, 0.75)),
        "width": float(span * rng.uniform(0.06, 0.2)),
        "preload": float(span * rng.uniform(0.1, 0.5)),
        "slope": float(rng.choice([-1, 1]) * rng.uniform(0.7, 1.5) / span),
        "time": float(rng.uniform(8.0, 25.0)),
        "reach": float(span * rng.uniform(0.05, 0.25)),
        "speed": float(fast * rng.uniform(0.15, 0.5)),
        "waves": float(2 * np.pi * rng.uniform(1.5, 5.0) / span),
        "phase": float(rng.uniform(0, 2 * np.pi)),
    }  # fmt: skip
    return Candidate(lambda x: place | {"coefficient": x}, 1e-4 * kind.noise, 1e4 * kind.noise)


def draw_strange(
    seed: int, robot: str, what: str | None, joint: str | None = None, multiple=(5.0, 40.0)
) -> dict[str, Any]:
    """A robot in motion with something strange, or without (None): three motions that it logs, and the truth.

    The second motion is another one like the first; the third is the first, BEYOND times as wide and as fast. `clean`:
    the efforts of each without noise.
    """
    kind = ROBOTS[robot]
    chain = kind.chain()
    rng = np.random.default_rng([seed, 41, *robot.encode()])
    logger = replace(draw_logger(rng, kind), rough=(0.0, 0.0, 0.0), wrapped=False)
    logger = replace(logger, rate=min(logger.rate, 500.0))
    duration = float(rng.uniform(20.0, 40.0))
    fit, other = (draw_motion(rng, chain, kind, duration, 0) for _ in range(2))
    wider = replace(fit, a=BEYOND * fit.a, b=BEYOND * fit.b)
    weighed = [link.name for link in chain.links if link.body >= 0 and link.mass > 0]
    parameters = {f"{name}.{part}": part for name in weighed for part in ("mass", "inertia")}
    declared = {"mass": TOLERANCE, "inertia": TOLERANCE}
    scatter = draw_scatter(rng, parameters, declared)
    effects = []
    if what is not None:
        tolerances = {name: declared[part] for name, part in parameters.items()}
        yardstick = Yardstick(chain, kind.tool, fit, duration, logger.noise, tolerances)
        own = np.random.default_rng([seed, 42, *what.encode()])
        effects = [
            effect_of_size(
                own, what, multiple, [], lambda: candidate(own, what, chain, kind, fit, joint), yardstick.sizes
            )
        ]
    device = Moving(chain, kind.tool, effects, scatter)
    own = np.random.default_rng([seed, 43])
    logs, clean = [], []
    for motion in (fit, other, wider):
        log = logger.log(own, device, motion, duration, seed)
        logs.append(log)
        clean.append(device.given(log["time"], motion, seed))
    return {
        "robot": robot, "logs": logs, "clean": clean, "joints": list(chain.names), "effects": effects,
        "noise": logger.noise, "tolerances": declared,
    }  # fmt: skip
