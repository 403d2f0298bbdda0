"""Findings, one function for each kind."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..channels import Noise
from ..laws import Effect
from ..laws.as_found import said_of_calibrated
from ..laws.deeds import Moved
from ..numbers import counted, number, percent, quantity
from ..recordings import SENSORS
from ..robot import Robot
from ..spatial import Array, rotation_exp, rotation_log
from .calibrate import (
    CalibratedParameter,
)
from .chances import WITHIN_95
from .criteria import GAIN, INDISTINCT, MUCH, WEIGHT_SHOWS
from .diagnosis import Finding, FittedParameter, heldout_gain
from .evidence import cross_validated, implausible, scale_of
from .intervals import parameters_of
from .noise import could_show_structure, is_white
from .problem import Fit, Problem
from .search import Selection, other_explanations
from .unrecorded_load import UnrecordedLoad

#: What to do where there is nothing to compare.
_NOTHING_MEASURED = (
    "give the recording poses (columns p.x … r.z) or efforts (tau.<joint>) under these names; prup-pin import makes"
    " them of other ones"
)


def sensor_displaced(
    effect: Effect,
    deviation: Array,
    first: Fit,
    before: Array,
    robot: Robot,
    calibrated: Sequence[CalibratedParameter],
) -> Finding:
    """Return the finding that a pose sensor stands elsewhere than believed, seen before anything was simulated.

    deviation (6,) of its parameters; what was calibrated of them since is part of it.
    """
    own = _calibrated_of(effect, SENSORS["pose_sensor"], calibrated)
    values, names = dict(effect.values), [quantity.name for quantity in effect.law.quantities]
    if len(own) == len(names):
        report = Moved(np.eye(4), np.eye(4))
        for axis, unit in zip(("x", "y", "z", "rx", "ry", "rz"), np.eye(6), strict=True):  # in the order of their acts
            step = (own[f"pose_sensor.{axis}"].value - own[f"pose_sensor.{axis}"].nominal) * unit
            report = report.then(Moved.from_frame(rotation_exp(step[3:]), step[:3]))
        whole = rotation_exp(np.array([values[name] for name in names[:3]]))
        report = report.then(Moved.from_frame(whole, np.array([values[name] for name in names[3:]])))
        at, turn = report(np.zeros((1, 3)), np.eye(3)[None])
        values = dict(zip(names, map(float, (*rotation_log(turn)[0], *at[0])), strict=True))
        sizes = np.array([own[f"pose_sensor.{axis}"].sd for axis in ("rx", "ry", "rz", "x", "y", "z")]).reshape(2, 3)
        deviation = np.sqrt(sizes**2 @ (whole**2).T).ravel()
    declare = "where it just stands there, declare it (tolerances frame_position and frame_rotation)"
    return _seen_before(effect, values, deviation, first, before, robot, declare)


def target_turned(
    effect: Effect,
    deviation: Array,
    first: Fit,
    before: Array,
    robot: Robot,
    calibrated: Sequence[CalibratedParameter],
) -> Finding:
    """Return the finding that a target is mounted in another way than drawn, seen before anything was simulated.

    deviation (3,) of its rotation vector; what was calibrated of it since is part of it.
    """
    target = effect.place.aspect.partition(" in ")[0] or "target"
    found = _calibrated_of(effect, ("target_rotation",), calibrated)
    own = {name.rpartition(".")[2]: item for name, item in found.items() if name.rpartition(".")[0] == target}
    names = ("rx", "ry", "rz")
    turn = rotation_exp(np.array([effect.values[name] for name in names]))
    vector = rotation_log(turn[None])[0]
    if own.keys() == set(names):
        steps = [(own[name].value - own[name].nominal) * unit for name, unit in zip(names, np.eye(3), strict=True)]
        turn = rotation_exp(steps[0]) @ rotation_exp(steps[1]) @ rotation_exp(steps[2]) @ turn
        vector = rotation_log(turn[None])[0]
        small = 1e-6
        by = (rotation_log(rotation_exp(small * np.eye(3)) @ turn) - vector).T / small
        deviation = np.sqrt(by**2 @ np.array([own[name].sd for name in names]) ** 2)
    values = dict(zip(names, map(float, vector), strict=True))
    declare = "where it is just mounted so, declare it (tolerance target_rotation)"
    others = effect.law.same_places(effect.place, robot.mechanism)
    return _seen_before(effect, values, deviation, first, before, robot, declare, others)


def _calibrated_of(
    effect: Effect, kinds: Collection[str], calibrated: Sequence[CalibratedParameter]
) -> dict[str, CalibratedParameter]:
    """Return what was calibrated of some kinds in the recordings in which a sensor's effect acts, by short name."""
    group = effect.law.group.label if effect.law.group else ""
    return {
        item.name.partition(" in ")[0]: item
        for item in calibrated
        if item.deviation.kind in kinds and (item.deviation.group.label if item.deviation.group else "") == group
    }


