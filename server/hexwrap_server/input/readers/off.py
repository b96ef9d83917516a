"""OFF with its variants: normals, colours and texture coordinates behind the vertices are passed over."""

from __future__ import annotations

import re

import numpy as np

from hexwrap_server.errors import UnreadableFileError
from hexwrap_server.input.readers.found import FileContent, of_mesh
from hexwrap_server.input.readers.text import as_utf8, count, floats, integers, rows
from hexwrap_solver.arrays import Ragged
from hexwrap_solver.surface import SentMesh

#: ``OFF`` with the prefixes that say what stands behind a vertex, perhaps glued to the first count.
_KEYWORD = re.compile(rb"(?P<st>ST)?(?P<c>C)?(?P<n>N)?(?P<w>4)?OFF", re.IGNORECASE)


def read_off(data: bytes) -> FileContent:
    """One mesh. Raises UnreadableFileError."""
    lines = [line for raw in as_utf8(data).splitlines() if (line := raw.partition(b"#")[0].split())]
    if not lines:
        raise UnreadableFileError("The OFF file is empty.")
    homogeneous, behind = False, 0
    keyword = _KEYWORD.match(lines[0][0])
    if keyword:
        if lines[0][0] == b"nOFF" or any(word.upper() == b"BINARY" for word in lines[0]):
            raise UnreadableFileError(
                "The OFF file is binary or of another dimension than three: save it as plain text OFF."
            )
        homogeneous = keyword["w"] is not None
        behind = 3 * bool(keyword["n"]) + 4 * bool(keyword["c"]) + 2 * bool(keyword["st"])
        rest = lines[0][0][keyword.end() :]
        lines[0] = ([rest] if rest else []) + lines[0][1:]
    elif not lines[0][0].isdigit():
        raise UnreadableFileError("The file begins neither with OFF nor with the number of its vertices.")
    n, m, body = _counts([line for line in lines if line])
    wide = 4 if homogeneous else 3
    one_per_line = len(body) >= n + m
    vertex_rows, face_rows = rows(
        body,
        [
            ("vertex", n, lambda words, at: wide if one_per_line else wide + behind),
            ("face", m, lambda words, at: 1 + count(words[at])),
        ],
    )
    points = floats([x for row in vertex_rows for x in row[:wide]], "vertices of the OFF file")
    points = points.reshape(-1, wide)
    lengths = np.array([int(row[0]) for row in face_rows], dtype=np.int64)
    corners = [x for row in face_rows for x in row[1 : 1 + int(row[0])]]
    index = integers(corners, "faces of the OFF file")
    from_one = bool(len(index)) and index.min() == 1 and index.max() == n
    faces = Ragged.of(index - from_one, lengths)
    content = of_mesh(SentMesh(points[:, :3] / points[:, 3:] if homogeneous else points, faces))
    if not from_one:
        return content
    return content.noted("The faces of the OFF file count vertices from 1, not from 0, and were read so.")


def _counts(lines: list[list[bytes]]) -> tuple[int, int, list[list[bytes]]]:
    """Numbers of vertices and faces (that of edges is passed over), and the lines behind them.

    The counts may stand on lines of their own; a line of three words behind two counts is a vertex.
    """
    words: list[bytes] = []
    at = 0
    while at < len(lines) and (len(words) < 2 or (len(words) < 3 and len(lines[at]) < 3)):
        words += lines[at]
        at += 1
    counts = integers(words[:3], "counts of the OFF file")
    if len(counts) < 2 or (counts < 0).any():
        raise UnreadableFileError("The OFF file does not tell how many vertices and faces it holds.")
    body = ([words[3:]] if len(words) > 3 else []) + lines[at:]
    return int(counts[0]), int(counts[1]), body
