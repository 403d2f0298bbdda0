"""A beam of arbitrary section along its length, given as a table of stations."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..numbers import number
from ..parameters import Quantity
from ..spatial import Array
from .flexibility import BodyWeight, SectionFlexibilities, body_weight, own_weight_deformation
from .module import Mask, ModuleGeometry, Values, WrenchModule
from .section import CLAMP, clamp_compliance


def _table(name: str, unit: str, description: str, default=None, **options) -> Quantity:
    return Quantity(name, unit, description, default, shape=(-1,), **options)


def _infinite(values: Values):
    return np.full_like(values["stations"], np.inf)


def _weightless(values: Values) -> Array:
    """Return no mass per length at any station [kg/m]."""
    return np.zeros_like(values["stations"])


class SectionBeam(WrenchModule):
    """Sections at stations from root (0) to tip (1), linear in between; a repeated station is a step.

    The stations give stiffnesses, not shapes, so that any material and section fits. The integrals run over each
    interval by Gauss-Legendre quadrature: stepped beams are exact, tapers of any shape as fine as their table.
    """

    kind = "section_beam"
    summary = "beam with EA, EI, GJ and shear stiffnesses tabulated along its length: stepped, tapered, any section"
    is_body = True
    spans_frames = True
    bends_exactly = True
    quantities = (
        _table("stations", "1", "places from root (0) to tip (1); a repeated one is a step", positive=False, upper=1.0),
        _table("axial_stiffness", "N", "EA at the stations"),
        _table("bending_stiffness_x", "N m^2", "EI about x at the stations"),
        _table("bending_stiffness_y", "N m^2", "EI about y at the stations"),
        _table("torsional_stiffness", "N m^2", "GJ at the stations", _infinite),
        _table("shear_stiffness_x", "N", "kappa G A along x at the stations", _infinite),
        _table("shear_stiffness_y", "N", "kappa G A along y at the stations", _infinite),
        _table("line_density", "kg/m", "mass per length", _weightless, positive=False),
        CLAMP,
    )

    @staticmethod
    def _from_tip(values: Values) -> Array:
        """Return the stations as fractions of the length from the tip, increasing, (n, s)."""
        return 1 - values["stations"][..., ::-1]

    def _profile(self, values: Values, length: Array, name: str) -> Callable[[Array], Array]:
        """Return the tabulated quantity as a function of the distance u from the tip."""
        places, table = self._from_tip(values), values[name][..., ::-1]
        start, width = places[..., None, :-1], np.diff(places)[..., None, :]
        low = table[..., None, :-1]
        with np.errstate(invalid="ignore"):  # infinite minus infinite: no slope
            slope = (table[..., None, 1:] - low) / np.where(width > 0, width, np.inf)
        steep = ~np.isfinite(slope)  # an infinite end makes the whole interval rigid
        low, slope = np.where(steep, np.inf, low), np.where(steep, 0.0, slope)

        def at(u: Array) -> Array:
            fraction = np.clip(u / np.asarray(length)[..., None], 0.0, 1.0)[..., None]
            inside = (fraction >= start) & (width > 0)
            # the last interval that starts at or before u
            index = np.where(inside, np.arange(width.shape[-1]), -1).max(-1, keepdims=True)
            chosen = inside & (np.arange(width.shape[-1]) == index)
            return np.where(chosen, low + slope * (fraction - start), 0.0).sum(-1)

        return at

    def section_law(self, values: Values, at: ModuleGeometry) -> SectionFlexibilities:
        length = at.length

        def flexibility(name: str) -> Callable[[Array], Array]:
            stiffness = self._profile(values, length, name)
            return lambda u: 1 / stiffness(u)

        return SectionFlexibilities(
            axial=flexibility("axial_stiffness"),
            shear_x=flexibility("shear_stiffness_x"),
            shear_y=flexibility("shear_stiffness_y"),
            torsion=flexibility("torsional_stiffness"),
            bending_x=flexibility("bending_stiffness_x"),
            bending_y=flexibility("bending_stiffness_y"),
            breaks=self._from_tip(values),
        )

    def compliance(self, values: Values, at: ModuleGeometry, load: Array | None) -> Array:
        return self.section_law(values, at).tip_compliance(at.length) + clamp_compliance(values, at.length)

    def line_density(self, values: Values, at: ModuleGeometry) -> Callable[[Array], Array]:
        return self._profile(values, at.length, "line_density")

    def weight_deformation(self, values: Values, at: ModuleGeometry, gravity: Array) -> Array:
        density = self.line_density(values, at)
        law = self.section_law(values, at)
        return own_weight_deformation(gravity, density, np.zeros_like(at.length), at.length, at.inboard_is_root, law)

    def weight(self, values: Values, at: ModuleGeometry) -> BodyWeight:
        density = self.line_density(values, at)
        none = np.zeros_like(at.length)
        return body_weight(density, at.length, none, at.anchored_at_tip, self._from_tip(values))

    def problems(self, values: Values, at: ModuleGeometry) -> Mask:
        stations = values["stations"]
        ordered = (np.diff(stations) >= 0).all(-1) & (stations[..., 0] == 0) & (stations[..., -1] == 1)
        return (at.length <= 0) | ~ordered

    def problem_text(self, values: Values, at: ModuleGeometry, index: int) -> str:
        return (
            f"length {number(at.length[..., index], 6)} m, stations {values['stations'][index].tolist()}; "
            "expected a positive "
            "length and stations that rise from 0 (root) to 1 (tip)"
        )
