"""Errors → problem documents (RFC 9457), the body of every unsuccessful answer."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, get_type_hints

import orjson

from hexwrap_server.errors import FormError, HttpError, JobFailedError
from hexwrap_solver.errors import (
    BoundaryError,
    GaussBonnetError,
    HexwrapError,
    NotAdaptedError,
    PanelsError,
    PatternError,
    SingularitiesError,
    SurfaceError,
)
from hexwrap_solver.surface.errors import (
    DegeneratePolygonError,
    FlatSurfaceError,
    IndexRangeError,
    NonFiniteError,
    NotClosedError,
    NurbsDataError,
    PoleError,
    PolygonSizeError,
    TooFineError,
)
from hexwrap_solver.surface.types import MeshSettings, NurbsSurface, SentMesh, SurfaceSettings

MEDIA_TYPE = "application/problem+json"
#: Where a request says what an error of the solver is about.
PLACES: dict[type[HexwrapError], str] = {
    SurfaceError: "/surface",
    NonFiniteError: "/surface/vertices",
    FlatSurfaceError: "/surface/vertices",
    IndexRangeError: "/surface/faces",
    PolygonSizeError: "/surface/faces",
    DegeneratePolygonError: "/surface/faces",
    NurbsDataError: "/surface/nurbs",
    NotClosedError: "/surface/nurbs/closed",
    PoleError: "/surface/nurbs/control_points",
    TooFineError: "/surface/mesh",
    GaussBonnetError: "/boundary",
    BoundaryError: "/boundary",
    NotAdaptedError: "/boundary",
    SingularitiesError: "/boundary",
    PatternError: "/pattern",
    PanelsError: "/panels",
}
#: Whose fields an error about the surface may name.
_SURFACE: dict[type, str] = {
    SentMesh: "/surface",
    SurfaceSettings: "/surface",
    NurbsSurface: "/surface/nurbs",
    MeshSettings: "/surface/mesh",
}


def place_of(error: HexwrapError) -> str | None:
    """JSON pointer to what an error of the solver is about, None where no one place is at fault."""
    section = next((PLACES[kind] for kind in type(error).__mro__ if kind in PLACES), None)
    if not error.field or section is None:
        return section
    if isinstance(error, SurfaceError):
        section = next(place for kind, place in _SURFACE.items() if error.field[0] in get_type_hints(kind))
    return "".join((section, *(f"/{step}" for step in error.field)))


def problem(error: HexwrapError) -> dict[str, Any]:
    """The members of a problem document."""
    if isinstance(error, JobFailedError):
        return error.document
    faults = error.faults if isinstance(error, FormError) else []
    errors = [{"pointer": pointer, "detail": detail} for pointer, detail in faults]
    if isinstance(error, HttpError):
        errors = error.errors
    place = vars(error).get("place", place_of(error))
    if not errors and place is not None:
        errors = [{"pointer": place, "detail": error.detail}]
    data: dict[str, Any] = dict(error.data)
    for name in ("vertices", "faces", "edges"):
        if getattr(error, name):
            data[name] = getattr(error, name)
    return {
        "type": f"/problems/{error.slug}",
        "title": error.title,
        "status": getattr(error, "status", 422),
        "detail": error.detail,
        "errors": errors,
    } | data


@contextmanager
def body_is_the_surface(is_file: bool = False) -> Iterator[None]:
    """Faults raised inside name places in a body that is the surface itself, not a request with a surface.

    is_file: the body has no fields to point at; the whole of it is meant.
    """
    try:
        yield
    except HexwrapError as error:
        place = place_of(error)
        if place is not None and place.startswith("/surface"):
            vars(error)["place"] = "" if is_file else place.removeprefix("/surface")
        raise


def dumped(document: object) -> bytes:
    """JSON of a small document, numpy numbers included; numbers that JSON does not have become null."""
    options = orjson.OPT_SERIALIZE_NUMPY | orjson.OPT_NON_STR_KEYS
    try:
        return orjson.dumps(document, option=options, default=str)
    except TypeError:  # an integer of more than 64 bits (cells beyond all limits), or half a character
        return orjson.dumps(_encodable(document), option=options, default=str)


def _encodable(value: object) -> object:
    """Integers of more than 64 bits as floats, halves of characters as question marks."""
    if isinstance(value, dict):
        return {_encodable(name): _encodable(inner) for name, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_encodable(inner) for inner in value]
    if isinstance(value, str):
        return value.encode(errors="replace").decode()
    if isinstance(value, int) and not -(2**63) <= value < 2**64:
        return float(value) if abs(value) < 2**1000 else str(value)
    return value


def plain(document: dict[str, Any]) -> dict[str, Any]:
    """A document as a client reads it: no numpy numbers, no NaN."""
    read: dict[str, Any] = orjson.loads(dumped(document))
    return read
