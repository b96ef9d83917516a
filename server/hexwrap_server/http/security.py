"""Closed to strangers: what a web page in somebody's browser, or a neighbour in the network, must not do.

A loopback service is within reach of every page that the user opens: by a cross-site POST, or by a name
that is made to point at 127.0.0.1 (DNS rebinding). So the Host header must be one of ours, and a request that
changes anything must not say that it comes from another site. Programs do not send those headers and pass.
"""

from __future__ import annotations

import hmac
from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from hexwrap_server.errors import HttpError, refusal
from hexwrap_server.http.answers import problem_response
from hexwrap_server.settings import Settings

LOOPBACK_NAMES = frozenset({"127.0.0.1", "localhost", "[::1]"})
SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})
#: Probes that a load balancer makes without a token, and the page, which asks its reader for one.
OPEN_PATHS = frozenset({"/health", "/ready", "/"})
OPEN_FOLDER = "/static/"


class Doorkeeper:
    """ASGI middleware: refuses foreign hosts, foreign sites, and those without the token."""

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self._app = app
        named = {name.strip().lower() for name in settings.allowed_hosts.split(",") if name.strip()}
        self._hosts = LOOPBACK_NAMES | named | {settings.host.lower(), f"[{settings.host.lower()}]"}
        self._any_host = bool(settings.token) and settings.host in ("0.0.0.0", "::")
        self._token = settings.token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http":
            refused = self._refusal(scope["method"], scope["path"], Headers(scope=scope))
            if refused is not None:
                await problem_response(refused)(scope, receive, send)
                return
        await self._app(scope, receive, send)

    def _refusal(self, method: str, path: str, headers: Headers) -> HttpError | None:
        host = headers.get("host", "").lower()
        if not self._any_host and host_name(host) not in self._hosts:
            return refusal(
                "host-not-allowed",
                f"The Host header says '{host[:100]}'; use 127.0.0.1, or start the server "
                "with --allowed-hosts.",
            )
        if method not in SAFE_METHODS and _is_foreign(headers, host):
            return refusal(
                "cross-site", "The browser says that this request comes from a page of another site."
            )
        is_open = path in OPEN_PATHS or path.startswith(OPEN_FOLDER)
        if self._token and not is_open and not self._knows_token(headers):
            return refusal(
                "token",
                "This server was started with a token; send it as 'Authorization: Bearer TOKEN'.",
                {"WWW-Authenticate": "Bearer"},
            )
        return None

    def _knows_token(self, headers: Headers) -> bool:
        kind, _, said = headers.get("authorization", "").partition(" ")
        return kind.lower() == "bearer" and hmac.compare_digest(said.strip().encode(), self._token.encode())


def host_name(host: str) -> str:
    """The name in a Host header, without the port; IPv6 addresses keep their brackets."""
    if host.startswith("["):
        return host.partition("]")[0] + "]"
    return host.partition(":")[0]


def _is_foreign(headers: Headers, host: str) -> bool:
    if headers.get("sec-fetch-site", "none") not in ("none", "same-origin"):
        return True
    origin = headers.get("origin")
    try:
        return origin is not None and urlsplit(origin).netloc.lower() != host
    except ValueError:  # such as half an IPv6 address
        return True
