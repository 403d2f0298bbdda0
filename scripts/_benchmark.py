"""Answers against truths: what a diagnosis named, what it left, and whether its intervals hold.

An answer is the document that `prup-pin diagnose` writes (diagnosis.json), by whatever tool: a list `findings`, and,
where the tool calibrates, a list `calibration`. Nothing here knows the package.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tests.reference.concealed.rotations import matrix, vector
from tests.reference.concealed.scattered import draw_scattered, write

#: True of every device: reporting them is never wrong.
ALWAYS_TRUE = ("finite_deflection", "self_weight")
#: Bodies that a robot file's tree joins to one: their factors are not told apart.
JOINED = ("hub.mass", "star_1.mass", "star_2.mass", "star_3.mass")
#: Size from which an effect has to be found.
LARGE = 3.0
Answer = Mapping[str, Any]

README = """# Concealed devices: a benchmark for diagnosis within tolerances

Robots of which every part is a little off, as on any real one, and on some of which one thing more is wrong: a gap, a
soft bearing, a sensor that is turned. What is it, and where?

- `robots/`: the nominal robots as URDF files with one extension element (`<prup_pin>`: loops, actuated joints, tool,
  stiffnesses). `3prup.urdf` has three legs of a ball screw, a bent rod, three bearings and a bent branch each;
  `six_ups.urdf` six sprung drives; `elastic_arm.urdf` six sprung joints. Gravity acts on all of them.
- `recordings/NAME.csv`: a bench test. `time` [s]; `q.<joint>` [m, rad] as the encoders report it; `w.fx … w.mz`
  [N, N m] the wrench on the tool point in the base frame, as its sensor reports it; `p.x p.y p.z` [m] and
  `r.x r.y r.z` [rad] the tool's position and rotation vector, as the pose sensor reports them; sometimes `temperature`
  [°C], 20 is neutral.
- `recordings/NAME.json`: the robot, the sensors' noise (one standard deviation, white) and the tolerances, one standard
  deviation of each member of a kind: `stiffness`, `bending` (EI), `mass` relative; `position` [m] of joints and base
  points, each direction; `direction` [rad] of axes, about both axes across; `encoder_offset`, `encoder_slope`;
  `frame_*`: the pose sensor's frame against the base; `target_*`: its target against the tool; `wrench_gain`,
  `wrench_rotation`. Where the answer says `misjudged`, each is declared half or twice as wide as it is.
- `recordings/NAME.heldout.csv`: another bench test of the same device, to judge predictions.
- `sealed/NAME.truth.json`: the answer. `effects`: physics, location (`places`: all its names), parameters, and `size`:
  RMS of what is left of the effect by channel after the best fit of all parameters within tolerance, in multiples of
  the noise, or half the length of that fit in tolerances, the larger of both. `scatter`: by how much each parameter is
  off, relative for stiffness, bending, mass, gain and slope, else m or rad.

Conventions of the scatter: a joint is shifted along the axes of the part before it and turned by exp(r) about its own;
true position = reported + offset + slope x reported; true wrench = exp(r) ((1 + gain) x reported), force and moment
alike; the pose sensor reports T exp(t) of the body and exp(f) T + s: position f (p + R d) + s, rotation f R t.

A tool answers with `answers/NAME/diagnosis.json`:

```
{"findings": [{"physics": "backlash", "location": "leg1/ball_nut", "candidates": ["leg1/ball_nut", …],
               "alternatives": ["hertzian_contact at leg1/ball_nut", …], "heldout_gain": 0.4}],
 "calibration": [{"parameter": "leg1/R_lambda.tilting_stiffness", "nominal": 6268.45, "value": 6713.2, "sd": 41.0}]}
```

