"""Calibration: what a recording says of everything that is a little off, within its tolerances.

Each parameter has a Gaussian prior about the robot file's value. The posterior's mode is found by Gauss-Newton steps
through the whole simulation; with x the amounts in multiples of their tolerances, J the whitened change per tolerance
and r the whitened residual, a step solves

    (J^T J + 1) dx = J^T r - x,

and the posterior covariance is (J^T J + 1)^-1. What the data say nothing about stays at its prior.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import connected_components

from ..laws import Effect
from ..laws.deviations import Deviation
from ..spatial import Array
from .candidates import Candidate
from .criteria import (
    ALIKE,
    AS_GOOD,
    CALIBRATION_STEP,
    FEW_ROUNDS,
    MUCH,
    PARAMETER_COST,
    ROUNDS,
    SETTLED,
    STEP,
    UNSEEN,
    WEIGHT_SHOWS,
    beyond_tolerance,
)
from .nuisance import Nuisance, least_within
from .problem import Fit, Problem, shortened
from .toleranced import Toleranced


@dataclass(frozen=True, repr=False)
class CalibratedParameter:
    """What is known of a parameter that may be off.

    x: by how many tolerances it is off; share: its posterior standard deviation in tolerances. value, sd, tolerance and
    nominal, the value it is off from, in its unit.
    """

    deviation: Deviation
    x: float
    share: float
    value: float
    sd: float
    tolerance: float
    nominal: float

    @property
    def name(self) -> str:
        return self.deviation.name

    @property
    def learned(self) -> float:
        """1 - sd / tolerance."""
        return 1 - self.share

    def __repr__(self) -> str:
        unit = self.deviation.unit
        return f"<{self.name} {self.value:.6g} {unit}, known to {self.sd:.2g} {unit} (tolerance {self.tolerance:.2g})>"

    def is_beyond(self, count: int) -> bool:
        """Return True where it lies beyond its tolerance: farther than chance takes any of `count` parameters."""
        return abs(self.x) > beyond_tolerance(count)


def calibrate(problem: Problem, toleranced: Toleranced, effects: Sequence[Effect] = ()) -> Problem:
    """Return a problem whose fits begin at the posterior's mode of all toleranced parameters, `effects` beside them."""
    return calibrated_from(problem.within(toleranced, effects))


def calibrated_from(problem: Problem, x: Array | None = None) -> Problem:
    """Return a problem whose fits begin at the posterior's mode, sought from x (p,) or from the drawing."""
    return problem.beginning(_settled(problem, problem.off(x)))


def within_tolerances(problem: Problem, toleranced: Toleranced, library: Sequence[Candidate], reach: float) -> Problem:
    """Return a problem with its parameters calibrated, the robot's weight beside them unless that makes it worse.

    Whether weight acts has no parameter to be found, and without it others would be bent to take its place: a payload
    of the robot's own mass. It acts on every robot, at the links' centres or along the beams; a recording made by a
    simulation may lack it. Weight does nothing to a rigid joint: it is judged by what is left when all joints may yield
    that can. `reach`: tolerances beyond which none is taken to be off.
    """
    heavy = [item for item in library if item.law.weighs]
    joints = [item for item in library if item.law.of_stiffness and item.place.name != "robot"]
    rigid = any(item.of_rigid_joint for item in joints)
    weights = [[item.effect(item.coordinates_of(np.ones(item.size)))] for item in heavy[: 1 if rigid else None]]
    light = problem.within(toleranced, (), reach)
    ways = [light.beside(effects) for effects in weights]
    shows = -WEIGHT_SHOWS if problem.simulator.inputs.weight_alone else -PARAMETER_COST
    freed = None
    if not ways:
        chosen = _begun([light])[0]
    elif rigid:
        begun = [_begun([light])[0], _begun(ways)[0]]
        left, weighed = (_left_by_joints(*each, joints) for each in begun)
        chosen = begun[1 if weighed < left - shows else 0]
    else:
        within = judged = _ways(_begun([*ways, light]))
        if min(fit.chi2 for _, fit in within) > MUCH * within[0][1].residual.size:
            # what is left out decides at the ends of tolerances, less so where parameters may take what they like
            judged = _ways([(each.reaching(each.prior.toleranced.reach), fit) for each, fit in within], FEW_ROUNDS)
        costs = [fit.chi2 + (shows if each.acting else 0.0) for each, fit in judged]
        best = judged[int(np.argmin(costs))][0].acting
        chosen = next(way for way in within if way[0].acting == best)
        freed = None if judged is within else next(fit for each, fit in judged if each.acting == best)
    return chosen[0].beginning(_settled(*chosen), freed)


#: A problem in which weight acts in one way or not at all, and how far its calibration has come.
_Way = tuple[Problem, Fit]


def _begun(problems: Sequence[Problem]) -> list[_Way]:
    """Return where a first step leads with each way of weight: by the derivatives of the first, but where none acts."""
    drawn: Fit | None = None
    begun = []
    for problem in problems:
        if drawn is None or not problem.acting:
            drawn = here = problem.first
        else:
            here = problem.fit_at((), drawn)
        begun.append((problem, _improved(problem, here) or here))
    return begun


