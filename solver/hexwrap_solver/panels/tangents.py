"""Tangent planes of the surface at panel centres (paper, section 4: orientation by the master surface)."""

from __future__ import annotations

from hexwrap_solver.arrays import Floats
from hexwrap_solver.surface.normals import with_tangents
from hexwrap_solver.surface.projection import project, start_parameters
from hexwrap_solver.surface.types import Surface


def surface_normals(surface: Surface, points: Floats) -> Floats:
    """(k, 3) unit normals, on the outside, where the surface is nearest to the points (k, 3).

    From the tangents of the NURBS surface where there is one, else interpolated between the mesh's normals.
    """
    nearest = surface.tree.nearest(points)
    interpolated = surface.normals_at(nearest.face, nearest.barycentric)
    if surface.nurbs is None:
        return interpolated
    start = start_parameters(surface, nearest.face, nearest.barycentric)
    _, _, exact = project(surface.nurbs, points, start)
    return with_tangents(exact, interpolated)
