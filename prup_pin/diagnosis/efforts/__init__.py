"""The second forward model's diagnosis: drives' efforts against inverse dynamics."""

from .verdict import EffortCurve, EffortDiagnosis, against_of, diagnose_efforts

__all__ = ["EffortCurve", "EffortDiagnosis", "against_of", "diagnose_efforts"]
