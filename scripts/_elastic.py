"""Blind trials on arms whose gears yield and whose motors vibrate: drawn, sealed, diagnosed, and only then opened."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from _benchmark import ALWAYS_TRUE, LARGE, Kind, columns, confusion, grid, in_turn, listed, rate, spread
from _motion import exported, is_one_of, judged, places_of, tried

from tests.reference.concealed.elastic import KINDS, draw_elastic, left_by_joint, write

#: Words for efforts that come late or through a low-pass; true where the log has either.
LATE = ("effort_delay", "effort_filter")
#: True of every device here: its gears yield.
YIELDS = "joint_compliance"
#: Parameters of findings that a truth's `values` hold under the same physics.
COMPARABLE = {
    "coulomb_friction": "limit",
    "viscous_friction": "damping",
    "rotor_inertia": "inertia",
    "effort_offset": "offset",
    "effort_delay": "delay",
    "effort_filter": "time_constant",
    "effort_gain": "gain",
    "payload": "mass",
}
#: Parameters of dry friction that depends on load or warms up: its limit is not that of the plain law.
OTHER_LAWS = {"share_of_load", "cold"}


def written(seed: int, robot: str, out: Path, sealed: Path, name: str) -> None:
    """Draw a device and write its recordings and its answer."""
    write(draw_elastic(seed, robot), out, sealed, name)


def trial(seed: int, robot: str) -> dict[str, Any]:
    """Draw, seal, diagnose, predict the held-out recording, and only then open the answer."""
    answer, seconds, truth, true, predicted = tried(seed, robot, written)
    return marks(answer, truth) | left(true, predicted, truth) | {"seconds": seconds}


def marks(answer: Mapping[str, Any], truth: Mapping[str, Any]) -> dict[str, Any]:
    """Return what an answer got right of a truth."""
    found = [item for item in answer["findings"] if item["physics"] not in ALWAYS_TRUE]
    named = [item for item in found if item["physics"] != "unknown"]
    granted = [*truth["effects"], *(more for true in truth["effects"] for more in true["also"])]
    beside = (YIELDS, *(LATE if truth["late"] else ()))
    wrong = [item for item in named if item["physics"] not in beside and not is_one_of(item, granted)]
    unknown = len(named) < len(found) or answer.get("verdict") == "unexplained"
    group = truth["group"]
    return {
        "seed": truth["seed"],
        "robot": truth["robot"],
        "group": group,
        "declared": truth["declared"],
        "late": truth["late"],
        "device": truth["device"],
        "yielding": truth["yielding"],
        "verdict": answer.get("verdict", ""),
        "findings": [
            {key: item.get(key) for key in ("physics", "location", "candidates", "parameters", "heldout_gain")}
            for item in found
        ],
        "effects": [
            judged(true, found, [item for item in found if any(names(item, place) for place in true["places"])])
            for true in truth["effects"]
            if true["location"] != "robot" or group == "one"
        ],
        "off": _everywhere(truth, named) if truth["everywhere"] else [],
        "wrong": [f"{item['physics']} at {item['location']}" for item in wrong],
        "unknown": unknown,
        "accused": group == "faultless" and bool(wrong or unknown),
        "intervals": list(_intervals(truth, named)),
    }


def _everywhere(truth: Mapping[str, Any], named: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return for what is off at all joints, kind by kind and joint by joint, its strength and whether it was told.

    Masses are told by any finding of theirs: which link's they are, a motion seldom tells.
    """
    out = []
    for true in (true for true in truth["effects"] if true["location"] == "robot"):
        mine = [item for item in named if item["physics"] == true["physics"]]
        if true["physics"] == "inertial_parameters":
            out.append({"physics": true["physics"], "joint": "robot", "strength": true["size"], "told": bool(mine)})
            continue
        for joint, strength in zip(truth["joints"], true["strength"], strict=True):
            told = any(names(item, joint) for item in mine)
            out.append({"physics": true["physics"], "joint": joint, "strength": strength, "told": told})
    return out


def names(finding: Mapping[str, Any], place: str) -> bool:
    """Return whether a finding is at a place: of one at the robot, whether its parameters or its table list it.

    One at the robot whose parameters belong to no joint is at all its places.
    """
    if finding["location"] != "robot" or place == "robot":
        return place in places_of(finding)
    words = {word for key in ("parameters", "table", "by_joint") for word in _words(finding.get(key))}
    listed = {word.rpartition(".")[0] or word for word in words} | words
    candidates = set(finding.get("candidates") or ())
    return place in listed if listed & candidates or place in listed else place in candidates


