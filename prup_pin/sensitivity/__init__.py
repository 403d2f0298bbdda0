"""What every parameter does to the loaded pose and to the compliance: derivatives by name."""

from .sensitivity import Sensitivity, Stiffening, sensitivity_of

__all__ = ["Sensitivity", "Stiffening", "sensitivity_of"]
