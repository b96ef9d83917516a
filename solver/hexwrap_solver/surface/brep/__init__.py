"""Boundary representations (Rhino's polysurfaces, trimmed surfaces, extrusions) as plain data."""

from hexwrap_solver.surface.brep.join import Joints, joined
from hexwrap_solver.surface.brep.mesh import BrepMesh, mesh_brep
from hexwrap_solver.surface.brep.surface import surface_from_brep, surface_from_patch
from hexwrap_solver.surface.brep.types import Brep, Edge, Face, NurbsCurve, Trim, together
from hexwrap_solver.surface.brep.whole import brep_of_surface

__all__ = [
    "Brep",
    "BrepMesh",
    "Edge",
    "Face",
    "Joints",
    "NurbsCurve",
    "Trim",
    "brep_of_surface",
    "joined",
    "mesh_brep",
    "surface_from_brep",
    "surface_from_patch",
    "together",
]
