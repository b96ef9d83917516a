"""Intake of a surface: a sent mesh or a NURBS surface becomes an annulus of triangles."""

from hexwrap_solver.surface.holes import with_openings
from hexwrap_solver.surface.intake import surface_from_mesh
from hexwrap_solver.surface.meshing import surface_from_nurbs
from hexwrap_solver.surface.types import MeshSettings, NurbsSurface, SentMesh, Surface

__all__ = [
    "MeshSettings",
    "NurbsSurface",
    "SentMesh",
    "Surface",
    "surface_from_mesh",
    "surface_from_nurbs",
    "with_openings",
]
