"""What every kind of module owes to the rest of the package; a new kind needs a line in `examples.EXAMPLES`."""

from __future__ import annotations

import numpy as np
import pytest

from prup_pin.modules import KINDS, DriveModule, ModuleGeometry, WrenchModule

from .examples import EXAMPLES, GEOMETRY, stacked

BY_KIND = pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.kind)


def test_every_kind_has_an_example():
    assert {kind.kind for kind in KINDS} == set(EXAMPLES)


def values_of(kind) -> dict[str, np.ndarray]:
    return stacked(kind.kind, *EXAMPLES[kind.kind])


def loads_of(kind, size: float = 1.0) -> np.ndarray:
    """Loads (2, k) of the order of the examples' preloads, where nonlinear kinds are far from linear."""
    loads = np.array([[50.0, -80.0, 60.0, 4.0, -3.0, 2.0], [-150.0, 90.0, 250.0, -5.0, 2.0, 7.0]])
    return size * (loads if kind.loads == WrenchModule.loads else loads[:, 2:3])


def sizes(matrix: np.ndarray) -> np.ndarray:
    """The root of the diagonal entries i and j for every entry (i, j): its natural size, and its unit."""
    root = np.sqrt(np.diagonal(matrix, axis1=-2, axis2=-1))
    root = np.where(root > 0, root, 1.0)
    return root[..., :, None] * root[..., None, :]


@BY_KIND
def test_declares_everything_a_robot_file_needs(kind):
    assert kind.summary
    assert isinstance(kind, WrenchModule) != isinstance(kind, DriveModule)
    names = [quantity.name for quantity in kind.quantities]
    assert len(set(names)) == len(names)
    for quantity in kind.quantities:
        assert quantity.unit
        assert quantity.description
        assert set(quantity.derived_from) <= set(names)


@BY_KIND
@pytest.mark.parametrize("loaded", [False, True])
def test_compliance_is_symmetric_and_creates_no_energy(kind, loaded):
    matrix = kind.compliance(values_of(kind), GEOMETRY, loads_of(kind) if loaded else None)
    assert matrix.shape == (2, len(kind.loads), len(kind.loads))
    assert (np.diagonal(matrix, axis1=-2, axis2=-1) >= 0).all()
    plain = matrix / sizes(matrix)
    assert plain == pytest.approx(np.swapaxes(plain, -1, -2), abs=1e-14)
    assert np.linalg.eigvalsh(plain).min() > -1e-12


@BY_KIND
def test_compliance_is_the_slope_of_the_deformation(kind):
    values, load = values_of(kind), loads_of(kind)
    matrix = kind.compliance(values, GEOMETRY, load)
    for component in range(load.shape[-1]):
        step = np.zeros_like(load)
        step[:, component] = 1e-4 * np.abs(load[:, component])
        ahead, behind = (kind.deformation(values, GEOMETRY, load + sign * step) for sign in (1, -1))
        slope = (ahead - behind) / (2 * step[:, component, None])
        size = sizes(matrix)[..., component]
        assert slope / size == pytest.approx(matrix[..., component] / size, abs=1e-7)


@BY_KIND
def test_no_load_no_deformation(kind):
    assert not kind.deformation(values_of(kind), GEOMETRY, np.zeros((2, len(kind.loads)))).any()


@BY_KIND
def test_compliance_at_rest_is_that_of_a_vanishing_load(kind):
    values = values_of(kind)
    rest, tiny = (kind.compliance(values, GEOMETRY, load) for load in (None, loads_of(kind, 1e-9)))
    assert tiny / sizes(rest) == pytest.approx(rest / sizes(rest), abs=1e-7)


@BY_KIND
def test_energy_does_not_depend_on_the_path(kind):
    values, end = values_of(kind), loads_of(kind, 3.0)
    detour = end * np.linspace(-0.5, 1.5, end.shape[-1]) + 40.0

    def work(start, stop):
        pieces, (nodes, weights) = 60, np.polynomial.legendre.leggauss(6)
        places = ((nodes + 1) / 2 + np.arange(pieces)[:, None]).ravel() / pieces
        loads = start + places[:, None, None] * (stop - start)
        rates = (kind.deformation(values, GEOMETRY, loads) * (stop - start)).sum(-1)
        return np.tile(weights / 2 / pieces, pieces) @ rates

    straight = work(0 * end, end)
    assert work(0 * end, detour) + work(detour, end) == pytest.approx(straight, rel=1e-6)
    if not kind.nonlinear:
        assert straight == pytest.approx((end * kind.deformation(values, GEOMETRY, end)).sum(-1) / 2, rel=1e-12)


