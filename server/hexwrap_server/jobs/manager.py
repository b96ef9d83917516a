"""The queue: jobs come in, works are run, everybody who waits is notified."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
import uuid
from collections import OrderedDict
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import dataclass, field, replace
from typing import Any

from hexwrap_server.errors import (
    AttemptsError,
    BusyError,
    FormError,
    GoneError,
    InternalError,
    ShuttingDownError,
    StorageError,
    TimeLimitError,
    WorkerDiedError,
    not_found,
    refusal,
)
from hexwrap_server.http.metrics import Metrics
from hexwrap_server.input.requests import CacheSettings, Exploration, Order, Outcome, ParsedRequest, Wanted
from hexwrap_server.jobs.codec import digest
from hexwrap_server.jobs.engine import Engine, nobody
from hexwrap_server.jobs.exploring import explore
from hexwrap_server.jobs.store import Job, Kind, Store, Work
from hexwrap_server.output.packed import picked
from hexwrap_server.problems import plain, problem
from hexwrap_server.settings import MIB, Settings
from hexwrap_server.version import service_version
from hexwrap_solver.errors import HexwrapError

#: A work that was running this often when the server died is not started again.
MAX_ATTEMPTS = 3
#: Seconds between two rounds of pruning.
PRUNE_INTERVAL = 600.0
#: Seconds between two attempts to write what a full disk refused.
CATCH_UP_INTERVAL = 2.0
#: Seconds that a job waits for the database while another program holds it, and between two attempts.
PATIENCE, BUSY_INTERVAL = 10.0, 0.1
#: Bytes of a result that a worker has just written up to which it is read without the detour of a thread.
AT_ONCE = 2**24
#: Explorations that run at once; they take no worker themselves.
EXPLORERS = 2
log = logging.getLogger("hexwrap.jobs")


@dataclass(eq=False)
class _Item:
    """A work that waits or runs, and the jobs and explorations that want it.

    found: of an exploration, numbers and documents of variants, in the order in which they became known.
    """

    work: Work
    jobs: dict[str, Job] = field(default_factory=dict)
    task: asyncio.Task[None] | None = None
    waiting: list[asyncio.Future[None]] = field(default_factory=list)
    found: list[tuple[int, dict[str, Any]]] = field(default_factory=list)

    @property
    def explores(self) -> bool:
        return isinstance(self.work.wanted, Exploration)

    @property
    def is_wanted(self) -> bool:
        return bool(self.jobs or self.waiting)

    def tell(self, error: Exception | None = None) -> None:
        """Those that wait for it."""
        for waiting in self.waiting:
            if waiting.done():
                continue
            if error is None:
                waiting.set_result(None)
            else:
                waiting.set_exception(error)


class JobManager:
    """Belongs to one event loop."""

    def __init__(
        self,
        store: Store,
        engine: Engine,
        settings: Settings,
        metrics: Metrics,
        errand: Callable[..., Awaitable[Any]],
    ) -> None:
        """errand: has short work done beside the jobs, on this machine."""
        self.store = store
        self.errand = errand
        self._engine = engine
        self._settings = settings
        self._metrics = metrics
        self._items: dict[str, _Item] = {}  # by identity
        self._live: dict[str, _Item] = {}  # by job
        self._queue: OrderedDict[str, _Item] = OrderedDict()
        self._running: set[_Item] = set()
        self._changed: dict[str, asyncio.Event] = {}
        self._chores: list[asyncio.Task[None]] = []
        self._last = "", b""  # the result that was finished or asked for last, and whose it is
        self._closing = asyncio.Event()
        self._turn = asyncio.Lock()

    @property
    def caching(self) -> CacheSettings:
        folder = str(self.store.stages) if self._engine.shares_disk else ""
        # what is remembered counts towards the limit of the next job
        mib = min(self._settings.memory_cache_mib, self._settings.job_mib / 8)
        return CacheSettings(folder, int(mib * MIB))

    @property
    def n_queued(self) -> int:
        return len(self._queue)

    @property
    def n_running(self) -> int:
        return len(self._running)

    async def start(self) -> None:
        """Take up what an earlier server left."""
        jobs = self.store.unfinished()
        for job in jobs:
            self._resume(job)
        for identity in {job.identity for job in jobs} - self._items.keys():
            self._settle(identity)
        self._chores = [asyncio.create_task(self._prune_forever()), asyncio.create_task(self._catch_up())]
        self._pump()

    def close_waits(self) -> None:
        """End all long polls and event streams; the server stops."""
        self._closing.set()
        for event in self._changed.values():
            event.set()

    async def stop(self) -> None:
        """Stop everything, the engine too; what is unfinished is taken up by the next server."""
        self.close_waits()
        self._queue.clear()
        tasks = [item.task for item in self._running if item.task]
        tasks += self._chores
        for task in tasks:
            task.cancel()
        # before the tasks come to know: the engine need not replace the workers that they kill
        await self._engine.stop()
        await asyncio.gather(*tasks, return_exceptions=True)
        self.store.catch_up()

    # what clients do

    async def submit(self, parsed: ParsedRequest) -> Job:
        """Raises HttpError when the queue is full, FormError when the surface is unknown."""
        async with self._turn:
            await asyncio.sleep(0)  # many at once leave the event loop to others in between
            return self._submit(parsed)

    def _submit(self, parsed: ParsedRequest) -> Job:
        identity = digest(service_version(), parsed.surface_id, parsed.wanted)
        kind: Kind = "explore" if isinstance(parsed.wanted, Exploration) else "solve"
        job = Job(uuid.uuid4().hex, identity, parsed.name, created=time.time(), kind=kind)
        finished = self.store.finished_work(identity)
        if finished is not None:
            job = _reused(job, finished)
            self.store.add(job, finished)
            self._metrics.jobs.labels("reused").inc()
            return job
        if not self.store.use_surface(parsed.surface_id):
            raise FormError.at("/surface/id", "no such surface is kept here; send it to /v1/surfaces again")
        item = self._items.get(identity)
        if item is None and sum(bool(one.jobs) for one in self._queue.values()) >= self._settings.max_queue:
            raise refusal(
                "queue-full",
                f"{len(self._queue)} jobs are waiting, the limit of this server; try again in a few seconds.",
            )
        if item is not None and any(other.status == "running" for other in item.jobs.values()):
            job = replace(job, status="running", started=job.created)
        self.store.add(job, Work(identity, parsed.surface_id, parsed.wanted))
        self._attach(job, item, Work(identity, parsed.surface_id, parsed.wanted))
        self._log(job, "accepted")
        self._pump()
        return job

    def get(self, id: str) -> Job:
        """Raises HttpError 404."""
        item = self._live.get(id)
        job = item.jobs[id] if item else self.store.job(id)
        if job is None:
            raise not_found("job", f"No job '{id[:64]}' is kept here; it may have expired.")
        return job

    async def latest(self, limit: int, before: str | None = None) -> list[dict[str, Any]]:
        """Documents of jobs, newest first. before: only those older than this one."""
        listed = await asyncio.to_thread(self.store.jobs, limit, before)
        present = [self.get(job.id) if job.id in self._live else job for job in listed]
        return [self.document(job) for job in present]

    def position(self, job: Job) -> int | None:
        """Number of works before this one, None unless it is queued."""
        if job.status != "queued":
            return None
        return next((i for i, identity in enumerate(self._queue) if identity == job.identity), 0)

    def document(self, job: Job) -> dict[str, Any]:
        return job.document(self.position(job))

    async def wait(self, id: str, seconds: float | None) -> Job:
        """The job when it is over, or after seconds (None: however long), or when the server stops."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                while not self.get(id).is_over and not self._closing.is_set():
                    await self._event(id).wait()
        return self.get(id)

    async def changes(self, id: str, heartbeat: float) -> AsyncIterator[Job | None]:
        """The job now and after each change until it is over; None after heartbeat seconds without one."""
        while True:
            job = self.get(id)
            if job.is_over or self._closing.is_set():
                yield job
                return
            event = self._event(id)  # before the job is sent: that may take long, and the job end meanwhile
            yield job
            while True:
                try:
                    async with asyncio.timeout(heartbeat):
                        await event.wait()
                    break
                except TimeoutError:
                    yield None

    def found(self, id: str) -> list[tuple[int, dict[str, Any]]]:
        """Of an exploration that waits or runs, the variants that are known; the list grows."""
        item = self._live.get(id)
        return item.found if item else []

    async def delete(self, id: str) -> None:
        """Stop a job that waits or runs, forget one that is over."""
        job = self.get(id)
        if job.is_over:
            self.store.forget(id)
            return
        item = self._live[id]
        self._end([replace(job, status="cancelled", finished=time.time())])
        await self._give_up(item)

    async def _give_up(self, item: _Item) -> None:
        """Stop a work that nobody wants any more."""
        if item.is_wanted:
            return
        self._queue.pop(item.work.identity, None)
        if self._items.get(item.work.identity) is item:
            del self._items[item.work.identity]
        if item.task:
            item.task.cancel()
            await asyncio.wait([item.task], timeout=2.0)

    async def result(self, job: Job) -> bytes:
        """The packed Result. Raises GoneError, StorageError."""
        self._kept(job)
        if self._last[0] != job.identity:
            packed = await asyncio.to_thread(self.store.result, job.identity)
            if packed is None:
                raise GoneError
            self._last = job.identity, packed
            return packed
        return self._last[1]

    async def parts(self, job: Job, names: list[str], errand: Callable[..., Awaitable[bytes]]) -> bytes:
        """Some parts of the Result, packed. Raises GoneError, StorageError."""
        some = picked(await self.result(job), names)
        if some is not None:
            return b"".join(some)
        timings = self._kept(job).timings
        path = str(self.store.solution_path(job.identity))
        return await errand("hexwrap_server.jobs.work:result_parts", path, names, timings)

    def _kept(self, job: Job) -> Work:
        work = self.store.finished_work(job.identity)
        if work is None:
            raise GoneError
        return work

    # how works run

    def _attach(self, job: Job, item: _Item | None, work: Work) -> None:
        if item is None:
            item = _Item(work)
            self._items[work.identity] = item
            self._queue[work.identity] = item
        item.jobs[job.id] = job
        self._live[job.id] = item

    def _resume(self, job: Job) -> None:
        work = self.store.work(job.identity)
        if work is None or not self.store.has_surface(work.surface):
            lost = InternalError("What this job needs was lost while the server was down; send it again.")
            self._end([_failed(job, lost)])
        elif work.size and self.store.has_outcome(job.identity):
            self._end([_reused(job, work)])
        elif work.attempts >= MAX_ATTEMPTS:
            gave_up = AttemptsError(
                f"The server died {work.attempts} times while this job was running, so it is not tried "
                "again; make the mesh or the pattern coarser."
            )
            self._end([_failed(job, gave_up)])
        else:
            self._attach(job, self._items.get(job.identity), work)
            self._log(job, "taken up again")

    def _pump(self) -> None:
        while not self._closing.is_set():
            exploring = sum(item.explores for item in self._running)
            places = {True: EXPLORERS - exploring, False: self.at_once - (len(self._running) - exploring)}
            item = next((item for item in self._queue.values() if places[item.explores] > 0), None)
            if item is None:
                break
            del self._queue[item.work.identity]
            self._take(item)
        self._metrics.queued.set(len(self._queue))
        self._metrics.running.set(len(self._running))

    def _take(self, item: _Item) -> None:
        self._running.add(item)
        item.task = asyncio.create_task(self._run(item))
        # a task that is cancelled before its first step never comes to its own end
        item.task.add_done_callback(lambda _: self._leave(item))

    async def _run(self, item: _Item) -> None:
        identity = item.work.identity
        begun = False
        try:
            await self._engine.wait_for_place(
                self._settings.job_seconds, lambda what: self._change(item, stage=what)
            )
            await _patiently(lambda: self.store.start_work(identity))
            begun = True
            now = time.time()
            await _patiently(
                lambda: self._change(item, written=True, status="running", stage="", started=now)
            )
            outcome = await (self._explore(item) if item.explores else self._compute(item))
            if outcome.result is None and outcome.size <= AT_ONCE:
                packed = self.store.keep_outcome(identity, outcome)
            else:
                packed = await asyncio.to_thread(self.store.keep_outcome, identity, outcome)
            await _patiently(lambda: self.store.finish_work(identity, outcome))
            self._last = identity, packed
            self._end([_done(job, outcome) for job in item.jobs.values()])
            item.tell()
        except asyncio.CancelledError:
            self._take_back(item, begun)
            raise
        except HexwrapError as error:
            told_to_end = isinstance(error, (WorkerDiedError, ShuttingDownError)) and self._closing.is_set()
            if told_to_end:  # as this server was; the next one goes on with the job
                self._take_back(item, begun)
                item.tell(ShuttingDownError())
            else:
                self._fail(item, error)
        except Exception as error:
            log.exception("a job failed unexpectedly")
            fault = InternalError(f"The server could not finish the job ({type(error).__name__}: {error}).")
            self._fail(item, fault)
        finally:
            self._leave(item)

    def _leave(self, item: _Item) -> None:
        """Make room for the next work. Does no harm twice."""
        if item not in self._running:
            return
        self._running.discard(item)
        if self._items.get(item.work.identity) is item:
            del self._items[item.work.identity]
        self._pump()

    def _take_back(self, item: _Item, begun: bool) -> None:
        if begun:
            with contextlib.suppress(StorageError):  # then it counts as an attempt
                self.store.take_back(item.work.identity)

    def _fail(self, item: _Item, error: HexwrapError) -> None:
        self._settle(item.work.identity)
        item.tell(error)
        try:
            ended = [_failed(job, error) for job in item.jobs.values()]
        except Exception:  # a problem that cannot be written must not keep the jobs from ending
            log.exception("a problem cannot be written as JSON")
            fault = InternalError(
                f"The job failed, and its problem cannot be written as JSON ({error}); report it."
            )
            ended = [_failed(job, fault) for job in item.jobs.values()]
        self._end(ended)

    def _settle(self, identity: str) -> None:
        with contextlib.suppress(StorageError):  # then it counts as an attempt
            self.store.settle(identity)

    async def _compute(self, item: _Item) -> Outcome:
        def report(stage: str, fraction: float, what: str) -> None:
            self._change(item, stage=stage, progress=round(max(0.0, min(1.0, fraction)), 4))

        outcome: Outcome = await self._engine.run(
            "hexwrap_server.jobs.work:solve",
            await self._order(item.work, next(iter(item.jobs), "")),
            self.caching,
            report=report,
            seconds=self._settings.job_seconds,
            mib=self._settings.job_mib,
        )
        return outcome

    async def _explore(self, item: _Item) -> Outcome:
        jobs, work = item.jobs, item.work
        order = await self._order(work, next(iter(jobs), ""))
        start = time.monotonic()
        begun: dict[str, float] = {}

        def report(stage: str, fraction: float) -> None:
            begun.setdefault(stage, time.monotonic() - start)
            self._change(item, stage=stage, progress=round(fraction, 4))

        def found(i: int, document: dict[str, Any]) -> None:
            item.found.append((i, document))
            for id in jobs:
                self._tell(id)

        def identify(wanted: Wanted) -> Work:
            return Work(digest(service_version(), work.surface, wanted), work.surface, wanted)

        name = next((job.name for job in jobs.values()), "")
        seconds = self._settings.explore_seconds
        try:
            async with asyncio.timeout(seconds):
                outcome = await explore(self, order, name, identify, report, found)
        except TimeoutError:
            raise TimeLimitError(
                f"The exploration was stopped after {seconds:g} s, the limit of this server; ask for fewer "
                "variants, or start the server with a larger --explore-seconds."
            ) from None
        ends = [*list(begun.values())[1:], time.monotonic() - start]
        timings = {stage: end - begin for (stage, begin), end in zip(begun.items(), ends, strict=True)}
        return replace(outcome, timings=timings)

    # what an exploration needs (see ``Hands``)

    @property
    def at_once(self) -> int:
        return self._engine.capacity

    async def call(self, function: str, *arguments: Any) -> Any:
        """In a worker, beside the works that are counted."""
        return await self._engine.run(
            function,
            *arguments,
            report=nobody,
            seconds=self._settings.job_seconds,
            mib=self._settings.job_mib,
        )

    async def solved(self, work: Work) -> str:
        """The path of a work's solution, when it is finished. Raises what it ended with."""
        identity = work.identity
        if self.store.finished_work(identity) is None:
            await _patiently(lambda: self.store.add_work(work))
            item = self._items.get(identity)
            if item is None:
                item = self._items[identity] = self._queue[identity] = _Item(work)
            waiting = asyncio.get_running_loop().create_future()
            item.waiting.append(waiting)
            self._pump()
            try:
                await waiting
            finally:
                item.waiting.remove(waiting)
                await self._give_up(item)
        return str(self.store.solution_path(identity))

    async def _order(self, work: Work, job: str) -> Order:
        """Workers on this machine read and write the files themselves."""
        if self._engine.shares_disk:
            surface = str(self.store.surface_path(work.surface))
            files = (str(self.store.result_path(work.identity)), str(self.store.solution_path(work.identity)))
            return Order(work.surface, surface, work.wanted, files, job)
        data = await asyncio.to_thread(self.store.surface, work.surface)
        return Order(work.surface, data or b"", work.wanted, None, job)

    def _change(self, item: _Item, *, written: bool = False, **changes: Any) -> None:
        changed = {id: replace(job, **changes) for id, job in item.jobs.items()}
        if written:
            self.store.update(changed.values())
        item.jobs.update(changed)
        for id in changed:
            self._tell(id)

    def _end(self, jobs: list[Job]) -> None:
        """Write the end of jobs, then tell."""
        self.store.end(jobs)
        for job in jobs:
            item = self._live.pop(job.id, None)
            if item is not None:
                item.jobs.pop(job.id, None)
            self._tell(job.id)
            self._metrics.ended(job)
            self._log(job, job.status)

    def _event(self, id: str) -> asyncio.Event:
        return self._changed.setdefault(id, asyncio.Event())

    def _tell(self, id: str) -> None:
        event = self._changed.pop(id, None)
        if event:
            event.set()

    async def _prune_forever(self) -> None:
        s = self._settings
        while True:
            try:
                surfaces = await asyncio.to_thread(self.store.surface_files)
                kept = self.store.prune_rows(s.results_days, s.results_mib * MIB, surfaces)
                await asyncio.to_thread(self.store.prune_files, kept, s.cache_mib * MIB)
            except StorageError as error:
                log.error("old results cannot be pruned: %s", error)
            await asyncio.sleep(PRUNE_INTERVAL)

    async def _catch_up(self) -> None:
        while True:
            await asyncio.sleep(CATCH_UP_INTERVAL)
            self.store.catch_up()
            try:
                await asyncio.to_thread(self.store.check_point)
            except (StorageError, OSError) as error:
                log.error("the list of jobs cannot be tidied: %s", error)

    def _log(self, job: Job, what: str) -> None:
        seconds = round(job.finished - job.started, 3) if job.finished and job.started else None
        extra = {"job": job.id, "job_name": job.name, "seconds": seconds, "found": job.found}
        log.info("job %s", what, extra=extra)


async def _patiently(write: Callable[[], None]) -> None:
    """Write when whoever else holds the database lets go; requests are answered meanwhile.

    Raises StorageError after PATIENCE seconds: no job fails because somebody made a copy.
    """
    deadline = time.monotonic() + PATIENCE
    while True:
        try:
            return write()
        except BusyError:
            if time.monotonic() > deadline:
                raise
        await asyncio.sleep(BUSY_INTERVAL)


def _done(job: Job, outcome: Outcome) -> Job:
    return _ended(job, timings=outcome.timings, found=outcome.found)


def _reused(job: Job, work: Work) -> Job:
    timings, found = dict.fromkeys(work.timings, 0.0), dict.fromkeys(work.timings, "result")
    return _ended(job, started=job.created, timings=timings, found=found)


def _ended(job: Job, **changes: Any) -> Job:
    return replace(job, status="done", stage="done", progress=1.0, finished=time.time(), **changes)


def _failed(job: Job, error: HexwrapError) -> Job:
    return replace(job, status="failed", finished=time.time(), problem=plain(problem(error)))