def _words(value: Any) -> Iterator[str]:
    """Yield all keys and texts of nested tables."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        yield from value
        for inner in value.values():
            yield from _words(inner)
    elif isinstance(value, Sequence):
        for inner in value:
            yield from _words(inner)


def _intervals(truth: Mapping[str, Any], named: Sequence[Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    """Yield 95 % intervals of parameters whose truth is one number, and that number."""
    places_of_truth = {true["physics"]: set(true["places"]) for true in truth["effects"]}
    for item in named:
        values = truth["values"].get(item["physics"], {})
        if OTHER_LAWS & {name.rpartition(".")[2] for name in item.get("parameters") or ()}:
            continue
        for name, parameter in (item.get("parameters") or {}).items():
            joint, _, key = name.rpartition(".")
            if key != COMPARABLE.get(item["physics"]) or not isinstance(parameter, Mapping):
                continue
            where = joint or item["location"]
            if item["physics"] == "payload" and not joint and places_of(item) & places_of_truth.get("payload", set()):
                where = next(iter(values), where)  # by any name of the tool
            low, high = parameter.get("ci95") or (None, None)
            if where in values and low is not None and high is not None:
                yield {
                    "physics": item["physics"],
                    "place": where,
                    "true": values[where],
                    "value": parameter["value"],
                    "ci95": [low, high],
                    "inside": bool(low <= values[where] <= high),
                }


def left(true: Mapping[str, np.ndarray], predicted: Mapping[str, np.ndarray], truth: Mapping[str, Any]) -> dict:
    """Return what drawing and prediction leave of the held-out efforts: by joint, all joints, and their ratio.

    Each joint by the spread of its efforts; and by their noise, beside which efforts that no log shows count little.
    """
    joints = truth["joints"]
    q, tau = (np.column_stack([true[f"{key}.{name}"] for name in joints]) for key in ("q", "tau"))
    none = np.full(len(tau), np.nan)
    guess = np.column_stack([predicted.get(f"tau.{name}", none) for name in joints])
    after, before = left_by_joint(true["time"], q, tau, guess), np.array(truth["left_by_the_file"])
    after_noise = left_by_joint(true["time"], q, tau, guess, truth["noise"])
    whole_before, whole_after, noise_before, noise_after = (
        float(np.sqrt(np.mean(np.square(part)))) for part in (before, after, truth["left_by_noise"], after_noise)
    )
    return {
        "before": whole_before,
        "after": whole_after,
        "missed": whole_after / whole_before,
        "missed_by_noise": noise_after / noise_before,
        "by_joint": {"before": before.tolist(), "after": after.tolist()},
    }


def summary(trials: Sequence[Mapping[str, Any]]) -> str:
    """Return the tables of all robots as Markdown."""

    def devices(group: str, hit: Callable[[Mapping[str, Any]], Any]) -> Callable[[Sequence], str]:
        return rate(hit, lambda t: t["group"] == group)

    def single(key: str) -> Callable[[Sequence], str]:
        return rate(lambda e: e[key], lambda e: e["size"] >= LARGE,
                    lambda t: t["effects"] if t["group"] == "one" else ())  # fmt: skip

    def missed(group: str, key: str = "missed") -> Callable[[Sequence], str]:
        return lambda ts: spread(t[key] for t in ts if t["group"] == group)

    rows: list[tuple[str, Callable[[list], str]]] = [("devices", lambda ts: str(len(ts)))]
    rows += [("faultless: accused", devices("faultless", lambda t: t["accused"]))]
    rows += [("… `unknown` or unexplained", devices("faultless", lambda t: t["unknown"]))]
    for name, key in (("place right", "place"), ("… physics right", "named"), ("… both, in one finding", "right"),
                      ("… both, or told among what cannot be told apart", "among")):  # fmt: skip
        rows += [(f"one effect: {name}", single(key))]
    for group in ("one", "everywhere"):
        rows += [(f"{group}: something wrong named", devices(group, lambda t: t["wrong"]))]
        rows += [(f"{group}: `unknown` beside", devices(group, lambda t: t["unknown"]))]
    for kind in dict.fromkeys(item["physics"] for t in trials for item in t["off"]):
        strong = rate(lambda item: item["told"], lambda item, kind=kind: item["physics"] == kind and
                      item["strength"] >= LARGE, lambda t: t["off"])  # fmt: skip
        rows += [(f"everywhere, {LARGE:g} x noise or more: {kind} told", strong)]
    for kind in (None, *dict.fromkeys(item["physics"] for t in trials for item in t["intervals"])):
        held = rate(lambda item: item["inside"], lambda item, kind=kind: kind in (None, item["physics"]),
                    lambda t: t["intervals"])  # fmt: skip
        rows += [(f"95 % intervals that hold the truth{f', {kind}' if kind else ''}", held)]
    for group in ("faultless", "one", "everywhere"):
        for name, key in (("the drawing leaves", "before"), ("the prediction leaves", "after"), ("missed", "missed"),
                          ("missed, each joint by its noise", "missed_by_noise")):  # fmt: skip
            if group != "faultless" or not key.startswith("missed"):
                rows += [(f"held out, {group}: {name}, median (90th percentile)", missed(group, key))]
    rows += [("seconds a diagnosis, median (90th percentile)", lambda ts: spread(t["seconds"] for t in ts))]
    lines = [f"{len(trials)} devices, seeds from {min(t['seed'] for t in trials)} on, as first answered.", ""]
    lines += [*grid(columns(trials), rows), "", "What one effect was taken for:", ""]
    beside = {"everywhere": " beside all else"}
    lines += confusion((e["physics"] + beside.get(t["group"], ""), e) for t in trials for e in t["effects"])
    wrong = Counter(word.partition(" at ")[0] for t in trials for word in t["wrong"])
    if wrong:
        lines += ["", "Named though it is not there: " + ", ".join(f"{k} {n}" for k, n in wrong.most_common()) + "."]
    # what a log's features do to accusations and to what is missed
    features: list[tuple[str, Callable[[Mapping[str, Any]], bool]]] = [
        ("noise and tolerances declared", lambda t: t["declared"]),
        ("nothing declared", lambda t: not t["declared"]),
        ("motors shake by 2 rad/s² or more", lambda t: max(t["device"]["shake"]) >= 2),
        ("motors do not shake", lambda t: max(t["device"]["shake"]) == 0),
        ("yielding 0.1 x noise or more", lambda t: max(t["yielding"]) >= 0.1),
        ("yielding less", lambda t: max(t["yielding"]) < 0.1),
        ("efforts filtered", lambda t: t["device"]["order"] > 0),
        ("efforts not filtered", lambda t: t["device"]["order"] == 0),
        ("clock jitters", lambda t: t["device"]["jitter"] > 0),
        ("velocities logged", lambda t: t["device"]["velocity"] is not None),
        ("2^15 counts a turn or fewer", lambda t: (t["device"]["counts"] or np.inf) <= 2**15),
    ]
    answers = devices("faultless", lambda t: t["accused"]), missed("one"), missed("everywhere")
    having = ((name, [t for t in trials if has(t)]) for name, has in features)
    names = ("log", "devices", "faultless: accused", "missed, one, median", "missed, everywhere, median")
    lines += ["", *listed(names, ((name, len(mine), *(of(mine) for of in answers)) for name, mine in having)), ""]
    bad = [t for t in trials if not good(t)]
    if bad:
        lines += ["All devices that are not as they should be:", ""]
        lines += listed(("device", "truth", "verdict", "left"), (
            (f"{t['robot']} {t['seed']}", said(t)[0], f"{t['verdict']}: {said(t)[1]}",
             f"{t['before']:.3g} → {t['after']:.3g}") for t in bad))  # fmt: skip
    return "\n".join(lines) + "\n"


def good(trial: Mapping[str, Any]) -> bool:
    """Return whether nothing was missed, misplaced or made up, and nothing is unknown."""
    told = all(item["told"] for item in trial["off"] if item["strength"] >= LARGE)
    return told and all(e["right"] for e in trial["effects"]) and not (trial["wrong"] or trial["unknown"])


def said(trial: Mapping[str, Any]) -> tuple[str, str]:
    """Return truth and findings of a trial in words."""
    strong = [item for item in trial["off"] if item["strength"] >= LARGE]
    true = ["everything"] * (trial["group"] == "everywhere")
    true += [f"{e['physics']} at {e['location']} ({e['size']:.1f})" for e in trial["effects"]]
    if strong:
        true.append(f"{sum(item['told'] for item in strong)} of {len(strong)} told")
    named = Counter(f"{item['physics']} at {item['location']}" for item in trial["findings"])
    return "; ".join(true) or "faultless", "; ".join(named) or "nothing"


def told(trial: Mapping[str, Any]) -> str:
    """Return one line on a trial."""
    true, named = said(trial)
    change = f"{trial['before']:.3g} -> {trial['after']:.3g}  {trial['seconds']:.0f} s"
    return f"{'ok' if good(trial) else '--'} {trial['robot']} {trial['seed']}: {true} -> {named}  {change}"


KIND = Kind(
    "elastic", "arms in motion whose gears yield", "elastic", in_turn("elastic", KINDS), trial, told, summary,
    lambda folder, devices: exported(folder / "elastic", devices, written),
)  # fmt: skip