strongest finding first, `candidates` and `alternatives` being what the data cannot tell apart; `calibration` and
`alternatives` may be left out. With
`answers/NAME/heldout.csv` (`time`, `p.x` … `r.z` for the rows of the held-out recording) it is also judged by what it
leaves there. `unknown` is the physics of what no law describes. `{command} --score {folder}` prints the table.
"""


def marks(answer: Answer, truth: Mapping[str, Any]) -> dict[str, Any]:
    """Return what an answer got right of a truth."""
    found = [item for item in answer["findings"] if item["physics"] not in ALWAYS_TRUE]
    effects = []
    for true in truth["effects"]:
        placed = [item for item in found if named_places(item) & set(true["places"])]
        right = [item for item in placed if item["physics"] == true["physics"]]
        named = any(item["physics"] == true["physics"] for item in found)
        others = {text.partition(" at ")[0] for item in found for text in item.get("alternatives") or ()}
        told = max(found, key=lambda item: item.get("heldout_gain") or 0.0)["physics"] if found else "nothing"
        effects.append(
            {
                "physics": true["physics"],
                "location": true["location"],
                "size": true["size"],
                "left": max(true["strength"]),
                "place": bool(placed),
                "named": named,
                "among": named or true["physics"] in others,
                "right": bool(right),
                "alone": bool(right) and all(named_places(item) & set(true["places"]) for item in found),
                "told": right[0]["physics"] if right else told,
            }
        )
    return {
        "verdict": answer.get("verdict", ""),
        "findings": [{key: item.get(key) for key in ("physics", "location", "candidates")} for item in found],
        "effects": effects,
        "false": [item["physics"] for item in found if not named_places(item) & set(truth["beyond"])],
        "inside": [] if truth["effects"] or truth["misjudged"] else held(answer, truth["scatter"]),
    }


def by_robot(trials: Sequence[Mapping[str, Any]], robots: Iterable[str]) -> dict[str, list[Mapping[str, Any]]]:
    """Return trials by the columns of a table: all of them, and those of each robot that has some."""
    groups = {"all": list(trials)} | {name: [t for t in trials if t["robot"] == name] for name in robots}
    return {name: mine for name, mine in groups.items() if mine}


def named_places(finding: Mapping[str, Any]) -> set[str]:
    """Return the places of a finding, without what is said of them in brackets."""
    told = [finding["location"], *finding.get("candidates", ())]
    return {name.partition(" (")[0] for name in told}


def held(answer: Answer, scatter: Mapping[str, float]) -> list[bool]:
    """Return for each calibrated parameter whether its 95 % interval holds the truth."""
    out = []
    for item in answer.get("calibration") or ():
        name = item["parameter"]
        if name in scatter and name not in JOINED:
            nominal = item["nominal"]
            true = nominal * (1 + scatter[name]) if nominal else scatter[name]
            out.append(bool(abs(item["value"] - true) <= 1.96 * item["sd"]))
    return out


def left_over(measured: Mapping[str, np.ndarray], predicted: Mapping[str, np.ndarray], noise) -> float:
    """Return the RMS of measured less predicted poses (p, r), in multiples of the noise."""
    moved = (measured["p"] - predicted["p"]) / noise["position"]
    turned = vector(matrix(measured["r"]) @ matrix(predicted["r"]).swapaxes(-1, -2)) / noise["rotation"]
    return float(np.sqrt(np.nanmean(np.hstack([moved, turned]) ** 2)))


def export(folder: Path, devices: Sequence[tuple[str, Mapping[str, Any]]], robots: Mapping[str, Path]) -> None:
    """Write recordings, sealed answers, robots and the format's description; devices by name, how each is drawn."""
    for name, text in ((f"{robot}.urdf", path.read_text(encoding="utf-8")) for robot, path in robots.items()):
        place = folder / "robots" / name
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(text, encoding="utf-8")
    for name, how in devices:
        drawn = draw_scattered(**how)
        write(drawn, folder / "recordings", folder / "sealed", name, f"../robots/{how['robot']}.urdf")
        print(f"{name} written", flush=True)
    text = README.replace("{command}", "python scripts/concealed_trials.py").replace("{folder}", "DIR")
    (folder / "README.md").write_text(text, encoding="utf-8")


def read_answers(folder: Path) -> list[dict[str, Any]]:
    """Return the marks of all answers in an exported folder; a device without answer has none and is told."""
    out = []
    for sealed in sorted((folder / "sealed").glob("*.truth.json")):
        name = sealed.name.removesuffix(".truth.json")
        given = folder / "answers" / name / "diagnosis.json"
        if not given.exists():
            print(f"{name}: no answer")
            continue
        truth = json.loads(sealed.read_text(encoding="utf-8"))
        result = marks(json.loads(given.read_text(encoding="utf-8")), truth)
        predicted = given.parent / "heldout.csv"
        after = float("nan")
        if predicted.exists():
            about = json.loads((folder / "recordings" / f"{name}.json").read_text(encoding="utf-8"))
            noise = {key: about[f"{key}_noise"] for key in ("position", "rotation")}
            after = left_over(read_poses(folder / "recordings" / f"{name}.heldout.csv"), read_poses(predicted), noise)
        out.append({"name": name, "robot": truth["robot"], "group": group(truth), "after": after} | result)
    return out


