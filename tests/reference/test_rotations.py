"""Rotation vectors of the references against the package's."""

from __future__ import annotations

import numpy as np

from prup_pin.spatial import rotation_exp
from tests.reference.concealed.rotations import matrix, vector


def test_there_and_back_up_to_half_a_turn():
    rng = np.random.default_rng(0)
    axes = rng.normal(size=(200, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    turns = axes * np.concatenate([rng.uniform(0, np.pi - 1e-6, 150), np.geomspace(1e-15, 1e-3, 50)])[:, None]
    np.testing.assert_allclose(matrix(turns), rotation_exp(turns), atol=1e-14)
    np.testing.assert_allclose(vector(matrix(turns)), turns, atol=1e-9)
