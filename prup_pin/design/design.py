"""`design`: the least mass with which a robot is as stiff as it shall be, at all poses.

Values of modules enter C and the mass as sums of powers (a diameter as d^-4 and d^2): in their logarithms both are
convex, and what is found is the lightest there is. Where a target is worst, at which pose and in which direction,
changes with the design; so the optimiser (SciPy's SLSQP) is given the worst places found so far, and whatever its
answer violates is added, until nothing is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ..errors import InfeasibleDesignError, InputError, PrupPinError
from ..kinematics import LoopKinematics
from ..mechanism import Mechanism
from ..sensitivity import ValueStep, has_slope, mass_of
from ..spatial import Array
from ..statics import Compliance, Statics, solve_statics
from ..sweep.engine import Engine
from ..sweep.places import grid, scattered
from ..sweep.quantities import Asked
from .target import Cut, Target, targets_of
from .variable import Variable, variables_of

#: A target is met where no pose exceeds it by more than this share of it.
MET = 1e-6
_ROUNDS = 40
#: Of every target so many of the worst poses are added a round.
_WORST = 3
#: Share of a length by which the robot is redrawn for its slope.
_STEP = 1e-4


class _Place(NamedTuple):
    """Where a target has to be watched: the target, the pose's row, and which number of C there."""

    target: int
    row: int
    cut: Cut


@dataclass(frozen=True, eq=False, repr=False)
class Design:
    """The lightest robot found. `robot.with_parameters(found.changes)` is it.

    values: what was free, by the names that were given. changes: by parameter. mass_before, mass: of all beams with a
    density, at home [kg]; cost_before, cost: the same with `costs` added. reached: per target the worst number of all
    poses; at: the coordinates where. binding: which bounds hold a value, 'low' or 'high', by name. rounds: how often
    the worst places were looked for anew.
    """

    targets: tuple[Target, ...]
    values: Mapping[str, float]
    changes: Mapping[str, float]
    mass_before: float
    mass: float
    cost_before: float
    cost: float
    before: tuple[float, ...]
    reached: tuple[float, ...]
    at: tuple[Mapping[str, float], ...]
    binding: Mapping[str, str]
    rounds: int

    def __repr__(self) -> str:
        chosen = ", ".join(f"{name} = {value:.5g}" for name, value in self.values.items())
        return f"<Design: {chosen}; {self.mass:.4g} kg, was {self.mass_before:.4g}>"

    def __str__(self) -> str:
        said = {None: "", "low": " (its least)", "high": " (its largest)"}
        lines = [f"{name:<32} {value:.6g}{said[self.binding.get(name)]}" for name, value in self.values.items()]
        lines.append(f"{'mass':<32} {self.mass:.5g} kg, was {self.mass_before:.5g} kg")
        for target, was, value, at in zip(self.targets, self.before, self.reached, self.at, strict=True):
            where = ", ".join(f"{name} {number:.4g}" for name, number in at.items())
            lines.append(f"{target}: {value:.5g} at {where}, was {was:.5g}")
        return "\n".join(lines)


def design(
    mechanism: Mechanism,
    targets: Mapping[str, float] | Target | Sequence[Target],
    free: Sequence[str],
    bounds: Mapping[str, tuple[float, float]] | None = None,
    poses: Any = None,
    costs: Mapping[str, float] | None = None,
    *,
    kinematics: LoopKinematics | None = None,
    axes: Mapping[str, Any],
) -> Design:
    """Return the lightest design that meets all targets at all poses; see `Robot.design`."""
    wanted = targets_of(targets)
    if not mechanism.modules:
        raise PrupPinError(f"'{mechanism.name}' has no compliant module: nothing yields, there is nothing to design")
    variables = variables_of(mechanism, free, bounds, costs)
    robot = _Robot(mechanism, kinematics or LoopKinematics(mechanism))
    search = _Search(robot, wanted, variables, poses, axes)
    x = np.log([variable.start for variable in variables])
    rounds = 0
    watched: list[_Place] = search.worst(x)
    for feasible in (False, True):
        while rounds < _ROUNDS:
            excess = float(search.excess(x).max())
            if not feasible and excess <= 0:
                break
            rounds += 1
            x, slack = search.solved(x, watched, feasible)
            if search.excess(x).max() <= (np.log1p(MET) if feasible else 0):
                break
            if not feasible and slack > MET:  # even what is watched cannot be met
                raise search.infeasible(x)
            watched += search.worst(x)
    if search.excess(x).max() > np.log1p(2 * MET):
        raise search.infeasible(x)
    return search.found(x, rounds)


