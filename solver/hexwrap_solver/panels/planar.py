"""Polygons seen in their own planes."""

from __future__ import annotations

import numpy as np
import shapely

from hexwrap_solver.arrays import Bools, Floats, Ints, Ragged
from hexwrap_solver.geometry import plane_axes


def in_planes(polygons: Ragged, center: Floats, axes: Floats) -> Floats:
    """(h, 2) corners about the centres (q, 3)."""
    row = polygons.row
    return np.asarray(np.einsum("hed,hd->he", axes[row], polygons.values - center[row]))


def outlines(corner: Floats, row: Ints) -> shapely.Geometry:
    """(q,) polygons of corners (h, 2), row by row."""
    return shapely.polygons(shapely.linearrings(corner, indices=row))


def crossing_themselves(polygons: Ragged, center: Floats, normal: Floats) -> Bools:
    """(q,) polygons whose edges cross or touch each other, seen along their normals."""
    if not polygons.n_rows:
        return np.zeros(0, dtype=bool)
    corner = in_planes(polygons, center, plane_axes(normal))
    return np.asarray(~shapely.is_valid(outlines(corner, polygons.row)))
