"""The engine's promises: limits, cancelling, and death of workers harm one call only."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import subprocess
import sys
from collections.abc import AsyncIterator, Coroutine
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any, TypeVar

import psutil
import pytest

from hexwrap_server.errors import (
    InternalError,
    MemoryLimitError,
    ShuttingDownError,
    TimeLimitError,
    WorkerDiedError,
)
from hexwrap_server.jobs.engine import ProcessEngine, nobody
from hexwrap_solver.errors import RequestError
from tests.server.patience import PATIENCE, until

T = TypeVar("T")
CALLS = "tests.server.calls:"


@asynccontextmanager
async def engine(workers: int = 1) -> AsyncIterator[ProcessEngine]:
    made = ProcessEngine(workers, preload="tests.server.calls")
    await made.start()
    try:
        yield made
    finally:
        pids = made.pids
        await made.stop()
        assert not any(psutil.pid_exists(pid) for pid in pids)


async def call(
    e: ProcessEngine, name: str, *arguments: Any, seconds: float = PATIENCE, mib: float = 4096
) -> Any:
    return await e.run(CALLS + name, *arguments, report=nobody, seconds=seconds, mib=mib)


async def made(mark: Path) -> None:
    async with asyncio.timeout(PATIENCE):
        while not mark.exists():
            await asyncio.sleep(0.01)


def run(story: Coroutine[Any, Any, T]) -> T:
    return asyncio.run(story)


async def ready(e: ProcessEngine) -> None:
    """When all workers are."""
    while e.starting:
        await asyncio.sleep(0.01)


def test_values_go_there_and_back() -> None:
    async def story() -> None:
        async with engine() as e:
            assert await call(e, "echo", {"a": [1, 2.5, b"x" * 2_000_000]}) == {
                "a": [1, 2.5, b"x" * 2_000_000]
            }
            assert await call(e, "environment", "OPENBLAS_NUM_THREADS") == "1"
            assert await call(e, "frozen") > 10_000  # numpy alone makes more

    run(story())


def test_calls_one_after_the_other_go_to_the_worker_that_remembers_most() -> None:
    async def story() -> None:
        async with engine(2) as e:
            await ready(e)
            assert len({await call(e, "pid") for _ in range(4)}) == 1

    run(story())


def test_progress_arrives_in_order_and_printing_does_no_harm() -> None:
    heard: list[tuple[str, float, str]] = []

    async def story() -> None:
        async with engine() as e:
            said = await e.run(CALLS + "talk", report=lambda *a: heard.append(a), seconds=PATIENCE, mib=4096)
            assert said == "talked"

    run(story())
    assert heard == [("first", 0.25, "a quarter"), ("second", 0.75, "three quarters")]


def test_refusals_keep_their_data_and_the_worker() -> None:
    async def story() -> None:
        async with engine() as e:
            before = await call(e, "pid")
            with pytest.raises(RequestError) as caught:
                await call(e, "refuse")
            assert (caught.value.vertices, caught.value.data) == ([3], {"missing": 0.5})
            with pytest.raises(InternalError, match="KeyError"):
                await call(e, "stumble")
            with pytest.raises(InternalError, match="answer"):
                await call(e, "unpicklable")
            assert await call(e, "pid") == before

    run(story())


def test_limits_end_one_call_and_the_next_one_runs() -> None:
    async def story() -> None:
        async with engine() as e:
            with pytest.raises(TimeLimitError, match=r"after 0\.3 s"):
                await call(e, "sleep", 3600, seconds=0.3)
            with pytest.raises(MemoryLimitError, match="300 MiB"):
                await call(e, "hoard", 500, mib=300)
            assert await call(e, "echo", 1) == 1

    run(story())


def test_death_of_a_worker_harms_its_own_call_only() -> None:
    async def story() -> None:
        async with engine(2) as e:
            neighbour = asyncio.create_task(call(e, "sleep", 1.0))
            with pytest.raises(WorkerDiedError) as caught:
                await call(e, "die")
            assert caught.value.data == {"exit_status": 7}
            assert await neighbour == "slept"
            assert await asyncio.gather(*(call(e, "echo", i) for i in range(5))) == list(range(5))

    run(story())


def test_worker_that_dies_while_it_waits_fails_no_call() -> None:
    async def story() -> None:
        async with engine() as e:
            for _ in range(2):
                idle = psutil.Process(await call(e, "pid"))
                idle.kill()
                idle.wait()
                assert e.is_ready
                assert await call(e, "echo", "next") == "next"

    run(story())


def test_worker_that_is_killed_while_it_waits_is_replaced_and_no_zombie_stays() -> None:
    async def story() -> None:
        async with engine(2) as e:
            await ready(e)
            before = e.pids
            for pid in before:
                psutil.Process(pid).kill()
            async with asyncio.timeout(PATIENCE):
                while len(e.pids) < 2 or set(e.pids) & set(before):
                    await asyncio.sleep(0.05)
            assert not any(psutil.pid_exists(pid) for pid in before)

    run(story())


def test_calls_that_run_or_wait_are_told_when_the_engine_gives_up(tmp_path: Path) -> None:
    async def story() -> None:
        async with engine() as e:
            busy = asyncio.create_task(call(e, "sleep", 3600, str(tmp_path / "started")))
            await made(tmp_path / "started")
            waiting = [asyncio.create_task(call(e, "echo", i)) for i in range(3)]
            await asyncio.sleep(0)
            e.give_up()
            told = await asyncio.gather(busy, *waiting, return_exceptions=True)
            assert [type(error) for error in told] == [ShuttingDownError] * 4

    run(story())


def test_one_worker_that_starts_keeps_nobody_from_the_others(tmp_path: Path) -> None:
    async def story() -> None:
        async with engine(2) as e:
            await ready(e)
            with pytest.raises(WorkerDiedError):
                await call(e, "die")
            assert e.starting == 1
            assert e.is_ready
            assert await call(e, "echo", 1) == 1

    run(story())


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_workers_leave_it_to_their_parent_when_to_end(number: signal.Signals) -> None:
    async def story() -> None:
        async with engine() as e:
            pid = await call(e, "pid")
            busy = asyncio.create_task(call(e, "sleep", 0.3))
            await asyncio.sleep(0.1)
            os.kill(pid, number)
            assert await busy == "slept"
            assert await call(e, "pid") == pid

    run(story())


@pytest.mark.parametrize("busy", [("sleep", 3600), ("crunch", 20_000)])
def test_cancelling_kills_within_moments(tmp_path: Path, busy: tuple[str, float]) -> None:
    async def story() -> None:
        async with engine() as e:
            pid = await call(e, "pid")
            task = asyncio.create_task(call(e, *busy, str(tmp_path / "started")))
            await made(tmp_path / "started")
            task.cancel()
            with pytest.raises(asyncio.CancelledError):
                await task  # which would take an hour
            assert not psutil.pid_exists(pid)
            assert await call(e, "echo", "next") == "next"

    run(story())


def test_calls_that_wait_for_a_worker_can_be_cancelled() -> None:
    async def story() -> None:
        async with engine() as e:
            running = asyncio.create_task(call(e, "sleep", 0.5))
            await asyncio.sleep(0.1)
            waiting = asyncio.create_task(call(e, "sleep", 60))
            await asyncio.sleep(0.1)
            waiting.cancel()
            assert await running == "slept"
            assert await call(e, "echo", 1) == 1

    run(story())


def test_stop_leaves_no_process_though_all_are_busy() -> None:
    async def story() -> None:
        async with engine(2) as e:
            busy = [asyncio.create_task(call(e, "sleep", 60)) for _ in range(3)]
            await asyncio.sleep(1.5)
            for task in busy:
                task.cancel()
            await asyncio.gather(*busy, return_exceptions=True)

    run(story())


PARENT = """
import asyncio, sys
from hexwrap_server.jobs.engine import ProcessEngine, nobody
async def main():
    e = ProcessEngine(2, preload="tests.server.calls")
    await e.start()
    busy = [e.run("tests.server.calls:sleep", 60, report=nobody, seconds=99, mib=4096) for _ in range(2)]
    tasks = [asyncio.create_task(b) for b in busy]
    while len(e.pids) < 2 or not e.is_ready:
        await asyncio.sleep(0.05)
    print(*e.pids, flush=True)
    await asyncio.gather(*tasks)
