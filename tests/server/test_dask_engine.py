"""The dask engine against a real local cluster of two worker processes."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import AsyncIterator, Coroutine, Iterator
from contextlib import asynccontextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import psutil
import pytest

from hexwrap_server.errors import MemoryLimitError, TimeLimitError, WorkerDiedError
from hexwrap_server.jobs.engine import nobody
from hexwrap_solver.errors import RequestError
from tests.server.bodies import request, tube
from tests.server.live import finished, over_first, running, until_at
from tests.server.patience import PATIENCE

if find_spec("distributed") is None:  # it takes seconds to import, which only these tests should cost
    pytest.skip("dask.distributed is not installed (extra 'dask')", allow_module_level=True)
CALLS = "tests.server.calls:"


def machines(number: int, **more: Any) -> Any:
    """A scheduler, and worker processes that their nannies start again when they die."""
    import dask
    import distributed

    if os.name == "posix":  # they are forked from one that has the seconds of its imports behind it
        dask.config.set({"distributed.worker.multiprocessing-method": "forkserver"})
    return distributed.LocalCluster(
        n_workers=number,
        threads_per_worker=1,
        dashboard_address=":0",
        protocol="tcp://",
        silence_logs=50,
        **more,
    )


@asynccontextmanager
async def cluster(number: int = 2) -> AsyncIterator[Any]:
    from distributed import Client

    made = machines(number, asynchronous=True)
    async with made, Client(made.scheduler_address, asynchronous=True) as client:
        await client.run(load_nothing)
        yield made


def load_nothing() -> None:
    """For machines whose calls need nothing: their processes are killed and started again and again."""
    from hexwrap_server.jobs import dask_engine

    dask_engine.ENGINE_PRELOAD = ""


@asynccontextmanager
async def engine(made: Any) -> AsyncIterator[Any]:
    from hexwrap_server.jobs.dask_engine import DaskEngine

    e = DaskEngine(made.scheduler_address)
    await e.start()
    try:
        while e.capacity < len(made.workers):
            await asyncio.sleep(0.05)
        yield e
    finally:
        await e.stop()


def held_by(gate: Path, scheduler: str) -> Any:
    """An engine whose jobs stay at their pattern until there is a gate.

    However fast they are, they run when their machine is killed or they are stopped.
    """
    from hexwrap_server.jobs.dask_engine import DaskEngine

    class Held(DaskEngine):
        async def run(self, function: str, *arguments: Any, **rest: Any) -> Any:
            return await super().run(CALLS + "solve_held", "pattern", str(gate), *arguments, **rest)

    return Held(scheduler)


def run(story: Coroutine[Any, Any, None]) -> None:
    asyncio.run(story)


async def call(e: Any, name: str, *arguments: Any, seconds: float = PATIENCE, mib: float = 4096) -> Any:
    return await e.run(CALLS + name, *arguments, report=nobody, seconds=seconds, mib=mib)


async def made_by(marks: list[Path]) -> None:
    while not all(mark.exists() for mark in marks):
        await asyncio.sleep(0.02)


@pytest.mark.filterwarnings("ignore")
def test_same_promises_as_on_one_machine(tmp_path: Path) -> None:
    heard: list[tuple[str, float, str]] = []

    async def story() -> None:
        async with cluster() as made, engine(made) as e:
            assert (e.capacity, e.is_ready) == (2, True)
            said = await e.run(CALLS + "talk", report=lambda *a: heard.append(a), seconds=PATIENCE, mib=4096)
            assert said == "talked"
            with pytest.raises(RequestError) as caught:
                await call(e, "refuse")
            assert caught.value.vertices == [3]
            with pytest.raises(WorkerDiedError):
                await call(e, "die")
            with pytest.raises(TimeLimitError):
                await call(e, "sleep", 3600, seconds=0.5)
            with pytest.raises(MemoryLimitError):
                await call(e, "hoard", 500, mib=300)
            marks = [tmp_path / "running"]
            task = asyncio.create_task(call(e, "sleep", 3600, str(marks[0])))
            await made_by(marks)
            task.cancel()
            with pytest.raises(asyncio.CancelledError):
                await task
            assert await asyncio.gather(*(call(e, "echo", i) for i in range(4))) == list(range(4))
            deadline = time.monotonic() + PATIENCE
            while len(heard) < 2 and time.monotonic() < deadline:
                await asyncio.sleep(0.05)
            if os.name == "posix":
                await killed_machine_costs_its_own_call_only(made, e, tmp_path / "gate")

    run(story())
    assert heard == [("first", 0.25, "a quarter"), ("second", 0.75, "three quarters")]


async def killed_machine_costs_its_own_call_only(made: Any, e: Any, gate: Path) -> None:
    """Both are heard to run first: dask gives a call whose machine died unheard of to another."""
    heard: list[tuple[str, float, str]] = []
    tasks = [
        asyncio.create_task(
            e.run(
                CALLS + "wait_for", str(gate), report=lambda *a: heard.append(a), seconds=PATIENCE, mib=4096
            )
        )
        for _ in range(2)
    ]
    while len(heard) < 2:
        await asyncio.sleep(0.02)
    victim = made.workers[0].pid
    inside = psutil.Process(victim).children(recursive=True)
    os.kill(victim, signal.SIGKILL)
    died, alive = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    assert [type(task.exception()) for task in died] == [WorkerDiedError]
    gate.touch()
    assert await asyncio.gather(*alive) == ["waited"]
    assert await call(e, "echo", "still there") == "still there"
    deadline = time.monotonic() + PATIENCE
    while any(p.is_running() and p.status() != psutil.STATUS_ZOMBIE for p in inside):
        assert time.monotonic() < deadline, "the job outlived its machine"
        await asyncio.sleep(0.05)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.skipif(os.name == "nt", reason="kill -STOP of POSIX")
def test_machine_that_does_not_answer_keeps_nobody(tmp_path: Path) -> None:
    from hexwrap_server.jobs.dask_engine import DaskEngine

    async def story() -> None:
        async with cluster(1) as made:
            e, mark = DaskEngine(made.scheduler_address), tmp_path / "one"
            await e.start()
            task = asyncio.create_task(call(e, "sleep", 8, str(mark)))
            await made_by([mark])
            os.kill(made.workers[0].pid, signal.SIGSTOP)
            try:
                task.cancel()
                await asyncio.wait([task], timeout=PATIENCE)
                stop = asyncio.create_task(e.stop())
                await asyncio.wait([stop], timeout=PATIENCE)
            finally:
                os.kill(made.workers[0].pid, signal.SIGCONT)
            await stop

    run(story())


@pytest.mark.long
@pytest.mark.filterwarnings("ignore")
def test_lost_scheduler_fails_its_job_and_is_found_again(tmp_path: Path) -> None:
    from distributed import Nanny, Scheduler

    from hexwrap_server.errors import ClusterError
    from hexwrap_server.jobs.dask_engine import DaskEngine

    async def story() -> None:
        async with cluster(1) as made, engine(made) as e:
            port, mark = made.scheduler.port, tmp_path / "one"
            assert isinstance(e, DaskEngine)
            task = asyncio.create_task(call(e, "sleep", 3600, str(mark)))
            await made_by([mark])
            await made.scheduler.close()
            with pytest.raises((ClusterError, WorkerDiedError)):
                await task
            while e.is_ready:
                await asyncio.sleep(0.05)
            with pytest.raises(ClusterError, match="no machines"):
                await call(e, "echo", 1)
            async with (
                Scheduler(port=port, dashboard_address=":0"),
                Nanny(f"tcp://127.0.0.1:{port}", nthreads=1),
            ):
                deadline = time.monotonic() + PATIENCE
                while not e.is_ready:
                    assert time.monotonic() < deadline
                    await asyncio.sleep(0.05)
                assert await call(e, "echo", "found") == "found"

    run(story())


@pytest.mark.long
@pytest.mark.filterwarnings("ignore")
@pytest.mark.skipif(os.name == "nt", reason="kill -9 of POSIX")
def test_job_whose_machine_is_killed_fails_alone(tmp_path: Path) -> None:
    """As the job whose worker process is killed on one machine."""
    gate = tmp_path / "gate"
    with (
        machines(2) as made,
        running(tmp_path / "data", held_by(gate, made.scheduler_address)) as client,
    ):
        bodies = [request(surface=tube(60, 20, height=10 + i)) for i in range(2)]
        ids = [client.post("/v1/jobs", json=body).json()["id"] for body in bodies]
        for id in ids:
            until_at(client, id, "pattern")  # and both stay there: one on each machine
        os.kill(made.workers[0].pid, signal.SIGKILL)
        lost = over_first(client, ids)
        assert (lost["status"], lost["problem"]["type"]) == ("failed", "/problems/worker-died")
        assert client.get(f"/v1/jobs/{lost['id']}/result").status_code == 503
        (neighbour,) = set(ids) - {lost["id"]}
        until_at(client, neighbour, "pattern")
        gate.touch()
        assert finished(client, neighbour)["status"] == "done"
        again = client.post("/v1/jobs", json=bodies[ids.index(lost["id"])]).json()["id"]
        assert finished(client, again)["status"] == "done"


@pytest.fixture(scope="module")
def one_machine() -> Iterator[str]:
    """The address of a cluster that nobody kills."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with machines(1) as made:
            yield made.scheduler_address


