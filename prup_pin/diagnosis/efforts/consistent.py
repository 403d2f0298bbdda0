"""Coefficients of a fit whose bodies can exist: mass, centre and inertia that some distribution of mass has.

A body's inertial parameters can be if and only if its pseudo-inertia, a matrix P (4, 4) of second moments, is positive
definite (Wensing, Kim and Slotine 2018). P is linear in the parameters, so least squares beside the entropic divergence
from the drawn bodies

    D(P | P0) = tr(P P0^-1) - log det(P P0^-1) - 4

is convex, grows without bound towards a body that cannot be, and is the same in all frames (Lee, Wensing and Park
2019).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...dynamics.inertial import pseudo_inertia
from ...mechanism import Mechanism
from ...spatial import Array
from .chosen import Chosen, fit
from .columns import Gathered

__all__ = ["consistent_fit"]

#: Steps of Newton's method, the decrease that ends it, and halvings of a step.
_STEPS, _SETTLED, _HALVINGS = 60, 1e-6, 40
#: By which the divergence's weight falls from one run of it to the next.
_SOFTER = 10.0
#: Weight of the divergence where a law says nothing of what its body is likely to be.
_WEIGHT = 0.5
#: Of the drawn body's smallest second moment, below which it has none to speak of: that body is left free.
_FLAT = 1e-12
_UNITS = np.array([pseudo_inertia(unit) for unit in np.eye(10)])


@dataclass(frozen=True, eq=False)
class _Body:
    """A drawn body P0 (4, 4) and what each coefficient (p,) adds to it, (p, 4, 4)."""

    drawn: Array
    changes: Array

    def at(self, x: Array) -> Array:
        """Return P with coefficients (p,)."""
        return self.drawn + np.tensordot(x, self.changes, axes=1)


def consistent_fit(given: Gathered, chosen: Chosen, bases: Sequence[tuple[int, Array] | None]) -> tuple[Array, Array]:
    """Return coefficients (p,) by which all bodies can exist, and their normal matrix (p, p).

    bases: the joint and the parameters (10,) of each parameter within tolerance that is of a body. Where the best fit's
    bodies can exist it is that.
    """
    x, matrix = fit(given, chosen)
    bodies = _bodies(given.mechanism, chosen, bases)
    if all(_smallest(body.at(x)) > 0 for body in bodies):
        return x, matrix
    where = np.array(chosen.where, int)
    moment = given.columns.moment[:, where].sum(axis=0)
    free = np.ones(len(where), bool)
    for term in chosen.terms:
        if term.law.one_sided:
            free[chosen.own(term)] = x[chosen.own(term)] > 0
    while True:
        found, weight = np.zeros(len(where)), max(float(abs(moment @ x)), _WEIGHT)
        while True:  # from a stiff divergence to its own weight: Newton's steps stay away from the cone's wall
            found = _newton(matrix, moment, bodies, free, found, weight)
            if weight <= _WEIGHT:
                break
            weight = max(weight / _SOFTER, _WEIGHT)
        bounded = np.zeros(len(where), bool)
        for term in chosen.terms:
            bounded[chosen.own(term)] = term.law.one_sided
        negative = bounded & (found < 0)
        if not negative.any():
            return found, matrix
        free &= ~negative


def _newton(matrix: Array, moment: Array, bodies: Sequence[_Body], free: np.ndarray, x: Array, weight: float) -> Array:
    """Return the coefficients (p,) of the least cost, from x (p,); those that are not `free` stay where they are."""
    here = np.flatnonzero(free)

    def cost(x: Array) -> float:
        value = 0.5 * x @ matrix @ x - moment @ x
        for body in bodies:
            present = body.at(x)
            if not _smallest(present) > 0:
                return np.inf
            value += weight * (np.trace(present @ np.linalg.inv(body.drawn)) - np.linalg.slogdet(present)[1])
        return float(value)

    now = cost(x)
    for _ in range(_STEPS):
        slope, curved = matrix @ x - moment, matrix.copy()
        for body in bodies:
            inverse = np.linalg.inv(body.at(x))
            seen = inverse @ body.changes  # (p, 4, 4)
            slope += weight * np.einsum("pij,ji->p", body.changes, np.linalg.inv(body.drawn) - inverse)
            curved += weight * np.einsum("pij,qji->pq", seen, seen)
        own = curved[np.ix_(here, here)]
        scale = 1 / np.sqrt(np.maximum(np.diag(own), np.finfo(float).tiny))
        own = own * scale[:, None] * scale + 1e-12 * np.eye(len(here))
        step = np.zeros(len(x))
        step[here] = -scale * np.linalg.solve(own, scale * slope[here])
        expected, share = -float(slope @ step), 1.0
        for _ in range(_HALVINGS):
            tried = cost(x + share * step)
            if tried < now - 1e-4 * share * expected:
                break
            share /= 2
        else:
            break
        x, now = x + share * step, tried
        if expected < _SETTLED:
            break
    return x


def _bodies(mechanism: Mechanism, chosen: Chosen, bases: Sequence[tuple[int, Array] | None]) -> list[_Body]:
    """Return the drawn bodies that anything chosen changes."""
    count = len(chosen.where)
    changes: dict[int, Array] = {}

    def at(joint: int) -> Array:
        return changes.setdefault(joint, np.zeros((10, count)))

    for column, index in enumerate(chosen.base):
        base = bases[index]
        if base is not None:
            at(base[0])[:, column] += base[1]
    for term in chosen.terms:
        for joint, own in term.law.of_body(term.place, mechanism).items():
            at(joint)[:, chosen.own(term)] += own
    found = []
    for joint, matrix in changes.items():
        drawn = pseudo_inertia(mechanism.model.inertias[joint].toDynamicParameters())
        if _smallest(drawn) > _FLAT * np.trace(drawn):
            found.append(_Body(drawn, np.tensordot(matrix.T, _UNITS, axes=1)))
    return found


def _smallest(pseudo: Array) -> float:
    """Return the smallest eigenvalue of a body's pseudo-inertia (4, 4)."""
    return float(np.linalg.eigvalsh(pseudo)[0])
