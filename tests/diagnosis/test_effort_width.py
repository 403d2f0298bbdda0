"""How far off what every drive has is: a variance for each kind, by marginal likelihood."""

import numpy as np
import pytest

from prup_pin.diagnosis.efforts.nuisance import learned_precisions


class PlainProblem:
    """One linear problem of white noise of size one: y = A x + e, in blocks, with a flat prior."""

    def __init__(self, columns, target, blocks=20):
        self.columns = self
        self.table, self.target = columns, target
        self.parts = np.array_split(np.arange(len(target)), blocks)
        self.total = columns.T @ columns
        self.moment = np.array([columns[part].T @ target[part] for part in self.parts])

    def precision(self, where):
        return np.zeros((len(where), len(where)))

    def residual(self, where, x):
        return (self.target - self.table[:, where] @ x)[:, None]

    def gradients(self, left, where):
        return np.array([self.table[part][:, where].T @ left[part, 0] for part in self.parts])


class PlainModel:
    terms = ()

    def __init__(self, problem):
        self.problem, self.where = problem, list(range(problem.table.shape[1]))


def problem(seed, sizes, samples=4000):
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(samples, len(sizes)))
    return PlainProblem(columns, columns @ (sizes * rng.normal(size=len(sizes))) + rng.normal(size=samples))


@pytest.fixture
def learned(monkeypatch):
    def plain_fit(model):
        matrix = model.problem.total
        return np.linalg.solve(matrix, model.problem.moment.sum(axis=0)), matrix

    monkeypatch.setattr("prup_pin.diagnosis.efforts.nuisance.fit", plain_fit)

    def of(problem, kinds):
        kinds = {name: (np.array(own), np.eye(len(own))) for name, own in kinds.items()}
        return learned_precisions(PlainModel(problem), kinds)

    return of


@pytest.mark.parametrize("width", [0.03, 0.1, 0.5])
def test_the_width_of_a_kind_is_what_its_coefficients_scatter_by(learned, width):
    """Forty coefficients tell a standard deviation to some 11 %; blocks scatter like white noise or a little more."""
    precision = learned(problem(1, np.full(40, width)), {"kind": range(40)})["kind"]
    assert precision == pytest.approx(width**-2, rel=0.5)


def test_kinds_have_widths_of_their_own(learned):
    sizes = np.repeat([0.5, 0.03], 30)
    precisions = learned(problem(2, sizes), {"wide": range(30), "narrow": range(30, 60)})
    assert precisions["wide"] < 10
    assert precisions["narrow"] > 400


def test_what_is_nothing_is_narrow(learned):
    """Coefficients that are nothing keep a prior that outweighs what 4000 samples of noise make of them."""
    precision = learned(problem(3, np.zeros(30)), {"kind": range(30)})["kind"]
    assert precision > 4000
