"""What must hold of the sent arrays before anything is computed with them."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Floats
from hexwrap_solver.surface.errors import (
    EmptySurfaceError,
    FlatSurfaceError,
    IndexRangeError,
    NonFiniteError,
    PolygonSizeError,
    ShapeError,
)
from hexwrap_solver.surface.types import SentMesh

#: Fourth powers of coordinates, which areas squared are, must neither overflow nor vanish.
LARGEST, SMALLEST = 1e60, 1e-60
#: At most this many faulty elements are listed in an error.
LISTED = 1000


def check_arrays(sent: SentMesh) -> None:
    """Raises SurfaceError for empty or misshapen arrays, coordinates that are not finite numbers, faces
    with other than 3 or 4 corners, and indices out of range."""
    if sent.vertices.ndim != 2 or sent.vertices.shape[1] != 3 or sent.faces.values.ndim != 1:
        raise ShapeError(
            f"Vertices have the shape {sent.vertices.shape}; rows of three coordinates are needed, and faces "
            "as rows of vertex indices."
        )
    if len(sent.vertices) == 0 or sent.faces.n_rows == 0:
        raise EmptySurfaceError(
            f"The mesh has {len(sent.vertices)} vertices and {sent.faces.n_rows} faces: both are needed."
        )
    check_finite(sent.vertices, "Vertex")
    if sent.normals is not None and sent.normals.shape != sent.vertices.shape:
        raise ShapeError(
            f"There are {len(sent.normals)} normals for {len(sent.vertices)} vertices: send one (x, y, z) "
            "per vertex, or none at all.",
            field=("normals",),
        )
    _check_faces(sent)


def check_finite(points: Floats, what: str, field: tuple[str | int, ...] = ("vertices",)) -> None:
    """Raises NonFiniteError for NaN, infinities and magnitudes whose areas a double cannot hold."""
    fine = np.abs(points) < LARGEST
    if not fine.all():
        bad = np.flatnonzero(~fine.all(axis=1))
        raise NonFiniteError(
            f"{what} {bad[0]} is at {points[bad[0]].tolist()} ({len(bad)} such in all): coordinates must be "
            f"finite numbers below {LARGEST:g}.",
            vertices=bad[:LISTED],
            field=field,
        )


def check_extent(size: float) -> None:
    """size: bounding diagonal of what the faces use. Raises FlatSurfaceError."""
    if size < SMALLEST:
        raise FlatSurfaceError(
            f"All vertices lie within {size:g} of each other: send a surface that has an extent."
        )


def _check_faces(sent: SentMesh) -> None:
    lengths, indices = sent.faces.lengths, sent.faces.values
    wrong = np.flatnonzero((lengths < 3) | (lengths > 4))
    if len(wrong):
        raise PolygonSizeError(
            f"Face {wrong[0]} has {lengths[wrong[0]]} corners ({len(wrong)} such in all): only triangles and "
            "quads can be used, so triangulate the mesh first.",
            faces=wrong[:LISTED],
        )
    if not np.issubdtype(indices.dtype, np.integer):
        raise ShapeError("Face indices must be integers.", field=("faces",))
    out = (indices < 0) | (indices >= len(sent.vertices))
    if out.any():
        faces = np.unique(sent.faces.row[out])
        raise IndexRangeError(
            f"Face {faces[0]} points at vertex {indices[out][0]}, but the {len(sent.vertices)} vertices sent "
            f"have the indices 0 to {len(sent.vertices) - 1} ({len(faces)} such faces in all).",
            faces=faces[:LISTED],
        )
