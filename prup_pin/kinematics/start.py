"""Where Newton starts: polynomials fitted to closed configurations about home.

Near home a configuration is an analytic function q(u) of the coordinates. Newton solves for it at places farther and
farther from home, each time from where the tangents dq/du of the nearest place known so far point to. The polynomial
that fits values and tangents best errs less than a Taylor series of its degree, and alike over the whole ball. It is
fixed by the mechanism alone, and it is only a start: Newton closes the loops.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import combinations_with_replacement
from math import acos, comb, hypot
from operator import mul, sub
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from ..errors import PrupPinError
from ..kernel import Expression, Factors, LoopedTree
from ..spatial import Array

Mask = NDArray[np.bool_]

#: Radius of the ball about home [dimensionless, rad] where all places close, and the part of it that holds where not.
_RADIUS, _HOLDS = 1.1, 0.75
#: A second fit, more exact, holds in the inner part of a ball. Where the fit is poor a ball gives way to that part.
_INNER = 0.73
#: Places that are well within a ball are no farther along any coordinate than this part of it.
_WELL_WITHIN = 0.4
#: No ball is smaller.
_LEAST = 0.1
#: The degree, lower with more coordinates, so that there are no more terms than these; fewer for a costly solver.
_DEGREE, _TERMS, _FEW_TERMS = 12, 100, 50
#: Equations for each term of the inner fit; a place gives one value and a slope along each coordinate.
_EQUATIONS = 1.8
#: Products of matrices with no more multiplications are done by one thread: bits depend on how several share them.
_ONE_THREAD = 200_000
#: The most that a good fit misses at the places that it is fitted to [m, rad].
_MISSED = 0.03
#: A coefficient below this [m, rad] is not written down.
_SMALL = 3e-6
#: A coordinate whose tangents differ less than `_SAME` over steps of `_NEAR` enters linearly; tried as far as `_FAR`.
_SAME, _NEAR, _FAR = 1e-9, 0.1, 4.0

#: From (start, coordinates) to the configuration (nq,) there and its tangents (nv, t). Raises NoPlaceError.
Solve = Callable[[Array, Array], tuple[Array, Array]]
#: From a place u (t,) and a motion near it to the motion (nv,) there and its slopes (nv, t). Raises NoPlaceError.
Place = Callable[[Array, Array], tuple[Array, Array]]


class NoPlaceError(PrupPinError):
    """There is no closed configuration near where one was looked for."""


class _Places(NamedTuple):
    """Coordinates u (n, t) [dimensionless, from home's], motions (n, nv) from home to there, slopes (n, nv, t)."""

    u: Array
    motions: Array
    slopes: Array


class _Polynomial:
    """Terms T_a(x_1) T_b(x_2) … in Chebyshev's polynomials T_k(x) = cos(k arccos x), x in the unit ball.

    x (t,) are the coordinates from home's, times factor; exponents (t, terms), each term's degree in each coordinate;
    coefficients (terms, nv).
    """

    def __init__(self, factor: Array, exponents: NDArray[np.int_], coefficients: Array):
        self.factor, self._exponents, self._coefficients = factor, exponents, np.asfortranarray(coefficients)
        self._factors: list[float] = factor.tolist()
        # T_k of each coordinate in one row, cosines of these multiples of the angles arccos x ...
        orders = np.arange(exponents.max() + 1.0)
        self._orders = np.kron(np.eye(len(factor)), orders)
        # ... and for each term the factors that are not 1, filled up with T_0.
        nonzero = exponents > 0
        depth = max(1, int(nonzero.sum(axis=0).max()))
        first = np.argsort(~nonzero, axis=0, kind="stable")[:depth]
        self._chosen = first * len(orders) + np.take_along_axis(exponents, first, axis=0)

    def __call__(self, away: Sequence[float]) -> Array | None:
        """Return the motion (nv,) from home to coordinates (t,) from home's, or None where they lie outside."""
        x = [*map(mul, away, self._factors)]
        if hypot(*x) > 1.0:
            return None
        factors = np.cos(np.array([*map(acos, x)]).dot(self._orders)).take(self._chosen)
        terms = factors[0]
        for index in range(1, len(factors)):
            terms *= factors[index]
        return terms.dot(self._coefficients)

    def of_many(self, away: Array) -> tuple[Array, Mask]:
        """Return the motions (n, nv) to coordinates (n, t), and which of them lie inside, (n,)."""
        x = away * self.factor
        within = np.sqrt((x * x).sum(axis=-1)) <= 1.0
        angles = np.arccos(np.where(within[:, None], x, 0.0))
        factors = np.cos(angles[:, None] @ self._orders)[:, 0, self._chosen]
        return (factors.prod(axis=1)[:, None] @ self._coefficients)[:, 0], within

    def written(self, away: Array) -> tuple[Array, Expression]:
        """Return the motion (nv,) to coordinates (t,), expressions, and the square of their distance in the ball."""
        x = away * self.factor
        # By their recurrence, T_k = 2 x T_{k-1} - T_{k-2}, which needs no cosine.
        rising = [1.0 + 0.0 * x, x]
        for _ in range(2, int(self._exponents.max()) + 1):
            rising.append(2.0 * x * rising[-1] - rising[-2])
        first, *others = (column[degrees] for column, degrees in zip(np.stack(rising).T, self._exponents, strict=True))
        terms = first.copy()
        for other in others:
            terms *= other
        return terms @ np.where(np.abs(self._coefficients) < _SMALL, 0.0, self._coefficients), (x * x).sum()


class PolynomialStart:
    """The polynomials of one mechanism, in coordinates that `scale` (t,) makes dimensionless."""

    def __init__(self, tree: LoopedTree, home: Array, coordinates: Array, scale: Array, solve: Solve, costly: bool):
        """`coordinates` (t,) are home's. What `solve` finds is asked here and never again, more seldom if `costly`."""
        self._tree, self._home, self._coordinates = tree, home, coordinates
        self._at_home: list[float] = coordinates.tolist()
        self._polynomials: list[_Polynomial] = []

        def place(u: Array, start: Array) -> tuple[Array, Array]:
            """Return motion and slopes at a place, from a motion near it."""
            q, tangents = solve(tree.moved(home, start), coordinates + u * scale)
            slopes = pin.dDifference(tree.model, home, q)[1] @ tangents
            return pin.difference(tree.model, home, q), slopes * scale

        try:
            _, slopes = place(np.zeros(len(scale)), np.zeros(tree.model.nv))
            linear = _linear(place, slopes)
        except NoPlaceError:
            return
        terms = _terms(linear, _FEW_TERMS if costly else _TERMS)
        radius = _RADIUS
        while radius > _LEAST and not self._polynomials:
            places, reached = _sampled(place, slopes, linear, radius, terms.shape[1])
            if reached < radius:
                radius = _HOLDS * reached
                continue
            for size in (_INNER * radius, radius):
                polynomial, missed = _fitted(places, size, linear, terms, scale)
                if missed < _MISSED:
                    self._polynomials.append(polynomial)
            radius *= _INNER

    def __call__(self, target: Iterable[float]) -> Array | None:
        """Return a configuration (nq,) near the one at `target` (t,), or None where the polynomials do not tell."""
        away = [*map(sub, target, self._at_home)]
        for polynomial in self._polynomials:
            motion = polynomial(away)
            if motion is not None:
                return self._tree.moved(self._home, motion)
        return None

    def about_home(self, count: int) -> Array:
        """Return coordinates (count, t) of places well within the inner ball, home's if there is none."""
        if not self._polynomials:
            return self._coordinates[None]
        even = np.array([*itertools.islice(_even(len(self._coordinates)), count)])
        return self._coordinates + _WELL_WITHIN * even / self._polynomials[0].factor

    @property
    def widest(self) -> _Polynomial | None:
        """The polynomial that reaches farthest from home, or None."""
        return self._polynomials[-1] if self._polynomials else None

    @property
    def coordinates(self) -> Array:
        """Home's coordinates, (t,)."""
        return self._coordinates

    def of_many(self, targets: Array) -> tuple[Array, Mask]:
        """Return motions (n, nv) from home towards targets (n, t), and which of them a polynomial told, (n,)."""
        motions = np.zeros((len(targets), self._tree.model.nv))
        told = np.zeros(len(targets), bool)
        for polynomial in self._polynomials:
            found, within = polynomial.of_many(targets - self._coordinates)
            new = within & ~told
            motions[new] = found[new]
            told |= within
        return motions, told


def _linear(place: Place, slopes: Array) -> Mask:
    """Return which coordinates enter linearly, (t,): their tangents are those of home, `slopes`, all around it."""
    count = slopes.shape[1]
    steps = _NEAR * np.concatenate((np.eye(count), -np.ones((1, count))))
    differences = [place(u, slopes @ u)[1] - slopes for u in steps]
    return np.abs(differences).max(axis=(0, 1)) < _SAME


def _sampled(place: Place, slopes: Array, linear: Mask, radius: float, terms: int) -> tuple[_Places, float]:
    """Return places all over a ball about home, where slopes are `slopes`, and how far out they were found."""
    count = len(linear)
    inner = int(np.ceil(_EQUATIONS * terms / (1 + count)))
    distances = *_spread(0.0, _INNER * radius, inner), *_spread(_INNER * radius, radius, inner // 3)
    nv, most = len(slopes), 1 + len(distances)
    found = _Places(np.zeros((most, count)), np.zeros((most, nv)), np.zeros((most, nv, count)))
    found.slopes[0] = slopes
    for k, (distance, even) in enumerate(zip(distances, _even(count), strict=False), start=1):
        direction = np.where(linear, 0.0, even)
        u = np.where(linear, _FAR * even, distance * direction / max(np.linalg.norm(direction), 1e-9))
        apart = (found.u[:k] - u) * ~linear
        near = int(np.argmin((apart * apart).sum(axis=1)))
        start = found.motions[near] + found.slopes[near] @ (u - found.u[near])
        try:
            found.motions[k], found.slopes[k] = place(u, start)
        except NoPlaceError:
            return found, distance
        found.u[k] = u
    return found, radius


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


def _terms(linear: Mask, most: int) -> NDArray[np.int_]:
    """Return the degree of each term in each coordinate, (t, terms)."""
    curved = np.flatnonzero(~linear).tolist()
    degree = max(d for d in range(1, _DEGREE + 1) if d == 1 or comb(len(curved) + d, d) <= most)
    words = [word for d in range(degree + 1) for word in combinations_with_replacement(curved, d)]
    words += [(index,) for index in np.flatnonzero(linear).tolist()]
    return np.array([np.bincount(word, minlength=len(linear)) for word in words], int).T


def _fitted(
    places: _Places, size: float, linear: Mask, exponents: NDArray[np.int_], scale: Array
) -> tuple[_Polynomial, float]:
    """Return the polynomial that fits the places in a ball of radius `size` best, and the most that it misses.

    `exponents` (t, terms), see `_terms`; the polynomial takes coordinates that `scale` makes dimensionless.
    """
    within = np.linalg.norm(places.u * ~linear, axis=1) <= size
    u, motions, slopes = (part[within] for part in places)
    orders = np.arange(exponents.max() + 1)
    factor = np.where(linear, 1 / _FAR, 1 / size)
    angles = np.arccos(u * factor)[..., None]
    each = np.arange(len(linear))[:, None]
    factors = np.cos(orders * angles)[:, each, exponents]
    rates = (orders * np.sin(orders * angles) / np.sin(angles))[:, each, exponents]
    rows, right = [factors.prod(axis=1)], [motions]
    for index in range(len(linear)):
        # A slope is weighed like a value: that of the highest term is its degree times as large.
        others = np.delete(factors, index, axis=1).prod(axis=1)
        rows.append(rates[:, index] * others / orders[-1])
        right.append(slopes[..., index] / (factor[index] * orders[-1]))
    equations = np.concatenate((np.concatenate(rows), np.concatenate(right)), axis=1)
    terms, width = exponents.shape[1], equations.shape[1]
    normal, step = np.zeros((terms, width)), max(1, _ONE_THREAD // (terms * width))
    for first in range(0, len(equations), step):
        some = equations[first : first + step]
        normal += some[:, :terms].T @ some
    coefficients = Factors().solver(normal[:, :terms])(normal[:, terms:])
    polynomial = _Polynomial(factor / scale, exponents, coefficients)
    return polynomial, float(np.abs(rows[0] @ coefficients - motions).max())
