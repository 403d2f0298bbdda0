"""`diagnose_efforts`: from a recorded motion to the diagnosis of its efforts, a step after the other."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ...errors import InputError
from ...laws.efforts import Body
from ...numbers import number
from ...recordings import Recording
from ...recordings.conventions import may_be_read
from ...robot import Robot
from ...spatial import Array
from ..criteria import (
    EFFORT_GAINS,
    FAR_LESS,
    GAIN,
    LITTLE,
    MOST,
    NEARLY,
    NO_MATTER,
    ROUNDS,
    SURE,
    UNSEEN,
)
from ..normal_equations import NormalEquations
from .band import band_of, in_motion
from .bayes_factors import with_likelier_bodies
from .belongs import check_efforts
from .conventions import gain_of
from .diagnosis import EffortDiagnosis
from .evidence import CrossValidation, held_out, relative_gain, savings, scores
from .few_bodies import with_few_bodies, with_law_for_bodies
from .final_state import FinalState, shows
from .gains import (
    Gains,
    are_apart,
    gains_of,
    in_any_unit,
    in_newtons,
    law_of_gains,
    likeliest_logs,
    precision_of_gains,
    scale_of,
    scatter_of_gains,
)
from .noise import EffortNoise, noise_of, true_roundings, true_sizes
from .nonlinear import optimised_in_either_form, refined
from .outliers import OutlierInterval, is_outlying
from .prepare import PreparedEfforts
from .problem import EffortCandidate, EffortModel, fit
from .propose import judged, places_of_laws, proposals
from .residuals import rms_of
from .search import (
    by_what_was_recorded,
    cost_of,
    in_plainest_form,
    kinds_of_most_drives,
    pruned,
    relieving_curve,
    searched,
    with_relieving_laws,
    without_needless_kinds,
    without_needless_nuisances,
)
from .verdict import effort_diagnosis_of

#: The stage that is told while laws are searched.
_LAWS = "laws compete for the efforts"


def diagnose_efforts(
    robot: Robot,
    recording: Recording,
    tell: Callable[[str, float], None] = lambda stage, share: None,
    static_efforts: Mapping[str, Array] | None = None,
    propose: bool | Sequence[str] = False,
) -> EffortDiagnosis:
    """Return what the columns tau of a recording say that a rigid robot's inverse dynamics leave out.

    static_efforts: by joint (N,), what drives hold at rest where more is known than of a rigid robot; NaN where not.
    propose: whether formulas are looked for where something is unknown or more than the declared noise is left; or at
    which joints.

    Raises InputError where the motion cannot be told, is too short, or no effort of a driven joint was recorded.
    """
    tell("the motion", 0.02)
    band, below = band_of(robot.mechanism, recording)

    def prepared(outliers: Sequence[OutlierInterval]) -> PreparedEfforts:
        at = in_motion(robot.mechanism, recording, band, [interval.rows for interval in outliers])
        if static_efforts is not None:
            known = np.column_stack([static_efforts[name][at.motion.rows] for name in at.driven])
            at = replace(at, rigid=np.where(np.isfinite(known), known, at.rigid))
        return PreparedEfforts(at, recording.tolerances.declared, below)

    whole = prepared(())
    if len(whole.kept) < 2:
        raise InputError("one row of efforts tells nothing: record a motion, or several postures at rest")
    if not whole.whitening.good.any():
        lasting = number(len(whole.kept) / (2.5 * whole.at.motion.band.highest), 2)
        raise InputError(
            f"the efforts last {lasting} s, {len(whole.kept)} samples as far apart as their band asks for: that is too "
            "short to tell anything; record for longer"
        )
    noise, outliers = noise_of(recording, whole.at), whole.outliers
    final = _final_state(robot, recording, prepared(outliers) if outliers else whole, noise, outliers, tell)
    held: list[OutlierInterval] = []
    if outliers:
        # what only rough values of laws could not follow is described by those that were optimised
        model = final.with_time
        modelled, _ = final.efforts.modelled(model, fit(model)[0], in_newtons(whole.at, final.scale))
        residual = (whole.measured / final.scale - whole.rigid)[whole.kept] - whole.at_kept(modelled)
        rows = whole.at.motion.rows[whole.kept]
        still = [interval for interval in outliers if is_outlying(interval, rows, residual, whole.good)]
        if len(still) < len(outliers):
            final = _final_state(robot, recording, prepared(still) if still else whole, noise, still, tell)
        held = [interval for interval in still if _friction_holds(final, whole, interval, residual)]
    found = effort_diagnosis_of(final, held)
    found = replace(found, judged=tuple(judged(final, found.findings)))
    if not propose:
        return found
    tell("formulas for what no law explains", 0.95)
    joints = [] if isinstance(propose, bool) else list(propose)
    if propose is True:
        unknown = [item for item in found.findings if item.physics == "unknown"]
        joints = [item.location for item in sorted(unknown, key=lambda item: -item.heldout_gain)]
        if found.declared:  # what laws leave beyond the noise is no less a matter of something else
            joints += [name for name, sizes in found.by_joint.items() if sizes["after"] > NEARLY]
        joints += places_of_laws(final)
    proposed = tuple(proposals(final, list(dict.fromkeys(joints))))
    advice = "; ".join(text for text in (*(item.apart for item in proposed), found.advice) if text)
    return replace(found, proposals=proposed, advice=advice)


def _friction_holds(final: FinalState, whole: PreparedEfforts, interval: OutlierInterval, residual: Array) -> bool:
    """Return whether joints, driven or not, hardly move in an interval, where dry friction may hold anything, and it
    holds no more.

    residual (n, k): of the efforts, intervals included.
    """
    at, inside = whole.at, interval.holds(whole.at.motion.rows[whole.kept])
    limits = np.zeros(len(at.driven))
    for term in final.laws:
        values = term.law.fitted(term.place, final.x[final.model.slice_of(term)], term.values)
        for name, dynamics in term.law.dynamics(term.place, values).items():
            speed = at.speed(name)
            if rms_of(speed[whole.kept][inside]) < LITTLE * rms_of(speed):
                felt = np.abs(at.along(name, np.ones(len(at))))[whole.kept][inside]
                limits += dynamics.friction * felt.max(axis=0)
    columns = [at.driven.index(name) for name in interval.joints]
    return bool((np.abs(residual[inside]).max(axis=0) < 2 * (1 + LITTLE) * limits)[columns].all())


def _final_state(
    robot: Robot,
    recording: Recording,
    prepared: PreparedEfforts,
    noise: Mapping[str, EffortNoise],
    outliers: Sequence[OutlierInterval],
    tell: Callable[[str, float], None],
) -> FinalState:
    """Return the final state of the efforts of a recording without outlier intervals; noise: of each joint's effort."""
    at, tolerances = prepared.at, recording.tolerances.declared

    tell(_LAWS, 0.1)
    as_written = not may_be_read(recording, [gain_of("tau", 1.0)])
    gains = None if as_written and not in_any_unit(tolerances) else gains_of(at, tolerances)
    doubts = check_efforts(at, scale_of(gains, len(at.driven)))
    if gains is not None:
        gains, efforts, model = _in_own_units(prepared, tolerances, gains, _part(partial(tell, _LAWS), 0.1, 0.6))
    if gains is None:
        doubts = check_efforts(at)
        efforts, model = _searched(prepared, _part(partial(tell, _LAWS), 0.1, 0.7))
    tell("what no law explains", 0.75)
    model = with_relieving_laws(efforts, model)
    problem, plain = model.problem, model.in_problem(model.problem.without_curves())
    beside = with_law_for_bodies(efforts, plain, _part(partial(tell, _LAWS), 0.7, 0.75))
    model = with_likelier_bodies(with_few_bodies(beside))
    model = model.in_problem(problem) if beside is plain else model
    model = by_what_was_recorded(efforts, optimised_in_either_form(efforts, model))
    model = in_plainest_form(efforts, model)
    scale = scale_of(gains, len(at.driven))
    sample, rounding = (of(noise, at.driven, scale) for of in (true_sizes, true_roundings))
    model, curves, imitating = _with_curves(efforts, model, sample, rounding)
    tell("the verdict", 0.9)

    def state(model: EffortModel, untold: Sequence[EffortCandidate]) -> FinalState:
        return FinalState(robot, recording, efforts, noise, model, curves, untold, gains, outliers, doubts)

    final, unsure = state(model, imitating), []
    while (needless := final.needless) is not None:
        unsure.append(needless)
        model = model.without(needless)
        final = state(model, imitating)
    # of what every drive has what is likeliest foretells best, be it surely anything or not: it stays, and is not told
    common = [term for term in unsure if term.law.everywhere or term.law.body]
    wider = model.with_term(*common)
    if relative_gain(held_out(model), held_out(wider))[0] <= GAIN:
        return final
    return state(wider, [*imitating, *common])


