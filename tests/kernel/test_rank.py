"""One decision on what counts as zero."""

import numpy as np
import pytest

from prup_pin.kernel import NEGLIGIBLE, pseudo_inverse, rank_of, semidefinite_inverse


@pytest.fixture
def matrix():
    """A 5 x 4 matrix of rank 3 but for one ten millionth, in mixed units, and the factors that take them away."""
    generator = np.random.default_rng(0)
    u, _ = np.linalg.qr(generator.standard_normal((5, 5)))
    v, _ = np.linalg.qr(generator.standard_normal((4, 4)))
    rows, columns = np.array([1e3, 1.0, 2.0, 1e-2, 5.0]), np.array([1.0, 1e4, 0.1, 3.0])
    values = np.zeros((5, 4))
    values[range(4), range(4)] = (2.0, 0.5, 1e-4, 0.1 * NEGLIGIBLE)
    return (u @ values @ v.T) / rows[:, None] / columns, rows, columns


def test_null_spaces_and_inverse_are_those_of_the_matrix_in_its_own_units(matrix):
    given, rows, columns = matrix
    rank, left, right, inverse = rank_of(given, rows, columns)
    assert (rank, left.shape, right.shape) == (3, (5, 2), (4, 1))
    assert np.abs(left.T @ given * columns).max() < NEGLIGIBLE
    assert np.abs(rows[:, None] * given @ right).max() < NEGLIGIBLE
    kept = rows[:, None] * (given @ inverse @ given - given) * columns
    assert np.abs(kept).max() < NEGLIGIBLE


def test_many_matrices_are_decided_as_one(matrix):
    given, rows, columns = matrix
    scaled = rows[:, None] * given * columns
    several = np.stack([scaled, 1e5 * scaled, np.zeros_like(scaled)])
    inverses = pseudo_inverse(several)
    np.testing.assert_allclose(inverses[0], rank_of(scaled).inverse, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(inverses[1], inverses[0] / 1e5, rtol=1e-9, atol=1e-14)
    assert not inverses[2].any()


def test_an_empty_matrix_binds_nothing():
    rank, left, right, inverse = rank_of(np.zeros((0, 3)), columns=np.array([1.0, 2.0, 3.0]))
    assert (rank, left.shape, inverse.shape) == (0, (0, 0), (3, 0))
    np.testing.assert_array_equal(right, np.diag([1.0, 2.0, 3.0]))


def test_energies_are_judged_by_the_square_of_motions():
    """A spring 1e-9 as soft as the others still counts; one that is soft only by rounding does not."""
    turn, _ = np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))
    softer = turn @ np.diag([1.0, 2.0, 1e-9]) @ turn.T
    np.testing.assert_allclose(semidefinite_inverse(softer) @ softer, np.eye(3), atol=1e-5)
    rounding = turn @ np.diag([1.0, 2.0, 1e-14]) @ turn.T
    assert np.linalg.matrix_rank(semidefinite_inverse(rounding), tol=1e-6) == 2
