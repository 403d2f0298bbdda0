"""What a simulation came to, as text: rows, failures, agreement with what was measured, remarks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from rich.console import Console
from rich.text import Text

from ...laws import Effect
from ...numbers import number
from ...recordings import Recording, suspicions
from ...robot import Robot
from ...simulation import Agreement, Prediction, compare
from .terminal import heading, listed, make_table, paragraph, print_table

#: So many row numbers are listed.
_SHOWN = 8
#: More values than this are counted, not written out: a calibration's.
_MOST_VALUES = 12


def print_simulation(
    out: Console,
    robot: Robot,
    effects: Sequence[Effect],
    recording: Recording,
    prediction: Prediction,
    notes: Sequence[str] = (),
) -> None:
    """Print the closing summary of a simulation; `recording` holds what was measured, if anything was."""
    how = "the efforts of its motion" if not prediction.position.shape[1] else "loaded, in its deformed position"
    out.print(Text(f"{robot.name}, {how}", style="bold"))
    listed(out, "with", [effect_text(effect) for effect in effects] or ["nothing added to the robot file"], "; ")
    _print_rows(out, prediction)
    found = compare(recording, prediction)
    if found:
        _print_agreement(out, robot, found)
    odd = [*suspicions(recording), *recording.remarks, *prediction.remarks, *notes]
    if odd:
        heading(out, "Remarks")
        for text in odd:
            paragraph(out, text, "- ")


def effect_text(effect: Effect) -> str:
    """Return an effect as it is typed; of many values only how many."""
    aspect = f":{effect.place.aspect}" if effect.place.aspect else ""
    values = " ".join(f"{name}={number(value, 6)}" for name, value in effect.values.items())
    if len(effect.values) > _MOST_VALUES:
        values = f"({len(effect.values)} values)"
    return f"{effect.law.physics}@{effect.place.name}{aspect} {values}".strip()


def _print_rows(out: Console, prediction: Prediction) -> None:
    failures = prediction.failures
    failed = sum(len(rows) for rows in failures.values())
    good = f"{len(prediction) - failed} predicted" if failed else "all predicted"
    listed(out, "rows", [f"{len(prediction)}, {good}"])
    print_failures(out, failures, prediction.reasons)


def print_failures(out: Console, failures: Mapping[str, np.ndarray], reasons: Mapping[str, str]) -> None:
    """Print which rows, counted from 0, have no answer, by status, and why."""
    for word, rows in failures.items():
        first = ", ".join(str(row + 1) for row in rows[:_SHOWN].tolist())
        more = ", …" if len(rows) > _SHOWN else ""
        listed(out, word, [f"{len(rows)} row{'s' if len(rows) > 1 else ''}: {first}{more}"])
        if word in reasons:
            paragraph(out, f"row {rows[0] + 1}: {reasons[word]}", "  ")


def _print_agreement(out: Console, robot: Robot, found: Sequence[Agreement]) -> None:
    heading(out, "Measured less predicted", "(root mean square)")
    efforts = any(item.share is not None for item in found)
    columns = [("", "left"), ("RMS", "right"), ("unit", "left"), ("noise", "right"), ("RMS / noise", "right")]
    table = make_table(*columns, *[("% of the effort", "right")] * efforts)
    for item in found:
        unit, factor = _unit(robot, item.channel)
        noise = "not declared" if item.noise is None else number(factor * item.noise, 3)
        multiple = "-" if item.in_noise is None else number(item.in_noise, 3)
        cells = [item.channel, number(factor * item.rms, 4), unit, noise, multiple]
        table.add_row(*cells, *["" if item.share is None else number(100 * item.share, 3)] * efforts)
    print_table(out, table)


def _unit(robot: Robot, channel: str) -> tuple[str, float]:
    """Return the unit in which a channel is shown, and its factor."""
    kind, _, name = channel.partition(" ")
    if kind == "effort":
        return ("N", 1.0) if robot.mechanism.joint(name).slides else ("N m", 1.0)
    return ("µrad", 1e6) if channel.endswith("rotation") else ("µm", 1e6)
