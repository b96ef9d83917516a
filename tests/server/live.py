"""A real server on a free port of this machine, in a thread of the test process."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import uvicorn

from hexwrap_server.http.app import create_app, open_listener
from hexwrap_server.http.service import Service
from hexwrap_server.jobs.engine import Engine
from hexwrap_server.settings import Settings

OVER = ("done", "failed", "cancelled")


class Live(httpx.Client):
    """A client of a running server, and the server's inside."""

    service: Service


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
        with Live(base_url=f"http://127.0.0.1:{port}", timeout=60, trust_env=False) as client:
            client.service = app.state.service
            yield client
    finally:
        server.should_exit = True
        thread.join(20)
        listener.close()


def until_at(client: httpx.Client, id: str, stage: str = "surface", seconds: float = 60) -> None:
    """Until the job runs and is at a stage. To be seen there it has to stay there."""
    deadline = time.monotonic() + seconds
    while True:
        job = client.get(f"/v1/jobs/{id}").json()
        assert job["status"] not in OVER, f"over before it was seen at its {stage}: {job}"
        if (job["status"], job["stage"]) == ("running", stage):
            return
        assert time.monotonic() < deadline, f"not at its {stage} after {seconds} s: {job}"
        time.sleep(0.02)


def over_first(client: httpx.Client, ids: list[str], seconds: float = 60) -> dict[str, Any]:
    """The first of some jobs that is over."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        for id in ids:
            job: dict[str, Any] = client.get(f"/v1/jobs/{id}").json()
            if job["status"] in OVER:
                return job
        time.sleep(0.02)
    raise AssertionError(f"none of {ids} is over after {seconds} s")


def finished(client: httpx.Client, id: str, seconds: float = 60) -> dict[str, Any]:
    """The job when it is over."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        job: dict[str, Any] = client.get(f"/v1/jobs/{id}", params={"wait": 10}).json()
        if job["status"] in OVER:
            return job
    raise AssertionError(f"job {id} is not over after {seconds} s")
