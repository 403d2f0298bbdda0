"""`diagnose`: from a robot and a recording to a verdict."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np
from scipy.stats import chi2 as chi_squared

from ..errors import InputError
from ..laws import Inputs
from ..recordings import Recording, suspicions
from ..robot import Robot
from ..simulation import Simulator
from ..spatial import Array, rotation_exp
from .candidates import Candidate, candidates
from .compete import INDISTINCT, Selection, cross_validated, penalty, select
from .detectable import not_detectable
from .diagnosis import Diagnosis, Finding, FittedParameter
from .fit import Fit, Problem
from .local_curve import LocalCurve, strongest_curve
from .locate import locate
from .next_experiment import next_experiment
from .residual import Measured, Noise, estimate_noise

__all__ = ["diagnose"]

#: More samples than this are thinned, whole blocks at a time.
MOST_SAMPLES = 1200
#: Residuals up to this multiple of a declared noise pass for noise where no structure is found in them.
_NOISE_LIKE = 1.10
#: Where a law takes away nearly all, a slightly rough law is still the right one.
_ROUGH = 1.25
_ROUGH_SHARE = 0.01
_STRUCTURE = 1e-4
#: A parameter whose usual change moves the whole residual by less than this share of the noise is not seen.
_UNSEEN = 1e-3

Tell = Callable[[str, float], None]


def _silent(stage: str, share: float) -> None:
    pass


def diagnose(robot: Robot, recording: Recording, *, tell: Tell = _silent) -> Diagnosis:
    """Return what the recording says that the simulation of `robot` left out.

    `tell(stage, share)` hears how far it is. Raises InputError where the recording does not belong to this robot at all
    (units, frames, another machine), UnknownNameError where it lacks the actuators' positions.
    """
    begun = time.perf_counter()
    remarks = [*recording.remarks, *suspicions(recording)]
    recording = _thinned(recording, remarks)
    inputs = _inputs(robot, recording)
    measured = Measured.of(recording)
    remarks += _what_is_missing(inputs, measured)
    simulator = Simulator(robot, inputs)
    tell("the nominal simulation", 0.0)
    nominal = simulator.run()
    _check_belongs(measured, nominal, recording)
    linear = _linear(simulator, nominal)
    noise = _noise(simulator, recording, measured, nominal, inputs)
    problem = Problem(simulator, measured, noise)
    first = problem.fit_at((), nominal)
    samples = first.samples
    white = problem.whiteners(first.influence)
    raw_linear = measured.residual(*linear)[samples]
    before = (white @ raw_linear[..., None])[..., 0]
    library = candidates(robot.mechanism, inputs)
    selection = select(problem, library, inputs.blocks, first, tell)
    tell("the verdict", 0.9)
    return _verdict(problem, selection, inputs, noise, before, raw_linear, remarks, begun, robot, tell)


def _inputs(robot: Robot, recording: Recording) -> Inputs:
    names = robot.mechanism.actuated
    speeds = None
    if recording.velocities and all(name in recording.velocities for name in names):
        speeds = np.stack([recording.velocities[name] for name in names], axis=1)
    return Inputs(
        time=np.array(recording.time),
        actuators=recording.actuator_positions(names),
        wrench=np.array(recording.wrench),
        blocks=recording.blocks(),
        temperature=None if recording.temperature is None else np.array(recording.temperature),
        speeds=speeds,
        runs=recording.run,
    )


def _thinned(recording: Recording, remarks: list[str]) -> Recording:
    """Return at most MOST_SAMPLES samples: whole blocks, evenly chosen; pieces of blocks where there are few."""
    n = len(recording)
    if n <= MOST_SAMPLES:
        return recording
    blocks = recording.blocks()
    starts = np.flatnonzero(np.diff(blocks, prepend=-1))
    count = len(starts)
    typical = n / count
    if typical <= MOST_SAMPLES / 8:
        wanted = max(int(MOST_SAMPLES / typical), 8)
        chosen = np.unique(np.linspace(0, count - 1, wanted).astype(int))
        keep = np.isin(np.searchsorted(starts, np.arange(n), side="right") - 1, chosen)
    else:
        keep = np.zeros(n, bool)
        keep[:: int(np.ceil(n / MOST_SAMPLES))] = True
    rows = np.flatnonzero(keep)[:MOST_SAMPLES]
    remarks.append(f"{n} samples are more than are needed: {len(rows)} of them, evenly chosen, were used")
    return recording.select(rows)


def _what_is_missing(inputs: Inputs, measured: Measured) -> list[str]:
    remarks = []
    if not measured.exists.any():
        remarks.append("no pose was measured (columns p.x … r.z): this recording cannot be compared with a simulation")
    elif not measured.exists[:, 3:].any():
        remarks.append("no rotation was measured: moments and tilts are judged by the position alone")
    elif not measured.exists[:, :3].any():
        remarks.append("no position was measured: forces are judged by the rotation alone")
    force = np.nan_to_num(np.abs(inputs.wrench)).max(initial=0.0)
    if force < 1e-6:
        remarks.append("no load was applied: nothing can be said about stiffness, play or friction")
    if len(np.unique(inputs.blocks)) < 2:
        remarks.append("one pose only: effects of geometry and stiffness look alike")
    return remarks


def _check_belongs(measured: Measured, nominal, recording: Recording) -> None:
    """Raise InputError where recording and robot are worlds apart, with the likely reason."""
    good = nominal.solved & measured.exists[:, :3].all(axis=1)
    if not nominal.solved.any():
        reasons = nominal.geometry.reasons
        first = next(iter(sorted(reasons.items())), None)
        told = f": row {first[0] + 2}: {first[1]}" if first else ""
        raise InputError(
            "the robot reaches none of the recording's poses, or none of its samples is complete"
            f"{told}. Check --robot, the q columns' names and units [m, rad]"
        )
    if good.sum() < 1:
        return
    distance = np.linalg.norm(measured.position[good] - nominal.position[good], axis=1)
    typical = float(np.median(distance))
    size = float(np.median(np.linalg.norm(nominal.position[good], axis=1)))
    if typical < 0.03 * max(size, 0.1):
        return
    ratio = float(np.median(np.linalg.norm(measured.position[good], axis=1))) / size
    for factor, unit in ((1e3, "mm"), (1e-3, "km"), (1e6, "um")):
        if 0.8 < ratio / factor < 1.25:
            raise InputError(
                f"measured positions are about {factor:g} times those of the simulation "
                f"({ratio * size:.4g} against {size:.4g} m): they seem to be in {unit}; expected metres"
            )
    raise InputError(
        f"measured and simulated positions are {typical:.3g} m apart (typical distance {size:.3g} m): this is another "
        "robot, another frame, or other units. Expected p.x p.y p.z in metres in the base frame of the robot file"
    )


def _linear(simulator: Simulator, nominal) -> tuple[Array, Array]:
    """Return the simulation that a user starts from: the rigid pose and C w about it."""
    geometry = nominal.geometry
    n = len(simulator.inputs)
    position, rotation = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan)
    robot = geometry.robot
    tools = np.array([pose.base_from_tool for pose in geometry.poses])
    compliances = np.array([robot.compliance(pose).C for pose in geometry.poses])
    samples = nominal.samples
    rows = geometry.rows[samples]
    moved = (compliances[rows] @ simulator.inputs.wrench[samples][..., None])[..., 0]
    position[samples] = tools[rows, :3, 3] + moved[:, :3]
    rotation[samples] = rotation_exp(moved[:, 3:]) @ tools[rows, :3, :3]
    return position, rotation


def _noise(simulator: Simulator, recording: Recording, measured: Measured, nominal, inputs: Inputs) -> Noise:
    geometry = nominal.geometry
    if not geometry.poses:
        return Noise(1e-6, 1e-5, 0.0, 0.0, "declared")
    compliances = np.array([geometry.robot.compliance(pose).C for pose in geometry.poses])
    each = compliances[np.maximum(geometry.rows, 0)]
    return estimate_noise(recording, measured, each, inputs.blocks, inputs.wrench)


# -- the verdict -------------------------------------------------------------------------------------------------------


def _verdict(
    problem, selection: Selection, inputs, noise, before, raw_linear, remarks, begun, robot, tell
) -> Diagnosis:
    last, first = selection.last, selection.first
    samples = last.samples
    labels = inputs.blocks[samples]
    count = int(problem.measured.exists[samples].sum())
    held = cross_validated(problem, last, labels) if count else 0.0
    rms = _rms(last.chi2, count)
    findings = [_finding(problem, last, index, selection, robot, held) for index in range(len(last.terms))]
    curves = strongest_curve(problem, last) if count else []
    unexplained = _unexplained(first, last, count, curves, bool(findings))
    if unexplained:
        findings = _with_unknown(findings, problem, selection, count)
    deflection = _finite_deflection(first, last, before)
    if deflection is not None:
        findings.append(deflection)
    findings.sort(key=lambda finding: -finding.heldout_gain)
    named = "explained" if findings else "nothing_missing"
    verdict = "unexplained" if unexplained else named
    effects = tuple(finding.effect for finding in findings if finding.effect is not None)
    final = last
    if len(effects) != len(last.terms):
        kept = [term for term in last.terms if any(term.effect == effect for effect in effects)]
        final = problem.refine(kept, first) if kept else first
    white_before = _rms(float((before**2).sum()), count)
    raw_after = problem.measured.residual(final.run.position, final.run.rotation)[samples]
    tell("the next experiment", 0.95)
    diagnosis = Diagnosis(
        verdict=verdict,
        noise=noise,
        before={"fit": white_before, "heldout": white_before},
        after={"fit": rms, "heldout": _rms(held, count)},
        by_channel=_channels(before, last.residual, raw_linear, raw_after, problem.measured.exists[samples]),
        findings=tuple(findings),
        not_detectable=tuple(not_detectable(problem, final, selection)) if count else (),
        next_experiment=next_experiment(robot, problem, selection, findings),
        remarks=tuple(dict.fromkeys(remarks)),
        effects=effects,
        samples=samples,
        residual_before=raw_linear,
        residual_after=raw_after,
        final=final.run,
        timing={"seconds": time.perf_counter() - begun},
    )
    return diagnosis


def _rms(chi2: float, count: int) -> float:
    return float(np.sqrt(chi2 / count)) if count else float("nan")


def _unexplained(first: Fit, last: Fit, count: int, curves: Sequence[LocalCurve], named: bool) -> bool:
    """Return True where structure is left over that no law takes away."""
    if not count:
        return False
    rms, began = _rms(last.chi2, count), _rms(first.chi2, count)
    structured = bool(curves) and chi_squared.sf(curves[0].gain, curves[0].degrees) * len(curves) < _STRUCTURE
    chance = 1 + 4 * np.sqrt(0.5 / count)
    if rms <= max(_NOISE_LIKE, chance):
        return structured and not named and rms > 1 + 2.5 * np.sqrt(0.5 / count) and curves[0].gain > 0.02 * last.chi2
    return not (named and rms <= _ROUGH and (rms**2 - 1) <= _ROUGH_SHARE * (began**2 - 1))


def _with_unknown(findings, problem: Problem, selection: Selection, count: int) -> list[Finding]:
    """Return the findings with what no law explains as the last one, in place of a law that only imitates it."""
    last = selection.last
    left = last.chi2 - count
    kept = list(findings)
    if kept:
        weakest = min(range(len(kept)), key=lambda index: kept[index].heldout_gain)
        gains = [_alone(problem, last, index) for index in range(len(last.terms))]
        # a law that takes most of the residual and leaves a shape behind is an imitation
        if len(kept) == 1 or gains[weakest] < 10 * left:
            kept.pop(weakest)
    terms = [term for term in last.terms if any(term.effect == finding.effect for finding in kept)]
    base = last if len(terms) == len(last.terms) else problem.refine(terms, selection.first)
    found = locate(problem, base)
    if found is None:
        return kept
    statement = (
        "structure is left over that no law of the library takes away; a deformation of "
        f"{found.module} by a law of its own would take away {100 * found.share:.0f} % of it"
    )
    share = found.curve.gain / base.chi2
    if found.follows is not None:
        what, share = found.follows
        statement += f". It follows {what} ({100 * share:.0f} %)"
    kept.append(
        Finding(
            physics="unknown",
            location=found.module,
            candidates=found.candidates,
            parameters={},
            heldout_gain=float(share),
            statement=statement,
            curve=found.curve,
        )
    )
    return kept


def _alone(problem: Problem, fit: Fit, index: int) -> float:
    """Return how much chi squared would grow without a term."""
    kept = [term.effect for place, term in enumerate(fit.terms) if place != index]
    changed = problem.change(fit, kept)
    return float(((fit.residual - changed) ** 2).sum()) - fit.chi2


def _finding(problem: Problem, fit: Fit, index: int, selection: Selection, robot: Robot, held: float) -> Finding:
    term = fit.terms[index]
    without = _alone(problem, fit, index) + fit.chi2
    own = fit.chi2 + penalty(term)
    places, laws = [term.candidate.place.name], []
    places += term.candidate.law.same_places(term.candidate.place, robot.mechanism)
    for rival in selection.rivals[index]:
        # indistinct: as good a fit, with values that are not absurd
        if rival.chi2 - fit.chi2 > INDISTINCT or rival.score > own + 2.5 * INDISTINCT:
            continue
        if rival.term.candidate.law.physics == term.candidate.law.physics:
            places.append(rival.term.candidate.place.name)
        elif rival.term is not term:
            laws.append(rival.term.candidate.name)
            places.append(rival.term.candidate.place.name)
    return Finding(
        physics=term.candidate.law.physics,
        location=term.candidate.place.name,
        candidates=tuple(dict.fromkeys(places)),
        parameters=_parameters(problem, fit, index),
        heldout_gain=float(np.clip(1 - held / max(without, 1e-300), 0.0, 1.0)),
        statement=term.candidate.law.statement(term.candidate.place, term.effect.values),
        effect=term.effect,
        alternatives=tuple(dict.fromkeys(laws)),
    )


def _parameters(problem: Problem, fit: Fit, index: int) -> dict[str, FittedParameter]:
    """Return values with 95 % intervals from the whole fit's covariance, widened where more than noise is left."""
    jacobian = problem.jacobian(fit)
    scale = np.linalg.norm(jacobian, axis=0)
    unseen = scale < _UNSEEN
    scale = np.where(unseen, 1.0, scale)
    scaled = jacobian / scale
    covariance = np.linalg.pinv(scaled.T @ scaled, rcond=1e-12, hermitian=True) / scale / scale[:, None]
    count = max(fit.residual.size, 1)
    covariance = covariance * max(1.0, fit.chi2 / count)
    start = sum(term.candidate.size for term in fit.terms[:index])
    term = fit.terms[index]
    candidate: Candidate = term.candidate
    out = {}
    for place, quantity in enumerate(candidate.quantities):
        deviation = 1.96 * float(np.sqrt(max(covariance[start + place, start + place], 0.0)))
        if unseen[start + place]:
            deviation = np.inf  # these data do not depend on it
        ends = []
        for sign in (-1.0, 1.0):
            moved = term.coordinates.copy()
            moved[place] += sign * min(deviation, 50.0 if candidate.logarithmic[place] else np.inf)
            end = float(candidate.values_of(moved)[place])
            ends.append(float(np.clip(end, quantity.lower, quantity.upper)))
        value = float(candidate.values_of(term.coordinates)[place])
        out[quantity.name] = FittedParameter(value, quantity.unit, (ends[0], ends[1]))
    return out


