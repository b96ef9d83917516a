"""Errors → problem documents (RFC 9457), the body of every answer that is no success."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import orjson

from hexwrap_server.errors import FormError, HttpError, JobFailedError
from hexwrap_solver.errors import HexwrapError

MEDIA_TYPE = "application/problem+json"


def problem(error: HexwrapError) -> dict[str, Any]:
    """The members of a problem document."""
    if isinstance(error, JobFailedError):
        return error.document
    faults = error.faults if isinstance(error, FormError) else []
    errors = [{"pointer": pointer, "detail": detail} for pointer, detail in faults]
    if isinstance(error, HttpError):
        errors = error.errors
    elif not errors and error.field is not None:
        errors = [{"pointer": "".join(f"/{step}" for step in error.field), "detail": error.detail}]
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
        if error.field is not None and error.field[:1] == ("surface",):
            error.field = () if is_file else error.field[1:]
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