def _seen_before(
    effect: Effect,
    values: Mapping[str, float],
    deviation: Array,
    first: Fit,
    before: Array,
    robot: Robot,
    declare: str,
    others: Sequence[str] = (),
) -> Finding:
    """Return the finding of what was told in closed form: values with their standard deviations (p,), in this order.

    declare: what to declare where it is no fault; others: places that cannot be told from its own.
    """
    units = {quantity.name: quantity.unit for quantity in effect.law.quantities}
    return Finding(
        physics=effect.law.physics,
        location=effect.place.name,
        candidates=(effect.place.name, *others),
        parameters={
            name: FittedParameter.about(value, units[name], WITHIN_95 * size)
            for (name, value), size in zip(values.items(), deviation.tolist(), strict=True)
        },
        heldout_gain=float(1 - (first.residual**2).sum() / max(float((before**2).sum()), 1e-300)),
        statement=f"{effect.law.statement(effect.place, {**effect.values, **values}, robot.mechanism)}; {declare}",
        effect=effect,
    )


def always_acting(effect: Effect, robot: Robot) -> Finding:
    """Return the finding of something without a parameter, which the calibration asked for."""
    return Finding(
        physics=effect.law.physics,
        location=effect.place.name,
        candidates=(effect.place.name,),
        parameters={},
        heldout_gain=0.0,
        statement=effect.statement(robot.mechanism),
        effect=effect,
    )


def beyond_its_tolerance(
    name: str, physics: str, place: str, value: FittedParameter, off: float, gain: float, more: str = ""
) -> Finding:
    """Return the finding that a parameter lies `off` tolerances beside the robot file, and by which share it counts."""
    return Finding(
        physics=physics,
        location=place,
        candidates=(place,),
        parameters={name: replace(value, drawn=None)},
        heldout_gain=gain,
        statement=(
            f"{name} lies {number(abs(off), 3)} tolerances away from the robot file: "
            f"{number(value.value, 6)} {value.unit} instead of {number(value.drawn or 0.0, 6)}{more}"
        ),
    )


def calibrated_beyond(item: CalibratedParameter, held: float) -> Finding:
    """Return the finding of a calibrated parameter beyond its tolerance; held: chi squared of what was held out."""
    gain, of = (item.x / item.share) ** 2, item.deviation
    own = of.kind in (*SENSORS["pose_sensor"], *SENSORS["target"])  # set up by whoever measures
    more = f"; where it just is there, declare it (tolerance {of.kind})" if own else ""
    value = FittedParameter.about(item.value, of.unit, WITHIN_95 * item.sd, item.nominal)
    return beyond_its_tolerance(
        item.name, of.physics, of.place, value, item.x, float(gain / (gain + max(held, 1e-300))), more
    )


def rms_of_sum(chi2: float, count: int) -> float:
    """Return the root mean square of `count` numbers by the sum of their squares; NaN where there is none."""
    return float(np.sqrt(chi2 / count)) if count else float("nan")


