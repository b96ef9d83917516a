"""Gauss curvature of a triangle mesh by angle defects (Gauss–Bonnet)."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Floats, Ints
from hexwrap_solver.surface.types import Surface

#: Curvature of a face times its area below this is rounding: a flat mesh has none.
ROUNDING = 1e-9


#: Angle defects this near to a multiple, in parts of it, are one.
NEAR = 0.02


def saddle_share(surface: Surface) -> float:
    """Share of the surface's area with negative Gauss curvature, 0…1.

    A face's curvature is the mean of 2π − Σ angles, per area, at its corners inside the surface; faces with
    none of these count as flat.
    """
    defect, area, n = angle_defects(surface), surface.areas, len(surface.vertices)
    defect[surface.boundary] = 0.0
    around = np.bincount(surface.faces.ravel(), weights=np.repeat(area, 3), minlength=n)
    density = np.divide(defect, around, out=np.zeros(n), where=around > 0)
    return float(area[density[surface.faces].sum(axis=1) * area < -ROUNDING].sum() / area.sum())


def angle_defects(surface: Surface) -> Floats:
    """(n,) 2π − Σ angles at vertices inside, π − Σ angles on the boundary."""
    corner = surface.vertices[surface.faces]
    ahead, back = np.roll(corner, -1, axis=1) - corner, np.roll(corner, 1, axis=1) - corner
    normal = np.cross(ahead, back)
    angle = np.arctan2(np.linalg.norm(normal, axis=2), np.einsum("mcd,mcd->mc", ahead, back))
    defect = 2 * np.pi - np.bincount(surface.faces.ravel(), angle.ravel(), len(surface.vertices))
    defect[surface.boundary] -= np.pi
    return np.asarray(defect)


def cone_points(surface: Surface, quantum: float) -> tuple[Ints, Ints]:
    """Vertices inside whose angle defects are multiples of the quantum, as a quarter turn is at the corners
    of boxes and setbacks, and what multiples: there the surface is a flat cone already."""
    turns = angle_defects(surface) / quantum
    turns[surface.boundary] = 0.0
    index = np.rint(turns).astype(np.int64)
    found = np.flatnonzero((abs(turns - index) < NEAR) & (index != 0))
    return found, index[found]


def is_flat_with_cones(surface: Surface, quantum: float) -> bool:
    """Whether the surface is flat but for such vertices, of which it has some, and its boundary straight."""
    vertex, _ = cone_points(surface, quantum)
    defect = abs(angle_defects(surface))
    defect[vertex] = 0.0
    return len(vertex) > 0 and bool(defect.sum() < NEAR * quantum)
