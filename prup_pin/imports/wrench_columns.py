"""Which columns are a wrench: fx … mz, or force.x … torque.z."""

from __future__ import annotations

import re

from .draft import Line
from .log import Log
from .units import dimension_of, spelled
from .words import WISHED, unit_in_name, words_of

#: What forces and moments are called, in English, German, French, Spanish and Italian.
_FORCES = ("force", "kraft", "fuerza", "forza")
_MOMENTS = ("torque", "moment", "drehmoment", "couple", "momento", "coppia")


def wrench_lines(log: Log, taken: set[str]) -> list[Line]:
    """Return the lines of a wrench: fx … mz, or force.x … torque.z."""
    lines: dict[str, Line] = {}
    for stream in log.streams:
        for name in stream.columns:
            words = words_of(name)
            if name in taken or not words or set(words) & set(WISHED):
                continue
            last = words[-1]
            if re.fullmatch(r"[fmt][xyz]", last):
                component = ("f" if last[0] == "f" else "m") + last[1]
            elif last in ("x", "y", "z") and len(words) > 1 and words[-2] in (*_FORCES, *_MOMENTS):
                component = ("f" if words[-2] in _FORCES else "m") + last
            else:
                continue
            said = stream.units.get(name) or unit_in_name(name)
            if said and dimension_of(spelled(said) or "N") not in (None, "force", "moment"):
                continue  # TX in mm is a translation
            # the recording's own name says what it is
            doubt = "" if name == f"w.{component}" else "is it what acts on the tool point, in base axes?"
            unit = (spelled(said) if said else None) or ("N" if component[0] == "f" else "N m")
            lines.setdefault(f"w.{component}", Line(f"w.{component}", name, unit, doubt=doubt))
    return list(lines.values())
