"""Where does what is left sit, and what does it follow? Before any law is named, and again beside a law that is.

By duality a deformation e_m of a module beyond its law appears at the tool as J_m^T e_m, with the wrench Jacobian J_m
that carries the load to the module. At every sample the part of the residual in those directions is its own estimate of
e_m. The place is where the residual lies in these directions at all samples; what e_m follows (the module's load, a
position, another leg's load, time) is asked only then: a piecewise linear function of one variable, e = sum c_k h_k(s),
whose coefficients follow by linear least squares.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..channels import Columns, Noise
from ..laws import Effect
from ..laws.drawn import Drawn, against_component
from ..spatial import Array
from .criteria import ALIKE, CHANCE_DEVIATIONS, KNOTS, MOST, NOTHING, TREMOR, UNSEEN
from .nuisance import Nuisance
from .problem import Fit, Problem

# -- the curve that one motion of a module asks for --------------------------------------------------------------------


@dataclass(frozen=True, eq=False, repr=False)
class LocalCurve:
    """Recovered deformation of one motion of a module.

    load (k,) [N or N m], deformation (k,) and its standard deviation (k,) [m or rad]; `gain`: chi squared removed.
    """

    module: str
    component: int
    load: Array
    deformation: Array
    deviation: Array
    gain: float

    @property
    def degrees(self) -> int:
        return len(self.load)


def local_curve(problem: Problem, fit: Fit, module: str, component: int) -> LocalCurve | None:
    """Return the curve of a module's motion that the residual asks for; None where its load does not vary."""
    load = fit.influence.loads(module)[:, component]
    return curve_against(problem, fit, module, component, load)


def curve_against(
    problem: Problem,
    fit: Fit,
    module: str,
    component: int,
    variable: Array,
    factor: Array | float = 1.0,
) -> LocalCurve | None:
    """Return the deformation of a module's motion as factor (n,) times a curve over a variable (n,).

    None where the variable does not vary or the motion does not reach the tool. The curve's `load` and `deformation`
    are then the variable and the deformation over the factor.
    """
    if np.ptp(variable) < NOTHING:
        return None
    # half as they lie, half evenly: most loads may be next to nothing, and a curve bends where they are large
    shares = np.linspace(0, 1, KNOTS)
    knots = np.unique((np.quantile(variable, shares) + variable.min() + shares * np.ptp(variable)) / 2)
    if knots[0] < 0 < knots[-1]:
        knots[np.argmin(np.abs(knots))] = 0.0
    knots = np.unique(knots)
    if len(knots) < 3:
        return None
    direction = fit.influence.signature(module)[:, :, component]
    white = (problem.whiteners(fit.influence) @ direction[..., None])[..., 0]
    hats = np.array([np.interp(variable, knots, row) for row in np.eye(len(knots))]).T
    hats = hats * np.broadcast_to(factor, len(variable))[:, None]
    columns = (white[:, :, None] * hats[:, None, :]).reshape(-1, hats.shape[1])
    scale = np.linalg.norm(columns, axis=0)
    if not scale.max() > 0:
        return None
    # a weak preference for smooth curves keeps knots that the data do not reach from swinging
    second = np.diff(np.eye(len(knots)), 2, axis=0) * UNSEEN * scale.max()
    normal = columns.T @ columns + second.T @ second + 1e-12 * scale.max() ** 2 * np.eye(len(knots))
    inverse = np.linalg.inv(normal)
    target = fit.residual.ravel()
    values = inverse @ (columns.T @ target)
    gain = float(target @ target - ((target - columns @ values) ** 2).sum())
    return LocalCurve(module, component, knots, values, np.sqrt(np.diag(inverse)), gain)


def curves_of_modules(problem: Problem, fit: Fit) -> Iterator[LocalCurve]:
    """Yield the curves of all modules' motions."""
    for name in fit.influence.rows:
        for component in range(fit.influence.loads(name).shape[1]):
            curve = local_curve(problem, fit, name, component)
            if curve is not None:
                yield curve


# -- the module --------------------------------------------------------------------------------------------------------

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
            taken, count = _taken(directions[:, :, list(components)], fit.residual)
            found.append(Yielding(name, components, taken - count))
    return sorted(found, key=lambda item: -item.gain)


