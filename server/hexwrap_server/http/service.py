"""All that one running server holds together: settings, store, engines, jobs."""

from __future__ import annotations

import asyncio
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import platformdirs

from hexwrap_server import __version__
from hexwrap_server.errors import HttpError, MemoryLimitError, TimeLimitError, refusal
from hexwrap_server.http.metrics import Metrics
from hexwrap_server.input.bodies import Body
from hexwrap_server.jobs.disk import make_private
from hexwrap_server.jobs.engine import Engine, ProcessEngine, nobody
from hexwrap_server.jobs.manager import JobManager
from hexwrap_server.jobs.store import Store
from hexwrap_server.settings import MIB, Settings

#: What processes for reading and errands load at their start.
ERRANDS_PRELOAD = "hexwrap_server.jobs.reading"
#: Longest errand (reading a body, writing a file), seconds.
ERRAND_SECONDS = 120.0
#: Bodies of up to this many MiB, unpacked, do not wait for larger ones and for files.
SMALL_BODY = 4.0


class Service:
    """Made with the application, started and stopped with the server."""

    def __init__(self, settings: Settings, engine: Engine | None = None) -> None:
        """Raises FolderInUseError, DamagedError, OSError."""
        self.settings = settings
        self.store = open_store(settings)
        self.metrics = Metrics()
        self.engine = engine or make_engine(settings)
        self.errands = ProcessEngine(2, ERRANDS_PRELOAD, warm=1)
        self.readers = ProcessEngine(settings.readers, ERRANDS_PRELOAD, warm=0)
        #: Those of them that are free.
        self.free_readers = asyncio.Semaphore(settings.readers)
        #: Bytes of request bodies in memory.
        self.body_bytes = 0
        self.manager = JobManager(self.store, self.engine, settings, self.metrics, self.errand)
        self._since = time.time()

    async def start(self) -> None:
        self.loop = asyncio.get_running_loop()
        await self.engine.start()
        await self.errands.start()
        await self.readers.start()
        await self.manager.start()

    def begin_to_stop(self) -> None:
        """Answer whoever waits; nothing new is begun."""
        self.manager.close_waits()
        self.errands.give_up()
        self.readers.give_up()

    async def stop(self) -> None:
        await asyncio.gather(self.manager.stop(), self.errands.stop(), self.readers.stop())
        self.store.close()

    @property
    def is_ready(self) -> bool:
        return self.engine.is_ready

    def health(self) -> dict[str, Any]:
        return {
            "status": "ok",
            "version": __version__,
            "workers": self.engine.capacity,
            "queued": self.manager.n_queued,
            "running": self.manager.n_running,
            "uptime": round(time.time() - self._since, 1),
        }

    async def errand(self, function: str, *arguments: Any) -> Any:
        """A short piece of work beside the jobs, in a process of its own."""
        return await self.errands.run(
            function, *arguments, report=nobody, seconds=ERRAND_SECONDS, mib=self.settings.job_mib
        )

    async def read(self, function: str, body: Body, *arguments: Any, is_file: bool = False) -> Any:
        """Have a body read in a process, as ``function(report, body, settings, *arguments)``.

        Raises what the function raises, TimeLimitError and MemoryLimitError; HttpError where none is free for
        as long as a reading may take.
        """
        settings = self.settings
        if not is_file and len(body.data) <= SMALL_BODY * MIB:
            small = replace(settings, max_body_mib=min(SMALL_BODY, settings.max_body_mib))
            try:
                return await self._read(self.errands, function, body, small, *arguments)
            except HttpError as error:
                if error.status != 413 or small == settings:
                    raise
        try:
            async with asyncio.timeout(settings.read_seconds):
                await self.free_readers.acquire()
        except TimeoutError:
            raise refusal(
                "too-many-bodies",
                f"Other bodies were being read for {settings.read_seconds:g} s; try again in a moment.",
            ) from None
        try:
            return await self._read(self.readers, function, body, settings, *arguments)
        finally:
            self.free_readers.release()

    async def _read(self, engine: ProcessEngine, function: str, *arguments: Any) -> Any:
        seconds, mib = self.settings.read_seconds, self.settings.read_mib
        try:
            return await engine.run(function, *arguments, report=nobody, seconds=seconds, mib=mib)
        except TimeLimitError:
            raise TimeLimitError(
                f"Reading was stopped after {seconds:g} s, the limit of this server; send a smaller or "
                "simpler body, or start the server with a larger --read-seconds."
            ) from None
        except MemoryLimitError:
            raise MemoryLimitError(
                f"Reading was stopped at {mib:g} MiB of memory, the limit of this server; send a smaller or "
                "simpler body, or start the server with a larger --read-mib."
            ) from None


def make_engine(settings: Settings) -> Engine:
    """The engine that the settings name."""
    if settings.engine == "dask":
        from hexwrap_server.jobs.dask_engine import DaskEngine  # an extra: installed only where it is used

        return DaskEngine(settings.scheduler)
    return ProcessEngine(settings.workers)


def open_store(settings: Settings) -> Store:
    """The store in ``--data``; without it, in the user's data folder.

    The port alone decides where in there: servers that start again in another order find their own jobs.
    """
    if settings.data:
        return Store(Path(settings.data))
    base = Path(platformdirs.user_data_dir("hexwrap", appauthor=False))
    make_private(base)
    return Store(base if settings.port == Settings.port else base / f"port-{settings.port}")
