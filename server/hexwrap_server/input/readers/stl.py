"""STL, binary or text: three vertices of its own for each triangle."""

from __future__ import annotations

import re

import numpy as np

from hexwrap_server.errors import UnreadableFileError
from hexwrap_server.input.readers.found import FileContent, of_mesh
from hexwrap_server.input.readers.text import as_utf8, floats
from hexwrap_solver.arrays import Ragged
from hexwrap_solver.surface import SentMesh

HEADER = 84
#: Normal, three corners, two bytes that programs use for colours.
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
#: Text begins so. Binary headers may, too, but the number behind them has a zero among its bytes.
_TEXT = re.compile(rb"\s*(facet|solid)\b", re.IGNORECASE)
_NAMES = re.compile(rb"^[ \t]*(?P<end>end[ \t]*)?solid\b(?P<name>[^\r\n]*)", re.IGNORECASE | re.MULTILINE)
_WORD = re.compile(rb"\b(facet|vertex|endfacet)\b", re.IGNORECASE)


def read_stl(data: bytes) -> FileContent:
    """All facets as one mesh; solids of a text file remain separate objects. Raises UnreadableFileError."""
    announced = int.from_bytes(data[80:HEADER], "little") if len(data) >= HEADER else -1
    if announced > 0 and len(data) == HEADER + announced * _TRIANGLE.itemsize:
        return _binary(data, announced)
    text = as_utf8(data)
    if _TEXT.match(text) and 0 not in text[: HEADER + _TRIANGLE.itemsize]:
        return _text(text)
    if announced < 0:
        raise UnreadableFileError("The file is not an STL file: it is shorter than the header of one.")
    held = (len(data) - HEADER) // _TRIANGLE.itemsize
    if announced == 0 == held:
        raise UnreadableFileError("The STL file holds no mesh: it has no facets.")
    if held < announced or announced == 0:
        raise UnreadableFileError(
            f"The STL file announces {announced} triangles but holds {held}: it is truncated or damaged, so "
            "export it again."
        )
    return _binary(data, announced)


def _binary(data: bytes, count: int) -> FileContent:
    """Bytes behind the last triangle are passed over."""
    read = np.frombuffer(data, dtype=_TRIANGLE, count=count, offset=HEADER)
    corners = read["corners"].reshape(-1, 3).astype(np.float64)
    return of_mesh(SentMesh(corners, Ragged.from_table(np.arange(len(corners)).reshape(-1, 3))))


def _text(text: bytes) -> FileContent:
    """Facets of any number of solids, whether or not the last one is ended."""
    lines = re.split(rb"[\r\n]+", text)
    body = b"\n".join(lines)
    # Names may hold any word, so they are blanked out first; where all stands on one line, they stay.
    names = list(_NAMES.finditer(body)) if len(lines) > 2 else []
    body = body if not names else _NAMES.sub(lambda match: b" " * len(match[0]), body)
    pieces = _WORD.split(body)
    words = [word.lower() for word in pieces[1::2]]
    behind = pieces[2::2]
    facets = words.count(b"facet")
    if facets == 0:
        raise UnreadableFileError("The STL file holds no mesh: it has no facets.")
    opened = np.cumsum([word == b"facet" for word in words])
    at_vertex = np.flatnonzero([word == b"vertex" for word in words])
    lengths = (
        np.bincount(opened[at_vertex] - 1, minlength=facets) if opened[0] else np.zeros(1, dtype=np.int64)
    )
    incomplete = np.flatnonzero(lengths < 3)
    if len(incomplete) or words[-1] != b"endfacet":
        facet = incomplete[0] if len(incomplete) else facets - 1
        raise UnreadableFileError(
            f"Facet {facet} of the STL file, of {facets}, is incomplete: it is truncated or damaged, so "
            "export it again."
        )
    rows = [behind[i].split()[:3] for i in at_vertex]
    if any(len(row) < 3 for row in rows):
        raise UnreadableFileError("A vertex of the STL file has fewer than three coordinates.")
    corners = floats([x for row in rows for x in row], "vertices of the STL file").reshape(-1, 3)
    mesh = SentMesh(corners, Ragged.of(np.arange(len(corners), dtype=np.int64), lengths))
    solids = [match for match in names if not match["end"]]
    starts = [match.start() for match in _WORD.finditer(body) if match[0].lower() == b"facet"]
    owner = np.maximum(np.searchsorted([match.start() for match in solids], starts) - 1, 0)
    used, owner = np.unique(owner, return_inverse=True)
    titles = [solids[k]["name"].strip().decode("utf-8", "replace") if solids else "" for k in used]
    return of_mesh(mesh, [(title, "") for title in titles], owner)
