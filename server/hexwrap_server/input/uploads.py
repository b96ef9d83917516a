"""Uploaded files: raw, or the one file of a multipart form."""

from __future__ import annotations

import contextlib
import io
import zipfile
from typing import Any

import python_multipart
from python_multipart.exceptions import FormParserError

from hexwrap_server.errors import TooManyVerticesError, UploadError
from hexwrap_server.input.form import read as read_form
from hexwrap_server.input.surface_files import FromFile, sent_surface
from hexwrap_solver.surface.types import SurfaceSettings

#: Fields of a form that say how its file is to be read.
FIELDS = {"object", "layer", "unit"}


def sent_file(body: bytes, content_type: str, name: str, max_vertices: int, max_mib: float) -> FromFile:
    """What a file, sent raw or in a form, stands for, within the limits. Raises UploadError, SurfaceError."""
    fields: dict[str, str] = {}
    if content_type.lower().startswith("multipart/"):
        name, body, fields = only_file(body, content_type)
    _no_bomb(body, max_mib)
    unknown = sorted(fields.keys() - FIELDS)
    if unknown:
        raise UploadError(f"The form has a field '{unknown[0][:40]}'; known are {', '.join(sorted(FIELDS))}.")
    settings = read_form(SurfaceSettings, {key: value for key, value in fields.items() if value})
    read = sent_surface(body, name, settings, max_vertices)
    mesh = read.sent.mesh
    if mesh is not None and len(mesh.vertices) > max_vertices:
        raise TooManyVerticesError(
            f"The file holds {len(mesh.vertices)} vertices, this server takes at most {max_vertices}; send a "
            "coarser mesh, or start the server with a larger --max-vertices."
        )
    return read


def _no_bomb(body: bytes, max_mib: float) -> None:
    """An archive may not unpack to more than a body may have."""
    if not zipfile.is_zipfile(io.BytesIO(body)):
        return
    with contextlib.suppress(zipfile.BadZipFile), zipfile.ZipFile(io.BytesIO(body)) as archive:
        unpacked = sum(member.file_size for member in archive.infolist())
        if unpacked > max_mib * 2**20:
            raise UploadError(
                f"The archive would unpack to {unpacked} bytes, this server takes at most {max_mib:g} MiB; "
                "send a coarser mesh, or start the server with a larger --max-body-mib."
            )


def only_file(body: bytes, content_type: str) -> tuple[str, bytes, dict[str, str]]:
    """Name and contents of the one file in a multipart form, and its fields. Raises UploadError."""
    files: list[tuple[str, bytes]] = []
    fields: dict[str, str] = {}

    def note(field: Any) -> None:
        name, value = ((part or b"").decode("utf-8", "replace") for part in (field.field_name, field.value))
        fields[name] = value.strip()

    def take(file: Any) -> None:
        file.file_object.seek(0)
        files.append(((file.file_name or b"").decode("utf-8", "replace"), file.file_object.read()))
        file.close()

    headers: dict[str, Any] = {
        "Content-Type": content_type.encode(),
        "Content-Length": str(len(body)).encode(),
    }
    try:
        python_multipart.parse_form(headers, io.BytesIO(body), note, take)
    except (FormParserError, ValueError) as error:
        raise UploadError(f"The multipart form cannot be read: {error}.") from None
    if len(files) != 1:
        raise UploadError(f"The form holds {len(files)} files; send exactly one.")
    return (*files[0], fields)
