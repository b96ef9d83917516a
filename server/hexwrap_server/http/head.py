"""HEAD is GET without the body, on every route."""

from __future__ import annotations

from starlette.types import ASGIApp, Message, Receive, Scope, Send

#: Where the scope says that nobody wants the body; in the scope further out, where the GET that was made of
#: it stands, with its route.
MARK = "hexwrap.head"


class Head:
    """ASGI middleware."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or scope["method"] != "HEAD":
            await self._app(scope, receive, send)
            return

        async def without_body(message: Message) -> None:
            if message["type"] == "http.response.body":
                message = {**message, "body": b""}
            await send(message)

        scope[MARK] = {**scope, "method": "GET", MARK: True}
        await self._app(scope[MARK], receive, without_body)
