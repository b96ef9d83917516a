"""rhino3dm's polysurfaces, trimmed surfaces, extrusions and SubDs as the solver's plain data."""

from __future__ import annotations

from typing import Any

import numpy as np
import rhino3dm

from hexwrap_server.errors import UnreadableFileError
from hexwrap_server.input.readers.rhino_model import xyz
from hexwrap_solver.arrays import Floats, Ragged
from hexwrap_solver.surface import NurbsSurface, SentMesh
from hexwrap_solver.surface.brep import Brep, Edge, Face, NurbsCurve, Trim

#: A SubD's control net is subdivided so often; its vertices then lie within 1/256 of a face of the limit.
SUBDIVISIONS = 3


def brep_of(geometry: Any, tolerance: float) -> Brep:
    """A polysurface, surface or extrusion. tolerance: the file's. Raises UnreadableFileError."""
    brep = _as_brep(geometry)
    if brep is None or len(brep.Faces) == 0:
        raise UnreadableFileError(
            f"The {type(geometry).__name__} in the Rhino file has no faces: run SelBadObjects in Rhino, "
            "then explode and join it again."
        )
    vertices = np.array([xyz(vertex.Location) for vertex in brep.Vertices], dtype=float).reshape(-1, 3)
    ends: dict[int, tuple[int, int]] = {}
    faces = []
    for face in brep.Faces:
        loops = sorted(face.Loops, key=lambda loop: loop.LoopType != rhino3dm.BrepLoopType.Outer)
        trims = tuple(tuple(_trim(trim, ends) for trim in loop.Trims) for loop in loops)
        surface = nurbs_surface(face.UnderlyingSurface())
        faces.append(Face(surface, trims, bool(face.OrientationIsReversed), _render(face)))
    edges = tuple(_edge(edge, ends.get(i, (-1, -1))) for i, edge in enumerate(brep.Edges))
    return Brep(vertices, edges, tuple(faces), tolerance)


def _render(face: Any) -> SentMesh | None:
    mesh = face.GetMesh(rhino3dm.MeshType.Any)
    return rhino_mesh(mesh) if mesh is not None and len(mesh.Faces) else None


def _as_brep(geometry: Any) -> Any:
    if isinstance(geometry, rhino3dm.Brep):
        return geometry
    if isinstance(geometry, rhino3dm.Extrusion):
        return geometry.ToBrep(True)
    return rhino3dm.Brep.TryConvertBrep(geometry)


def _trim(trim: Any, ends: dict[int, tuple[int, int]]) -> Trim:
    made = Trim(
        int(trim.EdgeIndex), bool(trim.IsReversed), int(trim.StartVertexIndex), int(trim.EndVertexIndex)
    )
    if made.edge >= 0:
        ends[made.edge] = (made.end, made.start) if made.reversed else (made.start, made.end)
    return made


def _edge(edge: Any, ends: tuple[int, int]) -> Edge:
    curve = edge.ToNurbsCurve()
    if curve is None:
        raise UnreadableFileError("An edge in the Rhino file has no NURBS form: run RebuildEdges in Rhino.")
    net = np.array([(*xyz(p), p.W) for p in curve.Points], dtype=float)
    net[:, :3] /= net[:, 3:]
    made = NurbsCurve(int(curve.Degree), _full(curve.Knots), net)
    return Edge(made, made.domain, *ends)


def nurbs_surface(surface: Any) -> NurbsSurface:
    """Rhino multiplies control points by their weights. Raises UnreadableFileError."""
    nurbs: Any = surface if isinstance(surface, rhino3dm.NurbsSurface) else surface.ToNurbsSurface()
    if nurbs is None:
        raise UnreadableFileError("The surface in the Rhino file has no NURBS form: run Mesh in Rhino.")
    points = nurbs.Points
    net = np.array(
        [
            [(*xyz(p), p.W) for p in (points[i, j] for j in range(points.CountV))]
            for i in range(points.CountU)
        ],
        dtype=np.float64,
    )
    net[..., :3] /= net[..., 3:]
    return NurbsSurface(
        (nurbs.Degree(0), nurbs.Degree(1)),
        (_full(nurbs.KnotsU), _full(nurbs.KnotsV)),
        net,
        (bool(nurbs.IsClosed(0)), bool(nurbs.IsClosed(1))),
    )


def rhino_mesh(mesh: Any) -> SentMesh:
    """Raises UnreadableFileError."""
    vertices = np.array([xyz(mesh.Vertices.Point3dAt(i)) for i in range(len(mesh.Vertices))], dtype=float)
    table = np.array([mesh.Faces[i] for i in range(len(mesh.Faces))], dtype=np.int64).reshape(-1, 4)
    if table.size == 0:
        raise UnreadableFileError(
            "The mesh in the Rhino file has no faces: delete it (Rhino's SelBadObjects)."
        )
    keep = np.ones(table.shape, dtype=bool)
    keep[:, 3] = table[:, 3] != table[:, 2]
    return SentMesh(vertices, Ragged.of(table[keep], keep.sum(axis=1)), _normals(mesh, len(vertices)))


def _normals(mesh: Any, n: int) -> Floats | None:
    if len(mesh.Normals) != n:
        return None
    return np.array([xyz(mesh.Normals[i]) for i in range(n)], dtype=float)


def _full(knots: Any) -> Floats:
    """Rhino leaves out the first and the last knot, which no basis function depends on."""
    k = np.array(list(knots), dtype=np.float64)
    return np.concatenate([k[:1], k, k[-1:]])


def subd_mesh(subd: Any) -> Any:
    """The mesh of a SubD, subdivided; None where rhino3dm cannot."""
    copy = subd.Duplicate()
    return control_net(copy) if copy.Subdivide(SUBDIVISIONS) else None


def control_net(subd: Any) -> Any:
    try:
        return rhino3dm.Mesh.CreateFromSubDControlNet(subd, False)
    except TypeError:  # older versions ask for no texture coordinates
        return rhino3dm.Mesh.CreateFromSubDControlNet(subd)
