"""What a table ignores, and what it does not say: sentences for people."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence

import numpy as np

from ..errors import did_you_mean
from ..spatial import WRENCH_NAMES, Array
from .columns import (
    AXES,
    candidates,
    in_other_words,
    marker_of,
)
from .problems import (
    shown,
)
from .recording import Noise
from .table import Form

#: Columns that remarks name, of one kind.
_REMARKED = 40


def remarks_of(
    header: Sequence[str], numbers: Mapping[str, Array], blank: Sequence[int], form: Form
) -> tuple[list[str], list[str]]:
    """Return sentences on what the table ignores and does not say of loads, and those of them on misspelt columns."""
    remarks: list[str] = []
    misspelt: list[str] = []
    # `status` is written beside predictions and commands
    unknown = [name for name in header if name not in ("run", "status") and not form.knows(name)]
    known = [*form.coordinates, *candidates(header)]
    plain = []
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


def unmeasured(numbers: Mapping[str, Array]) -> list[str]:
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


def undeclared(numbers: Mapping[str, Array], noise: Noise) -> list[str]:
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
