"""Reads a recording: a CSV file and the JSON beside it. Every problem is reported at once, with its line and column.

What a table ignores, and what it does not say, is told in sentences for people.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import did_you_mean
from ..parameters import meant_otherwise
from ..spatial import WRENCH_NAMES, Array
from .beside import said_beside
from .columns import (
    AXES,
    LARGEST_GRAVITY,
    candidates,
    fields_of,
    in_other_words,
    largest,
    marker_of,
    unit_of,
    without_unit,
)
from .problems import Problems, TableProblem, check_readable, read_bytes, shown
from .recording import Noise, Recording, ToolPath
from .table import EXPECTED, Form, Table, Thinning, blocks, careful_table, fast_table, header_of, rows_in, text_of

#: Columns that remarks name, of one kind.
_REMARKED = 40
#: More repeats of a time than these, and than this share of the rows, are those of a coarse clock; its steps are whole
#: multiples of the smallest one, to within this.
_REPEATED, _ON_GRID = (10, 0.05), 1e-3


def read_recording(path: str | Path) -> Recording:
    """Return the recording of a CSV file and of the JSON file of the same stem beside it, if there is one.

    Empty cells and 'nan' are 'not measured'. Columns that the format does not know are left out and named in `remarks`.
    All of a table is read and checked, piece by piece; of more than `MOST_ROWS` rows some are kept.

    Raises RecordingFileError with all problems of both files, each with its line and column.
    """
    return _read(Path(path), Form())[0]


def read_path(path: str | Path, coordinates: Mapping[str, str]) -> ToolPath:
    """Return the path of a CSV file: a recording's table with columns of the tool's wanted coordinates.

    coordinates: their names and units; a table has all of them, or positions of joints instead. Every row says all that
    its columns are for: no cell is empty.

    Raises RecordingFileError with all problems, each with its line and column.
    """
    recording, wanted = _read(Path(path), Form(coordinates, is_path=True))
    return ToolPath(recording, wanted)


def robot_named_beside(path: str | Path) -> str | None:
    """Return the robot that the JSON file beside a table names, or None. Raises RecordingFileError without the table.

    What is wrong with that file is said where the table is read.
    """
    path = Path(path)
    read_bytes(path, EXPECTED, (".csv",))
    return said_beside(path, Problems(path))[0].get("robot")


def _read(path: Path, form: Form) -> tuple[Recording, dict[str, Array]]:
    """Return the recording of a table, and its columns of wanted coordinates."""
    check_readable(path, EXPECTED, (".csv",))
    problems = Problems(path)
    # What is asked of every row of a path is answered of every row.
    thinning = Thinning(0) if form.is_path else Thinning(rows_in(path))
    header: list[str] = []
    parts: list[Table] = []
    labels: dict[str, int] = {}
    times: dict[int, tuple[float, int]] = {}
    for first, content in blocks(path, problems, whole=form.is_path):
        content = text_of(content, problems, form, first)
        if not parts:
            header = header_of(content, problems, form)
        part = fast_table(content, header, form, labels, first) or careful_table(
            content, header, problems, form, labels, first
        )
        _check(part, problems, times)
        _check_gravity(part, problems, first == 2)
        if form.is_path:
            _check_path(part, header, form, problems)
        parts.append(part.kept(thinning))
        if problems.many:
            break
    beside, told = said_beside(path, problems, header)
    problems.raise_all()
    table = Table.together(parts, tuple(labels) if labels else ("",))
    wanted = {name: table.numbers.pop(name) for name in form.coordinates if name in table.numbers}
    return _recording(path, header, table, beside, form, thinning.remarks, told), wanted


def _check(table: Table, problems: Problems, times: dict[int, tuple[float, int]]) -> None:
    """Add what is wrong with the numbers: sizes of no bench, time that is empty or does not increase within a run.

    times: of each run, the last time so far and its line.
    """
    for name, values in table.numbers.items():
        far = np.flatnonzero(np.abs(values) > largest(name))
        places = [
            (int(line), f"{value:.4g} is too large; expected at most {largest(name):g}, in {unit_of(name)}")
            for line, value in zip(table.lines[far], values[far], strict=True)
        ]
        problems.cells(name, "too large", places)
    time = table.numbers.get("time")
    if time is None or not len(time):
        return
    # Cells already reported as text are not reported as empty again.
    reported = {
        problem.line for problem in problems.found if isinstance(problem, TableProblem) and problem.column == "time"
    }
    empty = [int(line) for line in table.lines[np.isnan(time)] if int(line) not in reported]
    problems.cells("time", "empty", [(line, "is empty; every sample needs its time") for line in empty])
    run = np.zeros(len(time), np.int64) if table.run is None else table.run
    lines = np.concatenate(([line for _, line in times.values()], table.lines)).astype(np.int64)
    time = np.concatenate(([value for value, _ in times.values()], time))
    run = np.concatenate((list(times), run)).astype(np.int64)
    rows = np.flatnonzero(np.isfinite(time))
    rows = rows[np.argsort(run[rows], kind="stable")]
    last = rows[np.flatnonzero(np.diff(run[rows], append=-1))]
    times |= {int(run[row]): (float(time[row]), int(lines[row])) for row in last}
    before, after = rows[:-1], rows[1:]
    same = run[before] == run[after]
    with np.errstate(over="ignore", invalid="ignore"):  # times of any size, to be refused
        rounded = _rounded((time[after] - time[before])[same])
    if rounded:
        first = after[same][np.argmin(time[after][same] > time[before][same])]
        problems.cells("time", "rounded", [(int(lines[first]), rounded)])
        return
    wrong = np.flatnonzero(same & (time[after] <= time[before]))
    where = " within a run" if table.run is not None else ""
    hint = "" if table.run is not None else "; a new session needs another label in a column 'run'"
    places = [
        (
            int(lines[after[k]]),
            f"{time[after[k]]:.15g} s after {time[before[k]]:.15g} s (line {lines[before[k]]}): "
            f"time must increase{where}{hint}",
        )
        for k in wrong.tolist()
    ]
    problems.cells("time", "not increasing", sorted(places))


def _rounded(steps: Array) -> str:
    """Return what is wrong where the steps (n,) of a clock are those of one that is rounded too coarsely; else ''."""
    on = steps[steps > 0]
    count = len(steps) - len(on)
    if count <= max(_REPEATED[0], _REPEATED[1] * len(steps)) or not len(on) or (steps < 0).any():
        return ""
    grid = float(on.min())
    if not np.abs(on / grid - np.rint(on / grid)).max() <= _ON_GRID:
        return ""
    rate = f"{(len(steps) + 1) / (steps.sum() + grid):.3g}"
    return (
        f"{count} of {len(steps) + 1} rows have the time of the row before: the clock is rounded to {grid:.3g} s, and "
        f"there are about {rate} rows a second. Where they came evenly, write row number / rate as the time, or let "
        f"`prup-pin import` do it: in its map, 'rate: {rate}' in place of 'from: time'. Left at 'from: time' it keeps "
        "the first row of each time"
    )


def _check_gravity(table: Table, problems: Problems, first: bool) -> None:
    """Add what is wrong with the columns of gravity: one that is missing, a size that nothing on a bench falls with."""
    names = [f"g.{axis}" for axis in AXES]
    there = [name for name in names if name in table.numbers]
    if not there:
        return
    for name in names:
        if first and name not in there:
            told = f"is missing beside {', '.join(there)}"
            message = f"{told}: gravity has three components; write 0 for one that is zero"
            problems.add(TableProblem(message, 1, column=name))
    sizes = np.sqrt(sum(np.nan_to_num(table.numbers[name]) ** 2 for name in there))
    lines = table.lines[sizes > LARGEST_GRAVITY].tolist()
    places = [
        (line, f"gravity of {size:.4g} m/s^2: is it in mm/s^2? Expected at most {LARGEST_GRAVITY:g} m/s^2")
        for line, size in zip(lines, sizes[sizes > LARGEST_GRAVITY], strict=True)
    ]
    problems.cells(there[0], "absurd gravity", places)


def _check_path(table: Table, header: Sequence[str], form: Form, problems: Problems) -> None:
    """Add what a path leaves open: a coordinate beside others, empty cells, values that are of another unit."""
    stated = [name for name in form.coordinates if name in table.numbers]
    for name in form.coordinates:
        if stated and name not in stated:
            message = f"is missing beside {', '.join(stated)}: a path gives all of {', '.join(form.coordinates)}"
            meant = [other for other in header if without_unit(other).lower() == name.lower()]
            if meant:
                message += f". Is it column '{shown(meant[0])}'? Expected '{name}' in {form.coordinates[name]}"
            problems.add(TableProblem(message, 1, column=name))
    reported = {(problem.line, problem.column) for problem in problems.found if isinstance(problem, TableProblem)}
    for name, values in table.numbers.items():
        if name == "time":
            continue
        lines = [int(line) for line in table.lines[np.isnan(values)] if (int(line), name) not in reported]
        zero = "; write 0 where nothing acts" if name.startswith(("w.", "g.")) else ""
        problems.cells(name, "empty", [(line, f"is empty; every row of a path needs it{zero}") for line in lines])
        unit = form.coordinates.get(name, "")
        far = [(int(line), meant_otherwise(value, unit)) for line, value in zip(table.lines, values, strict=True)]
        problems.cells(name, "another unit", [(line, message) for line, message in far if message])


def _recording(
    path: Path,
    header: Sequence[str],
    table: Table,
    beside: Mapping[str, Any],
    form: Form,
    thinned: Sequence[str],
    told: Sequence[str],
) -> Recording:
    n, numbers = len(table.lines), table.numbers
    columns, misspelt = _ignored(header, numbers, table.blank, form)
    remarks = [*thinned, *columns]
    if not form.is_path:  # which has nothing measured
        remarks += [*_unmeasured(numbers), *told, *_undeclared(numbers, beside.get("noise", Noise()))]
    return Recording(
        time=numbers["time"],
        run=np.zeros(n, np.int64) if table.run is None else table.run,
        run_names=table.run_names,
        path=str(path),
        ignored=tuple(name for name in header if name != "run" and not form.knows(name)),
        remarks=tuple(remarks),
        **fields_of(numbers, n),
        **{**beside, "misspelt": (*beside.get("misspelt", ()), *misspelt)},
    )


# -- remarks ----------------------------------------------------------------------------------------------------------


def _ignored(
    header: Sequence[str], numbers: Mapping[str, Array], blank: Sequence[int], form: Form
) -> tuple[list[str], list[str]]:
    """Return sentences on what the table ignores and does not say of loads, and those of them on misspelt columns."""
    remarks: list[str] = []
    misspelt: list[str] = []
    # `status` is written beside predictions and commands
    unknown = [name for name in header if name not in ("run", "status") and not form.knows(name)]
    known = [*form.coordinates, *candidates(header)]
    plain = []
    for prefix in dict.fromkeys(name[:-2] for name in unknown if name.endswith("qw")):
        quaternion = [name for name in unknown if name in {f"{prefix}q{axis}" for axis in "wxyz"}]
        if len(quaternion) == len("wxyz"):
            names = ", ".join(f"'{shown(name)}'" for name in quaternion)
            misspelt.append(
                f"The columns {names} are ignored: they seem to be a quaternion, and r.x, r.y, r.z are a rotation "
                "vector. `prup-pin import` turns one into the other."
            )
            unknown = [name for name in unknown if name not in quaternion]
    for name in unknown[:_REMARKED]:
        other = in_other_words(name)
        near = f"Did you mean '{shown(other)}'?" if other in known else did_you_mean(name, known)
        if near:
            misspelt.append(f"The unknown column '{shown(name)}' is ignored. {near}")
        else:
            plain.append(f"'{shown(name)}'")
    remarks += misspelt
    if plain:
        word, are = ("column", "is") if len(plain) == 1 else ("columns", "are")
        remarks.append(f"The unknown {word} {', '.join(plain)} {are} ignored.")
    if len(unknown) > _REMARKED:
        remarks.append(f"{len(unknown) - _REMARKED} more columns are unknown, and ignored.")
    if blank:
        remarks.append(f"{len(blank)} blank lines within the table are skipped, the first is line {blank[0]}.")
    loads = [f"w.{name}" for name in WRENCH_NAMES if f"w.{name}" not in numbers]
    if len(loads) == 6 and not _of_efforts_alone(numbers):
        remarks.append(
            "There is no column w.fx … w.mz: the external wrench is taken as zero, and nothing but weight and motion "
            "load the robot."
        )
    elif 0 < len(loads) < 6:
        remarks.append(f"There is no column {', '.join(loads)}: these components of the wrench are taken as zero.")
    return remarks, misspelt


def _of_efforts_alone(numbers: Mapping[str, Array]) -> bool:
    """Return whether a table is a log of drives' efforts, on which nobody meant to measure poses or loads."""
    return any(name.startswith("tau.") for name in numbers) and not any(name[:2] in ("p.", "r.") for name in numbers)