def _taken(directions: Array, residual: Array) -> tuple[float, int]:
    """Return the square that motions along directions (n, K, k), free at every sample, remove, and their number."""
    basis, sizes, _ = np.linalg.svd(directions, full_matrices=False)
    seen = sizes > NOTHING * max(float(sizes.max(initial=0.0)), 1e-300)
    part = (basis.mT @ residual[..., None])[..., 0] * seen
    return float((part**2).sum()), int(seen.sum())


def tilting_base(problem: Problem, fit: Fit) -> tuple[float, float] | None:
    """Return the shares of the squared residual that a base which tilts as it likes takes away, and the best module.

    Free at every sample, each. None where the base leaves more than little, where a module does as well, or where so
    many free numbers say nothing: what the robot stands on is no module, and its neighbours would be blamed for it.
    """
    base, count = _taken(problem.whiteners(fit.influence) @ fit.influence.by_base[:, :, 3:5], fit.residual)
    total, best = float((fit.residual**2).sum()), max((item.gain for item in yieldings(problem, fit)), default=0.0)
    if base < ALIKE * total or best > ALIKE * (base - count) or count > MOST * problem.count(fit):
        return None
    return base / total, best / total


def least_left(problem: Problem, fit: Fit, module: str, residual: Array, nuisance: Nuisance | None = None) -> float:
    """Return what of a whitened residual (n, 6), squared and summed, no deformation of a module can take away.

    `nuisance`: what others may do with it. No law of that module alone leaves less, to first order.
    """
    basis = problem.reach(fit, module, resisted=True)

    def left(values: Array) -> Array:
        return values - basis @ (basis.mT @ values)

    rest = left(residual[..., None])[..., 0].ravel()
    if nuisance is not None:
        others = left(nuisance.basis.reshape(*residual.shape, -1)).reshape(len(rest), -1)
        rest = rest - others @ np.linalg.lstsq(others, rest, rcond=1e-9)[0]
    return float(rest @ rest)


def locate(problem: Problem, fit: Fit) -> Located | None:
    """Return where the residual of a fit sits; None where no module takes any of it away, or none's load varies."""
    found = yieldings(problem, fit)
    if not found or found[0].gain <= 0:
        return None
    chance = CHANCE_DEVIATIONS * np.sqrt(2 * len(fit.residual))
    least = found[0].gain - max((1 - ALIKE) * found[0].gain, chance)
    # what turns a bearing about its joint's axis is the drive that holds it there: the module of one motion comes first
    single = {item.module for item in found if len(fit.influence.loads(item.module)[0]) == 1}
    alike = sorted((item for item in found if item.gain >= least), key=lambda item: item.module not in single)
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


# -- a finding, sample by sample ---------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False, repr=False)
class Recovered:
    """A finding as the recording shows it.

    x (n,): what drives it; y (n,): the deformation (torque, travel) that each sample asks for, with its standard
    deviation (n,); law (n,): what the named law gives, or None. `knots`, `curve`, `band` (k,): means over neighbours,
    a curve that knows no law, and their standard deviation. SI; `x_unit`, `y_unit`.
    """

    x: Array
    y: Array
    deviation: Array
    law: Array | None
    knots: Array
    curve: Array
    band: Array
    x_label: str
    y_label: str
    x_unit: str
    y_unit: str
    path: bool  # what happened before matters: the law is not one line
    blocks: np.ndarray  # (n,) labels of samples between two moves of the actuators


@dataclass(frozen=True, eq=False, repr=False)
class Agreement:
    """A finding that no single load drives: what the recording asks of each column (n, K), and the law's.

    [m, rad]; zero where nothing was measured. columns: in groups of one unit; noise: of position and rotation.
    """

    asked: Array
    law: Array
    columns: tuple[Columns, ...]
    noise: Noise


@dataclass(frozen=True, eq=False, repr=False)
class Residuals:
    """Residuals in multiples of the noise, (n, K), whitened; zero columns where nothing was measured."""

    before: Array
    after: Array
    exists: np.ndarray
    columns: tuple[Columns, ...]


def residuals(problem: Problem, fit: Fit, before: Array, after: Array) -> Residuals:
    """Return measured less simulated poses, (n, K) [m, rad] each, in multiples of the noise."""
    white, exists = _whitening(problem, fit)
    first, last = ((white @ values[..., None])[..., 0] for values in (before, after))
    return Residuals(first, last, exists, problem.stack.groups())


