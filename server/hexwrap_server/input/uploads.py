"""Uploaded files, read in a worker process under its limits."""

from __future__ import annotations

import contextlib
import io
import zipfile
from typing import Any

import python_multipart
from python_multipart.exceptions import FormParserError

from hexwrap_server.input.requests import CacheSettings, Intake, SentSurface
from hexwrap_server.input.surface_files import read_surface
from hexwrap_server.jobs.work import checked
from hexwrap_server.jobs.worker import Report
from hexwrap_server.problems import FormError, body_is_the_surface
from hexwrap_solver.surface.types import MeshSettings, NurbsSurface, SentMesh, SurfaceSettings


class UploadError(FormError):
    slug = "upload"
    title = "The upload cannot be read"


class TooManyVerticesError(FormError):
    slug = "too-many-vertices"
    title = "The surface has too many vertices"


@body_is_the_surface(is_file=True)
def read_upload(
    report: Report,
    body: bytes,
    content_type: str,
    name: str,
    max_vertices: int,
    max_bytes: int,
    caching: CacheSettings,
) -> Intake:
    """A file sent raw (with its name) or in a form → checked surface. Raises UploadError, SurfaceError."""
    read = sent_file(body, content_type, name, max_vertices, max_bytes)
    if isinstance(read, NurbsSurface):
        settings = SurfaceSettings(MeshSettings(max_vertices=max_vertices))
        return checked(report, SentSurface(nurbs=read, settings=settings), caching)
    return checked(report, SentSurface(mesh=read), caching)


def sent_file(
    body: bytes, content_type: str, name: str, max_vertices: int, max_bytes: int
) -> SentMesh | NurbsSurface:
    """What a file, sent raw or in a form, holds, within the limits. Raises UploadError, SurfaceError."""
    if content_type.lower().startswith("multipart/"):
        name, body = only_file(body, content_type)
    _no_bomb(body, max_bytes)
    read = read_surface(body, name)
    if not isinstance(read, NurbsSurface) and len(read.vertices) > max_vertices:
        raise TooManyVerticesError(
            f"The file holds {len(read.vertices)} vertices, this server takes at most {max_vertices}; send a "
            "coarser mesh, or start the server with a larger --max-vertices."
        )
    return read


def _no_bomb(body: bytes, max_bytes: int) -> None:
    """An archive may not unpack to more than a body may have."""
    if not zipfile.is_zipfile(io.BytesIO(body)):
        return
    with contextlib.suppress(zipfile.BadZipFile), zipfile.ZipFile(io.BytesIO(body)) as archive:
        unpacked = sum(member.file_size for member in archive.infolist())
        if unpacked > max_bytes:
            raise UploadError(
                f"The archive would unpack to {unpacked} bytes, this server takes at most {max_bytes}; send "
                "a coarser mesh, or start the server with a larger --max-body-mib."
            )


def only_file(body: bytes, content_type: str) -> tuple[str, bytes]:
    """Name and contents of the one file in a multipart form. Raises UploadError."""
    files: list[tuple[str, bytes]] = []

    def take(file: Any) -> None:
        file.file_object.seek(0)
        files.append(((file.file_name or b"").decode("utf-8", "replace"), file.file_object.read()))
        file.close()

    headers: dict[str, Any] = {
        "Content-Type": content_type.encode(),
        "Content-Length": str(len(body)).encode(),
    }
    try:
        python_multipart.parse_form(headers, io.BytesIO(body), lambda field: None, take)
    except (FormParserError, ValueError) as error:
        raise UploadError(f"The multipart form cannot be read: {error}.") from None
    if len(files) != 1:
        raise UploadError(f"The form holds {len(files)} files; send exactly one.")
    return files[0]
