"""Panels for cells cut at the boundary: flat, of the cell's own shape, and clear of their neighbours."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Bools, Floats, Ragged
from hexwrap_solver.panels.polygons import area_vectors, means, row_minima


def plane_normals(polygons: Ragged) -> Floats:
    """(q, 3) unit normals of the polygons' mean planes (direction of the area vector)."""
    vector = area_vectors(polygons)
    length = np.linalg.norm(vector, axis=1)
    return vector / np.where(length > 0, length, 1.0)[:, None]


def flatten_and_clear(
    polygons: Ragged, normal: Floats, direction: Floats, offset: Floats, inner: Bools
) -> tuple[Ragged, Floats, Floats]:
    """Projects polygons on their planes and shrinks each about its centre until it clears its separating
    planes.

    normal: (q, 3). direction, offset, inner: per corner, the plane of the edge that begins there; only
    edges with a neighbour (inner) bind. Shrinking keeps corners and edges in step with those of the cell.
    Returns the polygons, centres (q, 3) and factors (q,); a factor ≤ 0 means that no room was left.
    """
    row = polygons.row
    center = means(polygons)
    spoke = polygons.values - center[row]
    spoke -= np.einsum("hd,hd->h", spoke, normal[row])[:, None] * normal[row]
    room = offset - np.einsum("hd,hd->h", direction, center[row])
    factor = np.where(row_minima(np.where(inner, room, 1.0), polygons.offsets) > 0, 1.0, -1.0)
    # Every corner against every plane of its polygon: polygons have few corners, so step around them.
    start, count = polygons.offsets[:-1][row], polygons.lengths[row]
    for step in range(int(polygons.lengths.max(initial=0))):
        k = start + (np.arange(len(row)) - start + step) % count
        extent = np.einsum("hd,hd->h", direction[k], spoke)
        allowed = np.divide(
            room[k], extent, out=np.ones(len(row)), where=inner[k] & (extent > room[k]) & (extent > 0)
        )
        factor = np.minimum(factor, row_minima(allowed, polygons.offsets))
    return Ragged(center[row] + np.maximum(factor, 0.0)[row, None] * spoke, polygons.offsets), center, factor
