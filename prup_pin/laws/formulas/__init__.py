"""Formulas that a diagnosis proposes where no law explains what is left, and what their files are made of."""

from .formula import Factor, Formula, Remainder, Term, library, tried
from .joint_formula import JointFormula
from .known import KNOWN
from .shapes import SHAPES
from .strain_formula import ModuleFormula, StrainFormula
from .written import law_file, word_of
