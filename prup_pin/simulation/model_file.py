"""The corrected model: a robot and the physics added to it, in a file that a person can read and change."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from .. import robots
from ..errors import InputError, ParameterError, PrupPinError, UnknownNameError, nearest_names
from ..files import json_lines, named_beside, write_whole
from ..laws import LAWS, Effect, Law, Place
from ..laws.deviations import Calibration, calibration_of
from ..laws.efforts import EFFORT_LAWS
from ..laws.efforts.free_curve import CURVES, FINE_CURVES
from ..laws.target import of_markers
from ..loading import Reading
from ..mechanism import Mechanism
from ..plugins import Source
from ..recordings import Noise
from ..recordings.beside import conventions_of, noise_of, own_sensors_of
from ..recordings.columns import NOISE_KEYS
from ..recordings.conventions import Convention, as_json
from ..recordings.problems import KeyReader, Problems, is_number, json_kind, read_json_object, shown
from ..robot import Robot
from .needs import as_json as needs_as_json
from .needs import lacking, needs_of
from .posterior import Posterior, instead, read_posterior

FORMAT = "prup_pin corrected model"
VERSION = 1
_KEYS = (
    "format",
    "version",
    "robot",
    "variant",
    "needs",
    "reading",
    "finite_deflection",
    "effects",
    "noise",
    "band",
    "effort_noise",
    "conventions",
    "own_sensors",
    "posterior",
    "verdict",
    "notes",
)
#: What a verdict is that leaves something without a law.
UNEXPLAINED = "unexplained"
_READING_KEYS = tuple(item.name for item in fields(Reading) if item.name != "variant")


@dataclass(frozen=True)
class Known:
    """How well an effect is known: 95 % intervals of its values by name, and what it explains.

    share: by which share the held-out squared residual falls as this effect comes to all the others.
    """

    intervals: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    share: float | None = None


@dataclass(frozen=True)
class CorrectedModel:
    """A robot, by a name or a path that `load` takes and a variant of its file, and the effects added to it.

    reading: how its file is read beyond what it says, but for the variant.
    noise: that of the sensors with which they were found, as far as it is known. band: by driven joint, the frequency
    [Hz] up to which its motion is the rigid robot's; beyond it lie the encoder's noise and motors that vibrate.
    conventions: how logs of this device are written, which declare none themselves. own_by_run: sensors that are set up
    anew for each run of a recording. effort_noise: by driven joint, the noise [N or N m] of its effort, where a
    diagnosis estimated it. known: of each effect in their order, how well, where a diagnosis said it. posterior: how
    well all their values are known together; None of a model that no diagnosis of poses wrote. verdict: that of the
    diagnosis which wrote it, if one did.
    """

    robot: str
    effects: tuple[Effect, ...] = ()
    variant: str | None = None
    notes: str = ""
    reading: Reading = field(default_factory=Reading)
    noise: Noise = field(default_factory=Noise)
    band: Mapping[str, float] = field(default_factory=dict)
    conventions: tuple[Convention, ...] = ()
    own_by_run: tuple[str, ...] = ()
    effort_noise: Mapping[str, float] = field(default_factory=dict)
    known: tuple[Known, ...] = ()
    posterior: Posterior | None = None
    verdict: str = ""

    @property
    def caution(self) -> str:
        """What whoever uses the model must know, a sentence; or ''."""
        if self.verdict != UNEXPLAINED:
            return ""
        return (
            "the diagnosis that wrote this model left something unexplained. Laws in it may only imitate what is "
            "missing, and it is valid only near the data of that diagnosis."
        )

    def known_of(self, effect: int) -> Known:
        """Return how well an effect is known, by its place among the effects."""
        return self.known[effect] if effect < len(self.known) else Known()

    def load(self) -> Robot:
        """Return the robot, without the effects. Raises RobotFileError, UnknownNameError."""
        return self.read.load(self.robot)

    @property
    def read(self) -> Reading:
        """How its file is read, the variant included."""
        return replace(self.reading, variant=self.variant or self.reading.variant)


def _known() -> tuple[Law, ...]:
    """Return what a file may hold: the laws of both channels, and curves of efforts that no law gives."""
    return (*LAWS, *EFFORT_LAWS, *CURVES, *FINE_CURVES)


def law_named(physics: str, place: Place | None = None, mechanism: Mechanism | None = None) -> Law:
    """Return the law of that name; where several share it, the one that acts at `place`. Raises UnknownNameError."""
    if physics == Calibration.physics:
        return Calibration(()) if mechanism is None else calibration_of(mechanism)
    every = _known() if mechanism is None else (*_known(), *of_markers(mechanism))
    named = [law for law in every if law.physics == physics]
    if not named:
        raise UnknownNameError("law", physics, sorted({law.physics for law in (*LAWS, *EFFORT_LAWS)}))
    if place is not None and mechanism is not None:
        for law in named:
            if place in law.places(mechanism):
                return law
    return named[0]


def place_named(physics: str, name: str, aspect: str, mechanism: Mechanism) -> Place:
    """Return the place of a law on this robot; an empty aspect may stand for the only one. Raises UnknownNameError."""
    if physics == Calibration.physics:
        return Place(name, aspect)
    law_named(physics)
    every = (*_known(), *of_markers(mechanism))
    places = [place for law in every if law.physics == physics for place in law.places(mechanism)]
    if not places:
        raise UnknownNameError(f"place of {physics}", name, [], f"{physics} cannot act on '{mechanism.name}'.")
    there = [place for place in places if place.name == name]
    if not there:
        raise UnknownNameError(f"place of {physics}", name, list(dict.fromkeys(place.name for place in places)))
    if Place(name, aspect) in there:
        return Place(name, aspect)
    aspects = [place.aspect for place in there if place.aspect]
    if aspect or len(there) != 1:
        if not aspect:
            raise InputError(
                f"{physics} at {name} acts on one of {', '.join(aspects)}; say which: {physics}@{name}:{aspects[0]}"
            )
        hint = "" if aspects else f"{physics} at {name} has none."
        raise UnknownNameError(f"aspect of {physics} at {name}", aspect, aspects, hint)
    return there[0]


def effect_named(physics: str, name: str, aspect: str, values: Mapping[str, float], mechanism: Mechanism) -> Effect:
    """Return an effect by names. Raises UnknownNameError, InputError or ParameterError for what does not fit."""
    place = place_named(physics, name, aspect, mechanism)
    return Effect(law_named(physics, place, mechanism), place, dict(values)).checked(mechanism)


def write_model(model: CorrectedModel, path: str | Path) -> None:
    """Write a corrected model as JSON; `read_model` returns an equal one. It is replaced as a whole or not at all.

    A path of a robot file is written relative to the model's folder. Raises InputError where the file cannot be written
    or an effect does not fit the robot.
    """
    write_whole({Path(path): json_lines(model_document(model, path))})


def model_document(model: CorrectedModel, path: str | Path) -> dict[str, Any]:
    """Return what the file `path` of a corrected model holds. Raises InputError as `write_model` does."""
    path = Path(path)
    mechanism = model.load().mechanism
    effects = []
    for index, effect in enumerate(model.effects):
        known = model.known_of(index)
        units = {q.name: q.unit for q in effect.checked(mechanism).law.quantities_at(effect.place, mechanism)}
        effects.append(
            {
                "physics": effect.law.physics,
                "location": effect.place.name,
                "aspect": effect.place.aspect,
                "parameters": {
                    name: {"value": float(value), "unit": units[name]}
                    | ({"interval": [float(end) for end in known.intervals[name]]} if name in known.intervals else {})
                    for name, value in effect.values.items()
                },
            }
            | ({} if known.share is None else {"share": float(known.share)})
        )
    robot = model.robot
    if robots.is_file(robots.as_path(robot)):
        robot = Path(os.path.relpath(robots.as_path(robot).resolve(), path.resolve().parent)).as_posix()
    value: dict[str, Any] = {"format": FORMAT, "version": VERSION, "robot": robot}
    if model.read.variant is not None:
        value["variant"] = model.read.variant
    if needs := needs_of(model.robot, mechanism, [effect.law for effect in model.effects]):
        value["needs"] = needs_as_json(needs)
    if reading := _reading_as_json(model.reading):
        value["reading"] = reading
    value |= {"finite_deflection": True, "effects": effects}
    if noise := model.noise.by_key:
        value["noise"] = noise
    if model.band:
        value["band"] = {name: {"value": float(cutoff), "unit": "Hz"} for name, cutoff in model.band.items()}
    if model.effort_noise:
        units = _effort_units(mechanism)
        value["effort_noise"] = {
            name: {"value": float(size), "unit": units[name]} for name, size in model.effort_noise.items()
        }
    if model.conventions:
        value["conventions"] = as_json(model.conventions)
    if model.own_by_run:
        value["own_sensors"] = {"by_run": list(model.own_by_run)}
    if model.verdict:
        value["verdict"] = model.verdict
    if model.notes:
        value["notes"] = model.notes
    if model.posterior is not None:
        value["posterior"] = model.posterior.document()
    return value


def _effort_units(mechanism: Mechanism) -> dict[str, str]:
    """Return the unit of each driven joint's effort."""
    return {name: mechanism.joint(name).effort_unit for name in mechanism.actuated}