def _in_own_units(
    prepared: PreparedEfforts, tolerances: Mapping[str, float], gains: Gains, tell: Callable[[float], None]
) -> tuple[Gains | None, PreparedEfforts, EffortModel]:
    """Return the gains beside which laws leave least, the efforts divided by them, and the model that these ask for.

    Every drive's gain stays free beside laws and masses, which else would make up for what the gains are off by; where
    it is another one then, efforts are divided by that, and laws are searched again beside the bodies that are known
    now. Gains by which the robot weighs next to nothing are none. A gain times a body is linear for small steps alone:
    beside bodies that are known gains may change by a little at a time, else twice those bodies less the drawn ones
    were as good as these. All masses and all gains together are one unknown: the gains' part of it is free while most
    masses are as drawn; once those of all links are free, it is what the drawn ones make likeliest. None: most drives
    are in one unit.
    """
    at, physics = in_newtons(prepared.at, gains.gains), law_of_gains().physics
    of_gains, middle = (EFFORT_GAINS, EFFORT_GAINS), np.full(len(gains.gains), np.log(gains.gains).mean())
    known: list[EffortCandidate] = []
    for left in range(ROUNDS - 1, -1, -1):
        efforts = PreparedEfforts(at, {**tolerances, physics: of_gains[0]}, prepared.below, of_gains[1])
        efforts, model = _searched(efforts, tell, known)
        model = with_relieving_laws(efforts, model)
        # where no body foretells as well beside free gains, none stays: given gains are those beside what stays
        model = with_few_bodies(model, most=0)
        masses = any(term.law.body is Body.ALL_LINKS for term in model.terms)
        bodies = efforts.modelled(model, fit(model)[0])[1]
        steps, covariance = _steps_of_gains(efforts, model, bodies, middle - np.log(gains.gains))
        gains = replace(gains, covariance=covariance)
        settled = np.abs(steps) < np.maximum(UNSEEN, LITTLE * gains.deviations)
        if not left or (settled.all() and not (masses and of_gains[1] > UNSEEN)):
            break
        of_gains = LITTLE, UNSEEN if masses else min(of_gains[1], LITTLE)
        gains = replace(gains, gains=gains.gains * np.exp(steps))
        if masses:
            gains = gains.by_masses(gains.gains)
            if gains.masses < FAR_LESS:
                return None, efforts, model
        known = [term for term in model.terms if term.is_body and not model.is_nuisance(term)]
        at = in_newtons(prepared.at, gains.gains).knowing(bodies, np.zeros_like(bodies), bodies)
    if not (gains.alike or in_any_unit(tolerances) or are_apart(np.log(gains.gains), covariance)):
        return None, efforts, model
    return gains, efforts, model


