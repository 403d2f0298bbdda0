"""Answers against truths: what a diagnosis named, what it left, and whether its intervals hold; and tables of that.

An answer is the document that `prup-pin diagnose` writes (diagnosis.json), by whatever tool: a list `findings`, and,
where the tool calibrates, a list `calibration`. Nothing here knows the package.
"""

from __future__ import annotations

import itertools
import json
import tempfile
from argparse import Namespace
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
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
#: A trial, as it is kept in OUT.
Result = Mapping[str, Any]

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


@dataclass(frozen=True)
class Kind:
    """A kind of trials: the option that asks for them, the page that tells them, and what is done for each.

    devices: by the options, (robot, seed) and what else trial(seed, robot, …) takes. summary: tables of all results as
    Markdown. export: writes devices into a folder. kept: OUT/kept.jsonl, where it is not called like the option;
    gathered: the page is of all results there.
    """

    name: str
    help: str
    page: str
    devices: Callable[[Namespace], list[tuple]]
    trial: Callable[..., dict[str, Any]]
    told: Callable[[Result], str]
    summary: Callable[[Sequence[Result]], str]
    export: Callable[[Path, Sequence[tuple[str, int]]], None] | None = None
    kept: str = ""
    gathered: bool = False


def in_turn(option: str, kinds: Iterable[str]) -> Callable[[Namespace], list[tuple]]:
    """Return what gives so many devices in all as an option says, each kind in its turn, with their seeds."""

    def devices(options: Namespace) -> list[tuple]:
        seeds: Counter[str] = Counter()
        found = []
        for name in itertools.islice(itertools.cycle(kinds), getattr(options, option)):
            found.append((name, options.first_seed + seeds[name]))
            seeds[name] += 1
        return found

    return devices


def of_each(option: str, kinds: Iterable[str]) -> Callable[[Namespace], list[tuple]]:
    """Return what gives so many devices of each robot that is asked for, else of each kind."""
    return lambda options: [
        (name, options.first_seed + index)
        for name in options.robot or kinds
        for index in range(getattr(options, option))
    ]


def of_each_or_in_turn(option: str, kinds: Sequence[str]) -> Callable[[Namespace], list[tuple]]:
    """Return what gives so many devices of each robot that is asked for, else so many in all, each kind in its turn."""
    return lambda options: (of_each if options.robot else in_turn)(option, kinds)(options)


@contextmanager
def sealed() -> Iterator[tuple[Path, Path]]:
    """Yield a folder for recordings and one for answers, for as long as a trial takes."""
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder) / "out", Path(folder) / "sealed"


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


def as_told(findings: Iterable[Any]) -> list[dict[str, Any]]:
    """Return what is kept of a diagnosis's findings."""
    return [
        {
            "physics": item.physics,
            "location": item.location,
            "candidates": list(item.candidates),
            "alternatives": list(item.alternatives),
            "parameters": {name: [v.value, *v.interval] for name, v in item.parameters.items()},
            "gain": item.heldout_gain,
            "statement": item.statement,
        }
        for item in findings
    ]


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


# -- tables ------------------------------------------------------------------------------------------------------------


def share(hits: int, total: int) -> str:
    """Return a share with its 95 % confidence interval."""
    if not total:
        return "-"
    p, z = hits / total, 1.96
    centre = (p + z * z / (2 * total)) / (1 + z * z / total)
    half = z * np.sqrt(p * (1 - p) / total + z * z / (4 * total**2)) / (1 + z * z / total)
    return f"{100 * p:.1f} % ({hits}/{total}; {100 * max(centre - half, 0):.1f}-{100 * min(centre + half, 1):.1f} %)"


def rate(
    hit: Callable[[Any], bool | None],
    of: Callable[[Any], Any] = lambda trial: True,
    each: Callable[[Result], Iterable[Any]] = lambda trial: (trial,),
) -> Callable[[Sequence[Result]], str]:
    """Return what writes the share of trials, or of what stands in `each` of them, that are hit; None counts nowhere.

    of: those that are asked.
    """

    def answer(trials: Sequence[Result]) -> str:
        known = [bool(x) for x in (hit(item) for t in trials for item in each(t) if of(item)) if x is not None]
        return share(sum(known), len(known))

    return answer


def spread(values: Iterable[float], form: str = ".3g", most: bool = False) -> str:
    """Return the median and in brackets what nine of ten stay below, or the largest."""
    finite = [value for value in values if np.isfinite(value)]
    top = (max if most else lambda known: np.quantile(known, 0.9))(finite) if finite else 0.0
    return f"{np.median(finite):{form}} ({top:{form}})" if finite else "-"


