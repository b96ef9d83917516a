"""Nothing that is sent takes time or memory without a bound, and nothing small waits for it."""

from __future__ import annotations

import errno
import gzip
import json
import pickle
import time
import tracemalloc
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from hexwrap_server import errors
from hexwrap_server.errors import DrawingError, FormError, GoneError, HttpError, StorageError
from hexwrap_server.http import bodies
from hexwrap_server.input.json_text import loads
from hexwrap_server.input.readers.drawing import Curve
from hexwrap_server.input.schemas import parse_request
from hexwrap_server.input.surface_files import sent_surface
from hexwrap_server.jobs import codec
from hexwrap_server.jobs.lift_curves import lift_curves
from hexwrap_server.jobs.store import Job, Store, Work
from hexwrap_server.jobs.work import solution_at
from hexwrap_solver.errors import HexwrapError
from hexwrap_solver.panels.sizes import partition_by_worst
from hexwrap_solver.surface.types import SurfaceSettings
from tests.server.analytic import cylinder
from tests.server.bodies import request, tube
from tests.server.live import finished, running
from tests.server.patience import PATIENCE, until
from tests.server.process import free_port, longest_step, served

MIB = 2**20
#: Processor seconds of one step of the event loop, within which nobody else is answered.
LONGEST_STEP = 0.25


def test_long_names_are_not_repeated_for_every_list() -> None:
    """1 MB with one long name and 4,000 lists: 4 GB of pointers, once."""
    text = b'{"%s": [%s, [NaN]]}' % (b"n" * 1_000_000, b",".join([b"[1]"] * 4000))
    tracemalloc.start()
    with pytest.raises(FormError) as caught:
        loads(text)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert caught.value.faults[0][0].endswith("/4000/0")
    assert peak < 60 * MIB


def test_one_long_number_does_not_make_all_others_long() -> None:
    """420 kB of which one coordinate takes 300 kB."""
    vertices = b"".join(b"v %d %d 0\n" % (x, x * x) for x in range(8000))
    data = vertices + b"v 1." + b"0" * 300_000 + b" 0 1\nf 1 2 8001\n"
    tracemalloc.start()
    sent = sent_surface(data, "a.obj", SurfaceSettings()).sent
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert sent.mesh is not None
    assert sent.mesh.vertices[8000].tolist() == [1.0, 0.0, 1.0]
    assert peak < 40 * MIB


def bomb(mib: int) -> bytes:
    """Numbers that unpack to so many MiB, and to eight times as much as a list of floats."""
    return gzip.compress(b"[" + b"1.5," * (mib * MIB // 4) + b"1]", 1)


@pytest.mark.parametrize(
    ("limits", "slug", "flag"),
    [
        ({"read_mib": 200.0}, "memory-limit", "--read-mib"),
        ({"read_seconds": 0.2}, "time-limit", "--read-seconds"),
    ],
)
def test_reading_has_limits_that_are_told(
    tmp_path: Path, limits: dict[str, float], slug: str, flag: str
) -> None:
    with running(tmp_path, workers=1, **limits) as client:
        answer = client.post("/v1/jobs", content=bomb(60), headers={"Content-Encoding": "gzip"})
        assert (answer.status_code, answer.json()["type"]) == (422, f"/problems/{slug}")
        assert flag in answer.json()["detail"]
        assert client.get("/health").status_code == 200


def test_bodies_in_memory_have_a_limit_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bodies, "BODIES_AT_ONCE", 0.001)
    with running(tmp_path, workers=1) as client:
        answer = client.post("/v1/jobs", content=b" " * MIB)
        assert (answer.status_code, answer.json()["type"]) == (503, "/problems/too-many-bodies")
        assert int(answer.headers["retry-after"]) > 0
        assert client.service.body_bytes == 0
        assert client.post("/v1/solve", json=request()).status_code == 200


def test_bodies_wait_no_longer_than_one_is_read(tmp_path: Path) -> None:
    with running(tmp_path, workers=1, readers=1, read_seconds=2.0) as client:
        client.run(client.service.free_readers.acquire())
        answer = client.post("/v1/surfaces?name=a.obj", content=b"v 0 0 0")
        assert (answer.status_code, answer.json()["type"]) == (503, "/problems/too-many-bodies")
        assert int(answer.headers["retry-after"]) > 0
        assert client.post("/v1/surfaces", json=tube()).status_code == 201


def test_reading_is_ended_with_the_server(tmp_path: Path) -> None:
    with running(tmp_path, workers=1) as client, ThreadPoolExecutor(3) as threads:
        service = client.service
        packed = {"content": bomb(200), "headers": {"Content-Encoding": "gzip"}}
        answers = [threads.submit(client.post, "/v1/jobs", **packed) for _ in range(3)]
        until(lambda: service.body_bytes, "the bodies")
        client.loop.call_soon_threadsafe(service.begin_to_stop)
        for answer in answers:
            told = answer.result(PATIENCE)
            assert (told.status_code, told.json()["type"]) == (503, "/problems/shutting-down")


def many_jobs(folder: Path, count: int) -> None:
    store = Store(folder)
    timings = dict.fromkeys(("surface", "map", "pattern", "fit", "panels", "quality"), 0.1)
    wanted = parse_request(request(), 1000, 1000).wanted
    for i in range(count):
        job = Job(f"{i:032x}", f"{i:064x}", "", "done", created=time.time(), timings=timings, found={})
        store.add(job, Work(job.identity, "a" * 64, replace(wanted)))
    store.close()


def test_lists_are_paged_and_hold_up_nobody(tmp_path: Path) -> None:
    many_jobs(tmp_path, 1500)
    port = free_port()
    with (
        served(tmp_path, port, workers=1),
        httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=PATIENCE, trust_env=False) as client,
    ):
        page: dict[str, Any] = {"next": "/v1/jobs?limit=1000"}
        seen: list[str] = []
        while page["next"]:
            page = client.get(page["next"]).json()
            seen += [job["id"] for job in page["jobs"]]
        assert seen == [f"{i:032x}" for i in reversed(range(1500))]
        assert client.get("/v1/jobs?limit=1001").status_code == 422
        body = json.dumps(request()).encode()
        assert client.post("/v1/solve", content=body).status_code == 200
        with ThreadPoolExecutor(50) as threads:
            known = [threads.submit(client.post, "/v1/jobs", content=body) for _ in range(200)]
            assert {answer.result().status_code for answer in known} == {202}
    assert longest_step(tmp_path) < LONGEST_STEP


