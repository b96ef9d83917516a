"""OBJ and OFF, the text formats with faces of any size.

Read here, and not through trimesh, because it triangulates them and renumbers OBJ vertices by their texture
coordinates, while boundary angles are given at the vertices of the file.
"""

from __future__ import annotations

import re

import numpy as np

from hexwrap_server.input.readers.errors import UnreadableFileError
from hexwrap_solver.arrays import Floats, Ints, Ragged
from hexwrap_solver.surface import SentMesh


def read_obj(data: bytes) -> SentMesh:
    """Every ``v`` and ``f`` of the file, whatever its objects and groups."""
    lines = [line.strip() for line in re.sub(rb"\\\r?\n", b" ", data).splitlines()]
    kinds = [line[:2] for line in lines]
    at_vertex = np.flatnonzero([kind in (b"v ", b"v\t") for kind in kinds])
    at_face = np.flatnonzero([kind in (b"f ", b"f\t") for kind in kinds])
    if len(at_vertex) == 0 or len(at_face) == 0:
        raise UnreadableFileError("The OBJ file holds no mesh: no 'v' or no 'f' lines were found.")
    vertices = _coordinates([lines[i][2:] for i in at_vertex])
    rows = [re.sub(rb"/\S*", b"", lines[i].split(b"#")[0][2:]).split() for i in at_face]
    faces = _ragged(rows)
    index = np.asarray(faces.values, dtype=np.int64)
    before = np.searchsorted(at_vertex, at_face)  # negative indices count back from the vertices so far
    index = np.where(index < 0, index + np.repeat(before, faces.lengths), index - 1)
    return SentMesh(vertices, Ragged(index, faces.offsets))


def read_off(data: bytes) -> SentMesh:
    """OFF, also with colours or normals behind the coordinates."""
    lines = [line for line in (raw.split(b"#")[0].split() for raw in data.splitlines()) if line]
    if not lines or not lines[0][0].endswith(b"OFF"):
        raise UnreadableFileError("The file does not begin with OFF.")
    body = lines[1:] if len(lines[0]) == 1 else [lines[0][1:], *lines[1:]]
    n, m = int(body[0][0]), int(body[0][1])
    if n < 0 or m < 0 or len(body) < 1 + n + m:
        raise UnreadableFileError(
            f"The OFF file announces {n} vertices and {m} faces but has only {len(body) - 1} lines: "
            "it is cut short."
        )
    rows = [row[1 : 1 + int(row[0])] for row in body[1 + n : 1 + n + m]]
    return SentMesh(_table([row[:3] for row in body[1 : 1 + n]]), _ragged(rows))


def _coordinates(lines: list[bytes]) -> Floats:
    return _table([line.split()[:3] for line in lines])


def _table(rows: list[list[bytes]]) -> Floats:
    """(n, 3)."""
    if any(len(row) != 3 for row in rows):
        raise UnreadableFileError("A vertex has less than three coordinates.")
    return np.array([x for row in rows for x in row]).astype(float).reshape(-1, 3)


def _ragged(rows: list[list[bytes]]) -> Ragged:
    values: Ints = np.array([x for row in rows for x in row]).astype(np.int64)
    return Ragged(values, np.cumsum([0, *map(len, rows)]))
