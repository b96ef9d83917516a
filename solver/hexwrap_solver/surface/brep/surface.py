"""From a Brep to the surface that is mapped: its mesh, with exact normals and creases, is taken in as any."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Ragged
from hexwrap_solver.surface.brep.mesh import mesh_brep
from hexwrap_solver.surface.brep.types import Brep
from hexwrap_solver.surface.intake import surface_from_mesh
from hexwrap_solver.surface.types import SentMesh, Surface, SurfaceSettings


def surface_from_brep(brep: Brep, settings: SurfaceSettings | None = None) -> Surface:
    """input_vertex numbers the vertices of the mesh. Raises SurfaceError."""
    settings = settings or SurfaceSettings()
    return surface_from_mesh(sent_of_brep(brep, settings), settings)


def sent_of_brep(brep: Brep, settings: SurfaceSettings) -> SentMesh:
    mesh = mesh_brep(brep, settings.mesh)
    faces = Ragged.from_table(mesh.faces)
    return SentMesh(mesh.vertices, faces, mesh.normals, mesh.creases, np.asarray(mesh.fold))
