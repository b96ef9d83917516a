"""Jobs on a dask.distributed cluster that somebody else runs (extra ``dask``).

dask cannot stop a task that runs, and it starts a task again when its machine is lost. So the job itself is
done by a worker process inside the task, which can be killed from here, and a lost machine ends the job as a
lost worker process does.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import threading
import uuid
from collections import OrderedDict
from collections.abc import Callable
from functools import partial
from typing import Any

from distributed import Client, get_worker

from hexwrap_server.errors import ClusterError, WorkerDiedError
from hexwrap_server.jobs.engine import ENGINE_PRELOAD
from hexwrap_server.jobs.worker import Report, WorkerProcess
from hexwrap_solver.errors import HexwrapError

#: Seconds between two looks at whether the machine of a job is still there.
CHECK_INTERVAL = 0.5
#: Seconds within which the scheduler has to answer at start.
CONNECT_SECONDS = 15
#: Seconds within which it has to say which machines there are.
LOOK_SECONDS = 10.0
#: Seconds that we wait for the cluster to stop something.
STOP_SECONDS = 1.0
_TOPIC = "hexwrap-progress"
log = logging.getLogger("hexwrap.dask")


class DaskEngine:
    """One job per thread of the cluster's workers, which must have the same hexwrap installed."""

    shares_disk = False

    def __init__(self, scheduler: str) -> None:
        self._address = scheduler
        self._client: Any = None
        self._listeners: dict[str, Callable[..., None]] = {}
        self._places: dict[str, list[str]] = {}  # machines that a call was given to
        self._machines: dict[str, int] = {}  # threads by address
        self._looking: asyncio.Task[None] | None = None

    @property
    def capacity(self) -> int:
        return max(1, sum(self._machines.values()))

    @property
    def is_ready(self) -> bool:
        return bool(self._machines)

    async def start(self) -> None:
        """Raises OSError when the scheduler does not answer."""
        try:
            await self._connect()
        except (OSError, RuntimeError, ValueError) as error:
            raise OSError(
                f"The dask scheduler at {self._address} does not answer ({error or type(error).__name__}); "
                "start it, or give the address of another as --scheduler."
            ) from error
        self._looking = asyncio.create_task(self._keep_looking())

    async def stop(self) -> None:
        if self._looking is not None:
            self._looking.cancel()
        if self._client is None:
            return
        for _ in range(20):  # calls that were cancelled are just being killed
            if not self._listeners:
                break
            await asyncio.sleep(0.1)
        for end in (partial(self._client.run, _close_idle, on_error="ignore"), self._client.close):
            with contextlib.suppress(OSError, RuntimeError):
                await asyncio.wait_for(end(), STOP_SECONDS)

    async def wait_for_place(self, seconds: float, report: Callable[[str], None]) -> None:
        """Clusters that grow with their work have no machines at first."""
        if self._machines:
            return
        report("waiting for a machine of the cluster")
        try:
            async with asyncio.timeout(seconds):
                while not self._machines:
                    await asyncio.sleep(CHECK_INTERVAL)
        except TimeoutError:
            raise ClusterError(
                f"The dask cluster at {self._address} had no machines for {seconds:g} s; start some, and "
                "send the job again."
            ) from None

    async def run(self, function: str, *arguments: Any, report: Report, seconds: float, mib: float) -> Any:
        if not self._machines:
            raise ClusterError(
                f"The dask cluster at {self._address} has no machines; send the job again later."
            )
        ticket = uuid.uuid4().hex
        self._listeners[ticket] = report
        future = self._client.submit(
            _in_process,
            ticket,
            function,
            arguments,
            seconds,
            mib,
            key=f"hexwrap-{ticket}",
            pure=False,
            retries=0,
        )
        try:
            return await self._answer(future, ticket)
        except BaseException:
            await self._kill(future, ticket)
            raise
        finally:
            del self._listeners[ticket]
            self._places.pop(ticket, None)

    async def _answer(self, future: Any, ticket: str) -> Any:
        answer = asyncio.ensure_future(future)
        try:
            while True:
                done, _ = await asyncio.wait([answer], timeout=CHECK_INTERVAL)
                if done:
                    return _content(answer)
                places = self._places.get(ticket, [])
                if len(places) > 1 or not self._machines.keys() >= set(places):
                    raise WorkerDiedError(
                        f"The machine that ran the job ({places[0]}) left the cluster; other jobs are not "
                        "affected. Send the job again."
                    )
        finally:
            answer.cancel()

    async def _kill(self, future: Any, ticket: str) -> None:
        assert self._client is not None
        with contextlib.suppress(Exception, asyncio.CancelledError):  # in whatever way the cluster went
            async with asyncio.timeout(STOP_SECONDS):
                await future.cancel(force=True)
                await self._client.run(_stop, ticket, on_error="ignore")

    async def _connect(self) -> None:
        client: Any = Client
        self._client = await client(self._address, asynchronous=True, timeout=CONNECT_SECONDS)
        self._client.subscribe_topic(_TOPIC, self._hear)
        await self._look()

    async def _look(self) -> None:
        """Ask the scheduler which machines there are."""
        identity = await asyncio.wait_for(self._client.scheduler.identity(n_workers=-1), LOOK_SECONDS)
        self._machines = {address: machine["nthreads"] for address, machine in identity["workers"].items()}

    async def _keep_looking(self) -> None:
        while True:
            await asyncio.sleep(CHECK_INTERVAL)
            try:
                await (self._look() if self._client.status == "running" else self._connect())
            except (OSError, RuntimeError) as error:
                self._machines = {}
                log.warning("the dask scheduler does not answer: %s", error)

    def _hear(self, event: tuple[Any, Any]) -> None:
        ticket, *content = event[1]
        if ticket not in self._listeners:
            return
        if content[0] == "place":
            self._places.setdefault(ticket, []).append(content[1])
            self._machines.setdefault(content[1], 1)  # one that joined since we looked
        else:
            self._listeners[ticket](*content)


