"""What the service adds to the solver, and what it carries.

    python benchmarks/service.py [--vertices 2000 20000] [--rounds 5] [--workers 2] [--clients 1 8 50]

overhead: wall time of POST /v1/solve over that of the pipeline alone, on the same new surfaces, the best of a
few rounds in turn, and how much of it lies outside the stages. cached: a request of about 1,000 panels again.
throughput and latency: towers of 2,000 vertices, none seen before, from 1, 8 and 50 clients at once.
"""

from __future__ import annotations

import argparse
import os

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"))

import gzip
import itertools
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

import httpx
import numpy as np
import orjson

from hexwrap_server.input.schemas import parse_request
from hexwrap_server.jobs.work import take_in
from hexwrap_solver import pipeline

PROGRAM = """
import sys
from hexwrap_server.http.app import serve
from hexwrap_server.settings import Settings
port, data, workers = int(sys.argv[1]), sys.argv[2], int(sys.argv[3])
serve(Settings(port=port, data=data, workers=workers, log_level="error", max_queue=1000))
"""
_NEW = itertools.count()


def tower(n: int) -> dict[str, Any]:
    """About n vertices on a doubly curved tower that was never sent before."""
    around, rows = round(np.sqrt(2.0 * n)), round(np.sqrt(n / 2.0))
    t = 2 * np.pi * np.arange(around) / around
    z = np.linspace(0, 1, rows)[:, None]
    r = 1 + 0.4 * np.cos(5 * z) + 0.15 * np.cos(2 * t + 3 * z) + 1e-6 * next(_NEW)
    points = np.stack([r * np.cos(t), r * np.sin(t), 4 * z + 0 * t], axis=-1).reshape(-1, 3)
    i, j = (x.ravel() for x in np.meshgrid(np.arange(around), np.arange(rows - 1)))
    a, b = j * around + i, j * around + (i + 1) % around
    faces = np.concatenate([np.stack([a, b, b + around], 1), np.stack([a, b + around, a + around], 1)])
    return {"vertices": points.tolist(), "faces": faces.tolist()}


@contextmanager
def server(workers: int) -> Iterator[httpx.Client]:
    """A client of a server process with data of its own."""
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    limits = httpx.Limits(max_connections=None)
    with (
        tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as data,
        httpx.Client(
            base_url=f"http://127.0.0.1:{port}", timeout=600, trust_env=False, limits=limits
        ) as client,
    ):
        process = subprocess.Popen([sys.executable, "-c", PROGRAM, str(port), data, str(workers)])
        try:
            while not ready(client):
                time.sleep(0.1)
            yield client
        finally:
            process.terminate()
            process.wait()


def ready(client: httpx.Client) -> bool:
    try:
        return client.get("/ready").status_code == 200
    except httpx.TransportError:
        return False


def posted(client: httpx.Client, body: bytes) -> tuple[float, bytes]:
    """Seconds until the whole answer is there, and the answer."""
    start = time.perf_counter()
    with client.stream("POST", "/v1/solve", content=body) as answer:
        raw = b"".join(answer.iter_raw())
        seconds = time.perf_counter() - start
    answer.raise_for_status()
    packed = answer.headers.get("content-encoding") == "gzip"
    return seconds, gzip.decompress(raw) if packed else raw


def alone(body: bytes) -> float:
    """Seconds of the pipeline without the service."""
    request = parse_request(orjson.loads(body), 10**7, 10**6)
    wanted = request.wanted
    start = time.perf_counter()
    pipeline.solve(lambda: take_in(request.surface, wanted.surface), wanted)  # type: ignore[arg-type]
    return time.perf_counter() - start


def overhead(client: httpx.Client, n: int, rounds: int) -> None:
    own, through, staged, again = [], [], [], []
    for _ in range(rounds):
        body = orjson.dumps({"surface": tower(n), "pattern": {"around": 48}})
        own.append(alone(body))
        seconds, answer = posted(client, body)
        through.append(seconds)
        staged.append(sum(orjson.loads(answer)["timings"].values()))
        again.append(posted(client, body)[0])
    a, b = min(own), min(through)
    median = statistics.median(t / s for t, s in zip(through, own, strict=True))
    outside = min(t - s for t, s in zip(through, staged, strict=True))
    print(
        f"{n:>8} vertices  solver {a:7.3f} s   service {b:7.3f} s   adds {100 * (b / a - 1):5.1f} % "
        f"  (median of neighbours {100 * (median - 1):5.1f} %)"
        f"  outside stages {outside:6.3f} s ({100 * outside / a:4.1f} %)   again {1000 * min(again):6.1f} ms"
    )


def cached(client: httpx.Client) -> None:
    """A fully cached answer of about 1,000 panels, packed and plain."""
    body = orjson.dumps({"surface": tower(2000), "pattern": {"around": 40}})
    panels = len(orjson.loads(posted(client, body)[1])["panels"]["polygons"])
    for accept in ("gzip", "identity"):
        client.headers["Accept-Encoding"] = accept
        times = [posted(client, body)[0] for _ in range(20)]
        print(
            f"{panels:>8} panels, cached, {accept:8}  best {1000 * min(times):5.1f} ms   "
            f"median {1000 * statistics.median(times):5.1f} ms"
        )
    client.headers["Accept-Encoding"] = "gzip"


def load(client: httpx.Client, clients: int, jobs: int) -> None:
    bodies = [orjson.dumps({"surface": tower(2000), "pattern": {"around": 48}}) for _ in range(jobs)]
    start = time.perf_counter()
    with ThreadPoolExecutor(clients) as threads:
        times = sorted(threads.map(lambda body: posted(client, body)[0], bodies))
    seconds = time.perf_counter() - start
    print(
        f"{clients:>8} clients   {jobs / seconds:6.2f} jobs/s   median {statistics.median(times):6.3f} s "
        f"  95 % {times[int(0.95 * len(times))]:6.3f} s"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--vertices", type=int, nargs="+", default=[2000, 20000])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--clients", type=int, nargs="*", default=[1, 8, 50])
    given = parser.parse_args()
    with server(given.workers) as client:
        alone(orjson.dumps({"surface": tower(500)}))  # so that neither side pays for first imports
        for _ in range(2 * given.workers):
            posted(client, orjson.dumps({"surface": tower(500)}))
        for n in given.vertices:
            overhead(client, n, given.rounds)
        cached(client)
        for clients in given.clients:
            load(client, clients, max(10, min(5 * clients, 100)))


if __name__ == "__main__":
    main()
