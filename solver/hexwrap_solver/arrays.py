"""Array types and the one container that the stages share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Complexes = NDArray[np.complex128]

#: A stage calls it with a fraction 0..1 of its own work, and a few words such as "Newton step 3".
Progress = Callable[[float, str], None]


def no_progress(fraction: float, what: str) -> None:
    """The default listener: nobody."""


def runs(counts: Ints) -> tuple[Ints, Ints]:
    """(owner, position inside the owner's run) of Σcounts entries."""
    owner = np.repeat(np.arange(len(counts)), counts)
    return owner, np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)


@dataclass(frozen=True)
class Ragged:
    """Rows of different lengths, stored flat (polygons with mixed numbers of corners).

    values: (k,) or (k, d) all rows one after the other.
    offsets: (n + 1,) int; row i is ``values[offsets[i]:offsets[i + 1]]``.
    """

    values: NDArray[np.int64] | NDArray[np.float64]
    offsets: Ints

    @property
    def n_rows(self) -> int:
        return len(self.offsets) - 1

    @property
    def lengths(self) -> Ints:
        """(n,) number of entries of each row."""
        return np.diff(self.offsets)

    @property
    def row(self) -> Ints:
        """(k,) the row to which each value belongs."""
        return np.repeat(np.arange(self.n_rows), self.lengths)

    @property
    def within(self) -> Ints:
        """(k,) place of each value in its row."""
        return runs(self.lengths)[1]

    def next(self) -> Ints:
        """(k,) position of the cyclic successor of each value inside its row."""
        following = np.arange(1, len(self.values) + 1)
        filled = self.lengths > 0
        following[self.offsets[1:][filled] - 1] = self.offsets[:-1][filled]
        return following

    @classmethod
    def of(cls, values: NDArray[np.int64] | NDArray[np.float64], lengths: Ints) -> Ragged:
        """Rows of these lengths (n,), one after the other."""
        return cls(values, np.append(0, np.cumsum(lengths)).astype(np.int64))

    @classmethod
    def chained(cls, tables: Sequence[Ragged]) -> Ragged:
        """The rows of one table after those of the other."""
        values = np.concatenate([table.values for table in tables])
        return cls.of(values, np.concatenate([table.lengths for table in tables]))

    @classmethod
    def from_table(cls, table: NDArray[np.int64] | NDArray[np.float64]) -> Ragged:
        """Rows of equal length: (n, m) or (n, m, d)."""
        n, m = table.shape[:2]
        return cls(table.reshape(n * m, *table.shape[2:]), np.arange(n + 1, dtype=np.int64) * m)

    def places(self, rows: Ints | Bools) -> Ints:
        """Positions of the values of some rows, row by row."""
        start = self.offsets[:-1][rows]
        row, within = runs(self.lengths[rows])
        return start[row] + within

    def take(self, rows: Ints | Bools) -> Ragged:
        """Some of the rows."""
        return Ragged.of(self.values[self.places(rows)], self.lengths[rows])

    def to_lists(self) -> list[list[object]]:
        """Nested Python lists, for export only."""
        return [part.tolist() for part in np.split(self.values, self.offsets[1:-1])] if self.n_rows else []

    def __getitem__(self, i: int) -> NDArray[np.int64] | NDArray[np.float64]:
        return self.values[self.offsets[i] : self.offsets[i + 1]]