def no_handles(*ignored: object) -> bytes:
    raise OSError(errno.EMFILE, "Too many open files")


def test_results_are_not_taken_for_gone_when_no_file_handle_is_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = Store(tmp_path)
    path = store.result_path("a" * 64)
    path.write_bytes(gzip.compress(b"{}"))
    solution = store.solution_path("a" * 64)
    solution.write_bytes(codec.encode(cylinder()))
    monkeypatch.setattr(Path, "read_bytes", no_handles)
    for read in (lambda: store.result("a" * 64), lambda: solution_at(str(solution))):
        with pytest.raises(StorageError, match="open"):
            read()
    monkeypatch.undo()
    assert store.result("a" * 64)
    assert solution_at(str(solution)).panels is not None
    solution_at.cache_clear()
    solution.unlink()
    with pytest.raises(GoneError):
        solution_at(str(solution))
    store.close()


def test_solve_computes_anew_what_was_kept_and_is_damaged(tmp_path: Path) -> None:
    with running(tmp_path, workers=1) as client:
        assert finished(client, client.post("/v1/jobs", json=request()).json()["id"])["status"] == "done"
    for path in (tmp_path / "results").iterdir():
        path.write_bytes(path.read_bytes()[:-20])
    with running(tmp_path, workers=1) as client:
        for include in ({}, {"include": "sizes"}):
            answer = client.post("/v1/solve", params=include, json=request())
            assert (answer.status_code, answer.json()["sizes"][0]["size"]) == (200, 0)


def test_errors_come_through_pipes_as_they_were() -> None:
    made: list[HexwrapError] = [
        HttpError(418, "teapot", "A teapot", "It is a teapot.", {"Retry-After": "1"}, [{"pointer": ""}]),
        errors.JobFailedError({"status": 422, "title": "No", "detail": "Nothing."}),
        errors.HopsError("No."),
        FormError.at("/surface/faces/3/1", "wrong"),
        GoneError(),
    ]
    for error in made:
        back = pickle.loads(pickle.dumps(error))
        assert (type(back), vars(back)) == (type(error), vars(error))
        assert str(back) == str(error)


@pytest.mark.parametrize("number", [1e308, -1e200, 5e-324, 1e-300])
@pytest.mark.parametrize(
    "path",
    [
        ("panels", "increment"),
        ("panels", "joint"),
        ("panels", "weights", "edge"),
        ("pattern", "edge_length"),
        ("boundary", "angles", "point"),
    ],
)
def test_numbers_that_overflow_are_refused(path: tuple[str, ...], number: float) -> None:
    body: dict[str, Any] = {"surface": tube()}
    if path[-1] == "point":
        body["boundary"] = {"mode": "angles", "angles": [{"point": [number, 0, 0], "angle": 3.0}]}
    else:
        section = body
        for step in path[:-1]:
            section = section.setdefault(step, {})
        section[path[-1]] = number
    with pytest.raises(FormError) as caught:
        parse_request(body, 1000, 1000)
    assert caught.value.faults[0][0].startswith("/" + "/".join(path[:2]))


@pytest.mark.parametrize(
    ("curves", "step"),
    [
        ([Curve(np.array([[0.0, 0.0], [1e9, 0.0]]))], None),
        ([Curve(np.array([[0.0, 0.0], [1.0, 0.0]]))], 1e-12),
        ([Curve(np.array([[0.0, 0.0], [1e308, 0.0], [-1e308, 0.0]]), closed=True)], None),
    ],
)
def test_drawings_that_need_too_many_points_are_refused(curves: list[Curve], step: float | None) -> None:
    with pytest.raises(DrawingError, match="more than 1,000,000 points"):
        lift_curves(cylinder().map, curves, step)


@pytest.mark.parametrize("seed", range(20))
def test_sizes_end_between_neighbouring_numbers(seed: int) -> None:
    """Losses that differ by rounding alone: the middle of two neighbours is one of them."""
    r = np.random.default_rng(seed)
    length = np.sort(1.0 + r.integers(0, 40, 60) * 2.0**-52)
    floored = np.minimum(length, np.sort(length - r.integers(0, 3, 60) * 2.0**-52))
    made = partition_by_worst(length, floored, 12)
    assert np.all(np.diff(made.loss) <= 0)