def _steps_of_gains(efforts: PreparedEfforts, model: EffortModel, bodies: Array, middle: Array) -> tuple[Array, Array]:
    """Return by how much the logarithms of gains are larger beside a model (k,), and their covariance (k, k).

    bodies (N, k): the efforts of the model's bodies beyond the drawn ones; middle (k,): about which these logarithms
    scatter. A gain's column is what bodies were known to ask for before the fit. What was new of them in it is as it is
    reported, too, so that a gain is told by how its column lies along all of them.
    """
    at, (drives, own) = efforts.at, efforts.gains_among(model)
    steps, covariance = np.zeros(len(at.driven)), EFFORT_GAINS**2 * np.eye(len(at.driven))
    if not drives:
        return steps, covariance
    x, normal = fit(model)
    where = [model.toleranced[index] for index in own]
    whole = np.linalg.inv(NormalEquations.of(normal).solve(np.eye(len(normal)))[np.ix_(own, own)])
    before, now = (efforts.at_kept(each)[:, drives] for each in (at.borne, at.rigid + bodies))
    along = np.sum(before * now, axis=0) / np.maximum(np.sum(now * now, axis=0), np.finfo(float).tiny)
    per = 1 / (efforts.tolerance_of_gains * np.maximum(along, LITTLE))
    of_all, middle = EFFORT_GAINS, middle[drives]
    if efforts.of_all_gains is not None and efforts.of_all_gains <= UNSEEN:  # it is given
        of_all, middle = UNSEEN, middle - middle.mean()
    told, moment = per[:, None] * (whole - model.problem.precision(where)) * per, per * (whole @ x[own])
    prior = precision_of_gains(scatter_of_gains(told, moment, of_all, middle), of_all, len(drives))
    steps[drives], covariance[np.ix_(drives, drives)] = likeliest_logs(told, moment, prior, middle)
    return steps, covariance


