"""Which rows are kept of a table with more of them than anything here needs."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

#: Rows that are kept of a table, and in how many pieces: long ones, in which motions and loads last.
MOST_ROWS, PIECES = 1_000_000, 40


@dataclass(frozen=True)
class Thinning:
    """Pieces of `count` rows, evenly spread from the first to the last; all rows where there are at most `most`."""

    count: int
    most: int = field(default_factory=lambda: MOST_ROWS)
    pieces: int = field(default_factory=lambda: PIECES)

    @property
    def length(self) -> int:
        """The rows of a piece."""
        return self.most // self.pieces

    @property
    def all_kept(self) -> bool:
        """Whether there are no more rows than are needed."""
        return self.count <= self.length * self.pieces

    def keeps(self, rows: np.ndarray) -> np.ndarray | None:
        """Return which of some rows (n,), counted from 0, are kept; None: all are."""
        if self.all_kept:
            return None
        starts = np.linspace(0, self.count - self.length, self.pieces).astype(np.int64)
        piece = np.clip(np.searchsorted(starts, rows, side="right") - 1, 0, self.pieces - 1)
        return rows - starts[piece] < self.length

    @property
    def remarks(self) -> list[str]:
        """Return what was done and why, for a person."""
        if self.all_kept:
            return []
        return [
            f"{self.count} rows are more than are needed, and than memory holds: they were read in a stream, and "
            f"{self.pieces} pieces of {self.length} rows, evenly spread, were kept."
        ]
