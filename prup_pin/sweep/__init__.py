"""Many poses at once: grids, lists and draws; what can be asked of each; statuses, tables, executors."""

from .quantities import QUANTITIES, Quantity
from .result import SweepResult
from .status import STATUSES
from .sweep import sweep

__all__ = ["QUANTITIES", "STATUSES", "Quantity", "SweepResult", "sweep"]
