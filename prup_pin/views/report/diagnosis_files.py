"""The files that a diagnosis leaves in a folder: verdict, corrected model, report, next experiment."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ... import __version__
from ...diagnosis import Diagnosis
from ...diagnosis.conventions import as_diagnosed
from ...errors import InputError, MissingExtraError
from ...laws import Effect
from ...laws.in_recording import lasting
from ...loading import Reading
from ...mechanism import Mechanism
from ...recordings import Convention, Noise, Recording
from ...recordings.columns import NOISE_KEYS
from ...recordings.writer import check_replaceable, json_lines, text_of, write_folder
from ...robot import Robot
from ...simulation import CorrectedModel, as_recorded
from ...simulation.model_file import model_document
from ..text.diagnosis_words import verdict_text
from .as_json import diagnosis_as_json, dump

VERDICT, MODEL, REPORT, PLAN = "diagnosis.json", "corrected_model.json", "report.html", "next_experiment.json"
FILES = (VERDICT, MODEL, REPORT, PLAN)


def missing_for_report() -> str:
    """Return what keeps the report from being made, in words; nothing where it can be made."""
    try:
        from .diagnosis_report import page

        page()
    except MissingExtraError as error:
        return str(error)
    return ""


def check_before(folder: Path, recordings: Path | Sequence[Path]) -> None:
    """Raise InputError, before anything is computed, where the files cannot be written."""
    there = folder
    try:
        while not there.exists() and there != there.parent:
            there = there.parent
        for name in FILES:
            check_replaceable(folder / name)
    except InputError as error:
        raise InputError(f"--out: {error}") from error
    except OSError as error:
        raise InputError(f"--out: cannot write to '{folder}': {error.strerror or error}") from error
    if not there.is_dir():
        raise InputError(f"--out: '{there}' is not a folder; give a folder for {VERDICT}, {MODEL}, {REPORT}")
    if not os.access(there, os.W_OK | os.X_OK):
        raise InputError(f"--out: cannot write to '{there}'")
    for recording in [recordings] if isinstance(recordings, Path) else recordings:
        for name in (VERDICT, MODEL, PLAN):
            if (folder / name).resolve() == recording.with_suffix(".json").resolve():
                raise InputError(
                    f"--out: '{folder / name}' would replace the JSON file beside the recording; choose another"
                )


def write_diagnosis(
    diagnosis: Diagnosis,
    robot: Robot,
    recording: Recording | Sequence[Recording],
    folder: Path,
    *,
    robot_name: str,
    reading: Reading | None = None,
    report: bool = True,
) -> list[Path]:
    """Write the files of a diagnosis and return their paths, the verdict's first.

    recording: the one that was diagnosed, or all of them. robot_name, reading: what this robot is loaded from, and how
    it was read; the corrected model names both. The files are all of this diagnosis or all as they were; a report or a
    plan of an earlier one does not stay. Raises InputError where the folder cannot be written, MissingExtraError where
    what makes the report is not installed.
    """
    recording = as_diagnosed(diagnosis, robot, declared := _listed(recording))
    adapted = as_recorded(robot, recording)
    robot, understood = adapted.robot, adapted.read(reading or Reading())
    text = None
    if report:
        from .diagnosis_report import diagnosis_html

        text = diagnosis_html(diagnosis, robot, recording)
    model = folder / MODEL
    recordings = recording
    names = ", ".join(Path(item.path).name for item in recordings)
    notes = text_of(f"diagnosis of {names}: {verdict_text(diagnosis)}")
    effects = tuple(_inside(effect, robot.mechanism) for effect in lasting(diagnosis.effects, robot.mechanism))
    efforts = diagnosis.efforts
    band = {} if efforts is None or efforts.standing else efforts.band
    made = CorrectedModel(
        robot_name,
        effects,
        understood.variant,
        notes,
        understood,
        _noise(diagnosis),
        band,
        _conventions(diagnosis, declared),
        diagnosis.own_by_run,
        _effort_noise(diagnosis),
    )
    corrected = model_document(made, model)
    plan = _plan(diagnosis, recordings[0], corrected["robot"])
    document = diagnosis_as_json(diagnosis, robot, __version__)
    document["next_experiment"] = {"why": diagnosis.next_experiment.get("why", ""), "plan": plan}
    files: dict[str, Iterable[str]] = {VERDICT: (dump(document) + "\n",), MODEL: json_lines(corrected)}
    if text is not None:
        files[REPORT] = (text_of(text),)
    if plan:
        files[PLAN] = json_lines(plan)
    try:
        write_folder(folder, files, FILES)
    except InputError as error:
        raise InputError(f"--out: {error}") from error
    return [folder / name for name in files]


def _listed(recording: Recording | Sequence[Recording]) -> list[Recording]:
    return [recording] if isinstance(recording, Recording) else list(recording)


def _conventions(diagnosis: Diagnosis, declared: Sequence[Recording]) -> tuple[Convention, ...]:
    """Return how all logs of the device were written, as declared and as found; nothing where they differ."""
    found = diagnosis.conventions or ((),) * len(declared)
    every = {(*item.conventions, *own) for item, own in zip(declared, found, strict=True)}
    return every.pop() if len(every) == 1 else ()


def _inside(effect: Effect, mechanism: Mechanism) -> Effect:
    """Return the effect with values that a fit left on a bound, or a rounding beyond it, just inside."""
    values = dict(effect.values)
    for quantity in effect.law.quantities_at(effect.place, mechanism):
        if quantity.name not in values:
            continue
        values[quantity.name] = float(np.clip(values[quantity.name], quantity.lowest, quantity.upper))
    return replace(effect, values=values)


def _noise(diagnosis: Diagnosis) -> Noise:
    """Return the noise that the diagnosis knew, declared or estimated; of what it did not, nothing."""
    if math.isnan(diagnosis.after["fit"]):
        return Noise()
    found = diagnosis.noise
    return Noise(found.position or None, found.rotation or None, found.force or None, found.moment or None)


def _effort_noise(diagnosis: Diagnosis) -> dict[str, float]:
    """Return the noise of each joint's effort, where it was not declared but told by the recording."""
    efforts = diagnosis.efforts
    if efforts is None or efforts.declared:
        return {}
    sizes = zip(efforts.joints, efforts.noise.tolist(), strict=True)
    return {name: size for name, size in sizes if math.isfinite(size) and size > 0}


def _plan(diagnosis: Diagnosis, recording: Recording, robot: str) -> dict[str, Any]:
    """Return the next experiment as a test plan; empty where there is none."""
    plan = dict(diagnosis.next_experiment.get("plan") or {})
    if not plan.get("poses"):
        return {}
    noise = {key: getattr(recording.noise, name) for key, name in NOISE_KEYS.items()}
    declared = {key: value for key, value in noise.items() if value is not None}
    plan |= {"robot": robot, "notes": str(diagnosis.next_experiment.get("why", ""))}
    if recording.tolerances.declared:
        plan["tolerances"] = dict(recording.tolerances.declared)
    return {**plan, "noise": declared} if declared else plan
