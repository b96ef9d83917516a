"""Rhino's .3dm: one mesh, or one untrimmed surface."""

from __future__ import annotations

from typing import Any

import numpy as np
import rhino3dm

from hexwrap_server.input.readers.errors import SeveralObjectsError, UnreadableFileError
from hexwrap_server.input.readers.rhino_brep import nurbs_surface
from hexwrap_solver.arrays import Floats, Ragged
from hexwrap_solver.surface import NurbsSurface, SentMesh

#: Rhino's geometry types that are surfaces; curves, points, lights and texts beside them do no harm.
SURFACES = (rhino3dm.Mesh, rhino3dm.Brep, rhino3dm.Surface)


def read_3dm(data: bytes) -> SentMesh | NurbsSurface:
    """The only surface of the file. Raises SeveralObjectsError, UnreadableFileError."""
    model: Any = rhino3dm.File3dm.FromByteArray(data)
    if model is None:
        raise UnreadableFileError("The file is no Rhino file, or it is cut short: save it again from Rhino.")
    objects = [item for item in model.Objects if not item.Attributes.IsInstanceDefinitionObject]
    found = [item for item in objects if isinstance(item.Geometry, SURFACES)]
    if not found:
        kinds = sorted({type(item.Geometry).__name__ for item in objects})
        raise UnreadableFileError(
            f"The Rhino file holds no mesh or surface (but {', '.join(kinds) or 'nothing at all'}): save the "
            "tube as a mesh or as one untrimmed surface."
        )
    if len(found) > 1:
        named = [f"{type(item.Geometry).__name__} {_name(item)}" for item in found]
        listed = ", ".join(named[:6]) + (" …" if len(named) > 6 else "")
        raise SeveralObjectsError(
            f"The Rhino file holds {len(found)} surfaces ({listed}): save the one that is to be "
            "panelized alone, or join them into one mesh.",
            data={"objects": named[:100]},
        )
    return convert(found[0].Geometry)


def _name(item: Any) -> str:
    return f"'{item.Attributes.Name}'" if item.Attributes.Name else str(item.Attributes.Id)


def convert(geometry: Any) -> SentMesh | NurbsSurface:
    """One mesh, polysurface or surface of rhino3dm. Raises UnreadableFileError."""
    if isinstance(geometry, rhino3dm.Mesh):
        return _mesh(geometry)
    if isinstance(geometry, rhino3dm.Brep):
        return _brep(geometry)
    return nurbs_surface(geometry)


def _brep(brep: Any) -> SentMesh | NurbsSurface:
    """Its surface where it has one untrimmed face, else the render meshes that Rhino saved with it."""
    faces = [brep.Faces[i] for i in range(len(brep.Faces))]
    if len(faces) == 1 and brep.IsSurface:
        surface = nurbs_surface(faces[0].UnderlyingSurface())
        return _turned(surface) if faces[0].OrientationIsReversed else surface
    meshes = [face.GetMesh(rhino3dm.MeshType.Any) for face in faces]
    if any(mesh is None for mesh in meshes):
        raise UnreadableFileError(
            f"The Rhino file holds a polysurface of {len(faces)} faces or a trimmed surface, without its "
            "render mesh: save it with render meshes, or convert it with Rhino's Mesh command."
        )
    parts = [_mesh(mesh) for mesh in meshes]
    first = np.cumsum([0, *(len(part.vertices) for part in parts)])
    corners = np.concatenate([part.faces.values + k for part, k in zip(parts, first, strict=False)])
    lengths = np.concatenate([part.faces.lengths for part in parts])
    return SentMesh(
        np.concatenate([part.vertices for part in parts]),
        Ragged(corners.astype(np.int64), np.concatenate([[0], np.cumsum(lengths)])),
    )


def _mesh(mesh: Any) -> SentMesh:
    vertices = np.array([_xyz(mesh.Vertices.Point3dAt(i)) for i in range(len(mesh.Vertices))], dtype=float)
    table = np.array([mesh.Faces[i] for i in range(len(mesh.Faces))], dtype=np.int64).reshape(-1, 4)
    if table.size == 0:
        raise UnreadableFileError("The mesh in the Rhino file has no faces.")
    keep = np.ones(table.shape, dtype=bool)
    keep[:, 3] = table[:, 3] != table[:, 2]
    offsets = np.concatenate([[0], np.cumsum(keep.sum(axis=1))])
    return SentMesh(vertices, Ragged(table[keep], offsets), _normals(mesh, len(vertices)))


def _normals(mesh: Any, n: int) -> Floats | None:
    if len(mesh.Normals) != n:
        return None
    return np.array([_xyz(mesh.Normals[i]) for i in range(n)], dtype=float)


def _xyz(point: Any) -> tuple[float, float, float]:
    return point.X, point.Y, point.Z


def _turned(surface: NurbsSurface) -> NurbsSurface:
    """The same surface seen from its other side: the second parameter runs backwards."""
    u, v = surface.knots
    return NurbsSurface(surface.degree, (u, -v[::-1]), surface.control_points[:, ::-1], surface.closed)