def columns(trials: Sequence[Result], robots: Iterable[str] = ()) -> dict[str, list[Result]]:
    """Return trials by the columns of a table: all of them, and those of each robot that has some, in that order."""
    names = list(robots) or dict.fromkeys(t["robot"] for t in trials)
    return filled({"all": list(trials)} | {name: [t for t in trials if t["robot"] == name] for name in names})


def filled(groups: Mapping[str, list[Result]]) -> dict[str, list[Result]]:
    """Return the groups that are not empty."""
    return {name: mine for name, mine in groups.items() if mine}


def listed(names: Iterable[str], rows: Iterable[Iterable[object]]) -> list[str]:
    """Return the lines of a Markdown table."""
    head = list(names)
    return [_row(head), "|---" * len(head) + "|", *map(_row, rows)]


def _row(cells: Iterable[object]) -> str:
    return f"| {' | '.join(map(str, cells))} |"


def grid(groups: Mapping[str, Any], rows: Iterable[tuple[str, Callable[[Any], str]]]) -> list[str]:
    """Return the lines of a table: questions down, groups of trials across."""
    return listed(("question", *groups), ((name, *map(answer, groups.values())) for name, answer in rows))


def confusion(effects: Iterable[tuple[str, Mapping[str, Any]]]) -> list[str]:
    """Return the lines of a table that says what effects, by a name, were taken for."""
    told, placed = defaultdict(Counter), Counter()
    for name, effect in effects:
        told[name][effect["told"]] += 1
        placed[name] += effect["place"]
    taken = {name: ", ".join(f"{word} {count}" for word, count in words.most_common()) for name, words in told.items()}
    rows = ((name, told[name].total(), placed[name], taken[name]) for name in sorted(told))
    return listed(("truth", "devices", "place right", "taken for"), rows)


def by_size(what: str, bounds: Sequence[float], trials: Sequence[Result], size: str) -> list[str]:
    """Return the lines of a table of single effects by their size: something found, and found right."""
    rows = []
    for low, high in itertools.pairwise((*bounds, np.inf)):
        mine = [t for t in trials if low <= t["effects"][0][size] < high]
        if mine:
            right = sum(t["effects"][0]["right"] for t in mine)
            top = f"{high:g}" if np.isfinite(high) else "more"
            rows.append((f"{low:g}-{top}", len(mine), sum(bool(t["findings"]) for t in mine), right))
    return listed((f"{what} [noise]", "devices", "something found", "place and physics right"), rows)


def at_places(items: Iterable[Mapping[str, Any]], size: str = "", otherwise: str = "") -> str:
    """Return 'physics at location' of effects or findings, with a size in brackets."""
    said = (f"{x['physics']} at {x['location']}" + (f" ({x[size]:.1f})" if size else "") for x in items)
    return "; ".join(said) or otherwise


def table(answers: Mapping[str, Sequence[Result]]) -> str:
    """Return one Markdown table: questions down, tools across."""

    def effects(kind: str, key: str, size: str = "size") -> Callable[[Sequence[Result]], str]:
        return rate(lambda e: e[key], lambda e: e[size] >= 0.95 * LARGE,
                    lambda t: t["effects"] if t["group"] == kind else ())  # fmt: skip

    def trials(kind: str, hit: Callable[[Result], bool]) -> Callable[[Sequence[Result]], str]:
        return rate(hit, lambda t: t["group"] == kind)

    rows = [
        ("scatter alone: something found", trials("clean", lambda t: bool(t["findings"]))),
        ("one effect of 3 x (noise and tolerance) or more: place right", effects("one", "place")),
        ("… physics right", effects("one", "named")),
        ("… physics right, or named among those that the data cannot tell apart", effects("one", "among")),
        ("… both, in one finding", effects("one", "right")),
        ("… and nothing named elsewhere", effects("one", "alone")),
        ("of which scatter cannot imitate 3 x noise or more: place right", effects("one", "place", "left")),
        ("… physics right", effects("one", "named", "left")),
        (
            "outside the library: a law named",
            trials("outside", lambda t: any(item["physics"] != "unknown" for item in t["findings"])),
        ),
        (
            "tolerances misjudged by two, scatter alone: found what is within three of them",
            trials("misjudged clean", lambda t: bool(t["false"])),
        ),
        ("… one effect: place right", effects("misjudged one", "place")),
        (
            "95 % intervals of calibrated parameters that hold the truth",
            rate(lambda hit: hit, each=lambda t: t["inside"]),
        ),
    ]
    rows += [
        (
            f"held out, {text}: median (90th percentile) [noise]",
            lambda ts, kind=kind: spread((t["after"] for t in ts if t["group"] == kind), ".2f"),
        )
        for kind, text in (("clean", "scatter alone"), ("one", "one effect"), ("outside", "outside the library"))
    ]
    rows += [("things named a device, mean", lambda ts: f"{np.mean([len(t['findings']) for t in ts]):.1f}")]
    return "\n".join(grid(answers, rows)) + "\n"
