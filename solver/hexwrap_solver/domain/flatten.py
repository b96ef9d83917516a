"""Points near the surface, laid out in the unrolled domain: the inverse of lifting."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexwrap_solver.arrays import Complexes, Floats, Ints
from hexwrap_solver.conformal.types import ConformalMap
from hexwrap_solver.domain.interpolate import domain_weights


@dataclass(frozen=True)
class Flattened:
    """uv: (k,) complex places in the unrolled domain, in one sheet, or of the net. distance: (k,) of each
    point from the surface, model units. face: (k,) triangle with the nearest point; barycentric: (k, 3)
    there."""

    uv: Complexes
    distance: Floats
    face: Ints
    barycentric: Floats


def flatten(cmap: ConformalMap, points: Floats) -> Flattened:
    """Carry the surface points nearest to (k, 3) points into the domain."""
    points = np.asarray(points, dtype=float).reshape(-1, 3)
    surface = cmap.surface
    near = surface.tree.nearest(points)
    weights = domain_weights(cmap, near.face, near.barycentric)
    corners = cmap.corners()[near.face]
    return Flattened((weights * corners).sum(axis=1), near.distance, near.face, near.barycentric)
