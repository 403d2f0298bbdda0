"""Which parameter to change first: what 10 % of it brings, found by solving the changed robot."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import JointLimitWarning, PrupPinError
from ...parameters import Parameter
from ...robot import Robot
from ...spatial import Array
from ..text.answer import Answer
from ..text.values import module_parameters

#: Relative change of a parameter.
STEP = 0.1


@dataclass(frozen=True)
class Lever:
    """A parameter that several equal modules share, and what its change brings.

    `factor` is 1 + STEP or 1 - STEP, whichever yields less. `deflection` (6,) [m, rad] is then that of the tool, and
    `change` the relative change of the load's work, that is of the displacement along the load (negative: stiffer).
    """

    modules: tuple[str, ...]
    parameter: str
    value: Any
    unit: str
    factor: float
    deflection: Array
    change: float


def find_levers(robot: Robot, answer: Answer, modules: Sequence[str]) -> list[Lever]:
    """Return what stiffens most, best first, among parameters of the named modules and their equals in other legs.

    Only values that somebody gave are tried; those that change less than 0.1 % are left out. The pose stays the same:
    parameters that move joints are not levers.
    """
    if answer.shares is None:  # the load deflects nothing
        return []
    wrench = answer.load.wrench
    work = float(wrench @ answer.deflection)
    found = []
    for names, parameter in _shared_parameters(robot, modules):
        first = robot.parameters[f"{names[0]}.{parameter}"]
        best = None
        for factor in (1 + STEP, 1 - STEP):
            value = np.asarray(first.value, float) * factor
            given = value if value.ndim else float(value)
            moved = _deflection(robot, answer, {f"{name}.{parameter}": given for name in names})
            if moved is not None:
                change = float(wrench @ moved) / work - 1
                if change < (-1e-3 if best is None else best.change):
                    best = Lever(names, parameter, first.value, first.unit, factor, moved, change)
        if best is not None:
            found.append(best)
    return sorted(found, key=lambda lever: lever.change)


def _shared_parameters(robot: Robot, modules: Sequence[str]) -> list[tuple[tuple[str, ...], str]]:
    """Return (modules, parameter) of what can be tried; modules of equal kind, name within the leg, and value."""
    equals: dict[tuple, list[str]] = {}
    wanted: dict[tuple, None] = {}
    for module in robot.mechanism.modules:
        given = {p.short: p for p in module_parameters(robot, module) if _is_given(p)}
        for name, parameter in given.items():
            if parameter.quantity is not None and any(source in given for source in parameter.quantity.derived_from):
                continue  # a tabulated value, such as an area, that follows another parameter
            local = module.name.rpartition("/")[2]
            key = (module.kind.kind, local, name, np.asarray(parameter.value, float).tobytes())
            equals.setdefault(key, []).append(module.name)
            if module.name in modules:
                wanted[key] = None
    return [(tuple(equals[key]), key[2]) for key in wanted]


def _is_given(parameter: Parameter) -> bool:
    """Return True for a value that somebody gave and that a factor changes."""
    value = np.asarray(parameter.value, float)
    return parameter.source not in ("default", "derived") and bool(np.isfinite(value).all() and value.any())


def _deflection(robot: Robot, answer: Answer, changes: Mapping[str, Any]) -> Array | None:
    """Return the deflection of the changed robot's tool; None where there is no such robot at this pose."""
    compliance = answer.compliance
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", JointLimitWarning)
            changed = robot.with_parameters(changes)
            pose = changed.pose_from_configuration(compliance.pose.q.tolist())
            return changed.compliance(pose, load=compliance.load).deflection(answer.load.wrench)
    except PrupPinError:
        return None
