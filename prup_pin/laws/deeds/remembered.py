"""A module that deforms by what it bore before."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ...loaded import Chain, Conditions, Equilibria, elastic_deformation, module_loads
from ...spatial import Array
from .deed import RUN, Deed, Felt, History, Solved
from .strain import Strain, Strains

if TYPE_CHECKING:
    from ..setup import Setup

#: A history that moves by less than 1e-7 of this stands still [m, rad].
_UNIT = 1e-3

#: From a module's elastic deformation (n, k), time (n,) [s], labels of runs (n,) and what was remembered before (None
#: at rest) to its deformation beyond the elastic one (n, k) and what is remembered after the last sample. Of a deed
#: `by_load`: from its loads (n, k) to what is remembered before each sample (n, k), and after the last.
Follow = Callable[[Array, Array, np.ndarray, Any], tuple[Array, Any]]


@dataclass(frozen=True)
class RememberedStrain(Deed):
    """A module deforms beyond its own law by what `follow` makes of its history; every run starts at rest.

    `follow(elastic, time, runs, before)` is a function of a module of its own, or a frozen dataclass that is called.
    by_load: it follows the module's loads, and what is remembered is how the next load deforms the module: by
    `follow.strain(load, remembered)`, which returns the deformation (n, k) and its derivative (n, k, k).
    """

    memory = RUN

    module: str
    follow: Follow
    by_load: bool = False

    @property
    def only_module(self) -> str | None:
        return self.module

    @property
    def is_proportional(self) -> bool:
        return self.by_load

    def felt(self, at: Solved) -> Felt:
        if not self.by_load or self.module not in at.first.rows:
            return Felt()
        return Felt(float(np.linalg.norm(at.first.loads(self.module), axis=1).max(initial=0.0)))

    def followed_in(self, found: Equilibria) -> Array:
        """Return what it follows at equilibria, (n, k)."""
        return (module_loads if self.by_load else elastic_deformation)(found, self.module)

    def strain_by(self, held: Array) -> Strain:
        """Return what the module deforms beyond its own law with what is held (n, k)."""
        return Strain(self.follow.strain if self.by_load else _given, (held,))  # type: ignore[attr-defined]

    def enter(self, setup: Setup) -> None:
        setup.remembered = (*setup.remembered, self)

    @classmethod
    def history(cls, setup: Setup, samples: np.ndarray, chain: Chain, before: Any) -> _Remembering | None:
        return _Remembering(setup, samples, before) if setup.remembered else None

    @classmethod
    def changes(cls, setup: Setup, at: Solved) -> Iterator[Array]:
        if setup.remembered == at.setup.remembered:
            return
        for sign, deeds in ((1.0, setup.remembered), (-1.0, at.setup.remembered)):
            for deed in deeds:
                key = "followed", deed.module, deed.by_load
                felt = at.first.once(key, partial(deed.followed_in, at.first.found))
                held, _ = deed.follow(felt, at.moment.time, at.moment.runs, None)
                strain, _ = deed.strain_by(held)(felt)
                yield sign * (at.first.by_strain(deed.module) @ strain[..., None])[..., 0]


class _Remembering(History):
    """What each deed's module holds of its history, (n, k), in their order."""

    def __init__(self, setup: Setup, samples: np.ndarray, before: tuple | None):
        self.deeds = setup.remembered
        self.moment = setup.moment(samples)
        self.strains: list[Array] = []
        self._before = (None,) * len(self.deeds) if before is None else before
        self._after = self._before

    def begin(self, found: Equilibria) -> None:
        """Begin with nothing: what is remembered follows the loads in one round or two."""

    def act(self, now: Conditions) -> Conditions:
        strains = dict(now.strains)
        for deed, strain in zip(self.deeds, self.strains, strict=False):
            strains[deed.module] = Strains((*strains.get(deed.module, ()), deed.strain_by(strain)))
        return replace(now, strains=strains)

    def follow(self, found: Equilibria) -> float:
        change, new, after = 0.0, [], []
        for index, deed in enumerate(self.deeds):
            felt = deed.followed_in(found)
            strain, kept = deed.follow(felt, self.moment.time, self.moment.runs, self._before[index])
            moved = strain - self.strains[index] if self.strains else strain
            change = max(change, float(np.abs(moved).max(initial=0.0)) / _UNIT)
            new.append(strain)
            after.append(kept)
        self.strains, self._after = new, tuple(after)
        return change

    @property
    def after(self) -> tuple:
        return self._after


def _given(load: Array, history: Array) -> tuple[Array, Array]:
    return history, np.zeros((*load.shape, load.shape[-1]))
