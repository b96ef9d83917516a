"""The queue's promises, through HTTP, with engines that are slow, deadly or counted."""

from __future__ import annotations

import asyncio
import http.client
import itertools
import json
import threading
import time
from collections.abc import AsyncIterator, Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager
from functools import reduce
from pathlib import Path
from typing import Any

import httpx
import pytest

from hexwrap_server.errors import FolderInUseError, WorkerDiedError
from hexwrap_server.http.metrics import Metrics
from hexwrap_server.input.bodies import Body
from hexwrap_server.jobs.engine import ProcessEngine, nobody
from hexwrap_server.jobs.manager import JobManager
from hexwrap_server.jobs.reading import read_request
from hexwrap_server.jobs.store import Job, Store
from hexwrap_server.settings import MIB, Settings
from tests.server.bodies import request, tube
from tests.server.live import Live, finished, running, until_at
from tests.server.patience import PATIENCE, until

Behave = Callable[..., Live]


class Watched(ProcessEngine):
    """Runs another function in place of a job's, and counts."""

    def __init__(self, workers: int, instead: str = "", *first: Any) -> None:
        super().__init__(workers)
        self.instead = instead
        self.first = first
        self.calls = 0

    async def run(self, function: str, *arguments: Any, **rest: Any) -> Any:
        self.calls += 1
        function = f"tests.server.calls:{self.instead}" if self.instead else function
        return await super().run(function, *self.first, *arguments, **rest)


def slow(seconds: float, workers: int = 1) -> Watched:
    return Watched(workers, "solve_after", seconds)


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Live, Watched]]:
    engine = Watched(1)
    with running(tmp_path_factory.mktemp("data"), engine, max_queue=2) as client:
        yield client, engine


@pytest.fixture
def behave(server: tuple[Live, Watched]) -> Iterator[Behave]:
    """The server of this module, whose engine behaves as told; afterwards nothing runs any more."""
    client, engine = server

    def told(instead: str = "", *first: Any) -> Live:
        engine.instead, engine.first, engine.calls = instead, first, 0
        return client

    yield told
    for job in client.get("/v1/jobs").json()["jobs"]:
        client.delete(f"/v1/jobs/{job['id']}")


_FRESH = itertools.count()


def fresh() -> dict[str, Any]:
    """A surface that no other test has sent."""
    return tube(height=10 + 0.01 * next(_FRESH))


def post(client: Live, **changes: Any) -> str:
    answer = client.post("/v1/jobs", json=request(**changes))
    assert answer.status_code == 202, answer.text
    id: str = answer.json()["id"]
    return id


def test_identical_requests_at_once_run_once(
    behave: Behave, server: tuple[Live, Watched], tmp_path: Path
) -> None:
    gate = tmp_path / "gate"
    client, surface = behave("solve_held", "surface", str(gate)), fresh()
    ids = [post(client, name=f"client {i}", surface=surface) for i in range(4)]
    assert len(set(ids)) == 4
    gate.touch()
    assert {finished(client, id)["status"] for id in ids} == {"done"}
    assert server[1].calls == 1
    later = client.get(f"/v1/jobs/{post(client, surface=surface)}").json()
    assert (later["status"], set(later["found"].values())) == ("done", {"result"})
    assert server[1].calls == 1


def test_changed_settings_reuse_the_stages_before(tmp_path: Path) -> None:
    with running(tmp_path, workers=1) as client:
        finished(client, post(client))
        found = finished(client, post(client, panels={"sizes": 3}))["found"]
        assert {found[s] for s in ("surface", "map", "pattern", "fit")} == {"memory"}
        assert found["panels"] == "computed"
        found = finished(client, post(client, pattern={"around": 10}))["found"]
        assert (found["map"], found["pattern"]) == ("memory", "computed")
    with running(tmp_path, workers=1) as client:
        job = finished(client, post(client, panels={"sizes": 4}))
        assert (job["found"]["pattern"], job["found"]["panels"]) == ("disk", "computed")
        header = client.get(f"/v1/jobs/{job['id']}/result").headers["server-timing"]
        assert 'desc="disk"' in header


