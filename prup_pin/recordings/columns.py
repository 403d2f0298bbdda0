"""The names that columns of a recording can have. One place for reader, writer and messages."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ..spatial import WRENCH_NAMES, Array

#: Prefix of the columns of one joint -> the field of Recording that holds them.
JOINT_GROUPS = {"q": "positions", "qd": "velocities", "qdd": "accelerations", "tau": "efforts"}
#: Prefix of the columns of one marker -> the field of Recording that holds them.
MARKER_GROUPS = {"p": "markers", "r": "marker_rotations"}
#: Prefix of three columns -> the field of Recording that holds them.
TRIPLES = {"p": "position", "r": "rotation", "g": "gravity"}
AXES = ("x", "y", "z")
#: Columns with a fixed name, and their unit.
UNITS = {
    "time": "s",
    **{f"w.{name}": "N" if name.startswith("f") else "N m" for name in WRENCH_NAMES},
    **{f"p.{axis}": "m" for axis in AXES},
    **{f"r.{axis}": "rad" for axis in AXES},
    **{f"g.{axis}": "m/s^2" for axis in AXES},
    "temperature": "degrees Celsius",
    "run": "",
}
#: The unit of efforts that drives report in units of their own, which no column names.
AS_LOGGED = "as logged"
#: Nothing on a bench falls faster [m/s^2].
LARGEST_GRAVITY = 100.0
#: Larger numbers are of no bench, and their squares of no computer: of time [s], and of all else in its SI unit.
LARGEST_TIME = 1e12
LARGEST_NUMBER = 1e9
#: Sensors are neither finer nor coarser than this, in the SI unit of what they measure.
FINEST_NOISE = 1e-15
COARSEST_NOISE = 1e6
#: Keys of the JSON beside a recording -> the field of Noise.
NOISE_KEYS = {f"{name}_noise": name for name in ("position", "rotation", "force", "moment", "effort")}
NOISE_UNITS = {"position": "m", "rotation": "rad", "force": "N", "moment": "N m", "effort": "N or N m"}

#: How programs call what a joint does, before its name: torque.elbow for tau.elbow.
_JOINT_WORDS = {
    **dict.fromkeys(("torque", "torques", "effort", "efforts", "moment", "force"), "tau"),
    **dict.fromkeys(("position", "positions", "pos", "angle"), "q"),
    **dict.fromkeys(("velocity", "velocities", "vel", "speed"), "qd"),
    **dict.fromkeys(("acceleration", "accelerations", "accel", "acc"), "qdd"),
}
#: How programs call forces and moments: F_x, Fx, Force x, Mx, torque_x.
_LOAD = re.compile(r"(?:(?P<force>f|force)|m|moment|torque)[._\s-]?(?P<axis>[xyz])", re.I)
_UNIT_AT_END = re.compile(r"\s*[\[(][^\[\]()]*[\])]\s*$")
_KNOWN_UNIT = re.compile(
    r"\s*[\[(]\s*(?:[mµuk]?m|[mµu]?rad|deg|°|[kM]?N|[kM]?N\s*[·*.]?\s*m{0,2})(?:/s(?:\^?2|²)?)?\s*[\])]\s*$", re.I
)


def marker_of(name: str) -> tuple[str, str, int] | None:
    """Return field of Recording, marker and axis (0 to 2) of a column p.<marker>.<axis> or r.<marker>.<axis>.

    None of others.
    """
    prefix, dot, rest = name.partition(".")
    if dot and prefix in MARKER_GROUPS and len(rest) > 2 and rest[-2:] in (".x", ".y", ".z"):
        return MARKER_GROUPS[prefix], rest[:-2], AXES.index(rest[-1])
    return None


def joint_of(name: str) -> tuple[str, str] | None:
    """Return the field of Recording and the joint of a column q.<joint> and the like, or None."""
    prefix, dot, joint = name.partition(".")
    return (JOINT_GROUPS[prefix], joint) if dot and joint and prefix in JOINT_GROUPS else None


def fields_of(columns: Mapping[str, Array], rows: int) -> dict[str, Any]:
    """Return the fields of Recording of columns (rows,) by name; the inverse of `Recording.columns`."""
    fields: dict[str, Any] = {group: {} for group in (*JOINT_GROUPS.values(), *MARKER_GROUPS.values())}
    fields["wrench"] = np.zeros((rows, 6))
    fields["wrench_columns"] = tuple(name for name in WRENCH_NAMES if f"w.{name}" in columns)
    for name, values in columns.items():
        prefix, _, rest = name.partition(".")
        if joint := joint_of(name):
            fields[joint[0]][joint[1]] = values
        elif marker := marker_of(name):
            fields[marker[0]].setdefault(marker[1], np.full((rows, 3), np.nan))[:, marker[2]] = values
        elif prefix == "w":
            fields["wrench"][:, WRENCH_NAMES.index(rest)] = values
        elif prefix in TRIPLES:
            fields.setdefault(TRIPLES[prefix], np.full((rows, 3), np.nan))[:, AXES.index(rest)] = values
        elif name == "temperature":
            fields[name] = values
    return fields


def is_known(name: str) -> bool:
    """Return whether a column's name belongs to the format."""
    return name in UNITS or joint_of(name) is not None or marker_of(name) is not None


