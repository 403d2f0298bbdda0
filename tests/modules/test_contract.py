"""What every kind of module owes to the rest of the package; a new kind needs a line in `examples.EXAMPLES`."""

from __future__ import annotations

import numpy as np
import pytest

from prup_pin.modules import KINDS
from prup_pin.testing.modules import CHECKS, GEOMETRY, check_declared, loads_of, sizes

from .examples import EXAMPLES, stacked

BY_KIND = pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.kind)


def test_every_kind_has_an_example():
    assert {kind.kind for kind in KINDS} == set(EXAMPLES)


def values_of(kind) -> dict[str, np.ndarray]:
    return stacked(kind.kind, *EXAMPLES[kind.kind])


@BY_KIND
def test_declares_everything_a_robot_file_needs(kind):
    check_declared(kind)


@BY_KIND
@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
def test_keeps_its_contract(kind, check):
    check(kind, values_of(kind))


ROUND = ("tapered_beam", "bearing", "bearing_pair", "hertzian_bearing")


@pytest.mark.parametrize("name", ROUND)
def test_a_round_module_turns_with_its_load(name):
    kind = next(kind for kind in KINDS if kind.kind == name)
    turn = np.kron(np.eye(2), [[np.cos(0.7), -np.sin(0.7), 0], [np.sin(0.7), np.cos(0.7), 0], [0, 0, 1]])
    values, load = values_of(kind), loads_of(kind)
    turned = kind.deformation(values, GEOMETRY, load @ turn.T)
    straight = kind.deformation(values, GEOMETRY, load) @ turn.T
    assert turned == pytest.approx(straight, rel=1e-12, abs=1e-12 * np.abs(straight).max())
    matrix = kind.compliance(values, GEOMETRY, load @ turn.T)
    expected = turn @ kind.compliance(values, GEOMETRY, load) @ turn.T
    assert matrix / sizes(matrix) == pytest.approx(expected / sizes(matrix), abs=1e-12)
