"""Where Newton starts: polynomials fitted to closed configurations about home.

Near home a configuration is an analytic function q(u) of the coordinates. Newton solves for it at places farther and
farther from home, each time from where the tangents dq/du of the nearest place known so far point to. The polynomial
that fits values and tangents best errs less than a Taylor series of its degree, and alike over the whole ball. It is
fixed by the mechanism alone, and it is only a start: Newton closes the loops.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from itertools import combinations_with_replacement
from math import comb, hypot
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from ..errors import PrupPinError
from ..kernel import LoopedTree
from ..spatial import Array

__all__ = ["NoPlaceError", "PolynomialStart"]

#: Radius of the ball about home [dimensionless, rad] where all places close, and the part of it that holds where not.
_RADIUS, _HOLDS = 1.1, 0.75
#: A second fit, more exact, holds in the inner part of a ball. A ball where the fit is poor gives way to its inner part.
_INNER = 0.73
#: No ball is smaller.
_LEAST = 0.1
#: The degree, lower with more coordinates, so that there are no more terms than this.
_DEGREE, _TERMS = 16, 170
#: Equations for each term of the inner fit; a place gives one value and a slope along each coordinate.
_EQUATIONS = 1.8
#: The most that a good fit misses at the places that it is fitted to [m, rad].
_MISSED = 0.03
#: A coordinate whose tangents differ less than `_SAME` over steps of `_NEAR` enters linearly; tried as far as `_FAR`.
_SAME, _NEAR, _FAR = 1e-9, 0.1, 4.0


#: From (start, coordinates) to the configuration (nq,) there and its tangents (nv, t). Raises NoPlaceError.
Solve = Callable[[Array, Array], tuple[Array, Array]]


class NoPlaceError(PrupPinError):
    """There is no closed configuration near where one was looked for."""


class _Place(NamedTuple):
    """Coordinates u (t,) [dimensionless, from home's], the motion (nv,) from home to there, its slopes (nv, t)."""

    u: Array
    motion: Array
    slopes: Array


class _Polynomial(NamedTuple):
    """Terms T_a(x_1) T_b(x_2) … in Chebyshev's polynomials T_k(x) = cos(k arccos x), with x = factor u in the unit ball.

    orders (1, degree + 1) are all k; chosen tells, coordinate by coordinate, each term's factor among the T_k(x_i) of
    all coordinates, (terms,) each; coefficients (terms, nv).
    """

    factor: Array
    orders: Array
    chosen: tuple[Array, ...]
    coefficients: Array

    def __call__(self, u: Array) -> Array | None:
        """Return the motion (nv,) from home to a place (t,), or None where the place lies outside."""
        x = u * self.factor
        if hypot(*x.tolist()) > 1.0:
            return None
        factors = np.cos(np.arccos(x).reshape(-1, 1).dot(self.orders))
        first, *others = self.chosen
        terms = factors.take(first)
        for chosen in others:
            terms *= factors.take(chosen)
        return terms.dot(self.coefficients)


class PolynomialStart:
    """The polynomials of one mechanism, in coordinates that `scale` (t,) makes dimensionless."""

    def __init__(self, tree: LoopedTree, home: Array, coordinates: Array, scale: Array, solve: Solve):
        """`coordinates` (t,) are home's. What `solve` finds is asked here and never again."""
        model = tree.model
        self._tree, self._home, self._coordinates, self._per_unit = tree, home, coordinates, 1 / scale
        self._polynomials: list[_Polynomial] = []

        def place(u: Array, start: Array) -> _Place:
            q, tangents = solve(tree.moved(home, start), coordinates + u * scale)
            slopes = pin.dDifference(model, home, q)[1] @ tangents
            return _Place(u, pin.difference(model, home, q), slopes * scale)

        linear = _linear(place, len(scale), model.nv)
        radius = _RADIUS
        while radius > _LEAST and not self._polynomials:
            places, reached = _sampled(place, linear, model.nv, radius)
            if reached < radius:
                radius = _HOLDS * reached
                continue
            for size in (_INNER * radius, radius):
                polynomial, missed = _fitted(places, size, linear)
                if missed < _MISSED:
                    self._polynomials.append(polynomial)
            radius *= _INNER

    def __call__(self, target: Array) -> Array | None:
        """Return a configuration (nq,) near the one at `target` (t,), or None where the polynomials do not tell."""
        u = (target - self._coordinates) * self._per_unit
        for polynomial in self._polynomials:
            motion = polynomial(u)
            if motion is not None:
                return self._tree.moved(self._home, motion)
        return None


def _linear(place: Callable[[Array, Array], _Place], count: int, nv: int) -> Array:
    """Return which coordinates enter linearly, (t,): their tangents are the same all around home."""
    try:
        home = place(np.zeros(count), np.zeros(nv))
        steps = _NEAR * np.concatenate((np.eye(count), -np.ones((1, count))))
        slopes = np.array([home.slopes, *(place(u, home.motion + home.slopes @ u).slopes for u in steps)])
    except NoPlaceError:
        return np.zeros(count, bool)
    return np.ptp(slopes, axis=0).max(axis=0) < _SAME


def _sampled(place: Callable[[Array, Array], _Place], linear: Array, nv: int, radius: float) -> tuple[list[_Place], float]:
    """Return places all over a ball about home, and how far out they were found."""
    count = len(linear)
    places = [place(np.zeros(count), np.zeros(nv))]
    inner = int(np.ceil(_EQUATIONS * len(_terms(linear)) / (1 + count)))
    distances = *_spread(0.0, _INNER * radius, inner), *_spread(_INNER * radius, radius, inner // 2)
    for distance, even in zip(distances, _even(count), strict=False):
        direction = np.where(linear, 0.0, even)
        u = np.where(linear, _FAR * even, distance * direction / max(np.linalg.norm(direction), 1e-9))
        apart = (np.array([known.u for known in places]) - u) * ~linear
        nearest = places[int(np.argmin((apart * apart).sum(axis=1)))]
        try:
            places.append(place(u, nearest.motion + nearest.slopes @ (u - nearest.u)))
        except NoPlaceError:
            return places, distance
    return places, radius


def _even(count: int) -> Iterator[Array]:
    """Yield places (count,) that fill the cube from -1 to 1 evenly, of any number.

    Multiples of powers of the root of r^(count + 1) = r + 1, modulo one (Roberts' generalisation of the golden ratio).
    """
    ratio = 2.0
    for _ in range(60):
        ratio = (1 + ratio) ** (1 / (1 + count))
    step = ratio ** -np.arange(1.0, 1 + count)
    for index in itertools.count(1):
        yield 2 * ((0.5 + index * step) % 1.0) - 1


def _spread(start: float, end: float, count: int) -> Array:
    """Return distances between two, denser towards the end: polynomials run away at the rim first."""
    return start + (end - start) * np.sin(np.pi / 2 * (np.arange(count) + 0.5) / count)


def _terms(linear: Array) -> list[tuple[int, ...]]:
    """Return each term as the coordinates whose product it is."""
    curved = np.flatnonzero(~linear)
    degree = max(d for d in range(1, _DEGREE + 1) if comb(len(curved) + d, d) <= max(_TERMS, 1 + len(curved)))
    words = [word for d in range(degree + 1) for word in combinations_with_replacement(curved.tolist(), d)]
    return words + [(index,) for index in np.flatnonzero(linear).tolist()]


def _fitted(places: list[_Place], size: float, linear: Array) -> tuple[_Polynomial, float]:
    """Return the polynomial that fits the places in a ball of radius `size` best, and the most that it misses."""
    within = [known for known in places if np.linalg.norm(known.u * ~linear) <= size]
    exponents = np.array([np.bincount(term, minlength=len(linear)) for term in _terms(linear)], int).T
    orders = np.arange(exponents.max() + 1)
    factor = np.where(linear, 1 / _FAR, 1 / size)
    u, motions, slopes = (np.array(part) for part in zip(*within, strict=True))
    angle = np.arccos(u * factor)[..., None]
    chosen = np.arange(len(linear))[:, None], exponents
    factors = np.cos(orders * angle)[:, *chosen]
    rates = (orders * np.sin(orders * angle) / np.sin(angle))[:, *chosen]
    values = factors.prod(axis=1)
    rows, right = [values], [motions]
    for index in range(len(linear)):
        # A slope is weighed like a value: that of the highest term is its degree times as large.
        others = np.delete(factors, index, axis=1).prod(axis=1)
        rows.append(rates[:, index] * others / orders[-1])
        right.append(slopes[..., index] / (factor[index] * orders[-1]))
    matrix, wanted = np.concatenate(rows), np.concatenate(right)
    coefficients = np.linalg.solve(matrix.T @ matrix, matrix.T @ wanted)
    places_of = tuple(exponents + len(orders) * chosen[0])
    polynomial = _Polynomial(factor, orders[None].astype(float), places_of, coefficients)
    return polynomial, float(np.abs(values @ coefficients - motions).max())
