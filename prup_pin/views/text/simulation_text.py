"""Effects as they are typed; a simulation and a compensation as text for a terminal."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence

import numpy as np
from rich.console import Console
from rich.text import Text

from ...compensation import Compensation
from ...errors import InputError, UnknownNameError
from ...laws import Effect
from ...laws.efforts.effort_sensor import EffortUnit
from ...mechanism import Mechanism
from ...numbers import counted, number
from ...recordings import Recording, suspicions
from ...recordings.columns import AS_LOGGED
from ...robot import Robot
from ...simulation import Agreement, Prediction, compare
from ...simulation.model_file import law_named, place_named
from .quantities import UNITS, parse_quantity
from .terminal import bullets, heading, listed, make_table, paragraph, print_table

#: So many row numbers are listed.
_SHOWN = 8
#: More effects than this are counted by their physics.
_MOST_EFFECTS = 6
#: More values than this are counted, not written out: a calibration's.
_MOST_VALUES = 12


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
    out.print(Text(f"{robot.name}, {how}", style="bold"))
    listed(out, "with", _effects_told(effects, source), "; ")
    _print_rows(out, prediction)
    found = compare(recording, prediction, effort_noise, robot.mechanism, band)
    if found:
        _print_agreement(out, robot, found, _in_own_units(effects))
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
    if len(effect.values) > _MOST_VALUES:
        values = f"({len(effect.values)} values)"
    return f"{effect.law.physics}@{effect.place.name}{aspect} {values}".strip()


def _effects_told(effects: Sequence[Effect], source: str) -> list[str]:
    """Return effects as they are typed, or of many how many there are of each physics, and where they stand."""
    if len(effects) <= _MOST_EFFECTS:
        return [effect_text(effect) for effect in effects] or ["nothing added to the robot file"]
    kinds = Counter(effect.law.physics.replace("_", " ") for effect in effects)
    counts = [f"{name} at {counted(count, 'place')}" for name, count in kinds.items()]
    return [*counts[:-1], f"{counts[-1]} ({len(effects)} effects{f' in {source}' if source else ''})"]


def _in_own_units(effects: Sequence[Effect]) -> frozenset[str]:
    """Return the joints whose drives report efforts in a unit of their own, where none does in N m or N."""
    gains = {e.place.name: 1 + e.values["gain"] for e in effects if isinstance(e.law, EffortUnit)}
    if not gains:
        return frozenset()
    from ...diagnosis.efforts.conventions import gains_apart  # heavy, and most simulations have no gains

    return frozenset(gains) if gains_apart(gains) else frozenset()


def _print_rows(out: Console, prediction: Prediction) -> None:
    failures = prediction.failures
    failed = sum(len(rows) for rows in failures.values())
    good = f"{len(prediction) - failed} predicted" if failed else "all predicted"
    listed(out, "rows", [f"{len(prediction)}, {good}"])
    print_failures(out, failures, prediction.reasons)


def print_failures(out: Console, failures: Mapping[str, np.ndarray], reasons: Mapping[str, str]) -> None:
    """Print which rows, counted from 0, have no answer, as lines of the file, whose first one holds names, and why."""
    for word, rows in failures.items():
        first = ", ".join(str(row + 2) for row in rows[:_SHOWN].tolist())
        more = ", …" if len(rows) > _SHOWN else ""
        listed(out, word, [f"{counted(len(rows), 'row')}: line{'s' if len(rows) > 1 else ''} {first}{more}"])
        if word in reasons:
            paragraph(out, f"line {rows[0] + 2}: {reasons[word]}", "  ")


def _print_agreement(out: Console, robot: Robot, found: Sequence[Agreement], own: Collection[str]) -> None:
    heading(out, "Measured less predicted", "(root mean square)")
    efforts = any(item.share is not None for item in found)
    columns = [("", "left"), ("RMS", "right"), ("unit", "left"), ("noise", "right"), ("RMS / noise", "right")]
    table = make_table(*columns, *[("% of the effort", "right")] * efforts)
    for item in found:
        unit, factor = _unit(robot, item.channel, own)
        noise = "not known" if item.noise is None else number(factor * item.noise, 3)
        multiple = "-" if item.in_noise is None else number(item.in_noise, 3)
        cells = [item.channel, number(factor * item.rms, 4), unit, noise, multiple]
        table.add_row(*cells, *["" if item.share is None else number(100 * item.share, 3)] * efforts)
    print_table(out, table)


def _unit(robot: Robot, channel: str, own: Collection[str]) -> tuple[str, float]:
    """Return the unit in which a channel is shown, and its factor; own: joints whose efforts are in another one."""
    kind, _, name = channel.partition(" ")
    if kind == "effort" and name in own:
        return AS_LOGGED, 1.0
    if kind == "effort":
        return ("N", 1.0) if robot.mechanism.joint(name).slides else ("N m", 1.0)
    return ("µrad", 1e6) if channel.endswith("rotation") else ("µm", 1e6)


# -- effects as they are typed -----------------------------------------------------------------------------------------


_FORM = re.compile(r"\s*(?P<physics>[^@\s]+)@(?P<place>[^@=]*?)(?P<values>(?:\s+[^\s=]+=\S+)*)\s*")
_EXPECTED = "expected 'physics@place[:aspect] name=value …', for example 'backlash@leg2/ball_nut half_gap=30um …'"


def parse_effect(text: str, mechanism: Mechanism, option: str = "--effect") -> Effect:
    """Return an effect on this robot; values are SI, or carry a unit. Raises InputError with what was expected."""
    match = _FORM.fullmatch(text)
    if match is None:
        raise InputError(f"{option} '{text}': {_EXPECTED}; `prup-pin laws` lists them")
    physics, typed = match["physics"], match["place"].strip()
    try:
        law_named(physics)
        name, _, aspect = _split(typed, physics, mechanism)
        place = place_named(physics, name, aspect, mechanism)
        law = law_named(physics, place, mechanism)
        quantities = {quantity.name: quantity for quantity in law.quantities_at(place, mechanism)}
        values: dict[str, float] = {}
        for assignment in match["values"].split():
            key, _, value = assignment.partition("=")
            if key not in quantities:
                raise UnknownNameError(f"parameter of {physics}", key, list(quantities))
            if key in values:
                raise InputError(f"{key} is given twice")
            values[key] = parse_quantity(value, _dimension(quantities[key].unit), option, text, text.index(assignment))
        missing = [item for item in quantities.values() if item.name not in {*values, *law.optional}]
        if missing:
            usual = law.starts(place, mechanism)[0]
            listed = ", ".join(
                f"{item.name} ({item.expected()}; a fit starts at {number(usual[item.name])})" for item in missing
            )
            raise InputError(f"missing {listed}")
        return Effect(law, place, values).checked(mechanism)
    except InputError as error:
        message = str(error)
        raise InputError(message if message.startswith(option) else f"{option} '{text}': {message}") from None


def _split(typed: str, physics: str, mechanism: Mechanism) -> tuple[str, str, str]:
    """Return name and aspect of 'leg1/R_lambda:tilting'; names of a robot may hold a colon themselves."""
    try:
        place_named(physics, typed, "", mechanism)
        return typed, "", ""
    except InputError:
        name, colon, aspect = typed.rpartition(":")
        return (name.strip(), colon, aspect.strip()) if colon else (typed, "", "")


def _dimension(unit: str) -> str:
    plain = unit.replace(" ", "")
    return next((name for name, units in UNITS.items() if plain in units), "number")


# -- a compensation: what the path missed, what the commands leave -----------------------------------------------------


#: What is smaller is rounding [um, urad].
_ROUNDING = 1e-2


def print_compensation(out: Console, robot: Robot, effects: Sequence[Effect], found: Compensation) -> None:
    """Print what the tool missed before and after, and the largest correction of each actuator."""
    out.print(Text(f"{robot.name}, loaded, put where it was wanted", style="bold"))
    listed(out, "with", [effect_text(effect) for effect in effects] or ["nothing added to the robot file"], "; ")
    count = found.status.count("ok")
    good = "all compensated" if count == len(found) else f"{count} compensated"
    listed(out, "rows", [f"{len(found)}, {good}", f"{found.passes} passes of the loaded robot"], "; ")
    print_failures(out, found.failures, found.reasons)
    heading(out, "What the tool misses", "(root mean square and largest of all rows, by the loaded robot)")
    table = make_table(
        ("", "left"), ("before", "right"), ("largest", "right"), ("after", "right"), ("largest", "right"), ("", "left")
    )
    for column, (name, unit) in enumerate(zip(found.names, found.units, strict=True)):
        both = np.isfinite(found.after[:, column])
        cells = []
        for errors in (found.before, found.after):
            error = 1e6 * errors[both, column]
            sizes = (np.sqrt(np.mean(error**2)), np.abs(error).max()) if len(error) else (np.nan, np.nan)
            cells += [f"< {_ROUNDING:g}" if size < _ROUNDING else number(float(size), 4) for size in sizes]
        table.add_row(name, *cells, "µm" if unit == "m" else "µrad")
    print_table(out, table)
    moved = [
        f"{name} by up to {_largest(found, name)} {'mm' if robot.mechanism.joint(name).unit == 'm' else 'mrad'}"
        for name in robot.mechanism.actuated
    ]
    listed(out, "moved", moved, ", ")
    remarks = [*found.path.recording.remarks, *found.remarks]
    bullets(out, "Remarks", remarks)


def _largest(found: Compensation, name: str) -> str:
    """Return the largest correction of an actuator [mm or mrad]."""
    moved = found.corrections[name]
    known = moved[np.isfinite(moved)]
    return number(1e3 * float(np.abs(known).max()), 4) if len(known) else "-"
