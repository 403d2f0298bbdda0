"""Postures beyond the robot file's joint limits: one remark instead of a warning for each."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager

from ..errors import JointLimitWarning

__all__ = ["limits_heard"]


@contextmanager
def limits_heard() -> Iterator[list[str]]:
    """Yield a list that hears, once for all postures, that joints stand beyond their limits; others go their way."""
    told: list[str] = []
    with warnings.catch_warnings():
        usual = warnings.showwarning
        warnings.simplefilter("always", JointLimitWarning)

        def show(message, category, *place, **more) -> None:
            if not issubclass(category, JointLimitWarning):
                usual(message, category, *place, **more)
            elif not told:
                told.append(f"some postures are beyond the joint limits of the robot file, such as: {message}")

        warnings.showwarning = show
        yield told
