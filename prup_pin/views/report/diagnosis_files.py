"""The files that a diagnosis leaves in a folder: verdict, corrected model, report, next experiment."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from ... import __version__
from ...diagnosis import Diagnosis
from ...diagnosis.conventions import as_diagnosed
from ...diagnosis.corrected import corrected_model, planned
from ...errors import InputError
from ...files import check_folder_for, json_lines, text_of, write_folder
from ...loading import Reading
from ...recordings import Recording
from ...robot import Robot
from ...simulation import as_recorded
from ...simulation.model_file import model_document
from ..text.diagnosis_words import verdict_text
from .as_json import diagnosis_as_json, dump

VERDICT, MODEL, REPORT, PLAN = "diagnosis.json", "corrected_model.json", "report.html", "next_experiment.json"
FILES = (VERDICT, MODEL, REPORT, PLAN)


def check_before(folder: Path, recordings: Sequence[Path]) -> None:
    """Raise InputError, before anything is computed, where a file would replace what it must not."""
    check_folder_for(folder, FILES)
    for recording in recordings:
        for name in (VERDICT, MODEL, PLAN):
            if (folder / name).resolve() == recording.with_suffix(".json").resolve():
                raise InputError(f"--out: '{folder / name}' would replace the recording's JSON file; choose another")


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
    plan of an earlier one does not stay. Raises InputError where the folder cannot be written.
    """
    declared = [recording] if isinstance(recording, Recording) else list(recording)
    recordings = as_diagnosed(diagnosis, robot, declared)
    adapted = as_recorded(robot, recordings)
    robot, understood = adapted.robot, adapted.read(reading or Reading())
    text = None
    if report:
        from .diagnosis_report import diagnosis_html

        text = diagnosis_html(diagnosis, robot, recordings)
    names = ", ".join(Path(item.path).name for item in recordings)
    notes = text_of(f"diagnosis of {names}: {verdict_text(diagnosis)}")
    made = corrected_model(diagnosis, robot, declared, robot_name, understood, notes)
    corrected = model_document(made, folder / MODEL)
    plan = planned(diagnosis, recordings[0], corrected["robot"])
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
