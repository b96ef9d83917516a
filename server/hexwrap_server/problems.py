"""Every answer that is no success is a problem (RFC 9457).

HexwrapError            (hexwrap_solver.errors) refused by the solver: 422
├── FormError           the body does not have the form it should: 400, 413 or 422
├── HttpError           about the request as such: no such job, host not allowed, queue full …
└── WorkError           (worker) no result: limits 422, a dead worker or a full disk 503, a bug 500
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, ClassVar, get_type_hints

import orjson

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
#: Statuses of the errors that are not 422.
STATUS = {"not-json": 400, "gone": 410, "worker-died": 503, "storage": 503, "cluster": 503, "internal": 500}
#: A pointer into the arrays of a sent mesh.
_ELEMENT = re.compile(r"(?:/surface)?/(vertices|faces)/(\d+)")
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
#: More faults than these are not listed, the first ones tell enough.
MOST_LISTED = 100


def place_of(error: HexwrapError) -> str | None:
    """JSON pointer to what an error of the solver is about, None where no one place is at fault."""
    section = next((PLACES[kind] for kind in type(error).__mro__ if kind in PLACES), None)
    if not error.field or section is None:
        return section
    if isinstance(error, SurfaceError):
        section = next(place for kind, place in _SURFACE.items() if error.field[0] in get_type_hints(kind))
    return "".join((section, *(f"/{step}" for step in error.field)))


class FormError(HexwrapError):
    """The body is not what the route takes. faults: (JSON pointer, what is wrong there)."""

    slug: ClassVar[str] = "invalid-request"
    title: ClassVar[str] = "The request does not have the right form"

    def __init__(self, faults: Sequence[tuple[str, str]] | str = ()) -> None:
        if isinstance(faults, str):  # rebuilt after the way between processes; the rest is in __dict__
            super().__init__(faults)
            self.faults: list[tuple[str, str]] = []
            return
        pointer, detail = faults[0]
        more = f" ({len(faults) - 1} more faults are listed in 'errors'.)" if len(faults) > 1 else ""
        super().__init__(f"{pointer or 'The body'}: {detail.rstrip('.')}.{more}")
        self.faults = list(faults[:MOST_LISTED])

    @classmethod
    def at(cls, pointer: str, detail: str, kind: type[HexwrapError] | None = None) -> FormError:
        """One fault. kind: the solver's error for the same fault; a client need not tell the two apart.

        A fault in the arrays of the mesh names its vertex or face by index too.
        """
        error = cls([(pointer, detail)])
        element = _ELEMENT.match(pointer)
        if element:
            setattr(error, element[1], [int(element[2])])
        if kind is not None:
            error.__dict__.update(slug=kind.slug, title=kind.title)
        return error


class HttpError(HexwrapError):
    """A refusal by the service itself."""

    def __init__(
        self,
        status: int,
        slug: str,
        title: str,
        detail: str,
        headers: dict[str, str] | None = None,
        errors: Sequence[dict[str, Any]] = (),
    ) -> None:
        super().__init__(detail)
        self.status = status
        self.own_slug = slug
        self.own_title = title
        self.headers = headers or {}
        self.errors = list(errors)


def problem(error: HexwrapError) -> dict[str, Any]:
    """The members of a problem document."""
    if isinstance(error, HttpError):
        return _document(error.own_slug, error.own_title, error.status, error.detail, error.errors)
    faults = error.faults if isinstance(error, FormError) else []
    errors = [{"pointer": pointer, "detail": detail} for pointer, detail in faults]
    place = vars(error).get("place", place_of(error))
    if not errors and place is not None:
        errors = [{"pointer": place, "detail": error.detail}]
    data: dict[str, Any] = dict(error.data)
    for name in ("vertices", "faces", "edges"):
        if getattr(error, name):
            data[name] = getattr(error, name)
    return _document(error.slug, error.title, STATUS.get(error.slug, 422), error.detail, errors) | data


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


def _document(
    slug: str, title: str, status: int, detail: str, errors: list[dict[str, Any]]
) -> dict[str, Any]:
    return {"type": f"/problems/{slug}", "title": title, "status": status, "detail": detail, "errors": errors}


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


def not_found(what: str, detail: str) -> HttpError:
    return HttpError(404, "not-found", f"No such {what}", detail)
