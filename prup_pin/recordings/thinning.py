"""Which rows are kept of a table with more of them than anything here needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

__all__ = ["MOST_ROWS", "Thinning"]

#: Rows that are kept of a table, and in how many pieces: long ones, in which motions and loads last.
MOST_ROWS, PIECES = 1_000_000, 40


@dataclass(frozen=True)
class Thinning:
    """Pieces of a table of `count` rows, evenly spread from the first to the last; all of a short one."""

    count: int

    @property
    def starts(self) -> np.ndarray:
        """Return the first row of each piece (PIECES,), counted from 0."""
        return np.linspace(0, self.count - MOST_ROWS // PIECES, PIECES).astype(np.int64)

    def keeps(self, rows: np.ndarray) -> np.ndarray | None:
        """Return which of some rows (n,), counted from 0, are kept; None: all are."""
        if self.count <= MOST_ROWS:
            return None
        starts = self.starts
        piece = np.clip(np.searchsorted(starts, rows, side="right") - 1, 0, PIECES - 1)
        return rows - starts[piece] < MOST_ROWS // PIECES

    @property
    def remarks(self) -> list[str]:
        """Return what was done and why, for a person."""
        if self.count <= MOST_ROWS:
            return []
        return [
            f"{self.count} rows are more than are needed, and than memory holds: they were read and checked in a "
            f"stream, and {PIECES} pieces of {MOST_ROWS // PIECES} rows, evenly spread, were kept."
        ]
