"""Request counts, the headers that every answer carries, and the answer where there would be none."""

from __future__ import annotations

import logging
import time

from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from hexwrap_server import __version__
from hexwrap_server.errors import InternalError
from hexwrap_server.http import head
from hexwrap_server.http.answers import problem_response
from hexwrap_server.http.metrics import Metrics

#: Methods that are counted separately; a client may invent others, and each would be counted for ever.
METHODS = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})
FAULT = "The server could not answer because of a fault in hexwrap, not in the request; please report it."
log = logging.getLogger("hexwrap.http")


class Observer:
    """ASGI middleware, outermost: counts, logs, and signs every answer, those to faults of its own too."""

    def __init__(self, app: ASGIApp, metrics: Metrics) -> None:
        self._app = app
        self._metrics = metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        start = time.perf_counter()
        has_begun = False

        async def signed(message: Message) -> None:
            nonlocal has_begun
            if message["type"] == "http.response.start":
                has_begun = True
                headers = MutableHeaders(scope=message)
                headers["Server"] = f"hexwrap/{__version__}"
                headers["X-Content-Type-Options"] = "nosniff"
                headers["Cross-Origin-Resource-Policy"] = "same-origin"
                self._note(scope, message["status"], time.perf_counter() - start)
            await send(message)

        try:
            await self._app(scope, receive, signed)
        except Exception as error:
            if has_begun:
                raise
            log.error("a fault while answering %s %s", scope["method"], scope["path"], exc_info=error)
            await problem_response(InternalError(FAULT))(scope, receive, signed)

    def _note(self, scope: Scope, status: int, seconds: float) -> None:
        routed = scope.get(head.MARK, scope)
        route = getattr(routed.get("route"), "path", "other")
        method = scope["method"] if scope["method"] in METHODS else "other"
        self._metrics.requests.labels(method, route, str(status)).inc()
        self._metrics.latency.labels(route).observe(seconds)
        extra = {
            "method": scope["method"],
            "path": scope["path"],
            "status": status,
            "seconds": round(seconds, 4),
        }
        log.debug("answered", extra=extra | {"job": routed.get("path_params", {}).get("id")})
