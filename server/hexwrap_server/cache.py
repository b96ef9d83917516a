"""Stages that need not be computed twice.

Each stage is known by the SHA-256 of the solver's version, the stage's settings and the stage before it. The
stages of one worker are kept in its memory, those of all workers of a machine in a folder.
"""

from __future__ import annotations

import contextlib
import logging
import os
import time
import uuid
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from hexwrap_server.codec import CodecError, decode, digest, encode
from hexwrap_server.version import solver_version
from hexwrap_solver.arrays import Progress

T = TypeVar("T")
log = logging.getLogger("hexwrap.cache")

#: Share of the whole work that each stage usually takes, for the progress bar.
SHARES = {
    "surface": 0.1,
    "map": 0.35,
    "pattern": 0.1,
    "fit": 0.2,
    "panels": 0.05,
    "quality": 0.15,
    "components": 0.02,
    "support": 0.03,
}


#: Seconds for which pruning leaves a file alone.
YOUNG = 300.0


class StageCache:
    """Finished stages by key: the recently used ones in memory, more of them in a folder."""

    def __init__(self, folder: Path | None, memory_bytes: int) -> None:
        self.folder = folder
        self.memory_bytes = memory_bytes
        self._kept: OrderedDict[str, tuple[Any, int]] = OrderedDict()
        self._used = 0
        # beside the next stage; one thread, so that stages do not pile up in memory
        self._writer = ThreadPoolExecutor(1, thread_name_prefix="hexwrap-cache")

    def get(self, key: str) -> tuple[Any, str] | None:
        """The stage and where it was found (``memory`` or ``disk``), or None."""
        if key in self._kept:
            self._kept.move_to_end(key)
            return self._kept[key][0], "memory"
        value = self._read(key)
        if value is None:
            return None
        self._keep(key, value)
        return value, "disk"

    def put(self, key: str, value: Any) -> None:
        self._keep(key, value)
        if self.folder is not None:
            self._writer.submit(self._write, key, value)

    def settle(self) -> None:
        """Until everything that was put is on the disk."""
        self._writer.submit(int).result()

    def _write(self, key: str, value: Any) -> None:
        try:
            path = self._path(key)
            path.parent.mkdir(parents=True, exist_ok=True)
            write_whole(path, encode(value))
        except OSError as error:  # a full disk costs speed, not the job
            log.warning("a stage could not be written to the cache: %s", error)

    def _keep(self, key: str, value: Any) -> None:
        size = size_of(value)
        self._kept[key] = (value, size)
        self._used += size
        while self._used > self.memory_bytes and self._kept:
            self._used -= self._kept.popitem(last=False)[1][1]

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
        self._done = 0.0

    def __call__(self, stage: str, settings: Any, compute: Callable[[Progress], T]) -> T:
        start = time.perf_counter()
        share = SHARES.get(stage, 0.0)
        done = self._done

        def progress(fraction: float, what: str) -> None:
            self._report(stage, min(done + share * min(max(fraction, 0.0), 1.0), 1.0), what)

        progress(0.0, "")
        self._key = digest(self._key, stage, settings)
        hit = self.cache.get(self._key)
        if hit is None:
            result = compute(progress)
            self.cache.put(self._key, result)
            self.found[stage] = "computed"
        else:
            result, self.found[stage] = hit
        self._done = done + share
        self.timings[stage] = time.perf_counter() - start
        return result


def size_of(value: Any) -> int:
    """Bytes of the arrays inside a dataclass of arrays."""
    if isinstance(value, np.ndarray):
        return value.nbytes
    if isinstance(value, (list, tuple)):
        return sum(size_of(v) for v in value)
    if is_dataclass(value):
        return 64 + sum(size_of(getattr(value, f.name)) for f in fields(value))
    return 64


def write_whole(path: Path, data: bytes) -> None:
    """Write a file that other processes see whole or not at all. Raises OSError."""
    part = path.with_name(f"{path.name}.{uuid.uuid4().hex}.part")
    try:
        part.write_bytes(data)
        os.replace(part, path)
    except OSError:
        with contextlib.suppress(OSError):
            part.unlink()
        raise


def prune(folder: Path, limit_bytes: float, keep: Callable[[str], bool] = lambda name: False) -> None:
    """Delete the longest unused files until the rest fits into limit_bytes.

    keep: names that stay. Files of the last minutes stay too: their owner may be about to name them.
    """
    entries = []
    total = 0
    for path in folder.glob("*"):
        with contextlib.suppress(OSError):
            state = path.stat()
            if not keep(path.name):
                entries.append((state.st_mtime, state.st_size, path))
                total += state.st_size
    for used, size, path in sorted(entries):
        if total <= limit_bytes or used > time.time() - YOUNG:
            break
        with contextlib.suppress(OSError):  # in use, on Windows
            path.unlink()
            total -= size
