"""Where a module yields beyond the model, before any law is named, and what its deformation follows.

By duality a deformation e_m beyond a module's law appears at the tool as J_m^T e_m, with the wrench Jacobian J_m that
carries the load to the module. At every sample the part of the residual in those directions is its own estimate of
e_m. The place is where the residual lies in these directions at all samples; what e_m follows (the module's load, a
position, another leg's load, time) is asked only then.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..spatial import Array
from .criteria import ALIKE, CHANCE_DEVIATIONS, NOT_REACHING, TREMOR
from .fit import Beside, Fit, Problem
from .local_curve import LocalCurve, curve_against, local_curve

__all__ = ["LOAD", "Located", "Variable", "Yielding", "approached", "least_left", "locate", "yieldings"]

#: What came from one direction or the other, where it is no joint.
LOAD = "load"

#: Motions of a module whose load is a wrench: along its axis, across, tilting, about its axis; bending of a beam.
_MOTIONS = ((2,), (0, 1), (3, 4), (5,))
_BENDING = (0, 1, 3, 4)


@dataclass(frozen=True)
class Yielding:
    """A motion of a module that may have yielded beyond the model, by whatever law.

    `components` of its deformation; `gain`: chi squared that a deformation of its own at every sample removes, beyond
    what so many free numbers remove by chance.
    """

    module: str
    components: tuple[int, ...]
    gain: float


class Variable(NamedTuple):
    """What a deformation may follow beside its own load: factor (n,) times a curve over values (n,); in words.

    came: the joint that takes another way, or 'load', where the factor is the direction from which that came.
    """

    words: str
    values: Array
    factor: Array | float = 1.0
    came: str = ""


@dataclass(frozen=True)
class Located:
    """Where the residual sits: the likeliest module, all that these data cannot tell from it, and the local curve.

    `share` of the whitened squared residual that a deformation there removes whatever its law. `follows`: what it
    follows where that is not the module's own load, with the share that a curve over it removes; or None.
    """

    module: str
    candidates: tuple[str, ...]
    curve: LocalCurve
    share: float
    follows: tuple[Variable, float] | None


def yieldings(problem: Problem, fit: Fit) -> list[Yielding]:
    """Return all motions of all modules, the one that the residual points to first."""
    influence = fit.influence
    white = problem.whiteners(influence)
    mechanism = influence.chain.mechanism
    found = []
    for name in influence.rows:
        directions = white @ influence.signature(name)
        motions = (
            ((0,),)
            if directions.shape[2] == 1
            else (*_MOTIONS, *([_BENDING] if mechanism.module(name).kind.bends_exactly else []))
        )
        for components in motions:
            basis, sizes, _ = np.linalg.svd(directions[:, :, list(components)], full_matrices=False)
            seen = sizes > NOT_REACHING * max(float(sizes.max(initial=0.0)), 1e-300)
            part = (basis.mT @ fit.residual[..., None])[..., 0] * seen
            found.append(Yielding(name, components, float((part**2).sum()) - int(seen.sum())))
    return sorted(found, key=lambda item: -item.gain)


def least_left(problem: Problem, fit: Fit, module: str, residual: Array, beside: Beside | None = None) -> float:
    """Return what of a whitened residual (n, 6), squared and summed, no deformation of a module can take away.

    `beside`: what others may do with it. No law of that module alone leaves less, to first order.
    """
    basis = problem.reach(fit.influence, module)

    def left(values: Array) -> Array:
        return values - basis @ (basis.mT @ values)

    rest = left(residual[..., None])[..., 0].ravel()
    if beside is not None:
        others = left(beside.basis.reshape(*residual.shape, -1)).reshape(len(rest), -1)
        rest = rest - others @ np.linalg.lstsq(others, rest, rcond=1e-9)[0]
    return float(rest @ rest)


def locate(problem: Problem, fit: Fit) -> Located | None:
    """Return where the residual of a fit sits; None where no module takes any of it away, or none's load varies."""
    found = yieldings(problem, fit)
    if not found or found[0].gain <= 0:
        return None
    chance = CHANCE_DEVIATIONS * np.sqrt(2 * len(fit.residual))
    least = found[0].gain - max((1 - ALIKE) * found[0].gain, chance)
    alike = [item for item in found if item.gain >= least]
    total = float((fit.residual**2).sum())
    own: LocalCurve | None = None
    clearest: tuple[Variable, LocalCurve] | None = None
    for item in alike:
        for component in item.components:
            curve = local_curve(problem, fit, item.module, component)
            if curve is None:
                continue
            if own is None or curve.gain > own.gain * (1 + 1e-6):
                own = curve
            for variable in _variables(problem, fit, item.module, component):
                other = curve_against(problem, fit, item.module, component, variable.values, variable.factor)
                if other is not None and (clearest is None or other.gain > clearest[1].gain * (1 + 1e-6)):
                    clearest = variable, other
    if own is None:
        return None
    follows = None
    if clearest is not None and clearest[1].gain > own.gain / ALIKE + chance:
        variable, best = clearest
        follows = variable, best.gain / total
        curve = local_curve(problem, fit, best.module, best.component)
        own = curve if curve is not None else own
    names = dict.fromkeys((own.module, *(item.module for item in alike)))
    share = min(max(item.gain for item in alike if item.module == own.module) / total, 1.0)
    return Located(own.module, tuple(names), own, share, follows)


