"""From a Brep, or any NURBS surface, to the surface that is mapped.

The mesh of a Brep, with its exact normals and creases, is taken in as any mesh. Smooth tubes without trims
have a mesher of their own, whose rows have no seam.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hexwrap_solver.arrays import Ragged
from hexwrap_solver.errors import SurfaceError
from hexwrap_solver.surface.brep.kinks import is_smooth
from hexwrap_solver.surface.brep.mesh import BrepMesh, mesh_brep
from hexwrap_solver.surface.brep.types import Brep
from hexwrap_solver.surface.brep.whole import brep_of_surface
from hexwrap_solver.surface.errors import (
    NonManifoldEdgeError,
    NotClosedError,
    PoleError,
    TrimError,
)
from hexwrap_solver.surface.intake import surface_from_mesh
from hexwrap_solver.surface.meshing import surface_from_nurbs
from hexwrap_solver.surface.nurbs_checks import TOLERANCE, check_data, check_pinches, checked
from hexwrap_solver.surface.orient import is_inside_out
from hexwrap_solver.surface.pieces import joined, together
from hexwrap_solver.surface.topology import twins
from hexwrap_solver.surface.types import NurbsSurface, SentMesh, Surface, SurfaceSettings

#: Rhino turns closed polysurfaces outwards when they are drawn; other programs' files hold what they hold.
INSIDE_OUT = "The closed polysurface was inside out and was turned, as Rhino does."


def surface_from_brep(brep: Brep, settings: SurfaceSettings | None = None) -> Surface:
    """input_vertex numbers the vertices of the mesh. Where faces have trims that cannot be meshed, the meshes
    that came with them are taken, which repairs says. Raises SurfaceError."""
    settings = settings or SurfaceSettings()
    try:
        mesh = mesh_brep(brep, settings.mesh)
        twin = twins(mesh.faces, len(mesh.vertices))
        if len(brep.faces) > 1 and (twin >= 0).all() and is_inside_out(mesh.vertices, mesh.faces, twin):
            surface = surface_from_mesh(_sent(mesh, turned=True), settings)
            return replace(surface, repairs=(INSIDE_OUT, *surface.repairs)).knowing(surface)
        return surface_from_mesh(_sent(mesh), settings)
    except (TrimError, NonManifoldEdgeError) as error:
        render = [face.render for face in brep.faces if face.render is not None]
        if len(render) < len(brep.faces):
            raise
        try:
            sent, _, joint = joined(together(render)[0], brep.tolerance)
            surface = surface_from_mesh(sent, settings)
        except SurfaceError:
            raise error from None
        reason = error.detail.partition(": ")[0]
        sentence = (
            f"The file's own render meshes of {len(render)} faces were taken, joined with gaps of up to "
            f"{joint.gap:.3g}. {reason}."
        )
        return replace(surface, repairs=(sentence, *surface.repairs)).knowing(surface)


def surface_from_patch(
    nurbs: NurbsSurface, settings: SurfaceSettings | None = None, tolerance: float | None = None
) -> Surface:
    """A NURBS surface without trims: a tube, a dome, an open sheet, smooth or with corners.

    tolerance: ends closer than this are one seam; None: a millionth of the size. Raises SurfaceError.
    """
    settings = settings or SurfaceSettings()
    check_data(nurbs)
    check_pinches(nurbs)
    try:
        checked(nurbs)
        if is_smooth(nurbs):
            return surface_from_nurbs(nurbs, settings.mesh)
    except PoleError:
        pass
    except NotClosedError:
        if any(nurbs.closed):
            raise
    tolerance = max(tolerance or 0.0, TOLERANCE * nurbs.size)
    return surface_from_brep(brep_of_surface(nurbs, tolerance), settings)


def _sent(mesh: BrepMesh, turned: bool = False) -> SentMesh:
    turn, sign = ([0, 2, 1], -1.0) if turned else ([0, 1, 2], 1.0)
    faces = Ragged.from_table(mesh.faces[:, turn])
    return SentMesh(mesh.vertices, faces, sign * mesh.normals, mesh.creases, np.asarray(mesh.fold))
