"""How often is the diagnosis right? Blind trials on devices drawn at random.

    python scripts/concealed_trials.py [--count 200] [--first-seed 1000] [--workers 2] [--out out/trials] [--docs]
        [--scattered 0] [--robot 3prup --robot six_ups --robot elastic_arm] [--today] [--efforts 0] [--markers 0]
        [--elastic 0] [--json DIR] [--loop 0] [--misread 0] [--uncalibrated 0] [--tracked 0]
        [--friction 0] [--since 0] [--lives 0] [--fleets 0] [--formulas 0]
    python scripts/concealed_trials.py --export DIR --scattered 100 [--robot …] [--first-seed 1000]
    python scripts/concealed_trials.py --export DIR --efforts 40 | --markers 40 | --elastic 40
    python scripts/concealed_trials.py --score DIR

A separate simulator (tests/reference/concealed, another formulation that shares no code with the package) draws a
device, its effects, places, sizes, loads and noise from a seed. The answer is sealed in a file; the diagnosis sees the
recording alone; the answer is opened only to score. Finished trials are kept in OUT/trials.jsonl, so a stopped run goes
on. `--scattered` draws so many devices of each robot whose parameters are all a little off (OUT/scattered.jsonl);
`--today` lets plain least squares and stepwise regression answer beside. `--efforts` draws so many robots in motion in
all, of five kinds in turn, that are seen by their efforts (OUT/efforts.jsonl), `--elastic` so many arms whose gears
yield and whose motors vibrate (OUT/elastic.jsonl; `--json`: and a file for each), `--markers` so many arms under their
own weight that a camera sees (OUT/markers.jsonl), `--tracked` so many arms whose poses are logged in motion
(OUT/tracked.jsonl), `--uncalibrated` so many parallel robots of which everything is off (OUT/uncalibrated.jsonl),
`--friction` so many whose parameters scatter and of which a joint has dry friction (OUT/friction.jsonl). `--since`
draws so many arms and 3-PRUPs, two to one, or so many of each `--robot`, that are tested twice, and asks what has
changed in between (OUT/since.jsonl); `--lives` so many arms and 3-PRUPs, nine to one, that are tested ten times, and
asks what changed when (OUT/life.jsonl); `--fleets` so many fleets of twenty arms (OUT/fleet.jsonl). `--formulas` draws
so many arms in motion with physics that is in no law, and a quarter as many without (OUT/formulas.jsonl). `--loop`
draws so many 3-PRUPs without scatter, or with `--robot` so many of each of these whose parameters scatter, and carries
out the experiment that an ambiguous verdict proposes (OUT/loop.jsonl). `--misread` draws so many logs in all, of six
robots in turn, that are written otherwise than they say (OUT/misread.jsonl). `--docs` writes the summaries into
docs/concealed_trials.md, docs/scattered_trials.md, docs/effort_trials.md, docs/elastic_trials.md,
docs/marker_trials.md, docs/tracked_trials.md, docs/uncalibrated_trials.md, docs/friction_trials.md,
docs/since_trials.md, docs/life_trials.md, docs/fleet_trials.md, docs/formula_trials.md, docs/loop_trials.md and
docs/misread_trials.md.

`--export` writes the scattered devices, their sealed answers and a description of the format, for any other tool;
`--score` reads that tool's answers.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import itertools
import json
import sys
import tempfile
import time
from collections import Counter, defaultdict
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
import _motion
import _since
import _tracked
import _uncalibrated
import numpy as np
from _benchmark import export, read_answers, table
from _project import ROOT
from _scattered import how, robot_file, told
from _scattered import summary as scattered_summary
from _scattered import trial as scattered_trial

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.recordings import read_recording
from prup_pin.simulation import simulate
from prup_pin.spatial import rotation_exp, rotation_log
from tests.reference.concealed.draw import NOISE, PHYSICS, RARE, draw, write
from tests.reference.concealed.efforts import KINDS as MOVING
from tests.reference.concealed.elastic import KINDS as YIELDING
from tests.reference.concealed.markers import CAMERAS
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
HEAD = """# Concealed trials: how often the diagnosis is right

