"""Boundary representations (Rhino's polysurfaces, trimmed surfaces, extrusions) as plain data."""

from hexwrap_solver.surface.brep.types import Brep, Edge, Face, NurbsCurve, Trim, together

__all__ = ["Brep", "Edge", "Face", "NurbsCurve", "Trim", "together"]
