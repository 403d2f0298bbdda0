"""What is said beside the findings of efforts: how to record the next motion, and what is odd about this one."""

from __future__ import annotations

from collections.abc import Sequence

from ...laws.efforts import Body
from ...mechanism.assumed import masses_in_doubt
from ...numbers import number
from ..diagnosis import Finding
from .outcome import Outcome

__all__ = ["advice_of", "remarks_of"]


def advice_of(outcome: Outcome, findings: Sequence[Finding], unknown: Sequence[Finding]) -> str:
    """Return which motion to record next; nothing where all is told."""
    slow = [
        name
        for name in outcome.at.driven
        if not outcome.at.moves(name) or outcome.motion.still[:, outcome.motion.names.index(name)].mean() > 0.5
        if name in outcome.motion.names
    ]
    if slow:
        return f"record again with {', '.join(slow)} in motion, at several speeds and both ways"
    if unknown:
        where = unknown[0].location
        return (
            f"move {where} alone, slowly and fast, over its whole travel and both ways, with the others in several "
            "postures: that tells apart what depends on its speed, its position and its load"
        )
    doubtful = [finding.location for finding in findings if finding.alternatives]
    moving = [name for name in doubtful if name in outcome.at.driven]
    if moving:
        return f"move {moving[0]} at several constant speeds, both ways, and accelerate it hard in between"
    return ""


def remarks_of(outcome: Outcome) -> list[str]:
    """Return what is odd about the motion, and what it cannot tell."""
    motion, efforts = outcome.motion, outcome.efforts
    remarks = list(motion.remarks)
    counted = (efforts.good | motion.saturated[efforts.every]).mean(axis=0)
    still = [(name, 1 - share) for name, share in zip(outcome.at.driven, counted, strict=True) if share < 0.98]
    if still:
        (first, share), *others = still
        more = "".join(f", {name} in {number(100 * share, 2)} %" for name, share in others)
        remarks.append(
            f"{first} stands still in {number(100 * share, 2)} %{more} of the samples: friction takes any value there, "
            "and they were left out for it"
        )
    remarks += masses_in_doubt(outcome.mechanism)
    rank, count = efforts.inertial_rank()
    if count:
        remarks.append(
            f"this motion tells {rank} combinations of the {count} inertial parameters of the moving links; "
            "the others stay as drawn"
        )
    for term in outcome.laws:
        if term.law.body is Body.ALL_LINKS:
            told = efforts.combinations(term.law)
            remarks.append(f"this motion tells nothing of {_by_link(told.silent)}: they stay as drawn")
    silent = [name for name in outcome.mechanism.actuated if name not in outcome.motion.names]
    if silent:
        remarks.append(f"no position was recorded of {', '.join(silent)}: taken to stand at home")
    return remarks


def _by_link(names: Sequence[str]) -> str:
    """Return parameters, link by link."""
    links: dict[str, list[str]] = {}
    for name in names:
        link, _, what = name.rpartition(".")
        links.setdefault(link, []).append(what)
    return "; ".join(f"{link}: {', '.join(what)}" for link, what in links.items())
