"""What can be wrong with a file, as opposed to the surface in it."""

from __future__ import annotations

from hexwrap_solver.errors import SurfaceError


class FileTypeError(SurfaceError):
    slug = "file-type"
    title = "The file type is not known"


class UnreadableFileError(SurfaceError):
    slug = "unreadable-file"
    title = "The file cannot be read"


class SeveralObjectsError(SurfaceError):
    slug = "several-objects"
    title = "The file holds more than one surface"


class NoObjectError(SurfaceError):
    slug = "no-such-object"
    title = "The file does not hold the object"
