"""Blind trials of a fleet: twenty devices of one drawing, what is common to them, and by how much they scatter."""

from __future__ import annotations

import json
import time
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from _benchmark import Kind, in_turn, listed, sealed, share
from _scattered import robot_file

from prup_pin.life.fleet import devices_of, fleet
from prup_pin.recordings import read_recording
from tests.reference.concealed.fleet import draw_fleet, write

#: Poses of a device's test, and devices of a fleet.
POSES, DEVICES = 8, 20
ROBOT = "elastic_arm"


def trial(seed: int, robot: str) -> dict[str, Any]:
    """Draw, seal, ask, and only then open the answer."""
    with sealed() as (out, hidden):
        paths = write(draw_fleet(seed, robot, POSES, DEVICES), out, hidden, str(robot_file(robot)))
        begun = time.process_time()
        devices = devices_of([read_recording(path) for path in paths])
        found = fleet(devices, out / "fleet", robot_name=str(robot_file(robot)))
        seconds = time.process_time() - begun
        truth = json.loads((hidden / "device01.truth.json").read_text())
    wrong, (who, apart, alone) = truth["wrong"], truth["apart"]
    name = f"device{who + 1:02}"
    common = [item for item in found.common if wrong[0] in (item.parameter, *item.others)]
    single = [item for item in found.outliers if item.device == name and apart in (item.parameter, *item.others)]
    return {
        "seed": seed,
        "robot": robot,
        "wrong": wrong,
        "apart": [name, apart, alone],
        "common": [[item.parameter, item.value, *item.interval] for item in found.common],
        "outliers": [[item.device, item.parameter, item.value, *item.interval] for item in found.outliers],
        "named": bool(common),
        "single": bool(single),
        "accused": len(found.common) - len(common) + len(found.outliers) - len(single),
        "tolerances": {
            item.kind: [item.value, *item.interval, truth["true"][item.kind], item.count]
            for item in found.scatter
            if item.told
        },
        "laws": dict(found.laws),
        "seconds": seconds,
    }


def told(result: Mapping[str, Any]) -> str:
    """Return one line on a trial."""
    good = result["named"] and result["single"] and not result["accused"]
    apart = ", ".join(f"{kind} {value / true:.2f}" for kind, (value, _, _, true, _) in result["tolerances"].items())
    return (
        f"{'ok' if good else '--'} {result['robot']} {result['seed']} {result['wrong'][0]}, {result['apart'][:2]} -> "
        f"{[item[0] for item in result['common']]} {[item[:2] for item in result['outliers']]}; {apart}  "
        f"{result['seconds']:.0f} s"
    )


def summary(trials: Sequence[Mapping[str, Any]]) -> str:
    """Return the tables as Markdown."""
    count = len(trials)
    each = [(kind, *values) for t in trials for kind, values in t["tolerances"].items()]
    near = sum(abs(value / true - 1) <= 0.2 for _, value, _, _, true, _ in each)
    inside = sum(low <= true <= high for _, _, low, high, true, _ in each)
    lines = listed(("question", "answer"), [
        (f"fleets of {DEVICES}", count),
        ("the error of the drawing named", share(sum(t["named"] for t in trials), count)),
        ("the device that stands apart named", share(sum(t["single"] for t in trials), count)),
        ("fleets in which something else is accused", share(sum(bool(t["accused"]) for t in trials), count)),
        ("tolerances within 20 % of the true ones", share(near, len(each))),
        ("true tolerances in their 95 % intervals", share(inside, len(each))),
        ("processor seconds of a device, median", f"{np.median([t['seconds'] for t in trials]) / DEVICES:.1f}"),
    ])  # fmt: skip
    kinds = defaultdict(list)
    for kind, value, _, _, true, parameters in each:
        kinds[kind, parameters].append(np.log(value / true))
    names = ("kind", "parameters", "told in", "told over true: mean of logarithms", "scatter of it")
    lines += ["", *listed(names, (
        (*key, f"{len(logs)} of {count}", f"{100 * np.expm1(np.mean(logs)):+.1f} %", f"{100 * np.std(logs):.1f} %")
        for key, logs in kinds.items())), ""]  # fmt: skip
    names = ("fleet", "what is wrong", "told of the drawing", "told of single devices")
    lines += listed(names, map(_row, sorted(trials, key=lambda t: t["seed"])))
    return "\n".join(lines) + "\n"


def _row(t: Mapping[str, Any]) -> tuple[object, ...]:
    """Return what is wrong with a fleet, and what was told."""
    wrong = f"{t['wrong'][0]} {t['wrong'][2]:+.3g}; {t['apart'][0]}: {t['apart'][1]} {t['apart'][2]:+.3g}"
    common = "; ".join(f"{name} {value:+.3g} ({low:+.3g} to {high:+.3g})" for name, value, low, high in t["common"])
    single = "; ".join(f"{device}: {name} {value:+.3g}" for device, name, value, _, _ in t["outliers"])
    return t["seed"], wrong, common or "nothing", single or "nothing"


KIND = Kind(
    "fleets", "fleets of twenty devices", "fleet", in_turn("fleets", [ROBOT]), trial, told, summary, kept="fleet"
)
