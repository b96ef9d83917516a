"""Where work is run. An engine runs a named function elsewhere and can always stop it.

Cancelling the coroutine that waits for ``run`` kills the work; a limit that is exceeded or a worker that dies
ends that one call with a WorkError; all other calls go on.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Protocol

from hexwrap_server.errors import ShuttingDownError, WorkerDiedError, WorkError
from hexwrap_server.jobs.worker import Report, WorkerProcess

#: Seconds between two looks for idle workers that died.
TEND_INTERVAL = 1.0
#: What a worker process imports before it says that it is ready.
ENGINE_PRELOAD = "hexwrap_server.jobs.work"
log = logging.getLogger("hexwrap.engine")


class Engine(Protocol):
    """Runs ``module:function`` with a Report and the given arguments (picklable) in another process."""

    @property
    def shares_disk(self) -> bool:
        """Whether its processes see this machine's files."""
        ...

    @property
    def capacity(self) -> int:
        """How many calls can run at once."""
        ...

    @property
    def is_ready(self) -> bool:
        """Whether there is a place where a call could run, now or when it is free."""
        ...

    async def start(self) -> None: ...

    async def stop(self) -> None:
        """Kill all running processes of the engine."""
        ...

    async def wait_for_place(self, seconds: float, report: Callable[[str], None]) -> None:
        """Until there is a place where a call could run. report: called with what it waits for, if it has to.

        Raises WorkError after seconds.
        """
        ...

    async def run(self, function: str, *arguments: Any, report: Report, seconds: float, mib: float) -> Any:
        """Raises HexwrapError as the function does, WorkError; when cancelled, kills the call first."""
        ...


def nobody(stage: str, fraction: float, what: str) -> None:
    """A listener that does not care."""


class ProcessEngine:
    """A number of worker processes on this machine.

    warm: how many of them are started at once, the others when they are needed; None: all.
    """

    shares_disk = True

    def __init__(self, workers: int, preload: str = ENGINE_PRELOAD, warm: int | None = None) -> None:
        self._workers = [WorkerProcess(preload) for _ in range(workers)]
        self._cold = self._workers[workers if warm is None else warm :]
        # the last one used remembers most; None tells whoever waits that the engine stops
        self._idle: asyncio.LifoQueue[WorkerProcess | None] = asyncio.LifoQueue()
        self._threads = ThreadPoolExecutor(2 * workers, thread_name_prefix="hexwrap-engine")
        self._starting: set[asyncio.Task[None]] = set()
        self._tending: asyncio.Task[None] | None = None
        self._stopping = False

    @property
    def capacity(self) -> int:
        return len(self._workers)

    @property
    def is_ready(self) -> bool:
        return not self._stopping and len(self._starting) < len(self._workers)

    @property
    def starting(self) -> int:
        """Workers that are not ready yet."""
        return len(self._starting)

    @property
    def pids(self) -> list[int]:
        """Process ids of the living workers."""
        return [w.pid for w in self._workers if w.is_alive]

    async def start(self) -> None:
        for worker in self._workers[: len(self._workers) - len(self._cold)]:
            self._begin(worker)
        self._tending = asyncio.create_task(self._tend())

    def give_up(self) -> None:
        """Kill all calls and refuse new ones; waiting callers get a ShuttingDownError."""
        self._stopping = True
        for worker in self._workers:
            worker.stop()
        self._idle.put_nowait(None)

    async def stop(self) -> None:
        self.give_up()
        if self._tending:
            self._tending.cancel()
        await asyncio.gather(*self._starting, return_exceptions=True)
        await asyncio.to_thread(self._threads.shutdown, wait=True)
        for worker in self._workers:
            worker.close()

    async def wait_for_place(self, seconds: float, report: Callable[[str], None]) -> None:
        return  # workers that die are started again

    async def run(self, function: str, *arguments: Any, report: Report, seconds: float, mib: float) -> Any:
        loop = asyncio.get_running_loop()

        def relay(stage: str, fraction: float, what: str) -> None:
            with contextlib.suppress(RuntimeError):  # the loop is gone, and with it whoever listened
                loop.call_soon_threadsafe(report, stage, fraction, what)

        worker = await self._free()
        call = loop.run_in_executor(self._threads, worker.run, function, arguments, relay, seconds, mib)
        try:
            return await asyncio.shield(call)
        except asyncio.CancelledError:
            worker.stop()
            with contextlib.suppress(Exception):
                await call
            raise
        except WorkerDiedError:
            if self._stopping:
                raise ShuttingDownError from None
            raise
        finally:
            if not call.done():
                await asyncio.wait([call])
            self._hand_back(worker)

    async def _free(self) -> WorkerProcess:
        while True:
            if self._idle.empty() and self._cold and not self._stopping:
                self._begin(self._cold.pop())
            worker = await self._idle.get()
            if worker is None:
                self._idle.put_nowait(None)  # for the next one who waits
                raise ShuttingDownError
            if worker.is_alive:
                return worker
            self._begin(worker)

    async def _tend(self) -> None:
        """Replace idle workers that were killed from outside; until then they are zombies."""
        while not self._stopping:
            await asyncio.sleep(TEND_INTERVAL)
            idle = [self._idle.get_nowait() for _ in range(self._idle.qsize())]
            for worker in reversed(idle):
                self._hand_back(worker)

    def _hand_back(self, worker: WorkerProcess | None) -> None:
        if worker is None or worker.is_alive:
            self._idle.put_nowait(worker)
        elif not self._stopping:
            self._begin(worker)

    def _begin(self, worker: WorkerProcess) -> None:
        task = asyncio.create_task(self._start(worker))
        self._starting.add(task)
        task.add_done_callback(self._starting.discard)

    async def _start(self, worker: WorkerProcess) -> None:
        pause = 0.1
        while not self._stopping:
            try:
                await asyncio.get_running_loop().run_in_executor(self._threads, _renew, worker)
            except (WorkError, OSError) as error:
                if not self._stopping:
                    log.error("a worker process did not start: %s", error)
                    await asyncio.sleep(pause)
                    pause = min(2 * pause, 10.0)
            else:
                self._idle.put_nowait(worker)
                return


def _renew(worker: WorkerProcess) -> None:
    worker.close()
    worker.start()
    worker.wait_ready()
