"""Which column of a log is the time: by its name, by rising from row to row, and its unit by the size of its steps."""

from __future__ import annotations

import numpy as np

from ..spatial import Array
from .log import Stream
from .units import UNITS, dimension_of, spelled
from .words import KIND, TIME, WISHED, unit_in_name, words_of

#: Column of a stream's time (None: stamps of the format, "": none), its unit, and what is not sure of it.
TimeColumn = tuple[str | None, str, str]
#: The same by stream.
Clocks = dict[str, TimeColumn]
#: Share of rows that may fall in a column of time.
LATE = 0.01
#: Periods of loggers [s].
_PERIODS = (2e-5, 0.5)


def time_column(stream: Stream) -> TimeColumn:
    """Return column, unit and doubt of a stream's time."""
    if stream.clock is not None:
        return None, "s", ""
    rising = [name for name, values in stream.columns.items() if _rises(values)]
    named = [name for name in rising if _is_time(stream, name)]
    if not named:  # a few rows came late, or the clock was started again
        named = [name for name, values in stream.columns.items() if _rises(values, LATE) and _is_time(stream, name)]
    named.sort(key=lambda name: (len(words_of(name)), -np.ptp(stream.columns[name])))
    rising = [name for name in rising if _may_be_time(stream, name)]
    if not (named or rising):
        return "", "s", "no column is a time: write how many rows a second there are; 1 will do for poses at rest"
    name = (named or rising)[0]
    doubt = "" if named else "no column has a name of time; this one rises from row to row"
    said = stream.units.get(name) or unit_in_name(name)
    unit = spelled(said) if said else None
    if unit is None or dimension_of(unit) != "time":
        words = words_of(name)
        unit = next((u for u in ("ns", "us", "ms") if u in words), "ms" if "ipoc" in words else None)
    if unit is None:
        values = stream.columns[name]
        step = float(np.median(np.diff(values[np.isfinite(values)])))
        since = float(np.nanmax(values))  # an epoch tells its unit by its size
        unit = next((u for u, size in (("ns", 1e17), ("us", 1e14), ("ms", 1e11)) if since > size), None)
        if unit is None:
            fits = [u for u in ("s", "ms", "us", "ns") if _PERIODS[0] <= step * UNITS["time"][u] <= _PERIODS[1]]
            unit = fits[0] if fits else "s"
            if step > _PERIODS[1]:
                doubt = doubt or f"the step is {step:g}: {unit} makes {step * UNITS['time'][unit]:g} s of it"
    return name, unit, doubt


def _is_time(stream: Stream, name: str) -> bool:
    """Return whether a column's name or unit is that of a time."""
    words = set(words_of(name))
    unit = stream.units.get(name) or unit_in_name(name)
    timed = unit is not None and dimension_of(spelled(unit) or "") == "time"
    return bool(words & set(TIME) or timed) and not words & set(WISHED)


def _may_be_time(stream: Stream, name: str) -> bool:
    """Return whether a column that rises may be the time by its name: no joint, no place, no count of rows."""
    words, values = words_of(name), stream.columns[name]
    said = stream.units.get(name) or unit_in_name(name)
    other = said is not None and dimension_of(spelled(said) or "s") != "time"
    spoken = set(words) & set(KIND) or (any(word.isdigit() for word in words) and name != "column 1")
    return not (other or spoken or words[-1:] in (["x"], ["y"], ["z"]) or (np.diff(values) == 1).all())


def _rises(values: Array, late: float = 0.0) -> bool:
    """Return whether a column rises from row to row, but for a share of them that may fall."""
    steps = np.diff(values[np.isfinite(values)])
    return len(steps) > 1 and float(np.mean(steps < 0)) <= late and float(np.mean(steps > 0)) > 0.5
