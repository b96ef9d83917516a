"""JSON text → request, in a thread for small bodies and in a worker process for large ones."""

from __future__ import annotations

import gc

import orjson

from hexwrap_server import codec
from hexwrap_server.problems import FormError
from hexwrap_server.requests import ParsedRequest
from hexwrap_server.schemas import Request, parse_request
from hexwrap_server.worker import Report


def read_request(report: Report, text: bytes, max_vertices: int, max_panels: int) -> ParsedRequest:
    """JSON → request. Raises FormError."""
    return packed(parse_request(loads(text), max_vertices, max_panels))


def packed(request: Request) -> ParsedRequest:
    """The surface by its content."""
    if isinstance(request.surface, str):
        return ParsedRequest(request.name, request.surface, None, request.wanted)
    return ParsedRequest(
        request.name, codec.digest(request.surface), codec.encode(request.surface), request.wanted
    )


def loads(text: bytes) -> object:
    """Raises FormError where the text is no JSON."""
    gc.disable()  # a body of a million numbers holds no cycles, but sets off many searches for them
    try:
        return orjson.loads(text)
    except orjson.JSONDecodeError as error:
        raise NotJsonError(
            f"The body is not JSON: {error.msg} at line {error.lineno}, column {error.colno}."
        ) from None
    finally:
        gc.enable()


class NotJsonError(FormError):
    slug = "not-json"
    title = "The body is not JSON"