A simulator of its own (`tests/reference/concealed/`: another formulation of the loaded 3-PRUP, by integrating each leg
from its end, which shares no code with the package) draws a device, a bench test of 14 poses with 27 loads each, and
sensors of half to four times 2 µm and 10 µrad; one recording in seven does not tell its noise. The answer is sealed in
a file. The diagnosis gets the recording alone, its corrected model predicts another test of the same device, and only
then the answer is opened to score. Seeds decide everything: `{command}`
makes this page again.

- *Clean*: nothing but the nominal robot. *One*: an effect of the library at a random place and size. *Pairs*: two of
  them. *Outside*: physics that no law describes (a cubic drive, a drive that moves with another leg's load, drift
  under load, …), where the right answer is `unknown`.
- Strength: RMS of what the effect alone changes in the pose channel where it is strongest, in multiples of that
  channel's noise.
- *Place right*: the true place is in the class that the verdict names. *Physics right*: the true word of the
  vocabulary is given.
- Some effects cannot be told apart by any pose of the tool: a base that sits too high and an encoder that is off, a
  mass at the tool point and a bias of the force sensor. The verdict then names one and lists the other.

"""
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


def trial(seed: int) -> dict:
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
    with tempfile.TemporaryDirectory() as folder:
        out, sealed = Path(folder) / "out", Path(folder) / "sealed"
        write(draw(seed, effects, multiple, noise=noise), out, sealed, "device", declared)
        begun = time.perf_counter()
        robot = prup_pin.load("3prup")
        recording = read_recording(out / "device.csv")
        found = diagnose(robot, recording)
        seconds = time.perf_counter() - begun
        heldout = read_recording(out / "device.heldout.csv")
        before, after = (residual(robot, heldout, effects, noise) for effects in ((), found.effects))
        truth = json.loads((sealed / "device.truth.json").read_text())
    return score(seed, group, found, truth, seconds, before, after) | {"sensors": sensors, "declared": declared}


def residual(robot, recording, effects, noise=NOISE) -> float:
    """Return the RMS residual of a prediction in multiples of the sensors' noise."""
    predicted = simulate(robot, recording, effects)
    moved = (np.array(recording.position) - predicted.position) / noise["position"]
    measured, simulated = (rotation_exp(np.array(x)) for x in (recording.rotation, predicted.rotation))
    turned = rotation_log(measured @ simulated.mT) / noise["rotation"]
    return float(np.sqrt(np.nanmean(np.hstack([moved, turned]) ** 2)))


def score(seed, group, found, truth, seconds, before, after) -> dict:
    """Compare a diagnosis with the answer."""
    findings = [item for item in found.findings if item.physics != "finite_deflection"]
    effects = []
    for true in truth["effects"]:
        placed = [item for item in findings if true["location"] in item.candidates]
        named = [item for item in findings if item.physics == true["physics"]]
        right = [item for item in placed if item.physics == true["physics"]]
        told = max(findings, key=lambda item: item.heldout_gain).physics if findings else "nothing"
        inside = []
        for item in right:
            for name, value in item.parameters.items():
                key = COMPARABLE.get((item.physics, name))
                if key in true["parameters"] and item.location == true["location"]:
                    low, high = value.interval
                    inside.append(bool(low <= true["parameters"][key] <= high))
        effects.append(
            {
                "physics": true["physics"],
                "location": true["location"],
                "parameters": true["parameters"],
                "strength": max(true["strength"]),
                "place": bool(placed),
                "named": bool(named),
                "right": bool(right),
                "told": right[0].physics if right else told,
                "inside": inside,
            }
        )
    return {
        "seed": seed,
        "group": group,
        "verdict": found.verdict,
        "findings": [
            {
                "physics": item.physics,
                "location": item.location,
                "candidates": list(item.candidates),
                "alternatives": list(item.alternatives),
                "parameters": {name: [v.value, *v.interval] for name, v in item.parameters.items()},
                "gain": item.heldout_gain,
            }
            for item in findings
        ],
        "effects": effects,
        "before": before,
        "after": after,
        "fit": [found.before["fit"], found.after["fit"], found.after["heldout"]],
        "seconds": seconds,
    }


