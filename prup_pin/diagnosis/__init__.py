"""When simulation and recording differ: locate, name, model, and show the fit improve."""

from .diagnose import diagnose
from .diagnosis import Diagnosis, Finding

__all__ = ["Diagnosis", "Finding", "diagnose"]
