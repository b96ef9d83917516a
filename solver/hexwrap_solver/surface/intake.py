"""From a sent mesh to an annulus."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Ints
from hexwrap_solver.surface.errors import (
    NonManifoldEdgeError,
    NotAnnulusError,
    PolygonSizeError,
    SeveralComponentsError,
)
from hexwrap_solver.surface.topology import boundary_loops, edge_groups, face_component, twins, vertex_normals
from hexwrap_solver.surface.types import SentMesh, Surface


def surface_from_mesh(sent: SentMesh) -> Surface:
    """The annulus that a sent mesh describes. Raises SurfaceError (its children in ``surface/errors.py``)."""
    used = np.unique(np.asarray(sent.faces.values, dtype=np.int64))
    vertex_of_input = np.full(len(sent.vertices), -1, dtype=np.int64)
    vertex_of_input[used] = np.arange(len(used))
    vertices = sent.vertices[used]
    faces = vertex_of_input[_triangles(sent)]
    loops = _annulus(faces, len(used), used)
    normals = vertex_normals(vertices, faces)
    return Surface(vertices, faces, loops, used, vertex_of_input, normals)


def _triangles(sent: SentMesh) -> Ints:
    lengths = sent.faces.lengths
    if np.any((lengths != 3) & (lengths != 4)):
        wrong = np.flatnonzero((lengths != 3) & (lengths != 4))
        raise PolygonSizeError(
            f"Face {wrong[0]} has {lengths[wrong[0]]} corners; only triangles and quads can be read: "
            "triangulate the mesh.",
            faces=wrong,
        )
    first = sent.faces.offsets[:-1]
    quad = first[lengths == 4]
    corners = np.asarray(sent.faces.values, dtype=np.int64)
    one = corners[first[:, None] + [0, 1, 2]]
    two = corners[quad[:, None] + [0, 2, 3]]
    return np.concatenate([one, two])


def _annulus(faces: Ints, n: int, sent_index: Ints) -> tuple[Ints, Ints]:
    order, first = edge_groups(faces, n)
    if np.any(np.diff(first) > 2):
        wrong = order[first[:-1][np.diff(first) > 2]]
        ends = sent_index[np.stack([faces.ravel()[wrong], np.roll(faces, -1, 1).ravel()[wrong]], axis=1)]
        raise NonManifoldEdgeError(
            f"{len(ends)} edges have more than two faces, the first {ends[0].tolist()}.",
            edges=ends.tolist(),
        )
    twin = twins(faces, n)
    if len(face_component(twin)) < len(faces):
        raise SeveralComponentsError("The surface is in more than one piece: send one piece only.")
    loops = boundary_loops(faces, twin)
    if len(loops) != 2 or n - (len(first) - 1) + len(faces) != 0:
        raise NotAnnulusError(f"The surface has {len(loops)} boundary loops, not two.")
    return loops[0], loops[1]
