"""From the final state to a diagnosis: verdict, findings, the corrected model, the next motion and remarks."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace

import numpy as np

from ...dynamics import INERTIAL
from ...laws import Effect, Place
from ...laws.efforts import Body, curve_by_position
from ...laws.efforts.deviations import effects_of_deviations
from ...mechanism.assumed import masses_in_doubt
from ...numbers import counted, number
from ..criteria import AS_GOOD, IMITATED
from ..diagnosis import Finding
from .belongs import CHECK_ROBOT
from .diagnosis import EffortDiagnosis
from .final_state import FinalState
from .findings import beyond_found, gains_found, laws_found
from .gains import law_of_gains
from .identify import efforts_not_detectable, efforts_visible
from .outliers import OutlierInterval
from .problem import EffortCandidate
from .residuals import curves_of, residuals_of
from .unexplained import beyond_declared, structure_left, unexplained


def effort_diagnosis_of(final: FinalState, held: Sequence[OutlierInterval] = ()) -> EffortDiagnosis:
    """Return the diagnosis of a final state. held: of its outliers those where dry friction may hold what is left."""
    efforts, motion, driven = final.efforts, final.motion, final.at.driven
    residuals = residuals_of(final)
    findings, structure = [*gains_found(final), *laws_found(final)], structure_left(final)
    beyond, remarks = list(beyond_found(final)), _remarks_of(final)
    if structure and beyond:
        # what no law explains drives them: they are no findings of their own
        names = ", ".join(name for finding in beyond for name in finding.parameters)
        remarks.append(f"{names} would be beyond tolerance, but may only imitate what is unknown")
    else:
        findings += beyond
    loud = beyond_declared(residuals) if final.recording.noise.effort else {}
    imitating = [finding for finding in findings if _may_imitate(final, finding, loud)]
    findings = [finding for finding in findings if finding not in imitating]
    if imitating:
        names = ", ".join(f"{finding.physics.replace('_', ' ')} at {finding.location}" for finding in imitating)
        remarks.append(f"the corrected model follows {names}, which may only imitate what is unknown there")
    findings.sort(key=lambda finding: -finding.heldout_gain)
    unknown = unexplained(final, residuals, structure)
    doubtful = _doubtful(final, unknown)
    remarks += [
        f"the curve of {name} over its position is continued as a constant beyond the travel that was recorded: no law "
        "explains all of it"
        for name in dict.fromkeys(term.place.name for term in doubtful)
    ]
    advice = _advice_of(final, findings, unknown)
    unknown += [interval.finding() for interval in final.outliers if interval not in held]
    remarks += [interval.where_friction_holds for interval in held]
    # how a log may be meant is a question where something is left alone, and then it comes before all else
    doubts = tuple(final.doubts) if unknown else ()
    if any(doubt.of_robot for doubt in doubts):
        findings = [replace(finding, advice=f"nothing before this is settled: {CHECK_ROBOT}") for finding in findings]
    return EffortDiagnosis(
        joints=driven,
        units=final.units,
        time=motion.time[efforts.kept],
        measured=residuals.measured,
        rigid=residuals.rigid,
        predicted=residuals.predicted,
        speed=np.column_stack([final.at.speed(name)[efforts.kept] for name in driven]),
        position=np.column_stack([final.at.position(name)[efforts.kept] for name in driven]),
        good=efforts.good,
        band=dict(zip(driven, motion.band.cutoffs, strict=True)),
        noise=final.noise_sizes * final.scale,
        how=tuple(final.noise[name].how for name in driven),
        before=residuals.before,
        after=residuals.after,
        by_joint=residuals.by_joint,
        shares=residuals.shares,
        findings=(*findings, *unknown),
        effects=tuple(effects_of(final, doubtful)),
        curves=tuple(curves_of(final)),
        verdict="unexplained" if unknown else "explained" if findings else "nothing_missing",
        not_detectable=tuple(efforts_not_detectable(final)),
        seen=() if findings or unknown else tuple(efforts_visible(final)),
        advice=advice,
        remarks=tuple(remarks),
        rows=motion.rows[efforts.kept],
        standing=motion.standing,
        separate=motion.separate,
        sliding=tuple(name for name in driven if final.mechanism.joint(name).slides),
        premises=(*(doubt.text for doubt in doubts), *_premises_of(final)),
    )


def _may_imitate(final: FinalState, finding: Finding, loud: Collection[str]) -> bool:
    """Return whether a law acts where joints leave more than noise, and takes too little to be told from that."""
    of = [term for term in final.laws if (term.law.physics, term.place.name) == (finding.physics, finding.location)]
    acts = {final.at.driven[joint] for term in of for joint in final.problem.columns.joints_of(term)}
    return bool(acts & set(loud)) and not finding.times**2 - 1 >= IMITATED


def _doubtful(final: FinalState, unknown: Sequence[Finding]) -> list[EffortCandidate]:
    """Return laws by a joint's position beside which structure is left: beyond its travel they say nothing."""
    places = {finding.location for finding in unknown} & set(final.at.driven)
    return [term for term in final.model.terms if term.law.within_travel and term.place.name in places]


