"""What a law of either channel says of itself, as checks that raise AssertionError of one that does not."""

from __future__ import annotations

import re

from ..laws.law import defects
from .contract import contract, require


@contract("law")
def check_declared(law):
    """It declares its word, a summary, quantities with units and starts, neutral values, and has a docstring."""
    require(not (wrong := "; ".join(defects(law))), wrong)
    require(type(law).__doc__, "It has no docstring.")
    strange = set(law.needs) - {"temperature", "speed", "gravity", "weight", "wrench"}
    require(not strange, f"It needs {', '.join(sorted(strange))}, which no recording has.")


@contract("law")
def check_advice(law, place, values):
    """A mechanic is told in 4 to 30 words, without a full stop, what to do about it."""
    said = law.advice(place, values)
    require(4 <= len(said.split()) <= 30 and not re.search(r"[{}]|\.$", said), f"It says '{said}'.")


@contract("law")
def check_statement(law, place, values, mechanism):
    """Its statement is a sentence for people: no braces, no names of the program, no full stop, no nan."""
    told = text = law.statement(place, values, mechanism)
    of_the_robot = [joint.name for joint in mechanism.joints]
    for name in (str(place), place.name, *law.same_places(place, mechanism), *of_the_robot):
        text = text.replace(name, "")
    holds = len(told) > 15 and not told.endswith(".") and "nan" not in told and not set("{}_\n") & set(text)
    require(holds, f"It says '{told}'.")


@contract("law")
def check_small_sizes(law, place, mechanism):
    """A statement tells small sizes in small units: 0.00004 m is 40 µm."""
    for size in (4e-8, 4e-5):
        small = [
            q for q in law.quantities_at(place, mechanism) if q.unit in {"m", "rad"} and q.lower <= size <= q.upper
        ]
        values = {**law.starts(place, mechanism)[0], **{q.name: size for q in small}}
        text = law.statement(place, values, mechanism)
        require(not re.search(r"\b0\.0\d* (m|µ|rad|deg)|e-\d|\b0 (mm|mrad)", text), f"It says '{text}'.")
