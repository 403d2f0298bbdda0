"""What every parameter does to the loaded pose and to the compliance: derivatives by name."""

from .sensitivity import Sensitivity, Stiffening, ValueStep, has_slope, mass_of, sensitivity_of

__all__ = ["Sensitivity", "Stiffening", "ValueStep", "has_slope", "mass_of", "sensitivity_of"]