def _unmeasured(numbers: Mapping[str, Array]) -> list[str]:
    """Return sentences on what was not measured."""
    remarks = []
    alone = _of_efforts_alone(numbers)
    triples = {} if alone else {"p": "position", "r": "orientation"}
    for name in numbers:
        if marker := marker_of(name):
            triples[f"{name[0]}.{marker[1]}"] = f"{triples[name[0]]} of {marker[1]}"
    for prefix, what in itertools.islice(triples.items(), _REMARKED):
        missing = [f"{prefix}.{axis}" for axis in AXES if f"{prefix}.{axis}" not in numbers]
        if len(missing) == 3:
            remarks.append(f"There is no column {', '.join(missing)}: the {what} was not measured.")
        elif missing:
            remarks.append(f"There is no column {', '.join(missing)}: this part of the {what} was not measured.")
        columns = {f"{prefix}.{axis}": numbers.get(f"{prefix}.{axis}", np.zeros(0)) for axis in AXES}
        empty = [name for name, values in columns.items() if len(values) and np.isnan(values).all()]
        if 0 < len(empty) < 3 - len(missing):
            are = "are" if len(empty) > 1 else "is"
            remarks.append(f"{', '.join(empty)} {are} empty in every row: this part of the {what} was not measured.")
    if "g.x" in numbers:
        lost = int(np.isnan(np.column_stack([numbers[f"g.{axis}"] for axis in AXES])).any(axis=1).sum())
        if lost:
            remarks.append(f"g.x g.y g.z are empty in {lost} rows: nothing is known of weight there.")
    positions = [name[2:] for name in numbers if name.startswith("q.")]
    efforts = [name[4:] for name in numbers if name.startswith("tau.")]
    lacking = [f"tau.{joint}" for joint in positions if joint not in efforts]
    if not efforts:
        remarks.append("There is no column tau.<joint>: the actuators' efforts were not measured.")
    elif lacking:
        remarks.append(f"There is no column {', '.join(lacking)}: these efforts were not measured.")
    loose = [f"tau.{joint}" for joint in efforts if joint not in positions]
    if loose:
        remarks.append(f"{', '.join(loose)} has no column q. of the same joint.")
    if "temperature" not in numbers and not alone:
        remarks.append("There is no column temperature.")
    return remarks


def _undeclared(numbers: Mapping[str, Array], noise: Noise) -> list[str]:
    """Return a sentence on measured channels whose noise is not declared while that of others is."""
    if noise == Noise():
        return []
    channels = {
        "position": any(name.startswith("p.") for name in numbers),
        "rotation": any(name.startswith("r.") for name in numbers),
        "force": any(name.startswith("w.f") for name in numbers),
        "moment": any(name.startswith("w.m") for name in numbers),
        "effort": any(name.startswith("tau.") for name in numbers),
    }
    silent = [f"{name}_noise" for name, there in channels.items() if there and getattr(noise, name) is None]
    return [f"{', '.join(silent)} {'is' if len(silent) == 1 else 'are'} not declared."] if silent else []
