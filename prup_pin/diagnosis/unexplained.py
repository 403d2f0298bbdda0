"""What does no law explain, and which laws stand beside it? The final state, of which the verdict is made.

A law that takes most of the residual and leaves a shape behind is an imitation. Beside what is unknown a law stands
that leaves noise where the unknown's place may deform as it likes; else only what far outweighs the rest. Laws in a row
that together still miss are nobody's faults.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from ..laws import Effect
from ..numbers import counted, percent
from .candidates import Term
from .criteria import FEWEST_NUMBERS, FOLLOWED, GAIN, IMITATED, LITTLE, MOST, ROUGHLY, chance_bound, clean_bound
from .diagnosis import Finding
from .evidence import cross_validated
from .findings import chi2_without, finding_of, nothing_compared, rms_of_sum, too_few_poses, unknown_at, without_place
from .intervals import parameters_of
from .locate import LOAD, Located, locate, tilting_base
from .noise import could_show_structure, noise_of_the_rest
from .prepare import Prepared, Tell
from .problem import Fit, Problem
from .search import Selection, select


@dataclass(frozen=True)
class Final:
    """What stands in the end: a fit, findings of its laws, and what no law explains.

    held_out: chi squared of blocks that were left out in turn; count: numbers that were compared; in_doubt: what would
    be said in multiples of the noise says nothing. stand_ins: laws of the fit that are nobody's faults, but foretell.
    """

    fit: Fit
    laws: tuple[Finding, ...]
    unknown: Finding | None
    held_out: float
    count: int
    in_doubt: bool = False
    stand_ins: tuple[Effect, ...] = ()


def final_state(
    problem: Problem, selection: Selection, prepared: Prepared, blocks: np.ndarray, tell: Tell, doubt: Finding | None
) -> Final:
    """Return what stands of a selection. blocks (N,): samples held out together; doubt: why nothing can be said."""
    last, robot = selection.last, problem.simulator.robot
    count, labels = problem.count(last), blocks[last.samples]
    held = cross_validated(problem, last, labels) if count else float("nan")
    alone = labels if prepared.kinds else None
    laws = [finding_of(problem, last, index, selection, robot, held, alone) for index in range(len(last.terms))]
    if not count:
        return Final(last, tuple(laws), nothing_compared(problem, prepared.unused), held, count)
    if doubt is not None:
        return Final(last, tuple(laws), doubt, held, count, in_doubt=True)
    if count < FEWEST_NUMBERS:
        return Final(problem.first, (), too_few_poses(count), held, count)
    if not _unexplained(problem, last, count):
        group = _cancelling(problem, last) if rms_of_sum(held, count) > ROUGHLY * clean_bound(count) else ()
        usual = [index for index in range(len(last.terms)) if index not in group and _is_usual(problem, last, index)]
        left_over = tuple(finding for index, finding in enumerate(laws) if index not in (*group, *usual))
        ins, minor = (tuple(last.terms[index].effect for index in places) for places in (group, usual))
        return Final(last, left_over, _in_place_of(ins), held, count, stand_ins=(*ins, *minor))
    kept, unknown, fit = _beside_unknown(list(laws), problem, selection, blocks, tell)
    unknown = unknown or without_place(problem, fit, selection, count)
    left, held = (cross_validated(problem, each, labels, bounded=True) for each in (fit, last))
    named = [_same(finding.effect, last.terms) for finding in kept]
    if None in named or held >= MOST * left:
        return Final(fit, tuple(kept), unknown, left, count)
    # laws that nobody names foretell what was held out all the same
    others = [term.effect for index, term in enumerate(last.terms) if index not in named]
    kept = [finding for index, finding in enumerate(laws) if index in named]
    return Final(last, tuple(kept), unknown, held, count, stand_ins=tuple(others))


def _is_usual(problem: Problem, fit: Fit, index: int) -> bool:
    """Return True for a law that is no more than all such parts have, and changes what was measured less than noise.

    No finding, but not left out either: laws of sound parts would come to imitate it.
    """
    if not fit.terms[index].effect.is_unremarkable:
        return False
    others = [term.effect for term in fit.others(index)[1]]
    return float(np.mean(problem.change(fit, others) ** 2)) < 1.0


def _cancelling(problem: Problem, fit: Fit) -> tuple[int, ...]:
    """Return the terms that together do a small part of what each of them does; () where none do.

    Faults do not make up for each other: such laws are the pieces of a curve that none of them has.
    """
    places = range(len(fit.terms))

    def moved(group: Sequence[int]) -> float:
        kept = [term.effect for index, term in enumerate(fit.terms) if index not in group]
        return float(np.linalg.norm(problem.change(fit, kept)))

    alone = [moved([index]) for index in places]
    groups = [group for size in range(2, len(alone) + 1) for group in combinations(places, size)]
    shares = {group: moved(group) / max(min(alone[index] for index in group), 1e-300) for group in groups}
    best = min(shares, key=lambda group: shares[group], default=())
    return best if best and shares[best] < LITTLE else ()


def _in_place_of(effects: Sequence[Effect]) -> Finding | None:
    """Return that something unknown is where effects stand that cancel each other; None where there are none."""
    if not effects:
        return None
    where = min((effect.place.name for effect in effects), key=len)
    return unknown_at(
        where,
        f"{counted(len(effects), 'law')} of the library follow what was measured at {where} only by making up for each "
        "other, each many times as large as all together, and do not foretell what was held out: none of them is "
        "what is missing there",
        advice=f"measure {where} in more positions: its error by position, free of loads, is the curve that is missing",
    )


def _same(effect: Effect | None, terms: Sequence[Term]) -> int | None:
    """Return which term is the law of an effect at its place; None where none is."""
    own = None if effect is None else (effect.law, effect.place)
    return next((index for index, term in enumerate(terms) if (term.candidate.law, term.candidate.place) == own), None)


def _unexplained(problem: Problem, last: Fit, count: int) -> bool:
    """Return True where structure is left over that no law takes away.

    Toleranced parameters shift the load at which a gap closes or a joint slides: beside them a law may be roughly right
    that takes away all but little of what there is while they are held. A robot file that is taken at its word leaves
    noise or something. A little more than the noise that was declared is noise where it follows nothing.
    """
    rms = rms_of_sum(last.chi2, count)
    began = rms_of_sum(last.chi2 + float((problem.change(last, ()) ** 2).sum()), count)
    beside = bool(len(problem.prior.toleranced) and last.terms)
    rough = beside and rms <= ROUGHLY and (rms**2 - 1) <= GAIN * (began**2 - 1)
    blocks = problem.simulator.inputs.blocks[last.samples]
    more = could_show_structure(blocks) and noise_of_the_rest(problem, last, blocks) is None
    return (rms > clean_bound(count) or (rms > chance_bound(count) and more)) and not rough


def _beside_unknown(
    laws: list[Finding], problem: Problem, selection: Selection, labels: np.ndarray, tell: Tell
) -> tuple[list[Finding], Finding | None, Fit]:
    """Return the findings that stand, what no law explains (None where it has no place), and the fit that stands."""
    kept, found, fit = _outweighing(laws, selection.last, problem)
    if (tilting := tilting_base(problem, fit)) is not None:
        return kept, _of_base(*tilting), fit
    if found is None:
        return kept, None, fit
    # what else there is, whatever happens at that place
    freed = problem.freed(fit.influence, found.module)
    again = select(freed, selection.library, labels, freed.fit_at((), problem.first), tell)
    beside = problem.fit_at(again.last.terms, again.last)
    # else what was freed has taken what the others explain, or they explain what it alone did
    own = again.last.names
    whole = all(term.candidate.name in own for term in fit.terms if term.is_expected)
    if (
        whole
        and not _hidden(problem, freed, fit)
        and _leaves_noise(problem, again.last, found.module)
        and _no_worse(problem, beside, labels)
    ):
        around = cross_validated(freed, again.last, labels[again.last.samples])
        robot = problem.simulator.robot
        kept = [finding_of(freed, again.last, index, again, robot, around) for index in range(len(again.last.terms))]
        fit, found = beside, locate(problem, beside) or found
    # how it is counted: one number for each sample against one curve for all
    share, what, came = found.curve.gain / fit.chi2, "its load", ""
    if found.follows is not None:
        (what, _, _, came), share = found.follows
    statement = (
        "part of the residual is systematic and explained by no law of the library. Of its square, a deformation of "
        f"{found.module}, free at each sample, would take away {percent(found.share)}, and one that "
        f"follows {what} {percent(share)}"
    )
    advice = ""
    if came:
        sides = "to each load from both sides" if came == LOAD else f"to each posture from both sides of {came}"
        statement += ": that is hysteresis, as friction or play leaves, and friction of a drive has no law at rest"
        advice = f"come {sides}: the mean of the two is free of the hysteresis, half of their difference is its size"
    elif share < FOLLOWED * found.share:
        statement += ": at one and the same of it the deformation is another from sample to sample"
        advice = (
            "come to each posture and each load from both sides, twice: where the two differ, what was before decides, "
            "as with dry friction and with play that stays where it was pushed; where they do not, vary what no column "
            "tells"
        )
    unknown = unknown_at(found.module, statement, float(share), advice)
    came = "" if came == LOAD else came
    return kept, replace(unknown, candidates=found.candidates, curve=found.curve, approached=came), fit


def _of_base(share: float, other: float) -> Finding:
    """Return that what the robot stands on does something unknown, which takes away shares of the residual's square."""
    return unknown_at(
        "base",
        "what the robot stands on moves as no law of the library has it. Of the square of what is left, a base that "
        f"tilts, free at each sample, would take away {percent(share)}, and no module of the robot more than "
        f"{percent(max(other, 0.0))}; a pose sensor that tilts would look alike",
        share,
        "look at anchors and at what the robot stands on: come to each load from both sides, and measure the base too",
    )


