"""A law that is another one, at more places or in fewer recordings: what it does not say itself that law says."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from ..mechanism import Mechanism
from ..parameters import Quantity
from .deeds import Felt, Solved
from .drawn import Drawn
from .law import Law, Place

_SAME = (
    *("physics", "summary", "remedy", "source", "neutral", "needs", "spread", "cost", "likely", "strong", "lasts"),
    "unremarkable",
    *("called", "weighs", "of_stiffness", "sensor"),
)


class OfAnother(Law):
    """`law` is the other one; `inner` says where that one is asked."""

    physics = ""
    summary = ""
    quantities = ()
    neutral: ClassVar = {}

    def __init__(self, law: Law, **own: Any):
        """`own`: attributes that are not those of the other law."""
        self.law = law
        vars(self).update({name: getattr(law, name) for name in _SAME} | own)

    @abstractmethod
    def inner(self, place: Place, mechanism: Mechanism) -> Place:
        """Return the place of the other law that a place of this one stands for, or the first of them."""

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        return self.law.quantities_at(self.inner(place, mechanism), mechanism)

    def seen_at(self, place: Place, mechanism: Mechanism, felt: Felt, interval: float) -> tuple[Quantity, ...]:
        return self.law.seen_at(self.inner(place, mechanism), mechanism, felt, interval)

    def starts(self, place: Place, mechanism: Mechanism) -> Sequence[Mapping[str, float]]:
        return self.law.starts(self.inner(place, mechanism), mechanism)

    def usual_at(self, place: Place, mechanism: Mechanism) -> Mapping[str, tuple[float, float]]:
        return self.law.usual_at(self.inner(place, mechanism), mechanism)

    def neutral_at(self, place: Place, mechanism: Mechanism) -> Mapping[str, float]:
        return self.law.neutral_at(self.inner(place, mechanism), mechanism)

    def advice(self, place: Place, values: Mapping[str, float]) -> str:
        return self.law.advice(place, values)

    def magnified(self, value: float, times: float) -> float:
        return self.law.magnified(value, times)

    def multiple(self, value: float, of: float) -> float:
        return self.law.multiple(value, of)

    def drawn(self, place: Place, at: Solved) -> Drawn | None:
        return None