def recovered(
    problem: Problem,
    fit: Fit,
    after: Array,
    effect: Effect | None,
    curve: LocalCurve | None,
    stand_ins: Sequence[Effect] = (),
) -> Recovered | Agreement | None:
    """Return what the recording shows of a finding: of an effect that the fit holds, or of an unknown one's curve.

    after (n, K): measured less simulated poses of the fit [m, rad]; stand_ins: effects of the fit that may imitate what
    is unknown, which stands for them too. None where neither is known.
    """
    influence = fit.influence
    white, exists = _whitening(problem, fit)
    asked, law, drawn = after, None, None
    if effect is not None:
        standing = () if problem.tolerances is None else problem.tolerances.effects
        if effect in standing:  # what acts beside any law, the weight
            without = problem.beside([other for other in standing if other != effect]).setup(fit.effects, fit.x)
        else:
            without = problem.setup_at(fit, [term.effect for term in fit.terms if term.effect != effect])
        law = -influence.change(without)
        if not law.any():
            return None  # nothing to draw
        asked = asked + law
        drawn = effect.law.drawn(effect.place, influence.solved)
    elif curve is not None:
        drawn = against_component(influence.solved, curve.module, curve.component)
        named = [term.effect for term in fit.terms if term.effect not in stand_ins]
        asked = asked - influence.change(problem.setup_at(fit, named)) if stand_ins else asked
    if drawn is not None:
        given = None if law is None else (white @ law[..., None])[..., 0]
        blocks = problem.simulator.inputs.blocks[fit.samples]
        made = _estimate(
            drawn, problem.stack.seen(drawn.direction), white, (white @ asked[..., None])[..., 0], given, blocks
        )
        if made is not None:
            return made
    if law is None:
        return None
    columns = problem.stack.groups()
    return Agreement(np.where(exists, asked, 0.0), np.where(exists, law, 0.0), columns, problem.noise)


def _whitening(problem: Problem, fit: Fit) -> tuple[Array, np.ndarray]:
    """Return W (n, K, K) at the equilibria of the fit, and what was both measured and simulated, (n, K)."""
    return problem.whiteners_at(fit.influence), problem.compared(fit.run)


def _estimate(
    drawn: Drawn, direction: Array, white: Array, wanted: Array, given: Array | None, blocks: np.ndarray
) -> Recovered | None:
    """Return what each sample asks for along a direction, and means; None where they say nothing."""
    direction = (white @ direction[..., None])[..., 0]
    weight = (direction**2).sum(axis=1)
    good = (weight > NOTHING * weight.max(initial=0.0)) & (weight > 0)
    if good.sum() < 3:
        return None
    x, along, weight = drawn.x[good], direction[good], weight[good]
    y = (along * wanted[good]).sum(axis=1) / weight
    law = None if given is None else (along * given[good]).sum(axis=1) / weight
    bins = _bins(x)
    if bins.max() < 1:
        return None
    total = np.bincount(bins, weight)
    knots, curve = (np.bincount(bins, weight * values) / total for values in (x, y))
    left = float((weight * (y - curve[bins]) ** 2).sum())
    if not float((weight * y**2).sum()) > left:
        return None  # a curve of means removes nothing
    band = np.sqrt(max(1.0, left / max(len(x) - len(knots), 1)) / total)
    labels, units = drawn.labels, drawn.units
    return Recovered(
        x, y, 1 / np.sqrt(weight), law, knots, curve, band, *labels, *units, drawn.path, blocks[good]
    )  # fmt: skip


def _bins(x: Array) -> np.ndarray:
    """Return (n,) numbers 0, 1, … of neighbouring samples: one for no load, quantiles on both sides of it."""
    reach = float(np.ptp(x))
    if not reach > 1e-9 * float(np.abs(x).max()):
        return np.zeros(len(x), int)
    sides = np.where(np.abs(x) < UNSEEN * reach, 0, np.sign(x)).astype(int)
    bins, first = np.zeros(len(x), int), 0
    for side in (-1, 0, 1):
        rows = np.flatnonzero(sides == side)
        if not len(rows):
            continue
        count = 1 if side == 0 else int(np.clip(len(rows) // KNOTS, 1, KNOTS))
        edges = np.quantile(x[rows], np.linspace(0, 1, count + 1)[1:-1])
        bins[rows] = first + np.searchsorted(np.unique(edges), x[rows], side="right")
        first = int(bins[rows].max()) + 1
    return np.unique(bins, return_inverse=True)[1].ravel()
