"""Corrected models as robot files that other simulators load, and what these files cannot say."""

from .export import Exported, LeftOut, Said, export_model, exported

__all__ = ["Exported", "LeftOut", "Said", "export_model", "exported"]
