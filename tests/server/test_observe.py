"""What is counted of answers, and what every answer carries, the one to a fault too."""

from __future__ import annotations

import logging
from collections.abc import Iterator

import pytest

from hexwrap_server.http import routes
from tests.server.live import Live, running


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    with running(tmp_path_factory.mktemp("data"), workers=1) as live:
        yield live


def counted(client: Live, method: str, route: str, status: int) -> float:
    labels = {"method": method, "route": route, "status": str(status)}
    value = client.service.metrics.registry.get_sample_value("hexwrap_http_requests_total", labels)
    return value or 0.0


def test_invented_methods_are_counted_together(client: Live) -> None:
    before = counted(client, "other", "/health", 405) + counted(client, "other", "other", 405)
    for i in range(5):
        assert client.request(f"INVENTED{i}", "/health").status_code == 405
    assert counted(client, "other", "/health", 405) + counted(client, "other", "other", 405) == before + 5
    assert "INVENTED" not in client.get("/metrics").text


@pytest.mark.parametrize("method", ["GET", "HEAD"])
def test_answers_are_counted_by_their_route(client: Live, method: str) -> None:
    before = counted(client, method, "/v1/jobs/{id}", 404)
    assert client.request(method, "/v1/jobs/unknown").status_code == 404
    assert counted(client, method, "/v1/jobs/{id}", 404) == before + 1


@pytest.mark.parametrize("method", ["GET", "HEAD"])
def test_faults_are_answered_like_anything_else(
    client: Live, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, method: str
) -> None:
    def stumble(request: object) -> None:
        raise KeyError("a bug")

    before = counted(client, method, "/ready", 500)
    monkeypatch.setattr(routes, "service_of", stumble)
    answer = client.request(method, "/ready")
    monkeypatch.undo()
    assert answer.status_code == 500
    assert answer.headers["content-type"] == "application/problem+json"
    if method == "GET":
        assert answer.json()["type"] == "/problems/internal"
        assert "a bug" not in answer.text
    assert answer.headers["server"].startswith("hexwrap/")
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert counted(client, method, "/ready", 500) == before + 1
    faults = [record for record in caplog.records if record.levelno >= logging.ERROR]  # uvicorn logs none
    assert [record.getMessage() for record in faults] == [f"a fault while answering {method} /ready"]
    assert "connection" not in answer.headers  # it stays open for the next one
    assert client.get("/health").status_code == 200
