"""Answers go out as gzip where the client takes it, on every route."""

from __future__ import annotations

import re

from starlette.datastructures import Headers
from starlette.middleware.gzip import GZipMiddleware
from starlette.types import ASGIApp, Receive, Scope, Send

#: Smaller answers are not worth packing.
WORTH_PACKING = 1024
#: Higher ones take longer and hardly make numbers smaller.
GZIP_LEVEL = 1
#: A name in Accept-Encoding, and its quality where it has one.
_ENCODING = re.compile(r"([^\s,;]+)\s*(?:;\s*q\s*=\s*([^\s,;]*))?")


class Compressed(GZipMiddleware):
    """Starlette's, which looks only for the word: here it finds it where its quality is above 0."""

    def __init__(self, app: ASGIApp) -> None:
        super().__init__(app, WORTH_PACKING, GZIP_LEVEL)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http":
            word = b"gzip" if _takes_gzip(Headers(scope=scope)) else b"identity"
            others = [header for header in scope["headers"] if header[0] != b"accept-encoding"]
            scope["headers"] = [*others, (b"accept-encoding", word)]
        await super().__call__(scope, receive, send)


def _takes_gzip(headers: Headers) -> bool:
    """Whether Accept-Encoding gives gzip a quality above 0; gzip by name goes before ``*``."""
    qualities = dict(_ENCODING.findall(",".join(headers.getlist("accept-encoding")).lower()))
    try:
        return float(qualities.get("gzip", qualities.get("*", "0")) or 1) > 0
    except ValueError:  # what is not a number counts as 0
        return False