def test_running_job_is_stopped_and_frees_its_worker(behave: Behave) -> None:
    client = behave("solve_after", 3600)
    id = post(client, surface=fresh())
    until_at(client, id)
    assert client.delete(f"/v1/jobs/{id}").status_code == 204
    assert client.get(f"/v1/jobs/{id}").json()["status"] == "cancelled"
    assert client.get("/health").json()["running"] == 0
    refused = client.get(f"/v1/jobs/{id}/result")
    assert (refused.status_code, refused.json()["type"]) == (409, "/problems/cancelled")
    assert client.delete(f"/v1/jobs/{id}").status_code == 204
    assert client.get(f"/v1/jobs/{id}").status_code == 404


def test_queue_has_positions_and_an_end(behave: Behave) -> None:
    client = behave("solve_after", 3600)
    first = post(client, surface=fresh())
    until_at(client, first)
    waiting = [post(client, surface=fresh()) for _ in range(2)]
    assert [client.get(f"/v1/jobs/{id}").json()["queue_position"] for id in waiting] == [0, 1]
    full = client.post("/v1/jobs", json=request(surface=fresh()))
    assert (full.status_code, full.json()["type"]) == (503, "/problems/queue-full")
    assert int(full.headers["retry-after"]) > 0
    assert client.delete(f"/v1/jobs/{waiting[0]}").status_code == 204
    assert client.get(f"/v1/jobs/{waiting[1]}").json()["queue_position"] == 0
    assert client.get("/health").json()["queued"] == 1


def test_cancelling_one_of_two_equal_jobs_leaves_the_other(behave: Behave, tmp_path: Path) -> None:
    gate = tmp_path / "gate"
    client, surface = behave("solve_held", "surface", str(gate)), fresh()
    first, second = post(client, surface=surface), post(client, surface=surface)
    until_at(client, first)
    assert client.delete(f"/v1/jobs/{first}").status_code == 204
    gate.touch()
    assert finished(client, second)["status"] == "done"
    assert client.get(f"/v1/jobs/{first}").json()["status"] == "cancelled"


def test_cancelled_work_can_be_asked_for_again(behave: Behave) -> None:
    client, surface = behave("solve_after", 3600), fresh()
    first = post(client, surface=surface)
    until_at(client, first)
    client.delete(f"/v1/jobs/{first}")
    behave("solve_after", 0.0)
    assert finished(client, post(client, surface=surface))["status"] == "done"


def test_job_whose_worker_dies_fails_alone(behave: Behave) -> None:
    client = behave("die_at_once")
    id = post(client, surface=fresh())
    job = finished(client, id)
    assert (job["status"], job["problem"]["type"]) == ("failed", "/problems/worker-died")
    assert client.get(f"/v1/jobs/{id}/result").status_code == 503
    behave()
    assert finished(client, post(client, surface=fresh()))["status"] == "done"


@pytest.mark.parametrize(
    ("data", "told"),
    [
        ({"cells": 2**70, "of": [10**400]}, {"cells": 2.0**70, "of": [str(10**400)]}),
        ({"half": "\ud800"}, {"half": "?"}),
        ({"deep": reduce(lambda inner, _: [inner], range(300), [])}, None),
    ],
)
def test_job_ends_whatever_its_problem_holds(behave: Behave, data: dict[str, Any], told: Any) -> None:
    client = behave("refuse_with", data)
    job = finished(client, post(client, surface=fresh()))
    assert job["status"] == "failed"
    if told is None:
        assert job["problem"]["type"] == "/problems/internal"
    else:
        assert {name: job["problem"][name] for name in told} == told


