"""The files that a diagnosis leaves in a folder: verdict, corrected model, report, next experiment."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ... import __version__
from ...diagnosis import Diagnosis
from ...errors import InputError, MissingExtraError
from ...laws import Effect
from ...laws.in_recording import lasting
from ...loading import Reading
from ...mechanism import Mechanism
from ...recordings import Recording
from ...recordings.columns import NOISE_KEYS
from ...recordings.writer import json_lines, write_whole
from ...robot import Robot
from ...simulation import CorrectedModel, as_recorded, write_model
from ..text.diagnosis_words import verdict_text
from .as_json import dump
from .diagnosis_json import diagnosis_as_json

__all__ = ["MODEL", "PLAN", "REPORT", "VERDICT", "check_before", "missing_for_report", "write_diagnosis"]

VERDICT, MODEL, REPORT, PLAN = "diagnosis.json", "corrected_model.json", "report.html", "next_experiment.json"


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
    while not there.exists() and there != there.parent:
        there = there.parent
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
    it was read; the corrected model names both. Each file is replaced as a whole or not at all; a report or a plan of
    an earlier diagnosis does not stay. Raises InputError where the folder cannot be written, MissingExtraError where
    what makes the report is not installed.
    """
    adapted = as_recorded(robot, recording)
    robot, understood = adapted.robot, adapted.read(reading or Reading())
    text = None
    if report:
        from .diagnosis_report import diagnosis_html

        text = diagnosis_html(diagnosis, robot, recording)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--out: cannot make the folder '{folder}': {error.strerror}") from error
    model = folder / MODEL
    recordings = [recording] if isinstance(recording, Recording) else list(recording)
    names = ", ".join(Path(item.path).name for item in recordings)
    notes = f"diagnosis of {names}: {verdict_text(diagnosis)}"
    effects = tuple(_inside(effect, robot.mechanism) for effect in lasting(diagnosis.effects, robot.mechanism))
    write_model(CorrectedModel(robot_name, effects, understood.variant, notes, understood), model)
    plan = _plan(diagnosis, recordings[0], json.loads(model.read_text(encoding="utf-8"))["robot"])
    document = diagnosis_as_json(diagnosis, robot, __version__)
    document["next_experiment"] = {"why": diagnosis.next_experiment.get("why", ""), "plan": plan}
    files: dict[Path, Iterable[str]] = {folder / VERDICT: (dump(document) + "\n",)}
    if text is not None:
        files[folder / REPORT] = (text,)
    if plan:
        files[folder / PLAN] = json_lines(plan)
    write_whole(files)
    for name in (REPORT, PLAN):
        if folder / name not in files:
            (folder / name).unlink(missing_ok=True)
    verdict, *others = files
    return [verdict, model, *others]


def _inside(effect: Effect, mechanism: Mechanism) -> Effect:
    """Return the effect with values that a fit left on a bound, or a rounding beyond it, just inside."""
    values = dict(effect.values)
    for quantity in effect.law.quantities_at(effect.place, mechanism):
        if quantity.name not in values:
            continue
        low = np.nextafter(quantity.lower, np.inf) if quantity.positive else quantity.lower
        values[quantity.name] = float(np.clip(values[quantity.name], low, quantity.upper))
    return replace(effect, values=values)


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