asyncio.run(main())
"""


def test_workers_notice_that_their_parent_was_killed() -> None:
    paths = os.pathsep.join(p or "." for p in sys.path)
    with subprocess.Popen(
        [sys.executable, "-c", PARENT],
        stdout=subprocess.PIPE,
        env=os.environ | {"PYTHONPATH": paths},
        text=True,
    ) as parent:
        assert parent.stdout is not None
        pids = [int(word) for word in parent.stdout.readline().split()]
        assert len(pids) == 2
        parent.send_signal(getattr(signal, "SIGKILL", signal.SIGTERM))
        parent.wait()
        until(lambda: not any(psutil.pid_exists(pid) for pid in pids), "the end of the workers")


def test_log_lines_of_workers_are_json_and_name_the_job(capfd: pytest.CaptureFixture[str]) -> None:
    async def story() -> None:
        async with engine() as e:
            with pytest.raises(InternalError):
                await call(e, "complain", "a1b2")
            with pytest.raises(InternalError):
                await call(e, "no_such_function")

    run(story())
    lines = [json.loads(line) for line in capfd.readouterr().err.splitlines()]
    assert [line["level"] for line in lines] == ["warning", "warning", "error", "error"]
    assert [line.get("job") for line in lines] == ["a1b2", "a1b2", "a1b2", None]
    assert lines[0]["message"] == "something is odd"
    assert "a library says" in lines[1]["message"]
    assert "ValueError: a bug" in lines[2]["traceback"]
