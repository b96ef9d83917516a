"""Lattice lines: where a straight boundary may lie so that it meets the pattern well."""

from __future__ import annotations

from dataclasses import dataclass

from hexwrap_solver.pattern.lattice import Lattice


@dataclass(frozen=True)
class Rows:
    """Parallel lattice lines. A straight boundary lies well at depth ≡ first (mod period), the depth being
    measured inwards from the origin of the lattice or a translation of it, in lattice units."""

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
    whole, cut, period = lattice.lines[round(2 * angle / lattice.quantum) % 2]
    return Rows(whole if boundary == "whole" else cut, period)
