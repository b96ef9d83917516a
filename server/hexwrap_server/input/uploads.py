"""Uploaded files: raw, or the one file of a multipart form."""

from __future__ import annotations

import contextlib
import io
import zipfile
from typing import Any

import python_multipart
from python_multipart.exceptions import FormParserError

from hexwrap_server.errors import UploadError
from hexwrap_server.input.surface_files import read_surface
from hexwrap_solver.surface.types import NurbsSurface, SentMesh


def sent_file(body: bytes, content_type: str, name: str, max_mib: float) -> SentMesh | NurbsSurface:
    """What a file, sent raw or in a form, holds. Raises UploadError, SurfaceError."""
    if content_type.lower().startswith("multipart/"):
        name, body = only_file(body, content_type)
    _no_bomb(body, max_mib)
    return read_surface(body, name)


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
