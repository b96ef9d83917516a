"""Lattice lines: where a straight boundary may lie so that it meets the pattern well."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.pattern.lattice import Lattice


@dataclass(frozen=True)
class Rows:
    """Parallel lattice lines. A straight boundary lies well at depth ≡ first (mod period), the depth being
    measured inwards from a point of coset 0, in lattice units."""

    first: float
    period: float

    def nearest_height(self, height: float) -> float:
        """Nearest distance of two boundaries that face each other, at least one row."""
        rows = max(1, round((height + 2 * self.first) / self.period))
        return rows * self.period - 2 * self.first


def rows_along(lattice: Lattice, angle: float, boundary: str) -> Rows:
    """The lines for edges at an angle (0 or half a quantum) to the boundary.

    Across hexagons' corners, ``whole`` takes the line on which a row of cells stands, ``trim`` the one
    through their centres, which cuts them in halves.
    """
    along_edges = round(2 * angle / lattice.quantum) % 2 == 0
    if lattice.kind == "hex":
        return Rows(0.0, np.sqrt(3) / 2) if along_edges else Rows(0.5 if boundary == "whole" else 0.0, 1.5)
    if lattice.kind == "triangle":
        return Rows(0.0, 1.5 if along_edges else np.sqrt(3) / 2)
    return Rows(0.0, np.sqrt(2) if along_edges else 1.0)
