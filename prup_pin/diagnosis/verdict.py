"""The verdict, made from the final state alone: what is found, what is left, and what stays unknown."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..channels import Stack
from ..laws import Effect
from ..laws.as_found import AsFound
from ..numbers import counted, number, quantity
from ..recordings import SENSORS
from ..spatial import Array
from .all_over import all_over
from .calibrate import (
    calibrated_parameters,
)
from .criteria import FEWEST_NUMBERS, LITTLE, MOST, MOST_LISTED, NEARLY, WEIGHT_SHOWS, clean_bound
from .diagnosis import Diagnosis
from .evidence import is_clean
from .findings import (
    always_acting,
    calibrated_beyond,
    finite_deflection,
    rms_of_sum,
    sensor_displaced,
    target_turned,
    with_neutral_values,
)
from .identify import not_detectable, visible
from .locate import recovered, residuals
from .next_experiment import next_experiment
from .posterior import joint_posterior
from .prepare import Prepared, Tell
from .problem import Fit, Problem
from .search import Selection
from .since import since_of, told_since
from .unexplained import Final


def verdict_of(
    problem: Problem, selection: Selection, final: Final, prepared: Prepared, blocks: np.ndarray, tell: Tell
) -> Diagnosis:
    """Return the diagnosis of a final state. blocks (N,): labels of samples that are held out together."""
    first, fit, count, robot = problem.first, final.fit, final.count, problem.simulator.robot
    samples, remarks = fit.samples, prepared.remarks
    before = problem.whitened(first.influence, prepared.raw_linear)
    white_before = rms_of_sum(float((before**2).sum()), count)
    white_after, white_held = rms_of_sum(fit.chi2, count), rms_of_sum(final.held_out, count)
    if final.in_doubt:
        white_before = white_after = white_held = float("nan")  # in multiples of a noise that nobody knows
    calibrated = [] if problem.tolerances is None else calibrated_parameters(problem, fit)
    acting: tuple[Effect, ...] = ()
    if problem.tolerances is not None and count and _shows(problem, fit):
        acting = problem.tolerances.effects
    silent = not final.laws and final.unknown is None and white_before > clean_bound(count)
    began = problem.whitened(first.influence, prepared.raw_registered)
    deflection = finite_deflection(problem.drawn, selection.last, began, silent)
    laws = sorted((*final.laws, *([deflection] if deflection else [])), key=lambda finding: -finding.heldout_gain)
    # a kind that is off all over has no tolerance but the one that these data gave it, and is told as a whole
    beyond = [
        item for item in calibrated if item.is_beyond(len(calibrated)) and item.deviation.kind not in prepared.kinds
    ]
    if beyond and (final.unknown is not None or not is_clean(problem, fit)):
        # what no law explains drives them: they are no findings of their own
        remarks.append(_driven_beyond([item.name for item in beyond]))
        beyond = []
    # what acts was left out of the simulation that one starts from, be it without a parameter; the loaded equilibrium
    # is a matter of how one simulates
    left_out = acting and prepared.earlier is None
    named = bool(final.laws or left_out or beyond or prepared.kinds or prepared.placed.undeclared)
    verdict = "unexplained" if final.unknown is not None else "explained" if named else "nothing_missing"
    if final.unknown is not None and count and not len(prepared.toleranced) and not robot.mechanism.loops:
        remarks.append(_UNCALIBRATED)
    moved_sensor = zip(prepared.placed.found, prepared.placed.deviations, strict=True)
    findings = [sensor_displaced(*each, first, before, robot, calibrated) for each in moved_sensor]
    turned = zip(prepared.placed.turned, prepared.placed.turned_deviations, strict=True)
    findings += [target_turned(*each, first, before, robot, calibrated) for each in turned]
    findings += laws
    findings += [calibrated_beyond(item, final.held_out) for item in beyond]
    for usual, said in ((False, _stand_ins), (True, _as_usual)):
        stated = [effect.statement(robot.mechanism) for effect in final.stand_ins if effect.is_unremarkable == usual]
        remarks += [said(stated)] if stated else []
    findings = [with_neutral_values(finding, robot) for finding in findings]
    told = {*SENSORS["pose_sensor"]} if prepared.placed.found else set()
    told |= {"target_rotation"} if prepared.placed.turned else set()
    kinds = [kind for kind in prepared.kinds if kind not in told]
    findings += all_over(problem, fit, calibrated, kinds, blocks, not findings)
    findings += [final.unknown] if final.unknown is not None else []
    found = [*(finding.effect for finding in findings if finding.effect is not None), *final.stand_ins]
    changed = [effect for effect in found if effect.law.instead_of is not None]
    # a sensor reports what all the others have left
    effects = tuple(effect for effect in found if effect not in (*changed, *prepared.placed.undeclared))
    effects = (*effects, *prepared.placed.every)
    standing = _standing(problem, fit, changed)
    if problem.tolerances is not None:
        findings += [always_acting(effect, robot) for effect in acting]
        effects = (*problem.tolerances.effects, *effects)
    effects = (*standing, *effects)
    known = joint_posterior(problem, fit, standing, effects) if count else None
    raw_after = problem.stack.residual(fit.run)[samples]
    if count:
        findings = [
            replace(
                finding,
                recovered=recovered(problem, fit, raw_after, finding.effect, finding.curve, final.stand_ins),
            )
            for finding in findings
        ]
    since = None
    if prepared.earlier is not None and count:
        since = since_of(prepared.earlier, problem, fit, selection.library)
        findings = [told_since(finding, since) for finding in findings]
    remarks += _noise_too_large(problem, fit)
    nothing = verdict == "nothing_missing" and count and since is None
    tell("the next experiment", 0.95)
    return Diagnosis(
        verdict=verdict,
        noise=problem.noise,
        before={"fit": white_before, "heldout": white_before},
        after={"fit": white_after, "heldout": white_held},
        within=_within(problem, first, count),
        calibration=tuple(calibrated),
        by_channel=_channels(problem.stack, samples, before, fit.residual, prepared.raw_linear, raw_after),
        findings=tuple(findings),
        not_detectable=tuple(not_detectable(problem, fit, selection)) if count else (),
        seen=tuple(visible(problem, fit, selection.library)) if nothing else (),
        next_experiment=next_experiment(problem, selection, final.unknown, final.laws),
        remarks=tuple(dict.fromkeys(remarks)),
        unused_columns=prepared.unused,
        effects=effects,
        samples=samples,
        columns=problem.stack.groups(),
        residual_before=prepared.raw_linear,
        residual_after=raw_after,
        residuals=residuals(problem, fit, prepared.raw_linear, raw_after) if count else None,
        final=fit.run,
        posterior=known,
        since=since,
        stand_ins=final.stand_ins,
        premises=tuple(_noise_not_as_declared(prepared.problem, problem)),
    )


def _standing(problem: Problem, fit: Fit, changed: Sequence[Effect]) -> tuple[Effect, ...]:
    """Return the effects that act before any law of a fit, what was found before as it has changed."""
    if problem.tolerances is None or not len(fit.x):
        return problem.simulator.acting
    effect = problem.tolerances.toleranced.effect(fit.x, changed)
    return effect.law.at(effect.values) if isinstance(effect.law, AsFound) else (effect,)


def _driven_beyond(names: Sequence[str]) -> str:
    """Return a sentence on parameters that what no law explains drives beyond their tolerances."""
    listed = ", ".join(names[:MOST_LISTED]) + (", …" if len(names) > MOST_LISTED else "")
    return (
        f"{counted(len(names), 'parameter')} would be beyond tolerance ({listed}), but while part of the residual "
        "is unexplained they may only imitate it"
    )


def _stand_ins(statements: Sequence[str]) -> str:
    """Return a sentence on laws that the corrected model has though nobody names them."""
    return (
        "the corrected model follows laws that are no findings, for they may only imitate what is missing; without "
        f"them it would predict worse: {'; '.join(statements)}"
    )


def _as_usual(statements: Sequence[str]) -> str:
    """Return a sentence on laws that the corrected model has and that are no more than on any such device."""
    return f"no finding, for it is as small as on any such sensor, but in the corrected model: {'; '.join(statements)}"


#: What may help where a tree is left unexplained and taken at its word.
_UNCALIBRATED = (
    "nothing is declared to be off: the robot file is taken at its word. Zeros of encoders, links, markers of an arm "
    "that was never calibrated are: --tolerances arm takes usual values, docs/tolerances.md says which"
)


def _shows(problem: Problem, fit: Fit) -> bool:
    """Return True where what is always present, weight, moves what was measured by more than chance."""
    assert problem.tolerances is not None
    light = replace(problem, tolerances=replace(problem.tolerances, effects=()))
    without = light.setup(fit.effects, fit.x)
    change = problem.whitened(fit.influence, fit.influence.change(without))
    return float((change**2).sum()) > WEIGHT_SHOWS


def _noise_too_large(problem: Problem, fit: Fit) -> Iterator[str]:
    """Yield where far less is left than the declared noise, of numbers that no fit of so few parameters can take away.

    By units, since one that is too large hides nothing of the other. One that repeats tell is told before.
    """
    free, exists = len(fit.x) + sum(len(term.effect.values) for term in fit.terms), problem.compared(fit.run)
    for name, unit in (("position", "m"), ("rotation", "rad")):
        declared = problem.noise.of_unit(unit)
        seen = [exists[:, where] for _, own, where in problem.stack.groups() if own == unit]
        left = [fit.residual[:, where] for _, own, where in problem.stack.groups() if own == unit]
        count = sum(int(here.sum()) for here in seen)
        if problem.noise.source != "declared" or free > MOST * count or count < FEWEST_NUMBERS:
            continue
        size = rms_of_sum(sum(float((rest[here] ** 2).sum()) for rest, here in zip(left, seen, strict=True)), count)
        if size < LITTLE:
            yield (
                f"{name}_noise is declared as {quantity(declared, unit)}, but only {number(size, 2)} times that is "
                "left of what was measured: is its unit right? Where it is too large, effects are overlooked"
            )


def _noise_not_as_declared(drawn: Problem, problem: Problem) -> Iterator[str]:
    """Yield where all is told by a noise that is larger than was declared, by more than nearly the same."""
    units = [unit for unit in ("m", "rad") if any(own == unit for _, own, _ in problem.stack.groups())]
    before, after = ([noise.of_unit(unit) for unit in units] for noise in (drawn.noise, problem.noise))
    if drawn.noise.source != "declared" or not any(b > NEARLY * a for a, b in zip(before, after, strict=True)):
        return
    declared, taken = (
        " and ".join(quantity(value, unit) for value, unit in zip(values, units, strict=True))
        for values in (before, after)
    )
    yield (
        f"The noise is taken to be {taken}, not {declared} as declared: what is left is so large, and follows nothing "
        "that was recorded. If the declared noise is right, something is missing"
    )


def _within(problem: Problem, first: Fit, count: int) -> dict[str, float]:
    """Return the residual of the drawing, and of the drawing within its tolerances, in multiples of the noise."""
    if problem.tolerances is None or not len(first.x):
        return {}
    return {"nominal": rms_of_sum(problem.drawn.chi2, count), "calibrated": rms_of_sum(first.chi2, count)}


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
