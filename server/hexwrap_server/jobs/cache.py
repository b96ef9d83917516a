"""Stages that need not be computed twice.

Each stage is known by the SHA-256 of the solver's version, the stage's settings and the stage before it, so
that a change asks for the stages after it alone; a stage beside the others names the one that it follows. The
stages of one worker are kept in its memory, those of all workers of a machine in a folder.
"""

from __future__ import annotations

import logging
import os
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import is_dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from hexwrap_server.errors import CodecError, StorageError
from hexwrap_server.jobs.codec import decode, digest, pieces
from hexwrap_server.jobs.disk import write_whole
from hexwrap_server.version import solver_version
from hexwrap_solver.arrays import Progress

T = TypeVar("T")
log = logging.getLogger("hexwrap.cache")

#: A stage that took so many seconds is written at once: its file takes little of that, and another worker may
#: wait for it. Those of quicker ones are written when the answer is out.
WORTH_WAITING = 0.1
#: Share of the whole work that each stage usually takes, for the progress bar.
SHARES = {
    "surface": 0.1,
    "singularities": 0.0,
    "map": 0.35,
    "pattern": 0.1,
    "fit": 0.2,
    "trade-off": 0.02,
    "panels": 0.03,
    "quality": 0.1,
    "trimmed": 0.02,
    "seats": 0.03,
    "outlook": 0.02,
    "other map": 0.03,
    "other boundary": 0.02,
    "components": 0.02,
    "support": 0.03,
}


class StageCache:
    """Finished stages by key: the recently used ones in memory, more of them in a folder."""

    def __init__(
        self,
        folder: Path | None,
        memory_bytes: int,
        later: Callable[[Callable[[], object]], object] = lambda do: do(),
    ) -> None:
        """later: takes what can wait until the answer is out."""
        self.folder = folder
        self.memory_bytes = memory_bytes
        self._later = later
        self._kept: OrderedDict[str, tuple[Any, int]] = OrderedDict()
        self._bytes = 0
        self._used: set[str] = set()  # since the last weighing

    def get(self, key: str) -> tuple[Any, str] | None:
        """The stage and where it was found (``memory`` or ``disk``), or None."""
        if key in self._kept:
            return self._again(key), "memory"
        value = self._read(key)
        if value is None:
            return None
        self._keep(key, value)
        return value, "disk"

    def remembered(self, key: str, make: Callable[[], T]) -> T:
        """What was made under that key before, if it is still in memory; it is not worth a file."""
        if key in self._kept:
            known: T = self._again(key)
            return known
        value = make()
        self._keep(key, value)
        return value

    def put(self, key: str, value: Any, seconds: float = WORTH_WAITING) -> None:
        """seconds: that it took."""
        self._keep(key, value)
        if self.folder is None:
            return
        if seconds < WORTH_WAITING:
            self._later(partial(self._write, key, value))
        else:
            self._write(key, value)

    def weigh(self) -> None:
        """Count what was used since the last time anew: stages keep what later ones derived from them."""
        self._later(self._weigh)

    def _weigh(self) -> None:
        for key in self._used:
            self._count(key, self._kept[key][0])
        self._used.clear()
        self._make_room()

    def _again(self, key: str) -> Any:
        self._used.add(key)
        self._kept.move_to_end(key)
        return self._kept[key][0]

    def _keep(self, key: str, value: Any) -> None:
        self._used.add(key)
        self._count(key, value)
        self._kept.move_to_end(key)
        self._make_room()

    def _count(self, key: str, value: Any) -> None:
        size = size_of(value)
        self._bytes += size - (self._kept[key][1] if key in self._kept else 0)
        self._kept[key] = (value, size)

    def _make_room(self) -> None:
        while self._kept and self._bytes > self.memory_bytes:
            key, (_, size) = self._kept.popitem(last=False)
            self._bytes -= size
            self._used.discard(key)

    def _read(self, key: str) -> Any:
        if self.folder is None:
            return None
        path = self._path(key)
        try:
            value = decode(path.read_bytes())
            os.utime(path)  # pruning goes by last use
        except FileNotFoundError:
            return None
        except (CodecError, OSError) as error:
            log.warning("a cached stage cannot be used: %s", error)
            return None
        return value

    def _write(self, key: str, value: Any) -> None:
        try:
            write_whole(self._path(key), pieces(value))
        except StorageError as error:  # a full disk costs speed, not the job
            log.warning("a stage could not be written to the cache: %s", error)

    def _path(self, key: str) -> Path:
        assert self.folder is not None
        return self.folder / f"{key}.stage"


class CachingRunner:
    """A StageRunner that looks every stage up first.

    timings: seconds per stage, hits included. found: per stage ``memory``, ``disk`` or ``computed``.
    """

    def __init__(self, cache: StageCache, report: Callable[[str, float, str], None]) -> None:
        self.timings: dict[str, float] = {}
        self.found: dict[str, str] = {}
        self.cache = cache
        self._report = report
        self._key = solver_version()
        self._keys: dict[str, str] = {}
        self._done = 0.0

    def __call__(
        self, stage: str, settings: Any, compute: Callable[[Progress], T], after: str | None = None
    ) -> T:
        start = time.perf_counter()
        share = SHARES.get(stage, 0.0)
        done = self._done

        def progress(fraction: float, what: str) -> None:
            self._report(stage, min(done + share * min(max(fraction, 0.0), 1.0), 1.0), what)

        key = digest(self._key if after is None else self._keys[after], stage, settings)
        self._keys[stage] = key
        if after is None:
            self._key = key
        hit = self.cache.get(key)
        if hit is None:
            progress(0.0, "")
            result = compute(progress)
            self.cache.put(key, result, time.perf_counter() - start)
            self.found[stage] = "computed"
        else:
            result, self.found[stage] = hit
        self._done = done + share
        self.timings[stage] = time.perf_counter() - start
        return result

    def remembered(self, what: str, stages: tuple[str, ...], make: Callable[[], T]) -> T:
        """What follows from a finished stage, the last of these that was run."""
        run = [self._keys[stage] for stage in stages if stage in self._keys]
        return self.cache.remembered(f"{run[-1]} {what}", make) if run else make()


def size_of(value: Any) -> int:
    """Bytes of the arrays inside a dataclass of arrays, and of those that it has derived and keeps."""
    if isinstance(value, np.ndarray):
        return value.nbytes
    if isinstance(value, bytes):
        return len(value)
    if isinstance(value, (list, tuple)):
        return sum(size_of(v) for v in value)
    if is_dataclass(value):
        return 64 + sum(size_of(v) for v in list(vars(value).values()))
    return 64
