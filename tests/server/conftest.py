"""Worker processes outlive the servers that run in the test process: to start one, SciPy is imported for
seconds, and every server has three or four. Servers in processes of their own (``process.served``) and
engines whose workers load test functions start theirs as ever.
"""

from __future__ import annotations

import subprocess
from collections import defaultdict
from collections.abc import Iterator
from typing import Any, ClassVar

import pytest

from hexwrap_server.http.service import ERRANDS_PRELOAD
from hexwrap_server.jobs import engine
from hexwrap_server.jobs.engine import ENGINE_PRELOAD
from hexwrap_server.jobs.worker import WorkerProcess

#: What is kept of a kind, at most.
MOST = 3


Idle = dict[str, list[subprocess.Popen[bytes]]]


class KeptWorker(WorkerProcess):
    """Left idle when its engine stops, and taken up by an engine of a later test: servers that one test
    starts on the same folder share no memory."""

    left: ClassVar[Idle] = defaultdict(list)
    idle: ClassVar[Idle] = defaultdict(list)
    _busy = True

    def start(self) -> None:
        idle = self.idle[self._preload]
        while idle:
            self._process = idle.pop()
            self._stopped = False
            if self.is_alive:
                return
        super().start()
        super().wait_ready()

    def wait_ready(self) -> None:
        self._busy = False

    def run(self, *call: Any) -> Any:
        self._busy = True
        result = super().run(*call)
        self._busy = False
        return result

    def stop(self) -> None:
        left, process = self.left[self._preload], self._process
        if self._preload in (ENGINE_PRELOAD, ERRANDS_PRELOAD) and not self._busy and len(left) < MOST:
            self._busy, self._process, self._seen = True, None, None
            if process is not None and process.poll() is None:
                left.append(process)
        else:
            super().stop()


engine.WorkerProcess = KeptWorker  # type: ignore[misc]


@pytest.fixture(autouse=True)
def workers_for_later_tests() -> Iterator[None]:
    yield
    for preload, left in KeptWorker.left.items():
        idle = KeptWorker.idle[preload]
        idle += left
        left.clear()
        while len(idle) > MOST:
            end(idle.pop(0))


@pytest.fixture
def fresh_workers() -> None:
    """None of the workers was started before the test: they write where the test's process does now."""
    pytest_sessionfinish()


def pytest_sessionfinish() -> None:
    for kept in (*KeptWorker.left.values(), *KeptWorker.idle.values()):
        while kept:
            end(kept.pop())


def end(process: subprocess.Popen[bytes]) -> None:
    process.kill()
    process.wait()
    for pipe in (process.stdin, process.stdout):
        assert pipe is not None
        pipe.close()
