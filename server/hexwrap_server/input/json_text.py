"""JSON text → request, in a thread for small bodies and in a worker process for large ones."""

from __future__ import annotations

import codecs
import gc
import json
import sys

import orjson

from hexwrap_server.input import quick
from hexwrap_server.input.faults import escaped
from hexwrap_server.input.requests import ParsedRequest
from hexwrap_server.input.schemas import Request, parse_request
from hexwrap_server.jobs import codec
from hexwrap_server.jobs.worker import Report
from hexwrap_server.problems import FormError
from hexwrap_solver.surface.errors import NonFiniteError


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
    """The document; large tables in it may be arrays already (``quick``).

    A byte order mark, which some editors put first, is passed over. Raises FormError where the text is no
    JSON, or holds a number that no float is.
    """
    text = text.removeprefix(codecs.BOM_UTF8)
    document = quick.read(text)
    return _listed(text) if document is None else document


def _listed(text: bytes) -> object:
    gc.disable()  # a body of a million numbers holds no cycles, but sets off many searches for them
    try:
        return orjson.loads(text)
    except orjson.JSONDecodeError as error:
        place = _not_finite(text)
        if place is not None:
            raise FormError.at(place, "must be a finite number", NonFiniteError) from None
        raise NotJsonError(
            f"The body is not JSON: {error.msg} at line {error.lineno}, column {error.colno}."
        ) from None
    finally:
        gc.enable()


def _not_finite(text: bytes) -> str | None:
    """JSON pointer to the first entry of a list that is NaN, infinite or too large for a float.

    None where something else is wrong with the text. Slow, and only for texts that were refused.
    """
    try:
        document = json.loads(text)
    except (ValueError, RecursionError):
        return None
    todo: list[tuple[str, object]] = [("", document)]
    while todo:
        place, value = todo.pop()
        if isinstance(value, dict):
            todo += [(f"{place}/{escaped(name)}", inner) for name, inner in value.items()][::-1]
        elif isinstance(value, list):
            for i, entry in enumerate(value):
                if isinstance(entry, (int, float)) and not abs(entry) <= sys.float_info.max:
                    return f"{place}/{i}"
            todo += [(f"{place}/{i}", row) for i, row in enumerate(value) if isinstance(row, (list, dict))][
                ::-1
            ]
    return None


class NotJsonError(FormError):
    slug = "not-json"
    title = "The body is not JSON"