def without_place(problem: Problem, fit: Fit, selection: Selection, count: int) -> Finding:
    """Return the finding that something is left which no part of the robot accounts for."""
    modules = len(fit.influence.rows)
    places = len({candidate.place.name for candidate in selection.library})
    laws = len({candidate.law.physics for candidate in selection.library})
    tried = f"{laws} kinds of physics at {places} places"
    if modules:
        tried += f" were tried, and whatever deformation of {modules} module{'s' if modules > 1 else ''}"
    else:
        tried += " were tried; the robot file has no module that could yield"
    squares = (fit.residual**2).sum(axis=0)
    parts = [(name, squares[where].sum()) for name, _, where in problem.stack.groups()]
    most, size = max(parts, key=lambda part: part[1])
    share = size / max(float(squares.sum()), 1e-300)
    return unknown_at(
        "robot",
        f"the residual is {number(rms_of_sum(fit.chi2, count), 3)} times the noise, and nothing explains it: "
        f"{tried}. It is largest in the {most} ({percent(share)} of its square)",
    )


def nothing_compared(problem: Problem, unused: Sequence[str]) -> Finding:
    """Return the finding that nobody can know whether anything is missing."""
    measured = problem.stack.exists.any()
    why = (
        "no sample with a measured pose could be simulated"
        if measured
        else "the recording holds no measured pose, of the tool (columns p.x … r.z) or of a marker"
    )
    if not measured and not any(name.startswith("tau.") for name in unused):
        why += ", and no effort (columns tau.<joint>)"
    rest = f"; not used were {', '.join(unused)}" if unused else ""
    statement = f"nothing could be compared, so nothing can be ruled out: {why}{rest}"
    return unknown_at("robot", statement, advice="" if measured else _NOTHING_MEASURED)


def too_little(what: str, advice: str) -> Finding:
    """Return the finding that nothing can be told of so little: '7 numbers of poses', and what to record."""
    return unknown_at(
        "robot",
        f"there is too little to compare: {what} are too few to judge anything by others",
        advice=advice,
        untold=True,
    )


def too_few_poses(count: int) -> Finding:
    """Return the finding that so many numbers of poses are too few."""
    advice = "record at least ten postures, or one under a dozen loads of both signs"
    return too_little(f"{counted(count, 'number')} of poses", advice)


def load_left(left: Noise, load: UnrecordedLoad) -> Finding:
    """Return the finding that a load nobody recorded leaves what is left, which has the size of that noise."""
    return unknown_at(
        "robot",
        f"the residual, {quantity(left.position, 'm')} and {quantity(left.rotation, 'rad')}, looks like the deflection "
        f"under {load} at the tool, and no load was recorded",
        advice=_GIVE_LOADS,
    )


def load_between(size: Noise, noise: Noise, load: UnrecordedLoad) -> Finding:
    """Return the finding that samples of one posture scatter by a `size` as under a load, and by `noise` beside it."""

    def of(scatter: Noise) -> str:
        sizes = ((scatter.position, "m"), (scatter.rotation, "rad"))
        return " and ".join(quantity(value, unit) for value, unit in sizes if value)

    return unknown_at(
        "robot",
        f"loads were applied that were not recorded: where the actuators stood still, the tool scatters by {of(size)} "
        f"as under {load}, and by {of(noise)} beside that. Without these loads nothing can be said of the robot",
        advice=_GIVE_LOADS,
        untold=True,
    )


_GIVE_LOADS = "give the load of each sample in columns w.fx … w.mz, with 0 where there was none"


def too_few(problem: Problem, selection: Selection, blocks: np.ndarray) -> Finding | None:
    """Return the finding that nobody can know what is noise: it was taken from samples too few to show structure."""
    samples = selection.last.samples
    if selection.last.terms or could_show_structure(blocks[samples]):
        return None
    noise, poses = problem.noise, len(np.unique(blocks[samples]))
    return unknown_at(
        "robot",
        f"nothing can be said: the noise is not declared, and {counted(len(samples), 'sample')} of "
        f"{counted(poses, 'pose')} are too few to tell noise of {number(1e6 * noise.position, 3)} µm and "
        f"{number(1e6 * noise.rotation, 3)} µrad from something left out",
        advice="declare position_noise and rotation_noise in the recording's JSON file, or record more",
    )