@BY_KIND
def test_poses_in_a_batch_are_poses_one_by_one(kind):
    values = values_of(kind)
    size, poses = len(kind.loads), 4
    generator = np.random.default_rng(3)
    grow = generator.uniform(0.8, 1.2, (poses, 2))
    batch = ModuleGeometry(GEOMETRY.length * grow, GEOMETRY.position * grow, *GEOMETRY[2:])
    loads = loads_of(kind) * generator.uniform(-1, 1, (poses, 2, size))
    gravity = generator.normal(size=(poses, 2, 3))
    compliance = np.broadcast_to(kind.compliance(values, batch, loads), (poses, 2, size, size))
    deformation = np.broadcast_to(kind.deformation(values, batch, loads), (poses, 2, size))
    own = np.broadcast_to(kind.weight_deformation(values, batch, gravity), (poses, 2, size))
    weight = kind.weight(values, batch)
    for index in range(poses):
        at = ModuleGeometry(batch.length[index], batch.position[index], *GEOMETRY[2:])
        assert compliance[index] == pytest.approx(kind.compliance(values, at, loads[index]), rel=1e-13, abs=0)
        assert deformation[index] == pytest.approx(kind.deformation(values, at, loads[index]), rel=1e-13, abs=0)
        assert own[index] == pytest.approx(kind.weight_deformation(values, at, gravity[index]), rel=1e-13, abs=0)
        if weight is not None:
            alone = kind.weight(values, at)
            assert weight.mass[index] == pytest.approx(alone.mass, rel=1e-13)
            assert weight.centre_from_tip[index] == pytest.approx(alone.centre_from_tip, rel=1e-13)


@BY_KIND
def test_modules_side_by_side_are_modules_one_by_one(kind):
    values, loads = values_of(kind), loads_of(kind)
    both = kind.compliance(values, GEOMETRY, loads)
    for index in range(2):
        alone = {name: value[index : index + 1] for name, value in values.items()}
        at = ModuleGeometry(*(value[index : index + 1] for value in GEOMETRY))
        assert both[index] == pytest.approx(kind.compliance(alone, at, loads[index : index + 1])[0], rel=1e-13, abs=0)


@BY_KIND
def test_constant_kinds_know_neither_pose_nor_load(kind):
    values = values_of(kind)
    reference = kind.compliance(values, GEOMETRY, None)
    elsewhere = ModuleGeometry(1.3 * GEOMETRY.length, 1.2 * GEOMETRY.position, *GEOMETRY[2:])
    moved = kind.compliance(values, elsewhere, loads_of(kind))
    assert kind.constant == np.allclose(moved, reference, rtol=1e-9, atol=0)


@BY_KIND
@pytest.mark.parametrize("factor", [1e12, np.inf])
def test_rigid_limit_is_zero_compliance(kind, factor):
    values = values_of(kind)
    soft = np.abs(kind.compliance(values, GEOMETRY, loads_of(kind)))
    rigid = dict(values)
    for name in values:
        if "stiffness" in name or name.endswith("modulus"):
            rigid[name] = np.array([value * factor if value > 0 else 0.0 for value in values[name].flat])
            rigid[name] = rigid[name].reshape(values[name].shape)
    if kind.kind == "compliance_matrix":
        rigid["scale"] = values["scale"] / factor
    hard = np.abs(kind.compliance(rigid, GEOMETRY, loads_of(kind)))
    assert soft.max() > 0
    assert (hard <= 1.000001 / factor * soft).all()


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


@BY_KIND
def test_only_kinds_with_a_weight_bend_under_it(kind):
    values = values_of(kind)
    gravity = np.array([[1.0, -2.0, 9.0], [3.0, 4.0, -8.0]])
    own = kind.weight_deformation(values, GEOMETRY, gravity)
    weight = kind.weight(values, GEOMETRY)
    assert own.shape == (2, len(kind.loads))
    assert own.any() == (weight is not None)
    if weight is not None:
        assert weight.mass[0] > 0
        bare = {**values, **{name: 0 * values[name] for name in ("density", "line_density") if name in values}}
        assert not kind.weight_deformation(bare, GEOMETRY, gravity).any()
        assert not kind.weight(bare, GEOMETRY).mass.any()
