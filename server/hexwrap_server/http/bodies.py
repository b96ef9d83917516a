"""Bodies of requests on their way in: read under a limit each, and under one for all."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from starlette.requests import ClientDisconnect, Request

from hexwrap_server.errors import refusal
from hexwrap_server.http.service import Service
from hexwrap_server.input.bodies import Body, body_too_large
from hexwrap_server.settings import MIB

#: All bodies that the server holds at once have at most the size of this many of the largest.
BODIES_AT_ONCE = 4


@asynccontextmanager
async def sent_body(request: Request) -> AsyncIterator[Body]:
    """The body, as long as the block lasts. Raises HttpError."""
    service: Service = request.app.state.service
    max_mib = service.settings.max_body_mib
    encoding = _encoding(request)
    limit = int(max_mib * MIB)
    declared = request.headers.get("content-length", "0")
    if declared.isdecimal() and int(declared) > limit:
        raise body_too_large(max_mib)
    chunks: list[bytes] = []
    size = 0
    try:
        async for chunk in request.stream():  # in small pieces, so that the event loop gets its turn
            size += len(chunk)
            service.body_bytes += len(chunk)
            if size > limit:
                raise body_too_large(max_mib)
            if service.body_bytes > BODIES_AT_ONCE * limit:
                raise refusal(
                    "too-many-bodies",
                    "Other clients are sending bodies that fill the memory set aside for them; try again in "
                    "a moment.",
                    {"Retry-After": "2", "Connection": "close"},
                )
            chunks.append(chunk)
        yield Body(b"".join(chunks), encoding)
    except ClientDisconnect:
        raise refusal("incomplete", "The connection closed before the whole body was sent.") from None
    finally:
        service.body_bytes -= size


def _encoding(request: Request) -> str:
    name = request.headers.get("content-encoding", "identity").strip().lower()
    known = {"": "", "identity": "", "gzip": "gzip", "x-gzip": "gzip"}
    if name in known:
        return known[name]
    raise refusal(
        "content-encoding",
        f"Content-Encoding '{name[:40]}' is not supported; send the body plain or as gzip.",
        {"Accept-Encoding": "gzip"},
    )
