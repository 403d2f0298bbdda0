"""Findings of what is off at many places at once: which kind of parameter, where, by how much."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ..numbers import number, quantity
from ..recordings import KINDS_OF_TOLERANCE
from .calibrate import CalibratedParameter
from .chances import WITHIN_95, normal_isf
from .criteria import FALSE_ALARM, FEWEST_OF_KIND, GAIN, MOST_LISTED
from .diagnosis import Finding, FittedParameter, heldout_gain
from .evidence import cross_validated
from .problem import Fit, Problem


def all_over(
    problem: Problem,
    fit: Fit,
    calibrated: Sequence[CalibratedParameter],
    kinds: Sequence[str],
    labels: np.ndarray,
    alone: bool = True,
) -> list[Finding]:
    """Return a finding for each kind of parameter that is off all over, its places with the surest first.

    One of which no place is sure, and without which blocks left out are foretold as well, is only the best of them; and
    none where it does nothing for these, unless it is `alone`. labels (N,): samples that are held out together.
    """
    found = []
    held = cross_validated(problem, fit, labels[fit.samples], strained=True) if kinds else 0.0
    said = {kind.name: kind.all_over for kind in KINDS_OF_TOLERANCE if kind.all_over}
    for words in dict.fromkeys(said.values()):
        items = [item for item in calibrated if item.deviation.kind in kinds and said.get(item.deviation.kind) == words]
        if items:
            found.append(_finding(problem, fit, items, words, labels[fit.samples], held))
    told = [finding for finding, is_sure in found if is_sure or finding.heldout_gain > GAIN]
    best = [finding for finding, _ in sorted(found, key=lambda each: -each[0].heldout_gain)[:1]]
    return told or [finding for finding in best if alone or finding.heldout_gain > 0]


def _finding(
    problem: Problem, fit: Fit, items: Sequence[CalibratedParameter], words: str, labels: np.ndarray, held: float
) -> tuple[Finding, bool]:
    """Return a finding, and whether any of its places is sure."""
    assert problem.tolerances is not None
    own = {item.name for item in items}
    mask = np.array([item.name in own for item in problem.tolerances.toleranced.law.deviations])
    without = cross_validated(problem, fit, labels, parameters=mask, strained=True)
    least = normal_isf(FALSE_ALARM / (2 * len(items)))
    sure = sorted((item for item in items if _surety(item) > least), key=_surety, reverse=True)
    every = list(dict.fromkeys(item.deviation.place for item in sorted(items, key=_surety, reverse=True)))
    told = sure or sorted(items, key=_surety, reverse=True)[:1]
    places = list(dict.fromkeys(item.deviation.place for item in sure)) or every
    more = f" and {len(places) - MOST_LISTED} more" if len(places) > MOST_LISTED else ""
    listed = ", ".join(places[:MOST_LISTED]) + more
    text = f"; sure of {listed}" if sure else "; these data tell them together, and none alone"
    apart = list(_apart(items, sure, least))
    if len(sure) == 1 and not apart:  # the mean over all says little of the one that is off
        text += f", with {_told(sure[0].deviation.amount(sure[0].value), _unit_of_amount(sure[0]), signed=True)}"
    text += "".join(apart)
    finding = Finding(
        physics=told[0].deviation.physics,
        location=places[0] if len(places) == 1 else "robot",
        candidates=tuple(places if len(places) == 1 else ("robot", *places)),
        parameters={
            item.name: FittedParameter.about(item.value, item.deviation.unit, WITHIN_95 * item.sd, item.nominal)
            for item in told
        },
        heldout_gain=heldout_gain(held, without),
        statement=f"{words}: {_sizes(items)}{text}",
    )
    return finding, bool(sure)


def _apart(items: Sequence[CalibratedParameter], sure: Sequence[CalibratedParameter], least: float) -> Iterator[str]:
    """Yield what to say of a parameter that is surely off, and by `least` times what its sisters are or more."""
    for item in sure if len(items) > FEWEST_OF_KIND else ():
        unit, amount = _unit_of_amount(item), item.deviation.amount(item.value)
        others = [other for other in items if other is not item and _unit_of_amount(other) == unit]
        size = float(np.sqrt(np.mean(np.square([each.deviation.amount(each.value) for each in others] or [amount]))))
        if abs(amount) > least * size:
            told, usual = _told(amount, unit, signed=True), _told(size, unit)
            yield f"; {item.deviation.place} stands apart, with {told} where the others have {usual}: look there first"


def _surety(item: CalibratedParameter) -> float:
    """Return by how many standard deviations a parameter is off."""
    return abs(item.x) / item.share


def _sizes(items: Sequence[CalibratedParameter]) -> str:
    """Return root mean squares over all of a kind, for people."""
    found = []
    for unit in dict.fromkeys(_unit_of_amount(item) for item in items):
        here = [item for item in items if _unit_of_amount(item) == unit]
        size = float(np.sqrt(np.mean(np.square([item.deviation.amount(item.value) for item in here]))))
        found.append(_told(size, unit))
    return f"{' and '.join(found)} in the root mean square of {len(items)}"


def _told(amount: float, unit: str, signed: bool = False) -> str:
    """Return by how much a parameter is off, for people: of a logarithm the share."""
    if unit == "1":
        return f"{number(100 * float(np.expm1(amount)), 3, signed=signed)} %"
    return quantity(amount, unit, signed=signed)


def _unit_of_amount(item: CalibratedParameter) -> str:
    """Return the unit of what a parameter is off by: none of a share of itself."""
    return "1" if item.deviation.relative else item.deviation.unit