def unit_of(name: str) -> str:
    """Return the unit of a column that belongs to the format; other ones are task coordinates, which paths have."""
    if name in UNITS:
        return UNITS[name]
    if marker := marker_of(name):
        return "m" if marker[0] == "markers" else "rad"
    by_prefix = {"qd": "m/s or rad/s", "qdd": "m/s^2 or rad/s^2", "tau": "N or N m"}
    return by_prefix.get(name.partition(".")[0], "m or rad")


def without_unit(name: str) -> str:
    """Return a column's name without a unit in brackets at its end."""
    return _UNIT_AT_END.sub("", name).strip()


def meant(name: str) -> str | None:
    """Return the column that a name stands for but for its unit, case or separators, or None.

    'w.fx [N]', 'W.Fx', 'w_fx' and 'F_x' stand for w.fx, 'Q.leg1_slide (m)' for q.leg1_slide. Names that belong to
    the format and names that have nothing to do with it give None.
    """
    plain = without_unit(name)
    letters = re.sub(r"[._\s-]", "", plain).lower()
    for known in UNITS:
        separated = "." not in known or re.search(r"[._\s-]", plain)  # 'rx' may be anything
        if letters == known.replace(".", "") and name != known and separated:
            return known
    if load := _LOAD.fullmatch(plain):
        return f"w.{'f' if load['force'] else 'm'}{load['axis'].lower()}"
    if is_known(name):
        plain = _KNOWN_UNIT.sub("", name)  # a joint may be named with brackets, but hardly 'slide [mm]'
        return plain if plain != name and is_known(plain) else None
    prefix, dot, rest = plain.partition(".")
    for candidate in (f"{prefix.lower()}.{rest}", f"{prefix.lower()}.{rest[:-1]}{rest[-1:].lower()}"):
        if dot and rest and is_known(candidate):
            return candidate
    return None


def in_other_words(name: str) -> str | None:
    """Return the joint's column that a name in a program's words would be: tau.elbow of torque.elbow [Nm]; or None."""
    word, dot, joint = without_unit(name).partition(".")
    prefix = _JOINT_WORDS.get(word.lower())
    return f"{prefix}.{joint}" if prefix and dot and joint else None


def candidates(header: Iterable[str]) -> list[str]:
    """Return names to compare a misspelt one with: the fixed ones and what the header's joints would give."""
    joints = {found[1] for name in header if (found := joint_of(name))}
    return [*UNITS, *(f"{prefix}.{joint}" for prefix in JOINT_GROUPS for joint in sorted(joints))]


def largest(name: str) -> float:
    """Return the largest size of a number in a column, in its SI unit."""
    return LARGEST_TIME if name == "time" else LARGEST_NUMBER
