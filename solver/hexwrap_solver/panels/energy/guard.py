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

from hexwrap_solver.arrays import Bools, Floats, Ints
from hexwrap_solver.panels.energy.seen import Seen
from hexwrap_solver.pattern.types import Pattern
from hexwrap_solver.tolerances import TINY

FAN, HOLD = 0.4, 0.1
EAR, BULGE = 0.2, 4.0

#: Triangles smaller than this fraction of the mean of their cell's fan, as trimmed cells have, do not count.
LEAST = 0.05


@dataclass(frozen=True)
class Guard:
    """Of q cells with p corners. usual: (q, p) or (q, 2p) areas in the pattern, ∞ for those left alone; the
    first p are the fan, the others, if any, ears."""

    usual: Floats

    @classmethod
    def of(cls, cells: Floats, free: Bools) -> Guard:
        """cells: (q, p, 3) in the pattern. free: (q, p) corners whose ears count."""
        p = cells.shape[1]
        seen = Seen.of(cells)
        area = np.concatenate([seen.fan(), seen.ears()], axis=1)[:, : 2 * p if p > 3 and free.any() else p]
        asked = area > LEAST * area[:, :p].mean(axis=1, keepdims=True)
        asked[:, p:] &= free[:, : asked.shape[1] - p]
        return cls(np.where(asked, area, np.inf))

    def residuals(self, seen: Seen) -> Floats:
        """(q, t) of the cells; the energy is half the sum of their squares."""
        fan, ear = self._shortages(seen)
        return np.concatenate([np.sqrt(HOLD) * fan, np.sqrt(BULGE) * ear], axis=1)

    def slopes(self, seen: Seen) -> tuple[Ints, Floats]:
        """(k,) cells that feel the barrier, and (k, t, p, 3) the derivatives of their residuals by the
        corners."""
        fan, ear = self._shortages(seen)
        beyond = np.isinf(fan)  # where only Newton's method at the end leads, which leaves the fan alone
        barrier = np.sqrt(HOLD) / FAN * (1 + np.where(beyond, 0.0, fan)) ** 2 * ((fan > 0) & ~beyond)
        by = np.concatenate([barrier, np.sqrt(BULGE) * (ear > 0)], axis=1)
        cell = np.flatnonzero(by.any(axis=1))
        slope = triangle_slopes(seen.take(cell))[:, : by.shape[1]]
        return cell, slope * (-by / self.usual)[cell, :, None, None]

    def _shortages(self, seen: Seen) -> tuple[Floats, Floats]:
        p = seen.x.shape[1]
        fan, ear = seen.fan() / self.usual[:, :p], np.zeros((len(seen.x), 0))
        fan = np.where(np.isfinite(self.usual[:, :p]), fan, 1.0)
        fan = np.where(fan > 0, np.maximum(FAN / np.maximum(fan, TINY) - 1, 0.0), np.inf)
        if self.usual.shape[1] > p:
            ear = np.where(np.isfinite(self.usual[:, p:]), EAR - seen.ears() / self.usual[:, p:], 0.0)
        return fan, np.maximum(ear, 0.0)


def triangle_slopes(seen: Seen) -> Floats:
    """(q, 2p, p, 3) derivatives of the areas of fan and ears by the corners.

    They hold for flat polygons: how the normal turns is left out, which areas there do not feel.
    """
    p = seen.x.shape[1]
    triangles = inner_triangles(p)
    a, b, c = (triangles[:, k] for k in range(3))
    plane = np.stack([seen.x, seen.y], axis=2)
    opposite, spoke = (c - b) @ plane, (a - b) @ plane
    turned, along = (np.stack([-v[..., 1], v[..., 0]], axis=2) / 2 for v in (opposite, spoke))
    # The first corner moves against the opposite edge, the others against the spokes.
    slope = turned[:, :, None] * (a - b)[..., None] - along[:, :, None] * (c - b)[..., None]
    return np.asarray(slope @ seen.axes[:, None, :2])


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
