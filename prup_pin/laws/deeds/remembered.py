"""A module that deforms by what it bore before."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ...loaded import Chain, Conditions, Equilibria, elastic_deformation
from ...spatial import Array
from .deed import RUN, Deed, History, Solved
from .strain import Strain, Strains

if TYPE_CHECKING:
    from ..setup import Setup

#: A history that moves by less than 1e-7 of this stands still [m, rad].
_UNIT = 1e-3

#: From a module's elastic deformation (n, k), time (n,) [s], labels of runs (n,) and what was remembered before (None
#: at rest) to its deformation beyond the elastic one (n, k) and what is remembered after the last sample.
Follow = Callable[[Array, Array, np.ndarray, Any], tuple[Array, Any]]


@dataclass(frozen=True)
class RememberedStrain(Deed):
    """A module deforms beyond its own law by what `follow` makes of its history; every run starts at rest.

    `follow(elastic, time, runs, before)` is a function of a module of its own, or a frozen dataclass that is called.
    """

    memory = RUN

    module: str
    follow: Follow

    @property
    def only_module(self) -> str | None:
        return self.module

    def enter(self, setup: Setup) -> None:
        setup.remembered.append(self)

    @classmethod
    def history(cls, setup: Setup, samples: np.ndarray, chain: Chain, before: Any) -> _Remembering | None:
        return _Remembering(setup, samples, before) if setup.remembered else None

    @classmethod
    def changes(cls, setup: Setup, at: Solved) -> Iterator[Array]:
        if setup.remembered == at.setup.remembered:
            return
        for sign, deeds in ((1.0, setup.remembered), (-1.0, at.setup.remembered)):
            for deed in deeds:
                elastic = at.first.once(
                    ("elastic", deed.module), partial(elastic_deformation, at.first.found, deed.module)
                )
                strain, _ = deed.follow(elastic, at.moment.time, at.moment.runs, None)
                yield sign * (at.first.by_strain(deed.module) @ strain[..., None])[..., 0]


class _Remembering(History):
    """What each deed's module deforms beyond its own law, (n, k), in their order."""

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
            strains[deed.module] = Strains((*strains.get(deed.module, ()), Strain(_given, (strain,))))
        return replace(now, strains=strains)

    def follow(self, found: Equilibria) -> float:
        change, new, after = 0.0, [], []
        for index, deed in enumerate(self.deeds):
            elastic = elastic_deformation(found, deed.module)
            strain, kept = deed.follow(elastic, self.moment.time, self.moment.runs, self._before[index])
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