SCATTERED_HEAD = """# Concealed trials on devices whose parameters scatter

Robots of which every part is a little off, within tolerances that stand beside the recording: stiffnesses, bending,
masses, base points and joints, directions, encoders, the pose sensor's frame and its target, the wrench sensor. Weights
act, loads are 0.6 of full. Each robot has a simulator of its own (`tests/reference/concealed/`): the 3-PRUP as in the
[trials without scatter](concealed_trials.md), a 6-UPS platform by the balance of each leg, an arm of elastic joints by
each joint's torque. The answer is sealed while the device is diagnosed.

- *Size* of an effect: RMS of what is left of it in its strongest channel after the best fit of all parameters with
  their tolerances as priors, in multiples of the noise; or half the length of that fit in tolerances, the larger of
  both. Effects are drawn from 3 to 40.
- *Misjudged*: each tolerance is declared half or twice as wide as it is.
- *Least squares*: all parameters fitted without regard to tolerances; those beyond three are named. *Stepwise*: the
  library's laws enter one by one while BIC falls. Both on the same devices.

`{command}` makes these tables again; `--export DIR` and `--score DIR` let any other tool answer.

"""


def wilson(hits: int, total: int) -> str:
    """Return a share with its 95 % confidence interval."""
    if not total:
        return "-"
    p, z = hits / total, 1.96
    centre = (p + z * z / (2 * total)) / (1 + z * z / total)
    half = z * np.sqrt(p * (1 - p) / total + z * z / (4 * total**2)) / (1 + z * z / total)
    return f"{100 * p:.1f} % ({hits}/{total}; {100 * max(centre - half, 0):.1f}-{100 * min(centre + half, 1):.1f} %)"


def alternative(trial: dict) -> bool:
    """Return True where the true physics stands among the alternatives of a finding."""
    true = trial["effects"][0]["physics"]
    return any(text.partition(" at ")[0] == true for item in trial["findings"] for text in item["alternatives"])


def summary(trials: list[dict]) -> str:
    """Return the tables as Markdown."""
    lines = [f"{len(trials)} devices, seeds from {min(t['seed'] for t in trials)} on.", ""]
    clean = [t for t in trials if t["group"] == "clean"]
    one = [t for t in trials if t["group"] in ("one", "rare")]
    weak = [t for t in trials if t["group"] == "weak"]
    strong = [t for t in one if t["effects"][0]["strength"] >= 3]
    outside = [t for t in trials if t["group"] == "outside"]
    pairs = [t for t in trials if t["group"] == "pair"]
    inside = [hit for t in trials for e in t["effects"] for hit in e["inside"]]
    wrong = [t for t in outside if any(item["physics"] != "unknown" for item in t["findings"])]
    paired = [e for t in pairs for e in t["effects"]]

    classes = [len(t["findings"][0]["candidates"]) for t in strong if t["findings"]] or [0]

    def rate(key: str) -> str:
        return wilson(sum(t["effects"][0][key] for t in strong), len(strong))

    lines += [
        "| question | answer |",
        "|---|---|",
        f"| false alarms on clean devices | {wilson(sum(bool(t['findings']) for t in clean), len(clean))} |",
        f"| one effect of 3 x noise or more: place right | {rate('place')} |",
        f"| … physics right | {rate('named')} |",
        f"| … both, in one finding | {rate('right')} |",
        f"| … physics right, or named among those that the data cannot tell apart | "
        f"{wilson(sum(t['effects'][0]['named'] or alternative(t) for t in strong), len(strong))} |",
        f"| places in the class of a single effect, median (90th percentile) | {np.median(classes):.0f} "
        f"({np.quantile(classes, 0.9):.0f}) |",
        f"| pairs: effects with place and physics right | {wilson(sum(e['right'] for e in paired), len(paired))} |",
        f"| outside the library: a law named | {wilson(len(wrong), len(outside))} |",
        f"| 95 % intervals that hold the truth | {wilson(sum(inside), len(inside))} |",
        f"| held-out residual before, median [noise] | {np.median([t['before'] for t in trials]):.2f} |",
        f"| held-out residual after, median (90th percentile) | {np.median([t['after'] for t in trials]):.2f} "
        f"({np.quantile([t['after'] for t in trials], 0.9):.2f}) |",
        f"| seconds a diagnosis, median (longest) | {np.median([t['seconds'] for t in trials]):.0f} "
        f"({max(t['seconds'] for t in trials):.0f}) |",
        "",
        "What single effects were taken for (rows: truth; columns: the strongest finding):",
        "",
    ]
    told = defaultdict(Counter)
    places = defaultdict(list)
    for t in [*one, *outside]:
        effect = t["effects"][0]
        told[effect["physics"]][effect["told"]] += 1
        places[effect["physics"]].append(effect["place"])
    lines += ["| truth | devices | place right | taken for |", "|---|---|---|---|"]
    for physics in sorted(told):
        taken = ", ".join(f"{name} {count}" for name, count in told[physics].most_common())
        lines.append(f"| {physics} | {sum(told[physics].values())} | {sum(places[physics])} | {taken} |")
    lines += ["", "Detection against strength (single effects of the library, strongest channel):", ""]
    lines += ["| strength [noise] | devices | something found | place and physics right |", "|---|---|---|---|"]
    for low, high in ((0, 0.5), (0.5, 1), (1, 2), (2, 3), (3, 5), (5, 10), (10, 20), (20, 1e9)):
        inside_bin = [t for t in [*one, *weak] if low <= t["effects"][0]["strength"] < high]
        if inside_bin:
            found = sum(bool(t["findings"]) for t in inside_bin)
            right = sum(t["effects"][0]["right"] for t in inside_bin)
            top = f"{high:g}" if high < 1e8 else "more"
            lines.append(f"| {low}-{top} | {len(inside_bin)} | {found} | {right} |")
    missed = [t for t in trials if not all(e["right"] for e in t["effects"]) and t["group"] != "weak"]
    missed += [t for t in clean if t["findings"]]
    lines += ["", f"All {len(missed)} devices with an effect that was missed, misplaced or misnamed:" if missed else ""]
    lines += ["", "| seed | truth | verdict |", "|---|---|---|"] if missed else []
    for t in missed:
        true = "; ".join(f"{e['physics']} at {e['location']} ({e['strength']:.1f})" for e in t["effects"]) or "clean"
        told = "; ".join(f"{item['physics']} at {item['location']}" for item in t["findings"]) or "nothing missing"
        lines.append(f"| {t['seed']} | {true} | {told} |")
    return "\n".join(lines) + "\n"