def no_noise(problem: Problem, fit: Fit, blocks: np.ndarray) -> Finding | None:
    """Return the finding that what is left is no noise, where its size was taken from nothing but itself.

    It follows time, pose or load, or is too much of what the sensor saw move. None where it may be noise. blocks (N,).
    """
    sizes = np.sqrt((fit.residual**2).mean(axis=0))
    alike = replace(fit, residual=fit.residual / np.where(sizes > 0, sizes, 1.0))
    share = _share_left(problem, fit)
    labels = blocks[fit.samples]
    if share > GAIN:
        why = f"it is {number(100 * share, 2)} % of what was seen to move, and no pose sensor scatters so much"
    elif could_show_structure(labels) and not is_white(problem, alike, labels):
        why = "it follows time, pose or load, and noise does not"
    else:
        return None
    return unknown_at(
        "robot",
        f"the residual with everything free to vary, {quantity(problem.noise.position, 'm')} and "
        f"{quantity(problem.noise.rotation, 'rad')}, is not noise: {why}",
        advice="declare position_noise and rotation_noise in the recording's JSON file, or measure some poses again",
    )


def _share_left(problem: Problem, fit: Fit) -> float:
    """Return the RMS of what is left of positions over that of how far they were seen to move; 0 where none were."""
    left, moved = 0.0, 0.0
    raw = problem.stack.residual(fit.run)[fit.samples]
    lengths = [group.where for group in problem.stack.groups() if group.unit == "m"]
    for where, channel in zip(lengths, problem.stack.poses, strict=True):
        position, here = channel.position[fit.samples], problem.stack.exists[fit.samples][:, where].all(axis=1)
        if here.any():
            left += float((raw[here][:, where] ** 2).sum())
            moved += float(((position[here] - position[here].mean(axis=0)) ** 2).sum())
    return float(np.sqrt(left / moved)) if moved else 0.0


def unknown_at(where: str, statement: str, share: float = 0.0, advice: str = "", untold: bool = False) -> Finding:
    """Return the finding of something unknown at a place, which would take away a share of the residual."""
    return Finding("unknown", where, (where,), {}, share, statement, advice=advice, untold=untold)


def chi2_without(problem: Problem, fit: Fit, index: int) -> float:
    """Return how much chi squared would grow without a term."""
    kept = [term.effect for term in fit.others(index)[1]]
    left = problem.without_tolerances(fit, (problem.target(fit) - problem.change(fit, kept)).ravel())
    return float((left**2).sum()) - fit.chi2


def finding_of(
    problem: Problem,
    fit: Fit,
    index: int,
    selection: Selection,
    robot: Robot,
    held: float,
    labels: np.ndarray | None = None,
) -> Finding:
    """Return the finding of a term. labels (n,): of what is held out where much was calibrated beside it."""
    term = fit.terms[index]
    if labels is None:
        without = chi2_without(problem, fit, index) + fit.chi2
    else:
        without = cross_validated(problem, fit, labels, less=index)
    scale = scale_of(problem, fit)  # where more than noise is left, less can be told apart
    own = fit.chi2 + scale * implausible(term)
    places, laws = [term.candidate.place.name], list[str]()
    places += term.candidate.law.same_places(term.candidate.place, robot.mechanism)
    for rival in other_explanations(problem, fit, index, selection.rivals[index]):
        # indistinct: as good a fit, with values that are not absurd; more parameters only rank it lower
        absurd = rival.chi2 + scale * implausible(rival.term) > own + MUCH * scale * INDISTINCT
        if rival.chi2 - fit.chi2 > scale * INDISTINCT or absurd:
            continue
        if rival.term.candidate.law.physics == term.candidate.law.physics:
            places += dict.fromkeys((rival.term.candidate.place.name, *rival.term.candidate.parts))
        elif rival.term is not term:
            if not any(_is_richer(rival.term.candidate.name, name) for name in laws):
                laws.append(rival.term.candidate.name)
            places.append(rival.term.candidate.place.name)
    parameters = parameters_of(problem, fit, index)
    return Finding(
        physics=term.candidate.law.physics,
        location=term.candidate.place.name,
        candidates=tuple(dict.fromkeys(places)),
        parameters=parameters,
        heldout_gain=heldout_gain(held, without),
        statement=said_of_calibrated(_statement(term.effect, parameters, robot), _own_tolerances(problem, fit, index)),
        effect=term.effect,
        alternatives=tuple(dict.fromkeys(laws)),
    )


