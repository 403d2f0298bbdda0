"""Logs, simulations, diagnoses, calibrations and exported models as text."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console

from ...laws import Effect
from ...laws.drawn import load_units
from ...laws.efforts.effort_sensor import EffortUnit
from ...numbers import counted, number, readable_unit, some, uncertain
from ...recordings import Recording, suspicions
from ...recordings.columns import AS_LOGGED, unit_of
from ...robot import Robot
from ...simulation import Agreement, Prediction, compare
from . import diagnosis_words as words
from .terminal import bullets, heading, listed, paragraph, show_table, title

if TYPE_CHECKING:  # the command line begins without them
    from ...diagnosis import Diagnosis
    from ...diagnosis.calibration import Calibration
    from ...diagnosis.diagnosis import Detectable
    from ...export import Exported
    from ...imports import Conversion, Log, LogMap


def print_log(out: Console, log: Log) -> None:
    """Print what a log holds, stream by stream."""
    title(out, log.path)
    for stream in log.streams:
        size = f"{counted(len(stream), 'row')}, {counted(len(stream.columns), 'column')}"
        listed(out, "", [f"{stream.name}: {size} of numbers"])


def print_conversion(out: Console, log: Log, plan: LogMap, done: Conversion) -> None:
    """Print a recording column by column beside the columns it came from, and the remarks."""
    from ...imports.map import ROTATIONS
    from ...imports.units import SI_WORDS, dimension_of

    print_log(out, log)
    recording = done.recording
    span = recording.time[-1] - recording.time[0]
    steps = np.diff(recording.time)
    rate = 1 / float(np.median(steps)) if len(steps) else 0.0
    sizes = f"{counted(len(recording), 'row')}, {number(float(span), 4)} s, {number(rate, 4)} rows a second"
    listed(out, "recording", [sizes])
    heading(out, "Columns", "(SI = sign x scale x value + offset)")
    rows, there = [], dict(recording.columns())
    for name, column in plan.columns.items():
        values = there.get(name, np.zeros(0))  # none of one that motors took the place of
        known = values[np.isfinite(values)]
        ends = [number(float(end), 4) for end in (known.min(), known.max())] if len(known) else ["", ""]
        factor = f" x {number(column.sign * column.scale, 4)}" if column.sign * column.scale != 1 else ""
        dimension = dimension_of(column.unit.name)
        si = SI_WORDS[dimension] if dimension is not None else unit_of(name)
        rows.append((name, column.source, column.unit.name + factor, *ends, si))
    show_table(out, ("recording", "column of the log", "in", ">from", ">to", ""), rows)
    for name, rotation in plan.rotations.items():
        angles = f" in {rotation.unit.name}" if ROTATIONS[rotation.manner] == 3 else ""
        paragraph(out, f"{name} from {', '.join(rotation.sources)}{angles}, as {rotation.manner}.", "- ")
    for group in plan.motors:
        paragraph(out, f"{', '.join(group.joints)} from the motors {', '.join(group.names)} by their matrix.", "- ")
    odd = [*done.remarks, *suspicions(recording), *recording.remarks]
    bullets(out, "Remarks", odd)
    if names := (*done.unused, *log.left_out):
        heading(out, "Not used")
        listed(out, "", names)


# -- a simulation ------------------------------------------------------------------------------------------------------


#: So many row numbers are listed.
_ROWS = 8


def print_simulation(
    out: Console,
    robot: Robot,
    effects: Sequence[Effect],
    recording: Recording,
    prediction: Prediction,
    notes: Sequence[str] = (),
    effort_noise: Mapping[str, float] | None = None,
    band: Mapping[str, float] | None = None,
    source: str = "",
) -> None:
    """Print the closing summary of a simulation; `recording` holds what was measured, if anything was.

    band: as `compare` takes it. source: the file that the effects are from, where they are from one.
    """
    how = "the efforts of its motion" if not prediction.position.shape[1] else "loaded, in its deformed position"
    title(out, f"{robot.name}, {how}")
    listed(out, "with", effects_told(effects, source), "; ")
    failures = prediction.failures
    failed = sum(len(rows) for rows in failures.values())
    good = f"{len(prediction) - failed} predicted" if failed else "all predicted"
    listed(out, "rows", [f"{len(prediction)}, {good}"])
    print_failures(out, failures, prediction.reasons)
    found = compare(recording, prediction, effort_noise, robot.mechanism, band)
    if found:
        _print_agreement(out, robot, found, _in_own_units(effects))
        loads = recording.noise.force or recording.noise.moment
        if loads and any(item.noise is not None and not item.channel.startswith("effort ") for item in found):
            paragraph(
                out,
                "(the noise is the pose sensor's alone; a diagnosis counts what the wrench sensor's noise makes of the "
                "prediction beside it)",
            )
        if band and any(item.share is not None for item in found):
            paragraph(
                out,
                "(% of the effort as a diagnosis says it: below the frequencies at which an effort is compared, where "
                "the joint moves; all else of all rows as they were measured)",
            )
    odd = [*suspicions(recording), *recording.remarks, *prediction.remarks, *notes]
    bullets(out, "Remarks", odd)


def effect_text(effect: Effect) -> str:
    """Return an effect as it is typed; of many values only how many."""
    aspect = f":{effect.place.aspect}" if effect.place.aspect else ""
    values = " ".join(f"{name}={number(value, 6)}" for name, value in effect.values.items())
    if len(effect.values) > 12:  # a calibration's
        values = f"({len(effect.values)} values)"
    return f"{effect.law.physics}@{effect.place.name}{aspect} {values}".strip()


def effects_told(effects: Sequence[Effect], source: str = "") -> list[str]:
    """Return effects as they are typed, or of many how many there are of each physics, and where they stand."""
    if len(effects) <= 6:
        return [effect_text(effect) for effect in effects] or ["nothing added to the robot file"]
    kinds = Counter(effect.law.physics.replace("_", " ") for effect in effects)
    counts = [f"{name} at {counted(count, 'place')}" for name, count in kinds.items()]
    return [*counts[:-1], f"{counts[-1]} ({len(effects)} effects{f' in {source}' if source else ''})"]


def _in_own_units(effects: Sequence[Effect]) -> frozenset[str]:
    """Return the joints whose drives report efforts in a unit of their own."""
    from ...diagnosis.efforts.shares import in_another_unit

    units = (effect for effect in effects if isinstance(effect.law, EffortUnit))
    return frozenset(effect.place.name for effect in units if in_another_unit(1 + effect.values["gain"]))


def print_failures(out: Console, failures: Mapping[str, np.ndarray], reasons: Mapping[str, str]) -> None:
    """Print which rows, counted from 0, have no answer, as lines of the file, whose first one holds names, and why."""
    for word, rows in failures.items():
        first = ", ".join(str(row + 2) for row in rows[:_ROWS].tolist())
        more = ", …" if len(rows) > _ROWS else ""
        listed(out, word, [f"{counted(len(rows), 'row')}: line{'s' if len(rows) > 1 else ''} {first}{more}"])
        if word in reasons:
            paragraph(out, f"line {rows[0] + 2}: {reasons[word]}", "  ")


def _print_agreement(out: Console, robot: Robot, found: Sequence[Agreement], own: Collection[str]) -> None:
    heading(out, "Measured less predicted", "(root mean square)")
    efforts = any(item.share is not None for item in found)
    alone = all(item.channel.startswith("effort ") for item in found)
    rows = []
    for item in found:
        unit, factor = _unit(robot, item.channel, own)
        noise = "not known" if item.noise is None else number(factor * item.noise, 3)
        multiple = "-" if item.in_noise is None else number(item.in_noise, 3)
        channel = item.channel.removeprefix("effort ") if alone else item.channel
        cells = [channel, number(factor * item.rms, 4), unit, noise, multiple]
        rows.append((*cells, *["" if item.share is None else number(100 * item.share, 3)] * efforts))
    columns = ("effort" * alone, ">RMS", "unit", ">noise", ">× noise", *[">% of the effort"] * efforts)
    show_table(out, columns, rows)


def _unit(robot: Robot, channel: str, own: Collection[str]) -> tuple[str, float]:
    """Return the unit in which a channel is shown, and its factor; own: joints whose efforts are in another one."""
    kind, _, name = channel.partition(" ")
    if kind == "effort" and name in own:
        return AS_LOGGED, 1.0
    if kind == "effort":
        return robot.mechanism.joint(name).effort_unit, 1.0
    return ("µrad", 1e6) if channel.endswith("rotation") else ("µm", 1e6)


# -- a diagnosis -------------------------------------------------------------------------------------------------------


_SIZES = "from which size, where it shows best to where it shows least"
#: Of what would have been seen so many kinds are listed.
_MOST_SEEN = 8


def print_diagnosis(
    out: Console, robot: Robot, recording: Recording | Sequence[Recording], diagnosis: Diagnosis
) -> None:
    """Print the verdict, the findings with intervals, the residuals before and after, doubts and remarks."""
    for premise in diagnosis.premises:
        title(out, premise)
    title(out, words.verdict_text(diagnosis))
    out.print()
    listed(out, "robot", [robot.name])
    recordings = [recording] if isinstance(recording, Recording) else list(recording)
    if len(recordings) > 1:
        for parts in words.recording_rows(diagnosis):
            listed(out, "recording", parts, ", ")
    else:
        held, samples = words.length_of(diagnosis, recordings[0]), len(recordings[0])
        listed(out, "recording", [held, counted(samples, "sample"), words.used_text(diagnosis, samples)], ", ")
    listed(out, "noise", words.noise_text(diagnosis), ", ")
    since = diagnosis.since
    if since is not None:
        listed(out, "compared with", [since.notes or "an earlier model"])
    for what, findings in words.finding_groups(diagnosis).items():
        heading(out, what)
        for index, finding in findings:
            paragraph(out, words.finding_text(finding), f"{index}  ")
            for text in words.finding_lines(diagnosis, finding):
                paragraph(out, text, "   ")
            if finding.curve is not None:
                load, deformation = load_units(robot.mechanism, finding.curve.module, finding.curve.component)
                columns = (f">load [{load}]", f">deformation [µ{deformation}]")
                show_table(out, columns, words.curve_rows(finding.curve), indent=5)
    for proposal in diagnosis.proposals:
        heading(out, f"A formula for what is left at {proposal.joint}")
        for text in words.proposal_lines(proposal):
            paragraph(out, text)
    if diagnosis.judged:
        bullets(out, "Proposed formulas", [str(item) for item in diagnosis.judged])
    heading(out, "Measured less simulated", "(root mean square)")
    show_table(out, ("", ">before", ">after", ""), words.channel_rows(diagnosis))
    if rows := words.effort_rows(diagnosis):
        heading(out, "Efforts, joint by joint")
        show_table(out, words.EFFORT_COLUMNS, rows)
        if note := words.multiple_text(diagnosis):
            paragraph(out, f"({note})")
    if since is None:
        bullets(out, "Corrected most within tolerances", words.corrections(diagnosis.calibration))
    else:
        if since.values:
            heading(out, "What was found before")
            names = ("", ">then", ">now", ">changed by (95 %)", ">would show from")
            show_table(out, names, words.then_and_now_rows(since))
        others = [f"{physics}: {sizes}" for physics, sizes in words.seen_rows(since.seen)]
        bullets(out, "What else would have been seen", others, f"({_SIZES})")
    shown = [f"{physics}: {sizes}" for physics, sizes in words.visible_rows(diagnosis.seen)]
    if more := shown[_MOST_SEEN:]:
        shown[_MOST_SEEN:] = [f"{counted(len(more), 'other kind')} of effects that show better still"]
    bullets(out, "What would have been seen", shown, f"({_SIZES}; the hardest to see first)")
    print_hidden(out, diagnosis.not_detectable)
    why = diagnosis.next_experiment.get("why")
    if why:
        heading(out, "Next experiment")
        paragraph(out, str(why))
    bullets(out, "Remarks", diagnosis.remarks)


def print_hidden(out: Console, hidden: Sequence[Detectable]) -> None:
    """Print what data could not show and another test might, and the size from which they would; the rest by name."""
    near, far = words.within_reach(hidden)
    rows = words.hidden_rows(near)
    texts = [f"{physics}: {needed}{f', at {where}' if where else ''}" for physics, where, needed in rows]
    if far:
        texts.append(f"{', '.join(far)}: at no usual size")
    bullets(out, "What these data could not show", texts, "(and from which size they would)")


# -- a calibration -----------------------------------------------------------------------------------------------------


#: Parameters that are shown: the best known ones, and all that lie far from the robot file.
_SHOWN, _FAR = 20, 2.0
#: What is learned less than this was not seen.
_UNSEEN = 0.01


def print_calibration(out: Console, robot: Robot, recordings: Sequence[Recording], found: Calibration) -> None:
    """Print before and after, what was learned, what these data tell only together and what they never saw."""
    before, after = number(found.nominal, 3), number(found.calibrated, 3)
    end = (
        "which is noise" if found.is_explained else "more than noise: the model lacks something, see prup-pin diagnose"
    )
    title(out, f"The drawing leaves {before} times the noise; within its tolerances it leaves {after}, {end}.")
    out.print()
    listed(out, "robot", [robot.name])
    for recording in recordings:
        name = [Path(recording.path).name] if len(recordings) > 1 else []
        listed(out, "recording", [*name, counted(len(recording), "sample")], ", ")
    listed(out, "used", [counted(found.samples, "sample")])
    listed(out, "parameters", [f"{len(found.parameters)} that may be off"], ", ")
    if acting := [effect.statement(robot.mechanism) for effect in found.effects[1:]]:
        listed(out, "acting", acting)
    heading(out, "What was learned", "(off: in tolerances; known: share of the tolerance that is left)")
    rows = []
    known = [item for item in found.parameters if item.learned > _UNSEEN]
    for place, item in enumerate(known):
        if place < _SHOWN or abs(item.x) > _FAR:
            unit, factor = readable_unit(largest := max(abs(item.value), item.sd), item.deviation.unit)
            if unit in ("", "1") and largest < 1e-3:
                unit, factor = "ppm", 1e6
            value = uncertain(factor * item.value, factor * item.sd)
            rows.append((item.name, value, unit, f"{item.x:+.2f}", f"{number(100 * item.share, 2)} %"))
    show_table(out, ("", ">calibrated", "", ">off", ">known"), rows)
    bullets(out, "Corrected most", words.corrections(found.parameters))
    bullets(out, "Told only together", [", ".join(group) for group in found.twins])
    unseen = [item.name for item in found.parameters if item.learned <= _UNSEEN]
    alike: dict[str, list[str]] = {}
    for parameter in unseen:
        owner, _, kind = parameter.rpartition(".")
        alike.setdefault(kind, []).append(owner)
    texts = [f"{kind} of {', '.join(some(owners, 3))}" for kind, owners in alike.items()]
    bullets(out, "Never seen by these data", texts, f"({len(unseen)} parameters)")
    bullets(out, "Remarks", found.remarks)


# -- an exported model: what the robot file holds, and what it leaves out --------------------------------------------


#: Values of an effect that are listed; the file's comment holds all of them.
_LISTED_VALUES = 6


def print_exported(out: Console, made: Exported) -> None:
    """Print which effects the file holds, and of what is left out how much it explained."""
    heading(out, "In the file", "" if made.said else "  the robot as it was drawn")
    if made.said:
        rows = []
        for item in made.said:
            more = len(item.values) - _LISTED_VALUES
            values = [*item.values[:_LISTED_VALUES], *[f"and {more} more"] * (more > 0)]
            rows.append((item.physics, item.place, "\n".join(values)))
        show_table(out, ("physics", "place", "values"), rows)
    if made.left_out:
        heading(out, "Left out", "  and what its effect explained of the held-out squared residual")
        explained = ["unknown" if x.share is None else f"{number(100 * x.share, 3)} %" for x in made.left_out]
        lost = [(x.physics, x.place, x.what, share) for x, share in zip(made.left_out, explained, strict=True)]
        show_table(out, ("physics", "place", "what", ">explained"), lost)
    if made.remarks:
        heading(out, "To know")
        listed(out, "", made.remarks)
