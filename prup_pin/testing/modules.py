"""What every kind of module must hold, as checks that raise AssertionError of one that does not.

Each takes a kind and the values of two modules of it, stacked to arrays (2,): see `stacked`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..mechanism.description import ModuleDescription, resolve_values
from ..modules import CompliantModule, ModuleGeometry, WrenchModule
from ..modules.module import Values, defects
from ..parameters import Parameter
from ..spatial import Array
from .contract import contract, near, require

#: Two modules in their places: lengths, joint positions, and all that decides where their own weight goes.
GEOMETRY = ModuleGeometry(
    np.array([0.3, 0.45]), np.array([0.2, 0.35]), np.array([True, False]), np.array([True, False])
)


def resolved(kind: CompliantModule, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return all values of one module, derived defaults included, as a robot file would get them.

    Raises ModuleValuesError.
    """
    quantities = {quantity.name: quantity for quantity in kind.quantities}
    values = {
        name: Parameter(f"m.{name}", value, quantities[name].unit if name in quantities else "")
        for name, value in given.items()
    }
    return resolve_values(ModuleDescription("m", kind.kind, "joint", values=values), kind)


def stacked(kind: CompliantModule, *modules: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Return the values of several modules as the arrays (n,) that the equations take."""
    each = [resolved(kind, given) for given in modules]
    return {name: np.array([values[name] for values in each]) for name in each[0]}


def loads_of(kind: CompliantModule, size: float = 1.0) -> Array:
    """Return loads (2, k) of usual sizes, where nonlinear kinds are far from linear."""
    loads = np.array([[50.0, -80.0, 60.0, 4.0, -3.0, 2.0], [-150.0, 90.0, 250.0, -5.0, 2.0, 7.0]])
    return size * (loads if kind.loads == WrenchModule.loads else loads[:, 2:3])


def sizes(matrix: Array) -> Array:
    """Return the root of the diagonal entries i and j for every entry (i, j): its natural size, and its unit."""
    root = np.sqrt(np.diagonal(matrix, axis1=-2, axis2=-1))
    root = np.where(root > 0, root, 1.0)
    return root[..., :, None] * root[..., None, :]


@contract("kind")
def check_declared(kind: CompliantModule) -> None:
    """It declares its word, a summary, and quantities with units."""
    require(not (wrong := "; ".join(defects(kind))), wrong)


@contract("kind")
def check_symmetric(kind: CompliantModule, values: Values) -> None:
    """Its compliance is symmetric and creates no energy."""
    for load in (None, loads_of(kind)):
        matrix = kind.compliance(values, GEOMETRY, load)
        expected = (2, len(kind.loads), len(kind.loads))
        require(matrix.shape == expected, f"Its shape is {matrix.shape}; expected {expected}.")
        require((np.diagonal(matrix, axis1=-2, axis2=-1) >= 0).all(), "A diagonal entry is negative.")
        plain = matrix / sizes(matrix)
        near(plain, np.swapaxes(plain, -1, -2), atol=1e-14)
        least = np.linalg.eigvalsh(plain).min()
        require(least > -1e-12, f"Its least eigenvalue, in natural sizes, is {least:.3g}.")


@contract("kind")
def check_slope(kind: CompliantModule, values: Values) -> None:
    """Its compliance is the slope of its deformation."""
    load = loads_of(kind)
    matrix = kind.compliance(values, GEOMETRY, load)
    for component in range(load.shape[-1]):
        step = np.zeros_like(load)
        step[:, component] = 1e-4 * np.abs(load[:, component])
        ahead, behind = (kind.deformation(values, GEOMETRY, load + sign * step) for sign in (1, -1))
        slope = (ahead - behind) / (2 * step[:, component, None])
        size = sizes(matrix)[..., component]
        near(slope / size, matrix[..., component] / size, atol=1e-7)


@contract("kind")
def check_unloaded(kind: CompliantModule, values: Values) -> None:
    """Without a load it does not deform."""
    require(not kind.deformation(values, GEOMETRY, np.zeros((2, len(kind.loads)))).any(), "It does.")


@contract("kind")
def check_at_rest(kind: CompliantModule, values: Values) -> None:
    """Its compliance at rest is that of a vanishing load."""
    rest, tiny = (kind.compliance(values, GEOMETRY, load) for load in (None, loads_of(kind, 1e-9)))
    near(tiny / sizes(rest), rest / sizes(rest), atol=1e-7)


@contract("kind")
def check_energy(kind: CompliantModule, values: Values) -> None:
    """Its energy does not depend on the path of the load."""
    end = loads_of(kind, 3.0)
    detour = end * np.linspace(-0.5, 1.5, end.shape[-1]) + 40.0

    def work(start, stop):
        pieces, (nodes, weights) = 60, np.polynomial.legendre.leggauss(6)
        places = ((nodes + 1) / 2 + np.arange(pieces)[:, None]).ravel() / pieces
        loads = start + places[:, None, None] * (stop - start)
        rates = (kind.deformation(values, GEOMETRY, loads) * (stop - start)).sum(-1)
        return np.tile(weights / 2 / pieces, pieces) @ rates

    straight = work(0 * end, end)
    near(work(0 * end, detour) + work(detour, end), straight, rtol=1e-6, atol=1e-12)
    if not kind.nonlinear:
        near(straight, (end * kind.deformation(values, GEOMETRY, end)).sum(-1) / 2, rtol=1e-12, atol=1e-12)


@contract("kind")
def check_poses(kind: CompliantModule, values: Values) -> None:
    """Poses in a batch are poses one by one."""
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
        near(compliance[index], kind.compliance(values, at, loads[index]), rtol=1e-13)
        near(deformation[index], kind.deformation(values, at, loads[index]), rtol=1e-13)
        near(own[index], kind.weight_deformation(values, at, gravity[index]), rtol=1e-13)
        if weight is not None:
            alone = kind.weight(values, at)
            if alone is None:
                raise AssertionError("It weighs in a batch alone.")
            near(weight.mass[index], alone.mass, rtol=1e-13)
            near(weight.centre_from_tip[index], alone.centre_from_tip, rtol=1e-13)


@contract("kind")
def check_side_by_side(kind: CompliantModule, values: Values) -> None:
    """Modules side by side are modules one by one."""
    loads = loads_of(kind)
    both = kind.compliance(values, GEOMETRY, loads)
    for index in range(2):
        alone = {name: value[index : index + 1] for name, value in values.items()}
        at = ModuleGeometry(*(value[index : index + 1] for value in GEOMETRY))
        near(both[index], kind.compliance(alone, at, loads[index : index + 1])[0], rtol=1e-13)


@contract("kind")
def check_constant(kind: CompliantModule, values: Values) -> None:
    """It is constant where it says so, with neither spans_frames, follows_joint nor nonlinear, and not elsewhere."""
    reference = kind.compliance(values, GEOMETRY, None)
    elsewhere = ModuleGeometry(1.3 * GEOMETRY.length, 1.2 * GEOMETRY.position, *GEOMETRY[2:])
    moved = kind.compliance(values, elsewhere, loads_of(kind))
    same = np.allclose(moved, reference, rtol=1e-9, atol=0)
    require(kind.constant == same, f"It says that it is {'' if kind.constant else 'not '}constant.")


@contract("kind")
def check_rigid(kind: CompliantModule, values: Values) -> None:
    """Where all its stiffnesses and moduli grow without end it yields nothing."""
    soft = np.abs(kind.compliance(values, GEOMETRY, loads_of(kind)))
    require(soft.max() > 0, "It yields nothing at all.")
    for factor in (1e12, np.inf):
        rigid = dict(values)
        for name in values:
            if "stiffness" in name or name.endswith("modulus"):
                grown = np.array([value * factor if value > 0 else 0.0 for value in values[name].flat])
                rigid[name] = grown.reshape(values[name].shape)
            elif name == "scale":  # of a compliance
                rigid[name] = values[name] / factor
        hard = np.abs(kind.compliance(rigid, GEOMETRY, loads_of(kind)))
        require((hard <= 1.000001 / factor * soft).all(), f"{factor:g} times as stiff it yields {hard.max():.3g}.")


@contract("kind")
def check_weight(kind: CompliantModule, values: Values) -> None:
    """It bends under its own weight where it has one, in proportion to its density, and not elsewhere."""
    gravity = np.array([[1.0, -2.0, 9.0], [3.0, 4.0, -8.0]])
    own = kind.weight_deformation(values, GEOMETRY, gravity)
    weight = kind.weight(values, GEOMETRY)
    expected = (2, len(kind.loads))
    require(own.shape == expected, f"Its shape is {own.shape}; expected {expected}.")
    require(own.any() == (weight is not None), f"It {'bends' if own.any() else 'does not bend'}.")
    if weight is not None:
        require(weight.mass[0] > 0, f"Its mass is {weight.mass[0]:g} kg.")
        bare = {**values, **{name: 0 * values[name] for name in ("density", "line_density") if name in values}}
        require(not kind.weight_deformation(bare, GEOMETRY, gravity).any(), "Without density it bends.")
        massless = kind.weight(bare, GEOMETRY)
        require(massless is not None and not massless.mass.any(), "Without density it has a mass.")


#: All of a kind and its values.
CHECKS = (
    check_symmetric,
    check_slope,
    check_unloaded,
    check_at_rest,
    check_energy,
    check_poses,
    check_side_by_side,
    check_constant,
    check_rigid,
    check_weight,
)
