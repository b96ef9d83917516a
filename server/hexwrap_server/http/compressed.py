"""Answers go out as gzip where the client takes it, on every route."""

from __future__ import annotations

from starlette.datastructures import Headers
from starlette.middleware.gzip import GZipMiddleware
from starlette.types import ASGIApp, Receive, Scope, Send

#: Smaller answers are not worth packing.
WORTH_PACKING = 1024
#: Higher ones take longer and hardly make numbers smaller.
GZIP_LEVEL = 1


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