@pytest.mark.parametrize(
    ("settings", "slug"),
    [({"job_seconds": 0.3}, "time-limit"), ({"job_mib": 20.0}, "memory-limit")],
)
def test_job_over_a_limit_fails(tmp_path: Path, settings: dict[str, Any], slug: str) -> None:
    with running(tmp_path, slow(3600), **settings) as client:
        id = post(client)
        job = finished(client, id)
        assert (job["status"], job["problem"]["type"]) == ("failed", f"/problems/{slug}")
        assert client.get(f"/v1/jobs/{id}/result").status_code == 422
        assert client.get("/health").json()["running"] == 0


@pytest.mark.parametrize(("job_mib", "cached"), [(400.0, 50), (8192.0, 256)])
def test_what_is_remembered_leaves_room_for_the_next_job(tmp_path: Path, job_mib: float, cached: int) -> None:
    store = Store(tmp_path)
    manager = JobManager(store, ProcessEngine(1), Settings(job_mib=job_mib), Metrics(), nothing_short)
    assert manager.caching.memory_bytes == cached * MIB
    store.close()


async def nothing_short(function: str, *arguments: Any) -> Any:
    raise AssertionError("nothing short is asked for")


class Still(ProcessEngine):
    """Runs nothing; a call ends when it is told how."""

    def __init__(self) -> None:
        super().__init__(1)
        self.ends: list[asyncio.Future[Any]] = []

    async def start(self) -> None: ...

    async def run(self, function: str, *arguments: Any, **rest: Any) -> Any:
        self.ends.append(asyncio.get_running_loop().create_future())
        return await self.ends[-1]


@asynccontextmanager
async def managed(folder: Path) -> AsyncIterator[tuple[JobManager, Still, list[Job]]]:
    """A manager in this event loop, three jobs, of which one runs."""
    store, engine = Store(folder), Still()
    manager = JobManager(store, engine, Settings(), Metrics(), nothing_short)
    await manager.start()
    try:
        jobs = []
        for around in (8, 9, 10):
            body = json.dumps(request(pattern={"around": around})).encode()
            parsed = read_request(nobody, Body(body), Settings(), str(store.surfaces))
            jobs.append(await manager.submit(parsed))
        while not engine.ends:
            await asyncio.sleep(0)
        yield manager, engine, jobs
    finally:
        await manager.stop()
        store.close()


def test_job_that_is_deleted_while_it_is_taken_frees_its_worker(tmp_path: Path) -> None:
    async def story() -> None:
        async with managed(tmp_path) as (manager, engine, (first, second, third)):

            async def delete_when_taken() -> None:
                while manager.position(manager.get(second.id)) == 0 and manager.n_queued == 2:
                    await asyncio.sleep(0)
                assert manager.get(second.id).status == "queued"  # its task has not made its first step
                await manager.delete(second.id)

            deleting = asyncio.create_task(delete_when_taken())
            await manager.delete(first.id)
            await deleting
            while len(engine.ends) < 2:
                await asyncio.sleep(0.01)
            assert manager.get(third.id).status == "running"
            assert (manager.n_running, manager.n_queued) == (1, 0)

    asyncio.run(asyncio.wait_for(story(), PATIENCE))


def test_end_of_a_job_is_told_to_readers_that_were_slow(tmp_path: Path) -> None:
    async def story() -> None:
        async with managed(tmp_path) as (manager, engine, (first, *_)):
            told = []
            async for job in manager.changes(first.id, heartbeat=0.2):
                assert job is not None, "the end was missed"
                told.append(job.status)
                if not job.is_over:  # it ends while this is being sent
                    engine.ends[0].set_exception(WorkerDiedError("It died."))
                    await manager.wait(first.id, None)
            assert told == ["running", "failed"]

    asyncio.run(asyncio.wait_for(story(), PATIENCE))


