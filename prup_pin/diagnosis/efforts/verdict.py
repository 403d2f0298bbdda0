"""From what was fitted to a diagnosis: what is found, what stays unknown, and all that is told of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...numbers import number
from ..criteria import (
    EFFORT_LOUD,
    EFFORT_UNTOLD,
    FEWEST_EFFORT_BLOCKS,
)
from ..diagnosis import Finding
from .advice import advice_of, remarks_of
from .columns import EffortCandidate
from .curves import curves_of
from .detectable import efforts_not_detectable
from .diagnosis import EffortDiagnosis
from .effects import effects_of
from .findings import beyond_found, gains_found, law_found
from .outcome import Outcome
from .residuals import noise_of, residuals_of, rms_of, shares_of
from .unknown import body_unknown, changing_unknown, curve_unknown, unknown_at

__all__ = ["effort_diagnosis_of"]


def effort_diagnosis_of(outcome: Outcome) -> EffortDiagnosis:
    """Return the diagnosis of what was fitted."""
    efforts, motion = outcome.efforts, outcome.motion
    added = efforts.added(outcome.named, outcome.x_named)
    every = efforts.every
    measured, rigid = efforts.measured[every] * outcome.scale, efforts.rigid[every]
    predicted = (rigid + efforts.filter(added)[every]) * outcome.scale
    noise, declared = noise_of(outcome, added)
    before, after, by_joint = residuals_of(outcome, added, noise)
    findings = [
        *gains_found(outcome),
        *(law_found(outcome, term) for term in outcome.laws),
    ]
    unknown = [
        *(curve_unknown(outcome, term) for term in outcome.free),
        *(body_unknown(outcome, term) for term in outcome.impossible),
    ]
    beyond = list(beyond_found(outcome))
    remarks = remarks_of(outcome)
    if unknown and beyond:
        # what no law explains drives them: they are no findings of their own
        names = ", ".join(name for finding in beyond for name in finding.parameters)
        remarks.append(f"{names} would lie beyond tolerance, but may only stand for what is unknown")
    else:
        findings += beyond
    findings.sort(key=lambda finding: -finding.heldout_gain)
    if not unknown and declared and after["fit"] > EFFORT_LOUD:
        worst = max(by_joint, key=lambda name: by_joint[name]["after"])
        unknown = [
            unknown_at(
                worst,
                f"what is left at {worst} is {number(by_joint[worst]['after'], 3)} times the declared "
                "noise; no law of "
                "the library takes it away, and it follows neither speed, position, load nor time",
            )
        ]
    shares = shares_of(outcome, predicted)
    if outcome.given.columns.count < FEWEST_EFFORT_BLOCKS:
        unknown = [unknown_at("robot", f"{len(every)} samples of efforts are too few to judge anything by others")]
    elif not unknown and shares["all"]["heldout"] > EFFORT_UNTOLD and not declared:
        worst = max(
            outcome.at.driven,
            key=lambda name: shares[name]["heldout"] * rms_of(measured[:, outcome.at.driven.index(name)]),
        )
        text = (
            f"{number(100 * shares['all']['heldout'], 3)} % of the efforts are left, most of it at "
            f"{worst}, and no law of "
            "the library takes it away; no noise was declared that it could be"
        )
        unknown = [unknown_at(worst, text)]
    elif not unknown and not declared:
        unknown = list(changing_unknown(efforts, measured - predicted))
    doubtful = _doubtful(outcome, unknown)
    remarks += [
        f"what {name} needs by its position is held beyond the travel that was seen: no law for it was found that "
        "explains all"
        for name in dict.fromkeys(term.place.name for term in doubtful)
    ]
    advice = advice_of(outcome, findings, unknown)
    unknown += [stretch.finding() for stretch in outcome.stretches]
    verdict = "unexplained" if unknown else "explained" if findings else "nothing_missing"
    return EffortDiagnosis(
        joints=outcome.at.driven,
        units=tuple("N" if outcome.mechanism.joint(name).slides else "N m" for name in outcome.at.driven),
        time=motion.time[every],
        measured=measured,
        rigid=rigid,
        predicted=predicted,
        speed=np.column_stack([outcome.at.speed(name)[every] for name in outcome.at.driven]),
        position=np.column_stack([outcome.at.position(name)[every] for name in outcome.at.driven]),
        good=efforts.good,
        band=dict(zip(outcome.at.driven, motion.band.cutoffs, strict=True)),
        noise=noise * outcome.scale,
        declared=declared,
        before=before,
        after=after,
        by_joint=by_joint,
        shares=shares,
        findings=(*findings, *unknown),
        effects=tuple(effects_of(outcome, doubtful)),
        curves=tuple(curves_of(outcome)),
        verdict=verdict,
        not_detectable=tuple(efforts_not_detectable(outcome)),
        advice=advice,
        remarks=(*outcome.doubts, *remarks),
        rows=motion.rows[every],
        standing=motion.standing,
    )


def _doubtful(outcome: Outcome, unknown: Sequence[Finding]) -> list[EffortCandidate]:
    """Return laws by a joint's position beside which structure is left: beyond its travel they say nothing."""
    places = {finding.location for finding in unknown} & set(outcome.at.driven)
    return [term for term in outcome.named.terms if term.law.family == "counterbalance" and term.place.name in places]
