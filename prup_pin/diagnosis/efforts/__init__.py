"""The second forward model's diagnosis: drives' efforts against inverse dynamics."""

from .verdict import EffortCurve, EffortDiagnosis, diagnose_efforts, effort_curve_of

__all__ = ["EffortCurve", "EffortDiagnosis", "diagnose_efforts", "effort_curve_of"]
