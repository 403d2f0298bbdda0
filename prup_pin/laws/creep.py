"""Parts that go on yielding."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np

from ..mechanism import Mechanism
from ..modules import WrenchModule
from ..numbers import number
from ..parameters import Quantity
from ..spatial import Array
from .deeds import Deed, Felt, RememberedStrain
from .law import ASPECTS, Law, Place
from .modules_at import yielding
from .setup import Setup


class CreepLaw(Law):
    """A module deforms further under a lasting load, towards (1 + share) times its elastic deformation.

    Each load is taken to act since the sample before its own.
    """

    physics = "creep"
    summary = "a part that goes on yielding"
    called = "relaxation, viscoelastic"
    remedy = (
        "find what goes on yielding at {place} (a polymer, a joint that works loose), or wait as long at every load"
    )
    cost = 6.0
    source = "Kelvin-Voigt element; Findley, Creep and Relaxation, ch. 5"
    quantities = (
        Quantity("share", "1", "final creep over elastic deformation", 0.5, upper=100.0),
        Quantity("time_constant", "s", "after which 63 % of it are there", 10.0, lower=0.01, upper=1e6),
    )
    neutral: ClassVar = {"share": 0.0}

    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        parts = yielding(mechanism, ("", *ASPECTS))
        names = {place.name for place in parts}
        whole = [module for module in mechanism.modules if isinstance(module.kind, WrenchModule)]
        bodies = [Place(module.name) for module in whole if module.name not in names and module.kind.is_body]
        return [*bodies, *parts]

    def seen_at(self, place: Place, mechanism: Mechanism, felt: Felt, interval: float) -> tuple[Quantity, ...]:
        # what is over within a sample is no history but another stiffness
        share, constant = self.quantities
        return share, replace(constant, lower=max(constant.lower, interval))

    def starts(self, place: Place, mechanism: Mechanism) -> Sequence[Mapping[str, float]]:
        return [{"share": 0.3, "time_constant": constant} for constant in (4.0, 30.0)]

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        components = ASPECTS[place.aspect] if place.aspect else slice(None)
        yield RememberedStrain(place.name, KelvinVoigt(values["share"], values["time_constant"], components))

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        share, constant = 100 * values["share"], values["time_constant"]
        return (
            f"{place} goes on yielding under load: {number(share, 3)} % more, with a time constant of "
            f"{number(constant, 3)} s"
        )


class Crept(NamedTuple):
    """What a module remembers after a sample: the time, its elastic deformation and what it has crept, (k,)."""

    time: float
    elastic: Array
    extent: Array


@dataclass(frozen=True)
class KelvinVoigt:
    """tau de/dt + e = share x elastic deformation, of some components of it, at rest at the start of each run."""

    share: float
    time_constant: float
    components: slice

    def __call__(
        self, elastic: Array, time: Array, runs: np.ndarray, before: Crept | None
    ) -> tuple[Array, Crept | None]:
        """Return what a module has crept (n, k), each elastic deformation held since the sample before its own."""
        if not len(time):
            return np.zeros_like(elastic), before
        if before is None:
            crept = self._crept(elastic, time, runs, 0.0)
        else:
            longer = np.vstack((before.elastic[None], elastic))
            crept = self._crept(longer, np.append(before.time, time), np.append(runs[:1], runs), before.extent)[1:]
        return crept, Crept(float(time[-1]), elastic[-1], crept[-1])

    def _crept(self, elastic: Array, time: Array, runs: np.ndarray, first: Array | float) -> Array:
        out = np.zeros_like(elastic)
        out[:1] = first
        target = np.zeros_like(elastic)
        target[:, self.components] = self.share * elastic[:, self.components]
        decays = np.exp(-np.maximum(np.diff(time), 0.0) / self.time_constant)  # a new run may start earlier
        even = len(decays) > 0 and float(np.ptp(decays)) < 1e-9 * (1 - float(decays[0])) and not np.any(runs != runs[0])
        if even:
            from scipy.signal import lfilter  # its import takes longer than that of all the rest

            decay = float(decays.mean())
            out[1:] = lfilter([1 - decay], [1, -decay], target[1:], axis=0, zi=decay * out[:1])[0]
            return out
        for sample in range(1, len(time)):
            if runs[sample] != runs[sample - 1]:
                continue
            decay = decays[sample - 1]
            out[sample] = decay * out[sample - 1] + (1 - decay) * target[sample]
        return out
