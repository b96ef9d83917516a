"""A disk that fills up: jobs end with a problem that says so, and everything goes on when there is room."""

from __future__ import annotations

import contextlib
import errno
import sqlite3
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from hexwrap_server.input.requests import Order, Wanted
from hexwrap_server.jobs import disk, manager
from hexwrap_server.jobs.engine import ProcessEngine
from hexwrap_server.jobs.store import Store, Work
from tests.server.bodies import request, tube
from tests.server.live import Live, finished, running, until_at
from tests.server.patience import until

Fill = Callable[[bool], None]


class Full:
    """A database that takes nothing new while it is full."""

    def __init__(self, real: sqlite3.Connection) -> None:
        self._real = real
        self.is_full = False
        self.is_broken = False

    def __getattr__(self, name: str) -> Any:
        return getattr(self._real, name)

    def _refuse(self, statement: str) -> None:
        if self.is_broken:
            raise sqlite3.DatabaseError("database disk image is malformed")
        if self.is_full and statement.split()[0] in ("INSERT", "UPDATE", "DELETE"):
            raise sqlite3.OperationalError("database or disk is full")

    def execute(self, statement: str, *values: Any) -> Any:
        self._refuse(statement)
        return self._real.execute(statement, *values)

    def executemany(self, statement: str, *values: Any) -> Any:
        self._refuse(statement)
        return self._real.executemany(statement, *values)


def databases(monkeypatch: pytest.MonkeyPatch) -> list[Full]:
    """The lists of jobs that are opened from now on, each on a disk that can be full."""
    opened: list[Full] = []
    connect: Any = sqlite3.connect

    def on_a_disk(path: Path, *arguments: Any, **options: Any) -> Any:
        found = connect(path, *arguments, **options)
        if Path(path).name != "hexwrap.sqlite3":
            return found
        opened.append(Full(found))
        return opened[-1]

    monkeypatch.setattr(sqlite3, "connect", on_a_disk)
    return opened


class Held(ProcessEngine):
    """Its jobs stay at their surface until there is a gate, where it has one."""

    gate: Path | None = None

    async def run(self, function: str, *arguments: Any, **rest: Any) -> Any:
        if self.gate and isinstance(arguments[0], Order):
            function = "tests.server.calls:solve_held"
            arguments = ("surface", str(self.gate), *arguments)
        return await super().run(function, *arguments, **rest)


@pytest.fixture
def server(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Live, Full, Held]]:
    monkeypatch.setattr(manager, "CATCH_UP_INTERVAL", 0.1)
    engine, disks = Held(1), databases(monkeypatch)
    with running(tmp_path, engine) as client:
        yield client, disks[0], engine


def status_on_disk(client: Live, id: str) -> str:
    with contextlib.closing(sqlite3.connect(client.service.store.folder / "hexwrap.sqlite3")) as db:
        status: str = db.execute("SELECT status FROM jobs WHERE id = ?", (id,)).fetchone()[0]
        return status


def test_job_that_ends_on_a_full_disk_fails_and_is_written_later(
    server: tuple[Live, Full, Held], tmp_path: Path
) -> None:
    client, disk, engine = server
    engine.gate = tmp_path / "gate"
    id = client.post("/v1/jobs", json=request()).json()["id"]
    until_at(client, id)
    disk.is_full = True
    engine.gate.touch()
    job = finished(client, id)
    assert (job["status"], job["problem"]["type"]) == ("failed", "/problems/storage")
    assert "database or disk is full" in job["problem"]["detail"]
    answer = client.get(f"/v1/jobs/{id}/result")
    assert (answer.status_code, answer.headers["retry-after"]) == (503, "5")
    assert client.get("/v1/jobs").json()["jobs"][0]["status"] == "failed"
    assert client.get("/health").json()["running"] == 0
    assert status_on_disk(client, id) == "running"
    disk.is_full = False
    until(lambda: status_on_disk(client, id) == "failed", "the end on disk")
    assert client.post("/v1/solve", json=request()).status_code == 200


def test_requests_on_a_full_disk_are_refused_with_503(server: tuple[Live, Full, Held]) -> None:
    client, disk, _ = server
    done = client.post("/v1/jobs", json=request()).json()["id"]
    finished(client, done)
    disk.is_full = True
    for method, path, body in (
        ("POST", "/v1/jobs", request()),
        ("POST", "/v1/solve", request(pattern={"around": 8})),
        ("DELETE", f"/v1/jobs/{done}", None),
    ):
        answer = client.request(method, path, json=body)
        assert (answer.status_code, answer.json()["type"]) == (503, "/problems/storage"), path
        assert int(answer.headers["retry-after"]) > 0
    assert client.get(f"/v1/jobs/{done}/result").status_code == 200
    disk.is_full = False
    assert client.delete(f"/v1/jobs/{done}").status_code == 204


def test_running_job_can_be_stopped_on_a_full_disk(server: tuple[Live, Full, Held], tmp_path: Path) -> None:
    client, disk, engine = server
    engine.gate = tmp_path / "gate"
    id = client.post("/v1/jobs", json=request()).json()["id"]
    until_at(client, id)
    disk.is_full = True
    assert client.delete(f"/v1/jobs/{id}").status_code == 204
    assert client.get(f"/v1/jobs/{id}").json()["status"] == "cancelled"


