"""The bundled samples through the service, over HTTP like any client: a table, the files and a picture."""

from __future__ import annotations

import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
from rich.console import Console

from hexwrap_server import samples
from hexwrap_server.cli.local import sample_body
from hexwrap_server.cli.summary import print_summary
from hexwrap_server.errors import UsageError
from hexwrap_server.output.writers import WRITERS

#: Seconds: for one answer, for a server to start, to stop before it is killed, between two looks at a job.
ANSWER, START, STOP, LOOK = 120.0, 60.0, 10.0, 0.2
ALL = "all"

#: Called while a job runs: stage, fraction 0..1, words.
Listener = Callable[[str, float, str], None]


class DemoError(Exception):
    """The demo cannot go on; the sentence says why."""


def run_demo(sample: str, out: Path, port: int, console: Console, listen: Listener) -> None:
    """Run one sample (or ``all``), using the hexwrap server on that port or one started for the while.

    Raises DemoError, UsageError.
    """
    names = samples.names() if sample == ALL else [sample]
    bodies = {name: sample_body(name) for name in names}
    with server(port, console) as client:
        for name, body in bodies.items():
            show(client, name, body, out / name, console, listen)


def show(
    client: httpx.Client, name: str, body: dict[str, Any], folder: Path, console: Console, listen: Listener
) -> None:
    """Send one request, print what came out and save its files. Raises DemoError."""
    start = time.perf_counter()
    job = finished(client, body, listen)
    seconds = time.perf_counter() - start
    result = _answer(client.get(f"/v1/jobs/{job['id']}/result")).json()
    console.print()
    print_summary(console, name, {"timings": job["timings"], **result})
    console.print(f"\n{seconds:.1f} s from the request to the finished job", highlight=False)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for file in WRITERS:
            (folder / file).write_bytes(_answer(client.get(f"/v1/jobs/{job['id']}/files/{file}")).content)
    except OSError as error:
        raise UsageError(f"{folder} cannot be written: {error.strerror or error}.") from None
    console.print(f"files in {folder.resolve()}: {', '.join(WRITERS)}", highlight=False)
    console.print(f"picture: {(folder / 'panels.png').resolve()}", highlight=False)


def finished(client: httpx.Client, body: dict[str, Any], listen: Listener) -> dict[str, Any]:
    """Send a job and wait for its end. Raises DemoError where it failed."""
    job = _answer(client.post("/v1/jobs", json=body)).json()
    while job["status"] in ("queued", "running"):
        listen(job["stage"] or job["status"], job["progress"], "")
        job = _answer(client.get(f"/v1/jobs/{job['id']}", params={"wait": LOOK})).json()
    if job["status"] != "done":
        raise DemoError((job["problem"] or {}).get("detail", f"the job was {job['status']}."))
    return dict(job)


@contextmanager
def server(port: int, console: Console) -> Iterator[httpx.Client]:
    """A client of the hexwrap server on that port, or of one that is started now and stopped at the end."""
    found = who_answers(port)
    if found == "hexwrap":
        console.print(f"using the hexwrap server on port {port}", highlight=False)
        with _client(port) as client:
            yield client
        return
    if found == "other":
        console.print(f"port {port} is used by another program; taking another port", highlight=False)
        port = _free_port()
    with tempfile.TemporaryDirectory(prefix="hexwrap-demo-", ignore_cleanup_errors=True) as folder:
        log = Path(folder) / "server.log"
        with log.open("wb") as lines:
            process = start_server(port, Path(folder) / "data", lines.fileno())
        try:
            with _client(port) as client:
                _wait_until_ready(client, process, log)
                console.print(f"started a hexwrap server on port {port}", highlight=False)
                yield client
        finally:
            stop_server(process)
            console.print("stopped the server that was started", highlight=False)


def start_server(port: int, data: Path, log: int) -> subprocess.Popen[bytes]:
    """``hexwrap serve`` as a process of its own, which a Ctrl-C in this console does not reach."""
    words = ["serve", "--port", str(port), "--data", str(data), "--workers", "1"]
    command = [sys.executable, "-m", "hexwrap_server.cli", *words]
    return subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=log,
        stderr=log,
        start_new_session=sys.platform != "win32",
        creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
    )


def stop_server(process: subprocess.Popen[bytes]) -> None:
    """Ask it to end, and make it end."""
    process.terminate()
    try:
        process.wait(STOP)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def who_answers(port: int) -> str:
    """``hexwrap``, ``other`` or ``nobody``: who answers."""
    with _client(port) as client:
        try:
            health = client.get("/health", timeout=3.0).json()
        except httpx.ConnectError:
            return "nobody"
        except (httpx.HTTPError, ValueError):
            return "other"
    known = isinstance(health, dict) and {"status", "version", "workers"} <= health.keys()
    return "hexwrap" if known else "other"


def _client(port: int) -> httpx.Client:
    return httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=ANSWER, trust_env=False)


def _wait_until_ready(client: httpx.Client, process: subprocess.Popen[bytes], log: Path) -> None:
    deadline = time.monotonic() + START
    while time.monotonic() < deadline:
        if process.poll() is not None:
            raise DemoError(f"the server did not start: {log.read_text(errors='replace').strip()}")
        try:
            client.get("/health", timeout=3.0).raise_for_status()
            return
        except httpx.HTTPError:
            time.sleep(0.1)
    raise DemoError(f"the server did not answer within {START:g} s.")


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _answer(response: httpx.Response) -> httpx.Response:
    """Raises DemoError with the problem's detail."""
    if response.is_success:
        return response
    try:
        detail = response.json()["detail"]
    except (ValueError, KeyError, TypeError):
        detail = f"the server answered {response.status_code} to {response.request.url}."
    raise DemoError(detail)
