"""Bytes of an uploaded or local file, and its name → a mesh or a NURBS surface, nothing checked yet."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import PurePath

from hexwrap_server.input.readers.errors import FileTypeError, UnreadableFileError
from hexwrap_server.input.readers.npz import read_npz
from hexwrap_server.input.readers.obj import read_obj
from hexwrap_server.input.readers.off import read_off
from hexwrap_server.input.readers.ply import read_ply
from hexwrap_server.input.readers.rhino import read_3dm
from hexwrap_server.input.readers.stl import read_stl
from hexwrap_solver.errors import SurfaceError
from hexwrap_solver.surface import NurbsSurface, SentMesh

#: Suffix → reader.
READERS: dict[str, Callable[[bytes], SentMesh | NurbsSurface]] = {
    ".3dm": read_3dm,
    ".npz": read_npz,
    ".obj": read_obj,
    ".off": read_off,
    ".ply": read_ply,
    ".stl": read_stl,
}


def read_surface(data: bytes, filename: str) -> SentMesh | NurbsSurface:
    """The surface in a file; only the suffix of filename counts.

    Raises FileTypeError for other suffixes, UnreadableFileError for files that are broken or hold no
    surface, SeveralObjectsError for Rhino files with more than one.
    """
    suffix = PurePath(filename).suffix.lower()
    if suffix not in READERS:
        raise FileTypeError(
            f"Files of type {suffix or 'without a suffix'} cannot be read: send one of {', '.join(READERS)}."
        )
    try:
        return READERS[suffix](data)
    except SurfaceError:
        raise
    except (Exception, MemoryError) as error:  # foreign readers fail in every way on broken files
        raise UnreadableFileError(
            f"The file {PurePath(filename).name} cannot be read as {suffix[1:].upper()} "
            f"({type(error).__name__}: {str(error)[:200]}): export it again."
        ) from error