def _searched(
    efforts: PreparedEfforts, tell: Callable[[float], None], known: Sequence[EffortCandidate] = ()
) -> tuple[PreparedEfforts, EffortModel]:
    """Return the efforts with learned priors, and the model that they ask for. known: bodies to begin with.

    Laws are searched beside nuisances that every drive has: of a robot on which everything is a little off, the first
    single law would stand for much that it is not. Where most drives surely have nothing of the kind, the drawing is
    that of this device but for a few laws: those found, without nuisances that are not sure, or those found from
    nothing, one after the other, which need no more to be as good. Where they leave more of held-out blocks, nuisances
    of which none is sure stay: a short motion tells of none of them alone what it tells of all together.

    How a friction turns round and how late signals are look alike, and a search ends near where it began: the ways of
    friction are the usual ones to begin with, or those that suit best before any law is found.
    """

    def beside_known(start: EffortModel) -> EffortModel:
        there = [term.name for term in start.terms]
        keys = [term.key for term in known if term.name not in there]
        return start.with_term(*(one for one in start.problem.candidates if one.key in keys))

    # a friction that turns round on another way than usual would look like none
    start = beside_known(efforts.start_with_nuisances())
    common, _ = efforts.with_learned_variances(refined(efforts, start, range(len(start.terms)), at_last=True))
    start = beside_known(common.start_with_nuisances())
    usual = searched(common, start, _part(tell, 0.0, 0.3))
    sure = without_needless_nuisances(usual)
    if kinds_of_most_drives(sure):
        start = beside_known(common.start_with_nuisances())
        start = refined(common, start, range(len(start.terms)), at_last=True)
        found = searched(common, start.apart(), _part(tell, 0.4, 0.7))
        found = found if relative_gain(held_out(usual), held_out(found))[0] > GAIN else usual
        return common, _as_drawn(common, start, found, _part(tell, 0.7, 1.0))
    usual = without_needless_kinds(usual).apart()
    found = searched(common, sure, _part(tell, 0.4, 0.7))
    plain = searched(common, beside_known(common.start()), _part(tell, 0.7, 1.0))
    if relative_gain(held_out(plain), held_out(found))[0] > GAIN:
        plain = found
    return common, usual if relative_gain(held_out(plain), held_out(usual))[0] > LITTLE else plain


def _as_drawn(
    efforts: PreparedEfforts, start: EffortModel, found: EffortModel, tell: Callable[[float], None]
) -> EffortModel:
    """Return the laws that are asked for where links are as drawn, if these foretell as well and are no more than those
    found beside masses of all links, which follow much that is none of theirs.
    """
    if not found.links_as_drawn:
        return found
    drawn = searched(efforts, start.without(*start.links_as_drawn), tell)
    laws, others = (sum(not model.is_nuisance(term) for term in model.terms) for model in (drawn, found))
    as_good = relative_gain(held_out(drawn), held_out(found))[0] <= GAIN
    return drawn if as_good and laws <= others else found


def _part(tell: Callable[[float], None], first: float, last: float) -> Callable[[float], None]:
    """Return what tells the progress of a part, from `first` to `last` of the whole."""
    return lambda share: tell(first + (last - first) * share)


