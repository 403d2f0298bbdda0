"""Inertial parameters that a motion tells only together: base parameters, by name.

The columns of the inertial regressor depend on each other: y_d = y_b K. A motion tells the combinations x_b + K x_d and
nothing else of the parameters x (Gautier 1991; Khalil and Dombre 2002, ch. 9).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...numbers import number
from ...spatial import Array
from ..criteria import EFFORT_TOLD

__all__ = ["Combinations"]

#: Share of a combination's efforts below which a parameter is not named in it.
_NAMED = 1e-3
#: Parameters named in a combination; more are counted.
_MOST_NAMED = 6


@dataclass(frozen=True, eq=False)
class Combinations:
    """Combinations (b) of parameters (p): `matrix` (b, p) @ parameters; `names` (b,); `alone`: each is one parameter.

    `silent`: parameters of which the motion tells nothing, in no combination.
    """

    matrix: Array
    names: tuple[str, ...]
    leads: tuple[int, ...]
    silent: tuple[str, ...]

    @classmethod
    def of(cls, regressor: Array, names: Sequence[str]) -> Combinations:
        """Return what a regressor (n, p) tells of its parameters `names`; those of the last links lead."""
        gram = regressor.T @ regressor
        size = np.sqrt(np.diag(gram))
        there = size > np.sqrt(EFFORT_TOLD) * size.max(initial=0.0)
        unit = np.where(there, 1 / np.where(there, size, 1.0), 0.0)
        gram = gram * unit[:, None] * unit
        # Cholesky's elimination in a fixed order: from the last link to the first, what is beside those before it
        leads: list[int] = []
        rest = gram.copy()
        for index in range(len(names) - 1, -1, -1):
            if there[index] and rest[index, index] > EFFORT_TOLD:
                leads.append(index)
                rest = rest - np.outer(rest[:, index], rest[index]) / rest[index, index]
        leads.sort()
        own = gram[np.ix_(leads, leads)]
        share = np.linalg.lstsq(own, gram[leads], rcond=None)[0] if leads else np.zeros((0, len(names)))
        share[:, leads] = np.eye(len(leads))
        share[np.abs(share) < _NAMED] = 0.0
        matrix = share * size[None, :] / size[leads][:, None]
        called = [
            _called(row, lead, share_row, names) for row, lead, share_row in zip(matrix, leads, share, strict=True)
        ]
        silent = tuple(name for index, name in enumerate(names) if not share[:, index].any())
        return cls(matrix, tuple(called), tuple(leads), silent)


def _called(row: Array, lead: int, share: Array, names: Sequence[str]) -> str:
    """Return a combination in words: its leading parameter and the others, those that do most first."""
    others = [index for index in np.argsort(-np.abs(share), kind="stable") if index != lead and row[index]]
    words = [names[lead]]
    for index in others[:_MOST_NAMED]:
        words.append(f"{'-' if row[index] < 0 else '+'} {_factor(abs(row[index]))}{names[index]}")
    if len(others) > _MOST_NAMED:
        words.append(f"and {len(others) - _MOST_NAMED} more")
    return " ".join(words)


def _factor(value: float) -> str:
    return "" if abs(value - 1) < _NAMED else f"{number(value, 3)} "
