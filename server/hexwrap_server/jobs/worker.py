"""One worker process, seen from inside (``main``) and from outside (``WorkerProcess``).

The two talk in frames (a length, then a pickle) over the worker's standard input and output. Every worker
has pipes of its own, so that one that is killed in the middle of a sentence garbles nobody else's. When the
parent dies, however it dies, the worker reads the end of its input and leaves.
"""

from __future__ import annotations

import contextlib
import gc
import logging
import os
import pickle
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from importlib import import_module
from typing import IO, Any

import psutil

from hexwrap_server import logs
from hexwrap_server.errors import InternalError, MemoryLimitError, TimeLimitError, WorkerDiedError, WorkError
from hexwrap_server.jobs.pipes import pipes_of_child, read_frame, write_frame
from hexwrap_solver.errors import HexwrapError

#: Two workers with two BLAS threads each are many times slower than with one each.
ONE_THREAD = dict.fromkeys(
    (
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "MKL_NUM_THREADS",
        "VECLIB_MAXIMUM_THREADS",
        "NUMEXPR_NUM_THREADS",
    ),
    "1",
)
#: The GNU C library gives freed memory back at once, and gets it again page by page for the next array: a
#: sixth of the time of a small job. Elsewhere these names mean nothing.
KEEP_MEMORY = {
    "MALLOC_MMAP_THRESHOLD_": str(32 * 2**20),
    "MALLOC_TRIM_THRESHOLD_": str(256 * 2**20),
    # Huge pages may have to be pieced together first, which took longer than the work in them (20 ms for the
    # factor of a map of 20,000 vertices, now and then).
    "NUMPY_MADVISE_HUGEPAGE": "0",
}
#: Seconds between two looks at a worker's memory and clock.
WATCH_INTERVAL = 0.1
#: Seconds between two progress messages of one job.
REPORT_INTERVAL = 0.05
#: What this process does when its answer is out and before it takes the next call: it only makes later calls
#: quicker, so nobody is to wait for it, and it may be lost.
AFTERWARDS: list[Callable[[], object]] = []
log = logging.getLogger("hexwrap.worker")

#: A function's name and its arguments.
Call = tuple[str, tuple[Any, ...]]
#: A function's listener: stage, fraction of the whole 0..1, a few words.
Report = Callable[[str, float, str], None]


class WorkerProcess:
    """A worker seen from its parent. All methods but ``stop`` belong to one thread."""

    def __init__(self, preload: str = "") -> None:
        self._preload = preload
        self._process: subprocess.Popen[bytes] | None = None
        self._seen: psutil.Process | None = None
        self._reason: WorkError | None = None
        self._stopped = False

    def start(self) -> None:
        """Start the process; it imports what it needs while the parent goes on."""
        paths = [os.path.abspath(p) for p in sys.path if p]
        self._stopped = False
        environment = os.environ | ONE_THREAD | KEEP_MEMORY | {"PYTHONPATH": os.pathsep.join(paths)}
        level = logging.getLevelName(log.getEffectiveLevel())
        program = "from hexwrap_server.jobs.worker import main; main()"
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", program, level, self._preload],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=environment,
        )

    def wait_ready(self) -> None:
        """Until the worker has imported everything. Raises WorkerDiedError."""
        if self._read()[0] != "ready":
            raise self._death()
        with contextlib.suppress(psutil.NoSuchProcess):
            self._seen = psutil.Process(self.pid)  # takes a millisecond, which no job is to wait for

    @property
    def pid(self) -> int:
        return self._process.pid if self._process else 0

    @property
    def is_alive(self) -> bool:
        return not self._stopped and self._process is not None and self._process.poll() is None

    def run(
        self, function: str, arguments: tuple[Any, ...], report: Report, seconds: float, mib: float
    ) -> Any:
        """Call ``module:function`` with a listener and the arguments in the worker.

        Raises what the function raised if that is a HexwrapError, or a WorkError.
        """
        self._reason = None
        done = threading.Event()
        watch = threading.Thread(target=self._watch, args=(done, seconds, mib), daemon=True)
        watch.start()
        try:
            self._write((function, arguments))
            while True:
                kind, *content = self._read()
                if kind == "progress":
                    report(*content)
                elif kind == "result":
                    return content[0]
                elif kind == "error":
                    raise content[0]
                else:
                    raise self._death()
        finally:
            done.set()
            watch.join()

    def stop(self) -> None:
        """Kill the worker at once. Safe from any thread."""
        self._stopped = True
        process = self._process
        if process is not None:
            with contextlib.suppress(OSError):
                process.kill()

    def close(self) -> None:
        """Kill the worker and leave nothing of it."""
        process = self._process
        if process is None:
            return
        self.stop()
        process.wait()
        for pipe in (process.stdin, process.stdout):
            with contextlib.suppress(OSError):
                if pipe:
                    pipe.close()
        self._process = self._seen = None

    def _watch(self, done: threading.Event, seconds: float, mib: float) -> None:
        deadline = time.monotonic() + seconds
        try:
            process = self._seen or psutil.Process(self.pid)
            used = 0.0
            while not done.wait(WATCH_INTERVAL):
                with contextlib.suppress(OSError):  # no file handle is free to look
                    used = process.memory_info().rss / 2**20
                if time.monotonic() > deadline:
                    self._reason = TimeLimitError(
                        f"The job was stopped after {seconds:g} s, the limit of this server; make the mesh "
                        "or the pattern coarser, or start the server with a larger --job-seconds."
                    )
                elif used > mib:
                    self._reason = MemoryLimitError(
                        f"The job was stopped at {used:.0f} MiB of memory, the limit of this server is "
                        f"{mib:g} MiB; make the mesh or the pattern coarser, or start the server with a "
                        "larger --job-mib."
                    )
                if self._reason:
                    self.stop()
                    return
        except psutil.NoSuchProcess:  # it ended by itself; the reader finds out
            return

    def _write(self, message: object) -> None:
        assert self._process is not None
        assert self._process.stdin is not None
        try:
            write_frame(self._process.stdin, message)
        except OSError:
            raise self._death() from None

    def _read(self) -> tuple[Any, ...]:
        assert self._process is not None
        assert self._process.stdout is not None
        return read_frame(self._process.stdout) or ("end",)

    def _death(self) -> WorkError:
        assert self._process is not None
        code = self._process.wait()
        return self._reason or WorkerDiedError(
            f"The worker process that ran the job ended unexpectedly (exit status {code}); other jobs are "
            "not affected. Send the job again; if it happens again, make the mesh or the pattern coarser.",
            data={"exit_status": code},
        )


