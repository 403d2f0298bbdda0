"""`diagnose_efforts`: from a robot in motion to what its efforts say."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np

from ...dynamics import InMotion
from ...errors import InputError
from ...recordings import Recording
from ...robot import Robot
from ...spatial import Array
from ..criteria import (
    EFFORT_CURVE_GAIN,
    EFFORT_CURVE_OWN,
    EFFORT_GAIN,
    EFFORT_GAINS_SAVE,
    EFFORT_IMITATED,
    EFFORT_MATERIAL,
    EFFORT_SURE,
)
from .band import band_of, in_motion
from .beside import Beside
from .chosen import Chosen, fit
from .columns import EffortCandidate, Gathered
from .diagnosis import EffortDiagnosis
from .gains import Gains, gains_of, in_newtons, law_of_gains
from .gather import Efforts
from .likelier import likelier
from .noise import EffortNoise, noise_of
from .outcome import Outcome
from .plausible import check_efforts
from .relief import relieved, relieving, squared_strain
from .search import held_out, kinds_of_most, pruned, scores, searched, surely, threshold, worth
from .stretches import Stretch, stands_out, stretches_of
from .verdict import effort_diagnosis_of

__all__ = ["diagnose_efforts"]

#: What is said while laws are looked for.
_LAWS = "laws compete for the efforts"


def diagnose_efforts(
    robot: Robot,
    recording: Recording,
    tell: Callable[[str, float], None] = lambda stage, share: None,
    held: Mapping[str, Array] | None = None,
) -> EffortDiagnosis:
    """Return what the columns tau of a recording say that a rigid robot's inverse dynamics leave out.

    held: by joint (N,), what drives hold at rest where more is known than of a rigid robot; NaN where it is not.

    Raises InputError where the motion cannot be told, or no effort of a driven joint was recorded.
    """
    tell("the motion", 0.02)
    band, below = band_of(robot.mechanism, recording)

    def efforts_without(stretches: Sequence[Stretch]) -> Efforts:
        at = in_motion(robot.mechanism, recording, band, [stretch.rows for stretch in stretches])
        return _efforts(recording, at if held is None else _holding(at, held), below)

    whole = efforts_without(())
    noise = noise_of(recording, whole.at)
    stretches = stretches_of(whole.at, whole.every, whole.outlying)
    if not stretches:
        return effort_diagnosis_of(_outcome(robot, recording, whole, noise, (), tell))
    found = _outcome(robot, recording, efforts_without(stretches), noise, stretches, tell)
    left = whole.left_by(found.chosen, fit(found.given, found.chosen)[0], found.scale)
    # what only rough values of laws could not follow is described by those that were settled
    kept = [
        stretch for stretch in stretches if stands_out(stretch, whole.at.motion.rows[whole.every], left, whole.good)
    ]
    if len(kept) < len(stretches):
        found = _outcome(robot, recording, efforts_without(kept) if kept else whole, noise, kept, tell)
    return effort_diagnosis_of(found)


def _outcome(
    robot: Robot,
    recording: Recording,
    plainly: Efforts,
    noise: Mapping[str, EffortNoise],
    stretches: Sequence[Stretch],
    tell: Callable[[str, float], None],
) -> Outcome:
    """Return what was fitted to the efforts of a recording, of that noise, without some stretches."""
    at, tolerances, declared = plainly.at, _tolerances(recording), recording.noise.effort

    def searched_by(gains: Gains | None, share: tuple[float, float]) -> tuple[list[str], Efforts, Gathered, Chosen]:
        scale = np.ones(len(at.driven)) if gains is None else gains.gains
        doubts = check_efforts(at, scale)
        efforts = plainly
        if gains is not None:
            others = {kind: size for kind, size in tolerances.items() if kind != law_of_gains().physics}
            efforts = Efforts(in_newtons(at, scale), others, declared / scale if declared else None, plainly.below)
        first, last = share
        return doubts, *_laws(efforts, gains is not None, partial(_between, partial(tell, _LAWS), first, last))

    tell(_LAWS, 0.1)
    gains = gains_of(at, tolerances)
    doubts, efforts, given, chosen = searched_by(gains, (0.1, 0.7))
    if gains is not None and any(term.law.of_gain for term in chosen.terms):
        # laws that take gains back: one gain and a delay look a little like many gains
        with suppress(InputError):
            plain = searched_by(None, (0.7, 0.75))
            share, sure = worth(plain[1].held_out_plainly(*plain[2:]), efforts.held_out_plainly(given, chosen))
            if not (sure > EFFORT_SURE and share > EFFORT_GAINS_SAVE):
                gains, (doubts, efforts, given, chosen) = None, plain
    tell("what no law explains", 0.75)
    given, chosen = relieved(given, chosen, efforts.with_curves)
    given, chosen, free, imitating = _with_curves(efforts, given, likelier(given.without_curves(), chosen))
    tell("the verdict", 0.9)
    while True:
        found = Outcome(robot, recording, efforts, noise, given, chosen, free, imitating, gains, stretches, doubts)
        if (needless := found.needless) is None:
            return found
        chosen = chosen.without(needless)


def _laws(efforts: Efforts, freed: bool, tell: Callable[[float], None]) -> tuple[Efforts, Gathered, Chosen]:
    """Return the laws that the efforts ask for, and efforts that know them; `freed`: beside the masses of all links.

    Looked for beside what every drive has: of a robot on which everything is a little off, the first single law would
    stand for much that it is not. Where most drives surely have nothing of the kind, the drawing is that of this device
    but for a few laws: those found, without what is not sure of every drive, or those found from nothing, one after the
    other, which need no more to be as good.

    How a friction turns round and how late signals are look alike, and a search ends near where it began: the ways of
    friction are the usual ones to begin with, or those that suit best before any law is found.
    """

    def begun(of: Efforts) -> tuple[Gathered, Chosen]:
        given = of.gathered()
        return given, of.start(given if freed else None)

    def looked_for(given: Gathered, start: Chosen, tell: Callable[[float], None]) -> tuple[Gathered, Chosen]:
        return searched(given, start, common.renewed, common.closer, tell)

    def better(found: tuple[Gathered, Chosen], usual: tuple[Gathered, Chosen]) -> tuple[Gathered, Chosen]:
        return found if worth(held_out(*usual), held_out(*found))[0] > EFFORT_GAIN else usual

    first, second, third = (partial(_between, tell, share, share + 0.3) for share in (0.0, 0.4, 0.7))
    given, start = begun(efforts)
    start = efforts.background(given, start)
    common, given = efforts.with_learned_widths(given, start)
    usual = looked_for(given, start, first)
    given, sure = usual[0], surely(*usual)
    if not kinds_of_most(given, sure.terms):
        return common, *better(looked_for(given, sure, second), looked_for(*begun(common), third))
    given, start = begun(common)
    start = common.background(given, start)
    given, start = common.closer(given, start, range(len(start.terms)), at_last=True)
    return common, *better(looked_for(given, start, second), usual)


def _between(tell: Callable[[float], None], first: float, last: float, share: float) -> None:
    tell(first + (last - first) * share)


def _holding(at: InMotion, held: Mapping[str, Array]) -> InMotion:
    """Return the same postures with what drives hold in them, where more is known than of a rigid robot."""
    known = np.column_stack([held[name][at.motion.rows] for name in at.driven])
    return replace(at, rigid=np.where(np.isfinite(known), known, at.rigid))


def _efforts(recording: Recording, at: InMotion, below: float | None) -> Efforts:
    noise = recording.noise.effort
    return Efforts(at, _tolerances(recording), np.full(len(at.driven), noise) if noise else None, below)


def _tolerances(recording: Recording) -> dict[str, float]:
    return {key: float(value) for key, value in recording.tolerances.declared.items()}


def _with_curves(
    efforts: Efforts, given: Gathered, chosen: Chosen
) -> tuple[Gathered, Chosen, list[EffortCandidate], list[EffortCandidate]]:
    """Return what is chosen, the curves of no law that the efforts still ask for, and laws that imitate them.

    A law that only imitates what is there leaves its shape behind: it is not named. Where it serves beside the curve, a
    prediction keeps it.
    """
    free: list[EffortCandidate] = []
    imitating: list[EffortCandidate] = []
    began = Beside(given, chosen.of(()))
    for _ in range(3):
        given, curves = efforts.with_curves(given)
        ranked, best = scores(given.only(curves), chosen)
        limit = threshold(best)
        beside = Beside(given, chosen)
        tried = []
        for score in sorted(ranked, key=lambda item: -item.gain)[:8]:
            if score.log_chance >= limit:
                continue
            share, sure = worth(beside.left, held_out(given, chosen.with_term(score.candidate)))
            saving, own = share * float(beside.left.sum()), beside.left_in(score.candidate)
            material = saving > EFFORT_MATERIAL * (began.left_in(score.candidate) - own) or not chosen.terms
            much = share > EFFORT_CURVE_GAIN or saving > EFFORT_CURVE_OWN * own
            if sure > EFFORT_SURE and much and material:
                tried.append((share, score.candidate))
        curve = max(tried, key=lambda item: item[0])[1] if tried else relieving(given, chosen, curves)
        if curve is None or any(curve.name == other.name for other in free):
            break
        free.append(curve)
        here = _cost(given, chosen)
        shape = here - _cost(given, chosen.with_term(curve))
        for term in chosen.terms:
            if term.law.is_curve or term.place.name != curve.place.name or curve.is_of_time:
                continue  # what changes with time is still what it is
            own = _cost(given, chosen.without(term)) - here
            if term.law.by_shape or shape > EFFORT_IMITATED * own:
                imitating.append(term)
        # what imitated that shape, or made room for it elsewhere
        doubtful = [term for term in chosen.terms if term.place.name != curve.place.name] + imitating
        chosen = pruned(given, chosen.with_term(curve), [term for term in doubtful if not term.law.is_curve])
    return given, chosen, free, imitating


def _cost(given: Gathered, chosen: Chosen) -> float:
    """Return the squares that held-out blocks keep, and those of strained tolerances."""
    return float(held_out(given, chosen).sum()) + squared_strain(given, chosen)