def group(truth: Mapping[str, Any]) -> str:
    """Return which kind of device an answer describes."""
    kind = "clean"
    if truth["effects"]:
        kind = "outside" if truth["effects"][0]["physics"] == "unknown" else "one"
    return f"misjudged {kind}" if truth["misjudged"] else kind


def read_poses(path: Path) -> dict[str, np.ndarray]:
    """Return p (N, 3) and r (N, 3) of a table."""
    with path.open(encoding="utf-8") as file:
        head = file.readline().strip().split(",")
    values = np.genfromtxt(path, delimiter=",", skip_header=1)
    return {key: values[:, [head.index(f"{key}.{axis}") for axis in "xyz"]] for key in ("p", "r")}


def table(answers: Mapping[str, Sequence[Mapping[str, Any]]], share) -> str:
    """Return one Markdown table: questions down, tools across. `share(hits, total)` writes a share."""
    rows: list[tuple[str, Any]] = [
        ("scatter alone: something found", lambda t: _count(t, "clean", lambda x: bool(x["findings"]))),
        ("one effect of 3 x (noise and tolerance) or more: place right", lambda t: _effects(t, "one", "place")),
        ("… physics right", lambda t: _effects(t, "one", "named")),
        (
            "… physics right, or named among those that the data cannot tell apart",
            lambda t: _effects(t, "one", "among"),
        ),
        ("… both, in one finding", lambda t: _effects(t, "one", "right")),
        ("… and nothing named elsewhere", lambda t: _effects(t, "one", "alone")),
        (
            "of which scatter cannot imitate 3 x noise or more: place right",
            lambda t: _effects(t, "one", "place", "left"),
        ),
        ("… physics right", lambda t: _effects(t, "one", "named", "left")),
        ("outside the library: a law named", lambda t: _count(t, "outside", _a_law)),
        (
            "tolerances misjudged by two, scatter alone: found what is within three of them",
            lambda t: _count(t, "misjudged clean", lambda x: bool(x["false"])),
        ),
        ("… one effect: place right", lambda t: _effects(t, "misjudged one", "place")),
        ("95 % intervals of calibrated parameters that hold the truth", lambda t: _inside(t)),
    ]
    lines = ["| question | " + " | ".join(answers) + " |", "|---" * (1 + len(answers)) + "|"]
    lines += [f"| {name} | " + " | ".join(share(*rate(trials)) for trials in answers.values()) + " |"
              for name, rate in rows]  # fmt: skip
    for kind, text in (("clean", "scatter alone"), ("one", "one effect"), ("outside", "outside the library")):
        left = [[t["after"] for t in trials if t["group"] == kind] for trials in answers.values()]
        lines.append(f"| held out, {text}: median (90th percentile) [noise] | " + " | ".join(map(_spread, left)) + " |")
    counts = [np.mean([len(t["findings"]) for t in trials]) if trials else np.nan for trials in answers.values()]
    lines.append("| things named a device, mean | " + " | ".join(f"{count:.1f}" for count in counts) + " |")
    return "\n".join(lines) + "\n"


def _spread(values: Sequence[float]) -> str:
    finite = [value for value in values if np.isfinite(value)]
    return f"{np.median(finite):.2f} ({np.quantile(finite, 0.9):.2f})" if finite else "-"


def _a_law(trial: Mapping[str, Any]) -> bool:
    return any(item["physics"] != "unknown" for item in trial["findings"])


def _count(trials, kind: str, hit) -> tuple[int, int]:
    chosen = [t for t in trials if t["group"] == kind]
    return sum(map(hit, chosen)), len(chosen)


def _effects(trials, kind: str, key: str, size: str = "size") -> tuple[int, int]:
    chosen = [e for t in trials if t["group"] == kind for e in t["effects"] if e[size] >= 0.95 * LARGE]
    return sum(e[key] for e in chosen), len(chosen)


def _inside(trials) -> tuple[int, int]:
    hits = [hit for t in trials for hit in t["inside"]]
    return sum(hits), len(hits)


__all__ = ["export", "group", "left_over", "marks", "read_answers", "table"]
