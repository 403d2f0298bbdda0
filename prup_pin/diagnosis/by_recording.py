"""What a diagnosis says of each of several recordings: which samples are whose, and how well they are explained."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..channels import Noise
from ..recordings import Together
from ..spatial import Array

__all__ = ["ByRecording", "by_recording"]


@dataclass(frozen=True, eq=False)
class ByRecording:
    """One recording's part in a diagnosis.

    `name` for people; `own` sensors that it does not share; `samples` it holds, of which the rows `rows` (m,), from 0,
    were used: these are the samples `used` (m,) among all of the diagnosis. before, after: their residual in multiples
    of the noise; NaN where nothing was compared.
    """

    name: str
    own: tuple[str, ...]
    noise: Noise
    samples: int
    rows: np.ndarray
    used: np.ndarray
    before: float
    after: float


def by_recording(
    together: Together, noise: Noise, samples: np.ndarray, residuals: tuple[Array, Array, np.ndarray] | None
) -> tuple[ByRecording, ...]:
    """Return each recording's part.

    samples (n,): those that were simulated. residuals: before and after (n, K), whitened, and which of them exist.
    """
    found = []
    for place, source in enumerate(together.sources):
        used = np.flatnonzero(together.which[samples] == place)
        before = after = float("nan")
        if residuals is not None and (count := int(residuals[2][used].sum())):
            before, after = (float(np.sqrt((values[used] ** 2).sum() / count)) for values in residuals[:2])
        own = noise.each[place] if noise.each else noise
        rows = together.rows[samples[used]]
        found.append(ByRecording(source.name, source.own, own, len(source.recording), rows, used, before, after))
    return tuple(found)
