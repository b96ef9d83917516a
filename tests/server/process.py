"""A server as a process of its own, to be signalled and killed."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
import psutil

from tests.server import forked
from tests.server.patience import PATIENCE, until

PROGRAM = """
import asyncio, pathlib, sys, time
from tests.server import forked
from hexwrap_server.http.app import serve
from hexwrap_server.settings import Settings
longest, run = [0.0], asyncio.Handle._run
note = pathlib.Path(sys.argv[2], "longest").open("w")  # once: a test may leave no handle free
def timed(handle):
    start = time.thread_time()
    run(handle)
    if time.thread_time() - start > longest[0]:
        longest[0] = time.thread_time() - start
        note.seek(0)
        note.write(f"{longest[0]:.9f}")
        note.flush()
asyncio.Handle._run = timed
forked.fork_from_here()
serve(Settings.from_environment({"port": int(sys.argv[1]), "data": sys.argv[2], "workers": int(sys.argv[3])}))
"""


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port: int = taken.getsockname()[1]
        return port


@contextmanager
def served(
    data: Path, port: int, workers: int = 2, *, group: bool = False, **settings: object
) -> Iterator[subprocess.Popen[bytes]]:
    """A server process that answers. group: it leads a process group of its own."""
    command = [sys.executable, "-c", PROGRAM, str(port), str(data), str(workers)]
    with (data / "log").open("ab") as log:
        variables = {f"HEXWRAP_{name.upper()}": str(value) for name, value in settings.items()}
        environment = os.environ | variables | {"PYTHONPATH": forked.paths()}
        process = forked.popen(command, env=environment, stderr=log, start_new_session=group)
    try:
        until(lambda: answers(process, data, port), "the server")
        yield process
    finally:
        process.kill()
        process.wait()


def answers(process: subprocess.Popen[bytes], data: Path, port: int) -> bool:
    assert process.poll() is None, (data / "log").read_text()
    try:
        httpx.get(f"http://127.0.0.1:{port}/health", trust_env=False, timeout=PATIENCE, verify=False)
    except httpx.TransportError:
        return False
    return True


def longest_step(data: Path) -> float:
    """Seconds of processor time of the longest step of a served server's event loop: so long nobody else was
    answered, on a machine without other work."""
    return float((data / "longest").read_text())


def children(process: subprocess.Popen[bytes]) -> list[psutil.Process]:
    """All but the template of its workers, which only tests have."""
    return [c for c in psutil.Process(process.pid).children(recursive=True) if not is_template(c)]


def is_template(process: psutil.Process) -> bool:
    try:
        return process.name() == forked.NAME
    except psutil.NoSuchProcess:  # it has just ended
        return False


def is_gone(process: psutil.Process) -> bool:
    """A process that init has not collected yet is gone all the same."""
    try:
        return not process.is_running() or process.status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return True
