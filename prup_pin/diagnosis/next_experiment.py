"""Which poses and loads would best separate what these data leave together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..channels import PoseChannel, Stack
from ..errors import PrupPinError
from ..laws import Inputs
from ..mechanism import Frame
from ..numbers import number
from ..robot import Robot
from ..simulation import Run, Simulator
from ..spatial import WRENCH_NAMES, Array
from .compete import Selection
from .criteria import (
    CERTAIN,
    INDISTINCT,
    LEAST_FORCE,
    LEAST_MOMENT,
    LEAST_WIDER,
    MOST_PAIRS,
    PLANNED_POSES,
    WEIGHED_LOADS,
    WEIGHED_POSES,
    WIDER,
    WORTH_SEPARATING,
)
from .fit import Fit, Problem, Term
from .influence import Influence

__all__ = ["next_experiment"]

#: Shares of a planned load, one sample each.
CYCLE = (0, 0.5, 1, 0.5, 0, -0.5, -1, -0.5, 0)
#: What decides between poses where every pair has enough.
_LITTLE = 1e-6
#: Pairs that the reason lists.
MOST_LISTED = 3


def next_experiment(robot: Robot, problem: Problem, selection: Selection, findings) -> dict[str, Any]:
    """Return a test plan whose samples differ most between the explanations that are left, with the reason.

    Where explanations were compared, `separates` and `cannot_separate` list them in pairs; the latter also parts of the
    robot to which one and the same effect can be ascribed.
    """
    proposed = _proposed(robot, problem, selection)
    same = [
        {"one": _named(term), "other": {**_named(term), "location": place}, "times_noise": 0.0}
        for term in selection.last.terms
        for place in term.candidate.law.same_places(term.candidate.place, robot.mechanism)
        if place != term.candidate.place.name
    ]
    return {**proposed, "cannot_separate": [*proposed.get("cannot_separate", ()), *same]} if same else proposed


def _proposed(robot: Robot, problem: Problem, selection: Selection) -> dict[str, Any]:
    pairs = _pairs(selection)
    plan: dict[str, Any] = {"robot": robot.name}
    inputs = problem.simulator.inputs
    finite = np.isfinite(inputs.actuators).all(axis=1)
    if not finite.any():
        return {"why": "no complete sample", "plan": {}}
    generator = np.random.default_rng(1)
    low, high = inputs.actuators[finite].min(axis=0), inputs.actuators[finite].max(axis=0)
    wide = np.maximum(WIDER * (high - low), LEAST_WIDER)
    positions = list(_reachable(robot, low - wide, high + wide, generator))
    force = max(float(np.nanmax(np.linalg.norm(inputs.wrench[:, :3], axis=1), initial=0.0)), LEAST_FORCE)
    moment = max(float(np.nanmax(np.linalg.norm(inputs.wrench[:, 3:], axis=1), initial=0.0)), LEAST_MOMENT)
    loads = _unit_loads(generator) * np.array(3 * [force] + 3 * [moment])
    if not positions:
        return {"why": "no pose near the recorded ones is reachable", "plan": {}}
    count = len(positions) * len(loads)
    # the base stays as it stood last
    gravity = None if inputs.gravity is None else inputs.gravity[np.isfinite(inputs.gravity).all(axis=1)][-1]
    trial = _inputs(positions, [loads] * len(positions), gravity)
    simulator = Simulator(robot, trial)
    usable = [term for pair in pairs for term in pair if set(term.candidate.law.needs) <= {"gravity"}]
    told: dict[str, list[dict[str, Any]]] = {}
    why = "the largest deflections, where anything left out shows most"
    run = simulator.run()
    seen = [channel for channel in problem.stack.poses if channel.exists.any()] or problem.stack.poses[:1]
    influence = Influence(simulator, run, Stack(tuple(PoseChannel.nothing(channel.frame, count) for channel in seen)))
    noise = influence.stack.deviation(problem.noise)
    unmeasured = np.concatenate([channel.exists.any() & ~channel.exists.any(axis=0) for channel in seen])
    noise[unmeasured] = np.inf
    separates = bool(pairs) and len(usable) == 2 * len(pairs)
    if separates:
        changes = [[influence.change(simulator.setup([term.effect])) for term in pair] for pair in pairs]
        differences = [one - other for one, other in changes]
    else:
        differences = [(influence.compliance @ trial.wrench[run.samples][..., None])[..., 0]]
    value = np.zeros((len(differences), count))
    value[:, run.samples] = [((difference / noise) ** 2).sum(axis=1) for difference in differences]
    picked = _picked(value.reshape(-1, len(positions), len(loads)), CERTAIN if separates else np.inf)
    chosen = [(positions[pose], loads[load]) for pose, load in picked]
    if separates:
        planned = _inputs([at for at, _ in chosen], [np.outer(CYCLE, load) for _, load in chosen], gravity)
        frames = [channel.frame for channel in seen]
        why, told = _told_apart(Simulator(robot, planned), problem, selection.last, pairs, noise, frames)
        if not told["separates"]:
            return {"why": why, "plan": {}, **told}
    names = robot.mechanism.actuated
    plan["poses"] = [
        {"actuators": {name: round(float(q), 6) for name, q in zip(names, at, strict=True)}} for at, _ in chosen
    ]
    plan["loads"] = [
        {
            "cycle": [*CYCLE],
            "wrench": {n: round(float(x), 4) for n, x in zip(WRENCH_NAMES, load, strict=True)},
            "poses": [place],
        }
        for place, (_, load) in enumerate(chosen)
    ]
    if markers := [channel.frame.name for channel in seen if channel is not problem.stack.poses[0]]:
        plan["markers"] = markers
    if gravity is not None:
        plan["gravity"] = gravity.tolist()
    return {"why": why, "plan": plan, **told}


def _picked(value: Array, enough: float) -> list[tuple[int, int]]:
    """Return places (pose, load) of a plan by what a full load there is worth to each pair, (pairs, poses, loads).

    One after the other, each where it adds most: more than `enough` for a pair is worth nothing, so that every pair
    gets its pose before one is told apart twice over.
    """
    value = np.nan_to_num(value) * float(np.square(CYCLE).sum())
    have = np.zeros((len(value), 1, 1))
    picked: list[tuple[int, int]] = []
    for _ in range(min(PLANNED_POSES, value.shape[1])):
        gain = (np.minimum(have + value, enough) - np.minimum(have, enough)).sum(axis=0)
        gain += _LITTLE * value.sum(axis=0)
        gain[[pose for pose, _ in picked]] = -np.inf
        pose, load = (int(place) for place in np.unravel_index(np.argmax(gain), gain.shape))
        picked.append((pose, load))
        have += value[:, pose, load, None, None]
    return picked


def _inputs(positions: Sequence[Array], loads: Sequence[Array], gravity: Array | None) -> Inputs:
    """Return the inputs of poses by their actuators' positions (a,), under loads (l, 6) in each of them."""
    count, each = len(positions) * len(loads[0]), len(loads[0])
    return Inputs(
        time=np.arange(count, dtype=float),
        actuators=np.repeat(np.array(positions), each, axis=0),
        wrench=np.concatenate(loads),
        blocks=np.repeat(np.arange(len(positions)), each),
        gravity=None if gravity is None else np.tile(gravity, (count, 1)),
    )