class _Robot:
    """A robot with values of its own: its kinematics, its C at any coordinates, what it weighs."""

    def __init__(self, mechanism: Mechanism, kinematics: LoopKinematics):
        self.mechanism, self.kinematics = mechanism, kinematics
        self.engine = Engine(mechanism, Asked(("C",)), kinematics)

    def with_values(self, changes: Mapping[str, float]) -> _Robot:
        """Return the robot with other values of parameters."""
        mechanism = self.mechanism.with_parameters(changes)
        same = mechanism.model is self.mechanism.model  # no length has changed
        return _Robot(mechanism, self.kinematics.of(mechanism) if same else LoopKinematics(mechanism))

    def statics(self, row: Array) -> Statics:
        """Return the solved statics at coordinates (t,)."""
        return solve_statics(self.engine.layout, self.kinematics.at_coordinates(row))

    @cached_property
    def home(self) -> Statics:
        """The solved statics at home."""
        return solve_statics(self.engine.layout, self.kinematics.home_pose())

    @property
    def mass(self) -> float:
        """The mass of all modules that say one [kg]."""
        return sum(mass_of(self.home, module, module.values) for module in self.mechanism.modules)

    def step(self, name: str) -> ValueStep | None:
        """Return a small change of a parameter at a pose that stays; None of a length, which moves joints."""
        lengths = {length.parameter.name for length in self.mechanism.description.lengths}
        parameter = self.mechanism.parameters[name]
        return ValueStep.of(self.mechanism, parameter) if name not in lengths and has_slope(parameter) else None

    def beside(self, name: str, value: float) -> tuple[_Robot, _Robot]:
        """Return the robots whose parameter is less and more than a value by the share `_STEP`."""
        return self.with_values({name: value * (1 - _STEP)}), self.with_values({name: value * (1 + _STEP)})


