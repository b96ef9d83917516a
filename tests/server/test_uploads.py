"""Files sent to the service: read in a worker, refused there when broken, too large or of another kind."""

from __future__ import annotations

import contextlib
import io
import os
import sqlite3
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from hexwrap_server.errors import FormError
from hexwrap_server.input.requests import Outcome, Wanted
from hexwrap_server.jobs.disk import keep_file
from hexwrap_server.jobs.store import Job, Store, Work
from hexwrap_server.problems import problem
from hexwrap_solver.errors import RequestError
from tests.server.bodies import tube
from tests.server.live import Live, running


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    data = tmp_path_factory.mktemp("data")
    with running(data, workers=1, max_vertices=5000, max_body_mib=4.0, job_mib=1500.0) as live:
        yield live


def obj() -> bytes:
    surface = tube()
    lines = ["v {} {} {}".format(*p) for p in surface["vertices"]]
    lines += ["f {} {} {}".format(*(i + 1 for i in f)) for f in surface["faces"]]
    return "\n".join(lines).encode()


def npz(**changes: np.ndarray) -> bytes:
    surface = tube()
    arrays = {"vertices": np.array(surface["vertices"]), "faces": np.array(surface["faces"])} | changes
    file = io.BytesIO()
    np.savez_compressed(file, **arrays)
    return file.getvalue()


def test_file_in_a_form_is_the_surface_sent_as_json(client: Live) -> None:
    as_json = client.post("/v1/surfaces", json=tube()).json()
    for name, data in (("tube.obj", obj()), ("TUBE.NPZ", npz())):
        answer = client.post("/v1/surfaces", files={"file": (name, data)})
        assert answer.status_code == 201, answer.text
        (listed,) = answer.json()["objects"]
        assert listed["used"]
        assert answer.json() | {"objects": []} == as_json
        raw = client.post("/v1/surfaces", params={"name": name}, content=data)
        assert raw.json() == answer.json()


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("tube.exe", b"MZ"),
        ("tube", obj()),
        ("tube.npz", b"PK\x03\x04 broken"),
        ("tube.3dm", b"not a Rhino file"),
        ("tube.ply", b"ply\nformat ascii 1.0\nelement vertex 3\nend_header\n"),
        ("tube.stl", b""),
        ("tube.npz", npz(vertices=np.array([{"a": 1}], dtype=object))),
        ("tube.npz", npz(faces=np.array([[0, 1, 99_999]]))),
        ("../../etc/passwd", b"root:x:0:0"),
    ],
)
def test_files_that_cannot_be_read_are_refused(client: Live, name: str, data: bytes) -> None:
    answer = client.post("/v1/surfaces", files={"file": (name, data)})
    assert answer.status_code == 422, answer.text
    assert answer.json()["detail"]
    assert client.get("/health").status_code == 200


def test_forms_hold_exactly_one_file(client: Live) -> None:
    two = client.post("/v1/surfaces", files=[("a", ("a.obj", obj())), ("b", ("b.obj", obj()))])
    assert (two.status_code, two.json()["type"]) == (422, "/problems/upload")
    broken = client.post("/v1/surfaces", content=b"--x\r\n", headers={"Content-Type": "multipart/form-data"})
    assert broken.status_code == 422


@pytest.mark.parametrize("path", ["/v1/surfaces", "/v1/surfaces/preview"])
def test_zip_bombs_are_refused(client: Live, path: str) -> None:
    bomb = npz(vertices=np.zeros((2_000_000, 3)))
    assert len(bomb) < 1_000_000
    answer = client.post(path, params={"name": "bomb.npz"}, content=bomb)
    assert (answer.status_code, answer.json()["type"]) == (422, "/problems/upload")
    assert "unpack" in answer.json()["detail"]


@pytest.mark.parametrize("path", ["/v1/surfaces", "/v1/surfaces/preview"])
def test_files_with_too_many_vertices_are_refused(client: Live, path: str) -> None:
    large = tube(100, 60)
    data = npz(vertices=np.array(large["vertices"]), faces=np.array(large["faces"]))
    answer = client.post(path, files={"file": ("large.npz", data)})
    assert (answer.status_code, answer.json()["type"]) == (422, "/problems/too-many-vertices")


def test_old_and_superfluous_results_are_forgotten(tmp_path: Path) -> None:
    store = Store(tmp_path)
    outcome = Outcome(b"r" * 1000, b"s" * 1000, 2000, {}, {})
    for i in range(4):
        identity = f"{i}" * 64
        keep_file(store.surface_path("a" * 64), b"surface")
        job = Job(f"job{i}", identity, "", created=time.time(), finished=time.time(), status="done")
        store.add(job, Work(identity, "a" * 64, Wanted(pattern=None, panels=None)))
        store.keep_outcome(identity, outcome)
        store.finish_work(identity, outcome)
        time.sleep(0.05)  # more than a step of any system's clock
    assert store.finished_work("0" * 64) is not None  # asked for: now the last used
    assert len(store.prune_rows(1, 4500, store.surface_files()).works) == 2
    assert [job.id for job in store.jobs(10)] == ["job3", "job0"]
    assert store.prune_rows(0, 1e9, store.surface_files()).works == set()
    assert store.jobs(10) == []
    store.close()