def _hidden(problem: Problem, freed: Problem, fit: Fit) -> bool:
    """Return True where what was freed can do most of what a law of the fit does.

    That law had no part in the search beside it, which says nothing against it: it stands by what it outweighs.
    """
    for index in range(len(fit.terms)):
        others = [term.effect for term in fit.others(index)[1]]
        before, left = (float((each.change(fit, others) ** 2).sum()) for each in (problem, freed))
        if left < LITTLE * before:
            return True
    return False


def _outweighing(kept: list[Finding], fit: Fit, problem: Problem) -> tuple[list[Finding], Located | None, Fit]:
    """Return the findings that each take `IMITATED` times what is left, where that sits, and their fit.

    Those that make up for each other are pieces of what is left. What acts on every robot, as weight does, imitates
    nothing.
    """
    count, mechanism = problem.count(fit), problem.simulator.robot.mechanism
    while True:
        least = IMITATED * max(fit.chi2 - count, 0.0)
        gains = [np.inf if term.is_expected else chi2_without(problem, fit, at) for at, term in enumerate(fit.terms)]
        imitating = _cancelling(problem, fit)
        if not imitating and min(gains, default=np.inf) < least:
            imitating = (int(np.argmin(gains)),)
        if not imitating:
            return kept, locate(problem, fit), fit
        kept = [finding for index, finding in enumerate(kept) if index not in imitating]
        terms = [term for term in fit.terms if any(term.effect == finding.effect for finding in kept)]
        fit = problem.refine(terms, problem.first) if terms else problem.first
        kept = [
            replace(
                finding,
                effect=term.effect,
                parameters=parameters_of(problem, fit, index),
                statement=term.effect.statement(mechanism),
            )
            for index, (finding, term) in enumerate(zip(kept, fit.terms, strict=True))
        ]


def _leaves_noise(problem: Problem, fit: Fit, module: str) -> bool:
    """Return True where a fit leaves noise while a module deforms as it likes, which takes numbers away."""
    free = np.linalg.norm(problem.reach(fit, module), axis=1) > 0.5
    count = max(problem.count(fit) - int(free[fit.run.solved[fit.samples]].sum()), 1)
    return fit.chi2 <= clean_bound(count) ** 2 * count


def _no_worse(problem: Problem, fit: Fit, labels: np.ndarray) -> bool:
    """Return True where the laws of a fit do not raise the residual: neither the whole nor that of blocks left out."""
    held = [cross_validated(problem, each, labels[each.samples]) for each in (problem.first, fit)]
    return fit.chi2 <= problem.first.chi2 and held[1] <= held[0]