def _takes_most(efforts: PreparedEfforts, model: EffortModel, curve: EffortCandidate) -> bool:
    """Return whether a curve takes most of what is left of its joint's effort, as it was measured."""
    without, left = (efforts.held_out_squares_at(curve.place.name, each) for each in (model, model.with_term(curve)))
    return left < (1 - MOST) * without


def _with_curves_for_shapes(
    model: EffortModel, curves: Sequence[EffortCandidate]
) -> tuple[EffortModel, list[EffortCandidate]]:
    """Return the model with one curve of no law in the place of several laws that follow one joint's position, where it
    foretells as well, and these curves: of two that are told by their shape the sum is any shape.
    """
    found = []
    for joint in dict.fromkeys(term.place.name for term in model.terms if term.law.by_shape):
        shapes = [
            t for t in model.terms if t.place.name == joint and t.law.against == "position" and not t.law.is_curve
        ]
        if len(shapes) < 2:
            continue
        rest, now = model.without(*shapes), held_out(model)
        own = [c for c in curves if c.place.name == joint and c.law.against == "position"]
        left = CrossValidation(rest).with_each(own)
        best = int(np.argmin(left.sum(axis=1)))
        if relative_gain(left[best], now)[0] <= GAIN:
            model = rest.with_term(own[best])
            found.append(own[best])
    return model, found


def _with_curves(
    efforts: PreparedEfforts, model: EffortModel, noise: Array, rounding: Array
) -> tuple[EffortModel, list[EffortCandidate], list[EffortCandidate]]:
    """Return the model with curves of no law that the efforts still ask for, these, and the laws that imitate them.

    A curve adds as much to its joint as one sample could show, as a law does, beyond what rounding to steps may be,
    which follows what it rounds by a curve. noise, rounding: of a sample (k,). One that takes most of what is left may
    do so in blocks that have little of it, and may be little beside what laws take.

    A law that only imitates something leaves its shape behind: it is not named. Where it serves beside the curve, the
    prediction keeps it.
    """
    found: list[EffortCandidate] = []
    imitating: list[EffortCandidate] = []
    began = CrossValidation(model.with_terms(()))
    for _ in range(3):
        model, curves = efforts.with_curves(model)
        model, shapes = _with_curves_for_shapes(model, curves)
        found += shapes
        alone, validation = model.in_problem(model.problem.only(curves)), CrossValidation(model)
        (ranked, limit), evenly = scores(savings(alone)), scores(savings(alone, evenly=True))
        in_most_blocks = {score.candidate for score in evenly[0] if score.log_chance < evenly[1]}
        tried, best = [], sorted(ranked, key=lambda item: -item.gain)[:8]
        for score, left in zip(best, validation.with_each([item.candidate for item in best]), strict=True):
            told = score.log_chance < limit
            if not told and score.candidate not in in_most_blocks:
                continue
            share, sure = relative_gain(validation.squares, left)
            saving, own = share * float(validation.squares.sum()), validation.squares_at(score.candidate)
            material = saving > GAIN * (began.squares_at(score.candidate) - own) or not model.terms
            much = share > NO_MATTER or saving > FAR_LESS * own
            if sure > SURE and much and ((told and material) or _takes_most(efforts, model, score.candidate)):
                tried.append((share, score.candidate))
        curve = max(tried, key=lambda item: item[0])[1] if tried else relieving_curve(model, curves)
        if curve is None or any(curve.name == other.name for other in found):
            break
        beside = model.with_term(curve)
        size = efforts.sizes(beside, fit(beside)[0])[-1]
        if not shows(np.sqrt(np.maximum(size**2 - rounding**2, 0.0)), noise):
            break
        found.append(curve)
        here = cost_of(model)
        shape = here - cost_of(beside)
        for term in model.terms:
            if term.law.is_curve or term.place.name != curve.place.name or curve.is_of_time:
                continue  # what changes with time is still what it is
            own = cost_of(model.without(term)) - here
            if term.law.by_shape or shape > NO_MATTER * own:
                imitating.append(term)
        # what imitated that shape, or made room for it elsewhere
        doubtful = [term for term in model.terms if term.place.name != curve.place.name] + imitating
        model = pruned(beside, [term for term in doubtful if not term.law.is_curve])
    return model, found, imitating
