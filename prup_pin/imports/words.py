"""The names of columns as people and programs write them: word by word, with their units."""

from __future__ import annotations

import re

from .units import spelled

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
    tail = re.search(r"[\[(]([^\[\]()]*[A-Za-z°%][^\[\]()]*)[\])]\s*$", name)
    plain = name[: tail.start()] if tail is not None and spelled(tail.group(1)) else name
    plain = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", plain)
    found = re.findall(r"[a-zäöüß]+|\d+", plain.lower())
    return [part for word in found for part in _halves(word)]


def _halves(word: str) -> list[str]:
    """Return a German word apart that says whether something is or shall be: istposition -> ist, position."""
    rest = word.removeprefix("soll") if word.startswith("soll") else word.removeprefix("ist")
    return [word.removesuffix(rest), rest] if rest != word and rest in KIND else [word]


def unit_in_name(name: str) -> str | None:
    """Return the unit that a column's name ends with, in brackets or after an underscore: 'q1_deg', 'x [mm]'."""
    bracket = re.search(r"[\[(]([^\[\]()]+)[\])]\s*$", name)
    if bracket is not None and not bracket.group(1).strip().isdigit():
        return spelled(bracket.group(1))
    tail = re.search(r"[_\s.]((?:deg|rad|mm|rpm|nm|ms|us|ns|dps)(?:[_/]s)?)$", name, re.I)
    return spelled(tail.group(1).replace("_", "/")) if tail is not None else None
