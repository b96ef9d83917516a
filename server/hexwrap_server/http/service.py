"""All that one running server holds together: settings, store, engines, jobs."""

from __future__ import annotations

import asyncio
import time
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import platformdirs

from hexwrap_server import __version__
from hexwrap_server.http.metrics import Metrics
from hexwrap_server.input.requests import ParsedRequest
from hexwrap_server.jobs.disk import make_private
from hexwrap_server.jobs.engine import Engine, ProcessEngine, nobody
from hexwrap_server.jobs.manager import JobManager
from hexwrap_server.jobs.store import Store
from hexwrap_server.settings import Settings

T = TypeVar("T")

#: Longest errand (reading a body, writing a file), seconds.
ERRAND_SECONDS = 120.0
#: Bodies whose contents are remembered by their hash.
KNOWN_BODIES = 256


class Service:
    """Made with the application, started and stopped with the server."""

    def __init__(self, settings: Settings, engine: Engine | None = None) -> None:
        """Raises FolderInUseError, DamagedError, OSError."""
        self.settings = settings
        self.store = open_store(settings)
        self.metrics = Metrics()
        self.engine = engine or make_engine(settings)
        self.errands = ProcessEngine(2)
        self._one_reading = asyncio.Semaphore(1)
        self.manager = JobManager(self.store, self.engine, settings, self.metrics)
        self._reader = ThreadPoolExecutor(1, thread_name_prefix="hexwrap-reader")
        self._known_bodies: OrderedDict[str, ParsedRequest] = OrderedDict()
        self._since = time.time()

    async def start(self) -> None:
        await self.engine.start()
        await self.errands.start()
        await self.manager.start()

    async def stop(self) -> None:
        await asyncio.gather(self.manager.stop(), self.errands.stop())
        self._reader.shutdown()
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

    async def reading(self, function: str, *arguments: Any) -> Any:
        """An errand that reads what may be large: one at a time, so that the short ones need not wait."""
        async with self._one_reading:
            return await self.errand(function, *arguments)

    async def read(self, function: Callable[..., T], *arguments: Any) -> T:
        """Read a body in the one thread for it: several would keep the event loop from its turn."""
        return await asyncio.get_running_loop().run_in_executor(self._reader, function, *arguments)

    def known_body(self, mark: str) -> ParsedRequest | None:
        """What was read from the same bytes before, if its surface is still kept."""
        known = self._known_bodies.get(mark)
        if known is None or not self.store.has_surface(known.surface_id):
            return None
        self._known_bodies.move_to_end(mark)
        return known

    def remember_body(self, mark: str, parsed: ParsedRequest) -> ParsedRequest:
        """The surface itself is on disk; only what points to it is remembered."""
        light = replace(parsed, surface=None)
        self._known_bodies[mark] = light
        while len(self._known_bodies) > KNOWN_BODIES:
            self._known_bodies.popitem(last=False)
        return light


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
