"""Draw a concealed fleet: devices of one drawing that is wrong in one place, with tolerances of their own.

Every parameter of every device scatters by the fleet's true tolerances; the recordings declare others. One parameter is
off on all devices alike, another on one device alone.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from . import draw
from .scatter import draw_scatter
from .scattered import KINDS, draw_always

#: True tolerances beside a workshop's ordinary ones, and declared ones beside the true ones.
TRUE, DECLARED = (0.5, 3.0), (0.7, 2.5)
#: How far the drawing is off, and the device that stands apart, in tolerances.
WRONG, APART = (3.0, 8.0), (8.0, 14.0)
#: Kinds of which a drawing, and of which a single device, is wrong.
OF_DRAWING, OF_DEVICE = ("position", "stiffness", "bending"), ("stiffness",)


def draw_fleet(seed: int, robot: str, poses: int, count: int = 20) -> dict[str, Any]:
    """Return noisy `records` of so many devices, what is declared, and the truth."""
    kind = KINDS[robot]
    rng = np.random.default_rng([seed, 31])
    used = [key for key in kind.tolerances if key in set(kind.parameters.values())]
    true = {key: kind.tolerances[key] * float(np.exp(rng.uniform(*np.log(TRUE)))) for key in used}
    declared = {key: float(f"{true[key] * np.exp(rng.uniform(*np.log(DECLARED))):.2g}") for key in used}
    wrong, apart = (
        str(rng.choice([name for name, own in kind.parameters.items() if own in kinds and not _of_base(name)]))
        for kinds in (OF_DRAWING, OF_DEVICE)
    )
    error, alone = (
        float(sign * true[kind.parameters[name]] * rng.uniform(*ends))
        for name, ends, sign in ((wrong, WRONG, rng.choice([-1.0, 1.0])), (apart, APART, 1.0))
    )
    who = int(rng.integers(count))
    always = draw_always(rng, robot)
    records, scatters = [], []
    for device in range(count):
        scatter = draw_scatter(rng, kind.parameters, true)
        scatter[wrong] = _off(scatter[wrong], error, kind.parameters[wrong])
        if device == who:
            scatter[apart] = _off(scatter[apart], alone, kind.parameters[apart])
        scatters.append(scatter)
        run = kind.programme(rng, poses)
        records.append(draw.measure(kind.machine([always], scatter=scatter), run, rng, kind.noise))
    return {
        "robot": robot,
        "records": records,
        "noise": dict(kind.noise),
        "tolerances": declared,
        "truth": {"seed": seed, "robot": robot, "true": true, "declared": declared,
                  "wrong": [wrong, kind.parameters[wrong], error], "apart": [who, apart, alone], "scatters": scatters},
    }  # fmt: skip


def _off(scatter: float, error: float, kind: str) -> float:
    """Return by how much a parameter is off by an error too: of what stays positive by its logarithm."""
    return float(np.expm1(np.log1p(scatter) + error)) if kind in ("stiffness", "bending") else scatter + error


def _of_base(name: str) -> bool:
    """Where the first joint is, is where the tracker is."""
    return name.startswith("joint1.")


def write(drawn: dict[str, Any], out: Path, sealed: Path, robot_file: str) -> list[Path]:
    """Write a table with its JSON for each device into `out`, and the answers into `sealed`; return the tables."""
    named = {f"device{place:02}": {} for place, _ in enumerate(drawn["records"], 1)}
    return draw.write_records(drawn, out, sealed, robot_file, KINDS[drawn["robot"]].actuated, named)
