"""What was once sent to bring the server down, as requests to a server process, and what they cost it."""

from __future__ import annotations

import contextlib
import gzip
import json
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import httpx
import psutil

from hexwrap_server import samples
from tests.server.bodies import request, tube
from tests.server.patience import PATIENCE, until
from tests.server.process import children

MIB = 2**20
#: Seconds between two looks at the memory of all processes.
LOOK = 0.02
Answers = list[httpx.Response]


@dataclass
class Target:
    """A server process, in whose folder are 1,000 finished jobs. bomb: MiB that a body unpacks to."""

    process: Any
    client: httpx.Client
    health: httpx.Client
    data: Path
    bomb: int

    @cached_property
    def packed(self) -> bytes:
        """Numbers that take eight times as much as a list of floats."""
        return gzip.compress(b"[" + b"1.5," * (self.bomb * MIB // 4) + b"1]", 1)

    def send_bomb(self) -> httpx.Response:
        return self.client.post("/v1/jobs", content=self.packed, headers={"Content-Encoding": "gzip"})

    def together(self, count: int, send: Callable[[], httpx.Response]) -> Answers:
        with ThreadPoolExecutor(count) as threads:
            return [sent.result() for sent in [threads.submit(send) for _ in range(count)]]


def long_name(target: Target) -> Answers:
    body = b'{"%s": [%s, [NaN]]}' % (b"n" * 1_000_000, b",".join([b"[1]"] * 4000))
    return [target.client.post("/v1/jobs", content=body)]


def flipped_bit(target: Target) -> Answers:
    """A bit of a length that Rhino's library believes for many seconds."""
    data = bytearray(samples.path_3dm("tower").read_bytes())
    data[1084] ^= 16
    return [target.client.post("/v1/surfaces?name=tower.3dm", content=bytes(data))]


def bombs(target: Target, count: int = 12) -> Answers:
    """A small body does not wait for them."""
    with ThreadPoolExecutor(count) as threads:
        sent = [threads.submit(target.send_bomb) for _ in range(count)]
        small = target.client.post("/v1/surfaces", json=tube(around=30))
        assert small.status_code == 201
        assert not all(one.done() for one in sent), "a small body waited for twelve large ones"
        return [small, *(one.result() for one in sent)]


def known_posts(target: Target) -> Answers:
    body = json.dumps(request()).encode()
    first = target.client.post("/v1/solve", content=body)
    return [first, *target.together(200, lambda: target.client.post("/v1/jobs", content=body))]


def long_list(target: Target) -> Answers:
    return target.together(4, lambda: target.client.get("/v1/jobs?limit=1000"))


def overflowing(target: Target) -> Answers:
    waist = samples.load("waist")
    waist["surface"]["nurbs"]["knots"] = [
        [x * 1e308 for x in row] for row in waist["surface"]["nurbs"]["knots"]
    ]
    point = {"mode": "angles", "angles": [{"point": [1e308, 0, 0], "angle": 3.0}]}
    bodies = [request(boundary=point), request(panels={"increment": 5e-324})]
    # infinite numbers are not JSON: Python writes them all the same
    texts = [json.dumps(body).encode() for body in (*bodies, waist)]
    return [target.client.post("/v1/solve", content=text) for text in texts]


def long_number(target: Target) -> Answers:
    """420 kB of which one coordinate takes 300 kB; the two curves of points are no surface."""
    vertices = b"".join(b"v %d %d 0\n" % (x, x * x) for x in range(8000))
    data = vertices + b"v 1." + b"0" * 300_000 + b" 0 1\nf 1 2 8001\n"
    return [target.client.post("/v1/surfaces?name=a.obj", content=data)]


def damaged(target: Target) -> Answers:
    """Kept results are cut short behind the server's back."""
    body = request(pattern={"around": 13})
    first = target.client.post("/v1/solve", json=body)
    for path in (target.data / "results").iterdir():
        path.write_bytes(path.read_bytes()[:-20])
    return [first, target.client.post("/v1/solve?include=sizes", json=body)]


def killed(target: Target) -> Answers:
    """All idle children at once: they are replaced, and none stays a zombie."""
    old = children(target.process)
    for child in old:
        child.kill()
    until(lambda: not any(psutil.pid_exists(child.pid) for child in old), "the end of the killed")
    return [target.client.post("/v1/solve", json=request(pattern={"around": 14}))]


def few_handles(target: Target) -> Answers:
    """64 of them, too few for all who ask. What is kept is not called gone."""
    job = target.client.post("/v1/jobs", json=request(pattern={"around": 15})).json()["id"]
    target.client.get(f"/v1/jobs/{job}?wait=60")
    server = psutil.Process(target.process.pid)
    usual = server.rlimit(psutil.RLIMIT_NOFILE)
    server.rlimit(psutil.RLIMIT_NOFILE, (64, usual[1]))
    path, alone = f"/v1/jobs/{job}/result?include=corners", {"Connection": "close"}
    found = target.together(60, lambda: target.client.get(path, headers=alone))
    server.rlimit(psutil.RLIMIT_NOFILE, usual)
    return [*found, target.client.get(f"/v1/jobs/{job}/result")]


def shutdown(target: Target) -> Answers:
    """While bodies are unpacked; the last attack."""
    with ThreadPoolExecutor(3) as threads:
        sent = [threads.submit(target.send_bomb) for _ in range(3)]
        until(lambda: max(memory(target.process)[1:], default=0) > 200, "the unpacking")
        target.process.terminate()
        target.process.wait(PATIENCE)
        return [one.result() for one in sent]


@dataclass
class Cost:
    """MiB of the server and of its largest child at their highest, seconds, slowest answer of /health."""

    server: float = 0.0
    child: float = 0.0
    seconds: float = 0.0
    health: float = 0.0


def memory(process: Any) -> list[float]:
    """MiB of a server process and of each of its children."""
    found = []
    for one in (psutil.Process(process.pid), *children(process)):
        with contextlib.suppress(psutil.Error):
            found.append(one.memory_info().rss / MIB)
    return found


def measured(target: Target, attack: Callable[[Target], Answers]) -> tuple[Answers, Cost]:
    """What an attack was answered, and what it cost."""
    assert target.packed  # made before the clock runs
    cost, done = Cost(), threading.Event()

    def look() -> None:
        with contextlib.suppress(psutil.Error):  # the server has ended
            while not done.wait(LOOK):
                server, *others = memory(target.process)
                cost.server, cost.child = max(cost.server, server), max(cost.child, *others, 0.0)

    def ask() -> None:
        with contextlib.suppress(httpx.TransportError):
            while not done.wait(LOOK):
                start = time.monotonic()
                target.health.get("/health").raise_for_status()
                cost.health = max(cost.health, time.monotonic() - start)

    start = time.monotonic()
    with ThreadPoolExecutor(2) as threads:
        watching = [threads.submit(look), threads.submit(ask)]
        try:
            answers = attack(target)
        finally:
            done.set()
            cost.seconds = time.monotonic() - start
        for one in watching:
            one.result()
    return answers, cost


#: Each attack and the statuses that its answers may have.
ATTACKS: dict[Callable[[Target], Answers], set[int]] = {
    long_name: {422},
    flipped_bit: {422},
    bombs: {201, 422, 503},
    known_posts: {200, 202},
    long_list: {200},
    overflowing: {400, 422},
    long_number: {201, 422},
    damaged: {200},
    killed: {200},
    few_handles: {200, 503},
    shutdown: {503},
}
