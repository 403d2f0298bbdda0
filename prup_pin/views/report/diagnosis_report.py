"""The report of a diagnosis: one self-contained page for a colleague.

It holds everything, runs no script and fetches nothing; names of files and robots are escaped by the template engine.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...diagnosis import Diagnosis, Finding
from ...diagnosis.efforts import effort_curve_of
from ...numbers import number
from ...plugins import files
from ...recordings import Recording, Together
from ...robot import Robot
from ...spatial import WRENCH_NAMES
from ..drawing import diagnosis_figures as figures
from ..text import diagnosis_words as words
from ..text.values import clean, dimension
from .pages import Picture, page, picture

#: Beyond so many points a drawing is a picture of pixels, lest the page grow heavy.
_MOST_DRAWN = 200


def diagnosis_html(diagnosis: Diagnosis, robot: Robot, recording: Recording | Sequence[Recording]) -> str:
    """Return one self-contained HTML page on a diagnosis of `recording`, or of several."""
    recordings = [recording] if isinstance(recording, Recording) else list(recording)
    channels = words.channel_rows(diagnosis)
    begun = "robot file" if diagnosis.since is None else "earlier model"
    white = diagnosis.residuals
    plan = diagnosis.next_experiment.get("plan") or {}
    return page(
        "diagnosis_page.html",
        robot,
        diagnosis=diagnosis,
        words=words,
        figures=figures,
        response=_response,
        recording=", ".join(Path(item.path).name or "the recording" for item in recordings),
        several=len(recordings) > 1,
        begun=begun,
        facts=_facts(diagnosis, begun),
        channels=channels,
        after=[(what, after, unit) for what, _, after, unit in channels],
        measured=_measured(diagnosis, robot, recordings),
        residuals=white if white is not None and white.exists.any() else None,
        many=len(diagnosis.samples) > _MOST_DRAWN,
        plan=_plan(plan, robot),
        poses=[f">pose {count}" for count, _ in enumerate(plan.get("poses", ()), 1)],
        most=words.MOST_PARAMETERS,
        brought=[path.name for path, _ in files()],
    )


def _facts(diagnosis: Diagnosis, begun: str) -> list[tuple[str, str, str]]:
    """Return what fell from where to where; one number where nothing did."""
    before, after = (f"{number(values['heldout'], 3)} ×" for values in (diagnosis.before, diagnosis.after))
    against = f"the noise: recording against the {begun}"
    facts = [("Before", before, against), ("After", after, "the noise, on held-out samples")]
    if before == after and not diagnosis.findings:
        facts = [("Residual", after, against)]
    for name, unit, _ in diagnosis.columns:
        values = diagnosis.by_channel.get(name)
        if values is not None:
            first, last, shown = words.ends_of(values, unit)
            facts.append((f"{name.capitalize()} residual", _fell(first, last), f"{shown}, root mean square"))
    if diagnosis.efforts is not None:
        shares = diagnosis.efforts.shares["all"]
        ends = (number(100 * shares[key], 3) for key in ("rigid", "heldout"))
        facts.append(("Residual of the efforts", _fell(*ends), "% of the efforts, root mean square"))
    return facts


def _fell(before: str, after: str) -> str:
    return after if before == after else f"{before} → {after}"


def _measured(diagnosis: Diagnosis, robot: Robot, recordings: Sequence[Recording]) -> list[tuple[str, list[str]]]:
    recording = Together.of(recordings, robot.mechanism.actuated, robot.mechanism.gravity).recording
    count = len(recording)
    rows = [("Samples", [str(count), *[words.used_text(diagnosis, count)] * (len(diagnosis.samples) != count)])]
    if len(recordings) > 1:
        rows += [(name, [*texts]) for name, *texts in words.recording_rows(diagnosis)]
    rows.append(("Length", [words.length_of(diagnosis, recording)]))
    loads = np.linalg.norm(np.nan_to_num(recording.wrench).reshape(-1, 2, 3), axis=2).max(axis=0, initial=0.0)
    sizes = [f"up to {number(size, 3)} {unit}" for size, unit in zip(loads.tolist(), ("N", "N m"), strict=True)]
    moving = diagnosis.efforts is not None and not diagnosis.efforts.standing
    unloaded = f"none measured: its own weight{' and motion' if moving else ''}"
    rows.append(("Loads", sizes if recording.has_wrench else [unloaded]))
    names = [
        name for name in ("position", "rotation", "gravity", "temperature") if getattr(recording, name) is not None
    ]
    names += [f"marker {name}" for name in recording.marker_names if name in robot.mechanism.frame_names]
    if diagnosis.efforts is not None:
        names.append(f"efforts of {', '.join(diagnosis.efforts.joints)}")
    elif recording.efforts:
        names.append("efforts, not used")
    rows.append(("Channels", names or ["none"]))
    warm = recording.temperature
    if warm is not None and np.isfinite(warm).any():
        ends = dict.fromkeys(number(float(end), 3) for end in (np.nanmin(warm), np.nanmax(warm)))
        rows.append(("Temperature", [f"{' to '.join(ends)} °C"]))
    if diagnosis.since is not None:
        rows.append(("Compared with", [diagnosis.since.notes or "an earlier model"]))
    *sensors, source = words.noise_text(diagnosis)
    rows.append(("Noise, 1 σ", [*sensors, f"({source})"]))
    for item in recordings:
        if item.notes:
            rows.append(("Notes", [item.notes]))
    return rows


def _response(diagnosis: Diagnosis, finding: Finding) -> Picture | None:
    """Return the picture of what a recording asks of a finding's place; None where nothing can be drawn."""
    if finding.recovered is not None:
        return picture(figures.response_figure, finding, pixels=len(diagnosis.samples) > _MOST_DRAWN)
    curve = effort_curve_of(finding, diagnosis.efforts)
    return None if curve is None else picture(figures.effort_curve_figure, finding, curve)


def _plan(plan: dict[str, Any], robot: Robot) -> list[tuple[str, ...]]:
    """Return rows of actuator positions, then of full loads: name, unit, a number for each pose of the plan."""
    rows: list[tuple[str, ...]] = []
    poses = plan.get("poses", ())
    for name in robot.mechanism.actuated if poses else ():
        turning = dimension(robot.mechanism, name) == "angle"
        unit, factor = ("°", 180 / np.pi) if turning else ("mm", 1e3)
        rows.append((name, unit, *(number(clean(pose["actuators"][name]) * factor, 5) for pose in poses)))
    loads: list[dict[str, float]] = [
        next((item["wrench"] for item in plan["loads"] if place in item.get("poses", [place])), {})
        for place in range(len(poses))
    ]
    for index, name in enumerate(WRENCH_NAMES):
        values = [wrench.get(name, 0.0) for wrench in loads]
        if any(values):
            rows.append((name, "N" if index < 3 else "N m", *(number(value, 3) for value in values)))
    return rows
