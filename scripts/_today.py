"""What people do today with a recording that disagrees with the simulation, on the same devices.

Plain least squares: all parameters that have a tolerance are fitted, without regard to how wide it is; those that end
up beyond three tolerances are named. Stepwise regression: the first-order columns of every law at every place of the
library enter one after the other, as long as an information criterion (BIC) falls; those that entered are named.
Both know of gravity.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from prup_pin.channels import Noise, Stack, channels_of
from prup_pin.diagnosis.calibrate import calibrate, calibrated_parameters
from prup_pin.diagnosis.candidates import Candidate, candidates
from prup_pin.diagnosis.influence import Influence
from prup_pin.diagnosis.problem import Problem
from prup_pin.diagnosis.toleranced import Toleranced
from prup_pin.errors import PrupPinError
from prup_pin.laws import LAWS, Effect, Place
from prup_pin.laws.deviations import deviations_of
from prup_pin.recordings import Recording
from prup_pin.robot import Robot
from prup_pin.simulation import Run, Simulator, inputs_of, simulate
from tests.reference.concealed.rotations import matrix, vector

Poses = Mapping[str, np.ndarray]
Tool = Callable[[Robot, Recording, Recording], tuple[dict[str, Any], Poses]]

#: Priors of plain least squares, in tolerances: only what nothing was measured of stays where it is.
_WIDE = 100.0
#: Beyond so many tolerances, and so many standard errors, a fitted parameter is named.
_BEYOND = 3.0
#: Stepwise regression ends here at the latest.
_MOST_TERMS = 40


@dataclass(frozen=True)
class Bench:
    """A recording beside the simulation of the robot with its weight."""

    problem: Problem
    weight: tuple[Effect, ...]
    run: Run

    @classmethod
    def of(cls, robot: Robot, recording: Recording) -> Bench:
        simulator = Simulator(robot, inputs_of(recording, robot))
        stack = Stack(channels_of(recording, robot.mechanism))
        told = recording.noise
        noise = Noise(told.position, told.rotation, told.force, told.moment, "declared")
        weight = tuple(_weight(robot))
        run = simulator.run(weight)
        return cls(Problem.of(simulator, stack, noise), weight, run)


def _weight(robot: Robot):
    law = next(item for item in LAWS if item.physics == "self_weight" and not item.places(robot.mechanism)[0].aspect)
    yield Effect(law, Place("robot"), {"scale": 1.0})


def least_squares(robot: Robot, recording: Recording, heldout: Recording) -> tuple[dict[str, Any], Poses]:
    """Fit every parameter that has a tolerance, and name those beyond three."""
    bench = Bench.of(robot, recording)
    declared = recording.tolerances.declared
    free = [item for item in deviations_of(robot.mechanism) if item.kind in declared]
    tolerances = {item.name: declared[item.kind] for item in free}
    wide = {name: _WIDE * value for name, value in tolerances.items()}
    found = calibrate(bench.problem, Toleranced.of(free, wide), bench.weight)
    findings, calibration = [], []
    for item in calibrated_parameters(found, found.first):
        item, x, sd = item.deviation, _WIDE * item.x, _WIDE * item.share
        value = item.value(float(x * tolerances[item.name]))
        error = float(sd * tolerances[item.name] * abs(item.per_amount(value)))
        calibration.append({"parameter": item.name, "nominal": item.nominal, "value": value, "sd": error})
        if abs(x) > _BEYOND and abs(x) > _BEYOND * sd:
            findings.append({"physics": item.physics, "location": item.place, "candidates": [item.place],
                             "heldout_gain": abs(float(x))})  # fmt: skip
    findings.sort(key=lambda item: -item["heldout_gain"])
    predicted = simulate(robot, heldout, found.prior.at(found.first.x))
    poses = {"p": predicted.position, "r": predicted.rotation}
    return {"verdict": "", "findings": _once(findings), "calibration": calibration}, poses


def stepwise(robot: Robot, recording: Recording, heldout: Recording) -> tuple[dict[str, Any], Poses]:
    """Let the laws of the library enter one by one while BIC falls."""
    fit, other = Bench.of(robot, recording), Bench.of(robot, heldout)
    library = candidates(robot.mechanism, fit.problem.simulator.inputs)
    influence = Influence(fit.problem.simulator, fit.run, fit.problem.stack)
    columns: dict[int, np.ndarray] = {}
    for index, candidate in enumerate(library):
        found = _columns(fit, influence, candidate)
        if found is not None:
            columns[index] = found
    residual = fit.problem.whitened(influence, fit.problem.stack.residual(fit.run)[fit.run.samples]).ravel()
    entered, gains = _forward(columns, residual)
    all_columns = np.hstack([columns[index] for index in entered]) if entered else np.zeros((len(residual), 0))
    sizes = np.linalg.lstsq(all_columns, residual, rcond=1e-10)[0]
    beside = Influence(other.problem.simulator, other.run, other.problem.stack)
    moved, at = np.zeros((len(heldout.time), 6)), 0
    for index in entered:
        for effect in _unit_effects(library[index]):
            setup = other.problem.simulator.setup([*other.weight, effect])
            moved[other.run.samples] += sizes[at] * beside.change(setup)[:, :6]
            at += 1
    findings = [
        {"physics": library[index].law.physics, "location": library[index].place.name,
         "candidates": [library[index].place.name], "heldout_gain": gain}
        for index, gain in zip(entered, gains, strict=True)
    ]  # fmt: skip
    rotation = matrix(moved[:, 3:]) @ other.run.rotation
    return {"verdict": "", "findings": _once(findings)}, {"p": other.run.position + moved[:, :3], "r": vector(rotation)}


def _unit_effects(candidate: Candidate) -> list[Effect]:
    """Return a law at its start, one effect for each of its parameters that is neutral otherwise."""
    start = candidate.law.starts(candidate.place, candidate.mechanism)[0]
    neutral = candidate.law.neutral_at(candidate.place, candidate.mechanism)
    moved = [name for name, value in start.items() if neutral[name] != value]
    return [Effect(candidate.law, candidate.place, {**neutral, name: start[name]}) for name in moved]


def _columns(bench: Bench, influence: Influence, candidate: Candidate) -> np.ndarray | None:
    """Return the whitened first-order columns of a law (rows, parameters); None where it shows nothing."""
    out = []
    for effect in _unit_effects(candidate):
        try:
            change = influence.change(bench.problem.simulator.setup([*bench.weight, effect]))
        except PrupPinError:
            return None
        out.append(bench.problem.whitened(influence, change).ravel())
    good = bool(out) and all(np.isfinite(column).all() and np.any(column) for column in out)
    return np.stack(out, -1) if good else None


def _forward(columns: Mapping[int, np.ndarray], residual: np.ndarray) -> tuple[list[int], list[float]]:
    """Return which groups of columns enter, in their order, and the share of the squared residual that each took."""
    left, n = residual.copy(), len(residual)
    free = {index: group.copy() for index, group in columns.items()}
    first = {index: np.linalg.norm(group) for index, group in columns.items()}
    entered: list[int] = []
    gains: list[float] = []
    while len(entered) < _MOST_TERMS:
        best, chosen, basis = 0.0, None, None
        for index, group in free.items():
            if np.linalg.norm(group) < 1e-6 * first[index]:
                continue
            q = np.linalg.qr(group)[0]
            taken = float(((q.T @ left) ** 2).sum())
            gain = -n * np.log1p(-min(taken / float(left @ left), 1 - 1e-12)) - group.shape[1] * np.log(n)
            if gain > best:
                best, chosen, basis = gain, index, q
        if chosen is None or basis is None:
            break
        before = float(left @ left)
        left = left - basis @ (basis.T @ left)
        entered.append(chosen)
        gains.append(1 - float(left @ left) / before)
        del free[chosen]
        for index in free:
            free[index] = free[index] - basis @ (basis.T @ free[index])
    return entered, gains


def _once(findings: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return findings without those of the same physics and place as a stronger one."""
    seen: dict[tuple[str, str], dict[str, Any]] = {}
    for item in findings:
        seen.setdefault((item["physics"], item["location"]), item)
    return list(seen.values())


#: By the name of their column.
TODAY: dict[str, Tool] = {"least squares": least_squares, "stepwise": stepwise}