def _reading_as_json(reading: Reading) -> dict[str, Any]:
    """Return what a reading says, by key; what it leaves to the robot file is left out."""
    found: dict[str, Any] = {}
    for name in _READING_KEYS:
        value = getattr(reading, name)
        if value is None or (not np.isscalar(value) and not len(value)):
            continue
        if isinstance(value, Mapping):
            found[name] = {key: np.asarray(item, float).tolist() for key, item in value.items()}
        elif name == "package_folders":
            found[name] = [str(robots.as_path(folder).resolve()) for folder in value]
        else:
            found[name] = list(value) if isinstance(value, Sequence) and not isinstance(value, str) else value
    return found


def read_model(path: str | Path) -> CorrectedModel:
    """Return the corrected model of a JSON file.

    Raises RecordingFileError with all problems, each with its place in the file.
    """
    path = Path(path)
    problems = Problems(path)
    values = read_json_object(path, "a corrected model, a JSON object", problems)
    problems.raise_all()
    model = _Reader(problems).model(values)
    problems.raise_all()
    return model


class _Reader(KeyReader):
    """Turns JSON into a model."""

    def text(self, values: dict[str, Any], name: str, key: str, needed: bool = False) -> str:
        """Return a text, '' where it is not needed and absent, or after reporting."""
        if name not in values:
            if needed:
                self.wrong(key, "is missing; expected a text")
            return ""
        value = values[name]
        if not isinstance(value, str) or (needed and not value.strip()):
            given = "an empty text" if isinstance(value, str) else json_kind(value)
            self.wrong(key, f"is {given}; expected a text")
            return ""
        return value

    def model(self, values: dict[str, Any]) -> CorrectedModel:
        if "findings" in values and "format" not in values:
            message = "it is a diagnosis; expected the corrected_model.json next to it"
            self.wrong("findings", message)
            self.problems.raise_all()
        if values.get("format") != FORMAT:
            self.wrong("format", f'{instead(values, "format")}; expected "{FORMAT}"')
        elif isinstance(values.get("version"), bool) or values.get("version") != VERSION:
            self.wrong("version", f"{instead(values, 'version')}; this prup_pin reads version {VERSION}")
        self.entries(values, "", _KEYS)
        if self.needs(values.get("needs", [])):
            self.problems.raise_all()  # all else would follow from it
        if values.get("finite_deflection", True) is not True:
            given = json_kind(values["finite_deflection"])
            self.wrong("finite_deflection", f"is {given}; expected true: the equilibrium is always the deformed one")
        name = self.text(values, "robot", "robot", needed=True)
        variant = self.text(values, "variant", "variant") or None
        notes = self.text(values, "notes", "notes")
        reading = self.reading(values.get("reading", {}))
        name, mechanism = self.robot(name, replace(reading, variant=variant))
        listed = values.get("effects")
        effects: list[Effect] = []
        known: list[Known] = []
        if not isinstance(listed, list):
            self.wrong("effects", f"{instead(values, 'effects')}; expected a list, which may be empty")
        else:
            for index, entry in enumerate(listed):
                effect = self.effect(entry, f"effects[{index}]", mechanism)
                if effect is not None:
                    effects.append(effect)
                    known.append(self.known(entry, f"effects[{index}]"))
        units = {} if mechanism is None else _effort_units(mechanism)
        sensors = values.get("noise")
        noise = noise_of(self, self.entries({} if sensors is None else sensors, "noise", tuple(NOISE_KEYS)))
        band = self.by_joint(values, "band", dict.fromkeys(units, "Hz"))
        effort_noise = self.by_joint(values, "effort_noise", units)
        all_read = isinstance(listed, list) and len(listed) == len(effects)
        joints = {} if mechanism is None else {"q": [j.name for j in mechanism.joints], "tau": list(mechanism.actuated)}
        written = values.get("conventions") if joints else None
        conventions = conventions_of(self, written, joints)
        own = self.entries(values.get("own_sensors", {}), "own_sensors", ("by_run",))
        by_run = own_sensors_of(self, own.get("by_run"), "own_sensors.by_run")
        return CorrectedModel(
            name,
            tuple(effects),
            variant,
            notes,
            reading,
            noise,
            band,
            conventions,
            by_run,
            effort_noise,
            tuple(known) if any(item != Known() for item in known) else (),
            read_posterior(values["posterior"], effects, self) if "posterior" in values and all_read else None,
            self.text(values, "verdict", "verdict"),
        )

    def needs(self, value: object) -> bool:
        """Return whether something that the model needs is not here, after reporting it."""
        if not isinstance(value, list):
            self.wrong("needs", f"is {json_kind(value)}; expected a list, which may be empty")
        before = len(self.problems)
        for index, item in enumerate(value if isinstance(value, list) else ()):
            key = f"needs[{index}]"
            entry = self.entries(item, key, ("package", "version", "file", "sha256", "for"))
            named, version = ("file", "sha256") if "file" in entry else ("package", "version")
            texts = [self.text(entry, name, f"{key}.{name}", needed=True) for name in (named, version)]
            things = entry.get("for")
            told = ", ".join(map(shown, things)) if isinstance(things, list) and things else "something"
            if all(texts) and (missing := lacking(Source(texts[0], texts[1], named == "file"), told)):
                self.wrong(f"{key}.{version}", missing)
        return len(self.problems) > before

    def by_joint(self, values: dict[str, Any], key: str, units: Mapping[str, str]) -> dict[str, float]:
        """Return numbers above 0 by driven joint, each in its unit; of a robot that is not known, any."""
        found = {}
        for name, item in self.entries(values.get(key, {}), key, tuple(units)).items():
            size = self.number(item, f"{key}.{shown(name)}", units.get(name))
            if size is not None and not size > 0:
                self.wrong(f"{key}.{shown(name)}.value", f"is {size:g}; expected a number above 0")
            elif size is not None:
                found[name] = size
        return found

    def reading(self, value: object) -> Reading:
        """Return how the robot's file is read."""
        entry = self.entries(value, "reading", _READING_KEYS)
        found: dict[str, Any] = {}
        for name, item in entry.items():
            key, expected = f"reading.{name}", ""
            if name == "tool":
                found[name] = self.text(entry, name, key, needed=True)
            elif name in ("actuated", "package_folders"):
                fits = isinstance(item, list) and all(isinstance(each, str) for each in item)
                expected = "" if fits else "a list of texts"
            elif name == "joint_stiffness" and is_number(item):
                pass
            else:
                listed = name == "parameters"  # some are arrays, checked where they are set
                fits = isinstance(item, dict) and all(
                    is_number(each) or (listed and isinstance(each, list)) for each in item.values()
                )
                expected = "" if fits else "an object of numbers by name"
            if expected:
                self.wrong(key, f"is {json_kind(item)}; expected {expected}")
            elif name != "tool":
                found[name] = item
        return Reading(**found) if not len(self.problems) else Reading()

    def robot(self, name: str, reading: Reading) -> tuple[str, Mechanism | None]:
        """Return the robot as `load` takes it from here, and its mechanism, or None after reporting."""
        if not name:
            return name, None
        name = named_beside(name, self.problems.path)
        try:
            return name, reading.load(name).mechanism
        except UnknownNameError as error:
            self.wrong("variant" if error.kind.startswith("variant") else "robot", str(error))
        except (PrupPinError, OSError) as error:
            self.wrong("robot", str(error))
        return name, None

    def effect(self, value: object, key: str, mechanism: Mechanism | None) -> Effect | None:
        entry = self.entries(value, key, ("physics", "location", "aspect", "parameters", "share"))
        if not isinstance(value, dict):
            return None
        before = len(self.problems)
        physics = self.text(entry, "physics", f"{key}.physics", needed=True)
        location = self.text(entry, "location", f"{key}.location", needed=True)
        aspect = self.text(entry, "aspect", f"{key}.aspect")
        given = self.entries(entry.get("parameters", {}), f"{key}.parameters", ())
        if "parameters" not in entry:
            self.wrong(f"{key}.parameters", "is missing; expected an object {…}")
        law, place = None, None
        if physics:
            try:
                law = law_named(physics)
            except UnknownNameError as error:
                self.wrong(f"{key}.physics", str(error))
        if law is not None and location and mechanism is not None:
            try:
                place = place_named(physics, location, aspect, mechanism)
            except UnknownNameError as error:
                self.wrong(f"{key}.{'aspect' if error.kind.startswith('aspect') else 'location'}", str(error))
            except InputError as error:
                self.wrong(f"{key}.aspect", str(error))
        if law is None or place is None or mechanism is None:
            for name, item in given.items():
                self.number(item, f"{key}.parameters.{shown(name)}")
            return None
        law = law_named(physics, place, mechanism)
        values = self.parameters(given, f"{key}.parameters", law, place, mechanism)
        return Effect(law, place, values) if len(self.problems) == before else None

    def known(self, entry: dict[str, Any], key: str) -> Known:
        """Return how well an effect is known; what is wrong with it is reported and left out."""
        share = entry.get("share")
        if share is not None and not is_number(share):
            self.wrong(f"{key}.share", f"is {json_kind(share)}; expected a number")
            share = None
        intervals = {}
        for name, item in entry["parameters"].items():
            ends = item.get("interval")
            if ends is None:
                continue
            if isinstance(ends, list) and len(ends) == 2 and all(map(is_number, ends)):
                intervals[name] = (float(ends[0]), float(ends[1]))
            else:
                at = f"{key}.parameters.{shown(name)}.interval"
                self.wrong(at, f"is {json_kind(ends)}; expected two numbers, the ends of a 95 % interval")
        return Known(intervals, None if share is None else float(share))

    def parameters(
        self, given: dict[str, Any], key: str, law: Law, place: Place, mechanism: Mechanism
    ) -> dict[str, float]:
        quantities = {quantity.name: quantity for quantity in law.quantities_at(place, mechanism)}
        values: dict[str, float] = {}
        for name, item in given.items():
            at = f"{key}.{shown(name)}"
            if name not in quantities:
                near = nearest_names(shown(name), list(quantities))
                self.wrong(at, f"{law.physics} at {place} has no such parameter. {near}")
                continue
            quantity = quantities[name]
            number = self.number(item, at, quantity.unit)
            if number is None:
                continue
            try:
                values[name] = quantity.check(number, f"{law.physics} at {place}")
            except ParameterError:
                self.wrong(f"{at}.value", f"is the number {number:g}; expected {quantity.expected()}")
        for name, quantity in quantities.items():
            if name not in given and name not in law.optional and not law.partial:
                self.wrong(f"{key}.{name}", f"is missing; expected a number {quantity.expected()}")
        return values

    def number(self, value: object, key: str, unit: str | None = None) -> float | None:
        """Return the value of {"value": 0.3, "unit": "1"}, or None after reporting; the unit is checked where known."""
        if not isinstance(value, dict):
            self.wrong(key, f'is {json_kind(value)}; expected an object {{"value": …, "unit": …}}')
            return None
        entry = self.entries(value, key, ("value", "unit", "interval"))
        number = entry.get("value")
        if not is_number(number):
            self.wrong(f"{key}.value", f"{instead(entry, 'value')}; expected a number{f' [{unit}]' if unit else ''}")
        if unit is not None and entry.get("unit") != unit:
            self.wrong(f"{key}.unit", f'{instead(entry, "unit")}; expected "{unit}"')
        return float(number) if is_number(number) else None