def _content(answer: asyncio.Future[Any]) -> Any:
    """What a task answered. Raises what it raised, ClusterError where that was no word of a worker's."""
    try:
        return answer.result()
    except HexwrapError:
        raise
    except asyncio.CancelledError:  # not by us: we would not be here
        raise ClusterError("The dask scheduler left while the job ran; send the job again.") from None
    except Exception as error:
        raise ClusterError(f"The cluster could not run the job ({type(error).__name__}: {error}).") from error


# What follows runs on the cluster's machines.

_GUARD = threading.Lock()
_IDLE: list[WorkerProcess] = []
_BUSY: dict[str, WorkerProcess] = {}
#: Calls that were stopped, which may not have begun yet; the oldest have long come and gone.
_STOPPED: OrderedDict[str, None] = OrderedDict()
MOST_STOPPED = 10_000


def _in_process(ticket: str, function: str, arguments: tuple[Any, ...], seconds: float, mib: float) -> Any:
    """The task: one call in a worker process that ``_stop`` can kill."""
    machine = get_worker()
    machine.log_event(_TOPIC, [ticket, "place", machine.address])

    def report(stage: str, fraction: float, what: str) -> None:
        machine.log_event(_TOPIC, [ticket, stage, fraction, what])

    with _GUARD:
        process = _IDLE.pop() if _IDLE else WorkerProcess(ENGINE_PRELOAD)
        _BUSY[ticket] = process
    try:
        if not process.is_alive:
            process.close()
            process.start()
            process.wait_ready()
        if ticket in _STOPPED:
            raise WorkerDiedError("The job was stopped before it began.")
        return process.run(function, arguments, report, seconds, mib)
    finally:
        with _GUARD:
            del _BUSY[ticket]
            if process.is_alive:
                _IDLE.append(process)
            else:
                process.close()


def _stop(ticket: str) -> None:
    """Runs on every machine of the cluster; one of them has the job."""
    with _GUARD:
        _STOPPED[ticket] = None
        while len(_STOPPED) > MOST_STOPPED:
            _STOPPED.popitem(last=False)
        if ticket in _BUSY:
            _BUSY[ticket].stop()


def _close_idle() -> None:
    with _GUARD:
        while _IDLE:
            _IDLE.pop().close()
