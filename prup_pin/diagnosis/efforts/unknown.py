"""Findings of what no law takes away: curves of no law, masses that no body has, friction that comes and goes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ...numbers import number
from ...spatial import Array
from ..diagnosis import Finding
from .changing import changing
from .columns import EffortCandidate
from .gather import Efforts
from .outcome import Outcome
from .plausible import CHECK_ROBOT
from .search import held_out

__all__ = [
    "body_unknown",
    "changing_unknown",
    "curve_unknown",
    "foreign_unknown",
    "loud_unknown",
    "unknown_at",
    "unmoved_unknown",
    "untold_unknown",
    "worse_unknown",
]


def curve_unknown(outcome: Outcome, term: EffortCandidate) -> Finding:
    """Return the finding of a curve of no law."""
    without = held_out(outcome.given, outcome.chosen.without(term))
    whole = held_out(outcome.given, outcome.chosen)
    share = float(np.clip(1 - whole.sum() / max(without.sum(), np.finfo(float).tiny), 0.0, 1.0))
    return unknown_at(
        term.place.name,
        f"structure is left over at {term.place.name} that no law of the library takes away; "
        f"{term.law.summary} by a curve of its own would take away {100 * share:.0f} % of the square of what is left"
        + ("" if term.is_of_time else ", and the corrected model follows it"),
        share,
    )


def body_unknown(outcome: Outcome, term: EffortCandidate) -> Finding:
    """Return the finding of masses that no body has: of their link's joint."""
    joint, link = outcome.carries(term.place.name), term.place.name
    saved = outcome.saves(term)
    share = float(np.clip(saved / max(saved + float(outcome.held.sum()), np.finfo(float).tiny), 0.0, 1.0))
    text = (
        f"structure is left over at {joint} that no law of the library takes away; masses of {link} that no body "
        f"has would take away {100 * share:.0f} % of its square; the corrected model keeps to a body that can be"
    )
    return replace(unknown_at(joint, text, share), candidates=(joint, link))


def loud_unknown(name: str, multiple: float) -> Finding:
    """Return that what is left at a joint is more than the noise that was declared."""
    return unknown_at(
        name,
        f"what is left at {name} is {number(multiple, 3)} times the declared noise; no law of the library takes it "
        "away, and it follows neither speed, position, load nor time",
    )


def untold_unknown(name: str, left: float, here: float, multiple: float) -> Finding:
    """Return that so much of a joint's effort is left, and of all, which is too loud for noise."""
    loud = (
        f"{number(multiple, 3)} times what a sample of it scatters by itself"
        if np.isfinite(multiple)
        else "and nothing tells how much a sample of it scatters by itself"
    )
    return unknown_at(
        name,
        f"{number(100 * here, 3)} % of the effort of {name} are left, {loud} ({number(100 * left, 3)} % of all "
        "efforts); no law of the library takes it away, and no noise was declared that it could be",
    )


def unmoved_unknown(name: str, here: float, multiple: float) -> Finding:
    """Return that a joint's effort changes while its position never does, and no load on it tells why."""
    text = (
        f"the position of {name} never changes, while its effort does by {number(multiple, 3)} times what a sample of "
        f"it scatters by itself and {number(100 * here, 3)} % of it: more than the load on it changes"
    )
    advice = (
        f"check the column q.{name}: if {name} moved, it is not its position; if it stood, look what else loaded it"
    )
    return replace(unknown_at(name, text), advice=advice)


def foreign_unknown(drawn: float, left: float) -> Finding:
    """Return that the log is hardly one of this robot: nothing that may be off in the drawing tells its efforts."""
    return unknown_at(
        "robot",
        f"what the robot file leaves is {number(drawn, 3)} times the efforts themselves, and with all that was "
        f"corrected {number(100 * left, 3)} % of them are left: this is hardly a log of this robot. {CHECK_ROBOT}",
    )


def worse_unknown(name: str, drawn: float, left: float) -> Finding:
    """Return that the corrected model predicts a joint's effort worse than the drawing does."""
    return unknown_at(
        name,
        f"with what was found {number(100 * left, 3)} % of the effort of {name} are left on blocks of time that were "
        f"not fitted, as drawn {number(100 * drawn, 3)} %: what takes place there is none of the laws that were found",
    )


def changing_unknown(efforts: Efforts, left: Array, measured: Array, noise: Array) -> Iterator[Finding]:
    """Yield that what is left (n, k), which no noise was declared for, is none: it follows the motion now and then."""
    change = changing(efforts, left, measured, noise)
    if change is not None:
        own = change.of == change.joint
        followed = f"its {change.variable}" if own else f"the {change.variable} of {change.of}"
        text = (
            f"what is left at {change.joint} follows {followed} by an amount that changes with time, which "
            f"would take away {number(100 * change.share, 2)} % of its square beyond chance and is "
            f"{number(100 * change.size, 2)} % of the joint's effort (root mean square): it is no noise, and no "
            "law of the library takes it away"
        )
        yield unknown_at(change.joint, text, change.share)


def unknown_at(where: str, statement: str, share: float = 0.0) -> Finding:
    """Return the finding of something unknown at a place, which would take away a share of what is left."""
    return Finding(
        physics="unknown",
        location=where,
        candidates=(where,),
        parameters={},
        heldout_gain=share,
        statement=statement,
    )
