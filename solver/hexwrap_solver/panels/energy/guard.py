"""A barrier before cells that collapse, fold over or cross themselves, and a pull back to convex ones.

Both look at triangles in a cell, seen along its normal: the fan from the mean of the corners to the edges,
and the ears that diagonals cut off at corners. Where all of the fan is positive, the outline does not cross
itself; where all ears are, it is convex. f is a triangle's area over what it is in the pattern:

    fan     ½ HOLD (FAN / f − 1)²    for f < FAN, ∞ for f ≤ 0
    ears    ½ BULGE (EAR − f)²       for f < EAR

Ears count where flat cells may be convex on any surface: at nodes where four edges or more meet, and at the
boundary. Of three cells around a node one is reflex there on a saddle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Bools, Floats
from hexwrap_solver.panels.energy.residuals import triangle_areas, triangle_slopes
from hexwrap_solver.pattern.types import Pattern

FAN, HOLD = 0.4, 0.1
EAR, BULGE = 0.2, 1.0

#: Triangles smaller than this fraction of the mean of their cell's fan, as trimmed cells have, do not count.
LEAST = 0.05


@dataclass(frozen=True)
class Guard:
    """Of q cells with p corners. triangles: (t, 3, p) their corners as weights of the cell's; usual: (q, t)
    areas in the pattern, ∞ for those left alone; the first p are the fan, the others, if any, ears."""

    triangles: Floats
    usual: Floats

    @classmethod
    def of(cls, cells: Floats, free: Bools) -> Guard:
        """cells: (q, p, 3) in the pattern. free: (q, p) corners whose ears count."""
        p = cells.shape[1]
        ears = p > 3 and bool(free.any())
        triangles = inner_triangles(p)[: 2 * p if ears else p]
        area = triangle_areas(cells, triangles)
        asked = area > LEAST * area[:, :p].mean(axis=1, keepdims=True)
        asked[:, p:] &= free[:, : asked.shape[1] - p]
        return cls(triangles, np.where(asked, area, np.inf))

    def residuals(self, cells: Floats) -> Floats:
        """(q, t) of cells (q, p, 3); the energy is half the sum of their squares."""
        fan, ear = self._shortages(triangle_areas(cells, self.triangles))
        return np.concatenate([np.sqrt(HOLD) * fan, np.sqrt(BULGE) * ear], axis=1)

    def slopes(self, cells: Floats) -> Floats:
        """(q, t, p, 3) their derivatives by the corners."""
        fan, ear = self._shortages(triangle_areas(cells, self.triangles))
        beyond = np.isinf(fan)  # where only Newton's method at the end leads, which leaves the fan alone
        barrier = np.sqrt(HOLD) / FAN * (1 + np.where(beyond, 0.0, fan)) ** 2 * ((fan > 0) & ~beyond)
        by = np.concatenate([barrier, np.sqrt(BULGE) * (ear > 0)], axis=1)
        return np.asarray(triangle_slopes(cells, self.triangles) * (-by / self.usual)[:, :, None, None])

    def _shortages(self, area: Floats) -> tuple[Floats, Floats]:
        p = self.triangles.shape[2]
        kept = np.where(np.isfinite(self.usual), area / self.usual, 1.0)
        fan = np.where(kept[:, :p] > 0, np.maximum(FAN / np.maximum(kept[:, :p], 1e-300) - 1, 0.0), np.inf)
        return fan, np.maximum(EAR - kept[:, p:], 0.0)


def inner_triangles(p: int) -> Floats:
    """(2p, 3, p) the fan and the ears."""
    here, ahead, behind = (np.roll(np.eye(p), step, axis=1) for step in (0, 1, -1))
    fan = np.stack([np.full((p, p), 1 / p), here, ahead], axis=1)
    return np.concatenate([fan, np.stack([behind, here, ahead], axis=1)])


def free_corners(pattern: Pattern) -> Bools:
    """Aligned with faces.values: corners at which flat cells may be convex on any surface."""
    faces, edge = pattern.faces, pattern.neighbours.values < 0
    degree = np.bincount(faces.values, minlength=len(pattern.vertices))
    degree[faces.values[edge]] += 2
    degree[faces.values[faces.next()][edge]] += 2
    return np.asarray(degree[faces.values] >= 4)
