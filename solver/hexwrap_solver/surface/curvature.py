"""Gauss curvature of a triangle mesh by angle defects (Gauss–Bonnet)."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.surface.types import Surface

#: Curvature of a face times its area below this is rounding: a flat mesh has none.
ROUNDING = 1e-9


def saddle_share(surface: Surface) -> float:
    """Share of the surface's area with negative Gauss curvature, 0…1.

    A face's curvature is the mean of 2π − Σ angles, per area, at its corners inside the surface; faces with
    none of these count as flat.
    """
    corner = surface.vertices[surface.faces]
    ahead, back = np.roll(corner, -1, axis=1) - corner, np.roll(corner, 1, axis=1) - corner
    normal = np.cross(ahead, back)
    angle = np.arctan2(np.linalg.norm(normal, axis=2), np.einsum("mcd,mcd->mc", ahead, back))
    area = np.linalg.norm(normal[:, 0], axis=1) / 2
    at, n = surface.faces.ravel(), len(surface.vertices)
    defect = 2 * np.pi - np.bincount(at, weights=angle.ravel(), minlength=n)
    defect[surface.boundary] = 0.0
    around = np.bincount(at, weights=np.repeat(area, 3), minlength=n)
    density = np.divide(defect, around, out=np.zeros(n), where=around > 0)
    return float(area[density[surface.faces].sum(axis=1) * area < -ROUNDING].sum() / area.sum())
