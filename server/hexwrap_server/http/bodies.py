"""Bodies of requests: read under a limit, unpacked under the same limit."""

from __future__ import annotations

import asyncio
import hashlib
import re
import zlib
from dataclasses import dataclass
from typing import Any

from starlette.requests import ClientDisconnect, Request

from hexwrap_server.problems import HttpError
from hexwrap_server.settings import MIB

#: Bytes that are unpacked at a time, and packed bytes that are looked at for it.
_STEP, _WINDOW = 4 * MIB, 64 * 1024
#: What follows the padding between two gzip members.
_CONTENT = re.compile(rb"[^\0]")
#: Most members of a gzip body. An empty one costs time and never reaches the limit; programs that pack in
#: blocks make one of every 64 KiB.
MAX_MEMBERS = 10_000


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
            f"Content-Encoding '{body.encoding[:40]}' is not supported; send the body plain or as gzip.",
            {"Accept-Encoding": "gzip"},
        )
    return await asyncio.to_thread(_unpacked, body.data, int(max_mib * MIB), max_mib)


def _encoding(request: Request) -> str:
    return request.headers.get("content-encoding", "identity").strip().lower()


async def _streamed(request: Request, max_mib: float, hashes: list[Any]) -> bytes:
    """hashes: updated with every piece; pieces are small, so that the event loop gets its turn."""
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
    whole, at = bytearray(), 0
    for _ in range(MAX_MEMBERS + 1):
        if at == len(data):
            return bytes(whole)
        at = _member(data, at, whole, limit, max_mib)
        content = _CONTENT.search(data, at)
        at = content.start() if content else len(data)
    raise _not_gzip(f"The body has more than {MAX_MEMBERS:,} gzip members; pack it as one.")


def _member(data: bytes, at: int, whole: bytearray, limit: int, max_mib: float) -> int:
    """Unpack the gzip member that begins there; returns where it ends.

    zlib copies what it has not used, so it is given little at a time.
    """
    member = zlib.decompressobj(16 + zlib.MAX_WBITS)
    window = b""
    while not member.eof:
        if not window:
            window = data[at : at + _WINDOW]
            at += len(window)
        try:
            part = member.decompress(window, _STEP)
        except zlib.error:
            raise _not_gzip() from None
        if not part and not window and not member.eof:
            raise _not_gzip()
        window = member.unconsumed_tail
        whole += part
        if len(whole) > limit:
            raise _too_large(max_mib)
    return at - len(member.unused_data)


def _too_large(max_mib: float) -> HttpError:
    return HttpError(
        413,
        "body-too-large",
        "The body is too large",
        f"The body has more than {max_mib:g} MiB, the limit of this server (unpacked, where it is gzip); "
        "send a coarser mesh, or start the server with a larger --max-body-mib.",
        {"Connection": "close"},
    )


def _not_gzip(
    detail: str = "Content-Encoding says gzip, but the body is damaged or truncated.",
) -> HttpError:
    return HttpError(400, "not-gzip", "The body is not gzip", detail)
