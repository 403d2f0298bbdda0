"""From what was selected to a diagnosis: what is found, what is left, and what stays unknown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..channels import Stack
from ..laws import Effect
from ..numbers import counted
from ..recordings import SENSORS
from ..robot import Robot
from ..spatial import Array
from .all_over import all_over
from .calibrate import (
    calibrated_parameters,
)
from .criteria import (
    IMITATED,
    ROUGH,
    ROUGH_SHARE,
    WEIGHT_SHOWS,
    clean_bound,
)
from .diagnosis import Diagnosis, Finding
from .evidence import cross_validated, is_clean
from .findings import (
    always_acting,
    beyond_its_tolerance,
    chi2_without,
    finding_of,
    finite_deflection,
    nothing_compared,
    parameters_of,
    rms_of_sum,
    sensor_displaced,
    with_neutral_values,
    without_place,
)
from .identify import not_detectable
from .locate import Located, locate, recovered, residuals
from .next_experiment import next_experiment
from .prepare import Prepared, Tell
from .problem import Fit, Problem
from .search import Selection, select

__all__ = ["verdict_of"]


#: Parameters that a remark lists by name.
MOST_LISTED = 5


def verdict_of(
    problem: Problem,
    selection: Selection,
    prepared: Prepared,
    blocks: np.ndarray,
    robot: Robot,
    tell: Tell,
    doubt: Finding | None = None,
) -> Diagnosis:
    """Return the diagnosis of what was selected; `blocks` (N,): samples held out together, `doubt`: why none holds."""
    raw_linear, remarks, unused = prepared.raw_linear, prepared.remarks, prepared.unused
    last, first = selection.last, selection.first
    samples = last.samples
    before = problem.whitened(first.influence, raw_linear)
    labels = blocks[samples]
    count = problem.count(last)
    held = cross_validated(problem, last, labels) if count else float("nan")
    findings = [
        finding_of(problem, last, index, selection, robot, held, labels if prepared.kinds else None)
        for index in range(len(last.terms))
    ]
    unknown: list[Finding] = []
    final = last
    if not count:
        unknown = [nothing_compared(problem, unused)]
    elif doubt is not None:
        unknown = [doubt]
    elif _unexplained(_without_laws(problem, first, last), last, count, bool(findings)):
        findings, located, final = _with_unknown(findings, problem, selection, blocks, count, robot, tell)
        held = cross_validated(problem, final, labels)
        unknown = [located or without_place(problem, final, selection, count)]
    white_before = rms_of_sum(float((before**2).sum()), count)
    white_after, white_held = rms_of_sum(final.chi2, count), rms_of_sum(held, count)
    if doubt is not None:
        white_before = white_after = white_held = float("nan")  # in multiples of a noise that nobody knows
    silent = not findings and not unknown and white_before > clean_bound(count)
    began = problem.whitened(first.influence, prepared.raw_registered)
    deflection = finite_deflection(problem.drawn, last, began, silent)
    if deflection is not None:
        findings.append(deflection)
    findings.sort(key=lambda finding: -finding.heldout_gain)
    acting: tuple[Effect, ...] = ()
    if problem.tolerances is not None and count and _shows(problem, final):
        acting = problem.tolerances.effects
    # what acts was left out of the simulation that one starts from, be it without a parameter
    named = "explained" if findings or acting or prepared.kinds or prepared.placed.found else "nothing_missing"
    verdict = "unexplained" if unknown else named
    if unknown and count and not len(prepared.toleranced) and not robot.mechanism.loops:
        remarks.append(_UNCALIBRATED)
    calibrated = [] if problem.tolerances is None else calibrated_parameters(problem, final)
    moved_sensor = zip(prepared.placed.found, prepared.placed.deviations, strict=True)
    findings = [*(sensor_displaced(*each, first, before, robot, calibrated) for each in moved_sensor), *findings]
    beyond = [item for item in calibrated if item.is_beyond(len(calibrated))]
    if beyond and (unknown or not is_clean(problem, final)):
        # what no law explains drives them: they are no findings of their own
        listed = ", ".join(item.name for item in beyond[:MOST_LISTED]) + (", …" if len(beyond) > MOST_LISTED else "")
        remarks.append(
            f"{counted(len(beyond), 'parameter')} would lie beyond tolerance ({listed}), but while "
            "structure is left over they may only stand for that"
        )
        beyond = []
    findings += [beyond_its_tolerance(item, final, held) for item in beyond]
    findings = [with_neutral_values(finding, robot) for finding in findings]
    told = [kind for kind in prepared.kinds if not (prepared.placed.found and kind in SENSORS["pose_sensor"])]
    findings += all_over(problem, final, calibrated, told, blocks)
    findings += unknown
    effects = tuple(finding.effect for finding in findings if finding.effect is not None)
    # a sensor reports what all the others have left
    effects = (*(effect for effect in effects if effect not in prepared.placed.found), *prepared.placed.every)
    if problem.tolerances is not None:
        findings += [always_acting(effect, robot) for effect in acting]
        effects = (*problem.tolerances.at(final.x), *effects)
    raw_after = problem.stack.residual(final.run)[samples]
    if count:
        findings = [
            replace(finding, recovered=recovered(problem, final, raw_after, finding.effect, finding.curve))
            for finding in findings
        ]
    tell("the next experiment", 0.95)
    diagnosis = Diagnosis(
        verdict=verdict,
        noise=problem.noise,
        before={"fit": white_before, "heldout": white_before},
        after={"fit": white_after, "heldout": white_held},
        within=_within(problem, first, count),
        calibration=tuple(calibrated),
        by_channel=_channels(problem.stack, samples, before, final.residual, raw_linear, raw_after),
        findings=tuple(findings),
        not_detectable=tuple(not_detectable(problem, final, selection)) if count else (),
        next_experiment=next_experiment(robot, problem, selection, findings),
        remarks=tuple(dict.fromkeys(remarks)),
        unused_columns=unused,
        effects=effects,
        samples=samples,
        columns=problem.stack.groups(),
        residual_before=raw_linear,
        residual_after=raw_after,
        residuals=residuals(problem, final, raw_linear, raw_after) if count else None,
        final=final.run,
    )
    return diagnosis


#: What may help where a tree is left unexplained and taken at its word.
_UNCALIBRATED = (
    "nothing is declared to be off: the robot file is taken at its word. Zeros of encoders, links, markers of an arm "
    "that was never calibrated are: --tolerances arm takes usual values, docs/tolerances.md says which"
)


def _shows(problem: Problem, fit: Fit) -> bool:
    """Return True where what acts whatever else does, weight, moves what was measured by more than chance."""
    assert problem.tolerances is not None
    parameters = [problem.tolerances.toleranced.effect(fit.x)] if len(fit.x) else []
    without = problem.simulator.setup([*parameters, *(term.effect for term in fit.terms)])
    change = problem.whitened(fit.influence, fit.influence.change(without))
    return float((change**2).sum()) > WEIGHT_SHOWS


def _within(problem: Problem, first: Fit, count: int) -> dict[str, float]:
    """Return the residual of the drawing, and of the drawing within its tolerances, in multiples of the noise."""
    if problem.tolerances is None or not len(first.x):
        return {}
    return {"nominal": rms_of_sum(problem.drawn.chi2, count), "calibrated": rms_of_sum(first.chi2, count)}


def _without_laws(problem: Problem, first: Fit, last: Fit) -> float:
    """Return the chi squared that the laws began with: toleranced parameters held, which else take a part of it."""
    if problem.tolerances is None:
        return first.chi2
    return last.chi2 + float((problem.change(last, ()) ** 2).sum())


def _unexplained(start: float, last: Fit, count: int, named: bool) -> bool:
    """Return True where structure is left over that no law takes away; `start` is the chi squared without any."""
    rms, began = rms_of_sum(last.chi2, count), rms_of_sum(start, count)
    rough = named and rms <= ROUGH and (rms**2 - 1) <= ROUGH_SHARE * (began**2 - 1)
    return rms > clean_bound(count) and not rough


def _with_unknown(
    findings: Sequence[Finding],
    problem: Problem,
    selection: Selection,
    labels: np.ndarray,
    count: int,
    robot: Robot,
    tell: Tell,
) -> tuple[list[Finding], Finding | None, Fit]:
    """Return the findings that stand, what no law explains (None where it has no place), the fit of those that stand.

    A law that takes most of the residual and leaves a shape behind is an imitation. Beside what is unknown a law stands
    that leaves noise where the unknown's place may deform as it likes; else only what far outweighs the rest. Laws in a
    row that together still miss are nobody's faults.
    """
    kept, found, fit = _outweighing(list(findings), selection.last, problem, selection.first, count, robot)
    if found is None:
        return kept, None, fit
    # what else there is, whatever happens at that place
    freed = problem.freed(fit.influence, found.module)
    begin = freed.fit_at((), selection.first.run)
    again = select(freed, selection.library, labels, begin, tell)
    beside = problem.fit_at(again.last.terms, again.last.run)
    # else what was freed has taken what the others explain, or they explain what it alone did
    if _leaves_noise(problem, again.last, found.module) and _no_worse(problem, selection.first, beside, labels):
        around = cross_validated(freed, again.last, labels[again.last.samples])
        kept = [finding_of(freed, again.last, index, again, robot, around) for index in range(len(again.last.terms))]
        fit, found = beside, locate(problem, beside) or found
    statement = (
        "structure is left over that no law of the library takes away; a deformation of "
        f"{found.module} by a law of its own would take away {100 * found.share:.0f} % of it"
    )
    share = found.curve.gain / fit.chi2
    if found.follows is not None:
        what, share = found.follows
        statement += f". It follows {what} ({100 * share:.0f} %)"
    unknown = Finding(
        physics="unknown",
        location=found.module,
        candidates=found.candidates,
        parameters={},
        heldout_gain=float(share),
        statement=statement,
        curve=found.curve,
    )
    return kept, unknown, fit


def _outweighing(
    kept: list[Finding], fit: Fit, problem: Problem, first: Fit, count: int, robot: Robot
) -> tuple[list[Finding], Located | None, Fit]:
    """Return the findings that each take `IMITATED` times what is left, where that sits, and their fit."""
    while True:
        least = IMITATED * max(fit.chi2 - count, 0.0)
        gains = [chi2_without(problem, fit, index) for index in range(len(kept))]
        if min(gains, default=np.inf) >= least:
            return kept, locate(problem, fit), fit
        kept.pop(int(np.argmin(gains)))
        terms = [term for term in fit.terms if any(term.effect == finding.effect for finding in kept)]
        fit = problem.refine(terms, first) if terms else first
        kept = [
            replace(
                finding,
                effect=term.effect,
                parameters=parameters_of(problem, fit, index),
                statement=term.effect.statement(robot.mechanism),
            )
            for index, (finding, term) in enumerate(zip(kept, fit.terms, strict=True))
        ]


def _leaves_noise(problem: Problem, fit: Fit, module: str) -> bool:
    """Return True where a fit leaves noise while a module deforms as it likes, which takes numbers away."""
    free = np.linalg.norm(problem.reach(fit.influence, module), axis=1) > 0.5
    count = max(problem.count(fit) - int(free[fit.run.solved[fit.samples]].sum()), 1)
    return fit.chi2 <= clean_bound(count) ** 2 * count


def _no_worse(problem: Problem, first: Fit, fit: Fit, labels: np.ndarray) -> bool:
    """Return True where the laws of a fit do not raise the residual: neither the whole nor that of blocks left out."""
    held = [cross_validated(problem, each, labels[each.samples]) for each in (first, fit)]
    return fit.chi2 <= first.chi2 and held[1] <= held[0]


def _channels(
    stack: Stack, samples: np.ndarray, before: Array, after: Array, raw_before: Array, raw_after: Array
) -> dict[str, dict[str, float]]:
    out: dict[str, dict[str, float]] = {}
    for name, si, columns in stack.groups():
        unit = f"u{si}"
        here = stack.exists[samples][:, columns]
        count = int(here.sum())
        if not count:
            continue
        out[name] = {
            "before": rms_of_sum(float((before[:, columns] ** 2)[here].sum()), count),
            "after": rms_of_sum(float((after[:, columns] ** 2)[here].sum()), count),
            f"before_{unit}": 1e6 * rms_of_sum(float((raw_before[:, columns] ** 2)[here].sum()), count),
            f"after_{unit}": 1e6 * rms_of_sum(float((raw_after[:, columns] ** 2)[here].sum()), count),
        }
    return out
