"""A formula as the file of a law, which reads like those of the library."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from ...parameters import Quantity
from .formula import Formula

__all__ = ["law_file", "word_of"]


def word_of(law: Formula) -> str:
    """Return the word of a formula in the vocabulary: its joint and its variables, 'elbow_joint_by_speed'."""
    variables = dict.fromkeys(
        factor.name for term in law.terms for factor in term.factors if factor.name != "direction"
    )
    word = re.sub(r"[^a-z0-9]+", "_", f"{law.joint}_by_{'_'.join(variables)}".lower()).strip("_")
    return word if word[0].isalpha() else f"joint_{word}"


def law_file(law: Formula, source: str, remarks: Sequence[str] = ()) -> str:
    """Return the text of a Python file with a formula as a law, which `--with` takes.

    source: what it was proposed from; remarks: sentences that a reader should know, as comments.
    """
    word = word_of(law)
    name = "".join(part.capitalize() for part in word.split("_"))
    known = sorted({factor.name for term in law.terms for factor in term.factors})
    shapes = sorted({term.shape for term in law.terms if term.shape != "linear"})
    code = [term.code(law.joint, own) for term, own in zip(law.terms, law.named, strict=True)]
    lines = [
        f'"""{law.summary[0].upper()}{law.summary[1:]}: proposed from {source}."""',
        "",
        "from prup_pin.laws.formulas import JointFormula",
        f"from prup_pin.laws.formulas.known import {', '.join(known)}",
        *([f"from prup_pin.laws.formulas.shapes import {', '.join(shapes)}"] if shapes else []),
        "from prup_pin.parameters import Quantity",
        "",
        *(f"# {remark}" for remark in remarks),
        *([""] if remarks else []),
        "",
        f"class {name}(JointFormula):",
        f'    """tau = {law.equation}."""',
        "",
        f'    physics = "{word}"',
        f'    summary = "{law.summary}"',
        f'    source = "proposed from {source}"',
        f'    joint = "{law.joint}"',
        f'    equation = "{law.equation}"',
        f"    linear = {_tuple(law.linear)}",
        f"    settled = {_tuple(law.settled)}",
        "    quantities = (",
        *(f"        {line}" for q in law.quantities for line in _quantity(q)),
        "    )",
        f"    neutral = {_mapping((name, 0.0) for name in law.linear)}",
        "    # 95 % intervals, and the ends between which each variable was: beyond them it was never seen",
        f"    found = {_mapping(law.found.items())}",
        f"    recorded = {_mapping(law.recorded.items())}",
        "",
        "    def columns(self, at, values):",
        *(
            [f"        return [{code[0]}]"]
            if len(code) == 1
            else ["        return [", *(f"            {one}," for one in code), "        ]"]
        ),
        "",
        "",
        f"LAWS = [{name}]",
    ]
    return "\n".join(lines) + "\n"


def _tuple(names: Sequence[str]) -> str:
    return "(" + "".join(f'"{name}", ' for name in names).rstrip(" " if len(names) == 1 else ", ") + ")"


def _mapping(items: Iterable) -> str:
    return "{" + ", ".join(f"{_value(key)}: {_value(value)}" for key, value in items) + "}"


def _value(value) -> str:
    """Return a value as code: numbers with the digits that matter."""
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, tuple):
        return f"({', '.join(map(_value, value))})"
    return f"{float(value):.6g}" if abs(float(value)) < float("inf") else f'float("{value}")'


def _quantity(q: Quantity) -> Sequence[str]:
    bounds = f"lower={_value(q.lower)}, upper={_value(q.upper)}"
    free = "" if q.positive else "positive=False, "
    return (
        "Quantity(",
        f'    "{q.name}", "{q.unit}", "{q.description}", {_value(q.default)}, {free}{bounds}',
        "),",
    )
