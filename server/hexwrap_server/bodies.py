"""Bodies of requests: read under a limit, unpacked under the same limit."""

from __future__ import annotations

import asyncio
import hashlib
import zlib
from dataclasses import dataclass
from typing import Any

from starlette.requests import ClientDisconnect, Request

from hexwrap_server.problems import HttpError
from hexwrap_server.settings import MIB

_STEP = 4 * MIB


@dataclass(frozen=True)
class Body:
    """A body as it was sent. mark: SHA-256 of how it is packed and of its bytes."""

    data: bytes
    encoding: str
    mark: str


async def read_body(request: Request, max_mib: float) -> bytes:
    """The body, unpacked. The limit holds for what is declared, sent and unpacked. Raises HttpError."""
    return await plain_body(Body(await _streamed(request, max_mib, []), _encoding(request), ""), max_mib)


async def sent_body(request: Request, max_mib: float) -> Body:
    """The body as it is sent, hashed while it comes in. Raises HttpError."""
    encoding = _encoding(request)
    sha = hashlib.sha256(encoding.encode() + b"\n")
    data = await _streamed(request, max_mib, [sha])
    return Body(data, encoding, sha.hexdigest())


async def plain_body(body: Body, max_mib: float) -> bytes:
    """The body, unpacked. Raises HttpError."""
    if body.encoding in ("", "identity"):
        return body.data
    if body.encoding not in ("gzip", "x-gzip"):
        raise HttpError(
            415,
            "content-encoding",
            "This encoding is not read",
            f"Content-Encoding '{body.encoding[:40]}' is not read here; send the body plain or as gzip.",
            {"Accept-Encoding": "gzip"},
        )
    return await asyncio.to_thread(_unpacked, body.data, int(max_mib * MIB), max_mib)


def _encoding(request: Request) -> str:
    return request.headers.get("content-encoding", "identity").strip().lower()


async def _streamed(request: Request, max_mib: float, hashes: list[Any]) -> bytes:
    """hashes: told of every piece; pieces are small, so that the event loop gets its turn."""
    limit = int(max_mib * MIB)
    declared = request.headers.get("content-length", "0")
    if declared.isdecimal() and int(declared) > limit:
        raise _too_large(max_mib)
    chunks: list[bytes] = []
    size = 0
    try:
        async for chunk in request.stream():
            chunks.append(chunk)
            size += len(chunk)
            if size > limit:
                raise _too_large(max_mib)
            for sha in hashes:
                sha.update(chunk)
    except ClientDisconnect:
        raise HttpError(
            400,
            "incomplete",
            "The body is incomplete",
            "The connection closed before the whole body was sent.",
        ) from None
    return b"".join(chunks)


def _unpacked(data: bytes, limit: int, max_mib: float) -> bytes:
    """A gzip bomb is not unpacked further than the limit."""
    whole = bytearray()
    while data:
        member = zlib.decompressobj(16 + zlib.MAX_WBITS)
        while not member.eof:
            try:
                part = member.decompress(data, _STEP)
            except zlib.error:
                raise _not_gzip() from None
            data = member.unconsumed_tail
            whole += part
            if len(whole) > limit:
                raise _too_large(max_mib)
            if not part and not data and not member.eof:
                raise _not_gzip()
        data = member.unused_data.lstrip(b"\0")
    return bytes(whole)


def _too_large(max_mib: float) -> HttpError:
    return HttpError(
        413,
        "body-too-large",
        "The body is too large",
        f"The body has more than {max_mib:g} MiB, the limit of this server (unpacked, where it is gzip); "
        "send a coarser mesh, or start the server with a larger --max-body-mib.",
        {"Connection": "close"},
    )


def _not_gzip() -> HttpError:
    return HttpError(
        400,
        "not-gzip",
        "The body is not gzip",
        "Content-Encoding says gzip, but the body is broken or cut short.",
    )
