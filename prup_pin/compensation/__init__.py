"""Commands that put the loaded tool where it was wanted: the payoff of a diagnosis."""

from .compensate import Compensation, Effects, PathLike, compensate, read_path, write_commands

__all__ = ["Compensation", "Effects", "PathLike", "compensate", "read_path", "write_commands"]
