"""How well the values of a corrected model are known together: what a later recording is compared with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..laws import Effect
from ..recordings.problems import is_number, json_kind, shown
from ..spatial import Array


class PosteriorValue(NamedTuple):
    """A value of an effect, by its place among the effects and its name.

    logarithmic: its standard deviation is of its logarithm, and so a share of it.
    """

    effect: int
    name: str
    value: float
    logarithmic: bool

    def __str__(self) -> str:
        return f"effects[{self.effect}].parameters.{self.name}"


@dataclass(frozen=True)
class Posterior:
    """Values of a model's effects with the covariance of all of them together, about the values of the model.

    rows: lower triangular root of the covariance, row i of i + 1 numbers, in the values' units or of their logarithms.
    explained: whether what their diagnosis left was noise; what else it left, they may have been bent to imitate.
    """

    values: tuple[PosteriorValue, ...] = ()
    rows: tuple[tuple[float, ...], ...] = ()
    explained: bool = True

    @classmethod
    def of(cls, values: Sequence[PosteriorValue], covariant: Array, explained: bool = True) -> Posterior:
        """Return that of values which change by `covariant` (p, q) per number of unit variance."""
        rows = tuple(tuple(row[: place + 1].tolist()) for place, row in enumerate(lower_root(covariant)))
        return cls(tuple(values), rows, explained)

    @property
    def root(self) -> Array:
        """Lower triangular root of the covariance, (p, p)."""
        out = np.zeros((len(self.values), len(self.values)))
        for place, row in enumerate(self.rows):
            out[place, : len(row)] = row
        return out

    def document(self) -> dict[str, Any]:
        """Return what a file holds of it."""
        values = [
            {"effect": item.effect, "parameter": item.name, "value": float(item.value)}
            | ({"logarithm": True} if item.logarithmic else {})
            for item in self.values
        ]
        # more digits than any covariance is known to
        rows = [" ".join(f"{size:.9g}" for size in row) for row in self.rows]
        return {"explained": self.explained, "parameters": values, "root": rows}


def instead(entry: Mapping[str, Any], key: str) -> str:
    """Return 'is …' of what stands under a key, or 'is missing', as the beginning of what is wrong with it."""
    return f"is {json_kind(entry[key])}" if key in entry else "is missing"


def lower_root(covariant: Array) -> Array:
    """Return the lower triangular L (p, p) with L L^T = A A^T, its diagonal not negative, of A (p, q)."""
    p, q = covariant.shape
    if not p:
        return np.zeros((0, 0))
    wide = np.concatenate((covariant, np.zeros((p, max(p - q, 0)))), axis=1)
    root = np.asarray(np.linalg.qr(wide.T, mode="r")).T
    return root * np.where(np.diagonal(root) < 0, -1.0, 1.0)


def read_posterior(given: object, effects: Sequence[Effect], reader: Any) -> Posterior | None:
    """Return the posterior of a file's effects; what is wrong with it is reported to `reader`, and None returned."""
    before = len(reader.problems)
    entry = reader.entries(given, "posterior", ("explained", "parameters", "root"))
    explained = entry.get("explained", True)
    if not isinstance(explained, bool):
        reader.wrong("posterior.explained", f"is {json_kind(explained)}; expected true or false")
    for key, what in (("parameters", "values"), ("root", "texts of numbers")):
        if isinstance(given, dict) and not isinstance(entry.get(key), list):
            reader.wrong(f"posterior.{key}", f"{instead(entry, key)}; expected a list of {what}")
    if len(reader.problems) > before:
        return None
    values = [_value(item, place, effects, reader) for place, item in enumerate(entry["parameters"])]
    rows = [_row(text, place, reader) for place, text in enumerate(entry["root"])]
    if len(rows) != len(values):
        reader.wrong("posterior.root", f"has {len(rows)} rows; expected one for each of {len(values)} parameters")
    names = [str(item) for item in values if item is not None]
    for name in dict.fromkeys(name for name in names if names.count(name) > 1):
        reader.wrong("posterior.parameters", f"{name} is there twice; expected each value once")
    if len(reader.problems) > before:
        return None
    return Posterior(tuple(item for item in values if item), tuple(row for row in rows if row), explained)


def _value(item: object, place: int, effects: Sequence[Effect], reader: Any) -> PosteriorValue | None:
    key = f"posterior.parameters[{place}]"
    entry = reader.entries(item, key, ("effect", "parameter", "value", "logarithm"))
    if not isinstance(item, dict):
        return None
    index, name, value = entry.get("effect"), entry.get("parameter"), entry.get("value")
    if isinstance(index, bool) or not isinstance(index, int) or not 0 <= index < len(effects):
        reader.wrong(
            f"{key}.effect", f"is {json_kind(index)}; expected the place of an effect, 0 to {len(effects) - 1}"
        )
        return None
    if not isinstance(name, str) or name not in effects[index].values:
        said = shown(name) if isinstance(name, str) else json_kind(name)
        reader.wrong(f"{key}.parameter", f"is {said}; expected a parameter of effects[{index}]")
        return None
    if not is_number(value):
        reader.wrong(f"{key}.value", f"is {json_kind(value)}; expected the number that effects[{index}] has there")
        return None
    logarithmic = entry.get("logarithm", False)
    if not isinstance(logarithmic, bool) or (logarithmic and not value > 0):
        reader.wrong(
            f"{key}.logarithm", f"is {json_kind(logarithmic)}; expected true, of a value above 0, or no such key"
        )
        return None
    return PosteriorValue(index, name, float(value), logarithmic)


def _row(text: object, place: int, reader: Any) -> tuple[float, ...]:
    key, expected = f"posterior.root[{place}]", f"a text of {place + 1} numbers, the last one above 0"
    if not isinstance(text, str):
        reader.wrong(key, f"is {json_kind(text)}; expected {expected}")
        return ()
    try:
        row = tuple(float(word) for word in text.split())
    except ValueError:
        row = ()
    if len(row) != place + 1 or not all(map(np.isfinite, row)) or not row[-1] > 0:
        reader.wrong(key, f"is no row of a root; expected {expected}")
        return ()
    return row
