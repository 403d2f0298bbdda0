"""Which poses and loads would best separate what these data leave together."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from ..numbers import counted, number, quantity
from ..spatial import WRENCH_NAMES, Array
from .criteria import (
    CERTAIN,
    DEEPER_CANDIDATES,
    DEEPER_SEARCHES,
    INDISTINCT,
    LITTLE,
    MOST_LISTED,
    MOST_PAIRS,
    MOST_PLANNED_POSES,
    MOST_REPEATED,
    MUCH,
    NOTHING,
    PARAMETER_COST,
    PLANNED_POSES,
    SETTLED,
    TURNED,
    WEIGHED_LOADS,
    WEIGHED_POSES,
)
from .diagnosis import Finding
from .identify import Bench, Pair, SimulatedTest, information, separation
from .problem import Problem, Term
from .search import Selection, other_explanations

#: Shares of a planned load, one sample each.
CYCLE = (0.0, 0.5, 1.0, 0.5, 0.0, -0.5, -1.0, -0.5, 0.0)
#: ... by which loads are weighed where something remembers what was before.
_SHORT_CYCLE = (0.0, 1.0, 0.0, -1.0)
#: Of what these laws need the plan can see to.
_SEEN_TO = {"gravity", "temperature", "wrench"}


def next_experiment(
    problem: Problem, selection: Selection, unknown: Finding | None, laws: Sequence[Finding] = ()
) -> dict[str, Any]:
    """Return a test plan whose samples differ most between the explanations that are left, with the reason.

    laws: findings of what was found beside what is unknown: other terms are nobody's, and not worth a test.
    Where what is unknown depends on the side from which a joint came, one that comes from both.
    Where explanations were compared, `separates` and `cannot_separate` list them in pairs; the latter also parts of the
    robot to which one and the same effect can be ascribed. `weighed` says how many poses under how many loads were.
    """
    own = [(item.effect.law, item.effect.place) for item in laws if item.effect is not None]
    named = [
        term for term in selection.last.terms if unknown is None or (term.candidate.law, term.candidate.place) in own
    ]
    proposed = _proposed(problem, selection, unknown, named)
    same = [
        {"one": _named(term), "other": {**_named(term), "location": place}, "times_noise": 0.0}
        for term in named
        for place in term.candidate.law.same_places(term.candidate.place, problem.simulator.robot.mechanism)
        if place != term.candidate.place.name
    ]
    return {**proposed, "cannot_separate": [*proposed.get("cannot_separate", ()), *same]} if same else proposed


def _proposed(problem: Problem, selection: Selection, unknown: Finding | None, named: Sequence[Term]) -> dict[str, Any]:
    bench = Bench.of(problem)
    if bench is None:
        return {"why": "no complete sample", "plan": {}}
    joint = "" if unknown is None else unknown.approached
    left = [pair for pair in _indistinct_pairs(problem, selection) if any(pair.term is term for term in named)]
    pairs = [pair for pair in left if pair.needs <= _SEEN_TO][:MOST_PAIRS]
    search = _Design(bench, problem, selection, pairs)
    if not search.begun:
        return {"why": "no pose near the recorded ones is reachable", "plan": {}}
    if joint and (chosen := search.from_both_sides(joint)):
        why = (
            f"each posture, {joint} coming from below and from above, at rest and under load: half of the difference "
            "is what depends on the side"
        )
        return {"why": why, "plan": _plan(search, chosen, CYCLE)}
    if not pairs:
        at = "" if unknown is None or unknown.location == "robot" else f" at {unknown.location}"
        what = "anything left out" if unknown is None else f"what is unknown{at}"
        why = f"the largest deflections, where {what} shows most"
        if left:
            why += "; explanations that are left differ in motion, which no test plan describes"
        return {"why": why, "plan": _plan(search, search.largest(), CYCLE)}
    chosen, repeated = search.planned()
    told = _Outcome(search, chosen, repeated)
    if told.most < PARAMETER_COST and told.undecided:
        # what is worth a plan for all is little; what is worth it for one pair, gone through often, tells that pair
        told = _Outcome(search, search.best_places(told.undecided[0]), MOST_REPEATED)
        repeated, chosen = told.repeated, told.chosen
    answer = {"why": told.why, "plan": {}, **told.lists, "weighed": len(search.positions)}
    if told.most >= PARAMETER_COST:
        cycle = CYCLE[:-1] * (repeated - 1) + CYCLE
        answer["plan"] = _plan(search, chosen, cycle, any("temperature" in pair.needs for pair in pairs))
    return answer


class _Design:
    """Places, each a pose under a load, weighed to first order: all pairs at first, then what is not apart yet.

    positions (c, a), loads (c, 6); `worth[k]` (c,) what a full load there is worth to pair k, in chi squared.
    """

    def __init__(self, bench: Bench, problem: Problem, selection: Selection, pairs: Sequence[Pair]):
        self.bench, self.problem, self.last, self.pairs = bench, problem, selection.last, pairs
        self.generator = np.random.default_rng(1)
        poses = list(bench.poses(WEIGHED_POSES, self.generator))
        units = np.concatenate((np.eye(6) * bench.largest, bench.loads(WEIGHED_LOADS, self.generator)))
        self.positions = np.repeat(np.array(poses), len(units), axis=0) if poses else np.zeros((0, 0))
        self.loads = np.tile(units, (len(poses), 1))
        self.begun = bool(poses)
        self.worth = np.zeros((0, 0))
        self.known = [information(problem, self.last, pair) for pair in pairs]

    def largest(self) -> list[int]:
        """Return the places of the largest deflections."""
        test = self._test(slice(None), (1.0,))
        moved = test.problem.whitened(test.fit.influence, _deflections(test))
        value = np.zeros(len(self.positions))
        value[test.fit.samples] = (moved**2).sum(axis=1)
        self.worth = value[None]
        order = np.argsort(-value, kind="stable")
        _, first = np.unique(self.positions[order], axis=0, return_index=True)
        return order[np.sort(first)[:PLANNED_POSES]].tolist()

    def from_both_sides(self, joint: str) -> list[int]:
        """Return the places of the largest deflections, each come to with a joint from below and from above, unloaded
        on the way; nothing where it cannot be moved so."""
        column = self.bench.robot.mechanism.actuated.index(joint)
        step = np.zeros(self.positions.shape[1])
        step[column] = LITTLE * float((self.bench.high - self.bench.low)[column])
        chosen: list[int] = []
        for place in self.largest():
            sides = [self.positions[place] - step, self.positions[place] + step]
            if all(self.bench.reaches(side) for side in sides):
                for side in sides:
                    chosen += [len(self.positions), place]
                    self.positions = np.concatenate((self.positions, side[None]))
                    self.loads = np.concatenate((self.loads, np.zeros((1, 6))))
        return chosen

    def planned(self) -> tuple[list[int], int]:
        """Return the places of a plan, and how often the cycle of loads is gone through in each."""
        every = range(len(self.pairs))
        self.worth = self._weighed(every, slice(None))
        for _ in range(DEEPER_SEARCHES):
            near = [k for k in every if SETTLED < self._best(k) < CERTAIN]
            if not near:
                break
            begun = len(self.positions)
            self._drawn(near)
            self.worth = np.concatenate((self.worth, self._weighed(near, slice(begun, None))), axis=1)
        chosen = self._picked()
        have = self.worth[:, chosen].sum(axis=1)
        wanted = [CERTAIN / size for size in have if MOST_REPEATED * size >= INDISTINCT]
        return chosen, int(np.clip(np.ceil(max(wanted, default=1.0)), 1, MOST_REPEATED))

    def _best(self, pair: int) -> float:
        """Return what the best places for one pair, each in a pose of its own, are worth to it."""
        return float(self.worth[pair, self.best_places(pair)].sum())

    def best_places(self, pair: int) -> list[int]:
        """Return the best places for one pair alone, each in a pose of its own."""
        order = np.argsort(-self.worth[pair], kind="stable")[: MOST_PLANNED_POSES * (6 + WEIGHED_LOADS)]
        _, first = np.unique(self.positions[order], axis=0, return_index=True)
        return [int(place) for place in order[np.sort(first)[:MOST_PLANNED_POSES]]]

    def _drawn(self, near: Sequence[int]) -> None:
        """Take in further places: half of them anywhere, half near those that are best for pairs not yet apart."""
        best = sorted({int(place) for k in near for place in np.argsort(-self.worth[k])[:PLANNED_POSES]})
        half = DEEPER_CANDIDATES // 2
        anywhere = list(self.bench.poses(half, self.generator))
        beside = list(self.bench.poses(half, self.generator, self.positions[best]))
        self.positions = np.array([*self.positions, *anywhere, *beside])
        loads = self.bench.loads(len(anywhere), self.generator)
        varied = self.bench.loads(len(beside), self.generator, self.loads[best])
        self.loads = np.concatenate((self.loads, loads, varied))

    def _test(self, places: slice, cycle: Sequence[float]) -> SimulatedTest:
        loads = np.array(cycle)[None, :, None] * self.loads[places, None]
        return SimulatedTest(self.bench, self.problem, self.last, self.bench.inputs(self.positions[places], loads))

    def _weighed(self, which: Iterable[int], places: slice) -> Array:
        """Return what places are worth to some pairs, (pairs, places), after what may be fitted there; others zero."""
        remembers = any(term.candidate.remembers for pair in self.pairs for term in (*self.last.terms, pair.rival))
        cycle = _SHORT_CYCLE if remembers else (1.0,)
        test = self._test(places, cycle)
        size = float(np.square(CYCLE).sum() / np.square(cycle).sum())
        found = np.zeros((len(self.pairs), len(test.problem.simulator.inputs)))
        for k in which:
            pair = self.pairs[k]
            left = separation(test.difference(pair), test.free(pair), self.known[k])
            found[k, test.fit.samples] = size * (np.nan_to_num(left) ** 2).sum(axis=1)
        return found.reshape(len(self.pairs), -1, len(cycle)).sum(axis=2)

    def _picked(self) -> list[int]:
        """Return places of a plan, no two in one pose.

        One after the other, each where it adds most: every pair counts alike, and more than what makes it certain is
        worth nothing to it. Beyond PLANNED_POSES only where a pair that can be told apart still needs one.
        """
        best = np.array([self._best(k) for k in range(len(self.worth))])
        asks = MOST_REPEATED * best >= INDISTINCT
        enough = np.where(asks, np.minimum(best, CERTAIN), np.inf)[:, None]
        share = np.where(asks[:, None], 1 / enough, NOTHING / max(float(best.max(initial=0.0)), 1e-300))
        have = np.zeros((len(self.worth), 1))
        picked: list[int] = []
        free = np.ones(len(self.positions), bool)
        while len(picked) < MOST_PLANNED_POSES and free.any():
            if len(picked) >= PLANNED_POSES and not (asks & (have[:, 0] < CERTAIN)).any():
                break
            gain = (share * (np.minimum(have + self.worth, enough) - np.minimum(have, enough))).sum(axis=0)
            place = int(np.argmax(np.where(free, gain + NOTHING**2 * self.worth.sum(axis=0), -np.inf)))
            picked.append(place)
            free &= (self.positions != self.positions[place]).any(axis=1)
            have += self.worth[:, place, None]
        return picked


def _deflections(test: SimulatedTest) -> Array:
    """Return how far the loads of a test move what is measured, (n, K), to first order."""
    wrench = test.problem.simulator.inputs.wrench[test.fit.samples]
    return (test.fit.influence.compliance @ wrench[..., None])[..., 0]


class _Outcome:
    """What a plan tells apart, pair by pair and in words: it is simulated, and what may be fitted is fitted."""

    def __init__(self, search: _Design, chosen: Sequence[int], repeated: int):
        self.search, self.chosen, self.repeated = search, list(chosen), repeated
        self.lists: dict[str, list[dict[str, Any]]] = {"separates": [], "cannot_separate": [], "undecided": []}
        self.most = 0.0
        self.undecided: list[int] = []
        said: dict[str, list[tuple[Pair, float | None]]] = {name: [] for name in self.lists}
        alike: list[tuple[int, dict[str, Any]]] = []
        test = self._test()
        for k, pair in enumerate(search.pairs):
            size, largest = self._separation(test, k)
            entry = {"one": _named(pair.term), "other": _named(pair.rival), "times_noise": largest}
            kind = "separates"
            if size < INDISTINCT:
                kind = "cannot_separate" if self._is_proved_alike(k) else "undecided"
                alike.append((k, entry))
                self.undecided += [k] * (kind == "undecided")
            if kind != "cannot_separate":
                self.most = max(self.most, size)
            self.lists[kind].append(entry)
            said[kind].append((pair, largest if kind == "separates" else None))
        texts = {
            "separates": "separates",
            "cannot_separate": "no pose and load within reach tells",
            "undecided": "this plan alone may not tell",
        }
        parts: list[str] = []
        for name, text in texts.items():
            if said[name]:
                parts.append(f"{text} {self._from(said[name], again=bool(parts))}")
        self.why = ". But ".join([parts[0], "; and ".join(parts[1:])][: len(parts)]) + self._beyond_reach(alike)

    def _from(self, told: Sequence[tuple[Pair, float | None]], again: bool = True) -> str:
        """Return 'backlash at A from backlash at B (1.4 times the noise), C (2.4)': each said once, `again` 'it'."""
        alone = len({_words(pair.term) for pair in self.search.pairs}) == 1
        groups: dict[str, dict[str, list[str]]] = {}
        unit = " times the noise"
        for pair, times in told[:MOST_LISTED]:
            ours, theirs = _apart(pair.term, pair.rival)
            physics, at, place = theirs.partition(" at ")
            size = "" if times is None else f" ({number(times, 2)}{unit})"
            unit = unit if times is None else ""
            groups.setdefault(ours, {}).setdefault(physics + at, []).append(place + size)
        sentences = [
            f"{'it' if again and alone else term} from "
            + ", or from ".join(physics + _listed(places) for physics, places in rivals.items())
            for term, rivals in groups.items()
        ]
        more = len(told) - MOST_LISTED
        return "; ".join(sentences) + (f"; and {counted(more, 'pair')} more" if more > 0 else "")

    def _test(
        self, times: float = 1.0, gravity: Array | None = None, chosen: Sequence[int] | None = None
    ) -> SimulatedTest:
        search, places = self.search, self.chosen if chosen is None else list(chosen)
        loads = np.array(CYCLE)[None, :, None] * search.loads[places, None]
        inputs = search.bench.inputs(search.positions[places], times * loads, gravity)
        return SimulatedTest(search.bench, search.problem, search.last, inputs)

    def _separation(self, test: SimulatedTest, k: int, repeated: int | None = None) -> tuple[float, float]:
        """Return how far a repeated test tells a pair apart, in chi squared, and the most of one sample in noise."""
        pair, times = self.search.pairs[k], self.repeated if repeated is None else repeated
        left = separation(test.simulated(pair), test.free(pair), self.search.known[k] / times)
        each = (np.nan_to_num(left) ** 2).sum(axis=1)
        return times * float(each.sum()), float(np.sqrt(each.max(initial=0.0)))

    def _is_proved_alike(self, k: int) -> bool:
        """Return True where not even a plan for this pair alone, repeated, would tell it apart."""
        search = self.search
        if MOST_REPEATED * search.worth[k, search.best_places(k)].sum() < INDISTINCT:
            return True
        # What the first recording says of the parameters counts once, not in each place.
        return self._separation(self._test(chosen=search.best_places(k)), k, MOST_REPEATED)[0] < INDISTINCT

    def _beyond_reach(self, alike: Sequence[tuple[int, dict[str, Any]]]) -> str:
        """Return what would tell apart what this bench does not: larger loads, a base tilted against gravity."""
        pairs, bench = self.search.pairs, self.search.bench
        ways: list[tuple[str, str, float, Array | None]] = []
        if alike:
            ways.append((f"Loads {MUCH:g} times as large", "larger_loads", MUCH, None))
        if any("gravity" in pairs[k].needs for k, _ in alike):
            gravity = bench.robot.mechanism.gravity if bench.gravity is None else bench.gravity
            ways.append(("The base tilted against gravity", "tilted_base", 1.0, _tilted(gravity)))
        said = ""
        for what, key, times, tilted in ways:
            test, told = self._test(times, tilted), list[tuple[Pair, float | None]]()
            for k, entry in alike:
                size, entry[key] = self._separation(test, k)
                if size >= INDISTINCT:
                    told.append((pairs[k], entry[key]))
            if told:
                said += f". {what} would tell {self._from(told)}"
        return said


def _tilted(gravity: Array) -> Array:
    """Return gravity (3,) as a base has it that is tilted by TURNED about the axis most across it."""
    axis = np.cross(gravity, np.eye(3)[int(np.argmin(np.abs(gravity)))])
    axis /= np.linalg.norm(axis)
    return gravity * np.cos(TURNED) + np.cross(axis, gravity) * np.sin(TURNED)


def _plan(search: _Design, chosen: Sequence[int], cycle: Sequence[float], warm: bool = False) -> dict[str, Any]:
    """Return a plan as `read_plan` reads it."""
    bench = search.bench
    names = bench.robot.mechanism.actuated
    plan: dict[str, Any] = {"robot": bench.robot.name}
    plan["poses"] = [
        {"actuators": {name: round(float(q), 6) for name, q in zip(names, search.positions[at], strict=True)}}
        for at in chosen
    ]
    plan["loads"] = [
        {
            "cycle": [*cycle] if search.loads[at].any() else [0.0],
            "wrench": {n: round(float(x), 4) for n, x in zip(WRENCH_NAMES, search.loads[at], strict=True)},
            "poses": [place],
        }
        for place, at in enumerate(chosen)
    ]
    if bench.markers:
        plan["markers"] = list(bench.markers)
    if bench.gravity is not None:
        plan["gravity"] = bench.gravity.tolist()
    if warm and bench.temperature is not None:
        plan["temperature"] = round(bench.temperature, 2)
    return plan


def _named(term: Term) -> dict[str, str]:
    return {"physics": term.candidate.law.physics, "location": term.candidate.place.name}


def _words(term: Term) -> str:
    """Return 'stiffness changed at leg3/drive'; the place keeps its own name."""
    physics, at, place = term.candidate.name.partition(" at ")
    return f"{physics.replace('_', ' ')}{at}{place}"


def _apart(term: Term, rival: Term) -> tuple[str, str]:
    """Return both in words that differ: where law and place are the same, with their values."""
    ours, theirs = _words(term), _words(rival)
    if ours != theirs:
        return ours, theirs
    return f"{ours} ({_values(term)})", f"{theirs} ({_values(rival)})"


def _values(term: Term) -> str:
    units = {item.name: item.unit for item in term.candidate.quantities}
    return ", ".join(f"{name.replace('_', ' ')} {quantity(x, units[name])}" for name, x in term.effect.values.items())


def _listed(words: Sequence[str]) -> str:
    return " or ".join([", ".join(words[:-1]), words[-1]]) if len(words) > 1 else words[0]


def _indistinct_pairs(problem: Problem, selection: Selection) -> list[Pair]:
    """Return pairs of terms (ours, rival) that the data leave together."""
    pairs = []
    for index, (term, rivals) in enumerate(zip(selection.last.terms, selection.rivals, strict=True)):
        for rival in other_explanations(problem, selection.last, index, rivals):
            other = rival.term
            if (
                _holds(other, term)
                or other is term
                or len({*_apart(term, other)}) == 1
                or rival.chi2 - selection.last.chi2 > MUCH * INDISTINCT
            ):
                continue
            pairs.append(Pair(term, other, rival.whole))
    return pairs


def _holds(whole: Term, part: Term) -> bool:
    """Return True for a law at several places, each with its own value, one of which is the other law's: no rival."""
    one, other = whole.candidate, part.candidate
    alike = one.law.physics == other.law.physics and one.size > other.size
    return alike and other.place.name in one.law.same_places(one.place, one.mechanism)
