"""A process beside each worker that writes results as text while the worker computes.

Writing numbers as text holds the interpreter, so that in a thread of the worker it takes its time from the
stages. The worker sends each finished stage through a pipe, and gets back where the parts of the text stand.
When the worker dies, however it dies, the scribe leaves (see ``scribe_main``); when the scribe dies, the
worker writes by itself.
"""

from __future__ import annotations

import contextlib
import logging
import subprocess
import sys
import threading
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from types import TracebackType
from typing import Any, cast

from hexwrap_server.jobs import codec
from hexwrap_server.jobs.pipes import read_frame, write_frame
from hexwrap_server.jobs.writing import Here, Written
from hexwrap_solver.errors import HexwrapError
from hexwrap_solver.pipeline import Solution

#: Stages whose values are written.
WRITTEN = ("surface", "map", "pattern", "panels")
log = logging.getLogger("hexwrap.scribe")


class Scribe:
    """The process, seen from its worker."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._ready = threading.Event()
        self._sender = ThreadPoolExecutor(1, thread_name_prefix="hexwrap-scribe")

    @property
    def is_ready(self) -> bool:
        return self._ready.is_set()

    def start(self) -> None:
        """Start it, if it was not; it imports what it needs while the worker goes on."""
        if self._process is not None:
            return
        level = logging.getLevelName(log.getEffectiveLevel())
        program = "from hexwrap_server.jobs.scribe_main import main; main()"
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", program, level], stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        threading.Thread(target=self._welcome, daemon=True).start()

    def give_up(self) -> None:
        """Do without it from now on."""
        self._ready.clear()
        process = self._process
        if process is None:
            return
        process.kill()
        process.wait()
        self._sender.shutdown(cancel_futures=True)
        for pipe in (process.stdin, process.stdout):
            with contextlib.suppress(OSError):
                if pipe:
                    pipe.close()

    def send(self, kind: str, name: Any = None, value: Any = None) -> Future[None]:
        """In a thread: the pipe may have to wait for the scribe."""
        return self._sender.submit(self._send, kind, name, value)

    def answer(self) -> tuple[Any, ...] | None:
        """Its next answer; None: there will be none."""
        assert self._process is not None
        assert self._process.stdout is not None
        return read_frame(self._process.stdout)

    def _send(self, kind: str, name: Any, value: Any) -> None:
        assert self._process is not None
        assert self._process.stdin is not None
        pipe = self._process.stdin
        pieces = [] if value is None else codec.pieces(value)
        write_frame(pipe, (kind, name, sum(map(len, pieces))))
        for piece in pieces:
            pipe.write(piece)
        pipe.flush()

    def _welcome(self) -> None:
        if self.answer() == ("ready",):
            self._ready.set()


class There:
    """A Writer that leaves the writing to the scribe."""

    def __init__(self, scribe: Scribe) -> None:
        self._scribe = scribe
        self._sent = [scribe.send("begin")]
        self._surface: Any = None
        self._all: tuple[Solution, dict[str, float]] | None = None

    def __enter__(self) -> There:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._scribe.is_ready:
            self._scribe.send("begin")  # nothing of this job is needed any more

    def made(self, stage: str, value: Any) -> None:
        if stage == "surface":
            self._surface = value
        if stage == "map" and value.surface is self._surface:  # it has that already
            value = replace(value, surface=cast(Any, None))
        if stage in WRITTEN:
            self._sent.append(self._scribe.send("stage", stage, value))

    def rest(self, solution: Solution, timings: dict[str, float]) -> None:
        self._all = solution, timings
        other = (solution.quality, solution.components, solution.support, timings)
        self._sent.append(self._scribe.send("rest", None, other))

    def finish(self, path: str | None) -> Written:
        self._sent.append(self._scribe.send("finish", path))
        try:
            for sent in self._sent:
                sent.result()
            kind, content = self._scribe.answer() or ("died", "")
        except Exception as error:  # an answer that nobody reads would be taken for that of a later job
            kind, content = "died", str(error)
        if kind == "written":
            return cast(Written, content)
        if isinstance(content, HexwrapError):
            raise content
        log.warning("the scribe %s %s; the worker writes by itself", kind, content)
        if kind == "died":
            self._scribe.give_up()
        assert self._all is not None
        with Here() as writer:
            writer.rest(*self._all)
            return writer.finish(path)


class Desk:
    """What the scribe has of a job. The first fault is told at its end."""

    def __init__(self) -> None:
        self._writer = Here()
        self._known: dict[str, Any] = {}
        self._fault: Exception | None = None

    def do(self, kind: str, name: Any, data: bytes) -> tuple[str, Any] | None:
        if kind == "begin":
            self._writer.__exit__(None, None, None)
            self.__init__()  # type: ignore[misc]
            return None
        try:
            if self._fault is None:
                return self._done(kind, name, data)
        except Exception as error:
            self._fault = error
        if kind != "finish":
            return None
        if isinstance(self._fault, HexwrapError):
            return "refused", self._fault
        return "failed", f"{type(self._fault).__name__}: {self._fault}"

    def _done(self, kind: str, name: Any, data: bytes) -> tuple[str, Any] | None:
        known = self._known
        if kind == "stage":
            value = codec.decode(data)
            if name == "map" and value.surface is None:
                value = replace(value, surface=known["surface"])
            known[name] = value
            self._writer.made(name, value)
        elif kind == "rest":
            quality, components, support, timings = codec.decode(data)
            solution = Solution(
                known["map"], quality, known.get("pattern"), known.get("panels"), components, support
            )
            self._writer.rest(solution, timings)
        else:
            return "written", self._writer.finish(name)
        return None