def test_jobs_end_and_requests_are_refused_when_the_database_breaks(
    server: tuple[Live, Full, Held], tmp_path: Path
) -> None:
    client, disk, engine = server
    done = client.post("/v1/jobs", json=request()).json()["id"]
    finished(client, done)
    engine.gate = tmp_path / "gate"
    id = client.post("/v1/jobs", json=request(surface=tube(12, 7))).json()["id"]
    until_at(client, id)
    disk.is_broken = True
    engine.gate.touch()
    job = finished(client, id)
    assert (job["status"], job["problem"]["type"]) == ("failed", "/problems/storage")
    for method, path in (("GET", "/v1/jobs"), ("GET", f"/v1/jobs/{done}/result"), ("POST", "/v1/jobs")):
        answer = client.request(method, path, json=request())
        assert (answer.status_code, answer.json()["type"]) == (503, "/problems/storage"), path
    disk.is_broken = False
    assert client.get(f"/v1/jobs/{done}/result").status_code == 200


def test_server_that_dies_before_the_end_is_written_runs_the_job_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    engine = Held(1)
    engine.gate = tmp_path / "gate"
    disks = databases(monkeypatch)
    with running(tmp_path, engine) as client:
        id = client.post("/v1/jobs", json=request(surface=tube(200, 100))).json()["id"]
        until_at(client, id)
        disks[0].is_full = True
        engine.gate.touch()
        assert finished(client, id)["status"] == "failed"
    with running(tmp_path, workers=1) as client:
        assert finished(client, id)["status"] == "done"


def test_surfaces_and_outcomes_that_find_no_room(tmp_path: Path) -> None:
    with running(tmp_path, workers=1) as client:
        (tmp_path / "results").rename(tmp_path / "away")  # worker processes cannot be patched
        job = finished(client, client.post("/v1/jobs", json=request()).json()["id"])
        assert (job["status"], job["problem"]["type"]) == ("failed", "/problems/storage")
        (tmp_path / "away").rename(tmp_path / "results")
        (tmp_path / "surfaces").rename(tmp_path / "away")
        answer = client.post("/v1/jobs", json=request(surface=tube(12, 5)))
        assert (answer.status_code, answer.json()["type"]) == (503, "/problems/storage")
        assert "could not read or write" in answer.json()["detail"]
        (tmp_path / "away").rename(tmp_path / "surfaces")
        assert client.post("/v1/solve", json=request()).status_code == 200


def test_database_that_is_really_full_refuses_and_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    disks = databases(monkeypatch)
    store = Store(tmp_path)
    pages = disks[0].execute("PRAGMA page_count").fetchone()[0]
    disks[0].execute(f"PRAGMA max_page_count = {pages}")
    large, small = (Work(name, "x" * size, Wanted()) for name, size in (("large", 10**6), ("small", 1)))
    with pytest.raises(manager.StorageError, match="full"):
        store.add_work(large)
    store.add_work(small)
    disks[0].execute("PRAGMA max_page_count = 100000")
    store.add_work(large)
    assert store.work("large") == large
    store.close()


def test_program_that_holds_the_database_holds_nobody_else(tmp_path: Path) -> None:
    with running(tmp_path, workers=1) as client:
        finished(client, client.post("/v1/jobs", json=request()).json()["id"])
        with contextlib.closing(sqlite3.connect(tmp_path / "hexwrap.sqlite3", isolation_level=None)) as other:
            other.execute("BEGIN IMMEDIATE")
            answer = client.post("/v1/jobs", json=request(pattern={"around": 8}))
            assert (answer.status_code, answer.json()["type"]) == (503, "/problems/storage")
            assert "Another program" in answer.json()["detail"]
            other.execute("ROLLBACK")
        assert client.post("/v1/solve", json=request(pattern={"around": 8})).status_code == 200


def test_job_that_ends_while_the_database_is_held_is_written_when_it_is_free(tmp_path: Path) -> None:
    engine = Held(1)
    engine.gate = tmp_path / "gate"
    with running(tmp_path, engine) as client:
        id = client.post("/v1/jobs", json=request()).json()["id"]
        until_at(client, id)
        with contextlib.closing(sqlite3.connect(tmp_path / "hexwrap.sqlite3", isolation_level=None)) as other:
            other.execute("BEGIN IMMEDIATE")
            engine.gate.touch()
            job = client.get(f"/v1/jobs/{id}", params={"wait": 2}).json()
            assert job["status"] == "running"
            other.execute("ROLLBACK")
        assert finished(client, id)["status"] == "done"


@pytest.mark.parametrize("refusals", [1, 3, 100])
def test_files_that_are_open_are_replaced_a_moment_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refusals: int
) -> None:
    """As on Windows, where nobody may replace what somebody reads."""
    left = [refusals]

    def replace(part: Path, path: Path) -> None:
        left[0] -= 1
        if left[0] >= 0:
            raise PermissionError(errno.EACCES, "in use")
        part.rename(path)

    monkeypatch.setattr(disk.os, "replace", replace)
    monkeypatch.setattr(disk, "PAUSES", (0.0, 0.001, 0.001, 0.001))
    if refusals < 10:
        disk.write_whole(tmp_path / "a", [b"new"])
        assert (tmp_path / "a").read_bytes() == b"new"
    else:
        with pytest.raises(disk.StorageError):
            disk.write_whole(tmp_path / "a", [b"new"])
    assert len(list(tmp_path.iterdir())) == (refusals < 10)
