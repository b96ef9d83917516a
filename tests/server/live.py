"""A real server on a free port of this machine, in a thread of the test process."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Coroutine, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import httpx
import uvicorn

from hexwrap_server.http.app import create_app, open_listener
from hexwrap_server.http.service import Service
from hexwrap_server.jobs.engine import Engine
from hexwrap_server.settings import Settings
from tests.server.patience import PATIENCE, until

T = TypeVar("T")
OVER = ("done", "failed", "cancelled")


class Live(httpx.Client):
    """A client of a running server, and the server's inside."""

    service: Service
    loop: asyncio.AbstractEventLoop

    def run(self, story: Coroutine[Any, Any, T]) -> T:
        """What a coroutine comes to in the event loop of the server."""
        return asyncio.run_coroutine_threadsafe(story, self.loop).result(PATIENCE)


@contextmanager
def running(data: Path, own: Engine | None = None, **settings: Any) -> Iterator[Live]:
    """A server that keeps its things in data."""
    settings = {"workers": 2, "data": str(data)} | settings
    app = create_app(Settings(**settings), own)
    listener = open_listener(Settings(port=0))
    server = uvicorn.Server(
        uvicorn.Config(
            app, log_level="warning", access_log=False, timeout_graceful_shutdown=1, server_header=False
        )
    )
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
    thread.start()
    try:
        while not server.started and thread.is_alive():
            time.sleep(0.01)
        port = listener.getsockname()[1]
        with Live(base_url=f"http://127.0.0.1:{port}", timeout=PATIENCE, trust_env=False) as client:
            client.service = app.state.service
            client.loop = app.state.service.loop
            yield client
    finally:
        server.should_exit = True
        thread.join(PATIENCE)
        listener.close()


def until_at(client: httpx.Client, id: str, stage: str = "surface") -> None:
    """Until the job runs and is at a stage. To be seen there it has to stay there."""

    def is_there() -> bool:
        job = client.get(f"/v1/jobs/{id}").json()
        assert job["status"] not in OVER, f"over before it was seen at its {stage}: {job}"
        return (job["status"], job["stage"]) == ("running", stage)

    until(is_there, f"job {id} at its {stage}")


def over_first(client: httpx.Client, ids: list[str]) -> dict[str, Any]:
    """The first of some jobs that is over."""

    def over() -> dict[str, Any] | None:
        jobs: list[dict[str, Any]] = [client.get(f"/v1/jobs/{id}").json() for id in ids]
        return next((job for job in jobs if job["status"] in OVER), None)

    job = until(over, "the end of a job")
    assert job is not None
    return job


def finished(client: httpx.Client, id: str) -> dict[str, Any]:
    """The job when it is over."""
    return over_first(client, [id])
