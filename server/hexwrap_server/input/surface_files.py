"""Bytes of an uploaded or local file, and its name → the surface that is meant, nothing of it checked yet."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import PurePath
from typing import Any, TypeVar

from hexwrap_server.errors import FileTypeError, UnreadableFileError
from hexwrap_server.input.choose import Chosen, choose
from hexwrap_server.input.object_words import rows
from hexwrap_server.input.readers.found import FileContent
from hexwrap_server.input.readers.npz import read_npz
from hexwrap_server.input.readers.obj import read_obj
from hexwrap_server.input.readers.off import read_off
from hexwrap_server.input.readers.ply import read_ply
from hexwrap_server.input.readers.rhino import read_3dm
from hexwrap_server.input.readers.stl import read_stl
from hexwrap_server.input.requests import SentSurface
from hexwrap_solver.errors import SurfaceError
from hexwrap_solver.surface import NurbsSurface, SentMesh
from hexwrap_solver.surface.brep import Brep
from hexwrap_solver.surface.types import MeshSettings, Origin, SurfaceSettings

T = TypeVar("T")

#: Formats that Rhino reads and we do not.
IMPORTED = ".step .stp .igs .iges .dwg .dgn .skp .fbx .3ds .3mf .wrl .glb .gltf"
#: What to do with files that hold something else.
INSTEAD = {
    **dict.fromkeys(
        (".dxf", ".csv", ".txt", ".svg"),
        "curves and points in it are for hexwrap lift, which lays them on a surface once that is solved, and "
        "for --feature-lines; if it holds a surface, open it in Rhino and run ExportSelected on that",
    ),
    **dict.fromkeys(IMPORTED.split(), "open or import it in Rhino and run ExportSelected on what is meant"),
    **dict.fromkeys(
        (".las", ".laz", ".e57", ".pts", ".ptx", ".xyz"),
        "it holds points: import it in Rhino and make a mesh with ShrinkWrap",
    ),
    **dict.fromkeys((".gh", ".ghx"), "bake the definition's surface in Grasshopper and save the Rhino file"),
    **dict.fromkeys((".zip", ".gz", ".7z", ".rar", ".tar"), "unpack it first"),
    ".ifc": "export the surface alone from the program that made the model, as 3DM, OBJ or STL",
    ".html": "it is a web page or XML, perhaps the message of a failed download: download the file again",
    ".lfs": "it only points at the file, which Git LFS keeps: fetch that with git lfs pull",
    ".3dmbak": "rename it so that it ends in .3dm",
    ".json": "it may be a request, which hexwrap solve and POST /v1/jobs take",
}
#: How files begin, and what their names end with then.
BEGINNINGS = {
    rb"3D Geometry File Format": ".3dm",
    rb"ply": ".ply",
    rb"OFF": ".off",
    rb"PK\x03\x04": ".zip",
    rb"\x1f\x8b": ".gz",
    rb"<": ".html",
    rb"version https://git-lfs": ".lfs",
    rb"ISO-10303-21.*FILE_SCHEMA\s*\(\s*\(\s*'IFC": ".ifc",
    rb"ISO-10303-21": ".step",
    rb"(999[^\S\n]*\n[^\n]*\n\s*)*0\s+SECTION": ".dxf",  # comments first: two lines each, in one way only
    rb"AC10": ".dwg",
    rb"glTF": ".glb",
    rb"Kaydara FBX": ".fbx",
}
#: Files are told by this many bytes.
BEGINNING = 8192


#: Suffix → reader.
READERS: dict[str, Callable[[bytes], FileContent]] = {
    ".3dm": read_3dm,
    ".npz": read_npz,
    ".obj": read_obj,
    ".off": read_off,
    ".ply": read_ply,
    ".stl": read_stl,
}


@dataclass(frozen=True)
class FromFile:
    """sent: what the file stands for. objects: all that it holds, as POST /v1/surfaces answers them."""

    sent: SentSurface
    objects: list[dict[str, Any]]


def read_file(data: bytes, filename: str) -> FileContent:
    """What is in a file; only the suffix of filename counts.

    Raises FileTypeError for other suffixes, UnreadableFileError for files that are broken.
    """
    return _guarded(filename, lambda suffix: _read(data, suffix))


def _read(data: bytes, suffix: str) -> FileContent:
    if not data:
        raise UnreadableFileError("The file is empty: save or export it again.")
    try:
        return READERS[suffix](data)
    except UnreadableFileError as error:
        head = data[:BEGINNING].lstrip()
        other = next((end for start, end in BEGINNINGS.items() if re.match(start, head, re.DOTALL)), "")
        other = other or next((end for end in READERS if end != suffix and _reads(data, end)), suffix)
        if other in (suffix, ".zip" if suffix == ".npz" else suffix):
            raise
        what = f"it is one, so give it the ending {other}" if other in READERS else INSTEAD[other]
        raise UnreadableFileError(f"The file begins like a {other} file: {what}.") from error


def _reads(data: bytes, suffix: str) -> bool:
    try:
        READERS[suffix](data)
    except Exception:  # foreign readers fail in every way
        return False
    return True


def read_surface(data: bytes, filename: str, settings: SurfaceSettings | None = None) -> Chosen:
    """The surface that is meant. Raises as read_file does, and NoObjectError, SeveralObjectsError."""
    return chosen_of(read_file(data, filename), filename, settings or SurfaceSettings())


def sent_surface(
    data: bytes, filename: str, settings: SurfaceSettings, max_vertices: int = MeshSettings.max_vertices
) -> FromFile:
    """The surface that is meant, and how it is to be taken in. Raises as read_surface does."""
    content = read_file(data, filename)
    chosen = chosen_of(content, filename, settings)
    return FromFile(as_sent(content, chosen, settings, max_vertices), rows(content.objects, chosen.used))


def chosen_of(content: FileContent, filename: str, settings: SurfaceSettings) -> Chosen:
    """The surface that is meant of what was read. Raises NoObjectError, SeveralObjectsError."""
    return _guarded(filename, lambda _: choose(content, settings.object, settings.layer, settings.unit))


def as_sent(
    content: FileContent,
    chosen: Chosen,
    settings: SurfaceSettings,
    max_vertices: int = MeshSettings.max_vertices,
) -> SentSurface:
    """What was chosen, and how it is to be taken in."""
    first = chosen.used[0]
    geometry = chosen.geometry
    meshing = replace(settings.mesh or MeshSettings(), max_vertices=max_vertices)
    return SentSurface(
        mesh=geometry if isinstance(geometry, SentMesh) else None,
        nurbs=geometry if isinstance(geometry, NurbsSurface) else None,
        brep=geometry if isinstance(geometry, Brep) else None,
        settings=None if isinstance(geometry, SentMesh) else replace(settings, mesh=meshing),
        unit=settings.unit or content.unit,
        origin=Origin(first.name, first.layer, tuple(sorted(first.attributes.items())), content.tolerance),
        notes=chosen.notes,
    )


def _guarded(filename: str, read: Callable[[str], T]) -> T:
    suffix = PurePath(filename).suffix.lower()
    if suffix not in READERS:
        what = f"Files of type {suffix}" if suffix else "Files without a suffix"
        instead = INSTEAD.get(suffix, "export it from the program that made it, as 3DM or OBJ")
        raise FileTypeError(
            f"{what} cannot be read as a surface: {instead}. Send the surface as one of {', '.join(READERS)}."
        )
    try:
        return read(suffix)
    except SurfaceError:
        raise
    except (Exception, MemoryError) as error:  # foreign readers fail in every way on broken files
        raise UnreadableFileError(
            f"The file {PurePath(filename).name} cannot be read as {suffix[1:].upper()} "
            f"({type(error).__name__}: {' '.join(str(error).split())[:200]}): export it again."
        ) from error