class _Search:
    """One design: what is asked, and the robot at any values of its variables, given by logarithms x."""

    def __init__(
        self,
        robot: _Robot,
        targets: tuple[Target, ...],
        variables: tuple[Variable, ...],
        poses: Any,
        axes: Mapping[str, Any],
    ):
        self.robot, self.targets, self.variables = robot, targets, variables
        coordinates = robot.engine.coordinates
        self.names = coordinates.names
        if poses is None and not axes:
            home = robot.kinematics.home_pose()
            at = home.coordinates if robot.mechanism.tasks else home.actuators
            poses = [[float(at[name]) for name in self.names]]
        if poses is not None and axes:
            raise InputError(f"poses= says where all poses are; leave out {', '.join(axes)}")
        self.rows = (grid(coordinates, axes) if poses is None else scattered(coordinates, poses)).rows()
        answer = robot.engine.solve(self.rows)
        bad = np.flatnonzero(answer.status != 0)
        if len(bad):
            at = self._at(int(bad[0]))
            raise InputError(
                f"{len(bad)} of {len(self.rows)} poses cannot be judged, the first at {at}: "
                f"{robot.engine.reason(self.rows[bad[0]])}. Expected poses that the robot reaches"
            )
        self._start = answer.values["C"]
        self._kept: dict[bytes, tuple[_Robot, Array]] = {}
        if not self.slopes(np.log([variable.start for variable in variables]))[1].any():
            named = ", ".join(variable.name for variable in variables)
            raise InputError(
                f"{named}: changes no mass that the robot file knows (a density), so that nothing says what it costs; "
                "give costs={name: kilograms per unit}"
            )

    def _at(self, row: int) -> dict[str, float]:
        return dict(zip(self.names, self.rows[row].tolist(), strict=True))

    # -- the robot at x ------------------------------------------------------------------------------------------------

    def changes(self, x: Array) -> dict[str, float]:
        """Return the values of all parameters that are free."""
        return {
            name: float(np.exp(at))
            for at, variable in zip(x, self.variables, strict=True)
            for name in variable.parameters
        }

    def at(self, x: Array) -> tuple[_Robot, Array]:
        """Return the robot and its C at all poses, (n, 6, 6); NaN where it does not reach one any more."""
        key = np.asarray(x, float).tobytes()
        if key not in self._kept:
            if len(self._kept) > 4:
                self._kept.pop(next(iter(self._kept)))
            robot = self.robot.with_values(self.changes(x))
            self._kept[key] = robot, robot.engine.solve(self.rows).values["C"]
        return self._kept[key]

    def values(self, x: Array) -> Array:
        """Return what every target limits at every pose, (targets, n); infinite where the robot does not reach it."""
        c = self.at(x)[1]
        there = np.isfinite(c).all(axis=(1, 2))
        found = np.full((len(self.targets), len(c)), np.inf)
        for index, target in enumerate(self.targets):
            found[index, there] = target.worst(c[there])
        return found

    def excess(self, x: Array) -> Array:
        """Return by which factor every target is missed at every pose, as logarithms, (targets, n)."""
        most = np.array([target.most for target in self.targets])
        with np.errstate(divide="ignore"):
            return np.log(self.values(x) / most[:, None])

    def worst(self, x: Array) -> list[_Place]:
        """Return the places to watch: for each target the worst poses, with what is worst there."""
        c, excess = self.at(x)[1], self.excess(x)
        found = []
        for index, target in enumerate(self.targets):
            order = np.argsort(-np.where(np.isfinite(excess[index]), excess[index], -np.inf), kind="stable")[:_WORST]
            found += [_Place(index, int(row), cut) for row in order for cut in target.cuts(c[row])]
        return found

    # -- what the optimiser asks ---------------------------------------------------------------------------------------

    def slopes(self, x: Array) -> tuple[float, Array]:
        """Return the cost [kg] and its slope by x."""
        robot = self.at(x)[0]
        cost, slope = robot.mass, np.zeros(len(x))
        for column, variable in enumerate(self.variables):
            value = float(np.exp(x[column]))
            cost += variable.cost * value
            slope[column] = variable.cost * value
            for name in variable.parameters:
                if (step := robot.step(name)) is not None:
                    slope[column] += value * step.mass(robot.home)
                else:
                    less, more = robot.beside(name, value)
                    slope[column] += (more.mass - less.mass) / (2 * _STEP)
        return cost, slope

    def watched(self, x: Array, places: list[_Place]) -> tuple[Array, Array]:
        """Return by which factors the places miss their targets, as logarithms (k,), and the slopes by x, (k, v)."""
        robot = self.at(x)[0]
        sizes, slopes = np.zeros(len(places)), np.zeros((len(places), len(x)))
        for row in dict.fromkeys(place.row for place in places):
            statics = robot.statics(self.rows[row])
            c, changes = _compliance(statics).C, self._changes_of_c(robot, statics, self.rows[row], x)
            for index, place in enumerate(places):
                if place.row == row:
                    size, by_c = place.cut.of(c)
                    sizes[index] = np.log(size / self.targets[place.target].most)
                    slopes[index] = (by_c * changes).sum(axis=(1, 2)) / size
        return sizes, slopes

    def _changes_of_c(self, robot: _Robot, statics: Statics, row: Array, x: Array) -> Array:
        """Return dC/dx at one pose, (v, 6, 6); the tool held where it is."""
        out = np.zeros((len(x), 6, 6))
        for column, variable in enumerate(self.variables):
            value = float(np.exp(x[column]))
            for name in variable.parameters:
                if (step := robot.step(name)) is not None:
                    out[column] += value * step.compliance(statics)
                else:
                    less, more = (_compliance(other.statics(row)).C for other in robot.beside(name, value))
                    out[column] += (more - less) / (2 * _STEP)
        return out

    def solved(self, x: Array, places: list[_Place], feasible: bool) -> tuple[Array, float]:
        """Return the best x for what is watched: the cheapest, or before one is feasible the one that misses least.

        And by which factor, as a logarithm, that still misses the worst of them.
        """
        from scipy.optimize import minimize

        count = len(x)
        low, high = (np.log([getattr(v, end) for v in self.variables]) for end in ("low", "high"))
        kept: dict[bytes, tuple[Array, Array]] = {}

        def limits(at: Array) -> tuple[Array, Array]:
            key = at[:count].tobytes()
            if key not in kept:
                kept.clear()
                kept[key] = self.watched(at[:count], places)
            return kept[key]

        if feasible:
            scale = self.slopes(x)[0]

            def cost(at: Array) -> tuple[float, Array]:
                value, slope = self.slopes(at)
                return np.log(value / scale), slope / value

            constraints = {
                "type": "ineq",
                "fun": lambda at: -limits(at)[0],
                "jac": lambda at: -limits(at)[1],
            }
            start, limit = x, list(zip(low, high, strict=True))
        else:
            # One more unknown, by how much the worst is missed; the targets need not be met by more than a little.
            start = np.append(x, limits(x)[0].max())
            limit = [*zip(low, high, strict=True), (-0.01, None)]

            def cost(at: Array) -> tuple[float, Array]:
                return float(at[-1]), np.append(np.zeros(count), 1.0)

            constraints = {
                "type": "ineq",
                "fun": lambda at: at[-1] - limits(at)[0],
                "jac": lambda at: np.hstack((-limits(at)[1], np.ones((len(places), 1)))),
            }
        found = minimize(
            cost,
            start,
            jac=True,
            method="SLSQP",
            bounds=limit,
            constraints=[constraints],
            options={"maxiter": 200, "ftol": 1e-12},
        )
        best = np.clip(found.x[:count], low, high)
        return best, float(limits(best)[0].max())

    # -- the end -------------------------------------------------------------------------------------------------------

    def found(self, x: Array, rounds: int) -> Design:
        values, known = self.values(x), self.robot.mechanism.parameters
        before = np.array([target.worst(self._start) for target in self.targets])
        mass_before = self.robot.mass
        cost_before = mass_before + sum(
            v.cost * float(np.mean([known[name].value for name in v.parameters])) for v in self.variables
        )
        worst = values.argmax(axis=1)
        cost = self.slopes(x)[0]
        more = sum(v.cost * float(np.exp(at)) for v, at in zip(self.variables, x, strict=True))
        binding = {}
        for variable, at in zip(self.variables, x, strict=True):
            for which, end in (("low", variable.low), ("high", variable.high)):
                if abs(at - np.log(end)) < 1e-6:
                    binding[variable.name] = which
        return Design(
            self.targets,
            {variable.name: float(np.exp(at)) for variable, at in zip(self.variables, x, strict=True)},
            self.changes(x),
            mass_before,
            cost - more,
            cost_before,
            cost,
            tuple(before.max(axis=1).tolist()),
            tuple(values.max(axis=1).tolist()),
            tuple(self._at(int(row)) for row in worst),
            binding,
            rounds,
        )

    def infeasible(self, x: Array) -> InfeasibleDesignError:
        """Return the error that says how near the targets one can come, and what yields where they are missed."""
        excess = self.excess(x)
        index, row = np.unravel_index(int(np.argmax(excess)), excess.shape)
        target, at = self.targets[index], self._at(int(row))
        robot, c = self.at(x)
        reached = float(self.values(x)[index, row])
        where = ", ".join(f"{name} = {value:.5g}" for name, value in at.items())
        soft = ""
        if np.isfinite(c[row]).all():
            compliance = _compliance(robot.statics(self.rows[row]))
            worst = max(target.cuts(c[row]), key=lambda cut: cut.of(c[row])[0])
            shares = sorted(compliance.shares(worst.wrench).items(), key=lambda item: -item[1])[:3]
            soft = " Most of it yields in " + ", ".join(f"{name} ({100 * share:.0f} %)" for name, share in shares) + "."
        bounds = [v.name for v, value in zip(self.variables, x, strict=True) if abs(value - np.log(v.high)) < 1e-6]
        held = f" At their largest: {', '.join(bounds)}." if bounds else ""
        return InfeasibleDesignError(
            f"no design within the bounds meets all targets: {target} comes to {reached:.4g} {target.unit} at best, "
            f"at {where}.{soft}{held} Expected wider bounds, more free parameters, or a target that can be met",
            {v.name: float(np.exp(value)) for v, value in zip(self.variables, x, strict=True)},
            tuple(self.values(x).max(axis=1).tolist()),
        )


def _compliance(statics: Statics) -> Compliance:
    """Return the compliance of solved statics, in plain units."""
    return Compliance(statics, np.ones((6, 6)), None)
