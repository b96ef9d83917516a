"""A data folder that was damaged: nothing wrong is told, and what was lost is made again."""

from __future__ import annotations

import contextlib
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from hexwrap_server.errors import DamagedError, FolderInUseError
from hexwrap_server.input.requests import Wanted
from hexwrap_server.jobs.disk import keep_file, surface_file
from hexwrap_server.jobs.store import Job, Store, Work
from tests.server.bodies import request
from tests.server.live import Live, finished, running
from tests.server.patience import PATIENCE

Damage = Callable[[bytes], bytes]


def cut_short(data: bytes) -> bytes:
    return data[: len(data) // 2]


def garbled(data: bytes) -> bytes:
    middle = len(data) // 2
    return data[:middle] + bytes(255 - byte for byte in data[middle : middle + 50]) + data[middle + 50 :]


def emptied(data: bytes) -> bytes:
    return b""


def solved(client: Live, **changes: Any) -> tuple[str, dict[str, Any]]:
    id = client.post("/v1/jobs", json=request(**changes)).json()["id"]
    assert finished(client, id)["status"] == "done"
    result: dict[str, Any] = client.get(f"/v1/jobs/{id}/result").json()
    return id, result


@pytest.mark.parametrize("damage", [cut_short, garbled, emptied])
def test_damaged_files_are_told_and_made_again(tmp_path: Path, damage: Damage) -> None:
    with running(tmp_path, workers=1) as client:
        id, result = solved(client)
    for path in (p for folder in ("results", "surfaces", "stages") for p in (tmp_path / folder).iterdir()):
        path.write_bytes(damage(path.read_bytes()))
    with running(tmp_path, workers=1) as client:
        for what in ("files/panels.obj", "result", "files/result.json", "files/panels.csv"):
            answer = client.get(f"/v1/jobs/{id}/{what}")
            assert (answer.status_code, answer.json()["type"]) == (410, "/problems/gone"), what
        again, same = solved(client)
        assert result | {"timings": None} == same | {"timings": None}
        assert client.get(f"/v1/jobs/{again}/files/panels.obj").status_code == 200
        assert client.get(f"/v1/jobs/{id}/result").status_code == 200


def test_damaged_surface_is_asked_for_again(tmp_path: Path) -> None:
    with running(tmp_path, workers=1) as client:
        surface = {"id": client.post("/v1/surfaces", json=request()["surface"]).json()["id"]}
    for path in (p for folder in ("surfaces", "stages") for p in (tmp_path / folder).iterdir()):
        path.write_bytes(cut_short(path.read_bytes()))
    with running(tmp_path, workers=1) as client:
        for _ in range(2):
            answer = client.post("/v1/solve", json={"surface": surface})
            assert (answer.status_code, answer.json()["errors"][0]["pointer"]) == (422, "/surface/id")
        assert client.post("/v1/surfaces", json=request()["surface"]).json()["id"] == surface["id"]
        assert (
            client.post("/v1/solve", json={"surface": surface, "pattern": {"around": 8}}).status_code == 200
        )


def test_surface_whose_file_cannot_be_read_is_a_problem(tmp_path: Path) -> None:
    with running(tmp_path, workers=1) as client:
        id = client.post("/v1/surfaces", json=request()["surface"]).json()["id"]
        file = tmp_path / "surfaces" / f"{id}.surface"
        file.unlink()
        file.mkdir()
        answer = client.post("/v1/surfaces", json=request()["surface"])
        assert (answer.status_code, answer.json()["type"]) == (503, "/problems/storage")
        file.rmdir()
        assert client.post("/v1/surfaces", json=request()["surface"]).status_code == 201


def test_surface_that_is_pruned_while_it_is_sent_again_is_written_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = surface_file(tmp_path, "a" * 64)
    keep_file(path, b"surface")

    def read(path: Path) -> bytes:
        path.unlink()
        return b"surface"

    monkeypatch.setattr(Path, "read_bytes", read)
    keep_file(path, b"surface")
    monkeypatch.undo()
    assert path.read_bytes() == b"surface"


def test_lost_solution_is_made_again(tmp_path: Path) -> None:
    with running(tmp_path, workers=1) as client:
        id, _ = solved(client)
        for path in (tmp_path / "results").glob("*.solution"):
            path.unlink()
        assert client.get(f"/v1/jobs/{id}/files/panels.obj").status_code == 410
        again, _ = solved(client)
        assert client.get(f"/v1/jobs/{again}/files/panels.obj").status_code == 200


def test_failed_work_starts_from_the_first_attempt_again(tmp_path: Path) -> None:
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]]
    fan = {"vertices": corners, "faces": [[0, 1, 2], [1, 0, 3], [0, 1, 4]]}  # three faces at an edge
    with running(tmp_path, workers=1) as client:
        for _ in range(3):
            id = client.post("/v1/jobs", json={"surface": fan}).json()["id"]
            assert finished(client, id)["status"] == "failed"
        store = client.service.store
        job = store.job(id)
        assert job is not None
        work = store.work(job.identity)
        assert work is not None
        assert work.attempts == 0


def test_list_of_jobs_that_is_none_is_told(tmp_path: Path) -> None:
    (tmp_path / "hexwrap.sqlite3").write_bytes(b"no list at all" * 300)
    command = [sys.executable, "-m", "hexwrap_server.cli", "serve", "--port", "0", "--data", str(tmp_path)]
    told = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert told.returncode == 1
    assert "hexwrap.sqlite3 cannot be used" in told.stderr
    assert "Traceback" not in told.stderr


def test_lock_that_cannot_be_opened_is_not_taken_for_another_server(tmp_path: Path) -> None:
    (tmp_path / "lock.sqlite3").mkdir()
    with pytest.raises(DamagedError, match="cannot be used"):
        Store(tmp_path)
    (tmp_path / "lock.sqlite3").rmdir()
    first = Store(tmp_path)
    with pytest.raises(FolderInUseError):
        Store(tmp_path)
    first.close()


def test_work_of_another_version_is_told_as_lost(tmp_path: Path) -> None:
    with running(tmp_path, workers=1) as client:
        id, _ = solved(client)
    with contextlib.closing(sqlite3.connect(tmp_path / "hexwrap.sqlite3", isolation_level=None)) as db:
        db.execute("UPDATE works SET wanted = ?", (b"of another version",))
        db.execute("UPDATE jobs SET status = 'queued'")
    with running(tmp_path, workers=1) as client:
        told = client.get(f"/v1/jobs/{id}").json()
        assert (told["status"], told["problem"]["type"]) == ("failed", "/problems/internal")


def test_the_log_of_writes_goes_into_the_database_beside_the_writing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def in_database() -> int:
        with contextlib.closing(sqlite3.connect(f"file:{database}?immutable=1", uri=True)) as db:
            count: int = db.execute("SELECT count(*) FROM jobs").fetchone()[0]
            return count

    database = tmp_path / "hexwrap.sqlite3"
    store = Store(tmp_path)
    monkeypatch.setattr("hexwrap_server.jobs.store.CHECKPOINT", 1)
    store.check_point()
    before = database.read_bytes()
    for i in range(1500):  # SQLite alone would stop for the disk after about 300
        store.add(Job(str(i), "identity", ""), Work("identity", "surface", Wanted(pattern=None, panels=None)))
    assert database.read_bytes() == before
    store.check_point()
    assert in_database() == 1500
    store.close()
