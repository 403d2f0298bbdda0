"""Two valid modules of every kind, and a way to evaluate them: what the tests of this folder share."""

from __future__ import annotations

from typing import Any

import numpy as np

from prup_pin.modules import KINDS, CompliantModule, ModuleGeometry
from prup_pin.testing import modules as testing

STEEL: dict[str, Any] = {"youngs_modulus": 201e9, "shear_modulus": 77e9, "shear_coefficient": 0.886, "density": 7850.0}
SPRING_STEEL: dict[str, Any] = {"youngs_modulus": 206e9, "shear_modulus": 79e9}
CATALOGUE_NUT: dict[str, Any] = {"rated_stiffness": 680e6, "dynamic_load_rating": 14300.0}
DRIVE: dict[str, Any] = {"screw_lead": 0.01, "motor_pulley_diameter": 0.1, "screw_pulley_diameter": 0.035}


def _matrix(seed: int) -> np.ndarray:
    factor = np.random.default_rng(seed).normal(size=(6, 6)) * np.array([1e-4] * 3 + [1e-3] * 3)[:, None]
    return factor @ factor.T


EXAMPLES: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "beam": (
        {"diameter": 0.02, "inner_diameter": 0.004, "body_length": 0.5, **STEEL},
        {"area": 4e-4, "second_moment_x": 1e-8, "second_moment_y": 2e-8, "torsion_constant": 1.5e-8, **STEEL},
    ),
    "tapered_beam": (
        {"root_diameter": 0.03, "tip_diameter": 0.01, "inner_diameter": 0.004, **STEEL},
        {"root_diameter": 0.02, "tip_diameter": 0.025, **STEEL},
    ),
    "section_beam": (
        {
            "stations": [0.0, 0.4, 0.4, 1.0],
            "axial_stiffness": [6e7, 6e7, 2e7, 1e7],
            "bending_stiffness_x": [3000.0, 2500.0, 1500.0, 500.0],
            "bending_stiffness_y": [2000.0, 2500.0, 900.0, 400.0],
            "torsional_stiffness": [900.0, 800.0, 700.0, 300.0],
            "shear_stiffness_x": [2e7, 2e7, 1e7, 5e6],
            "shear_stiffness_y": [3e7, 2e7, 1e7, 4e6],
            "line_density": [3.0, 2.5, 1.0, 0.5],
        },
        {
            "stations": [0.0, 0.2, 0.7, 1.0],
            "axial_stiffness": [5e7, 4e7, 3e7, 2e7],
            "bending_stiffness_x": [1000.0, 2000.0, 3000.0, 1000.0],
            "bending_stiffness_y": [1000.0, 2500.0, 2000.0, 1000.0],
        },
    ),
    "bearing": (
        {"radial_stiffness": 96.9e6, "axial_stiffness": 46.4e6, "tilting_stiffness": 6268.45},
        {"radial_stiffness": 50e6, "rotational_stiffness": 120.0},
    ),
    "bearing_pair": (
        {"radial_stiffness": 48.45e6, "axial_stiffness": 23.2e6, "effective_width": 0.016},
        {"radial_stiffness": 58.74e6, "axial_stiffness": 12.5e6, "count": 3.0},
    ),
    "hertzian_bearing": (
        {
            "reference_stiffness": 60e6,
            "reference_load": 200.0,
            "preload": 40.0,
            "axial_stiffness": 30e6,
            "tilting_stiffness": 5000.0,
        },
        {"reference_stiffness": 90e6, "reference_load": 500.0, "preload": 100.0},
    ),
    "ball_nut": (
        {"preload": 1144.0, **CATALOGUE_NUT},
        {"working_load": 600.0, **CATALOGUE_NUT},
    ),
    "preloaded_ball_nut": (
        {"preload": 60.0, **CATALOGUE_NUT},
        {"preload": 100.0, "stiffness": 300e6},
    ),
    "ball_screw": (
        {"length": 0.61, "area": 176.7e-6, "youngs_modulus": 206e9},
        {"length": 0.8, "area": 250e-6, "youngs_modulus": 210e9},
    ),
    "support_bearing": ({"stiffness_each": 17.32e6}, {"stiffness": 30e6}),
    "timing_belt": ({"stiffness": 18.04e6, **DRIVE}, {"stiffness": 10e6, "reverse_efficiency": 0.8, **DRIVE}),
    "motor": ({"torsional_stiffness": 6875.5, **DRIVE}, {"torsional_stiffness": 900.0, **DRIVE}),
    "joint_spring": ({"stiffness": 1e4}, {"stiffness": 2e4}),
    "compliance_matrix": ({"matrix": _matrix(1)}, {"matrix": _matrix(2), "scale": 1.5}),
    "cross_spring_hinge": (
        {"leaf_length": 0.06, "leaf_width": 0.03, "leaf_thickness": 3e-3, "count": 2.0, **SPRING_STEEL},
        {"leaf_length": 0.04, "leaf_width": 0.02, "leaf_thickness": 5e-4, "youngs_modulus": 72e9, "count": 4.0},
    ),
    "beam_as_published": (
        {"diameter": 0.02, **STEEL},
        {"diameter": 0.012, **STEEL},
    ),
}


def kind_named(name: str) -> CompliantModule:
    return next(kind for kind in KINDS if kind.kind == name)


def resolved(kind: str, **given: Any) -> dict[str, Any]:
    """Return all values of one module, derived defaults included, as a robot file would get them."""
    return testing.resolved(kind_named(kind), given)


def stacked(kind: str, *modules: dict[str, Any]) -> dict[str, np.ndarray]:
    """Return the values of several modules as the arrays (n,) that the equations take."""
    return testing.stacked(kind_named(kind), *modules)


def one(kind: str, span: float = 1.0, /, position: float = 0.2, load=None, **given: Any) -> np.ndarray:
    """Return the compliance (k, k) of one module."""
    at = geometry(span, position)
    wrench = None if load is None else np.asarray(load, float)[None]
    return kind_named(kind).compliance(stacked(kind, given), at, wrench)[0]


def geometry(length: float = 1.0, position: float = 0.2, inboard_is_root: bool = True, anchored_at_tip: bool = False):
    return ModuleGeometry(
        np.array([length]), np.array([position]), np.array([inboard_is_root]), np.array([anchored_at_tip])
    )
