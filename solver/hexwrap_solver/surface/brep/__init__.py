"""Boundary representations (Rhino's polysurfaces, trimmed surfaces, extrusions) as plain data."""

from hexwrap_solver.surface.brep.mesh import BrepMesh, mesh_brep
from hexwrap_solver.surface.brep.types import Brep, Edge, Face, NurbsCurve, Trim, together

__all__ = ["Brep", "BrepMesh", "Edge", "Face", "NurbsCurve", "Trim", "mesh_brep", "together"]