def test_a_surface_deleted_meanwhile_is_not_listed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = Store(tmp_path)
    keep_file(store.surface_path("a" * 64), b"surface")
    listed = [store.surface_path("b" * 64), *store.surfaces.glob("*.surface")]
    monkeypatch.setattr(Path, "glob", lambda folder, pattern: iter(listed))
    assert set(store.surface_files()) == {"a" * 64}
    store.close()


def edit(store: Store, statement: str, *values: object) -> None:
    """As another program would."""
    with contextlib.closing(sqlite3.connect(store.folder / "hexwrap.sqlite3", isolation_level=None)) as db:
        db.execute(statement, values)


def failed_long_ago(store: Store, number: int) -> str:
    """The surface of a job that failed, 1000 bytes."""
    identity = surface = f"{number:064x}"
    keep_file(store.surface_path(surface), bytes(1000))
    moment = time.time() - 1000 + number
    os.utime(store.surface_path(surface), (moment, moment))
    job = Job(f"job{number}", identity, "", created=moment, finished=moment, status="failed")
    store.add(job, Work(identity, surface, Wanted(pattern=None, panels=None)))
    edit(store, "UPDATE works SET used = ? WHERE identity = ?", moment, identity)
    return surface


def pruned(store: Store, days: float, result_bytes: float) -> set[str]:
    """Surfaces that are still there."""
    store.prune_files(store.prune_rows(days, result_bytes, store.surface_files()), 1e9)
    return set(store.surface_files())


def test_surfaces_of_failed_jobs_count(tmp_path: Path) -> None:
    store = Store(tmp_path)
    surfaces = [failed_long_ago(store, i) for i in range(8)]
    edit(store, "UPDATE jobs SET status = 'queued' WHERE id = 'job0'")
    assert pruned(store, days=1, result_bytes=3500) == {surfaces[0], *surfaces[-3:]}
    assert {job.id for job in store.jobs(10)} == {"job0", "job5", "job6", "job7"}
    store.close()


def test_surfaces_that_many_works_share_count_once(tmp_path: Path) -> None:
    store = Store(tmp_path)
    surface = failed_long_ago(store, 1)
    for i in range(2, 6):
        job = Job(f"job{i}", f"{i:064x}", "", status="failed", finished=time.time())
        store.add(job, Work(job.identity, surface, Wanted(pattern=None, panels=None)))
    assert pruned(store, days=1, result_bytes=1500) == {surface}
    assert len(store.jobs(10)) == 5
    store.close()


def test_what_no_job_uses_has_an_age_too(tmp_path: Path) -> None:
    store = Store(tmp_path)
    for id, days in (("a" * 64, 3), ("b" * 64, 0.5)):
        keep_file(store.surface_path(id), b"surface")
        stage = store.stages / f"{id}.stage"
        stage.write_bytes(b"stage")
        for path in (store.surface_path(id), stage):
            os.utime(path, (time.time() - days * 86400,) * 2)
    assert pruned(store, days=1, result_bytes=1e9) == {"b" * 64}
    assert [path.name[0] for path in store.stages.iterdir()] == ["b"]
    store.close()


def test_surface_that_a_job_asks_for_while_it_is_pruned_stays(tmp_path: Path) -> None:
    store = Store(tmp_path)
    surface = failed_long_ago(store, 1)
    kept = store.prune_rows(0, 1e9, store.surface_files())
    assert store.use_surface(surface)
    store.prune_files(kept, 1e9)
    assert store.has_surface(surface)
    assert not store.use_surface("f" * 64)
    store.close()


FIN = {
    "vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]],
    "faces": [[0, 1, 2], [1, 0, 3], [0, 1, 4]],
}


@pytest.mark.parametrize(
    ("surface", "pointer"),
    [
        (FIN, ""),
        (FIN | {"faces": [[0, 1, 1.5]]}, "/faces/0/2"),
        (
            {
                "nurbs": {
                    "degree": [1, 1],
                    "knots": [[0, 0, 1, 1], [0, 1, 0, 1]],
                    "control_points": [[[0, 0, 0], [1, 0, 0]], [[0, 1, 0], [1, 1, 0]]],
                }
            },
            "/nurbs/knots/1",
        ),
    ],
)
def test_pointers_lead_into_the_body_as_it_was_sent(
    client: Live, surface: dict[str, object], pointer: str
) -> None:
    alone = client.post("/v1/surfaces", json=surface)
    assert alone.status_code == 422
    assert [error["pointer"] for error in alone.json()["errors"]] == [pointer]
    inside = client.post("/v1/solve", json={"surface": surface}).json()
    assert [error["pointer"] for error in inside["errors"]] == [f"/surface{pointer}"]
    assert inside["type"] == alone.json()["type"]


def test_of_a_file_the_whole_is_at_fault(client: Live) -> None:
    data = b"v 0 0 0\nv 1 0 0\nv 0 2 0\nv 0 -1 1\nv 0 -1 -1\nf 1 2 3\nf 2 1 4\nf 1 2 5\n"  # three alike
    answer = client.post("/v1/surfaces", params={"name": "fin.obj"}, content=data)
    assert answer.status_code == 422
    assert [error["pointer"] for error in answer.json()["errors"]] == [""]


def test_refusals_about_no_single_field_point_nowhere() -> None:
    assert problem(RequestError("It cannot be."))["errors"] == []
    assert problem(FormError("It cannot be."))["errors"] == []
