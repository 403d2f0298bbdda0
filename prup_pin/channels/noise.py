"""How much the sensors scatter."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..spatial import Array


@dataclass(frozen=True)
class Noise:
    """Standard deviations: position [m], rotation [rad], force [N], moment [N m], effort [N or N m]; their source.

    'declared', 'estimated' by repeats or by what is white, or 'residual': what is left beside all that may be off.
    Of several recordings with noise of their own, `each` by their places, and which (N,) of them each sample is from;
    the four are then those of all samples together.
    """

    position: float
    rotation: float
    force: float
    moment: float
    source: str
    each: tuple[Noise, ...] = ()
    which: np.ndarray | None = field(default=None, compare=False, repr=False)
    effort: float = 0.0

    @classmethod
    def of_several(cls, each: Sequence[Noise], which: np.ndarray) -> Noise:
        """Return the noise of recordings together; that of one where all are alike."""
        if all(noise == each[0] for noise in each):
            return each[0]
        shares = np.bincount(which, minlength=len(each)) / len(which)
        values = np.array([[noise.position, noise.rotation, noise.force, noise.moment] for noise in each])
        sources = {noise.source for noise in each}
        source = sources.pop() if len(sources) == 1 else "estimated"
        position, rotation, force, moment = np.sqrt(shares @ values**2).tolist()
        return cls(position, rotation, force, moment, source, tuple(each), which)

    def parts(self, samples: np.ndarray | None) -> Iterator[tuple[Noise, np.ndarray | slice]]:
        """Yield one noise after the other, and where it holds among some samples (n,)."""
        if self.which is None or samples is None:
            yield self, slice(None)
            return
        for place, noise in enumerate(self.each):
            yield noise, self.which[samples] == place

    def of_unit(self, unit: str) -> float:
        """Return that of a pose sensor's columns in 'm' or in 'rad'."""
        return self.position if unit == "m" else self.rotation

    @property
    def wrench(self) -> Array:
        """Of the wrench sensor's components, (6,) [N, N m]."""
        return np.array(3 * [self.force] + 3 * [self.moment])
