"""Fifty clients at once: everybody is served, and nothing is computed twice."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import httpx

from tests.server.bodies import tube
from tests.server.patience import PATIENCE
from tests.server.process import free_port, longest_step, served

CLIENTS = 50
#: Seconds of processor time for which the server may answer nobody else, such as /health.
LONGEST_STEP = 0.5


def test_fifty_clients_at_once(tmp_path: Path) -> None:
    port = free_port()
    with (
        served(tmp_path, port),
        httpx.Client(
            base_url=f"http://127.0.0.1:{port}",
            timeout=PATIENCE,
            trust_env=False,
            limits=httpx.Limits(max_connections=CLIENTS),
        ) as client,
        ThreadPoolExecutor(CLIENTS) as threads,
    ):

        def one(i: int) -> tuple[int, dict[str, Any]]:
            body = {"name": f"{i % 10}", "surface": tube(height=10 + i % 10), "pattern": {"around": 10}}
            answer = client.post("/v1/solve", json=body)
            return answer.status_code, answer.json()

        answers = list(threads.map(one, range(2 * CLIENTS)))
        assert longest_step(tmp_path) < LONGEST_STEP
        assert {status for status, _ in answers} == {200}
        for i, (_, result) in enumerate(answers):
            assert result == answers[i % 10][1]
        jobs = client.get("/v1/jobs", params={"limit": 1000}).json()["jobs"]
        assert len(jobs) == 2 * CLIENTS
        counted = client.get("/metrics").text
        assert 'hexwrap_jobs_total{status="done"}' in counted
        assert [runs(jobs, f"{name}") for name in range(10)] == [1] * 10


def runs(jobs: list[dict[str, Any]], name: str) -> int:
    """How often the work of the jobs of this name was done: jobs that share a run share its times."""
    alike = [job for job in jobs if job["name"] == name]
    assert len(alike) == 2 * CLIENTS / 10
    own = [job for job in alike if "result" not in job["found"].values()]  # not taken from a finished one
    return len({tuple(sorted(job["timings"].items())) for job in own})