def _finite_deflection(first: Fit, last: Fit, before: Array) -> Finding | None:
    """Return the finding that equilibrium in the deformed position explains more than chance."""
    difference = before - first.residual  # what the nominal simulation gains by it, whitened
    size = float((difference**2).sum())
    with_linear = last.residual + difference
    worse = float((with_linear**2).sum())
    gained = worse - last.chi2
    if size < 25 or gained < max(0.5 * size, 25) or gained < 0.01 * worse:
        return None
    return Finding(
        physics="finite_deflection",
        location="robot",
        candidates=("robot",),
        parameters={},
        heldout_gain=float(gained / worse),
        statement="the loads move the robot far enough that equilibrium must be taken in the deformed position",
    )


def _channels(before, after, raw_before, raw_after, exists) -> dict[str, dict[str, float]]:
    out: dict[str, dict[str, float]] = {}
    for name, unit, columns in (("position", "um", slice(0, 3)), ("rotation", "urad", slice(3, 6))):
        here = exists[:, columns]
        count = int(here.sum())
        if not count:
            continue
        out[name] = {
            "before": _rms(float((before[:, columns] ** 2)[here].sum()), count),
            "after": _rms(float((after[:, columns] ** 2)[here].sum()), count),
            f"before_{unit}": 1e6 * _rms(float((raw_before[:, columns] ** 2)[here].sum()), count),
            f"after_{unit}": 1e6 * _rms(float((raw_after[:, columns] ** 2)[here].sum()), count),
        }
    return out