def _told_apart(
    simulator: Simulator,
    problem: Problem,
    fit: Fit,
    pairs: Sequence[tuple[Term, Term]],
    noise: Array,
    frames: Sequence[Frame],
) -> tuple[str, dict[str, list[dict[str, Any]]]]:
    """Return what a plan would tell apart, in words and pair by pair: it is simulated.

    noise (K,) of the columns that `frames` are measured in.
    """
    known: dict[tuple[int, int], Run] = {}
    base = [] if problem.tolerances is None else problem.tolerances.at(fit.x)

    def run(term: Term, instead_of: Term) -> Run:
        """Return the simulated plan with a term in another one's place."""
        key = id(term), id(instead_of)
        if key not in known:
            kept = [other.effect for other in fit.terms if other is not instead_of]
            known[key] = simulator.run([*base, *kept, term.effect])
        return known[key]

    apart: list[str] = []
    alike: list[str] = []
    told: dict[str, list[dict[str, Any]]] = {"separates": [], "cannot_separate": []}
    for one, other in pairs:
        rival = run(other, one)
        measured = Stack(tuple(PoseChannel.of_run(rival, frame) for frame in frames))
        difference = measured.residual(run(one, one)) / noise
        size = float((difference**2).sum())
        text = f"{_words(one)} against {_words(other)}"
        largest = float(np.sqrt((difference**2).sum(axis=1).max()))
        pair = {"one": _named(one), "other": _named(other), "times_noise": largest}
        if size < INDISTINCT:
            told["cannot_separate"].append(pair)
            alike.append(text)
        else:
            told["separates"].append(pair)
            apart.append(f"{text} (by {number(largest, 2)} times the noise)")
    same = f"no pose and load within reach tells apart: {'; '.join(alike[:MOST_LISTED])}"
    if not apart:
        return same, told
    return f"separates {'; '.join(apart[:MOST_LISTED])}" + (f". But {same}" if alike else ""), told


def _named(term: Term) -> dict[str, str]:
    return {"physics": term.candidate.law.physics, "location": term.candidate.place.name}


def _words(term: Term) -> str:
    """Return 'stiffness changed at leg3/drive'; the place keeps its own name."""
    physics, at, place = term.candidate.name.partition(" at ")
    return f"{physics.replace('_', ' ')}{at}{place}"


def _pairs(selection: Selection) -> list[tuple[Term, Term]]:
    """Return pairs of terms (ours, rival) that the data leave together."""
    pairs = []
    for term, rivals in zip(selection.last.terms, selection.rivals, strict=True):
        for rival in rivals:
            other = rival.term
            if _holds(other, term) or other is term or rival.chi2 - selection.last.chi2 > WORTH_SEPARATING * INDISTINCT:
                continue
            pairs.append((term, other))
    return pairs[:MOST_PAIRS]


def _holds(whole: Term, part: Term) -> bool:
    """Return True for a law at several places, each with its own value, one of which is the other law's: no rival."""
    one, other = whole.candidate, part.candidate
    alike = one.law.physics == other.law.physics and one.size > other.size
    return alike and other.place.name in one.law.same_places(one.place, one.mechanism)


def _reachable(robot: Robot, low, high, generator):
    found = 0
    for _ in range(10 * WEIGHED_POSES):
        values = generator.uniform(low, high)
        try:
            robot.pose_from_actuators(values)
        except PrupPinError:
            continue
        found += 1
        yield values
        if found == WEIGHED_POSES:
            return


def _unit_loads(generator) -> np.ndarray:
    axes = np.eye(6)
    mixed = generator.normal(size=(WEIGHED_LOADS, 6))
    mixed[:, :3] /= np.linalg.norm(mixed[:, :3], axis=1, keepdims=True)
    mixed[:, 3:] /= np.linalg.norm(mixed[:, 3:], axis=1, keepdims=True)
    return np.concatenate((axes, mixed))