def _advice_of(final: FinalState, findings: Sequence[Finding], unknown: Sequence[Finding]) -> str:
    """Return which motion to record next; empty where nothing is in doubt."""
    slow = [
        name
        for name in final.at.driven
        if not final.at.moves(name) or final.motion.still[:, final.motion.names.index(name)].mean() > 0.5
        if name in final.motion.names
    ]
    if slow:
        return f"record again with {', '.join(slow)} in motion, at several speeds and both ways"
    if unknown:
        where = unknown[0].location
        return (
            f"move {where} alone, slowly and fast, over its whole travel and both ways, with the others in several "
            "postures: that tells apart what depends on its speed, its position and its load"
        )
    doubtful = [finding.location for finding in findings if finding.alternatives]
    moving = [name for name in doubtful if name in final.at.driven]
    if moving:
        return f"move {moving[0]} at several constant speeds, both ways, and accelerate it hard in between"
    return ""


def _remarks_of(final: FinalState) -> list[str]:
    """Return remarks on the motion, and on what it cannot tell."""
    motion, efforts = final.motion, final.efforts
    remarks = list(motion.remarks)
    compared = (motion.compared | motion.saturated)[efforts.kept].mean(axis=0)
    still = [(name, 1 - share) for name, share in zip(final.at.driven, compared, strict=True) if share < 0.98]
    if still:
        (first, share), *others = still
        more = "".join(f", {name} in {number(100 * share, 2)} %" for name, share in others)
        remarks.append(
            f"{first} stands still in {number(100 * share, 2)} %{more} of the samples: friction takes any value there, "
            "and these samples were not used for it"
        )
    if final.gains is None and (off := final.gains_off):
        told = ", ".join(
            f"{name} {number(100 * gain, 3, signed=True)} % (95 %: {number(100 * (gain - reach), 3, signed=True)} to "
            f"{number(100 * (gain + reach), 3, signed=True)} %)"
            for name, (gain, reach) in off.items()
        )
        remarks.append(f"within their tolerance, drives' gains are off: {told}; friction is told as it is reported")
    remarks += masses_in_doubt(final.mechanism)
    rank, count = efforts.inertial_rank()
    if count:
        remarks.append(
            f"this motion determines {counted(rank, 'combination')} of the {count} inertial parameters of the moving "
            "links; the others stay as drawn"
        )
    for term in final.laws:
        if term.law.body is Body.ALL_LINKS:
            untold = _by_link(efforts.base_parameters(term.law).silent)
            remarks.append(f"this motion says nothing about {untold}: what it does not show stays as drawn")
            times, reach = final.heaviness_of(term)
            unlikely = times + reach < 1 / AS_GOOD or times - reach > AS_GOOD
            if unlikely and final.gains is None:
                remarks.append(
                    f"all links together come out {number(times, 2)} times as heavy as in the robot file (95 %: "
                    f"{number(times - reach, 2)} to {number(times + reach, 2)}): efforts in another unit look so too; "
                    'where the masses are right, declare "tolerances": {"effort_gain": 1}'
                )
    return remarks


def _premises_of(final: FinalState) -> tuple[str, ...]:
    """Return what was taken for granted of drives whose position was not recorded; loops tell it."""
    silent = [name for name in final.mechanism.actuated if name not in final.motion.names]
    if not silent or final.mechanism.loops:
        return ()
    columns, stood = ", ".join(f"q.{name}" for name in silent), "it" if len(silent) == 1 else "each of them"
    return (
        f"No position was recorded of {', '.join(silent)} (no column {columns}): all that follows takes {stood} to "
        "have stood at home.",
    )


def _by_link(names: Sequence[str]) -> str:
    """Return names of inertial parameters in words, link by link."""
    links: dict[str, list[str]] = {}
    for name in names:
        link, _, what = name.rpartition(".")
        links.setdefault(link, []).append(what)
    told = []
    for link, silent in links.items():
        shown = " and ".join(name for name in INERTIAL if name not in silent)
        most = f"{link} but its {shown}" if shown else link
        told.append(most if 2 * len(silent) > len(INERTIAL) else f"{link}: {', '.join(silent)}")
    return "; ".join(told)


def effects_of(final: FinalState, doubtful: Sequence[EffortCandidate]) -> Iterator[Effect]:
    """Yield all effects of the corrected model: laws that add something, and toleranced parameters.

    doubtful: laws told as curves.
    """
    gains = [] if final.gains is None else final.efforts.gains_among(final.model)[1]
    within = [
        (final.efforts.deviations[index], amount)
        for place, (index, amount) in enumerate(zip(final.model.toleranced, final.x, strict=False))
        if place not in gains
    ]
    yield from effects_of_deviations([item for item, _ in within], np.array([amount for _, amount in within]))
    for term in final.model.terms:
        own = final.x[final.model.slice_of(term)]
        if not own.any():
            continue
        if term in doubtful:
            # as a curve through knots, which ends where its joint's travel does
            efforts = term.law.efforts_per(term.place, term.values, final.at) @ own
            yield Effect(*curve_by_position(term.place.name, efforts, final.at))
            continue
        for law, place, values in term.law.parts(term.place, term.law.fitted(term.place, own, term.values)):
            yield final.effect(law, place, values)
    if final.gains is not None:
        law = law_of_gains()
        for name, gain in zip(final.at.driven, final.reported, strict=True):
            yield Effect(law, Place(name, law.variant), {law.linear[0]: float(gain - 1)})
