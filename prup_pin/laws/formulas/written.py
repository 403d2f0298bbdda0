"""A formula as the file of a law, which reads like those of the library."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from ...parameters import Quantity
from .formula import Formula, Remainder
from .shapes import SHAPES
from .strain_formula import ModuleFormula


def word_of(law: Formula | ModuleFormula) -> str:
    """Return the word of a formula in the vocabulary: its place and its variables, 'elbow_joint_by_speed'."""
    if isinstance(law, ModuleFormula):
        place, variables = law.module, [name for name, _ in law.recorded]
    else:
        place, names = law.joint, (factor.name for term in law.terms for factor in term.factors)
        variables = [name for name in dict.fromkeys(names) if name != "direction"]
    word = re.sub(r"[^a-z0-9]+", "_", f"{place}_by_{'_'.join(variables)}".lower()).strip("_")
    return word if word[0].isalpha() else f"at_{word}"


def law_file(
    law: Formula | ModuleFormula, source: str, remarks: Sequence[str] = (), beside: Remainder | None = None
) -> str:
    """Return the text of a Python file with a formula as a law, which `--with` takes.

    source: what it was proposed from; remarks: sentences that a reader should know, as comments; beside: what was
    fitted with a formula of a joint, for what its shape leaves.
    """
    word = word_of(law)
    name = "".join(part.capitalize() for part in word.split("_"))
    base, where, made_of, method = _of_module(law) if isinstance(law, ModuleFormula) else _of_joint(law, beside)
    equation, quantities, neutral = law.equation, law.quantities, law.neutral
    if beside is not None:
        equation += f" + {beside.text}"
        quantities, neutral = (*quantities, beside.height), {**neutral, beside.height.name: 0.0}
    lines = [
        f'"""{law.summary[0].upper()}{law.summary[1:]}: proposed from {source}."""',
        "",
        *(
            f"from prup_pin.laws.{room} import {', '.join(sorted(names))}"
            for room, names in sorted([("formulas", {base}), *made_of])
            if names
        ),
        "from prup_pin.parameters import Quantity",
        "",
        *(f"# {remark}" for remark in remarks),
        *([""] if remarks else []),
        "",
        f"class {name}({base}):",
        f'    """{law.symbol} = {equation}."""',
        "",
        f'    physics = "{word}"',
        f'    summary = "{law.summary}"',
        f'    source = "proposed from {source}"',
        *(f"    {key} = {_value(value)}" for key, value in where.items()),
        f'    equation = "{equation}"',
        "    quantities = (",
        *(f"        {line}" for q in quantities for line in _quantity(q)),
        "    )",
        f"    neutral = {_value(neutral)}",
        "    # 95 % intervals, and the ends between which each variable was: beyond them it was never seen",
        f"    found = {_value(law.found)}",
        f"    recorded = {_value(law.recorded)}",
        "",
        *(f"    {line}" for line in method),
        "",
        "",
        f"LAWS = [{name}]",
    ]
    return "\n".join(lines) + "\n"


#: Base class, attributes that say where a formula acts, names that it is made of by module, and its method.
_Parts = tuple[str, Mapping[str, Any], Sequence[tuple[str, set[str]]], Sequence[str]]


def _of_joint(law: Formula, beside: Remainder | None) -> _Parts:
    where: dict[str, Any] = {"joint": law.joint, "linear": law.linear, "settled": law.settled}
    known = {factor.name for term in law.terms for factor in term.factors}
    shapes = {term.shape for term in law.terms if term.shape != "linear"}
    code = [term.code(law.joint, own) for term, own in zip(law.terms, law.named, strict=True)]
    rooms = [("formulas.known", known), ("formulas.shapes", shapes)]
    if beside is not None:
        where |= {"linear": (*law.linear, beside.height.name), "heights": list(beside.heights)}
        code.append(beside.code)
        known |= {beside.variable} | ({"direction"} if beside.turns else set())
        rooms.append(("efforts.free_curve", {"smooth_curve"}))
        if beside.turns:
            rooms.append(("efforts.effort_law", {"usual_way"}))
    one = [f"    return [{code[0]}]"]
    body = one if len(code) == 1 else ["    return [", *(f"        {each}," for each in code), "    ]"]
    return "JointFormula", where, rooms, ("def columns(self, at, values):", *body)


def _of_module(law: ModuleFormula) -> _Parts:
    where = {"module": law.module, "component": law.component, "of": law.of}
    arguments = ", ".join(("load", *(f'values["{name}"]' for name in SHAPES[law.shape].parameters)))
    body = f'    return values["coefficient"] * {law.shape}({arguments})'
    return "StrainFormula", where, (("formulas.shapes", {law.shape}),), ("def deformation(self, load, values):", body)


def _value(value: Any) -> str:
    """Return a value as code: numbers with the digits that matter."""
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, tuple):
        return f"({', '.join(map(_value, value))}{',' * (len(value) == 1)})"
    if isinstance(value, list):
        rows = [", ".join(map(_value, value[first : first + 8])) for first in range(0, len(value), 8)]
        return "\n".join(("(", *(f"        {row}," for row in rows), "    )"))
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_value(key)}: {_value(item)}" for key, item in value.items()) + "}"
    return f"{float(value):.6g}" if abs(float(value)) < float("inf") else f'float("{value}")'


def _quantity(q: Quantity) -> Sequence[str]:
    bounds = f"lower={_value(q.lower)}, upper={_value(q.upper)}"
    free = "" if q.positive else "positive=False, "
    return (
        "Quantity(",
        f'    "{q.name}", "{q.unit}", "{q.description}", {_value(q.default)}, {free}{bounds}',
        "),",
    )
