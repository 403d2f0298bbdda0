"""Units as loggers write them, and what they are in SI; the words and units in the names of columns."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from unicodedata import normalize

_TURN = 2 * math.pi
_LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "inch": 0.0254}
_ANGLE = {"rad": 1.0, "mrad": 1e-3, "deg": _TURN / 360, "°": _TURN / 360, "rev": _TURN, "turn": _TURN}
#: SI value of each unit, by what is measured.
UNITS: Mapping[str, Mapping[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60.0},
    "angle": _ANGLE,
    "length": _LENGTH,
    "angular velocity": {
        **{f"{unit}/s": value for unit, value in _ANGLE.items()},
        "rpm": _TURN / 60,
        "rev/min": _TURN / 60,
        "rps": _TURN,
    },
    "velocity": {**{f"{unit}/s": value for unit, value in _LENGTH.items()}, "m/min": 1 / 60, "mm/min": 1e-3 / 60},
    "angular acceleration": {f"{unit}/s^2": value for unit, value in _ANGLE.items()},
    "acceleration": {**{f"{unit}/s^2": value for unit, value in _LENGTH.items()}, "g0": 9.80665},
    "moment": {"N m": 1.0, "mN m": 1e-3, "kN m": 1e3, "N cm": 1e-2, "N mm": 1e-3},
    "force": {"N": 1.0, "mN": 1e-3, "kN": 1e3, "kgf": 9.80665, "lbf": 4.4482216152605},
    "temperature": {"degC": 1.0, "K": 1.0},
    "label": {"1": 1.0},
}
#: What a driver may say instead of an effort or a position; it takes a `scale` to SI.
UNSCALED = ("A", "mA", "V", "%", "counts", "raw")
#: ... and of it what a drive takes.
DRIVING = ("A", "mA")
#: What stands for no unit at all: the first one of each dimension.
SI_WORDS: Mapping[str, str] = {dimension: next(iter(units)) for dimension, units in UNITS.items()}
_KELVIN = -273.15
#: Other spellings, compared without case, spaces and dots.
_SPELLED = {
    "sec": "s", "second": "s", "seconds": "s", "msec": "ms", "millis": "ms", "usec": "us", "micros": "us",
    "nsec": "ns", "nanos": "ns", "radian": "rad", "radians": "rad", "degree": "deg", "degrees": "deg", "grad": "deg",
    "grados": "deg", "gradi": "deg", "degrés": "deg", "degres": "deg", "radianes": "rad", "radianti": "rad",
    "deg/sec": "deg/s", "rad/sec": "rad/s", "dps": "deg/s", "°/s": "deg/s", "1/min": "rpm", "u/min": "rpm",
    "nm": "N m", "n*m": "N m", "n·m": "N m", "n-m": "N m", "mnm": "mN m", "knm": "kN m", "ncm": "N cm", "nmm": "N mm",
    "newton": "N", "percent": "%", "pct": "%", "ampere": "A", "amps": "A", "amp": "A", "volt": "V", "volts": "V",
    "celsius": "degC", "°c": "degC", "kelvin": "K", "count": "counts", "inc": "counts", "ticks": "counts",
    "rad/s2": "rad/s^2", "rad/s²": "rad/s^2", "deg/s2": "deg/s^2", "deg/s²": "deg/s^2", "m/s2": "m/s^2",
    "m/s²": "m/s^2", "mm/s2": "mm/s^2", "mm/s²": "mm/s^2", "in": "inch", "-": "1",
    "meter": "m", "meters": "m", "metre": "m", "metres": "m", "millimeter": "mm", "millimeters": "mm",
    "millimetre": "mm", "millimetres": "mm", "centimeter": "cm", "centimeters": "cm", "inches": "inch",
    "°/s²": "deg/s^2", "u/s": "rps", "newtonmeter": "N m", "newton-meters": "N m", "μm": "um", "μs": "us", "c": "degC",
    "度": "deg", "秒": "s", "ミリ秒": "ms", "n・m": "N m",
}  # fmt: skip


_KNOWN = tuple(unit for units in UNITS.values() for unit in units) + UNSCALED
#: A share of something that the drive knows: '% of rated torque', 'percent rated', '% Nennmoment'.
_SHARE = re.compile(r"(?:%|percent|per cent|pct|prozent)(?![a-zäöü])", re.IGNORECASE)
#: Units by their letters alone, the first of those that share them.
_FLAT = {re.sub(r"\s", "", unit).lower(): unit for unit in reversed(_KNOWN)}


@dataclass(frozen=True)
class Unit:
    """SI = factor x value + offset; `needs_scale` where the factor is only known with a scale."""

    name: str
    factor: float
    offset: float = 0.0
    needs_scale: bool = False


def narrow(text: str) -> str:
    """Return a text with plain characters in the place of wide ones: 'mm' of '㎜' and 'N' of 'Ｎ'."""
    return "".join(normalize("NFKC", c) if "\u3300" <= c <= "\u33ff" or "\uff01" <= c <= "\uff9f" else c for c in text)


def spelled(text: str) -> str | None:
    """Return the unit that a text means, or None; of a share, in per cent of whatever, that it is one."""
    plain = re.sub(r"\s+", " ", narrow(text).strip().strip("[]()").strip())
    if plain in _KNOWN:
        return plain
    if _SHARE.match(plain):
        return "%"
    flat = re.sub(r"[\s._]", "", plain).lower()
    if flat in _SPELLED:
        return _SPELLED[flat]
    return _FLAT.get(flat) if len(flat) > 1 else None


def dimension_of(unit: str | None) -> str | None:
    """Return what a unit measures; None of none, and of those that take a scale."""
    return next((dimension for dimension, units in UNITS.items() if unit in units), None)


def factor_of(unit: str | None) -> float:
    """Return the SI value of a unit; 1 of none, and of those that take a scale."""
    dimension = dimension_of(unit)
    return 1.0 if unit is None or dimension is None else UNITS[dimension][unit]


def unit_for(text: str, dimensions: tuple[str, ...]) -> Unit | None:
    """Return the unit of one of some dimensions that a text means, or None."""
    name = spelled(text)
    if name in UNSCALED and not {"time", "label"} & set(dimensions):
        return Unit(name, 1.0, needs_scale=True)
    for dimension in dimensions:
        if name is not None and name in UNITS[dimension]:
            return Unit(name, UNITS[dimension][name], _KELVIN if name == "K" else 0.0)
    return None


def units_in_words(dimensions: tuple[str, ...]) -> str:
    """Return the units that fit, for a message."""
    fit = [unit for dimension in dimensions for unit in UNITS[dimension] if not unit.startswith(("µ", "°"))]
    unscaled = [] if {"time", "label"} & set(dimensions) else [f"{', '.join(UNSCALED)} with a scale"]
    return ", ".join(fit + unscaled)


# -- names of columns --------------------------------------------------------------------------------------------------


#: Words in the names of columns -> prefix of the recording's column.
WORDS = {
    "q": ("q", "qm", "pos", "position", "positions", "angle", "angles", "ang", "theta", "encoder", "enc", "winkel",
          "lage", "gelenkwinkel", "achswinkel", "stellung"),
    "qd": ("qd", "dq", "qdot", "vel", "velocity", "velocities", "speed", "speeds", "omega", "geschwindigkeit",
           "drehzahl", "winkelgeschwindigkeit", "dtheta"),
    "qdd": ("qdd", "ddq", "acc", "accel", "acceleration", "accelerations", "beschleunigung"),
    "tau": ("tau", "torque", "torques", "effort", "efforts", "trq", "moment", "moments", "drehmoment", "antriebsmoment",
            "current", "currents", "curr", "cur", "strom", "motorstrom"),
}  # fmt: skip
KIND = {word: kind for kind, words in WORDS.items() for word in words}
CURRENT = ("current", "currents", "curr", "cur", "strom", "motorstrom")
#: Of system identification: what goes in, and what comes out of it.
IN_OUT = {"u": "tau", "y": "q"}
#: A controller's wishes are no measurements.
WISHED = ("target", "desired", "des", "cmd", "command", "commanded", "ref", "reference", "setpoint", "goal", "set",
           "error", "err", "planned", "limit", "max", "min", "soll", "sollwert", "as")  # fmt: skip
MEASURED = ("actual", "act", "measured", "meas", "feedback", "fbk", "fb", "real", "state", "states", "ist", "istwert",
             "ai", "ma")  # fmt: skip
TIME = ("time", "t", "timestamp", "stamp", "timestamps", "sec", "seconds", "tout", "ms", "millis", "clock", "zeit",
         "zeitstempel", "uhrzeit", "datetime", "date", "ipoc")  # fmt: skip


def words_of(name: str) -> list[str]:
    """Return the words of a column's name in lower case, numbers apart: 'TorqueJ3 [Nm]' -> torque, j, 3."""
    name = narrow(name)
    tail = re.search(r"[\[(]([^\[\]()]*[A-Za-z°%][^\[\]()]*)[\])]\s*$", name)
    plain = name
    if tail is not None and spelled(tail.group(1)):
        plain = name[: tail.start()]
        if _SHARE.match(tail.group(1).strip()):  # of what: '% Nennmoment' is of an effort
            of = re.findall(r"[a-zäöüß]+", tail.group(1).lower())
            plain = " ".join((plain, *(kind for word in of if (kind := word.removeprefix("nenn")) in KIND)))
    plain = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", plain)
    found = re.findall(r"[a-zäöüß]+|\d+", plain.lower())
    return [part for word in found for part in _halves(word)]


