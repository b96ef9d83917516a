"""Answers go out as gzip where the client takes it, on every route."""

from __future__ import annotations

import asyncio
from typing import Any

from isal import isal_zlib
from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

#: Smaller answers are not worth packing.
WORTH_PACKING = 1024
#: Higher ones take longer and hardly make numbers smaller.
GZIP_LEVEL = 1
#: zlib's way to say: a gzip header, and the largest window.
GZIP_WINDOW = 31
#: A packed stream of events would hold back each of them until there are many.
NEVER_PACKED = "text/event-stream"
#: Longer pieces are packed in a thread.
LONG_PIECE = 65536


class Compressed:
    """ASGI middleware. Answers that are packed already pass as they are."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http":
            send = _Answer(send, takes_gzip(Headers(scope=scope)))
        await self._app(scope, receive, send)


class _Answer:
    """One answer on its way. Its head is held back until the first piece shows whether packing pays."""

    def __init__(self, send: Send, takes: bool) -> None:
        self._send = send
        self._takes = takes
        self._head: Message | None = None
        self._packer: Any = None

    async def __call__(self, message: Message) -> None:
        if message["type"] == "http.response.start" and _can_be_packed(message):
            self._head = message
            return
        if self._head is not None:
            head, self._head = self._head, None
            await self._begin(head, message)
        elif self._packer is not None:
            message = await self._packed(message)
        await self._send(message)

    async def _begin(self, head: Message, first: Message) -> None:
        whole = not first.get("more_body", False)
        if whole and len(first.get("body", b"")) < WORTH_PACKING:
            await self._send(head)
            return
        headers = MutableHeaders(scope=head)
        if "accept-encoding" not in headers.get("vary", "").lower():
            headers.add_vary_header("Accept-Encoding")
        if self._takes:
            self._packer = isal_zlib.compressobj(GZIP_LEVEL, wbits=GZIP_WINDOW)
            first.update(await self._packed(first))
            headers["Content-Encoding"] = "gzip"
            del headers["Content-Length"]
            if whole:
                headers["Content-Length"] = str(len(first["body"]))
        await self._send(head)

    async def _packed(self, message: Message) -> Message:
        body, more = message.get("body", b""), message.get("more_body", False)
        if len(body) > LONG_PIECE:
            body = await asyncio.to_thread(self._pack, body, more)
        else:
            body = self._pack(body, more)
        return {**message, "body": body}

    def _pack(self, body: bytes, more: bool) -> bytes:
        packed: bytes = self._packer.compress(body)
        return packed if more else packed + self._packer.flush()


def _can_be_packed(start: Message) -> bool:
    """A part of a file (206) counts its bytes unpacked."""
    headers = Headers(raw=start.get("headers", []))
    is_stream = headers.get("content-type", "").startswith(NEVER_PACKED)
    return start["status"] != 206 and "content-encoding" not in headers and not is_stream


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
