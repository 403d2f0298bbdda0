"""The diagnosis knows no law by name, nor does the export: what they must know of one is data of the law, so that a new
law is one file."""

import ast

import pytest

from prup_pin.laws import LAWS, Law
from prup_pin.laws.as_found import AsFound, ChangedEffect
from prup_pin.laws.deviations import Calibration
from prup_pin.laws.efforts import EFFORT_LAWS, EffortLaw
from prup_pin.laws.formulas import Formula, JointFormula, ModuleFormula, StrainFormula

from .imports import ROOT, files, imported

#: The modules of `laws` of which a law is made, and those that say what tolerances let be off and what was found:
#: the contract.
_LAWS = ("law", "as_found", "deeds", "drawn", "inputs", "setup", "deviations", "yielding", "efforts", "formulas")
CONTRACT = {("laws",), *(("laws", name) for name in _LAWS)}
CONTRACT |= {("laws", "formulas", "strain_formula")}
CONTRACT |= {("laws", "efforts", name) for name in ("effort_law", "variables", "deviations")}
#: Classes of laws that the diagnosis may name: any law, one of efforts, what is within tolerance or was found before,
#: and the formulas that it proposes itself.
ANY = {Law, EffortLaw, Calibration, AsFound, ChangedEffect, Formula, JointFormula, ModuleFormula, StrainFormula}
FILES = [path for path in files() if any(path.is_relative_to(ROOT / room) for room in ("diagnosis", "export"))]


def subclasses(cls):
    return {cls}.union(*(subclasses(own) for own in cls.__subclasses__()))


WORDS = {law.physics for law in (*LAWS, *EFFORT_LAWS)} | {law.family for law in EFFORT_LAWS} - {""}
CLASSES = {cls.__name__ for cls in subclasses(Law) - ANY if cls.__module__.startswith("prup_pin.")}


def named(text):
    """Yield the laws that a program names: by their words or families as strings, by their classes."""
    tree = ast.parse(text)
    said = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and node.value in WORDS and id(node) not in said:
            yield f"line {node.lineno}: {node.value!r}"
        name = getattr(node, "id", None) or getattr(node, "attr", None) or getattr(node, "name", None)
        if name in CLASSES:
            yield f"line {getattr(node, 'lineno', 0)}: {name}"


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_no_file_of_the_diagnosis_names_a_law(path):
    assert list(named(path.read_text(encoding="utf-8"))) == []
    modules = {name for name in imported(path) if name[0] == "laws"}
    assert modules <= CONTRACT, f"{path} imports laws, not their contract"


def test_what_names_a_law_is_seen():
    assert len(FILES) > 50
    for text in (
        "if term.law.physics == 'cogging': pass",
        "words = {'payload': 1}",
        "family = 'dry friction'",
        "from prup_pin.laws import Everywhere",
        "isinstance(law, Lagging)",
        "laws.JointCompliance()",
    ):
        assert list(named(text)), text
    assert not list(named("'''What rubs: cogging.'''\nlaw.family == other.family\nlaw: EffortLaw"))
