"""Uploaded files, read in a worker process under its limits."""

from __future__ import annotations

import contextlib
import io
import zipfile
from dataclasses import replace
from typing import Any

import python_multipart
from python_multipart.exceptions import FormParserError

from hexwrap_server.input.form import read as read_form
from hexwrap_server.input.requests import CacheSettings, Intake
from hexwrap_server.input.surface_files import FromFile, sent_surface
from hexwrap_server.jobs.work import checked
from hexwrap_server.jobs.worker import Report
from hexwrap_server.problems import FormError, body_is_the_surface
from hexwrap_solver.surface.types import SurfaceSettings

#: Fields of a form that say how its file is to be read.
FIELDS = {"object", "layer", "unit"}


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
    """A file sent raw (with its name) or in a form → checked surface, with the objects of the file.

    Fields of the form choose among these, as ``surface.object`` and the like do. Raises UploadError,
    SurfaceError.
    """
    read = sent_file(body, content_type, name, max_vertices, max_bytes)
    intake = checked(report, read.sent, caching)
    return replace(intake, answer=intake.answer | {"objects": read.objects})


def sent_file(body: bytes, content_type: str, name: str, max_vertices: int, max_bytes: int) -> FromFile:
    """What a file, sent raw or in a form, stands for, within the limits. Raises UploadError, SurfaceError."""
    fields: dict[str, str] = {}
    if content_type.lower().startswith("multipart/"):
        name, body, fields = only_file(body, content_type)
    _no_bomb(body, max_bytes)
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
