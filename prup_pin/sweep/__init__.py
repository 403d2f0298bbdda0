"""Many poses at once: grids, lists and draws; what can be asked of each; statuses, tables, executors."""

from .engine import STATUSES
from .indices import ErrorRange, Spread
from .quantities import QUANTITIES, Quantity
from .result import SweepFile, SweepResult
from .sweep import Engines, sweep

__all__ = ["QUANTITIES", "STATUSES", "Engines", "ErrorRange", "Quantity", "Spread", "SweepFile", "SweepResult", "sweep"]