def main() -> None:
    """The life of a worker: take a call, answer, until the parent is gone."""
    inlet, outlet = pipes_of_child()
    calls: queue.SimpleQueue[Call] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(inlet, calls), daemon=True).start()
    logs.set_up_logging(sys.argv[1])
    for module in filter(None, sys.argv[2:]):
        import_module(module)
    gc.freeze()  # half a million objects of modules need not be searched for garbage
    write_frame(outlet, ("ready",))
    while True:
        function, arguments = calls.get()
        _say(outlet, _answer(function, arguments, _reporter(outlet)))
        while AFTERWARDS:
            try:
                AFTERWARDS.pop(0)()
            except Exception:
                log.exception("a fault after the answer")


def _say(outlet: IO[bytes], answer: tuple[Any, ...]) -> None:
    try:
        write_frame(outlet, answer)
    except (TypeError, AttributeError, pickle.PicklingError) as error:
        fault = InternalError(f"The answer cannot be sent because of a fault in hexwrap: {error}.")
        write_frame(outlet, ("error", fault))


def _listen(inlet: IO[bytes], calls: queue.SimpleQueue[Call]) -> None:
    try:
        while (call := read_frame(inlet)) is not None:
            calls.put((call[0], call[1]))
    except Exception:  # such as MemoryError: nothing that comes later can be understood
        log.exception("cannot decode a message from the server")
    finally:
        os._exit(0)


def _answer(function: str, arguments: tuple[Any, ...], report: Report) -> tuple[Any, ...]:
    logs.at_work_for("")
    try:
        module, name = function.split(":")
        return "result", getattr(import_module(module), name)(report, *arguments)
    except HexwrapError as error:
        return "error", error
    except MemoryError:
        return "error", MemoryLimitError("The job ran out of memory; make the mesh or the pattern coarser.")
    except Exception as error:
        log.exception("a fault in %s", function)
        return "error", InternalError(
            f"The job failed because of a fault in hexwrap, not in the request "
            f"({type(error).__name__}: {error}); please report it together with the request."
        )


def _reporter(outlet: IO[bytes]) -> Report:
    last = ("", 0.0)

    def report(stage: str, fraction: float, what: str) -> None:
        nonlocal last
        now = time.monotonic()
        if stage != last[0] or now - last[1] >= REPORT_INTERVAL:
            last = (stage, now)
            write_frame(outlet, ("progress", stage, fraction, what))

    return report
