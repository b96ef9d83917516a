"""Half-edges of a pattern: one per corner k of a cell, from that corner to the next."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Bools, Ints, Ragged
from hexwrap_solver.geometry import pair_key, stable_order


@dataclass(frozen=True)
class HalfEdges:
    """All arrays (h,), aligned with the values of the faces.

    cell: the cell on the left. start, end: pattern vertices. twin: the same edge seen from the other cell,
    or −1.
    """

    cell: Ints
    start: Ints
    end: Ints
    twin: Ints

    @property
    def across(self) -> Ints:
        """(h,) the cell on the right, or −1."""
        return np.where(self.twin >= 0, self.cell[self.twin], -1)

    def pairs(self) -> Ints:
        """Each edge between two cells once, as the lower of its two half-edges."""
        return np.flatnonzero(np.arange(len(self.twin)) < self.twin)

    @classmethod
    def of(cls, faces: Ragged, n: int) -> HalfEdges:
        """faces: rows of vertices 0 … n − 1. Twins are found through these."""
        start = faces.values.astype(np.int64)
        end = start[faces.next()]
        key = pair_key(start, end, n)
        order = stable_order(key, n * n)
        ordered = key.take(order)
        same: Bools = ordered[1:] == ordered[:-1]
        first, second = order[:-1][same], order[1:][same]
        twin = np.full(len(start), -1, dtype=np.int64)
        twin[first], twin[second] = second, first
        return cls(faces.row, start, end, twin)
