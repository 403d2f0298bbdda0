"""The second forward model's diagnosis: drives' efforts against inverse dynamics."""

from .diagnose import diagnose_efforts
from .diagnosis import EffortCurve, EffortDiagnosis, effort_curve_of

__all__ = ["EffortCurve", "EffortDiagnosis", "diagnose_efforts", "effort_curve_of"]
