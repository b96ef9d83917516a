"""Bytes → responses: JSON, problems, packed bodies."""

from __future__ import annotations

import asyncio
from typing import Any

from isal import igzip
from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.responses import Response

from hexwrap_server.problems import MEDIA_TYPE, dumped, problem
from hexwrap_solver.errors import HexwrapError

JSON = "application/json"
#: Smaller answers are not worth packing.
WORTH_PACKING = 1024
#: Higher ones take longer and hardly make numbers smaller.
GZIP_LEVEL = 1
#: zlib's way to say: a gzip header, and the largest window.
GZIP_WINDOW = 31


def json_response(document: object, status: int = 200, headers: dict[str, str] | None = None) -> Response:
    """A small document."""
    return Response(dumped(document), status, headers, JSON)


def problem_response(error: HexwrapError | dict[str, Any]) -> Response:
    """A refusal, or the problem of a failed job."""
    document = error if isinstance(error, dict) else problem(error)
    headers = {"Cache-Control": "no-store"} | getattr(error, "headers", {})
    if document["status"] == 503:
        headers.setdefault("Retry-After", "5")
    return Response(dumped(document), document["status"], headers, MEDIA_TYPE)


async def packed_response(
    request: Request, data: bytes, media_type: str = JSON, headers: dict[str, str] | None = None
) -> Response:
    """A large body, gzip where the client takes it; packed off the event loop."""
    headers = {"Vary": "Accept-Encoding"} | (headers or {})
    if len(data) >= WORTH_PACKING and takes_gzip(request.headers):
        data = await asyncio.to_thread(igzip.compress, data, GZIP_LEVEL)
        headers["Content-Encoding"] = "gzip"
    return Response(data, headers=headers, media_type=media_type)


def takes_gzip(headers: Headers) -> bool:
    """Whether Accept-Encoding gives gzip a quality above 0; gzip by name goes before ``*``."""
    qualities: dict[str, float] = {}
    for entry in ",".join(headers.getlist("accept-encoding")).split(","):
        name, *parameters = (word.strip().lower() for word in entry.split(";"))
        qualities[name] = _quality(parameters)
    return qualities.get("gzip", qualities.get("*", 0.0)) > 0


def _quality(parameters: list[str]) -> float:
    """1 where there is none; what is not a number counts as 0."""
    for parameter in parameters:
        name, _, value = parameter.partition("=")
        if name.strip() == "q":
            try:
                return float(value)
            except ValueError:
                return 0.0
    return 1.0
