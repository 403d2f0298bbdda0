"""Efforts as a linear model, joint by joint: bodies near their drawing, and what drives need besides.

tau_j = g_j (Y_j b) + U_j c, with inertial parameters b that all joints share and whose prior is the robot file's, and a
gain g_j, of 1 where a drive reports what it gives. Products of columns with each other and with efforts are all that a
likelihood asks for: how far a log is from such a robot (`unlikely.py`), and in which units its drives report
(`gains.py`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...mechanism import Mechanism
from ...spatial import Array
from ..criteria import EFFORT_MASSES, LEAST_REACH, LITTLE


@dataclass(frozen=True, eq=False)
class BodyPrior:
    """Inertial parameters of all bodies that may be other than drawn: their places (r,) among all, their standard
    deviations (r,), and what the robot file has, in multiples of these (r,).
    """

    where: np.ndarray
    deviations: Array
    drawn: Array

    @classmethod
    def of(cls, mechanism: Mechanism, tolerances: Mapping[str, float]) -> BodyPrior:
        """Return the prior by what is declared of masses and inertias, and of the tool's body with what it may hold."""
        mass, inertia = (max(float(tolerances.get(key, EFFORT_MASSES)), 1e-3) for key in ("mass", "inertia"))
        bodies, spread = list(mechanism.model.inertias)[1:], []
        for body in bodies:
            m = float(body.mass)
            trace = float(np.trace(body.inertia)) + m * float(body.lever @ body.lever)
            reach = np.sqrt(trace / m) if m > 0 else 0.0
            spread.append(np.array([mass * m, *3 * [mass * m * reach], *6 * [inertia * max(trace, 0.0)]]))
        tool = mechanism.tool
        if tool is not None and tool.joint > 0:  # what it holds is in no drawing
            held = LITTLE * sum(float(body.mass) for body in mechanism.model.inertias)
            lever = float(np.linalg.norm(tool.placement[:3, 3])) + LEAST_REACH
            own = np.array([held, *3 * [held * lever], *6 * [held * lever**2]])
            spread[tool.joint - 1] = np.hypot(spread[tool.joint - 1], own)
        deviations = np.concatenate(spread)
        where = np.flatnonzero(deviations > 0)
        drawn = np.concatenate([body.toDynamicParameters() for body in bodies])
        return cls(where, deviations[where], drawn[where] / deviations[where])

    def columns(self, regressor: Array) -> Array:
        """Return efforts (n, k, r) per standard deviation, of efforts per parameter of each body (n, k, bodies, 10)."""
        return np.asarray(regressor.reshape(*regressor.shape[:2], -1)[..., self.where] * self.deviations)


def gram_of(columns: Array) -> Array:
    """Return products (k, p, p) of columns (n, k, p) with each other at each joint, where most of them are nothing."""
    gram = np.zeros((columns.shape[1], columns.shape[2], columns.shape[2]))
    for joint in range(len(gram)):
        there = columns[:, joint].any(axis=0)
        own = columns[:, joint, there]
        gram[joint][np.ix_(there, there)] = own.T @ own
    return gram


@dataclass(frozen=True, eq=False)
class JointEquations:
    """Normal equations of each joint's efforts: products of columns (k, p, p), with efforts (k, p), of efforts (k,)."""

    gram: Array
    moment: Array
    power: Array

    @classmethod
    def of(cls, columns: Array, efforts: Array, gram: Array | None = None) -> JointEquations:
        """Return the equations of columns (n, k, p) and efforts (n, k); gram: the columns' products, if known."""
        moment = np.matmul(efforts.T[:, None], columns.transpose(1, 0, 2))[:, 0]
        return cls(gram_of(columns) if gram is None else gram, moment, (efforts**2).sum(axis=0))

    @classmethod
    def total(cls, parts: Sequence[JointEquations]) -> JointEquations:
        """Return the equations of several blocks of time together."""
        return cls(*(sum(getattr(part, name) for part in parts) for name in ("gram", "moment", "power")))

    def among(self, basis: Array) -> JointEquations:
        """Return the same of combinations of the columns: basis (p, r)."""
        return JointEquations(basis.T @ self.gram @ basis, self.moment @ basis, self.power)

    def scaled(self, joints: Array, columns: Array) -> JointEquations:
        """Return the same of columns and efforts in other units, of each joint (k,) and of each column (p,)."""
        squares = joints**2
        gram = self.gram * (squares[:, None, None] * columns[:, None]) * columns
        return JointEquations(gram, self.moment * squares[:, None] * columns, self.power * squares)

    def without(self, count: int) -> JointEquations:
        """Return the same without the first columns."""
        return JointEquations(self.gram[:, count:, count:], self.moment[:, count:], self.power)

    def less(self, x: Array, gain: Array | float = 1.0) -> JointEquations:
        """Return the same of what is left of the efforts beside coefficients x (p,) and gains (k,)."""
        return JointEquations(self.gram, self.moment - (gain * (self.gram @ x).T).T, self.left(x, gain))

    def borne(self, x: Array) -> Array:
        """Return the squares (k,) of what coefficients x (p,) do."""
        return np.asarray((self.gram @ x) @ x)

    def left(self, x: Array, gain: Array | float = 1.0) -> Array:
        """Return the squares (k,) that coefficients x (p,) leave, beside gains (k,)."""
        return np.asarray(self.power - 2 * gain * (self.moment @ x) + gain**2 * self.borne(x))

    def weighted(self, weights: Array) -> Array:
        """Return products (p, p) of columns over all joints, each with its weight (k,)."""
        return np.tensordot(weights, self.gram, 1)

    def likeliest(self, mean: Array, width: float, gain: Array) -> tuple[Array, Array]:
        """Return the likeliest coefficients (p,) beside gains (k,), and their inverse covariance (p, p).

        They scatter about their mean (p,) by `width` each, and the efforts by 1.
        """
        precision = self.weighted(gain**2) + np.eye(len(mean)) / width**2
        return np.asarray(np.linalg.solve(precision, gain @ self.moment + mean / width**2), float), precision