def _own_tolerances(problem: Problem, fit: Fit, index: int) -> list[str] | None:
    """Return the values, in words, on top of which a term acts where these are within a tolerance; None where none is.

    Of those of its word and place the ones that do just what it does; nothing of what was found before together.
    """
    toleranced, candidate = problem.prior.toleranced, fit.terms[index].candidate
    alike = [
        place
        for place, item in enumerate(toleranced.law.deviations)
        if (item.physics, item.place) == (candidate.law.physics, candidate.place.name)
    ]
    if toleranced.root is not None or not alike:
        return None
    own = np.linalg.qr(problem.jacobian(fit)[:, fit.coordinates_of(index)])[0]
    told = []
    for place in alike:
        item, does = toleranced.law.deviations[place], fit.per_tolerance[:, place]
        if np.linalg.norm(does - own @ (own.T @ does)) <= GAIN * np.linalg.norm(does):
            told.append(quantity(toleranced.value(place, float(fit.x[place])), item.unit))
    return told


def _is_richer(name: str, other: str) -> bool:
    """Return True for the name of a law that is another one there with more parameters: 'across by direction'."""
    return name.startswith(f"{other.removesuffix(')')} by ")


def with_neutral_values(finding: Finding, robot: Robot) -> Finding:
    """Return a finding in which parameters that these data do not tell change nothing, such as unmeasured rotations.

    But for those that nothing their law allows would make so: they stay where the fit left them.
    """
    effect = finding.effect
    if effect is None:
        return finding
    bounds = {q.name: (q.lower, q.upper) for q in effect.law.quantities_at(effect.place, robot.mechanism)}
    neutral = {
        name: value
        for name, value in effect.law.neutral.items()
        if name in finding.parameters and finding.parameters[name].interval == bounds[name]
        if bounds[name][0] <= value <= bounds[name][1]
    }
    if not neutral or len(neutral) == len(effect.law.neutral):
        return finding
    told = replace(effect, values={**effect.values, **neutral})
    parameters = {name: replace(item, value=neutral.get(name, item.value)) for name, item in finding.parameters.items()}
    return replace(finding, effect=told, parameters=parameters, statement=told.statement(robot.mechanism))


def _statement(effect: Effect, parameters: Mapping[str, FittedParameter], robot: Robot) -> str:
    """Return what an effect says of itself."""
    intervals = {name: item.interval for name, item in parameters.items()}
    return effect.law.told(effect.place, effect.values, intervals, robot.mechanism)


def finite_deflection(first: Fit, last: Fit, before: Array, silent: bool = False) -> Finding | None:
    """Return the finding that equilibrium in the deformed position explains more than chance.

    `silent`: nothing else says why the residual before is larger than noise, and that after is not.
    """
    difference = before - first.residual  # what the nominal simulation gains by it, whitened
    size = float((difference**2).sum())
    with_linear = last.residual + difference
    worse = float((with_linear**2).sum())
    gained = worse - last.chi2
    if size < WEIGHT_SHOWS or (not silent and gained < WEIGHT_SHOWS):
        return None
    return Finding(
        physics="finite_deflection",
        location="robot",
        candidates=("robot",),
        parameters={},
        heldout_gain=float(gained / worse),
        statement="the loads move the robot far enough that equilibrium must be taken in the deformed position",
    )
