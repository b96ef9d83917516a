"""The application and the server around it."""

from __future__ import annotations

import asyncio
import errno
import gc
import logging
import signal
import socket
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from types import FrameType
from typing import Any

import uvicorn
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.responses import Response
from starlette.routing import BaseRoute, Match, Mount
from starlette.types import Scope

from hexwrap_server import __version__
from hexwrap_server.errors import HttpError, PortTakenError, StorageError, bad_parameters
from hexwrap_server.http.answers import problem_response
from hexwrap_server.http.compressed import Compressed
from hexwrap_server.http.docs import DocumentedApp, add_docs
from hexwrap_server.http.head import Head
from hexwrap_server.http.hops.routes import router as hops
from hexwrap_server.http.observe import METHODS, Observer
from hexwrap_server.http.routes import router
from hexwrap_server.http.security import Doorkeeper
from hexwrap_server.http.service import Service
from hexwrap_server.http.viewer import add_viewer
from hexwrap_server.jobs.engine import Engine
from hexwrap_server.logs import set_up_logging
from hexwrap_server.settings import Settings
from hexwrap_solver.errors import HexwrapError

#: Seconds that open connections get when the server stops.
GRACE = 2
#: Connections that may wait to be accepted. Where no file handle is free, asyncio tries this many in a row,
#: and with more all else waits.
BACKLOG = 128
#: Seconds that a connection stays open between requests: longer than clients that would not see it end keep
#: theirs (httpx: five), and no longer, since each holds a file handle.
KEEP_ALIVE = 10
log = logging.getLogger("hexwrap.server")


def create_app(settings: Settings | None = None, engine: Engine | None = None) -> FastAPI:
    """The application. engine: where jobs run, if not as the settings say.

    Raises FolderInUseError, DamagedError, OSError where the data folder cannot be used.
    """
    settings = settings or Settings.from_environment()
    service = Service(settings, engine)

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        asyncio.get_running_loop().set_exception_handler(_on_loop_fault)
        try:
            await service.start()
            yield
        finally:
            await service.stop()

    app = DocumentedApp(
        title="hexwrap",
        version=__version__,
        summary="Seamless hexagonal, quad and triangle panels on tube-like surfaces",
        lifespan=lifespan,
        redirect_slashes=False,
        openapi_url=None,
        docs_url=None,
        redoc_url=None,
    )
    app.state.service = service
    app.include_router(router)
    app.include_router(hops)
    add_viewer(app)
    add_docs(app)
    app.add_exception_handler(HexwrapError, _on_error)
    app.add_exception_handler(OSError, _on_os_error)
    app.add_exception_handler(HTTPException, _on_http_exception)
    app.add_exception_handler(RequestValidationError, _on_parameters)
    app.add_middleware(Compressed)
    app.add_middleware(Head)
    app.add_middleware(Doorkeeper, settings=settings)
    app.add_middleware(Observer, metrics=service.metrics)
    return app


def serve(settings: Settings) -> None:
    """Serve until Ctrl-C or SIGTERM.

    Raises PortTakenError, FolderInUseError, DamagedError, OSError, and what keeps the engine from starting.
    """
    set_up_logging(settings.log_level)
    listener = open_listener(settings)
    try:
        app = create_app(settings)
        config = uvicorn.Config(
            app,
            lifespan="off",
            log_config=None,
            access_log=False,
            server_header=False,
            timeout_graceful_shutdown=GRACE,
            timeout_keep_alive=KEEP_ALIVE,
            backlog=BACKLOG,
            h11_max_incomplete_event_size=64 * 1024,
        )
        server = _Server(config, app.state.service)
        for number in (signal.SIGINT, signal.SIGTERM):  # uvicorn raises them again when it has shut down
            signal.signal(number, server.handle_exit)
        gc.freeze()  # half a million objects of modules need not be searched for garbage
        asyncio.run(_run(server, app, listener))
    finally:
        listener.close()


async def _run(server: uvicorn.Server, app: FastAPI, listener: socket.socket) -> None:
    """Raises what keeps the application from starting; uvicorn would only write its traceback."""
    async with app.router.lifespan_context(app):
        await server.serve(sockets=[listener])


class _Server(uvicorn.Server):
    """Ends long polls and event streams as soon as a signal comes, so that nothing waits for them."""

    def __init__(self, config: uvicorn.Config, service: Service) -> None:
        super().__init__(config)
        self._service = service

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        super().handle_exit(sig, frame)
        self._service.begin_to_stop()


def open_listener(settings: Settings) -> socket.socket:
    """The socket to serve on; port 0 takes a free one. Raises PortTakenError."""
    family = socket.AF_INET6 if ":" in settings.host else socket.AF_INET
    # asyncio sends without delay only where the protocol is named
    listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    if sys.platform != "win32":  # there it would let two servers share the port
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((settings.host, settings.port))
        listener.listen(BACKLOG)
    except OSError as error:
        listener.close()
        raise PortTakenError(
            f"Cannot listen on {settings.host}:{settings.port} ({error.strerror or error}). If a hexwrap "
            "server runs there already, use it; otherwise choose another --port."
        ) from None
    host, port = listener.getsockname()[:2]
    log.info("listening on http://%s:%s", f"[{host}]" if ":" in host else host, port)
    return listener


def _on_loop_fault(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """What nobody waits for. Connections that cannot be accepted wait, and are not worth a traceback each."""
    error = context.get("exception")
    if isinstance(error, OSError) and error.errno in (errno.EMFILE, errno.ENFILE):
        log.debug("no file handle is free for a connection")
    else:
        log.error("%s", context["message"], exc_info=error)


async def _on_error(request: Request, error: Exception) -> Response:
    assert isinstance(error, HexwrapError)
    return problem_response(error)


async def _on_os_error(request: Request, error: Exception) -> Response:
    """Such as too many open files."""
    log.error("a file cannot be used", exc_info=error)
    return problem_response(StorageError.of(error))


async def _on_http_exception(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    title, detail = {
        404: (
            "No such address",
            f"Nothing is at {request.url.path[:200]}; the routes are listed at /docs.",
        ),
        405: ("Method not allowed", f"{request.method} is not possible at {request.url.path[:200]}."),
    }.get(error.status_code, (str(error.detail), str(error.detail)))
    slug = {404: "not-found", 405: "method-not-allowed"}.get(error.status_code, "http")
    headers = dict(error.headers or {})
    if error.status_code == 405:
        headers["Allow"] = ", ".join(_allowed(request))
    return problem_response(HttpError(error.status_code, slug, title, detail, headers))


def _allowed(request: Request) -> list[str]:
    """Methods that this path answers to, by whichever route: the router itself names those of the first."""
    asked = {"type": "http", "path": request.scope["path"], "root_path": "", "headers": []}
    taken = {m for m in METHODS if any(_takes(route, asked | {"method": m}) for route in request.app.routes)}
    return sorted(taken | {"HEAD"} if "GET" in taken else taken)


def _takes(route: BaseRoute, asked: Scope) -> bool:
    if isinstance(route, Mount) and asked["method"] != "GET":
        return False  # a folder of files matches any method
    return route.matches(asked)[0] is Match.FULL


async def _on_parameters(request: Request, error: Exception) -> Response:
    """Faults in the path or the query; bodies have their own way (``schemas``)."""
    assert isinstance(error, RequestValidationError)
    listed = [(".".join(map(str, e["loc"][1:])), e["msg"]) for e in error.errors()]
    return problem_response(bad_parameters(f"Parameter '{listed[0][0]}': {listed[0][1]}.", listed))
