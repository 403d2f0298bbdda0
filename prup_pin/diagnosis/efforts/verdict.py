"""From what was fitted to a diagnosis: what is found, what stays unknown, and all that is told of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from ...recordings.columns import AS_LOGGED
from ...spatial import Array
from ..criteria import (
    EFFORT_FOREIGN,
    EFFORT_LOUD,
    EFFORT_NO_MATTER,
    EFFORT_NO_NOISE,
    EFFORT_SURE,
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
from .findings import beyond_found, gains_found, laws_found
from .noise import EffortNoise
from .outcome import Outcome
from .residuals import residuals_of, rms_of, shares_of
from .search import worth
from .unknown import (
    body_unknown,
    changing_unknown,
    curve_unknown,
    foreign_unknown,
    loud_unknown,
    unknown_at,
    unmoved_unknown,
    untold_unknown,
    worse_unknown,
)

__all__ = ["effort_diagnosis_of"]


def effort_diagnosis_of(outcome: Outcome) -> EffortDiagnosis:
    """Return the diagnosis of what was fitted."""
    efforts, motion = outcome.efforts, outcome.motion
    added = efforts.added(outcome.named, outcome.x_named)
    every = efforts.every
    gains = list(gains_found(outcome))
    in_own_units = any(finding.conventions for finding in gains)
    # where that is how the log is written, it is read so before the robot file is held against it
    read = outcome.scale if in_own_units else np.ones_like(outcome.scale)
    measured, rigid = efforts.measured[every] * outcome.scale, efforts.rigid[every] * read
    predicted = (efforts.rigid + efforts.filter(added))[every] * outcome.scale
    told = outcome.noise
    declared = bool(outcome.recording.noise.effort)
    noise = outcome.noise_sizes
    before, after, by_joint = residuals_of(outcome, added, noise, outcome.scale / read)
    findings = [*gains, *laws_found(outcome)]
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
    held = measured - efforts.held_out_residual(outcome.given, outcome.named) * outcome.scale
    shares = shares_of(outcome, rigid, predicted, held)
    if outcome.given.columns.count < FEWEST_EFFORT_BLOCKS:
        unknown = [unknown_at("robot", f"{len(every)} samples of efforts are too few to judge anything by others")]
    else:
        unknown = unknown or (
            list(_beyond_declared(after, by_joint))
            if declared
            else list(_unmoved(outcome, measured, rigid, predicted, by_joint))
            or list(_changing(outcome, added, told))
            or list(_no_noise(outcome, measured, shares, by_joint))
        )
        if not unknown and _is_foreign(shares["all"]):
            unknown = [foreign_unknown(shares["all"]["rigid"], shares["all"]["heldout"])]
        named = {finding.location for finding in unknown}
        unknown += [item for item in _worse(outcome, measured, rigid, held, shares) if item.location not in named]
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
        units=tuple(
            AS_LOGGED if in_own_units else outcome.mechanism.joint(name).effort_unit for name in outcome.at.driven
        ),
        time=motion.time[every],
        measured=measured,
        rigid=rigid,
        predicted=predicted,
        speed=np.column_stack([outcome.at.speed(name)[every] for name in outcome.at.driven]),
        position=np.column_stack([outcome.at.position(name)[every] for name in outcome.at.driven]),
        good=efforts.good,
        band=dict(zip(outcome.at.driven, motion.band.cutoffs, strict=True)),
        noise=noise * outcome.scale,
        how=tuple(told[name].how for name in outcome.at.driven),
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
        sliding=tuple(name for name in outcome.at.driven if outcome.mechanism.joint(name).slides),
    )


def _is_foreign(share: Mapping[str, float]) -> bool:
    """Return True where the drawing foretells less than nothing of the efforts, and no correction most of them.

    A correction that takes the drawn efforts away leaves the noise, which speaks for no robot at all.
    """
    return share["rigid"] > EFFORT_FOREIGN and share["heldout"] > EFFORT_UNTOLD


def _beyond_declared(after: Mapping[str, float], by_joint: Mapping[str, Mapping[str, float]]) -> Iterator[Finding]:
    """Yield that what is left is more than the noise that was declared."""
    if after["fit"] > EFFORT_LOUD:
        worst = max(by_joint, key=lambda name: by_joint[name]["after"])
        yield loud_unknown(worst, by_joint[worst]["after"])


def _no_noise(
    outcome: Outcome,
    measured: Array,
    shares: Mapping[str, Mapping[str, float]],
    by_joint: Mapping[str, Mapping[str, float]],
) -> Iterator[Finding]:
    """Yield that too much is left to be noise, by what the recording alone tells of that: where most of it is."""
    sizes = {name: rms_of(measured[outcome.efforts.good[:, k], k]) for k, name in enumerate(outcome.at.driven)}
    loud = [
        name
        for name in outcome.at.driven
        if shares[name]["heldout"] > EFFORT_UNTOLD and not by_joint[name]["after"] <= EFFORT_NO_NOISE
    ]
    if loud:
        worst = max(loud, key=lambda name: shares[name]["heldout"] * sizes[name])
        yield untold_unknown(worst, shares["all"]["heldout"], shares[worst]["heldout"], by_joint[worst]["after"])


def _unmoved(
    outcome: Outcome, measured: Array, rigid: Array, predicted: Array, by_joint: Mapping[str, Mapping[str, float]]
) -> Iterator[Finding]:
    """Yield joints whose effort changes though their position never does: by more than noise and what friction holds.

    Friction at rest may hold any part of what the load on the joint changes by, and no more.
    """
    scatter = EFFORT_NO_NOISE * outcome.noise_sizes * outcome.scale
    for column, name in enumerate(outcome.at.driven):
        good = outcome.efforts.good[:, column]
        if outcome.at.moves(name) or outcome.motion.standing or not good.any():
            continue
        size, left = rms_of(measured[good, column]), float(np.std((measured - predicted)[good, column]))
        held = float(np.hypot(np.std(rigid[good, column]), scatter[column]))
        if left > max(EFFORT_NO_MATTER * size, held):
            yield unmoved_unknown(name, left / size, by_joint[name]["after"])


def _changing(outcome: Outcome, added: Array, told: Mapping[str, EffortNoise]) -> Iterator[Finding]:
    """Yield that what is left follows some motion by amounts that change, where the motion has its power."""
    efforts, motion = outcome.efforts, outcome.motion
    judged, names = efforts.judged, outcome.at.driven
    measured, left = (
        judged(values, motion.piece)[efforts.every] * outcome.scale
        for values in (motion.efforts, motion.efforts - outcome.at.rigid - added)
    )
    noise = [told[name].below(cutoff) for name, cutoff in zip(names, judged.cutoffs, strict=True)]
    yield from changing_unknown(efforts, left, measured, np.nan_to_num(noise))


def _worse(
    outcome: Outcome, measured: Array, rigid: Array, held: Array, shares: Mapping[str, Mapping[str, float]]
) -> Iterator[Finding]:
    """Yield joints of which the corrected model predicts the effort surely worse than the drawing, by what matters."""
    for column, name in enumerate(outcome.at.driven):
        drawn, left = shares[name]["rigid"], shares[name]["heldout"]
        if not (left > EFFORT_NO_MATTER and left > (1 + EFFORT_NO_MATTER) * drawn):
            continue
        counts = outcome.efforts.good[:, column]
        first, last = (np.where(counts, measured[:, column] - values[:, column], 0.0) ** 2 for values in (rigid, held))
        parts = outcome.given.columns.parts
        _, sure = worth(*(np.array([float(squares[part].sum()) for part in parts]) for squares in (last, first)))
        if sure > EFFORT_SURE:
            yield worse_unknown(name, drawn, left)


def _doubtful(outcome: Outcome, unknown: Sequence[Finding]) -> list[EffortCandidate]:
    """Return laws by a joint's position beside which structure is left: beyond its travel they say nothing."""
    places = {finding.location for finding in unknown} & set(outcome.at.driven)
    return [term for term in outcome.named.terms if term.law.within_travel and term.place.name in places]
