"""How often is the diagnosis right? Blind trials on devices drawn at random.

    python scripts/concealed_trials.py [--count 200] [--scattered 50] [--efforts 60] … [--first-seed 1000]
        [--robot NAME] [--workers 2] [--out out/trials] [--docs]
    python scripts/concealed_trials.py --export DIR --scattered 100 [--robot …] [--first-seed 1000]
    python scripts/concealed_trials.py --export DIR --efforts 40 | --markers 40 | --elastic 40
    python scripts/concealed_trials.py --score DIR

A separate simulator (tests/reference/concealed, another formulation that shares no code with the package) draws a
device, its effects, places, sizes, loads and noise from a seed. The answer is sealed in a file; the diagnosis sees the
recording alone; the answer is opened only to score. Each kind of trials is a file beside this one and a page of docs/,
into which `--docs` writes the tables; an option says how many (`--help`). Finished trials are kept in OUT, so a stopped
run goes on.

`--export` writes the scattered devices, their sealed answers and a description of the format, for any other tool;
`--score` reads that tool's answers.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import re
import sys
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import partial
from pathlib import Path

import _efforts
import _elastic
import _fleet
import _formulas
import _friction
import _life
import _loop
import _markers
import _misread
import _scattered
import _since
import _tracked
import _uncalibrated
import numpy as np
from _benchmark import (
    Kind,
    as_told,
    at_places,
    by_size,
    columns,
    confusion,
    left_over,
    listed,
    rate,
    read_answers,
    sealed,
    spread,
    table,
)
from _project import ROOT

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.recordings import read_recording
from prup_pin.simulation import simulate
from tests.reference.concealed.draw import NOISE, PHYSICS, RARE, draw, write
from tests.reference.concealed.scattered import KINDS

#: What is drawn: name -> (share of the trials, effects, range of strength in multiples of the noise).
GROUPS = {
    "clean": (0.25, [], (4.0, 40.0)),
    "one": (0.50, None, (3.0, 40.0)),
    "pair": (0.10, 2, (4.0, 40.0)),
    "outside": (0.15, ["alien"], (3.0, 30.0)),
    "rare": (0.0, None, (4.0, 40.0)),
    "weak": (0.0, None, (0.3, 3.0)),
}
#: Noise of the sensors, as a share of 2 um, 10 urad, 0.03 N and 2 mN m; share of the recordings that do not tell it.
SENSORS = (0.5, 4.0)
UNDECLARED = 0.15
KNOWN = [name for name in PHYSICS if name != "alien"]
#: Parameters whose truth is one number under the same name, or under the given one.
COMPARABLE = {
    ("stiffness_changed", "factor"): "factor",
    ("backlash", "half_gap"): "half_gap",
    ("coulomb_friction", "limit"): "limit",
    ("root_tilt_compliance", "root_tilting_stiffness"): "stiffness",
    ("hub_root_compliance", "root_tilting_stiffness"): "stiffness",
    ("thermal_growth", "expansion"): "coefficient",
    ("lead_error", "relative"): "ratio",
    ("encoder_offset", "offset"): "offset",
    ("payload", "mass"): "mass",
    ("creep", "share"): "ratio",
    ("viscous_friction", "damping"): "damping",
    ("encoder_delay", "delay"): "delay",
}


#: Seeds from here on draw, besides: physics that few robots have, effects near the noise (one device in ten each), and
#: more clean devices (one in four), because few false alarms need many devices to be counted.
RARE_SEEDS, WEAK_SEEDS, CLEAN_SEEDS = 1_000_000, 2_000_000, 3_000_000


def group_of(seed: int) -> str:
    """Return which kind of device a seed draws."""
    for start, name in ((CLEAN_SEEDS, "clean"), (WEAK_SEEDS, "weak"), (RARE_SEEDS, "rare")):
        if seed >= start:
            return name
    at = np.random.default_rng([seed, 7]).random()
    total = 0.0
    for name, (share, _, _) in GROUPS.items():
        total += share
        if at < total:
            return name
    return name


def devices(options: argparse.Namespace) -> list[tuple[str, int]]:
    """Return seeds of plain devices, with a tenth as many rare and weak ones and a quarter as many clean ones."""
    count = options.count
    counts = {0: count, RARE_SEEDS: count // 10, WEAK_SEEDS: count // 10, CLEAN_SEEDS: count // 4}
    return [("", start + options.first_seed + k) for start, many in counts.items() for k in range(many)]


def trial(seed: int, robot: str = "") -> dict:
    """Draw, seal, diagnose, predict the held-out recording, and only then open the answer."""
    group = group_of(seed)
    _, effects, multiple = GROUPS[group]
    if effects is None:
        names = RARE if group == "rare" else KNOWN
        effects = [names[seed % len(names)]]
    rng = np.random.default_rng([seed, 8])
    sensors = float(np.exp(rng.uniform(*np.log(SENSORS))))
    noise = {name: sensors * value for name, value in NOISE.items()}
    declared = bool(rng.random() > UNDECLARED)
    with sealed() as (out, hidden):
        write(draw(seed, effects, multiple, noise=noise), out, hidden, "device", declared)
        begun = time.perf_counter()
        loaded = prup_pin.load("3prup")
        found = diagnose(loaded, read_recording(out / "device.csv"))
        seconds = time.perf_counter() - begun
        heldout = read_recording(out / "device.heldout.csv")
        before, after = (
            left_over(_scattered.poses_of(heldout), _scattered.poses_of(simulate(loaded, heldout, effects)), noise)
            for effects in ((), found.effects)
        )
        truth = json.loads((hidden / "device.truth.json").read_text())
    findings = [item for item in found.findings if item.physics != "finite_deflection"]
    return {
        "seed": seed,
        "group": group,
        "verdict": found.verdict,
        "findings": as_told(findings),
        "effects": [scored(true, findings) for true in truth["effects"]],
        "before": before,
        "after": after,
        "fit": [found.before["fit"], found.after["fit"], found.after["heldout"]],
        "seconds": seconds,
        "sensors": sensors,
        "declared": declared,
    }


def scored(true, findings) -> dict:
    """Compare the findings with a true effect."""
    placed = [item for item in findings if true["location"] in item.candidates]
    right = [item for item in placed if item.physics == true["physics"]]
    told = max(findings, key=lambda item: item.heldout_gain).physics if findings else "nothing"
    inside = []
    for item in right:
        for name, value in item.parameters.items():
            key = COMPARABLE.get((item.physics, name))
            if key in true["parameters"] and item.location == true["location"]:
                low, high = value.interval
                inside.append(bool(low <= true["parameters"][key] <= high))
    return {
        "physics": true["physics"],
        "location": true["location"],
        "parameters": true["parameters"],
        "strength": max(true["strength"]),
        "place": bool(placed),
        "named": any(item.physics == true["physics"] for item in findings),
        "right": bool(right),
        "told": right[0].physics if right else told,
        "inside": inside,
    }


def alternative(trial: dict) -> bool:
    """Return True where the true physics stands among the alternatives of a finding."""
    true = trial["effects"][0]["physics"]
    return any(text.partition(" at ")[0] == true for item in trial["findings"] for text in item["alternatives"])


def summary(trials: list[dict]) -> str:
    """Return the tables as Markdown."""
    by = {name: [t for t in trials if t["group"] == name] for name in GROUPS}
    one = [t for t in trials if t["group"] in ("one", "rare")]
    strong = [t for t in one if t["effects"][0]["strength"] >= 3]
    classes = [len(t["findings"][0]["candidates"]) for t in strong if t["findings"]] or [0]

    def first(key: str) -> str:
        return rate(lambda t: t["effects"][0][key])(strong)

    rows = [
        ("false alarms on clean devices", rate(lambda t: bool(t["findings"]))(by["clean"])),
        ("one effect of 3 x noise or more: place right", first("place")),
        ("… physics right", first("named")),
        ("… both, in one finding", first("right")),
        (
            "… physics right, or named among those that the data cannot tell apart",
            rate(lambda t: t["effects"][0]["named"] or alternative(t))(strong),
        ),
        ("places in the class of a single effect, median (90th percentile)", spread(classes, ".0f")),
        (
            "pairs: effects with place and physics right",
            rate(lambda e: e["right"], each=lambda t: t["effects"])(by["pair"]),
        ),
        (
            "outside the library: a law named",
            rate(lambda t: any(item["physics"] != "unknown" for item in t["findings"]))(by["outside"]),
        ),
        (
            "95 % intervals that hold the truth",
            rate(lambda hit: hit, each=lambda t: (hit for e in t["effects"] for hit in e["inside"]))(trials),
        ),
        ("held-out residual before, median [noise]", f"{np.median([t['before'] for t in trials]):.2f}"),
        ("held-out residual after, median (90th percentile)", spread((t["after"] for t in trials), ".2f")),
        ("seconds a diagnosis, median (longest)", spread((t["seconds"] for t in trials), ".0f", True)),
    ]
    lines = [f"{len(trials)} devices, seeds from {min(t['seed'] for t in trials)} on.", ""]
    lines += [*listed(("question", "answer"), rows), ""]
    lines += ["What single effects were taken for (rows: truth; columns: the strongest finding):", ""]
    lines += confusion((t["effects"][0]["physics"], t["effects"][0]) for t in [*one, *by["outside"]])
    lines += ["", "Detection against strength (single effects of the library, strongest channel):", ""]
    lines += by_size("strength", (0, 0.5, 1, 2, 3, 5, 10, 20), [*one, *by["weak"]], "strength")
    missed = [t for t in trials if not all(e["right"] for e in t["effects"]) and t["group"] != "weak"]
    missed += [t for t in by["clean"] if t["findings"]]
    lines += ["", f"All {len(missed)} devices with an effect that was missed, misplaced or misnamed:" if missed else ""]
    if missed:
        lines += ["", *listed(("seed", "truth", "verdict"), (
            (t["seed"], at_places(t["effects"], "strength", "clean"),
             at_places(t["findings"], otherwise="nothing missing")) for t in missed))]  # fmt: skip
    return "\n".join(lines) + "\n"


def told(result: dict) -> str:
    """Return one line on a trial without scatter."""
    named = at_places(result["findings"], otherwise="nothing")
    found = all(e["right"] for e in result["effects"]) and bool(result["effects"]) == (named != "nothing")
    change = f"{result['before']:.2f} -> {result['after']:.2f}  {result['seconds']:.0f} s"
    true = at_places(result["effects"], "strength", "clean")
    return f"{'ok' if found else '--'} {result['seed']} {true} -> {named}  {change}"


#: All kinds of trials, each by the option that asks for so many.
TRIALS = (
    Kind("count", "3-PRUPs without scatter", "concealed", devices, trial, told, summary, kept="trials"),
    *(each.KIND for each in (_scattered, _efforts, _elastic, _markers, _uncalibrated, _tracked, _friction, _since,
                             _life, _fleet, _formulas, _loop, _misread)),
)  # fmt: skip


def run(jobs: dict, kept: Path, workers: int, tell) -> list[dict]:
    """Return the results of jobs, (function, *arguments) by key; those kept in a file are not done again."""
    done = [item for item in read(kept) if key_of(item) in jobs]
    finished = {key_of(item) for item in done}
    with ProcessPoolExecutor(workers) as pool, kept.open("a") as file:
        waiting = {pool.submit(*job): key for key, job in jobs.items() if key not in finished}
        for job in as_completed(waiting):
            try:
                result = job.result()
            except Exception as error:  # one device must not stop the others; it is counted and shown
                print(f"{waiting[job]}: {type(error).__name__}: {error}", file=sys.stderr)
                continue
            done.append(result)
            file.write(json.dumps(result) + "\n")
            file.flush()
            print(tell(result), flush=True)
    return sorted(done, key=key_of)


def read(kept: Path) -> list[dict]:
    """Return the results in a file, if there is one."""
    return [json.loads(line) for line in kept.read_text().splitlines()] if kept.exists() else []


def key_of(result: dict) -> tuple[str, int]:
    """Return robot and seed of a result."""
    return result.get("robot", ""), result["seed"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    for kind in TRIALS:
        parser.add_argument(f"--{kind.name}", type=int, default=200 if kind.name == "count" else 0, help=kind.help)
    parser.add_argument("--nothing", type=int, default=0, help="beside --formulas so many more without anything")
    parser.add_argument("--robot", action="append", choices=list(KINDS), help="of these robots; default: all")
    parser.add_argument("--today", action="store_true", help="what people do today, beside, on scattered devices")
    parser.add_argument("--first-seed", type=int, default=1000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("out/trials"))
    parser.add_argument("--docs", action="store_true", help="write the pages of docs/ on what was run")
    parser.add_argument("--export", type=Path, metavar="DIR", help="write devices for another tool")
    parser.add_argument("--score", type=Path, metavar="DIR", help="score another tool's answers in an exported folder")
    options = parser.parse_args()
    if options.score:
        print(scored_answers(read_answers(options.score)))
        return
    if options.export:
        for kind in TRIALS:
            if kind.export and (found := kind.devices(options)):
                kind.export(options.export, found)
        return
    options.out.mkdir(parents=True, exist_ok=True)
    for kind in TRIALS:
        found = kind.devices(options)
        if found:
            tables, command = answered(kind, found, options)
            print("\n" + tables)
            if options.docs:
                tell(ROOT / "docs" / f"{kind.page}_trials.md", tables, command)


def tell(page: Path, tables: str, command: str) -> None:
    """Write tables, and the command that makes them again, in the place of those of a page."""
    head, _, rest = page.read_text(encoding="utf-8").partition("<!-- trials -->")
    head = re.sub(r"`python scripts/concealed_trials\.py [^`]*--docs`", f"`{command}`", head, count=1)
    _, mark, rest = rest.partition("<!-- /trials -->")
    page.write_text(f"{head}<!-- trials -->\n\n{tables}\n{mark}{rest}", encoding="utf-8")


def answered(kind: Kind, devices: list[tuple], options: argparse.Namespace) -> tuple[str, str]:
    """Run devices of a kind; return their tables, and the command that makes them again."""
    beside = {"beside": options.today} if kind is _scattered.KIND else {}
    jobs = {(robot, seed): (partial(kind.trial, **beside), seed, robot, *more) for robot, seed, *more in devices}
    kept = options.out / f"{kind.kept or kind.name}.jsonl"
    done = run(jobs, kept, options.workers, kind.told)
    missing = f"{len(jobs) - len(done)} of {len(jobs)} devices ended in an error and are not counted below.\n\n"
    if kind.gathered:
        done = sorted([*done, *(item for item in read(kept) if key_of(item) not in jobs)], key=key_of)
    text = (missing if len(jobs) > len(done) else "") + (kind.summary(done) if done else "")
    asked = f"--{kind.name} {getattr(options, kind.name)}"
    asked = asked if kind.name == "count" else f"--count 0 {asked}"
    asked += f" --nothing {options.nothing}" * (kind is _formulas.KIND) + " --today" * beside.get("beside", False)
    asked += "".join(f" --robot {name}" for name in options.robot or ())
    return text, f"python scripts/concealed_trials.py {asked} --first-seed {options.first_seed} --docs"


def scored_answers(answers: list[dict]) -> str:
    """Return the table of another tool's answers, robot by robot."""
    mine = columns(answers, KINDS)
    return "\n".join(f"### {name}: {len(own)} answers\n\n{table({'answers': own})}" for name, own in mine.items())


if __name__ == "__main__":
    main()
