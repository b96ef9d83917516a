"""PLY and STL, by trimesh, which is loaded with the first such file: most servers never see one."""

from __future__ import annotations

import io

import numpy as np

from hexwrap_server.input.readers.errors import UnreadableFileError
from hexwrap_solver.arrays import Ragged
from hexwrap_solver.surface import SentMesh


def read_ply(data: bytes) -> SentMesh:
    """Triangles, or quads where all faces are; trimesh splits mixed ones."""
    from trimesh.exchange.ply import load_ply

    return _sent(load_ply(io.BytesIO(data), fix_texture=False, skip_materials=True), "PLY")


def read_stl(data: bytes) -> SentMesh:
    """Binary or text; three vertices of its own for each triangle."""
    from trimesh.exchange.stl import load_stl

    sent = _sent(load_stl(io.BytesIO(data)), "STL")
    return SentMesh(sent.vertices, sent.faces)  # its normals belong to faces


def _sent(loaded: dict[str, object], kind: str) -> SentMesh:
    vertices, faces = (np.asarray(loaded.get(key, ())) for key in ("vertices", "faces"))
    if vertices.size == 0 or faces.size == 0:
        raise UnreadableFileError(f"The {kind} file holds no mesh: it has no vertices or no faces.")
    normals = loaded.get("vertex_normals")
    return SentMesh(
        vertices.astype(float),
        Ragged.from_table(faces.astype(np.int64)),
        None if normals is None else np.asarray(normals, dtype=float),
    )
