"""The JSON file beside a table: robot, noise, tolerances, conventions, sensors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..errors import InputError, did_you_mean, nearest_names
from ..files import as_path, is_file, is_path, named_beside
from .columns import COARSEST_NOISE, FINEST_NOISE, NOISE_KEYS, NOISE_UNITS
from .conventions import Convention, convention_of
from .problems import KeyProblem, KeyReader, Problems, ValueReader, is_number, json_kind, read_json_object, shown
from .recording import Noise, moment
from .tolerances import KINDS_OF_TOLERANCE, SENSORS, Tolerances

#: Keys of the JSON beside the table.
KEYS = ("robot", *NOISE_KEYS, "tolerances", "own_sensors", "conventions", "notes", "date", "device")
_TOLERANCES = {kind.name: kind for kind in KINDS_OF_TOLERANCE}


def said_beside(path: Path, problems: Problems, header: Sequence[str] = ()) -> tuple[dict[str, Any], list[str]]:
    """Return what the JSON file beside a table with these columns says, by fields of Recording, and remarks."""
    beside = path.with_suffix(".json")
    if not beside.exists():
        return {}, [f"There is no {beside.name} next to the table: the noise is not declared."]
    remarks: list[str] = []
    found: dict[str, Any] = {}
    values = read_json_object(beside, "a JSON object", problems)
    keys = ValueReader(problems, beside.name)
    noise = {}
    misspelt = []
    for key, value in values.items():
        if key in NOISE_KEYS:
            noise[NOISE_KEYS[key]] = noise_value(keys, key, value)
        elif key == "tolerances":
            found[key] = tolerances_of(keys, value, key)
        elif key == "own_sensors":
            if isinstance(value, dict) and set(value) <= {"by_run"}:
                found["own_by_run"] = own_sensors_of(keys, value.get("by_run"), f"{key}.by_run")
            else:
                found[key] = own_sensors_of(keys, value, key)
        elif key == "conventions":
            found[key] = conventions_of(keys, value, _joints(header)) if header else ()
        elif key == "frame" and value == "base":
            pass  # which they all are in
        elif key in ("robot", "notes", "date", "device"):
            text = keys.text(value, key)
            if text is not None:
                found[key] = text
            if key == "date" and text is not None:
                try:
                    moment(text)
                except ValueError:
                    expected = "expected a day or a moment, as 2026-03-01 or 2026-03-01T14:30"
                    keys.wrong(key, f"is {shown(text)}; {expected}")
        else:
            near = did_you_mean(shown(key), KEYS, 1)
            told = near or nearest_names(shown(key), KEYS)
            remarks.append(f"{beside.name}: the unknown key '{shown(key)}' is ignored. {told}")
            if near:
                misspelt.append((key, near))
                found["misspelt"] = (*found.get("misspelt", ()), remarks[-1])
    for key, near in misspelt if problems else ():  # what is wrong is mended at once, and then nothing else is told
        keys.wrong(shown(key), f"unknown key. {near}")
    if named := found.get("robot"):
        found["robot"] = named_beside(named, path)
        if is_path(named) and is_file(as_path(named)) and not is_file(path.parent / as_path(named)):
            told = f"there is no '{shown(named)}' beside it: without --robot, one of the working folder is taken."
            remarks.append(f"{beside.name}: {told}")
            found["misspelt"] = (*found.get("misspelt", ()), remarks[-1])
    return {**found, "noise": Noise(**noise)}, remarks


def own_sensors_of(keys: KeyReader, value: object, key: str) -> tuple[str, ...]:
    """Return the sensors that a recording has for itself, or each run; what is wrong is added, and left out."""
    if value is None or value is False:
        return ()
    if value is True:
        return tuple(SENSORS)
    if not isinstance(value, list):
        message = f"is {json_kind(value)}; expected true, or a list of some of {', '.join(SENSORS)}"
        keys.wrong(key, message + ('; for each run {"by_run": […]}' if key == "own_sensors" else ""))
        return ()
    for place, name in enumerate(value):
        if name not in SENSORS:
            keys.wrong(f"{key}[{place}]", f"is {json_kind(name)}. {nearest_names(shown(name), list(SENSORS))}")
    return tuple(name for name in SENSORS if name in value)


def _joints(header: Sequence[str]) -> dict[str, list[str]]:
    """Return the joints that have a column q, and those that have a column tau."""
    return {
        group: [name.partition(".")[2] for name in header if name.startswith(f"{group}.")] for group in ("q", "tau")
    }


def conventions_of(keys: KeyReader, values: object, joints: Mapping[str, Sequence[str]]) -> tuple[Convention, ...]:
    """Return the conventions of a JSON object; joints: by q and tau, those with such a column.

    What is wrong is added, and a wrong one left out.
    """
    if values is None:
        return ()
    if not isinstance(values, dict):
        message = f'is {json_kind(values)}; expected an object such as {{"wrench": "reaction", "q": ["deg"]}}'
        keys.wrong("conventions", message)
        return ()
    found = []
    for columns, given in values.items():
        for said in given if isinstance(given, list) else [given]:
            place = f"conventions.{shown(columns)}"
            if not isinstance(said, str):
                message = f'is {json_kind(said)}; expected a text such as "reaction", or a list of such texts'
                keys.wrong(place, message)
                continue
            try:
                found.append(convention_of(columns, said, joints))
            except InputError as error:
                keys.wrong(place, str(error))
    return tuple(found)


def noise_of(keys: KeyReader, values: Mapping[str, object]) -> Noise:
    """Return the noise that stands under the key `noise`, by the keys of its channels; others are not looked at."""
    known = {key: value for key, value in values.items() if key in NOISE_KEYS}
    return Noise(**{NOISE_KEYS[key]: noise_value(keys, key, value, "noise") for key, value in known.items()})


def noise_value(keys: KeyReader, key: str, value: object, within: str = "") -> float | None:
    """Return a declared standard deviation, or None where it is null or wrong; what is wrong is added."""
    if value is None:
        return None
    if not is_number(value) or not FINEST_NOISE <= value <= COARSEST_NOISE:
        span = "above 0" if not is_number(value) or value <= 0 else f"from {FINEST_NOISE:g} to {COARSEST_NOISE:g}"
        unit = f"one standard deviation {span} [{NOISE_UNITS[NOISE_KEYS[key]]}]"
        message = f"is {json_kind(value)}; expected {unit}, or no such key where it is not known"
        keys.wrong(keys.joined(within, key), message)
        return None
    return float(value)


def read_tolerances(path: str | Path) -> Tolerances:
    """Return the tolerances of a JSON file: those under its key `tolerances`, as beside a recording, or its own keys.

    Raises RecordingFileError with all that is wrong.
    """
    problems = Problems(Path(path))
    keys = KeyReader(problems)
    values = read_json_object(problems.path, "a JSON object of tolerances", problems)
    within = "tolerances" in values
    found = tolerances_of(keys, values["tolerances"] if within else values, "tolerances" * within)
    if not found.declared and not problems:
        message = f"declares no tolerance; expected some of {', '.join(_TOLERANCES)}"
        problems.add(KeyProblem(message, None, keys.file))
    problems.raise_all()
    return found


def tolerances_of(keys: KeyReader, values: object, key: str) -> Tolerances:
    """Return the tolerances of the JSON object at a key; what is wrong is added, and a wrong one left out."""
    if values is None:
        return Tolerances()
    if not isinstance(values, dict):
        keys.wrong(key, f"is {json_kind(values)}; expected an object")
        return Tolerances()
    found = {}
    for name, value in values.items():
        if name not in _TOLERANCES:
            near = nearest_names(shown(name), list(_TOLERANCES))
            keys.wrong(keys.joined(key, name), f"no tolerance has this name. {near}")
        elif value is not None:
            if wrong := _TOLERANCES[name].wrong(value):
                keys.wrong(keys.joined(key, name), f"is {json_kind(value)}; {wrong}")
            else:
                found[name] = float(value)
    return Tolerances(**found)
