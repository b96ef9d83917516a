"""Servers and workers killed at random under load; afterwards every accepted job is accounted for."""

from __future__ import annotations

import contextlib
import hashlib
import random
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.server.bodies import tube
from tests.server.patience import PATIENCE
from tests.server.process import children, free_port, is_gone, served

#: To read the certificates of the machine takes longer than the request.
PLAIN: dict[str, Any] = {"trust_env": False, "verify": False, "timeout": PATIENCE}
#: What may become of a job whose worker or server was killed.
EXCUSES = ("/problems/worker-died", "/problems/too-many-attempts")


class Load:
    """Clients that send jobs of different weight and remember what was accepted, and what was done."""

    def __init__(self, base: str, seed: int) -> None:
        self.accepted: list[str] = []
        self.done: dict[str, str] = {}
        self._base = base
        self._chance = random.Random(seed)
        self._over = threading.Event()
        self._threads = [threading.Thread(target=self._send), threading.Thread(target=self._look)]

    def __enter__(self) -> Load:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *ignored: object) -> None:
        self._over.set()
        for thread in self._threads:
            thread.join()

    def wait_for_one_more(self) -> None:
        """Until the server has accepted another job: nothing is learnt from killing one that has none."""
        before, over = len(self.accepted), time.monotonic() + PATIENCE
        while len(self.accepted) == before:
            assert time.monotonic() < over, "no job was accepted"
            time.sleep(0.05)

    def _send(self) -> None:
        i = 0
        while not self._over.wait(self._chance.uniform(0.02, 0.3)):
            i += 1
            size = self._chance.choice([12, 12, 24, 120])
            body = {"surface": tube(size, size // 2, height=10 + i % 7), "pattern": {"around": 8 + i % 5}}
            with contextlib.suppress(httpx.TransportError):
                answer = httpx.post(f"{self._base}/v1/jobs", json=body, **PLAIN)
                if answer.status_code == 202:
                    self.accepted.append(answer.json()["id"])

    def _look(self) -> None:
        while not self._over.wait(0.1):
            with contextlib.suppress(httpx.TransportError):
                for job in httpx.get(f"{self._base}/v1/jobs", **PLAIN).json()["jobs"]:
                    if job["status"] == "done" and job["id"] not in self.done:
                        self.done[job["id"]] = fingerprint(self._base, job["id"])


def fingerprint(base: str, id: str) -> str:
    answer = httpx.get(f"{base}/v1/jobs/{id}/result", **PLAIN)
    assert answer.status_code == 200
    assert answer.json()["quality"]["scale_ratio"] >= 1
    return hashlib.sha256(answer.content).hexdigest()


def lives(data: Path, port: int, kills: int, chance: random.Random) -> Iterator[int]:
    """Servers one after the other on the same data; yields how many kills are still to come."""
    while kills > 0:
        with ExitStack() as stack:
            server = stack.enter_context(served(data, port))
            while kills > 0:
                yield kills
                time.sleep(chance.uniform(0.2, 2.0))
                kills -= 1
                workers = children(server)
                if workers and chance.random() < 0.5:
                    with contextlib.suppress(Exception):
                        chance.choice(workers).kill()
                else:
                    server.kill()
                    server.wait()
                    gone_by = time.monotonic() + PATIENCE
                    while not all(map(is_gone, workers)):
                        assert time.monotonic() < gone_by, "workers outlived their server"
                        time.sleep(0.05)
                    break  # and the next server takes over


def torment(data: Path, kills: int, seed: int) -> None:
    port, chance = free_port(), random.Random(seed)
    base = f"http://127.0.0.1:{port}"
    with Load(base, seed) as load:
        for _ in lives(data, port, kills, chance):
            load.wait_for_one_more()
    assert load.accepted
    with served(data, port):
        told = {id: settled(base, id) for id in load.accepted}
        for job in told.values():
            assert job["status"] in ("done", "failed"), job
            if job["status"] == "failed":
                assert job["problem"]["type"] in EXCUSES, job
        failed = sum(job["status"] == "failed" for job in told.values())
        assert failed < len(told)
        assert failed <= 2 * kills  # two workers, and what shares their work
        for id, before in load.done.items():
            assert fingerprint(base, id) == before


def settled(base: str, id: str) -> dict[str, Any]:
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        answer = httpx.get(f"{base}/v1/jobs/{id}?wait=10", **PLAIN)
        assert answer.status_code == 200, f"accepted job {id} was lost"
        job: dict[str, Any] = answer.json()
        if job["status"] in ("done", "failed", "cancelled"):
            return job
    raise AssertionError(f"job {id} is never over")


def test_every_job_is_accounted_for_after_a_few_kills(tmp_path: Path) -> None:
    torment(tmp_path, kills=2, seed=1)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(5))
def test_every_job_is_accounted_for_after_fifty_kills(tmp_path: Path, seed: int) -> None:
    torment(tmp_path, kills=10, seed=seed)
