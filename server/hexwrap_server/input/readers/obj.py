"""OBJ. Vertices keep their numbers in the file: boundary angles are given at them."""

from __future__ import annotations

import re

import numpy as np

from hexwrap_server.errors import UnreadableFileError
from hexwrap_server.input.readers.found import FileContent, of_mesh
from hexwrap_server.input.readers.text import as_utf8, floats, integers
from hexwrap_solver.arrays import Ints, Ragged
from hexwrap_solver.surface import SentMesh

#: Lines that a backslash at their end continues; at the end of a name or a comment it is a letter.
_CONTINUED = re.compile(rb"(v|vn|vt|vp|f|fo|l|p)\s", re.IGNORECASE)
_VERTEX, _FACE = (b"v ", b"v\t"), (b"f ", b"f\t", b"fo")
#: What a file may hold instead of a mesh.
_OTHERS = {b"surf": "NURBS surfaces", b"curv": "curves", b"l": "lines", b"p": "points"}


def read_obj(data: bytes) -> FileContent:
    """Every ``v`` and ``f`` of the file; its objects, or else its groups, remain separate.

    Raises UnreadableFileError.
    """
    lines = _lines(as_utf8(data))
    kinds = [line[:2].lower() for line in lines]
    at_vertex = np.flatnonzero([kind in _VERTEX for kind in kinds])
    at_face = np.flatnonzero([kind in _FACE for kind in kinds])
    if len(at_vertex) == 0 or len(at_face) == 0:
        raise _no_mesh(lines)
    coordinates = [lines[i][2:].split()[:3] for i in at_vertex]
    short = next((k for k, row in enumerate(coordinates) if len(row) < 3), None)
    if short is not None:
        raise UnreadableFileError(f"Vertex {short} of the OBJ file has fewer than three coordinates.")
    vertices = floats([x for row in coordinates for x in row], "vertices of the OBJ file")
    corners = [re.sub(rb"/\S*", b"", lines[i][2:]).split() for i in at_face]
    named = integers([x for row in corners for x in row], "faces of the OBJ file")
    lengths = np.array([len(row) for row in corners], dtype=np.int64)
    before = np.repeat(np.searchsorted(at_vertex, at_face), lengths)  # negative: back from those so far
    mesh = SentMesh(
        vertices.reshape(-1, 3),
        Ragged.of(_checked(named, before, len(at_vertex), lengths), lengths),
    )
    return of_mesh(mesh, *_groups(lines, kinds, at_face))


def _groups(lines: list[bytes], kinds: list[bytes], at_face: Ints) -> tuple[list[tuple[str, str]], Ints]:
    """Name and group of every object (its name is the group's where it has none), and each face's object.
    Where there is neither, faces of one material are one."""
    labels = []
    for marks in ((b"o ", b"o\t"), (b"g ", b"g\t"), (b"us",)):
        at = [i for i, kind in enumerate(kinds) if kind in marks]
        names = ["", *(_name(lines[i].split(maxsplit=1)) for i in at)]
        labels.append([names[k] for k in np.searchsorted(at, at_face)])
    material = labels.pop()
    if not any(labels[0]) and not any(labels[1]) and len(set(material)) > 1:
        labels[1] = material
    pairs = [(o, g) if o else (g, "") for o, g in zip(*labels, strict=True)]
    number: dict[tuple[str, str], int] = {}
    owner = np.array([number.setdefault(pair, len(number)) for pair in pairs], dtype=np.int64)
    return list(number), owner


def _name(line: list[bytes]) -> str:
    name = b" ".join(line[1].split()) if len(line) > 1 else b""
    try:
        return name.decode()
    except UnicodeDecodeError:  # of an older Windows
        return name.decode("cp1252", "replace")


def _lines(data: bytes) -> list[bytes]:
    """Without comments, and with continued lines in one piece."""
    lines = [line.partition(b"#")[0].strip() for line in data.splitlines()]
    if b"\\" not in data:
        return lines
    whole: list[bytes] = []
    goes_on = False
    for line in lines:
        if goes_on:
            whole[-1] += b" " + line
        else:
            whole.append(line)
        goes_on = whole[-1].endswith(b"\\") and _CONTINUED.match(whole[-1]) is not None
        if goes_on:
            whole[-1] = whole[-1][:-1]
    return whole


def _checked(named: Ints, before: Ints, n: int, lengths: Ints) -> Ints:
    """Vertex indices from 0. Raises UnreadableFileError for those that name no vertex of the file."""
    index = np.where(named < 0, named + before, named - 1)
    wrong = np.flatnonzero((named == 0) | (index < 0) | (index >= n))
    if len(wrong):
        face = int(np.searchsorted(np.cumsum(lengths), wrong[0], side="right"))
        raise UnreadableFileError(
            f"Face {face} of the OBJ file names vertex {named[wrong[0]]}, but the file holds {n}, counted "
            f"from 1 ({len(wrong)} such corners in all): it is truncated or damaged, so export it again."
        )
    return index


def _no_mesh(lines: list[bytes]) -> UnreadableFileError:
    first = {line.split()[0].lower() for line in lines if line}
    others = [what for word, what in _OTHERS.items() if word in first]
    held = f" It holds {' and '.join(others)}." if others else ""
    return UnreadableFileError(
        f"The OBJ file holds no mesh: no 'v' or no 'f' lines were found.{held} Export the surface as a "
        "polygon mesh."
    )
