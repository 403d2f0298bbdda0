"""Inertial parameters in a fit: which combinations a motion identifies, and coefficients whose bodies can exist.

The columns of the inertial regressor depend on each other: y_d = y_b K. A motion identifies the base parameters
x_b + K x_d and nothing else of the parameters x (Gautier 1991; Khalil and Dombre 2002, ch. 9).

A body's inertial parameters are physically consistent if and only if its pseudo-inertia, a matrix P (4, 4) of second
moments, is positive definite (Wensing, Kim and Slotine 2018). P is linear in the parameters, so least squares beside
the entropic divergence from the drawn bodies

    D(P | P0) = tr(P P0^-1) - log det(P P0^-1) - 4

is convex, grows without bound towards a body that cannot be, and is the same in all frames (Lee, Wensing and Park
2019).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...dynamics.inertial import has_masses, pseudo_inertia, usual_body
from ...mechanism import Mechanism
from ...numbers import number
from ...parameters import SMALLEST_VALUE
from ...spatial import Array
from ..criteria import EFFORT_TOLD, ITERATIONS, LITTLE, MOST_LISTED, NOTHING, ROUNDING, UNSEEN
from .problem import EffortModel, fit

#: Weight of the divergence where a law says nothing of what its body is likely to be.
_WEIGHT = 0.5
_UNITS = np.array([pseudo_inertia(unit) for unit in np.eye(10)])


@dataclass(frozen=True, eq=False)
class BaseParameters:
    """Identifiable combinations (b) of parameters (p): `matrix` (b, p) times these, each led by one of `leads` (b,).

    `silent`: parameters in no combination, of which the motion says nothing.
    """

    matrix: Array
    names: tuple[str, ...]
    leads: tuple[int, ...]
    silent: tuple[str, ...]

    @classmethod
    def of(cls, regressor: Array, names: Sequence[str]) -> BaseParameters:
        """Return the base parameters of a regressor (n, p) of parameters `names`; those of the last links lead."""
        gram = regressor.T @ regressor
        size = np.sqrt(np.diag(gram))
        there = size > np.sqrt(EFFORT_TOLD) * size.max(initial=0.0)
        unit = np.where(there, 1 / np.where(there, size, 1.0), 0.0)
        gram = gram * unit[:, None] * unit
        # Cholesky's elimination in a fixed order: from the last link to the first, what is beside those before it
        leads: list[int] = []
        rest = gram.copy()
        for index in range(len(names) - 1, -1, -1):
            if there[index] and rest[index, index] > EFFORT_TOLD:
                leads.append(index)
                rest = rest - np.outer(rest[:, index], rest[index]) / rest[index, index]
        leads.sort()
        own = gram[np.ix_(leads, leads)]
        share = np.linalg.lstsq(own, gram[leads], rcond=None)[0] if leads else np.zeros((0, len(names)))
        share[:, leads] = np.eye(len(leads))
        share[np.abs(share) < UNSEEN] = 0.0
        matrix = share * size[None, :] / size[leads][:, None]
        called = [_called(*each, names) for each in zip(matrix, leads, share, strict=True)]
        silent = tuple(name for index, name in enumerate(names) if not share[:, index].any())
        return cls(matrix, tuple(called), tuple(leads), silent)


def _called(row: Array, lead: int, share: Array, names: Sequence[str]) -> str:
    """Return a combination in words: its leading parameter and the others, those that do most first."""
    others = [index for index in np.argsort(-np.abs(share), kind="stable") if index != lead and row[index]]
    words = [names[lead]]
    for index in others[:MOST_LISTED]:
        value = abs(row[index])
        factor = "" if abs(value - 1) < UNSEEN else f"{number(value, 3)} "
        words.append(f"{'-' if row[index] < 0 else '+'} {factor}{names[index]}")
    if len(others) > MOST_LISTED:
        words.append(f"and {len(others) - MOST_LISTED} more")
    return " ".join(words)


# -- bodies that can exist ---------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Body:
    """A drawn body (4, 4) and what each coefficient (p,) adds to it, (p, 4, 4).

    usual: the body P0 (4, 4) that it is likely to be near: the drawn one, or of a robot file without masses any other.
    """

    drawn: Array
    usual: Array
    changes: Array

    def at(self, x: Array) -> Array:
        """Return P with coefficients (p,)."""
        return self.drawn + np.tensordot(x, self.changes, axes=1)


def consistent_fit(model: EffortModel, toleranced: Sequence[tuple[int, Array] | None]) -> tuple[Array, Array]:
    """Return the coefficients (p,) of a model whose bodies can exist, and their normal matrix (p, p).

    toleranced: the joint and the body's parameters (10,) of each toleranced parameter that is of a body. If the bodies
    of the free fit can exist, that is returned.
    """
    x, matrix = fit(model)
    bodies = _bodies(model.problem.mechanism, model, toleranced)
    if all(_smallest(body.at(x)) > 0 for body in bodies):
        return x, matrix
    moment = model.problem.columns.moment[:, np.array(model.where, int)].sum(axis=0)
    free = ~model.one_sided | (x > 0)
    while True:
        found, weight = _as_usual(bodies), max(float(abs(moment @ x)), _WEIGHT)
        while True:  # from a stiff divergence to its own weight: Newton's steps stay away from the cone's wall
            found = _newton(matrix, moment, bodies, free, found, weight)
            if weight <= _WEIGHT:
                break
            weight = max(LITTLE * weight, _WEIGHT)
        negative = model.one_sided & (found < 0)
        if not negative.any():
            return np.where(np.abs(found) < SMALLEST_VALUE, 0.0, found), matrix
        free &= ~negative


def _as_usual(bodies: Sequence[_Body]) -> Array:
    """Return coefficients (p,) with which bodies are as they usually are: none where that is as they are drawn."""
    changes = np.concatenate([body.changes.reshape(len(body.changes), -1).T for body in bodies])
    lacking = np.concatenate([(body.usual - body.drawn).ravel() for body in bodies])
    own = np.flatnonzero(changes.any(axis=0))
    found = np.zeros(changes.shape[1])
    found[own] = np.linalg.lstsq(changes[:, own], lacking, rcond=None)[0]
    return found


def _newton(matrix: Array, moment: Array, bodies: Sequence[_Body], free: np.ndarray, x: Array, weight: float) -> Array:
    """Return the coefficients (p,) of the least cost, from x (p,); those that are not `free` stay where they are."""
    here = np.flatnonzero(free)

    def cost(x: Array) -> float:
        value = 0.5 * x @ matrix @ x - moment @ x
        for body in bodies:
            present = body.at(x)
            if not _smallest(present) > 0:
                return np.inf
            value += weight * (np.trace(present @ np.linalg.inv(body.usual)) - np.linalg.slogdet(present)[1])
        return float(value)

    now = cost(x)
    for _ in range(ITERATIONS):
        slope, curved = matrix @ x - moment, matrix.copy()
        for body in bodies:
            inverse = np.linalg.inv(body.at(x))
            seen = inverse @ body.changes  # (p, 4, 4)
            slope += weight * np.einsum("pij,ji->p", body.changes, np.linalg.inv(body.usual) - inverse)
            curved += weight * np.einsum("pij,qji->pq", seen, seen)
        own = curved[np.ix_(here, here)]
        scale = 1 / np.sqrt(np.maximum(np.diag(own), np.finfo(float).tiny))
        own = own * scale[:, None] * scale + 1e-12 * np.eye(len(here))
        step = np.zeros(len(x))
        step[here] = -scale * np.linalg.solve(own, scale * slope[here])
        expected, share = -float(slope @ step), 1.0
        for _ in range(ITERATIONS):
            tried = cost(x + share * step)
            if tried < now - 1e-4 * share * expected:
                break
            share /= 2
        else:
            break
        x, now = x + share * step, tried
        if expected < NOTHING:
            break
    return x


def _bodies(mechanism: Mechanism, model: EffortModel, toleranced: Sequence[tuple[int, Array] | None]) -> list[_Body]:
    """Return the drawn bodies that a model changes."""
    count = len(model.where)
    changes: defaultdict[int, Array] = defaultdict(lambda: np.zeros((10, count)))
    for column, index in enumerate(model.toleranced):
        if (body := toleranced[index]) is not None:
            changes[body[0]][:, column] += body[1]
    for term in model.terms:
        for joint, own in term.law.of_body(term.place, mechanism).items():
            changes[joint][:, model.slice_of(term)] += own
    found = []
    for joint, matrix in changes.items():
        drawn = pseudo_inertia(mechanism.model.inertias[joint].toDynamicParameters())
        usual = drawn if has_masses(mechanism) else usual_body(joint, mechanism)
        if _smallest(usual) > ROUNDING * np.trace(usual):
            found.append(_Body(drawn, usual, np.tensordot(matrix.T, _UNITS, axes=1)))
    return found


def _smallest(pseudo: Array) -> float:
    """Return the smallest eigenvalue of a body's pseudo-inertia (4, 4)."""
    return float(np.linalg.eigvalsh(pseudo)[0])