def _halves(word: str) -> list[str]:
    """Return a German word apart that says whether something is or shall be: istposition -> ist, position."""
    rest = word.removeprefix("soll") if word.startswith("soll") else word.removeprefix("ist")
    return [word.removesuffix(rest), rest] if rest != word and rest in KIND else [word]


#: A unit at the end of a column's name: in brackets, perhaps before a number for a name that stands twice; or after an
#: underscore, of one letter where that is hardly anything else.
_IN_BRACKETS = re.compile(r"[\[(]([^\[\]()]+)[\])](?= \(\d+\)$|\s*$)")
_AFTER = re.compile(
    r"[_\s.]((?:(?i:deg|rad|grados|gradi|degr[eé]s|mm|cm|rpm|nm|ms|us|ns|dps)(?:[_/]s)?)|N|(?<=[\dxyzXYZ]_)[mA]"
    r"|(?i:%|percent|per cent|pct|prozent)"
    r"(?:[_\s.](?i:of|von|vom|des|the|rated|nominal|peak|max|nenn\w*|torque|current))*)$"
)


def unit_in_name(name: str) -> str | None:
    """Return the unit that a column's name ends with, in brackets or after an underscore: 'q1_deg', 'x [mm]'."""
    return _parted(name)[1]


def without_unit(name: str) -> str:
    """Return a column's name without the unit that it ends with: 'fx_N' -> 'fx'."""
    return _parted(name)[0]


def _parted(name: str) -> tuple[str, str | None]:
    """Return a column's name without its unit, wide characters as plain ones, and that unit, None where it has none."""
    plain = narrow(name)
    for pattern in (_IN_BRACKETS, _AFTER):
        found = pattern.search(plain)
        unit = spelled(found[1].replace("_", "/")) if found is not None and not found[1].strip().isdigit() else None
        if found is not None and unit is not None:
            return plain[: found.start()].rstrip() + plain[found.end() :], unit
        if found is not None and pattern is _IN_BRACKETS and not found[1].strip().isdigit():
            break
    return plain, None
