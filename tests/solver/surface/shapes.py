"""Small meshes for the tests."""

from __future__ import annotations

import numpy as np

from hexwrap_solver.arrays import Floats, Ints, Ragged
from hexwrap_solver.surface import SentMesh


def tube(rings: int = 5, around: int = 7) -> tuple[Floats, Ints]:
    """A waisted tube: vertices ring by ring from below, and quads, outward."""
    i, j = np.divmod(np.arange(rings * around), around)
    z = i / max(rings - 1, 1)
    angle = 2 * np.pi * j / around
    radius = 1 + (z - 0.4) ** 2
    vertices = np.stack([radius * np.cos(angle), radius * np.sin(angle), 2 * z], axis=1)
    i, j = np.divmod(np.arange((rings - 1) * around), around)
    a, b = i * around + j, i * around + (j + 1) % around
    return vertices, np.stack([a, b, b + around, a + around], axis=1)


def twisted(vertices: Floats, by: float = 0.4) -> Floats:
    """Turned about the axis by an angle that grows with the height."""
    x, y, z = vertices.T
    c, s = np.cos(by * z), np.sin(by * z)
    return np.stack([x * c - y * s, x * s + y * c, z], axis=1)


def triangles(quads: Ints) -> Ints:
    """Two triangles of every quad, one after the other."""
    return quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)


def mesh(vertices: Floats, faces: Ints | list[list[int]], normals: Floats | None = None) -> SentMesh:
    if isinstance(faces, list):
        lengths = [len(face) for face in faces]
        values = np.array([v for face in faces for v in face], dtype=np.int64)
        return SentMesh(np.asarray(vertices, float), Ragged(values, np.cumsum([0, *lengths])), normals)
    return SentMesh(np.asarray(vertices, float), Ragged.from_table(faces), normals)