@pytest.mark.parametrize(("closing", "status"), [(True, "running"), (False, "failed")])
def test_job_whose_worker_is_ended_with_the_server_goes_on_later(
    tmp_path: Path, closing: bool, status: str
) -> None:
    async def story() -> None:
        async with managed(tmp_path) as (manager, engine, (first, *_)):
            if closing:
                manager.close_waits()
            engine.ends[0].set_exception(WorkerDiedError("It died."))
            await asyncio.sleep(0.1)
            while not closing and not manager.get(first.id).is_over:
                await asyncio.sleep(0.01)
            kept = manager.store.job(first.id)
            work = manager.store.work(first.identity)
            assert kept is not None
            assert work is not None
            assert (kept.status, work.attempts) == (status, 0)

    asyncio.run(asyncio.wait_for(story(), PATIENCE))


class Lonely(ProcessEngine):
    """Has no place for any job at first."""

    has_place = False

    async def wait_for_place(self, seconds: float, told: Callable[[str], None]) -> None:
        deadline = time.monotonic() + seconds
        told("waiting for a place")
        while not self.has_place:
            await asyncio.sleep(0.01)
            if time.monotonic() > deadline:
                raise WorkerDiedError("There was no place.")


def test_jobs_wait_in_the_queue_until_there_is_a_place(tmp_path: Path) -> None:
    engine = Lonely(1)
    with running(tmp_path, engine) as client:
        ids = [post(client) for _ in range(2)]
        client.get(f"/v1/jobs/{ids[0]}", params={"wait": 0.2})
        for id in ids:
            job = client.get(f"/v1/jobs/{id}").json()
            assert (job["status"], job["started"]) == ("queued", None)
        assert client.get(f"/v1/jobs/{ids[0]}").json()["stage"] == "waiting for a place"
        other = post(client, surface=fresh())
        assert client.delete(f"/v1/jobs/{other}").status_code == 204
        engine.has_place = True
        assert [finished(client, id)["status"] for id in ids] == ["done", "done"]


def test_jobs_that_find_no_place_in_time_fail(tmp_path: Path) -> None:
    with running(tmp_path, Lonely(1), job_seconds=0.2) as client:
        job = finished(client, post(client))
        assert (job["status"], job["problem"]["detail"]) == ("failed", "There was no place.")


def test_wait_holds_the_answer_and_lets_go(behave: Behave, tmp_path: Path) -> None:
    gate = tmp_path / "gate"
    client = behave("solve_held", "surface", str(gate))
    id = post(client, surface=fresh())
    assert client.get(f"/v1/jobs/{id}", params={"wait": 0.3}).json()["status"] in ("queued", "running")
    refused = client.get(f"/v1/jobs/{id}/result")
    assert (refused.status_code, refused.json()["type"]) == (409, "/problems/not-finished")
    gate.touch()
    assert client.get(f"/v1/jobs/{id}", params={"wait": 30}).json()["status"] == "done"


def test_client_that_goes_away_disturbs_nothing(behave: Behave, tmp_path: Path) -> None:
    gate = tmp_path / "gate"
    client = behave("solve_held", "surface", str(gate))
    impatient = http.client.HTTPConnection(client.base_url.host, client.base_url.port)
    impatient.request("POST", "/v1/solve", json.dumps(request(name="impatient", surface=fresh())))

    def accepted() -> dict[str, Any] | None:
        jobs: list[dict[str, Any]] = client.get("/v1/jobs").json()["jobs"]
        return next((job for job in jobs if job["name"] == "impatient"), None)

    job = until(accepted, "the job")
    assert job is not None
    assert job["finished"] is None
    impatient.close()
    gate.touch()
    assert finished(client, job["id"])["status"] == "done"


def test_jobs_survive_a_restart(tmp_path: Path) -> None:
    engine = Watched(1)
    with running(tmp_path, engine) as client:
        done = post(client, pattern={"around": 8})
        finished(client, done)
        before = client.get(f"/v1/jobs/{done}/result").content
        engine.instead, engine.first = "solve_after", (60,)
        ids = [post(client, pattern={"around": n}) for n in (10, 12, 14)]
        until_at(client, ids[0])
    with running(tmp_path, workers=1) as client:
        assert [finished(client, id)["status"] for id in ids] == ["done"] * 3
        assert client.get(f"/v1/jobs/{done}").json()["status"] == "done"
        assert client.get(f"/v1/jobs/{done}/result").content == before
        lifted = client.post(f"/v1/jobs/{done}/lift", json={"points": [[0.1, 0.1]]})
        assert lifted.status_code == 200


