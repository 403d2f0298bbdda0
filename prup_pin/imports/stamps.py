"""Dates and times of day as text: as seconds."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import date

import numpy as np

from ..spatial import Array

_DATE = (
    r"(?:(?P<y>\d{4})[-/.](?P<m>\d{1,2})[-/.](?P<d>\d{1,2})"
    r"|(?P<a>\d{1,2})(?P<mark>[./-])(?P<b>\d{1,2})[./-](?P<c>\d{4}))"
)
_CLOCK = r"(?P<H>\d{1,2}):(?P<M>\d{2}):(?P<S>\d{2})(?:[.,:](?P<f>\d+))?\s*(?P<half>[ap]\.?m\.?)?"
_ZONE = r"(?:Z|UTC|(?P<sign>[+-])(?P<zh>\d{2}):?(?P<zm>\d{2}))?"
_STAMP = re.compile(rf'\s*"?(?:{_DATE}[T\s_]+)?{_CLOCK}\s*{_ZONE}"?\s*', re.I)
_DAY = 86_400.0
#: Seconds are counted from here, so that microseconds are not lost.
_BEGIN = date(2000, 1, 1).toordinal()


def seconds_of(texts: Sequence[str]) -> Array:
    """Return texts such as 2023-03-29T06:23:40.125, 29.03.2023 06:23:40,125 or 06:23:40.125 as seconds (N,).

    NaN for an empty text and for what is none.
    """
    return np.array([_seconds(text) for text in texts])


def past_midnight(seconds: Array) -> Array:
    """Return times of day (N,) [s] that go on past midnight; those with a date as they are."""
    known = np.isfinite(seconds)
    if not known.any() or seconds[known].min() < 0 or seconds[known].max() >= _DAY:
        return seconds
    fallen = np.diff(seconds[known]) < -_DAY / 2
    out = seconds.copy()
    out[known] += _DAY * np.concatenate([[0], np.cumsum(fallen)])
    return out


def _seconds(text: str) -> float:
    found = _STAMP.fullmatch(text)
    if found is None:
        return np.nan
    part = found.groupdict()
    hour = int(part["H"])
    if part["half"]:
        hour = hour % 12 + 12 * (part["half"][0].lower() == "p")
    seconds = 3600.0 * hour + 60 * int(part["M"]) + int(part["S"]) + float(f"0.{part['f'] or 0}")
    if part["sign"]:
        seconds -= float(f"{part['sign']}1") * (3600 * int(part["zh"]) + 60 * int(part["zm"]))
    try:
        if part["y"]:
            return seconds + _DAY * (date(int(part["y"]), int(part["m"]), int(part["d"])).toordinal() - _BEGIN)
        if part["c"]:
            first, second = int(part["a"]), int(part["b"])
            american = part["mark"] == "/" and first <= 12
            day, month = (second, first) if american else (first, second)
            return seconds + _DAY * (date(int(part["c"]), month, day).toordinal() - _BEGIN)
    except ValueError:
        return np.nan
    return seconds
