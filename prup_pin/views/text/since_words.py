"""What has changed since an earlier test, in words: what the terminal and the report both say."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from ...numbers import number, readable_unit
from ...recordings import SENSORS

if TYPE_CHECKING:  # the command line begins without them
    from ...diagnosis import Diagnosis, Finding
    from ...diagnosis.since import Changed, Seen, Since

#: Values of earlier effects that a verdict tells by name.
_MOST_TOLD = 2
#: No gap, offset or friction of a robot is so large, in any SI unit: a test that needs it never shows one.
ABSURD = 1e9
#: Shares from this on are told in per cent.
_SHARE = 1e-3
#: A value that does nothing and is so many times another one has no end.
_ENDLESS = 1e6


def verdict_since(diagnosis: Diagnosis, since: Since) -> str:
    """Return the verdict on what has changed, in a sentence or two."""
    before, after = (number(values["heldout"], 3) for values in (diagnosis.before, diagnosis.after))
    named = [item for item in diagnosis.findings if item.physics != "unknown" and item.parameters]
    if diagnosis.verdict == "nothing_missing":
        seen = [*_largest_unseen(since)]
        number_ = f" {seen[0][:1].upper()}{'; '.join(seen)[1:]}." if seen else ""
        return (
            "Nothing has changed since the earlier test beyond what that could know: what its model leaves is noise "
            f"({after} times it).{number_}"
        )
    told = ", ".join(f"{_name(item)}{_from_to(item)}" for item in named)
    takes = f"the residual falls from {before} to {after} times the noise" if before != after else f"{after} are left"
    if diagnosis.verdict == "explained":
        sensors = all(item.effect is not None and item.effect.law.sensor in SENSORS for item in named)
        only = " Nothing else has: the robot is as it was." if sensors else ""
        return f"Changed since the earlier test: {told}; with it {takes}.{only}"
    if not since.explained:
        beside = f"; with {told} {takes}" if told else ""
        return (
            "Nothing can be told for certain: the earlier test was left unexplained itself, and its model leaves "
            f"{before} times the noise here{beside}. Whether that has changed or was there before, both recordings "
            "diagnosed together would say."
        )
    where = next((item.location for item in diagnosis.findings if item.physics == "unknown"), "robot")
    at = "" if where == "robot" else f"; it is largest in {where}"
    if told:
        return f"Something has changed that is not understood: with {told} {takes}, and no law explains the rest{at}."
    return (
        f"Something has changed that is not understood: the earlier model leaves {before} times the noise, and no law "
        f"of the library explains it{at}."
    )


def _name(finding: Finding) -> str:
    words = finding.physics.replace("_", " ")
    return words if finding.location == "robot" else f"{words} at {finding.location}"


def _from_to(finding: Finding) -> str:
    """Return ' (half gap from 12 to 19 µm)' of what was there before."""
    for name, item in finding.parameters.items():
        if item.before is not None:
            unit, factor = readable_unit(item.value, item.unit)
            ends = [number(factor * value, 3) for value in (item.before, item.value)]
            return f" ({name.replace('_', ' ')} from {ends[0]} to {ends[1]} {unit})".replace(" )", ")")
    return ""


def _largest_unseen(since: Since) -> Iterator[str]:
    """Yield how large a change would have been seen: of what was found before, and of the first law of the library."""
    first = [item for item in since.values if item.seen is not None and item is _first_of(since, item)]
    for item in first[:_MOST_TOLD]:
        words = item.parameter.replace("_", " ")
        yield f"a {words} at {item.location} larger or smaller by {_size(item.seen or 0.0, item.unit)} would have shown"
    for physics, ends in _ends(since.seen)[:1]:
        told = ", ".join(f"by {_off(item)} at {item.location}" for item in ends)
        yield f"so would {physics} {told}" if first else f"{physics} {told} would have shown"


def _first_of(since: Since, item: Changed) -> Changed:
    """Return the first value of the effect that a value is of."""
    key = (item.physics, item.location, item.aspect)
    return next(other for other in since.values if (other.physics, other.location, other.aspect) == key)


def then_and_now_rows(since: Since) -> list[tuple[str, str, str, str, str]]:
    """Return rows of what was found before: what, then, now, the difference with its interval, what would show."""
    rows = []
    for item in since.values:
        what = f"{item.physics.replace('_', ' ')} at {item.location}: {item.parameter.replace('_', ' ')}"
        unit, factor = readable_unit(item.then.value, item.unit)
        then, now = (number(factor * value.value, 3) for value in (item.then, item.now))
        apart = "as it was"
        if item.has_changed:
            low, high = (number(factor * end, 3) for end in sorted(item.difference.interval))
            sign = "+" if item.difference.value > 0 else ""
            apart = f"{sign}{number(factor * item.difference.value, 3)} ({low} to {high})"
        shown = "none" if item.seen is None else number(factor * item.seen, 2)
        rows.append((f"{what} [{unit}]" if unit else what, then, now, apart, shown))
    return rows


def seen_rows(seen: Sequence[Seen]) -> list[tuple[str, str, str]]:
    """Return rows of what would have shown beside: physics, the most and the least sensitive place, the sizes there."""
    rows = []
    for physics, ends in _ends(seen):
        places = " to ".join(dict.fromkeys(item.location for item in ends))
        rows.append((f"{physics}, {ends[0].parameter.replace('_', ' ')}", places, _off(*ends)))
    return rows


def _ends(seen: Sequence[Seen]) -> list[tuple[str, list[Seen]]]:
    """Return, of each physics in words and parameter, the most and the least sensitive place.

    Left out is what shows at no size that there is.
    """
    kinds: dict[tuple[str, str, str], list[Seen]] = {}
    for item in seen:
        if not _is_endless(item) or abs(item.smallest) < ABSURD:
            kinds.setdefault((item.physics, item.parameter, item.unit), []).append(item)
    found = []
    for (physics, _, _), items in kinds.items():
        items.sort(key=lambda item: 1 / item.smallest if _is_endless(item) else abs(item.smallest - item.neutral))
        found.append((physics.replace("_", " "), [items[0], *items[-1:]] if len(items) > 1 else items))
    return found


def _off(*items: Seen) -> str:
    """Return by how much a parameter must be off to show, at one place or at two: a factor or a share in per cent."""
    endless = _is_endless(items[0])
    sizes = [item.smallest if endless else abs(item.smallest - item.neutral) for item in items]
    if items[0].unit == "1" and max(sizes) >= _SHARE:
        unit, factor = "%", 100.0
    else:
        unit, factor = readable_unit(sizes[0], items[0].unit)
    shown = dict.fromkeys(number(factor * size, 2 if unit == "%" else 3) for size in sizes)
    return f"{'below ' if endless else ''}{' to '.join(shown)} {unit}".strip()


def _is_endless(item: Seen) -> bool:
    """Return True for what does nothing where its value is without end, such as a reference load."""
    return abs(item.neutral) > _ENDLESS * abs(item.smallest) > 0


def _size(value: float, unit: str) -> str:
    shown, factor = readable_unit(value, unit)
    return f"{number(factor * value, 3)} {shown}".strip()
