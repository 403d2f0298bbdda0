"""A module that deforms beyond its own law."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...spatial import Array
from .deed import Deed, Felt, Solved

if TYPE_CHECKING:
    from ..setup import Setup


class Strain(NamedTuple):
    """A module's deformation beyond its own law: `function(load, *samples)` of its load (N, k).

    `samples` are arrays (N, …), one value a sample (a temperature, a history). Returns deformation (N, k) and its
    derivative (N, k, k).
    """

    function: Callable[..., tuple[Array, Array]]
    samples: tuple[Array, ...] = ()

    def __call__(self, load: Array) -> tuple[Array, Array]:
        return self.function(load, *self.samples)

    def take(self, rows: Any) -> Strain:
        return Strain(self.function, tuple(array[rows] for array in self.samples))


class Strains(tuple):
    """Several strains of one module, added up."""

    def __call__(self, load: Array) -> tuple[Array, Array]:
        total, slope = np.zeros_like(load), np.zeros((*load.shape, load.shape[-1]))
        for item in self:
            more, more_slope = item(load)
            total, slope = total + more, slope + more_slope
        return total, slope

    def take(self, rows: Any) -> Strains:
        return Strains(item.take(rows) for item in self)


@dataclass(frozen=True, eq=False)
class ExtraStrain(Deed):
    """A module deforms by `strain` beyond its own law."""

    displaces_joints = True

    module: str
    strain: Strain

    @property
    def only_module(self) -> str | None:
        return self.module

    def felt(self, at: Solved) -> Felt:
        """Return the largest load along which it strains the module."""
        if not isinstance(self.strain.function, Along) or self.module not in at.first.rows:
            return Felt()
        load = at.first.loads(self.module)[:, self.strain.function.direction].reshape(len(at.samples), -1)
        return Felt(float(np.linalg.norm(load, axis=1).max(initial=0.0)))

    def enter(self, setup: Setup) -> None:
        setup.strains = {**setup.strains, self.module: (*setup.strains.get(self.module, ()), self.strain)}

    @classmethod
    def changes(cls, setup: Setup, at: Solved) -> Iterator[Array]:
        for name in {} if setup.strains is at.setup.strains else {**setup.strains, **at.setup.strains}:
            if name not in at.first.rows:
                continue
            load = at.first.loads(name)
            extra = extent_of(setup, name, load, at.samples)
            extra = extra - at.first.once(("strain", name), partial(extent_of, at.setup, name, load, at.samples))
            if (
                not at.first.frames
            ):  # joints: where a block begins unloaded they have moved by what is there without load
                rest = np.zeros_like(load)
                bare = extent_of(setup, name, rest, at.samples) - extent_of(at.setup, name, rest, at.samples)
                extra = extra - bare[at.moment.begins]
            if np.any(extra):
                yield (at.first.by_strain(name) @ extra[..., None])[..., 0]


def extent_of(setup: Setup, module: str, load: Array, samples: np.ndarray) -> Array:
    """Return what a module deforms beyond its own law under a load (n, k)."""
    items = setup.strains.get(module, ())
    return sum((item.take(samples)(load)[0] for item in items), np.zeros_like(load))


@dataclass(frozen=True)
class Along:
    """A strain along the resultant of some load components.

    `law(force, *samples)` gives extent and slope of force >= 0 (N,), with extent 0 at force 0. The deformation points
    along the resultant; across it the secant acts.
    """

    direction: slice
    law: Callable[..., tuple[Array, Array]]

    def __call__(self, load: Array, *samples: Array) -> tuple[Array, Array]:
        part = load[:, self.direction].reshape(len(load), -1)
        force = np.linalg.norm(part, axis=1)
        moving = force > 1e-9  # N or N m
        extent, slope = self.law(force, *samples)
        _, at_rest = self.law(np.zeros_like(force), *samples)
        secant = np.where(moving, extent / np.where(moving, force, 1.0), at_rest)
        unit = part / np.where(moving, force, 1.0)[:, None]
        strain, derivative = np.zeros_like(load), np.zeros((*load.shape, load.shape[1]))
        strain[:, self.direction] = (secant[:, None] * part).reshape(load[:, self.direction].shape)
        block = secant[:, None, None] * np.eye(part.shape[1])
        block += np.where(moving, slope - secant, 0.0)[:, None, None] * unit[:, :, None] * unit[:, None, :]
        derivative[:, self.direction, self.direction] = block
        return strain, derivative