@pytest.mark.filterwarnings("ignore")
def test_running_job_on_a_cluster_is_stopped(tmp_path: Path, one_machine: str) -> None:
    gate = tmp_path / "gate"
    with running(tmp_path / "data", held_by(gate, one_machine)) as client:
        body = request(surface=tube(60, 20))
        id = client.post("/v1/jobs", json=body).json()["id"]
        until_at(client, id, "pattern")
        assert client.delete(f"/v1/jobs/{id}").status_code == 204
        assert client.get(f"/v1/jobs/{id}").json()["status"] == "cancelled"
        gate.touch()
        small = client.post("/v1/jobs", json=request()).json()["id"]
        assert finished(client, small)["status"] == "done"


@pytest.mark.filterwarnings("ignore")
def test_jobs_run_on_a_cluster(tmp_path: Path, one_machine: str) -> None:
    with running(tmp_path, engine="dask", scheduler=one_machine) as client:
        job = finished(client, client.post("/v1/jobs", json=request()).json()["id"])
        assert job["status"] == "done"
        assert client.get(f"/v1/jobs/{job['id']}/files/panels.csv").status_code == 200


@pytest.mark.filterwarnings("ignore")
def test_jobs_wait_for_the_first_machine(tmp_path: Path) -> None:
    with (
        machines(0) as made,
        running(tmp_path, engine="dask", scheduler=made.scheduler_address) as client,
    ):
        id = client.post("/v1/jobs", json=request()).json()["id"]
        client.get(f"/v1/jobs/{id}", params={"wait": 1})
        job = client.get(f"/v1/jobs/{id}").json()
        assert (job["status"], job["stage"]) == ("queued", "waiting for a machine of the cluster")
        made.scale(1)
        assert finished(client, id)["status"] == "done"