def _ways(begun: Sequence[_Way], rounds: int = ROUNDS) -> list[_Way]:
    """Return calibrations that have begun, each with another way of weight, at their ends.

    Derivatives are taken anew for the best, and for those that come near it. Where weight acts in two ways they are
    alike; what is far behind at its begin is left out.
    """
    (best, begins), *others = sorted(begun, key=lambda way: way[1].chi2)
    last = _settled(best, begins, rounds)
    found = [(best, last)]
    for problem, fit in others:
        if fit.chi2 > MUCH * begins.chi2:
            continue
        # what is off by far is so in whatever way weight acts
        fit = min(fit, problem.fit_at((), last), key=lambda each: each.chi2)
        if problem.acting and best.acting:
            found.append((problem, _followed(problem, fit.near(last))))
            continue
        fit = _followed(problem, fit)
        found.append((problem, _settled(problem, fit, rounds) if fit.chi2 < AS_GOOD * last.chi2 else fit))
    return found


def _left_by_joints(problem: Problem, fit: Fit, joints: Sequence[Candidate]) -> float:
    """Return the chi squared that is left, to first order, where all joints may be as soft as they like."""
    fit = problem.relinearised(fit)
    held = fit.per_tolerance
    columns = [held]
    for item in joints:
        starts = item.starts()
        neutral = item.law.neutral_at(item.place, item.mechanism)
        for start in starts:
            if (start != starts[0])[item.logarithmic].any():
                continue  # as the first, but for its size
            near = np.where(item.logarithmic, [neutral[q.name] for q in item.quantities], item.values_of(start))
            step = item.effect(item.coordinates_of(near + STEP * (item.values_of(start) - near)))
            columns.append(problem.change(fit, [step]).reshape(-1, 1))
    matrix = np.concatenate(columns, axis=1)
    sizes = np.linalg.norm(matrix, axis=0)
    sizes[: held.shape[1]] = 1.0
    priors = np.eye(held.shape[1], matrix.shape[1])
    right = np.concatenate((fit.residual.ravel(), -fit.x))
    system = np.vstack((matrix / np.where(sizes > 0, sizes, 1.0), priors))
    rest = right - system @ np.linalg.lstsq(system, right, rcond=1e-8)[0]
    return float(rest @ rest)


def _settled(problem: Problem, fit: Fit, rounds: int = ROUNDS) -> Fit:
    """Return a calibration that has begun at its end, or where so many rounds lead."""
    for _ in range(rounds):
        fit = problem.relinearised(fit)
        better = _improved(problem, fit)
        if better is None:
            return fit
        fit = _followed(problem, better)
    return fit


def _followed(problem: Problem, near: Fit) -> Fit:
    """Return where steps lead with derivatives that were taken near by, which cost far more than a step.

    Where a step does not help any more the derivatives are to be taken anew.
    """
    for _ in range(FEW_ROUNDS):
        better = _improved(problem, near, least_share=1.0)
        if better is None:
            break
        near = better
    return near


def _improved(problem: Problem, fit: Fit, least_share: float = CALIBRATION_STEP) -> Fit | None:
    """Return where a Gauss-Newton step leads, shortened until it helps; None where none of `least_share` does."""
    held, residual, reach = fit.per_tolerance, fit.residual.ravel(), problem.prior.reach
    normal = held.T @ held + np.eye(len(fit.x))
    step = np.linalg.solve(normal, held.T @ residual - fit.x)
    if (np.abs(fit.x + step) > reach).any():
        root = np.linalg.cholesky(normal).T
        step = least_within(root, root @ (fit.x + step), np.broadcast_to(reach, step.shape)) - fit.x
    # Where much is left, the last digits would be those of a model that lacks something.
    more = max(fit.chi2 - AS_GOOD * residual.size, 0.0)
    if float(step @ normal @ step) < SETTLED + UNSEEN * more:
        return None
    tries = (problem.fit_at((), fit, fit.x + share * step, near=True) for share in shortened(least_share))
    return next((each for each in tries if each.chi2 < fit.chi2), None)


# -- what is known of each ---------------------------------------------------------------------------------------------


def calibrated_parameters(problem: Problem, fit: Fit) -> list[CalibratedParameter]:
    """Return what is known of every toleranced parameter at a fit, its terms free beside them, the best known first."""
    toleranced = problem.prior.toleranced
    held = Nuisance.free(problem.jacobian(fit)).without(fit.per_tolerance)
    shares = toleranced.scattered(np.linalg.inv(held.T @ held + np.eye(len(fit.x))))
    found = []
    for place, (item, off, share) in enumerate(
        zip(toleranced.law.deviations, toleranced.off(fit.x).tolist(), shares.tolist(), strict=True)
    ):
        amount, value, begun = (
            float(toleranced.tolerances[place]),
            toleranced.value(place, off),
            toleranced.value(place, 0),
        )
        sizes = [amount * item.per_amount(each) for each in (value, begun)]
        found.append(CalibratedParameter(item, off, share, value, share * sizes[0], sizes[1], begun))
    return sorted(found, key=lambda item: item.share)


def twins(problem: Problem, fit: Fit) -> tuple[tuple[str, ...], ...]:
    """Return parameters that these data tell only together, as they change what is measured alike: groups of names."""
    sizes = np.linalg.norm(fit.per_tolerance, axis=0)
    seen_at_all = sizes > 1.0
    columns = fit.per_tolerance[:, seen_at_all] / sizes[seen_at_all]
    correlation = np.eye(len(sizes))
    correlation[np.ix_(seen_at_all, seen_at_all)] = np.abs(columns.T @ columns)
    count, group = connected_components(correlation**2 > ALIKE, directed=False)
    members = [np.flatnonzero(group == label) for label in range(count)]
    names = [item.name for item in problem.prior.toleranced.law.deviations]
    return tuple(tuple(names[index] for index in several) for several in members if len(several) > 1)
