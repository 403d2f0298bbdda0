"""The lightest robot that is stiff enough everywhere: values of modules and lengths by an optimiser."""

from .design import Design, design
from .target import Target

__all__ = ["Design", "Target", "design"]