def test_waiting_for_machines_has_an_end() -> None:
    from hexwrap_server.errors import ClusterError
    from hexwrap_server.jobs.dask_engine import DaskEngine

    told: list[str] = []
    with pytest.raises(ClusterError, match=r"no machines for 0\.1 s"):
        asyncio.run(DaskEngine("tcp://127.0.0.1:1").wait_for_place(0.1, told.append))
    assert told == ["waiting for a machine of the cluster"]


def test_scheduler_that_does_not_answer_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    from hexwrap_server.jobs import dask_engine

    class Silent:
        scheduler: Any

        async def identity(self, n_workers: int) -> None:
            await asyncio.sleep(60)

        def subscribe_topic(self, *_: Any) -> None:
            pass

    async def client(*_: Any, **__: Any) -> Any:
        silent = Silent()
        silent.scheduler = silent
        return silent

    monkeypatch.setattr(dask_engine, "LOOK_SECONDS", 0.05)
    monkeypatch.setattr(dask_engine, "Client", client)
    with pytest.raises(OSError, match="does not answer"):
        asyncio.run(dask_engine.DaskEngine("tcp://127.0.0.1:1").start())


NO_SCHEDULER = """
import sys
from hexwrap_server.cli import main as cli
from hexwrap_server.jobs import dask_engine
dask_engine.CONNECT_SECONDS = 0.3
words = ["serve", "--port", "0", "--engine", "dask", "--scheduler", sys.argv[1], "--data", sys.argv[2]]
sys.exit(cli.main(words))
"""


def test_address_of_no_known_kind_is_told() -> None:
    from hexwrap_server.jobs.dask_engine import DaskEngine

    with pytest.raises(OSError, match=r"The dask scheduler at nowhere://127\.0\.0\.1:9 does not answer"):
        asyncio.run(DaskEngine("nowhere://127.0.0.1:9").start())


def test_scheduler_that_is_down_at_start_is_told_in_a_sentence(tmp_path: Path) -> None:
    address = "tcp://127.0.0.1:9"
    paths = os.pathsep.join(os.path.abspath(p or ".") for p in sys.path)
    told = subprocess.run(
        [sys.executable, "-c", NO_SCHEDULER, address, str(tmp_path)],
        env=os.environ | {"PYTHONPATH": paths},
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert told.returncode == 1
    assert f"hexwrap: The dask scheduler at {address} does not answer" in told.stderr
    assert "Traceback" not in told.stderr


@pytest.mark.filterwarnings("ignore")
def test_explorations_there_come_to_the_same(tmp_path: Path, one_machine: str) -> None:
    from hexwrap_server.jobs.dask_engine import DaskEngine

    vary = {"around": [10, 12], "sizes": [1, 5], "singularities": [0]}
    body = {"surface": tube(), "vary": vary, "variants": 3, "seed": 3}
    found = []
    for name, own in (("dask", DaskEngine(one_machine)), ("pool", None)):
        with running(tmp_path / name, own) as client:
            job = finished(client, client.post("/v1/explore", json=body).json()["id"])
            assert job["status"] == "done", job
            found.append(client.get(f"/v1/jobs/{job['id']}/result").json())
            best = found[-1]["variants"][found[-1]["best"]]
            assert best["measured"]
            assert client.post("/v1/jobs", json=best["request"]).json()["status"] == "done"
    assert found[0] == found[1]
