"""The tip compliance of a straight beam from the moments of its sections' flexibility.

By Castigliano (Eqs. 31-36, 103-106 of the paper, with the sign of Eq. (90) corrected): with u the distance from
the tip, the section at u carries the tip force and the tip moment plus u times the tip force, so all that the
geometry of a section law contributes are the integrals over the length of

    1/EA,  1/(kappa G A),  1/GJ   and   u^n / EI,  n = 0, 1, 2.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..spatial import Array

# Gauss-Legendre on [0, 1]; 24 points integrate a taper of 1:6 to rounding.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)
NODES, WEIGHTS = (_NODES + 1) / 2, _WEIGHTS / 2


@dataclass(frozen=True)
class SectionFlexibilities:
    """Flexibilities of the section at distance u from the tip, functions of u (..., points)."""

    axial: Callable[[Array], Array]
    shear_x: Callable[[Array], Array]
    shear_y: Callable[[Array], Array]
    torsion: Callable[[Array], Array]
    bending_x: Callable[[Array], Array]
    bending_y: Callable[[Array], Array]
    #: Where the law may jump, as fractions of the length from the tip (n, b).
    breaks: Array

    def tip_compliance(self, length: Array) -> Array:
        """Return the (..., 6, 6) tip compliance by quadrature."""
        u, weight = quadrature(length, self.breaks)

        def moment(flexibility: Callable[[Array], Array], power: int) -> Array:
            return (flexibility(u) * u**power * weight).sum(-1)

        return tip_compliance(
            axial=moment(self.axial, 0),
            shear=(moment(self.shear_x, 0), moment(self.shear_y, 0)),
            torsion=moment(self.torsion, 0),
            bending_x=(moment(self.bending_x, 0), moment(self.bending_x, 1), moment(self.bending_x, 2)),
            bending_y=(moment(self.bending_y, 0), moment(self.bending_y, 1), moment(self.bending_y, 2)),
        )


def tip_compliance(axial: Array, shear: tuple, torsion: Array, bending_x: tuple, bending_y: tuple) -> Array:
    """Return the (..., 6, 6) compliance at the tip, loads and deformations (fx fy fz mx my mz) at the tip.

    `axial` = int 1/EA, `torsion` = int 1/GJ, `shear` = (int 1/GA_x, int 1/GA_y); `bending_x` = int u^n/EI_x for
    n = 0, 1, 2 resists moments about x (so deflection along y), `bending_y` those about y.
    """
    x0, x1, x2 = bending_x
    y0, y1, y2 = bending_y
    matrix = np.zeros((*np.broadcast_shapes(np.shape(axial), np.shape(x0)), 6, 6))
    matrix[..., 0, 0] = y2 + shear[0]
    matrix[..., 1, 1] = x2 + shear[1]
    matrix[..., 2, 2] = axial
    matrix[..., 3, 3] = x0
    matrix[..., 4, 4] = y0
    matrix[..., 5, 5] = torsion
    matrix[..., 0, 4] = matrix[..., 4, 0] = y1
    matrix[..., 1, 3] = matrix[..., 3, 1] = -x1
    return matrix


def slender_beam(length: float, bending: float) -> Array:
    """Return the same of a uniform beam of which sections bend by 1 / EI [1/(N m^2)] and do nothing else, (6, 6)."""
    bends = tuple(np.asarray(bending * length**n / n) for n in (1, 2, 3))
    return tip_compliance(np.zeros(()), (0.0, 0.0), np.zeros(()), bends, bends)


def quadrature(length: Array, breaks: Array) -> tuple[Array, Array]:
    """Return Gauss points u and weights (..., points) over [0, length], composite over `breaks`.

    `breaks` (n, b) are the places where a section law may jump, as fractions of the length from the tip, 0 and 1
    included; no point falls on a break.
    """
    edges = np.asarray(length)[..., None] * breaks
    return _between(edges[..., :-1], edges[..., 1:])


def _between(start: Array, end: Array) -> tuple[Array, Array]:
    """Return Gauss points and weights of the intervals [start, end] (..., intervals), flattened to (..., points)."""
    width = (end - start)[..., None]
    flat = (*start.shape[:-1], -1)
    return (start[..., None] + width * NODES).reshape(flat), (width * WEIGHTS).reshape(flat)


def centre_line(law: SectionFlexibilities, length: Array, load: Array, fractions: Array) -> Array:
    """Return the displacement of sections relative to the clamped root under a tip load, (..., p, 6).

    `load` (..., 6) acts at the tip; `fractions` (p,) of the length from the root. A section moves by what the
    sections between it and the root do: int kappa(v) (v - u) dv and the like, u the distance from the tip.
    """
    u = np.asarray(length)[..., None] * (1 - fractions)
    edges = np.broadcast_to(
        (np.asarray(length)[..., None] * law.breaks)[..., None, :], (*u.shape, law.breaks.shape[-1])
    )
    v, w = _between(np.maximum(edges[..., :-1], u[..., None]), np.maximum(edges[..., 1:], u[..., None]))
    flat = v.reshape(*u.shape[:-1], -1)

    def weighted(flexibility: Callable[[Array], Array]) -> Array:
        return flexibility(flat).reshape(v.shape) * w

    fx, fy, fz, mx, my, mz = (load[..., i, None, None] for i in range(6))
    kx, ky = weighted(law.bending_x) * (mx - v * fy), weighted(law.bending_y) * (my + v * fx)
    arm = v - u[..., None]
    return np.stack(
        [
            (weighted(law.shear_x) * fx + ky * arm).sum(-1),
            (weighted(law.shear_y) * fy - kx * arm).sum(-1),
            (weighted(law.axial) * fz).sum(-1),
            kx.sum(-1),
            ky.sum(-1),
            (weighted(law.torsion) * mz).sum(-1),
        ],
        axis=-1,
    )


@dataclass(frozen=True)
class BodyWeight:
    """The weight of a beam's body: mass [kg] and its centre's distance from the tip towards the root [m]."""

    mass: Array
    centre_from_tip: Array


def body_weight(
    line_density: Callable[[Array], Array], length: Array, overhang: Array, overhang_at_root: Array, breaks: Array
) -> BodyWeight:
    """Return mass and centre of a beam with `line_density`(u) [kg/m] and a uniform overhang beyond one end."""
    u, w = quadrature(length, breaks)
    density = line_density(u)
    span, first = (density * w).sum(-1), (density * w * u).sum(-1)
    extra = line_density(np.where(overhang_at_root, length, 0.0)[..., None])[..., 0] * overhang
    centre = np.where(overhang_at_root, length + overhang / 2, -overhang / 2)
    mass = span + extra
    return BodyWeight(mass, (first + extra * centre) / np.where(mass > 0, mass, 1.0))


def own_weight_deformation(
    gravity: Array,
    line_density: Callable[[Array], Array],
    overhang: Array,
    length: Array,
    inboard_is_root: Array,
    law: SectionFlexibilities,
) -> Array:
    """Return what the weight of the inboard material takes off the tip deformation, (..., 6).

    A module's load is the whole wrench across its joint, the beam's own weight included. A section is crossed by
    that wrench less the weight of the material inboard of it, overhang included. `gravity` (..., 3) [m/s^2] in
    module axes; `overhang` [m] is the material beyond the inboard end; `line_density` is a function of the distance
    u from the tip.
    """
    u, w = quadrature(length, law.breaks)
    rooted = np.asarray(inboard_is_root)[..., None]
    end = np.where(rooted, np.asarray(length)[..., None], 0.0)
    overhang = np.asarray(overhang)[..., None]
    # Mass of the piece between each section and the inboard end, and its first moment about the section.
    edges = np.broadcast_to(
        (np.asarray(length)[..., None] * law.breaks)[..., None, :], (*u.shape, law.breaks.shape[-1])
    )
    low, high = np.minimum(u, end)[..., None], np.maximum(u, end)[..., None]
    inner, inner_w = _between(np.clip(edges[..., :-1], low, high), np.clip(edges[..., 1:], low, high))
    density = line_density(inner.reshape(*u.shape[:-1], -1)).reshape(inner.shape) * inner_w
    end_mass = line_density(end) * overhang
    distance = np.abs(u - end)
    mass = density.sum(-1) + end_mass
    moment = (density * np.abs(inner - u[..., None])).sum(-1) + end_mass * (distance + overhang / 2)
    # z points from root to tip: the inboard piece lies towards -z where the root is inboard.
    arm = np.where(rooted, -moment, moment)
    g = gravity[..., None, :]
    fx, fy, fz = g[..., 0] * mass, g[..., 1] * mass, g[..., 2] * mass
    kx, ky = law.bending_x(u) * -arm * g[..., 1] * w, law.bending_y(u) * arm * g[..., 0] * w
    # A section's rotation r at distance u below the tip moves the tip by r x (u e_z).
    removed = np.stack(
        [
            (law.shear_x(u) * fx * w + ky * u).sum(-1),
            (law.shear_y(u) * fy * w - kx * u).sum(-1),
            (law.axial(u) * fz * w).sum(-1),
            kx.sum(-1),
            ky.sum(-1),
            np.zeros(u.shape[:-1]),
        ],
        axis=-1,
    )
    return -removed