def run(jobs: dict, kept: Path, workers: int, tell) -> list[dict]:
    """Return the results of jobs, (function, *arguments) by key; those kept in a file are not done again."""
    done = [json.loads(line) for line in kept.read_text().splitlines()] if kept.exists() else []
    done = [item for item in done if key_of(item) in jobs]
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


def key_of(result: dict) -> tuple[str, int]:
    """Return robot and seed of a result."""
    return result.get("robot", ""), result["seed"]


def told_plain(result: dict) -> str:
    """Return one line on a trial without scatter."""
    truth = ", ".join(f"{e['physics']}@{e['location']}({e['strength']:.1f})" for e in result["effects"]) or "clean"
    named = ", ".join(f"{f['physics']}@{f['location']}" for f in result["findings"]) or "nothing"
    found = all(e["right"] for e in result["effects"]) and bool(result["effects"]) == (named != "nothing")
    change = f"{result['before']:.2f} -> {result['after']:.2f}  {result['seconds']:.0f} s"
    return f"{'ok' if found else '--'} {result['seed']} {truth} -> {named}  {change}"


def counted(summarise, done: list, jobs: dict) -> str:
    """Return a summary that says how many devices it leaves out."""
    missing = f"{len(jobs) - len(done)} of {len(jobs)} devices ended in an error and are not counted below.\n\n"
    return (missing if len(done) < len(jobs) else "") + (summarise(done) if done else "")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--scattered", type=int, default=0, help="devices of each robot whose parameters scatter")
    parser.add_argument("--robot", action="append", choices=list(KINDS), help="of these robots; default: all")
    parser.add_argument("--efforts", type=int, default=0, help="robots in motion, seen by their efforts")
    parser.add_argument("--elastic", type=int, default=0, help="arms in motion whose gears yield")
    parser.add_argument("--json", type=Path, metavar="DIR", help="write each --elastic trial as a file of its own")
    parser.add_argument("--markers", type=int, default=0, help="arms under their own weight, seen by markers")
    parser.add_argument("--uncalibrated", type=int, default=0, help="parallel robots of which everything is off")
    parser.add_argument("--tracked", type=int, default=0, help="arms whose poses are logged in motion")
    parser.add_argument("--friction", type=int, default=0, help="scattered devices with dry friction in a joint")
    parser.add_argument("--formulas", type=int, default=0, help="arms in motion with physics that is in no law")
    parser.add_argument("--nothing", type=int, default=0, help="... and so many more with nothing of the kind")
    parser.add_argument("--since", type=int, default=0, help="devices that are tested twice")
    parser.add_argument("--lives", type=int, default=0, help="devices that are tested ten times")
    parser.add_argument("--fleets", type=int, default=0, help="fleets of twenty devices")
    parser.add_argument("--loop", type=int, default=0, help="devices whose next experiment is carried out")
    parser.add_argument("--misread", type=int, default=0, help="logs that are written otherwise than they say")
    parser.add_argument("--today", action="store_true", help="what people do today, beside, on scattered devices")
    parser.add_argument("--first-seed", type=int, default=1000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("out/trials"))
    parser.add_argument("--docs", action="store_true", help="write the pages of docs/ on what was run")
    parser.add_argument("--export", type=Path, metavar="DIR", help="write scattered devices for another tool")
    parser.add_argument("--score", type=Path, metavar="DIR", help="score another tool's answers in an exported folder")
    options = parser.parse_args()
    robots = options.robot or list(KINDS)
    first = options.first_seed
    scattered = [(robot, first + index) for robot in robots for index in range(options.scattered)]
    drawn = {
        "efforts": (_efforts, _turns(MOVING, options.efforts, first)),
        "elastic": (_elastic, _turns(YIELDING, options.elastic, first)),
        "markers": (_markers, _turns(CAMERAS, options.markers, first)),
    }
    if options.export and any(devices for _, devices in drawn.values()):
        for name, (kind, devices) in drawn.items():
            if devices:
                kind.export(options.export / name, devices)
        return
    if options.export:
        devices = [(f"{robot}-{seed}", how(seed, robot)) for robot, seed in scattered]
        export(options.export, devices, {robot: robot_file(robot) for robot in robots})
        return
    if options.score:
        print(scored(read_answers(options.score)))
        return
    options.out.mkdir(parents=True, exist_ok=True)
    counts = {0: options.count, RARE_SEEDS: options.count // 10, WEAK_SEEDS: options.count // 10}
    counts[CLEAN_SEEDS] = options.count // 4
    jobs = {("", start + first + index): (trial, start + first + index)
            for start, count in counts.items() for index in range(count)}  # fmt: skip
    pages: dict[str, str] = {}

    def page(name, head, jobs, tell, summarise, asked, called="") -> list:
        """Run devices, print their summary and keep it as a page of docs/; return the results."""
        done = run(jobs, options.out / f"{called or name}.jsonl", options.workers, tell)
        text = counted(summarise, done, jobs)
        print("\n" + text)
        command = f"python scripts/concealed_trials.py {asked} --first-seed {first} --docs"
        pages[f"{name}_trials.md"] = head.format(command=command) + text
        return done

    if jobs:
        page("concealed", HEAD, jobs, told_plain, summary, f"--count {options.count}", "trials")
    if scattered:
        jobs = {(robot, seed): (scattered_trial, seed, robot, options.today) for robot, seed in scattered}
        asked = f"--count 0 --scattered {options.scattered}" + " --today" * options.today
        page("scattered", SCATTERED_HEAD, jobs, told, partial(scattered_summary, share=wilson), asked)
    for name, (kind, devices) in drawn.items():
        if devices:
            jobs = {(robot, seed): (kind.trial, seed, robot) for robot, seed in devices}
            if kind is _elastic:
                tell, summarise = _elastic.told, partial(_elastic.summary, share=wilson)
            else:
                tell = _motion.told
                summarise = partial(_motion.summary, share=wilson, before=kind.BEFORE, after=kind.AFTER)
            asked = f"--count 0 --{name} {len(devices)}"
            done = page(name.removesuffix("s"), kind.HEAD, jobs, tell, summarise, asked, name)
            if kind is _elastic and options.json:
                _elastic.dump(done, options.json)
    if options.uncalibrated:
        devices = _turns(_uncalibrated.KINDS, options.uncalibrated, first)
        jobs = {(robot, seed): (_uncalibrated.trial, seed, robot) for robot, seed in devices}
        summarise, asked = partial(_uncalibrated.summary, share=wilson), f"--count 0 --uncalibrated {len(devices)}"
        page("uncalibrated", _uncalibrated.HEAD, jobs, _uncalibrated.told, summarise, asked)
    if options.tracked:
        devices = _turns(_tracked.ROBOTS, options.tracked, first)
        jobs = {(robot, seed): (_tracked.trial, seed, robot) for robot, seed in devices}
        summarise, asked = partial(_tracked.summary, share=wilson), f"--count 0 --tracked {options.tracked}"
        page("tracked", _tracked.HEAD, jobs, _tracked.told, summarise, asked)
    if options.friction:
        devices = _turns([name for name in _friction.ROBOTS if name in robots], options.friction, first)
        jobs = {(robot, seed): (_friction.trial, seed, robot) for robot, seed in devices}
        asked = f"--count 0 --friction {options.friction}"

        def of_all(done: list[dict]) -> str:
            """Return the summary of these devices and of those that lie beside them in OUT."""
            lines = (options.out / "friction.jsonl").read_text().splitlines()
            beside = [item for item in map(json.loads, lines) if key_of(item) not in jobs]
            return _friction.summary(sorted([*beside, *done], key=key_of), share=wilson)

        asked += "".join(f" --robot {name}" for name in options.robot or ())
        page("friction", _friction.HEAD, jobs, _friction.told, of_all, asked)
    if options.since:
        devices = [(robot, first + index) for robot in options.robot or () for index in range(options.since)]
        devices = devices or _since.devices(options.since, first)
        jobs = {(robot, seed): (_since.trial, seed, robot) for robot, seed in devices}
        asked = f"--count 0 --since {options.since}" + "".join(f" --robot {name}" for name in options.robot or ())
        page("since", _since.HEAD, jobs, _since.told, partial(_since.summary, share=wilson), asked)
    if options.lives:
        devices = [(robot, first + index) for robot in options.robot or () for index in range(options.lives)]
        devices = devices or _life.devices(options.lives, first)
        jobs = {(robot, seed): (_life.trial, seed, robot) for robot, seed in devices}
        asked = f"--count 0 --lives {options.lives}" + "".join(f" --robot {name}" for name in options.robot or ())
        page("life", _life.HEAD, jobs, _life.told, partial(_life.summary, share=wilson), asked)
    if options.fleets:
        jobs = {(_fleet.ROBOT, first + k): (_fleet.trial, first + k, _fleet.ROBOT) for k in range(options.fleets)}
        asked = f"--count 0 --fleets {options.fleets}"
        page("fleet", _fleet.HEAD, jobs, _fleet.told, partial(_fleet.summary, share=wilson), asked)
    if options.formulas or options.nothing:
        jobs = {(robot, seed): (_formulas.trial, seed, robot, kind)
                for seed, robot, kind in _formulas.devices(options.formulas, first, options.nothing)}  # fmt: skip
        summarise = partial(_formulas.summary, share=wilson)
        asked = f"--count 0 --formulas {options.formulas} --nothing {options.nothing}"
        page("formula", _formulas.HEAD, jobs, _formulas.told, summarise, asked, "formulas")
    if options.loop:
        loops = [(kind, first + index) for kind in options.robot or [_loop.PLAIN] for index in range(options.loop)]
        jobs = {(kind, seed): (_loop.trial, seed, kind) for kind, seed in loops}
        asked = f"--count 0 --loop {options.loop}" + "".join(f" --robot {name}" for name in options.robot or ())
        page("loop", _loop.HEAD, jobs, _loop.told, partial(_loop.summary, share=wilson), asked)
    if options.misread:
        jobs, asked = _misread.jobs_of(options.misread, first), f"--count 0 --misread {options.misread}"
        page("misread", _misread.HEAD, jobs, _misread.told, partial(_misread.summary, share=wilson), asked)
    if options.docs:
        for name, text in pages.items():
            (ROOT / "docs" / name).write_text(text, encoding="utf-8")


def _turns(kinds, count: int, first: int) -> list[tuple[str, int]]:
    """Return `count` devices, each kind in its turn, with their seeds."""
    names = itertools.islice(itertools.cycle(kinds), count)
    return [(name, first + index // len(kinds)) for index, name in enumerate(names)]


def scored(answers: list[dict]) -> str:
    """Return the table of another tool's answers, robot by robot."""
    parts = []
    for robot in KINDS:
        mine = [item for item in answers if item["robot"] == robot]
        if mine:
            parts.append(f"### {robot}: {len(mine)} answers\n\n{table({'answers': mine}, wilson)}")
    return "\n".join(parts)


if __name__ == "__main__":
    main()