def test_work_that_killed_the_server_thrice_is_given_up(tmp_path: Path) -> None:
    with running(tmp_path, slow(3600)) as client:
        id, same = post(client), post(client)
        until_at(client, id)
    store = Store(tmp_path)
    job = store.job(id)
    assert job is not None
    work = store.work(job.identity)
    assert work is not None
    assert work.attempts == 0  # an orderly stop is no failed attempt
    for _ in range(3):
        store.start_work(job.identity)
    store.close()
    with running(tmp_path) as client:
        for each in (id, same):
            told = client.get(f"/v1/jobs/{each}").json()
            assert (told["status"], told["problem"]["type"]) == ("failed", "/problems/too-many-attempts")
        assert client.post("/v1/solve", json=request()).status_code == 200


def test_one_folder_serves_one_server(tmp_path: Path) -> None:
    with running(tmp_path, workers=1), pytest.raises(FolderInUseError):
        Store(tmp_path)
    Store(tmp_path).close()


def test_stop_ends_long_polls_and_streams_at_once(tmp_path: Path) -> None:
    """Of a job that would take an hour."""
    answers: list[Any] = []

    def poll(base: httpx.URL, id: str) -> None:
        with (
            httpx.Client(base_url=base, timeout=PATIENCE, trust_env=False) as other,
            other.stream("GET", f"/v1/jobs/{id}/events") as events,
        ):
            listening.set()
            answers.append(list(events.iter_lines()))

    with running(tmp_path, slow(3600)) as client:
        id = post(client)
        listening = threading.Event()
        poller = threading.Thread(target=poll, args=(client.base_url, id))
        poller.start()
        assert listening.wait(PATIENCE)
        client.service.manager.close_waits()
        poller.join(PATIENCE)
        assert client.get(f"/v1/jobs/{id}", params={"wait": 50}).json()["status"] != "done"
        client.delete(f"/v1/jobs/{id}")
    assert len(answers) == 1


def test_solve_that_the_server_ends_says_where_the_job_is(tmp_path: Path) -> None:
    with running(tmp_path, slow(3600)) as client, ThreadPoolExecutor(1) as thread:
        solving = thread.submit(client.post, "/v1/solve", json=request())
        while not client.service.manager.n_running:
            time.sleep(0.02)
        client.service.manager.close_waits()
        answer = solving.result(PATIENCE)
        id = client.get("/v1/jobs").json()["jobs"][0]["id"]
        client.delete(f"/v1/jobs/{id}")
    assert (answer.status_code, answer.json()["type"]) == (503, "/problems/shutting-down")
    assert answer.headers["location"] == f"/v1/jobs/{id}"
    assert int(answer.headers["retry-after"]) > 0


def test_workers_know_for_whom_they_work(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    surface = fresh()
    with running(tmp_path, workers=1) as client:
        assert finished(client, post(client, surface=surface))["status"] == "done"
        deadline = time.monotonic() + PATIENCE
        while not list((tmp_path / "stages").glob("*.stage")):  # written when the worker has a pause
            assert time.monotonic() < deadline
            time.sleep(0.02)
    for path in (tmp_path / "stages").iterdir():
        path.write_bytes(b"damaged")
    with running(tmp_path, workers=1) as client:
        id = post(client, surface=surface, name="again", panels={"sizes": 3})
        assert finished(client, id)["status"] == "done"
    told = [json.loads(line) for line in capfd.readouterr().err.splitlines() if "cached stage" in line]
    assert {line["job"] for line in told} == {id}