def _variables(problem: Problem, fit: Fit, module: str, component: int) -> Iterator[Variable]:
    """Yield what a deformation may follow beside its own load."""
    influence, inputs = fit.influence, problem.simulator.inputs
    samples, mechanism = fit.samples, influence.chain.mechanism
    load = influence.loads(module)[:, component]
    runs = inputs.run_labels()[samples]
    mine = mechanism.module(module).joint
    told: set[int] = set()
    for name in influence.ratio:  # modules of drives share their joint's load
        driven = mechanism.module(name).joint
        if driven not in told and driven != mine:
            told.add(driven)
            joint = str(mechanism.model.names[driven])
            yield Variable(f"the load of the drive of {joint}", influence.loads(name)[:, 0])
    for column, joint in enumerate(mechanism.actuated):
        position = inputs.actuators[samples, column]
        yield Variable(f"the position of {joint}", position)
        yield Variable(f"its load, by a factor that changes with the position of {joint}", position, load)
    geometry = fit.run.geometry
    joint = str(mechanism.model.names[mine])
    if joint in mechanism.actuated:
        came = approached(inputs.actuators[samples, mechanism.actuated.index(joint)], runs)
        yield Variable(f"the direction from which {joint} came", load, came, joint)
    elif all(joint in pose.joints for pose in geometry.poses[:1]):
        turned = np.array([pose.joints[joint] for pose in geometry.poses])[geometry.rows[samples]]
        yield Variable(f"the position of {joint}", turned)
        yield Variable(f"its load, by a factor that changes with the position of {joint}", turned, load)
    yield Variable("the direction from which its load came", load, approached(load, runs), LOAD)
    if inputs.temperature is not None and not np.isnan(inputs.temperature[samples]).any():
        yield Variable("the temperature", inputs.temperature[samples])
    yield Variable("time", inputs.time[samples])
    yield Variable("its load, by a factor that changes with time", inputs.time[samples], load)


def approached(values: Array, runs: np.ndarray) -> Array:
    """Return the sign (n,) of the last change that is no tremor, 0 before the first; values (n,) as taken, in runs."""
    out, least = np.zeros(len(values)), TREMOR * float(np.ptp(values))
    for run in np.unique(runs):
        rows = np.flatnonzero(runs == run)
        steps = np.diff(values[rows], prepend=values[rows[0]])
        last = np.maximum.accumulate(np.where(np.abs(steps) > least, np.arange(len(rows)), 0))
        out[rows] = np.sign(steps[last])
    return out
